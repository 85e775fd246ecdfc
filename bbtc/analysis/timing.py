"""How long actions take, and when they are given up: names bound, numbers checked as far as known."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from bbtc import durations
from bbtc.analysis import formulas
from bbtc.analysis.names import Names, Scope
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.syntax import ast

_SECONDS = "seconds are numbers, and functions that `:init` gives: `(drive-time ?from ?to)`"


def timed(names: Names, schema: md.Schema, node: ast.Timing | None, scope: Scope) -> md.Schema:
    """The action with its duration and its time-out."""
    if node is None:
        return schema
    duration = None if node.duration is None else _duration(names, node.duration, scope)
    given = node.timeout_probability if node.timeout_probability is not None else node.on_timeout
    if node.timeout is None:
        if given is not None:
            message = f"action `{schema.name}` says what comes of a time-out, and has none"
            names.report.error("BBT0444", message, given.span, "`:timeout n` gives it up after n seconds")
        return replace(schema, duration=duration)
    limit = _timeout(names, schema.name, node, duration, scope)
    late = me.NOTHING if node.on_timeout is None else formulas.effect(names, node.on_timeout, scope)
    if limit is None:
        return replace(schema, duration=duration)
    half = Fraction(1, 2)
    branches = (
        me.Branch(half, late, node.span if node.on_timeout is None else node.on_timeout.span),
        me.Branch(half, schema.effect, schema.span),
    )
    effect = me.Choice(branches, False, limit.span, limit)
    return replace(schema, effect=effect, duration=duration, timeout=limit)


def _timeout(
    names: Names, action: str, node: ast.Timing, duration: me.LiftedDuration | None, scope: Scope
) -> me.TimeOut | None:
    timeout = node.timeout
    assert timeout is not None
    whose = f"the time-out of action `{action}`"
    seconds, chance = formulas.amount(names, timeout, scope), node.timeout_probability
    if isinstance(seconds, me.Constant) and not 0 < seconds.value <= durations.LONGEST:
        message = f"{whose} is not above 0" if seconds.value <= 0 else f"{whose} is too long"
        names.report.error("BBT0444", message, timeout.span, "an action that may not begin needs no time-out")
    if chance is None and node.duration is None:
        message = f"how probably {whose[4:]} passes is not said"
        hint = "say so, as `:timeout-probability 0.1`, or how long the action takes, as `:duration 12`"
        names.report.error("BBT0444", message, timeout.span, hint)
    elif chance is not None and node.duration is not None:
        message = f"how probably {whose[4:]} passes follows from its duration"
        names.report.error("BBT0444", message, chance.span, "give either of the two")
    elif chance is not None and not 0 <= chance.value <= 1:
        message = f"probability {chance.text} is outside [0, 1]"
        names.report.error("BBT0210", message, chance.span, formulas.percentage(chance.value))
    if seconds is None:
        return None
    return me.TimeOut(seconds, duration, None if chance is None else chance.value, timeout.span)


def _duration(names: Names, node: ast.Duration, scope: Scope) -> me.LiftedDuration | None:
    found = [formulas.amount(names, amount, scope) for amount in node.amounts]
    amounts = tuple(amount for amount in found if amount is not None)
    if len(amounts) < len(found):
        return None
    lifted = me.LiftedDuration(node.kind, amounts, tuple(weight.value for weight in node.weights), node.span)
    values = [amount.value for amount in amounts if isinstance(amount, me.Constant)]
    if len(values) == len(amounts):
        wrong = durations.problem(me.duration_of(lifted, values))
        if wrong is not None:
            names.report.error("BBT0443", wrong, node.span, _SECONDS)
    return lifted
