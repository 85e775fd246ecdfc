"""Equal attempts that follow one another are put together, where every run stays what it was."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.belief.chain import explore
from bbtc.belief.simulate import simulate
from bbtc.ground.condition import TRUE, Is, Known
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task, simulate_tree
from bbtc.replay.equivalence import ENGINES, difference, engine_missing
from bbtc.rewrite.repeat import with_repeats
from bbtc.rewrite.simplify import numbered, size
from bbtc.tree.nodes import (
    ActionNode,
    ConditionNode,
    ControlNode,
    Node,
    Tree,
    actions_of,
    retries_of,
    retries_until_success_of,
)
from bbtc.tree.validate import check_tree
from bbtc.verifier.verdict import verify
from tests.domains.brute_force import runs_of
from tests.domains.problems import PROBLEMS, task_of, tree_of
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import nodes, tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN
SEEN, LIT = 0, 1
OF = task(
    "seen lit",
    {SEEN: U, LIT: T},
    Is(SEEN, T),
    action("look", Is(SEEN, U), ("1/3", {SEEN: T}), ("1/6", {SEEN: F}), ("1/2", {})),
    action("search", Is(SEEN, F), ("1/2", {SEEN: T}), ("1/4", {LIT: F}), ("1/4", {})),
    action("shine", TRUE, ("1", {LIT: T})),
)


def repeats(of: Task, root: Node) -> Node:
    return with_repeats(of, root, explore(of, root, Limits()), Limits())


@examples(100)
@given(data=st.data())
def test_no_run_changes(data: st.DataObject) -> None:
    """Random attempts, one after the other; the runs are told by an interpreter of the tests' own."""
    of = data.draw(tasks())
    attempt = data.draw(nodes(of))
    before = data.draw(nodes(of))
    attempts = [attempt] * data.draw(st.integers(2, 3))
    root = numbered(ControlNode("", "fallback", (before, *attempts)))
    try:
        check_tree(Tree(of, root, Fraction(0), Fraction(1), "stuck"))
    except Exception:  # noqa: BLE001
        return
    found = repeats(of, root)
    assert size(found) <= size(root)
    assert (found is root) == (size(found) == size(root))
    assert runs_of(of, found, 3) == runs_of(of, root, 3)


def do(name: str, *around: Node) -> Node:
    """An attempt: conditions, the action, and what came of it."""
    act = ActionNode("", f"{name}()")
    return ControlNode("", "sequence", (*around[:-1], act, around[-1])) if around else act


def control(kind: str, *children: Node) -> Node:
    return ControlNode("", kind, children)  # type: ignore[arg-type]


SEEN_NODE, KNOWN, BRIGHT = (ConditionNode("", each) for each in (Is(SEEN, T), Known(SEEN), Is(LIT, T)))
LOOK = do("look", KNOWN)
SEARCH = do("search", ConditionNode("", Is(SEEN, F)), BRIGHT, SEEN_NODE)
AGAIN = ActionNode("", "look()", latched=False)


@pytest.mark.parametrize(
    ("before", "attempts", "nodes_less"),
    [
        (control("skipper", SEEN_NODE, control("fallback", LOOK, LOOK)), [2], 5),
        (control("skipper", SEEN_NODE, control("fallback", LOOK, LOOK, LOOK)), [3], 8),
        (
            control(
                "fallback", control("skipper", SEEN_NODE, control("fallback", LOOK, LOOK)), SEARCH, SEARCH
            ),
            [2, 2],
            5 + 5,
        ),
        (control("skipper", SEEN_NODE, LOOK), [], 0),
        # Between the two something else is done.
        (control("fallback", SEEN_NODE, SEARCH, do("shine", SEEN_NODE), SEARCH), [], 0),
        # It tries again by itself.
        (control("fallback", SEEN_NODE, AGAIN, AGAIN), [], 0),
    ],
)
def test_neighbours_that_are_equal(before: Node, attempts: list[int], nodes_less: int) -> None:
    root = numbered(before)
    found = repeats(OF, root)
    assert [count for _, count in retries_of(found)] == attempts
    assert size(root) - size(found) == nodes_less
    assert simulate(OF, found, Limits()).success == simulate(OF, root, Limits()).success


@pytest.mark.parametrize("name", ["kitting/gift-set", "household/grasp-soda", "warehouse/one-order"])
def test_what_refinement_repeats_is_put_together_where_its_advice_is_taken(name: str) -> None:
    (problem,) = (each for each in PROBLEMS if str(each) == name)
    published = tree_of(problem, "refine")
    tree = plan_task(task_of(problem), None, "advised", Limits(), lambda _: None).tree
    assert list(retries_of(tree.root))
    assert size(tree.root) < size(published.root)
    ours, theirs = (simulate_tree(each, Limits())[0] for each in (tree, published))
    assert (ours.success, ours.cost, ours.actions) == (theirs.success, theirs.cost, theirs.actions)
    assert verify(tree, Limits(), "own").problems == ()


def test_attempts_of_several_actions_are_one_and_run_as_before_in_both_engines() -> None:
    """Refinement inserts the template "find" twice, which looks at one table after the other."""
    (problem,) = (each for each in PROBLEMS if str(each) == "household/look-for-soda")
    refined = tree_of(problem, "refine")
    root = repeats(refined.task, refined.root)
    ((again, attempts),) = retries_until_success_of(root)
    assert attempts == 2
    assert len(list(actions_of(again))) > 1
    assert (size(refined.root), size(root)) == (37, 25)
    tree = replace(refined, root=root)
    assert verify(tree, Limits(), "own").problems == ()
    for form in ENGINES:
        if engine_missing(form) is None:
            assert difference(tree, form, Limits()) is None
