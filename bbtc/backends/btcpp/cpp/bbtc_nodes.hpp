// Control nodes of belief behavior trees for BehaviorTree.CPP 4.6 and later: Skipper and Latch.
// C++17, this header only. Part of bbtc (Apache-2.0); https://www.apache.org/licenses/LICENSE-2.0
#ifndef BBTC_NODES_HPP  // not "pragma once": each tree of a program may bring along its own copy
#define BBTC_NODES_HPP

#include <optional>
#include <string>

#include <behaviortree_cpp/bt_factory.h>
#include <behaviortree_cpp/control_node.h>

namespace bbtc {

/// Goes on to the next child while a child returns RUNNING; returns the first SUCCESS or FAILURE, and
/// RUNNING if all children do. Memoryless: every tick starts at the first child. It is to unknown what
/// a Sequence is to true and a Fallback to false.
class Skipper : public BT::ControlNode {
 public:
  Skipper(const std::string& name, const BT::NodeConfig& config) : BT::ControlNode(name, config) {}

  static BT::PortsList providedPorts() { return {}; }

 private:
  BT::NodeStatus tick() override {
    setStatus(BT::NodeStatus::RUNNING);
    bool all_skipped = true;
    for (std::size_t index = 0; index < childrenCount(); ++index) {
      const BT::NodeStatus status = children_nodes_[index]->executeTick();
      all_skipped = all_skipped && status == BT::NodeStatus::SKIPPED;
      if (status == BT::NodeStatus::SUCCESS || status == BT::NodeStatus::FAILURE) {
        resetChildren();
        return status;
      }
      if (status == BT::NodeStatus::IDLE) {
        throw BT::LogicError("[", name(), "]: a child must not return IDLE");
      }
    }
    if (all_skipped) {
      resetChildren();
      return BT::NodeStatus::SKIPPED;
    }
    return BT::NodeStatus::RUNNING;
  }
};

/// Runs an action, its last child, once: when the action has ended, its status is kept and returned from
/// the next tick on (conditions further left were read before the action's effect). An action that is
/// halted after its start counts as run, and successful, because its own effect often is what halts it.
///
/// Children before the action must succeed, in this order, before it starts; they are read in every tick
/// until then, and not while it runs.
///
/// With keep="false" the action starts again whenever it is ticked after its end. A kept status outlives
/// halt and completion of the tree: make a new tree for another run.
class Latch : public BT::ControlNode {
 public:
  Latch(const std::string& name, const BT::NodeConfig& config) : BT::ControlNode(name, config) {}

  static BT::PortsList providedPorts() {
    return {BT::InputPort<bool>("keep", true, "whether the action runs once and its status is kept"),
            BT::InputPort<std::string>(
                "flag", "acting",
                "entry of the root blackboard that is set to true while the action runs")};
  }

  void halt() override {
    if (started_ && keep_) {
      kept_ = BT::NodeStatus::SUCCESS;
    }
    started_ = false;
    BT::ControlNode::halt();
  }

 private:
  BT::NodeStatus tick() override {
    if (kept_) {
      return *kept_;
    }
    if (children_nodes_.empty()) {
      throw BT::LogicError("[", name(), "]: a Latch needs an action");
    }
    setStatus(BT::NodeStatus::RUNNING);
    if (!started_) {
      const BT::NodeStatus ready = readiness();
      if (ready != BT::NodeStatus::SUCCESS) {
        return ready;
      }
      keep_ = getInput<bool>("keep").value();
      flag_ = "@" + getInput<std::string>("flag").value();
      started_ = true;
    }
    // A number, because that is what `:= false` in a Script makes of the entry.
    config().blackboard->set<double>(flag_, 1.0);
    const BT::NodeStatus status = children_nodes_.back()->executeTick();
    if (status == BT::NodeStatus::SUCCESS || status == BT::NodeStatus::FAILURE) {
      started_ = false;
      if (keep_) {
        kept_ = status;
      }
      resetChildren();
    }
    return BT::NodeStatus::RUNNING;
  }

  /// SUCCESS where every child before the action succeeds, or else the first other status.
  BT::NodeStatus readiness() {
    for (std::size_t index = 0; index + 1 < childrenCount(); ++index) {
      const BT::NodeStatus status = children_nodes_[index]->executeTick();
      if (status != BT::NodeStatus::SUCCESS && status != BT::NodeStatus::SKIPPED) {
        if (status != BT::NodeStatus::RUNNING) {
          resetChildren();
        }
        return status;
      }
    }
    return BT::NodeStatus::SUCCESS;
  }

  std::optional<BT::NodeStatus> kept_;
  bool started_ = false;
  bool keep_ = true;
  std::string flag_;
};

/// Makes a factory know both nodes, unless it does so already.
inline void registerNodes(BT::BehaviorTreeFactory& factory) {
  if (factory.builders().count("Skipper") != 0 && factory.builders().count("Latch") != 0) {
    return;
  }
  factory.registerNodeType<Skipper>("Skipper");
  factory.registerNodeType<Latch>("Latch");
}

}  // namespace bbtc

#endif  // BBTC_NODES_HPP
