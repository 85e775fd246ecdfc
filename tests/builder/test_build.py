"""``bbtc build``: what is out of date is made, all of it and nothing else, whatever goes wrong beside it."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import bbtc as bbtc_api
from bbtc import pipeline
from bbtc.builder import pool, runner, state
from bbtc.builder.job import Job
from bbtc.builder.runner import BuildReport, build
from bbtc.manifest.entries import TreeEntry
from tests.builder.projects import COIN, REPOSITORY, bbtc, project, several, snapshot
from tests.long_form import amount

LAMP = "(define (domain lamp) (:predicates (lit)) (:action on :effect (lit)))\n"
LIGHT = "(define (problem light) (:domain lamp) (:goal (lit)))\n"


def outcomes(report: BuildReport) -> dict[str, str]:
    """The status of each tree."""
    return {outcome.name: outcome.status for outcome in report.outcomes}


def built(report: BuildReport) -> list[str]:
    """The trees that were built."""
    return [outcome.name for outcome in report.outcomes if outcome.status == "built"]


def run(folder: Path, *names: str, **options: Any) -> BuildReport:
    """Build in this process."""
    return build(folder / "bbtc.yaml", names=names, **{"jobs": 1, **options})


# --- what is made ----------------------------------------------------------------------------


def test_a_build_makes_what_the_commands_make(tmp_path: Path) -> None:
    manifest = (
        "trees:\n  coin:\n    domain: coin.pddl\n    target: 0.75\n    strategy: policy\n"
        "    retries: least\n"
        "    exports: {btcpp: , py_trees: robot/coin.py, big: {format: dot, options: {legend: true}}}\n"
        "    expect: [success == 3/4, actions == 3/2, nodes < 9]\n"
    )
    folder = project(tmp_path, manifest, coin_pddl=COIN)
    done = bbtc(folder, "build")
    assert done.returncode == 0, done.stderr
    assert "coin: success 3/4 (0.75)" in done.stderr
    plan = ["plan", "coin.pddl", "--target", "0.75", "--strategy", "policy", "--retries", "least", "-q"]
    assert bbtc(folder, *plan, "-o", "tree.json").returncode == 0
    assert (folder / "build/coin.tree.json").read_text() == (folder / "tree.json").read_text()
    for file, form in {
        "build/coin.xml": ["btcpp"],
        "robot/coin.py": ["py_trees"],
        "build/coin-big.dot": ["dot", "-O", "legend=true"],
    }.items():
        assert (folder / file).read_text() == bbtc(folder, "export", "tree.json", "--to", *form).stdout, file


DOOR = """(define (domain door) (:predicates (inside) (shut) (key))
  (:action open :precondition (key) :effect (not (shut)))
  (:action force :effect (probabilistic 1/2 (not (shut))))
  (:action drop :effect (not (key)))
  (:action enter :precondition (not (shut)) :effect (inside)))
(define (problem in) (:domain door) (:init (shut) (key)) (:goal (inside)))
"""


def test_a_build_holds_a_tree_to_what_it_does_where_others_change_the_world(tmp_path: Path) -> None:
    # The tree opens the door and enters. States without the key, which only an action takes away that it does
    # not use, are counted all the same.
    def manifest(expect: str) -> str:
        how = f"guarded: false, perturb: 0.1, expect: [{expect}]"
        return f"trees:\n  door: {{domain: door.pddl, {how}}}\n"

    folder = project(tmp_path, manifest("nodes < 99"), door_pddl=DOOR)
    assert built(run(folder)) == ["door"]
    tree = bbtc_api.load_tree(folder / "build/door.tree.json")
    assert len(tree.task.actions) < 4
    task = bbtc_api.compile(folder / "door.pddl")
    expected = bbtc_api.recovery(tree, task=task)
    assert expected.states == 6 > bbtc_api.recovery(tree).states
    runs = bbtc_api.perturb(tree, "0.1", task=task)
    told = f"recovery == {expected.mean}, perturbed-success == {runs.success}"
    told += f", perturbed-unready == {runs.unready}"
    (folder / "bbtc.yaml").write_text(manifest(told))
    assert built(run(folder)) == ["door"]
    assert outcomes(run(folder)) == {"door": "unchanged"}
    (folder / "bbtc.yaml").write_text(manifest(told).replace("0.1", "0.2"))
    assert outcomes(run(folder)) == {"door": "failed"}
    (folder / "bbtc.yaml").write_text(manifest("recovery > 1"))
    done = bbtc(folder, "build")
    assert done.returncode == 1
    assert "door: expected recovery > 1, but recovery is " in done.stderr


def test_a_format_of_several_files_goes_into_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bbtc.backends import registry
    from bbtc.backends.exporter import Files
    from bbtc.manifest import read

    class Several:
        name, description, suffix, options = "several", "for tests", "", ()

        def export(self, tree: object, options: object, figures: object) -> Files:
            """Two files."""
            return Files({"a.txt": "a\n", "sub/b.txt": "b\n"})

    original = registry.load_exporter
    for module in (registry, read):
        monkeypatch.setattr(
            module, "load_exporter", lambda form: Several() if form == "several" else original(form)
        )
    folder = project(tmp_path, "trees: {c: {domain: c.pddl, target: 0, exports: [several]}}\n", c_pddl=COIN)
    assert run(folder).ok
    assert (folder / "build/c-several/sub/b.txt").read_text() == "b\n"
    (folder / "build/c-several/sub/b.txt").unlink()
    assert built(run(folder)) == ["c"]
    assert (folder / "build/c-several/sub/b.txt").read_text() == "b\n"
    assert built(run(folder)) == []


def test_init_makes_a_project_that_builds(tmp_path: Path) -> None:
    assert bbtc(tmp_path, "init", "plants").returncode == 0
    folder = tmp_path / "plants"
    done = bbtc(folder, "build")
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stderr
    assert {path.suffix for path in (folder / "build").iterdir()} == {".json", ".xml", ".svg"}
    assert bbtc(folder, "build", "--check").returncode == 0
    assert bbtc(folder, "fmt", "--check", "domain.pddl", "first-problem.pddl").returncode == 0
    before = snapshot(folder)
    again = bbtc(folder, "init")
    assert (again.returncode, snapshot(folder)) == (1, before)
    assert "BBT1007" in again.stderr


# --- what is out of date ---------------------------------------------------------------------


def test_nothing_changed_builds_and_touches_nothing(tmp_path: Path) -> None:
    folder = several(tmp_path, 6)
    assert len(built(run(folder))) == 6
    before = snapshot(folder)
    assert built(run(folder)) == []
    assert "6 trees: 0 built, 6 up to date" in bbtc(folder, "build").stderr
    assert snapshot(folder) == before


def test_up_to_date_needs_no_manifest_parser_and_no_stage(tmp_path: Path) -> None:
    folder = several(tmp_path, 2)
    run(folder)
    code = (
        "import sys; from pathlib import Path; from bbtc.builder.runner import build\n"
        "assert build(Path('bbtc.yaml')).count('unchanged') == 2\n"
        "heavy = ('yaml', 'lark', 'clingo', 'numpy', 'bbtc.pipeline', 'bbtc.backends', 'bbtc.planner')\n"
        "print([name for name in heavy if name in sys.modules])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        env=environment(),
    )
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_an_edited_file_builds_what_depends_on_it(tmp_path: Path) -> None:
    folder = several(tmp_path, 7, per_domain=3)
    run(folder)
    domain = folder / "d1.pddl"
    domain.write_text(domain.read_text().replace("1/2", "3/4"))
    assert built(run(folder)) == ["t3", "t4", "t5"]
    assert built(run(folder)) == []
    (folder / "p6.pddl").write_text("; now\n" + (folder / "p6.pddl").read_text())
    before = snapshot(folder)
    report = run(folder)
    assert built(report) == ["t6"]
    assert [outcome.changed for outcome in report.outcomes if outcome.status == "built"] == [()]
    assert snapshot(folder) == before, "a comment changes no artefact"
    assert built(run(folder)) == []


@pytest.mark.parametrize(
    ("change", "stale"),
    [
        (("domain: lamp.pddl", "domain: other.pddl"), ["a"]),
        (("target: 0.5", "target: 0.75"), ["a"]),
        (("strategy: refine", "strategy: auto"), ["b"]),
        (("max-actions: 3", "max-actions: 4"), ["c"]),
        (("legend: true", "legend: false"), ["d"]),
        (("svg: x.svg", "svg: y.svg"), ["d"]),
        (("success >= 0.5", "success >= 0.6"), ["b"]),
        (("output: build", "output: made"), ["a", "b", "c", "d"]),
        (("# nothing", "# something"), []),
    ],
)
def test_an_edited_setting_builds_what_it_is_for(
    tmp_path: Path, change: tuple[str, str], stale: list[str]
) -> None:
    manifest = (
        "output: build  # nothing\ntrees:\n"
        "  a: {domain: lamp.pddl, problem: light.pddl, target: 0.5}\n"
        "  b: {domain: coin.pddl, target: 0.75, strategy: refine, expect: [success >= 0.5]}\n"
        "  c: {domain: coin.pddl, target: 0.75, strategy: policy, max-actions: 3}\n"
        "  d:\n    domain: lamp.pddl\n    problem: light.pddl\n"
        "    exports:\n      dot: {options: {legend: true}}\n      svg: x.svg\n"
    )
    sources = {"lamp_pddl": LAMP, "other_pddl": LAMP, "light_pddl": LIGHT, "coin_pddl": COIN}
    folder = project(tmp_path, manifest, **sources)
    assert len(built(run(folder))) == 4
    assert change[0] in manifest
    (folder / "bbtc.yaml").write_text(manifest.replace(*change, 1))
    assert built(run(folder)) == stale
    assert built(run(folder)) == []


def test_a_new_export_is_made_of_the_tree_there_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = several(tmp_path, 2)
    run(folder)
    manifest = folder / "bbtc.yaml"
    manifest.write_text(manifest.read_text().replace("[dot]", "[dot, btcpp]"))
    monkeypatch.setattr(pipeline, "plan_task", lambda *_: pytest.fail("planned again"))
    assert built(run(folder)) == ["t0", "t1"]
    assert (folder / "build/t1.xml").exists()


@pytest.mark.parametrize("harm", ["edit", "delete"])
def test_an_artefact_that_was_touched_is_made_again(tmp_path: Path, harm: str) -> None:
    folder = several(tmp_path, 2)
    run(folder)
    for file in ("build/t1.dot", "build/t0.tree.json"):
        before = (folder / file).read_bytes()
        (folder / file).unlink() if harm == "delete" else (folder / file).write_text("mine\n")
        assert built(run(folder)) == [Path(file).name.partition(".")[0]]
        assert (folder / file).read_bytes() == before


def test_another_version_builds_everything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = several(tmp_path, 3)
    run(folder)
    monkeypatch.setattr(runner, "tool_version", lambda: "another")
    assert len(built(run(folder))) == 3
    assert built(run(folder)) == []


def test_force_builds_what_is_up_to_date(tmp_path: Path) -> None:
    folder = several(tmp_path, 3)
    run(folder)
    assert built(run(folder, "t1", force=True)) == ["t1"]
    assert len(built(run(folder, force=True))) == 3


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "{}", '{"format": "bbtc-build", "version": 1}', "\x00", "[" * 99999]
)
def test_a_broken_state_is_no_harm(tmp_path: Path, text: str) -> None:
    folder = several(tmp_path, 2)
    run(folder)
    (folder / ".bbtc/state.json").write_text(text)
    assert len(built(run(folder))) == 2
    assert built(run(folder)) == []


def test_only_the_trees_named_are_built(tmp_path: Path) -> None:
    folder = several(tmp_path, 4)
    assert outcomes(run(folder, "t2", "t0")) == {"t0": "built", "t2": "built"}
    assert built(run(folder)) == ["t1", "t3"]
    manifest = folder / "bbtc.yaml"
    manifest.write_text(manifest.read_text().replace("0.75", "0.5"))
    assert built(run(folder, "t1")) == ["t1"]
    assert built(run(folder)) == ["t0", "t2", "t3"], "what the first build left out is still out of date"
    done = bbtc(folder, "build", "t22")
    assert done.returncode == 1
    assert "did you mean 't2'?" in done.stderr


# --- what fails ------------------------------------------------------------------------------

FAILING = {
    "syntax": ("{domain: broken.pddl}", 1, "BBT0102"),
    "missing file": ("{domain: gone.pddl}", 1, "BBT0001"),
    "folder": ("{domain: .}", 1, "BBT0001"),
    "out of reach": ("{domain: oneshot.pddl, target: 0.9}", 1, "BBT1004"),
    "expectation": ("{domain: coin.pddl, target: 0.5, expect: [cost > 100]}", 1, "BBT1005"),
    "limit": ("{domain: coin.pddl, limits: {ground-actions: 0}}", 3, "BBT0007"),
    "options": ("{domain: coin.pddl, strategy: refine, max-actions: 2}", 1, "BBT0503"),
    "file in the way": ("{domain: coin.pddl, target: 0.5, tree: coin.pddl/x.json}", 1, "BBT0004"),
}
ONESHOT = """(define (domain oneshot) (:predicates (done) (left))
  (:action try :precondition (and (not (done)) (left))
    :effect (probabilistic 1/2 (and (done) (not (left))) 1/2 (not (left)))))
(define (problem once) (:domain oneshot) (:init (left)) (:goal (done)))
"""


@pytest.mark.parametrize(
    ("names", "jobs"),
    [*(([name], jobs) for name in FAILING for jobs in ("1", "2")[: amount(1, 2)]), ([*FAILING], "2")],
    ids=lambda value: value if isinstance(value, str) else "+".join(value),
)
def test_a_failure_loses_no_other_tree_and_writes_nothing(
    tmp_path: Path, names: list[str], jobs: str
) -> None:
    """By itself, and all of them at once."""
    bad = "".join(f"  bad{number}: {FAILING[name][0]}\n" for number, name in enumerate(names))
    good = "  good: {domain: coin.pddl, target: 0.5}\n  too: {domain: coin.pddl, target: 0.75}\n"
    folder = project(
        tmp_path,
        f"trees:\n{bad}{good}",
        coin_pddl=COIN,
        broken_pddl="(define (domain d)\n",
        oneshot_pddl=ONESHOT,
    )
    done = bbtc(folder, "build", "-j", jobs)
    status = min(FAILING[name][1] for name in names)
    assert done.returncode == status, done.stderr
    for name in names:
        assert f"[{FAILING[name][2]}]" in done.stderr
    assert "Traceback" not in done.stderr
    trees, failed = len(names) + 2, len(names)
    assert f"{trees} trees: 2 built, 0 up to date, {failed} failed" in done.stderr
    assert sorted(path.name for path in (folder / "build").iterdir()) == ["good.tree.json", "too.tree.json"]
    again = bbtc(folder, "build", "-j", jobs)
    assert again.returncode == status
    assert f"{trees} trees: 0 built, 2 up to date, {failed} failed" in again.stderr


@pytest.mark.parametrize(
    ("manifest", "place"),
    [
        ("trees:\n  a:\n    domain: coin.pddl\n    problem: gone.pddl\n", "bbtc.yaml:4:14: "),
        ("defaults:\n  domain: gone.pddl\ntrees:\n  a:\n    problem: coin.pddl\n", "bbtc.yaml:2:11: "),
    ],
)
def test_a_missing_file_is_shown_where_the_manifest_names_it(
    tmp_path: Path, manifest: str, place: str
) -> None:
    done = bbtc(project(tmp_path, manifest, coin_pddl=COIN), "build")
    assert f"{place}error[BBT0001]: cannot read gone.pddl" in done.stderr


def test_the_files_of_a_tree_that_fails_stay_as_they_were(tmp_path: Path) -> None:
    folder = several(tmp_path, 2, per_domain=1)
    run(folder)
    before = {file: content for file, content in snapshot(folder).items() if file.startswith("build")}
    domain = folder / "d0.pddl"
    whole = domain.read_text()
    domain.write_text(whole + ")")
    assert outcomes(run(folder)) == {"t0": "failed", "t1": "unchanged"}
    assert before.items() <= snapshot(folder).items()
    domain.write_text(whole)
    assert run(folder).ok


def test_an_unmet_expectation_shows_its_place_to_machines(tmp_path: Path) -> None:
    manifest = (
        "trees:\n  coin: {domain: coin.pddl, target: 0.5, retries: least,\n"
        "    expect: [\n      cost < 5,\n      actions < 5,\n        success > 1/2]}\n"
    )
    folder = project(tmp_path, manifest, coin_pddl=COIN)
    (found,) = json.loads(bbtc(folder, "build", "--format", "json").stderr)
    assert (found["code"], found["place"]["file"], found["place"]["startLine"]) == ("BBT1005", "bbtc.yaml", 6)
    assert found["message"] == "coin: expected success > 1/2, but success is 1/2 (0.5)"
    annotation = bbtc(folder, "build", "--format", "github").stderr
    assert annotation.startswith("::error file=bbtc.yaml,line=6,col=9,")


def test_a_bug_is_told_and_loses_no_other_tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = several(tmp_path, 3, per_domain=1)
    plan = pipeline.plan_task

    def planner(task: Any, *arguments: Any, **options: Any) -> Any:
        if task.problem == "p1":
            raise ZeroDivisionError("oops")
        return plan(task, *arguments, **options)

    monkeypatch.setattr(pipeline, "plan_task", planner)
    report = run(folder)
    assert outcomes(report) == {"t0": "built", "t1": "failed", "t2": "built"}
    (diagnostic,) = report.outcomes[1].diagnostics
    assert (diagnostic.code, report.outcomes[1].failure) == ("BBT1006", "internal")


# --- several at once -------------------------------------------------------------------------


def test_several_jobs_make_the_same_files(tmp_path: Path) -> None:
    one, two = several(tmp_path / "one", 9), several(tmp_path / "two", 9)
    assert run(one, jobs=1).ok
    assert run(two, jobs=2).ok
    contents = [{file: content for file, (content, _) in snapshot(folder).items()} for folder in (one, two)]
    assert contents[0] == contents[1]
    assert built(run(two)) == []


class Deadly:
    """Kills the process that unpickles it."""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[int]]:
        return os._exit, (3,)


def test_a_process_that_dies_costs_its_job_only() -> None:
    entry = TreeEntry("x", ("c.pddl",), "x.json")
    good = Job(entry, (("c.pddl", COIN.replace("1/2", "1").encode()),), None, False, ())
    jobs = [replace(good, entry=replace(entry, name=str(number))) for number in range(6)]
    jobs[2] = replace(jobs[2], sources=(Deadly(),))  # type: ignore[arg-type]
    made = {each.name: each for each in pool.do_all(jobs, 2)}
    assert {name for name, each in made.items() if each.failure is not None} == {"2"}
    assert "ended with status 3" in made["2"].diagnostics[0].message
    assert len(made) == 6


def test_two_builds_of_one_project_do_not_meet(tmp_path: Path) -> None:
    folder = several(tmp_path, 8)
    command = [sys.executable, "-m", "bbtc.cli.main", "build", "-j", "1"]
    both = [
        subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True, env=environment())
        for _ in range(2)
    ]
    told = [process.communicate(timeout=120)[1] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert sorted(re.findall(r"(\d) built, (\d) up to date", "".join(told))) == [("0", "8"), ("8", "0")]


# --- check -----------------------------------------------------------------------------------


def test_check_writes_nothing_and_finds_drift(tmp_path: Path) -> None:
    folder = several(tmp_path, 3, per_domain=1)
    fresh = bbtc(folder, "build", "--check")
    assert (fresh.returncode, (folder / ".bbtc").exists(), (folder / "build").exists()) == (1, False, False)
    assert "build/t0.dot does not exist" in fresh.stderr
    run(folder)
    assert bbtc(folder, "build", "--check").returncode == 0
    for keeps_state in (True, False):
        if not keeps_state:  # as in a fresh clone
            (folder / ".bbtc/state.json").unlink()
        file = folder / "build/t1.dot"
        text = file.read_text()
        file.write_text(text.replace("digraph", "graph"))
        before = snapshot(folder)
        drifted = bbtc(folder, "build", "--check")
        assert drifted.returncode == 1
        assert "-graph" in drifted.stderr
        assert "+digraph" in drifted.stderr
        assert "1 failed" in drifted.stderr
        assert snapshot(folder) == before
        file.write_text(text)
        assert bbtc(folder, "build", "--check").returncode == 0


def test_check_finds_a_changed_source(tmp_path: Path) -> None:
    folder = several(tmp_path, 2, per_domain=1)
    run(folder)
    domain = folder / "d1.pddl"
    domain.write_text(domain.read_text().replace("1/2", "0.8"))
    before = snapshot(folder)
    done = bbtc(folder, "build", "--check")
    assert (done.returncode, snapshot(folder)) == (1, before)
    assert '+  "success_probability": "4/5"' in done.stderr
    assert "t0" not in done.stderr


# --- terminals, interruptions, watching ------------------------------------------------------


def environment() -> dict[str, str]:
    """For the commands that are started here."""
    return {**os.environ, "PYTHONPATH": str(REPOSITORY), "NO_COLOR": "1"}


def test_progress_shows_on_a_terminal_only(tmp_path: Path) -> None:
    folder = several(tmp_path, 3)
    assert "\r" not in bbtc(folder, "build").stderr
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "bbtc.cli.main", "build", "--force", "-j", "1"]
    process = subprocess.Popen(command, cwd=folder, stderr=theirs, env=environment())
    os.close(theirs)
    shown = b""
    try:
        while chunk := os.read(ours, 65536):
            shown += chunk
    except OSError:  # the other end is closed
        pass
    os.close(ours)
    assert process.wait(timeout=60) == 0
    assert b"] 2/3 t1" in shown
    assert b"3 trees: 3 built" in shown


def started(folder: Path, *arguments: str, mark: str = "") -> subprocess.Popen[str]:
    """The command, running, in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "bbtc.cli.main", "build", *arguments],
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**environment(), "BBTC_TEST_MARK": mark},
    )


def wait_until(holds: Callable[[], bool], seconds: float = 60) -> None:
    """Wait; fail if it takes too long."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)


COINS = range(60)
SLOW = (
    f"(define (domain slow) (:predicates {' '.join(f'(heads{i}) (tails{i})' for i in COINS)})"
    + "".join(
        f"(:action toss{i} :precondition (not (or (heads{i}) (tails{i})))"
        f" :effect (probabilistic 1/2 (heads{i}) 1/2 (tails{i})))"
        for i in COINS
    )
    + ")"
)
"""How each coin fell is remembered: every policy leads to more states than can be explored."""


def slow_project(folder: Path) -> Path:
    """A project with a quick tree, and one that takes for ever."""
    goal = " ".join(f"(or (heads{i}) (tails{i}))" for i in COINS)
    problem = f"(define (problem long) (:domain slow) (:init) (:goal (and {goal})))"
    manifest = (
        "trees:\n  quick: {domain: coin.pddl, target: 0.5}\n"
        "  slow: {domain: slow.pddl, problem: long.pddl, strategy: policy}\n"
    )
    return project(folder, manifest, coin_pddl=COIN, slow_pddl=SLOW, long_pddl=problem)


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_keeps_what_was_built(tmp_path: Path, jobs: str, request: pytest.FixtureRequest) -> None:
    folder = slow_project(tmp_path)
    process = started(folder, "-j", jobs)
    request.addfinalizer(process.kill)
    wait_until((folder / "build/quick.tree.json").exists)
    time.sleep(0.5)
    os.killpg(process.pid, signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130, told
    assert "Traceback" not in told
    assert not (folder / "build/slow.tree.json").exists()
    assert outcomes(run(folder, "quick")) == {"quick": "unchanged"}


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs /proc to see processes")
def test_a_killed_build_leaves_no_process_behind(tmp_path: Path) -> None:
    folder = slow_project(tmp_path)
    mark = f"{os.getpid()}-{tmp_path.name}"

    def alive() -> list[str]:
        found = []
        for file in Path("/proc").glob("[0-9]*/environ"):
            try:
                if f"BBTC_TEST_MARK={mark}".encode() in file.read_bytes():
                    found.append(file.parent.name)
            except OSError:
                pass
        return found

    process = started(folder, "-j", "2", mark=mark)
    wait_until((folder / "build/quick.tree.json").exists)
    assert len(alive()) >= 2
    process.kill()
    process.communicate(timeout=60)
    wait_until(lambda: not alive())


def test_watch_builds_again_after_a_change(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    folder = several(tmp_path, 1)
    process = started(folder, "--watch", "-j", "1")
    request.addfinalizer(process.kill)
    tree = folder / "build/t0.tree.json"
    wait_until(tree.exists)
    assert process.stderr is not None
    while "waiting" not in process.stderr.readline():
        pass
    domain = folder / "d0.pddl"
    whole = domain.read_text()
    for text, shown in [(whole + ")", "BBT0103"), (whole.replace("1/2", "4/5"), "success 4/5")]:
        domain.write_text(text)
        lines: list[str] = []
        while not lines or "waiting" not in lines[-1]:
            lines.append(process.stderr.readline())
            assert lines[-1], lines
        assert shown in "".join(lines)
    assert '"success_probability": "4/5"' in tree.read_text()
    os.killpg(process.pid, signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130


def test_the_state_names_what_a_build_depends_on(tmp_path: Path) -> None:
    folder = several(tmp_path, 1)
    run(folder)
    steps = state.load_state(folder).trees["t0"]
    assert set(steps["tree"].inputs) == {"d0.pddl", "p0.pddl"}
    assert set(steps["export:dot"].inputs) == {"build/t0.tree.json"}
    assert (folder / ".bbtc/.gitignore").read_text() == "*\n"
