"""What a domain with numbers means, worked out from its text alone: a reader of parentheses, states as
dictionaries, and value iteration. It shares nothing with the stages of bbtc."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from typing import Any, TypeAlias

State: TypeAlias = tuple[frozenset[str], tuple[tuple[str, int], ...]]
"""What is true, and the value of each number."""
Env: TypeAlias = dict[str, str]


def read(text: str) -> Any:
    """Nested lists of words."""
    stack: list[list[Any]] = [[]]
    for word in re.findall(r"[()]|[^\s()]+", text.lower()):
        if word == "(":
            stack.append([])
        elif word == ")":
            done = stack.pop()
            stack[-1].append(done)
        else:
            stack[-1].append(word)
    return stack[0]


@dataclass
class World:
    """A domain with its problem."""

    ranges: dict[str, tuple[int, int, bool]] = field(default_factory=dict)
    actions: list[tuple[str, list[str], Any, Any]] = field(default_factory=list)
    events: list[tuple[list[str], Any, Any, bool]] = field(default_factory=list)
    """What happens by itself, all of it at once; is it drawn by the second?"""
    times: dict[str, list[tuple[int, Fraction]]] = field(default_factory=dict)
    """The seconds that an action takes, until it is given up."""
    lost: dict[str, tuple[Fraction, Any]] = field(default_factory=dict)
    """How probably an action is given up, and what it does then."""
    ends: dict[str, tuple[Any, Any]] = field(default_factory=dict)
    """While what an action goes on, and what it does otherwise."""
    objects: list[str] = field(default_factory=list)
    statics: dict[str, Fraction] = field(default_factory=dict)
    goal: Any = None
    start: State = (frozenset(), ())

    @classmethod
    def of(cls, text: str) -> World:
        """Read a text of one domain and one problem; all parameters range over all objects."""
        world = cls()
        numbers: dict[str, int] = {}
        facts: set[str] = set()
        for definition in read(text):
            for section in definition[2:]:
                match section[0]:
                    case ":functions":
                        parts = section[1:]
                        for at, part in enumerate(parts):
                            if part == "-":
                                _, low, high, *policy = parts[at + 1]
                                world.ranges[parts[at - 1][0]] = (int(low), int(high), policy == [":block"])
                    case ":action":
                        fields = dict(zip(section[2::2], section[3::2], strict=True))
                        world.actions.append(
                            (
                                section[1],
                                fields.get(":parameters", []),
                                fields.get(":precondition", ["and"]),
                                fields[":effect"],
                            )
                        )
                        if ":while" in fields:
                            world.ends[section[1]] = (fields[":while"], fields.get(":on-abort", ["and"]))
                        if ":duration" in fields:
                            world.takes(section[1], fields)
                    case ":exogenous":
                        fields = dict(zip(section[2::2], section[3::2], strict=True))
                        parts = fields.get(":parameters", []), fields.get(":precondition", ["and"])
                        world.events.append((*parts, fields[":effect"], fields.get(":per") == "second"))
                    case ":objects":
                        world.objects = section[1:]
                    case ":goal":
                        world.goal = section[1]
                    case ":init":
                        for fact in section[1:]:
                            if fact[0] != "=":
                                facts.add(named(fact, {}))
                            elif fact[1][0] in world.ranges:
                                numbers[named(fact[1], {})] = int(fact[2])
                            else:
                                world.statics[named(fact[1], {})] = Fraction(fact[2])
                    case _:
                        continue
        world.start = frozenset(facts), tuple(sorted(numbers.items()))
        return world

    def takes(self, action: str, fields: dict[str, Any]) -> None:
        """Read how long an action takes."""
        said = fields[":duration"]
        listed = [["", said, "1"]] if isinstance(said, str) else [["", *each] for each in said[1:]]
        times = [(int(seconds), Fraction(p)) for _, seconds, p in listed]
        if ":timeout" in fields:
            most = int(fields[":timeout"])
            late = sum((p for seconds, p in times if seconds > most), Fraction(0))
            self.lost[action] = late, fields.get(":on-timeout", ["and"])
            times = [(min(seconds, most), p) for seconds, p in times]
        self.times[action] = times

    def done(self, action: str, effect: Any, env: Env, state: State) -> dict[State, Fraction]:
        """What an action leads to that is not ended by its condition: it may be given up."""
        late, instead = self.lost.get(action, (Fraction(0), None))
        found: dict[State, Fraction] = {}
        for p, does in ((1 - late, effect), (late, instead)):
            for new, q in self.results(does, env, state).items() if p else ():
                found[new] = found.get(new, Fraction(0)) + p * q
        return found

    def meanwhile(self, action: str, chance: Fraction) -> Fraction:
        """How probably something takes place that has a chance every second."""
        return sum((p * (1 - (1 - chance) ** seconds) for seconds, p in self.times[action]), Fraction(0))

    def value(self, expression: Any, env: Env, state: State) -> Fraction:
        """The value of a numeric expression."""
        if isinstance(expression, str):
            return Fraction(expression)
        head, rest = expression[0], expression[1:]
        if head in "+-*/":
            values = [self.value(each, env, state) for each in rest]
            if head == "-" and len(values) == 1:
                return -values[0]
            total = values[0]
            for each in values[1:]:
                total = {
                    "+": total + each,
                    "-": total - each,
                    "*": total * each,
                    "/": total / each if each else total,
                }[head]
            return total
        name = named(expression, env)
        numbers = dict(state[1])
        return Fraction(numbers[name]) if name in numbers else self.statics[name]

    def holds(self, formula: Any, env: Env, state: State) -> bool:
        """Does a condition hold?"""
        match formula:
            case ["and", *parts]:
                return all(self.holds(each, env, state) for each in parts)
            case ["or", *parts]:
                return any(self.holds(each, env, state) for each in parts)
            case ["not", part]:
                return not self.holds(part, env, state)
            case ["forall", [parameter], part]:
                return all(self.holds(part, {**env, parameter: each}, state) for each in self.objects)
            case [("<" | "<=" | "=" | ">=" | ">") as operator, left, right]:
                one, other = self.value(left, env, state), self.value(right, env, state)
                return {
                    "<": one < other,
                    "<=": one <= other,
                    "=": one == other,
                    ">=": one >= other,
                    ">": one > other,
                }[operator]
            case _:
                return named(formula, env) in state[0]

    def drawn(self, effect: Any, env: Env, state: State) -> Iterator[tuple[Fraction, list[Any]]]:
        """What may happen: changes with their probability. All is read in the state before."""
        match effect:
            case ["and", *parts]:
                ways = [list(self.drawn(each, env, state)) for each in parts]
                for chosen in product(*ways):
                    probability = Fraction(1)
                    for p, _ in chosen:
                        probability *= p
                    yield probability, [change for _, made in chosen for change in made]
            case ["when", condition, part]:
                if self.holds(condition, env, state):
                    yield from self.drawn(part, env, state)
                else:
                    yield Fraction(1), []
            case ["forall", [parameter], part]:
                parts = [self.drawn(part, {**env, parameter: each}, state) for each in self.objects]
                for chosen in product(*map(list, parts)):
                    probability = Fraction(1)
                    for p, _ in chosen:
                        probability *= p
                    yield probability, [change for _, made in chosen for change in made]
            case ["probabilistic", *branches]:
                left = Fraction(1)
                for p, part in zip(branches[::2], branches[1::2], strict=True):
                    left -= Fraction(p)
                    for inner, made in self.drawn(part, env, state):
                        yield Fraction(p) * inner, made
                if left:
                    yield left, []
            case ["increase", target, amount]:
                yield Fraction(1), [("add", named(target, env), self.value(amount, env, state))]
            case ["decrease", target, amount]:
                yield Fraction(1), [("add", named(target, env), -self.value(amount, env, state))]
            case ["assign", target, amount]:
                yield Fraction(1), [("assign", named(target, env), self.value(amount, env, state))]
            case ["scale-up", target, amount]:
                value = self.value(target, env, state) * self.value(amount, env, state)
                yield Fraction(1), [("assign", named(target, env), value)]
            case ["not", atom]:
                yield Fraction(1), [("delete", named(atom, env), None)]
            case _:
                yield Fraction(1), [("add fact", named(effect, env), None)]

    def after(self, state: State, changes: list[Any], *, block: bool = True) -> State | None:
        """The state once all changes are made; None where a number that blocks would leave its range."""
        true = set(state[0]) - {name for kind, name, _ in changes if kind == "delete"}
        true |= {name for kind, name, _ in changes if kind == "add fact"}
        numbers = dict(state[1])
        for name, value in state[1]:
            assigned = [amount for kind, which, amount in changes if kind == "assign" and which == name]
            added = sum(amount for kind, which, amount in changes if kind == "add" and which == name)
            new = max(assigned, default=Fraction(value)) + added
            assert new == int(new)
            low, high, blocks = self.ranges[name.split()[0]]
            if block and blocks and not low <= new <= high:
                return None
            numbers[name] = min(max(int(new), low), high)
        return frozenset(true), tuple(sorted(numbers.items()))

    def moves(self, state: State) -> Iterator[tuple[str, dict[State, Fraction]]]:
        """The actions that may start, with what they lead to."""
        for name, parameters, precondition, effect in self.actions:
            for args in product(self.objects, repeat=len(parameters)):
                env = dict(zip(parameters, args, strict=True))
                if not self.holds(precondition, env, state):
                    continue
                if self.leaves_range(effect, env, state):
                    continue
                if name in self.lost and self.leaves_range(self.lost[name][1], env, state):
                    continue
                goes_on, abort = self.ends.get(name, (["and"], ["and"]))
                if not self.holds(goes_on, env, state):
                    continue
                found: dict[State, Fraction] = {}
                if name in self.ends:
                    for meanwhile, p in self.happened(state, name).items():
                        if self.holds(goes_on, env, meanwhile):
                            ways = self.done(name, effect, env, meanwhile)
                        else:
                            ways = self.results(abort, env, meanwhile)
                        for new, q in ways.items():
                            found[new] = found.get(new, Fraction(0)) + p * q
                else:
                    for done, p in self.done(name, effect, env, state).items():
                        for new, q in self.happened(done, name).items():
                            found[new] = found.get(new, Fraction(0)) + p * q
                yield f"{name}({','.join(args)})", found

    def leaves_range(self, effect: Any, env: Env, state: State) -> bool:
        """Would a number that blocks leave its range in some outcome?"""
        return any(self.after(state, changes) is None for p, changes in self.drawn(effect, env, state) if p)

    def results(self, effect: Any, env: Env, state: State) -> dict[State, Fraction]:
        """What an effect leads to; numbers stay in their ranges."""
        found: dict[State, Fraction] = {}
        for p, changes in self.drawn(effect, env, state):
            new = self.after(state, changes, block=False)
            assert new is not None
            found[new] = found.get(new, Fraction(0)) + p
        return found

    def happened(self, state: State, action: str) -> dict[State, Fraction]:
        """The states after the draw of the events that goes with an action."""
        due = []
        for parameters, precondition, effect, by_second in self.events:
            for args in product(self.objects, repeat=len(parameters)):
                env = dict(zip(parameters, args, strict=True))
                if self.holds(precondition, env, state) and not self.leaves_range(effect, env, state):
                    what = effect
                    if by_second:
                        what = ["probabilistic", self.meanwhile(action, Fraction(effect[1])), effect[2]]
                    due.append(list(self.drawn(what, env, state)))
        found: dict[State, Fraction] = {}
        for chosen in product(*due):
            probability, changes = Fraction(1), []
            for p, made in chosen:
                probability *= p
                changes += made
            new = self.after(state, changes, block=False)
            assert new is not None
            found[new] = found.get(new, Fraction(0)) + probability
        return found

    def best(self, most: int) -> float | None:
        """The greatest probability of reaching the goal; None where there are more states than ``most``."""
        index = {self.start: 0}
        states = [self.start]
        won: list[bool] = []
        moves: list[list[list[tuple[int, float]]]] = []
        for state in states:
            if len(states) > most:
                return None
            won.append(self.holds(self.goal, {}, state))
            made: list[list[tuple[int, float]]] = []
            for _, results in () if won[-1] else self.moves(state):
                for each in results:
                    if each not in index:
                        index[each] = len(states)
                        states.append(each)
                made.append([(index[each], float(p)) for each, p in results.items()])
            moves.append(made)
        values = [float(each) for each in won]
        while True:
            worst = 0.0
            for at, choices in enumerate(moves):
                if choices:
                    new = max(sum(p * values[to] for to, p in results) for results in choices)
                    worst = max(worst, new - values[at])
                    values[at] = new
            if worst < 1e-13:
                return values[0]


def named(form: Any, env: Env) -> str:
    """A fact or a number by its name."""
    return " ".join(env.get(word, word) for word in form)


def success(world: World, tree: Any) -> float:
    """The probability that a tree, as JSON, reaches the goal: of actions that are not latched."""
    index = {world.start: 0}
    states = [world.start]
    values: list[float] = []
    edges: list[list[tuple[int, float]]] = []
    for state in states:
        status, action = tick(world, tree, state)
        if status == "success":
            assert world.holds(world.goal, {}, state)
        values.append(float(status == "success"))
        results = {} if action is None else dict(world.moves(state))[action]
        for each in results:
            if each not in index:
                index[each] = len(states)
                states.append(each)
        edges.append([(index[each], float(p)) for each, p in results.items()])
    while True:
        worst = 0.0
        for at, row in enumerate(edges):
            if row:
                new = sum(p * values[to] for to, p in row)
                worst = max(worst, new - values[at])
                values[at] = new
        if worst < 1e-13:
            return values[0]


def tick(world: World, node: Any, state: State) -> tuple[str, str | None]:
    """What a node returns, and the action that it starts."""
    kind = node["type"]
    match kind:
        case "condition":
            return ("success" if condition(node["condition"], state) else "failure"), None
        case "action":
            assert node.get("latched", True) is False, "not met here"
            if node.get("guarded") and node["action"] not in dict(world.moves(state)):
                return "failure", None
            return "running", node["action"]
        case "sequence" | "fallback":
            go_on = "success" if kind == "sequence" else "failure"
            for child in node["children"]:
                status, action = tick(world, child, state)
                if status != go_on:
                    return status, action
            return go_on, None
        case _:
            raise AssertionError(kind)


def condition(words: Any, state: State) -> bool:
    """The value of a condition of a tree."""
    match words:
        case ["is", name, value]:
            return (plain(name) in state[0]) is (value == "true")
        case ["within", name, low, high]:
            return bool(low <= dict(state[1])[plain(name)] <= high)
        case ["and", *parts]:
            return all(condition(each, state) for each in parts)
        case ["or", *parts]:
            return any(condition(each, state) for each in parts)
        case ["not", part]:
            return not condition(part, state)
        case [word]:
            return bool(word == "true")
        case other:
            raise AssertionError(other)


def plain(name: str) -> str:
    """``p(a,b)`` as the words of a fact."""
    return " ".join(re.findall(r"[^(),]+", name))
