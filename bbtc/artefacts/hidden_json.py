"""What is hidden in a task, as JSON; :mod:`bbtc.artefacts.task_json` puts it in its place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from bbtc.artefacts.conditions import condition_to_json
from bbtc.artefacts.cursor import At
from bbtc.artefacts.numbers import given_text
from bbtc.artefacts.prior_json import prior_to_json
from bbtc.ground.task import Component, Knowledge, Observation, Task, TrueWorld, Variable

Json: TypeAlias = dict[str, object]


def component_to_json(component: Component, task: Task) -> Json:
    """A component as a JSON object."""
    local = component.local(task, component.seen)
    value: Json = {
        "facts": list(component.facts),
        "prior": prior_to_json(component),
        "known": [_knowledge_to_json(knowledge, task, local) for knowledge in component.known],
    }
    if component.seen:
        value["seen"] = [task.variables[variable].name for variable in component.seen]
    if component.first:
        value["first"] = [observation_to_json(observation, local) for observation in component.first]
    return value


def _knowledge_to_json(knowledge: Knowledge, task: Task, local: Sequence[Variable]) -> Json:
    value: Json = {
        "variable": task.variables[knowledge.variable].name,
        "condition": condition_to_json(knowledge.condition, local),
    }
    return value | ({"at_least": given_text(knowledge.at_least)} if knowledge.at_least != 1 else {})


def observation_to_json(observation: Observation, local: Sequence[Variable]) -> Json:
    """An observation over local variables as a JSON object."""
    value: Json = {"condition": condition_to_json(observation.condition, local)}
    if observation.when is not None:
        value["when"] = condition_to_json(observation.when, local)
    if observation.accuracy != 1:
        value["accuracy"] = given_text(observation.accuracy)
    if observation.accuracy_false is not None:
        value["accuracy_false"] = given_text(observation.accuracy_false)
    return value


def true_world_to_json(world: TrueWorld) -> Json:
    """A true world as a JSON object."""
    value: Json = {"true": sorted(world.true)}
    return value | ({"false": sorted(world.false)} if world.false else {})


def true_world(at: At) -> TrueWorld:
    """Inverse of :func:`true_world_to_json`."""
    members = at.members(["true"], ["false"])
    false = members["false"].strings() if "false" in members else ()
    return TrueWorld(frozenset(members["true"].strings()), frozenset(false))
