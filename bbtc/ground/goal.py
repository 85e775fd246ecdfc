"""Says why a goal cannot be reached, and what would have to be so."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from typing_extensions import assert_never

from bbtc.diagnostics import Diagnostic, Related, Report
from bbtc.ground.lower import Lowering
from bbtc.ground.missing import Fact, Lack, Missing, NoneTogether, NoObject, Search
from bbtc.ground.normal import conjuncts
from bbtc.ground.numbers.digits import with_digits
from bbtc.ground.reachability.atoms import Atoms
from bbtc.ground.reachability.reach import Reach, reach
from bbtc.ground.refused import refused
from bbtc.ground.start import beginning
from bbtc.ground.task import ground_name
from bbtc.ground.universe import Row, Universe
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf

_LONGEST = 60
_MOST_NAMED = 3
"""Roots told of one part of the goal, and facts named in one message."""


def unreachable(model: md.Model, part: mf.Formula, atoms: Atoms, limits: Limits) -> Diagnostic:
    """The error about a part of the goal that is false even if nothing is ever undone. Raises
    :class:`bbtc.diagnostics.LimitReached`."""
    missing = Search(atoms.reach, limits).missing(part)
    hint = _hint(atoms.reach, missing)
    forgotten = [each.what for each in missing[:_MOST_NAMED] if _is_unknown(each.what)]
    if hint is not None and forgotten:
        hint += f": add `{_all_written(model, atoms.universe, forgotten)}` to `:init`"
    return Diagnostic(
        "BBT0412",
        f"the goal cannot be reached: no action ever achieves {_shown(part, model)}",
        part.span or model.goal_span,
        hint,
        related=_related(missing),
    )


def goal_doubts(model: md.Model, limits: Limits) -> list[Diagnostic] | None:
    """Warnings about the parts of a problem's goal that nothing can make true, the root first: facts that
    `:init` may have forgotten to call unknown. None for what cannot be grounded anyway. Raises
    :class:`bbtc.diagnostics.LimitReached`."""
    begun = Report()
    model = with_digits(model, begun)
    if model.goal is None or begun.errors or any(True for _ in refused(model)):
        return None
    begin = beginning(model, begun, limits)
    if begun.errors:
        return None
    reached = reach(model, begin, limits)
    lowering = Lowering(Atoms(reached), limits)
    search = Search(reached, limits)
    found: list[Diagnostic] = []
    forgotten: list[tuple[mf.Formula, tuple[Missing, ...]]] = []
    for part in conjuncts(model.goal):
        if lowering.is_never(part):
            missing = search.missing(part)
            if missing and all(_is_unknown(each.what) for each in missing):
                forgotten.append((part, missing))
            else:
                found.append(_never(model, reached, [(part, missing)]))
    if forgotten:
        roots = {each.what: each for _, missing in forgotten for each in missing}
        found[:0] = [
            _forgotten(model, reached.universe, list(roots.values())),
            _never(model, reached, forgotten),
        ]
    return found


def _never(
    model: md.Model, reached: Reach, parts: Sequence[tuple[mf.Formula, tuple[Missing, ...]]]
) -> Diagnostic:
    """The warning about parts of a goal that lack things of one kind."""
    missing = list(dict.fromkeys(each for _, roots in parts for each in roots))
    first, *others = [part for part, _ in parts]
    return Diagnostic(
        "BBT0316",
        f"{_nothing(model, [each.what for each in missing])} can make the goal {_shown(first, model)} true",
        first.span or model.goal_span,
        _hint(reached, missing),
        related=(*_related(missing), *(Related("nor this", part.span) for part in others[:_MOST_NAMED])),
    )


def _is_unknown(what: Lack) -> bool:
    return isinstance(what, Fact) and what.value is Truth.UNKNOWN


def _nothing(model: md.Model, facts: Iterable[Lack]) -> str:
    """What cannot bring facts about: others may change those of external predicates."""
    external = any(isinstance(fact, Fact) and model.predicates[fact.predicate].external for fact in facts)
    return "no action" if external else "nothing"


def _forgotten(model: md.Model, universe: Universe, missing: Sequence[Missing]) -> Diagnostic:
    """The warning about facts that nothing makes unknown, although something must find out about them."""
    facts = [each.what for each in missing if isinstance(each.what, Fact)]
    told = facts[:_MOST_NAMED]
    more = f" or {len(facts) - len(told)} more" if len(facts) > len(told) else ""
    names = " or ".join(f"`{_name(model, universe, fact)}`" for fact in told)
    texts = _all_written(model, universe, told)
    return Diagnostic(
        "BBT0315",
        f"{_nothing(model, facts)} makes {names}{more} unknown",
        model.init.span or model.problem_span,
        f"add `{texts}` to `:init`: what it does not mention is false",
        related=_related(missing[:_MOST_NAMED]),
    )


def _shown(part: mf.Formula, model: md.Model) -> str:
    span = part.span or model.goal_span
    if span is None:
        return "the goal"
    shown = " ".join(span.text.split())
    return f"`{shown}`" if len(shown) <= _LONGEST - 2 else f"`{shown[: _LONGEST - 5]}...`"


def _related(missing: Sequence[Missing]) -> tuple[Related, ...]:
    """Where an action asks for what is missing."""
    places = [
        Related(f"`{each.by}` needs it here", each.what.span)
        for each in missing[:_MOST_NAMED]
        if each.by is not None and isinstance(each.what, Fact) and each.what.span is not None
    ]
    return tuple(dict.fromkeys(places))


def _hint(reached: Reach, missing: Sequence[Missing]) -> str | None:
    if not missing:
        return None
    told = [_told(reached, each) for each in missing[:_MOST_NAMED]]
    more = f"; and {len(missing) - len(told)} more" if len(missing) > len(told) else ""
    return "; ".join(told) + more


def _told(reached: Reach, missing: Missing) -> str:
    """One root in words."""
    model, by = reached.usage.model, missing.by
    match missing.what:
        case Fact() as fact:
            return _fact_told(reached, missing, fact)
        case NoObject(types):
            what = f"of type {' or '.join(f'`{name}`' for name in types)}"
            if types == ("object",):
                what = "at all"
            return f"there is no object {what}" + (f" for `{by}`" if by is not None else "")
        case NoneTogether(name):
            whole = "precondition" if name in model.schemas else "condition"
            return f"`{name}` could, but no objects meet its whole {whole}"
        case _:
            assert_never(missing.what)


def _fact_told(reached: Reach, missing: Missing, fact: Fact) -> str:
    model, universe = reached.usage.model, reached.universe
    name, value, by = _name(model, universe, fact), fact.value, missing.by
    if value is Truth.UNKNOWN:
        start = "the goal" if by is None else f"`{by}`"
        return f"{start} needs `{name}` to be unknown, and {_nothing(model, [fact])} makes it so"
    if missing.setters:
        listed = ", ".join(f"`{each}`" for each in missing.setters[:_MOST_NAMED])
        return f"only {listed} could make `{name}` {value.word}, and never can: is it missing in `:init`?"
    if model.predicates[fact.predicate].derived:
        return f"no rule ever makes `{name}` {value.word}"
    needs = f"`{by}` needs `{name}`" + (" to be false" if value is Truth.FALSE else "")
    nothing = (
        f"no action makes `{name}` {value.word}" if by is None else f"{needs}, and no action makes it so"
    )
    if model.predicates[fact.predicate].external:
        only = (
            f"only others can make `{name}` {value.word}"
            if by is None
            else f"{needs}, and only others can make it so"
        )
        return f"{only}: no plan counts on that"
    if None not in fact.row and reached.can_be(Truth.UNKNOWN, fact.predicate, _numbers(fact)):
        return f"{nothing} once it is unknown"
    if value is Truth.FALSE:
        return nothing
    return f"{nothing}, nor does `:init` give it{_meant(reached, fact)}"


def _numbers(fact: Fact) -> Row:
    return tuple(number for number in fact.row if number is not None)


def _meant(reached: Reach, fact: Fact) -> str:
    """The predicate that may be meant, if there is just one: given, of the same arguments, and never read."""
    model = reached.usage.model
    read = {atom.predicate for formula in _conditions(model) for atom in mf.atoms(formula)}
    wanted = [parameter.types for parameter in model.predicates[fact.predicate].parameters]
    names = [
        name
        for name, predicate in model.predicates.items()
        if name not in read
        and (predicate.inferred or [parameter.types for parameter in predicate.parameters] == wanted)
        and len(predicate.parameters) == len(wanted)
        and (Truth.TRUE in reached.usage.set_values.get(name, ()) or name in reached.usage.start.true)
    ]
    return f" (is `{names[0]}` meant? nothing reads it)" if len(names) == 1 else ""


def _conditions(model: md.Model) -> Iterator[mf.Formula]:
    for schema in model.schemas.values():
        yield schema.precondition
        yield from me.conditions(schema.effects)
    yield from (rule.condition for rule in model.rules)
    if model.goal is not None:
        yield model.goal
    for template in model.templates.values():
        yield from md.conditions(template.body)


def _args(model: md.Model, universe: Universe, fact: Fact) -> tuple[str, ...]:
    declared = model.predicates[fact.predicate].parameters
    return tuple(
        parameter.name if number is None else universe.names[number]
        for number, parameter in zip(fact.row, declared, strict=True)
    )


def _name(model: md.Model, universe: Universe, fact: Fact) -> str:
    return ground_name(fact.predicate, _args(model, universe, fact))


def _all_written(model: md.Model, universe: Universe, facts: Sequence[Lack]) -> str:
    return " ".join(_written(model, universe, fact) for fact in facts if isinstance(fact, Fact))


def _written(model: md.Model, universe: Universe, fact: Fact) -> str:
    """The fact as ``:init`` says it."""
    atom = f"({' '.join((fact.predicate, *_args(model, universe, fact)))})"
    match fact.value:
        case Truth.TRUE:
            return atom
        case Truth.FALSE:
            return f"(not {atom})"
        case Truth.UNKNOWN:
            return f"(unknown {atom})"
        case _:
            assert_never(fact.value)
