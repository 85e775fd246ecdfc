"""No module of the package leads back to itself, and every wing says which way its imports point."""

from __future__ import annotations

import graphlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import pytest

import bbtc
from tests.import_graph import UnknownImport, import_graph, sources_of

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGE = REPOSITORY / "bbtc"
MOST_FILES = 20
Graph: TypeAlias = dict[str, set[str]]
WINGS = (
    "backends",
    "backends.btcpp",
    "backends.models",
    "backends.pictures",
    "backends.pytrees",
    "cli",
    "cli.commands",
    "ground",
    "ground.reachability",
    "planner",
    "planner.chaining",
    "planner.mdp",
    "planner.synthesis",
    "rewrite",
)


@pytest.fixture(scope="module")
def graph() -> Graph:
    return import_graph(sources_of(PACKAGE))


def circle(graph: Graph) -> list[str]:
    """Modules in a circle, the first of them again at the end; empty where there is none."""
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        found: list[str] = error.args[1]
        return found
    return []


# --- this package ----------------------------------------------------------------------------


def test_no_circle_of_imports(graph: Graph) -> None:
    assert circle(graph) == []


def test_every_import_that_the_linter_sees_is_seen(graph: Graph) -> None:
    grimp = pytest.importorskip("grimp", reason="import-linter is not installed")
    theirs = grimp.build_graph("bbtc", cache_dir=None)
    assert theirs.modules == graph.keys()
    missed = {name: theirs.find_modules_directly_imported_by(name) - graph[name] for name in graph}
    assert {name: found for name, found in missed.items() if found} == {}


def test_strings_lead_to_commands_strategies_formats_and_processes(graph: Graph) -> None:
    assert {"bbtc.cli.commands.plan", "bbtc.cli.commands.import_"} <= graph["bbtc.cli.group"]
    assert {"bbtc.planner.auto", "bbtc.planner.chaining.search"} <= graph["bbtc.planner.strategies"]
    assert {"bbtc.backends.btcpp.exporter", "bbtc.backends.data"} <= graph["bbtc.backends.registry"]
    assert "bbtc.verifier.storm_worker" in graph["bbtc.verifier.storm"]
    assert "bbtc.builder.worker" in graph["bbtc.builder.pool"]
    assert {"bbtc.api", "bbtc.planner.result"} <= graph["bbtc"]


@pytest.mark.parametrize("name", bbtc.__all__)
def test_every_name_of_the_package_is_there(name: str) -> None:
    assert getattr(bbtc, name) is not None


def test_no_folder_holds_too_many_modules() -> None:
    folders = [PACKAGE, *(path for path in PACKAGE.rglob("*") if path.is_dir())]
    counts = {str(each.relative_to(REPOSITORY)): len(list(each.glob("*.py"))) for each in folders}
    assert {name: count for name, count in counts.items() if count > MOST_FILES} == {}


def test_every_wing_has_its_layers() -> None:
    settings: dict[str, Any] = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    held = {name for each in contracts if each["type"] == "layers" for name in each["containers"]}
    assert {f"bbtc.{wing}" for wing in WINGS} - held == set()
    inner = [path.parent.relative_to(REPOSITORY).parts for path in PACKAGE.glob("*/*/__init__.py")]
    assert {".".join(parts) for parts in inner} - held == set(), "wings within a wing"


# --- what counts as an import ----------------------------------------------------------------


def texts(**modules: str) -> dict[str, str]:
    """The modules of a small package, ``a__b`` standing for ``shop.a.b``."""
    named = {f"shop.{name.replace('__', '.')}": text for name, text in modules.items()}
    return {"shop": "", **named}


def spellings() -> Iterator[tuple[str, str]]:
    yield "a statement", "import shop.b"
    yield "a name of a module", "from shop.b import thing"
    yield "a module of a package", "from shop import b"
    yield "a local statement", "def run():\n    from shop.b import thing\n    return thing"
    yield "for checkers only", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import shop.b"
    yield "a string", "from importlib import import_module\nimport_module('shop.b')"
    yield "an attribute", "import importlib\nimportlib.import_module('shop.b').run()"
    yield "a row of a table", "TABLE = {'b': ('shop.b', 'run')}\nimport_module(TABLE['b'][0])"
    yield "a row with its attribute", "TABLE = {'b': 'shop.b:run'}\nimport_module(TABLE['b'].split(':')[0])"
    yield "a beginning", "def run(name):\n    return import_module(f'shop.{name}')"
    yield "a process", "subprocess.run([sys.executable, '-m', 'shop.b'])"
    yield "a program", "subprocess.run([sys.executable, '-c', 'import sys; from shop.b import run; run()'])"


@pytest.mark.parametrize(("how", "text"), [*spellings()], ids=lambda each: each.partition("\n")[0][:30])
def test_a_circle_is_found_however_it_is_spelt(how: str, text: str) -> None:
    graph = import_graph(texts(a=text, b="from shop.a import run"))
    assert "shop.b" in graph["shop.a"], how
    assert set(circle(graph)) == {"shop.a", "shop.b"}


@pytest.mark.parametrize(
    "text",
    [
        "",
        '"""Told of by :mod:`shop.b`."""',
        "def run():\n    'shop.b'\n",
        "NAME = 'shop.yaml'",
        "NAME = 'our shop.b is open'",
        "import shopping.b",
        "import_module('other.b')",
    ],
)
def test_what_is_no_import(text: str) -> None:
    assert import_graph(texts(a=text, b="from shop.a import run"))["shop.a"] == set()


@pytest.mark.parametrize(
    "text",
    [
        "def run(name):\n    return import_module(name)",
        "import_module('shop.gone')",
        "import_module(f'shop.gone.{name}')",
        "from . import b",
    ],
)
def test_a_name_that_nothing_tells_is_refused(text: str) -> None:
    with pytest.raises(UnknownImport):
        import_graph(texts(a=text, b=""))
