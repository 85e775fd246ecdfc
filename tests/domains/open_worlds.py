"""Worlds in which others change what they may, as the text of a problem alone says it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from random import Random

from bbtc.ground.task import Task
from tests.domains.lifted import Change, Fact, Form, Lifted, State, World


class OpenWorlds:
    """The facts of a text that may change in the world, and what its conditions are worth there."""

    def __init__(self, text: str) -> None:
        self.lifted = lifted = Lifted.of(text)
        effects = [action.get(":effect", []) for action in lifted.actions]
        settings = [each for effect in effects for each in self._settings(effect)]
        given = [each for form in lifted.init if form[0] != "=" for each in self._settings(form)]
        self.open = {name for name, _ in settings} | lifted.external
        self.doubtful = {name for name, unknown in [*settings, *given] if unknown}
        self.names = {action[":name"]: action for action in lifted.actions}

    @cached_property
    def facts(self) -> list[Fact]:
        """Every fact that may change."""
        return [
            (name, *bound.values())
            for name in sorted(self.open)
            for bound in self.lifted.bindings(self.lifted.predicates[name], {})
        ]

    @cached_property
    def starts(self) -> list[State]:
        """The states that the text starts in."""
        return sorted(self.lifted.start(), key=sorted)

    def changed(self, world: World, rng: Random, share: float) -> Change:
        """The world, with a share of what may change as anybody may have left it."""
        new = {
            fact: rng.choice([0, 1, 2] if fact[0] in self.doubtful else [0, 2])
            for fact in self.facts
            if rng.random() < share
        }
        return {**world, **new}

    def goal(self, world: World) -> int:
        """The value of the goal."""
        return self._value(self.lifted.goal, {}, world)

    def precondition(self, schema: str, args: tuple[str, ...], world: World) -> int:
        """The value of the precondition of an action."""
        action = self.names[schema]
        return self._value(action.get(":precondition", []), self._bound(schema, args), world)

    def after(self, schema: str, args: tuple[str, ...], world: World, rng: Random) -> Change:
        """The world after an action, which may have any of its outcomes."""
        effect = self.names[schema].get(":effect", [])
        draws = self.lifted.effect(effect, self._bound(schema, args), self._derived(world))
        return {**world, **rng.choice([change for _, change, _ in draws])}

    def values(self, task: Task, world: World) -> list[int]:
        """The values of the variables of a task."""
        return [world.get((variable.predicate, *variable.args), 0) for variable in task.variables]

    def _bound(self, schema: str, args: tuple[str, ...]) -> dict[str, str]:
        parameters = self.names[schema].get(":parameters", [])
        return dict(zip((word for word in parameters if str(word).startswith("?")), args, strict=True))

    def _derived(self, world: World) -> World:
        return self.lifted.derived(frozenset((fact, value) for fact, value in world.items() if value))

    def _value(self, form: Form, bound: dict[str, str], world: World) -> int:
        return self.lifted.value(form, bound, self._derived(world))

    def _settings(self, effect: Form) -> Iterator[tuple[str, bool]]:
        """The predicates that an effect mentions, each with whether it makes it unknown."""
        match effect:
            case [] | ["increase", *_]:
                return
            case ["and" | "oneof", *parts]:
                for part in parts:
                    yield from self._settings(part)
            case ["probabilistic", *branches]:
                for part in branches[1::2]:
                    yield from self._settings(part)
            case ["forall" | "when", _, part]:
                yield from self._settings(part)
            case ["not" | "unknown" as kind, part] if kind == "not" or not self.lifted.is_fact(effect):
                yield (part if isinstance(part, str) else part[0]), kind == "unknown"
            case _:
                yield (effect if isinstance(effect, str) else effect[0]), False
