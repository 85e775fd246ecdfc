"""What is read and checked, but cannot be grounded yet."""

from __future__ import annotations

from collections.abc import Iterator

from bbtc.diagnostics import Diagnostic
from bbtc.model import domain as md
from bbtc.model import effect as me

_START = "only facts, `(unknown …)` and `(probabilistic …)` can"


def refused(model: md.Model) -> Iterator[Diagnostic]:
    """An error for every construct of a model that grounding has no counterpart for."""
    for schema in model.schemas.values():
        if schema.observe is not None:
            yield Diagnostic(
                "BBT0406",
                f"`:observe` of action `{schema.name}` cannot be grounded yet",
                schema.observe_span,
                "write it as an effect: `(probabilistic 1/2 p 1/2 (not p))` under `(unknown p)`",
            )
    for sensor in model.sensors:
        yield Diagnostic("BBT0407", f"sensor `{sensor.name}` cannot be grounded yet", sensor.span)
    for clause in model.init.clauses:
        what = "`invariant`" if clause.invariant else "`or` and other uncertain conditions"
        yield Diagnostic("BBT0405", f"{what} in `:init` cannot be grounded yet", clause.span, _START)
    for choice in model.init.choices:
        if has_oneof(choice):
            yield Diagnostic("BBT0404", "`oneof` in `:init` cannot be grounded yet", choice.span, _START)
    if model.problem is not None and model.goal is None:
        yield Diagnostic(
            "BBT0411",
            f"problem `{model.problem}` has no goal to plan for",
            model.problem_span,
            "bbtc plans for a goal; a metric alone is none",
        )


def has_oneof(effect: me.Effect) -> bool:
    """Does a draw of the start leave open how likely its results are?"""
    return any(
        isinstance(part, me.Choice) and part.oneof and len(part.branches) > 1 for part in me.walk(effect)
    )
