"""What can matter to the goal of a physical task: backward relevance, in which what tells something of a
hidden fact that matters does, too."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Literal, TypeAlias

from bbtc.ground import task as gt
from bbtc.ground.condition import Condition, variables
from bbtc.ground.hidden.parts import all_settings, facts_of, facts_read, parts_of
from bbtc.ground.hidden.physical import Physical
from bbtc.markov import reachable

_Node: TypeAlias = tuple[Literal["variable", "action"], int]


def relevant(physical: Physical, hidden: frozenset[int]) -> tuple[set[int], set[str]]:
    """The variables that matter, and the names of the actions.

    A variable leads to what sets it, with the conditions of that; an action to its precondition and the
    conditions of its charges. A hidden variable leads, besides, to all that stands with it in a draw or a
    condition of the start, in an observation or in a draw of an action, and to the hidden facts that effects
    make of it, if something may be told of them.
    """
    leads: dict[_Node, set[_Node]] = {}
    start: set[_Node] = set(_nodes(physical.task.goal))
    for index, action in enumerate(physical.task.actions):
        node: _Node = ("action", index)
        leads[node] = set(_nodes(action.precondition))
        for charge in gt.charges_of(action.factors):
            leads[node].update(_nodes(charge.when))
        outcomes = list(gt.outcomes_of(action.factors))
        rewarding = any(each.reward or any(c.reward for c in each.charges) for each in outcomes)
        if physical.task.metric == "reward" and rewarding:
            start.add(node)
        for setting in all_settings(action.factors):
            of = leads.setdefault(("variable", setting.variable), set())
            of.add(node)
            if setting.when is not None:
                of.update(_nodes(setting.when))
        for draw in parts_of(action.factors).draws:
            together = facts_of(draw)
            if together & hidden:
                _couple(leads, together)
        for reading in physical.readings.get(action.name, ()):
            for variable, others in _coupled(reading, hidden):
                leads.setdefault(("variable", variable), set()).update({node, *others})
    for reading in physical.first:
        for variable, others in _coupled(reading, hidden):
            leads.setdefault(("variable", variable), set()).update(others)
    for together in _of_start(physical):
        _couple(leads, together)
    for variable, (condition, _) in physical.thresholds.items():
        leads.setdefault(("variable", variable), set()).update(_nodes(condition))
    _tell(physical, hidden, leads)
    for template in physical.task.templates:
        start.update(_of_template(physical.task, template))
    found = reachable(start, lambda node: leads.get(node, ()))
    kept = {number for kind, number in found if kind == "variable"}
    names = {physical.task.actions[number].name for kind, number in found if kind == "action"}
    return kept, names


def _coupled(reading: gt.Observation, hidden: frozenset[int]) -> Iterator[tuple[int, list[_Node]]]:
    """The hidden variables that a reading tells of, each with all that it reads."""
    read = {*variables(reading.condition), *(() if reading.when is None else variables(reading.when))}
    return ((variable, [("variable", other) for other in read]) for variable in read & hidden)


def _nodes(condition: Condition) -> Iterator[_Node]:
    return (("variable", number) for number in variables(condition))


def _couple(leads: dict[_Node, set[_Node]], together: Iterable[int]) -> None:
    """Each of some variables leads to all of them."""
    found = sorted(together)
    for one, other in zip(found, [*found[1:], *found[:1]], strict=True):
        leads.setdefault(("variable", one), set()).add(("variable", other))


def _of_start(physical: Physical) -> Iterator[set[int]]:
    for draw in physical.draws:
        yield set(draw.variables)
    for clause in physical.clauses:
        yield set(variables(clause.condition)) & physical.uncertain


def _tell(physical: Physical, hidden: frozenset[int], leads: dict[_Node, set[_Node]]) -> None:
    """Hidden facts lead to what effects make of them, where something may be told of that."""
    comes: dict[int, set[int]] = {}
    for together in _of_start(physical):
        order = sorted(together)
        for one, other in zip(order, [*order[1:], *order[:1]], strict=True):
            comes.setdefault(one, set()).add(other)
    for action in physical.task.actions:
        for setting in all_settings(action.factors):
            comes.setdefault(setting.variable, set()).update(facts_read(setting.when) & hidden)
        for draw in parts_of(action.factors).draws:
            together = facts_of(draw)
            if together & hidden:
                for variable in together:
                    comes.setdefault(variable, set()).update(together & hidden)
    told = {
        variable
        for readings in (*physical.readings.values(), physical.first)
        for reading in readings
        for variable in variables(reading.condition)
        if variable in hidden
    }
    may_tell = reachable(told, lambda variable: comes.get(variable, ()))
    for variable in may_tell:
        for source in comes.get(variable, ()):
            leads.setdefault(("variable", source), set()).add(("variable", variable))


def _of_template(task: gt.Task, template: gt.GroundTemplate) -> Iterator[_Node]:
    numbers = {action.name: index for index, action in enumerate(task.actions)}
    yield from _nodes(template.precondition)
    for setting in all_settings(template.factors):
        yield "variable", setting.variable
        if setting.when is not None:
            yield from _nodes(setting.when)
    for part in gt.walk_body(template.body):
        if isinstance(part, gt.BodyCondition):
            yield from _nodes(part.condition)
        elif isinstance(part, gt.BodyAction):
            yield "action", numbers[part.action]
