"""Trees that were written by hand for problems of our domains, and those that bbtc plans, in the same worlds.

``by_hand/DOMAIN-PROBLEM.xml`` is what an engineer would put on the robot: BehaviorTree.CPP, reactive, each
action with its precondition. Each was improved until it succeeds in 99 of 100 runs in which something changes
by itself before one tick in twenty, or as often as the world allows; only then was the planned one looked at.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from fractions import Fraction
from math import sqrt
from pathlib import Path
from typing import Literal, TypeAlias

import bbtc
from bbtc.belief.simulate import Figures
from bbtc.disturbance.perturbed import PerturbedRuns, perturbed_runs
from bbtc.disturbance.recovery import Recovery, recovery
from bbtc.limits import Limits
from bbtc.planner.strategies import DEFAULT
from bbtc.rewrite.simplify import size
from bbtc.tree.nodes import Tree
from tests.domains.problems import PROBLEMS, REPOSITORY, Problem, task_of
from tests.domains.problems import tree_of as planned_tree

Author: TypeAlias = Literal["by hand", "planned"]
AUTHORS: tuple[Author, ...] = ("by hand", "planned")
Kind: TypeAlias = Literal["success", "starts", "goals", "cost", "nodes"]
KINDS: tuple[Kind, ...] = ("success", "starts", "goals", "cost", "nodes")
"""In what a tree may fall short."""
RATES = (Fraction(1, 100), Fraction(5, 100), Fraction(10, 100))
"""How probably something changes by itself before a tick."""
MARGIN = Fraction(5, 1000)
"""By so much a planned tree may succeed less often than the one by hand."""
MOST_NODES = Fraction(3, 2)
"""So many times the nodes may a planned tree have."""
MORE_NODES = {Problem("bin-picking", "two-parts"): Fraction(5, 2)}
"""Where it has more than that: it ends where the goal is out of reach, and the one by hand is blocked."""

_BY_HAND = Path(__file__).parent / "by_hand"


def file_of(problem: Problem) -> Path:
    """Where the tree for a problem stands, if somebody wrote one."""
    return _BY_HAND / f"{problem.domain}-{problem.name}.xml"


CONTESTED = [problem for problem in PROBLEMS if file_of(problem).exists()]
"""The problems that somebody wrote a tree for."""


@functools.cache
def tree_of(problem: Problem, author: Author) -> Tree:
    """The tree by hand, or what ``bbtc plan`` makes unless told otherwise."""
    if author == "by hand":
        tree = bbtc.import_tree(file_of(problem), *(REPOSITORY / file for file in problem.files))
        assert tree.task == task_of(problem)
        return tree
    return planned_tree(problem, DEFAULT)


def nodes_of(problem: Problem, author: Author) -> int:
    """The size of a tree, SubTrees counted wherever they are called."""
    return size(tree_of(problem, author).root)


@functools.cache
def figures_of(problem: Problem, author: Author) -> Figures:
    """What a tree attains, exactly, in the undisturbed world."""
    return bbtc.simulate(tree_of(problem, author))


@functools.cache
def runs_of(problem: Problem, author: Author, rate: Fraction, count: int, seed: int) -> PerturbedRuns:
    """What comes of a tree where something changes with this probability before each tick."""
    root = tree_of(problem, author).root
    return perturbed_runs(task_of(problem), root, rate, Limits(), runs=count, seed=seed)


def recovery_of(problem: Problem, author: Author) -> Recovery:
    """What a tree attains from every state that can be reached, or many of them."""
    return recovery(task_of(problem), tree_of(problem, author).root, Limits())


def shortfalls(problem: Problem, count: int, seed: int) -> Iterator[tuple[Kind, str]]:
    """In what the planned tree is worse than the one by hand, or starts an action without its precondition,
    or succeeds without the goal; what three standard errors of so many runs explain does not count."""
    for rate in RATES:
        ours, theirs = (runs_of(problem, author, rate, count, seed) for author in ("planned", "by hand"))
        error = 3 * sqrt(sum(each.success * (1 - each.success) for each in (ours, theirs)) / count)
        at = f"at {float(rate):.0%}"
        if ours.success < theirs.success - MARGIN - Fraction(error):
            yield "success", f"{at}, success {float(ours.success):.4f}, not {float(theirs.success):.4f}"
        if ours.unready:
            yield "starts", f"{at}, {ours.unready} of {ours.starts} starts are without precondition"
        if ours.missed:
            yield "goals", f"{at}, {ours.missed} of {count} runs succeed without the goal"
    ours_cost, theirs_cost = (figures_of(problem, author).cost for author in ("planned", "by hand"))
    if theirs_cost is not None and (ours_cost is None or ours_cost > theirs_cost):
        yield "cost", f"it costs {ours_cost and float(ours_cost)}, not {float(theirs_cost)}"
    ours_nodes, theirs_nodes = (nodes_of(problem, author) for author in ("planned", "by hand"))
    most = MORE_NODES.get(problem, MOST_NODES)
    if ours_nodes > most * theirs_nodes:
        yield "nodes", f"it has {ours_nodes} nodes, more than {float(most)} times {theirs_nodes}"
