"""Exporter ``btcpp_project``: a C++ program for a tree, for BehaviorTree.CPP 4.6 and later.

It holds the tree and its palette, a class for each condition and action, the interface of the robot, and
two programs: one for the robot, and one that runs the tree in a simulated world. Another flavour has the
leaves as clients of ROS 2 actions or services (:mod:`bbtc.backends.btcpp.ros`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

from bbtc.backends.btcpp import cppcode
from bbtc.backends.btcpp.bindings.bound import BINDINGS, bindings_of
from bbtc.backends.btcpp.exporter import btcpp
from bbtc.backends.btcpp.leaves import LeafWriter, Program
from bbtc.backends.btcpp.monitor import monitor_files
from bbtc.backends.btcpp.names import BtcppNames, btcpp_names
from bbtc.backends.btcpp.options import NAMESPACE, NODES, namespace_of, profile_of
from bbtc.backends.btcpp.palette import btcpp_palette
from bbtc.backends.btcpp.ros import ros_files
from bbtc.backends.btcpp.world import SimulatedRobotWriter
from bbtc.backends.exporter import Figures, Files, Option, OptionValue
from bbtc.backends.names import snake
from bbtc.diagnostics import BbtcError
from bbtc.tree.nodes import Tree

_LEAVES = Option(
    "leaves",
    "cpp",
    "cpp: plain C++, with a simulated world; ros2-actions, ros2-services: clients in ROS 2",
    ("cpp", "ros2-actions", "ros2-services"),
)


@dataclass(frozen=True, slots=True)
class BtcppProjectExporter:
    """Writes a folder with a C++ program for a tree."""

    name: str = "btcpp_project"
    description: str = "folder with a C++ program for the tree of --to btcpp, also in ROS 2"
    suffix: str = ""
    options: tuple[Option, ...] = (NODES, NAMESPACE, _LEAVES, BINDINGS)

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> Files:
        """The files. Raises :class:`BbtcError` for a tree that is too deep (BBT0705), for a namespace
        that is none (BBT0704), and for bindings that have faults, or that the program has no part for."""
        namespace = namespace_of(self.name, options)
        names = btcpp_names(tree, namespace)
        # Its leaves are classes of the program, also those that are bound.
        own = {"nodes": options.get("nodes", "stock"), "namespace": namespace}
        xml = btcpp.export(tree, own, None)
        bindings = bindings_of(options)
        # The first attribute of that name; ids hold no quotes.
        main_tree = xml.partition('main_tree_to_execute="')[2].partition('"')[0]
        files = {"tree.xml": xml, "palette.xml": btcpp_palette.export(tree, own, figures)}
        program = Program(
            package=f"{snake(tree.task.problem)}_tree",
            space=f"{snake(namespace) if namespace else 'robot'}_tree",
            main_tree=main_tree,
            our_nodes=profile_of(options) == "bbtc",
        )
        if program.our_nodes:
            files |= {name: _static(name) for name in ("bbtc_nodes.hpp", "bbtc_nodes_plugin.cpp")}
        match options.get("leaves"):
            case "ros2-actions" | "ros2-services" as leaves:
                files |= ros_files(tree, names, program, leaves == "ros2-services", bindings)
            case _ if bindings.bindings:
                message = f"{bindings.file}: the program in plain C++ has no actions and topics of ROS 2"
                hint = "bindings are for -O leaves=ros2-actions and ros2-services, and for --to btcpp"
                raise BbtcError.single("BBT0713", message, hint=hint)
            case _:
                files |= _plain_files(tree, names, program)
        return Files(files)


btcpp_project = BtcppProjectExporter()


def _plain_files(tree: Tree, names: BtcppNames, program: Program) -> dict[str, str]:
    leaves = LeafWriter(tree.task, names, program, tree.monitor)
    cmake = _CMAKE + (_CMAKE_PLUGIN if program.our_nodes else "")
    space = program.space
    files = {
        "CMakeLists.txt": cppcode.fill(cmake, PACKAGE=program.package),
        "README.md": _README,
        "robot.hpp": leaves.robot(),
        "robot_stub.hpp": leaves.stub(),
        "leaves.hpp": leaves.header(),
        "main.cpp": cppcode.fill(_static("main.cpp"), ROBOT_TREE=space),
        "simulated_world.hpp": cppcode.fill(_static("simulated_world.hpp"), ROBOT_TREE=space),
        "simulated_robot.hpp": SimulatedRobotWriter(tree, names, leaves, space).header(),
        "simulate.cpp": cppcode.fill(_static("simulate.cpp"), ROBOT_TREE=space),
    }
    if tree.task.events:
        files["moving_world.hpp"] = cppcode.fill(_static("moving_world.hpp"), ROBOT_TREE=space)
        files["simulated_world.hpp"] = files["simulated_world.hpp"].replace(" private:", " protected:")
        files["README.md"] += _README_MOVING
    if tree.monitor is not None:
        files |= monitor_files(tree.task, names, tree.monitor, space)
        files["hidden_world.hpp"] = cppcode.fill(_static("hidden_world.hpp"), ROBOT_TREE=space)
        files["main.cpp"] = files["main.cpp"].replace("milliseconds(100))", f"milliseconds(100), {_OUTSIDE}")
        # What is hidden is kept in the same state.
        files["simulated_world.hpp"] = files["simulated_world.hpp"].replace(" private:", " protected:")
        files["README.md"] += _README_MONITOR
    return files


def _static(name: str) -> str:
    return (resources.files("bbtc.backends.btcpp") / "cpp" / name).read_text(encoding="utf-8")


_CMAKE = """\
cmake_minimum_required(VERSION 3.16)
project(PACKAGE LANGUAGES CXX)

set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)

find_package(Threads REQUIRED)  # a static library of BehaviorTree.CPP does not look for it
find_package(behaviortree_cpp REQUIRED)
set(engine BT::behaviortree_cpp)
if(NOT TARGET ${engine})  # as ROS 2 builds it
  set(engine behaviortree_cpp::behaviortree_cpp)
endif()

# main: the tree on the robot. simulate: the tree in a simulated world.
foreach(program main simulate)
  add_executable(${program} ${program}.cpp)
  target_link_libraries(${program} ${engine})
  target_compile_definitions(${program} PRIVATE TREE_FILE="${CMAKE_CURRENT_SOURCE_DIR}/tree.xml")
endforeach()

# Where my_robot.hpp comes or goes, main is compiled anew: no file that it includes would tell.
file(GLOB my_robot CONFIGURE_DEPENDS my_robot.hpp)
if(my_robot)
  target_compile_definitions(main PRIVATE HAS_MY_ROBOT)
endif()
"""

_CMAKE_PLUGIN = """
# The nodes Skipper and Latch for programs that load theirs at run time.
add_library(bbtc_nodes SHARED bbtc_nodes_plugin.cpp)
target_compile_definitions(bbtc_nodes PRIVATE BT_PLUGIN_EXPORT)
target_link_libraries(bbtc_nodes ${engine})
"""

_OUTSIDE = """\
robot.monitor());
    if (!robot.monitor().outside().empty()) {
      std::cout << robot.monitor().outside() << '\\n';
    }"""

_README_MONITOR = """\
| `monitor*.hpp` | what is known of hidden facts, by what the robot tells `monitor()` |
| `hidden_world.hpp` | the simulated world's hidden facts, and what is told of them |
"""

_README_MOVING = """\
| `moving_world.hpp` | what happens by itself in the simulated world |
"""

_README = """\
# A behavior tree, made by bbtc

```
cmake -B build && cmake --build build
build/simulate --seed 1         # one run in the simulated world
build/simulate --runs 1000      # how often it succeeds
```

It needs BehaviorTree.CPP 4.6 or later, found by CMake (`-DCMAKE_PREFIX_PATH=...` where it is installed
elsewhere).

To run it on a robot, copy `robot_stub.hpp` to `my_robot.hpp`, fill that in, and run `build/main`. The other
files are made anew by `bbtc export`, which leaves `my_robot.hpp` alone.

| file | holds |
|---|---|
| `tree.xml` | the tree, for BehaviorTree.CPP and Groot2 |
| `palette.xml` | the nodes to draw with in Groot2 |
| `robot.hpp` | what the tree needs of a robot: a function for each condition and action |
| `leaves.hpp` | the nodes that call these functions |
| `simulated_*.hpp` | a robot in a simulated world, with the chances of the domain |
"""
