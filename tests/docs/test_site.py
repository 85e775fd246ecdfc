"""The documentation site is built without a warning, and the command reference is what click says."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import click
import pytest

from bbtc.cli.group import COMMANDS, cli

REPOSITORY = Path(__file__).parents[2]
REFERENCE = REPOSITORY / "docs" / "command-reference.md"


def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    if find_spec("mkdocs") is None or find_spec("material") is None:
        pytest.skip("mkdocs-material is not installed: pip install '.[docs]'")
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "mkdocs",
            "build",
            "--strict",
            "--quiet",
            "--site-dir",
            str(tmp_path / "site"),
        ],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "site" / "errors" / "BBT0202.html").exists()
    assert (tmp_path / "site" / "index.html").exists()


# --- the reference of commands ---------------------------------------------------------------


def reference() -> str:
    """Every command and option, as click knows them."""
    parts = [
        "# All commands and options\n",
        "Made from the program itself; [commands](commands.md) tells more, with examples.\n",
        "## bbtc\n",
        _described(cli.make_context("bbtc", [], resilient_parsing=True)),
    ]
    for name in COMMANDS:
        root = cli.make_context("bbtc", [], resilient_parsing=True)
        command = cli.get_command(root, name)
        assert command is not None
        parts += [
            f"## bbtc {name}\n",
            _described(command.make_context(name, [], root, resilient_parsing=True)),
        ]
    return "\n".join(parts)


def _described(context: click.Context) -> str:
    command = context.command
    usage = " ".join(
        ["bbtc" if context.parent is None else f"bbtc {command.name}", *command.collect_usage_pieces(context)]
    )
    lines = [f"`{usage}`\n", f"{_text(command.help or '')}\n", "| option | meaning |", "|---|---|"]
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None:
            option, told = (part.replace("|", "\\|") for part in record)
            lines.append(f"| `{option}` | {' '.join(told.split())} |")
    return "\n".join(lines) + "\n"


def _text(text: str) -> str:
    """Paragraphs, without the line ends of the source."""
    return "\n\n".join(" ".join(part.split()) for part in text.split("\n\n"))


def test_the_command_reference_is_what_the_program_says(request: pytest.FixtureRequest) -> None:
    text = reference()
    if request.config.getoption("--update-golden"):
        REFERENCE.write_text(text, "utf-8")
    assert REFERENCE.read_text("utf-8") == text, "run with --update-golden, and read it"
