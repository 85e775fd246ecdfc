"""A program as a user writes it. Checkers read it strictly, and it runs: see ``test_signatures.py``."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path

from typing_extensions import assert_type

import bbtc


def best(files: list[Path], targets: list[Fraction | float | str]) -> bbtc.Tree | None:
    """The tree for the highest target that is reached."""
    task = bbtc.compile(*files)
    reached: bbtc.Tree | None = None
    for target in targets:
        plan: bbtc.Plan = bbtc.plan(task, target=target, strategy="refine", limits=bbtc.Limits(seconds=60))
        if plan.tree.status == "target-reached":
            reached = plan.tree
    return reached


def write_everything(tree: bbtc.Tree, folder: Path) -> None:
    """The tree in formats of each kind: a text, bytes, the files of a folder."""
    (folder / "tree.xml").write_text(bbtc.export(tree, "btcpp"), encoding="utf-8")
    (folder / "tree.dot").write_text(bbtc.export(tree, "dot", legend=True, templates="collapsed"))
    (folder / "tree.png").write_bytes(bbtc.export(tree, "png"))
    for name, text in bbtc.export(tree, "btcpp_project").texts.items():
        file = folder / "project" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    (folder / "tree.json").write_text(bbtc.dumps(tree))


def report(tree: bbtc.Tree) -> str:
    """What the tree does, recomputed."""
    figures: bbtc.Figures = bbtc.simulate(tree)
    verdict = bbtc.verify(tree, engine="own")
    assert_type(figures.success, Fraction)
    assert_type(figures.cost, Fraction | None)
    assert_type(bbtc.export(tree, "py_trees"), str)
    assert_type(bbtc.export(tree, "png"), bytes)
    longest = max(len(run.steps) for run in bbtc.scenarios(tree, 10))
    upper: Fraction = bbtc.bounds(tree.task).upper
    agreed = "agreed" if not verdict.problems else "; ".join(d.message for d in verdict.problems)
    return f"{figures.success} of at most {upper}, {longest} steps or more, {agreed}"


def main(domain: str, problem: str, folder: str) -> None:
    """Plan, write, read back, report."""
    try:
        tree = best([Path(domain), Path(problem)], ["1/2", 0.75, Fraction(9, 10)])
    except bbtc.LimitReached:
        sys.exit(3)
    except bbtc.BbtcError as error:
        diagnostics: tuple[bbtc.Diagnostic, ...] = error.diagnostics
        sys.exit("\n".join(diagnostic.render() for diagnostic in diagnostics))
    assert tree is not None
    write_everything(tree, Path(folder))
    again = bbtc.import_tree(Path(folder, "tree.xml"), domain, problem)
    assert not bbtc.diff(tree, again).differs
    print(report(again))


if __name__ == "__main__":
    main(*sys.argv[1:])
