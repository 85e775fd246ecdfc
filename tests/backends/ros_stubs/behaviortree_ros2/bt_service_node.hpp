#pragma once
#include <behaviortree_ros2/ros_node_params.hpp>

namespace BT {
enum ServiceNodeErrorCode { SERVICE_UNREACHABLE };

template <class ServiceT>
class RosServiceNode : public RosStubNode {
 public:
  using Request = typename ServiceT::Request;
  using Response = typename ServiceT::Response;
  using RosStubNode::RosStubNode;
  static PortsList providedBasicPorts(PortsList addition) { return withBasic("service_name", addition); }
  static PortsList providedPorts() { return providedBasicPorts({}); }
  virtual bool setRequest(typename Request::SharedPtr& request) = 0;
  virtual NodeStatus onResponseReceived(const typename Response::SharedPtr& response) = 0;
  virtual NodeStatus onFailure(ServiceNodeErrorCode) { return NodeStatus::FAILURE; }

 private:
  bool ask(std::string& shown) override {
    auto request = std::make_shared<Request>();
    const bool right = setRequest(request);
    shown = Shown<Request>::of(*request);
    return right;
  }

  NodeStatus answer() override {
    auto response = std::make_shared<Response>();
    succeed(*response, 0);
    return onResponseReceived(response);
  }
};
}  // namespace BT
