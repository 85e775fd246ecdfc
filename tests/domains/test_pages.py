"""The pages in ``docs/domains/``: every figure, refinement and tree on them is what bbtc says now.

What is made stands between ``<!-- kind: what -->`` and ``<!-- end -->``; ``--update-golden`` writes
it anew.
"""

from __future__ import annotations

import itertools
import re

import pytest

from bbtc.artefacts.numbers import exact
from bbtc.belief.chain import explore
from bbtc.belief.scenarios import scenarios
from bbtc.belief.simulate import simulate
from bbtc.ground.describe import describe
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.tree.nodes import ConditionNode, ControlNode, Node, Tree, walk
from tests.conftest import GOLDEN, Golden
from tests.domains.constructs import users
from tests.domains.problems import DOMAINS, PROBLEMS, REPOSITORY, Problem, bbtc, plan_of, tree_of

PAGES = REPOSITORY / "docs" / "domains"
MADE = re.compile(r"(?<=<!-- )(?!end )(\w+)(?:: ([\w/-]+))? -->\n.*?(?=<!-- end -->)", re.DOTALL)
SIGNS = {"sequence": "→", "fallback": "?", "skipper": "⇒", "retry": "↻", "retry-until-success": "↺"}


def outline(task: Task, node: Node, depth: int = 0) -> str:
    """A tree as indented text: signs of control nodes, conditions, actions in brackets with their guards."""
    indent = "  " * depth
    if isinstance(node, ControlNode):
        attempts = "" if node.attempts is None else f"at most {node.attempts} actions"
        label = f"{SIGNS[node.kind]} {node.template or attempts}".rstrip()
        return f"{indent}{label}\n" + "".join(outline(task, child, depth + 1) for child in node.children)
    if isinstance(node, ConditionNode):
        return f"{indent}{describe(task, node.condition)}\n"
    needed = task.action_by_name[node.action].precondition
    guard = f" needs {describe(task, needed)}" if node.guarded else ""
    return f"{indent}[{node.action}]{guard}\n"


def fenced(text: str) -> str:
    """The text in a code block."""
    return f"\n```text\n{text}```\n\n"


def planned(problem: Problem, anew: bool) -> tuple[Tree, int]:
    """The tree of a problem, and by how many refinements it was made: as its golden files have it, or now."""
    if anew:
        plan = plan_of(problem)
        return plan.tree, len(plan.refinements)
    told = (GOLDEN / str(problem) / "plan.txt").read_text(encoding="utf-8")
    return tree_of(problem), len(re.findall(r"^ *\d+\. ", told, re.MULTILINE))


def tree(problem: Problem, anew: bool) -> str:
    """The tree as an outline."""
    made, _ = planned(problem, anew)  # its task may have variables more, for what is believed
    return fenced(outline(made.task, made.root))


def plan(problem: Problem, anew: bool) -> str:
    """What ``bbtc plan`` tells about its refinements: what it told when its golden file was written, or tells
    now."""
    golden = (GOLDEN / str(problem) / "plan.txt").read_text(encoding="utf-8")
    text = bbtc("plan", *problem.files, *problem.switches).err if anew else golden
    lines = text.splitlines()
    last = next(number for number, line in enumerate(lines) if line.startswith("target "))
    return fenced("".join(f"{line}\n" for line in lines[: last + 1]))  # warnings follow


def figures(domain: str, anew: bool) -> str:
    """A table of the problems of a domain with their exact figures."""
    rows = [
        "| problem | target | success | refinements | nodes | belief states | scenarios | cost | actions |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for problem in PROBLEMS:
        if problem.domain == domain:
            made, refinements = planned(problem, anew)
            does = simulate(made.task, made.root, Limits())
            runs = scenarios(explore(made.task, made.root, Limits()), Limits())
            count = sum(1 for _ in itertools.islice(runs, 500))
            cells = [
                f"[{problem.name}](../../{problem.files[1]})",
                exact(made.target),
                exact(made.success_probability),
                str(refinements),
                str(sum(1 for _ in walk(made.root))),
                str(does.states),
                "over 500" if count == 500 else str(count),
                "∞" if does.cost is None else exact(does.cost),
                "∞" if does.actions is None else exact(does.actions),
            ]
            rows.append(f"| {' | '.join(cells)} |")
    return "\n" + "".join(f"{row}\n" for row in rows) + "\n"


def constructs() -> str:
    """A table of the constructs of the language and the domains that use them."""
    rows = ["| construct | used in |", "|---|---|"]
    for name, domains in users().items():
        rows.append(f"| {name} | {', '.join(f'[{d}]({d}.md)' for d in domains)} |")
    return "\n" + "".join(f"{row}\n" for row in rows) + "\n"


def made(kind: str, what: str, anew: bool) -> str:
    """What belongs between the marks."""
    match kind:
        case "tree":
            return tree(Problem(*what.split("/")), anew)
        case "plan":
            return plan(Problem(*what.split("/")), anew)
        case "figures":
            return figures(what, anew)
        case "constructs":
            return constructs()
        case _:
            raise AssertionError(f"nothing makes {kind}")


@pytest.mark.parametrize("page", ["README", *DOMAINS])
def test_what_a_page_shows_is_what_bbtc_says(page: str, golden: Golden) -> None:
    file = PAGES / f"{page}.md"
    text = file.read_text(encoding="utf-8")

    def now_of(m: re.Match[str]) -> str:
        return f"{m[1]}{': ' + m[2] if m[2] else ''} -->\n{made(m[1], m[2] or '', golden.update)}"

    now = MADE.sub(now_of, text)
    assert text.count("<!-- end -->") == len(MADE.findall(text)) > 0
    if golden.update and now != text:
        file.write_text(now, encoding="utf-8")
    else:
        assert text == now, "run pytest tests/domains/test_pages.py --update-golden, and read the prose again"


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_a_page_shows_every_problem(problem: Problem) -> None:
    text = (PAGES / f"{problem.domain}.md").read_text(encoding="utf-8")
    for mark in (f"figures: {problem.domain}", f"plan: {problem}", f"tree: {problem}"):
        assert f"<!-- {mark} -->" in text


def test_every_construct_is_used_somewhere() -> None:
    assert [name for name, domains in users().items() if not domains] == []
