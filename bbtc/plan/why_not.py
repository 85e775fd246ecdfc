"""Why a target is out of reach: where the runs of the best tree end, which action led there, and
which conditions nothing can bring about from there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import explore
from bbtc.belief.state import Values
from bbtc.belief.tick import Status
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, conjuncts
from bbtc.ground.describe import describe
from bbtc.ground.task import Effect, GroundAction, Task, effects_of
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.plan.relaxed import Facts, RelaxedReachability, possible
from bbtc.source import Span
from bbtc.tree.nodes import Tree


@dataclass(frozen=True, slots=True)
class Block:
    """A fact that no action at all brings about: ``fact`` would have to have ``value``, but is ``now``
    something else. ``action`` (None: the goal itself) needs it, and stands at ``span``."""

    fact: str
    value: Truth
    now: Truth
    action: str | None
    span: Span | None


@dataclass(frozen=True, slots=True)
class DeadEnd:
    """Runs of this total probability end without the goal after ``action`` (None: they start so).
    ``lost`` are the parts of the goal that nothing can make true from there; empty where only their
    combination is out of reach. ``blocks`` say what that comes from, as far as it can be told."""

    probability: Fraction
    action: str | None
    span: Span | None
    lost: tuple[str, ...]
    blocks: tuple[Block, ...] = ()


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
    makers = _makers(task)
    found: dict[tuple[str | None, tuple[str, ...], tuple[Block, ...]], Fraction] = {}

    def add(action: str | None, state: int, probability: Fraction) -> None:
        values = chain.states[state].values
        facts = relaxed.facts(values)
        lost = [part for part in conjuncts(task.goal) or (task.goal,) if not possible(part, facts)]
        blocks = _blocks(task, makers, lost, facts, values)
        key = (action, tuple(describe(task, part) for part in lost), blocks)
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
        DeadEnd(p, action, None if action is None else task.action_by_name[action].span, lost, blocks)
        for (action, lost, blocks), p in ranked
    )


_Fact: TypeAlias = tuple[int, Truth]


def _makers(task: Task) -> dict[_Fact, list[tuple[GroundAction, Effect]]]:
    """The effects that give a variable a value."""
    found: dict[_Fact, list[tuple[GroundAction, Effect]]] = {}
    for action in task.actions:
        for effect in effects_of(action.factors):
            for fact in effect.sets:
                found.setdefault(fact, []).append((action, effect))
    return found


def _blocks(
    task: Task,
    makers: dict[_Fact, list[tuple[GroundAction, Effect]]],
    lost: Iterable[Condition],
    facts: Facts,
    values: Values,
) -> tuple[Block, ...]:
    """Down from conditions that nothing can make true, through the preconditions of the actions that
    would, the facts that no action brings about."""
    found: dict[_Fact, Block] = {}
    seen: set[_Fact] = set()
    todo: list[tuple[_Fact, GroundAction | None]] = [
        (fact, None) for part in lost for fact in _impossible(part, facts)
    ]
    for fact, needing in todo:  # grows while it is read: breadth first
        if fact in seen:
            continue
        seen.add(fact)
        variable, value = fact
        if fact not in makers:
            name, span = (None, task.goal_span) if needing is None else (needing.name, needing.span)
            text = describe(task, Is(variable, Truth.TRUE))
            found[fact] = Block(text, value, Truth(values[variable]), name, span)
        for action, effect in makers.get(fact, ()):
            needs = [action.precondition, *([] if effect.when is None else [effect.when])]
            todo.extend((each, action) for need in needs for each in _impossible(need, facts))
    return tuple(found.values())


def _impossible(condition: Condition, facts: Facts) -> Iterator[_Fact]:
    """The facts whose absence makes a condition impossible."""
    if possible(condition, facts):
        return
    match condition:
        case Is(variable, value):
            yield variable, value
        case Known(variable):
            yield variable, Truth.TRUE
            yield variable, Truth.FALSE
        case And(parts) | Or(parts):
            for part in parts:
                yield from _impossible(part, facts)
        case Not(_) | Constant(_):
            return
        case _:
            assert_never(condition)
