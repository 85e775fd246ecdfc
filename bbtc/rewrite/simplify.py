"""Smaller trees that do the same: no simplification changes what happens in any run.

Rewrite rules, for a control node k (Sequence, Fallback or Skipper). What a node ever returns is read off
every state that a run can visit, or, where others may change the world, worked out for any state
(:mod:`bbtc.rewrite.ensured`); with "goes on" for the status after which k ticks its next child:

1. ``k(…, c, …)`` becomes ``k(…, …)`` if c never does anything but go on, or is never ticked (as what stands
   behind a child that never goes on).
2. ``k(…, k(x, …), …)`` becomes ``k(…, x, …, …)``.
3. ``k(c)`` becomes ``c``.

These change nothing in any state that is visited. The others are tried, and kept if both trees, run side by
side, do the same (:mod:`bbtc.belief.same_runs`); k is a Sequence or a Fallback and j the other of the two:

4. ``k(…, j(a, x…), j(a, y…), …)`` becomes ``k(…, j(a, k(j(x…), j(y…))), …)`` for a condition a, wherever it
   stands among its neighbours.
5. ``k(…, j(x…, a), j(y…, a), …)`` becomes ``k(…, j(k(j(x…), j(y…)), a), …)`` for an action a, likewise.

Where others may change the world, a stands first in rule 4 and last in rule 5: the rules hold in any state
then.

Rules 1 to 3 are applied until nothing changes, then one of 4 and 5, and so on. The result as a whole is
compared with the tree given, in the same way. Templates keep the shape that their author gave them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import replace
from operator import is_

from bbtc.belief.chain import Chain, explore
from bbtc.belief.same_runs import same_runs
from bbtc.belief.state import Transition
from bbtc.belief.tick import NodeStatus, compile_tick
from bbtc.diagnostics import LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.rewrite.ensured import GO_ON, may_return
from bbtc.tree.nodes import (
    COUNTING,
    ActionNode,
    ConditionNode,
    ControlKind,
    ControlNode,
    Node,
    actions_of,
    walk,
)

_MOST_TICKS = 200_000
"""Ticks spent on trying merged trees, each time."""

_LOOK = 1024
"""States between two looks at the clock."""

_MOST_STATES = 20_000
"""A tree with more states is left as it is."""


def simplified(
    task: Task,
    root: Node,
    limits: Limits,
    transitions: dict[str, Transition] | None = None,
    *,
    closed_world: bool = False,
) -> Node:
    """The tree made smaller, its runs unchanged; but in a ``closed_world``, also those that begin where
    others have changed something. Raises ``LimitReached``; ``AssertionError`` if what was found does
    something else, which is a bug."""
    try:
        chain = explore(task, root, replace(limits, states=min(limits.states, _MOST_STATES)), transitions)
    except LimitReached:
        limits.check_time("the search for a small tree")
        return root
    found = root
    while True:
        if closed_world:
            own = chain if found is root else explore(task, found, limits, transitions)
            smaller = _without_idle(found, _returned(task, found, own, limits))
        else:
            smaller = _without_idle(found, may_return(task, found))
        found = smaller
        # What nodes may return takes as long as many merges: it is worked out once none is left.
        while (shared := _shared(task, found, chain, limits, closed_world=closed_world)) is not None:
            found = shared
        if found is smaller:
            break
    if not same_runs(task, chain, smaller):
        raise AssertionError("a simplification changed what a tree does")
    return smaller


def size(root: Node) -> int:
    """The number of nodes."""
    return sum(1 for _ in walk(root))


def numbered(root: Node) -> Node:
    """The tree with ids ``n1``, ``n2``, … from the root down, from left to right."""
    count = 0

    def visit(node: Node) -> Node:
        nonlocal count
        count += 1
        node = replace(node, id=f"n{count}")
        if isinstance(node, ControlNode):
            return replace(node, children=tuple([visit(child) for child in node.children]))
        return node

    return visit(root)


# --- what never matters: rules 1 to 3 --------------------------------------------------------


def _returned(task: Task, root: Node, chain: Chain, limits: Limits) -> dict[str, set[int]]:
    """By the id of each node, what it returns in the states of the tree's chain."""
    returned: dict[str, set[int]] = {node.id: set() for node in walk(root)}
    tick = compile_tick(task, root, lambda node, status: returned[node.id].add(status))
    for number, state in enumerate(chain.states):
        if number % _LOOK == _LOOK - 1:
            limits.check_time("the search for a small tree")
        tick(state.values, state.finished)
    return returned


def without_idle_branches(task: Task, root: Node, chain: Chain, limits: Limits) -> Node:
    """Rule 1 for those alternatives of Fallbacks that hold actions, and rule 3 for Fallbacks: the tree
    without branches that were tried in vain, its tests as they are. The root itself is returned where nothing
    was taken out. Raises ``LimitReached`` when the time is over."""
    returned = _returned(task, root, chain, limits)

    def kept(node: Node) -> Node:
        if not isinstance(node, ControlNode):
            return node
        children = node.children
        if node.kind == "fallback" and node.template is None:
            used = [c for c in children if returned[c.id] - {NodeStatus.FAILURE} or not any(actions_of(c))]
            children = tuple(used) or children
        children = tuple(kept(child) for child in children)
        if node.kind == "fallback" and len(children) == 1:
            return children[0]
        unchanged = len(children) == len(node.children) and all(map(is_, children, node.children))
        return node if unchanged else replace(node, children=children)

    return kept(root)


def _without_idle(root: Node, returned: Mapping[str, Set[int]]) -> Node:
    """Rules 1 to 3, until nothing more is found."""

    def kept(node: Node) -> Node:
        if not isinstance(node, ControlNode) or node.template is not None:
            return node
        if node.kind in COUNTING:
            return replace(node, children=(kept(node.children[0]),))
        goes_on = GO_ON[node.kind]
        children: list[Node] = []
        for child in node.children:
            if returned[child.id] - {goes_on}:  # else rule 1
                children.extend(_dissolved(node.kind, kept(child)))  # rule 2
        if not children:
            children = [kept(node.children[0])]
        if len(children) == 1:
            return children[0]  # rule 3
        return replace(node, children=tuple(children))

    return kept(root)


def _dissolved(kind: ControlKind, child: Node) -> Sequence[Node]:
    if isinstance(child, ControlNode) and child.kind == kind and child.template is None:
        return child.children
    return (child,)


# --- what stands twice: rules 4 and 5 --------------------------------------------------------


def _shared(task: Task, root: Node, chain: Chain, limits: Limits, *, closed_world: bool) -> Node | None:
    """Rule 4 or 5, once: the first smaller tree that does the same; None if there is none."""
    for tried, smaller in enumerate(_merged(root, anywhere=closed_world)):
        limits.check_time("the search for a small tree")
        if tried * len(chain.states) > _MOST_TICKS:
            break
        if same_runs(task, chain, smaller):
            return numbered(smaller)
    return None


def _merged(node: Node, *, anywhere: bool) -> Iterator[Node]:
    """Trees with two neighbours merged, which may or may not do the same; ``anywhere``: what they share
    stands anywhere among its neighbours."""
    if not isinstance(node, ControlNode) or node.template is not None:
        return
    if node.kind in {"fallback", "sequence"}:
        inner: ControlKind = "sequence" if node.kind == "fallback" else "fallback"
        for at in range(len(node.children) - 1):
            for merged in _pair(node, inner, node.children[at : at + 2], anywhere=anywhere):
                children = (*node.children[:at], merged, *node.children[at + 2 :])
                yield merged if len(children) == 1 else replace(node, children=children)
    for at, child in enumerate(node.children):
        for smaller in _merged(child, anywhere=anywhere):
            yield replace(node, children=(*node.children[:at], smaller, *node.children[at + 1 :]))


def _pair(
    above: ControlNode, inner: ControlKind, neighbours: Sequence[Node], *, anywhere: bool
) -> Iterator[Node]:
    one, other = neighbours
    first, second = _parts(inner, one), _parts(inner, other)
    if isinstance(other, ControlNode) and len(second) > 1:
        for part in first:
            for twin in second:
                if isinstance(part, ControlNode) or not _same(part, twin):
                    continue
                end = 0 if isinstance(part, ConditionNode) else -1
                if not anywhere and not (part is first[end] and twin is second[end]):
                    continue
                rest = [
                    _control(other, inner, [c for c in side if c is not p])
                    for side, p in ((first, part), (second, twin))
                ]
                if any(each is None for each in rest):
                    continue
                choice = ControlNode(
                    f"{other.id}.or", above.kind, tuple(each for each in rest if each is not None)
                )
                if isinstance(part, ActionNode) and isinstance(twin, ActionNode):  # rule 5
                    # A guard is kept: where there is none, it would hold.
                    action = replace(part, guarded=part.guarded or twin.guarded)
                    yield replace(other, kind=inner, children=(choice, action))
                else:  # rule 4
                    yield replace(other, kind=inner, children=(part, choice))


def _parts(kind: ControlKind, node: Node) -> tuple[Node, ...]:
    if isinstance(node, ControlNode) and node.kind == kind and node.template is None:
        return node.children
    return (node,)


def _control(like: ControlNode, kind: ControlKind, children: Sequence[Node]) -> Node | None:
    if len(children) < 2:
        return children[0] if children else None
    return ControlNode(f"{children[0].id}.{kind}", kind, tuple(children), reason=like.reason)


def _same(one: Node, other: Node) -> bool:
    """Are two subtrees equal but for ids, and without memory?"""
    match one, other:
        case ConditionNode(), ConditionNode():
            return one.condition == other.condition
        case ActionNode(), ActionNode():
            return one.action == other.action and not one.latched and not other.latched
        case ControlNode(), ControlNode():
            return (
                one.kind == other.kind
                and one.kind not in COUNTING
                and len(one.children) == len(other.children)
                and all(map(_same, one.children, other.children))
            )
        case _:
            return False
