"""The leaves of a BehaviorTree.CPP tree as clients in ROS 2, with ``behaviortree_ros2``: a package with its
interfaces. An action is a client of a ROS action (or service); a condition reads the latest beliefs from a
topic, because a condition must answer at once: one that waits for a service would seem unknown."""

from __future__ import annotations

import re

from bbtc.backends.btcpp import cppcode
from bbtc.backends.btcpp.leaves import ACCESS, Program
from bbtc.backends.btcpp.monitor import key_code, monitor_files
from bbtc.backends.btcpp.names import BtcppNames
from bbtc.backends.btcpp.palette import port_code, signature
from bbtc.backends.btcpp.ros_monitor import (
    FIRST_READINGS,
    READING,
    README,
    watched,
    watched_head,
    watched_main,
)
from bbtc.backends.exporter import Begun
from bbtc.backends.interface import Leaf, action_symbol
from bbtc.backends.names import Symbol
from bbtc.diagnostics import BbtcError
from bbtc.ground.task import Task
from bbtc.tree.monitor import FIRST
from bbtc.tree.nodes import Tree


def ros_files(tree: Tree, names: BtcppNames, program: Program, services: bool) -> dict[str, str]:
    """The files of the package, by name. Actions are ROS actions, or else ``services``."""
    writer = _RosWriter(tree, names, program, services)
    files = {
        "CMakeLists.txt": writer.cmake(),
        "package.xml": cppcode.fill(_PACKAGE_XML, PACKAGE=program.package),
        "README.md": cppcode.fill(_README, PACKAGE=program.package, KIND=writer.kind),
        "leaves.hpp": writer.header(),
        "main.cpp": cppcode.fill(
            _MAIN if tree.monitor is None else watched_main(_MAIN),
            PACKAGE=program.package,
            ROBOT_TREE=program.space,
        ),
        "msg/Belief.msg": _BELIEF,
        "msg/Beliefs.msg": _BELIEFS,
    }
    if tree.monitor is not None:
        files["msg/Reading.msg"] = READING
        files["msg/Beliefs.msg"] += FIRST_READINGS
        files["README.md"] += README
    # To be adapted by their user: an export that comes later leaves them alone.
    begun: dict[str, str] = {name: Begun(text) for name, text in (files | writer.interfaces()).items()}
    return (
        begun
        if tree.monitor is None
        else begun | monitor_files(tree.task, names, tree.monitor, program.space)
    )


class _RosWriter:
    def __init__(self, tree: Tree, names: BtcppNames, program: Program, services: bool) -> None:
        counted = next((leaf for leaf in names.interface.conditions if leaf.counts), None)
        if counted is not None:
            raise BbtcError.single(
                "BBT0441",
                f"the ROS 2 package does not know numbers, such as {signature(counted)}",
                hint="with `-O leaves=cpp` the robot is a class that is asked for them",
            )
        self._task: Task = tree.task
        self._monitor = tree.monitor
        self._names = names
        self._program = program
        self._services = services
        self.kind = "service" if services else "action"
        self._folder = "srv" if services else "action"
        taken = {"belief", "beliefs"} | (set() if tree.monitor is None else {"reading"})
        self._types: dict[Symbol, str] = {}
        for leaf in names.interface.actions:
            # Names of interfaces have no underscores.
            name = names.plain[leaf.symbol].replace("_", "")
            if name.upper() == name:  # EOF, NULL: may be a macro
                name += "Task"
            while name.casefold() in taken:
                name += "X"
            taken.add(name.casefold())
            self._types[leaf.symbol] = name

    def interfaces(self) -> dict[str, str]:
        """The definition of every action or service."""
        return {
            f"{self._folder}/{self._types[leaf.symbol]}.{self._folder}": "\n".join(
                [
                    f"# {cppcode.comment(signature(leaf))}",
                    *(f"string {field}" for field in cppcode.parameters(leaf.parameters)),
                    "---",
                    "bool success",
                    *(["Reading[] readings"] if self._tells(leaf) else []),
                    *([] if self._services else ["---"]),
                    "",
                ]
            )
            for leaf in self._names.interface.actions
        }

    def cmake(self) -> str:
        """``CMakeLists.txt``."""
        messages = ["msg/Belief.msg", "msg/Beliefs.msg"] + (["msg/Reading.msg"] if self._monitor else [])
        paths = [f'  "{name}"' for name in [*messages, *self.interfaces()]]
        return cppcode.fill(_CMAKE, PACKAGE=self._program.package, INTERFACES="\n".join(paths))

    def header(self) -> str:
        """``leaves.hpp``."""
        package, space = self._program.package, self._program.space
        includes = [f'#include "{package}/msg/beliefs.hpp"']
        names = map(_header_name, self._types.values())
        includes += [f'#include "{package}/{self._folder}/{name}.hpp"' for name in names]
        blocks = [
            cppcode.fill(
                _HEAD if self._monitor is None else watched_head(_HEAD),
                INCLUDES="\n".join(includes),
                CLIENT=f"<behaviortree_ros2/bt_{self.kind}_node.hpp>",
                OURS='#include "bbtc_nodes.hpp"\n' if self._program.our_nodes else "",
                PACKAGE=package,
                ROBOT_TREE=space,
                MAIN_TREE=cppcode.literal(self._program.main_tree),
            )
        ]
        blocks += [self._condition(leaf) for leaf in self._names.interface.conditions]
        blocks += [self._action(leaf) for leaf in self._names.interface.actions]
        return "\n".join([*blocks, self._register()])

    def _condition(self, leaf: Leaf) -> str:
        names = [f"argument(*this, {cppcode.literal(port)})" for port in leaf.parameters]
        return cppcode.fill(
            _CONDITION,
            TOLD=cppcode.comment(signature(leaf)),
            NAME=f"{self._names.plain[leaf.symbol]}Condition",
            PORTS=port_code(self._task, self._names, leaf),
            FACT=cppcode.literal(self._names.ids[leaf.symbol]),
            ARGUMENTS=f"{{{', '.join(names)}}}",
            UNKNOWN="true" if leaf.three_valued else "false",
        )

    def _action(self, leaf: Leaf) -> str:
        fields = [
            f"    request.{field} = argument(*this, {cppcode.literal(port)});"
            for field, port in zip(cppcode.parameters(leaf.parameters), leaf.parameters, strict=True)
        ]
        kind = self._types[leaf.symbol]
        text = _SERVICE if self._services else _ACTION
        if self._monitor is not None:
            text = watched(text, tells=self._tells(leaf))
        key = key_code(self._names, leaf, [f"argument(*this, {cppcode.literal(p)})" for p in leaf.parameters])
        return cppcode.fill(
            text,
            KEY=key,
            TOLD=cppcode.comment(signature(leaf)),
            NAME=f"{self._names.plain[leaf.symbol]}Action",
            TYPE=f"{self._program.package}::{self._folder}::{kind}",
            PORTS=port_code(self._task, self._names, leaf),
            FIELDS="\n".join(fields) if fields else f"    (void)request;  // {self.kind} without arguments",
        )

    def _tells(self, leaf: Leaf) -> bool:
        """Does the monitor wait for what actions of this schema tell?"""
        names = () if self._monitor is None else self._monitor.readings.keys() - {FIRST}
        return any(action_symbol(self._task.action_by_name[name]) == leaf.symbol for name in names)

    def _register(self) -> str:
        lines = [
            "/// Make a factory know every node of the tree, as clients of a ROS node. What its conditions",
            "/// read is to be given to isReady before every tick.",
            "inline std::shared_ptr<Beliefs> registerLeaves(BT::BehaviorTreeFactory& factory,",
            "                                               BT::RosNodeParams params) {",
            *(["  bbtc::registerNodes(factory);"] if self._program.our_nodes else []),
            "  // In later versions of behaviortree_ros2 the pointer is a weak one.",
            "  auto beliefs = std::make_shared<Beliefs>(std::weak_ptr<rclcpp::Node>(params.nh).lock());",
        ]
        conditions = [leaf.symbol for leaf in self._names.interface.conditions]
        lines += [self._registration(symbol, "Condition", "beliefs") for symbol in conditions]
        for leaf in self._names.interface.actions:
            server = cppcode.literal(_header_name(self._types[leaf.symbol]))
            lines.append(f"  params.default_port_value = {server};")
            given = "params" if self._monitor is None else "params, beliefs"
            lines.append(self._registration(leaf.symbol, "Action", given))
        return "\n".join(
            [*lines, "  return beliefs;", "}", "", f"}}  // namespace {self._program.space}", ""]
        )

    def _registration(self, symbol: Symbol, suffix: str, given: str) -> str:
        name = f"{self._names.plain[symbol]}{suffix}"
        return f"  factory.registerNodeType<{name}>({cppcode.literal(self._names.ids[symbol])}, {given});"


def _header_name(interface: str) -> str:
    """The file name that ROS 2 derives from the name of an interface: ``LightOn`` is ``light_on``."""
    spaced = re.sub(r"(.)([A-Z][a-z]+)", r"\1_\2", interface)
    return re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", spaced).lower()


_BELIEF = """\
# What is known of a fact, named as in the tree: the id of the condition and the values of its ports.
uint8 FALSE = 0
uint8 UNKNOWN = 1
uint8 TRUE = 2
string condition
string[] arguments
uint8 value
"""

_BELIEFS = """\
# All that is known at a moment. Facts that are missing are unknown. Before its first tick, a tree waits for a
# message that tells of every fact it reads, but for those that can be unknown.
Belief[] beliefs
"""

_HEAD = (
    """\
// The leaves of the tree as clients in ROS 2. Made by bbtc: a start, to be adapted to your interfaces.
#pragma once

#include <chrono>
#include <csignal>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <behaviortree_cpp/bt_factory.h>
#include <behaviortree_cpp/condition_node.h>
#include CLIENT
#include <rclcpp/rclcpp.hpp>

OURS
INCLUDES

namespace ROBOT_TREE {

"""
    + ACCESS
    + """
/// A fact: the id of its condition, and the values of its ports.
struct Fact {
  std::string condition;
  std::vector<std::string> arguments;
};

/// What is known: the latest message on the topic `beliefs`. It changes in `update` only, between ticks.
class Beliefs {
 public:
  using Message = PACKAGE::msg::Beliefs;
  using Belief = PACKAGE::msg::Belief;

  explicit Beliefs(const std::shared_ptr<rclcpp::Node>& node)
      : logger_(node->get_logger()),
        group_(node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive, false)) {
    executor_.add_callback_group(group_, node->get_node_base_interface());
    rclcpp::SubscriptionOptions options;
    options.callback_group = group_;
    subscription_ = node->create_subscription<Message>(
        "beliefs", rclcpp::QoS(1),
        [this](std::shared_ptr<const Message> message) { latest_ = std::move(message); }, options);
  }

  Beliefs(const Beliefs&) = delete;
  Beliefs& operator=(const Beliefs&) = delete;

  /// Take what has arrived.
  void update() { executor_.spin_some(); }

  /// Has there been any message?
  bool any() const { return latest_ != nullptr; }

  /// What the latest message says of a fact: one that it does not name is unknown.
  std::uint8_t value(const Fact& fact) const {
    if (latest_) {
      for (const auto& one : latest_->beliefs) {
        if (one.condition == fact.condition && one.arguments == fact.arguments) {
          return one.value;
        }
      }
    }
    return Belief::UNKNOWN;
  }

  /// Say what a tree waits for: at once, and then every ten seconds.
  void sayWaiting(const std::set<std::string>& facts) {
    const auto now = std::chrono::steady_clock::now();
    if (said_ && now - *said_ < std::chrono::seconds(10)) {
      return;
    }
    said_ = now;
    std::string text;
    for (const auto& fact : facts) {
      text += (text.empty() ? "" : ", ") + fact;
    }
    RCLCPP_WARN(logger_, "waiting for the topic beliefs to tell of %s", text.c_str());
  }

 private:
  rclcpp::Logger logger_;
  rclcpp::CallbackGroup::SharedPtr group_;
  rclcpp::executors::SingleThreadedExecutor executor_;
  rclcpp::Subscription<Message>::SharedPtr subscription_;
  std::shared_ptr<const Message> latest_;
  std::optional<std::chrono::steady_clock::time_point> said_;
};

/// A condition answers at once, with RUNNING where the fact is unknown. So it does where that is never so in
/// the domain: nothing that needs it starts then.
class BeliefCondition : public BT::ConditionNode {
 public:
  BeliefCondition(const std::string& name, const BT::NodeConfig& config, std::shared_ptr<Beliefs> beliefs)
      : BT::ConditionNode(name, config), beliefs_(std::move(beliefs)) {}

  /// The fact that it reads.
  virtual Fact fact() const = 0;

  /// Can it be unknown in the domain?
  virtual bool canBeUnknown() const = 0;

  /// Has a message told of it? That it is unknown is an answer where it can be.
  bool isTold() const {
    return beliefs_->any() && (canBeUnknown() || beliefs_->value(fact()) != Beliefs::Belief::UNKNOWN);
  }

 private:
  BT::NodeStatus tick() override {
    switch (beliefs_->value(fact())) {
      case Beliefs::Belief::TRUE:
        return BT::NodeStatus::SUCCESS;
      case Beliefs::Belief::FALSE:
        return BT::NodeStatus::FAILURE;
      default:
        return BT::NodeStatus::RUNNING;
    }
  }

  std::shared_ptr<Beliefs> beliefs_;
};

/// Take what has arrived: to be called before every tick. Says whether the tree may be ticked: one that has
/// not begun waits, however long, until every condition of it has been told.
inline bool isReady(Beliefs& beliefs, const BT::Tree& tree) {
  beliefs.update();
  if (tree.rootNode()->status() != BT::NodeStatus::IDLE) {
    return true;
  }
  std::set<std::string> missing;
  for (const auto& subtree : tree.subtrees) {
    for (const auto& node : subtree->nodes) {
      const auto* condition = dynamic_cast<const BeliefCondition*>(node.get());
      if (condition != nullptr && !condition->isTold()) {
        const Fact fact = condition->fact();
        std::string text = fact.condition + "(";
        for (const auto& argument : fact.arguments) {
          text += (&argument == fact.arguments.data() ? "" : ", ") + argument;
        }
        missing.insert(text + ")");
      }
    }
  }
  if (!missing.empty()) {
    beliefs.sayWaiting(missing);
  }
  return missing.empty();
}
"""
)

_CONDITION = """\
/// TOLD
class NAME : public BeliefCondition {
 public:
  using BeliefCondition::BeliefCondition;

  static BT::PortsList providedPorts() { return PORTS; }

  Fact fact() const override { return {FACT, ARGUMENTS}; }
  bool canBeUnknown() const override { return UNKNOWN; }
};
"""

_ACTION = """\
/// TOLD
class NAME : public BT::RosActionNode<TYPE> {
 public:
  using BT::RosActionNode<TYPE>::RosActionNode;

  static BT::PortsList providedPorts() { return providedBasicPorts(PORTS); }

  bool setGoal(Goal& request) override {
FIELDS
    return true;
  }

  BT::NodeStatus onResultReceived(const WrappedResult& result) override {
    return result.result->success ? BT::NodeStatus::SUCCESS : BT::NodeStatus::FAILURE;
  }

  BT::NodeStatus onFailure(BT::ActionNodeErrorCode /*error*/) override { return BT::NodeStatus::FAILURE; }
};
"""

_SERVICE = """\
/// TOLD
class NAME : public BT::RosServiceNode<TYPE> {
 public:
  using BT::RosServiceNode<TYPE>::RosServiceNode;

  static BT::PortsList providedPorts() { return providedBasicPorts(PORTS); }

  bool setRequest(Request::SharedPtr& given) override {
    auto& request = *given;
FIELDS
    return true;
  }

  BT::NodeStatus onResponseReceived(const Response::SharedPtr& response) override {
    return response->success ? BT::NodeStatus::SUCCESS : BT::NodeStatus::FAILURE;
  }

  BT::NodeStatus onFailure(BT::ServiceNodeErrorCode /*error*/) override { return BT::NodeStatus::FAILURE; }
};
"""

_MAIN = """\
// Runs the tree as a node of ROS 2. Made by bbtc.
#include <chrono>
#include <memory>

#include <rclcpp/rclcpp.hpp>

#include "leaves.hpp"

int main(int argc, char** argv) {
  // With the signal handlers of rclcpp, no goal could be cancelled any more after Ctrl-C.
  rclcpp::init(argc, argv, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  const auto node = std::make_shared<rclcpp::Node>("PACKAGE");
  BT::RosNodeParams params;
  params.nh = node;
  BT::BehaviorTreeFactory factory;
  const auto beliefs = ROBOT_TREE::registerLeaves(factory, params);
  factory.registerBehaviorTreeFromFile(TREE_FILE);
  // A tree runs once: its latches stay latched. Make a new one for another run.
  auto tree = factory.createTree(ROBOT_TREE::kMainTree);
  const auto ready = [&] { return ROBOT_TREE::isReady(*beliefs, tree); };
  const BT::NodeStatus status = ROBOT_TREE::run(tree, std::chrono::milliseconds(20), ready);
  RCLCPP_INFO(node->get_logger(), "the tree returned %s", BT::toStr(status).c_str());
  rclcpp::shutdown();
  return status == BT::NodeStatus::SUCCESS ? 0 : 1;
}
"""

_CMAKE = """\
cmake_minimum_required(VERSION 3.16)
project(PACKAGE LANGUAGES CXX)

set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(rclcpp REQUIRED)
find_package(behaviortree_ros2 REQUIRED)

rosidl_generate_interfaces(${PROJECT_NAME}
INTERFACES
)
rosidl_get_typesupport_target(interfaces ${PROJECT_NAME} rosidl_typesupport_cpp)

add_executable(main main.cpp)
ament_target_dependencies(main rclcpp behaviortree_ros2)
target_link_libraries(main "${interfaces}")
target_compile_definitions(main PRIVATE TREE_FILE="${CMAKE_INSTALL_PREFIX}/share/${PROJECT_NAME}/tree.xml")

install(TARGETS main DESTINATION lib/${PROJECT_NAME})
install(FILES tree.xml palette.xml DESTINATION share/${PROJECT_NAME})
ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""

_PACKAGE_XML = """\
<?xml version="1.0"?>
<package format="3">
  <name>PACKAGE</name>
  <version>0.1.0</version>
  <description>A behavior tree, made by bbtc</description>
  <maintainer email="you@example.org">you</maintainer>
  <license>to be chosen</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>behaviortree_ros2</depend>
  <depend>rclcpp</depend>
  <depend>action_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""

_README = """\
# A behavior tree for ROS 2, made by bbtc

```
colcon build --packages-select PACKAGE
ros2 run PACKAGE main
```

It needs `behaviortree_ros2`. Write a server for each KIND here, and a node that publishes what is known on
the topic `beliefs`, as `msg/Beliefs`: for each fact the id of its condition, its arguments, and its value.
All facts stand in one message. Publish it again and again, since the tree may start later.

Before its first tick the tree waits, however long, for a message that tells of every fact it reads, but for
those that can be unknown; it says what it waits for. From then on a fact that the latest message does not
name is unknown: its condition is RUNNING, and nothing that needs it starts.

These files are yours, but for `tree.xml`, `palette.xml` and `bbtc_nodes*`: a later export leaves alone what
you have changed. Where your `leaves.hpp` does not fit the tree any more, it says so, and writes
`leaves.hpp.new` beside it.
"""
