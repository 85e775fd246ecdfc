"""BehaviorTree.CPP as a library: found by CMake, if it is there, and a driver compiled with it, which
runs what only C++ can: the profile of our own control nodes, in any version."""

from __future__ import annotations

import functools
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import pytest

from bbtc.backends.btcpp.exporter import btcpp
from bbtc.backends.btcpp.names import btcpp_names
from bbtc.backends.interface import BOUNDS
from bbtc.ground.task import ground_name
from bbtc.replay.engines import number_in_world
from bbtc.replay.script import OffScript, Run, Script, ScriptedWorld, Timing, World
from bbtc.tree.nodes import Tree
from tests.replay.ticks import Tick, TickScript, TickWorld

REPOSITORY = Path(__file__).parents[2]
NODES = REPOSITORY / "bbtc" / "backends" / "btcpp" / "cpp"
SOURCES = Path(__file__).parent / "cpp"
BUILDS = REPOSITORY / "build" / "cpp"


def cmake_build(source: Path, build: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Configure and build a CMake project; the result of the step that failed, or of the last."""
    ninja = ["-G", "Ninja"] if shutil.which("ninja") else []
    steps = (
        ["cmake", "-S", str(source), "-B", str(build), "-DCMAKE_BUILD_TYPE=Debug", *ninja, *options],
        ["cmake", "--build", str(build)],
    )
    for step in steps:
        done = subprocess.run(step, capture_output=True, text=True, timeout=540, check=False)
        if done.returncode != 0:
            break
    return done


@functools.cache
def missing_library() -> str | None:
    """Why nothing can be compiled with BehaviorTree.CPP here; None if it can."""
    for program in ("cmake", "c++"):
        if shutil.which(program) is None:
            return f"no {program} on the PATH"
    options = ["NAME=behaviortree_cpp", "COMPILER_ID=GNU", "LANGUAGE=CXX", "MODE=EXIST", *_prefix()]
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            ["cmake", "--find-package", *(f"-D{option}" for option in options)],
            cwd=folder,
            capture_output=True,
            check=False,
        )
    if done.returncode != 0:
        return "CMake finds no BehaviorTree.CPP: set CMAKE_PREFIX_PATH to where 4.6 or later is installed"
    return None


def _prefix() -> Iterator[str]:
    # --find-package does not read the environment variable in every version.
    if "CMAKE_PREFIX_PATH" in os.environ:
        yield f"CMAKE_PREFIX_PATH={os.environ['CMAKE_PREFIX_PATH'].replace(os.pathsep, ';')}"


def library_prefix() -> list[str]:
    """The folders where the library may be, as far as the environment names them."""
    return [path for path in os.environ.get("CMAKE_PREFIX_PATH", "").split(os.pathsep) if path]


def require_library() -> None:
    """Skip the test where nothing can be compiled with BehaviorTree.CPP."""
    reason = missing_library()
    if reason is not None:
        pytest.skip(reason)


@functools.cache
def driver() -> Path:
    """The folder with ``driver`` and the plugin of our nodes, compiled once for a state of the sources
    and a library."""
    digest = hashlib.sha256(os.environ.get("CMAKE_PREFIX_PATH", "").encode())
    for file in sorted([*SOURCES.iterdir(), *NODES.iterdir()]):
        if file.is_file():
            digest.update(file.read_bytes())
    folder = BUILDS / digest.hexdigest()[:16]
    if not (folder / "driver").exists():
        BUILDS.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=BUILDS) as scratch:
            done = cmake_build(SOURCES, Path(scratch) / "made", f"-DBBTC_NODES={NODES}")
            assert done.returncode == 0, done.stdout + done.stderr
            try:
                (Path(scratch) / "made").rename(folder)
            except OSError:  # another process of this test run was first
                assert (folder / "driver").exists()
    return folder


class CompiledReplay:
    """The exported XML of a tree in the compiled driver, for any number of scripts. :attr:`world` is
    that of the last one. Close it, or use it as a context."""

    profile: Literal["stock", "bbtc"] = "bbtc"
    namespace = "Test"

    def __init__(self, tree: Tree) -> None:
        self._task = tree.task
        names = btcpp_names(tree, self.namespace)
        options = {"nodes": self.profile, "namespace": self.namespace}
        self.source = btcpp.export(tree, options, None)
        self.world: ScriptedWorld | None = None
        self._symbols = {node_id: symbol for symbol, node_id in names.ids.items()}
        self._objects = {value: name for name, value in names.values.items()}
        self._folder = tempfile.TemporaryDirectory()
        file = Path(self._folder.name) / "tree.xml"
        file.write_text(self.source, encoding="utf-8")
        main = self.source.split('main_tree_to_execute="')[1].split('"')[0]
        nodes = [
            f"{kind}:{names.ids[leaf.symbol]}:{','.join([*leaf.parameters, *BOUNDS[: 2 * leaf.counts]])}"
            for kind, found in (
                ("condition", names.interface.conditions),
                ("action", names.interface.actions),
            )
            for leaf in found
        ]
        built = driver()
        plugin = next(file for file in built.iterdir() if file.name.startswith("libbbtc_nodes."))
        self._process = subprocess.Popen(
            [built / "driver", plugin, file, main, *nodes],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
        )
        self._waiting = False

    def close(self) -> None:
        """End the driver."""
        self._process.kill()
        self._process.communicate()
        self._folder.cleanup()

    def __enter__(self) -> CompiledReplay:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def run(self, script: Script, timing: Timing = "between") -> Run:
        """Replay one script in a new instance of the tree."""
        return self.run_in(ScriptedWorld(self._task, script, timing))

    def run_in(self, world: ScriptedWorld) -> Run:
        """What a new instance of the tree does in a world."""
        self.world = world
        if self._waiting:
            self._answer("0")
        for _ in range(world.most_ticks()):
            status = self._tick(world)
            if status == "3":
                return Run(tuple(world.actions), "cut", world.values)
            if status != "1":
                return Run(tuple(world.actions), "success" if status == "2" else "failure", world.values)
            world.between_ticks()
            if _ + 1 < world.most_ticks():
                self._answer("1")
        return Run(tuple(world.actions), "endless", world.values)

    def _tick(self, world: World) -> str:
        """Answer the questions of a tick; its status."""
        self._waiting = False
        assert self._process.stdout is not None
        while True:
            line = self._process.stdout.readline()
            assert line, f"the driver ended: {self._process.wait()}"
            kind, *rest = line.split()
            if kind == "T":
                self._waiting = True
                return rest[0]
            try:
                self._answer(self._reply(world, kind, rest))
            except OffScript:
                self._answer("x")

    def _reply(self, world: World, kind: str, rest: list[str]) -> str:
        node = rest[0]
        if kind == "H":
            world.cancel(node)
            return "0"
        if kind == "G":
            return self._acted(world, world.go_on(node))
        symbol = self._symbols[rest[1]]
        if symbol.kind == "function":
            *args, least, most = rest[2:]
            name = ground_name(symbol.name, tuple(self._objects[value] for value in args))
            number = number_in_world(self._task, world, name)
            fits = (least == "-" or number >= int(least)) and (most == "-" or number <= int(most))
            return "2" if fits else "0"
        name = ground_name(symbol.name, tuple(self._objects[value] for value in rest[2:]))
        if kind == "C":
            return str(world.read(name))
        return self._acted(world, world.start(name, node))

    @staticmethod
    def _acted(world: World, ended: bool) -> str:
        return "1" if not ended else "2" if world.succeeds else "0"

    def trace(self, script: TickScript) -> list[Tick]:
        """What happens in every tick of a script in a new instance of the tree, until it ends."""
        world = TickWorld(self._task, script)
        if self._waiting:
            self._answer("0")
        for number in range(len(script.before)):
            world.next_tick()
            status = self._tick(world)
            world.tick_ended({"0": "failure", "1": "running", "2": "success"}[status])
            if status != "1":
                break
            if number in script.halts:
                self._answer("h")
                assert self._tick(world) == "1"
            if number + 1 < len(script.before):
                self._answer("1")
        return world.ticks

    def _answer(self, text: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{text}\n")
        self._process.stdin.flush()


class CompiledStockReplay(CompiledReplay):
    """The same with stock nodes only."""

    profile = "stock"
