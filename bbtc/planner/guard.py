"""Trees that keep to their preconditions and their goal in worlds that others change."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count

from bbtc.belief.chain import explore
from bbtc.belief.simulate import figures
from bbtc.ground.condition import FALSE, TRUE, Condition, Is, conjunction, conjuncts, doubt, negation
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.result import Plan
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, actions_of, walk


def guarded(plan: Plan, limits: Limits) -> Plan:
    """The plan with the checks that the simulated world makes redundant: every action node is guarded by the
    action's precondition, and what the goal consists of is read last of all.

    In the simulation the tree does the same actions and succeeds in the same runs. Only runs that end with
    all attempts of a retry node used up may end blocked instead of failed, where the action that is refused
    has an unknown precondition; should the tree succeed less often for it, actions below retry nodes stand
    behind a test that fails there (two nodes more for each). A limit on time does not count: the plan may be
    what was found within it. Raises ``LimitReached`` at the others.
    """
    task, limits = plan.tree.task, replace(limits, seconds=None)
    root = _with_goal(task, plan.tree.root)
    found = _with_guards(task, root)
    chain = explore(task, found, limits)
    done = figures(task, found, chain)
    if (done.success, done.cost) != (plan.figures.success, plan.figures.cost):
        found = _with_guards(task, root, tests=_below_retries(root))
        chain = explore(task, found, limits)
        done = figures(task, found, chain)
    if (done.success, done.cost) != (plan.figures.success, plan.figures.cost):
        raise AssertionError("a guard changed what a tree does")
    return replace(plan, tree=replace(plan.tree, root=found), figures=done, chain=chain)


def most_more(task: Task) -> int:
    """How many nodes :func:`guarded` adds, but where it puts tests before actions below retry nodes."""
    return len(conjuncts(task.goal)) + 1


def _below_retries(root: Node) -> frozenset[str]:
    """The actions below retry nodes that are not latched, and so fail once all attempts are used up."""
    retries = [node for node in walk(root) if isinstance(node, ControlNode) and node.kind == "retry"]
    return frozenset(node.id for retry in retries for node in actions_of(retry) if not node.latched)


def _with_guards(task: Task, root: Node, tests: frozenset[str] = frozenset()) -> Node:
    """Guards at all actions but ``tests``, before which stands a test that is never unknown: it fails where
    a guard would be running."""
    fresh = _fresh(root)
    # Bottom-up and iterative: trees may be deep.
    done: dict[int, Node] = {}
    for node in reversed(list(walk(root))):
        new = node
        if isinstance(node, ControlNode):
            new = replace(node, children=tuple([done[id(child)] for child in node.children]))
        elif isinstance(node, ActionNode):
            needed = task.action_by_name[node.action].precondition
            new = replace(node, guarded=needed != TRUE and node.id not in tests)
            if needed != TRUE and node.id in tests:
                test = ConditionNode(next(fresh), _surely(task, needed))
                new = ControlNode(next(fresh), "sequence", (test, new))
        done[id(node)] = new
    return done[id(root)]


def _surely(task: Task, condition: Condition) -> Condition:
    """True where the condition is, else false."""

    def unknown(variable: int) -> Condition:
        return Is(variable, Truth.UNKNOWN) if task.variables[variable].three_valued else FALSE

    return conjunction([negation(doubt(condition, unknown)), condition])


def _fresh(root: Node) -> Iterator[str]:
    """Ids that no node of the tree has."""
    ids = {node.id for node in walk(root)}
    return (name for number in count(1) if (name := f"g{number}") not in ids)


def _with_goal(task: Task, root: Node) -> Node:
    parts = conjuncts(task.goal)
    open_ended = isinstance(root, ControlNode) and root.kind == "sequence" and root.template is None
    children = root.children if isinstance(root, ControlNode) and open_ended else (root,)
    last = children[max(0, len(children) - len(parts)) :]
    if tuple([each.condition for each in last if isinstance(each, ConditionNode)]) == parts:
        return root
    fresh = _fresh(root)
    checks = [ConditionNode(next(fresh), part) for part in parts]
    if isinstance(root, ControlNode) and open_ended:
        return replace(root, children=(*children, *checks))
    return ControlNode(next(fresh), "sequence", (root, *checks))
