#pragma once
#include <behaviortree_ros2/ros_node_params.hpp>

namespace BT {
enum ActionNodeErrorCode { SERVER_UNREACHABLE };

template <class ActionT>
class RosActionNode : public RosStubNode {
 public:
  using Goal = typename ActionT::Goal;
  struct WrappedResult {
    std::shared_ptr<typename ActionT::Result> result;
  };
  using RosStubNode::RosStubNode;
  static PortsList providedBasicPorts(PortsList addition) { return withBasic("action_name", addition); }
  static PortsList providedPorts() { return providedBasicPorts({}); }
  virtual bool setGoal(Goal& goal) = 0;
  virtual NodeStatus onResultReceived(const WrappedResult& result) = 0;
  virtual NodeStatus onFailure(ActionNodeErrorCode) { return NodeStatus::FAILURE; }

 private:
  bool ask(std::string& shown) override {
    Goal goal;
    const bool right = setGoal(goal);
    shown = Shown<Goal>::of(goal);
    return right;
  }

  NodeStatus answer() override {
    WrappedResult result{std::make_shared<typename ActionT::Result>()};
    succeed(*result.result, 0);
    return onResultReceived(result);
  }
};
}  // namespace BT
