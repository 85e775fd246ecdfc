"""py_trees modules: their form, whatever the names, and their simulated world."""

from __future__ import annotations

import ast
import functools
import importlib.util
import os
import random
import subprocess
import sys
import types
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given

import bbtc
from bbtc.backends.pytrees.exporter import py_trees_names
from bbtc.backends.pytrees.pycode import call, layout, literal
from bbtc.backends.pytrees.runtime import MODULES, used_in
from bbtc.backends.registry import load_exporter, parse_options
from bbtc.backends.shape import DEEPEST_TREE
from bbtc.belief.state import compile_action, initial_belief
from bbtc.diagnostics import BbtcError
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import with_monitor
from bbtc.replay.engines import PyTreesReplay
from bbtc.replay.script import Run, Script
from bbtc.tree.nodes import Tree, actions_of
from tests.backends.test_btcpp import nested
from tests.belief.hidden_tasks import search, tiger
from tests.conftest import Golden
from tests.profiles import examples
from tests.replay.random_trees import random_tree
from tests.replay.reference import random_run
from tests.strategies import HOSTILE_NAMES, soda_tree, trees

REPOSITORY = Path(__file__).resolve().parents[2]
TRUTH = {True: 2, None: 1, False: 0}


def export(tree: Tree, form: str = "py_trees", **options: str) -> str:
    exporter = load_exporter(form)
    text = exporter.export(tree, parse_options(exporter, options), None)
    assert isinstance(text, str)
    return text


def module_of(tree: Tree, **options: str) -> types.ModuleType:
    module = types.ModuleType("exported")
    exec(compile(export(tree, **options), "<exported>", "exec"), module.__dict__)
    return module


def test_the_soda_tree(golden: Golden) -> None:
    golden("export/soda.py", export(soda_tree()))
    golden("export/soda_imported.py", export(soda_tree(), runtime="imported"))
    golden("export/soda_robot.py", export(soda_tree(), "py_trees_robot"))


def watched(task: Task) -> Tree:
    """A tree of a task with hidden facts, with its monitor."""
    tree = with_monitor(bbtc.plan(task, target=Fraction(9, 10)).tree, Limits())
    assert tree is not None
    return tree


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Exported modules that use everything, with their classes in them and imported, and a robot
    for each, as files."""
    folder = tmp_path_factory.mktemp("exported")
    files = []
    made = [
        soda_tree(),
        nested(60, ("sequence", "fallback")),
        *(random_tree(seed, 0.6) for seed in range(12)),
        *map(watched, (tiger(Fraction(17, 20), Fraction(96, 100)), search(3))),
    ]
    for number, tree in enumerate(made):
        for runtime in ("embedded", "imported"):
            name = f"tree_{number}_{runtime}"
            texts = {
                f"{name}.py": export(tree, runtime=runtime),
                f"{name}_robot.py": export(tree, "py_trees_robot", module=name, runtime=runtime),
            }
            for file, text in texts.items():
                (folder / file).write_text(text, encoding="utf-8")
                files.append(folder / file)
    return files


def run_tool(cwd: Path, *command: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", *command], cwd=cwd, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]


@pytest.mark.skipif(importlib.util.find_spec("ruff") is None, reason="ruff is not installed")
def test_modules_pass_ruff(written: list[Path]) -> None:
    rules = "--select=E,F,W,I,B,UP,RET,SIM,PIE,PLW,ARG"
    run_tool(written[0].parent, "ruff", "check", "--isolated", "--line-length=100", rules, *map(str, written))


@pytest.mark.skipif(importlib.util.find_spec("ruff") is None, reason="ruff is not installed")
def test_modules_are_laid_out_as_ruff_would(written: list[Path]) -> None:
    folder, files = written[0].parent, map(str, written)
    run_tool(folder, "ruff", "format", "--isolated", "--line-length", "100", "--check", *files)


@pytest.mark.skipif(importlib.util.find_spec("mypy") is None, reason="mypy is not installed")
def test_modules_pass_mypy_strict(written: list[Path], tmp_path: Path) -> None:
    empty = tmp_path / "mypy.ini"
    empty.write_text("[mypy]\n")
    cache = f"--cache-dir={tmp_path / 'cache'}"
    run_tool(written[0].parent, "mypy", "--strict", f"--config-file={empty}", cache, *map(str, written))


def output(file: Path, *arguments: str) -> str:
    command = [sys.executable, str(file), *arguments]
    path = {"PYTHONPATH": str(REPOSITORY)}
    done = subprocess.run(
        command, env=os.environ | path, capture_output=True, text=True, check=True, timeout=60
    )
    return done.stdout


@pytest.mark.parametrize("runtime", ["embedded", "imported"])
def test_the_module_runs_as_a_program(written: list[Path], runtime: str) -> None:
    module = written[0].with_name(f"tree_0_{runtime}.py")
    first = output(module, "--seed", "3")
    assert first == output(module, "--seed", "3")
    lines = first.splitlines()
    assert lines[0] == "light_on(): luminousity_ok() true"
    assert lines[1] in ("detect(soda): seen(soda) true", "detect(soda): seen(soda) false")
    ended = "SUCCESS" if lines[1].endswith("true") else "FAILURE"
    assert lines[2:] == [f"The tree returned {ended}."]
    counted = output(module, "--runs", "400").split()
    assert counted[1:] == ["of", "400", "runs", "succeeded."]
    assert 150 < int(counted[0]) < 250


@pytest.mark.parametrize("runtime", ["embedded", "imported"])
def test_the_robot_to_start_from_runs_and_tells_what_is_to_do(written: list[Path], runtime: str) -> None:
    robot = written[0].with_name(f"tree_0_{runtime}_robot.py")
    assert output(robot) == "to do: light_on\nThe tree returned FAILURE.\n"


def test_modules_import_py_trees_the_standard_library_and_only_on_demand_bbtc(written: list[Path]) -> None:
    ours = {file.stem for file in written}
    for file in written:
        statements = [
            node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.ImportFrom)
        ]
        modules = {str(node.module).partition(".")[0] for node in statements}
        allowed = {"__future__", "py_trees"} | ({"bbtc"} if "imported" in file.stem else set())
        assert modules - ours - sys.stdlib_module_names <= allowed


@examples(60)
@given(trees(HOSTILE_NAMES))
def test_hostile_names_neither_become_code_nor_change_what_it_does(tree: Tree) -> None:
    source = export(tree)
    parsed = ast.parse(source)
    imports = {
        alias.name for node in ast.walk(parsed) if isinstance(node, ast.Import) for alias in node.names
    }
    assert imports == {"argparse", "math", "random", "time"}
    named = {node.id for node in ast.walk(parsed) if isinstance(node, ast.Name)}
    leaves = py_trees_names(tree).interface.leaves.values()
    parameters = {name for leaf in leaves for name in leaf.parameters}
    assert named <= known_names() | parameters
    robot = ast.parse(export(tree, "py_trees_robot", namespace=tree.task.problem))
    assert {node.id for node in ast.walk(robot) if isinstance(node, ast.Name)} <= known_names() | parameters
    assert set(used_in(export(tree, runtime="imported").splitlines())) <= known_names() | parameters
    replay = PyTreesReplay(tree)
    rng = random.Random(1)
    for _ in range(3):
        script, expected = random_run(tree.task, tree.root, rng, most=4)
        assert replay.run(script) == expected


@functools.cache
def known_names() -> set[str]:
    """Names that a module may refer to, whatever the tree."""
    runtime = [REPOSITORY / "bbtc" / "runtime" / f"{module}.py" for module in MODULES]
    defined = {
        node.name
        for file in runtime
        for node in ast.parse(file.read_text()).body
        if isinstance(node, ast.ClassDef | ast.FunctionDef)
    }
    own = {"ACTIONS", "INITIAL", "MyRobot", "OWN", "READS", "Robot", "SimulatedWorld", "__all__", "__name__"}
    own |= {"create_root", "main", "print", "report", "rng", "robot", "s"}
    return defined | own | {name for file in runtime for name in used_in(file.read_text().splitlines())}


@pytest.mark.parametrize(
    "text",
    [
        "soda",
        'a"); import os #',
        "it's",
        "both ' and \"",
        "\\",
        "\\N{BULLET}",
        "\n",
        "\x00\x1b",
        "ü漢🤖",
        "\udc80",
        "",
    ],
)
def test_a_literal_is_the_text_and_nothing_but_a_literal(text: str) -> None:
    written = literal(text)
    assert ast.literal_eval(written) == text
    assert "\n" not in written


def test_code_is_laid_out_one_item_a_line_where_it_is_too_long() -> None:
    short = call("f", "1", call("g", "2"))
    assert layout(short, "x = ") == ["x = f(1, g(2))"]
    long = call("f", literal("x" * 90), call("g", "2"))
    assert layout(long, "x = ") == ["x = f(", f'    "{"x" * 90}",', "    g(2),", ")"]


def test_deep_trees_run() -> None:
    for levels, kinds in ((DEEPEST_TREE - 1, ("sequence", "fallback", "skipper")), (5000, ("sequence",))):
        run = PyTreesReplay(nested(levels, kinds)).run(Script((), (("go()", ()),)))  # type: ignore[arg-type]
        assert run == Run(("go()",), "success", ())


def test_a_tree_too_deep_for_the_engine_is_an_error() -> None:
    with pytest.raises(BbtcError) as error:
        export(nested(5000, ("sequence", "fallback")))
    assert error.value.diagnostics[0].code == "BBT0705"


# --- the simulated world -----------------------------------------------------------------------


class AllDraws:
    """A source of random numbers that takes every path in turn, with its probability."""

    def __init__(self) -> None:
        self.path: list[tuple[int, int]] = []  # the number drawn, of how many
        self.position = 0

    def randrange(self, bound: int) -> int:
        if self.position == len(self.path):
            self.path.append((0, bound))
        drawn, known = self.path[self.position]
        assert known == bound
        self.position += 1
        return drawn

    def next_path(self) -> bool:
        """Go to the next path; False after the last."""
        self.position = 0
        while self.path:
            drawn, bound = self.path.pop()
            if drawn + 1 < bound:
                self.path.append((drawn + 1, bound))
                return True
        return False

    @property
    def probability(self) -> Fraction:
        result = Fraction(1)
        for _, bound in self.path:
            result /= bound
        return result


def distribution(make: Callable[[AllDraws], tuple[int, ...]]) -> dict[tuple[int, ...], Fraction]:
    """The exact distribution of what ``make`` returns."""
    draws, result = AllDraws(), dict[tuple[int, ...], Fraction]()
    while True:
        made = make(draws)
        result[made] = result.get(made, Fraction(0)) + draws.probability
        if not draws.next_path():
            return result


def known_variables(task: Task, state: Mapping[tuple[str, ...], object]) -> list[int]:
    """The variables that the module keeps."""
    return [index for index, v in enumerate(task.variables) if (v.predicate, *v.args) in state]


@pytest.mark.parametrize("seed", range(25))
def test_the_simulated_world_has_exactly_the_distribution_of_the_task(seed: int) -> None:
    tree = random_tree(seed)
    task, module = tree.task, module_of(tree)
    facts = [(variable.predicate, *variable.args) for variable in task.variables]
    kept = known_variables(task, module.INITIAL[0][1])

    def start(draws: AllDraws) -> tuple[int, ...]:
        state = module.draw(draws, module.INITIAL)
        return tuple(TRUTH[state[facts[index]]] for index in kept)

    expected: dict[tuple[int, ...], Fraction] = {}
    for values, p in initial_belief(task).items():
        seen = tuple(values[index] for index in kept)
        expected[seen] = expected.get(seen, Fraction(0)) + p
    assert distribution(start) == expected

    rng = random.Random(seed)
    for name in sorted({node.action for node in actions_of(tree.root)}):
        action = task.action_by_name[name]
        before = tuple(rng.choice(variable.values) for variable in task.variables)
        state = {fact: {2: True, 1: None, 0: False}[before[i]] for i, fact in enumerate(facts)}

        fact = (action.schema, *action.args)
        outcomes = module.ACTIONS[fact]

        def after(
            draws: AllDraws, outcomes: object = outcomes, state: dict[tuple[str, ...], bool | None] = state
        ) -> tuple[int, ...]:
            changes = module.happen(draws, outcomes, state)
            return tuple(TRUTH[(state | changes)[fact]] for fact in facts)

        wanted: dict[tuple[int, ...], Fraction] = {}
        for result in compile_action(task, action, Limits())(bytes(before)):
            wanted[tuple(result.values)] = wanted.get(tuple(result.values), Fraction(0)) + result.probability
        assert distribution(after) == wanted
