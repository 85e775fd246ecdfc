"""Durative actions of PDDL 2.1 in their sequential use: each becomes one action.

Where nothing runs beside it, an action that changes facts at its start and at its end may as well do all of
that at once, if its conditions are read as what they are then (Fox and Long 2003): what has to hold *over
all* of it, or at its end, is read before its start as what it will be after the effects there (regression),
and an effect at its end outdoes one at its start.

What needs something to run at the same time is refused by name: facts that hold only while another action
runs, durations that the planner chooses, and numbers that change on the way.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from typing_extensions import assert_never

from bbtc.diagnostics import Report
from bbtc.kleene import Truth
from bbtc.source import Span
from bbtc.syntax import ast


def with_sequential(
    definition: ast.Definition, problem: ast.Definition | None, report: Report
) -> ast.Definition:
    """The domain with its durative actions as actions."""
    if not any(isinstance(section, ast.DurativeAction) for section in definition.sections):
        return definition
    _refuse_concurrency(definition, problem, report)
    return replace(definition, sections=tuple(_sequential(each, report) for each in definition.sections))


def _sequential(section: ast.Section, report: Report) -> ast.Section:
    return _Sequential(section, report).action() if isinstance(section, ast.DurativeAction) else section


@dataclass(slots=True)
class _Parts:
    """What a durative action says, by when."""

    conditions: list[tuple[ast.Moment, ast.Formula]] = field(default_factory=list)
    effects: list[tuple[ast.Moment, ast.Effect]] = field(default_factory=list)


class _Sequential:
    """One durative action on its way to an action."""

    def __init__(self, node: ast.DurativeAction, report: Report) -> None:
        self._node = node
        self._report = report
        self._parts = _Parts()
        self._bound: set[str] = set()
        self._counted = {name for _, effect in self._effects_at_start() for name in _changed_numbers(effect)}
        """Functions that the start changes."""
        if node.condition is not None:
            self._parts.conditions = list(self._conditions(node.condition))
        if node.effect is not None:
            self._parts.effects = list(self._effects(node.effect))
        first = [effect for when, effect in self._parts.effects if when == "at start"]
        self._sets = [leaf for effect in first for leaf in _plain(effect)]
        self._vague = {name for effect in first for name in _conditional(effect)}
        """Predicates that are set at the start under conditions, or for all of some objects."""

    def action(self) -> ast.Action:
        """The action that does the same at once."""
        node = self._node
        conditions = [
            formula if when == "at start" else self._before(formula)
            for when, formula in self._parts.conditions
        ]
        last = [effect for when, effect in self._parts.effects if when == "at end"]
        first = [effect for when, effect in self._parts.effects if when == "at start"]
        effects = [*(each for effect in first for each in self._outdone(effect, last)), *last]
        duration = ast.Duration("number", (node.duration,), (), node.duration.span)
        return ast.Action(
            node.name,
            node.parameters,
            ast.And(tuple(conditions), node.span) if conditions else None,
            None,
            ast.EffectAnd(tuple(effects), node.span),
            node.span,
            timing=ast.Timing(duration, None, None, None, node.duration.span),
        )

    # --- taking apart ------------------------------------------------------------------------

    def _conditions(self, timed: ast.Timed) -> Iterator[tuple[ast.Moment, ast.Formula]]:
        match timed:
            case ast.TimedFormula(when, formula):
                yield when, formula
            case ast.TimedAll(parts):
                for part in parts:
                    yield from self._conditions(part)
            case ast.TimedForall(parameters, part, span):
                for when, formula in self._conditions(part):
                    yield when, ast.Quantified("forall", parameters, formula, span)
            case ast.TimedChange() | ast.TimedWhen():
                raise AssertionError("the grammar allows no effect here")
            case _:
                assert_never(timed)

    def _effects(self, timed: ast.Timed) -> Iterator[tuple[ast.Moment, ast.Effect]]:
        match timed:
            case ast.TimedChange(when, effect):
                yield when, effect
            case ast.TimedAll(parts):
                for part in parts:
                    yield from self._effects(part)
            case ast.TimedForall(parameters, part, span):
                for when, effect in self._effects(part):
                    yield when, ast.EffectForall(parameters, effect, span)
            case ast.TimedWhen(condition, inner, span):
                yield from self._guarded(condition, inner, span)
            case ast.TimedFormula():
                raise AssertionError("the grammar allows no condition here")
            case _:
                assert_never(timed)

    def _guarded(
        self, condition: ast.Timed, inner: ast.Timed, span: Span
    ) -> Iterator[tuple[ast.Moment, ast.Effect]]:
        """Effects under conditions: those of the start are read before it, as all conditions are."""
        read = list(self._conditions(condition))
        for when, effect in self._effects(inner):
            if when == "at start" and any(moment != "at start" for moment, _ in read):
                self._refuse("an effect at the start depends on what comes later", span)
            for moment, formula in read:
                if moment != "at start":
                    self._check_plain(formula)
            yield when, ast.When(ast.And(tuple(formula for _, formula in read), span), effect, span)

    def _check_plain(self, formula: ast.Formula) -> None:
        """What an effect asks at the end must not be what the start sets."""
        first = {
            leaf.atom.predicate.key
            for when, effect in self._effects_at_start()
            for leaf in (*_plain(effect), *_inner(effect))
        }
        if first & set(_predicates(formula)) or self._counted & set(_compared(formula)):
            self._refuse(
                "an effect asks at the end for what the action itself sets at its start", self._node.span
            )

    def _effects_at_start(self) -> Iterator[tuple[ast.Moment, ast.Effect]]:
        stack = [] if self._node.effect is None else [self._node.effect]
        while stack:
            part = stack.pop()
            match part:
                case ast.TimedChange("at start" as when, effect):
                    yield when, effect
                case ast.TimedAll(parts):
                    stack.extend(parts)
                case ast.TimedForall(_, inner) | ast.TimedWhen(_, inner):
                    stack.append(inner)
                case _:
                    pass

    def _refuse(self, what: str, span: Span) -> None:
        name = self._node.name.text
        hint = "write it as two actions, or as an `:action` that does what is left at its end"
        self._report.error("BBT0449", f"durative action `{name}`: {what}", span, hint)

    # --- conditions --------------------------------------------------------------------------

    def _before(self, formula: ast.Formula) -> ast.Formula:
        """What has to hold before the start for a condition to hold after its effects (regression)."""
        match formula:
            case ast.Atom():
                return self._atom_before(formula)
            case ast.Not(part, span):
                return ast.Not(self._before(part), span)
            case ast.And(parts, span):
                return ast.And(tuple(map(self._before, parts)), span)
            case ast.Or(parts, span):
                return ast.Or(tuple(map(self._before, parts)), span)
            case ast.Imply(premise, conclusion, span):
                return ast.Imply(self._before(premise), self._before(conclusion), span)
            case ast.Quantified(kind, parameters, part, span):
                names = {name.key for group in parameters for name in group.names}
                mine = {term.key for leaf in self._sets for term in leaf.atom.args}
                if names & mine and set(_predicates(part)) & {leaf.atom.predicate.key for leaf in self._sets}:
                    self._refuse("a quantifier takes the name of a parameter", span)
                return ast.Quantified(kind, parameters, self._before(part), span)
            case ast.Empty() | ast.Equality() | ast.Unsupported():
                return formula
            case ast.Comparison(_, left, right, span):
                if self._counted & {*_numbers(left), *_numbers(right)}:
                    self._refuse("it compares a number that it changes at its start", span)
                return formula
            case ast.Test() | ast.Believed():
                if set(_predicates(formula)) & (
                    self._vague | {leaf.atom.predicate.key for leaf in self._sets}
                ):
                    self._refuse("it asks whether something is known that it sets at its start", formula.span)
                return formula
            case _:
                assert_never(formula)

    def _atom_before(self, atom: ast.Atom) -> ast.Formula:
        if atom.predicate.key in self._vague:
            self._refuse(
                f"it asks for `{atom.predicate.text}`, which it sets at its start under conditions", atom.span
            )
            return atom
        found: ast.Formula = atom
        for value in (Truth.FALSE, Truth.TRUE):  # add after delete
            for leaf in self._sets:
                if leaf.value is value and leaf.atom.predicate.key == atom.predicate.key:
                    same = _same(leaf.atom, atom)
                    found = (
                        ast.Or((same, found), atom.span)
                        if value is Truth.TRUE
                        else ast.And((ast.Not(same, atom.span), found), atom.span)
                    )
        return found

    # --- effects -----------------------------------------------------------------------------

    def _outdone(self, effect: ast.Effect, last: Sequence[ast.Effect]) -> Iterator[ast.Effect]:
        """An effect at the start without what the end undoes. What is made true wins where both are at
        once, so that only facts which the end makes false are left out."""
        undone = [leaf for each in last for leaf in _plain(each) if leaf.value is not Truth.TRUE]
        vague = {
            leaf.atom.predicate.key for each in last for leaf in _inner(each) if leaf.value is not Truth.TRUE
        }
        if isinstance(effect, ast.EffectAnd):
            for part in effect.parts:
                yield from self._outdone(part, last)
            return
        if not isinstance(effect, ast.Assign):
            mine = {leaf.atom.predicate.key for leaf in _inner(effect) if leaf.value is not Truth.FALSE}
            if mine & (vague | {leaf.atom.predicate.key for leaf in undone}):
                self._refuse("what it sets at its start under conditions is undone at its end", effect.span)
            yield effect
            return
        if effect.value is Truth.FALSE:
            made = {_key(leaf.atom) for each in last for leaf in _plain(each) if leaf.value is Truth.TRUE}
            if _key(effect.atom) not in made:
                yield effect
            return
        if effect.atom.predicate.key in vague:
            self._refuse("what it sets at its start is undone at its end under conditions", effect.span)
        clash = [
            _same(leaf.atom, effect.atom)
            for leaf in undone
            if leaf.atom.predicate.key == effect.atom.predicate.key
        ]
        if any(isinstance(same, ast.Empty) for same in clash):
            return
        kept: ast.Effect = effect
        if clash:
            kept = ast.When(ast.Not(ast.Or(tuple(clash), effect.span), effect.span), effect, effect.span)
        yield kept


def _same(one: ast.Atom, other: ast.Atom) -> ast.Formula:
    """Where two atoms of a predicate are one: nothing to ask if their arguments are the same."""
    pairs = [(a, b) for a, b in zip(one.args, other.args, strict=False) if a.key != b.key]
    if not pairs:
        return ast.Empty(other.span)
    return ast.And(tuple(ast.Equality(a, b, other.span) for a, b in pairs), other.span)


def _plain(effect: ast.Effect) -> Iterator[ast.Assign]:
    """What an effect sets in any case."""
    match effect:
        case ast.Assign():
            yield effect
        case ast.EffectAnd(parts):
            for part in parts:
                yield from _plain(part)
        case _:
            return


def _conditional(effect: ast.Effect) -> Iterator[str]:
    """Predicates of what an effect sets otherwise."""
    match effect:
        case ast.EffectAnd(parts):
            for part in parts:
                yield from _conditional(part)
        case ast.Assign():
            return
        case _:
            yield from (leaf.atom.predicate.key for leaf in _inner(effect))


def _inner(effect: ast.Effect) -> Iterator[ast.Assign]:
    """What an effect sets within `when`, `forall` and chance."""
    match effect:
        case ast.EffectAnd(parts):
            for part in parts:
                yield from _inner(part)
        case ast.When(_, part) | ast.EffectForall(_, part):
            yield from (*_plain(part), *_inner(part))
        case ast.Probabilistic(branches):
            for branch in branches:
                yield from (*_plain(branch.effect), *_inner(branch.effect))
        case ast.OneOf(parts):
            for part in parts:
                yield from (*_plain(part), *_inner(part))
        case ast.Assign() | ast.Empty() | ast.FluentEffect() | ast.Unsupported():
            return
        case _:
            assert_never(effect)


def _predicates(formula: ast.Formula) -> Iterator[str]:
    """The predicates that a condition reads."""
    match formula:
        case ast.Atom(predicate):
            yield predicate.key
        case ast.Not(part) | ast.Quantified(_, _, part) | ast.Believed(part):
            yield from _predicates(part)
        case ast.And(parts) | ast.Or(parts):
            for each in parts:
                yield from _predicates(each)
        case ast.Imply(premise, conclusion):
            yield from (*_predicates(premise), *_predicates(conclusion))
        case ast.Test(_, atom):
            yield from _predicates(atom)
        case ast.Empty() | ast.Equality() | ast.Comparison() | ast.Unsupported():
            return
        case _:
            assert_never(formula)


def _compared(formula: ast.Formula) -> Iterator[str]:
    """The functions that a condition compares."""
    match formula:
        case ast.Comparison(_, left, right):
            yield from (*_numbers(left), *_numbers(right))
        case ast.Not(part) | ast.Quantified(_, _, part) | ast.Believed(part):
            yield from _compared(part)
        case ast.And(parts) | ast.Or(parts):
            for each in parts:
                yield from _compared(each)
        case ast.Imply(premise, conclusion):
            yield from (*_compared(premise), *_compared(conclusion))
        case _:
            return


def _numbers(expression: ast.NumericExpression) -> Iterator[str]:
    """The functions in an expression."""
    match expression:
        case ast.FluentRef(name):
            yield name.key
        case ast.Arithmetic(_, operands):
            for operand in operands:
                yield from _numbers(operand)
        case _:
            return


def _changed_numbers(effect: ast.Effect) -> Iterator[str]:
    """The functions that an effect may change."""
    match effect:
        case ast.FluentEffect(_, fluent):
            yield fluent.name.key
        case ast.EffectAnd(parts) | ast.OneOf(parts):
            for part in parts:
                yield from _changed_numbers(part)
        case ast.When(_, part) | ast.EffectForall(_, part):
            yield from _changed_numbers(part)
        case ast.Probabilistic(branches):
            for branch in branches:
                yield from _changed_numbers(branch.effect)
        case _:
            return


# --- what takes concurrency ----------------------------------------------------------------------


def _refuse_concurrency(definition: ast.Definition, problem: ast.Definition | None, report: Report) -> None:
    """Refuse actions that need a fact which holds only while another one runs, and not at the start."""
    durative = [section for section in definition.sections if isinstance(section, ast.DurativeAction)]
    only: dict[str, ast.DurativeAction] = {}
    lasting: set[str] = set()
    for section in () if problem is None else problem.sections:
        if isinstance(section, ast.Init):
            facts = (each for each in section.elements if isinstance(each, ast.Assign))
            lasting.update(_made(facts))
    for section in definition.sections:
        if isinstance(section, ast.Action) and section.effect is not None:
            lasting.update(_made(_every(section.effect)))
    for node in durative:
        start, end = _set_by(node, "at start"), _set_by(node, "at end")
        lasting.update(_made(end))
        undone = {_key(leaf.atom) for leaf in end if leaf.value is Truth.FALSE}
        for leaf in start:
            if leaf.value is Truth.TRUE:
                key = leaf.atom.predicate.key
                if _key(leaf.atom) in undone:
                    only.setdefault(key, node)
                else:
                    lasting.add(key)
    for node in durative:
        for predicate in _needed(node):
            lender = only.get(predicate)
            if lender is not None and lender is not node and predicate not in lasting:
                report.error(
                    "BBT0449",
                    f"durative action `{node.name.text}` needs `{predicate}`, which is true only while "
                    f"`{lender.name.text}` runs",
                    node.span,
                    "actions run one after the other here: nothing runs beside another action",
                )


def _key(atom: ast.Atom) -> tuple[str, ...]:
    """Which atom it is."""
    return (atom.predicate.key, *(term.key for term in atom.args))


def _every(effect: ast.Effect) -> list[ast.Assign]:
    return [*_plain(effect), *_inner(effect)]


def _made(leaves: Iterable[ast.Assign]) -> Iterator[str]:
    return (leaf.atom.predicate.key for leaf in leaves if leaf.value is Truth.TRUE)


def _set_by(node: ast.DurativeAction, moment: ast.Moment) -> list[ast.Assign]:
    """All that a durative action may set at its start, or its end."""
    found: list[ast.Assign] = []
    stack = [] if node.effect is None else [node.effect]
    while stack:
        part = stack.pop()
        match part:
            case ast.TimedChange(when, effect) if when == moment:
                found += _every(effect)
            case ast.TimedAll(parts):
                stack.extend(parts)
            case ast.TimedForall(_, inner) | ast.TimedWhen(_, inner):
                stack.append(inner)
            case _:
                pass
    return found


def _needed(node: ast.DurativeAction) -> Iterator[str]:
    """Predicates of its plain conditions that are to be true."""
    stack: list[ast.Timed] = [] if node.condition is None else [node.condition]
    while stack:
        part = stack.pop()
        match part:
            case ast.TimedFormula(_, formula):
                yield from _positive(formula)
            case ast.TimedAll(parts):
                stack.extend(parts)
            case ast.TimedForall(_, inner):
                stack.append(inner)
            case _:
                pass


def _positive(formula: ast.Formula) -> Iterator[str]:
    match formula:
        case ast.Atom(predicate):
            yield predicate.key
        case ast.And(parts):
            for part in parts:
                yield from _positive(part)
        case ast.Quantified(_, _, part):
            yield from _positive(part)
        case _:
            return
