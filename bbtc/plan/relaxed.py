"""Relaxed reachability from a state: what could ever become true if nothing were undone."""

from __future__ import annotations

from typing_extensions import assert_never

from bbtc.belief.state import Values
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, variables
from bbtc.ground.task import GroundAction, Task, effects_of

Facts = set[tuple[int, int]]
"""Pairs of variable and value that are possible."""


def possible(condition: Condition, facts: Facts) -> bool:
    """Can the condition be true if every variable takes any of its possible values at will?"""
    match condition:
        case Is(variable, value):
            return (variable, int(value)) in facts
        case Known(variable):
            return (variable, 0) in facts or (variable, 2) in facts
        case And(parts):
            return all(possible(part, facts) for part in parts)
        case Or(parts):
            return any(possible(part, facts) for part in parts)
        case Not(_):
            return True  # never built by grounding, which pushes negations to the leaves
        case Constant(value):
            return value
        case _:
            assert_never(condition)


class RelaxedReachability:
    """The delete relaxation of a task, indexed once and asked for many states."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self._effects = [list(effects_of(action.factors)) for action in task.actions]
        self._readers: dict[int, list[int]] = {}
        for position, action in enumerate(task.actions):
            read = set(variables(action.precondition))
            for effect in self._effects[position]:
                if effect.when is not None:
                    read.update(variables(effect.when))
            for variable in sorted(read):
                self._readers.setdefault(variable, []).append(position)
        self._cache: dict[Values, Facts] = {}

    def facts(self, values: Values) -> Facts:
        """Everything reachable from a state in the relaxation; a superset of the truth."""
        if values in self._cache:
            return self._cache[values]
        facts: Facts = {(variable, value) for variable, value in enumerate(values)}
        queue = list(range(len(self.task.actions)))
        queued = set(queue)
        while queue:
            position = queue.pop()
            queued.discard(position)
            if not possible(self.task.actions[position].precondition, facts):
                continue
            for effect in self._effects[position]:
                if effect.when is not None and not possible(effect.when, facts):
                    continue
                for variable, value in effect.sets:
                    if (variable, int(value)) not in facts:
                        facts.add((variable, int(value)))
                        for reader in self._readers.get(variable, ()):
                            if reader not in queued:
                                queued.add(reader)
                                queue.append(reader)
        self._cache[values] = facts
        return facts

    def applicable(self, action: GroundAction, values: Values) -> bool:
        """Could the action become applicable from this state?"""
        return possible(action.precondition, self.facts(values))
