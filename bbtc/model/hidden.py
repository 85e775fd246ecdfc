"""Which models have hidden state: something is true that the robot may not know."""

from __future__ import annotations

from bbtc.model import domain as md
from bbtc.model import effect as me


def has_hidden_state(model: md.Model) -> bool:
    """Whether facts of the model may be true without being known: an action has ``:observe``, there is a
    sensor, a predicate is ``observed``, or ``:init`` has a ``oneof`` or a clause such as ``(or …)``. In all
    other models a fact is unknown where an effect or ``:init`` says so, and nothing is hidden behind it."""
    return (
        bool(model.sensors or model.init.clauses)
        or any(predicate.observed for predicate in model.predicates.values())
        or any(schema.tells for schema in model.schemas.values())
        or any(map(has_oneof, model.init.choices))
    )


def has_oneof(effect: me.Effect) -> bool:
    """Does a draw of the start leave open how likely its results are?"""
    return any(
        isinstance(part, me.Choice) and part.oneof and len(part.branches) > 1 for part in me.walk(effect)
    )
