"""Replay a script in what the exporters wrote: the py_trees module, and real BehaviorTree.CPP."""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping
from typing import Any
from xml.etree import ElementTree as ET

from bbtc.export.btcpp import btcpp
from bbtc.export.btcpp_names import BtcppNames, btcpp_names
from bbtc.export.names import Symbol
from bbtc.export.pytrees import py_trees, py_trees_names
from bbtc.ground.task import ground_name
from bbtc.tree.nodes import Tree
from tests.replay.script import OffScript, Run, Script, ScriptedWorld, Timing


def replay_py_trees(tree: Tree, script: Script, timing: Timing = "between") -> Run:
    """What the exported module does under py_trees."""
    return PyTreesReplay(tree).run(script, timing)


def replay_btcpp(tree: Tree, script: Script, timing: Timing = "between") -> Run:
    """What the exported XML does under BehaviorTree.CPP (module ``behaviortreepy``)."""
    return BtcppReplay(tree).run(script, timing)


def _ended(world: ScriptedWorld, success: bool) -> Run:
    return Run(tuple(world.actions), "success" if success else "failure", world.values)


class PyTreesReplay:
    """The exported module of a tree, ready to run any number of scripts. :attr:`world` is that of
    the last one."""

    def __init__(self, tree: Tree) -> None:
        self._task = tree.task
        self._names = py_trees_names(tree)
        self.world: ScriptedWorld | None = None
        self.source = py_trees.export(tree, {"runtime": "embedded"}, None)
        self._module = types.ModuleType("exported")
        exec(compile(self.source, "<exported>", "exec"), self._module.__dict__)

    def run(self, script: Script, timing: Timing = "between") -> Run:
        """Replay one script in a new instance of the tree."""
        import py_trees as engine

        world = self.world = ScriptedWorld(self._task, script, timing)
        root = self._module.create_root(self._robot(world, engine.common.Status))
        try:
            for _ in range(world.most_ticks()):
                root.tick_once()
                if root.status != engine.common.Status.RUNNING:
                    return _ended(world, root.status == engine.common.Status.SUCCESS)
                world.between_ticks()
        except OffScript:
            return Run(tuple(world.actions), "cut", world.values)
        return Run(tuple(world.actions), "endless", world.values)

    def _robot(self, world: ScriptedWorld, status: Any) -> object:
        truth = {0: False, 1: None, 2: True}

        def condition(name: str) -> Callable[..., bool | None]:
            return lambda *args: truth[world.read(ground_name(name, args))]

        def action(name: str) -> Callable[..., object]:
            def act(*args: str) -> object:
                ground = ground_name(name, args)
                ended = world.go_on(ground) if world.running(ground) else world.start(ground, ground)
                return status.SUCCESS if ended else status.RUNNING

            return act

        methods: dict[str, object] = {"cancel": world.cancel}
        for symbol, method in self._names.methods.items():
            make = condition if symbol.kind == "predicate" else action
            methods[method] = make(symbol.name)
        return types.SimpleNamespace(**methods)


class BtcppReplay:
    """The exported XML of a tree, loaded into BehaviorTree.CPP once for any number of scripts.
    :attr:`world` is that of the last one."""

    def __init__(self, tree: Tree) -> None:
        import behaviortreepy as engine

        self._engine = engine
        self._task = tree.task
        self._names = btcpp_names(tree)
        self.source = btcpp.export(tree, {"model": True}, None)
        self._factory = engine.BehaviorTreeFactory()
        self._error: Exception | None = None
        self.world: ScriptedWorld | None = None
        document = ET.fromstring(self.source)
        self._main = document.attrib["main_tree_to_execute"]
        self._register(document, self._names)
        self._factory.register_behavior_tree_from_text(ET.tostring(document, encoding="unicode"))

    def run(self, script: Script, timing: Timing = "between") -> Run:
        """Replay one script in a new instance of the tree."""
        status = self._engine.NodeStatus
        world = self.world = ScriptedWorld(self._task, script, timing)
        root = self._factory.create_tree(self._main)
        for _ in range(world.most_ticks()):
            returned = root.tick_exactly_once()
            if isinstance(self._error, OffScript):
                self._error = None
                return Run(tuple(world.actions), "cut", world.values)
            if self._error is not None:
                raise self._error
            if returned != status.RUNNING:
                assert returned in (status.SUCCESS, status.FAILURE)
                return _ended(world, returned == status.SUCCESS)
            world.between_ticks()
        return Run(tuple(world.actions), "endless", world.values)

    def _register(self, document: ET.Element, names: BtcppNames) -> None:
        """Give every leaf tag an id of its own, since nodes written in Python cannot declare ports:
        its callback knows literal ports, and reads others from the SubTree's blackboard."""
        symbols = {node_id: symbol for symbol, node_id in names.ids.items()}
        objects = {value: name for name, value in names.values.items()}
        model = document.find("TreeNodesModel")
        assert model is not None
        declared = {
            entry.attrib["ID"]: [port.attrib["name"] for port in entry.iter("input_port")]
            for entry in model
            if entry.tag in ("Action", "Condition")
        }
        known: dict[tuple[str, ...], str] = {}
        for tree in document.iter("BehaviorTree"):
            for element in tree.iter():
                if element.tag in symbols:
                    symbol, ports = symbols[element.tag], declared[element.tag]
                    values = [element.attrib.pop(port) for port in ports]
                    assert all(key == "name" or key.startswith("_") for key in element.attrib)
                    key = (element.tag, *values)
                    if key not in known:
                        known[key] = f"Leaf{len(known)}"
                        self._register_leaf(known[key], symbol, values, objects)
                    element.tag = known[key]
        for entry in [entry for entry in model if entry.tag in ("Action", "Condition")]:
            model.remove(entry)

    def _register_leaf(
        self, node_id: str, symbol: Symbol, values: list[str], objects: Mapping[str, str]
    ) -> None:
        status = self._engine.NodeStatus
        truth = {0: status.FAILURE, 1: status.RUNNING, 2: status.SUCCESS}

        def ground(node: Any) -> str:
            board = node.config().blackboard
            read = [board.get_string(v[1:-1]) if v.startswith("{") else v for v in values]
            return ground_name(symbol.name, tuple(objects[value] for value in read))

        def safely(callback: Callable[[Any, ScriptedWorld], object]) -> Callable[[Any], object]:
            # The engine turns an exception into FAILURE: keep it, and tell after the tick.
            def safe(node: Any) -> object:
                assert self.world is not None
                if self._error is None:
                    try:
                        return callback(node, self.world)
                    except Exception as error:  # noqa: BLE001
                        self._error = error
                return status.FAILURE

            return safe

        if symbol.kind == "predicate":
            self._factory.register_simple_condition(
                node_id, safely(lambda node, world: truth[world.read(ground(node))])
            )
            return

        def start(node: Any, world: ScriptedWorld) -> object:
            return status.SUCCESS if world.start(ground(node), node.uid()) else status.RUNNING

        def go_on(node: Any, world: ScriptedWorld) -> object:
            return status.SUCCESS if world.go_on(node.uid()) else status.RUNNING

        def halted(node: Any, world: ScriptedWorld) -> None:
            world.cancel(node.uid())

        self._factory.register_simple_stateful_action(node_id, safely(start), safely(go_on), safely(halted))
