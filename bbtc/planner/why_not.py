"""Why the goal is out of reach: where the runs of the best tree end, which action led there, and which facts
nothing brings back from there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import explore
from bbtc.belief.draws import Values
from bbtc.belief.scenarios import Scenario, scenarios
from bbtc.belief.tick import NodeStatus
from bbtc.diagnostics import LimitReached
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within, conjuncts
from bbtc.ground.describe import describe
from bbtc.ground.repair import Every, Need, Repairs, Root, Some, Way, every, some
from bbtc.ground.task import Effect, GroundAction, GroundEvent, Task, apparent_factors, effects_of
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.h_add import Facts, Relaxation, possible
from bbtc.source import Span
from bbtc.tree.nodes import Tree


@dataclass(frozen=True, slots=True)
class Block:
    """A fact that nothing brings back: ``fact`` would have to have ``value``, but is ``now`` something else.
    ``action`` (None: the goal itself) needs it, and stands at ``span``. Without ``setters`` no action at all
    brings it about; those could, but are out of reach themselves, mostly for want of it."""

    fact: str
    value: Truth
    now: Truth
    action: str | None
    span: Span | None
    setters: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DeadEnd:
    """Runs of this total probability end without the goal after ``action`` (None: they start so).
    ``lost`` are the parts of the goal that nothing can make true from there; empty where only their
    combination is out of reach. ``blocks`` say what that comes from, as far as it can be told; ``run`` is
    the most probable of them."""

    probability: Fraction
    action: str | None
    span: Span | None
    lost: tuple[str, ...]
    blocks: tuple[Block, ...] = ()
    run: Scenario | None = None


_MOST_EXPLAINED = 1000
"""Ways to end without the goal of which it is told what they lack: the most probable."""
_MOST_RUNS = 200
"""Runs looked at for the most probable one of each way."""
_Key: TypeAlias = "tuple[str | None, tuple[str, ...], tuple[Block, ...]]"


def dead_ends(tree: Tree, limits: Limits) -> tuple[DeadEnd, ...]:
    """What stops the runs of a tree that does as well as any policy, the most probable first; empty
    for any other tree. Raises ``LimitReached``."""
    if tree.status != "out-of-reach" or tree.bounds is None or tree.success_probability != tree.bounds[1]:
        return ()
    task = tree.task
    chain = explore(task, tree.root, limits)
    visits = Absorption(chain).visits()
    ends = {state for state in chain.final if chain.status[state] is not NodeStatus.SUCCESS}
    weights: dict[tuple[str | None, int], Fraction] = {}
    for probability, state in chain.initial:
        if state in ends and probability:
            weights[None, state] = probability
    for state, edges in enumerate(chain.edges):
        for edge in edges:
            if edge.successor in ends:
                last = chain.actions[chain.action[state]].action, edge.successor
                weight = (visits[state] or Fraction(0)) * edge.result.probability
                weights[last] = weights.get(last, Fraction(0)) + weight
    roots = RootFinder(task, limits)
    keys: dict[tuple[str | None, int], _Key] = {}
    found: dict[_Key, Fraction] = {}
    for end in sorted(weights, key=lambda end: -weights[end]):  # stable: else as found
        values = chain.states[end[1]].values
        lost = tuple(describe(task, part) for part in roots.lost(values))
        blocks = roots.blocks(values) if len(keys) < _MOST_EXPLAINED else ()
        keys[end] = end[0], lost, blocks
        found[keys[end]] = found.get(keys[end], Fraction(0)) + weights[end]
    runs: dict[_Key, Scenario] = {}
    with suppress(LimitReached):  # the ends are told without them
        for run in islice(scenarios(chain, limits, failing=True), _MOST_RUNS):
            action = run.steps[-1].node.action if run.steps else None
            runs.setdefault(keys[action, run.end], run)
    ranked = sorted(found.items(), key=lambda item: (-item[1], item[0][0] or "", item[0][1]))
    return tuple(
        DeadEnd(
            probability,
            action,
            None if action is None else task.action_by_name[action].span,
            lost,
            blocks,
            runs.get((action, lost, blocks)),
        )
        for (action, lost, blocks), probability in ranked
    )


_Fact: TypeAlias = tuple[int, Truth]


class RootFinder:
    """Finds what nothing brings back from states of one task, by the delete relaxation."""

    def __init__(self, task: Task, limits: Limits) -> None:
        self._task = task
        self._limits = limits
        self._relaxed = Relaxation(task, limits)
        self._makers: dict[_Fact, list[tuple[GroundAction | GroundEvent, Effect]]] = {}
        for each in task.occurrences:
            for effect in effects_of(apparent_factors(task, each)):
                for fact in effect.sets:
                    self._makers.setdefault(fact, []).append((each, effect))
        self._spans = {each.name: each.span for each in task.occurrences}

    def lost(self, values: Values) -> list[Condition]:
        """The parts of the goal that nothing can make true from a state."""
        facts, goal = self._relaxed.facts(values), self._task.goal
        return [part for part in conjuncts(goal) or (goal,) if not possible(part, facts)]

    def blocks(self, values: Values) -> tuple[Block, ...]:
        """What the lost parts of the goal come from, nearest to the goal first; empty where nothing is lost,
        or nothing would help. Raises ``LimitReached``."""
        facts = self._relaxed.facts(values)

        def ways(fact: _Fact) -> Iterator[Way[_Fact]]:
            for action, effect in self._makers.get(fact, ()):
                when = None if effect.when is None else _lacking(effect.when, facts)
                need = every([_lacking(action.precondition, facts), when])
                assert need is not None, "else the fact would be possible"
                if not self._forgets_first(need, fact[0]):
                    yield Way(action.name, need)

        repairs: Repairs[_Fact] = Repairs(ways, lambda _: 1.0, self._limits)
        need = every(_lacking(part, facts) for part in self.lost(values))
        roots = repairs.roots(need)
        given = bytearray(values)
        for root in roots:
            variable, value = root.what
            given[variable] = value
        # What asks for a fact and for its contrary, as no sane goal does, has no repair.
        return () if roots and self.lost(bytes(given)) else tuple(self._block(root, values) for root in roots)

    def _forgets_first(self, need: Need[_Fact], variable: int) -> bool:
        """Whether it takes the variable to be unknown, which nothing makes it: to find out about it is no way
        to change it."""
        unknown = (variable, Truth.UNKNOWN)
        parts = need.parts if isinstance(need, Every) else (need,)
        return unknown in parts and unknown not in self._makers

    def _block(self, root: Root[_Fact], values: Values) -> Block:
        variable, value = root.what
        return Block(
            describe(self._task, Is(variable, Truth.TRUE)),
            value,
            Truth(values[variable]),
            root.by,
            self._task.goal_span if root.by is None else self._spans[root.by],
            root.setters,
        )


def _lacking(condition: Condition, facts: Facts) -> Need[_Fact] | None:
    """What a condition lacks to be possible; None if nothing."""
    if possible(condition, facts):
        return None
    match condition:
        case Is(variable, value):
            return variable, value
        case Known(variable):
            return Some(((variable, Truth.TRUE), (variable, Truth.FALSE)))
        case And(parts):
            return every(_lacking(part, facts) for part in parts)
        case Or(parts):
            return some(_lacking(part, facts) for part in parts)
        case Not(_) | Constant(_) | Within():
            return Some(())
        case _:
            assert_never(condition)
