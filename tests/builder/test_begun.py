"""Files that bbtc begins and people fill in: whatever is built or exported, and whatever was lost of what the
last build noted, what somebody wrote stays. What is written runs together as it is."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bbtc.backends.begun import interface_changes
from bbtc.backends.btcpp.project import btcpp_project
from bbtc.builder.runner import build
from tests.builder.projects import REPOSITORY, bbtc, project, snapshot
from tests.strategies import soda_tree

CAN = """(define (domain can)
  (:requirements :strips)
  (:predicates (light) (seen ?item))
  (:action light_on :effect (light))
  (:action detect :parameters (?item) :precondition (light)
    :effect (seen ?item)))
(define (problem find-can) (:domain can) (:objects cola) (:goal (seen cola)))
"""
MANIFEST = """trees:
  find-it:
    domain: can.pddl
    strategy: refine
    exports:
      py_trees: robot/find_it.py
      py_trees_robot: robot/my_robot.py
"""
FILLED = 'print("looks for", item); self._beliefs.believe(True, "seen", item); return Status.SUCCESS'


def filled(text: str) -> str:
    """The robot with actions that do something."""
    for line, instead in {
        'return self._to_do("light_on")': 'self._beliefs.believe(True, "light"); return Status.SUCCESS',
        'return self._to_do("detect", item)': FILLED,
    }.items():
        assert line in text
        text = text.replace(line, instead)
    return text


def python(file: Path, cwd: Path) -> str:
    """What a program says."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, str(file)], cwd=cwd, env=environment,
        capture_output=True, text=True, check=False, timeout=30,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A project that was built, and whose robot was filled in."""
    folder = project(tmp_path, MANIFEST, can_pddl=CAN)
    assert build(folder / "bbtc.yaml", jobs=1).ok
    robot = folder / "robot/my_robot.py"
    robot.write_text(filled(robot.read_text()))
    return folder


# --- what is filled in stays -----------------------------------------------------------------


@pytest.mark.parametrize("lost", ["nothing", "state.json", "all notes", "tree"])
def test_a_build_leaves_the_robot_that_was_filled_in_alone(folder: Path, lost: str) -> None:
    before = snapshot(folder)["robot/my_robot.py"]
    for check, force in ((False, False), (False, True), (True, False), (True, True)):
        match lost:
            case "state.json":
                (folder / ".bbtc/state.json").unlink(missing_ok=True)
            case "all notes":
                shutil.rmtree(folder / ".bbtc", ignore_errors=True)
            case "tree" if not check:
                (folder / "build/find-it.tree.json").unlink()
            case _:
                pass
        report = build(folder / "bbtc.yaml", jobs=1, check=check, force=force)
        assert [(each.failure, each.diagnostics) for each in report.outcomes] == [(None, ())]
        assert snapshot(folder)["robot/my_robot.py"] == before
    names = [path.name for path in sorted((folder / "robot").glob("*"))]
    assert names == ["find_it.py", "my_robot.py"]
    assert [build(folder / "bbtc.yaml", jobs=1).count("unchanged") for _ in range(2)][1] == 1


def test_a_robot_that_was_not_touched_stays_too_when_the_domain_changes(tmp_path: Path) -> None:
    folder = project(tmp_path, MANIFEST, can_pddl=CAN)
    assert build(folder / "bbtc.yaml", jobs=1).ok
    before = (folder / "robot/my_robot.py").read_bytes()
    (folder / "can.pddl").write_text(CAN.replace("light", "lamp"))
    assert build(folder / "bbtc.yaml", jobs=1).ok
    assert (folder / "robot/my_robot.py").read_bytes() == before
    assert b"def lamp" in (folder / "robot/my_robot.py.new").read_bytes()


def test_a_robot_that_was_deleted_begins_anew(folder: Path) -> None:
    (folder / "robot/my_robot.py").unlink()
    assert not build(folder / "bbtc.yaml", jobs=1, check=True).ok
    assert build(folder / "bbtc.yaml", jobs=1).ok
    assert 'self._to_do("detect", item)' in (folder / "robot/my_robot.py").read_text()


def test_a_changed_interface_is_told_and_what_it_would_be_stands_beside(folder: Path) -> None:
    robot, beside = folder / "robot/my_robot.py", folder / "robot/my_robot.py.new"
    mine = robot.read_bytes()
    domain = CAN.replace("(seen ?item)", "(seen ?item ?place)").replace("?item)", "?item ?place)")
    domain = domain.replace("(:action light_on :effect (light))", "(:action lamp :effect (lit))")
    domain = domain.replace("(light)", "(lit)").replace("cola", "cola table")
    (folder / "can.pddl").write_text(domain)
    changes = (
        "it does not fit the tree: it lacks lit(), lamp(); other than it was is seen(item, place), "
        "detect(item, place); no longer used is light(), light_on()"
    )
    checked = bbtc(folder, "build", "--check")
    assert f"warning[BBT1012]: robot/my_robot.py is yours and stays as it is, but {changes}" in checked.stderr
    assert not beside.exists()
    done = bbtc(folder, "build", "--format", "json")
    (found,) = (each for each in json.loads(done.stderr) if each["code"] == "BBT1012")
    assert (done.returncode, found["severity"]) == (0, "warning")
    assert changes in found["message"]
    assert robot.read_bytes() == mine
    assert "def lamp(self)" in beside.read_text()
    # Taken over, with what is gone left in place: only that is told.
    robot.write_text(beside.read_text() + "\n    def own(self) -> None: ...\n")
    beside.unlink()
    done = bbtc(folder, "build", "--force")
    assert (done.returncode, "BBT1012" in done.stderr, beside.exists()) == (0, False, False)


def test_a_robot_that_is_no_python_for_now_stays_and_is_told(folder: Path) -> None:
    robot = folder / "robot/my_robot.py"
    robot.write_text("class MyRobot:\n    def detect(self,\n")
    done = bbtc(folder, "build")
    assert (done.returncode, robot.read_text()) == (0, "class MyRobot:\n    def detect(self,\n")
    assert "it cannot be read" in done.stderr


def test_an_export_leaves_the_robot_that_was_filled_in_alone(folder: Path) -> None:
    export = ["export", "build/find-it.tree.json", "--to", "py_trees_robot", "-o", "robot.py"]
    assert bbtc(folder, *export).stderr == ""
    mine = filled((folder / "robot.py").read_text())
    (folder / "robot.py").write_text(mine)
    done = bbtc(folder, *export)
    assert (done.returncode, (folder / "robot.py").read_text()) == (0, mine)
    assert "note[BBT1011]: robot.py" in done.stderr
    done = bbtc(folder, *export, "--check")
    assert (done.returncode, done.stderr) == (0, "")
    (folder / "can.pddl").write_text(CAN.replace("light", "lamp"))
    export[1:2] = ["can.pddl"]
    assert bbtc(folder, *export, "--check").returncode == 0
    assert not (folder / "robot.py.new").exists()
    done = bbtc(folder, *export)
    assert (done.returncode, (folder / "robot.py").read_text()) == (0, mine)
    assert "it lacks lamp(), lamp_on()" in done.stderr
    assert "def lamp_on" in (folder / "robot.py.new").read_text()
    (folder / "robot.py").unlink()
    assert bbtc(folder, *export, "--check").returncode == 1
    assert bbtc(folder, *export[:-2]).stdout == (folder / "robot.py.new").read_text()


def test_a_package_for_ros_is_begun_once_and_its_tree_is_made_anew(tmp_path: Path) -> None:
    ros = "exports: {ros: {format: btcpp_project, file: ros, options: {leaves: ros2-actions}}}"
    folder = project(tmp_path, f"trees: {{find-it: {{domain: can.pddl, {ros}}}}}\n", can_pddl=CAN)
    assert build(folder / "bbtc.yaml", jobs=1).ok
    mine = {}
    for name in ("leaves.hpp", "main.cpp", "package.xml", "CMakeLists.txt", "action/Detect.action"):
        mine[name] = (folder / "ros" / name).read_text() + "\n// mine\n"
        (folder / "ros" / name).write_text(mine[name])
    xml = (folder / "ros/tree.xml").read_text()
    (folder / "ros/tree.xml").write_text("edited")
    done = bbtc(folder, "build")
    assert (done.returncode, "warning" in done.stderr) == (0, False)
    assert (folder / "ros/tree.xml").read_text() == xml
    (folder / "can.pddl").write_text(CAN.replace("light_on", "lamp"))
    done = bbtc(folder, "build")
    assert done.returncode == 0
    assert "ros/leaves.hpp is yours and stays as it is" in done.stderr
    assert "it lacks Lamp(); no longer used is LightOn()" in done.stderr
    assert {name: (folder / "ros" / name).read_text() for name in mine} == mine
    assert sorted(path.name for path in folder.rglob("*.new")) == ["leaves.hpp.new"]
    assert (folder / "ros/action/Lamp.action").exists()
    assert (folder / "ros/tree.xml").read_text() != xml


# --- what is asked of a file -----------------------------------------------------------------

ROBOT = '''class MyRobot:
    def seen(self, item: str) -> bool | None:
        """Whether seen(item) holds; None where that is unknown."""
    def go(self) -> Status:
        """Start or continue go()."""
'''


@pytest.mark.parametrize(
    ("old", "changes"),
    [
        (ROBOT, []),
        (ROBOT.replace("item", "thing"), []),
        (ROBOT.replace("MyRobot", "Another"), []),
        ("class A:\n    go = seen = None\n", []),
        ("class A:\n    def seen(self, *_): ...\n    async def go(self): ...\n", []),
        ("class A(elsewhere.Base): ...\n", []),
        ("class A(Robot): ...\n", ["it lacks seen(item), which can be unknown, go()"]),
        ("class A:\n    def __getattr__(self, name): ...\n", []),
        (ROBOT.replace("; None where that is unknown", ""),
         ["other than it was is seen(item), which can be unknown"]),
        (ROBOT.replace("self, item: str", "self"), ["other than it was is seen(item), which can be unknown"]),
        (ROBOT.replace("go", "drive"), ["it lacks go()", "no longer used is drive()"]),
        ("from old import Robot\n" + ROBOT, ["it imports old, but the module of the tree is tree"]),
        ("from tree import Robot\n" + ROBOT, []),
        ("\0", ["it cannot be read, so what it offers is not known"]),
    ],
)  # fmt: skip
def test_what_a_robot_offers_is_compared_with_what_is_asked(old: str, changes: list[str]) -> None:
    new = "from tree import Robot, create_root, run\n" + ROBOT
    assert interface_changes("robot.py", old.encode(), new.encode()) == changes
    assert interface_changes("README.md", old.encode(), new.encode()) == []


def test_leaves_for_ros_that_were_adapted_fit_until_a_node_is_missing() -> None:
    leaves = btcpp_project.export(soda_tree(), {"leaves": "ros2-actions"}, None).texts["leaves.hpp"]
    adapted = leaves.replace("request.arg =", "request.target =").replace("action::Detect", "action::Find")
    assert interface_changes("leaves.hpp", adapted.encode(), leaves.encode()) == []
    for old, new, changes in (
        ('>("Seen"', '>("Sees"', ["it lacks Seen(arg)", "no longer used is Sees(arg)"]),
        ('InputPort<std::string>("arg"', 'InputPort<std::string>("x"',
         ["other than it was is Seen(arg), Detect(arg)"]),
    ):  # fmt: skip
        changed = adapted.replace(old, new)
        assert changed != adapted
        assert interface_changes("leaves.hpp", changed.encode(), leaves.encode()) == changes


# --- what is written runs together -----------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "exports", "robot"),
    [
        ("find-it", "[py_trees, py_trees_robot]", "build/find_it_robot.py"),
        ("kitchen/find-it", "[py_trees_robot, py_trees]", "build/kitchen/find_it_robot.py"),
        ("1", "{py_trees: , py_trees_robot: build/r.py}", "build/r.py"),
        ("a", "{py_trees: robot/one.py, py_trees_robot: robot/x-y.py}", "robot/x-y.py"),
        ("a", "{py_trees: robot/trees/one.py, py_trees_robot: robot/two.py}", "robot/two.py"),
        ("a", "{py_trees: b/one.py, near: {format: py_trees, file: c/two.py}, py_trees_robot: c/three.py}",
         "c/three.py"),
        ("a", "{py_trees: , py_trees_robot: {options: {runtime: imported}}}", "build/a_robot.py"),
    ],
)  # fmt: skip
def test_a_robot_imports_the_module_that_is_built_with_it(
    name: str, exports: str, robot: str, tmp_path: Path
) -> None:
    text = f"trees: {{{name}: {{domain: can.pddl, strategy: refine, exports: {exports}}}}}\n"
    folder = project(tmp_path, text, can_pddl=CAN)
    report = build(folder / "bbtc.yaml", jobs=1)
    assert report.ok
    if "imported" in exports:
        (folder / "build/bbtc").symlink_to(REPOSITORY / "bbtc")
    assert "to do: light_on\n" in python(folder / robot, tmp_path)
    (folder / robot).write_text(filled((folder / robot).read_text()))
    assert build(folder / "bbtc.yaml", jobs=1, force=True).ok
    assert python(folder / robot, tmp_path) == "looks for cola\nThe tree returned SUCCESS.\n"


@pytest.mark.parametrize(
    "file", ["robot/find-it.py", "robot/class.py", "robot/1.py", "robot/tree.txt", "robot/a.b.py"]
)
def test_a_module_that_python_cannot_import_is_refused(file: str, tmp_path: Path) -> None:
    manifest = MANIFEST.replace("robot/find_it.py", file)
    folder = project(tmp_path, manifest, can_pddl=CAN)
    done = bbtc(folder, "build")
    assert (done.returncode, "bbtc.yaml:7:23: error[BBT0707]" in done.stderr) == (1, True), done.stderr
    assert not (folder / "robot").exists()
    own = "\n        file: robot/my_robot.py\n        options: {module: find_it}"
    project(folder, manifest.replace(" robot/my_robot.py", own))
    assert bbtc(folder, "build").returncode == 0
    assert "from find_it import" in (folder / "robot/my_robot.py").read_text()
