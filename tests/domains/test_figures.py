"""The plans for our domains: sound, as good as they say, and in the paper's case, as in the paper."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest

from bbtc.belief.chain import explore
from bbtc.belief.simulate import simulate
from bbtc.belief.soundness import violations
from bbtc.belief.state import initial_belief
from bbtc.ground.condition import evaluate
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.tree.nodes import actions_of
from bbtc.tree.validate import tree_problems
from tests.domains.brute_force import brute_force
from tests.domains.problems import DOMAINS, PROBLEMS, Problem, bbtc, plan_of, task_of, tree_of


@pytest.mark.parametrize("domain", DOMAINS)
def test_nothing_is_doubtful_in_a_domain(domain: str) -> None:
    """With a problem, warnings tell what that problem has no use for. That only events change a condition is
    a fact of some."""
    done = bbtc("check", f"domains/{domain}/domain.pddl")
    assert (done.status, done.out) == (0, b"")
    told = set(re.findall(r"BBT\d+", done.err))
    assert told == ({"BBT0317"} if domain in ("building", "bin-picking") else set())
    assert "0 warnings" in done.err


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_the_target_is_reached(problem: Problem) -> None:
    tree = tree_of(problem)
    assert tree.status == "target-reached"
    success = simulate(tree.task, tree.root, Limits()).success
    assert tree.success_probability == success >= task_of(problem).goal_probability


@pytest.mark.parametrize("domain", DOMAINS)
def test_a_domain_has_a_problem_that_takes_more_than_luck(domain: str) -> None:
    """At least one problem starts at a lower probability, and takes several actions, some of chance."""
    trees = [tree_of(problem) for problem in PROBLEMS if problem.domain == domain]
    assert len(trees) >= 2
    assert any(
        goal_at_the_start(tree.task) < tree.success_probability
        and len(list(actions_of(tree.root))) > 1
        and any(len(edges) > 1 for edges in explore(tree.task, tree.root, Limits()).edges)
        for tree in trees
    )


def goal_at_the_start(task: Task) -> Fraction:
    """How probably the goal is known to be true before anything is done."""
    belief = initial_belief(task)
    return sum((p for values, p in belief.items() if evaluate(task.goal, values) is Truth.TRUE), Fraction(0))


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_the_tree_is_sound(problem: Problem) -> None:
    tree = tree_of(problem)
    assert list(tree_problems(tree)) == []
    assert violations(tree.task, explore(tree.task, tree.root, Limits())) == []


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_figures_agree_with_brute_force(problem: Problem) -> None:
    tree = tree_of(problem)
    totals = brute_force(tree.task, tree.root)
    figures = simulate(tree.task, tree.root, Limits())
    found = (*totals.ends.values(), totals.cost, totals.actions, totals.reward)
    claimed = (
        figures.success,
        figures.failure,
        figures.blocked,
        figures.cost,
        figures.actions,
        figures.reward,
    )
    if totals.open:
        assert [float(each) for each in found] == pytest.approx(
            [float(each or 0) for each in claimed], abs=1e-9
        )
    else:
        assert found == claimed
    if tree.task.moves_by_time:
        assert float(sum(totals.ends.values()) + totals.open) == pytest.approx(1)
    else:
        assert sum(totals.ends.values()) + totals.open == 1


# --- the paper's scenario --------------------------------------------------------------------


def test_the_household_refines_as_in_the_paper() -> None:
    plan = plan_of(Problem("household", "look-for-soda"))
    assert [step.inserted for step in plan.refinements] == [
        "detect(soda)",
        "light_on()",
        "find(soda)",
        "find(soda)",
    ]
    assert [step.success for step in plan.refinements] == [
        0,
        Fraction(1, 2),
        Fraction(7, 8),
        Fraction(31, 32),
    ]


def test_the_household_says_so() -> None:
    problem = Problem("household", "look-for-soda")
    done = bbtc("plan", *problem.files, *problem.switches)
    assert done.status == 0
    assert "target 9/10 (0.9) reached: success probability 31/32 (0.96875)" in done.err


@pytest.mark.parametrize(
    ("name", "success"), [("grasp-soda", Fraction(1) - Fraction(4, 5) ** 4), ("look-in-fridge", Fraction(1))]
)
def test_grasping_and_the_fridge(name: str, success: Fraction) -> None:
    """A grasp holds one time in five; four of them reach one half."""
    assert tree_of(Problem("household", name)).success_probability == success
