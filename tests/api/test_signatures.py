"""What people and checkers see of the functions: signatures, help, types."""

from __future__ import annotations

import inspect
import json
import os
import pkgutil
import pydoc
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import bbtc
from bbtc.backends.exporter import Files
from bbtc.backends.registry import BUILT_INS
from tests.conftest import REPOSITORY

HOUSEHOLD = REPOSITORY / "domains" / "household"
FUNCTIONS = sorted(name for name in bbtc.__all__ if inspect.isfunction(getattr(bbtc, name)))


def function(name: str) -> Callable[..., object]:
    found = getattr(bbtc, name)
    assert inspect.isfunction(found)
    return found


# --- at a prompt -----------------------------------------------------------------------------


def test_every_name_in_small_letters_is_a_function() -> None:
    assert [name for name in bbtc.__all__ if name.islower() and name != "__version__"] == FUNCTIONS


def test_no_part_of_the_package_has_the_name_of_a_function() -> None:
    parts = {module.name for module in pkgutil.iter_modules(bbtc.__path__)}
    assert "api" in parts
    assert parts & set(bbtc.__all__) == set()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_signature_names_every_parameter_and_its_type(name: str) -> None:
    signature = inspect.signature(function(name))
    assert signature.parameters
    for parameter in signature.parameters.values():
        assert parameter.annotation not in {"object", "Any", inspect.Parameter.empty}, parameter
        if parameter.kind is inspect.Parameter.VAR_KEYWORD:  # each format has options of its own
            assert (name, parameter.name) == ("export", "options")
    assert signature.return_annotation not in {"object", "Any", inspect.Signature.empty}


def test_the_signature_of_plan_has_the_options_of_the_command() -> None:
    from bbtc.cli.commands.plan import command

    parameters = inspect.signature(bbtc.plan).parameters
    options = {(option.name or "").removeprefix("reading_") for option in command.params}
    named = {each.name for each in parameters.values() if each.kind is inspect.Parameter.KEYWORD_ONLY}
    assert {"target", "strategy", "max_actions", "retries", "guarded", "problem", "lenient"} <= named
    assert named - {"limits", "report", "progress"} <= options


@pytest.mark.parametrize("name", FUNCTIONS)
def test_help_shows_the_function(name: str) -> None:
    shown = pydoc.plain(pydoc.render_doc(f"bbtc.{name}"))
    assert shown.startswith(f"Python Library Documentation: function {name} in bbtc")
    assert "PACKAGE CONTENTS" not in shown
    inner = inspect.getdoc(function(name))
    assert inner
    assert inner.splitlines()[0] in shown
    for parameter in inspect.signature(function(name)).parameters:
        assert re.search(rf"\b{parameter}\b", shown)


def test_pydoc_shows_functions_whatever_was_imported() -> None:
    code = (
        "import pydoc, bbtc.planner.auto, bbtc.backends.registry, bbtc.verifier.verdict\n"
        "import bbtc.builder.runner\n"
        "for name in ('plan', 'export', 'verify', 'build'):\n"
        "    print(pydoc.render_doc(f'bbtc.{name}').splitlines()[0])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert [line.split(":")[1].split() for line in done.stdout.splitlines()] == [
        ["function", name, "in", "bbtc"] for name in ("plan", "export", "verify", "build")
    ]


def test_exports_are_of_the_kind_that_their_overload_names() -> None:
    from typing import get_args

    from bbtc import api

    kinds = {str: api.TextFormat, bytes: api.BinaryFormat, Files: api.FolderFormat}
    assert {name for each in kinds.values() for name in get_args(each)} == set(BUILT_INS)
    tree = bbtc.plan(HOUSEHOLD / "domain.pddl", HOUSEHOLD / "look-for-soda.pddl").tree
    for kind, names in kinds.items():
        for name in get_args(names):
            assert isinstance(bbtc.export(tree, name), kind), name


# --- to type checkers ------------------------------------------------------------------------

PROGRAM = Path(__file__).with_name("typed_program.py")
MISTAKES = {
    "a text is not bytes": (
        '.write_text(bbtc.export(tree, "btcpp")',
        '.write_bytes(bbtc.export(tree, "btcpp")',
    ),
    "bytes are no text": ('write_bytes(bbtc.export(tree, "png"))', 'write_text(bbtc.export(tree, "png"))'),
    "files are no text": ('"btcpp_project").texts', '"btcpp_project").encode()'),
    "a misspelt option": ("target=target", "targit=target"),
    "a limit is no number": ("bbtc.Limits(seconds=60)", "60"),
    "no such engine": ('engine="own"', 'engine="mine"'),
    "no tree is simulated": ("bbtc.simulate(tree)", "bbtc.simulate(tree.task)"),
    "no such status": ('== "target-reached"', '== "target_reached"'),
    "nothing is missing": ("bbtc.export(tree, ", "bbtc.exports(tree, "),
}


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the program as it is and, under the name of each mistake, with that mistake."""
    folder = tmp_path_factory.mktemp("programs")
    text = PROGRAM.read_text("utf-8")
    (folder / "right.py").write_text(text, "utf-8")
    for mistake, (right, wrong) in MISTAKES.items():
        assert right in text
        (folder / f"{mistake}.py".replace(" ", "_")).write_text(text.replace(right, wrong), "utf-8")
    return folder


ALL_MISTAKES = sorted(mistake.replace(" ", "_") for mistake in MISTAKES)


def test_the_program_runs(tmp_path: Path) -> None:
    files = [HOUSEHOLD / "domain.pddl", HOUSEHOLD / "look-for-soda.pddl"]
    done = subprocess.run(
        [sys.executable, PROGRAM, *files, tmp_path], capture_output=True, text=True, check=True, timeout=120
    )
    assert done.stdout == "31/32 of at most 1, 10 steps or more, agreed\n"
    assert (tmp_path / "tree.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "project" / "CMakeLists.txt").is_file()


def test_mypy_takes_the_program_strictly_and_finds_mistakes(programs: Path) -> None:
    pytest.importorskip("mypy", reason="mypy is not installed")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--config-file", os.devnull,
         "--cache-dir", programs / "cache", *sorted(programs.glob("*.py"))],
        capture_output=True, text=True, check=False, timeout=300, cwd=programs,
    )  # fmt: skip
    assert done.returncode == 1, done.stdout + done.stderr
    assert sorted(set(re.findall(r"^(\w+)\.py:\d+: error", done.stdout, re.MULTILINE))) == ALL_MISTAKES


def test_pyright_takes_the_program_strictly_and_finds_mistakes(programs: Path) -> None:
    pytest.importorskip("pyright", reason="pyright is not installed")
    if shutil.which("node") is None:
        pytest.skip("pyright runs in Node.js, which is not installed")
    (programs / "pyrightconfig.json").write_text('{"typeCheckingMode": "strict"}')
    done = subprocess.run(
        [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable],
        capture_output=True, text=True, check=False, timeout=300, cwd=programs,
    )  # fmt: skip
    found = json.loads(done.stdout)
    assert found["summary"]["filesAnalyzed"] == len(MISTAKES) + 1
    errors = {Path(each["file"]).stem: each for each in found["generalDiagnostics"]}
    assert errors.get("right") is None
    assert sorted(errors) == ALL_MISTAKES
