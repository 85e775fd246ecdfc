// As much of rclcpp as generated code uses, to compile and run it without ROS: messages come from the test.
#pragma once
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#define RCLCPP_STUB_LOG(level, logger, ...) \
  ((void)(logger), std::printf(level ": "), std::printf(__VA_ARGS__), std::printf("\n"))
#define RCLCPP_INFO(logger, ...) RCLCPP_STUB_LOG("info", logger, __VA_ARGS__)
#define RCLCPP_ERROR(logger, ...) RCLCPP_STUB_LOG("error", logger, __VA_ARGS__)
#define RCLCPP_WARN(logger, ...) RCLCPP_STUB_LOG("warning", logger, __VA_ARGS__)

namespace rclcpp {

struct Node;

struct Logger {
  Logger() = delete;  // as in ROS
  explicit Logger(const Node*) {}
};

enum class CallbackGroupType { MutuallyExclusive, Reentrant };

/// What waits to be handed to the subscriptions of the group.
struct CallbackGroup {
  using SharedPtr = std::shared_ptr<CallbackGroup>;
  std::vector<std::function<void()>> waiting;
};

struct QoS {
  explicit QoS(std::size_t) {}
  QoS& best_effort() { return *this; }
  QoS& transient_local() { return *this; }
};

struct SubscriptionOptions {
  CallbackGroup::SharedPtr callback_group;
};

struct SubscriptionBase {
  virtual ~SubscriptionBase() = default;
};

template <typename Message>
struct Subscription : SubscriptionBase {
  using SharedPtr = std::shared_ptr<Subscription<Message>>;
  std::function<void(std::shared_ptr<const Message>)> callback;
  CallbackGroup::SharedPtr group;
};

struct NodeBase {};

struct Node {
  explicit Node(const std::string&) { latest() = this; }

  Logger get_logger() const { return Logger(this); }
  std::shared_ptr<NodeBase> get_node_base_interface() { return std::make_shared<NodeBase>(); }

  CallbackGroup::SharedPtr create_callback_group(CallbackGroupType, bool /*automatically*/ = true) {
    return std::make_shared<CallbackGroup>();
  }

  template <typename Message, typename Callback>
  typename Subscription<Message>::SharedPtr create_subscription(const std::string& topic, const QoS&,
                                                                Callback&& callback,
                                                                const SubscriptionOptions& options) {
    auto made = std::make_shared<Subscription<Message>>();
    made->callback = std::forward<Callback>(callback);
    made->group = options.callback_group;
    if (!subscriptions[topic].expired()) {
      std::printf("a second subscription to %s\n", topic.c_str());
    }
    subscriptions[topic] = made;
    return made;
  }

  /// For tests: send a message, which is taken when the executor of the subscription spins.
  template <typename Message>
  void publish(const std::string& topic, const Message& message) {
    const auto base = subscriptions.at(topic).lock();
    const auto to = std::dynamic_pointer_cast<Subscription<Message>>(base);
    const auto sent = std::make_shared<const Message>(message);
    to->group->waiting.push_back([to, sent] { to->callback(sent); });
  }

  /// For tests: the node that was made last.
  static Node*& latest() {
    static Node* node = nullptr;
    return node;
  }

  std::map<std::string, std::weak_ptr<SubscriptionBase>> subscriptions;
};

/// For tests: called whenever an executor spins, before it does.
inline std::function<void()>& onSpin() {
  static std::function<void()> called;
  return called;
}

namespace executors {
struct SingleThreadedExecutor {
  void add_callback_group(const CallbackGroup::SharedPtr& group, const std::shared_ptr<NodeBase>&) {
    groups.push_back(group);
  }

  void spin_some() {
    if (onSpin()) {
      onSpin()();
    }
    for (const auto& group : groups) {
      for (const auto& call : std::exchange(group->waiting, {})) {
        call();
      }
    }
  }

  std::vector<CallbackGroup::SharedPtr> groups;
};
}  // namespace executors

struct InitOptions {};
enum class SignalHandlerOptions { All, SigInt, SigTerm, None };
inline void init(int, char**, const InitOptions&, SignalHandlerOptions) {}
inline void shutdown() {}

/// What is left without the arguments of ROS, which begin with --ros-args.
inline std::vector<std::string> remove_ros_arguments(int count, char const* const* given) {
  std::vector<std::string> left;
  for (int next = 0; next < count && std::string(given[next]) != "--ros-args"; ++next) {
    left.emplace_back(given[next]);
  }
  return left;
}
}  // namespace rclcpp
