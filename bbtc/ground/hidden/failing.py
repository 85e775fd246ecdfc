"""Actions whose preconditions are about the world: where what is hidden makes one false, the action may be
started all the same. It costs what it costs, and changes nothing."""

from __future__ import annotations

from dataclasses import replace

from bbtc.ground import task as gt
from bbtc.ground.condition import TRUE, Condition, conjunction, conjuncts
from bbtc.ground.hidden.parts import facts_read
from bbtc.ground.hidden.physical import Physical
from bbtc.ground.hidden.uncertain import hidden_facts


def may_fail(physical: Physical) -> Physical:
    """The physical task in which preconditions read nothing that is hidden: what they read of it guards the
    effects, which may hide more."""
    while True:
        hidden = hidden_facts(physical)
        actions = tuple(_guarded(action, hidden) for action in physical.task.actions)
        if actions == physical.task.actions:
            return physical
        physical = replace(physical, task=replace(physical.task, actions=actions))


def _guarded(action: gt.GroundAction, hidden: frozenset[int]) -> gt.GroundAction:
    parts = list(conjuncts(action.precondition))
    of_world = [part for part in parts if facts_read(part) & hidden]
    if not of_world:
        return action
    guard = conjunction(of_world)
    return replace(
        action,
        precondition=conjunction(part for part in parts if part not in of_world),
        factors=tuple(_under(factor, guard) for factor in action.factors),
    )


def _under(factor: gt.Factor, guard: Condition) -> gt.Factor:
    return replace(factor, outcomes=tuple(_outcome(outcome, guard) for outcome in factor.outcomes))


def _outcome(outcome: gt.Outcome, guard: Condition) -> gt.Outcome:
    effects = (
        replace(effect, when=conjunction([guard, TRUE if effect.when is None else effect.when]))
        for effect in outcome.effects
    )
    inner = tuple(_under(factor, guard) for factor in outcome.factors)
    return replace(outcome, effects=tuple(effects), factors=inner)
