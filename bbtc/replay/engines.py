"""Replay a script in what the exporters wrote: the py_trees module, and real BehaviorTree.CPP."""

from __future__ import annotations

import types
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal
from xml.etree import ElementTree as ET

from bbtc.backends.btcpp.exporter import btcpp
from bbtc.backends.btcpp.names import BtcppNames, btcpp_names
from bbtc.backends.interface import BOUNDS
from bbtc.backends.names import Symbol
from bbtc.backends.pytrees.exporter import py_trees, py_trees_names
from bbtc.ground.task import Task, ground_name
from bbtc.replay.script import OffScript, Run, Script, ScriptedWorld, Timing, Watch, World
from bbtc.tree.nodes import Tree


class Replay(ABC):
    """An exported tree in an engine of this process. :attr:`world` is that of the last script."""

    source: str

    def __init__(self) -> None:
        self.world: ScriptedWorld | None = None

    def run(self, script: Script, timing: Timing = "between") -> Run:
        """Replay one script in a new tree."""
        return self.run_in(ScriptedWorld(self.task, script, timing))

    def run_in(self, world: ScriptedWorld) -> Run:
        """What a new tree does in a world."""
        self.world = world
        self.begin(world)
        self._watch(world)
        try:
            for _ in range(world.most_ticks()):
                match self.tick():
                    case "running":
                        world.between_ticks()
                    case "success" | "failure" as ended:
                        return Run(tuple(world.actions), ended, world.told_values)
        except OffScript:
            return Run(tuple(world.actions), "cut", world.told_values)
        return Run(tuple(world.actions), "endless", world.told_values)

    def _watch(self, world: ScriptedWorld) -> None:  # noqa: B027 - most trees have no monitor
        """Where facts are hidden: let the exported monitor listen to the world."""

    def runs(self, jobs: Iterable[tuple[Script, Timing]]) -> list[Run]:
        """Replay many scripts."""
        return [self.run(script, timing) for script, timing in jobs]

    @property
    @abstractmethod
    def task(self) -> Task: ...

    @abstractmethod
    def begin(self, world: World, haltable: bool = False) -> None:
        """Make a new tree in a world."""

    @abstractmethod
    def tick(self) -> Literal["success", "failure", "running"]:
        """Tick the root once. Raises what the world raises."""

    @abstractmethod
    def halt(self) -> None:
        """Stop the tree from outside, if it is haltable."""


class PyTreesReplay(Replay):
    """The exported module of a tree under py_trees."""

    def __init__(self, tree: Tree, runtime: Literal["embedded", "imported"] = "embedded") -> None:
        super().__init__()
        import py_trees as engine

        self._status = engine.common.Status
        self._ended = False
        self._task, self._monitor = tree.task, tree.monitor
        self._names = py_trees_names(tree)
        self.source = py_trees.export(tree, {"runtime": runtime}, None)
        self._module = _load(self.source)

    @property
    def task(self) -> Task:
        return self._task

    def begin(self, world: World, haltable: bool = False) -> None:  # noqa: ARG002 - it always is
        # To make a tree takes longer than to run it: one that has ended is made to forget.
        self._world = world
        if not self._ended:
            self._root = self._module.create_root(self._robot())
            return
        self._ended = False
        self._root.stop(self._status.INVALID)
        for node in self._root.iterate():
            if type(node).__name__ in ("Latch", "Try"):
                node._started, node._final = False, None  # noqa: SLF001 - of our runtime
            elif type(node).__name__ == "Retry":
                node.made = 0

    def tick(self) -> Literal["success", "failure", "running"]:
        self._root.tick_once()
        self._ended = self._root.status != self._status.RUNNING
        word: Literal["success", "failure", "running"] = self._root.status.value.lower()
        assert word in ("success", "failure", "running")
        return word

    def halt(self) -> None:
        self._root.stop(self._status.INVALID)

    def _robot(self) -> object:
        truth = {0: False, 1: None, 2: True}
        status = self._status

        def condition(name: str) -> Callable[..., bool | None]:
            return lambda *args: truth[self._world.read(ground_name(name, args))]

        def action(name: str) -> Callable[..., object]:
            def act(*args: str) -> object:
                ground, world = ground_name(name, args), self._world
                ended = world.go_on(ground) if world.running(ground) else world.start(ground, ground)
                return (status.SUCCESS if world.succeeds else status.FAILURE) if ended else status.RUNNING

            return act

        methods: dict[str, object] = {"cancel": lambda name: self._world.cancel(name)}  # noqa: PLW0108 - the world of then

        def number(name: str) -> Callable[..., int]:
            return lambda *args: number_in_world(self._task, self._world, ground_name(name, args))

        makers: dict[str, Callable[[str], object]]
        makers = {"predicate": condition, "function": number, "action": action}
        for symbol, method in self._names.methods.items():
            methods[method] = makers[symbol.kind](symbol.name)
        self._namespace = types.SimpleNamespace(**methods)
        return self._namespace

    def _watch(self, world: ScriptedWorld) -> None:
        if self._monitor is not None:
            self._namespace.monitor = monitor_in(self._module, world)
            world.watch(self._namespace.monitor, self._monitor.known, starts=False)


def number_in_world(task: Task, world: World, name: str) -> int:
    """The value that a number of a task has in a world."""
    number = task.number_by_name[name]
    digits = (world.read(task.variables[digit].name) for digit in number.digits)
    return number.low + sum((value >> 1) << place for place, value in enumerate(digits))


def _load(source: str) -> Any:
    """An exported module."""
    module = types.ModuleType("exported")
    exec(compile(source, "<exported>", "exec"), module.__dict__)  # noqa: S102 - our own
    return module


def exported_module(tree: Tree) -> Any:
    """The exported module of a tree for py_trees."""
    return _load(py_trees.export(tree, {"runtime": "embedded"}, None))


def monitor_in(module: Any, world: ScriptedWorld) -> Watch:
    """The monitor of an exported module, which sees what is to be seen in a world."""
    truth = {0: False, 1: None, 2: True}

    def see(*fact: str) -> bool | None:
        return truth[world.read(ground_name(fact[0], fact[1:]))]

    monitor: Watch = module.Monitor(module.MONITOR, see)
    return monitor


class BtcppReplay(Replay):
    """The exported XML of a tree, loaded into BehaviorTree.CPP once; ``source`` is that XML where it was
    changed, with the same leaves."""

    def __init__(self, tree: Tree, source: str | None = None) -> None:
        super().__init__()
        import behaviortreepy as engine

        self._engine = engine
        self._task, self._monitor = tree.task, tree.monitor
        # What C++ makes of the same table is compared apart: leaves written in Python ask the one in Python.
        self._module = None if tree.monitor is None else exported_module(tree)
        self._names = btcpp_names(tree)
        self.source = btcpp.export(tree, {}, None) if source is None else source
        self._factory = engine.BehaviorTreeFactory()
        self._error: Exception | None = None
        self._root: Any = None
        document = ET.fromstring(self.source)  # noqa: S314 - our own
        self._main = document.attrib["main_tree_to_execute"]
        self._register(document, self._names)
        self._paused = self._haltable = False
        self._ground: dict[tuple[bool, int], str] = {}
        status = engine.NodeStatus
        self._factory.register_simple_condition(
            "LeafPaused", lambda _: status.RUNNING if self._paused else status.FAILURE
        )
        outer = ET.SubElement(document, "BehaviorTree", ID="Leaf")
        halting = ET.SubElement(outer, "ReactiveFallback")
        ET.SubElement(halting, "LeafPaused")
        ET.SubElement(halting, "SubTree", ID=self._main)
        self._factory.register_behavior_tree_from_text(ET.tostring(document, encoding="unicode"))

    @property
    def task(self) -> Task:
        return self._task

    def begin(self, world: World, haltable: bool = False) -> None:
        self._root = None  # the last tree halts what it runs, in its own world
        self._error = None
        self._current, self._haltable = world, haltable
        self._root = self._factory.create_tree("Leaf" if haltable else self._main)

    def tick(self) -> Literal["success", "failure", "running"]:
        returned = self._root.tick_exactly_once()
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        status = self._engine.NodeStatus
        if returned == status.RUNNING:
            return "running"
        assert returned in (status.SUCCESS, status.FAILURE)
        return "success" if returned == status.SUCCESS else "failure"

    def _watch(self, world: ScriptedWorld) -> None:
        if self._monitor is not None:
            world.watch(monitor_in(self._module, world), self._monitor.known, starts=True)

    def halt_all(self) -> None:
        """The engine's ``haltTree()``, which runs the ``_onHalted`` of every node, running or not."""
        self._root.halt_tree()

    def halt(self) -> None:
        # As a larger tree would.
        self._paused = True
        assert self.tick() == "running"
        self._paused = False

    def _register(self, document: ET.Element, names: BtcppNames) -> None:
        """Give every leaf tag an id of its own, since nodes written in Python cannot declare ports:
        its callback knows literal ports, and reads others from the SubTree's blackboard."""
        symbols = {node_id: symbol for symbol, node_id in names.ids.items()}
        objects = {value: name for name, value in names.values.items()}
        known: dict[tuple[str, ...], str] = {}
        for tree in document.iter("BehaviorTree"):
            for element in tree.iter():
                if element.tag in symbols:
                    symbol = symbols[element.tag]
                    ports = names.interface.leaves[symbol].parameters
                    values = [element.attrib.pop(port) for port in ports]
                    spans = [element.attrib.pop(port, "") for port in BOUNDS if symbol.kind == "function"]
                    assert all(key == "name" or key.startswith("_") for key in element.attrib)
                    key = (element.tag, *values, *spans)
                    if key not in known:
                        known[key] = f"Leaf{len(known)}"
                        self._register_leaf(known[key], symbol, values, objects, spans)
                    element.tag = known[key]
        for model in document.findall("TreeNodesModel"):
            for entry in [entry for entry in model if entry.tag in ("Action", "Condition")]:
                model.remove(entry)

    def _register_leaf(
        self,
        node_id: str,
        symbol: Symbol,
        values: list[str],
        objects: Mapping[str, str],
        spans: list[str],
    ) -> None:
        status = self._engine.NodeStatus
        truth = {0: status.FAILURE, 1: status.RUNNING, 2: status.SUCCESS}

        def ground(node: Any) -> str:
            # A node has the same number in every tree that is made of a BehaviorTree.
            key = (self._haltable, node.uid())
            if key not in self._ground:
                self._ground[key] = read(node)
            return self._ground[key]

        def read(node: Any) -> str:
            board = node.config().blackboard
            found = [board.get_string(v[1:-1]) if v.startswith("{") else v for v in values]
            return ground_name(symbol.name, tuple(objects[value] for value in found))

        def safely(callback: Callable[[Any, World], object]) -> Callable[[Any], object]:
            # The engine turns an exception into FAILURE: keep it, and tell after the tick.
            def safe(node: Any) -> object:
                if self._error is None:
                    try:
                        return callback(node, self._current)
                    except Exception as error:  # noqa: BLE001
                        self._error = error
                return status.FAILURE

            return safe

        if symbol.kind == "predicate":
            self._factory.register_simple_condition(
                node_id, safely(lambda node, world: truth[world.read(ground(node))])
            )
            return

        if symbol.kind == "function":
            least, most = spans

            def compare(node: Any, world: World) -> object:
                value = number_in_world(self._task, world, ground(node))
                inside = (not least or int(least) <= value) and (not most or value <= int(most))
                return status.SUCCESS if inside else status.FAILURE

            self._factory.register_simple_condition(node_id, safely(compare))
            return

        def start(node: Any, world: World) -> object:
            return ending(world) if world.start(ground(node), node.uid()) else status.RUNNING

        def go_on(node: Any, world: World) -> object:
            return ending(world) if world.go_on(node.uid()) else status.RUNNING

        def ending(world: World) -> object:
            return status.SUCCESS if world.succeeds else status.FAILURE

        def halted(node: Any, world: World) -> None:
            world.cancel(node.uid())

        self._factory.register_simple_stateful_action(node_id, safely(start), safely(go_on), safely(halted))
