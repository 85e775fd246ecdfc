// As much of behaviortree_ros2 as generated code uses, to check its syntax without ROS.
#pragma once
#include <memory>
#include <string>

#include <behaviortree_cpp/bt_factory.h>
#include <rclcpp/rclcpp.hpp>

namespace BT {
struct RosNodeParams {
  std::shared_ptr<rclcpp::Node> nh;
  std::string default_port_value;
};

/// The part that the nodes for actions, services and topics share here.
class RosStubNode : public ActionNodeBase {
 public:
  RosStubNode(const std::string& name, const NodeConfig& config, const RosNodeParams&)
      : ActionNodeBase(name, config) {}
  void halt() override {}
  NodeStatus tick() override { return NodeStatus::FAILURE; }

 protected:
  static PortsList withBasic(const char* basic, PortsList addition) {
    PortsList all = {InputPort<std::string>(basic, "", "")};
    for (const auto& port : addition) {
      if (!all.insert(port).second) {
        throw LogicError("two ports are called ", port.first);
      }
    }
    return all;
  }
};
}  // namespace BT
