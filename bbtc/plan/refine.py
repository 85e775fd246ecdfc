"""The paper's Algorithm 3: refine a tree until its simulation reaches the target.

Steps, numbered as in the paper: 1 simulate; 2 find the most probable deepest failed condition;
3 if an action of a later branch undid it, move that branch; 4 otherwise insert an action or a
template for it; repeat. The choice is greedy, as published. What is added so that it always ends:
a condition for which nothing can be inserted is closed, and with every failed condition closed
the planner is stuck; and the limits on time, states and nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import Chain, explore
from bbtc.belief.failures import Failing, FailureFinder
from bbtc.belief.simulate import figures as chain_figures
from bbtc.belief.simulate import simulate
from bbtc.belief.state import State, Transition
from bbtc.belief.tick import Status
from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.condition import Condition, evaluate, variables
from bbtc.ground.describe import describe
from bbtc.ground.task import GroundTemplate, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.plan.choose import Candidate, Chooser, Target
from bbtc.plan.draft import Attempt, Draft, Frozen, Subgoal, changed_by, freeze, new_attempt
from bbtc.plan.prune import without_idle_branches
from bbtc.plan.result import Plan, Progress, Refinement
from bbtc.plan.threats import find_threat
from bbtc.tree.nodes import Node, Tree, actions_of, walk
from bbtc.tree.nodes import Status as PlanStatus


@dataclass(slots=True)
class _Simulated:
    """A draft with its nodes, its chain and what follows from them."""

    frozen: Frozen
    chain: Chain
    mass: dict[int, Fraction]
    success: Fraction

    @property
    def root(self) -> Node:
        return self.frozen.root


@dataclass(slots=True)
class _Refiner:
    task: Task
    target: Fraction
    limits: Limits
    draft: Draft
    chooser: Chooser
    transitions: dict[str, Transition]
    closed: set[tuple[Subgoal, Truth]] = field(default_factory=set)
    moved: set[tuple[Subgoal, Subgoal]] = field(default_factory=set)
    found: dict[tuple[Attempt, Condition], Subgoal] = field(default_factory=dict)

    def simulate(self) -> _Simulated:
        frozen = freeze(self.draft)
        self.limits.check_nodes(sum(1 for _ in walk(frozen.root)))
        chain = explore(self.task, frozen.root, self.limits, self.transitions)
        visits = Absorption(chain).visits()
        mass = {state: visits[state] or Fraction(0) for state in chain.final}
        success = sum((p for s, p in mass.items() if chain.status[s] is Status.SUCCESS), Fraction(0))
        return _Simulated(frozen, chain, mass, success)

    def targets(self, simulated: _Simulated) -> list[Target]:
        """Failed conditions that are not closed, the most probable first (paper: the deepest of
        each state; a state whose deepest one is closed counts for its next deepest)."""
        finder = FailureFinder(self.task, simulated.root)
        bits = _bits(simulated)
        groups: dict[tuple[Subgoal, Truth], list[tuple[State, Fraction]]] = {}
        for index, probability in simulated.mass.items():
            if simulated.chain.status[index] is Status.SUCCESS or not probability:
                continue
            state = simulated.chain.states[index]
            for failing in finder.failing(state):
                subgoal = self.subgoal_of(simulated, failing, state, bits)
                if subgoal is None:
                    continue
                key = (subgoal, evaluate(subgoal.condition, state.values))
                if key[1] is not Truth.TRUE and key not in self.closed:
                    groups.setdefault(key, []).append((state, probability))
                    break
        targets = [
            Target(subgoal, value, tuple(states), _idle(subgoal, states, bits))
            for (subgoal, value), states in groups.items()
        ]
        return sorted(targets, key=lambda target: -target.probability)

    def subgoal_of(
        self, simulated: _Simulated, failing: Failing, state: State, bits: dict[Attempt, int]
    ) -> Subgoal | None:
        """The subgoal a failing node stands for, unless it only guards what has run already."""
        owner = simulated.frozen.owners.get(failing.node)
        if owner is None:
            return None
        subgoal = owner.subgoal
        if subgoal is None:
            if failing.node not in simulated.frozen.attempts or owner.attempt is None:
                return None  # a condition of a template's author is that author's business
            subgoal = self.missing_precondition(owner.attempt, failing.condition)
        if subgoal is not None and subgoal.parent is not None:
            for attempt in subgoal.parent.ancestors():
                own = bits.get(attempt, 0)
                if own and state.finished & own == own:
                    return None
        return subgoal

    def missing_precondition(self, attempt: Attempt, condition: Condition) -> Subgoal | None:
        """The precondition that an action inside a template lacks, as a subgoal before the body;
        None if the body itself can change it."""
        if not isinstance(attempt.doing, GroundTemplate):
            return None
        if not changed_by(self.task, attempt.doing.body).isdisjoint(variables(condition)):
            return None
        for subgoal in attempt.preconditions:
            if subgoal.condition == condition:
                return subgoal
        return self.found.setdefault((attempt, condition), Subgoal(condition, attempt))

    def insert(self, target: Target, candidate: Candidate) -> None:
        """Put the candidate under the target: a perception under a Skipper where the condition is
        unknown, an actuation under a Fallback where it is false."""
        parent = target.subgoal.parent
        if parent is not None and target.subgoal not in parent.preconditions:
            parent.preconditions.append(target.subgoal)
        attempt = new_attempt(target.subgoal, candidate.doing, list(candidate.conditions))
        attempts = target.subgoal.sensing if target.value is Truth.UNKNOWN else target.subgoal.acting
        attempts.append(attempt)

    def step(self, simulated: _Simulated) -> Refinement | None:
        """One refinement of the draft (its success filled in later); None if stuck."""
        started = _started(simulated)
        while targets := self.targets(simulated):
            target = targets[0]
            common = (describe(self.task, target.subgoal.condition), target.value, target.probability)
            threat = find_threat(self.draft, target, started, self.moved)
            if threat is not None:
                self.moved.add((threat.siblings[threat.earlier], threat.siblings[threat.later]))
                threat.resolve()
                return Refinement("move", *common, threat.action)
            candidates = self.chooser.candidates(target)
            if candidates:
                best = candidates[0]
                self.insert(target, best)
                return Refinement("insert", *common, best.name, best.success, best.open, best.unmet)
            self.closed.add((target.subgoal, target.value))
        return None


def refine(task: Task, target: Fraction, limits: Limits, progress: Progress) -> Plan:
    """Plan by greedy refinement. Always returns: the target is reached, or nothing is left to
    insert (status ``stuck``), or a limit is reached; then the plan holds the best tree so far.

    Raises :class:`bbtc.diagnostics.LimitReached` only if the limits do not even allow the
    simulation of the initial belief.
    """
    transitions: dict[str, Transition] = {}
    refiner = _Refiner(task, target, limits, Draft.start(task), Chooser(task, transitions), transitions)
    refinements: list[Refinement] = []
    status: PlanStatus = "stuck"
    stop: Diagnostic | None = None
    best = current = refiner.simulate()
    initial = current.success
    try:
        while True:
            if current.success >= target:
                status = "target-reached"
                break
            limits.check_time("planning")
            done = refiner.step(current)
            if done is None:
                break
            current = refiner.simulate()
            nodes = sum(1 for _ in walk(current.root))
            refinements.append(replace(done, success=current.success, nodes=nodes))
            progress(refinements[-1])
            if current.success > best.success:
                best = current
    except LimitReached as reached:
        status, stop = "limit-reached", reached.diagnostics[0]
    except KeyboardInterrupt:
        status = "interrupted"
    root = without_idle_branches(task, best.root, best.chain)
    figures = simulate(task, root, limits) if root is not best.root else chain_figures(task, root, best.chain)
    return Plan(Tree(task, root, best.success, target, status), figures, initial, tuple(refinements), stop)


def _bits(simulated: _Simulated) -> dict[Attempt, int]:
    """For each attempt, the latches of its own action nodes."""
    bits: dict[Attempt, int] = {}
    for index, node in enumerate(actions_of(simulated.root)):
        attempt = simulated.frozen.attempts[node.id]
        bits[attempt] = bits.get(attempt, 0) | 1 << index
    return bits


def _started(simulated: _Simulated) -> frozenset[Attempt]:
    """Attempts of which an action was started in some run that ends without success."""
    finished = 0
    for index, probability in simulated.mass.items():
        if probability and simulated.chain.status[index] is not Status.SUCCESS:
            finished |= simulated.chain.states[index].finished
    return frozenset(attempt for attempt, bits in _bits(simulated).items() if bits & finished)


def _idle(subgoal: Subgoal, states: list[tuple[State, Fraction]], bits: dict[Attempt, int]) -> frozenset[str]:
    finished = 0
    for state, _ in states:
        finished |= state.finished
    return frozenset(
        attempt.doing.name
        for attempt in subgoal.attempts()
        if attempt.doing is not None and not bits.get(attempt, 0) & finished
    )
