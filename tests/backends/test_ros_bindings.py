"""Bindings to ROS 2: clients send goals of types that there are, with fields from tables; conditions answer
from topics. Compiled and run with stand-ins for ROS 2, and with BehaviorTree.CPP itself."""

from __future__ import annotations

import re
import subprocess
from fractions import Fraction
from pathlib import Path

import pytest

import bbtc
from bbtc.diagnostics import BbtcError
from bbtc.source import SourceFile
from bbtc.tree.nodes import Tree
from tests.backends.test_btcpp_project import NODE_CMAKE, STUBS, files, interface, snake, write
from tests.replay.compiled import cmake_build, require_library

PATROL = """(define (domain patrol)
  (:requirements :typing :probabilistic-effects :unknown)
  (:types room)
  (:predicates (at ?room - room) (battery_low) (unknown (clear ?room - room)) (reported))
  (:action go_to :parameters (?to - room)
    :precondition (not (battery_low))
    :effect (and (at ?to) (forall (?r - room) (when (not (= ?r ?to)) (not (at ?r))))))
  (:action dock :parameters () :precondition (battery_low) :effect (not (battery_low)))
  (:action report :parameters (?room - room)
    :precondition (and (at ?room) (clear ?room)) :effect (reported))
  (:action look :parameters (?room - room)
    :precondition (and (at ?room) (unknown (clear ?room)))
    :effect (probabilistic 0.8 (clear ?room) 0.2 (not (clear ?room)))))
(define (problem round)
  (:domain patrol)
  (:objects hall kitchen - room)
  (:init (at hall) (battery_low) (unknown (clear kitchen)))
  (:goal (reported)))
"""

BINDINGS = """
tables:
  poses: {hall: 0;map;0.0;0.5;0;0;0;0;1, kitchen: 0;map;4.0;-2.5;0;0;0;1;0}
  docks: {hall: 7, kitchen: 9}
actions:
  go_to:
    ros:
      action: nav2_msgs/action/NavigateToPose
      name: navigate_to_pose
      goal:
        pose.header.frame_id: {table: poses, of: to, part: 2}
        pose.pose.position.x: {table: poses, of: to, part: 3}
        pose.pose.position.y: {table: poses, of: to, part: 4}
        behavior_tree: ""
        tries: {table: docks, of: to}
        fast: true
      success: error_code == 0
  dock: {ros: {service: std_srvs/srv/SetBool, name: /dock, request: {data: true}, success: success == true}}
  look: {ros: {service: my_srvs/srv/Look, name: /look, request: {where: {of: room}}}}
conditions:
  at: {ros: {topic: /room, type: std_msgs/msg/String, where: {field: data, is: ==, value: {of: room}}}}
  battery_low: {ros: {topic: /battery_status, type: sensor_msgs/msg/BatteryState, where: percentage < 0.2}}
  clear:
    ros:
      topic: /clear
      type: my_msgs/msg/Clear
      where: {field: share, is: ">=", value: {table: docks, of: room}}
      unknown: nan
      latched: true
"""

TYPES = {
    "nav2_msgs/action/navigate_to_pose.hpp": """
namespace nav2_msgs::action { struct NavigateToPose {
  struct Header { std::string frame_id; };
  struct Position { double x = 0, y = 0, z = 0; };
  struct Pose { Position position; };
  struct Stamped { Header header; Pose pose; };
  struct Goal {
    Stamped pose;
    std::string behavior_tree = "other";
    std::uint8_t tries = 0;
    bool fast = false;
  };
  struct Result { std::uint16_t error_code = 0; };
}; }
template <> struct BT::Shown<nav2_msgs::action::NavigateToPose::Goal> {
  static std::string of(const nav2_msgs::action::NavigateToPose::Goal& goal) {
    const auto& at = goal.pose.pose.position;
    return " " + goal.pose.header.frame_id + " " + std::to_string(at.x) + " " + std::to_string(at.y) + " " +
           std::to_string(goal.tries) + (goal.fast ? " fast" : "") + " '" + goal.behavior_tree + "'";
  }
};
""",
    "std_srvs/srv/set_bool.hpp": """
namespace std_srvs::srv { struct SetBool {
  struct Request { using SharedPtr = std::shared_ptr<Request>; bool data = false; };
  struct Response { using SharedPtr = std::shared_ptr<Response>; bool success = true; };
}; }
""",
    "my_srvs/srv/look.hpp": """
namespace my_srvs::srv { struct Look {
  struct Request { using SharedPtr = std::shared_ptr<Request>; std::string where; };
  struct Response { using SharedPtr = std::shared_ptr<Response>; };
}; }
template <> struct BT::Shown<my_srvs::srv::Look::Request> {
  static std::string of(const my_srvs::srv::Look::Request& request) { return " " + request.where; }
};
""",
    "std_msgs/msg/string.hpp": "namespace std_msgs::msg { struct String { std::string data; }; }\n",
    "sensor_msgs/msg/battery_state.hpp": (
        "namespace sensor_msgs::msg { struct BatteryState { float percentage = 0; }; }\n"
    ),
    "my_msgs/msg/clear.hpp": "namespace my_msgs::msg { struct Clear { double share = 0; }; }\n",
}
"""Stand-ins for the C++ that ROS 2 has of these types."""

RUN = """
#include <csignal>
#include <sstream>
#define main run_generated_node
#include "main.cpp"
#undef main

// What is published before a spin: "TOPIC VALUE", several with a comma between them, or nothing.
static void publish(const std::string& text) {
  std::istringstream parts(text);
  for (std::string one; std::getline(parts, one, ',');) {
    std::printf("publish %s\\n", one.c_str());
    const std::string topic = one.substr(0, one.find(' ')), value = one.substr(one.find(' ') + 1);
    auto* node = rclcpp::Node::latest();
    if (topic == "/room") {
      node->publish(topic, std_msgs::msg::String{value});
    } else if (topic == "/clear") {
      node->publish(topic, my_msgs::msg::Clear{std::stod(value)});
    } else if (topic == "/battery_status") {
      node->publish(topic, sensor_msgs::msg::BatteryState{std::stof(value)});
    } else {
      robot_tree::Beliefs::Message message;
      robot_tree::Beliefs::Belief belief;
      belief.condition = "Reported";
      belief.value = static_cast<std::uint8_t>(std::stoi(value));
      message.beliefs.push_back(belief);
      node->publish("beliefs", message);
    }
  }
}

int main(int count, char** given) {
  int next = 1;
  while (next < count && std::string(given[next]) != "--ros-args") ++next;
  ++next;
  rclcpp::onSpin() = [&] {
    if (next < count && std::string(given[next]) == "for ever") return;
    if (next >= count) {
      std::raise(SIGTERM);
    } else {
      publish(given[next++]);
    }
  };
  return run_generated_node(count, given);
}
"""


GOAL = "ask navigate_to_pose map 4.000000 -2.500000 9 fast ''"


def patrol() -> Tree:
    return bbtc.plan(SourceFile("patrol.pddl", PATROL), target=Fraction(4, 5)).tree


def package(folder: Path, tree: Tree, bindings: str = BINDINGS, **options: str) -> dict[str, str]:
    (folder / "bindings.yaml").write_text(bindings, encoding="utf-8")
    return files(tree, **{"leaves": "ros2-actions", "bindings": str(folder / "bindings.yaml"), **options})


def told(folder: Path, bindings: str, tree: Tree | None = None, **options: str) -> list[str]:
    with pytest.raises(BbtcError) as raised:
        package(folder, tree or patrol(), bindings, **options)
    return [each.render().splitlines()[0].replace(f"{folder}/", "") for each in raised.value.diagnostics]


@pytest.fixture(scope="module")
def node(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program, compiled with stand-ins."""
    require_library()
    folder = tmp_path_factory.mktemp("bound")
    write(folder, package(folder, patrol()))
    names = {file.stem: file for kind in ("msg", "srv", "action") for file in folder.glob(f"{kind}/*.{kind}")}
    for name, file in names.items():
        header = f"round_tree/{file.suffix[1:]}/{snake(name)}.hpp"
        write(folder, {header: interface(file, "round_tree")})
    includes = "#pragma once\n#include <cstdint>\n#include <memory>\n#include <string>\n"
    write(folder, {name: includes + text for name, text in TYPES.items()})
    run = NODE_CMAKE.replace('"STUBS/run_node.cpp"', "run.cpp").replace("STUBS", str(STUBS))
    write(folder / "run", {"CMakeLists.txt": run, "run.cpp": RUN})
    done = cmake_build(folder / "run", folder / "build", "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "build" / "node"


def ran(node: Path, *told: str, options: tuple[str, ...] = ()) -> tuple[int, list[str]]:
    run = [str(node), *options, "--ros-args", *told]
    done = subprocess.run(run, capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, done.stdout.splitlines()


def test_the_package_uses_the_types_and_makes_interfaces_for_the_others_only(tmp_path: Path) -> None:
    made = package(tmp_path, patrol())
    assert {name for name in made if name.startswith(("action/", "srv/"))} == {"action/Report.action"}
    for name in ("nav2_msgs", "std_srvs", "my_srvs", "std_msgs", "sensor_msgs", "my_msgs"):
        assert f"find_package({name} REQUIRED)" in made["CMakeLists.txt"]
        assert f"<depend>{name}</depend>" in made["package.xml"]
        assert re.search(rf"ament_target_dependencies\(main [^)]*\b{name}\b", made["CMakeLists.txt"])
    assert made["tree.xml"] == files(patrol(), leaves="ros2-actions")["tree.xml"]
    assert package(tmp_path, patrol(), "version: 1\n") == files(patrol(), leaves="ros2-actions")


def test_the_first_tick_waits_for_the_first_message_of_every_topic(node: Path) -> None:
    """Of a topic that may be unknown, a message that it is so will do; of others NaN is no answer."""
    first = "/room hall,/battery_status 0.9,/clear nan"
    status, said = ran(node, first, "/room hall", "beliefs 0", "")
    assert status == 1
    waiting = [line for line in said if line.startswith("warning")]
    assert waiting[0] == "warning: waiting for the topic beliefs to tell of Reported()"
    assert not any(line.startswith("ask") for line in said[: said.index("publish beliefs 0")])
    assert GOAL in said
    late = ran(
        node, "/room hall,/battery_status nan,beliefs 0", "for ever", options=("--startup-timeout", "0.05")
    )
    assert late[0] == 3
    assert late[1][-1].startswith(
        "error: not told in time: waited for the topic /battery_status to tell of Battery"
    )
    assert "the topic /clear to tell of Clear(kitchen)" in late[1][-1]


def test_conditions_answer_from_topics_and_goals_come_from_tables(node: Path) -> None:
    start = "/room hall,/battery_status 0.1,/clear nan,beliefs 0"
    at_dock = ran(node, start, "", "/battery_status 0.5", "", "")
    assert [line for line in at_dock[1] if line.startswith("ask")][:2] == ["ask /dock", GOAL]
    there = "/room kitchen,/battery_status 0.5,/clear nan,beliefs 0"
    status, said = ran(node, there, "", "/clear 9", "", "beliefs 2", "")
    assert [line for line in said if line.startswith("ask")] == ["ask /look kitchen", "ask report"]
    assert (status, said[-1]) == (0, "info: the tree returned SUCCESS")
    # Half a tenth less than the table says of the kitchen is not clear.
    status, said = ran(node, there, "", "/clear 8.95", "", "")
    assert "ask report" not in said
    # The limit itself is not below it, at the precision of the field, and one bit less is.
    assert "ask /dock" not in ran(node, start.replace("0.1", "0.2"), "", "")[1]
    assert "ask /dock" in ran(node, start.replace("0.1", "0.19999"), "", "")[1]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("\n      unknown: nan", ""),
        ("percentage < 0.2}", "percentage < low}"),
        ("where: percentage < 0.2", "where: percentage"),
        ("percentage < 0.2}", "present == true, unknown: nan}"),
        ("{of: room}}}}", "{of: roon}}}}"),
        ("nav2_msgs/action/NavigateToPose", "nav2_msgs/srv/NavigateToPose"),
        ("nav2_msgs/action/NavigateToPose", "nav2_msgs/NavigateToPose"),
        ("      goal:\n", "      request:\n"),
        ("name: navigate_to_pose", "name: navigate to pose"),
        ("fast: true", 'fast: "{fast}"'),
        ("fast: true", "Fast-er: true"),
        ("fast: true", "fast: .inf"),
        ("kitchen: 9}", "hall2: 9}"),
        ("part: 4}", "part: 12}"),
        ("success: error_code == 0", "success: error_code"),
    ],
)
def test_a_fault_has_its_place(old: str, new: str, tmp_path: Path) -> None:
    assert BINDINGS.count(old) >= 1
    found = told(tmp_path, BINDINGS.replace(old, new, 1))
    assert found
    assert all(re.match(r"bindings\.yaml:\d+:\d+: error\[BBT\d{4}\]: ", each) for each in found)


def test_what_the_package_has_no_part_for_is_refused(tmp_path: Path) -> None:
    (found,) = told(tmp_path, BINDINGS, leaves="cpp")
    assert "error[BBT0713]: " in found
    assert "the program in plain C++ has no actions and topics of ROS 2" in found
    (found,) = told(tmp_path, "actions: {go_to: {node: NavigateToPose}}")
    assert found.startswith("bindings.yaml:1:11: error[BBT0713]: 'go_to' is bound to a node only")
    unknown = BINDINGS.replace("\n      unknown: nan", "")
    (found,) = told(tmp_path, unknown)
    assert "error[BBT0713]: 'clear' can be unknown, and the topic does not tell when it is" in found


def test_the_same_files_every_time(tmp_path: Path) -> None:
    assert package(tmp_path, patrol()) == package(tmp_path, patrol())
