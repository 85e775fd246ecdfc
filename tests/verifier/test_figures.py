"""The recomputed figures of a tree are those of the simulator, to the last digit, in every form of the
chain; those of trees that others wrote are refused."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given

from bbtc.artefacts import load_tree
from bbtc.belief.simulate import simulate
from bbtc.diagnostics import LimitReached
from bbtc.files.sources import read_source
from bbtc.ground.condition import TRUE, And, Is, Known, Not
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import verify_tree
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree
from bbtc.verifier.chain import Form, chain_of, solvable_chain
from bbtc.verifier.explore import explore
from bbtc.verifier.program import Program
from bbtc.verifier.solve import Recomputed, recompute
from bbtc.verifier.verdict import verify
from tests.conftest import GOLDEN
from tests.domains.problems import SHORTER, Problem
from tests.long_form import amount
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.replay.random_trees import random_tree, with_attempts
from tests.strategies import soda_tree, trees

SAME = (
    "success",
    "failure",
    "blocked",
    "endless",
    "actions",
    "actions_given_success",
    "cost",
    "cost_given_success",
    "reward",
)
FORMS: list[tuple[Form, int]] = [("guards", 64), ("walk", 64), ("guards", 0), ("walk", 0)]
"""With at most 0 branches, every action is written in stages."""


def solved(program: Program) -> Recomputed:
    return recompute(explore(program, Limits()), Limits())


def disagreements(tree: Tree, found: Recomputed) -> dict[str, tuple[Fraction | None, Fraction | None]]:
    figures = simulate(tree.task, tree.root, Limits())
    return {
        name: (getattr(figures, name), found.figure(name))
        for name in SAME
        if getattr(figures, name) != found.figure(name)
    }


# --- random trees ----------------------------------------------------------------------------


@pytest.mark.parametrize("first", range(0, amount(100, 5000), 50))
def test_random_trees_full_of_actions(first: int) -> None:
    for seed in range(first, first + 50):
        tree = random_tree(seed, latched=0.85 if seed % 2 else 0.5)
        for form, most in FORMS:
            found = solved(chain_of(tree.task, tree.root, form, most))
            assert disagreements(tree, found) == {}, (seed, form, most)


@pytest.mark.parametrize("first", range(0, amount(50, 3000), 50))
def test_random_trees_that_try_again(first: int) -> None:
    for seed in range(first, first + 50):
        tree = with_attempts(random_tree(seed, latched=0.85 if seed % 2 else 0.5), seed)
        for form, most in FORMS:
            found = solved(chain_of(tree.task, tree.root, form, most))
            assert disagreements(tree, found) == {}, (seed, form, most)


@examples(amount(120, 3000))
@given(tree=trees())
def test_trees_on_tasks_with_every_construct(tree: Tree) -> None:
    """Chance in chance, several factors, conditional effects, costs and rewards of outcomes."""
    for form, most in FORMS:
        assert disagreements(tree, solved(chain_of(tree.task, tree.root, form, most))) == {}, (form, most)


@pytest.mark.parametrize("kind", ["sequence", "fallback"])
def test_wide_and_deep_trees(kind: str) -> None:
    """Neither the width nor the depth of a tree is a matter of recursion."""
    coin = task("heads", {}, Is(0, Truth.TRUE), action("throw", TRUE, ("1/2", {0: Truth.TRUE}), ("1/2", {})))
    heads = Is(0, Truth.TRUE)
    ends = Not(heads) if kind == "sequence" else heads

    outer: ControlKind = "fallback" if kind == "sequence" else "sequence"
    inner: ControlKind = "sequence" if kind == "fallback" else "fallback"
    throws = [ActionNode(f"a{number}", "throw()") for number in range(300)]
    checks = [ConditionNode(f"c{number}", ends) for number in range(300)]
    attempts = [ControlNode(f"n{n}", inner, pair) for n, pair in enumerate(zip(throws, checks, strict=True))]
    wide: Node = ControlNode("n", outer, tuple(attempts))
    deep: Node = ConditionNode("n", ends)
    never = And((heads, ends))
    for n in range(100):
        below = ControlNode(f"s{n}", "sequence", (throws[n], deep))
        deep = ControlNode(
            f"d{n}", "fallback" if n % 2 else "skipper", (ConditionNode(f"e{n}", never), below)
        )
    for root in (wide, deep):
        tree = Tree(coin, root, Fraction(0), Fraction(1), "stuck")
        assert disagreements(tree, solved(solvable_chain(coin, root))) == {}


def test_an_action_that_would_not_start_is_not_refused_for_want_of_attempts() -> None:
    """A guarded action with an unknown precondition is running, whatever its retry node has left."""
    hide = action("hide", Is(0, Truth.TRUE), ("1", {0: Truth.UNKNOWN}))
    use = action("use", Is(0, Truth.TRUE), ("1", {}))
    hidden = task("found", {0: Truth.TRUE}, Is(0, Truth.TRUE), hide, use)
    first = ControlNode("s", "sequence", (ConditionNode("k", Known(0)), ActionNode("h", "hide()", False)))
    both = ControlNode("f", "fallback", (first, ActionNode("u", "use()", False, True)))
    root = ControlNode("r", "retry", (both,), attempts=1)
    for form, most in FORMS:
        found = solved(chain_of(hidden, root, form, most))
        assert (found.blocked, found.failure) == (1, 0)
        assert disagreements(Tree(hidden, root, Fraction(0), Fraction(1), "stuck"), found) == {}


# --- trees that were planned -----------------------------------------------------------------

PLANNED = sorted(GOLDEN.glob("*/*/tree.json"))


def golden_tree(path: Path) -> Tree:
    return load_tree(read_source(str(path)))


@pytest.mark.parametrize("path", PLANNED, ids=lambda path: "/".join(path.parts[-3:-1]))
def test_the_trees_of_the_domains_are_verified(path: Path) -> None:
    tree = golden_tree(path)
    verdict = verify_tree(tree, Limits(), "own")
    assert verdict.problems == ()
    found = verdict.own if verdict.worlds is None else verdict.worlds
    assert found is not None
    assert disagreements(tree, found) == {}


# --- what is not as claimed ------------------------------------------------------------------


def codes(tree: Tree) -> list[str]:
    return [problem.code for problem in verify_tree(tree, Limits(), "own").problems]


def test_a_claim_that_is_a_little_too_high_is_refused() -> None:
    tree = soda_tree()
    assert codes(tree) == []
    assert codes(replace(tree, success_probability=Fraction(1, 2) + Fraction(1, 10**15))) == ["BBT0801"]


def cuts(node: Node) -> Iterator[ControlNode]:
    """The tree without a branch of its first node that has several, for each of them, the last first."""
    assert isinstance(node, ControlNode)
    if len(node.children) == 1:
        for inner in cuts(node.children[0]):
            yield replace(node, children=(inner,))
    for at in reversed(range(len(node.children) if len(node.children) > 1 else 0)):
        yield replace(node, children=(*node.children[:at], *node.children[at + 1 :]))


@pytest.mark.parametrize("problem", SHORTER, ids=str)
def test_a_tree_that_lost_a_branch_is_refused(problem: Problem) -> None:
    """Less success, or success without the goal. Branches for what others do are not used by its own runs."""
    tree = golden_tree(GOLDEN / str(problem) / "tree.json")
    assert any(codes(replace(tree, root=lost)) for lost in cuts(tree.root))


def test_a_status_or_bounds_that_contradict_the_claim_are_refused() -> None:
    tree = soda_tree()
    assert codes(replace(tree, status="target-reached")) == ["BBT0801"]
    assert codes(replace(tree, target=Fraction(1, 2))) == ["BBT0801"]  # out of reach, it says
    assert codes(replace(tree, bounds=(Fraction(0), Fraction(1, 3)))) == ["BBT0801"]
    assert codes(replace(tree, bounds=(Fraction(1, 2), Fraction(1, 2)))) == []


def test_trees_that_are_not_sound_are_refused() -> None:
    tree = soda_tree()
    always = replace(tree, root=ConditionNode("n", TRUE), success_probability=Fraction(1), status="stuck")
    assert codes(always) == ["BBT0802"]  # success, and the can was not seen
    dark = replace(tree, root=ActionNode("n", "detect(soda)"), status="stuck")
    assert "BBT0802" in codes(dark)  # it starts without light


def findings(tree: Tree) -> list[tuple[str, str]]:
    return [(problem.code, problem.message) for problem in verify(tree, Limits(), "own").problems]


def test_an_action_that_may_start_without_its_precondition_is_a_finding_of_its_own() -> None:
    """It looks for the can without light, and succeeds only if it sees it: all else is as it claims."""
    dark = ControlNode(
        "n1", "sequence", (ActionNode("n2", "detect(soda)"), ConditionNode("n3", soda_tree().task.goal))
    )
    half = Fraction(1, 2)
    tree = replace(soda_tree(), root=dark, success_probability=half, status="stuck", bounds=None)
    assert findings(tree) == [("BBT0802", "an action can start where its precondition is not true")]


def test_success_without_the_goal_is_told_with_its_probability() -> None:
    tree = soda_tree()
    lit = replace(tree, root=ActionNode("n1", "light_on()"), success_probability=Fraction(1), status="stuck")
    assert findings(replace(lit, bounds=None)) == [
        ("BBT0802", "with probability 1 the tree succeeds where the goal is not true")
    ]


def test_limits_end_the_recomputation() -> None:
    tree = soda_tree()
    with pytest.raises(LimitReached, match="states"):
        verify(tree, Limits(states=2), "own")
    with pytest.raises(LimitReached, match="time"):
        verify(tree, Limits(seconds=0.0), "own")
