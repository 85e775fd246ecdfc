"""The manifest is read strictly: every fault has its place, and no text makes reading it long."""

from __future__ import annotations

import json
import re
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
import yaml
from jsonschema import Draft202012Validator

from bbtc.diagnostics import BbtcError
from bbtc.manifest.entries import Manifest
from bbtc.manifest.expectations import FIGURES
from bbtc.manifest.find import find_manifest
from bbtc.manifest.read import read_manifest
from bbtc.planner.strategies import DEFAULT, STRATEGIES

REPOSITORY = Path(__file__).parents[2]
SCHEMA: dict[str, Any] = json.loads((REPOSITORY / "docs" / "schemas" / "bbtc-manifest-1.json").read_text())

FULL = """
version: 1
output: out
defaults: &common
  domain: d.pddl
  strategy: auto
trees:
  first:
    problem: p.pddl
    target: 19/20
    max-actions: 7
    retries: least
    prefer: size
    closed-world: true
    limits: {time: 60, states: 1000}
    exports:
      btcpp: trees/first.xml
      svg:
      big:
        format: dot
        options: {legend: true}
    expect:
      - success >= 95%
      - cost <= 7/2
  group/second:
    problem: q.pddl
    strategy: refine
    tree: second.json
    exports: [dot, py_trees]
"""

TOML = """
[project]
name = "robot"

[tool.bbtc]
output = "out"

[tool.bbtc.defaults]
domain = "d.pddl"
strategy = "auto"

[tool.bbtc.trees.first]
problem = "p.pddl"
target = 0.95
max-actions = 7
retries = "least"
prefer = "size"
closed-world = true
limits = {time = 60, states = 1000}
expect = ["success >= 95%", "cost <= 7/2"]

[tool.bbtc.trees.first.exports]
btcpp = "trees/first.xml"
svg = {}
big = {format = "dot", options = {legend = true}}

[tool.bbtc.trees."group/second"]
problem = "q.pddl"
strategy = "refine"
tree = "second.json"
exports = ["dot", "py_trees"]
"""


def read(text: str, name: str = "bbtc.yaml") -> Manifest:
    """The manifest of a text."""
    return read_manifest(Path("/project") / name, text.encode())


def faults(text: str, name: str = "bbtc.yaml") -> list[tuple[str, str, str]]:
    """Code, place (line:column) and message of everything wrong with a text."""
    with pytest.raises(BbtcError) as error:
        read(text, name)
    return [
        (d.code, d.span.place.removeprefix(f"{name}:") if d.span else "", d.message)
        for d in error.value.diagnostics
    ]


def test_a_full_manifest_is_read() -> None:
    first, second = read(FULL).trees
    assert (first.name, first.inputs, first.file) == ("first", ("d.pddl", "p.pddl"), "out/first.tree.json")
    assert (first.target, first.strategy, first.max_actions) == (Fraction(19, 20), "auto", 7)
    assert (first.closed_world, second.closed_world) == (True, False)
    assert (first.prefer, second.prefer, second.retries) == ("size", "success", "unbounded")
    assert (first.retries, first.limits) == ("least", (("states", 1000), ("seconds", 60)))
    assert [(e.name, e.form, e.file, e.options) for e in first.exports] == [
        ("btcpp", "btcpp", "trees/first.xml", ()),
        ("svg", "svg", "out/first.svg", ()),
        ("big", "dot", "out/first-big.dot", (("legend", "true"),)),
    ]
    assert [(e.figure, e.comparison, e.number) for e in first.expect] == [
        ("success", ">=", Fraction(19, 20)),
        ("cost", "<=", Fraction(7, 2)),
    ]
    assert (second.file, second.strategy, second.target) == ("second.json", "refine", None)
    assert [e.file for e in second.exports] == ["out/group/second.dot", "out/group/second.py"]


def test_toml_says_the_same() -> None:
    assert read(TOML, "pyproject.toml").trees == read(FULL).trees


def test_a_number_is_exact_as_it_is_written() -> None:
    text = "trees: {a: {domain: d, target: 0.1000000000000000000001}}"
    assert read(text).trees[0].target == Fraction("0.1000000000000000000001")


# --- faults ----------------------------------------------------------------------------------

BASE = "trees:\n  a:\n    domain: d.pddl\n"

FAULTS = {
    "duplicate key": (BASE + "    domain: e.pddl\n", "BBT0603", "4:5", "stands twice"),
    "duplicate tree": (BASE + "  a:\n    domain: d.pddl\n", "BBT0603", "4:3", "stands twice"),
    "unknown key": (BASE + "    strateggy: auto\n", "BBT0603", "4:5", "unknown field 'strateggy'"),
    "unknown key at the top": (BASE + "extra: 1\n", "BBT0603", "4:1", "unknown field 'extra'"),
    "no trees": ("output: x\n", "BBT0603", "1:1", "field 'trees' is missing"),
    "no domain": ("trees:\n  a:\n    target: 1\n", "BBT0603", "2:3", "field 'domain' is missing"),
    "trees a list": ("trees: [a]\n", "BBT0604", "1:8", "must be an object"),
    "tree a text": ("trees:\n  a: d.pddl\n", "BBT0604", "2:6", "must be a mapping"),
    "domain a number": ("trees:\n  a:\n    domain: 5\n", "BBT0604", "3:13", "not the number 5"),
    "domain a list": ("trees:\n  a:\n    domain: [d]\n", "BBT0604", "3:13", "must be a string"),
    "target a word": (BASE + "    target: much\n", "BBT0604", "4:13", "not a probability"),
    "target above 1": (BASE + "    target: 1.5\n", "BBT0604", "4:13", "between 0 and 1"),
    "endless target": (BASE + "    target: 1e999999999\n", "BBT0604", "4:13", "not a probability"),
    "strategy": (BASE + "    strategy: luck\n", "BBT0604", "4:15", "must be one of"),
    "count": (BASE + "    max-actions: 1.5\n", "BBT0604", "4:18", "whole number"),
    "huge count": (BASE + f"    max-actions: {'9' * 5000}\n", "BBT0604", "4:18", "whole number"),
    "format": (BASE + "    exports: [bt_cpp]\n", "BBT0701", "4:15", "unknown export format"),
    "option": (BASE + "    exports: {dot: {options: {size: 1}}}\n", "BBT0704", "4:21", "no option 'size'"),
    "expectation": (BASE + "    expect: [success is 1]\n", "BBT0604", "4:14", "FIGURE COMPARISON"),
    "figure": (BASE + "    expect: [luck >= 1]\n", "BBT0604", "4:14", "unknown figure"),
    "no rate": (
        BASE + "    expect: [perturbed-success > 0]\n",
        "BBT0603",
        "2:3",
        "field 'perturb' is missing",
    ),
    "rate": (BASE + "    perturb: 2\n", "BBT0604", "4:14", "between 0 and 1"),
    "outside": (BASE + "    tree: ../x.json\n", "BBT0604", "4:11", "inside the project"),
    "absolute": (BASE + "    exports: {dot: /etc/passwd}\n", "BBT0604", "4:20", "inside the project"),
    "name": ("trees:\n  ../a:\n    domain: d\n", "BBT0604", "2:3", "cannot name a tree"),
    "version": (BASE + "version: 2\n", "BBT0602", "4:10", "reads version 1"),
    "one file twice": (BASE + "    tree: x\n    exports: {dot: x}\n", "BBT1003", "5:20", "made twice"),
    "tag": ("trees: !!python/object:os.system {}\n", "BBT1001", "1:8", "tags are not used"),
    "tag on a text": (BASE + "    problem: !!binary aaaa\n", "BBT1001", "4:14", "tags"),
    "two documents": (BASE + "---\na: 1\n", "BBT1001", "4:1", "one document"),
    "merge": ("x-x: &x {a: 1}\ntrees: {a: {<<: *x}}\n", "BBT0603", "2:13", "unknown field '<<'"),
    "list as key": ("? [a]\n: b\n", "BBT1001", "1:3", "key must be plain"),
    "anchor": (BASE + "    exports: *gone\n", "BBT1001", "4:14", "not defined"),
    "not YAML": ("trees: {a: [}\n", "BBT1001", "1:13", "not valid YAML"),
    "tab": ("trees:\n\ta: 1\n", "BBT1001", "2:1", "not valid YAML"),
    "control character": ("trees: \x07\n", "BBT1001", "1:8", "not valid YAML: the character U+0007"),
    "deep": ("trees: " + "[" * 5000, "BBT0605", "1:27", "too deeply"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_has_its_code_and_place(name: str) -> None:
    text, code, place, words = FAULTS[name]
    ((found_code, found_place, message),) = faults(text)
    assert (found_code, found_place) == (code, place), message
    assert words in message


def test_a_slip_is_told_with_what_is_meant_and_in_full() -> None:
    ((_, _, figure),) = faults(BASE + "    expect: [sucess >= 1]\n")
    assert figure.endswith("unknown figure 'sucess'; did you mean 'success'?")
    ((_, _, form),) = faults(BASE + "    expect: [cost =< 1]\n")
    assert form.endswith("an expectation is FIGURE COMPARISON NUMBER, such as 'success >= 0.95'")
    with pytest.raises(BbtcError) as error:
        read(BASE + "    strategy: serach\n")
    assert error.value.diagnostics[0].hint == "did you mean 'search'?"


def test_what_the_page_shows_of_exports_is_read() -> None:
    page = (Path(__file__).parents[2] / "docs" / "build.md").read_text()
    blocks = re.findall(r"```yaml\n(exports:\n.*?)```", page, re.DOTALL)
    assert blocks
    for block in blocks:
        assert read(BASE + re.sub("^", "    ", block, flags=re.MULTILINE)).trees[0].exports


TOML_FAULTS = {
    "not TOML": ("[tool.bbtc]\ntrees = \n", "BBT1001", "2:9"),
    "duplicate key": ("[tool.bbtc]\noutput = 'a'\noutput = 'b'\n", "BBT1001", "3:13"),
    "unknown key": ("[tool.bbtc.trees.a]\ndomain = 'd'\ndomane = 'e'\n", "BBT0603", "3:1"),
    "wrong type": ("[tool.bbtc.trees.a]\ndomain = 5\n", "BBT0604", "2:10"),
    "in an inline table": ("[tool.bbtc.trees]\na = {domain = 'd', target = 2}\n", "BBT0604", "2:5"),
}


@pytest.mark.parametrize("name", TOML_FAULTS)
def test_a_fault_in_toml_has_its_place(name: str) -> None:
    text, code, place = TOML_FAULTS[name]
    ((found_code, found_place, message),) = faults(text, "pyproject.toml")
    assert (found_code, found_place) == (code, place), message


def test_all_faults_are_told_at_once() -> None:
    text = BASE + "    target: 7\n    strategy: luck\n  b: 3\n  c:\n    domain: 1\n"
    assert [place for _, place, _ in faults(text)] == ["4:13", "5:15", "6:6", "8:13"]


def test_private_members_are_left_alone() -> None:
    assert len(read(BASE + "    x-owner: me\nx-note: [1, {}]\n").trees) == 1


def test_an_alias_shares_a_value() -> None:
    text = (
        BASE.replace("d.pddl\n", "d.pddl\n    exports: &e [dot]\n") + "  b: {domain: d.pddl, exports: *e}\n"
    )
    assert [entry.exports[0].form for entry in read(text).trees] == ["dot", "dot"]


@pytest.mark.parametrize("kind", ["lists", "mappings", "expectations", "itself"])
def test_no_alias_makes_reading_long(kind: str) -> None:
    if kind == "itself":
        text = "trees: &a\n  b: *a\n"
    elif kind == "expectations":
        lines = "".join(f"  t{n}: {{domain: d, expect: *e}}\n" for n in range(2000))
        many = ", ".join(["success >= 0"] * 2000)
        text = f"x-e: &e [{many}]\ntrees:\n{lines}"
    else:
        levels = ["x-0: &a0 [x]"] if kind == "lists" else ["x-0: &a0 {k: x}"]
        for level in range(1, 60):
            nine = [f"*a{level - 1}"] * 9
            body = f"[{', '.join(nine)}]"
            if kind == "mappings":
                body = "{" + ", ".join(f"k{i}: {each}" for i, each in enumerate(nine)) + "}"
            levels.append(f"x-{level}: &a{level} {body}")
        text = "\n".join(levels) + "\ntrees: *a59\n"
    start = time.process_time()
    assert faults(text)
    assert time.process_time() - start < 20


def test_a_manifest_that_is_too_large_is_refused(tmp_path: Path) -> None:
    from bbtc.builder.runner import build

    (tmp_path / "bbtc.yaml").write_bytes(b"#" * (1 << 20) + b"\n")
    with pytest.raises(BbtcError, match="BBT0005"):
        build(tmp_path / "bbtc.yaml")


# --- where it is -----------------------------------------------------------------------------


def test_the_manifest_of_a_folder_around_is_found(tmp_path: Path) -> None:
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    (inner / "pyproject.toml").write_text("[tool.other]\n")
    (tmp_path / "bbtc.yaml").write_text(BASE)
    assert find_manifest(inner) == tmp_path / "bbtc.yaml"
    (inner / "pyproject.toml").write_text("[tool.bbtc.trees]\n")
    assert find_manifest(inner) == inner / "pyproject.toml"
    (inner / "bbtc.yaml").write_text(BASE)
    with pytest.raises(BbtcError, match="BBT1002"):
        find_manifest(inner)


# --- the schema for editors ------------------------------------------------------------------


def instance(text: str) -> Any:
    """The value as an editor's YAML support sees it."""
    return yaml.safe_load(text)


def test_the_schema_takes_what_we_take() -> None:
    Draft202012Validator.check_schema(SCHEMA)
    for text in (FULL, BASE, (REPOSITORY / "bbtc/builder/template/bbtc.yaml").read_text()):
        assert list(Draft202012Validator(SCHEMA).iter_errors(instance(text))) == []


@pytest.mark.parametrize(
    "name",
    [
        "unknown key",
        "unknown key at the top",
        "no trees",
        "trees a list",
        "tree a text",
        "domain a number",
        "domain a list",
        "target above 1",
        "strategy",
        "count",
        "expectation",
        "figure",
        "version",
        "name",
    ],
)
def test_the_schema_refuses_what_we_refuse(name: str) -> None:
    assert list(Draft202012Validator(SCHEMA).iter_errors(instance(FAULTS[name][0])))


def test_the_schema_knows_every_figure_and_setting() -> None:
    pattern = SCHEMA["$defs"]["expectation"]["pattern"]
    assert all(f"|{figure}|" in pattern.replace("(", "|").replace(")", "|") for figure in FIGURES)


def test_the_schema_takes_the_rate_of_a_perturbed_world_and_what_is_expected_in_it() -> None:
    text = BASE + "    perturb: 5%\n    expect: [perturbed-success >= 0.9, recovery == 1]\n"
    assert not list(Draft202012Validator(SCHEMA).iter_errors(instance(text)))
    assert read(text).trees[0].perturb == Fraction(1, 20)
    assert list(Draft202012Validator(SCHEMA).iter_errors(instance(BASE + "    perturb: 5\n")))


def test_the_schema_knows_every_strategy() -> None:
    strategy = SCHEMA["$defs"]["strategy"]
    assert (set(strategy["enum"]), strategy["default"]) == (set(STRATEGIES), DEFAULT)


@pytest.mark.parametrize(
    ("trees", "message"),
    [
        ("a: {domain: d, exports: [dot, dot]}", "build/a.dot is made twice"),
        ("a: {domain: d, exports: {dot: x/./y, svg: x//y}}", "x/y is made twice"),
        ("a: {domain: d, exports: {dot: x/y}}, b: {domain: d, exports: {dot: ./x/y}}", "x/y is made twice"),
        ("a: {domain: d, tree: x}, b: {domain: d, exports: {svg: x/y}}", "x/y is inside the file"),
        ("a: {domain: d, exports: {svg: x/y/z}}, b: {domain: d, tree: x}", "x/y/z is inside the file"),
        ("a: {domain: d, exports: {btcpp_project: p, btcpp: p/tree.xml}}", "is inside the folder"),
        ("a: {domain: d, exports: {btcpp: p/tree.xml, btcpp_project: p}}", "p/tree.xml is inside the folder"),
        ("a: {domain: d, exports: {btcpp_project: p, q: {format: btcpp_project, file: p/q}}}", "is inside"),
        ("a: {domain: d, exports: {py_trees_robot: r.py, dot: r.py.new}}", "differ by .new only"),
        ("a: {domain: d, exports: {dot: r.py.new, py_trees_robot: r.py}}", "differ by .new only"),
        ("a-b: {domain: d, exports: [py_trees_robot]}, a_b: {domain: d, exports: [py_trees_robot]}",
         "build/a_b_robot.py is made twice"),
    ],
)  # fmt: skip
def test_exports_that_would_write_over_each_other_are_refused(trees: str, message: str) -> None:
    (fault,) = faults(f"trees: {{{trees}}}\n")
    assert fault[0] == "BBT1003"
    assert message in fault[2]


# --- how much ----------------------------------------------------------------------------------

IN_TOML = "[tool.bbtc.trees.a]\ndomain = 'd'\n"
MUCH = {
    "a whole number of 5,000 digits": (f"{IN_TOML}x-a = {'9' * 5000}\n", "BBT1001"),
    "one of 5,000 digits in base 16": (f"{IN_TOML}x-a = 0x{'f' * 5000}\n", "BBT1001"),
    "a dotted key": (f"{IN_TOML}x-a{'.a' * 100_000} = 1\n", "BBT0605"),
    "a dotted key in quotes": (IN_TOML + "x-a" + ".'b'" * 50_000 + " = 1\n", "BBT0605"),
    "a dotted table": (f"[tool.bbtc{' . a' * 50_000}]\n", "BBT0605"),
    "a dotted key inside": (f"{IN_TOML}x-a = {{a{'.a' * 100_000} = 1}}\n", "BBT0605"),
    "blanks": (f"{IN_TOML}{' ' * 200_000}!\n", "BBT1001"),
    "words": (f"{IN_TOML}{'a ' * 100_000}\n", "BBT1001"),
    "defaults for all": (
        "defaults: {domain: d, limits: {" + "".join(f"x-{i}: 1, " for i in range(20_000)) + "}}\n"
        "trees: {" + "".join(f"t{i}: {{}}, " for i in range(1000)) + "}\n",
        "",
    ),
    "exports for all": (
        "defaults: {domain: d, exports: {" + "".join(f"e{i}: {{format: dot}}, " for i in range(999)) + "}}\n"
        "trees: {" + "".join(f"t{i}: {{}}, " for i in range(1000)) + "}\n",
        "BBT0005",
    ),
    "an alias of much": (
        "x-x: &x {" + "".join(f"x-{i}: 1, " for i in range(20_000)) + "}\n"
        "trees: {" + "".join(f"t{i}: {{domain: d, limits: *x}}, " for i in range(1000)) + "}\n",
        "BBT0005",
    ),
    "a key that stands often": (f"{BASE}x-a: {{{'a: 1, ' * 20_000}}}\n", "BBT0603"),
}


@pytest.mark.parametrize("name", MUCH)
def test_a_manifest_that_says_too_much_is_refused_at_once(name: str) -> None:
    text, code = MUCH[name]
    file = Path("bbtc.yaml" if "trees:" in text else "pyproject.toml")
    start = time.process_time()
    found = set()
    try:
        read_manifest(file, text.encode())
    except BbtcError as error:
        found = {diagnostic.code for diagnostic in error.diagnostics}
    assert found == ({code} if code else set())
    assert time.process_time() - start < 30  # what was wrong took minutes


@pytest.mark.parametrize("form", ["x-a: [{}]\n", "x-a: {{{}}}\n"])
def test_the_length_of_a_line_does_not_count_twice(form: str) -> None:
    def seconds(count: int) -> float:
        text = BASE + form.format("".join(f"a{number}: b, " for number in range(count)))
        start = time.process_time()
        read_manifest(Path("bbtc.yaml"), text.encode())
        return time.process_time() - start

    seconds(100)
    assert seconds(8_000) < 10 * seconds(2_000)
