"""Threats: an action of a later branch undid a condition that an earlier branch needs.

Source: the paper's section "Iterative Behavior Tree Expansion", after Colledanchise, Almeida,
Ögren, "Towards Blended Reactive Planning and Acting using Behavior Trees" (2019): the branch of
the threatening action is moved before the threatened condition.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from bbtc.ground.condition import evaluate
from bbtc.ground.task import Effect, GroundAction, GroundTemplate, Task, apparent_factors, effects_of
from bbtc.kleene import Truth
from bbtc.planner.chaining.choose import Flaw
from bbtc.planner.chaining.draft import Attempt, Draft, Subgoal, actions_in


@dataclass(frozen=True, slots=True)
class Threat:
    """``siblings[later]`` holds an executed action that undoes what ``siblings[earlier]`` needs."""

    siblings: list[Subgoal]
    earlier: int
    later: int
    action: str

    def resolve(self) -> None:
        """Move the later branch before the earlier one."""
        self.siblings.insert(self.earlier, self.siblings.pop(self.later))

    def take_back(self) -> None:
        """Undo :meth:`resolve`."""
        self.siblings.insert(self.later, self.siblings.pop(self.earlier))


def find_threat(
    draft: Draft,
    flaw: Flaw,
    started: frozenset[Attempt],
    moved: set[tuple[Subgoal, Subgoal]],
) -> Threat | None:
    """The innermost threat to a flaw among the attempts that were ``started`` in its states, if
    the pair of branches was not ``moved`` before (in either direction)."""
    if flaw.value is not Truth.FALSE:
        return None
    subgoal = flaw.subgoal
    while True:
        siblings = subgoal.parent.preconditions if subgoal.parent is not None else draft.goals
        # (A precondition found missing stands among its siblings only once it is resolved.)
        places = [place for place, sibling in enumerate(siblings) if sibling is subgoal]
        earlier = places[0] if places else len(siblings)
        for later in range(earlier + 1, len(siblings)):
            pair = (subgoal, siblings[later])
            if pair in moved or pair[::-1] in moved:
                continue
            for attempt in _attempts(siblings[later]):
                if attempt in started and undoes(draft.task, attempt, flaw):
                    assert attempt.doing is not None
                    return Threat(siblings, earlier, later, attempt.doing.name)
        if subgoal.parent is None:
            return None
        subgoal = subgoal.parent.subgoal


def undoes(task: Task, attempt: Attempt, flaw: Flaw) -> bool:
    """Can what was attempted make the flaw's condition other than true, as it is in its states?"""
    condition = flaw.subgoal.condition
    for effect in _effects(task, attempt):
        for state, _ in flaw.states:
            # The state without the effect: was the condition true before these values were set?
            values = bytearray(state.values)
            for variable, value in effect.sets:
                if values[variable] == value:
                    values[variable] = 2 - value
            if evaluate(condition, values) is Truth.TRUE:
                return True
    return False


def _effects(task: Task, attempt: Attempt) -> Iterator[Effect]:
    """Everything an attempt can do; of a template, what the actions of its body do."""
    match attempt.doing:
        case GroundAction():
            yield from effects_of(apparent_factors(task, attempt.doing))
        case GroundTemplate():
            for action in actions_in(task, attempt.doing.body):
                yield from effects_of(apparent_factors(task, action))
        case None:
            return


def _attempts(subgoal: Subgoal) -> Iterator[Attempt]:
    stack = [subgoal]
    while stack:
        for attempt in stack.pop().attempts():
            yield attempt
            stack.extend(attempt.preconditions)
