"""Why a target is out of reach: where the runs of the best tree end, which action led there, and
which conditions nothing can bring about from there."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import explore
from bbtc.belief.state import Values
from bbtc.belief.tick import Status
from bbtc.ground.condition import conjuncts
from bbtc.ground.describe import describe
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.plan.relaxed import RelaxedReachability, possible
from bbtc.source import Span
from bbtc.tree.nodes import Tree


@dataclass(frozen=True, slots=True)
class DeadEnd:
    """Runs of this total probability end without the goal after ``action`` (None: they start so).
    ``lost`` are the parts of the goal that nothing can make true from there; empty where only their
    combination is out of reach."""

    probability: Fraction
    action: str | None
    span: Span | None
    lost: tuple[str, ...]


def dead_ends(tree: Tree, limits: Limits) -> tuple[DeadEnd, ...]:
    """What stops the runs of a tree that does as well as any policy, the most probable first; empty
    for any other tree. Raises ``LimitReached``."""
    if tree.status != "out-of-reach" or tree.bounds is None or tree.success_probability != tree.bounds[1]:
        return ()
    task = tree.task
    chain = explore(task, tree.root, limits)
    visits = Absorption(chain).visits()
    relaxed = RelaxedReachability(task)
    ends = {state for state in chain.final if chain.status[state] is not Status.SUCCESS}
    found: dict[tuple[str | None, tuple[str, ...]], Fraction] = {}

    def add(action: str | None, state: int, probability: Fraction) -> None:
        key = (action, _lost(task, relaxed, chain.states[state].values))
        found[key] = found.get(key, Fraction(0)) + probability

    for probability, state in chain.initial:
        if state in ends and probability:
            add(None, state, probability)
    for state, edges in enumerate(chain.edges):
        for edge in edges:
            if edge.target in ends:
                weight = (visits[state] or Fraction(0)) * edge.result.probability
                add(chain.actions[chain.action[state]].action, edge.target, weight)
    ranked = sorted(found.items(), key=lambda item: (-item[1], item[0][0] or "", item[0][1]))
    return tuple(
        DeadEnd(p, action, None if action is None else task.action_by_name[action].span, lost)
        for (action, lost), p in ranked
    )


def _lost(task: Task, relaxed: RelaxedReachability, values: Values) -> tuple[str, ...]:
    facts = relaxed.facts(values)
    parts = conjuncts(task.goal) or (task.goal,)
    return tuple(describe(task, part) for part in parts if not possible(part, facts))
