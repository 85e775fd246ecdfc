"""The chain of a tree (:mod:`bbtc.belief.chain`) with the time that its actions take.

Physical states know no clock: time is a second quantity, added up along the edges. Ticks take none, and an
action takes its duration, drawn independently of its outcome and of all others. Where it may be given up,
whether that is so decides both about its outcome and about its time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise

from bbtc import durations
from bbtc.belief.chain import Chain
from bbtc.belief.draws import Values
from bbtc.belief.state import Result, Transition, compile_action, compile_parts
from bbtc.durations import INSTANT, Bounds, Taken, UpTo
from bbtc.ground.task import ONE, ZERO, Factor, GroundAction, Task
from bbtc.limits import Limits
from bbtc.markov import distribution


@dataclass(frozen=True, slots=True)
class Happening:
    """One way in which an action takes time: how probable it is, what it takes (no longer than ``at_most``,
    if that is given), and where it leads, with probabilities that sum to 1."""

    chance: Fraction
    duration: Taken
    at_most: Fraction | None
    moves: tuple[tuple[int, Fraction], ...]

    @property
    def mean(self) -> Bounds:
        """The expected number of seconds."""
        if self.at_most is None:
            return durations.mean(self.duration)
        sure = durations.within(self.duration, self.at_most)
        part = durations.partial_mean(self.duration, self.at_most)
        return part[0] / sure[1], min(self.at_most, part[1] / sure[0]) if sure[0] else self.at_most


class Untimed(Exception):
    """Why nothing can be said of the time that a tree takes."""


def timed(task: Task) -> bool:
    """Does any action of the task say how long it takes?"""
    return any(action.duration is not None or action.timeout is not None for action in task.actions)


def untimed_actions(task: Task, chain: Chain) -> tuple[str, ...]:
    """The schemas of those actions of the tree that do not say how long they take: it counts as no time."""
    actions = (task.action_by_name[node.action] for node in chain.actions)
    return tuple(
        dict.fromkeys(each.schema for each in actions if each.duration is None and each.timeout is None)
    )


def happenings(task: Task, chain: Chain, limits: Limits) -> tuple[tuple[Happening, ...], ...]:
    """For each state of the chain, the ways in which its action takes time; none in a final state. Raises
    :class:`Untimed`, and :class:`bbtc.diagnostics.LimitReached`."""
    if chain.given_up:
        raise Untimed("an action is given up by the tick after the one that starts it")
    doings: dict[str, Doing] = {}
    found: list[tuple[Happening, ...]] = []
    for state, action in enumerate(chain.action):
        if action < 0:
            found.append(())
            continue
        if state % 1024 == 0:
            limits.check_time("adding up durations")
        name = chain.actions[action].action
        if name not in doings:
            doings[name] = Doing(task, task.action_by_name[name], limits)
        found.append(doings[name].happenings(chain, state))
    return tuple(found)


def _nothing(values: Values) -> tuple[Result, ...]:
    del values
    return ()


@dataclass(frozen=True, slots=True)
class _Way:
    """Where an action may be given up, or aborted: one of these, with the results of its transition, whose
    probabilities may sum to less than 1."""

    chance: Fraction
    duration: Taken
    at_most: Fraction | None
    transition: Transition = _nothing


class Doing:
    """An action in time, divided by whether it is given up."""

    def __init__(self, task: Task, action: GroundAction, limits: Limits) -> None:
        self._ways: list[_Way] = []
        given_up = chance_given_up(action)
        if not given_up:
            self._add(task, action, limits, _Way(ONE, action.duration or INSTANT, None))
            return
        if action.duration is None:
            raise Untimed(f"{action.name} does not say how long it takes where its time-out does not pass")
        assert action.timeout is not None
        late = _Way(given_up, durations.Fixed(action.timeout), None)
        self._add(task, _only(action, timed_out=True), limits, late)
        if given_up < 1:
            usual = _Way(1 - given_up, action.duration, action.timeout)
            self._add(task, _only(action, timed_out=False), limits, usual)

    def _add(self, task: Task, action: GroundAction, limits: Limits, way: _Way) -> None:
        """Add the action in this way; where events may abort it, some time up to its end."""
        if action.during is None or not task.events:
            self._ways.append(replace(way, transition=compile_action(task, action, limits)))
            return
        ends, aborted = compile_parts(task, action, limits)
        sooner = way.duration if isinstance(way.duration, UpTo) else UpTo(way.duration)
        self._ways.append(replace(way, transition=ends))
        self._ways.append(_Way(way.chance, sooner, None, aborted))

    def happenings(self, chain: Chain, state: int) -> tuple[Happening, ...]:
        """The ways in which it takes time in a state of a chain that starts it."""
        successor = {edge.result.values: edge.successor for edge in chain.edges[state]}
        return self.ways_from(chain.states[state].values, successor)

    def ways_from(self, values: Values, number: Mapping[Values, int]) -> tuple[Happening, ...]:
        """The ways in which it takes time in a state with these values; what it leads to is numbered."""
        found = []
        for way in self._ways:
            results = way.transition(values)
            share = sum((result.probability for result in results), ZERO)
            if share:
                moves = distribution(
                    (number[result.values], result.probability / share) for result in results
                )
                found.append(Happening(way.chance * share, way.duration, way.at_most, tuple(moves.items())))
        return tuple(found)


def chance_given_up(action: GroundAction) -> Fraction:
    """How probably the time-out of an action passes."""
    return sum(
        (each.probability for factor in action.factors for each in factor.outcomes if each.timed_out),
        Fraction(0),
    )


def _only(action: GroundAction, *, timed_out: bool) -> GroundAction:
    """The action, given that it is given up, or is not."""
    return replace(action, factors=tuple(_part(factor, timed_out) for factor in action.factors))


def _part(factor: Factor, timed_out: bool) -> Factor:
    if not any(outcome.timed_out for outcome in factor.outcomes):
        return factor
    kept = [outcome for outcome in factor.outcomes if outcome.timed_out is timed_out]
    total = sum((outcome.probability for outcome in kept), Fraction(0))
    return replace(
        factor, outcomes=tuple(replace(each, probability=each.probability / total) for each in kept)
    )


def time_of_run(ways: Sequence[Sequence[Happening]], visited: Sequence[int]) -> Bounds:
    """The expected number of seconds of a run through these states."""
    least = most = Fraction(0)
    for state, successor in pairwise(visited):
        shares = [
            (each.chance * probability, each.mean)
            for each in ways[state]
            for target, probability in each.moves
            if target == successor
        ]
        total = sum((share for share, _ in shares), Fraction(0))
        least += sum((share * mean[0] for share, mean in shares), Fraction(0)) / total
        most += sum((share * mean[1] for share, mean in shares), Fraction(0)) / total
    return least, most
