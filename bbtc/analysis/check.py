"""Checks of a model: each a pure function with a code of its own, warnings or notes.

What holds for one problem need not hold for the domain: an action that this problem never needs may
be what another one is about. So a finding about the domain that rests on the problem is a note, and a
warning only where it holds for every one of several problems.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf

from typing_extensions import assert_never

from bbtc.analysis import facts
from bbtc.analysis.facts import Known
from bbtc.analysis.requirements import missing, unneeded
from bbtc.diagnostics import Diagnostic, Related, Severity
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.amount import Amount, FunctionValue
from bbtc.model.hidden import has_hidden_state
from bbtc.model.intervals import Interval, interval, never
from bbtc.model.types import Parameter
from bbtc.source import Span
from bbtc.syntax.words import TEST_WORDS

_SHORTFALL = Fraction(1, 100)
"""A no-change remainder of this probability or less is likely a slip of the pen."""


@dataclass(frozen=True, slots=True)
class Check:
    """A check and the code of its findings. ``needs_problem``: they rest on what a problem says."""

    code: str
    find: Callable[[Known], Iterator[Diagnostic]]
    needs_problem: bool = False


def check(*models: md.Model, doubted: Collection[str] = ()) -> Iterator[Diagnostic]:
    """The findings about a domain: the models are those of one domain with each of its problems, or
    that of the domain alone. Of problems named in ``doubted`` the goal or the start is known to be wrong:
    what rests on them would only repeat it, and is not looked for."""
    known = tuple(map(Known, models))
    settled = tuple(each for each in known if each.model.problem not in doubted)
    for each in CHECKS:
        if not each.needs_problem:
            yield from _merged(each, known)
        elif models[0].problem is not None and settled:
            yield from _merged(each, settled)


def _merged(each: Check, models: tuple[Known, ...]) -> Iterator[Diagnostic]:
    """What a check finds in a problem, and what it finds in the domain with every problem."""
    rounds = [(known.model, list(each.find(known))) for known in models]
    keys = [{(found.span, found.about) for found in findings} for _, findings in rounds]
    common = set.intersection(*keys)
    for number, (model, findings) in enumerate(rounds):
        for found in findings:
            if _in_problem(model, found.span):
                yield found
            elif number == 0 and (found.span, found.about) in common:
                note = each.needs_problem and len(models) == 1
                yield replace(found, severity=Severity.NOTE) if note else found


def _in_problem(model: md.Model, span: Span | None) -> bool:
    """Whether a place is in the problem of a model, not in its domain."""
    domain, problem = model.span, model.problem_span
    if span is None or domain is None or problem is None or span.source is not problem.source:
        return False
    if domain.source is not problem.source:
        return True
    # One file holds both: the later definition begins between their names.
    return span.start > problem.start if problem.start > domain.start else span.start < domain.start


# --- predicates and conditions ---------------------------------------------------------------


def _unread(known: Known) -> Iterator[tuple[md.Predicate, bool]]:
    """Predicates that nothing reads, each with whether anything sets it."""
    model = known.model
    read = {atom.predicate for formula in known.conditions for atom in mf.atoms(formula)}
    for schema in model.schemas.values():
        read |= facts.observed(schema)
    read |= {atom.predicate for asked in model.thresholds.values() for atom in mf.atoms(asked.condition)}
    written = {leaf.predicate for schema in model.schemas.values() for leaf in me.settings(schema.effects)}
    written |= {rule.predicate for rule in model.rules}
    for name, predicate in model.predicates.items():
        if name not in read and name not in model.symbols and not md.is_number(name):
            yield predicate, name in written


def _unused_predicates(known: Known) -> Iterator[Diagnostic]:
    for predicate, written in _unread(known):
        if not written and not predicate.inferred:
            yield Diagnostic("BBT0301", f"predicate `{predicate.name}` is never used", predicate.span)


def _unread_predicates(known: Known) -> Iterator[Diagnostic]:
    for predicate, written in _unread(known):
        if written:
            yield Diagnostic(
                "BBT0301",
                f"nothing reads predicate `{predicate.name}`",
                predicate.span,
                "no precondition, `when`, template or goal depends on it",
            )


def _never_unknown(known: Known) -> Iterator[Diagnostic]:
    reached = known.reached
    for name, predicate in known.model.predicates.items():
        others = predicate.external  # who may make it unknown
        if predicate.declared_three_valued and not others and (name, Truth.UNKNOWN) not in reached.values:
            yield Diagnostic(
                "BBT0218",
                f"`{name}` is declared three-valued, but nothing makes it unknown",
                predicate.span,
                "nothing that its rules read is ever unknown"
                if predicate.derived
                else f"no `(unknown ({name} …))` stands in `:init` or in an effect that can happen",
            )


def _test_words(known: Known) -> Iterator[Diagnostic]:
    for name in sorted(TEST_WORDS & known.model.predicates.keys()):
        predicate = known.model.predicates[name]
        theirs = f"`({name} a)` is a fact of it, " if len(predicate.parameters) == 1 else ""
        message = f"the predicate `{name}` has the name of a test"
        hint = f"{theirs}`({name} (p))` tests the fact `(p)`"
        yield Diagnostic("BBT0227", message, predicate.span, hint)


def _set_to(model: md.Model, *, unknown: bool) -> set[str]:
    """Predicates that an action makes unknown; or those that one makes true or false."""
    return {
        leaf.predicate
        for schema in model.schemas.values()
        for leaf in me.settings(schema.effects)
        if (leaf.value is Truth.UNKNOWN) is unknown
    }


def _untold(known: Known, lost: Collection[str]) -> Iterator[mf.Reading]:
    """The first reading of the value of each of the ``lost`` predicates, those that are unknown at some time,
    that nothing ever tells."""
    model = known.model
    told = _set_to(model, unknown=False) | {
        atom.predicate for sensor in model.sensors for atom in mf.atoms(md.facts_told(sensor.sensed))
    }
    for schema in model.schemas.values():
        told |= facts.observed(schema)
    if has_hidden_state(model):
        # What a draw, a condition of the start or an effect joins may be told by each other.
        told |= {leaf.predicate for choice in model.init.choices for leaf in me.settings(choice)}
        told |= {atom.predicate for clause in model.init.clauses for atom in mf.atoms(clause.condition)}
        guards = (guard for schema in model.schemas.values() for guard in me.conditions(schema.effects))
        told |= {atom.predicate for guard in guards for atom in mf.atoms(guard)}
    for reading in known.readings:
        predicate = model.predicates[reading.atom.predicate]
        if reading.value is Truth.UNKNOWN or predicate.name not in lost or predicate.name in told:
            continue
        if not predicate.derived and not predicate.external and predicate.name not in model.thresholds:
            told.add(predicate.name)
            yield reading


def _lost_later(known: Known) -> Iterator[mf.Reading]:
    return _untold(known, _set_to(known.model, unknown=True))


def _lost_at_first(known: Known) -> Iterator[mf.Reading]:
    unknown = {name for name, value in known.reached.values if value is Truth.UNKNOWN}
    return _untold(known, unknown - _set_to(known.model, unknown=True))


def _never_known(known: Known, readings: Iterable[mf.Reading]) -> Iterator[Diagnostic]:
    for reading in readings:
        name = reading.atom.predicate
        message = f"no action makes `{name}` known"
        hint = "it is unknown at some time, and no effect makes it true or false again"
        yield _about_reading("BBT0304", message, reading, hint, known)


def _about_reading(code: str, message: str, reading: mf.Reading, hint: str, known: Known) -> Diagnostic:
    name = reading.atom.predicate
    related = (Related(f"`{name}` is declared here", known.model.predicates[name].span),)
    about = (name, reading.value.word if reading.value else "known")
    return Diagnostic(code, message, reading.span, hint, related=related, about=about)


def _lost_knowledge(known: Known) -> Iterator[Diagnostic]:
    return _never_known(known, _lost_later(known))


def _never_given(known: Known) -> Iterator[tuple[mf.Reading, Truth]]:
    """The first reading of each value that nothing gives, but for those of which is told that nothing makes
    them known."""
    never_known = {each.atom.predicate for each in (*_lost_at_first(known), *_lost_later(known))}
    told: set[tuple[str, Truth]] = set()
    for reading in known.readings:
        name, value = reading.atom.predicate, reading.value
        if value is None or (name, value) in told or (name, value) in known.reached.values:
            continue
        if value is Truth.UNKNOWN or name not in never_known:
            told.add((name, value))
            yield reading, value


def _hopeless_conditions(known: Known) -> Iterator[Diagnostic]:
    """Readings of values that nothing gives; those of external predicates have a note of their own."""
    yield from _never_known(known, _lost_at_first(known))
    for reading, value in _never_given(known):
        name = reading.atom.predicate
        if not known.model.predicates[name].external:
            message = f"nothing makes `{name}` {value.word}"
            hint = "`:init` does not give it, and no action that can apply sets it"
            yield _about_reading("BBT0304", message, reading, hint, known)


def _only_others(known: Known) -> Iterator[Diagnostic]:
    for reading, value in _never_given(known):
        name = reading.atom.predicate
        if known.model.predicates[name].external:
            message = f"only others can make `{name}` {value.word}"
            hint = "plans and figures take it to stay as `:init` says"
            yield _about_reading("BBT0313", message, reading, hint, known)


def _only_events(known: Known) -> Iterator[Diagnostic]:
    model = known.model
    actions = (schema for schema in model.schemas.values() if schema.exogenous is None)
    told = {leaf.predicate for schema in actions for leaf in me.settings(schema.effects)}
    by_itself = {leaf.predicate for event in model.events for leaf in me.settings(event.effects)}
    events = {id(each) for event in model.events for each in facts.schema_conditions(event)}
    for condition in known.conditions:
        for reading in mf.readings(condition) if id(condition) not in events else ():
            name = reading.atom.predicate
            if name in by_itself and name not in told:
                told.add(name)
                message, hint = f"only events change `{name}`", "the robot can wait for it, and nothing else"
                yield _about_reading("BBT0317", message, reading, hint, known)


# --- actions ---------------------------------------------------------------------------------


def _unreachable_actions(known: Known) -> Iterator[Diagnostic]:
    reached = known.reached
    for name, schema in known.model.schemas.items():
        if name not in reached.actions:
            first = _impossible(schema.precondition, reached)
            if first is not None and any(
                known.model.predicates[a.predicate].external for a in mf.atoms(first)
            ):
                continue  # of which BBT0313 tells
            related = () if first is None else (Related("this is never true", first.span),)
            message = f"{schema.kind} `{name}` can never {'apply' if schema.exogenous is None else 'happen'}"
            yield Diagnostic("BBT0302", message, schema.span, related=related)


def _impossible(formula: mf.Formula, reached: facts.Reached) -> mf.Formula | None:
    """The innermost part that makes a condition impossible."""
    if isinstance(formula, mf.And):
        for part in formula.parts:
            if not reached.possible(part):
                return _impossible(part, reached)
    return formula


def _contradictions(known: Known) -> Iterator[Diagnostic]:
    for schema in known.model.schemas.values():
        yield from _contradictions_in(schema.effect, {})
        yield from _contradictions_in(schema.on_abort, {})


def _contradictions_in(
    effect: me.Effect, above: dict[tuple[str, tuple[str, ...]], me.Set]
) -> Iterator[Diagnostic]:
    """Settings that happen together with others of the same atom. ``above`` holds those that always
    happen beside the effect; settings under a ``when`` or a quantifier have their own company."""
    match effect:
        case me.Set(predicate, args, value, span):
            before = above.setdefault((predicate, args), effect)
            if before.value is not value:
                yield Diagnostic(
                    "BBT0303",
                    f"one outcome makes `{predicate}` both {before.value.word} and {value.word}",
                    span,
                    f"{max(before.value, value).word} wins",
                    related=(Related("the other one", before.span),),
                )
        case me.Together(parts):
            certain = sorted(parts, key=lambda part: not isinstance(part, me.Set))
            for part in certain:
                yield from _contradictions_in(part, above)
        case me.When(_, inner) | me.ForEach(_, inner):
            yield from _contradictions_in(inner, {})
        case me.Choice(branches):
            for branch in branches:
                yield from _contradictions_in(branch.effect, dict(above))
        case me.Add() | me.Change():
            return
        case _:
            assert_never(effect)


def _duplicates(known: Known) -> Iterator[Diagnostic]:
    seen: dict[tuple[object, ...], md.Schema] = {}
    for schema in known.model.schemas.values():
        renamed = {parameter.name: f"?{number}" for number, parameter in enumerate(schema.parameters)}
        kinds = tuple(parameter.types for parameter in schema.parameters)
        key = (schema.exogenous, kinds, *_renamed(schema, renamed))
        before = seen.setdefault(key, schema)
        if before is not schema:
            yield Diagnostic(
                "BBT0305",
                f"{schema.kind} `{schema.name}` does the same as `{before.name}`",
                schema.span,
                related=(Related(f"`{before.name}`", before.span),),
            )


def _without_effect(known: Known) -> Iterator[Diagnostic]:
    if known.model.events:
        return  # it waits for what happens by itself
    for name, schema in known.model.schemas.items():
        if not schema.tells and next(me.settings(schema.effects), None) is None:
            yield Diagnostic("BBT0306", f"action `{name}` changes nothing", schema.span)


def _irrelevant_actions(known: Known) -> Iterator[Diagnostic]:
    if known.model.goal is None:
        return
    actions = known.relevant
    possible = known.reached.actions
    for name, schema in known.model.schemas.items():
        changes = next(me.settings(schema.effects), None) is not None
        waits = schema.exogenous is None and known.model.events  # for what happens by itself
        if name not in actions and name in possible and changes and not waits:
            yield Diagnostic(
                "BBT0307",
                f"{schema.kind} `{name}` cannot matter to the goal",
                schema.span,
                "no condition on the way to the goal reads what it changes",
            )


def _impossible_comparisons(known: Known) -> Iterator[Diagnostic]:
    """Comparisons that no values within the ranges make true. Of numbers without a declared range nothing is
    known here, and functions that never change have the values of `:init`."""
    model = known.model
    changed = {change.function for each in model.schemas.values() for change in me.changes(each.effects)}

    def of(amount: Amount) -> Interval:
        return interval(amount, value)

    def value(read: FunctionValue) -> Interval:
        range_ = model.functions[read.function].range
        if range_ is not None:
            return Fraction(range_.low), Fraction(range_.high)
        given = [number for (name, _), number in model.init.numbers.items() if name == read.function]
        if read.function in changed or not given:
            return -inf, inf
        return min(given), max(given)

    for condition in known.conditions:
        for compare in mf.comparisons(condition):
            if never(compare, of):
                message = "this can never hold: no values within the ranges compare so"
                yield Diagnostic("BBT0442", message, compare.span)


# --- probabilities, parameters, templates ----------------------------------------------------


def _probabilities(known: Known) -> Iterator[Diagnostic]:
    for schema in known.model.schemas.values():
        for part in me.walk(schema.effects):
            if isinstance(part, me.Choice) and part.timeout is None:
                yield from _doubtful(part)


def _doubtful(choice: me.Choice) -> Iterator[Diagnostic]:
    seen: dict[me.Effect, me.Branch] = {}
    for branch in choice.branches:
        rest = branch.span == choice.span and branch.effect == me.NOTHING
        before = branch if rest else seen.setdefault(branch.effect, branch)
        if before is not branch and before.probability != 0:
            yield Diagnostic(
                "BBT0308",
                "two outcomes of one choice are the same",
                branch.span,
                "write it once, with the sum of the probabilities",
                related=(Related("the other one", before.span),),
            )
        if branch.probability == 0:
            yield Diagnostic("BBT0308", "this outcome has probability 0", branch.span)
        elif rest and branch.probability <= _SHORTFALL:
            total = float(1 - branch.probability)
            yield Diagnostic(
                "BBT0308",
                f"the probabilities sum to {total:.9g}, just short of 1",
                choice.span,
                "what is missing to 1 means no change",
            )


def _unused_parameters(known: Known) -> Iterator[Diagnostic]:
    for schema in known.model.schemas.values():
        marked = [(p, replace(p, name=f"{p.name} ")) for p in schema.parameters]
        for parameter, other in marked:
            if not _occurs(schema, parameter, other):
                yield Diagnostic(
                    "BBT0309",
                    f"{schema.kind} `{schema.name}` never uses its parameter `{parameter.name}`",
                    parameter.span,
                    f"every object it may take makes another ground {schema.kind}",
                )


def _occurs(schema: md.Schema, parameter: Parameter, other: Parameter) -> bool:
    """Whether renaming the parameter changes the action."""
    renamed = _renamed(schema, {parameter.name: other.name})
    whole = (
        schema.precondition,
        schema.effect,
        schema.observe,
        schema.told,
        schema.on_abort,
        schema.duration,
    )
    return renamed != whole


def _renamed(schema: md.Schema, binding: Mapping[str, mf.Term]) -> tuple[object, ...]:
    """Precondition (``:while`` among it), effects, observations and duration with other parameters."""
    free, observed = dict(binding), schema.observe
    told: object = None
    if isinstance(observed, me.Choice):
        told = me.substitute(observed, free)
    elif observed is not None:
        told = mf.substitute(observed, free)
    besides = tuple(
        replace(each, condition=mf.substitute(each.condition, free), when=mf.substitute(each.when, free))
        for each in schema.told
    )
    effect, abort = me.substitute(schema.effect, free), me.substitute(schema.on_abort, free)
    duration = me.substitute_duration(schema.duration, free)
    return mf.substitute(schema.precondition, free), effect, told, besides, abort, duration


def _unused_templates(known: Known) -> Iterator[Diagnostic]:
    called = {call.name for template in known.model.templates.values() for call in md.calls(template.body)}
    for name, template in known.model.templates.items():
        if template.effect is None and name not in called:
            yield Diagnostic(
                "BBT0310",
                f"template `{name}` is never used",
                template.span,
                "give it an `:effect` that tells the planner what it is for, or call it from another",
            )


CHECKS = (
    Check("BBT0227", _test_words),
    Check("BBT0218", _never_unknown, needs_problem=True),
    Check("BBT0301", _unused_predicates),
    Check("BBT0301", _unread_predicates, needs_problem=True),
    Check("BBT0302", _unreachable_actions, needs_problem=True),
    Check("BBT0442", _impossible_comparisons, needs_problem=True),
    Check("BBT0303", _contradictions),
    Check("BBT0304", _lost_knowledge),
    Check("BBT0304", _hopeless_conditions, needs_problem=True),
    Check("BBT0313", _only_others, needs_problem=True),
    Check("BBT0317", _only_events),
    Check("BBT0305", _duplicates),
    Check("BBT0306", _without_effect),
    Check("BBT0307", _irrelevant_actions, needs_problem=True),
    Check("BBT0308", _probabilities),
    Check("BBT0309", _unused_parameters),
    Check("BBT0310", _unused_templates),
    Check("BBT0311", lambda known: missing(known.model)),
    Check("BBT0311", lambda known: unneeded(known.model), needs_problem=True),
)
