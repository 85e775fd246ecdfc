"""The CMake package, with real cmake, make and ninja: what has not changed is not built, what has is once."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from bbtc.version import __version__
from tests.builder.projects import COIN
from tests.integration.tools import REPOSITORY, edit, program, recipe, run, runs, tool
from tests.long_form import LONG

CMAKE_DIR = REPOSITORY / "bbtc" / "cmake"
DOMAIN, _, PROBLEM = COIN.partition("(define (problem")

PLAIN = """cmake_minimum_required(VERSION 3.20)
project(robot NONE)
find_package(bbtc 0.1 REQUIRED)
add_custom_target(robot ALL)
bbtc_add_tree(robot DOMAIN domain.pddl PROBLEM throws.pddl SUCCESS 0.75 STRATEGY refine)
bbtc_add_tree(robot DOMAIN both.pddl NAME again EXPORTS "py_trees=sub dir/again.py" dot=again.dot
  PLAN_OPTIONS --strategy policy)
install(FILES ${robot_BBTC_FILES} DESTINATION share/robot)
"""

HEAD = """cmake_minimum_required(VERSION 3.20)
project(robot CXX)
"""

LEAVES = """cmake_minimum_required(VERSION 3.20)
project(robot CXX)
set(CMAKE_CXX_STANDARD 17)
find_package(bbtc REQUIRED)
add_executable(robot main.cpp)
target_include_directories(robot PRIVATE engine)
bbtc_add_tree(robot DOMAIN domain.pddl PROBLEM throws.pddl SUCCESS 0.75 CPP NAMESPACE coin)
"""
ROBOT = """#include <cstdio>
#include "throws/robot_stub.hpp"
int main() { std::puts(coin_tree::MyRobot().isHeads() ? "heads" : "unknown"); }
"""
# So much of the engine's header as the interface of the robot needs.
ENGINE = """#pragma once
namespace BT { enum class NodeStatus { IDLE, RUNNING, SUCCESS, FAILURE, SKIPPED }; }
"""

WITH_LIBRARY = """cmake_minimum_required(VERSION 3.20)
project(robot CXX)
set(CMAKE_CXX_STANDARD 17)
find_package(bbtc REQUIRED)
find_package(behaviortree_cpp REQUIRED)
add_executable(robot main.cpp)
target_link_libraries(robot PRIVATE BT::behaviortree_cpp)
target_compile_definitions(robot PRIVATE TREES="${CMAKE_CURRENT_BINARY_DIR}")
bbtc_add_tree(robot DOMAIN domain.pddl PROBLEM throws.pddl SUCCESS 0.75 CPP NAMESPACE once NODES bbtc)
bbtc_add_tree(robot DOMAIN domain.pddl PROBLEM throws.pddl SUCCESS 0.75 NAME again CPP
  NAMESPACE again NODES bbtc)
"""
TWO_TREES = """#include <iostream>
#include <behaviortree_cpp/bt_factory.h>
#include "again/leaves.hpp"
#include "again/robot_stub.hpp"
#include "throws/leaves.hpp"
#include "throws/robot_stub.hpp"

int main() {
  BT::BehaviorTreeFactory factory;
  once_tree::MyRobot first;
  again_tree::MyRobot second;
  once_tree::registerLeaves(factory, first);
  again_tree::registerLeaves(factory, second);
  factory.registerBehaviorTreeFromFile(TREES "/throws.xml");
  factory.registerBehaviorTreeFromFile(TREES "/again.xml");
  std::cout << BT::toStr(factory.createTree(once_tree::kMainTree).tickWhileRunning())
            << BT::toStr(factory.createTree(again_tree::kMainTree).tickWhileRunning()) << std::endl;
}
"""

GENERATORS = {"Ninja": "ninja", "Unix Makefiles": "make"}


@pytest.fixture
def source(tmp_path: Path) -> Path:
    folder = tmp_path / "source"
    folder.mkdir()
    (folder / "CMakeLists.txt").write_text(PLAIN)
    (folder / "domain.pddl").write_text(DOMAIN)
    (folder / "throws.pddl").write_text(f"(define (problem{PROBLEM}")
    (folder / "both.pddl").write_text(COIN.replace("1/2", "1"))
    (folder / "main.cpp").write_text("int main() { return 0; }\n")
    return folder


def configure(source: Path, generator: str) -> Path:
    """Configure a build with a program bbtc that notes its runs; the build's folder."""
    cmake, make = tool("cmake"), tool(GENERATORS[generator])
    build = source.parent / "build"
    executable = program(source.parent)
    run(
        cmake,
        "-S",
        source,
        "-B",
        build,
        "-G",
        generator,
        f"-DCMAKE_MAKE_PROGRAM={make}",
        f"-Dbbtc_DIR={CMAKE_DIR}",
        "-DCMAKE_CXX_COMPILER_WORKS=1",  # what is compiled below shows it
        f"-DBBTC_EXECUTABLE={executable}",
        cwd=source,
    )
    return build


def make(build: Path) -> list[str]:
    """Build; the commands of bbtc that it ran."""
    run(tool("cmake"), "--build", build, cwd=build)
    return runs(build.parent)


@pytest.mark.parametrize("generator", GENERATORS)
def test_trees_are_built_when_they_are_out_of_date(source: Path, generator: str) -> None:
    build = configure(source, generator)
    assert sorted(make(build)) == ["export"] * 4 + ["plan"] * 2
    xml = ET.parse(build / "throws.xml").getroot()
    assert xml.get("BTCPP_format") == "4"
    assert ET.parse(build / "throws_nodes.xml").find("TreeNodesModel") is not None
    assert '"success_probability": "3/4"' in (build / "throws.tree.json").read_text()
    assert "create_root" in (build / "sub dir" / "again.py").read_text()
    assert make(build) == []
    edit(source / "domain.pddl", "1/2", "0.8")
    assert sorted(make(build)) == ["export", "export", "plan"]
    assert '"success_probability": "4/5"' in (build / "throws.tree.json").read_text()
    assert make(build) == []


@pytest.mark.parametrize("generator", GENERATORS)
def test_a_comment_is_built_once_although_it_changes_nothing(source: Path, generator: str) -> None:
    build = configure(source, generator)
    make(build)
    before = (build / "throws.xml").read_bytes()
    edit(source / "throws.pddl", "(define", "; a comment\n(define")
    assert "plan" in make(build)
    assert (build / "throws.xml").read_bytes() == before
    assert make(build) == []


def test_a_broken_domain_fails_the_build_with_its_place(source: Path) -> None:
    build = configure(source, "Unix Makefiles")
    make(build)
    before = (build / "throws.xml").read_bytes()
    edit(source / "domain.pddl", "1/2", "7/2")
    told = run(tool("cmake"), "--build", build, cwd=build, status=2)
    assert "domain.pddl:" in told
    assert "BBT0210" in told
    assert (build / "throws.xml").read_bytes() == before
    edit(source / "domain.pddl", "7/2", "1/2")
    make(build)


def test_a_compiled_program_has_its_trees_beside_it(source: Path) -> None:
    if shutil.which("c++") is None and shutil.which("g++") is None:
        pytest.skip("no C++ compiler")
    (source / "CMakeLists.txt").write_text(HEAD + recipe("cmake"))
    (source / "look-for-soda.pddl").write_text((source / "throws.pddl").read_text())
    build = configure(source, "Unix Makefiles")
    assert sorted(make(build)) == ["export", "export", "plan"]
    assert (build / "look-for-soda.xml").exists()
    assert make(build) == []


@pytest.mark.parametrize("generator", GENERATORS if LONG else ["Ninja"])
def test_a_program_is_compiled_with_the_interface_of_its_robot(source: Path, generator: str) -> None:
    if shutil.which("c++") is None:
        pytest.skip("no C++ compiler")
    (source / "CMakeLists.txt").write_text(LEAVES)
    (source / "main.cpp").write_text(ROBOT)
    header = source / "engine" / "behaviortree_cpp" / "basic_types.h"
    header.parent.mkdir(parents=True)
    header.write_text(ENGINE)
    build = configure(source, generator)
    assert sorted(make(build)) == ["export"] * 3 + ["plan"]
    assert run(build / "robot", cwd=build) == "to do: isHeads, false until then\nunknown\n"
    compiled = (build / "robot").stat().st_mtime_ns
    assert make(build) == []
    # Chances are no part of the interface: nothing is compiled.
    edit(source / "domain.pddl", "1/2", "0.8")
    assert sorted(make(build)) == ["export"] * 3 + ["plan"]
    assert (build / "robot").stat().st_mtime_ns == compiled
    assert make(build) == []
    # Another name of a condition is.
    for name in ("domain.pddl", "throws.pddl"):
        edit(source / name, "heads", "tails")
    edit(source / "main.cpp", "isHeads", "isTails")
    make(build)
    assert (build / "robot").stat().st_mtime_ns != compiled
    assert make(build) == []


def test_the_headers_that_cmake_expects_are_those_that_are_made() -> None:
    from bbtc.backends.btcpp.project import btcpp_project
    from tests.strategies import soda_tree

    config = (CMAKE_DIR / "bbtcConfig.cmake").read_text()
    plain = config.partition("set(headers ")[2].partition(")")[0].split()
    ours = config.partition("list(APPEND headers ")[2].partition(")")[0].split()
    for options, expected in (({}, plain), ({"nodes": "bbtc"}, plain + ours)):
        made = btcpp_project.export(soda_tree(), options, None).texts
        assert sorted(name for name in made if name.endswith(".hpp")) == sorted(expected)


def test_two_trees_run_in_one_program_with_the_real_library(source: Path) -> None:
    from tests.replay.compiled import require_library

    require_library()
    (source / "CMakeLists.txt").write_text(WITH_LIBRARY)
    (source / "main.cpp").write_text(TWO_TREES)
    build = configure(source, "Ninja")
    make(build)
    told = run(build / "robot", cwd=build)
    assert told.replace("to do: doThrow\n", "") == "FAILUREFAILURE\n" != told  # the stubs can do nothing
    assert make(build) == []


def test_the_program_of_the_page_runs_with_the_real_library(source: Path) -> None:
    from tests.replay.compiled import require_library

    require_library()
    (source / "CMakeLists.txt").write_text(HEAD + recipe("cmake-cpp"))
    (source / "main.cpp").write_text(recipe("c++"))
    for name in ("domain.pddl", "look-for-soda.pddl"):
        shutil.copy(REPOSITORY / "domains" / "household" / name, source)
    build = configure(source, "Ninja")
    make(build)
    told = set(run(build / "robot", cwd=build).splitlines())
    assert told == {"to do: doLightOn", "to do: doGoto table1", "to do: doGoto table2"}


def test_files_are_installed(source: Path) -> None:
    build = configure(source, "Unix Makefiles")
    make(build)
    run(tool("cmake"), "--install", build, "--prefix", source.parent / "prefix", cwd=build)
    installed = {path.name for path in (source.parent / "prefix/share/robot").iterdir()}
    assert {"throws.tree.json", "throws.xml", "throws_nodes.xml", "again.py"} <= installed


@pytest.mark.parametrize(
    ("call", "told"),
    [
        ("bbtc_add_tree(nobody DOMAIN both.pddl)", "there is no target 'nobody'"),
        ("bbtc_add_tree(robot PROBLEM both.pddl)", "DOMAIN is missing"),
        ("bbtc_add_tree(robot DOMAIN both.pddl EXPORTS btcpp)", "is not <format>=<file>"),
        ("bbtc_add_tree(robot DOMAIN both.pddl DOMIAN x)", "unknown arguments"),
        ("bbtc_add_tree(robot DOMAIN both.pddl CPP)", "CPP is for a library or an executable"),
    ],
)
def test_wrong_calls_are_told(source: Path, call: str, told: str) -> None:
    (source / "CMakeLists.txt").write_text(PLAIN.partition("bbtc_add_tree")[0] + call + "\n")
    cmake = tool("cmake")
    executable = program(source.parent)
    found = run(
        cmake,
        "-S",
        source,
        "-B",
        source.parent / "build",
        f"-Dbbtc_DIR={CMAKE_DIR}",
        f"-DBBTC_EXECUTABLE={executable}",
        cwd=source,
        status=1,
    )
    assert told in " ".join(found.split())


def test_the_package_is_found_by_the_path_alone(source: Path) -> None:
    # As a wheel installs it: the programs in bin/, the package in share/cmake/.
    cmake = tool("cmake")
    prefix = source.parent
    executable = program(prefix)
    shutil.copytree(CMAKE_DIR, prefix / "share" / "cmake" / "bbtc")
    (source / "CMakeLists.txt").write_text(PLAIN + 'message(STATUS "uses ${BBTC_EXECUTABLE}")\n')
    found = run(cmake, "-S", source, "-B", prefix / "build", cwd=source, path=executable.parent)
    assert f"uses {executable}" in found
    assert str(prefix / "share") in (prefix / "build" / "CMakeCache.txt").read_text()


def test_the_version_is_that_of_the_program() -> None:
    assert (CMAKE_DIR / "version.txt").read_text().strip() == __version__


def test_the_program_tells_where_the_package_is() -> None:
    from tests.domains.problems import bbtc

    assert bbtc("--cmake-dir").out.decode().strip() == str(CMAKE_DIR)


# --- names -----------------------------------------------------------------------------------

NAMED = """cmake_minimum_required(VERSION 3.20)
project(robot NONE)
find_package(bbtc REQUIRED)
add_custom_target(robot ALL)
bbtc_add_tree(robot DOMAIN [==[{name}]==] NAME t SUCCESS 0.5 EXPORTS dot=t.dot)
"""


@pytest.mark.parametrize("generator", GENERATORS)
def test_a_name_with_odd_letters_is_built_like_any_other(source: Path, generator: str) -> None:
    name = "a b$c'd&e=f(g).pddl"
    (source / name).write_text(COIN)
    (source / "CMakeLists.txt").write_text(NAMED.format(name=name))
    build = configure(source, generator)
    assert make(build) == ["plan", "export"]
    assert make(build) == []
    edit(source / name, "1/2", "3/4")
    assert make(build) == ["plan", "export"]


@pytest.mark.parametrize("name", ["a;b.pddl", "a#b.pddl", "a%b.pddl", "a:b.pddl", "ab:c.pddl"])
def test_a_name_that_cmake_cannot_pass_on_is_refused(source: Path, name: str) -> None:
    (source / name).write_text(COIN)
    (source / "CMakeLists.txt").write_text(NAMED.format(name=name))
    told = run(
        tool("cmake"), "-S", source, "-B", source.parent / "build", f"-Dbbtc_DIR={CMAKE_DIR}",
        f"-DBBTC_EXECUTABLE={program(source.parent)}", cwd=source, status=1,
    )  # fmt: skip
    assert "DOMAIN has a character that" in told
