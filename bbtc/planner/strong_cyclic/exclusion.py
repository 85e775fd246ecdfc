"""Groups of variables of which at most one is true in every reachable state, such as the places of a robot.

A group is guessed from names: the ground predicates of a symbol that agree in all arguments but at most one,
together with those of other symbols that share these arguments. A guess is kept if at most one member is
true in every initial state, and every action that makes one true makes one false that it needs to be true.
Source of guess, check and repair: Helmert, "Concise finite-domain representations for PDDL planning tasks"
(2009), section 5; here the check is done on the ground actions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import permutations

from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.packing import ALWAYS, set_bits
from bbtc.planner.strong_cyclic.determinised import Action, Determinised
from bbtc.planner.strong_cyclic.partial_state import PartialState, Reasons, contradict, united

_MOST_GUESSES = 200
_MOST_PARTS = 4  # predicates of one group


@dataclass(frozen=True, slots=True, order=True)
class _Part:
    """Ground predicates of a symbol: those of a group agree in the arguments at ``fixed``, in this order."""

    predicate: str
    arity: int
    fixed: tuple[int, ...]

    def key(self, args: tuple[str, ...]) -> tuple[str, ...]:
        return tuple([args[at] for at in self.fixed])


_Guess = tuple[_Part, ...]


@dataclass(frozen=True, slots=True)
class _Making:
    """What a step of an action makes true, what the action needs to be true, and what of it the step makes
    false or makes true again."""

    makes: tuple[int, ...]
    needs: frozenset[int]
    gone: frozenset[int]


class Exclusion:
    """The groups found. ``groups`` are lists of variables, in order; ``mates[v]`` are the bits of all that
    are false while v is true, where there are any; ``members`` are the bits of all variables in groups."""

    def __init__(self, model: Determinised, limits: Limits) -> None:
        self.groups: list[list[int]] = _Search(model, limits).groups()
        self.mates: dict[int, int] = {}
        for group in self.groups:
            bits = sum(1 << variable for variable in group)
            for variable in group:
                self.mates[variable] = self.mates.get(variable, 0) | bits & ~(1 << variable)
        self.members = sum(1 << variable for variable in self.mates)

    def implied(self, partial: PartialState) -> int:
        """The bits of the variables that are false in every reachable state that satisfies it, because
        another one is true."""
        found = 0
        for bit in set_bits(partial.value & self.members):
            found |= self.mates[bit]
        return found

    def closed(self, partial: PartialState) -> PartialState:
        """With all that it implies."""
        implied = self.implied(partial) & ~partial.mask
        return PartialState(partial.mask | implied, partial.value)

    def possible(self, partial: PartialState) -> bool:
        """May a reachable state satisfy it?"""
        return not self.implied(partial) & partial.value

    def shortest(self, partial: PartialState) -> PartialState:
        """Without what the rest of it implies."""
        return PartialState(partial.mask & ~(self.implied(partial) & ~partial.value), partial.value)

    def refuting(
        self, reasons: Reasons, partials: Iterable[PartialState], state: int, known: PartialState
    ) -> PartialState:
        """``known``, which a state satisfies, with enough of the state for none of some partial states to
        hold, none of which holds in it. Of the literals that do so, the one that rules out the most is
        taken first."""
        closed = self.closed(known)
        ways: list[PartialState] = []
        number: dict[PartialState, int] = {}
        way_of: dict[int, int] = {}
        waiting: list[list[int]] = []
        for partial in partials:
            if contradict(closed, partial):
                continue
            options: list[int] = []
            for bit in set_bits((state ^ partial.value) & partial.mask):
                key = 2 * bit + (partial.value >> bit & 1)
                if key not in way_of:
                    only = PartialState(1 << bit, partial.value & 1 << bit)
                    literal = self.strongest(reasons.differs(only, state), state)
                    way_of[key] = number.setdefault(literal, len(ways))
                    if way_of[key] == len(ways):
                        ways.append(literal)
                if way_of[key] not in options:
                    options.append(way_of[key])
            waiting.append(options)
        counts = [0] * len(ways)
        for options in waiting:
            for way in options:
                counts[way] += 1
        while waiting:
            best = max(range(len(ways)), key=lambda way: (counts[way], ways[way].value != 0, -ways[way].mask))
            known = united(known, ways[best])
            rest: list[list[int]] = []
            for options in waiting:
                if best in options:
                    for way in options:
                        counts[way] -= 1
                else:
                    rest.append(options)
            waiting = rest
        return known

    def strongest(self, literal: PartialState, state: int) -> PartialState:
        """What implies a literal of a state: that another member of its group is true."""
        variable = literal.mask.bit_length() - 1
        if not literal.value and variable in self.mates:
            mates = state & self.mates[variable]
            if mates:
                return PartialState(mates & -mates, mates & -mates)
        return literal


class _Search:
    def __init__(self, model: Determinised, limits: Limits) -> None:
        self.task: Task = model.task
        self.limits = limits
        self.making: dict[str, list[_Making]] = {}
        self.unsure: set[str] = {v.predicate for v in self.task.variables if v.three_valued}
        for number, action in enumerate(model.actions):
            if number % 256 == 0:
                limits.check_time("planning")
            self._note(action)
        self.by_symbol: dict[tuple[str, int], list[int]] = {}
        for number, variable in enumerate(self.task.variables):
            self.by_symbol.setdefault((variable.predicate, len(variable.args)), []).append(number)

    def _note(self, action: Action) -> None:
        cubes = action.needs if action.needs is not None else (PartialState(0, 0),)
        count = len(self.task.variables)
        for cube in cubes:
            needs = frozenset(bit for bit in set_bits(cube.value & cube.mask) if bit < count)
            for step in action.steps:
                for part in step.guarded:
                    if part.when != ALWAYS:
                        self.unsure.update(
                            self.task.variables[v].predicate for v, value in part.sets if value is Truth.TRUE
                        )
                made = tuple([variable for variable, value in step.sets if value is Truth.TRUE])
                gone = frozenset(v for v, value in step.sets if value is Truth.FALSE) | frozenset(made)
                for symbol in sorted({self.task.variables[variable].predicate for variable in made}):
                    self.making.setdefault(symbol, []).append(_Making(made, needs, gone & needs))

    def groups(self) -> list[list[int]]:
        found: dict[tuple[int, ...], None] = {}
        waiting = [guess for guess in self._first() if guess[0].predicate not in self.unsure]
        seen = set(waiting)
        tried = 0
        while waiting and tried < _MOST_GUESSES:
            guess = waiting.pop(0)
            tried += 1
            self.limits.check_time("planning")
            groups = self._members(guess)
            better = self._check(guess, groups)
            if better is None:
                found.update(
                    (tuple(members), None) for members in self._initially(groups) if len(members) > 1
                )
                continue
            for repaired in better:
                if repaired not in seen:
                    seen.add(repaired)
                    waiting.append(repaired)
        return [list(group) for group in found if not any(set(group) < set(other) for other in found)]

    def _first(self) -> Iterator[_Guess]:
        for symbol, arity in sorted(self.by_symbol):
            yield (_Part(symbol, arity, tuple(range(arity))),)
            for counted in range(arity):
                fixed = tuple(at for at in range(arity) if at != counted)
                yield (_Part(symbol, arity, fixed),)

    def _members(self, guess: _Guess) -> dict[tuple[str, ...], list[int]]:
        found: dict[tuple[str, ...], list[int]] = {}
        for part in guess:
            for number in self.by_symbol.get((part.predicate, part.arity), ()):
                found.setdefault(part.key(self.task.variables[number].args), []).append(number)
        return {key: sorted(members) for key, members in found.items()}

    def _initially(self, groups: dict[tuple[str, ...], list[int]]) -> Iterator[list[int]]:
        """The groups with at most one true member in every initial state."""
        for _, members in sorted(groups.items()):
            if all(
                sum(state.values[member] is Truth.TRUE for member in members) <= 1
                for state in self.task.initial
            ):
                yield members

    def _check(self, guess: _Guess, groups: dict[tuple[str, ...], list[int]]) -> list[_Guess] | None:
        """None if no action ever makes a member true besides another, else guesses to try instead."""
        group_of = {member: key for key, members in groups.items() for member in members}
        for part in guess:
            for making in self.making.get(part.predicate, ()):
                touched: set[tuple[str, ...]] = set()
                for made in making.makes:
                    key = group_of.get(made)
                    if key is None:
                        continue
                    if key in touched:
                        return []  # two at once
                    touched.add(key)
                    if not any(group_of.get(lost) == key for lost in making.gone):
                        return list(self._repaired(guess, key, making))
        return None

    def _repaired(self, guess: _Guess, key: tuple[str, ...], making: _Making) -> Iterator[_Guess]:
        """The guess with a predicate more, of something that the action needs and makes false."""
        if len(guess) >= _MOST_PARTS:
            return
        symbols = {part.predicate for part in guess}
        for lost in sorted(making.gone):
            variable = self.task.variables[lost]
            if variable.predicate in symbols or variable.predicate in self.unsure:
                continue
            if lost in making.makes:
                continue
            arity = len(variable.args)
            if not len(key) <= arity <= len(key) + 1:
                continue
            for fixed in permutations(range(arity), len(key)):
                part = _Part(variable.predicate, arity, fixed)
                if part.key(variable.args) == key:
                    yield tuple(sorted((*guess, part)))
