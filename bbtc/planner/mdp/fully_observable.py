"""A task without hidden facts in which everything can be done that can be done with them, and more: the
robot sees the world.

Its P* is an upper bound on that of the task (Hauskrecht 2000). What preconditions and the goal ask of hidden
facts is so in the world, since what is known is true; what they ask of the knowledge itself, and of what is
only believed, counts as met.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from math import prod

from bbtc.ground.condition import TRUE, Condition, Is, Known, is_test, negation, replaced, variables
from bbtc.ground.pruning.renumber import Renumbering
from bbtc.ground.task import (
    ONE,
    Change,
    Factor,
    GroundAction,
    InitialState,
    Task,
    Variable,
    charges_of,
    effects_of,
    split_name,
)
from bbtc.kleene import Truth

MOST_STARTS = 10_000
"""Worlds of all components together that are spelled out."""


def fully_observable(task: Task) -> Task | None:
    """The task in which all is seen; None where there are too many worlds to begin in, and where effects read
    what is known: to see more might then do less."""
    if any(component.diagram is not None for component in task.components):
        return None
    starts = prod((len(component.prior) for component in task.components), start=len(task.initial))
    return None if starts > MOST_STARTS or reads_knowledge(task) else _Seeing(task).task()


def reads_knowledge(task: Task) -> bool:
    """Do effects read what is known? To know more might then do less."""
    known = {each.variable for component in task.components for each in component.known}
    return any(not known.isdisjoint(_read(action)) for action in task.actions)


def _read(action: GroundAction) -> Iterator[int]:
    """The task's variables that effects read."""
    for change in action.changes:
        yield from change.seen
    for effect in effects_of(action.factors):
        yield from () if effect.when is None else variables(effect.when)
    for charge in charges_of(action.factors):
        yield from variables(charge.when)


class _Seeing:
    def __init__(self, task: Task) -> None:
        self._task = task
        self._facts: list[Variable] = []
        self._first: list[int] = []
        self._known: dict[int, Condition] = {}
        for number, component in enumerate(task.components):
            first = len(task.variables) + len(self._facts)
            self._first.append(first)
            for fact in component.facts:
                predicate, args = split_name(fact)
                name = f"world-{number + 1}-{predicate}"  # nothing that is read reaches a tree
                self._facts.append(Variable(name, args, three_valued=False))
            world = Renumbering({at: first + at for at in range(len(component.facts))})
            for each in component.known:
                self._known[each.variable] = world.condition(each.condition) if each.at_least == 1 else TRUE

    def task(self) -> Task:
        """All of it."""
        return replace(
            self._task,
            variables=(*self._task.variables, *self._facts),
            initial=tuple(self._initial()),
            goal=replaced(self._task.goal, self._seen),
            actions=tuple(map(self._action, self._task.actions)),
            templates=(),
            components=(),
        )

    def _initial(self) -> Iterator[InitialState]:
        components = self._task.components
        for worlds in product(*(component.prior for component in components)):
            probability, values = ONE, []
            for component, (world, p) in zip(components, worlds, strict=True):
                probability *= p
                values += [Truth.of(bool(world >> bit & 1)) for bit in range(len(component.facts))]
            for state in self._task.initial:
                yield InitialState(state.probability * probability, (*state.values, *values))

    def _seen(self, leaf: Is | Known) -> Condition:
        """What is asked, where the world is seen."""
        true = self._known.get(leaf.variable)
        if true is None:
            return leaf
        if true is TRUE or is_test(leaf):
            return TRUE
        return true if leaf == Is(leaf.variable, Truth.TRUE) else negation(true)

    def _action(self, action: GroundAction) -> GroundAction:
        factors = (*action.factors, *(each for change in action.changes for each in self._factors(change)))
        return replace(
            action, precondition=replaced(action.precondition, self._seen), factors=factors, changes=()
        )

    def _factors(self, change: Change) -> tuple[Factor, ...]:
        first, facts = self._first[change.component], len(self._task.components[change.component].facts)
        local = {at: first + at for at in range(facts)}
        local |= {facts + at: variable for at, variable in enumerate(change.seen)}
        return Renumbering(local).factors(change.factors)
