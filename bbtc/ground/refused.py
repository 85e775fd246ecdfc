"""What is read and checked, but cannot be grounded yet."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from bbtc.diagnostics import Diagnostic
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf

_START = "facts, `(unknown …)`, `(probabilistic …)`, `(oneof …)` and `(or …)` can"


def refused(model: md.Model) -> Iterator[Diagnostic]:
    """An error for every construct of a model that grounding has no counterpart for."""
    for schema in model.schemas.values():
        if isinstance(schema.observe, me.Choice) and noise(schema.observe) is None:
            yield Diagnostic(
                "BBT0406",
                f"`:observe` of action `{schema.name}` cannot be grounded",
                schema.observe_span,
                "a noisy reading is written `(probabilistic q (p))`: right with q, whichever the truth",
            )
    for sensor in model.sensors:
        yield Diagnostic("BBT0407", f"sensor `{sensor.name}` cannot be grounded yet", sensor.span)
    for clause in model.init.clauses:
        if clause.invariant:
            yield Diagnostic("BBT0405", "`invariant` in `:init` cannot be grounded yet", clause.span, _START)
        elif any(_is_no_fact(model, reading) for reading in mf.readings(clause.condition)):
            message = "a condition in `:init` tells of facts, not of what is known or derived"
            yield Diagnostic("BBT0405", message, clause.span, _START)
    if model.problem is not None and model.goal is None:
        yield Diagnostic(
            "BBT0411",
            f"problem `{model.problem}` has no goal to plan for",
            model.problem_span,
            "bbtc plans for a goal; a metric alone is none",
        )


def noise(observed: me.Choice) -> tuple[me.Set, Fraction] | None:
    """The fact that a noisy reading tells, and the probability that it is right; None for other forms."""
    told = [branch for branch in observed.branches if not isinstance(branch.effect, me.Together)]
    if observed.oneof or len(told) != 1 or not isinstance(told[0].effect, me.Set):
        return None
    return told[0].effect, told[0].probability


def _is_no_fact(model: md.Model, reading: mf.Reading) -> bool:
    tested = reading.value is None or reading.value is Truth.UNKNOWN
    return tested or model.predicates[reading.atom.predicate].derived
