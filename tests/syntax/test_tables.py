"""The tables beside the grammar are those of the grammar."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from bbtc.syntax import tables as made
from bbtc.syntax.tables import START, dumped, grammar_text, make_tables, tables


def test_the_tables_are_in_step_with_the_grammar(repository: Path) -> None:
    text = (repository / "grammar" / "bbtc.tables.json").read_text("utf-8")
    assert text == dumped(grammar_text()), "run `python -m bbtc.syntax.tables`"


def test_what_is_read_is_what_would_be_computed() -> None:
    assert tables() == make_tables(grammar_text(), START)


@pytest.mark.parametrize("seed", ["1", "2"])
def test_the_tables_do_not_hang_on_the_order_of_sets(repository: Path, seed: str) -> None:
    code = "from bbtc.syntax.tables import *; print(dumped(grammar_text()), end='')"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=repository,
        env={**os.environ, "PYTHONHASHSEED": seed},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == (repository / "grammar" / "bbtc.tables.json").read_text("utf-8")


def test_tables_of_another_grammar_are_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    other = grammar_text().replace("DIRECTION operand CLOSE", "operand DIRECTION CLOSE")
    assert other != grammar_text()
    monkeypatch.setattr(made, "grammar_text", lambda: other)
    assert tables() == make_tables(other, START)


def test_a_run_does_without_lark(repository: Path) -> None:
    code = (
        "import sys; sys.modules['lark'] = None\n"
        "from bbtc.cli.main import main\n"
        "sys.argv = ['bbtc', 'check', 'domains/household/domain.pddl']; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=repository, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
