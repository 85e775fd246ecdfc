"""``python -m tests.mutation``: how many of a sample of mutants the tests notice. See tests/README.md."""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.mutation.mutants import Mutant, mutants_of
from tests.mutation.trial import Project, Tried, drawn, try_all

REPOSITORY = Path(__file__).resolve().parents[2]
EQUIVALENT = Path(__file__).with_name("equivalent.tsv")
LEAST = 0.9
"""The share of a sample that tests have to notice."""

_WHOLE = ("tests/domains/test_golden.py", "tests/domains/test_figures.py")
PACKAGES = {
    "bbtc/belief": (
        *_WHOLE,
        "tests/belief",
        "tests/planner/test_simplify.py",
        "tests/planner/test_failing_runs.py",
        "tests/planner/test_targets.py",
        "tests/verifier/test_figures.py",
        "tests/backends/test_text_formats.py",
        "tests/cli/test_run.py",
        "tests/planner/test_refine.py",
    ),
    "bbtc/ground": (
        *_WHOLE,
        "tests/ground",
        "tests/artefacts",
        "tests/domains/test_against_lifted.py",
        "tests/analysis",
        "tests/cli/test_limits.py",
    ),
    "bbtc/planner": (
        *_WHOLE,
        "tests/planner",
        "tests/verifier/test_plans.py",
        "tests/domains/test_against_lifted.py",
    ),
    "bbtc/disturbance": (
        "tests/disturbance",
        "tests/replay/test_perturbed.py",
    ),
    "bbtc/rewrite": (
        *_WHOLE,
        "tests/planner",
        "tests/belief/test_retry.py",
    ),
    "bbtc/verifier": (
        *_WHOLE,
        "tests/verifier",
        "tests/backends/test_text_formats.py",
        "tests/cli/test_limits.py",
    ),
    "bbtc/backends": (
        "tests/backends/test_names.py",
        "tests/backends/test_text_formats.py",
        "tests/backends/test_graphviz.py",
        "tests/backends/test_btcpp.py",
        *_WHOLE,
        "tests/backends",
        "tests/artefacts",
        "tests/imports/test_roundtrip.py",
        "tests/imports/test_edits.py",
        "tests/replay/test_ticks.py",
        "tests/replay/test_equivalence.py",
        "tests/replay/test_replay.py",
        "tests/replay/test_actions.py",
        "tests/domains/test_same_behaviour.py",
        "tests/builder/test_begun.py",
    ),
}


def repository() -> Project:
    """This checkout, with what git knows of it and what is new."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=REPOSITORY,
        stdout=subprocess.PIPE,
        check=True,
    )
    names = [name for name in listed.stdout.decode().split("\0") if name and (REPOSITORY / name).is_file()]
    return Project(REPOSITORY, PACKAGES, tuple(names))


def explained(path: Path) -> dict[tuple[str, str, str, str], str]:
    """The mutants known to be equivalent, with why."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(file, dialect="excel-tab")
        return {(row["file"], row["function"], row["original"], row["mutant"]): row["why"] for row in rows}


def report(
    found: Sequence[Tried], equivalent: dict[tuple[str, str, str, str], str]
) -> tuple[list[str], bool]:
    """The lines to print, and whether enough were noticed and all others are explained."""
    survivors = [each for each in found if each.fate == "survived"]
    killed = len(found) - len(survivors)
    open_ = [each for each in survivors if each.mutant.key not in equivalent]
    lines = [f"{killed} of {len(found)} mutants killed ({killed / max(1, len(found)):.1%})"]
    # On a busy machine a survivor may look like one: they are named.
    lines.extend(f"only by the time limit: {named(each.mutant)}" for each in found if each.fate == "timeout")
    for each in survivors:
        why = equivalent.get(each.mutant.key)
        lines.append(f"survived{'' if why is None else ', equivalent'}: {named(each.mutant)}")
        lines.extend([] if why is None else [f"  {why}"])
    if open_:
        lines.append("To explain, as rows of equivalent.tsv, or to kill by a test:")
        lines.extend("\t".join((*each.mutant.key, "")) for each in open_)
    return lines, killed >= LEAST * len(found) and not open_


def named(mutant: Mutant) -> str:
    """A mutant in one line."""
    return f"{mutant.file}:{mutant.line} {mutant.function}: {mutant.original}  →  {mutant.mutant}"


def _told(done: Tried) -> None:
    by = f" by {done.by}" if done.fate == "killed" else ""
    print(f"{done.fate} in {done.seconds:.0f} s{by}: {named(done.mutant)}", flush=True)


def main(arguments: Sequence[str]) -> int:
    """The exit status: 0 if enough were killed and every survivor is explained, else 1."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--count", type=int, default=150, help="how many mutants")
    parser.add_argument("--seed", type=int, default=0, help="which ones")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time")
    parser.add_argument(
        "--most", type=float, default=60, help="seconds that the tests chosen for one mutant take without it"
    )
    parser.add_argument("--timeout", type=float, default=900, help="seconds for the tests of one")
    parser.add_argument("--file", help="all mutants of this module in the place of a sample")
    parser.add_argument("--list", action="store_true", help="only list them")
    options = parser.parse_args(arguments)
    project = repository()
    if options.file:
        mutants = mutants_of(project.root, options.file)
    else:
        mutants = drawn(project, options.count, options.seed)
    if options.list:
        for mutant in mutants:
            print(named(mutant))
        return 0
    found = try_all(project, mutants, options.jobs, options.timeout, _told, options.most)
    lines, good = report(found, explained(EQUIVALENT))
    print("\n".join(lines))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
