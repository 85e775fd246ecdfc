"""Whether ``:requirements`` says what a domain uses. A domain without the section says nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

from typing_extensions import assert_never

from bbtc.analysis import facts
from bbtc.diagnostics import Diagnostic, Severity
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.source import Span

_CODE = "BBT0311"


@dataclass(frozen=True, slots=True)
class _Feature:
    """Something that a domain may use. ``key`` is its requirement; ``within`` include it, too."""

    key: str
    what: str
    within: tuple[str, ...] = ()


_QUANTIFIED = (":quantified-preconditions", ":adl")
_NUMBERS = (":fluents", ":numeric-fluents")
_FEATURES = {
    feature.key: feature
    for feature in (
        _Feature(":typing", "a type", (":adl",)),
        _Feature(":equality", "`=`", (":adl",)),
        _Feature(":negative-preconditions", "`not` in a condition", (":adl", ":disjunctive-preconditions")),
        _Feature(":disjunctive-preconditions", "`or` or `imply`", (":adl",)),
        _Feature(":existential-preconditions", "`exists`", _QUANTIFIED),
        _Feature(":universal-preconditions", "`forall` in a condition", _QUANTIFIED),
        _Feature(":conditional-effects", "`when`", (":adl", ":universal-effects")),
        _Feature(":universal-effects", "`forall` in an effect", (":adl", ":conditional-effects")),
        _Feature(":probabilistic-effects", "`probabilistic`", (":mdp",)),
        _Feature(":non-deterministic", "`oneof`", (":nondeterministic", ":contingent")),
        _Feature(":rewards", "a reward", (":mdp", *_NUMBERS)),
        _Feature(":action-costs", "a cost", _NUMBERS),
        _Feature(":derived-predicates", "a derived predicate", (":domain-axioms", ":axioms")),
        _Feature(":contingent", "`:observe`", (":partial-observability", ":observability")),
        _Feature(":unknown", "`unknown` or `known`", (":contingent",)),
        _Feature(":templates", "a template"),
    )
}
_OTHERS = (
    ":strips",
    ":adl",
    ":quantified-preconditions",
    ":fluents",
    ":numeric-fluents",
    ":object-fluents",
    ":mdp",
    ":nondeterministic",
    ":domain-axioms",
    ":axioms",
    ":partial-observability",
    ":observability",
    ":durative-actions",
    ":duration-inequalities",
    ":continuous-effects",
    ":timed-initial-literals",
    ":preferences",
    ":constraints",
    ":hierarchy",
    ":method-preconditions",
    ":safety-constraints",
    ":open-world",
    ":translation",
)
_NOT_EQUAL = "(not (= …))"
"""Some list ``:negative-preconditions`` for it, most do not; both are fine."""
_KNOWN = (*_FEATURES, *_OTHERS)
_SEPARABLE = frozenset(_FEATURES) - {":typing", ":universal-effects", ":contingent"}
"""What is worth a note if it is listed and not used. (Who lists ``:typing`` may do so by habit.)"""


def missing(model: md.Model) -> Iterator[Diagnostic]:
    """Constructs that ``:requirements`` does not list, each once, and names that are no requirement."""
    if not model.requirements:
        return
    for key, listed in model.requirements.items():
        if key not in _KNOWN:
            from difflib import get_close_matches

            near = get_close_matches(key, _KNOWN, 1, 0.75)
            hint = f"did you mean `{near[0]}`?" if near else None
            severity = Severity.WARNING if near else Severity.NOTE
            yield Diagnostic(_CODE, f"`{key}` is no requirement that bbtc knows", listed, hint, severity)
    for key, span in _first_uses(_in_domain(model)).items():
        feature = _FEATURES.get(key)
        if feature is not None and model.requirements.keys().isdisjoint((key, *feature.within)):
            message = f"{feature.what} needs the requirement `{key}`, which `:requirements` does not list"
            yield Diagnostic(_CODE, message, span or model.span, f"add `{key}`")


def unneeded(model: md.Model) -> Iterator[Diagnostic]:
    """Requirements that neither the domain nor the problem makes use of."""
    used = _first_uses(chain(_in_domain(model), _in_problem(model)))
    fulfilled = {name for key in used for name in (key, *(_FEATURES[key].within if key in _FEATURES else ()))}
    if _NOT_EQUAL in used:
        fulfilled.add(":negative-preconditions")
    for key, span in model.requirements.items():
        if key in _SEPARABLE and key not in fulfilled:
            message = f"`{key}` is required, but nothing here needs it"
            yield Diagnostic(_CODE, message, span, f"{_FEATURES[key].what} would")


_Use = tuple[str, "Span | None"]


def _first_uses(uses: Iterable[_Use]) -> dict[str, Span | None]:
    first: dict[str, Span | None] = {}
    for key, span in uses:
        first.setdefault(key, span)
    return first


def _in_domain(model: md.Model) -> Iterator[_Use]:
    yield from ((":typing", each.span) for each in model.types.types.values() if each.name != "object")
    for formula in facts.all_conditions(replace(model, goal=None, init=md.Init())):
        yield from _in_formula(formula)
    for schema in model.schemas.values():
        yield from _in_effect(schema.effects)
        if schema.observe is not None:
            yield ":contingent", schema.observe_span
        if isinstance(schema.observe, me.Choice):
            yield from _in_effect(schema.observe)
    for template in model.templates.values():
        yield ":templates", template.span
        yield from _in_effect(template.effect or me.NOTHING)
    yield from ((":derived-predicates", rule.span) for rule in model.rules)
    declared = (each for each in model.predicates.values() if each.name not in model.thresholds)
    yield from ((":unknown", each.span) for each in declared if each.declared_three_valued)
    timing = {
        name for each in model.schemas.values() for name in me.functions_timing(each.duration, each.timeout)
    }
    for function in (each for each in model.functions.values() if each.name not in timing):
        if function.range is not None or md.number_predicate(function.name) in model.predicates:
            yield ":numeric-fluents", function.span
            continue
        yield ":rewards" if function.name == "reward" else ":action-costs", function.span


def _in_problem(model: md.Model) -> Iterator[_Use]:
    yield from _in_formula(model.goal or mf.ALWAYS)
    for choice in model.init.choices:
        yield from _in_effect(choice)
    if model.init.clauses or any(fact.value is Truth.UNKNOWN for fact in model.init.facts):
        yield ":unknown", model.init.span
        yield ":contingent", model.init.span
    if model.metric == "reward" or model.goal_reward:
        yield ":rewards", model.problem_span


def _in_formula(formula: mf.Formula) -> Iterator[_Use]:
    match formula:
        case mf.Atom():
            return
        case mf.Test(_, _, span):
            yield ":unknown", span
        case mf.Equal(_, _, span):
            yield ":equality", span
        case mf.Compare(span=span):
            yield ":numeric-fluents", span
        case mf.Not(part, span):
            yield _NOT_EQUAL if isinstance(part, mf.Equal) else ":negative-preconditions", span
            yield from _in_formula(part)
        case mf.And(parts):
            for part in parts:
                yield from _in_formula(part)
        case mf.Or(parts, span):
            if span is not None:  # written, and not what a form of another planner stands for
                yield ":disjunctive-preconditions", span
            for number, part in enumerate(parts):
                # The negation that stands first may be that of an `imply`.
                yield from _in_formula(part.part if number == 0 and isinstance(part, mf.Not) else part)
        case mf.Quantified(kind, _, part, span):
            yield ":existential-preconditions" if kind == "exists" else ":universal-preconditions", span
            yield from _in_formula(part)
        case _:
            assert_never(formula)


def _in_effect(effect: me.Effect) -> Iterator[_Use]:
    for part in me.walk(effect):
        match part:
            case me.Set(_, _, value, span):
                if value is Truth.UNKNOWN:
                    yield ":unknown", span
            case me.Add(to, _, _, span):
                yield ":rewards" if to == "reward" else ":action-costs", span
            case me.Change(span=span):
                yield ":numeric-fluents", span
            case me.Together():
                pass
            case me.When(condition, _, span):
                yield ":conditional-effects", span
                yield from _in_formula(condition)
            case me.ForEach(_, _, span):
                yield ":universal-effects", span
            case me.Choice(timeout=me.TimeOut()):
                pass
            case me.Choice(_, oneof, span):
                yield ":non-deterministic" if oneof else ":probabilistic-effects", span
            case _:
                assert_never(part)
