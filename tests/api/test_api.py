"""The Python functions do what the commands do."""

from __future__ import annotations

import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

import bbtc
from bbtc.tree.nodes import walk
from tests.domains.problems import bbtc as command

HOUSEHOLD = Path(__file__).parents[2] / "domains" / "household"
DOMAIN, PROBLEM = HOUSEHOLD / "domain.pddl", HOUSEHOLD / "look-for-soda.pddl"
FILES = "domains/household/domain.pddl", "domains/household/look-for-soda.pddl"


def fresh_python(code: str) -> str:
    """What a new interpreter prints."""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60, cwd=HOUSEHOLD
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_each_stage_gives_what_its_command_writes() -> None:
    task = bbtc.compile(DOMAIN, PROBLEM)
    assert bbtc.dumps(task).encode() == command("compile", *FILES).out
    plan = bbtc.plan(task, target="0.9")
    written = command("plan", *FILES, "--target", "0.9").out
    assert bbtc.dumps(plan).encode() == written
    for form in ("btcpp", "py_trees", "dot"):
        exported = bbtc.export(plan, form)
        assert isinstance(exported, str)
        assert exported.encode() == command("export", "-", "--to", form, stdin=written).out


def test_a_stage_takes_files_and_the_results_of_the_stages_before_it(tmp_path: Path) -> None:
    model = bbtc.load(DOMAIN, PROBLEM)
    task = bbtc.compile(model)
    compiled = tmp_path / "task.json"
    compiled.write_text(bbtc.dumps(task))
    trees = [
        bbtc.dumps(bbtc.plan(*each)) for each in [(DOMAIN, str(PROBLEM)), (model,), (task,), (compiled,)]
    ]
    assert set(trees) == {trees[0]}
    saved = tmp_path / "tree.json"
    saved.write_text(trees[0])
    plan = bbtc.plan(task)
    assert bbtc.simulate(saved) == bbtc.simulate(bbtc.load_tree(saved)) == bbtc.simulate(plan) == plan.figures
    assert bbtc.export(saved, "btcpp") == bbtc.export(plan.tree, "btcpp")


def test_a_text_needs_no_file() -> None:
    both = bbtc.SourceFile("both", DOMAIN.read_text() + PROBLEM.read_text())
    assert bbtc.plan(both).tree == bbtc.plan(DOMAIN, PROBLEM).tree


@pytest.mark.parametrize("target", [0.8, "0.8", "4/5", "80%", Fraction(4, 5)])
def test_a_target_is_exact_however_it_is_written(target: float | str | Fraction) -> None:
    tree = bbtc.plan(DOMAIN, PROBLEM, target=target, strategy="refine").tree
    assert (tree.target, tree.success_probability) == (Fraction(4, 5), Fraction(7, 8))


@pytest.mark.parametrize("target", ["much", 1.5, -0.1, "1e999999999", float("nan")])
def test_a_target_that_is_no_probability_is_refused(target: float | str) -> None:
    with pytest.raises(ValueError, match=r"probability|between"):
        bbtc.plan(DOMAIN, PROBLEM, target=target)


def test_errors_carry_every_diagnostic(tmp_path: Path) -> None:
    broken = tmp_path / "broken.pddl"
    text = DOMAIN.read_text().replace("0.95 (at", "1.2 (at").replace("0.5 (not (seen", "0.6 (not (seen")
    broken.write_text(text)
    with pytest.raises(bbtc.BbtcError) as error:
        bbtc.load(broken, PROBLEM)
    assert [d.code for d in error.value.diagnostics] == ["BBT0210", "BBT0211"]
    assert [d.code for d in bbtc.check(broken)] == ["BBT0210", "BBT0211"]


def test_doubts_go_to_the_report_and_stop_nothing() -> None:
    source = bbtc.SourceFile(
        "d",
        "(define (domain d) (:predicates (a) (idle)) (:action make :effect (a)))"
        "(define (problem p) (:domain d) (:goal (a)))",
    )
    report = bbtc.Report()
    assert bbtc.plan(source, report=report).tree.success_probability == 1
    assert [d.code for d in report] == ["BBT0301"]


def test_a_limit_gives_the_best_tree() -> None:
    plan = bbtc.plan(DOMAIN, PROBLEM, strategy="refine", limits=bbtc.Limits(nodes=26))
    assert (plan.tree.status, plan.tree.success_probability) == ("limit-reached", Fraction(7, 8))


def test_progress_hears_every_refinement() -> None:
    heard: list[object] = []
    assert tuple(heard) == ()
    plan = bbtc.plan(DOMAIN, PROBLEM, strategy="refine", progress=heard.append)
    assert heard
    assert tuple(heard) == plan.refinements


def test_strategies_and_bounds() -> None:
    plan = bbtc.plan(DOMAIN, PROBLEM, strategy="policy", max_actions=3, target=0.5)
    assert plan.tree.success_probability == Fraction(1, 2)
    assert bbtc.bounds(DOMAIN, PROBLEM, max_actions=3).upper == Fraction(1, 2)
    with pytest.raises(bbtc.BbtcError, match="BBT0501"):
        bbtc.plan(DOMAIN, PROBLEM, strategy="luck")


def test_options_of_an_export_are_typed() -> None:
    plan = bbtc.plan(DOMAIN, PROBLEM)
    assert bbtc.export(plan, "dot", legend=True) == bbtc.export(plan, "dot", legend="yes")
    assert bbtc.export(plan, "dot", legend=True) != bbtc.export(plan, "dot")
    with pytest.raises(bbtc.BbtcError, match="BBT0704"):
        bbtc.export(plan, "dot", no_such_option=1)


def test_the_runs_are_those_of_the_simulation() -> None:
    plan = bbtc.plan(DOMAIN, PROBLEM, strategy="refine")
    runs = bbtc.scenarios(plan, 1000)
    assert sum(run.probability for run in runs) == 1
    assert bbtc.scenarios(plan, 2) == runs[:2]


def test_an_exported_tree_is_read_back(tmp_path: Path) -> None:
    plan = bbtc.plan(DOMAIN, PROBLEM)
    file = tmp_path / "tree.xml"
    xml = bbtc.export(plan, "btcpp")
    assert isinstance(xml, str)
    file.write_text(xml)
    assert bbtc.simulate(bbtc.import_tree(file, DOMAIN, PROBLEM)).success == plan.figures.success


def test_a_run_goes_where_it_is_told_and_back() -> None:
    plan = bbtc.plan(DOMAIN, PROBLEM, target=0.5, strategy="refine")
    run = bbtc.run(plan, seed=3)
    while not run.finished:
        run.step(0)
    assert (run.now.status.word, run.now.state.values) != ("running", run.moments[0].state.values)
    ends = run.moments
    assert run.back()
    assert run.now == ends[len(run.moments) - 1]
    drawn = [bbtc.run(plan, seed=seed) for seed in (3, 3, *range(20))]
    for each in drawn:
        while not each.finished:
            each.step()
    assert drawn[0].moments == drawn[1].moments
    statuses = {each.now.status.word for each in drawn}
    assert statuses == {"success", "failure"}


def test_a_difference_tells_what_the_command_tells(tmp_path: Path) -> None:
    old, new = (bbtc.plan(DOMAIN, PROBLEM, target=target, strategy="refine") for target in (0.5, 0.8))
    changes = bbtc.diff(old, new)
    assert changes.differs
    assert not bbtc.diff(old, old).differs
    success = next(figure for figure in changes.figures if figure.name == "success")
    assert (success.old, success.new) == (Fraction(1, 2), Fraction(7, 8))
    assert [figure.name for figure in changes.figures if figure.differs and figure.name == "target"]
    for name, plan in (("old", old), ("new", new)):
        (tmp_path / name).write_text(bbtc.dumps(plan))
    told = command("diff", str(tmp_path / "old"), str(tmp_path / "new")).out.decode()
    for figure in changes.figures:
        assert figure.name in told
    assert changes == bbtc.diff(tmp_path / "old", tmp_path / "new")


def test_a_project_is_made_once(tmp_path: Path) -> None:
    made = bbtc.init(tmp_path / "made")
    assert all(path.is_file() for path in made)
    assert bbtc.build(tmp_path / "made" / "bbtc.yaml", jobs=1).ok
    with pytest.raises(bbtc.BbtcError, match="BBT1007"):
        bbtc.init(tmp_path / "made")


def test_a_project_is_built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "both.pddl").write_text(DOMAIN.read_text() + PROBLEM.read_text())
    (tmp_path / "bbtc.yaml").write_text("trees: {soda: {domain: both.pddl, exports: [dot]}}\n")
    monkeypatch.chdir(tmp_path)
    assert [outcome.status for outcome in bbtc.build(jobs=1).outcomes] == ["built"]
    assert bbtc.build("bbtc.yaml", "soda", check=True).ok
    assert (tmp_path / "build/soda.dot").exists()


def test_wrong_kinds_of_input_are_type_errors() -> None:
    task = bbtc.compile(DOMAIN, PROBLEM)
    with pytest.raises(TypeError, match="stands alone"):
        bbtc.plan(task, PROBLEM)
    with pytest.raises(TypeError, match="no tree"):
        bbtc.dumps(3)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="give a domain"):
        bbtc.compile()


def test_a_tree_draws_itself_in_a_notebook() -> None:
    plan = bbtc.plan(DOMAIN, PROBLEM)
    picture = plan.tree._repr_svg_()
    assert picture is not None
    assert plan._repr_svg_() == picture
    root = ET.fromstring(picture)
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert len([g for g in root.iter() if g.get("data-id")]) == len(list(walk(plan.tree.root)))


# --- the package -----------------------------------------------------------------------------


def test_every_command_has_its_function() -> None:
    from bbtc.cli.group import COMMANDS

    other_names = {"fmt": "format_text", "import": "import_tree"}  # "import" is a word of the language
    assert len(COMMANDS) > 10
    for name in COMMANDS:
        assert other_names.get(name, name) in bbtc.__all__


def test_everything_named_is_there_and_documented() -> None:
    for name in bbtc.__all__:
        assert getattr(bbtc, name) is not None, name
        assert getattr(bbtc, name).__doc__ or name == "__version__", name
    assert set(bbtc.__all__) <= set(dir(bbtc))
    with pytest.raises(AttributeError, match="no_such_thing"):
        bbtc.no_such_thing  # type: ignore[attr-defined]  # noqa: B018


def test_importing_the_package_imports_no_stage() -> None:
    code = (
        "import bbtc, sys; print([m for m in sys.modules if m.startswith('bbtc.')], 'click' in sys.modules)"
    )
    assert fresh_python(code) == "['bbtc.version'] False\n"


@pytest.mark.parametrize(
    "before",
    [
        "",
        "import bbtc.planner.chaining.refine",
        "from bbtc.backends import registry",
        "import bbtc.cli.commands.plan",
    ],
)
def test_functions_named_like_subpackages_work_whatever_was_imported(before: str) -> None:
    code = f"""
import bbtc
{before}
plan = bbtc.plan("domain.pddl", "look-for-soda.pddl")
print(plan.tree.success_probability, len(bbtc.export(plan, "dot")) > 100)
import bbtc.planner.chaining.refine as module
from bbtc.backends.registry import BUILT_INS
print(module.__name__, "dot" in BUILT_INS)
"""
    assert fresh_python(code) == "1 True\nbbtc.planner.chaining.refine True\n"


def test_the_version_is_that_of_the_distribution() -> None:
    from importlib.metadata import version

    assert bbtc.__version__ == version("bbtc")
