// As much of behaviortree_ros2 as generated code uses, to compile and run it without ROS. Servers answer at once.
#pragma once
#include <cstdio>
#include <memory>
#include <string>

#include <behaviortree_cpp/bt_factory.h>
#include <rclcpp/rclcpp.hpp>

namespace BT {
struct RosNodeParams {
#ifdef LATER_ROS_NODE_PARAMS
  std::weak_ptr<rclcpp::Node> nh;
#else
  std::shared_ptr<rclcpp::Node> nh;
#endif
  std::string default_port_value;
};

/// What is printed of a request: for tests, which tell for their types.
template <class Request>
struct Shown {
  static std::string of(const Request&) { return ""; }
};

/// A result tells of success, if it can.
template <class Result>
auto succeed(Result& result, int) -> decltype(result.success = true, void()) {
  result.success = true;
}
template <class Result>
void succeed(Result&, long) {}

/// The part that the nodes for actions and services share here: a request in the first tick, which is printed,
/// and its answer in the next.
class RosStubNode : public ActionNodeBase {
 public:
  RosStubNode(const std::string& name, const NodeConfig& config, const RosNodeParams& params)
      : ActionNodeBase(name, config), server_(params.default_port_value) {}

  void halt() override {
    if (status() == NodeStatus::RUNNING) {
      std::printf("cancel %s\n", server_.c_str());
    }
    resetStatus();
  }

 protected:
  NodeStatus tick() override {
    if (status() == NodeStatus::RUNNING) {
      return answer();
    }
    setStatus(NodeStatus::RUNNING);
    std::string shown;
    if (!ask(shown)) {
      return NodeStatus::FAILURE;
    }
    std::printf("ask %s%s\n", server_.c_str(), shown.c_str());
    return NodeStatus::RUNNING;
  }

  virtual bool ask(std::string& shown) = 0;
  virtual NodeStatus answer() = 0;

  static PortsList withBasic(const char* basic, PortsList addition) {
    PortsList all = {InputPort<std::string>(basic, "", "")};
    for (const auto& port : addition) {
      if (!all.insert(port).second) {
        throw LogicError("two ports are called ", port.first);
      }
    }
    return all;
  }

 private:
  std::string server_;
};
}  // namespace BT
