"""The value of a problem from its text alone, by the pages on the language and the semantics.

It shares nothing with the package: it splits a text into parentheses and words, interprets what they say
without naming or grounding anything first, and finds the best probability of each state by iteration. For
small problems only; templates are passed over, since they change nothing that is possible.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import Any, TypeAlias

import numpy as np
from typing_extensions import Self

Form: TypeAlias = Any
"""A word, or a list of forms."""
Fact = tuple[str, ...]
World = Mapping[Fact, int]
"""The value of each fact that is not false: 2 is true, 1 unknown."""
State = frozenset[tuple[Fact, int]]
Change = dict[Fact, int]
Binding = dict[str, str]
Draws = list[tuple[Fraction, Change, Fraction]]
"""What may happen: with its probability, and what it adds to the cost."""
Result: TypeAlias = tuple[Fraction, dict[State, Fraction]]
_MOST_DRAWS = 1000
_MOST_STATES = 300
_NOTHING: Draws = [(Fraction(1), {}, Fraction(0))]


class TooLarge(Exception):
    """The problem has more states, or an effect more outcomes, than are worth a test."""


def forms(text: str) -> list[Form]:
    """What a text says, in lower case."""
    stack: list[list[Form]] = [[]]
    for word in re.findall(r"[()]|\??[^\s()?]+", re.sub(r";.*", "", text).lower()):
        if word == "(":
            stack.append([])
        elif word == ")":
            stack[-2].append(stack.pop())
        else:
            stack[-1].append(word)
    return stack[0]


def typed(words: Iterable[Form], default: str = "object") -> dict[str, set[str]]:
    """The names of a typed list with the types of each."""
    found: dict[str, set[str]] = {}
    waiting: list[str] = []
    rest = iter(words)
    for word in rest:
        if word == "-":
            kinds = next(rest)
            for name in waiting:
                found.setdefault(name, set()).update([kinds] if isinstance(kinds, str) else kinds[1:])
            waiting = []
        else:
            waiting.append(word)
    return {**found, **{name: {default} for name in waiting}}


def _fact(form: Form, bound: Mapping[str, str]) -> Fact:
    return (form,) if isinstance(form, str) else (form[0], *(bound.get(word, word) for word in form[1:]))


def _fields(section: list[Form]) -> dict[str, Form]:
    return dict(zip(section[::2], section[1::2], strict=True))


@dataclass
class Lifted:
    """The domain and the problem of a text."""

    types: dict[str, set[str]] = field(default_factory=dict)
    objects: dict[str, set[str]] = field(default_factory=dict)
    predicates: dict[str, dict[str, set[str]]] = field(default_factory=dict)
    external: set[str] = field(default_factory=set)
    functions: set[str] = field(default_factory=set)
    actions: list[dict[str, Form]] = field(default_factory=list)
    events: list[dict[str, Form]] = field(default_factory=list)
    watched: set[Fact] = field(default_factory=set)
    """Facts that events must never set to different values at once."""
    rules: list[tuple[Form, dict[str, set[str]], Form]] = field(default_factory=list)
    init: list[Form] = field(default_factory=list)
    goal: Form = ""
    cost: str = "total-cost"
    _worlds: dict[State, World] = field(default_factory=dict)

    @classmethod
    def of(cls, text: str) -> Self:
        """Read a text."""
        self = cls()
        for head, *rest in (section for definition in forms(text) for section in definition[2:]):
            match head:
                case ":types":
                    self.types.update(typed(rest))
                case ":constants" | ":objects":
                    self.objects.update(typed(rest))
                case ":predicates":
                    for each in rest:
                        self.external.update([each[1][0]] if each[0] == "external" else [])
                        name, *parameters = each[1] if each[0] == "external" else each
                        self.predicates[name] = typed(parameters)
                case ":functions":
                    self.functions.update(function[0] for function in rest)
                case ":action":
                    self.actions.append({":name": rest[0], **_fields(rest[1:])})
                case ":exogenous":
                    self.events.append({":name": rest[0], **_fields(rest[1:])})
                case ":derived":
                    name, *parameters = rest[0]
                    self.rules.append(([name, *typed(parameters)], typed(parameters), rest[1]))
                case ":axiom":
                    given = _fields(rest)
                    self.rules.append((given[":implies"], typed(given[":vars"]), given[":context"]))
                case ":init":
                    self.init = rest
                case ":goal":
                    self.goal = rest[0]
                case ":metric":
                    self.cost = rest[1][0]
                case _:
                    pass
        return self

    # --- types ---------------------------------------------------------------------------

    def members(self, types: set[str]) -> list[str]:
        """The objects of some of the types."""

        def fits(given: set[str]) -> bool:
            return bool(given & types) or any(fits(self.types.get(name, set())) for name in given)

        return [name for name, given in self.objects.items() if "object" in types or fits(given)]

    def bindings(self, parameters: dict[str, set[str]], around: Mapping[str, str]) -> Iterator[Binding]:
        """Every way to bind the parameters, with what is bound around them."""
        for row in product(*(self.members(types) for types in parameters.values())):
            yield {**around, **dict(zip(parameters, row, strict=True))}

    # --- conditions and effects ------------------------------------------------------------

    def value(self, form: Form, bound: Mapping[str, str], world: World) -> int:
        """The Kleene value of a condition."""
        match form:
            case [] | ["and"]:
                return 2
            case ["and", *parts]:
                return min(self.value(part, bound, world) for part in parts)
            case ["or", *parts]:
                return max((self.value(part, bound, world) for part in parts), default=0)
            case ["not", part]:
                return 2 - self.value(part, bound, world)
            case ["imply", premise, conclusion]:
                return max(2 - self.value(premise, bound, world), self.value(conclusion, bound, world))
            case ["=", left, right]:
                return 2 if bound.get(left, left) == bound.get(right, right) else 0
            case ["forall" | "exists" as kind, parameters, part]:
                every = [self.value(part, each, world) for each in self.bindings(typed(parameters), bound)]
                return min(every, default=2) if kind == "forall" else max(every, default=0)
            case ["unknown" | "known" as kind, part] if not self.is_fact(form):
                unknown = world.get(_fact(part, bound), 0) == 1
                return 2 if unknown == (kind == "unknown") else 0
            case _:
                return world.get(_fact(form, bound), 0)

    def is_fact(self, form: Form) -> bool:
        """Is ``(known a)`` a fact? It is where a predicate of that name has one argument; what stands in
        parentheses of its own is never an argument."""
        return isinstance(form[1], str) and (form[1][0] == "?" or len(self.predicates.get(form[0], ())) == 1)

    def effect(self, form: Form, bound: Mapping[str, str], world: World) -> Draws:
        """What an effect may do; its conditions are read in ``world``."""
        match form:
            case []:
                return _NOTHING
            case ["and", *parts]:
                return _together(self.effect(part, bound, world) for part in parts)
            case ["forall", parameters, part]:
                every = self.bindings(typed(parameters), bound)
                return _together(self.effect(part, each, world) for each in every)
            case ["when", condition, part]:
                met = self.value(condition, bound, world) == 2
                return self.effect(part, bound, world) if met else _NOTHING
            case ["probabilistic", *branches]:
                shares = [Fraction(share) for share in branches[::2]]
                rest = 1 - sum(shares)
                return _merged(
                    (share * p, change, cost)
                    for share, part in zip([*shares, rest], [*branches[1::2], []], strict=True)
                    for p, change, cost in self.effect(part, bound, world)
                )
            case ["oneof", *parts]:
                drawn = (each for part in parts for each in self.effect(part, bound, world))
                return _merged((p / len(parts), change, cost) for p, change, cost in drawn)
            case ["increase", [fluent], amount]:
                return [(Fraction(1), {}, self.number(amount, bound) * (fluent == self.cost))]
            case ["not", part]:
                return [(Fraction(1), {_fact(part, bound): 0}, Fraction(0))]
            case ["unknown", part] if not self.is_fact(form):
                return [(Fraction(1), {_fact(part, bound): 1}, Fraction(0))]
            case _:
                return [(Fraction(1), {_fact(form, bound): 2}, Fraction(0))]

    def met(self, form: Form, bound: Mapping[str, str], world: World) -> Iterator[bool]:
        """Whether the conditions in an effect are met, all that :meth:`effect` reads of the world."""
        parts: Iterable[Form] = ()
        match form:
            case ["and" | "oneof", *parts]:
                pass
            case ["probabilistic", *branches]:
                parts = branches[1::2]
            case ["forall", parameters, part]:
                for each in self.bindings(typed(parameters), bound):
                    yield from self.met(part, each, world)
            case ["when", condition, part]:
                yield (known := self.value(condition, bound, world) == 2)
                parts = [part] if known else []
            case _:
                pass
        for part in parts:
            yield from self.met(part, bound, world)

    def number(self, form: Form, bound: Mapping[str, str]) -> Fraction:
        """A number, or what ``:init`` gives as the value of a function."""
        if isinstance(form, str):
            return Fraction(form)
        if form[0] in {"+", "*"}:
            left, right = (self.number(part, bound) for part in form[1:])
            return left + right if form[0] == "+" else left * right
        wanted = _fact(form, bound)
        given = (each for each in self.init if each[0] == "=")
        return next(Fraction(amount) for _, function, amount in given if _fact(function, {}) == wanted)

    @cached_property
    def strata(self) -> list[set[str]]:
        """The predicates of rules, those first that others read under a negation or a test."""
        level = dict.fromkeys((head[0] for head, _, _ in self.rules), 0)
        for _ in range(len(level) * len(level)):
            for head, _, condition in self.rules:
                for name, growing in self.reads(condition):
                    if name in level:
                        level[head[0]] = max(level[head[0]], level[name] + (not growing))
        return [{name for name in level if level[name] == each} for each in sorted({*level.values()})]

    def reads(self, form: Form, growing: bool = True) -> Iterator[tuple[str, bool]]:
        """The predicates in a condition, and whether the condition grows with them."""
        match form:
            case ["and" | "or", *parts]:
                for part in parts:
                    yield from self.reads(part, growing)
            case ["not", part]:
                yield from self.reads(part, not growing)
            case ["imply", premise, conclusion]:
                yield from self.reads(premise, not growing)
                yield from self.reads(conclusion, growing)
            case ["forall" | "exists", _, part]:
                yield from self.reads(part, growing)
            case ["unknown" | "known", part] if not self.is_fact(form):
                yield _fact(part, {})[0], False
            case [str(name), *_] | str(name):
                yield name, growing
            case _:
                return

    @cached_property
    def instances(self) -> list[list[tuple[Fact, Form, Binding]]]:
        """The rules of each stratum for all arguments: the fact, and the condition with its binding."""
        return [
            [
                (_fact(head, bound), condition, bound)
                for head, parameters, condition in self.rules
                if head[0] in names
                for bound in self.bindings(parameters, {})
            ]
            for names in self.strata
        ]

    def derived(self, state: State) -> dict[Fact, int]:
        """The world of a state: derived facts have the values of the least fixpoint, where all of them are
        false at first and false < unknown < true."""
        world = dict(state)
        for rules in self.instances:
            while True:
                values = [(fact, self.value(condition, bound, world)) for fact, condition, bound in rules]
                risen = [(fact, value) for fact, value in values if value > world.get(fact, 0)]
                for fact, value in risen:
                    world[fact] = max(value, world.get(fact, 0))
                if not risen:
                    break
        return world

    # --- the process -------------------------------------------------------------------------

    def start(self) -> dict[State, Fraction]:
        """The initial states; what is drawn takes the place of what is given."""
        drawn = [each for each in self.init if each[0] in {"probabilistic", "forall"}]
        given = [each for each in self.init if each[0] != "=" and each not in drawn]
        ((_, facts, _),) = _together(self.effect(each, {}, {}) for each in given)
        return _states((p, {**facts, **change}) for p, change, _ in self.effect(["and", *drawn], {}, {}))

    @cached_property
    def counts(self) -> bool:
        """Whether an action costs what it adds to the fluent, and not 1."""
        return self.cost in self.functions or f"'{self.cost}'" in str(self.actions)

    @cached_property
    def moves(self) -> dict[str, Move]:
        """Every action with arguments, by its name."""
        return {
            f"{action[':name']}({','.join(bound.values())})": Move(
                ["and", action.get(":precondition", []), action.get(":while", [])],
                action.get(":effect", []),
                bound,
                action.get(":while"),
                action.get(":on-abort", []),
                action.get(":duration", "0"),
            )
            for action in self.actions
            for bound in self.bindings(typed(action.get(":parameters", [])), {})
        }

    def after(self, move: Move, state: State) -> Result:
        """What an action costs on average, and what it leads to; remembered."""
        if state not in move.results:
            world = self.world(state)
            met = tuple(self.met(move.effect, move.bound, world))
            if met not in move.draws:
                move.draws[met] = self.effect(move.effect, move.bound, world)
            draws = move.draws[met]
            cost = sum((p * c for p, _, c in draws), Fraction(0)) if self.counts else Fraction(1)
            facts = dict(state)
            move.results[state] = cost, _states((p, {**facts, **change}) for p, change, _ in draws)
            if self.events:
                move.results[state] = self.with_events(move, state, move.results[state])
        return move.results[state]

    def with_events(self, move: Move, state: State, alone: Result) -> Result:
        """What an action costs on average and leads to, with what happens by itself."""
        if move.during is None:
            cost, states = alone
            found = self.happening(states, move.takes)
            return cost + found[0] * self.counts, found[1]
        cost, states = self.happening({state: Fraction(1)}, move.takes)
        total = cost * self.counts + (0 if self.counts else 1)
        after: dict[State, Fraction] = {}
        for each, p in states.items():
            world = self.world(each)
            going_on = self.value(move.during, move.bound, world) == 2
            effect = move.effect if going_on else move.abort
            for q, change, more in self.effect(effect, move.bound, world):
                total += p * q * more * self.counts
                for follower, r in _states([(Fraction(1), {**dict(each), **change})]).items():
                    after[follower] = after.get(follower, Fraction(0)) + p * q * r
        return total, after

    def happening(self, states: dict[State, Fraction], takes: Form) -> Result:
        """What events cost on average, and what they make of some states, in the time of an action."""
        total = Fraction(0)
        for events in self.rounds:
            after: dict[State, Fraction] = {}
            for state, p in states.items():
                world, facts = self.world(state), dict(state)
                due = [
                    self.effect(_in_time(event, takes), bound, world)
                    for event in events
                    for bound in self.bindings(typed(event.get(":parameters", [])), {})
                    if self.value(event.get(":precondition", []), bound, world) == 2
                ]
                for number, one in enumerate(due):
                    for other in due[:number]:
                        clash = _contradicting(one, other) & self.watched
                        assert not clash, f"events contradict each other: {clash}"
                for q, change, cost in _together(due):
                    total += p * q * cost
                    for follower, r in _states([(Fraction(1), {**facts, **change})]).items():
                        after[follower] = after.get(follower, Fraction(0)) + p * q * r
            states = after
        return total, states

    @cached_property
    def rounds(self) -> list[list[dict[str, Form]]]:
        """The events that happen at once, those first that others wait for."""
        left, found = list(self.events), []
        while left:
            later = {name for event in left for name in _listed(event.get(":before", []))}
            found.append([event for event in left if event[":name"] not in later])
            left = [event for event in left if event[":name"] in later]
        return found

    def world(self, state: State) -> World:
        """:meth:`derived`, remembered."""
        if state not in self._worlds:
            self._worlds[state] = self.derived(state)
        return self._worlds[state]

    @cached_property
    def space(self) -> Space:
        """Every state that may be reached, with what each action that may start costs on average and
        leads to; where the goal is true, none does."""
        start = self.start()
        number = {state: place for place, state in enumerate(start)}
        states, choices, goals = list(number), [], []
        for state in states:
            world = self.world(state)
            own: list[tuple[Fraction, list[tuple[int, Fraction]]]] = []
            goals.append(self.value(self.goal, {}, world) == 2)
            choices.append(own)
            for move in () if goals[-1] else self.moves.values():
                if self.value(move.needs, move.bound, world) == 2:
                    cost, found = self.after(move, state)
                    for each in found:
                        if each not in number:
                            number[each] = len(states)
                            states.append(each)
                    own.append((cost, [(number[each], p) for each, p in found.items()]))
                if len(states) > _MOST_STATES:
                    raise TooLarge
        return Space(goals, [(number[state], p) for state, p in start.items()], choices)


@dataclass
class Move:
    """An action with arguments; its draws, by which of its conditions are met."""

    needs: Form
    effect: Form
    bound: Binding
    during: Form | None = None
    abort: Form = ""
    takes: Form = "0"
    draws: dict[tuple[bool, ...], Draws] = field(default_factory=dict)
    results: dict[State, Result] = field(default_factory=dict)


class Space:
    """The states by number: where the goal is true, where it starts, and what may be done."""

    def __init__(
        self,
        goals: list[bool],
        start: list[tuple[int, Fraction]],
        choices: list[list[tuple[Fraction, list[tuple[int, Fraction]]]]],
    ) -> None:
        self.goals, self.start, self.choices = goals, start, choices
        # The same in flat arrays: the successors of all choices, the choices of all states that have some.
        self._acting = np.array([number for number, each in enumerate(choices) if each], dtype=np.intp)
        flat = [choice for each in choices for choice in each]
        self._owners = np.array([n for n, each in enumerate(choices) for _ in each], dtype=np.intp)
        self._costs = np.array([float(cost) for cost, _ in flat])
        self._after = np.array([state for _, after in flat for state, _ in after], dtype=np.intp)
        self._chances = np.array([float(p) for _, after in flat for _, p in after])
        self._first_after = _firsts([len(after) for _, after in flat])
        self._first_choice = _firsts([len(each) for each in choices if each])

    def _expected(self, values: np.ndarray) -> np.ndarray:
        """The expected value after each choice."""
        return np.add.reduceat(self._chances * values[self._after], self._first_after)

    def mean(self, values: list[Any]) -> Any:
        """The expected value at the start."""
        return sum(p * values[state] for state, p in self.start)

    def within(self, *budgets: int) -> list[Fraction]:
        """The best probability of reaching the goal with so many actions, for each of these numbers."""
        best, found = [Fraction(goal) for goal in self.goals], {}
        for steps in range(max(budgets) + 1):
            found[steps] = Fraction(self.mean(best))
            best = [
                max([value, *(sum((p * best[s] for s, p in after), Fraction(0)) for _, after in choices)])
                for value, choices in zip(best, self.choices, strict=True)
            ]
        return [found[steps] for steps in budgets]

    @cached_property
    def best(self) -> list[float]:
        """The best probability of ever reaching the goal from each state, to 1e-9 or so."""
        best = np.array(self.goals, dtype=float)
        acting, moved = self._acting, 1.0 if len(self._acting) else 0.0
        while moved > 1e-14:
            found = np.maximum(best[acting], np.maximum.reduceat(self._expected(best), self._first_choice))
            moved = float((found - best[acting]).max())
            best[acting] = found
        values: list[float] = best.tolist()
        return values

    def least_cost(self) -> float | None:
        """The least cost of reaching the goal as probably as possible, or of ending where it is out of
        reach; None where actions may cost nothing."""
        best, cost = np.array(self.best), np.zeros(len(self.goals))
        if not len(self._acting):
            return 0.0
        matter = best[self._owners] > 0
        if (matter & (self._costs <= 0)).any():
            return None
        best_ones = self._expected(best) > best[self._owners] - 1e-9
        acting, moved = self._acting[best[self._acting] > 0], 1.0 if (best[self._acting] > 0).any() else 0.0
        while moved > 1e-12:
            each = np.where(best_ones, self._costs + self._expected(cost), np.inf)
            found = np.minimum.reduceat(each, self._first_choice)[best[self._acting] > 0]
            moved = float((abs(found - cost[acting]) / (1 + found)).max())
            cost[acting] = found
        return float(self.mean(cost.tolist()))


def _firsts(lengths: list[int]) -> np.ndarray:
    """Where each of some parts of such lengths begins, laid end to end."""
    return np.cumsum([0, *lengths])[:-1]


def _together(parts: Iterable[Draws]) -> Draws:
    """All of them, drawn independently; of two values for a fact the greater stays."""
    result = _NOTHING
    for part in parts:
        if part == _NOTHING:
            continue
        if len(result) * len(part) > _MOST_DRAWS:
            raise TooLarge
        joined = [
            (p * q, {**one, **{fact: max(v, one.get(fact, v)) for fact, v in other.items()}}, c + d)
            for (p, one, c), (q, other, d) in product(result, part)
        ]
        result = joined if len(joined) == 1 else _merged(joined)
    return result


def _in_time(event: dict[str, Form], takes: Form) -> Form:
    """The effect of an event in the time of an action; of one by the second, with what it comes to."""
    if event.get(":per") != "second":
        return event[":effect"]

    def scaled(form: Form) -> Form:
        match form:
            case ["probabilistic", chance, effect]:
                return ["probabilistic", str(_meanwhile(Fraction(chance), takes)), effect]
            case ["and", *parts]:
                return ["and", *map(scaled, parts)]
            case ["forall", parameters, part]:
                return ["forall", parameters, scaled(part)]
            case ["when", condition, part]:
                return ["when", condition, scaled(part)]
            case _:
                return ["probabilistic", str(_meanwhile(Fraction(1), takes)), form] if form else form

    return scaled(event[":effect"])


_PARTS = 20_000


def _meanwhile(chance: Fraction, takes: Form) -> Fraction:
    """How probably it happens in some time, by the midpoint rule over the quantiles of it."""
    match takes:
        case str(seconds):
            times = [float(Fraction(seconds))]
        case ["uniform", low, high]:
            times = [float(low) + (float(high) - float(low)) * (n + 0.5) / _PARTS for n in range(_PARTS)]
        case ["triangular", low, mode, high]:
            times = [_triangle((n + 0.5) / _PARTS, *map(float, (low, mode, high))) for n in range(_PARTS)]
        case ["empirical", *points]:
            assert len({weight for _, weight in points}) == 1
            times = [float(seconds) for seconds, _ in points]
        case _:
            raise ValueError(takes)
    never = sum((1 - float(chance)) ** time for time in times) / len(times)
    return Fraction(round((1 - never) * 10**12), 10**12)


def _triangle(share: float, low: float, mode: float, high: float) -> float:
    """The quantile of a triangular distribution."""
    turn = (mode - low) / (high - low)
    if share < turn:
        return low + float((share * (high - low) * (mode - low)) ** 0.5)
    return high - float(((1 - share) * (high - low) * (high - mode)) ** 0.5)


def _contradicting(one: Draws, other: Draws) -> set[Fact]:
    """The facts that two draws may set to different values."""
    return {
        fact
        for (_, first, _), (_, second, _) in product(one, other)
        for fact, value in first.items()
        if second.get(fact, value) != value
    }


def _listed(names: Form) -> list[str]:
    return [names] if isinstance(names, str) else list(names)


def _merged(draws: Iterable[tuple[Fraction, Change, Fraction]]) -> Draws:
    found: dict[tuple[State, Fraction], Fraction] = {}
    for p, change, cost in draws:
        if p:
            key = frozenset(change.items()), cost
            found[key] = found[key] + p if key in found else p
    return [(p, dict(change), cost) for (change, cost), p in found.items()]


def _states(worlds: Iterable[tuple[Fraction, World]]) -> dict[State, Fraction]:
    found: dict[State, Fraction] = {}
    for p, world in worlds:
        state = frozenset((fact, value) for fact, value in world.items() if value)
        found[state] = found.get(state, Fraction(0)) + p
    return found
