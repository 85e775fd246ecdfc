"""Groups of facts of which at most one is true in any state that can be reached, such as a robot's places.

Pairs that are never true together are found as the fixpoint of what pairs can be reached: h² of Haslum and
Geffner, "Admissible heuristics for optimal planning" (2000), with conditional effects. That sees more than
:mod:`bbtc.planner.strong_cyclic.exclusion`, which reads groups off names and unconditional effects: ``(forall
(?p) (not (at ?p)))`` leaves no place, whichever the robot was at. Groups are sets of such pairs whose members
take each other's place by some action; facts that are exclusive only because no action makes them true are
changed by others, each by itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations

from bbtc.belief.state import initial_belief
from bbtc.diagnostics import LimitReached
from bbtc.ground.condition import TRUE
from bbtc.ground.task import Effect, Factor, GroundAction, Outcome, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.packing import ALWAYS, cubes, set_bits
from bbtc.planner.strong_cyclic.determinised import Action, Determinised, Step
from bbtc.planner.strong_cyclic.partial_state import ANY_STATE, PartialState, contradict, united

_MOST_CUBES = 16  # ways for the guard of an effect to hold that are told apart
_MOST_PARTS = 64  # parts of one step whose pairs are told apart
_DOING = "the search for exclusive facts"


@dataclass(frozen=True, slots=True)
class Group:
    """Variables of which at most one is true; ``always`` exactly one."""

    members: tuple[int, ...]
    always: bool


@dataclass(frozen=True, slots=True)
class _Part:
    """What a step makes true and no longer true, as bits, in states that satisfy ``when``."""

    when: PartialState
    makes: int
    ends: int


@dataclass(frozen=True, slots=True)
class _Way:
    """A step of an action in states in which one disjunct of its precondition holds."""

    need: PartialState
    parts: tuple[_Part, ...]

    def certain(self, known: PartialState) -> tuple[int, int]:
        """The bits made true in states that satisfy it, and of the others those that are not true afterwards,
        also where an effect ends them only if they are true."""
        makes = ends = 0
        for part in self.parts:
            lacking = part.when.mask & ~known.mask | (part.when.value ^ known.value) & part.when.mask
            if not lacking:
                makes |= part.makes
                ends |= part.ends
            elif lacking & lacking - 1 == 0 and lacking & part.ends and lacking & part.when.value:
                ends |= lacking
        return makes, ends


def exclusive_groups(task: Task, limits: Limits) -> list[Group]:
    """The groups, in order. None where an action has too many outcomes to look at. Raises
    :class:`bbtc.diagnostics.LimitReached` when the time is over."""
    task = _one_after_another(task)
    try:
        model = Determinised(task, limits)
    except LimitReached:
        if limits.met:
            raise
        return []
    ways = [way for action in model.actions for way in _ways(action, len(task.variables))]
    together = _together(task, ways, limits)
    links = _links(task, ways, together)
    found = dict.fromkeys(
        members
        for families in _families(task).values()
        for members in _united(families, links, together)
        if members & members - 1
    )
    starts = list(initial_belief(task))
    groups = []
    for members in found:
        if not any(members & other == members != other for other in found):
            numbers = tuple(set_bits(members))
            begins = all(any(values[v] == Truth.TRUE for v in numbers) for values in starts)
            groups.append(Group(numbers, begins and all(_keeps_one(way, members) for way in ways)))
    return sorted(groups, key=lambda group: group.members)


def _one_after_another(task: Task) -> Task:
    """The task with events as actions. Those of a round all read the state before it: as if each could happen
    anywhere, with any of its effects, and so could an action that goes on while they do, or its abort."""
    if not task.events:
        return task
    free = GroundAction("", (), TRUE, ())
    actions: list[GroundAction] = []
    for action in task.actions:
        if action.during is None:
            actions.append(action)
        else:
            ends = (action.factors, action.on_abort)
            actions += [replace(free, factors=tuple(map(_anywhere, each))) for each in ends]
    actions += [replace(free, factors=tuple(map(_anywhere, event.factors))) for event in task.events]
    return replace(task, actions=tuple(actions), events=())


def _anywhere(factor: Factor) -> Factor:
    """A factor whose effects may happen, or not, whatever their guards read."""
    return Factor(
        tuple(
            Outcome(
                outcome.probability,
                tuple(effect for effect in outcome.effects if effect.when is None),
                (
                    *map(_anywhere, outcome.factors),
                    *(_perhaps(effect) for effect in outcome.effects if effect.when is not None),
                ),
            )
            for outcome in factor.outcomes
        )
    )


def _perhaps(effect: Effect) -> Factor:
    half = Fraction(1, 2)
    return Factor((Outcome(half, (Effect(None, effect.sets),)), Outcome(half, ())))


def _ways(action: Action, count: int) -> Iterator[_Way]:
    every = (1 << count) - 1
    for step in dict.fromkeys(action.steps):
        parts = tuple(_parts(step, every))
        for need in (ANY_STATE,) if action.needs is None else action.needs:
            yield _Way(need, parts)


def _parts(step: Step, every: int) -> Iterator[_Part]:
    if not step.guarded:
        yield _Part(ANY_STATE, *_bits(step.sets))
        return
    for guarded in step.guarded:
        makes, ends = _bits(guarded.sets)
        whens = [ANY_STATE] if guarded.when == ALWAYS else cubes(guarded.when, _MOST_CUBES)
        if whens is None:  # it may always make true, and never surely ends anything
            whens, ends = [ANY_STATE], 0
        for when in whens:
            yield _Part(when, makes & every, ends & every)


def _bits(sets: Sequence[tuple[int, Truth]]) -> tuple[int, int]:
    makes = ends = 0
    for variable, value in sets:
        if value is Truth.TRUE:
            makes |= 1 << variable
        else:
            ends |= 1 << variable
    return makes, ends


class _Pairs:
    """Which variables may be true together: ``mates[v]`` are the bits of those that may be so with v, itself
    included; 0 of one that is never true."""

    def __init__(self, task: Task) -> None:
        self.mates = [0] * len(task.variables)
        self._some = 0  # all that may be true
        self._every = (1 << len(task.variables)) - 1
        for values in initial_belief(task):
            true = sum(1 << v for v, value in enumerate(values) if value == Truth.TRUE)
            self._join(true, true)

    def _join(self, one: int, other: int) -> bool:
        """Note that each of some may be true together with each of others. Is that news?"""
        news = False
        for bit in set_bits(one):
            fresh = other & ~self.mates[bit]
            if fresh:
                news = True
                self._some |= fresh | 1 << bit
                self.mates[bit] |= fresh
                for mate in set_bits(fresh):
                    self.mates[mate] |= 1 << bit
        return news

    def _possible(self, known: PartialState) -> int | None:
        """The bits of all that may be true with what is known to be; None if that cannot be."""
        room = self._some
        true = known.value & self._every
        for bit in set_bits(true):
            room &= self.mates[bit]
        return None if true & ~room else room & ~(known.mask & ~known.value)

    def grow(self, way: _Way) -> bool:
        """Add the pairs that a step may lead to. Were there new ones?"""
        if self._possible(way.need) is None:
            return False
        news = False
        making = [part for part in way.parts if part.makes and not contradict(way.need, part.when)]
        for part in making:
            known = united(way.need, part.when)
            room = self._possible(known)
            if room is not None:
                makes, ends = way.certain(known)
                news |= self._join(makes, makes | room & ~ends)
        if len(making) > _MOST_PARTS:
            whole = 0
            for part in making:
                whole |= part.makes
            return self._join(whole, whole) or news
        for one, two in combinations(making, 2):
            known = united(way.need, one.when)
            if not contradict(known, two.when) and self._possible(united(known, two.when)) is not None:
                news |= self._join(one.makes, two.makes)
        return news


def _together(task: Task, ways: Sequence[_Way], limits: Limits) -> list[int]:
    """Of each variable, the bits of those that may be true together with it; 0 of one that is never true."""
    pairs = _Pairs(task)
    changed = True
    while changed:
        changed = False
        for number, way in enumerate(ways):
            if number % 256 == 0:
                limits.check_time(_DOING)
            changed |= pairs.grow(way)
    return pairs.mates


def _links(task: Task, ways: Sequence[_Way], together: Sequence[int]) -> dict[int, int]:
    """Of each two-valued variable, the bits of those that take its place, or it theirs."""
    plain = sum(1 << v for v, variable in enumerate(task.variables) if not variable.three_valued)
    links: dict[int, int] = {}
    for way in ways:
        for part in way.parts:
            if not part.makes or contradict(way.need, part.when):
                continue
            _, ends = way.certain(united(way.need, part.when))
            for made in set_bits(part.makes & plain):
                for ended in set_bits(ends & plain & ~together[made]):
                    links[made] = links.get(made, 0) | 1 << ended
                    links[ended] = links.get(ended, 0) | 1 << made
    return links


def _families(task: Task) -> dict[tuple[str, ...], list[int]]:
    """The two-valued variables, as bits, of each predicate that agree in all arguments but at most one, by
    the arguments that they agree in."""
    found: dict[tuple[str, ...], dict[tuple[str, int, int], int]] = {}
    for number, variable in enumerate(task.variables):
        if variable.three_valued:
            continue
        arity = len(variable.args)
        for counted in range(-1, arity):
            key = tuple(sorted(arg for at, arg in enumerate(variable.args) if at != counted))
            kind = (variable.predicate, arity, counted)
            alike = found.setdefault(key, {})
            alike[kind] = alike.get(kind, 0) | 1 << number
    return {key: list(dict.fromkeys(alike.values())) for key, alike in found.items()}


def _united(families: Sequence[int], links: Mapping[int, int], together: Sequence[int]) -> Iterator[int]:
    """Groups made of some families with the same arguments: each with those that are linked to it."""
    own = [each for each in families if all(not together[v] & each & ~(1 << v) for v in set_bits(each))]
    for first in own:
        members, waiting = first, [first]
        for at in waiting:
            near = 0
            for variable in set_bits(at):
                near |= links.get(variable, 0)
            for other in own:
                if not other & near or not other & ~members:
                    continue
                if all(not together[v] & members & ~(1 << v) for v in set_bits(other)):
                    members |= other
                    waiting.append(other)
        yield _linked(members, own, links)


def _linked(members: int, families: Sequence[int], links: Mapping[int, int]) -> int:
    """Of a group, the members that take each other's place: the largest such part, with the others of a
    family of which two do, where no action that is known makes them true or not."""
    best = 0
    left = members
    while left:
        part, waiting = 0, [(left & -left).bit_length() - 1]
        while waiting:
            variable = waiting.pop()
            if not part >> variable & 1:
                part |= 1 << variable
                waiting.extend(set_bits(links.get(variable, 0) & members & ~part))
        left &= ~part
        if part.bit_count() > best.bit_count():
            best = part
    more = best
    for family in families:
        if (family & best).bit_count() > 1:
            more |= sum(1 << v for v in set_bits(family & members & ~best) if v not in links)
    return more


def _keeps_one(way: _Way, members: int) -> bool:
    """Does whatever makes a member no longer true make another one true?"""
    for part in way.parts:
        if part.ends & members and not part.makes & members:
            known = united(way.need, part.when) if not contradict(way.need, part.when) else None
            if known is not None and not way.certain(known)[0] & members:
                return False
    return True
