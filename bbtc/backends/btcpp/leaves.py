"""The leaves of a BehaviorTree.CPP tree as C++: a class per condition and action, and the interface of the
robot that they ask."""

from __future__ import annotations

from dataclasses import dataclass

from bbtc.backends.btcpp import cppcode
from bbtc.backends.btcpp.monitor import MonitorTable, key_code
from bbtc.backends.btcpp.names import BtcppNames
from bbtc.backends.btcpp.palette import port_code, signature
from bbtc.backends.interface import Leaf, variable_symbol
from bbtc.ground.task import Task
from bbtc.tree.monitor import Monitor

_ROBOT = """\
// What the tree needs of a robot. Made by bbtc; no need to edit it.
#pragma once

#include <optional>
#include <string>

#include <behaviortree_cpp/basic_types.h>

namespace ROBOT_TREE {

/// A condition answers at once, with nothing where it is unknown. An action is called in every tick while it
/// runs, and answers at once with RUNNING; with SUCCESS when the conditions show what it did; with FAILURE
/// when the robot could not do it. It is cancelled when it is no longer wanted; where another takes its
/// place, in the same tick, but perhaps after the first call of the other.
class Robot {
 public:
  virtual ~Robot() = default;
"""

ACCESS = """\
/// The id of the tree to run.
inline constexpr const char* kMainTree = MAIN_TREE;

/// Tick a tree until it ends, with a pause between ticks. `ready` is asked before each tick; where it says
/// no, the tick is left out. SIGINT (Ctrl-C) and SIGTERM end that, too: the action that runs is cancelled,
/// and the status is RUNNING.
inline BT::NodeStatus run(BT::Tree& tree, std::chrono::milliseconds pause,
                          const std::function<bool()>& ready = [] { return true; }) {
  static volatile std::sig_atomic_t interrupted = 0;
  interrupted = 0;
  const auto interrupt = [](int) { interrupted = 1; };
  const auto on_interrupt = std::signal(SIGINT, interrupt);
  const auto on_terminate = std::signal(SIGTERM, interrupt);
  BT::NodeStatus status = BT::NodeStatus::RUNNING;
  while (interrupted == 0) {
    if (ready()) {
      status = tree.tickOnce();
    }
    if (status != BT::NodeStatus::RUNNING) {
      break;
    }
    tree.sleep(pause);
  }
  if (status == BT::NodeStatus::RUNNING) {
    tree.haltTree();
  }
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_terminate);
  return status;
}

/// The value of a port.
inline std::string argument(const BT::TreeNode& node, const std::string& port) {
  const auto value = node.getInput<std::string>(port);
  if (!value) {
    throw BT::RuntimeError(node.name(), ": ", value.error());
  }
  return value.value();
}
"""
"""C++ that every flavour of the leaves begins with."""

_INCLUDE_MONITOR = """\
#include "monitor_table.hpp"

#include <behavior"""

_LEAVES = (
    """\
// The leaves of the tree: a class for each condition and action. Made by bbtc; no need to edit it.
#pragma once

#include <chrono>
#include <csignal>
#include <functional>
#include <optional>
#include <string>

#include <behaviortree_cpp/action_node.h>
#include <behaviortree_cpp/bt_factory.h>
#include <behaviortree_cpp/condition_node.h>

#include "robot.hpp"

namespace ROBOT_TREE {

"""
    + ACCESS
    + """
/// SUCCESS, FAILURE or RUNNING for true, false or unknown.
inline BT::NodeStatus statusOf(std::optional<bool> value) {
  return !value ? BT::NodeStatus::RUNNING : *value ? BT::NodeStatus::SUCCESS : BT::NodeStatus::FAILURE;
}
"""
)

_STUB = """\
// A robot to start from: copy this file to my_robot.hpp, and fill it in there.
#pragma once

#include <iostream>
#include <optional>
#include <set>
#include <sstream>
#include <string>

#include "robot.hpp"

namespace ROBOT_TREE {

class MyRobot : public Robot {
 public:
  MyRobot() = default;
"""

_STUB_END = """
 private:
  /// Tells, once, of a condition that is to be written.
  template <typename... Words>
  void toDo(const Words&... words) {
    std::ostringstream told;
    (told << ... << words);
    if (told_.insert(told.str()).second) {
      std::cerr << "to do: " << told.str() << '\\n';
    }
  }

  std::set<std::string> told_;
};
"""

_CONDITION = """\
class NAME : public BT::ConditionNode {
 public:
  NAME(const std::string& name, const BT::NodeConfig& config, Robot* robot)
      : BT::ConditionNode(name, config), robot_(robot) {}

  static BT::PortsList providedPorts() { return PORTS; }

 private:
  BT::NodeStatus tick() override { return statusOf(robot_->METHOD(ARGUMENTS)); }

  Robot* robot_;
};
"""

_NUMBER = _CONDITION.replace("statusOf(", "between(*this, ")

_BETWEEN = """\
/// The value of a port that holds a whole number.
inline int bound(const BT::TreeNode& node, const std::string& port) {
  const auto value = node.getInput<int>(port);
  if (!value) {
    throw BT::RuntimeError(node.name(), ": ", value.error());
  }
  return value.value();
}

/// Whether a number is no less than the port at_least and no more than at_most; RUNNING where it is unknown.
inline BT::NodeStatus between(const BT::TreeNode& node, std::optional<int> value) {
  if (!value) {
    return BT::NodeStatus::RUNNING;
  }
  const bool inside = bound(node, "at_least") <= *value && *value <= bound(node, "at_most");
  return inside ? BT::NodeStatus::SUCCESS : BT::NodeStatus::FAILURE;
}
"""

_ACTION = """\
class NAME : public BT::StatefulActionNode {
 public:
  NAME(const std::string& name, const BT::NodeConfig& config, Robot* robot)
      : BT::StatefulActionNode(name, config), robot_(robot) {}

  static BT::PortsList providedPorts() { return PORTS; }

 private:
  BT::NodeStatus onStart() override { return onRunning(); }
  BT::NodeStatus onRunning() override { return robot_->METHOD(ARGUMENTS); }
  void onHalted() override { robot_->CANCEL(ARGUMENTS); }

  Robot* robot_;
};
"""


_KNOWN_CONDITION = """\
class NAME : public BT::ConditionNode {
 public:
  NAME(const std::string& name, const BT::NodeConfig& config, Robot* robot)
      : BT::ConditionNode(name, config), robot_(robot) {}

  static BT::PortsList providedPorts() { return PORTS; }

 private:
  BT::NodeStatus tick() override {
    const std::string fact = KEY;
    return KNOWN;
  }

  Robot* robot_;
};
"""

_WATCHED_ACTION = """\
class NAME : public BT::StatefulActionNode {
 public:
  NAME(const std::string& name, const BT::NodeConfig& config, Robot* robot)
      : BT::StatefulActionNode(name, config), robot_(robot) {}

  static BT::PortsList providedPorts() { return PORTS; }

 private:
  BT::NodeStatus onStart() override {
    if (!robot_->monitor().outside().empty()) {
      return BT::NodeStatus::FAILURE;
    }
    robot_->monitor().begin(KEY);
    return onRunning();
  }
  BT::NodeStatus onRunning() override { return robot_->METHOD(ARGUMENTS); }
  void onHalted() override { robot_->CANCEL(ARGUMENTS); }

  Robot* robot_;
};
"""

MONITOR_ACCESS = (
    ACCESS.replace(
        """\
                          const std::function<bool()>& ready = [] { return true; }) {
""",
        """\
                          const Monitor& monitor,
                          const std::function<bool()>& ready = [] { return true; }) {
""",
    )
    .replace(
        """\
    if (ready()) {
""",
        """\
    if (!monitor.outside().empty()) {
      tree.haltTree();
      status = BT::NodeStatus::FAILURE;
    } else if (ready() && !monitor.waits()) {
""",
    )
    .replace(
        """\
inline BT::NodeStatus run(""",
        """\
/// Where the monitor says that what happened is outside the model, the tree fails. Before its first tick it
/// waits for what the robot is told before its first action.
inline BT::NodeStatus run(""",
    )
)
"""The same with a monitor."""

_MONITOR_MEMBER = """\

  Robot() = default;
  Robot(const Robot&) = delete;
  Robot& operator=(const Robot&) = delete;

  /// Knows what is hidden from what the robot is told. Call `told` for each of these, in the moment in which
  /// its effects are seen, with what its observations told:TELLINGS
  Monitor& monitor() { return monitor_; }
"""

_SEE = """\

 private:
  /// What the monitor asks for.
  std::optional<bool> see(const std::string& fact) {
SEEN
    return std::nullopt;
  }

  Monitor monitor_{monitorTable(), [this](const std::string& fact) { return see(fact); }};
};
"""


@dataclass(frozen=True, slots=True)
class Program:
    """What a program is called: its package, the C++ namespace of its leaves, and the tree it runs; and
    whether that tree has our control nodes."""

    package: str
    space: str
    main_tree: str
    our_nodes: bool


class LeafWriter:
    """Writes the C++ of the leaves. Class and method names are ids with a word added, so that none is a
    keyword or a macro."""

    def __init__(
        self, task: Task, names: BtcppNames, program: Program, monitor: Monitor | None = None
    ) -> None:
        self._monitor = monitor
        self._task = task
        self._program = program
        self._space = program.space
        self._names = names

    def class_name(self, leaf: Leaf) -> str:
        """``SeenCondition``, ``DetectAction``."""
        return f"{self._names.plain[leaf.symbol]}{'Action' if leaf.symbol.kind == 'action' else 'Condition'}"

    def method(self, leaf: Leaf) -> str:
        """``isSeen``, ``doDetect``."""
        verb = "do" if leaf.symbol.kind == "action" else "get" if leaf.counts else "is"
        return f"{verb}{self._names.plain[leaf.symbol]}"

    def cancel(self, leaf: Leaf) -> str:
        """``cancelDetect``."""
        return f"cancel{self._names.plain[leaf.symbol]}"

    def declaration(self, leaf: Leaf, method: str, *, named: bool = True) -> str:
        """``std::optional<bool> isSeen(const std::string& item)``; names as comments where unused."""
        if method == self.cancel(leaf):
            result = "void"
        elif leaf.symbol.kind == "action":
            result = "BT::NodeStatus"
        elif leaf.counts:
            result = "std::optional<int>"
        else:
            result = "std::optional<bool>" if leaf.three_valued else "bool"
        listed = [p if named else f"/*{p}*/" for p in cppcode.parameters(leaf.parameters)]
        return f"{result} {method}({', '.join(f'const std::string& {p}' for p in listed)})"

    def leaves(self) -> list[Leaf]:
        """Conditions, then actions."""
        return [*self._names.interface.conditions, *self._names.interface.actions]

    def asked(self) -> list[Leaf]:
        """Those that the robot answers: conditions, then actions."""
        return [*self._names.interface.asked, *self._names.interface.actions]

    def robot(self) -> str:
        """``robot.hpp``: the interface of the robot."""
        if self._monitor is None:
            lines = [self._open(_ROBOT)]
        else:
            lines = [self._open(_ROBOT.replace("#include <behavior", _INCLUDE_MONITOR)), *self._watching()]
        for leaf in self.asked():
            said = cppcode.comment(signature(leaf))
            if leaf.symbol.kind == "action":
                lines += ["", f"  /// Start or continue {said}."]
                lines += [f"  virtual {self.declaration(leaf, self.method(leaf))} = 0;"]
                lines += [f"  virtual {self.declaration(leaf, self.cancel(leaf), named=False)} {{}}"]
            elif leaf.counts:
                lines += ["", f"  /// The value of {said}; nothing where that is unknown."]
                lines += [f"  virtual {self.declaration(leaf, self.method(leaf))} = 0;"]
            else:
                unknown = "; nothing where that is unknown" if leaf.three_valued else ""
                lines += ["", f"  /// Whether {said} holds{unknown}."]
                lines += [f"  virtual {self.declaration(leaf, self.method(leaf))} = 0;"]
        end = ["};"] if self._monitor is None else [self._seen(self._monitor).rstrip("\n")]
        return "\n".join([*lines, *end, "", *self._close()])

    def _watching(self) -> list[str]:
        """The access to the monitor."""
        assert self._monitor is not None
        table = MonitorTable(self._task, self._names, self._monitor)
        told = ""
        for action, readings in self._monitor.readings.items():
            listed = ", ".join(map(cppcode.literal, readings)) or "nothing but that it was done"
            name = cppcode.comment(cppcode.literal(table.action(action)))
            told += f"\n  ///   {name}: {cppcode.comment(listed)}"
        return [_MONITOR_MEMBER.replace("TELLINGS", told).rstrip("\n")]

    def _seen(self, monitor: Monitor) -> str:
        """What the monitor asks the robot for."""
        table = MonitorTable(self._task, self._names, monitor)
        lines = []
        for index in sorted(monitor.seen):
            read = self._task.variables[index]
            leaf = self._names.interface.leaves[variable_symbol(read)]
            args = ", ".join(cppcode.literal(self._names.values[arg]) for arg in read.args)
            lines += [f"    if (fact == {cppcode.literal(table.fact(index))}) {{"]
            lines += [f"      return {self.method(leaf)}({args});", "    }"]
        return cppcode.fill(_SEE, SEEN="\n".join(lines) or "    (void)fact;")

    def header(self) -> str:
        """``leaves.hpp``: the classes, and the function that registers them."""
        words = {"ROBOT_TREE": self._space, "MAIN_TREE": cppcode.literal(self._program.main_tree)}
        head = _LEAVES if self._monitor is None else _LEAVES.replace(ACCESS, MONITOR_ACCESS)
        if self._program.our_nodes:
            head = head.replace('#include "robot.hpp"', '#include "bbtc_nodes.hpp"\n#include "robot.hpp"')
        counts = any(leaf.counts for leaf in self.leaves())
        if counts:
            head = head.replace("#include <functional>\n", "#include <functional>\n#include <limits>\n")
        blocks = [cppcode.fill(head, **words)]
        blocks += [_BETWEEN] if counts else []
        blocks += [self._class(leaf) for leaf in self.leaves()]
        body = [
            f"  factory.registerNodeType<{self.class_name(leaf)}>"
            f"({cppcode.literal(self._names.ids[leaf.symbol])}, robot);"
            for leaf in self.leaves()
        ]
        if self._program.our_nodes:
            body.append("  bbtc::registerNodes(factory);")
        register = [
            "/// Make a factory know every node of the tree. The robot must outlive its trees.",
            "inline void registerLeaves(BT::BehaviorTreeFactory& factory, Robot& the_robot) {",
            "  Robot* robot = &the_robot;",
            *body,
            "}",
            "",
            *self._close(),
        ]
        return "\n".join([*blocks, "\n".join(register)])

    def stub(self) -> str:
        """``robot_stub.hpp``: a robot that knows and can do nothing yet."""
        lines = [self._open(_STUB)]
        for leaf in self.asked():
            if leaf.symbol.kind == "action":
                # Said aloud: a tree that tries without end would else be silent without end.
                words = [cppcode.literal(f"to do: {self.method(leaf)}")]
                words += (f"' ' << {parameter}" for parameter in cppcode.parameters(leaf.parameters))
                body = [f"std::cerr << {' << '.join(words)} << '\\n';", "return BT::NodeStatus::FAILURE;"]
                declared = self.declaration(leaf, self.method(leaf))
            else:
                # Else a tree whose guards it blocks would end without a word.
                open_ = leaf.three_valued or leaf.counts
                said, answer = ("unknown", "std::nullopt") if open_ else ("false", "false")
                words = [cppcode.literal(self.method(leaf))]
                words += (f"' ', {parameter}" for parameter in cppcode.parameters(leaf.parameters))
                words.append(cppcode.literal(f", {said} until then"))
                body = [f"toDo({', '.join(words)});", f"return {answer};"]
                declared = self.declaration(leaf, self.method(leaf))
            lines += ["", f"  {declared} override {{", *(f"    {line}" for line in body), "  }"]
        return "\n".join([*lines, _STUB_END, *self._close()])

    def _class(self, leaf: Leaf) -> str:
        told = f"/// {cppcode.comment(signature(leaf))}\n"
        text = _ACTION if leaf.symbol.kind == "action" else _NUMBER if leaf.counts else _CONDITION
        more: dict[str, str] = {}
        if self._monitor is not None:
            text, more = self._with_monitor(leaf)
        return told + cppcode.fill(
            text,
            **more,
            NAME=self.class_name(leaf),
            METHOD=self.method(leaf),
            CANCEL=self.cancel(leaf),
            ARGUMENTS=", ".join(f"argument(*this, {cppcode.literal(port)})" for port in leaf.parameters),
            PORTS=port_code(self._task, self._names, leaf),
        )

    def _with_monitor(self, leaf: Leaf) -> tuple[str, dict[str, str]]:
        """The class of a leaf that asks the monitor, and what to fill in."""
        key = key_code(self._names, leaf, [f"argument(*this, {cppcode.literal(p)})" for p in leaf.parameters])
        if leaf.symbol.kind == "action":
            return _WATCHED_ACTION, {"KEY": key}
        if leaf.symbol in self._names.interface.deduced:
            return _KNOWN_CONDITION, {"KEY": key, "KNOWN": "statusOf(robot_->monitor().value(fact))"}
        if not any(
            variable_symbol(self._task.variables[index]) == leaf.symbol
            for index in (self._monitor.known if self._monitor is not None else ())
        ):
            return _CONDITION, {}
        known = (
            "statusOf(robot_->monitor().knows(fact) ? robot_->monitor().value(fact)\n"
            "                                                : robot_->METHOD(ARGUMENTS))"
        )
        return _KNOWN_CONDITION.replace("KNOWN", known), {"KEY": key}

    def _open(self, text: str) -> str:
        return cppcode.fill(text, ROBOT_TREE=self._space).rstrip()

    def _close(self) -> list[str]:
        return [f"}}  // namespace {self._space}", ""]
