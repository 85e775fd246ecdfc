"""Effects, and what is believed of hidden facts after them, by Bayes' rule on lists of worlds; written apart
from :mod:`bbtc.belief`.

A world of a component is the values of its facts. What is believed is the probability of each possible world.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import TypeVar

from bbtc.ground.task import Change, Factor, Observation, Outcome, Task
from bbtc.replay.script import Values
from tests.replay.reference import value_of

Belief = tuple[tuple[Values, Fraction], ...]
Beliefs = tuple[Belief, ...]
"""What is believed of each component."""
Sets = tuple[tuple[int, int], ...]
Reading = tuple[bool | None, ...]
"""What each observation tells; None where it is not made."""
_Shows = TypeVar("_Shows", bound=Hashable)


@dataclass(frozen=True)
class Shown:
    """One of the things that an action may show: what it sets of what is seen, and what is believed then."""

    chance: Fraction
    sets: Sets
    cost: Fraction
    reward: Fraction
    beliefs: Beliefs


def first_beliefs(task: Task, values: Values) -> Iterator[tuple[Fraction, Values, Beliefs]]:
    """What may be believed once all is read that is read at the start."""
    ways = []
    for component in task.components:
        facts = range(len(component.facts))
        prior = [(tuple(2 * (world >> at & 1) for at in facts), p) for world, p in component.prior]
        seen = tuple(values[each] for each in component.seen)
        told = [
            (p * chance, reading, world)
            for world, p in prior
            for chance, reading in _readings(component.first, world + seen)
        ]
        ways.append([(chance, belief) for _, chance, belief in _sorted_out(told)])
    for way in product(*ways):
        beliefs = tuple(belief for _, belief in way)
        yield _all(chance for chance, _ in way), with_knowledge(task, values, beliefs), beliefs


def after_changes(task: Task, changes: Sequence[Change], values: Values, beliefs: Beliefs) -> Iterator[Shown]:
    """All that the changes of an action may show."""
    ways = [list(_after(task, change, values, beliefs[change.component])) for change in changes]
    for way in product(*ways):
        after = list(beliefs)
        for change, shown in zip(changes, way, strict=True):
            (after[change.component],) = shown.beliefs
        yield Shown(
            _all(shown.chance for shown in way),
            tuple(each for shown in way for each in shown.sets),
            sum((shown.cost for shown in way), Fraction(0)),
            sum((shown.reward for shown in way), Fraction(0)),
            tuple(after),
        )


def _after(task: Task, change: Change, values: Values, belief: Belief) -> Iterator[Shown]:
    """What a change may show, with the belief of its component alone."""
    facts = len(task.components[change.component].facts)
    seen = tuple(values[each] for each in change.seen)
    told: list[tuple[Fraction, tuple[Sets, Reading], Values]] = []
    costs: dict[tuple[Sets, Reading], tuple[Fraction, Fraction]] = {}
    for world, p in belief:
        for chance, sets, cost, reward in every(change.factors, world + seen):
            after = changed(world + seen, sets)
            both = zip(change.seen, seen, after[facts:], strict=True)
            settled = tuple((variable, now) for variable, before, now in both if now != before)
            for exact, reading in _readings(change.observations, after):
                share, shows = p * chance * exact, (settled, reading)
                told.append((share, shows, after[:facts]))
                paid, earned = costs.get(shows, (Fraction(0), Fraction(0)))
                costs[shows] = paid + share * cost, earned + share * reward
    for shows, chance, found in _sorted_out(told):
        cost, reward = costs[shows]
        yield Shown(chance, shows[0], cost / chance, reward / chance, (found,))


def _readings(observations: Sequence[Observation], values: Values) -> Iterator[tuple[Fraction, Reading]]:
    """What may be read in a world, with its probability; nothing where it is not looked."""
    ways: list[list[tuple[Fraction, bool | None]]] = []
    for each in observations:
        if each.when is not None and value_of(each.when, values) != "T":
            ways.append([(Fraction(1), None)])
            continue
        truth = value_of(each.condition, values) == "T"
        otherwise = each.accuracy if each.accuracy_false is None else each.accuracy_false
        right = each.accuracy if truth else otherwise
        noisy = [(right, truth), (1 - right, not truth)]
        ways.append([(chance, said) for chance, said in noisy if chance])
    for way in product(*ways):
        yield _all(chance for chance, _ in way), tuple(said for _, said in way)


def _sorted_out(
    told: Sequence[tuple[Fraction, _Shows, Values]],
) -> Iterator[tuple[_Shows, Fraction, Belief]]:
    """For each thing shown its probability, and what is believed then."""
    weights: dict[_Shows, dict[Values, Fraction]] = {}
    for share, shows, world in told:
        of = weights.setdefault(shows, {})
        of[world] = of.get(world, Fraction(0)) + share
    for shows, of in weights.items():
        chance = sum(of.values(), Fraction(0))
        yield shows, chance, tuple(sorted((world, share / chance) for world, share in of.items() if share))


def with_knowledge(task: Task, values: Values, beliefs: Beliefs) -> Values:
    """The values, those that tell what is known of hidden facts being what is believed."""
    after = list(values)
    for component, belief in zip(task.components, beliefs, strict=True):
        for each in component.known:
            words = {
                word: sum((p for world, p in belief if value_of(each.condition, world) == word), Fraction(0))
                for word in "TF"
            }
            sure = [word for word in "TF" if words[word] >= each.at_least]
            after[each.variable] = {"T": 2, "F": 0}[sure[0]] if sure else 1
    return tuple(after)


def _all(chances: Iterator[Fraction]) -> Fraction:
    found = Fraction(1)
    for chance in chances:
        found *= chance
    return found


def every(factors: tuple[Factor, ...], values: Values) -> Iterator[tuple[Fraction, Sets, Fraction, Fraction]]:
    """Every combination of one outcome for each factor: probability, settings, cost, reward."""
    if not factors:
        yield Fraction(1), (), Fraction(0), Fraction(0)
        return
    for outcome in factors[0].outcomes:
        for p, sets, cost, reward in every(outcome.factors + factors[1:], values):
            due = [charge for charge in outcome.charges if value_of(charge.when, values) == "T"]
            yield (
                outcome.probability * p,
                _settings(outcome, values) + sets,
                outcome.cost + cost + sum(charge.cost for charge in due),
                outcome.reward + reward + sum(charge.reward for charge in due),
            )


def _settings(outcome: Outcome, values: Values) -> Sets:
    return tuple(
        (variable, int(value))
        for effect in outcome.effects
        if effect.when is None or value_of(effect.when, values) == "T"
        for variable, value in effect.sets
    )


def changed(values: Values, sets: Sets) -> Values:
    """The values after all settings at once; of two values for one variable the greater wins."""
    after = list(values)
    for variable in {variable for variable, _ in sets}:
        after[variable] = max(value for each, value in sets if each == variable)
    return tuple(after)
