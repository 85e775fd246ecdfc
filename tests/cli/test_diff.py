"""``bbtc diff``: what changed from one tree to another."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.cli.program import bbtc

GOLDEN = Path(__file__).parents[1] / "golden"
SODA = GOLDEN / "household" / "look-for-soda" / "tree.json"


def diff(old: Path, new: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return bbtc("diff", old, new, *arguments)


@pytest.fixture
def soda() -> dict[str, Any]:
    data: dict[str, Any] = json.loads(SODA.read_text())
    return data


def write(folder: Path, data: dict[str, Any]) -> Path:
    path = folder / "changed.json"
    path.write_text(json.dumps(data))
    return path


def test_a_tree_and_itself_do_not_differ() -> None:
    done = diff(SODA, SODA, "--exit-code")
    assert done.returncode == 0
    assert done.stdout.endswith("tree: the same\n")


def test_new_ids_and_reasons_are_no_difference(soda: dict[str, Any], tmp_path: Path) -> None:
    soda["root"]["id"] = "top"
    soda["root"]["children"][0]["reason"] = "of old"
    assert diff(SODA, write(tmp_path, soda), "--exit-code").returncode == 0


def test_a_branch_left_out_shows_in_the_tree_and_in_the_figures(soda: dict[str, Any], tmp_path: Path) -> None:
    soda["root"]["children"].pop()
    changed = write(tmp_path, soda)
    done = diff(SODA, changed)
    assert done.returncode == 0
    assert re.search(r"^success +31/32 \(0\.96875\) +7/8 \(0\.875\) +-0\.09375$", done.stdout, re.MULTILINE)
    assert "tree: 0 nodes added, 13 removed, 0 changed" in done.stdout
    assert re.search(r"^- └─ →$", done.stdout, re.MULTILINE)
    assert diff(SODA, changed, "--exit-code").returncode == 1


def test_another_kind_of_node_is_one_change(soda: dict[str, Any], tmp_path: Path) -> None:
    soda["root"]["children"][1]["type"] = "fallback"
    done = diff(SODA, write(tmp_path, soda))
    assert "tree: 0 nodes added, 0 removed, 1 changed" in done.stdout
    assert "- ├─ →\n+ ├─ ?\n" in done.stdout


def test_what_changed_in_the_task_is_told(soda: dict[str, Any], tmp_path: Path) -> None:
    detect = next(action for action in soda["task"]["actions"] if action["name"] == "detect(soda)")
    detect["outcomes"][0]["p"], detect["outcomes"][1]["p"] = "0.75", "0.25"
    detect["cost"] = "2"
    done = diff(SODA, write(tmp_path, soda))
    assert "task: action detect(soda) changed: cost, outcomes\n" in done.stdout
    assert "tree: the same\n" in done.stdout


def test_markdown_shows_hostile_names_as_they_are(soda: dict[str, Any], tmp_path: Path) -> None:
    hostile = "```\n</details>|`` @someone(soda)"
    text = json.dumps(soda).replace(json.dumps("seen(soda)")[1:-1], json.dumps(hostile)[1:-1])
    done = diff(SODA, write(tmp_path, json.loads(text)), "--to", "markdown")
    assert done.returncode == 0, done.stderr
    fence = re.search(r"^(`+)diff$", done.stdout, re.MULTILINE)
    assert fence is not None
    assert len(fence[1]) == 4  # longer than any run of backticks inside
    outside = re.sub(r"(?<!`)(`+)(?!`).*?(?<!`)\1(?!`)", "", done.stdout, flags=re.DOTALL)
    assert "@someone" not in outside
    assert "</details>" not in outside


def test_trees_of_other_tasks_can_be_compared() -> None:
    done = diff(SODA, GOLDEN / "charging" / "one-room" / "tree.json", "--to", "markdown")
    assert done.returncode == 0
    assert "- task: `goal changed`" in done.stdout
    assert "| success |" in done.stdout


def test_a_file_that_is_no_tree_is_refused() -> None:
    done = diff(SODA, SODA.with_name("task.json"))
    assert done.returncode == 1
    assert "error[BBT0602]" in done.stderr
