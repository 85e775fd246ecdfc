"""Actions as a disturbed world runs them: one that starts without its precondition does nothing.

The model says nothing of such a start, which a tree that was not planned for the state may make. It costs
what the action costs, the tree remembers it as a start like any other, and only events change the world.
"""

from __future__ import annotations

from dataclasses import replace

from bbtc.belief.draws import Values
from bbtc.belief.state import Result, Transition, compile_action
from bbtc.ground.condition import compile_condition
from bbtc.ground.task import GroundAction, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.tree.nodes import Node, actions_of


def careful_actions(task: Task, root: Node, limits: Limits) -> dict[str, Transition]:
    """The actions of a tree by name, as functions that raise :class:`bbtc.diagnostics.LimitReached` where
    there is too much that an action may lead to."""
    names = dict.fromkeys(node.action for node in actions_of(root))
    return {name: _careful(task, task.action_by_name[name], limits) for name in names}


def _careful(task: Task, action: GroundAction, limits: Limits) -> Transition:
    ready, run = compile_condition(action.precondition), compile_action(task, action, limits)
    idle = compile_action(task, replace(action, factors=(), changes=(), during=None), limits)

    def results(values: Values) -> tuple[Result, ...]:
        return run(values) if ready(values) == Truth.TRUE else idle(values)

    return results
