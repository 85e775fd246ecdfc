"""The leaves for ROS 2 that are bound to actions, services and topics with types that there are, see
docs/bindings.md."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from bbtc.artefacts.cursor import clip
from bbtc.backends.btcpp import cppcode, ros_text
from bbtc.backends.btcpp.bindings.bound import BoundLeaf, bound_leaves
from bbtc.backends.btcpp.bindings.entries import (
    Argument,
    Bindings,
    Comparison,
    Entry,
    Given,
    RosCall,
    RosTopic,
    Text,
)
from bbtc.backends.btcpp.names import BtcppNames
from bbtc.backends.btcpp.palette import port_code, signature
from bbtc.backends.names import Symbol, interface_header
from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.tree.nodes import Tree

_LARGEST = 2**63 - 1
_COMPARE = {
    "==": "equal_to",
    "!=": "not_equal_to",
    "<=": "less_equal",
    ">=": "greater_equal",
    "<": "less",
    ">": "greater",
}


def bound_to_ros(tree: Tree, names: BtcppNames, bindings: Bindings) -> dict[Symbol, BoundLeaf]:
    """The leaves of a tree that are bound to ROS 2. Raises :class:`BbtcError`: BBT0708 for what the domain or
    a table does not have, BBT0713 for what the package has no part for."""
    leaves = bound_leaves(tree, names.interface, bindings)
    faults = [fault for bound in leaves.values() if (fault := _refused(tree, bound)) is not None]
    if faults:
        raise BbtcError(faults)
    return leaves


def _refused(tree: Tree, bound: BoundLeaf) -> Diagnostic | None:
    binding, name = bound.binding, clip(bound.binding.name)
    if tree.monitor is not None:
        message = f"'{name}' is bound, but facts are hidden here: a monitor must be told what actions observe"
        return Diagnostic("BBT0713", message, binding.span)
    if binding.call is None and binding.topic is None:
        message = f"'{name}' is bound to a node only, which the program for ROS 2 does not load"
        return Diagnostic(
            "BBT0713", message, binding.span, hint="say what stands for it in ROS 2, under `ros`"
        )
    topic = binding.topic
    if topic is not None and bound.leaf.three_valued and not topic.nan:
        message = f"'{name}' can be unknown, and the topic does not tell when it is"
        hint = "say `unknown: nan` where its value is no number then"
        return Diagnostic("BBT0713", message, topic.span, hint=hint)
    return None


@dataclass(frozen=True, slots=True)
class BoundWriter:
    """Writes the C++ of bound leaves, and what a package says to use their types."""

    tree: Tree
    names: BtcppNames
    leaves: Mapping[Symbol, BoundLeaf]

    def packages(self) -> list[str]:
        """The packages of the types, sorted."""
        return sorted({parts[0] for parts in self._types()})

    def includes(self) -> list[str]:
        """The lines that include the types."""
        if not self.leaves:
            return []
        headers = dict.fromkeys(
            f"{p}/{folder}/{interface_header(name)}.hpp" for p, folder, name in self._types()
        )
        standard = [f"#include <{name}>" for name in ("cmath", "type_traits", "typeinfo")]
        return [*standard, *(f'#include "{header}"' for header in headers)]

    def kinds(self) -> set[str]:
        """``action``, ``service``, or both."""
        return {bound.binding.call.kind for bound in self.leaves.values() if bound.binding.call is not None}

    def head(self) -> str:
        """What the classes rest on."""
        return f"\n{_VALUES}" if self.leaves else ""

    def leaf(self, symbol: Symbol) -> str | None:
        """The class of a leaf; None where it is not bound."""
        if symbol not in self.leaves:
            return None
        bound = self.leaves[symbol]
        binding = bound.binding
        if binding.call is not None:
            return self._call(bound, binding.call)
        assert binding.topic is not None
        return self._topic(bound, binding.topic)

    def server(self, symbol: Symbol) -> str | None:
        """The name of the server of an action; None where it is not bound."""
        call = self.leaves[symbol].binding.call if symbol in self.leaves else None
        return None if call is None else call.server

    # --- classes -----------------------------------------------------------------------------

    def _call(self, bound: BoundLeaf, call: RosCall) -> str:
        result = "result.result" if call.kind == "action" else "response"
        if call.success is None:
            answer = f"    (void){result.partition('.')[0]};\n    return BT::NodeStatus::SUCCESS;"
        else:
            compared = self._compared(bound, call.success, f"{result}->", None)
            answer = (
                f"    return {compared}.value_or(false) ? BT::NodeStatus::SUCCESS : BT::NodeStatus::FAILURE;"
            )
        return cppcode.fill(
            _ACTION if call.kind == "action" else _SERVICE,
            TOLD=cppcode.comment(signature(bound.leaf)),
            NAME=f"{self.names.plain[bound.leaf.symbol]}Action",
            TYPE="::".join(call.type),
            PORTS=port_code(self.tree.task, self.names, bound.leaf),
            FIELDS=self._fields(bound, call.fields) or "    (void)request;",
            ANSWER=answer,
        )

    def _topic(self, bound: BoundLeaf, topic: RosTopic) -> str:
        value = topic.where.value
        arguments = [f"argument(*this, {cppcode.literal(port)})" for port in bound.leaf.parameters]
        if isinstance(value, Argument) and value.table is not None:
            cases = [
                f"    if (object == {cppcode.literal(shown)}) {{\n"
                f"      return {self._compared(bound, topic.where, 'message.', row)};\n    }}\n"
                for name, shown in self._objects(value)
                if (row := value.looked_up(name)) is not None
            ]
            port = cppcode.literal(bound.leaf.parameters[bound.position(value)])
            answer = f"    const std::string object = argument(*this, {port});\n{''.join(cases)}"
            answer += '    throw BT::RuntimeError(name(), ": nothing is said of ", object);'
        else:
            answer = f"    return {self._compared(bound, topic.where, 'message.', None)};"
        return cppcode.fill(
            _TOPIC,
            TOLD=cppcode.comment(signature(bound.leaf)),
            NAME=f"{self.names.plain[bound.leaf.symbol]}Condition",
            TYPE="::".join(topic.type),
            PORTS=port_code(self.tree.task, self.names, bound.leaf),
            FACT=cppcode.literal(self.names.ids[bound.leaf.symbol]),
            ARGUMENTS=f"{{{', '.join(arguments)}}}",
            TOPIC=cppcode.literal(topic.topic),
            LATCHED="true" if topic.latched else "false",
            UNKNOWN="true" if bound.leaf.three_valued else "false",
            ANSWER=answer,
        )

    def _types(self) -> list[tuple[str, str, str]]:
        uses = (bound.binding.call or bound.binding.topic for bound in self.leaves.values())
        return sorted({use.type for use in uses if use is not None})

    def _objects(self, argument: Argument) -> list[tuple[str, str]]:
        """The objects that a table tells of, with their names in ports."""
        assert argument.table is not None
        values = self.names.values
        return [(name, values[name]) for name in argument.table.rows if name in values]

    # --- values ------------------------------------------------------------------------------

    def _fields(self, bound: BoundLeaf, fields: tuple[Given, ...]) -> str:
        """The statements that fill in a goal or a request."""
        lines: list[str] = []
        tables: dict[str, dict[str, list[str]]] = {}
        for given in fields:
            value, target = given.value, f"request.{given.name}"
            assert not isinstance(value, Entry)
            if isinstance(value, Text):
                lines.append(f"    {_assigned(target, value)}")
                continue
            port = bound.leaf.parameters[bound.position(value)]
            if value.table is None:
                lines.append(f"    setText({target}, argument(*this, {cppcode.literal(port)}));")
                continue
            cases = tables.setdefault(port, {})
            for name, shown in self._objects(value):
                row = value.looked_up(name)
                if row is not None:
                    cases.setdefault(shown, []).append(f"      {_assigned(target, row)}")
        for port, cases in tables.items():
            lines += ["    {", f"    const std::string object = argument(*this, {cppcode.literal(port)});"]
            word = "if"
            for shown, statements in cases.items():
                lines += [f"    {word} (object == {cppcode.literal(shown)}) {{", *statements]
                word = "} else if"
            lines += ["    } else {", "      return false;", "    }", "    }"]
        return "\n".join(lines)

    def _compared(self, bound: BoundLeaf, test: Comparison, prefix: str, row: Text | None) -> str:
        value = test.value if row is None else row
        operator = f"std::{_COMPARE[test.operator]}<>()"
        target = f"{prefix}{test.member}"
        match value:
            case Text(text, "number"):
                return f"comparedNumber({target}, {operator}, {_number(text)})"
            case Text(text, "truth"):
                return f"comparedTruth({target}, {operator}, {text})"
            case Text(text):
                return f"comparedText({target}, {operator}, {cppcode.literal(text)})"
            case Argument():
                port = bound.leaf.parameters[bound.position(value)]
                return f"comparedText({target}, {operator}, argument(*this, {cppcode.literal(port)}))"


def _assigned(target: str, value: Text) -> str:
    match value.plain:
        case "number":
            return f"setNumber({target}, {_number(value.text)});"
        case "truth":
            return f"setTruth({target}, {value.text});"
        case _:
            return f"setText({target}, {cppcode.literal(value.text)});"


def _number(text: str) -> str:
    """A number in C++: exact where it is whole."""
    if text.lstrip("+-").isdigit() and abs(int(text)) <= _LARGEST:
        return f"{int(text)}LL"
    value = float(text)
    assert math.isfinite(value)
    return repr(value)


_VALUES = """\
/// Fill in a field of a message. One of another kind is told when this is compiled, a number that does not
/// fit when it runs.
template <typename Field, typename Number>
void setNumber(Field& field, Number value) {
  static_assert(std::is_arithmetic_v<Field> && !std::is_same_v<Field, bool>, "this field is no number");
  field = static_cast<Field>(value);
  if (std::is_integral_v<Field> && static_cast<Number>(field) != value) {
    throw BT::RuntimeError("the number ", std::to_string(value), " does not fit its field");
  }
}

template <typename Field>
void setTruth(Field& field, bool value) {
  static_assert(std::is_same_v<Field, bool>, "this field is no truth value");
  field = value;
}

template <typename Field>
void setText(Field& field, const std::string& value) {
  static_assert(std::is_same_v<Field, std::string>, "this field is no text");
  field = value;
}

/// Compare a field of a message, by its own precision; nothing where it is no number (NaN).
template <typename Field, typename Compare, typename Number>
std::optional<bool> comparedNumber(const Field& field, Compare compare, Number value) {
  static_assert(std::is_arithmetic_v<Field> && !std::is_same_v<Field, bool>, "this field is no number");
  if constexpr (std::is_floating_point_v<Field>) {
    return std::isnan(field) ? std::nullopt : std::optional<bool>(compare(field, static_cast<Field>(value)));
  } else if constexpr (std::is_integral_v<Number> && std::is_unsigned_v<Field>) {
    return value < 0 ? compare(0LL, value)
                     : compare(static_cast<std::uint64_t>(field), static_cast<std::uint64_t>(value));
  } else {
    return compare(field, value);
  }
}

template <typename Field, typename Compare>
std::optional<bool> comparedTruth(const Field& field, Compare compare, bool value) {
  static_assert(std::is_same_v<Field, bool>, "this field is no truth value");
  return compare(field, value);
}

template <typename Field, typename Compare>
std::optional<bool> comparedText(const Field& field, Compare compare, const std::string& value) {
  static_assert(std::is_same_v<Field, std::string>, "this field is no text");
  return compare(field, value);
}

/// A condition that answers from the latest message of a topic; with RUNNING before the first, and where the
/// value is no number.
template <typename Message>
class TopicCondition : public ToldCondition {
 public:
  TopicCondition(const std::string& name, const BT::NodeConfig& config,
                 std::shared_ptr<const Latest<Message>> latest)
      : ToldCondition(name, config), latest_(std::move(latest)) {}

  /// What a message tells; nothing where that is unknown.
  virtual std::optional<bool> answer(const Message& message) const = 0;

  bool isTold() const override {
    return latest_->message && (canBeUnknown() || answer(*latest_->message).has_value());
  }

 private:
  BT::NodeStatus tick() override {
    const auto value = latest_->message ? answer(*latest_->message) : std::nullopt;
    return !value ? BT::NodeStatus::RUNNING : *value ? BT::NodeStatus::SUCCESS : BT::NodeStatus::FAILURE;
  }

  std::shared_ptr<const Latest<Message>> latest_;
};
"""

_TOPIC = """\
/// TOLD
class NAME : public TopicCondition<TYPE> {
 public:
  NAME(const std::string& name, const BT::NodeConfig& config, const std::shared_ptr<Beliefs>& beliefs)
      : TopicCondition(name, config, beliefs->listen<TYPE>(TOPIC, LATCHED)) {}

  static BT::PortsList providedPorts() { return PORTS; }

  std::string topic() const override { return TOPIC; }
  std::string what() const override { return shown({FACT, ARGUMENTS}); }
  bool canBeUnknown() const override { return UNKNOWN; }

  std::optional<bool> answer(const TYPE& message) const override {
ANSWER
  }
};
"""

_ENDS = "    return {}->success ? BT::NodeStatus::SUCCESS : BT::NodeStatus::FAILURE;"
_ACTION = ros_text.ACTION.replace(_ENDS.format("result.result"), "ANSWER")
_SERVICE = ros_text.SERVICE.replace(_ENDS.format("response"), "ANSWER")
