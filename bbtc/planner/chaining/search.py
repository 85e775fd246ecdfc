"""The strategy ``search``: backward chaining by best-first search over refinements of reactive trees.

A tree grows from the goal by backward chaining (Colledanchise, Almeida, Ögren, "Towards Blended
Reactive Planning and Acting using Behavior Trees", 2019): a condition that is false gets an action under a
Fallback, one that is unknown an observation under a Skipper, with the preconditions before it as
conditions of their own. Actions are not latched, so a tree tries again by itself. Where the paper commits
to the best refinement, this searches (limited discrepancies: Harvey, Ginsberg 1995):

Of a small task the search first finds what any policy can reach, and looks for no more than that.

1. Simulate the tree. Final states that fail from which the goal is possible in the delete relaxation
   can still be repaired, and circles broken: what these weigh together with the success so far bounds
   what the refinements of this tree can reach.
2. Trees whose bound falls short of the target come last, however promising they looked: an insertion
   that leads into a dead end is backed out of. Of the others, the one comes first whose refinements were
   ranked best when they were chosen.
3. If runs go round in a circle, branches that undo one another are put into another order; otherwise the
   most probable repairable state gets an insertion, cheapest in the relaxation first
   (:mod:`bbtc.planner.chaining.moves`).
4. Where the target is reached, the tree is made smaller: what does not change any run, and then
   alternatives that the target does not need. Then attempts are bounded.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import count

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import Chain, explore
from bbtc.belief.draws import Values
from bbtc.belief.failures import FailureFinder
from bbtc.belief.state import Transition, compile_action
from bbtc.belief.tick import NodeStatus
from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.condition import evaluate
from bbtc.ground.describe import describe
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.best_tree import BestTree
from bbtc.planner.chaining.draft import Attempt, Draft, Frozen, Subgoal, freeze, new_attempt
from bbtc.planner.chaining.moves import Insertion, Move, Moves, forward, separating
from bbtc.planner.finish import GRACE, finish
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.h_add import possible
from bbtc.planner.mdp.maxprob import max_prob
from bbtc.planner.options import DEFAULTS, Options
from bbtc.planner.result import Plan, Progress, Refinement
from bbtc.rewrite.simplify import size
from bbtc.tree.nodes import PlanStatus

MOST_TREES = 400
"""Trees simulated in one search."""

MOST_STATES = 100_000
"""States of all simulations of one search together."""

FEW_ACTIONS = 100
"""For a task with no more, the search first asks what any policy can reach, and looks for no more."""

_FEW_STATES = 2_000
"""States explored for that."""

_BRANCHES = 5
"""Refinements of a tree that are considered."""

_TREE_STATES = 5_000
"""States of one simulation; a tree with more is given up."""


@dataclass(frozen=True, slots=True)
class _Seen:
    """A simulated draft. ``failing`` are final states without success, the most probable first;
    ``reachable`` bounds what refinements can make of it; ``circling`` are attempts of runs without end."""

    draft: Draft
    frozen: Frozen
    chain: Chain
    success: Fraction
    failing: tuple[tuple[Fraction, int], ...]
    reachable: Fraction
    circling: tuple[Attempt, ...]
    endless: Fraction


@dataclass(frozen=True, slots=True)
class _Node:
    """A refinement not yet made: of which tree (None: the first), and what it is."""

    above: _Seen | None
    change: Insertion | Move | None
    discrepancy: int
    steps: tuple[Refinement, ...]
    values: Values = b""


@dataclass(slots=True)
class _Search:
    task: Task
    target: Fraction
    limits: Limits
    best: BestTree
    moves: Moves = field(init=False)
    transitions: dict[str, Transition] = field(default_factory=dict)
    trees: int = 0
    states: int = 0
    known: set[tuple[object, ...]] = field(default_factory=set)
    heap: list[tuple[Fraction, int, int, int, _Node | tuple[_Node, _Seen]]] = field(default_factory=list)
    order: count[int] = field(default_factory=count)

    def run(self) -> None:
        """Search until the target is reached, nothing is left, or enough was tried."""
        self.moves = Moves(self.task, self.limits)
        self.push(_Node(None, None, 0, ()), Fraction(1))
        while self.heap and self.trees < MOST_TREES and self.states < MOST_STATES:
            shortfall, discrepancy, depth, _, entry = heapq.heappop(self.heap)
            if isinstance(entry, _Node):
                seen = self.simulate(entry)
                if seen is None:
                    continue
                steps = entry.steps
                if entry.above is not None:
                    steps = (*steps, self.told(entry.above, entry.change, entry.values, seen))
                entry = replace(entry, steps=steps)
                if seen.success > self.best.success:
                    self.best.take(seen.frozen.root, seen.chain, seen.success, steps)
                if seen.success >= self.target:
                    return
                now = -min(seen.reachable, self.target)
                if now > shortfall:
                    heapq.heappush(self.heap, (now, discrepancy, depth, next(self.order), (entry, seen)))
                    continue
            else:
                entry, seen = entry
            self.expand(entry, seen)

    def push(self, entry: _Node, reachable: Fraction) -> None:
        key = (-min(reachable, self.target), entry.discrepancy, -len(entry.steps), next(self.order))
        heapq.heappush(self.heap, (*key, entry))

    # --- one tree ----------------------------------------------------------------------------

    def simulate(self, entry: _Node) -> _Seen | None:
        """Make the refinement and simulate; None for a tree seen before, and for one too large."""
        draft = self.refined(entry)
        self.limits.check_time("planning")
        form = _form(draft)
        if form in self.known:
            return None
        try:
            frozen = freeze(draft, self.limits)
        except LimitReached:
            return None
        self.known.add(form)
        narrow = replace(self.limits, states=min(self.limits.states, _TREE_STATES))
        self.trees += 1
        try:
            chain = explore(self.task, frozen.root, narrow, self.transitions)
        except LimitReached:
            self.limits.check_time("planning")
            self.states += narrow.states
            return None
        self.states += len(chain.states)
        absorption = Absorption(chain)
        visits = absorption.visits()
        ends = [(visits[state] or Fraction(0), state) for state in chain.final]
        success = sum((p * chain.won(state) for p, state in ends), Fraction(0))
        failing = [(p, state) for p, state in ends if p and chain.status[state] is not NodeStatus.SUCCESS]
        endless = 1 - sum((p for p, _ in ends), Fraction(0))
        lost = sum((p for p, state in failing if not self.hopeful(chain.states[state].values)), Fraction(0))
        started = dict.fromkeys(chain.actions[chain.action[state]].id for state in sorted(absorption.endless))
        return _Seen(
            draft,
            frozen,
            chain,
            success,
            tuple(sorted(failing, key=lambda end: (-end[0], end[1]))),
            1 - lost,
            tuple(dict.fromkeys(frozen.attempts[action] for action in started)),
            endless,
        )

    def hopeful(self, values: Values) -> bool:
        return possible(self.task.goal, self.moves.relaxed.facts(values))

    def refined(self, entry: _Node) -> Draft:
        """A copy of the tree's draft with the refinement made."""
        if entry.above is None:
            draft = Draft.start(self.task, reactive=True)
            first = bytes(self.task.initial[0].values)
            wanted = self.moves.ordered([goal.condition for goal in draft.goals], first)
            draft.goals.sort(key=lambda goal: wanted.index(goal.condition))
            return draft
        draft, copies = entry.above.draft.copied()
        match entry.change:
            case Move():
                entry.change.apply(draft, copies)
            case Insertion(_, old, value, doing, conditions):
                subgoal = copies[old]
                ordered = self.moves.ordered(conditions, entry.values)
                attempts = subgoal.sensing if value is Truth.UNKNOWN else subgoal.acting
                attempts.append(new_attempt(subgoal, doing, list(ordered)))
            case None:
                pass
        return draft

    # --- what next ---------------------------------------------------------------------------

    def expand(self, entry: _Node, seen: _Seen) -> None:
        changes: list[tuple[Insertion | Move, Values]] = []
        if seen.circling:
            changes.extend((move, b"") for move in separating(seen.draft, seen.circling))
        elif seen.reachable < self.target and (last := _last(seen.draft)) is not None:
            changes.extend((move, b"") for move in forward(seen.draft, last))
        finder = FailureFinder(self.task, seen.frozen.root)
        for _, state in seen.failing:
            values = seen.chain.states[state].values
            if not self.hopeful(values):
                continue
            owners = (seen.frozen.owners.get(each.node) for each in finder.failing(seen.chain.states[state]))
            subgoals = [owner.subgoal for owner in owners if owner is not None and owner.subgoal is not None]
            found = self.moves.insertions(subgoals, seen.draft, values)[:_BRANCHES]
            if found:
                changes.extend((insertion, values) for insertion in found)
                break
        for rank, (change, values) in enumerate(changes):
            self.push(_Node(seen, change, entry.discrepancy + rank, entry.steps, values), seen.reachable)

    def told(self, above: _Seen, change: Insertion | Move | None, values: Values, now: _Seen) -> Refinement:
        """The refinement in the terms of reports."""
        nodes = size(now.frozen.root)
        if isinstance(change, Insertion):
            condition = change.subgoal.condition
            weight = Fraction(0)
            for p, state in above.failing:
                if evaluate(condition, above.chain.states[state].values) is change.value:
                    weight += p
            chance, opened = self.chances(change, values)
            unmet = sum(evaluate(c, values) is not Truth.TRUE for c in change.conditions)
            return Refinement(
                "insert",
                describe(self.task, condition),
                change.value,
                weight,
                change.name,
                chance,
                opened,
                unmet,
                now.success,
                nodes,
            )
        assert change is not None
        undone = describe(self.task, change.undone(above.draft))
        return Refinement(
            "move", undone, Truth.FALSE, above.endless, change.name, success=now.success, nodes=nodes
        )

    def chances(self, insertion: Insertion, values: Values) -> tuple[Fraction, Fraction]:
        """Probabilities that the action makes the condition hold (known, if it was unknown), and that it
        leaves it to be observed."""
        if insertion.doing is None:
            return Fraction(1), Fraction(0)
        name = insertion.doing.name
        if name not in self.transitions:
            self.transitions[name] = compile_action(self.task, insertion.doing, self.limits)
        chance = opened = Fraction(0)
        for result in self.transitions[name](insertion.started(values)):
            after = evaluate(insertion.subgoal.condition, result.values)
            if after is Truth.TRUE or (insertion.value is Truth.UNKNOWN and after is Truth.FALSE):
                chance += result.probability
            elif after is Truth.UNKNOWN and insertion.value is Truth.FALSE:
                opened += result.probability
        return chance, opened


def _last(draft: Draft) -> Attempt | None:
    """The attempt inserted last: its nodes have the highest numbers."""
    found: list[tuple[int, Attempt]] = []
    stack: list[Subgoal] = list(draft.goals)
    while stack:
        for attempt in stack.pop().attempts():
            stack.extend(attempt.preconditions)
            found.append((max((int(n[1:]) for n in attempt.ids.values()), default=0), attempt))
    return max(found, key=lambda pair: pair[0])[1] if found else None


def _form(draft: Draft) -> tuple[object, ...]:
    """What a draft is, whatever the order of its refinements."""

    def of(subgoal: Subgoal) -> tuple[object, ...]:
        lists = (subgoal.sensing, subgoal.acting)
        return (
            subgoal.condition,
            *(tuple((a.doing and a.doing.name, *map(of, a.preconditions)) for a in each) for each in lists),
        )

    return tuple(map(of, draft.goals))


def possible_target(task: Task, target: Fraction, limits: Limits) -> Fraction:
    """The target, or the best that any policy can do where that is less and known with little effort."""
    if len(task.actions) > FEW_ACTIONS:
        return target
    try:
        space = explore_space(task, replace(limits, states=min(limits.states, _FEW_STATES)))
        if space.complete:
            return min(target, max_prob(space, limits).initial.upper)
    except LimitReached:
        limits.check_time("planning")
    return target


def plan_search(
    task: Task, target: Fraction, limits: Limits, progress: Progress, options: Options = DEFAULTS
) -> Plan:
    """Plan by a search over refinements. Always returns: the target is reached, or nothing that was
    found reaches it (status ``stuck``), or a limit is reached; then the plan holds the best tree so far.

    Raises :class:`bbtc.diagnostics.LimitReached` only if the limits do not even allow the simulation of
    the initial belief.
    """
    start = freeze(Draft.start(task), limits).root
    best = BestTree.start(task, target, options.best, start, limits)
    search = _Search(task, target, limits, best)
    status: PlanStatus = "stuck"
    stop: Diagnostic | None = None
    try:
        search.target = possible_target(task, target, limits)
        search.run()
    except LimitReached as reached:
        status, stop = "limit-reached", reached.diagnostics[0]
    except KeyboardInterrupt:
        status = "interrupted"
        limits = limits.within(GRACE)
    if best.success > best.initial:
        try:
            finish(best, limits, options, transitions=search.transitions)
        except LimitReached as reached:
            stop = stop or reached.diagnostics[0]
        except KeyboardInterrupt:
            status = "interrupted"
    plan = best.plan(status, stop)
    for step in plan.refinements:
        progress(step)
    return plan
