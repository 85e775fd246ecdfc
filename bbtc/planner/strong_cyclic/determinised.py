"""The all-outcomes determinisation of a task over bits: every outcome of an action as a step of its own.

Source of the idea: Yoon, Fern, Givan, "FF-Replan" (2007); of regression to what a step needs: Muise,
McIlraith, Beck, "Improved non-deterministic planning by exploiting state relevance" (2012).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from bbtc.ground.task import Effect, Factor, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.packing import ALWAYS, NEVER, BitTest, Packing, bit_test, cubes, set_bits
from bbtc.planner.strong_cyclic.partial_state import (
    ANY_STATE,
    PartialState,
    Reasons,
    satisfied,
    united,
    without,
)

MOST_OUTCOMES = 4096
"""Joint outcomes of one action; a task with an action of more is refused."""

_MOST_CUBES = 32  # disjuncts of a precondition that are looked at one by one
_ACTIONS_AT_ONCE = 256  # between two looks at the limits


@dataclass(frozen=True, slots=True)
class Assignment:
    """Values that are set where ``when`` holds: ``sets`` by variable."""

    when: BitTest
    sets: tuple[tuple[int, Truth], ...]
    clear: int
    true: int
    unknown: int
    kill: int
    """Bits to clear, and then to set; ``kill`` are unknown bits of what becomes true, which wins."""


@dataclass(frozen=True, slots=True)
class Step:
    """One joint outcome of an action: unconditional assignments, as bits to keep and to set, and all
    assignments where some depend on the state."""

    keep: int
    set: int
    sets: tuple[tuple[int, Truth], ...]
    """What is set whatever the state: the value of each variable after all unconditional assignments."""
    guarded: tuple[Assignment, ...]
    touched: int
    """Bits of all variables that some assignment sets."""

    def apply(self, state: int) -> int:
        """The state after it."""
        if not self.guarded:
            return state & self.keep | self.set
        clear = true = unknown = kill = 0
        for part in self.guarded:
            if satisfied(part.when, state):
                clear |= part.clear
                true |= part.true
                unknown |= part.unknown
                kill |= part.kill
        return (state & ~clear) | true | (unknown & ~kill)


@dataclass(frozen=True, slots=True)
class Action:
    """A ground action: its number in the task, when it may start, and what may come of it. ``needs`` are the
    disjuncts of the precondition, None if they are too many."""

    number: int
    test: BitTest
    needs: tuple[PartialState, ...] | None
    steps: tuple[Step, ...]

    @property
    def common(self) -> PartialState:
        """What every state in which it may start satisfies, as far as that is a partial state."""
        if self.needs is None or len(self.needs) != 1:
            return ANY_STATE
        return self.needs[0]


class Determinised:
    """A task as actions and steps over bits. To make it raises ``LimitReached``."""

    def __init__(self, task: Task, limits: Limits) -> None:
        self.task = task
        self.packing = Packing.of(task)
        self.reasons = Reasons(self.packing)
        self.goal = bit_test(self.packing, task.goal)
        made: list[Action] = []
        for number, action in enumerate(task.actions):
            if number % _ACTIONS_AT_ONCE == 0:
                limits.check_time("planning")
            test = bit_test(self.packing, action.precondition)
            needs = cubes(test, _MOST_CUBES)
            steps = dict.fromkeys(self._step(effects) for effects in _joint(action.factors))
            made.append(Action(number, test, None if needs is None else tuple(needs), tuple(steps)))
        self.actions: Sequence[Action] = tuple(made)
        self._index()

    def _step(self, effects: frozenset[Effect]) -> Step:
        parts: dict[BitTest, dict[int, Truth]] = {}
        for effect in effects:
            test = ALWAYS if effect.when is None else bit_test(self.packing, effect.when)
            if test != NEVER:
                sets = parts.setdefault(test, {})
                for variable, value in effect.sets:
                    sets[variable] = max(value, sets.get(variable, value))
        made = [self._assignment(when, tuple(sorted(sets.items()))) for when, sets in parts.items()]
        made.sort(key=lambda part: (part.when != ALWAYS, part.sets, repr(part.when)))
        plain = next((part for part in made if part.when == ALWAYS), self._assignment(ALWAYS, ()))
        guarded = tuple(made) if any(part.when != ALWAYS for part in made) else ()
        touched = 0
        for part in made:
            touched |= part.clear
        return Step(~plain.clear, plain.true | plain.unknown, plain.sets, guarded, touched)

    def _assignment(self, when: BitTest, sets: tuple[tuple[int, Truth], ...]) -> Assignment:
        clear = true = unknown = kill = 0
        for variable, value in sets:
            bits = self.packing.bits(variable)
            clear |= bits
            if value is Truth.TRUE:
                true |= 1 << variable
                kill |= bits & ~(1 << variable)
            elif value is Truth.UNKNOWN:
                unknown |= self.packing.assigned(variable, value)
        return Assignment(when, sets, clear, true, unknown, kill)

    # --- which actions may start --------------------------------------------------------------

    def _index(self) -> None:
        """Each disjunct of a precondition stands under one of its bits that must be set: one that is not set
        at the start, if possible, since few others are then set in most states, and of these the rarest."""
        often: dict[int, int] = {}
        at_start = 0
        for initial in self.task.initial:
            at_start |= self.packing.pack(bytes(initial.values))
        for action in self.actions:
            for need in action.needs or ():
                for bit in set_bits(need.value):
                    often[bit] = often.get(bit, 0) + 1
        self._under: dict[int, list[tuple[int, int, int]]] = {}
        self._other: list[tuple[int, BitTest]] = []
        self._pivots = 0
        for action in self.actions:
            rest = action.needs is None
            for need in action.needs or ():
                if not need.value:
                    rest = True
            if rest:
                self._other.append((action.number, action.test))
                continue
            for need in action.needs or ():
                pivot = min(set_bits(need.value), key=lambda bit: (at_start >> bit & 1, often[bit], bit))
                self._under.setdefault(pivot, []).append((action.number, need.mask, need.value))
                self._pivots |= 1 << pivot

    def applicable(self, state: int) -> list[int]:
        """The numbers of the actions that may start in a state, in order."""
        found = [
            number
            for bit in set_bits(state & self._pivots)
            for number, mask, value in self._under[bit]
            if state & mask == value
        ]
        found.extend(number for number, test in self._other if satisfied(test, state))
        found.sort()
        return list(dict.fromkeys(found))

    # --- regression ---------------------------------------------------------------------------

    def needed(self, action: int, step: Step, state: int, wanted: PartialState) -> PartialState:
        """What of a state, in which an action may start and leads by a step to ``wanted``, is enough for
        that: whatever satisfies it may start the action, and gets to ``wanted`` by the same step."""
        found = self.reasons.why(self.actions[action].test, state)
        return united(found, self.before(step, state, wanted, found.mask))

    def before(self, step: Step, state: int, wanted: PartialState, known: int = 0) -> PartialState:
        """What of a state, from which a step leads to ``wanted``, is enough for that. Bits of the mask
        ``known`` cost nothing."""
        found = without(wanted, step.touched)
        if not step.guarded:
            return found
        variables = sorted({self.packing.owner(bit) for bit in set_bits(wanted.mask & step.touched)})
        for variable in variables:
            why = self._why_set(step, state, variable, wanted, known | found.mask)
            found = united(found, why)
        return found

    def _why_set(
        self, step: Step, state: int, variable: int, wanted: PartialState, known: int
    ) -> PartialState:
        """Why the literal of one variable holds after a step."""
        bits = self.packing.bits(variable) & wanted.mask
        value = wanted.value & bits

        def fits(truth: Truth) -> bool:
            return self.packing.assigned(variable, truth) & bits == value

        setters = [
            (part.when, truth) for part in step.guarded for each, truth in part.sets if each == variable
        ]
        firing = [(when, truth) for when, truth in setters if satisfied(when, state)]
        found, least = ANY_STATE, -1
        if firing:
            result = max(truth for _, truth in firing)
            whys = [self.reasons.why(when, state, known) for when, truth in firing if truth is result]
            found = min(whys, key=lambda way: (way.mask & ~known).bit_count())
            least = int(result)
        else:
            found = PartialState(bits, value)
        for when, truth in setters:
            if truth > least and not fits(truth):  # it would undo it
                reason = self.reasons.why_not(when, state, known | found.mask)
                found = united(found, reason)
        return found


def _joint(factors: tuple[Factor, ...]) -> Iterator[frozenset[Effect]]:
    """The effects of every joint outcome of independent factors that is possible, equal ones once."""
    total: dict[frozenset[Effect], None] = {frozenset(): None}
    for factor in factors:
        drawn: dict[frozenset[Effect], None] = {}
        for outcome in factor.outcomes:
            if outcome.probability:
                own = frozenset(effect for effect in outcome.effects if effect.sets)
                drawn.update((own | nested, None) for nested in _joint(outcome.factors))
        if len(total) * len(drawn) > MOST_OUTCOMES:
            raise Limits.reached(
                f"an action with more than {MOST_OUTCOMES} joint outcomes ended the search for a policy that"
                " surely succeeds",
                "--strategy auto",
            )
        total = dict.fromkeys(one | other for one in total for other in drawn)
    yield from total
