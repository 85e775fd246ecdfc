"""What a tree attains in the worst world that hidden facts may make at the start: nobody may know the odds.

The robot believes what it would believe anyway; only what happens, and what it is told, is that of one world.
The chain holds the worlds beside what is believed, as octets behind the values of a state.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import inf, prod

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import explore
from bbtc.belief.draws import PLACES, Draw, Drawer, Values, compile_factor, product_of, unbounded
from bbtc.belief.hidden import Readings, beliefs_of, case_of, place_of, true_in_worlds
from bbtc.belief.state import Transition, results_of
from bbtc.belief.tick import NodeStatus
from bbtc.ground.condition import variables
from bbtc.ground.task import MISREAD, NO_CHANGE, ONE, ZERO, Change, Component, GroundAction, Task
from bbtc.kleene import Truth
from bbtc.limits import MOST_WORLDS, Limits
from bbtc.markov import distribution, independent
from bbtc.tree.nodes import Node, actions_of


@dataclass(frozen=True, slots=True)
class WorstWorld:
    """A world at the start that gives a tree the least success probability, which is ``success``: the facts
    that matter to the tree and that the start leaves open, and which of them are ``true``."""

    success: Fraction
    facts: tuple[str, ...]
    true: frozenset[str]


def with_worlds(task: Task) -> Task | None:
    """The task with all that is hidden, as long as that is known; None where nothing is, or it is not."""
    names = [variable.name for variable in task.variables]
    for found in (task.unlowered, task.origin, task):
        if found is not None and found.components and names == [each.name for each in found.variables]:
            told = {each.variable for component in found.components for each in component.known}
            open_ = (at for at, variable in enumerate(found.variables) if variable.hidden and at not in told)
            return None if any(True for _ in open_) else found
    return None


def worst_world(task: Task, root: Node, limits: Limits) -> WorstWorld | None:
    """The world at the start in which a tree succeeds least often; None where no hidden facts are known, or
    those that matter have more than 4,096 worlds together. Raises ``LimitReached``."""
    full = with_worlds(task)
    if full is None:
        return None
    search = _Worlds(full, root)
    return search.worst(limits) if search.count <= MOST_WORLDS else None


class _Worlds:
    def __init__(self, task: Task, root: Node) -> None:
        self._task, self._root = task, root
        names = {node.action for node in actions_of(root)}
        self._actions = [action for action in task.actions if action.name in names]
        asked = set(variables(task.goal))
        matter = {change.component for action in self._actions for change in action.changes}
        for index, component in enumerate(task.components):
            if component.first or any(each.variable in asked for each in component.known):
                matter.add(index)
        self._matter = sorted(matter)
        self._place: dict[int, int] = {}
        """Where the world of a component stands in the values of a state, an octet for each fact."""
        place = len(task.variables) + PLACES * len(task.components)
        for index in self._matter:
            self._place[index] = place
            place += len(task.components[index].facts)
        self._changes: dict[Change, tuple[Readings, dict[tuple[int, bytes, int], dict[Draw, Fraction]]]] = {}
        components = [task.components[index] for index in self._matter]
        self.count = prod(inf if each.diagram is not None else len(each.prior) for each in components)
        """So many worlds those that matter have together."""

    def worst(self, limits: Limits) -> WorstWorld:
        """The worst of all worlds, the first of several."""
        task = self._task
        priors = [_drawn_by_nobody(task.components[index]) for index in self._matter]
        every = list(product(*priors))
        began = [
            distribution(
                (values, p * q)
                for worlds, p in independent(
                    [prior[each] for prior, each in zip(priors, picked, strict=True)]
                )
                for values, q in self._starts(worlds)
            )
            for picked in every
        ]
        starts = dict.fromkeys((values for each in began for values in each), ONE)
        moves = {action.name: self._transition(action) for action in self._actions}
        chain = explore(task, self._root, limits, moves, starts)
        won = {
            state: ONE for state in chain.final if self._won(chain.status[state], chain.states[state].values)
        }
        chances = Absorption(chain).hitting(won)
        at = {values: chances[number] for values, (_, number) in zip(starts, chain.initial, strict=True)}
        success = [sum((p * at[values] for values, p in each.items()), ZERO) for each in began]
        least = min(success)
        worlds = dict(zip(self._matter, every[success.index(least)], strict=True))
        facts = [
            (fact, bool(world >> bit & 1))
            for prior, (index, world) in zip(priors, worlds.items(), strict=True)
            for bit, fact in enumerate(task.components[index].facts)
            if any((world ^ other) >> bit & 1 for other in prior)
        ]
        return WorstWorld(least, tuple(f for f, _ in facts), frozenset(fact for fact, true in facts if true))

    def _starts(self, worlds: Sequence[int]) -> Iterator[tuple[Values, Fraction]]:
        """The states that a run may begin in, in some worlds, with their probabilities."""
        task = self._task
        first = [Change(at, each.seen, (), each.first) for at, each in enumerate(task.components)]
        found: list[tuple[Values, Fraction]] = []
        for state in task.initial:
            values = bytes(state.values)
            for component in task.components:
                values += beliefs_of(component).prior.to_bytes(PLACES, "big")
            for index, world in zip(self._matter, worlds, strict=True):
                values += bytes(2 * (world >> bit & 1) for bit in range(len(task.components[index].facts)))
            drawers = [self._drawer(first[index]) for index in self._matter]
            results = results_of(values, ZERO, product_of(values, drawers, unbounded))
            found += [(result.values, state.probability * result.probability) for result in results]
        yield from distribution(found).items()

    def _transition(self, action: GroundAction) -> Transition:
        """What an action leads to in one world."""
        drawers = [compile_factor(factor, unbounded) for factor in action.factors if factor != NO_CHANGE]
        drawers += [self._drawer(change) for change in action.changes]
        return lambda values: results_of(values, action.cost, product_of(values, drawers, unbounded))

    def _drawer(self, change: Change) -> Drawer:
        """A change in one world. What it costs there is nobody's question."""
        readings, known = self._changes.setdefault(change, (Readings(self._task, change, unbounded), {}))
        first, place = place_of(self._task, change.component), self._place[change.component]
        facts = len(self._task.components[change.component].facts)

        def draw(values: Values) -> dict[Draw, Fraction]:
            number, seen = case_of(self._task, change, values)
            world = _world(values, place, facts)
            found = known.get((number, seen, world))
            if found is None:
                found = known[number, seen, world] = distribution(
                    ((tuple(sorted(sets)), ZERO, ZERO), p) for sets, p in results(number, seen, world)
                )
            return found

        def results(number: int, seen: bytes, world: int) -> Iterator[tuple[list[tuple[int, int]], Fraction]]:
            for shown, belief, after, p in readings.in_world(number, seen, world):
                sets = [(change.seen[at], value) for at, value in shown]
                sets += readings.beliefs.known(belief)
                sets += [(first + at, octet) for at, octet in enumerate(belief.to_bytes(PLACES, "big"))]
                sets += [(place + bit, 2 * (after >> bit & 1)) for bit in range(facts)]
                yield sets, p

        return draw

    def _won(self, status: NodeStatus, values: Values) -> bool:
        worlds = {
            index: _world(values, place, len(self._task.components[index].facts))
            for index, place in self._place.items()
        }
        return status is NodeStatus.SUCCESS and true_in_worlds(self._task, self._task.goal, values, worlds)


def _drawn_by_nobody(component: Component) -> dict[int, dict[int, Fraction]]:
    """By what is true of the facts that somebody or something set before the start: the worlds in which that
    is so, and how likely each of them is then. Whether a reading is wrong that stays is noise, and drawn."""
    noise = sum(1 << bit for bit, fact in enumerate(component.facts) if fact.startswith(MISREAD))
    found: dict[int, dict[int, Fraction]] = {}
    for world, p in component.prior:
        if p:
            found.setdefault(world & ~noise, {})[world] = p
    for worlds in found.values():
        whole = sum(worlds.values())
        worlds.update({world: p / whole for world, p in worlds.items()})
    return found


def _world(values: Values, place: int, facts: int) -> int:
    return sum(1 << bit for bit in range(facts) if values[place + bit] == Truth.TRUE)
