"""What is hidden in a task, as JSON; :mod:`bbtc.artefacts.task_json` puts it in its place."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from typing_extensions import Self

from bbtc.artefacts.conditions import (
    condition_from_json,
    condition_to_json,
    variable_from_json,
)
from bbtc.artefacts.cursor import At, check_distinct, clip, optional
from bbtc.artefacts.numbers import given_text
from bbtc.artefacts.prior_json import prior_from_json, prior_to_json
from bbtc.ground.condition import Condition
from bbtc.ground.task import (
    ONE,
    Change,
    Component,
    Factor,
    Knowledge,
    NumberVariable,
    Observation,
    Task,
    TrueWorld,
    Variable,
    numbers_of,
    split_name,
)

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


@dataclass(frozen=True, slots=True)
class HiddenReader(ABC):
    """Reads what refers to variables, those of a task or the local ones of a component."""

    variables: tuple[Variable, ...]
    index: Mapping[str, int]
    components: tuple[Component, ...] = ()
    numbers: Mapping[str, NumberVariable] = field(default_factory=dict)

    @classmethod
    def of(cls, variables: Iterable[Variable]) -> Self:
        """For some variables."""
        listed = tuple(variables)
        index = {variable.name: number for number, variable in enumerate(listed)}
        return cls(listed, index, numbers={number.name: number for number in numbers_of(listed)})

    @abstractmethod
    def chance(self, at: At, members: Mapping[str, At], depth: int = 0) -> tuple[Factor, ...]:
        """The factors of an object with either ``outcomes`` or ``factors``."""

    def condition(self, at: At) -> Condition:
        """A condition over the variables."""
        return condition_from_json(at, self.index, self.numbers)

    def component(self, at: At) -> Component:
        """A component."""
        members = at.members(["facts", "prior", "known"], ["seen", "first"])
        facts, seen = members["facts"].strings(), self._seen(members)
        check_distinct(members["facts"], sorted(facts))
        local = self._local(facts, seen)
        prior, diagram = prior_from_json(members["prior"], {fact: at for at, fact in enumerate(facts)})
        known = sorted(
            (self._knowledge(each, local) for each in members["known"].elements()),
            key=lambda each: each.variable,
        )
        first = tuple(local.observation(each) for each in optional(members, "first"))
        return Component(facts, prior, tuple(known), first, seen, diagram)

    def _knowledge(self, at: At, local: Self) -> Knowledge:
        members = at.members(["variable", "condition"], ["at_least"])
        variable = variable_from_json(members["variable"], self.index)
        if not self.variables[variable].three_valued:
            name = clip(self.variables[variable].name)
            raise members["variable"].fault("BBT0604", f"variable '{name}' cannot be unknown")
        at_least = members["at_least"].given_probability() if "at_least" in members else ONE
        if 2 * at_least <= 1:
            raise members["at_least"].fault("BBT0604", "must be above 1/2, for one side to be believed")
        return Knowledge(variable, local.condition(members["condition"]), at_least)

    def _seen(self, members: Mapping[str, At]) -> tuple[int, ...]:
        return tuple(variable_from_json(each, self.index) for each in optional(members, "seen"))

    def _local(self, facts: Sequence[str], seen: Sequence[int]) -> Self:
        """Reads what refers to the local variables of a component."""
        hidden = (Variable(*split_name(fact), three_valued=False, hidden=True) for fact in facts)
        return self.of((*hidden, *(self.variables[variable] for variable in seen)))

    def observation(self, at: At) -> Observation:
        """Inverse of :func:`observation_to_json`."""
        members = at.members(["condition"], ["when", "accuracy", "accuracy_false"])
        return Observation(
            self.condition(members["condition"]),
            members["accuracy"].given_probability() if "accuracy" in members else ONE,
            self.condition(members["when"]) if "when" in members else None,
            members["accuracy_false"].given_probability() if "accuracy_false" in members else None,
        )

    def change(self, at: At) -> Change:
        """What an action does to a component."""
        members = at.members(["component"], ["seen", "outcomes", "factors", "oneof", "observations"])
        number = members["component"].value
        if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < len(self.components):
            message = f"must be the number of a component, below {len(self.components)}"
            raise members["component"].fault("BBT0604", message)
        seen = self._seen(members)
        local = self._local(self.components[number].facts, seen)
        observations = tuple(local.observation(each) for each in optional(members, "observations"))
        return Change(number, seen, local.chance(at, members), observations)
