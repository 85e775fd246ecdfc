"""The repository keeps its own rules: layers, sizes, codes, README commands, what a wheel holds."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

import pytest
import yaml
from hypothesis import settings

from bbtc.backends.registry import BUILT_INS, load_exporter
from bbtc.codes import CODES
from tests import profiles

REPOSITORY = Path(__file__).resolve().parent.parent
SOURCES = sorted((REPOSITORY / "bbtc").rglob("*.py"))

MOST_MODULE_LINES = 600
MOST_FUNCTION_LINES = 80


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def functions() -> Iterator[tuple[Path, ast.FunctionDef | ast.AsyncFunctionDef]]:
    for path in SOURCES:
        for node in ast.walk(ast.parse(text_of(path))):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                yield path, node


def test_imports_keep_to_the_layers() -> None:
    pytest.importorskip("importlinter", reason="import-linter is not installed")
    script = Path(sys.executable).parent / "lint-imports"
    run = subprocess.run(
        [script, "--no-cache"], cwd=REPOSITORY, capture_output=True, text=True, check=False, timeout=120
    )
    assert run.returncode == 0, run.stdout + run.stderr


def test_no_module_is_too_long() -> None:
    long = {str(path): text_of(path).count("\n") for path in SOURCES}
    assert {name: lines for name, lines in long.items() if lines > MOST_MODULE_LINES} == {}


def test_no_function_is_too_long() -> None:
    long = [
        f"{path.name}:{node.lineno} {node.name}"
        for path, node in functions()
        if (node.end_lineno or 0) - node.lineno >= MOST_FUNCTION_LINES
    ]
    assert long == []


def test_every_module_postpones_annotations() -> None:
    line = "from __future__ import annotations"
    assert [
        str(path) for path in SOURCES if text_of(path).count("\n") > 1 and line not in text_of(path)
    ] == []


def test_every_code_is_registered_and_used() -> None:
    used = {
        code
        for path in SOURCES
        if path.name != "codes.py"
        for code in re.findall(r"\bBBT\d{4}\b", text_of(path))
    }
    assert used - CODES.keys() == set(), "codes that are not registered"
    assert CODES.keys() - used == set(), "codes that nothing reports"


@pytest.mark.parametrize("name", BUILT_INS)
def test_built_in_exporters_are_what_they_are_registered_as(name: str) -> None:
    exporter = load_exporter(name)
    assert exporter.name == name
    assert exporter.description
    assert not exporter.suffix or exporter.suffix.startswith(".")  # none for a folder of files
    assert len({option.name for option in exporter.options}) == len(exporter.options)


def test_the_page_on_architecture_names_every_part() -> None:
    page = text_of(REPOSITORY / "docs" / "architecture.md")
    table = page.partition("## The map")[2].partition("## Where a change goes")[0]
    places = [row.split("|")[1] for row in table.splitlines() if row.startswith("| `")]
    named = re.findall(r"`([\w./]+)`", "\n".join(places))
    parts = {
        f"{path.name}/" if path.is_dir() else path.name
        for path in (REPOSITORY / "bbtc").iterdir()
        if path.name not in {"__pycache__", "__init__.py"}
    }
    assert parts <= {*named}
    assert {*named} <= parts
    folders = {path.parent.relative_to(REPOSITORY / "bbtc").as_posix() for path in SOURCES} - {"."}
    assert {folder for folder in folders if f"`{folder}/`" not in table} == set()


def test_every_place_that_the_page_on_architecture_names_is_there() -> None:
    page = text_of(REPOSITORY / "docs" / "architecture.md")
    places = re.findall(r"`((?:[\w.-]+/)+[\w.-]*|[\w-]+\.(?:py|md|lark|toml))`", page)
    assert len(places) > 100
    for place in places:
        found = [REPOSITORY / top / place for top in ("", "bbtc") if (REPOSITORY / top / place).exists()]
        assert found, place
        assert place.endswith("/") == found[0].is_dir(), place


def test_the_page_on_tests_names_every_long_form() -> None:
    page = text_of(REPOSITORY / "tests" / "README.md")
    sweeps = {
        path.relative_to(REPOSITORY).as_posix()
        for path in (REPOSITORY / "tests").rglob("test_*.py")
        if re.search("^from tests.long_form import", text_of(path), re.MULTILINE)
    }
    assert set(re.findall(r"^\| `(tests/[\w/]+\.py)`", page, re.MULTILINE)) == sweeps


def test_every_folder_of_tests_is_looked_into(pytestconfig: pytest.Config) -> None:
    passed_over = pytestconfig.getini("norecursedirs")
    folders = {path.relative_to(REPOSITORY).parent for path in (REPOSITORY / "tests").rglob("test_*.py")}
    names = {name for folder in folders for name in folder.parts}
    assert [name for name in sorted(names) if any(fnmatch(name, glob) for glob in passed_over)] == []


def test_profiles_alone_decide_how_many_examples_are_drawn() -> None:
    named = {path.name for path in (REPOSITORY / "tests").rglob("*.py") if "max_examples" in text_of(path)}
    assert named == {"profiles.py", Path(__file__).name}
    try:
        settings.load_profile("explore")
        assert profiles.examples(60).max_examples == 600
        settings.load_profile("steady")
        assert profiles.examples(60).max_examples == 60
    finally:
        profiles.load()


def test_no_test_changes_what_is_private() -> None:
    """Nothing whose name begins with ``_`` is set by ``setattr``, by a patch, or by assignment."""
    called = r"\b(?:setattr|patch(?:\.\w+)?)\([^)]*[\"., ]_[a-zA-Z]\w*[\"=]"
    private = re.compile(rf"{called}|^\s*(?!self|cls)\w+\._\w+ = ", re.MULTILINE)
    found = {
        path.name: private.findall(text_of(path))
        for path in (REPOSITORY / "tests").rglob("test_*.py")
        if path != Path(__file__)
    }
    assert {name: each for name, each in found.items() if each} == {}


# --- commands --------------------------------------------------------------------------------


def test_the_readme_names_targets_that_exist() -> None:
    blocks = re.findall(r"^```\w*\n(.*?)^```", text_of(REPOSITORY / "README.md"), re.DOTALL | re.MULTILINE)
    named = re.findall(r"^(?:\$ )?make (\w+)", "\n".join(blocks), re.MULTILINE)
    targets = re.findall(r"^([\w-]+):", text_of(REPOSITORY / "Makefile"), re.MULTILINE)
    assert {"demo", "test"} <= set(named) <= set(targets)


def test_a_scheduled_job_makes_every_part_of_the_long_tests() -> None:
    job = yaml.safe_load(text_of(REPOSITORY / ".github" / "workflows" / "test-long.yml"))
    assert job[True]["schedule"], "YAML 1.1 reads `on` as true"
    (work,) = job["jobs"].values()
    made = re.findall(r"MAKE\) --keep-going (.*)", text_of(REPOSITORY / "Makefile"))
    assert [" ".join(work["strategy"]["matrix"]["part"])] == made
    assert work["steps"][-1]["run"].startswith("make ${{ matrix.part }} ")
    page = text_of(REPOSITORY / "tests" / "README.md")
    for part in made[0].split():
        recipe = subprocess.run(
            ["make", "--dry-run", "--always-make", part],
            cwd=REPOSITORY,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        assert ".[dev,compare]" in recipe
        assert f"| `make {part}` |" in page


def test_links_between_documents_lead_somewhere() -> None:
    pages = [
        REPOSITORY / "README.md",
        REPOSITORY / "CHANGELOG.md",
        *sorted((REPOSITORY / "docs").rglob("*.md")),
    ]
    broken = [
        f"{page.relative_to(REPOSITORY)}: {target}"
        for page in pages
        for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text_of(page))
        if "://" not in target and not (page.parent / target).exists()
    ]
    assert broken == []


# --- the wheel -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("hatchling", reason="hatchling is not installed")
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=REPOSITORY,
        capture_output=True,
        check=True,
        timeout=120,
    )
    (built,) = folder.glob("*.whl")
    return built


def test_the_wheel_holds_the_package_its_data_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        grammar = archive.read("bbtc/grammar/bbtc.lark")
    assert grammar == (REPOSITORY / "grammar" / "bbtc.lark").read_bytes()
    assert "bbtc/py.typed" in names
    assert {f"bbtc/errors/{code}.md" for code in CODES} <= names
    modules = {str(path.relative_to(REPOSITORY).as_posix()) for path in SOURCES}
    assert modules <= names
    tops = {name.partition("/")[0] for name in names}
    assert {top for top in tops if not top.endswith((".dist-info", ".data"))} == {"bbtc"}
    shared = {name.partition(".data/data/")[2] for name in names if ".data/" in name}
    assert {name.rpartition("/")[0] for name in shared} == {"share/cmake/bbtc"}
    assert {"bbtc/builder/template/bbtc.yaml", "bbtc/cmake/bbtcConfig.cmake"} <= names


def test_an_installed_wheel_reads_a_domain(wheel: Path, tmp_path: Path) -> None:
    installed = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(installed)
    folder = REPOSITORY / "domains" / "household"
    code = "import sys; sys.path.insert(0, sys.argv.pop(1)); from bbtc.cli.main import main; main()"
    # First on the path, the wheel hides the sources of this repository.
    run = subprocess.run(
        [
            sys.executable,
            "-c",
            code,
            installed,
            "check",
            folder / "domain.pddl",
            folder / "look-for-soda.pddl",
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert run.returncode == 0, run.stderr
