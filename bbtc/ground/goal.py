"""Says why a goal cannot be reached."""

from __future__ import annotations

from bbtc.diagnostics import Report
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf

_LONGEST = 60


def unreachable(model: md.Model, part: mf.Formula, report: Report) -> None:
    """Report a part of the goal that is false even if nothing is ever undone."""
    span = part.span or model.goal_span
    shown = "the goal" if span is None else f"`{' '.join(span.text.split())}`"
    if len(shown) > _LONGEST:
        shown = f"{shown[: _LONGEST - 4]}...`"
    report.error(
        "BBT0412",
        f"the goal cannot be reached: no action ever achieves {shown}",
        span,
        _achievers(model, part),
    )


def _achievers(model: md.Model, part: mf.Formula) -> str | None:
    """What could make an unreachable literal true, if the part is one."""
    atom = part.part if isinstance(part, mf.Not) else part
    if not isinstance(atom, mf.Atom) or model.predicates[atom.predicate].derived:
        return None
    value = Truth.FALSE if isinstance(part, mf.Not) else Truth.TRUE
    setters = [
        f"`{schema.name}`"
        for schema in model.schemas.values()
        if any(
            isinstance(leaf, me.Set) and leaf.predicate == atom.predicate and leaf.value is value
            for leaf in me.leaves(schema.effect)
        )
    ]
    if not setters:
        external = model.predicates[atom.predicate].external
        more = ", and it is planned for as if others left it as `:init` says" if external else ""
        return f"no action makes `{atom.predicate}` {value.word}{more}"
    listed = ", ".join(setters[:5])
    return (
        f"only {listed} could, but cannot apply, or not to these objects: `bbtc check` may tell "
        "which precondition is never true"
    )
