"""Rules are named for what they are there for, and nothing else changes."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given

from bbtc.backends.registry import load_exporter, parse_options
from bbtc.belief.simulate import simulate
from bbtc.ground.condition import TRUE, And, Condition, Is, Known
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.subgoals import with_subgoals
from bbtc.rewrite.simplify import numbered
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree, walk
from bbtc.tree.validate import check_tree
from tests.domains.problems import PROBLEMS, Problem
from tests.domains.problems import tree_of as planned_tree
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import trees

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN
GIVEN, SEEN, HERE, OPEN, LOW, CLEAN = range(6)
NAMES = ("given", "seen", "here", "open", "low", "clean")
TASK = task(
    " ".join(NAMES),
    {SEEN: U, CLEAN: T},
    And((Is(GIVEN, T), Is(CLEAN, T))),
    action("give", And((Is(HERE, T), Is(SEEN, T))), ("1/2", {GIVEN: T}), ("1/2", {CLEAN: F})),
    action("look", And((Is(HERE, T), Is(SEEN, U))), ("1/2", {SEEN: T}), ("1/2", {SEEN: F})),
    action("go", Is(OPEN, T), ("3/4", {HERE: T}), ("1/4", {HERE: T, LOW: T})),
    action("unlock", TRUE, ("1", {OPEN: T})),
    action("charge", Is(LOW, T), ("1", {LOW: F})),
    action("wave", TRUE, ("1", {LOW: T})),
    action("shake", TRUE, ("1", {SEEN: U})),
    action("wipe", TRUE, ("1", {CLEAN: T})),
)


def tree_of(*rules: str) -> Node:
    """The goal, then rules ``low not:open act``."""
    children: list[Node] = [ConditionNode("", TASK.goal)]
    for rule in rules:
        *tests, act = rule.split()
        action_node = ActionNode("", f"{act}()", latched=False, guarded=True)
        conditions = [ConditionNode("", literal(word)) for word in tests]
        children.append(ControlNode("", "sequence", (*conditions, action_node)) if tests else action_node)
    return numbered(ControlNode("", "fallback", tuple(children)))


def literal(word: str) -> Condition:
    kind, _, name = word.rpartition(":")
    variable = NAMES.index(name)
    return Known(variable) if kind == "known" else Is(variable, {"": T, "not": F, "unknown": U}[kind])


def names_of(root: Node) -> list[str | None]:
    return [each.name for each in walk(root) if isinstance(each, ControlNode) and each.kind == "sequence"]


@pytest.mark.parametrize(
    ("rules", "names"),
    [
        (["not:given give"], ["for given()"]),
        # Not what stands before it wants first, but what the goal wants.
        (["not:given give", "not:clean wipe"], ["for given()", "for clean()"]),
        # What the rule before it reads; here, where go has a side effect, too.
        (["not:given give", "not:low go"], ["for given()", "for here()"]),
        (["low charge", "not:given give", "not:open unlock"], [None, "for given()", None]),
        (["not:given give", "not:low go", "not:low unlock"], ["for given()", "for here()", "for open()"]),
        # An action that finds out makes nothing true.
        (["known:seen not:given give", "not:low look"], ["for given()", "for known seen()"]),
        # A rule that ends what it reads does not want it.
        (["low charge", "not:given wave"], [None, None]),
        (["known:seen shake", "not:low look"], [None, None]),
        # What holds already is not what it is for.
        (["not:given give", "here not:low go"], ["for given()", None]),
        # Nothing is said of an action alone.
        (["give", "go"], []),
    ],
)
def test_names(rules: list[str], names: list[str | None]) -> None:
    assert names_of(with_subgoals(TASK, tree_of(*rules))) == names


def test_a_condition_that_rules_share_holds_for_each() -> None:
    inner = ControlNode("i", "sequence", (ConditionNode("l", literal("not:low")), ActionNode("g", "go()")))
    shared = ControlNode("s", "fallback", (ActionNode("v", "give()"), inner))
    for word, expected in (("not:given", "for here()"), ("here", None)):
        root = ControlNode("o", "sequence", (ConditionNode("c", literal(word)), shared))
        assert names_of(with_subgoals(TASK, root)) == [None, expected]


@pytest.mark.parametrize("label", ["name", "reason", "template"])
def test_words_of_others_stay(label: str) -> None:
    rule = next(
        each for each in walk(tree_of("not:given give")) if isinstance(each, ControlNode) and each.id == "n3"
    )
    own = replace(rule, **{label: "mine()"})  # type: ignore[arg-type]
    assert with_subgoals(TASK, own) == own


@pytest.mark.parametrize("form", ["text", "dot", "mermaid", "btcpp", "py_trees"])
def test_every_export_shows_them(form: str) -> None:
    root = with_subgoals(TASK, tree_of("not:given give"))
    figures = simulate(TASK, root, Limits())
    tree = Tree(TASK, root, figures.success, figures.success, "stuck")
    text = load_exporter(form).export(tree, parse_options(load_exporter(form), {}), None)
    assert isinstance(text, str)
    assert "for given()" in text.replace("#40;", "(").replace("#41;", ")")


@examples(100)
@given(tree=trees())
def test_names_change_nothing(tree: Tree) -> None:
    root = with_subgoals(tree.task, tree.root)
    check_tree(replace(tree, root=root))
    for before, after in zip(walk(tree.root), walk(root), strict=True):
        if isinstance(before, ControlNode) and isinstance(after, ControlNode):
            assert replace(after, name=before.name, children=()) == replace(before, children=())
            assert after.name == before.name or before.name is None
        else:
            assert after == before


@pytest.mark.parametrize("problem", [p for p in PROBLEMS if p.name in ("night-round", "survey")], ids=str)
def test_planned_trees_have_them(problem: Problem) -> None:
    found = [name for name in names_of(planned_tree(problem, "auto").root) if name is not None]
    assert {"night-round": "for patrolled(lobby)", "survey": "for at(cellar)"}[problem.name] in found
