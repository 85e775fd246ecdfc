"""Bindings: nodes that others have stand for actions and conditions, and a tree of them does what the tree of
our own leaves does. What does not fit is told with its place.

``BBTC_NAV2_MODELS`` names Nav2's own ``nav2_tree_nodes.xml``, which the last test holds our example against.
"""

from __future__ import annotations

import json
import os
import random
import re
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import yaml
from jsonschema import Draft202012Validator

import bbtc
from bbtc.artefacts import dumps, tree_to_json
from bbtc.backends.btcpp.bindings.fits import misfit
from bbtc.backends.btcpp.bindings.read import files_of, read_bindings
from bbtc.backends.btcpp.exporter import btcpp
from bbtc.backends.btcpp.names import BtcppNames, btcpp_names
from bbtc.backends.btcpp.palette import btcpp_palette
from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.replay.engines import BtcppReplay
from bbtc.replay.script import TIMINGS
from bbtc.source import SourceFile
from bbtc.tree.nodes import Tree
from tests.builder.projects import bbtc as command
from tests.builder.projects import project
from tests.domains.problems import PROBLEMS, Problem, tree_of
from tests.long_form import amount
from tests.replay.compiled import cmake_build, require_library
from tests.replay.random_trees import random_tree
from tests.replay.reference import varied_runs
from tests.strategies import soda_tree

SCHEMA: dict[str, Any] = json.loads(
    (Path(__file__).parents[2] / "docs" / "schemas" / "bbtc-bindings-1.json").read_text(encoding="utf-8")
)

PATROL = """(define (domain patrol)
  (:requirements :typing :probabilistic-effects :unknown)
  (:types room)
  (:predicates (at ?room - room) (battery_low) (unknown (clear ?room - room)))
  (:action go_to :parameters (?to - room)
    :precondition (not (battery_low))
    :effect (probabilistic 0.9 (and (at ?to) (forall (?r - room) (when (not (= ?r ?to)) (not (at ?r)))))))
  (:action dock :parameters () :precondition (battery_low) :effect (not (battery_low)))
  (:action look :parameters (?room - room)
    :precondition (and (at ?room) (unknown (clear ?room)))
    :effect (probabilistic 0.8 (clear ?room) 0.2 (not (clear ?room)))))
(define (problem round)
  (:domain patrol)
  (:objects hall kitchen - room)
  (:init (at hall) (battery_low))
  (:goal (at kitchen)))
"""

MODELS = """<root BTCPP_format="4">
  <TreeNodesModel>
    <Action ID="NavigateToPose">
      <input_port name="goal" type="geometry_msgs::msg::PoseStamped">where to</input_port>
      <input_port name="behavior_tree" type="string"/>
      <input_port name="server_name" type="string"/>
      <output_port name="error_code_id" type="uint16"/>
    </Action>
    <Action ID="DockRobot">
      <input_port name="use_dock_id" type="bool" default="true"/>
      <input_port name="dock_id" type="string"/>
      <input_port name="max_staging_time" type="float" default="1000.0"/>
      <bidirectional_port name="tries" type="int"/>
    </Action>
    <Condition ID="GoalReached"><input_port name="goal" type="geometry_msgs::msg::PoseStamped"/></Condition>
    <Condition ID="IsBatteryLow">
      <input_port name="min_battery" type="double"/>
      <input_port name="battery_topic" type="string" default="&quot;/battery_status&quot;"/>
    </Condition>
    <Control ID="RecoveryNode"/>
  </TreeNodesModel>
</root>
"""

POSES = {"hall": "0;map;0.0;0.5;0.0;0.0;0.0;0.0;1.0", "kitchen": "0;map;4.0;-2.5;0.0;0.0;0.0;1.0;0.0"}
BINDINGS = f"""version: 1
models: [nodes.xml]
omit: [server_name, behavior_tree]
tables:
  poses: {{hall: {POSES["hall"]}, kitchen: {POSES["kitchen"]}}}
actions:
  go_to:
    node: NavigateToPose
    ports:
      goal: {{table: poses, of: to}}
      error_code_id: "{{go_to_error}}"
  dock: {{node: DockRobot, ports: {{dock_id: home, max_staging_time: 20.5, use_dock_id: true}}}}
conditions:
  at: {{node: GoalReached, ports: {{goal: {{table: poses, of: room}}}}}}
  battery_low: {{node: IsBatteryLow, ports: {{min_battery: 0.2}}}}
"""


def patrol() -> Tree:
    return bbtc.plan(SourceFile("patrol.pddl", PATROL)).tree


def bound(
    folder: Path, tree: Tree, bindings: str = BINDINGS, models: str = MODELS, **options: str
) -> ET.Element:
    (folder / "nodes.xml").write_text(models, encoding="utf-8")
    (folder / "bindings.yaml").write_text(bindings, encoding="utf-8")
    return ET.fromstring(btcpp.export(tree, {"bindings": str(folder / "bindings.yaml"), **options}, None))


def faults(folder: Path, bindings: str, models: str = MODELS, tree: Tree | None = None) -> list[str]:
    """What is told of bindings: place, code and message, without the folder."""
    with pytest.raises(BbtcError) as raised:
        bound(folder, tree or patrol(), bindings, models)
    return [each.render().splitlines()[0].replace(f"{folder}/", "") for each in raised.value.diagnostics]


# --- what is written -------------------------------------------------------------------------


def test_our_control_nodes_do_not_hold_nodes_of_others(tmp_path: Path) -> None:
    """They know facts by ids and ports of our leaves: a condition that an action sets would not be held."""
    with pytest.raises(BbtcError) as raised:
        bound(tmp_path, patrol(), nodes="bbtc")
    (fault,) = raised.value.diagnostics
    assert fault.code == "BBT0713"
    actions_only = BINDINGS.partition("conditions:")[0]
    document = bound(tmp_path, patrol(), actions_only, nodes="bbtc")
    latched = [each[-1].tag for each in document.iter("Latch")]
    assert latched
    assert set(latched) <= {"NavigateToPose", "DockRobot"}


def test_every_leaf_is_a_node_of_the_package_with_its_ports(tmp_path: Path) -> None:
    document = bound(tmp_path, patrol())
    used: dict[str, list[dict[str, str]]] = {}
    for tree in document.iter("BehaviorTree"):
        for element in tree.iter():
            ports = {k: v for k, v in element.attrib.items() if k != "name" and not k.startswith("_")}
            if element.tag in ("NavigateToPose", "DockRobot", "GoalReached", "IsBatteryLow"):
                used.setdefault(element.tag, []).append(ports)
            assert element.tag not in ("At", "BatteryLow", "GoTo", "Dock")
    kitchen = POSES["kitchen"]
    assert {str(sorted(each.items())) for each in used["NavigateToPose"]} == {
        str([("error_code_id", "{@go_to_error}"), ("goal", kitchen)])
    }
    assert used["DockRobot"] == [{"dock_id": "home", "max_staging_time": "20.5", "use_dock_id": "true"}]
    assert all(each == {"goal": kitchen} for each in used["GoalReached"])
    assert used["IsBatteryLow"][0] == {"min_battery": "0.2"}
    model = document.find("TreeNodesModel")
    assert model is not None
    described = {each.attrib["ID"]: each for each in model if each.tag != "SubTree" and each.tag != "Control"}
    assert set(described) == set(used)
    goal = described["NavigateToPose"].find("input_port[@name='goal']")
    assert goal is not None
    assert goal.attrib["type"] == "geometry_msgs::msg::PoseStamped"


def test_a_node_that_answers_the_contrary_is_inverted_once(tmp_path: Path) -> None:
    text = BINDINGS.replace("{min_battery: 0.2}", "{min_battery: 0.2}, negated: true")
    plain, negated = bound(tmp_path, patrol()), bound(tmp_path, patrol(), text)

    def under_inverter(document: ET.Element) -> tuple[int, int]:
        inverted = sum(1 for each in document.iter("Inverter") if each.find("IsBatteryLow") is not None)
        every = sum(1 for tree in document.iter("BehaviorTree") for _ in tree.iter("IsBatteryLow"))
        return inverted, every - inverted

    assert under_inverter(plain) == under_inverter(negated)[::-1]
    assert not any(each.find("Inverter") is not None for each in negated.iter("Inverter"))


def test_ids_of_the_models_are_not_taken_for_leaves_of_ours(tmp_path: Path) -> None:
    """An action that is not bound keeps a class of its own, also where a node has its name."""
    models = MODELS.replace('<Control ID="RecoveryNode"/>', '<Action ID="Dock"/><Action ID="GoTo"/>')
    lines = [line for line in BINDINGS.splitlines() if "dock:" not in line]
    document = bound(tmp_path, patrol(), "\n".join(lines), models)
    tags = {each.tag for tree in document.iter("BehaviorTree") for each in tree.iter()}
    assert "DoDock" in tags
    assert not tags & {"Dock", "GoTo"}


def test_an_unused_binding_does_no_harm_and_none_changes_nothing(tmp_path: Path) -> None:
    tree = soda_tree()
    (tmp_path / "empty.yaml").write_text("version: 1\n")
    options = {"bindings": str(tmp_path / "empty.yaml")}
    assert btcpp.export(tree, options, None) == btcpp.export(tree, {}, None)
    assert btcpp_palette.export(tree, options, None) == btcpp_palette.export(tree, {}, None)


# --- the same as the tree of our own leaves --------------------------------------------------


BOUND = ("delivery", "household", "kitting")
"""Domains with templates, conditions that can be unknown, and both."""


def all_bound(tree: Tree) -> str:
    """Bindings of every leaf, each to a node of its own, with a table for every other parameter; every
    other condition is answered by its contrary."""
    names = btcpp_names(tree)
    tables = {"shown": {name: f"row of {value}" for name, value in names.values.items()}}
    given: dict[str, dict[str, object]] = {"actions": {}, "conditions": {}}
    for number, leaf in enumerate(names.interface.leaves.values()):
        parameters = next(
            (
                each.parameters
                for each in tree.task.signatures
                if (each.kind, each.symbol) == (leaf.symbol.kind, leaf.symbol.name)
            ),
            leaf.parameters,
        )
        ports = {
            f"p{place}": {"table": "shown", "of": name} if place % 2 == number % 2 else {"of": name}
            for place, name in enumerate(parameters)
        }
        binding: dict[str, object] = {"node": f"Ext{number}", "ports": ports}
        if leaf.symbol.kind == "predicate":
            binding |= {"negated": number % 2 == 0, "unknown": "running"}
        given["actions" if leaf.symbol.kind == "action" else "conditions"][leaf.symbol.name] = binding
    return yaml.safe_dump({"tables": tables, **given})


def unbound(document: ET.Element, names: BtcppNames) -> str:
    """The document with our leaves put back by the numbers that :func:`all_bound` gave."""
    leaves = list(names.interface.leaves.values())

    def put_back(element: ET.Element) -> None:
        leaf = leaves[int(element.tag.removeprefix("Ext"))]
        element.tag = names.ids[leaf.symbol]
        for place, parameter in enumerate(leaf.parameters):
            element.set(parameter, element.attrib.pop(f"p{place}").removeprefix("row of "))

    for tree in document.iter("BehaviorTree"):
        for parent in list(tree.iter()):
            for at, child in enumerate(parent):
                while child.tag.startswith("Ext"):
                    number = int(child.tag.removeprefix("Ext"))
                    negated = number % 2 == 0 and leaves[number].symbol.kind == "predicate"
                    put_back(child)
                    if negated and parent.tag == "Inverter":
                        parent.tag = "ForceNothing"
                    elif negated:
                        parent[at] = ET.Element("Inverter")
                        parent[at].append(child)
        _drop_wrappers(tree)
    return ET.tostring(document, encoding="unicode")


def _drop_wrappers(tree: ET.Element) -> None:
    for parent in list(tree.iter()):
        for at, child in enumerate(parent):
            if child.tag == "ForceNothing":
                parent[at] = child[0]
                for name, value in child.attrib.items():
                    child[0].set(name, value)


def same_runs(folder: Path, tree: Tree, seed: int) -> int:
    """Compare bound and plain tree in BehaviorTree.CPP; how many runs there were."""
    runs = varied_runs(tree.task, tree.root, seed, keep=4)
    if not runs:
        return 0
    document = bound(folder, tree, all_bound(tree))
    assert not {each.tag for each in document.iter() if each.tag in set(btcpp_names(tree).ids.values())}
    replay, plain = BtcppReplay(tree, unbound(document, btcpp_names(tree))), BtcppReplay(tree)
    for script, expected in runs:
        assert replay.run(script) == expected
        for timing in TIMINGS:  # what a running action sets is held, of nodes of others, too
            assert replay.run(script, timing) == plain.run(script, timing)
    return len(runs)


@pytest.mark.parametrize("problem", [p for p in PROBLEMS if p.domain in BOUND], ids=str)
def test_a_bound_tree_does_what_the_tree_of_our_leaves_does(problem: Problem, tmp_path: Path) -> None:
    pytest.importorskip("behaviortreepy")
    assert same_runs(tmp_path, tree_of(problem), 1) or problem.name == "look-in-fridge"  # which hardly acts


@pytest.mark.parametrize("problem", [p for p in PROBLEMS if p.domain in BOUND], ids=str)
def test_a_file_with_nodes_of_others_is_read_back_as_the_very_same_tree(
    problem: Problem, tmp_path: Path
) -> None:
    """By the same bindings, with the notes at its end and without."""
    tree = tree_of(problem)
    (tmp_path / "bindings.yaml").write_text(all_bound(tree), encoding="utf-8")
    options = {"bindings": str(tmp_path / "bindings.yaml")}
    saved = tmp_path / "tree.json"
    saved.write_text(dumps(tree_to_json(tree)))
    text = btcpp.export(tree, options, None)
    (tmp_path / "tree.xml").write_text(text)
    back = bbtc.import_tree(tmp_path / "tree.xml", saved, bindings=options["bindings"])
    assert dumps(tree_to_json(back)) == saved.read_text()
    (tmp_path / "tree.xml").write_text(re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL))
    edited = bbtc.import_tree(tmp_path / "tree.xml", saved, bindings=options["bindings"])
    assert edited.success_probability == tree.success_probability
    with pytest.raises(BbtcError):  # the nodes are no leaves of the task
        bbtc.import_tree(tmp_path / "tree.xml", saved)


def test_a_node_that_stands_for_nothing_or_for_several_is_told(tmp_path: Path) -> None:
    tree = patrol()
    (tmp_path / "patrol.pddl").write_text(PATROL)
    text = ET.tostring(bound(tmp_path, tree), encoding="unicode")
    task, bindings = tmp_path / "patrol.pddl", tmp_path / "bindings.yaml"

    def told(xml: str) -> str:
        (tmp_path / "edited.xml").write_text(xml)
        with pytest.raises(BbtcError) as raised:
            bbtc.import_tree(tmp_path / "edited.xml", task, bindings=bindings)
        return raised.value.diagnostics[0].message

    assert told(text.replace("map;4.0", "map;5.0")).endswith("stands for nothing of the task")
    assert told(text.replace('min_battery="0.2"', 'min_battery="0.3"')).endswith("for nothing of the task")
    bindings.write_text(BINDINGS.replace(POSES["hall"], POSES["kitchen"]))
    assert "may be each of" in told(text)


def test_random_bound_trees_do_what_those_of_our_leaves_do(tmp_path: Path) -> None:
    pytest.importorskip("behaviortreepy")
    rng, runs = random.Random(5), 0
    for _ in range(amount(8, 300)):
        seed = rng.randrange(10**6)
        tree = random_tree(seed)
        symbols = [leaf.symbol for leaf in btcpp_names(tree).interface.leaves.values()]
        if len({(s.kind, s.name) for s in symbols}) == len(symbols):
            runs += same_runs(tmp_path, tree, seed)
    assert runs


PLUGIN = """
#include <behaviortree_cpp/action_node.h>
#include <behaviortree_cpp/bt_factory.h>
#include <behaviortree_cpp/condition_node.h>

// What the stand-ins share with the program that loads them.
struct Pose { double x = 0; double y = 0; };

namespace BT {
template <> inline Pose convertFromString(StringView text) {
  const auto parts = splitString(text, ';');
  if (parts.size() != 9) throw RuntimeError("a pose has nine parts");
  return {convertFromString<double>(parts[2]), convertFromString<double>(parts[3])};
}
}

static BT::Blackboard::Ptr top(const BT::TreeNode& node) {
  auto board = node.config().blackboard;
  while (auto parent = board->parent()) board = parent;
  return board;
}

class NavigateToPose : public BT::StatefulActionNode {
 public:
  using BT::StatefulActionNode::StatefulActionNode;
  static BT::PortsList providedPorts() {
    return {BT::InputPort<Pose>("goal"), BT::InputPort<std::string>("behavior_tree"),
            BT::InputPort<std::string>("server_name"), BT::OutputPort<uint16_t>("error_code_id")};
  }
  BT::NodeStatus onStart() override { return BT::NodeStatus::RUNNING; }
  BT::NodeStatus onRunning() override {
    const auto goal = getInput<Pose>("goal").value();
    top(*this)->set("x", goal.x);
    setOutput("error_code_id", uint16_t(7));
    return BT::NodeStatus::SUCCESS;
  }
  void onHalted() override {}
};

class DockRobot : public BT::SyncActionNode {
 public:
  using BT::SyncActionNode::SyncActionNode;
  static BT::PortsList providedPorts() {
    return {BT::InputPort<bool>("use_dock_id", true, ""), BT::InputPort<std::string>("dock_id"),
            BT::InputPort<float>("max_staging_time", 1000.0F, ""), BT::BidirectionalPort<int>("tries")};
  }
  BT::NodeStatus tick() override {
    const bool by_id = getInput<bool>("use_dock_id").value();
    const bool right = getInput<std::string>("dock_id").value() == "home" && by_id;
    top(*this)->set("charge", right ? 0.9 : 0.0);
    return BT::NodeStatus::SUCCESS;
  }
};

class GoalReached : public BT::ConditionNode {
 public:
  using BT::ConditionNode::ConditionNode;
  static BT::PortsList providedPorts() { return {BT::InputPort<Pose>("goal")}; }
  BT::NodeStatus tick() override {
    const bool there = getInput<Pose>("goal").value().x == top(*this)->get<double>("x");
    return there ? BT::NodeStatus::SUCCESS : BT::NodeStatus::FAILURE;
  }
};

class IsBatteryLow : public BT::ConditionNode {
 public:
  using BT::ConditionNode::ConditionNode;
  static BT::PortsList providedPorts() {
    return {BT::InputPort<double>("min_battery"),
            BT::InputPort<std::string>("battery_topic", "/battery_status", "")};
  }
  BT::NodeStatus tick() override {
    const bool low = top(*this)->get<double>("charge") <= getInput<double>("min_battery").value();
    return low ? BT::NodeStatus::SUCCESS : BT::NodeStatus::FAILURE;
  }
};

BT_REGISTER_NODES(factory) {
  factory.registerNodeType<NavigateToPose>("NavigateToPose");
  factory.registerNodeType<DockRobot>("DockRobot");
  factory.registerNodeType<GoalReached>("GoalReached");
  factory.registerNodeType<IsBatteryLow>("IsBatteryLow");
}
"""

MAIN = """
#include <behaviortree_cpp/bt_factory.h>
#include <iostream>

int main(int, char** given) {
  BT::BehaviorTreeFactory factory;
  factory.registerFromPlugin(given[1]);
  factory.registerBehaviorTreeFromFile(given[2]);
  auto board = BT::Blackboard::create();
  board->set("x", 0.0);
  board->set("charge", 0.1);
  auto tree = factory.createTree("Round", board);
  const auto status = tree.tickWhileRunning(std::chrono::milliseconds(1));
  std::cout << BT::toStr(status) << " x=" << board->get<double>("x");
  std::cout << " charge=" << board->get<double>("charge");
  std::cout << " error=" << board->get<uint16_t>("go_to_error") << std::endl;
}
"""

CMAKE = """cmake_minimum_required(VERSION 3.16)
project(stand_in CXX)
set(CMAKE_CXX_STANDARD 17)
find_package(Threads REQUIRED)
find_package(behaviortree_cpp REQUIRED)
add_library(nodes SHARED plugin.cpp)
target_compile_definitions(nodes PRIVATE BT_PLUGIN_EXPORT)
target_link_libraries(nodes BT::behaviortree_cpp)
add_executable(main main.cpp)
target_link_libraries(main BT::behaviortree_cpp)
"""


def test_the_engine_loads_the_tree_with_a_plugin_that_has_these_nodes_and_it_drives_there(
    tmp_path: Path,
) -> None:
    require_library()
    for name, text in {"plugin.cpp": PLUGIN, "main.cpp": MAIN, "CMakeLists.txt": CMAKE}.items():
        (tmp_path / name).write_text(text)
    document = bound(tmp_path, patrol())
    (tmp_path / "tree.xml").write_text(ET.tostring(document, encoding="unicode"))
    made = cmake_build(tmp_path, tmp_path / "build")
    assert made.returncode == 0, made.stdout + made.stderr
    plugin = next((tmp_path / "build").glob("libnodes.*"))
    run = [tmp_path / "build" / "main", plugin, tmp_path / "tree.xml"]
    done = subprocess.run(run, capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout == "SUCCESS x=4 charge=0.9 error=7\n", done.stderr


# --- what is wrong ---------------------------------------------------------------------------

FAULTS = """
  dock: {node |  dokc: {node | 12:3 BBT0708 the domain 'patrol' has no action 'dokc'
of: to} | of: too} | 10:7 BBT0708 'go_to' has no parameter 'too'
table: poses, of: to | table: pose, of: to | 10:21 BBT0708 AT go_to.ports.goal.table: there is no table 'pose'
, kitchen: KITCHEN | | 5:3 BBT0708 the table 'poses' has no 'kitchen'
node: DockRobot | node: Dockrobot | 12:16 BBT0710 no model has the node 'Dockrobot'
node: DockRobot | node: IsBatteryLow | 12:16 BBT0710 'IsBatteryLow' is KIND Condition; MUST an Action
node: DockRobot | node: RecoveryNode | 12:16 BBT0710 'RecoveryNode' is KIND Control; MUST an Action
node: IsBatteryLow | node: DockRobot | 15:23 BBT0710 'DockRobot' is KIND Action; MUST a Condition
error_code_id: | error_code: | 11:7 BBT0711 the node 'NavigateToPose' has no port 'error_code'
, behavior_tree] | ] | 8:11 BBT0711 NAVIGATE is not given 'behavior_tree', a port without default
"{go_to_error}" | 7 | 11:7 BBT0711 'error_code_id' of 'NavigateToPose' is an output: OUTPUT
: 20.5 | : soon | 12:50 BBT0712 'soon' DOES 'max_staging_time' of 'DockRobot', TAKES
0;map;0.0;0.5; | map;0.5; | 5:17 BBT0712 'map;0.5;0.0;0.0;0.0;0.0;1.0' for 'hall' DOES 'goal' POSE
dock_id: home | dock_id: "{do ck}" | 12:44 BBT0604 AT dock.ports.dock_id: '{do ck}' is no ENTRY
dock: {node: DockRobot, ports | dock: {ports | 12:10 BBT0603 AT dock.ports: 'ports' needs a 'node'
dock_id: home, | dock_id: home, name: x, | 12:56 BBT0604 AT dock.ports.name: 'name' is not the name of a port
version: 1 | version: 2 | 1:10 BBT0602 at version: this version of bbtc reads version 1
[nodes.xml] | [lost.xml] | 2:10 BBT0001 at models[0]: cannot read lost.xml: there is no such file
models: | modles: | 2:1 BBT0603 at modles: unknown field 'modles'
at: { | at: {negated: maybe, | 14:17 BBT0604 at conditions.at.negated: FLAG
of: to} | of: to, part: 0} | 10:42 BBT0604 AT go_to.ports.goal.part: must be a whole number from 1, of a table
DockRobot, | DockRobot, unknown: running, | 12:27 BBT0603 AT dock.unknown: 'unknown' is for conditions
DockRobot, | DockRobot, node: A, | 12:27 BBT0603 AT dock: 'node' stands twice
"""
"""What is changed, into what, and what is told then."""

SHORT = {
    "AT ": "at actions.",
    "KIND": "a node of the kind",
    "NAVIGATE": "the node 'NavigateToPose'",
    "MUST": "here it must be",
    "TAKES": "which takes a number",
    "DOES": "does not fit port",
    "OUTPUT": "it goes to an entry of the blackboard",
    "FLAG": "must be true or false, not the string 'maybe'",
    "ENTRY": "entry of the blackboard that may stand here",
    "KITCHEN": POSES["kitchen"],
    "POSE": "of 'NavigateToPose', which takes a pose stamp;frame;x;y;z;qx;qy;qz;qw (stamp 0: the latest)",
}


@pytest.mark.parametrize("line", FAULTS.strip("\n").splitlines())
def test_a_fault_has_its_place(line: str, tmp_path: Path) -> None:
    for word, text in SHORT.items():
        line = line.replace(word, text)
    old, new, told = (part.strip() for part in line.split("|"))
    place, code, message = told.split(" ", 2)
    assert old in BINDINGS
    first = faults(tmp_path, BINDINGS.replace(old, new, 1))[0]
    assert first == f"bindings.yaml:{place}: error[{code}]: {message}"


def test_a_near_name_is_offered(tmp_path: Path) -> None:
    for old, new, hint in (
        ("node: DockRobot", "node: Dockrobot", "'DockRobot'"),
        ("dock_id: home", "dockid: home", "'dock_id'"),
        ("  dock: {node", "  dokc: {node", "'dock'"),
        ("of: to}", "of: too}", "'to'"),
    ):
        with pytest.raises(BbtcError) as raised:
            bound(tmp_path, patrol(), BINDINGS.replace(old, new, 1))
        assert any(hint in (each.hint or "") for each in raised.value.diagnostics)


ODD = [
    "{}",
    "[]",
    "null",
    "1e400",
    "{of:to}",
    "{of:1}",
    "&a",
    "*a",
    "-",
    ":",
    "#",
    "é",
    "\x07",
    "node:A",
    "ros:{}",
    "{a:{b:c}}",
    "!!int",
    "0x1F",
    ".nan",
    "<<:",
]


def test_broken_texts_are_told_and_nothing_else_happens(tmp_path: Path) -> None:
    tree, rng, told = patrol(), random.Random(3), list[Diagnostic]()
    for _ in range(amount(75, 20_000)):
        text = BINDINGS
        for _ in range(rng.randint(1, 3)):
            start = rng.randrange(len(text))
            text = text[:start] + rng.choice(ODD) + text[start + rng.randint(0, 12) :]
        try:
            bound(tmp_path, tree, text)
        except BbtcError as error:
            told += error.diagnostics
    assert told
    assert all(each.span is not None for each in told)


@pytest.mark.parametrize(
    ("models", "code"),
    [
        ("<root/>", "BBT0709"),
        ("<root><TreeNodesModel><Leaf ID='A'/></TreeNodesModel></root>", "BBT0709"),
        ("<root><TreeNodesModel><Action/></TreeNodesModel></root>", "BBT0709"),
        ("<root><TreeNodesModel><Action ID='A'/><Action ID='A'/></TreeNodesModel></root>", "BBT0709"),
        ("<root><TreeNodesModel><Action ID='A'><input_port/></Action></TreeNodesModel></root>", "BBT0709"),
        ("<root>", "BBT0614"),
        ("<!DOCTYPE root [<!ENTITY a 'b'>]><root/>", "BBT0614"),
    ],
)
def test_models_that_are_none_are_told_with_the_place(models: str, code: str, tmp_path: Path) -> None:
    (found,) = faults(tmp_path, BINDINGS, models)
    assert f"error[{code}]" in found
    assert found.startswith("nodes.xml:1:")


def test_a_condition_that_can_be_unknown_is_bound_only_where_the_node_can_tell(tmp_path: Path) -> None:
    tree = soda_tree()
    text = "conditions: {seen: {node: SeesIt, ports: {what: {of: ITEM}}EXTRA}}"
    parameter = btcpp_names(tree).interface.conditions[1].parameters[0]
    text = text.replace("ITEM", parameter)
    (found,) = faults(tmp_path, text.replace("EXTRA", ""), tree=tree)
    assert "error[BBT0713]: 'seen' can be unknown, and 'SeesIt' does not tell when it is" in found
    document = bound(tmp_path, tree, text.replace("EXTRA", ", unknown: running"))
    assert [each.get("what") for each in document.iter("SeesIt")]


@pytest.mark.parametrize(
    ("port_type", "good", "bad"),
    [
        ("int", ["0", "-7", "2147483647"], ["2147483648", "1.0", "", "a", " 1"]),
        ("uint16", ["0", "65535"], ["-1", "65536"]),
        ("unsigned int", ["4294967295"], ["-1"]),
        ("std::uint8_t", ["255"], ["256"]),
        ("double", ["1", "-0.5", "1e-3", ".5"], ["1,5", "nan", "", "x"]),
        ("bool", ["true", "0", "False"], ["yes", "2", ""]),
        ("std::chrono::milliseconds", ["20"], ["-1", "1.5", "20ms"]),
        ("vector<int>", ["1;2;3", "1", ""], ["1;a", "1;;2"]),
        ("std::vector<double>", ["1.5;2"], ["1;x"]),
        ("vector<string>", ["a;b", ""], []),
        ("geometry_msgs::msg::Point", ["1;2;3"], ["1;2", "1;2;x"]),
        ("geometry_msgs::msg::Quaternion", ["0;0;0;1"], ["0;0;1"]),
        ("geometry_msgs::msg::PoseStamped", [POSES["hall"], "json:{}"], ["1;2;3", "x" + POSES["hall"]]),
        ("nav_msgs::msg::Goals", ["0;map", f"0;map;{POSES['hall']}"], ["0", f"0;map;{POSES['hall']};1"]),
        ("std::string", ["anything", ""], []),
        ("my_msgs::msg::Own", ["whatever"], []),
        ("", ["whatever"], []),
    ],
)  # fmt: skip
def test_a_text_fits_a_type_or_not(port_type: str, good: list[str], bad: list[str]) -> None:
    assert [text for text in good if misfit(text, port_type)] == []
    assert [text for text in bad if not misfit(text, port_type)] == []


# --- where they are given --------------------------------------------------------------------


def test_the_schema_takes_what_is_read(tmp_path: Path) -> None:
    Draft202012Validator.check_schema(SCHEMA)
    validator = Draft202012Validator(SCHEMA)
    assert validator.is_valid(yaml.safe_load(BINDINGS))
    for wrong in (
        "actions: {a: {}}",
        "actions: {a: {ports: {}}}",
        "modles: []",
        "conditions: {c: {node: 1x}}",
    ):
        assert not validator.is_valid(yaml.safe_load(wrong))
        (tmp_path / "wrong.yaml").write_text(wrong)
        with pytest.raises(BbtcError):
            read_bindings(str(tmp_path / "wrong.yaml"))


def test_the_command_takes_them_and_names_what_it_read(tmp_path: Path) -> None:
    bound(tmp_path, patrol())
    (tmp_path / "patrol.pddl").write_text(PATROL)
    more = ["-O", "bindings=bindings.yaml", "-o", "tree.xml", "--depfile", "tree.d", "-q"]
    done = command(tmp_path, "export", "patrol.pddl", "--to", "btcpp", *more[:-1])
    assert done.returncode == 0, done.stderr
    assert "<NavigateToPose" in (tmp_path / "tree.xml").read_text()
    rule = (tmp_path / "tree.d").read_text()
    assert "bindings.yaml" in rule
    assert "nodes.xml" in rule
    over = command(tmp_path, "export", "patrol.pddl", "--to", "btcpp", *more[:2], "-o", "nodes.xml")
    assert over.returncode == 2
    assert (tmp_path / "nodes.xml").read_text() == MODELS
    lost = command(tmp_path, "export", "patrol.pddl", "--to", "btcpp", "-O", "bindings=lost.yaml")
    assert lost.returncode == 1
    assert "error[BBT0001]: cannot read lost.yaml" in lost.stderr


def test_a_build_makes_the_export_anew_when_bindings_or_models_change(tmp_path: Path) -> None:
    manifest = (
        "trees:\n  round:\n    domain: patrol.pddl\n"
        "    exports: {btcpp: {options: {bindings: robot/bindings.yaml}}}\n"
    )
    folder = project(tmp_path / "p", manifest, patrol_pddl=PATROL)
    (folder / "robot").mkdir()
    bound(folder / "robot", patrol())
    other = tmp_path / "elsewhere"
    other.mkdir()

    def built(*more: str, where: Path = folder) -> str:
        done = command(where, "build", *more)
        assert done.returncode == 0, done.stderr
        return done.stdout + done.stderr

    built()
    tree = folder / "build" / "round.xml"
    assert 'max_staging_time="20.5"' in tree.read_text()
    assert "1 up to date" in built()
    assert "1 up to date" in built("-m", str(folder / "bbtc.yaml"), where=other)
    changed = BINDINGS.replace("20.5", "30.5")
    (folder / "robot" / "bindings.yaml").write_text(changed)
    assert "1 built" in built("-m", str(folder / "bbtc.yaml"), where=other)
    assert 'max_staging_time="30.5"' in tree.read_text()
    (folder / "robot" / "nodes.xml").write_text(MODELS.replace('name="max_staging_time"', 'name="patience"'))
    done = command(folder, "build")
    assert done.returncode == 1
    assert "robot/bindings.yaml:12:50: error[BBT0711]" in done.stderr
    assert 'max_staging_time="30.5"' in tree.read_text()
    assert set(files_of(str(folder / "robot" / "bindings.yaml"))) == {
        str(folder / "robot" / "bindings.yaml"), str(folder / "robot" / "nodes.xml")
    }  # fmt: skip
    (folder / "bbtc.yaml").write_text(manifest.replace("{options:", "{file: robot/nodes.xml, options:"))
    assert "BBT1009" in command(folder, "build").stderr


def test_the_example_fits_the_models_that_nav2_ships(tmp_path: Path) -> None:
    given = os.environ.get("BBTC_NAV2_MODELS")
    if not given:
        pytest.skip("BBTC_NAV2_MODELS does not name Nav2's nav2_tree_nodes.xml")
    models = Path(given).read_text(encoding="utf-8")
    omit = "omit: [server_name, server_timeout, behavior_tree, dock_pose, dock_type, robot_base_frame]"
    text = BINDINGS.replace("omit: [server_name, behavior_tree]", omit)
    document = bound(tmp_path, patrol(), text, models)
    assert {"NavigateToPose", "DockRobot", "GoalReached", "IsBatteryLow"} <= {e.tag for e in document.iter()}
    wrong = text.replace("goal: {table: poses, of: to}", "pose: {table: poses, of: to}")
    found = faults(tmp_path, wrong, models)
    assert any("error[BBT0711]: the node 'NavigateToPose' has no port 'pose'" in each for each in found)
