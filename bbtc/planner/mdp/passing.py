"""What happens by itself between two decisions, one thing after the other.

Multiplied out, an action with n independent events would lead to 2 to the n states. Here it leads to a state
that only passes: one in which the next events are drawn, a few at a time, and nothing is decided. A *stage*
says what is drawn next; stage 0 is that of decisions. Events of one round are drawn after each other where
none reads what an earlier one sets, so that each reads the state which the round began with.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import prod

from bbtc.ground.condition import (
    TRUE,
    Condition,
    Is,
    conjunction,
    disjunction,
    doubt,
    negation,
    variables,
)
from bbtc.ground.task import Charge, Factor, GroundEvent, Outcome, Task, charges_of, effects_of
from bbtc.kleene import Truth
from bbtc.markov import components

_MOST_TOGETHER = 8
"""Joint outcomes of events that are drawn at once."""

_MOST_GROUPS = 12
"""With more, the results of actions are worked out one by one: few events are due in any one state."""


@dataclass(frozen=True, slots=True)
class Step:
    """In stage ``stage``, where the precondition is true, one outcome of each factor happens, and stage
    ``after`` is next."""

    stage: int
    precondition: Condition
    factors: tuple[Factor, ...]
    after: int


@dataclass(frozen=True, slots=True)
class Passing:
    """The stages of a task: how many there are, stage 0 among them, how many of them draw events for one
    action, the one that each action leads to, and what happens in the others. Actions of ``interrupted``
    change nothing at first: their outcome is among the steps."""

    stages: int
    draws: int
    after: tuple[int, ...]
    interrupted: frozenset[int]
    steps: tuple[Step, ...]

    @property
    def levels(self) -> int:
        """How many steps it takes at most from one decision to the next."""
        return 1 + self.draws + bool(self.interrupted)

    @property
    def bits(self) -> int:
        """How many bits a stage takes."""
        return (self.stages - 1).bit_length()

    @classmethod
    def none(cls, task: Task) -> Passing:
        """That nothing happens by itself."""
        return cls(1, 0, (0,) * len(task.actions), frozenset(), ())

    @classmethod
    def of(cls, task: Task) -> Passing | None:
        """The stages of a task; None where there would be too many."""
        if not task.events:
            return cls.none(task)
        steps: list[Step] = []
        after, interrupted = [], set[int]()
        stages, longest = 1, 0
        shared: dict[tuple[tuple[GroundEvent, ...], ...], int] = {}
        for number, action in enumerate(task.actions):
            rounds = task.rounds(action)
            if action.during is None and rounds in shared:
                after.append(shared[rounds])
                continue
            groups = [group for events in rounds for group in _groups(events)]
            draws = [tuple(factor for event in group for factor in _conditional(event)) for group in groups]
            count = len(draws)
            if count > _MOST_GROUPS or any(_size(group) > 8 * _MOST_TOGETHER for group in groups):
                return None
            after.append(stages)
            steps += [Step(stages + n, TRUE, factors, stages + n + 1) for n, factors in enumerate(draws)]
            if action.during is None:
                shared[rounds] = stages
                steps[-1] = replace(steps[-1], after=0)
                stages += count
            else:
                interrupted.add(number)
                steps.append(Step(stages + count, action.during, action.factors, 0))
                steps.append(Step(stages + count, _failing(action.during), action.on_abort, 0))
                stages += count + 1
            longest = max(longest, count)
        return cls(stages, longest, tuple(after), frozenset(interrupted), tuple(steps))


def _failing(condition: Condition) -> Condition:
    """A condition that is true where this one is not."""
    unknown = doubt(condition, lambda variable: Is(variable, Truth.UNKNOWN))
    return disjunction([negation(condition), unknown])


def _groups(events: Sequence[GroundEvent]) -> Iterator[list[GroundEvent]]:
    """Events of one round, in an order in which none reads what an earlier group sets."""
    setters: dict[int, list[int]] = {}
    for number, event in enumerate(events):
        for variable in dict.fromkeys(v for effect in effects_of(event.factors) for v, _ in effect.sets):
            setters.setdefault(variable, []).append(number)
    first: list[list[int]] = [[] for _ in events]  # which events come before each
    for number, event in enumerate(events):
        for variable in dict.fromkeys(_read(event)):
            for setter in setters.get(variable, ()):
                if setter != number:
                    first[setter].append(number)
    group: list[GroundEvent] = []
    for component in components(first):
        own = [events[number] for number in sorted(component)]
        if group and _size([*group, *own]) > _MOST_TOGETHER:
            yield group
            group = []
        group += own
    if group:
        yield group


def _read(event: GroundEvent) -> Iterator[int]:
    yield from variables(event.precondition)
    for effect in effects_of(event.factors):
        yield from () if effect.when is None else variables(effect.when)
    for charge in charges_of(event.factors):
        yield from variables(charge.when)


def _size(events: Sequence[GroundEvent]) -> int:
    """How many joint outcomes events have, at most."""
    return prod(_outcomes(factor) for event in events for factor in event.factors)


def _outcomes(factor: Factor) -> int:
    return sum(prod(map(_outcomes, outcome.factors)) for outcome in factor.outcomes)


def _conditional(event: GroundEvent) -> tuple[Factor, ...]:
    """The factors of an event, under its precondition."""
    if event.precondition == TRUE:
        return event.factors
    return tuple(_under(event.precondition, factor) for factor in event.factors)


def _under(condition: Condition, factor: Factor) -> Factor:
    return replace(factor, outcomes=tuple(_outcome_under(condition, each) for each in factor.outcomes))


def _outcome_under(condition: Condition, outcome: Outcome) -> Outcome:
    charges = [replace(each, when=conjunction([condition, each.when])) for each in outcome.charges]
    if outcome.cost or outcome.reward:
        charges.append(Charge(condition, outcome.cost, outcome.reward))
    return Outcome(
        outcome.probability,
        tuple(
            replace(each, when=conjunction([condition, TRUE if each.when is None else each.when]))
            for each in outcome.effects
        ),
        tuple(_under(condition, factor) for factor in outcome.factors),
        charges=tuple(charges),
    )
