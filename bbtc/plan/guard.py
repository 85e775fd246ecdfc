"""Trees that keep to their preconditions and their goal in worlds that others change."""

from __future__ import annotations

from dataclasses import replace
from itertools import count

from bbtc.belief.chain import explore
from bbtc.belief.simulate import figures
from bbtc.ground.condition import TRUE, conjuncts
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.plan.result import Plan
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, actions_of, walk


def guarded(plan: Plan, limits: Limits) -> Plan:
    """The plan with the checks that the simulated world makes redundant: every action node is guarded by the
    action's precondition, and what the goal consists of is read last of all.

    In the simulation the tree does the same actions and succeeds in the same runs. Only runs that end with
    all attempts of a retry node used up may end blocked instead of failed, where the action that is refused
    has an unknown precondition; should the tree succeed less often for it, actions below retry nodes are
    left as they are. A limit on time does not count: the plan may be what was found within it.
    Raises ``LimitReached`` at the others.
    """
    task, limits = plan.tree.task, replace(limits, seconds=None)
    root = _with_goal(task, plan.tree.root)
    found = _with_guards(task, root, below_retries=True)
    chain = explore(task, found, limits)
    done = figures(task, found, chain)
    if (done.success, done.cost) != (plan.figures.success, plan.figures.cost):
        found = _with_guards(task, root, below_retries=False)
        chain = explore(task, found, limits)
        done = figures(task, found, chain)
    if (done.success, done.cost) != (plan.figures.success, plan.figures.cost):
        raise AssertionError("a guard changed what a tree does")
    return replace(plan, tree=replace(plan.tree, root=found), figures=done, chain=chain)


def most_more(task: Task) -> int:
    """How many nodes :func:`guarded` adds at most."""
    return len(conjuncts(task.goal)) + 1


def _with_guards(task: Task, root: Node, *, below_retries: bool) -> Node:
    spared = set()
    if not below_retries:
        retries = [node for node in walk(root) if isinstance(node, ControlNode) and node.kind == "retry"]
        spared = {node.id for retry in retries for node in actions_of(retry)}
    # Bottom-up and iterative: trees may be deep.
    done: dict[int, Node] = {}
    for node in reversed(list(walk(root))):
        new = node
        if isinstance(node, ControlNode):
            new = replace(node, children=tuple([done[id(child)] for child in node.children]))
        elif isinstance(node, ActionNode) and node.id not in spared:
            new = replace(node, guarded=task.action_by_name[node.action].precondition != TRUE)
        done[id(node)] = new
    return done[id(root)]


def _with_goal(task: Task, root: Node) -> Node:
    parts = conjuncts(task.goal)
    open_ended = isinstance(root, ControlNode) and root.kind == "sequence" and root.template is None
    children = root.children if isinstance(root, ControlNode) and open_ended else (root,)
    last = children[max(0, len(children) - len(parts)) :]
    if tuple([each.condition for each in last if isinstance(each, ConditionNode)]) == parts:
        return root
    ids = {node.id for node in walk(root)}
    fresh = (name for number in count(1) if (name := f"g{number}") not in ids)
    checks = [ConditionNode(next(fresh), part) for part in parts]
    if isinstance(root, ControlNode) and open_ended:
        return replace(root, children=(*children, *checks))
    return ControlNode(next(fresh), "sequence", (root, *checks))
