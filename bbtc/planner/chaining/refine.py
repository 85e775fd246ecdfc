"""The strategy ``refine``: backward chaining by the paper's Algorithm 3, which refines a tree until its
simulation reaches the target.

Steps, numbered as in the paper: 1 simulate; 2 find the most probable deepest failed condition;
3 if an action of a later branch undid it, move that branch; 4 otherwise insert an action or a
template for it; repeat. The choice is greedy, as published. What is added so that it always ends
and does not insert in vain for ever: a state in which nothing can be inserted for any of its failed
conditions is given up; refinements that bring nothing for a while are taken back, and the first of
them is not tried there again; and there are limits on time, states and nodes.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import explore
from bbtc.belief.state import Transition
from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.condition import evaluate
from bbtc.ground.describe import describe
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.markov import weighted
from bbtc.planner.best_tree import BestTree
from bbtc.planner.chaining.choose import Candidate, Chooser, Flaw
from bbtc.planner.chaining.draft import Draft, Subgoal, freeze, new_attempt
from bbtc.planner.chaining.flaws import FlawFinder, Simulated
from bbtc.planner.chaining.threats import find_threat
from bbtc.planner.options import DEFAULTS, Options
from bbtc.planner.result import Plan, Progress, Refinement
from bbtc.rewrite.simplify import without_idle_branches
from bbtc.tree.nodes import PlanStatus, walk

PATIENCE = 30
"""So many refinements may pass without progress before they are taken back."""

PROGRESS = Fraction(1, 1000)
"""Progress closes at least this share of the gap to the target."""

KEPT_PROMISE = Fraction(1, 100)
"""A template that brings less than this share of what its guide promised is not inserted there again."""


@dataclass(frozen=True, slots=True)
class _Change:
    """A refinement of the draft: what it was, how to take it back, and the insertion it made."""

    refinement: Refinement
    undo: Callable[[], None]
    insertion: tuple[Subgoal, Truth, str] | None


@dataclass(slots=True)
class _Refiner:
    task: Task
    target: Fraction
    limits: Limits
    draft: Draft
    transitions: dict[str, Transition]
    finder: FlawFinder
    moved: set[tuple[Subgoal, Subgoal]] = field(default_factory=set)

    def simulate(self) -> Simulated:
        """Step 1."""
        frozen = freeze(self.draft, self.limits)
        self.limits.check_time("planning")
        chain = explore(self.task, frozen.root, self.limits, self.transitions)
        visits = Absorption(chain).visits()
        mass = {state: visits[state] or Fraction(0) for state in chain.final}
        success = weighted((p, chain.won(state)) for state, p in mass.items())
        goals = Fraction(0)
        if len(self.draft.goals) > 1:
            conditions = [goal.condition for goal in self.draft.goals]
            true = [
                sum(evaluate(each, chain.states[state].values) is Truth.TRUE for each in conditions)
                for state in mass
            ]
            goals = weighted(zip(mass.values(), map(Fraction, true), strict=True))
        return Simulated(frozen, chain, mass, success, goals)

    def refine_once(self, simulated: Simulated) -> _Change | None:
        """Steps 2 to 4; None if nothing is left to insert."""
        flaw = self.finder.best(simulated)
        if flaw is None:
            return None
        common = (describe(self.task, flaw.subgoal.condition), flaw.value, flaw.probability)
        threat = find_threat(self.draft, flaw, simulated.started(flaw), self.moved)
        if threat is not None:
            self.moved.add((threat.siblings[threat.earlier], threat.siblings[threat.later]))
            threat.resolve()
            return _Change(Refinement("move", *common, threat.action), threat.take_back, None)
        best = self.finder.chooser.candidates(flaw)[0]
        undo = self.insert(flaw, best)
        refinement = Refinement("insert", *common, best.name, best.success, best.observable, best.unmet)
        return _Change(refinement, undo, (flaw.subgoal, flaw.value, best.key))

    def insert(self, flaw: Flaw, candidate: Candidate) -> Callable[[], None]:
        """Put the candidate under the flaw: a perception under a Skipper where the condition is
        unknown, an actuation under a Fallback where it is false. Returns how to take it out again."""
        subgoal = flaw.subgoal
        attempt = new_attempt(subgoal, candidate.doing, list(candidate.conditions))
        attempts = subgoal.sensing if flaw.value is Truth.UNKNOWN else subgoal.acting
        attempts.append(attempt)
        siblings = subgoal.parent.preconditions if subgoal.parent is not None else self.draft.goals
        attached = subgoal not in siblings
        if attached:
            siblings.append(subgoal)

        def undo() -> None:
            attempts.remove(attempt)
            if attached:
                siblings.remove(subgoal)

        return undo

    def judge(self, change: _Change, before: Simulated, after: Simulated) -> None:
        """Bar a template that could run at once and brought next to nothing of what its guide
        promised: the runs that end with its condition as it was are as many as before."""
        done = change.refinement
        if change.insertion is None or change.insertion[2] not in self.task.template_by_name or done.unmet:
            return
        subgoal, value, _ = change.insertion
        resolved = before.failing(subgoal.condition, value) - after.failing(subgoal.condition, value)
        if resolved < done.probability * done.chance * KEPT_PROMISE:
            self.finder.banned.add(change.insertion)

    def retreat(self, changes: list[_Change], base: Simulated) -> Refinement | None:
        """Take back refinements that brought nothing, and bar the first insertion among them."""
        for change in reversed(changes):
            change.undo()
        first = next((change for change in changes if change.insertion is not None), None)
        if first is None or first.insertion is None:
            return None
        self.finder.banned.add(first.insertion)
        return replace(
            first.refinement, kind="retreat", success=base.success, nodes=_size(base), taken_back=len(changes)
        )


def refine(
    task: Task, target: Fraction, limits: Limits, progress: Progress, options: Options = DEFAULTS
) -> Plan:
    """Plan by greedy refinement. Always returns: the target is reached, or nothing is left to
    insert (status ``stuck``), or a limit is reached; then the plan holds the best tree so far.

    Raises :class:`bbtc.diagnostics.LimitReached` only if the limits do not even allow the
    simulation of the initial belief.
    """
    draft = Draft.start(task)
    kept = BestTree.start(task, target, options.best, freeze(draft, limits).root, limits)
    transitions: dict[str, Transition] = {}
    finder = FlawFinder(task, Chooser(task, transitions, limits))
    refiner = _Refiner(task, target, limits, draft, transitions, finder)
    refinements: list[Refinement] = []
    status: PlanStatus = "stuck"
    stop: Diagnostic | None = None
    best = base = current = refiner.simulate()  # the base: where progress was last made
    since_base: list[_Change] = []

    def tell(refinement: Refinement) -> None:
        refinements.append(refinement)
        progress(refinement)

    try:
        while best.success < target:
            change = refiner.refine_once(current) if len(since_base) < PATIENCE else None
            if change is None:
                if not since_base:
                    break
                retreat = refiner.retreat(since_base, base)
                since_base, current = [], base
                if retreat is not None:
                    tell(retreat)
                continue
            before, current = current, refiner.simulate()
            tell(replace(change.refinement, success=current.success, nodes=_size(current)))
            since_base.append(change)
            refiner.judge(change, before, current)
            if current.success > best.success:
                best = current
                kept.take(best.root, best.chain, best.success, tuple(refinements))
            if _progress(base, current, target):
                base, since_base = current, []
            elif change.insertion is None and current.success < before.success:
                since_base.pop().undo()  # a move that harms; its pair is not moved again
                current = before
    except LimitReached as reached:
        status, stop = "limit-reached", reached.diagnostics[0]
    except KeyboardInterrupt:
        status = "interrupted"
    with contextlib.suppress(LimitReached):
        root = without_idle_branches(task, best.root, best.chain, limits)
        if root is not best.root:
            kept.take(root, explore(task, root, limits, transitions), best.success)
    return replace(kept.plan(status, stop), refinements=tuple(refinements))


def _progress(base: Simulated, now: Simulated, target: Fraction) -> bool:
    gap = target - base.success
    return now.success - base.success >= gap * PROGRESS or (
        now.success == base.success and now.goals > base.goals
    )


def _size(simulated: Simulated) -> int:
    return sum(1 for _ in walk(simulated.root))
