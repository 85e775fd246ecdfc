// As much of rclcpp as generated code uses, to check its syntax without ROS.
#pragma once
#include <memory>
#include <string>

#define RCLCPP_INFO(logger, ...) (void)(logger)

namespace rclcpp {
struct Logger {};
struct Node {
  explicit Node(const std::string&) {}
  Logger get_logger() const { return {}; }
};
struct InitOptions {};
enum class SignalHandlerOptions { All, SigInt, SigTerm, None };
inline void init(int, char**, const InitOptions&, SignalHandlerOptions) {}
inline void shutdown() {}
}  // namespace rclcpp
