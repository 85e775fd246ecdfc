"""The recipes of docs/build-systems.md, run by the real tools."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.builder.projects import COIN
from tests.integration.tools import REPOSITORY, edit, program, recipe, run, runs, tool
from tests.long_form import LONG

PAGE = (REPOSITORY / "docs" / "build-systems.md").read_text("utf-8")
DOMAIN, _, PROBLEM = COIN.partition("(define (problem")


@pytest.fixture
def source(tmp_path: Path) -> Path:
    folder = tmp_path / "source"
    folder.mkdir()
    (folder / "domain.pddl").write_text(DOMAIN)
    for name in ("soda", "fridge"):
        (folder / f"{name}.pddl").write_text(
            f"(define (problem{PROBLEM}".replace("(:goal (heads))", "(:goal (heads)) (:goal-probability 0.5)")
        )
    return folder


def test_the_makefile_builds_what_is_out_of_date(source: Path) -> None:
    make = tool("make")
    (source / "Makefile").write_text(recipe("makefile"))
    path = program(source.parent).parent

    def build() -> list[str]:
        run(make, cwd=source, path=path)
        return sorted(runs(source.parent))

    assert build() == ["export", "export", "plan", "plan"]
    assert (source / "soda.xml").exists()
    assert build() == []
    edit(source / "fridge.pddl", "0.5", "0.75")
    assert build() == ["export", "plan"]
    assert build() == []
    edit(source / "domain.pddl", "(define", "; comment\n(define")
    assert build() == ["export", "export", "plan", "plan"]
    assert build() == []


def test_the_ninja_file_builds_what_is_out_of_date(source: Path) -> None:
    ninja = tool("ninja")
    (source / "build.ninja").write_text(recipe("ninja"))
    path = program(source.parent).parent

    def build() -> list[str]:
        run(ninja, cwd=source, path=path)
        return sorted(runs(source.parent))

    assert build() == ["export", "export", "plan", "plan"]
    assert build() == []
    edit(source / "fridge.pddl", "0.5", "0.75")
    assert build() == ["export", "plan"]
    assert build() == []
    edit(source / "domain.pddl", "(define", "; comment\n(define")
    assert build() == ["plan", "plan"], "the trees are the same: nothing to export"
    assert build() == []


# --- GitHub ----------------------------------------------------------------------------------


def steps() -> list[str]:
    """The commands of the workflow that run bbtc."""
    workflow: dict[str, Any] = yaml.safe_load(recipe("workflow"))
    (job,) = workflow["jobs"].values()
    return [step["run"] for step in job["steps"] if step.get("run", "").startswith("bbtc ")]


def test_the_workflow_annotates_what_is_wrong(source: Path) -> None:
    path = program(source.parent).parent
    (source / "bbtc.yaml").write_text("trees: {soda: {domain: domain.pddl, problem: soda.pddl}}\n")
    run("bbtc", "build", cwd=source, path=path)
    check, drift = steps()
    run("sh", "-c", check, cwd=source, path=path)
    assert "::error" not in run("sh", "-c", drift, cwd=source, path=path)
    edit(source / "domain.pddl", "1/2", "3/4")
    drifted = run("sh", "-c", drift, cwd=source, path=path, status=1)
    assert re.search(r"^::error title=BBT0008 [^:]*::build/soda.tree.json differs", drifted, re.MULTILINE)
    edit(source / "domain.pddl", "3/4", "7/4")
    found = run("sh", "-c", check, cwd=source, path=path, status=1)
    assert re.search(r"^::error file=domain.pddl,line=\d+,col=\d+,endLine=\d+,", found, re.MULTILINE)


# --- pre-commit ------------------------------------------------------------------------------


def git(folder: Path, *arguments: str) -> str:
    """Run git as somebody."""
    who = ["-c", "user.name=tests", "-c", "user.email=tests@example.org", "-c", "commit.gpgsign=false"]
    return run(tool("git"), *who, *arguments, cwd=folder)


# pip need not compile all modules of what it installs, most of which are never loaded. In the short form it
# installs bbtc alone, and finds here what bbtc needs, and what builds it.
INSTALL = {"PIP_NO_COMPILE": "1"}
if not LONG:
    here = {
        "PYTHONPATH": sysconfig.get_path("purelib"),
        "PIP_NO_DEPS": "1",
        "PIP_NO_BUILD_ISOLATION": "false",
    }
    INSTALL |= here | {"PIP_NO_INDEX": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}


@pytest.fixture(scope="module")
def hooks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A git repository with what the hooks are installed from."""
    tool("git"), tool("pre-commit")
    folder = tmp_path_factory.mktemp("hooks")
    ignored = shutil.ignore_patterns("__pycache__", ".*_cache")
    for name in ("bbtc", "grammar", "docs/errors"):
        shutil.copytree(REPOSITORY / name, folder / name, ignore=ignored)
    for name in ("pyproject.toml", "README.md", "LICENSE", ".pre-commit-hooks.yaml"):
        shutil.copy(REPOSITORY / name, folder / name)
    git(folder, "init", "-q")
    git(folder, "add", "-A")
    git(folder, "commit", "-q", "-m", "hooks")
    return folder


def test_the_hooks_check_format_and_find_drift(
    hooks: Path, source: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    home = tmp_path_factory.mktemp("pre-commit-home")
    config = yaml.safe_load(recipe("pre-commit"))
    (entry,) = config["repos"]
    entry |= {"repo": f"file://{hooks}", "rev": git(hooks, "rev-parse", "HEAD").strip()}
    (source / ".pre-commit-config.yaml").write_text(yaml.safe_dump(config))
    manifest = "output: trees\ntrees: {soda: {domain: domain.pddl, problem: soda.pddl}}\n"
    (source / "bbtc.yaml").write_text(manifest)
    if not LONG:
        pytest.importorskip("hatchling", reason="hatchling is not installed")
    path = program(source.parent).parent
    run("bbtc", "fmt", *sorted(file.name for file in source.glob("*.pddl")), cwd=source, path=path)
    run("bbtc", "build", cwd=source, path=path)
    git(source, "init", "-q")
    git(source, "add", "-A")

    def hook(status: int, name: str = "") -> str:
        done = subprocess.run(
            [tool("pre-commit"), "run", "--all-files", "--color", "never", *([name] if name else [])],
            cwd=source,
            env={**os.environ, **INSTALL, "PRE_COMMIT_HOME": str(home)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=600,
            check=False,
        )
        told = done.stdout
        if "An unexpected error has occurred" in told and "pip" in told:
            pytest.skip("the hooks cannot be installed: no package index")
        assert done.returncode == status, told
        return told

    assert len(re.findall(r"\.Passed$", hook(0), re.MULTILINE)) == 3
    edit(source / "soda.pddl", "(:domain", "   (:domain")
    assert "files were modified by this hook" in hook(1, "bbtc-fmt")
    hook(0, "bbtc-fmt")
    edit(source / "domain.pddl", "1/2", "3/4")
    assert '+            "p": "0.75"' in hook(1, "bbtc-drift")
    edit(source / "domain.pddl", "3/4", "7/4")
    assert "BBT0210" in hook(1, "bbtc-check")
