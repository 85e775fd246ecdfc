"""What an action does, taken apart: to what is seen, and to each component of hidden facts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from fractions import Fraction

from bbtc.ground import task as gt
from bbtc.ground.condition import FALSE, TRUE, Condition, Is, Known, conjuncts, is_test, replaced, variables
from bbtc.ground.effects import arrange
from bbtc.ground.hidden.groups import Groups
from bbtc.ground.hidden.parts import (
    Parts,
    Setting,
    all_settings,
    drawn_anew,
    effects_of,
    facts_of,
    facts_read,
    only,
    parts_of,
)
from bbtc.kleene import Truth


@dataclass(frozen=True, slots=True)
class Act:
    """An action with its effects on what matters, in parts, and what it tells."""

    action: gt.GroundAction
    parts: Parts
    readings: tuple[gt.Observation, ...]


def act(
    action: gt.GroundAction,
    readings: Iterable[gt.Observation],
    kept: Set[int],
    hidden: frozenset[int],
    odds: Mapping[int, Fraction],
) -> Act:
    """An action, as far as it matters: ``kept`` variables, of which some are ``hidden``. ``odds`` tells
    how likely facts are true that are drawn anew."""
    parts = parts_of(action.factors)
    draws = [only(draw, kept) for draw in parts.draws]
    parts = replace(
        parts,
        settings=[setting for setting in parts.settings if setting.variable in kept],
        draws=[draw for draw in draws if draw is not None],
    )
    readings = _settled(telling(readings, hidden), _certain_after(action, hidden))
    return Act(action, drawn_anew(parts, odds), tuple(readings))


def _certain_after(action: gt.GroundAction, hidden: frozenset[int]) -> dict[int, Truth]:
    """The values of seen variables that an action leaves for sure: what it sets, and what it asks for and
    does not touch."""
    sets: dict[int, set[Truth | None]] = {}
    parts = parts_of(action.factors)
    for setting in parts.settings:
        sets.setdefault(setting.variable, set()).add(setting.value if setting.when is None else None)
    for setting in all_settings(parts.draws):
        sets.setdefault(setting.variable, set()).add(None)
    found = {}
    for variable, values in sets.items():
        if len(values) == 1 and None not in values:
            found[variable] = next(value for value in values if value is not None)
    for part in conjuncts(action.precondition):
        if isinstance(part, Is) and not is_test(part) and part.variable not in sets:
            found[part.variable] = part.value
    return {variable: value for variable, value in found.items() if variable not in hidden}


def _settled(readings: Iterable[gt.Observation], certain: Mapping[int, Truth]) -> Iterator[gt.Observation]:
    """Readings without conditions that are certain; those that are not made are left out."""

    def leaf(read: Is | Known) -> Condition:
        value = certain.get(read.variable)
        if value is None or is_test(read):
            return read
        return TRUE if isinstance(read, Is) and read.value is value else FALSE

    for reading in readings:
        when = TRUE if reading.when is None else replaced(reading.when, leaf)
        if when != FALSE:
            yield replace(reading, when=None if when == TRUE else when)


def telling(readings: Iterable[gt.Observation], hidden: frozenset[int]) -> tuple[gt.Observation, ...]:
    """The readings that tell something of hidden facts that matter."""
    return tuple(reading for reading in readings if not hidden.isdisjoint(variables(reading.condition)))


def join(groups: Groups, acts: Iterable[Act], first: Iterable[gt.Observation]) -> None:
    """Join the hidden facts that actions, or what is told ``first``, make depend on each other."""
    for reading in first:
        groups.join(_hidden(groups, read_after([reading])))
    for each in acts:
        for setting in each.parts.settings:
            if setting.variable in groups:
                groups.join(_hidden(groups, facts_read(setting.when) | {setting.variable}))
        for charge in each.parts.charges:
            groups.join(_hidden(groups, facts_read(charge.when)))
        for reading in each.readings:
            groups.join(_hidden(groups, read_after([reading])))
        for cluster in _clusters(groups, each):
            groups.join(cluster.hidden)


@dataclass(slots=True)
class _Cluster:
    """Draws of an action that set the same seen variables, so that what is seen of one depends on the
    others; the seen variables that they set, and the hidden facts that they touch, or that a reading of those
    tells of."""

    draws: list[gt.Factor]
    sets: set[int]
    hidden: set[int]


def _clusters(groups: Groups, each: Act) -> list[_Cluster]:
    found: list[_Cluster] = []
    for draw in each.parts.draws:
        sets = {setting.variable for setting in all_settings([draw]) if setting.variable not in groups}
        found = _merged(found, _Cluster([draw], sets, set(_hidden(groups, facts_of(draw)))), sets)
    for reading in each.readings:
        read = read_after([reading])
        if any(cluster.sets & read for cluster in found):
            found = _merged(found, _Cluster([], set(), set(_hidden(groups, read))), read)
    return found


def _merged(clusters: list[_Cluster], new: _Cluster, over: set[int]) -> list[_Cluster]:
    """The clusters with a new one, into which those go that set some of these variables."""
    apart = [cluster for cluster in clusters if not cluster.sets & over]
    for cluster in clusters:
        if cluster.sets & over:
            new.draws[:0] = cluster.draws
            new.sets |= cluster.sets
            new.hidden |= cluster.hidden
    return [*apart, new]


def _hidden(groups: Groups, facts: Iterable[int]) -> list[int]:
    return [fact for fact in facts if fact in groups]


def read_after(readings: Iterable[gt.Observation]) -> set[int]:
    """The variables that readings read, after the action."""
    return {
        variable
        for reading in readings
        for condition in (reading.condition, reading.when)
        if condition is not None
        for variable in variables(condition)
    }


# --- a component of an action --------------------------------------------------------------------


@dataclass(slots=True)
class _Share:
    """What an action does to one component."""

    settings: list[Setting] = field(default_factory=list)
    charges: list[gt.Charge] = field(default_factory=list)
    draws: list[gt.Factor] = field(default_factory=list)
    readings: list[gt.Observation] = field(default_factory=list)


def divided(
    each: Act, groups: Groups, components: Mapping[int, tuple[int, Sequence[int]]]
) -> tuple[tuple[gt.Factor, ...], tuple[gt.Change, ...]]:
    """The factors of what is seen, and the changes of components, which are given by the fact that stands
    for each, with their numbers and facts."""
    shares: dict[int, _Share] = {}

    def share(facts: Iterable[int]) -> _Share | None:
        hidden = _hidden(groups, facts)
        return shares.setdefault(groups.of(hidden[0]), _Share()) if hidden else None

    parts, seen = each.parts, _Share()
    for reading in each.readings:
        of = share(read_after([reading]))
        assert of is not None
        of.readings.append(reading)
    for charge in parts.charges:
        (share(facts_read(charge.when)) or seen).charges.append(charge)
    after = {leader: read_after(of.readings) for leader, of in shares.items()}
    for cluster in _clusters(groups, each):
        of = share(cluster.hidden)
        (seen if of is None else of).draws.extend(cluster.draws)
        if of is not None:
            leader = groups.of(next(iter(cluster.hidden)))
            after[leader] = after.get(leader, set()) | cluster.sets

    def readers(sets: set[int]) -> list[_Share]:
        return [shares[leader] for leader, read in after.items() if read & sets]

    for setting in parts.settings:
        of = share([setting.variable])
        for into in [of] if of is not None else readers({setting.variable}) or [seen]:
            into.settings.append(setting)
    outcome = gt.Outcome(gt.ONE, effects_of(seen.settings), (), parts.reward, parts.cost, tuple(seen.charges))
    factors = arrange([gt.Factor((outcome,)), *seen.draws]) or (gt.NO_CHANGE,)
    changes = [_change(*components[leader], of) for leader, of in sorted(shares.items())]
    return factors, tuple(sorted(changes, key=lambda change: change.component))


def _change(component: int, facts: Sequence[int], share: _Share) -> gt.Change:
    local = Local(facts)
    factors = []
    if share.settings or share.charges:
        certain = gt.Outcome(gt.ONE, effects_of(share.settings), charges=tuple(share.charges))
        factors.append(local.factor(gt.Factor((certain,))))
    factors += [local.factor(draw) for draw in share.draws]
    readings = tuple(local.observation(reading) for reading in share.readings)
    return gt.Change(component, tuple(local.seen), tuple(factors), readings)


class Local:
    """The local variables of a component: its facts, then the task's variables that are asked for."""

    def __init__(self, facts: Sequence[int]) -> None:
        self._facts = {fact: place for place, fact in enumerate(facts)}
        self.seen: list[int] = []
        self._seen: dict[int, int] = {}

    def variable(self, number: int, *, test: bool = False) -> int:
        """The local number of a variable; with ``test``, of what is known of it."""
        if number in self._facts and not test:
            return self._facts[number]
        if number not in self._seen:
            self._seen[number] = len(self._facts) + len(self.seen)
            self.seen.append(number)
        return self._seen[number]

    def condition(self, condition: Condition) -> Condition:
        """A condition over local variables."""
        return replaced(condition, self._leaf)

    def _leaf(self, leaf: Is | Known) -> Condition:
        return replace(leaf, variable=self.variable(leaf.variable, test=is_test(leaf)))

    def factor(self, factor: gt.Factor) -> gt.Factor:
        """A factor over local variables."""
        return replace(factor, outcomes=tuple(map(self._outcome, factor.outcomes)))

    def _outcome(self, outcome: gt.Outcome) -> gt.Outcome:
        effects = tuple(
            gt.Effect(
                None if effect.when is None else self.condition(effect.when),
                tuple((self.variable(number), value) for number, value in effect.sets),
            )
            for effect in outcome.effects
        )
        charges = tuple(replace(each, when=self.condition(each.when)) for each in outcome.charges)
        inner = tuple(map(self.factor, outcome.factors))
        return replace(outcome, effects=effects, factors=inner, charges=charges)

    def observation(self, reading: gt.Observation) -> gt.Observation:
        """An observation over local variables."""
        when = None if reading.when is None else self.condition(reading.when)
        return replace(reading, condition=self.condition(reading.condition), when=when)
