"""The value of a problem from its text alone, by the pages on the language and the semantics.

It shares nothing with the package: it splits a text into parentheses and words, interprets what they say
without naming or grounding anything first, and finds the best probability of each state by iteration. For
small problems without templates only.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import Any, TypeAlias

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
    rules: list[tuple[Form, dict[str, set[str]], Form]] = field(default_factory=list)
    init: list[Form] = field(default_factory=list)
    goal: Form = ""
    cost: str = "total-cost"

    @classmethod
    def of(cls, text: str) -> Lifted:
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
            case ["unknown" | "known" as kind, part]:
                unknown = self.value(part, bound, world) == 1
                return 2 if unknown == (kind == "unknown") else 0
            case _:
                return world.get(_fact(form, bound), 0)

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
            case ["unknown", part]:
                return [(Fraction(1), {_fact(part, bound): 1}, Fraction(0))]
            case _:
                return [(Fraction(1), {_fact(form, bound): 2}, Fraction(0))]

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

    def derived(self, state: State) -> dict[Fact, int]:
        """The world of a state: derived facts have the values of the least fixpoint. Rules that read a
        negation stand behind those of what they read."""
        world = dict(state)
        for name in dict.fromkeys(head[0] for head, _, _ in self.rules):
            while True:
                before = dict(world)
                for head, parameters, condition in self.rules:
                    for bound in self.bindings(parameters, {}) if head[0] == name else ():
                        fact = _fact(head, bound)
                        world[fact] = max(world.get(fact, 0), self.value(condition, bound, before))
                if world == before:
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
    def choices(self) -> dict[State, list[tuple[Fraction, dict[State, Fraction]]]]:
        """Every state that may be reached, with what each action that may start costs on average and
        leads to; where the goal is true, none does."""
        found: dict[State, list[tuple[Fraction, dict[State, Fraction]]]] = {}
        waiting = list(self.start())
        while waiting:
            state = waiting.pop()
            if state in found:
                continue
            if len(found) > 300:
                raise TooLarge
            world, found[state] = self.derived(state), []
            if self.value(self.goal, {}, world) == 2:
                continue
            for action in self.actions:
                for bound in self.bindings(typed(action.get(":parameters", [])), {}):
                    if self.value(action.get(":precondition", []), bound, world) == 2:
                        draws = self.effect(action.get(":effect", []), bound, world)
                        cost = sum((p * c for p, _, c in draws), Fraction(0)) if self.counts else Fraction(1)
                        after = _states((p, {**dict(state), **change}) for p, change, _ in draws)
                        found[state].append((cost, after))
                        waiting += after
        return found

    def goals(self) -> dict[State, Fraction]:
        """1 for every state in which the goal is true, 0 for others."""
        true = {state: self.value(self.goal, {}, self.derived(state)) == 2 for state in self.choices}
        return {state: Fraction(value) for state, value in true.items()}

    def within(self, steps: int) -> Fraction:
        """The best probability of reaching the goal with so many actions."""
        best = self.goals()
        for _ in range(steps):
            best = {
                state: max([best[state], *(mean(after, best) for _, after in self.choices[state])])
                for state in self.choices
            }
        result: Fraction = mean(self.start(), best)
        return result

    def best(self) -> dict[State, float]:
        """The best probability of ever reaching the goal from each state, to 1e-9 or so."""
        best = {state: float(value) for state, value in self.goals().items()}
        moved = 1.0
        while moved > 1e-13:
            moved = 0.0
            for state, choices in self.choices.items():
                value = max([best[state], *(mean(after, best) for _, after in choices)])
                moved, best[state] = max(moved, value - best[state]), value
        return best

    def least_cost(self, best: dict[State, float]) -> float | None:
        """The least cost of reaching the goal as probably as possible, or of ending where it is out of
        reach; None where actions may cost nothing."""
        open_ = [state for state in self.choices if best[state] > 0 and self.choices[state]]
        if any(own <= 0 for state in open_ for own, _ in self.choices[state]):
            return None
        cost, moved = dict.fromkeys(self.choices, 0.0), 1.0
        while moved > 1e-11:
            moved = 0.0
            for state in open_:
                value = min(
                    float(own) + mean(after, cost)
                    for own, after in self.choices[state]
                    if mean(after, best) > best[state] - 1e-9
                )
                moved, cost[state] = max(moved, abs(value - cost[state]) / (1 + value)), value
        return float(mean(self.start(), cost))


def _together(parts: Iterable[Draws]) -> Draws:
    """All of them, drawn independently; of two values for a fact the greater stays."""
    result = _NOTHING
    for part in parts:
        if len(result) * len(part) > 2000:
            raise TooLarge
        result = _merged(
            (p * q, {**one, **{fact: max(v, one.get(fact, v)) for fact, v in other.items()}}, c + d)
            for (p, one, c), (q, other, d) in product(result, part)
        )
    return result


def _merged(draws: Iterable[tuple[Fraction, Change, Fraction]]) -> Draws:
    found: dict[tuple[State, Fraction], Fraction] = {}
    for p, change, cost in draws:
        key = frozenset(change.items()), cost
        found[key] = found.get(key, Fraction(0)) + p
    return [(p, dict(change), cost) for (change, cost), p in found.items() if p]


def _states(worlds: Iterable[tuple[Fraction, World]]) -> dict[State, Fraction]:
    found: dict[State, Fraction] = {}
    for p, world in worlds:
        state = frozenset((fact, value) for fact, value in world.items() if value)
        found[state] = found.get(state, Fraction(0)) + p
    return found


def mean(after: Mapping[State, Fraction], values: Mapping[State, Any]) -> Any:
    """The expected value of a state."""
    return sum(p * values[state] for state, p in after.items())
