"""Reads the text of a POMDP in the language of PRISM, and enumerates its beliefs: what such texts are worth
by the manual of PRISM alone. For small ones only."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias

from tests.domains.lifted import TooLarge
from tests.hidden.exact_mdp import Choice, Mdp

State: TypeAlias = tuple[int, ...]
Belief: TypeAlias = tuple[tuple[State, Fraction], ...]

_ONE = Fraction(1)


@dataclass(frozen=True)
class _Command:
    label: str
    guard: Callable[[dict[str, int]], bool]
    branches: tuple[tuple[Fraction, Mapping[str, Callable[[dict[str, int]], int]]], ...]


class PomdpText:
    """A module of commands, its observables, and the states of its label ``goal``."""

    def __init__(self, text: str) -> None:
        lines = [line.split("//")[0].strip() for line in text.splitlines()]
        body = " ".join(lines)
        assert next(line for line in lines if line) == "pomdp"
        observed = re.search(r"observables (.*?) endobservables", body)
        assert observed is not None
        cells = re.findall(r"(\S+) : \[0\.\.(\d+)\] init (\d+);", body)
        self.names = [name for name, _, _ in cells]
        self.highest = {name: int(highest) for name, highest, _ in cells}
        self.initial = tuple(int(first) for _, _, first in cells)
        self.seen = [self.names.index(name.strip()) for name in observed[1].split(",")]
        formulas: dict[str, str] = {}
        for name, expression in re.findall(r"formula (\S+) = (.*?);", body):
            formulas[name] = _python(expression, formulas)
        self.goal = _compiled(re.findall(r'label "goal" = (.*?);', body)[0], formulas)
        module = body[body.index("module task") : body.index("endmodule")]
        self.commands = [
            _command(label, guard, update, formulas)
            for label, guard, update in re.findall(r"\[(\w*)\] ([^;]*?) -> ([^;]*);", module)
        ]

    def values(self, state: State) -> dict[str, int]:
        """The cells by name."""
        return dict(zip(self.names, state, strict=True))

    def choices(self, state: State) -> dict[str, _Command]:
        """The commands that are enabled, by label: no two of one label."""
        values = self.values(state)
        found: dict[str, _Command] = {}
        for command in self.commands:
            if command.guard(values):
                assert command.label not in found, (command.label, values)
                found[command.label] = command
        return found

    def after(self, belief: Belief, label: str) -> dict[Belief, Fraction]:
        """What may be believed after a choice, by Bayes' rule on what is seen."""
        by_seen: dict[State, dict[State, Fraction]] = {}
        for state, p in belief:
            values = self.values(state)
            command = self.choices(state)[label]
            assert sum(q for q, _ in command.branches) == 1, values
            for q, updates in command.branches:
                new = {**values, **{name: update(values) for name, update in updates.items()}}
                assert all(0 <= new[name] <= self.highest[name] for name in self.names), new
                then = tuple(new[name] for name in self.names)
                of = by_seen.setdefault(tuple(then[at] for at in self.seen), {})
                of[then] = of.get(then, Fraction(0)) + p * q
        return {
            tuple(sorted((state, p / whole) for state, p in of.items())): whole
            for of in by_seen.values()
            for whole in [sum(of.values(), Fraction(0))]
        }

    def offered(self, belief: Belief) -> set[str]:
        """What may be done: the same in all states of a belief, since they look alike."""
        every = [set(self.choices(state)) for state, _ in belief]
        assert all(each == every[0] for each in every), [self.values(state) for state, _ in belief]
        return every[0]

    def won(self, belief: Belief) -> bool:
        """Is the goal reached?"""
        every = {bool(self.goal(self.values(state))) for state, _ in belief}
        assert len(every) == 1
        return every.pop()

    def settled(self, belief: Belief) -> Iterator[tuple[Belief, Fraction]]:
        """What a belief becomes by steps that nobody chooses."""
        waiting = [(belief, _ONE)]
        found: dict[Belief, Fraction] = {}
        while waiting:
            each, p = waiting.pop()
            if self.won(each) or self.offered(each) != {""}:
                found[each] = found.get(each, Fraction(0)) + p
            else:
                waiting += [(then, p * q) for then, q in self.after(each, "").items()]
        yield from found.items()

    def mdp(self, most: int) -> Mdp:
        """The process over beliefs, the one before the start first; each action costs 1. Raises
        :class:`TooLarge` for more beliefs."""
        beliefs: list[Belief] = []
        number: dict[Belief, int] = {}

        def row(found: Mapping[Belief, Fraction]) -> list[tuple[int, Fraction]]:
            after: dict[int, Fraction] = {}
            for before, p in found.items():
                for each, q in self.settled(before):
                    if each not in number:
                        number[each] = len(beliefs) + 1
                        beliefs.append(each)
                    after[number[each]] = after.get(number[each], Fraction(0)) + p * q
            return list(after.items())

        start: Belief = ((self.initial, _ONE),)
        choices: list[list[Choice]] = [[(_ONE, row({start: _ONE}))]]
        goals = [False]
        for belief in beliefs:  # grows while it is read
            goals.append(self.won(belief))
            labels = [] if goals[-1] else sorted(self.offered(belief) - {""})
            choices.append([(_ONE, row(self.after(belief, label))) for label in labels])
            if len(beliefs) > most:
                raise TooLarge
        return Mdp(goals, choices)

    def within(self, steps: int) -> Fraction:
        """The best probability of reaching the goal with so many actions at most."""
        known: dict[tuple[Belief, int], Fraction] = {}

        def best(belief: Belief, left: int) -> Fraction:
            if self.won(belief):
                return _ONE
            if (belief, left) not in known:
                labels = self.offered(belief) - {""} if left else set()
                values = (
                    sum(
                        (p * mean(each, left - 1) for each, p in self.after(belief, label).items()),
                        Fraction(0),
                    )
                    for label in labels
                )
                known[belief, left] = max(values, default=Fraction(0))
            return known[belief, left]

        def mean(belief: Belief, left: int) -> Fraction:
            return sum((p * best(each, left) for each, p in self.settled(belief)), Fraction(0))

        return mean(((self.initial, _ONE),), steps)


# --- the language --------------------------------------------------------------------------------


def _command(label: str, guard: str, update: str, formulas: Mapping[str, str]) -> _Command:
    branches = []
    for part in re.split(r" \+ (?=[\d/.]+ : )", update):
        share, _, sets = part.partition(" : ") if re.match(r"[\d/.]+ : ", part) else ("1", "", part)
        updates = {}
        for name, value in re.findall(r"\((\w+)'=(.*?)\)(?= & \(\w+'|$)", sets):
            updates[name] = _compiled(value, formulas)
        assert updates or sets == "true", sets
        branches.append((Fraction(share), updates))
    return _Command(label, _compiled(guard, formulas), tuple(branches))


def _compiled(expression: str, formulas: Mapping[str, str]) -> Callable[[dict[str, int]], Any]:
    code = compile(_python(expression, formulas), "prism", "eval")
    return lambda values: eval(code, {}, values)  # of text that this program has written


def _python(expression: str, formulas: Mapping[str, str]) -> str:
    """In PRISM ``!`` binds more tightly than ``&``, that more than ``|``, and that more than ``? :``: as
    Python's words do."""
    tokens = re.findall(r"\w+|!=|>=|[=<!&|?:()]", expression)
    assert "".join(tokens) == expression.replace(" ", ""), expression
    place = 0

    def until(ends: set[str]) -> str:
        nonlocal place
        found: list[str] = []
        while place < len(tokens) and tokens[place] not in ends:
            token = tokens[place]
            place += 1
            if token == "?":
                yes = until({":"})
                place += 1
                return f"({yes} if {' '.join(found)} else {until(ends)})"
            if token == "(":
                inner = until({")"})
                place += 1
                found.append(f"({inner})")
            else:
                words = {"=": "==", "!": "not", "&": "and", "|": "or", "true": "True", "false": "False"}
                found.append(words.get(token, f"({formulas[token]})" if token in formulas else token))
        return " ".join(found)

    return until(set())
