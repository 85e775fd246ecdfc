"""What is unknown reaches conditions through rules, also where nothing ever changes it."""

from __future__ import annotations

from fractions import Fraction

import pytest

from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.bounds import task_value
from tests.ground.examples import task_of

_TEMPLATE = "(:template do :effect (done) :body (finish))"


def _text(rules: str, init: str, needs: str, *, template: bool) -> str:
    return (
        "(define (domain survey) (:types spot) (:constants here there - spot)"
        " (:predicates (dark) (deep ?s - spot) (near ?a ?b - spot) (done)"
        "  (closed) (shut) (bad ?s - spot) (worse ?s - spot))"
        f" {rules} (:action finish :precondition {needs} :effect (done)) {_TEMPLATE if template else ''})"
        f"(define (problem once) (:domain survey) (:init {init}) (:goal (done)))"
    )


_DARK = "(:derived (closed) (dark))"
_BOTH = f"{_DARK} (:derived (shut) (not (closed)))"
_DEEP = "(:derived (bad ?s - spot) (deep ?s))"
_CHAIN = (
    "(:derived (bad ?s - spot) (or (deep ?s) (exists (?o - spot) (and (near ?s ?o) (bad ?o)))))"
    "(:derived (worse ?s - spot) (and (bad ?s) (not (dark))))"
)
_CASES = [
    (_DARK, "(unknown (dark))", "(known (closed))", 0),
    (_DARK, "(unknown (dark))", "(unknown (closed))", 1),
    (_DARK, "(unknown (dark))", "(not (unknown (closed)))", 0),
    (_DARK, "(unknown (dark))", "(or (closed) (not (closed)))", 0),
    (_DARK, "(dark)", "(known (closed))", 1),
    (_BOTH, "(unknown (dark))", "(known (shut))", 0),
    (_BOTH, "(unknown (dark))", "(unknown (shut))", 1),
    (_BOTH, "", "(shut)", 1),
    (_DEEP, "(unknown (deep here))", "(forall (?s - spot) (known (bad ?s)))", 0),
    (_DEEP, "(unknown (deep here))", "(exists (?s - spot) (unknown (bad ?s)))", 1),
    (_DEEP, "(unknown (deep here)) (deep there)", "(and (unknown (bad here)) (known (bad there)))", 1),
    (_CHAIN, "(near here there) (unknown (deep there))", "(unknown (bad here))", 1),
    (_CHAIN, "(unknown (near here there)) (deep there)", "(known (bad here))", 0),
    (_CHAIN, "(unknown (near here there)) (deep there) (dark)", "(known (worse here))", 1),
    (_CHAIN, "(unknown (near here there)) (deep there)", "(unknown (worse here))", 1),
    ("(:derived (closed) (unknown (dark)))", "(unknown (dark))", "(and (closed) (known (closed)))", 1),
    (_DARK, "(probabilistic 1/4 (unknown (dark)) 1/4 (dark))", "(known (closed))", Fraction(3, 4)),
    (_DARK, "(unknown (dark)) (probabilistic 1/4 (not (dark)))", "(unknown (closed))", Fraction(3, 4)),
]


@pytest.mark.parametrize("template", [False, True])
@pytest.mark.parametrize(("rules", "init", "needs", "best"), _CASES)
def test_a_rule_is_unknown_where_what_it_reads_is(
    rules: str, init: str, needs: str, best: Fraction, template: bool
) -> None:
    task = task_of(_text(rules, init, needs, template=template))
    assert (task_value(task, Limits()).lower, task_value(task, Limits()).upper) == (best, best)
    plan = plan_task(task, None, "refine" if template else "auto", Limits(), lambda _: None)
    assert plan.tree.success_probability == best


@pytest.mark.parametrize(("rules", "init", "needs", "best"), _CASES)
def test_a_goal_or_a_guard_reads_the_same(rules: str, init: str, needs: str, best: Fraction) -> None:
    text = _text(rules, init, "()", template=False)
    guarded = text.replace(":effect (done)", f":effect (when {needs} (done))")
    assert task_value(task_of(guarded), Limits()).lower == best
    if best:
        at_once = text.replace("(:goal (done))", f"(:goal {needs})")
        assert task_value(task_of(at_once), Limits()).lower == best


def test_what_stays_unknown_is_no_variable_of_a_task_that_only_tests_it() -> None:
    task = task_of(_text(_DARK, "(unknown (dark))", "(unknown (closed))", template=False))
    assert [variable.name for variable in task.variables] == ["done()"]


@pytest.mark.parametrize("kind", ["exists", "forall"])
@pytest.mark.parametrize("template", [False, True])
def test_it_does_not_matter_in_which_order_a_quantifier_says_things(kind: str, template: bool) -> None:
    parts = ["(not (deep ?s))", "(near here ?s)", "(or (dark) (not (deep ?s)))"]
    join = "and" if kind == "exists" else "imply (dark)"
    for one, other, third in (parts, parts[::-1], [parts[1], parts[0], parts[2]]):
        needs = f"({kind} (?s - spot) ({join} (and {one} {other} {third})))"
        text = _text("", "(near here there)", needs, template=template)
        text = text.replace("(:action", "(:action dig :parameters (?s - spot) :effect (deep ?s)) (:action", 1)
        assert task_value(task_of(text), Limits()).lower == 1
