#pragma once
#include <behaviortree_ros2/ros_node_params.hpp>

namespace BT {
template <class TopicT>
class RosTopicSubNode : public RosStubNode {
 public:
  using RosStubNode::RosStubNode;
  static PortsList providedBasicPorts(PortsList addition) { return withBasic("topic_name", addition); }
  static PortsList providedPorts() { return providedBasicPorts({}); }
  virtual NodeStatus onTick(const std::shared_ptr<TopicT>& last_msg) = 0;
};
}  // namespace BT
