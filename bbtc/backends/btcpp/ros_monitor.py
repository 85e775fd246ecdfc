"""The leaves for ROS 2 where facts are hidden: what they have beside those of :mod:`bbtc.backends.btcpp.ros`.

The results of actions hold readings; a monitor works out what is known, and conditions ask it.
"""

from __future__ import annotations

from bbtc.backends.btcpp.leaves import ACCESS, MONITOR_ACCESS

_WATCHES = """\
  NAME(const std::string& name, const BT::NodeConfig& config, const BT::RosNodeParams& params,
       std::shared_ptr<Beliefs> beliefs)
      : BASE(name, config, params), beliefs_(std::move(beliefs)) {}
"""

_BEGINS = """\
    if (!beliefs_->monitor().outside().empty()) {
      return false;
    }
    beliefs_->monitor().begin(KEY);
FIELDS
"""

_TELLS = """\
    beliefs_->tell(KEY, RESULT->readings);
    return RESULT->success"""


def watched(text: str, *, tells: bool) -> str:
    """The client of an action that tells the monitor when it starts, and what it was told."""
    is_service = "RosServiceNode" in text
    base = "BT::RosServiceNode<TYPE>" if is_service else "BT::RosActionNode<TYPE>"
    result = "response" if is_service else "result.result"
    text = text.replace(f"  using {base}::{base[4:-6]};\n", _WATCHES.replace("BASE", base))
    text = text.replace("FIELDS\n", _BEGINS)
    if tells:
        text = text.replace(f"    return {result}->success", _TELLS.replace("RESULT", result))
    return text.replace("};\n", "\n private:\n  std::shared_ptr<Beliefs> beliefs_;\n};\n")


_MONITOR_OF_BELIEFS = """\

  /// Knows what is hidden from what the robot was told.
  Monitor& monitor() { return monitor_; }

  /// What an action told; the empty name stands for what is told before the first one.
  void tell(const std::string& action, const std::vector<PACKAGE::msg::Reading>& told) {
    Readings readings;
    for (const auto& one : told) {
      readings[one.name] = one.value;
    }
    monitor_.told(action, readings);
  }

  /// The same name of a fact as the monitor has.
  static std::string nameOf(const std::string& condition, const std::vector<std::string>& arguments) {
    std::string name = condition + "(";
    for (const auto& argument : arguments) {
      name += (&argument == arguments.data() ? "" : ",") + argument;
    }
    return name + ")";
  }

  /// Has a message told of a fact, if only that it is unknown?
  bool hasTold(const std::string& fact) const {
    return latest_ && std::any_of(latest_->beliefs.begin(), latest_->beliefs.end(), [&](const Belief& one) {
             return nameOf(one.condition, one.arguments) == fact;
           });
  }

  /// What is known of a fact, of the latest message or by the monitor.
  std::uint8_t known(const Fact& fact) const {
    const std::string name = nameOf(fact.condition, fact.arguments);
    if (!monitor_.knows(name)) {
      return value(fact);
    }
    const auto value = monitor_.value(name);
    return !value ? Belief::UNKNOWN : *value ? Belief::TRUE : Belief::FALSE;
  }

 private:
  std::optional<bool> see(const std::string& fact) const {
    if (latest_) {
      for (const auto& one : latest_->beliefs) {
        if (nameOf(one.condition, one.arguments) == fact && one.value != Belief::UNKNOWN) {
          return one.value == Belief::TRUE;
        }
      }
    }
    return std::nullopt;
  }

"""

_FIRST_TOLD = """\
  /// Take what has arrived.
  void update() {
    executor_.spin_some();
    if (monitor_.waits() && latest_) {
      tell("", latest_->first);
    }
  }
"""


def watched_head(head: str) -> str:
    """What leaves begin with, with a monitor."""
    head = head.replace(ACCESS, MONITOR_ACCESS).replace("OURS\n", '#include "monitor_table.hpp"\nOURS\n')
    head = head.replace(
        "\n private:\n  std::shared_ptr<rclcpp::Node>",
        f"{_MONITOR_OF_BELIEFS}  std::shared_ptr<rclcpp::Node>",
        1,
    )
    head = head.replace(
        "  /// Take what has arrived.\n  void update() { executor_.spin_some(); }\n", _FIRST_TOLD
    )
    head = head.replace(
        "  std::optional<std::chrono::steady_clock::time_point> said_;\n",
        "  std::optional<std::chrono::steady_clock::time_point> said_;\n"
        "  Monitor monitor_{monitorTable(), [this](const std::string& fact) { return see(fact); }};\n",
    )
    head = head.replace(
        "  if (missing.empty()) {\n",
        "  for (const auto& fact : beliefs.monitor().asks()) {\n"
        "    if (!beliefs.hasTold(fact)) {\n"
        '      missing["beliefs"].insert(fact);\n'
        "    }\n"
        "  }\n"
        "  if (beliefs.monitor().waits()) {\n"
        '    missing["beliefs"].insert("what is told before the first action");\n'
        "  }\n"
        "  if (missing.empty()) {\n",
        1,
    )
    head = head.replace("#include <chrono>\n", "#include <algorithm>\n#include <chrono>\n", 1)
    head = head.replace("switch (beliefs_->value(fact()))", "switch (beliefs_->known(fact()))")
    return head.replace(
        "  bool isTold() const override {\n",
        "  bool isTold() const override {\n"
        "    if (beliefs_->monitor().knows(Beliefs::nameOf(fact().condition, fact().arguments))) {\n"
        "      return true;\n"
        "    }\n",
    )


def watched_main(main: str) -> str:
    """The program, with a monitor."""
    return main.replace("milliseconds(20), ready)", "milliseconds(20), beliefs->monitor(), ready)").replace(
        '  RCLCPP_INFO(node->get_logger(), "the tree',
        "  if (!beliefs->monitor().outside().empty()) {\n"
        '    RCLCPP_WARN(node->get_logger(), "%s", beliefs->monitor().outside().c_str());\n'
        "  }\n"
        '  RCLCPP_INFO(node->get_logger(), "the tree',
    )


READING = """\
# What an observation of an action told, by its name in monitor_table.hpp: whether it seemed true. One that
# was not made is left out. What the robot sees change may stand here, too, so that it is not told too late.
string name
bool value
"""

FIRST_READINGS = """\
# What the robot is told before its first action, if it is told anything: read once, from the first message.
Reading[] first
"""

README = """\

Some facts are hidden. What is known of them no node publishes: the monitor works it out (`monitor.hpp`, and
the table in `monitor_table.hpp`, which names for every action what it tells). So the result of every such
action has `readings`, also where it fails. Where they cannot be in the model, the tree fails, and the log
says why. The two files are made anew by a later export.
"""
