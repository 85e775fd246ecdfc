"""What exports hold where facts are hidden: a simulated world with what is true, a monitor, a robot that
tells it its readings. The tests that compile skip where CMake finds no BehaviorTree.CPP."""

from __future__ import annotations

import random
import re
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import pytest

import bbtc
from bbtc.backends.exporter import Begun
from bbtc.limits import Limits
from bbtc.pipeline import export_tree, with_monitor
from bbtc.replay.engines import exported_module
from bbtc.tree.nodes import Tree
from tests.backends.test_btcpp_project import (
    STUBS,
    assert_succeeds_as_often,
    built,
    files,
    ran,
    ros_package,
)
from tests.belief.hidden_tasks import search, tiger
from tests.replay.compiled import library_prefix, require_library

ACCURACY = Fraction(17, 20)
HALF = Fraction(1, 2)


def exported(tree: Tree) -> Tree:
    watched = with_monitor(tree, Limits())
    assert watched is not None
    return watched


@pytest.fixture(scope="module")
def listener() -> Tree:
    """Listens until one side is ahead by two, then opens a door: right with 0.96980."""
    return bbtc.plan(tiger(ACCURACY, Fraction(96, 100)), target=HALF).tree


def test_runs_in_the_simulated_world_end_as_often_as_computed(listener: Tree) -> None:
    pytest.importorskip("py_trees")
    module = exported_module(exported(listener))
    generator, successes, runs = random.Random(1), 0, 1500
    tables = {"priors": module.PRIORS, "tellings": module.TELLINGS, "parts": module.MONITOR}
    for _ in range(runs):
        lines: list[str] = []
        world = module.SimulatedWorld(module.INITIAL, module.ACTIONS, generator, lines.append, **tables)
        successes += module.run(module.create_root(world)).value == "SUCCESS"
        assert world.monitor.outside == ""
        assert re.fullmatch(r"the truth: (really tiger\(left\)|nothing)", lines[0])
    success = listener.success_probability
    deviation = float(runs * success * (1 - success)) ** 0.5
    assert abs(successes - float(runs * success)) <= 5 * deviation


def test_a_begun_robot_runs_and_says_what_it_did_not_tell(listener: Tree, tmp_path: Path) -> None:
    pytest.importorskip("py_trees")
    for form, name, options in (
        ("py_trees", "listening", dict[str, str]()),
        ("py_trees_robot", "robot", {"module": "listening"}),
    ):
        text = export_tree(listener, form, options, Limits())
        assert isinstance(text, str)
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    robot = (tmp_path / "robot.py").read_text(encoding="utf-8")
    assert '# self.monitor.told("listen", readings={"tiger(left)": True})' in robot
    assert '# self.monitor.told("open", "left")\n' in robot
    assert "def tiger" not in robot  # the monitor answers that
    done = subprocess.run(
        [sys.executable, "robot.py"], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.splitlines()[-1] == "outside the model: listen() told nothing"


def test_the_program_in_cpp_ends_as_often_as_computed(listener: Tree, tmp_path: Path) -> None:
    build = built(tmp_path, exported(listener))
    for ticks in ("1", "3"):
        assert_succeeds_as_often(build / "simulate", listener.success_probability, "--ticks", ticks)
    said = ran(build / "simulate", "--seed", "1")
    assert said.startswith("the truth:")
    assert "told: tiger(left) " in said
    assert "outside the model: Listen() told nothing" in ran(build / "main")


@pytest.mark.parametrize("leaves", ["ros2-actions", "ros2-services"])
def test_the_flavours_for_ros_with_a_monitor_are_valid_cpp(leaves: str, tmp_path: Path) -> None:
    require_library()
    folder = ros_package(tmp_path, exported(bbtc.plan(search(3), target=1).tree), leaves)
    kind = "action" if leaves == "ros2-actions" else "srv"
    assert "Reading[] readings" in (folder / kind / f"Look.{kind}").read_text(encoding="utf-8")
    assert "Reading[] readings" not in (folder / kind / f"Take.{kind}").read_text(encoding="utf-8")
    flags = ["-std=c++17", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", '-DTREE_FILE="x"']
    flags += [f"-I{folder}", f"-I{STUBS}", *(f"-isystem{path}/include" for path in library_prefix())]
    flags += ["-DLATER_ROS_NODE_PARAMS"] if leaves == "ros2-services" else []
    done = subprocess.run(
        ["c++", *flags, "main.cpp"],
        cwd=folder, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_the_files_of_the_monitor_are_made_anew_and_the_robot_is_left_alone() -> None:
    watched = exported(bbtc.plan(search(3), target=1).tree)
    ros = files(watched, leaves="ros2-actions")
    assert not isinstance(ros["monitor_table.hpp"], Begun)
    assert isinstance(ros["leaves.hpp"], Begun)
    assert files(watched) == files(watched)
