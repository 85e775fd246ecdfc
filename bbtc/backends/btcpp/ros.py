"""The leaves of a BehaviorTree.CPP tree as clients in ROS 2, with ``behaviortree_ros2``: a package with its
interfaces. An action is a client of a ROS action (or service); a condition reads the latest beliefs from a
topic, because a condition must answer at once: one that waits for a service would seem unknown."""

from __future__ import annotations

from bbtc.backends.btcpp import cppcode, ros_text
from bbtc.backends.btcpp.bindings.entries import Bindings
from bbtc.backends.btcpp.leaves import Program
from bbtc.backends.btcpp.monitor import key_code, monitor_files
from bbtc.backends.btcpp.names import BtcppNames
from bbtc.backends.btcpp.palette import port_code, signature
from bbtc.backends.btcpp.ros_bound import BoundWriter, bound_to_ros
from bbtc.backends.btcpp.ros_monitor import (
    FIRST_READINGS,
    READING,
    README,
    watched,
    watched_head,
    watched_main,
)
from bbtc.backends.exporter import Begun
from bbtc.backends.interface import Leaf, action_symbol
from bbtc.backends.names import Symbol, interface_header
from bbtc.diagnostics import BbtcError
from bbtc.ground.task import Task
from bbtc.tree.monitor import FIRST
from bbtc.tree.nodes import Tree


def ros_files(
    tree: Tree, names: BtcppNames, program: Program, services: bool, bindings: Bindings
) -> dict[str, str]:
    """The files of the package, by name. Actions that are not bound are ROS actions, or else ``services``.
    Raises :class:`BbtcError` for bindings that do not fit."""
    bound = BoundWriter(tree, names, bound_to_ros(tree, names, bindings))
    writer = _RosWriter(tree, names, program, services, bound)
    files = {
        "CMakeLists.txt": writer.cmake(),
        "package.xml": writer.package(),
        "README.md": cppcode.fill(ros_text.README, PACKAGE=program.package, KIND=writer.kind),
        "leaves.hpp": writer.header(),
        "main.cpp": cppcode.fill(
            ros_text.MAIN if tree.monitor is None else watched_main(ros_text.MAIN),
            PACKAGE=program.package,
            ROBOT_TREE=program.space,
        ),
        "msg/Belief.msg": ros_text.BELIEF,
        "msg/Beliefs.msg": ros_text.BELIEFS,
    }
    if tree.monitor is not None:
        files["msg/Reading.msg"] = READING
        files["msg/Beliefs.msg"] += FIRST_READINGS
        files["README.md"] += README
    # To be adapted by their user: an export that comes later leaves them alone.
    begun: dict[str, str] = {name: Begun(text) for name, text in (files | writer.interfaces()).items()}
    return (
        begun
        if tree.monitor is None
        else begun | monitor_files(tree.task, names, tree.monitor, program.space)
    )


class _RosWriter:
    def __init__(
        self, tree: Tree, names: BtcppNames, program: Program, services: bool, bound: BoundWriter
    ) -> None:
        counted = next((leaf for leaf in names.interface.conditions if leaf.counts), None)
        if counted is not None:
            raise BbtcError.single(
                "BBT0441",
                f"the ROS 2 package does not know numbers, such as {signature(counted)}",
                hint="with `-O leaves=cpp` the robot is a class that is asked for them",
            )
        self._task: Task = tree.task
        self._monitor = tree.monitor
        self._names = names
        self._program = program
        self._services = services
        self._bound = bound
        self.kind = "service" if services else "action"
        self._folder = "srv" if services else "action"
        taken = {"belief", "beliefs"} | (set() if tree.monitor is None else {"reading"})
        self._types: dict[Symbol, str] = {}
        for leaf in self._own_actions():
            # Names of interfaces have no underscores.
            name = names.plain[leaf.symbol].replace("_", "")
            if name.upper() == name:  # EOF, NULL: may be a macro
                name += "Task"
            while name.casefold() in taken:
                name += "X"
            taken.add(name.casefold())
            self._types[leaf.symbol] = name

    def _own_actions(self) -> list[Leaf]:
        """The actions whose interface is made here."""
        return [leaf for leaf in self._names.interface.actions if leaf.symbol not in self._bound.leaves]

    def package(self) -> str:
        """``package.xml``."""
        text = cppcode.fill(ros_text.PACKAGE_XML, PACKAGE=self._program.package)
        used = "".join(f"  <depend>{name}</depend>\n" for name in self._bound.packages())
        return text.replace("  <exec_depend>", f"{used}  <exec_depend>", 1)

    def interfaces(self) -> dict[str, str]:
        """The definition of every action or service."""
        return {
            f"{self._folder}/{self._types[leaf.symbol]}.{self._folder}": "\n".join(
                [
                    f"# {cppcode.comment(signature(leaf))}",
                    *(f"string {field}" for field in cppcode.parameters(leaf.parameters)),
                    "---",
                    "bool success",
                    *(["Reading[] readings"] if self._tells(leaf) else []),
                    *([] if self._services else ["---"]),
                    "",
                ]
            )
            for leaf in self._own_actions()
        }

    def cmake(self) -> str:
        """``CMakeLists.txt``."""
        messages = ["msg/Belief.msg", "msg/Beliefs.msg"] + (["msg/Reading.msg"] if self._monitor else [])
        paths = [f'  "{name}"' for name in [*messages, *self.interfaces()]]
        text = cppcode.fill(ros_text.CMAKE, PACKAGE=self._program.package, INTERFACES="\n".join(paths))
        found = "".join(f"find_package({name} REQUIRED)\n" for name in self._bound.packages())
        used = "".join(f" {name}" for name in self._bound.packages())
        return text.replace("\nrosidl_generate", f"{found}\nrosidl_generate", 1).replace(
            "rclcpp behaviortree_ros2)", f"rclcpp behaviortree_ros2{used})", 1
        )

    def header(self) -> str:
        """``leaves.hpp``."""
        package, space = self._program.package, self._program.space
        includes = [f'#include "{package}/msg/beliefs.hpp"']
        names = map(interface_header, self._types.values())
        includes += [f'#include "{package}/{self._folder}/{name}.hpp"' for name in names]
        includes += self._bound.includes()
        kinds = sorted(self._bound.kinds() | {self.kind})
        blocks = [
            cppcode.fill(
                ros_text.HEAD if self._monitor is None else watched_head(ros_text.HEAD),
                INCLUDES="\n".join(includes),
                CLIENT="\n".join(f"#include <behaviortree_ros2/bt_{kind}_node.hpp>" for kind in kinds),
                LATEST=ros_text.LATEST if self._bound.leaves else "",
                LISTEN=ros_text.LISTEN if self._bound.leaves else "",
                LISTENED=ros_text.LISTENED if self._bound.leaves else "",
                OURS='#include "bbtc_nodes.hpp"\n' if self._program.our_nodes else "",
                PACKAGE=package,
                ROBOT_TREE=space,
                MAIN_TREE=cppcode.literal(self._program.main_tree),
            )
        ]
        blocks += [self._bound.head()] if self._bound.leaves else []
        blocks += [
            self._bound.leaf(leaf.symbol) or self._condition(leaf)
            for leaf in self._names.interface.conditions
        ]
        blocks += [
            self._bound.leaf(leaf.symbol) or self._action(leaf) for leaf in self._names.interface.actions
        ]
        return "\n".join([*blocks, self._register()])

    def _condition(self, leaf: Leaf) -> str:
        names = [f"argument(*this, {cppcode.literal(port)})" for port in leaf.parameters]
        return cppcode.fill(
            ros_text.CONDITION,
            TOLD=cppcode.comment(signature(leaf)),
            NAME=f"{self._names.plain[leaf.symbol]}Condition",
            PORTS=port_code(self._task, self._names, leaf),
            FACT=cppcode.literal(self._names.ids[leaf.symbol]),
            ARGUMENTS=f"{{{', '.join(names)}}}",
            UNKNOWN="true" if leaf.three_valued else "false",
        )

    def _action(self, leaf: Leaf) -> str:
        fields = [
            f"    request.{field} = argument(*this, {cppcode.literal(port)});"
            for field, port in zip(cppcode.parameters(leaf.parameters), leaf.parameters, strict=True)
        ]
        kind = self._types[leaf.symbol]
        text = ros_text.SERVICE if self._services else ros_text.ACTION
        if self._monitor is not None:
            text = watched(text, tells=self._tells(leaf))
        key = key_code(self._names, leaf, [f"argument(*this, {cppcode.literal(p)})" for p in leaf.parameters])
        return cppcode.fill(
            text,
            KEY=key,
            TOLD=cppcode.comment(signature(leaf)),
            NAME=f"{self._names.plain[leaf.symbol]}Action",
            TYPE=f"{self._program.package}::{self._folder}::{kind}",
            PORTS=port_code(self._task, self._names, leaf),
            FIELDS="\n".join(fields) if fields else f"    (void)request;  // {self.kind} without arguments",
        )

    def _tells(self, leaf: Leaf) -> bool:
        """Does the monitor wait for what actions of this schema tell?"""
        names = () if self._monitor is None else self._monitor.readings.keys() - {FIRST}
        return any(action_symbol(self._task.action_by_name[name]) == leaf.symbol for name in names)

    def _register(self) -> str:
        lines = [
            "/// Make a factory know every node of the tree, as clients of a ROS node. What its conditions",
            "/// read is to be given to isReady before every tick.",
            "inline std::shared_ptr<Beliefs> registerLeaves(BT::BehaviorTreeFactory& factory,",
            "                                               BT::RosNodeParams params) {",
            *(["  bbtc::registerNodes(factory);"] if self._program.our_nodes else []),
            "  // In later versions of behaviortree_ros2 the pointer is a weak one.",
            "  auto beliefs = std::make_shared<Beliefs>(std::weak_ptr<rclcpp::Node>(params.nh).lock());",
        ]
        conditions = [leaf.symbol for leaf in self._names.interface.conditions]
        lines += [self._registration(symbol, "Condition", "beliefs") for symbol in conditions]
        for leaf in self._names.interface.actions:
            own = self._types.get(leaf.symbol, "")
            server = cppcode.literal(self._bound.server(leaf.symbol) or interface_header(own))
            lines.append(f"  params.default_port_value = {server};")
            given = "params" if self._monitor is None else "params, beliefs"
            lines.append(self._registration(leaf.symbol, "Action", given))
        return "\n".join(
            [*lines, "  return beliefs;", "}", "", f"}}  // namespace {self._program.space}", ""]
        )

    def _registration(self, symbol: Symbol, suffix: str, given: str) -> str:
        name = f"{self._names.plain[symbol]}{suffix}"
        return f"  factory.registerNodeType<{name}>({cppcode.literal(self._names.ids[symbol])}, {given});"
