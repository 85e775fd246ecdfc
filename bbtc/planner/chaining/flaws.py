"""What to resolve next: the most probable deepest failed condition (paper, section "Finding a
condition to resolve")."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from bbtc.belief.chain import Chain
from bbtc.belief.failures import Failing, FailureFinder
from bbtc.belief.state import State
from bbtc.belief.tick import NodeStatus
from bbtc.ground.condition import Condition, evaluate, variables
from bbtc.ground.task import GroundTemplate, Task
from bbtc.kleene import Truth
from bbtc.planner.chaining.choose import Chooser, Flaw
from bbtc.planner.chaining.draft import Attempt, Frozen, Subgoal, changed_by
from bbtc.tree.nodes import Node, actions_of


@dataclass(slots=True)
class Simulated:
    """A draft with its nodes, its chain, and the probability of each final state."""

    frozen: Frozen
    chain: Chain
    mass: dict[int, Fraction]
    success: Fraction
    goals: Fraction
    """Expected number of the goal's conditions that are true at the end."""
    bits: dict[Attempt, int] = field(init=False)
    """For each attempt, the latches of its own action nodes."""

    def __post_init__(self) -> None:
        self.bits = {}
        for index, node in enumerate(actions_of(self.root)):
            attempt = self.frozen.attempts[node.id]
            self.bits[attempt] = self.bits.get(attempt, 0) | 1 << index

    @property
    def root(self) -> Node:
        """The frozen tree."""
        return self.frozen.root

    def failing(self, condition: Condition, value: Truth) -> Fraction:
        """Probability of ending without success and with the condition at the value."""
        states = self.chain.states
        return sum(
            (
                probability
                for index, probability in self.mass.items()
                if self.chain.status[index] is not NodeStatus.SUCCESS
                and evaluate(condition, states[index].values) is value
            ),
            Fraction(0),
        )

    def started(self, flaw: Flaw) -> frozenset[Attempt]:
        """Attempts of which an action was started in some of a flaw's states."""
        finished = _finished(flaw.states)
        return frozenset(attempt for attempt, bits in self.bits.items() if bits & finished)


@dataclass(slots=True)
class FlawFinder:
    """Groups the failing final states of a draft by the condition to resolve in them.

    ``banned`` holds insertions that were tried and taken back.
    """

    task: Task
    chooser: Chooser
    banned: set[tuple[Subgoal, Truth, str]] = field(default_factory=set)
    _missing: dict[tuple[Attempt, Condition], Subgoal] = field(default_factory=dict)

    def best(self, simulated: Simulated) -> Flaw | None:
        """The most probable flaw; None if no insertion helps in any state.

        In each state it is the deepest failed condition that some insertion may still help there;
        a state in which none helps any of its failed conditions is given up.
        """
        finder = FailureFinder(self.task, simulated.root)
        groups: dict[tuple[Subgoal, Truth], list[tuple[State, Fraction]]] = {}
        for index, probability in simulated.mass.items():
            if simulated.chain.status[index] is NodeStatus.SUCCESS or not probability:
                continue
            state = simulated.chain.states[index]
            for failing in finder.failing(state):
                subgoal = self._subgoal(simulated, failing, state)
                if subgoal is None:
                    continue
                value = evaluate(subgoal.condition, state.values)
                here = self._flaw(simulated, subgoal, value, [(state, probability)])
                if value is not Truth.TRUE and self.chooser.helps(here):
                    groups.setdefault((subgoal, value), []).append((state, probability))
                    break
        flaws = [self._flaw(simulated, subgoal, value, states) for (subgoal, value), states in groups.items()]
        return max(flaws, key=lambda flaw: flaw.probability, default=None)

    def _flaw(
        self, simulated: Simulated, subgoal: Subgoal, value: Truth, states: list[tuple[State, Fraction]]
    ) -> Flaw:
        finished = _finished(states)
        attempts = subgoal.sensing if value is Truth.UNKNOWN else subgoal.acting
        excluded = {
            attempt.doing.name
            for attempt in attempts
            if attempt.doing is not None and not simulated.bits.get(attempt, 0) & finished
        }
        excluded.update(name for at, of, name in self.banned if at is subgoal and of is value)
        return Flaw(subgoal, value, tuple(states), frozenset(excluded))

    def _subgoal(self, simulated: Simulated, failing: Failing, state: State) -> Subgoal | None:
        """The subgoal a failing node stands for, unless it only guards what has run already."""
        owner = simulated.frozen.owners.get(failing.node)
        if owner is None:
            return None
        subgoal = owner.subgoal
        if subgoal is None:
            if failing.node not in simulated.frozen.attempts or owner.attempt is None:
                return None  # a condition of a template's author is that author's business
            subgoal = self._missing_precondition(owner.attempt, failing.condition)
        if subgoal is not None and subgoal.parent is not None:
            for attempt in subgoal.parent.ancestors():
                own = simulated.bits.get(attempt, 0)
                if own and state.finished & own == own:
                    return None
        return subgoal

    def _missing_precondition(self, attempt: Attempt, condition: Condition) -> Subgoal | None:
        """The precondition that an action inside a template lacks, as a subgoal before the body;
        None if the body itself can change it."""
        if not isinstance(attempt.doing, GroundTemplate):
            return None
        if not changed_by(self.task, attempt.doing.body).isdisjoint(variables(condition)):
            return None
        for subgoal in attempt.preconditions:
            if subgoal.condition == condition:
                return subgoal
        return self._missing.setdefault((attempt, condition), Subgoal(condition, attempt))


def _finished(states: list[tuple[State, Fraction]] | tuple[tuple[State, Fraction], ...]) -> int:
    """The latches that have finished in some of the states."""
    finished = 0
    for state, _ in states:
        finished |= state.finished
    return finished
