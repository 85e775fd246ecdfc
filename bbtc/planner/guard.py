"""Trees that keep to their preconditions and their goal in worlds that others change."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import count

from typing_extensions import assert_never

from bbtc.belief.chain import Chain, explore
from bbtc.belief.simulate import figures
from bbtc.belief.tick import NodeStatus, compile_tick
from bbtc.ground.condition import FALSE, TRUE, Condition, Is, conjunction, conjuncts, doubt, negation
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.result import Plan
from bbtc.rewrite.ensured import GO_ON, Facts, returned
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, actions_of, retries_of, walk


def guarded(plan: Plan) -> Plan:
    """The plan with the checks that matter only where others change the world: every action reads its
    precondition before it starts, and what the goal consists of is read last of all, but for what the place
    of a node ensures in any state (:mod:`bbtc.rewrite.ensured`).

    In the simulation the tree does the same actions and succeeds in the same runs, which start actions only
    where their preconditions are true. Only runs that end with all attempts of a retry node used up may end
    blocked instead of failed, where the action that is refused has an unknown precondition; where something
    else has its turn after it, a test that fails there stands before the action (two nodes more).
    """
    task, root = plan.tree.task, plan.tree.root
    found = with_guards(task, root)
    if found == root:
        return plan
    chain, done = plan.chain, plan.figures
    if chain is not None:
        chain = replace(chain, actions=tuple(actions_of(found)))
    if any(retries_of(root)):
        chain = _ending_anew(task, found, chain or explore(task, found, Limits()))
        done = figures(task, found, chain)
    if (done.success, done.cost) != (plan.figures.success, plan.figures.cost):
        raise AssertionError("a guard changed what a tree does")
    return replace(plan, tree=replace(plan.tree, root=found), figures=done, chain=chain)


def with_guards(task: Task, root: Node) -> Node:
    """A tree with the checks of :func:`guarded`."""
    depending: set[str] = set()
    _depending(task, root, depending, kept=False)
    guarding = _Guarding(task, Facts(task), _fresh(root), depending, any(retries_of(root)))
    return _with_goal(task, guarding.node(root, _Last()) if root.id in depending else root)


def most_more(task: Task) -> int:
    """How many nodes :func:`guarded` adds, but where it puts tests before actions below retry nodes."""
    return len(conjuncts(task.goal)) + 1


def _ending_anew(task: Task, root: Node, chain: Chain) -> Chain:
    """The chain with the ends that a tree comes to, which starts the same actions otherwise."""
    tick = compile_tick(task, root)
    status = list(chain.status)
    for number in chain.final:
        state = chain.states[number]
        status[number] = NodeStatus(tick(state.values, state.finished))
    return replace(chain, status=tuple(status))


def _depending(task: Task, node: Node, found: set[str], *, kept: bool) -> None:
    """Find the nodes with an action below whose guard depends on what is sure there."""
    match node:
        case ConditionNode():
            pass
        case ActionNode():
            always = task.action_by_name[node.action].precondition == TRUE
            if not (kept if node.guarded else always):
                found.add(node.id)
        case ControlNode():
            for child in node.children:
                _depending(task, child, found, kept=kept or node.template is not None)
                if child.id in found:
                    found.add(node.id)
        case _:
            assert_never(node)


@dataclass(slots=True)
class _Guarding:
    """A walk through a tree, with what is sure at each node."""

    task: Task
    facts: Facts
    fresh: Iterator[str]
    depending: Set[str]
    """The nodes with an action below whose guard depends on what is sure there."""
    retries: bool
    """Are there retry nodes? Only below these it matters what has its turn after an action."""
    kept: bool = False
    """Here guards stay as they are: templates keep the form that their author gave them."""

    def node(self, node: Node, last: _Last, *, bounded: bool = False) -> Node:
        """The node with guards; ``bounded``: it stands below a retry node."""
        match node:
            case ConditionNode():
                return node
            case ActionNode():
                return self._action(node, test=bounded and not last.of_retry and not node.latched)
            case ControlNode(template=str()):
                with self._inside_template():
                    return self._control(node, last, bounded=bounded)
            case ControlNode():
                return self._control(node, last, bounded=bounded)
            case _:
                assert_never(node)

    def _control(self, node: ControlNode, last: _Last, *, bounded: bool) -> Node:
        if node.kind == "retry-until-success":
            last = _Last(of_all=False, of_retry=last.of_retry)  # it has its turn again itself
            return replace(node, children=(self.node(node.children[0], last, bounded=bounded),))
        if node.kind == "retry":
            (child,) = node.children
            return replace(node, children=(self.node(child, _Last(last.of_all, last.of_all), bounded=True),))
        children: list[Node] = []
        told = 0
        with self.facts.meanwhile():
            for at, child in enumerate(node.children):
                if child.id not in self.depending:
                    children.append(child)
                    continue
                for earlier in children[told:]:  # what they returned matters from here on
                    self.facts.add(returned(self.task, earlier, GO_ON[node.kind], bounded=bounded))
                told = at
                rest = node.children[at + 1 :] if self.retries and node.kind == "fallback" else ()
                children.append(self.node(child, self._last(last, rest, bounded), bounded=bounded))
        return replace(node, children=tuple(children))

    @contextmanager
    def _inside_template(self) -> Iterator[None]:
        around, self.kept = self.kept, True
        yield
        self.kept = around

    def _action(self, node: ActionNode, *, test: bool) -> Node:
        needed = self.task.action_by_name[node.action].precondition
        if self.facts.sure(needed):
            return node if self.kept else replace(node, guarded=False)
        if node.guarded:
            return node
        if not test or self.facts.never_unknown(needed):
            return replace(node, guarded=True)
        condition = ConditionNode(next(self.fresh), _surely(self.task, needed))
        return ControlNode(next(self.fresh), "sequence", (condition, node))

    def _last(self, last: _Last, rest: Sequence[Node], bounded: bool) -> _Last:
        for node in rest:
            if self.facts.possible(returned(self.task, node, NodeStatus.SUCCESS, bounded=bounded)):
                return _Last(of_all=False, of_retry=False)
            if any(actions_of(node)):
                last = _Last(of_all=False, of_retry=last.of_retry)
        return last


@dataclass(frozen=True, slots=True)
class _Last:
    """Does nothing have its turn after an action that fails since its attempts are used up: nothing at all,
    nothing but what the same retry nodes refuse."""

    of_all: bool = True
    of_retry: bool = True


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
    facts = Facts(task)
    facts.add(returned(task, root, NodeStatus.SUCCESS))
    missing = [part for part in conjuncts(task.goal) if not facts.sure(part)]
    if not missing:
        return root
    fresh = _fresh(root)
    checks = [ConditionNode(next(fresh), part) for part in missing]
    if isinstance(root, ControlNode) and root.kind == "sequence" and root.template is None:
        return replace(root, children=(*root.children, *checks))
    return ControlNode(next(fresh), "sequence", (root, *checks))
