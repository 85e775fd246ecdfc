"""What is read and checked, but cannot be grounded yet."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from bbtc.diagnostics import Diagnostic
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.hidden import has_hidden_state

_START = "facts, `(unknown …)`, `(probabilistic …)`, `(oneof …)` and `(or …)` can"

_NOISY = (
    "a noisy reading is written `(probabilistic q (p))`: right with q, whichever the truth; or "
    "`(probabilistic q (p) r (not (p)))`: right with q where `(p)` is true, with r where it is false"
)

_FACTS = "the robot knows what it knows: `(unknown …)` and `(known …)` belong into conditions"


def refused(model: md.Model) -> Iterator[Diagnostic]:
    """An error for every construct of a model that grounding has no counterpart for."""
    yield from _refused_events(model)
    for schema in model.schemas.values():
        if isinstance(schema.observe, me.Choice) and noise(schema.observe) is None:
            yield Diagnostic(
                "BBT0406",
                f"`:observe` of action `{schema.name}` cannot be grounded",
                schema.observe_span,
                _NOISY,
            )
        elif (
            schema.observe is not None
            and not isinstance(schema.observe, me.Choice)
            and any(_is_knowledge(model, reading) for reading in mf.readings(schema.observe))
        ):
            message = f"`:observe` of action `{schema.name}` tells of facts, not of what is known"
            yield Diagnostic("BBT0406", message, schema.observe_span, _FACTS)
        for told in (part for reading in schema.told for part in (reading.condition, reading.when)):
            if any(_is_knowledge(model, reading) for reading in mf.readings(told)):
                message = f"`:observation` of action `{schema.name}` tells of facts, not of what is known"
                yield Diagnostic("BBT0406", message, schema.span, _FACTS)
    for sensor in model.sensors:
        if isinstance(sensor.sensed, me.Choice) and noise(sensor.sensed) is None:
            message = f"what sensor `{sensor.name}` tells cannot be grounded"
            yield Diagnostic("BBT0407", message, sensor.span, _NOISY)
        if any(_is_knowledge(model, each) for each in mf.readings(md.facts_told(sensor.sensed))):
            message = f"sensor `{sensor.name}` tells of facts, not of what is known"
            yield Diagnostic("BBT0407", message, sensor.span, _FACTS)
    yield from _timeouts(model)
    for clause in model.init.clauses:
        if any(_is_no_fact(model, reading) for reading in mf.readings(clause.condition)):
            message = "a condition in `:init` tells of facts, not of what is known or derived"
            yield Diagnostic("BBT0405", message, clause.span, _START)
    for threshold in () if has_hidden_state(model) else model.thresholds.values():
        message = "nothing is hidden here that `believed` could ask about"
        hint = "hidden is what `:observe` tells, and what `:init` leaves open beside it"
        yield Diagnostic("BBT0420", message, threshold.span, hint)
    if model.problem is not None and model.goal is None:
        yield Diagnostic(
            "BBT0411",
            f"problem `{model.problem}` has no goal to plan for",
            model.problem_span,
            "bbtc plans for a goal; a metric alone is none",
        )


def _timeouts(model: md.Model) -> Iterator[Diagnostic]:
    """Whether an action is given up, and what it does to hidden facts, would be one draw."""
    if not has_hidden_state(model):
        return
    for schema in model.schemas.values():
        if schema.timeout is not None:
            message = f"action `{schema.name}` has a time-out, in a domain in which facts are hidden"
            hint = "write its outcomes as `probabilistic`, the one of the time-out, too"
            yield Diagnostic("BBT0445", message, schema.timeout.span, hint)


def _refused_events(model: md.Model) -> Iterator[Diagnostic]:
    hides = has_hidden_state(model)
    for schema in model.schemas.values():
        event = schema.exogenous
        if hides and (event is not None or schema.during is not None):
            what = f"event `{schema.name}`" if event is not None else f"`:while` of action `{schema.name}`"
            message = f"{what} cannot be grounded beside hidden state"
            hint = "hidden is what `:observe` tells, and what `:init` leaves open beside it; without these, "
            hint += "an event that the robot does not see makes its facts unknown: `(unknown (p))`"
            yield Diagnostic("BBT0452", message, schema.span, hint)


def noise(observed: me.Choice) -> tuple[me.Set, Fraction, Fraction | None] | None:
    """The fact that a noisy reading tells, and the probability that it is right, where it is true, and, if
    that differs, where it is false; None for other forms."""
    sets = [each.effect for each in observed.branches if isinstance(each.effect, me.Set)]
    told = [branch for branch in observed.branches if not isinstance(branch.effect, me.Together)]
    if observed.oneof or len(sets) != len(told):
        return None
    if len(told) == 1:
        return sets[0], told[0].probability, None
    if not me.both_ways(sets):
        return None
    right = {each.value: branch.probability for each, branch in zip(sets, told, strict=True)}
    true, false = right[Truth.TRUE], right[Truth.FALSE]
    return sets[0], true, None if false == true else false


def _is_no_fact(model: md.Model, reading: mf.Reading) -> bool:
    if reading.atom.predicate in model.thresholds:
        return True
    return _is_test(reading) or model.predicates[reading.atom.predicate].derived


def _observed(schema: md.Schema) -> Iterator[mf.Reading]:
    """The facts that an action tells exactly."""
    if schema.observe is not None and not isinstance(schema.observe, me.Choice):
        yield from mf.readings(schema.observe)


def _is_knowledge(model: md.Model, reading: mf.Reading) -> bool:
    return _is_test(reading) or reading.atom.predicate in model.thresholds


def _is_test(reading: mf.Reading) -> bool:
    return reading.value is None or reading.value is Truth.UNKNOWN
