"""Doubts about the start and the goal of a problem that need no grounding: what `:init` leaves false
although the goal needs it found out, most likely a forgotten `(unknown …)`; goals no predicate allows."""

from __future__ import annotations

from collections.abc import Iterator

from bbtc.analysis import facts
from bbtc.diagnostics import Diagnostic, Severity
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf

_MOST_NAMED = 3
_LONGEST = 60


def hopeless(model: md.Model) -> Iterator[Diagnostic]:
    """Warnings about the parts of a goal that nothing can make true whatever the objects are."""
    if model.goal is None:
        return
    reached = facts.reached(model)
    for part in model.goal.parts if isinstance(model.goal, mf.And) else (model.goal,):
        if not reached.possible(part):
            span = part.span or model.goal_span
            shown = "" if span is None else f" `{' '.join(span.text.split())[:_LONGEST]}`"
            message = f"nothing can make the goal{shown} true"
            hint = "`:init` does not give it, and no action that can apply brings it about"
            yield Diagnostic("BBT0316", message, span, hint)


def not_unknown(model: md.Model) -> Iterator[Diagnostic]:
    """A finding about the facts of a goal that only observing can make true, that are false at the start
    because `:init` does not mention them, and whose being false no action ever asks for: a note where an
    action makes them unknown later."""
    if model.goal is None:
        return
    mentioned = {(fact.predicate, fact.args) for fact in model.init.facts}
    drawn = {leaf.predicate for choice in model.init.choices for leaf in me.settings(choice)}
    drawn |= {atom.predicate for clause in model.init.clauses for atom in mf.atoms(clause.condition)}
    wanted = [
        reading.atom
        for reading in mf.readings(model.goal)
        if reading.value in (Truth.TRUE, None) and not any(map(mf.is_parameter, reading.atom.args))
    ]
    found = [
        atom
        for atom in dict.fromkeys(wanted)
        if (atom.predicate, atom.args) not in mentioned
        and atom.predicate not in drawn
        and _is_only_observed(model, atom.predicate)
    ]
    if not found:
        return
    names = " or ".join(f"`{atom.predicate}({','.join(atom.args)})`" for atom in found[:_MOST_NAMED])
    more = f" or {len(found) - _MOST_NAMED} more" if len(found) > _MOST_NAMED else ""
    texts = " ".join(f"(unknown ({' '.join((atom.predicate, *atom.args))}))" for atom in found[:_MOST_NAMED])
    given = md.set_values(model)
    never = all(Truth.UNKNOWN not in given.get(atom.predicate, ()) for atom in found)
    yield Diagnostic(
        "BBT0315",
        f"nothing makes {names}{more} unknown{'' if never else ' at the start'}, but only observing tells",
        model.init.span or model.problem_span,
        f"if nobody knows it yet, add `{texts}` to `:init`; if it is false, `(not …)` there says so",
        Severity.WARNING if never else Severity.NOTE,
    )


def _is_only_observed(model: md.Model, predicate: str) -> bool:
    """Whether whatever makes it true asks for it to be unknown first, and nothing asks for it to be false."""
    makers = [
        schema
        for schema in model.schemas.values()
        if any(
            leaf.predicate == predicate and leaf.value is Truth.TRUE for leaf in me.settings(schema.effects)
        )
    ]
    conditions = [formula for schema in model.schemas.values() for formula in facts.schema_conditions(schema)]
    conditions.extend(rule.condition for rule in model.rules)
    asked = {
        reading.value
        for formula in conditions
        for reading in mf.readings(formula)
        if reading.atom.predicate == predicate
    }
    return (
        bool(makers) and Truth.FALSE not in asked and all(_observes(schema, predicate) for schema in makers)
    )


def _observes(schema: md.Schema, predicate: str) -> bool:
    parts = schema.precondition.parts if isinstance(schema.precondition, mf.And) else (schema.precondition,)
    guards = list(me.conditions(schema.effects))
    return any(
        isinstance(part, mf.Test) and part.kind == "unknown" and part.atom.predicate == predicate
        for part in (*parts, *guards)
    )
