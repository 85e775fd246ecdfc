"""Texts of packages for ROS 2: C++ and the files around it. Words in capitals are filled in."""

from __future__ import annotations

from bbtc.backends.btcpp.leaves import ACCESS

LATEST = """
/// The latest message of a topic, once there is one.
template <typename Message>
struct Latest {
  std::shared_ptr<const Message> message;
  typename rclcpp::Subscription<Message>::SharedPtr subscription;
};
"""

LISTEN = """
  /// The latest message of a topic, which changes in `update` only. Of a topic whose last message waits for
  /// those who come later (`latched`), that one counts.
  template <typename Message>
  std::shared_ptr<const Latest<Message>> listen(const std::string& topic, bool latched) {
    auto& known = listened_[topic + ' ' + typeid(Message).name()];
    if (!known) {
      auto made = std::make_shared<Latest<Message>>();
      rclcpp::SubscriptionOptions options;
      options.callback_group = group_;
      auto qos = rclcpp::QoS(1);
      made->subscription = node_->create_subscription<Message>(
          topic, latched ? qos.transient_local() : qos.best_effort(),
          [latest = made.get()](std::shared_ptr<const Message> got) { latest->message = std::move(got); },
          options);
      known = made;
    }
    return std::static_pointer_cast<Latest<Message>>(known);
  }
"""

LISTENED = """
  std::map<std::string, std::shared_ptr<void>> listened_;"""

BELIEF = """\
# What is known of a fact, named as in the tree: the id of the condition and the values of its ports.
uint8 FALSE = 0
uint8 UNKNOWN = 1
uint8 TRUE = 2
string condition
string[] arguments
uint8 value
"""

BELIEFS = """\
# All that is known at a moment. Facts that are missing are unknown. Before its first tick, a tree waits for a
# message that tells of every fact it reads, but for those that can be unknown.
Belief[] beliefs
"""

HEAD = (
    """\
// The leaves of the tree as clients in ROS 2. Made by bbtc: a start, to be adapted to your interfaces.
#pragma once

#include <chrono>
#include <csignal>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <behaviortree_cpp/bt_factory.h>
#include <behaviortree_cpp/condition_node.h>
CLIENT
#include <rclcpp/rclcpp.hpp>

OURS
INCLUDES

namespace ROBOT_TREE {

"""
    + ACCESS
    + """
using Seconds = std::chrono::duration<double>;

/// What is thrown where a tree may wait no longer for what its conditions read.
class NotTold : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A fact: the id of its condition, and the values of its ports.
struct Fact {
  std::string condition;
  std::vector<std::string> arguments;
};

/// A fact as people read it: `Seen(soda)`.
inline std::string shown(const Fact& fact) {
  std::string text = fact.condition + "(";
  for (const auto& argument : fact.arguments) {
    text += (&argument == fact.arguments.data() ? "" : ", ") + argument;
  }
  return text + ")";
}
LATEST
/// What is known: the latest message on the topic `beliefs`. It changes in `update` only, between ticks.
class Beliefs {
 public:
  using Message = PACKAGE::msg::Beliefs;
  using Belief = PACKAGE::msg::Belief;

  explicit Beliefs(const std::shared_ptr<rclcpp::Node>& node)
      : node_(node),
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
LISTEN
  /// Say what a tree waits for, at once and then every ten seconds; throws NotTold when it has done so for as
  /// long as it may.
  void wait(const std::string& missing, std::optional<Seconds> patience) {
    const auto now = std::chrono::steady_clock::now();
    since_ = since_.value_or(now);
    if (patience && now - *since_ >= *patience) {
      throw NotTold("not told in time: waited for " + missing + "; the tree has not begun");
    }
    if (!said_ || now - *said_ >= std::chrono::seconds(10)) {
      said_ = now;
      RCLCPP_WARN(node_->get_logger(), "waiting for %s", missing.c_str());
    }
  }

 private:
  std::shared_ptr<rclcpp::Node> node_;
  rclcpp::CallbackGroup::SharedPtr group_;
  rclcpp::executors::SingleThreadedExecutor executor_;
  rclcpp::Subscription<Message>::SharedPtr subscription_;
  std::shared_ptr<const Message> latest_;LISTENED
  std::optional<std::chrono::steady_clock::time_point> since_;
  std::optional<std::chrono::steady_clock::time_point> said_;
};

/// A condition answers at once from what has arrived, with RUNNING where the fact is unknown. So it does
/// where that is never so in the domain: nothing that needs it starts then.
class ToldCondition : public BT::ConditionNode {
 public:
  using BT::ConditionNode::ConditionNode;

  /// The topic that tells, and of what, for people.
  virtual std::string topic() const = 0;
  virtual std::string what() const = 0;

  /// Can it be unknown in the domain?
  virtual bool canBeUnknown() const = 0;

  /// Has a message told of it? That it is unknown is an answer where it can be.
  virtual bool isTold() const = 0;
};

/// A condition that the topic `beliefs` tells of.
class BeliefCondition : public ToldCondition {
 public:
  BeliefCondition(const std::string& name, const BT::NodeConfig& config, std::shared_ptr<Beliefs> beliefs)
      : ToldCondition(name, config), beliefs_(std::move(beliefs)) {}

  /// The fact that it reads.
  virtual Fact fact() const = 0;

  std::string topic() const override { return "beliefs"; }
  std::string what() const override { return shown(fact()); }

  bool isTold() const override {
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
/// not begun waits until every condition of it has been told. Throws NotTold where that takes longer than
/// `patience`, if there is any.
inline bool isReady(Beliefs& beliefs, const BT::Tree& tree, std::optional<Seconds> patience = std::nullopt) {
  beliefs.update();
  if (tree.rootNode()->status() != BT::NodeStatus::IDLE) {
    return true;
  }
  std::map<std::string, std::set<std::string>> missing;
  for (const auto& subtree : tree.subtrees) {
    for (const auto& node : subtree->nodes) {
      const auto* condition = dynamic_cast<const ToldCondition*>(node.get());
      if (condition != nullptr && !condition->isTold()) {
        missing[condition->topic()].insert(condition->what());
      }
    }
  }
  if (missing.empty()) {
    return true;
  }
  std::string text;
  for (const auto& [topic, facts] : missing) {
    text += (text.empty() ? "the topic " : ", and the topic ") + topic + " to tell of";
    for (const auto& fact : facts) {
      text += (fact == *facts.begin() ? " " : ", ") + fact;
    }
  }
  beliefs.wait(text, patience);
  return false;
}
"""
)

CONDITION = """\
/// TOLD
class NAME : public BeliefCondition {
 public:
  using BeliefCondition::BeliefCondition;

  static BT::PortsList providedPorts() { return PORTS; }

  Fact fact() const override { return {FACT, ARGUMENTS}; }
  bool canBeUnknown() const override { return UNKNOWN; }
};
"""

ACTION = """\
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

SERVICE = """\
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

MAIN = """\
// Runs the tree as a node of ROS 2. Made by bbtc.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rclcpp/rclcpp.hpp>

#include "leaves.hpp"

// How long the tree waits for what its conditions read before its first tick.
constexpr double kStartupTimeout = 60;  // seconds

namespace {

/// Read `--startup-timeout SECONDS`, or `none` for however long. Says whether the arguments are right.
bool readArguments(const std::vector<std::string>& given, std::optional<ROBOT_TREE::Seconds>& patience) {
  for (std::size_t next = 1; next < given.size(); next += 2) {
    if (given[next] != "--startup-timeout" || next + 1 == given.size()) {
      return false;
    }
    const std::string& text = given[next + 1];
    if (text == "none") {
      patience.reset();
      continue;
    }
    char* end = nullptr;
    const double seconds = std::strtod(text.c_str(), &end);
    if (text.empty() || *end != '\\0' || !(seconds >= 0 && seconds <= 1e9)) {
      return false;
    }
    patience = ROBOT_TREE::Seconds(seconds);
  }
  return true;
}

}  // namespace

/// Returns 0 where the tree succeeds, 1 where it fails or is interrupted, 2 for wrong arguments, and 3 where
/// not all conditions were told in time.
int main(int argc, char** argv) {
  std::optional<ROBOT_TREE::Seconds> patience = ROBOT_TREE::Seconds(kStartupTimeout);
  if (!readArguments(rclcpp::remove_ros_arguments(argc, argv), patience)) {
    std::fputs("usage: main [--startup-timeout SECONDS|none]\\n", stderr);
    return 2;
  }
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
  const auto ready = [&] { return ROBOT_TREE::isReady(*beliefs, tree, patience); };
  BT::NodeStatus status = BT::NodeStatus::IDLE;
  try {
    status = ROBOT_TREE::run(tree, std::chrono::milliseconds(20), ready);
  } catch (const ROBOT_TREE::NotTold& error) {
    RCLCPP_ERROR(node->get_logger(), "%s", error.what());
    rclcpp::shutdown();
    return 3;
  }
  RCLCPP_INFO(node->get_logger(), "the tree returned %s", BT::toStr(status).c_str());
  rclcpp::shutdown();
  return status == BT::NodeStatus::SUCCESS ? 0 : 1;
}
"""

CMAKE = """\
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

PACKAGE_XML = """\
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

README = """\
# A behavior tree for ROS 2, made by bbtc

```
colcon build --packages-select PACKAGE
ros2 run PACKAGE main
```

It needs `behaviortree_ros2`. Write a server for each KIND here, and a node that publishes what is known on
the topic `beliefs`, as `msg/Beliefs`: for each fact the id of its condition, its arguments, and its value.
All facts stand in one message. Publish it again and again, since the tree may start later.

Before its first tick the tree waits for a message that tells of every fact it reads, but for those that can
be unknown; it says what it waits for. After `--startup-timeout` seconds (60, or `none` for however long) it
names what was not told, and ends with status 3. From then on a fact that the latest message does not
name is unknown: its condition is RUNNING, and nothing that needs it starts.

These files are yours, but for `tree.xml`, `palette.xml` and `bbtc_nodes*`: a later export leaves alone what
you have changed. Where your `leaves.hpp` does not fit the tree any more, it says so, and writes
`leaves.hpp.new` beside it.
"""
