"""The C++ program for a tree: it compiles and does what the tree does, whatever the names. The tests that
compile skip where CMake finds no BehaviorTree.CPP."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.backends.btcpp import cppcode
from bbtc.backends.btcpp.project import btcpp_project
from bbtc.backends.interface import action_symbol
from bbtc.backends.world_model import actions_used
from bbtc.ground.condition import TRUE, And, Is, Known
from bbtc.ground.task import (
    Effect,
    Factor,
    GroundAction,
    InitialState,
    Outcome,
    Signature,
    Task,
    Variable,
)
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import simulate_tree
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree, tries_without_end
from tests.domains.problems import PROBLEMS, tree_of
from tests.replay.compiled import cmake_build, library_prefix, require_library
from tests.strategies import HOSTILE_NAMES, soda_tree

STUBS = Path(__file__).parent / "ros_stubs"


def files(tree: Tree, **options: str) -> dict[str, str]:
    return dict(btcpp_project.export(tree, options, None).texts)


def write(folder: Path, texts: dict[str, str]) -> Path:
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def built(folder: Path, tree: Tree, **options: str) -> Path:
    """The program ``simulate`` of a tree, compiled with all warnings as errors."""
    require_library()
    source = write(folder, files(tree, **options))
    done = cmake_build(source, folder / "build", "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Wpedantic -Werror")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "build"


def ran(program: Path, *arguments: str) -> str:
    done = subprocess.run([program, *arguments], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def assert_succeeds_as_often(program: Path, success: Fraction, *arguments: str, runs: int = 3000) -> None:
    """Fail if the number of successes is further from the exact one than by five standard deviations."""
    found = re.search(r"(\d+) of (\d+) runs", ran(program, "--runs", str(runs), *arguments))
    assert found is not None
    deviation = float(runs * success * (1 - success)) ** 0.5
    assert abs(int(found.group(1)) - float(runs * success)) <= 5 * deviation


@pytest.mark.parametrize("nodes", ["stock", "bbtc"])
@pytest.mark.parametrize("name", ["household/look-for-soda", "charging/night-round"])
def test_the_program_of_a_domain_compiles_and_succeeds_as_often_as_simulated(
    name: str, nodes: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (problem,) = [problem for problem in PROBLEMS if str(problem) == name]
    tree = tree_of(problem)
    success = simulate_tree(tree, Limits())[0].success
    build = built(tmp_path, tree, nodes=nodes)
    assert_succeeds_as_often(build / "simulate", success)
    monkeypatch.chdir(tmp_path)
    options = ("--ticks", "3", "--seed", "7", "--tree", "tree.xml")
    assert_succeeds_as_often(build / "simulate", success, *options)
    assert "The tree returned " in ran(build / "simulate", "--seed", "1")
    # The stub knows nothing and can do nothing, and says so; where nothing bounds that, the tree tries on.
    endless = tries_without_end(tree.root)
    try:
        done = subprocess.run(
            [build / "main"], capture_output=True, timeout=5 if endless else 60, check=False
        )
    except subprocess.TimeoutExpired as error:
        assert endless
        said = error.stderr or b""
    else:
        assert (done.returncode, done.stdout) == (0, b"The tree returned FAILURE.\n")
        said = done.stderr
    todo = "to do: doReturnToDock station" if name.startswith("charging") else "to do: doLightOn"
    assert todo in said.decode().splitlines()


def test_a_stub_says_which_conditions_are_to_be_written_where_they_block_a_guard(tmp_path: Path) -> None:
    """Neither action is ever started, so that only the conditions can tell."""
    tree = soda_tree()
    guards = (Is(0, Truth.TRUE), Is(1, Truth.TRUE))
    actions = tuple(
        replace(action, precondition=guard) for action, guard in zip(tree.task.actions, guards, strict=True)
    )
    attempts = tuple(
        ActionNode(f"a{number}", action.name, guarded=True) for number, action in enumerate(actions)
    )
    tree = replace(
        tree, task=replace(tree.task, actions=actions), root=ControlNode("r", "fallback", attempts)
    )
    build = built(tmp_path, tree)
    done = subprocess.run([build / "main"], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (0, "The tree returned FAILURE.\n")
    assert done.stderr.splitlines() == [
        "to do: isLuminousityOk, false until then",
        "to do: isSeen soda, unknown until then",
    ]


def test_a_static_library_that_leaves_threads_to_others_is_found(tmp_path: Path) -> None:
    """As CMake writes its package where BTCPP_SHARED_LIBS is off: it names a target of a package that it
    does not look for."""
    if shutil.which("cmake") is None or shutil.which("c++") is None:
        pytest.skip("no cmake and c++ on the PATH")
    package = """add_library(BT::behaviortree_cpp INTERFACE IMPORTED)
set_target_properties(BT::behaviortree_cpp PROPERTIES
                      INTERFACE_LINK_LIBRARIES "\\$<LINK_ONLY:Threads::Threads>")
"""
    source = write(tmp_path / "source", files(soda_tree()))
    write(tmp_path / "package", {"behaviortree_cppConfig.cmake": package})
    configure = ["cmake", "-S", str(source), "-B", str(tmp_path / "build")]
    found = f"-Dbehaviortree_cpp_DIR={tmp_path / 'package'}"
    done = subprocess.run([*configure, found], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr


ROBOT = """#include "robot_stub.hpp"
#define MyRobot WORD
namespace robot_tree {
class WORD : public Robot {
 public:
  bool isLuminousityOk() override { return std::cout << "WORD\\n", false; }
  std::optional<bool> isSeen(const std::string&) override { return std::nullopt; }
  BT::NodeStatus doLightOn() override { return BT::NodeStatus::FAILURE; }
  BT::NodeStatus doDetect(const std::string&) override { return BT::NodeStatus::FAILURE; }
};
}  // namespace robot_tree
"""


def test_a_robot_that_comes_changes_or_goes_is_noticed_by_the_build(tmp_path: Path) -> None:
    """By that of CMake's default generator, or of the one that the environment names (CMAKE_GENERATOR)."""
    require_library()
    source, build = write(tmp_path / "source", files(soda_tree())), tmp_path / "build"
    configure = ["cmake", "-S", str(source), "-B", str(build), "-DCMAKE_CXX_FLAGS=-O0"]
    subprocess.run(configure, check=True, capture_output=True, timeout=300)
    robot = source / "my_robot.hpp"

    def said() -> str:
        make = ["cmake", "--build", str(build), "--target", "main"]
        done = subprocess.run(make, capture_output=True, text=True, timeout=540, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        done = subprocess.run([build / "main"], capture_output=True, text=True, timeout=60, check=False)
        return "".join(dict.fromkeys(done.stdout.splitlines()))

    stub = said()
    robot.write_text(ROBOT.replace("WORD", "First"), encoding="utf-8")
    os.utime(robot, (1, 1))  # copied with its old time
    assert said() == f"First{stub}"
    robot.write_text(ROBOT.replace("WORD", "Second"), encoding="utf-8")
    assert said() == f"Second{stub}"
    robot.unlink()
    assert said() == stub


TIRELESS = """#include <iostream>
#include "robot_stub.hpp"
namespace robot_tree {
class Tireless : public MyRobot {
  BT::NodeStatus doLightOn() override {
    std::cout << "light" << std::endl;
    return BT::NodeStatus::RUNNING;
  }
  void cancelLightOn() override { std::cout << "cancel" << std::endl; }
};
}  // namespace robot_tree
#define MyRobot Tireless
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_program_cancels_the_action_that_runs(number: signal.Signals, tireless: Path) -> None:
    with subprocess.Popen([tireless], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "light\n"
        program.send_signal(number)
        *before, cancelled, last = program.communicate(timeout=30)[0].splitlines()
    assert set(before) <= {"light"}
    assert (cancelled, last, program.returncode) == ("cancel", "Interrupted.", 1)


@pytest.fixture(scope="module")
def tireless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program ``main`` with a robot that never ends what it does."""
    folder = tmp_path_factory.mktemp("tireless")
    (folder / "my_robot.hpp").write_text(TIRELESS, encoding="utf-8")
    return built(folder, soda_tree()) / "main"


def hostile_tree() -> Tree:
    """Predicates, actions, parameters and objects called as C++, its libraries, CMake or ROS call things
    of their own."""
    words = [
        *(
            "EOF",
            "class",
            "errno",
            "NAME",
            "PORTS",
            "std",
            "BT",
            "Robot",
            "Skipper",
            "seen",
            "se-en",
            "Beliefs",
        ),
        *('a"); system("x', "*/", "\\", "${CMAKE}", "\n#error", "ü", "", "7", 'R"('),
    ]
    arguments = ("class", 'q"', "7", "ROBOT_TREE")
    parameters = ("new", "std", "topic_name", "goal")
    variables = tuple(
        sorted((Variable(word, arguments, True) for word in words), key=lambda variable: variable.name)
    )
    known = And(tuple(Known(index) for index in range(len(words))))
    all_true = tuple((index, Truth.TRUE) for index in range(len(words)))
    actions = tuple(
        sorted(
            (
                GroundAction(word, arguments, TRUE, (Factor((
                    Outcome(Fraction(1, 3), (Effect(None, all_true),)),
                    Outcome(Fraction(2, 3), (Effect(known, ((0, Truth.FALSE),)),)),
                )),))
                for word in words
            ),
            key=lambda action: action.name,
        )
    )  # fmt: skip
    signatures = tuple(
        Signature(kind, word, parameters) for kind in ("action", "predicate") for word in sorted(words)
    )
    task = Task(
        'x"', "-->\n*/", variables, (InitialState(Fraction(1), (Truth.UNKNOWN,) * len(words)),),
        Is(0, Truth.TRUE), actions, signatures=signatures,
    )  # fmt: skip
    attempts = tuple(
        ControlNode(f"s{i}", "sequence", (ActionNode(f"a{i}", action.name), ConditionNode(f"c{i}", Known(0))))
        for i, action in enumerate(actions)
    )
    checks: tuple[Node, ...] = tuple(
        ConditionNode(f"k{i}", Is(i, Truth.TRUE), name='n"') for i in range(len(words))
    )
    root = ControlNode(
        "r", "sequence", (ControlNode("f", "fallback", attempts), *checks), name="*/", template='t("'
    )
    tree = Tree(task, root, Fraction(0), Fraction(1), "stuck")
    return replace(tree, success_probability=simulate_tree(tree, Limits())[0].success)


@pytest.mark.parametrize("nodes", ["stock", "bbtc"])
def test_a_program_full_of_hostile_names_compiles_and_runs(nodes: str, tmp_path: Path) -> None:
    tree = hostile_tree()
    assert 0 < tree.success_probability < 1
    build = built(tmp_path, tree, nodes=nodes, namespace="class")
    assert_succeeds_as_often(build / "simulate", tree.success_probability, runs=500)


FIELD = re.compile(r"(?!.*__)[a-z][a-z0-9_]*[a-z0-9]|[a-z]")  # what ROS 2 takes for the name of a field


def ros_package(folder: Path, tree: Tree, leaves: str) -> Path:
    """The files of a package for ROS 2, and the headers that ROS 2 would make of its interfaces."""
    write(folder, files(tree, leaves=leaves, nodes="bbtc"))
    package = re.search(r"project\((\w+)", (folder / "CMakeLists.txt").read_text())
    assert package is not None
    made = 0
    for kind in ("msg", "srv", "action"):
        for file in sorted(folder.glob(f"{kind}/*.{kind}")):
            assert re.fullmatch(r"[A-Z][A-Za-z0-9]*", file.stem)
            write(
                folder,
                {f"{package.group(1)}/{kind}/{snake(file.stem)}.hpp": interface(file, package.group(1))},
            )
            made += 1
    messages = 2 if tree.monitor is None else 3
    assert made == messages + len({action_symbol(action) for action in actions_used(tree)})
    return folder


@pytest.mark.parametrize("leaves", ["ros2-actions", "ros2-services"])
def test_the_flavours_for_ros_are_valid_cpp(leaves: str, tmp_path: Path) -> None:
    """Against stand-ins for the headers of ROS 2, and the headers of BehaviorTree.CPP itself."""
    require_library()
    folder = ros_package(tmp_path, hostile_tree(), leaves)
    flags = ["-std=c++17", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", '-DTREE_FILE="x"']
    flags += [f"-I{folder}", f"-I{STUBS}", *(f"-isystem{path}/include" for path in library_prefix())]
    flags += ["-DLATER_ROS_NODE_PARAMS"] if leaves == "ros2-services" else []
    done = subprocess.run(
        ["c++", *flags, "main.cpp"],
        cwd=folder, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


NODE_CMAKE = """cmake_minimum_required(VERSION 3.16)
project(node CXX)
set(CMAKE_CXX_STANDARD 17)
find_package(Threads REQUIRED)
find_package(behaviortree_cpp REQUIRED)
add_executable(node "STUBS/run_node.cpp")
target_include_directories(node PRIVATE .. "STUBS")
target_compile_definitions(node PRIVATE TREE_FILE="${CMAKE_CURRENT_SOURCE_DIR}/../tree.xml")
target_link_libraries(node BT::behaviortree_cpp)
"""


@pytest.fixture(scope="module")
def node(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program of a package for ROS 2, made with stand-ins for ROS 2: it is told what is published, see
    ``run_node.cpp``. Servers tell when they are asked, and do what they are asked at once."""
    require_library()
    folder = ros_package(tmp_path_factory.mktemp("ros"), soda_tree(), "ros2-actions")
    write(folder / "run", {"CMakeLists.txt": NODE_CMAKE.replace("STUBS", str(STUBS))})
    done = cmake_build(folder / "run", folder / "build", "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "build" / "node"


def published(node: Path, *beliefs: str) -> list[str]:
    """What the node says; ``beliefs`` are published before one tick after the other."""
    return ended(node, "--ros-args", *beliefs)[1]


def ended(node: Path, *arguments: str) -> tuple[int, list[str]]:
    """How the node ends, and what it says."""
    done = subprocess.run([node, *arguments], capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, [*done.stdout.splitlines(), *done.stderr.splitlines()]


def test_a_node_is_not_ticked_before_every_condition_has_been_told(node: Path) -> None:
    """Nothing is asked of the robot until the light, which is never unknown, has been told; the can may be
    unknown, and is where a message does not name it."""
    said = published(node)
    assert said == [
        "warning: waiting for the topic beliefs to tell of LuminousityOk(), Seen(soda)",
        "info: the tree returned RUNNING",
    ]
    light_missing = [
        "publish Seen|soda=2",
        "warning: waiting for the topic beliefs to tell of LuminousityOk()",
        "info: the tree returned RUNNING",
    ]
    assert published(node, "Seen|soda=2", "", "") == light_missing  # told once
    for light in ("nothing", "LuminousityOk=1", "Seen|can=0;LuminousityOk|soda=0"):
        said = published(node, light, "", "")
        assert said[-1] == "info: the tree returned RUNNING", light  # interrupted, neither blocked nor begun
        assert not any(line.startswith("ask") for line in said), light
    assert published(node, "", "LuminousityOk=0", "")[1:3] == ["publish LuminousityOk=0", "ask light_on"]


def test_a_node_that_is_not_told_in_time_names_what_it_waited_for_and_ends(node: Path) -> None:
    lost = "the topic beliefs to tell of LuminousityOk(), Seen(soda)"
    assert ended(node, "--startup-timeout", "0.1", "--ros-args", "for ever") == (
        3,
        [
            f"warning: waiting for {lost}",
            f"error: not told in time: waited for {lost}; the tree has not begun",
        ],
    )
    lit = "publish LuminousityOk=1;Seen|soda=2"
    status, said = ended(node, "--startup-timeout", "0.1", "--ros-args", lit.split()[1], "for ever")
    assert (status, said[0]) == (3, lit)
    assert said[-1].endswith(
        "waited for the topic beliefs to tell of LuminousityOk(); the tree has not begun"
    )


def test_once_told_a_node_runs_however_long_it_takes(node: Path) -> None:
    told = ["LuminousityOk=2", "", "LuminousityOk=2;Seen|soda=2", ""]  # 20 ms between two
    status, said = ended(node, "--startup-timeout", "0.001", "--ros-args", *told)
    assert (status, said[-1]) == (0, "info: the tree returned SUCCESS")


def test_a_node_waits_however_long_where_it_is_told_so_and_a_minute_else(node: Path) -> None:
    for options in ([], ["--startup-timeout", "none"], ["--startup-timeout", "5"]):
        status, said = ended(node, *options, "--ros-args", *[""] * 10)
        assert (status, said[-1]) == (1, "info: the tree returned RUNNING")  # interrupted
    assert "kStartupTimeout = 60;" in (node.parents[1] / "main.cpp").read_text()


def test_wrong_arguments_of_a_node_are_refused(node: Path) -> None:
    for wrong in (
        ["--startup"],
        ["--startup-timeout"],
        *(["--startup-timeout", x] for x in ("", "-1", "5s", "nan")),
    ):
        assert ended(node, *wrong) == (2, ["usage: main [--startup-timeout SECONDS|none]"])


def test_an_unknown_can_is_looked_for_and_a_lost_light_starts_nothing(node: Path) -> None:
    lit = "LuminousityOk=2"
    assert published(node, lit, "", f"{lit};Seen|soda=2", "") == [
        f"publish {lit}",
        "ask detect",
        f"publish {lit};Seen|soda=2",
        "info: the tree returned SUCCESS",
    ]
    # Neither lit nor dark: the search ends, and the light is not switched on either.
    assert published(node, lit, "nothing", "", "") == [
        f"publish {lit}",
        "ask detect",
        "publish nothing",
        "cancel detect",
        "info: the tree returned FAILURE",
    ]


def snake(name: str) -> str:
    """The file name of an interface, by the rule of ROS 2."""
    name = re.sub("(.)([A-Z][a-z]+)", r"\1_\2", name)
    return re.sub("([a-z0-9])([A-Z])", r"\1_\2", name).lower()


def interface(file: Path, package: str) -> str:
    """The C++ that ROS 2 would make of the definition of an interface, as far as needed."""
    types = {"string": "std::string", "uint8": "std::uint8_t", "bool": "bool"}
    types |= {f"{name}[]": f"std::vector<{of}>" for name, of in types.items()} | {
        f"{name}[]": f"std::vector<{package}::msg::{name}>" for name in ("Belief", "Reading")
    }
    parts = [[]] if file.suffix == ".msg" else [[], []]  # type: ignore[var-annotated]
    number = 0
    for line in file.read_text(encoding="utf-8").splitlines():
        if line == "---":
            number += 1
        elif line and not line.startswith("#"):
            kind, name, *value = line.split(maxsplit=2)
            if value:
                parts[0].append(f"static constexpr {types[kind]} {name} {value[0]};")
            else:
                assert FIELD.fullmatch(name), name
                parts[number].append(f"{types[kind]} {name};")
    names = {".msg": [file.stem], ".srv": ["Request", "Response"], ".action": ["Goal", "Result"]}[file.suffix]
    structs = [
        f"struct {name} {{ using SharedPtr = std::shared_ptr<{name}>; {' '.join(fields)} }};"
        for name, fields in zip(names, parts, strict=False)
    ]
    body = "\n".join(structs)
    if file.suffix != ".msg":
        body = f"struct {file.stem} {{\n{body}\n}};"
    used = [name for name in ("Belief", "Reading") if f"{name}[]" in file.read_text()]
    include = "".join(f'#include "{package}/msg/{name.lower()}.hpp"\n' for name in used)
    return (
        "#pragma once\n#include <cstdint>\n#include <memory>\n#include <string>\n#include <vector>\n"
        f"{include}namespace {package}::{file.suffix[1:]} {{\n{body}\n}}\n"
    )


def test_the_files_are_the_same_every_time_and_leave_the_robot_alone() -> None:
    tree = soda_tree()
    for options in ({}, {"nodes": "bbtc"}, {"leaves": "ros2-actions"}, {"leaves": "ros2-services"}):
        assert files(tree, **options) == files(tree, **options)
        assert "my_robot.hpp" not in files(tree, **options)
        assert ("bbtc_nodes.hpp" in files(tree, **options)) == ("nodes" in options)


def test_the_command_writes_a_folder(tmp_path: Path) -> None:
    import sys

    from bbtc.artefacts import dumps, tree_to_json

    (tmp_path / "tree.json").write_text(dumps(tree_to_json(soda_tree())))
    command = [sys.executable, "-m", "bbtc.cli.main", "export", "tree.json", "--to", "btcpp_project"]

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*command, *arguments], cwd=tmp_path, capture_output=True, text=True, check=False,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        )  # fmt: skip

    assert run("-o", "made").returncode == 0
    assert (tmp_path / "made" / "simulate.cpp").is_file()
    assert run("-o", "made", "--check").returncode == 0
    (tmp_path / "made" / "my_robot.hpp").write_text("mine")
    (tmp_path / "made" / "robot.hpp").write_text("edited")
    drifted = run("-o", "made", "--check")
    assert drifted.returncode == 1
    assert "BBT0008" in drifted.stderr
    assert (tmp_path / "made" / "robot.hpp").read_text() == "edited"
    assert run("-o", "made").returncode == 0
    assert (tmp_path / "made" / "my_robot.hpp").read_text() == "mine"
    assert run().returncode == 2
    (tmp_path / "notes").write_text("mine")
    blocked = run("-o", "notes")
    assert blocked.returncode == 1
    assert "BBT0004" in blocked.stderr


@given(st.lists(HOSTILE_NAMES | st.sampled_from(sorted(cppcode.RESERVED)), unique=True))
def test_parameters_are_no_words_of_cpp(names: list[str]) -> None:
    made = cppcode.parameters(names)
    assert len(set(made)) == len(names)
    assert not set(made) & cppcode.RESERVED


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_a_literal_says_the_bytes_of_its_text(text: str) -> None:
    made = cppcode.literal(text)
    assert re.fullmatch(r'"(?:[ !#-\[\]-~]|\\[0-7]{3})*"', made)
    said = re.sub(r"\\([0-7]{3})", lambda found: chr(int(found.group(1), 8)), made[1:-1])
    assert said.encode("latin-1") == text.encode()


@given(st.lists(st.integers(1, 10**30), min_size=1, max_size=6))
def test_weights_are_the_probabilities_or_next_to_them(parts: list[int]) -> None:
    probabilities = [Fraction(part, sum(parts)) for part in parts]
    made = cppcode.weights(probabilities)
    assert all(weight > 0 for weight in made)
    assert sum(made) < 2**63 + 1
    for weight, probability in zip(made, probabilities, strict=True):
        assert abs(Fraction(weight, sum(made)) - probability) < Fraction(1, 2**49)
