// Nodes of belief behavior trees for BehaviorTree.CPP 4.6 and later: Skipper, Latch, While, Held, Committed.
// C++17, this header only. Part of bbtc (Apache-2.0); https://www.apache.org/licenses/LICENSE-2.0
#ifndef BBTC_NODES_HPP  // not "pragma once": each tree of a program may bring along its own copy
#define BBTC_NODES_HPP

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include <behaviortree_cpp/behavior_tree.h>
#include <behaviortree_cpp/bt_factory.h>
#include <behaviortree_cpp/control_node.h>
#include <behaviortree_cpp/decorator_node.h>

namespace bbtc {

class Held;

/// What the nodes of one tree know of the action that runs.
struct Commitment {
  bool running = false;    ///< An action runs.
  bool committed = false;  ///< An action was running when the tick began.
  bool called = false;     ///< The tick has come to an action.
  std::map<std::string, BT::NodeStatus> held;  ///< What the running action may set, as it was before.
  std::vector<Held*> leaves;                   ///< What reads facts.
};

/// Around a condition: what it returned before the running action began, if that may set it; else what it
/// returns. It is known by its id and those of its ports that tell more than their default, in the order of
/// their names: "At(place=hall)".
class Held : public BT::DecoratorNode {
 public:
  Held(const std::string& name, const BT::NodeConfig& config) : BT::DecoratorNode(name, config) {}

  static BT::PortsList providedPorts() { return {}; }

  std::string fact() const {
    const BT::TreeNode& leaf = *child();
    std::map<std::string, std::string> ports;
    for (const auto& [port, value] : leaf.config().input_ports) {
      const std::string given = leaf.getInput<std::string>(port).value();
      if (given != leaf.config().manifest->ports.at(port).defaultValueString()) {
        ports[port] = given;
      }
    }
    std::string text = leaf.registrationName() + "(";
    for (const auto& [port, value] : ports) {
      text += (text.back() == '(' ? "" : ",") + port + "=" + value;
    }
    return text + ")";
  }

  /// What the condition returns now.
  BT::NodeStatus read() {
    const BT::NodeStatus status = child_node_->executeTick();
    resetChild();
    return status;
  }

 private:
  friend class Committed;

  BT::NodeStatus tick() override {
    setStatus(BT::NodeStatus::RUNNING);
    if (commitment_ != nullptr && !commitment_->held.empty()) {
      const auto found = commitment_->held.find(fact());
      if (found != commitment_->held.end()) {
        return found->second;
      }
    }
    return read();
  }

  std::shared_ptr<Commitment> commitment_;
};

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

/// In a Latch, right before its action: the action goes on while the condition succeeds.
class While : public BT::DecoratorNode {
 public:
  While(const std::string& name, const BT::NodeConfig& config) : BT::DecoratorNode(name, config) {}

  static BT::PortsList providedPorts() { return {}; }

 private:
  BT::NodeStatus tick() override {
    setStatus(BT::NodeStatus::RUNNING);
    const BT::NodeStatus status = child_node_->executeTick();
    resetChild();
    return status;
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
/// halt and completion of the tree: make a new tree for another run. With an entry it is kept there, as
/// 'success' or 'failure', and forgotten with any other value.
///
/// Below a Committed it starts nothing in a tick in which another action was running when that began. What
/// it "sets" is held while it runs: facts as a Held knows them, separated by semicolons, where {port} stands
/// for the value of a port around.
class Latch : public BT::ControlNode {
 public:
  Latch(const std::string& name, const BT::NodeConfig& config) : BT::ControlNode(name, config) {}

  static BT::PortsList providedPorts() {
    return {BT::InputPort<bool>("keep", true, "whether the action runs once and its status is kept"),
            BT::InputPort<std::string>(
                "flag", "acting",
                "entry of the root blackboard that is set to true while the action runs"),
            BT::InputPort<std::string>("entry", "",
                                       "entry of the blackboard that its status is kept in"),
            BT::InputPort<std::string>("sets", "", "the facts that are held while the action runs")};
  }

  void halt() override {
    if (started_) {
      ended(BT::NodeStatus::SUCCESS);
    }
    BT::ControlNode::halt();
  }

 private:
  friend class Committed;

  BT::NodeStatus tick() override {
    if (const auto status = kept()) {
      return *status;
    }
    if (children_nodes_.empty()) {
      throw BT::LogicError("[", name(), "]: a Latch needs an action");
    }
    setStatus(BT::NodeStatus::RUNNING);
    bool goes_on = true;
    if (started_) {
      BT::TreeNode* before = childrenCount() < 2 ? nullptr : children_nodes_[childrenCount() - 2];
      goes_on = before == nullptr || before->registrationName() != "While" ||
                before->executeTick() == BT::NodeStatus::SUCCESS;
    } else {
      const BT::NodeStatus ready = readiness();
      if (ready != BT::NodeStatus::SUCCESS) {
        return ready;
      }
      keep_ = getInput<bool>("keep").value();
      flag_ = "@" + getInput<std::string>("flag").value();
      hold();
      listen();
      started_ = true;
    }
    if (commitment_ != nullptr) {
      commitment_->running = commitment_->called = true;
    } else {
      // A number, because that is what `:= false` in a Script makes of the entry.
      config().blackboard->set<double>(flag_, 1.0);
    }
    // An action that does not go on is halted, and counts as run.
    const BT::NodeStatus status =
        goes_on ? children_nodes_.back()->executeTick() : BT::NodeStatus::SUCCESS;
    if (status == BT::NodeStatus::SUCCESS || status == BT::NodeStatus::FAILURE) {
      ended(goes_on && failed_ ? BT::NodeStatus::FAILURE : status);
      resetChildren();
    }
    return BT::NodeStatus::RUNNING;
  }

  /// Notice where the action itself fails: what gives it up in time hides that.
  void listen() {
    failed_ = false;
    BT::TreeNode* leaf = children_nodes_.back();
    while (auto* around = dynamic_cast<BT::DecoratorNode*>(leaf)) {
      leaf = around->child();
    }
    ending_ = leaf->subscribeToStatusChange(
        [this](BT::TimePoint, const BT::TreeNode&, BT::NodeStatus, BT::NodeStatus now) {
          if (now == BT::NodeStatus::FAILURE) {  // not where a clock of its own halts it
            failed_ = true;
          }
        });
  }

  /// The text of a port as it stands in the file.
  std::string text(const std::string& port) const {
    const auto found = config().input_ports.find(port);
    return found == config().input_ports.end() ? "" : found->second;
  }

  std::optional<BT::NodeStatus> kept() const {
    const std::string entry = text("entry");
    if (entry.empty()) {
      return kept_;
    }
    std::string status;
    if (config().blackboard->get(entry, status) && status == "success") {
      return BT::NodeStatus::SUCCESS;
    }
    return status == "failure" ? std::optional(BT::NodeStatus::FAILURE) : std::nullopt;
  }

  /// The action has ended.
  void ended(BT::NodeStatus status) {
    started_ = false;
    if (commitment_ != nullptr) {
      commitment_->running = false;
    }
    const std::string entry = text("entry");
    if (keep_ && entry.empty()) {
      kept_ = status;
    } else if (keep_) {
      config().blackboard->set<std::string>(entry,
                                            status == BT::NodeStatus::SUCCESS ? "success" : "failure");
    }
  }

  /// Write down what the action may set.
  void hold() {
    if (commitment_ == nullptr) {
      return;
    }
    std::string facts = ";";
    std::string port;
    bool in_port = false;
    for (const char letter : text("sets")) {
      if (letter == '{' || letter == '}') {
        if (in_port) {
          facts += config().blackboard->get<std::string>(port);
        }
        in_port = letter == '{';
        port.clear();
      } else if (letter != ' ') {
        (in_port ? port : facts) += letter;
      }
    }
    facts += ";";
    for (Held* leaf : commitment_->leaves) {
      const std::string fact = leaf->fact();
      if (facts.find(";" + fact + ";") != std::string::npos && commitment_->held.count(fact) == 0) {
        commitment_->held[fact] = leaf->read();
      }
    }
  }

  /// SUCCESS where every child before the action succeeds, or else the first other status. RUNNING before
  /// the first Script, which uses something up, where the tick has passed by an action that ran.
  BT::NodeStatus readiness() {
    const bool waits = commitment_ != nullptr && commitment_->committed;
    for (std::size_t index = 0; index + 1 < childrenCount(); ++index) {
      if (waits && children_nodes_[index]->registrationName() == "Script") {
        return BT::NodeStatus::RUNNING;
      }
      if (children_nodes_[index]->registrationName() == "While") {
        continue;
      }
      const BT::NodeStatus status = children_nodes_[index]->executeTick();
      if (status != BT::NodeStatus::SUCCESS && status != BT::NodeStatus::SKIPPED) {
        if (status != BT::NodeStatus::RUNNING) {
          resetChildren();
        }
        return status;
      }
    }
    return waits ? BT::NodeStatus::RUNNING : BT::NodeStatus::SUCCESS;
  }

  std::optional<BT::NodeStatus> kept_;
  BT::TreeNode::StatusChangeSubscriber ending_;
  bool failed_ = false;
  bool started_ = false;
  bool keep_ = true;
  std::string flag_;
  std::shared_ptr<Commitment> commitment_;
};

/// The root of a tree. It knows which action runs: a tick that passes that by is RUNNING, since what the
/// action set may be half done, and all is read anew in the next one. FAILURE where the tree is RUNNING but
/// no action is: something is unknown then that nothing can observe, and nothing would ever change.
class Committed : public BT::DecoratorNode {
 public:
  Committed(const std::string& name, const BT::NodeConfig& config) : BT::DecoratorNode(name, config) {}

  static BT::PortsList providedPorts() { return {}; }

 private:
  BT::NodeStatus tick() override {
    if (commitment_ == nullptr) {
      bind();
    }
    Commitment& now = *commitment_;
    now.committed = now.running;
    now.called = false;
    if (!now.committed) {
      now.held.clear();
    }
    setStatus(BT::NodeStatus::RUNNING);
    const BT::NodeStatus status = child_node_->executeTick();
    if (status != BT::NodeStatus::RUNNING) {
      resetChild();
    }
    if (now.called || now.committed) {
      return BT::NodeStatus::RUNNING;
    }
    if (status == BT::NodeStatus::RUNNING) {
      resetChild();
      return BT::NodeStatus::FAILURE;
    }
    return status;
  }

  /// Tell the nodes below of each other.
  void bind() {
    commitment_ = std::make_shared<Commitment>();
    BT::applyRecursiveVisitor(child_node_, [this](BT::TreeNode* node) {
      if (auto* latch = dynamic_cast<Latch*>(node)) {
        latch->commitment_ = commitment_;
      } else if (auto* leaf = dynamic_cast<Held*>(node)) {
        leaf->commitment_ = commitment_;
        commitment_->leaves.push_back(leaf);
      }
    });
  }

  std::shared_ptr<Commitment> commitment_;
};

/// Makes a factory know these nodes, unless it does so already.
inline void registerNodes(BT::BehaviorTreeFactory& factory) {
  const auto add = [&factory](const std::string& id, auto* type) {
    using Node = std::remove_pointer_t<decltype(type)>;
    if (factory.builders().count(id) == 0) {
      factory.registerNodeType<Node>(id);
    }
  };
  add("Skipper", static_cast<Skipper*>(nullptr));
  add("Latch", static_cast<Latch*>(nullptr));
  add("While", static_cast<While*>(nullptr));
  add("Held", static_cast<Held*>(nullptr));
  add("Committed", static_cast<Committed*>(nullptr));
}

}  // namespace bbtc

#endif  // BBTC_NODES_HPP
