"""The pytest plugin, used as somebody else's repository would."""

from __future__ import annotations

from importlib.metadata import entry_points
from pathlib import Path

import pytest

from tests.builder.projects import COIN, REPOSITORY, bbtc, project

pytest_plugins = "pytester"

INSTALLED = any(point.name == "bbtc" for point in entry_points(group="pytest11"))
MANIFEST = """trees:
  coin:
    domain: coin.pddl
    target: 0.75
    retries: least
    exports: [btcpp, py_trees, dot]
    expect: [success >= 0.75, actions <= 2]
"""


PLUGIN = ("-p", "bbtc" if INSTALLED else "bbtc.pytest_plugin", "-p", "no:cacheprovider")


def collected(pytester: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    """Run pytest with the plugin, and without what this repository's tests configure, in this process, which
    has loaded both."""
    return pytester.runpytest_inprocess(*PLUGIN, *arguments)


def alone(pytester: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    """The same in a process of its own."""
    return pytester.runpytest_subprocess(*PLUGIN, *arguments)


@pytest.fixture(scope="module", autouse=True)
def _loaded(tmp_path_factory: pytest.TempPathFactory) -> None:
    """What is loaded before stays when such a run ends; NumPy cannot be loaded twice."""
    from bbtc.builder.runner import build

    made = project(tmp_path_factory.mktemp("loaded"), MANIFEST, coin_pddl=COIN)
    build(made / "bbtc.yaml", jobs=1)


@pytest.fixture
def folder(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project whose artefacts are up to date."""
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    made = project(pytester.path, MANIFEST, coin_pddl=COIN)
    assert bbtc(made, "build").returncode == 0
    return made


def test_every_tree_is_tested(pytester: pytest.Pytester, folder: Path) -> None:
    result = alone(pytester, "--bbtc", "-v")
    result.stdout.fnmatch_lines(
        [
            "bbtc.yaml::coin::figures PASSED*",
            "bbtc.yaml::coin::files PASSED*",
            "bbtc.yaml::coin::same-behaviour-btcpp *",
            "bbtc.yaml::coin::same-behaviour-py_trees PASSED*",
        ]
    )
    outcomes = result.parseoutcomes()
    assert outcomes["passed"] + outcomes.get("skipped", 0) == 4


def test_manifests_are_left_alone_unless_asked_for(pytester: pytest.Pytester, folder: Path) -> None:
    assert collected(pytester).ret == pytest.ExitCode.NO_TESTS_COLLECTED
    pytester.makeini("[pytest]\nbbtc = true\n")
    assert collected(pytester, "-k", "figures").parseoutcomes() == {"passed": 1, "deselected": 3}


def test_pyproject_toml_is_a_manifest_too(pytester: pytest.Pytester, folder: Path) -> None:
    (folder / "bbtc.yaml").unlink()
    pytester.makepyprojecttoml('[tool.bbtc.trees.coin]\ndomain = "coin.pddl"\ntarget = 0.5\n')
    result = collected(pytester, "--bbtc", "-v", "-k", "figures")
    result.stdout.fnmatch_lines(["pyproject.toml::coin::figures PASSED*"])


def test_drift_fails_with_a_diff_until_it_is_accepted(pytester: pytest.Pytester, folder: Path) -> None:
    (folder / "coin.pddl").write_text(COIN.replace("1/2", "0.8"))
    result = collected(pytester, "--bbtc", "-k", "files")
    assert result.parseoutcomes()["failed"] == 1
    result.stdout.fnmatch_lines(["*BBT0008*", '+  "success_probability": "4/5",*'])
    result.stdout.no_fnmatch_line("*Traceback*")
    assert collected(pytester, "--bbtc", "--bbtc-update", "-k", "files").ret == 0
    assert collected(pytester, "--bbtc", "-k", "files").ret == 0
    assert '"success_probability": "4/5"' in (folder / "build/coin.tree.json").read_text()


def test_figures_that_are_not_as_expected_fail(pytester: pytest.Pytester, folder: Path) -> None:
    (folder / "bbtc.yaml").write_text(MANIFEST.replace("actions <= 2", "actions < 1.5"))
    result = collected(pytester, "--bbtc", "-k", "figures")
    assert result.parseoutcomes()["failed"] == 1
    result.stdout.fnmatch_lines(["*BBT1005*expected actions < 1.5, but actions is 3/2 (1.5)"])


def test_a_domain_with_an_error_fails_with_its_place(pytester: pytest.Pytester, folder: Path) -> None:
    (folder / "coin.pddl").write_text(COIN.replace("1/2", "5/2"))
    result = collected(pytester, "--bbtc", "-k", "figures")
    result.stdout.fnmatch_lines(["*coin.pddl:4:*BBT0210*"])


def test_a_manifest_with_an_error_is_an_error_of_collection(pytester: pytest.Pytester, folder: Path) -> None:
    (folder / "bbtc.yaml").write_text("trees: {coin: {domane: x}}\n")
    result = collected(pytester, "--bbtc")
    assert result.parseoutcomes() == {"errors": 1}
    result.stdout.fnmatch_lines(["*bbtc.yaml:1:16*BBT0603*unknown field 'domane'*"])


def test_an_export_that_behaves_otherwise_fails(pytester: pytest.Pytester, folder: Path) -> None:
    pytester.makeconftest(
        """
        from dataclasses import replace
        from bbtc.replay.engines import PyTreesReplay

        run = PyTreesReplay.run
        PyTreesReplay.run = lambda *arguments: replace(run(*arguments), status="failure")
        """
    )
    result = alone(pytester, "--bbtc", "-k", "same-behaviour-py_trees")
    assert result.parseoutcomes()["failed"] == 1
    told = "run 1 (outcomes land between): expected throw(), success; py_trees did throw(), failure"
    assert told in result.outlines


def test_the_golden_fixture_compares_with_a_file(pytester: pytest.Pytester, folder: Path) -> None:
    pytester.makepyfile(
        """
        import bbtc

        def test_it(bbtc_golden):
            plan = bbtc.plan("coin.pddl", target=0.5)
            bbtc_golden("golden/coin.dot", bbtc.export(plan, "dot"))
        """
    )
    missing = collected(pytester)
    missing.stdout.fnmatch_lines(["*golden/coin.dot does not exist*", "*--bbtc-update accepts it*"])
    assert collected(pytester, "--bbtc-update").ret == 0
    assert collected(pytester).ret == 0
    (folder / "golden/coin.dot").write_text("other\n")
    collected(pytester).stdout.fnmatch_lines(["*-other*"])
