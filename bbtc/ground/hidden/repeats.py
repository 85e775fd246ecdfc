"""Readings that stay: whether a reading is wrong is a hidden fact of its own, drawn anew when a fact that the
reading tells of gets another value. What is told then is exact: whether the one holds without the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from bbtc.ground import task as gt
from bbtc.ground.condition import TRUE, Condition, Is, conjunction, disjunction, negation, variables
from bbtc.ground.hidden.parts import Setting, effects_of, settings_of
from bbtc.kleene import Truth


@dataclass(frozen=True, slots=True)
class Kept:
    """A noisy observation that is kept: what it tells, how probably it is right where that is true, or
    false (None: both), and the name of the fact that it is wrong."""

    condition: Condition
    accuracy: Fraction
    name: str
    args: tuple[str, ...]
    where: bool | None = None


class Keeping:
    """The facts that readings are wrong, as variables behind those of a task."""

    def __init__(self, task: gt.Task) -> None:
        self._task = task
        self._taken = {variable.predicate for variable in task.variables}
        self.facts: list[tuple[gt.Variable, Kept]] = []
        self._numbers: dict[Kept, int] = {}

    def told(self, reading: gt.Observation, name: str, args: tuple[str, ...]) -> Condition:
        """What a reading tells exactly, be it right or wrong."""
        condition = reading.condition
        if reading.accuracy_false is None:
            wrong = self._wrong(Kept(condition, reading.accuracy, name, args))
            return disjunction(
                [conjunction([condition, negation(wrong)]), conjunction([negation(condition), wrong])]
            )
        missed = self._wrong(Kept(condition, reading.accuracy, name, args, where=True))
        seen = self._wrong(Kept(condition, reading.accuracy_false, name, args, where=False))
        return disjunction(
            [conjunction([condition, negation(missed)]), conjunction([negation(condition), seen])]
        )

    def _wrong(self, kept: Kept) -> Condition:
        """That it is wrong."""
        number = self._numbers.get(kept)
        if number is None:
            number = self._numbers[kept] = len(self._task.variables) + len(self.facts)
            predicate = gt.unused_name(
                gt.MISREAD + ("not " if kept.where is False else "") + kept.name, self._taken
            )
            self.facts.append((gt.Variable(predicate, kept.args, three_valued=False), kept))
        return Is(number, Truth.TRUE)

    def odds(self) -> Mapping[int, Fraction]:
        """How probable it is that each reading is wrong."""
        return {number: 1 - kept.accuracy for kept, number in self._numbers.items()}

    def actions(self) -> tuple[gt.GroundAction, ...]:
        """The actions, which draw anew whether readings are wrong where they change what these tell of."""
        readers: dict[int, list[int]] = {}
        for kept, number in self._numbers.items():
            for variable in dict.fromkeys(variables(kept.condition)):
                readers.setdefault(variable, []).append(number)
        return tuple(
            replace(action, factors=tuple(_drawing(factor, readers) for factor in action.factors))
            for action in self._task.actions
        )


def _drawing(factor: gt.Factor, readers: Mapping[int, Sequence[int]]) -> gt.Factor:
    return replace(factor, outcomes=tuple(_with_draws(each, readers) for each in factor.outcomes))


def _with_draws(outcome: gt.Outcome, readers: Mapping[int, Sequence[int]]) -> gt.Outcome:
    settings = list(settings_of(outcome))
    surely = {setting.variable: setting.value for setting in settings if setting.when is None}
    more = []
    for when, variable, value in settings:
        if value < surely.get(variable, value):
            continue  # another effect of the outcome decides
        changes = TRUE if value is Truth.UNKNOWN else negation(Is(variable, value))
        guard = conjunction([TRUE if when is None else when, changes])
        more += [
            Setting(None if guard == TRUE else guard, number, Truth.UNKNOWN)
            for number in readers.get(variable, ())
        ]
    inner = tuple(_drawing(factor, readers) for factor in outcome.factors)
    return replace(outcome, effects=effects_of([*settings, *more]), factors=inner)
