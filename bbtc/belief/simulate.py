"""Self-simulation (paper, Algorithm 2): the exact figures of a tree."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import Chain, explore
from bbtc.belief.failures import FailureFinder
from bbtc.belief.tick import NodeStatus, compile_tick
from bbtc.belief.worst_world import WorstWorld
from bbtc.ground.condition import Condition
from bbtc.ground.task import ONE, ZERO, Task
from bbtc.limits import Limits
from bbtc.markov import weighted
from bbtc.tree.nodes import Node, walk


@dataclass(frozen=True, slots=True)
class FailureShare:
    """A part of the failure probability and what stopped the runs of that part.

    ``status`` is failure where ``condition`` was false and running where it was unknown and
    nothing observed it (blocked). ``condition`` is None where ``node`` is a retry node whose
    attempts are used up, and where no condition failed in the last tick (an empty control node).
    """

    node: str
    condition: Condition | None
    status: NodeStatus
    probability: Fraction


@dataclass(frozen=True, slots=True)
class Figures:
    """What a tree does, exactly. The probabilities of success, failure, blocked, endless and mistaken (the
    root succeeds, but the goal is not true: what is hidden was taken for true) sum to 1. Costs and numbers of
    actions are expectations; None is infinite, or, given success, undefined because success is
    impossible. ``worst`` is the worst world that hidden facts may make at the start; None where nothing is
    hidden, or that was not worked out, for the reason that ``worst_untold`` tells."""

    success: Fraction
    failure: Fraction
    blocked: Fraction
    endless: Fraction
    failures: tuple[FailureShare, ...]
    cost: Fraction | None
    cost_given_success: Fraction | None
    actions: Fraction | None
    actions_given_success: Fraction | None
    reward: Fraction | None
    states: int
    mistaken: Fraction = Fraction(0)
    worst: WorstWorld | None = None
    worst_untold: str | None = None


def simulate(task: Task, root: Node, limits: Limits) -> Figures:
    """The figures of a tree from the task's initial belief. Raises ``LimitReached``."""
    return figures(task, root, explore(task, root, limits))


def success_of(chain: Chain) -> Fraction:
    """The probability that runs end in success, the goal being true."""
    visits = Absorption(chain).visits()
    return weighted((visits[state] or ZERO, chain.won(state)) for state in chain.final)


def figures(task: Task, root: Node, chain: Chain) -> Figures:
    """The figures of a tree whose chain is known."""
    absorption = Absorption(chain)
    visits = absorption.visits()
    endless = absorption.entering()
    mass = {status: Fraction(0) for status in NodeStatus}
    for state in chain.final:
        mass[chain.status[state]] += visits[state] or 0
    mistaken = sum(
        ((visits[state] or 0) * (1 - chance) for state, chance in chain.doubtful.items()), Fraction(0)
    )
    success = mass[NodeStatus.SUCCESS] - mistaken
    wins = absorption.hitting({state: chain.won(state) for state in chain.final if chain.won(state)})
    taken = [
        (visit * edge.result.probability, edge)
        for visit, edges in zip(visits, chain.edges, strict=True)
        if visit
        for edge in edges
    ]
    won = [(weight * wins[edge.successor], edge) for weight, edge in taken]
    actions, won_actions = (weighted((weight, ONE) for weight, _ in each) for each in (taken, won))
    cost, won_cost = (weighted((weight, edge.result.cost) for weight, edge in each) for each in (taken, won))
    reward = weighted((weight, edge.result.reward) for weight, edge in taken)
    return Figures(
        success=success,
        failure=mass[NodeStatus.FAILURE],
        blocked=mass[NodeStatus.RUNNING],
        endless=endless,
        failures=_shares(task, root, chain, visits),
        cost=None if endless else cost,
        cost_given_success=won_cost / success if success else None,
        actions=None if endless else actions,
        actions_given_success=won_actions / success if success else None,
        reward=None if endless else reward,
        states=len(chain.states),
        mistaken=mistaken,
    )


def _shares(task: Task, root: Node, chain: Chain, visits: list[Fraction | None]) -> tuple[FailureShare, ...]:
    finder = FailureFinder(task, root)
    shares: dict[tuple[str, Condition | None, NodeStatus], Fraction] = {}
    for state in chain.final:
        probability = visits[state]
        if chain.status[state] is NodeStatus.SUCCESS or not probability:
            continue
        node, condition, status = finder.stopped(chain.states[state])
        key = (node or root.id, condition, chain.status[state] if status is None else status)
        shares[key] = shares.get(key, Fraction(0)) + probability
    order = {node.id: position for position, node in enumerate(walk(root))}
    ranked = sorted(shares.items(), key=lambda item: (-item[1], order[item[0][0]], item[0][2]))
    return tuple(FailureShare(node, condition, status, p) for (node, condition, status), p in ranked)


def flow(task: Task, root: Node, chain: Chain) -> dict[str, Fraction]:
    """For every node, the probability that a run ticks it at least once."""
    absorption = Absorption(chain)
    ticked: dict[str, dict[int, Fraction]] = {node.id: {} for node in walk(root)}
    seen: list[str] = []
    tick = compile_tick(task, root, lambda node, _: seen.append(node.id))
    for index, state in enumerate(chain.states):
        seen.clear()
        tick(state.values, state.finished)
        for node in seen:
            ticked[node][index] = Fraction(1)
    return {node: absorption.start(absorption.hitting(states)) for node, states in ticked.items()}
