"""The best tree that a planner has made so far, kept where no limit and no interruption can lose it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from bbtc.belief.chain import Chain, explore
from bbtc.belief.simulate import Figures, figures, success_of
from bbtc.diagnostics import Diagnostic
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.result import Plan, Refinement
from bbtc.tree.nodes import ConditionNode, Node, PlanStatus, Tree, walk


@dataclass(frozen=True, slots=True)
class _Kept:
    root: Node
    chain: Chain
    success: Fraction
    size: int
    steps: tuple[Refinement, ...]


@dataclass(slots=True)
class BestTree:
    """What a planner has found for a task and a target. What is better than all that ``outer`` knows, the
    best tree of the planner that asked this one, is told to it, too. With ``smallest``, success beyond the
    target counts for nothing."""

    task: Task
    target: Fraction
    smallest: bool = False
    outer: BestTree | None = None
    initial: Fraction = Fraction(0)
    """The success probability before anything is done."""
    _kept: _Kept | None = None

    @classmethod
    def start(
        cls, task: Task, target: Fraction, outer: BestTree | None, root: Node, limits: Limits
    ) -> BestTree:
        """To begin with: a tree of which every planner knows that it can be made. Raises
        :class:`bbtc.diagnostics.LimitReached` if it cannot even be simulated."""
        chain = explore(task, root, limits)
        found = cls(task, target, outer is not None and outer.smallest, outer, success_of(chain))
        found.offer(root, chain, found.initial)
        return found

    @property
    def root(self) -> Node:
        """The tree."""
        assert self._kept is not None
        return self._kept.root

    @property
    def chain(self) -> Chain:
        """Its chain."""
        assert self._kept is not None
        return self._kept.chain

    @property
    def success(self) -> Fraction:
        """Its success probability."""
        assert self._kept is not None
        return self._kept.success

    @property
    def empty(self) -> bool:
        """Is there no tree at all?"""
        return self._kept is None

    def offer(
        self, root: Node, chain: Chain, success: Fraction, steps: tuple[Refinement, ...] | None = None
    ) -> None:
        """Keep a tree if it does better than the one kept, or as well with fewer nodes."""
        kept = self._kept
        size = sum(1 for _ in walk(root))
        if kept is None or (self._counts(success), -size) > (self._counts(kept.success), -kept.size):
            self.take(root, chain, success, steps)

    def _counts(self, success: Fraction) -> Fraction:
        return min(success, self.target) if self.smallest else success

    def take(
        self, root: Node, chain: Chain, success: Fraction, steps: tuple[Refinement, ...] | None = None
    ) -> None:
        """Keep a tree, whatever was before; ``steps`` led to it, by default those that led to the one
        before."""
        if steps is None:
            steps = () if self._kept is None else self._kept.steps
        self._kept = _Kept(root, chain, success, sum(1 for _ in walk(root)), steps)
        if self.outer is not None:
            self.outer.offer(root, chain, success, steps)

    def plan(self, status: PlanStatus, stop: Diagnostic | None = None, known: Figures | None = None) -> Plan:
        """The plan of the tree kept; one that reaches the target has done so, whatever ended the search."""
        if self._kept is None:
            goal = ConditionNode("n1", self.task.goal)
            self.take(goal, explore(self.task, goal, Limits()), Fraction(0))
        assert self._kept is not None
        kept = self._kept
        found = figures(self.task, kept.root, kept.chain) if known is None else known
        if found.success >= self.target:
            status = "target-reached"
        tree = Tree(self.task, kept.root, found.success, self.target, status)
        return Plan(tree, found, self.initial, kept.steps, stop, kept.chain)
