"""The builder's methods take what the grammar gives them, and fast forms mean what slow ones mean."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import pytest
from lark import Lark
from lark.grammar import Rule

from bbtc.source import SourceFile
from bbtc.syntax.build import Builder
from bbtc.syntax.engine import Engine, Token
from bbtc.syntax.fields import Field
from bbtc.syntax.tables import START, Production, grammar_text, tables

# --- types of the productions ----------------------------------------------------------------


def _productions() -> Iterator[tuple[Rule, Production]]:
    """Lark's rules beside ours, which stand in the same order."""
    lark = Lark(grammar_text(), parser="lalr", start=START)
    rules = sorted(lark.rules, key=lambda rule: (rule.origin.name, [s.name for s in rule.expansion]))
    for rule, production in zip(rules, tables().productions, strict=True):
        assert (rule.origin.name, len(rule.expansion)) == (production.origin, production.size)
        yield rule, production


PRODUCTIONS = list(_productions())
_BY_ORIGIN: dict[str, list[tuple[Rule, Production]]] = {}
for _pair in PRODUCTIONS:
    _BY_ORIGIN.setdefault(_pair[1].origin, []).append(_pair)


def _flat(kind: Any) -> frozenset[Any]:
    """The members of a type: those of a union, or the type itself."""
    if get_origin(kind) in {Union, UnionType}:
        return frozenset().union(*map(_flat, get_args(kind)))
    return frozenset([NoneType if kind is None else kind])


def _callback(name: str) -> tuple[inspect.Signature, dict[str, Any]]:
    """Parameters of a method of the builder, with their types and that of the result (``return``)."""
    found = getattr(Builder(), name)
    hints = get_type_hints(found)
    if isinstance(found, type):
        hints["return"] = found
        if issubclass(found, Field):
            hints |= get_type_hints(Field)
            (hints["value"],) = get_args(found.__orig_bases__[0])  # type: ignore[attr-defined]
    return inspect.signature(found), hints


def _kinds(rule: Rule, production: Production) -> frozenset[Any]:
    """The types that the value of a production may have."""
    if production.single:
        return _given(rule.expansion[0])
    assert production.call is not None
    return _flat(_callback(production.call)[1]["return"])


def _given(symbol: Any) -> frozenset[Any]:
    """The types that a child of a production may have; the items of a list as a set in a tuple."""
    if symbol.is_term:
        return frozenset([Token])
    below = _BY_ORIGIN[symbol.name]
    if symbol.name.startswith("_"):
        items = [_given(rule.expansion[-1]) for rule, _ in below]
        return frozenset([(frozenset().union(*items),)])
    return frozenset().union(*(_kinds(rule, production) for rule, production in below))


def _takes(wanted: Any, given: Any) -> bool:
    """Whether a type accepts what may be given."""
    for kind in given:
        if isinstance(kind, tuple):
            lists = [get_args(each)[0] for each in _flat(wanted) if get_origin(each) is list]
            if not any(_takes(items, kind[0]) for items in lists):
                return False
        elif not any(
            kind == each or (isinstance(kind, type) and issubclass(kind, get_origin(each) or each))
            for each in _flat(wanted)
        ):
            return False
    return True


@pytest.mark.parametrize(
    ("rule", "production"),
    [pair for pair in PRODUCTIONS if pair[1].call is not None and not pair[1].single],
    ids=lambda value: str(value) if isinstance(value, Rule) else "",
)
def test_each_production_fits_the_types_of_its_method(rule: Rule, production: Production) -> None:
    assert production.call is not None
    children = [_given(symbol) for symbol in rule.expansion]
    for at in production.empty:
        children.insert(at, frozenset([(frozenset(),)]))
    signature, hints = _callback(production.call)
    for name, given in signature.bind(*children).arguments.items():
        several = signature.parameters[name].kind is inspect.Parameter.VAR_POSITIONAL
        for each in given if several else [given]:
            assert _takes(hints[name], each), f"{production.call}({name}) is given {each}"


def test_each_method_of_the_builder_has_a_production() -> None:
    methods = {name for name in dir(Builder) if not name.startswith("_")}
    assert methods == {production.call for _, production in PRODUCTIONS if production.call} - {
        production.call for _, production in PRODUCTIONS if production.single
    }


# --- forms that the grammar has twice --------------------------------------------------------

FAST_AND_SLOW = {
    "typed names": ("(:types a b - t u)", "(:types a b - (either t) u)"),
    "declaration": ("(:predicates (p ?x - t ?y))", "(:predicates (p ?x - (either t) ?y))"),
    "parameters": (
        "(:template n :parameters (?x) :body (foreach (?y - t) (a ?y)))",
        "(:template n :parameters (?x) :body (foreach (?y - (either t)) (a ?y)))",
    ),
    "conjunction": ("(:goal (and (p) (not (q a))))", "(:goal (and p (not (q a))))"),
    "negation": ("(:goal (or (not (p)) (q)))", "(:goal (or (not p) (q)))"),
    "equation": ("(:goal (or (= a n7) (not (= a n7))))", "(:goal (or (= a 7) (not (= a 7))))"),
    "several effects": ("(:action a :effect (and (p) (not (q))))", "(:action a :effect (and p (not q)))"),
    "value of a fluent": ("(:init (= (cost) 3))", "(:init (= cost 3))"),
}
"""Texts that mean the same, the second one written so that no fast terminal matches."""


class Recorder:
    """A builder that keeps the names of the methods that are called."""

    def __init__(self) -> None:
        self.called: list[str] = []

    def __getattr__(self, name: str) -> Any:
        found = getattr(Builder(), name)

        def called(*children: Any) -> Any:
            self.called.append(name)
            return found(*children)

        return called


def test_the_grammar_marks_both_of_two_forms() -> None:
    marks = re.findall(r"// fast: (.*)", grammar_text())
    assert set(marks) == set(FAST_AND_SLOW)
    assert min(map(marks.count, FAST_AND_SLOW)) >= 2


@pytest.mark.parametrize("form", FAST_AND_SLOW)
def test_a_fast_form_gives_the_same_nodes_as_the_slow_one(form: str) -> None:
    texts = [f"(define (domain d) {section})" for section in FAST_AND_SLOW[form]]
    built = [Recorder(), Recorder()]
    fast, slow = (
        Engine[object](tables(), recorder).parse(text, SourceFile("test.pddl", text))
        for recorder, text in zip(built, texts, strict=True)
    )
    assert sorted(built[0].called) != sorted(built[1].called)
    # A number takes no part in a fast equation: here it stands for the name `n7`.
    assert repr(fast) == repr(slow).replace("'7'", "'n7'")
