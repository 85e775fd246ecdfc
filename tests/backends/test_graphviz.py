"""Pictures of trees: the paper's look in Graphviz text and in our own SVG, whatever the names."""

from __future__ import annotations

import itertools
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.backends.pictures.diagram import diagram, flow_text, wrap
from bbtc.backends.pictures.layout import Box, tidy
from bbtc.backends.registry import load_exporter, parse_options
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import Is
from bbtc.kleene import Truth
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree, walk
from tests.conftest import Golden
from tests.long_form import amount
from tests.profiles import examples
from tests.strategies import HOSTILE_NAMES, soda_tree, trees

_SVG = "{http://www.w3.org/2000/svg}"


def export(
    tree: Tree,
    form: str,
    options: Mapping[str, str] | None = None,
    figures: Mapping[str, Fraction] | None = None,
) -> str | bytes:
    exporter = load_exporter(form)
    written = exporter.export(tree, parse_options(exporter, options or {}), figures)
    assert isinstance(written, (str, bytes))
    return written


def templated() -> Tree:
    """The soda tree with its second child as the body of a template."""
    tree = soda_tree()
    root = tree.root
    assert isinstance(root, ControlNode)
    body = root.children[1]
    assert isinstance(body, ControlNode)
    body = replace(body, template="look(soda)")
    return replace(tree, root=replace(root, children=(root.children[0], body)))


def graphviz_program() -> str:
    """Any Graphviz, as an independent reader of Graphviz text."""
    scripts = sysconfig.get_path("scripts")
    found = (
        shutil.which("graphviz-pure", path=scripts) or shutil.which("graphviz-pure") or shutil.which("dot")
    )
    if found is None:
        pytest.skip("neither graphviz-pure nor dot is installed")
    return found


@dataclass
class Drawn:
    """A node as Graphviz draws it."""

    lines: list[str]
    shape: str
    fill: str
    dashed: bool


def read_dot(text: str) -> tuple[dict[str, Drawn], list[tuple[str, str]]]:
    """The nodes by name and the edges of a Graphviz text, as Graphviz itself draws them."""
    run = subprocess.run(
        [graphviz_program(), "-Tsvg"], input=text.encode(), capture_output=True, check=True, timeout=60
    )
    groups = list(ET.fromstring(run.stdout).iter(f"{_SVG}g"))
    nodes: dict[str, Drawn] = {}
    for group in (g for g in groups if g.get("class") == "node"):
        (shape,) = [e for e in group.iter() if e.tag in (f"{_SVG}polygon", f"{_SVG}ellipse")]
        fill = shape.get("fill", "")
        nodes[title(group)] = Drawn(
            [(element.text or "").replace("\xa0", " ") for element in group.iter(f"{_SVG}text")],
            shape.tag.removeprefix(_SVG),
            {"white": "#ffffff", "orange": "#ffa500"}.get(fill, fill),
            "stroke-dasharray" in shape.attrib,
        )
    edges = [title(group).split("->") for group in groups if group.get("class") == "edge"]
    return nodes, [(tail.removesuffix(":s"), head.removesuffix(":n")) for tail, head in edges]


def title(group: ET.Element) -> str:
    element = group.find(f"{_SVG}title")
    assert element is not None
    return element.text or ""


# --- the look --------------------------------------------------------------------------------


def test_dot_has_the_look_of_the_paper() -> None:
    nodes, edges = read_dot(str(export(templated(), "dot")))
    look = {name: (drawn.lines, drawn.shape, drawn.fill) for name, drawn in nodes.items()}
    assert look["n1"] == (["⇒"], "polygon", "#ffffff")
    assert look["n2"] == (["seen(soda)"], "ellipse", "#ffa500")
    assert look["n3"] == (["→", "look(soda)"], "polygon", "#9262d1")
    assert look["n4"] == (["?"], "polygon", "#ffffff")
    assert look["n11"] == (["detect(soda)"], "polygon", "#5fd35f")
    assert look["n12"] == (["known seen(soda)"], "ellipse", "#ffa500")
    assert [head for tail, head in edges if tail == "n5"] == ["n6", "n11", "n12"]


@pytest.mark.parametrize("form", ["dot", "svg"])
def test_a_picture_is_the_same_as_ever(form: str, golden: Golden) -> None:
    options = {"legend": "true"} | ({"layout": "bbtc"} if form == "svg" else {})
    golden(f"pictures/soda.{form}", export(templated(), form, options))


def test_templates_can_be_drawn_as_one_node() -> None:
    nodes, edges = read_dot(str(export(templated(), "dot", {"templates": "collapsed"})))
    assert set(nodes) == {"n1", "n2", "n3"}
    assert nodes["n3"].lines == ["look(soda)"]
    assert nodes["n3"].fill == "#fde910"
    assert edges == [("n1", "n2"), ("n1", "n3")]


def test_an_action_that_may_run_again_is_dashed() -> None:
    tree = soda_tree()
    again = replace(tree, root=ActionNode("n1", "light_on()", latched=False))
    assert read_dot(str(export(again, "dot")))[0]["n1"].dashed
    assert "stroke-dasharray" in str(export(again, "svg", {"layout": "bbtc"}))


@pytest.mark.parametrize(("form", "options"), [("dot", {}), ("svg", {"layout": "bbtc"})])
def test_the_flow_stands_at_the_lines(form: str, options: dict[str, str]) -> None:
    flow = {"n1": Fraction(1), "n2": Fraction(1), "n3": Fraction(7, 8)}
    text = str(export(templated(), form, {**options, "templates": "collapsed"}, flow))
    assert "7/8" in text
    assert "7/8" not in str(export(templated(), form, options))


def test_the_flow_stands_beside_its_line() -> None:
    """Two thirds of the way down, a little to the right."""
    flow = {node.id: Fraction(7, 8) for node in walk(soda_tree().root)}
    picture = ET.fromstring(str(export(soda_tree(), "svg", {"layout": "bbtc"}, flow)))
    groups = [group for group in picture.iter(f"{_SVG}g") if group.get("class") == "line"]
    assert groups
    for group in groups:
        line, text = group.find(f"{_SVG}line"), group.find(f"{_SVG}text")
        assert line is not None
        assert text is not None
        x1, x2, x = (float(str(each.get(name))) for each, name in ((line, "x1"), (line, "x2"), (text, "x")))
        y1, y2, y = (float(str(each.get(name))) for each, name in ((line, "y1"), (line, "y2"), (text, "y")))
        assert x == pytest.approx((x1 + 2 * x2) / 3 + 4, abs=0.2)
        assert y1 + (y2 - y1) / 2 < y <= y2 + 2


def test_flow_is_exact_where_that_is_short() -> None:
    assert flow_text(Fraction(31, 32)) == "31/32"
    assert flow_text(Fraction(1)) == "1"
    assert flow_text(Fraction(0)) == "0"
    assert flow_text(Fraction(12345, 99991)) == "0.123"
    assert flow_text(Fraction(1, 10**400)) == "<0.001"
    assert flow_text(1 - Fraction(1, 10**400)) == ">0.999"


@pytest.mark.parametrize("form", ["dot", "svg"])
def test_the_legend_shows_what_occurs(form: str) -> None:
    options = {"layout": "bbtc"} if form == "svg" else {}
    with_legend = str(export(templated(), form, {**options, "legend": "true"}))
    assert "template (expanded)" in with_legend
    assert "template (not expanded)" not in with_legend
    assert "template (expanded)" not in str(export(templated(), form, options))


def test_long_texts_are_broken_and_cut() -> None:
    lines = wrap(" and ".join(f"clear(block{n})" for n in range(100)))
    assert max(map(len, lines)) <= 30
    assert len(lines) == 8
    assert lines[-1] == "…"
    assert max(map(len, wrap("x" * 1000))) <= 60
    name = "the-arm-of-the-left-robot-is-holding-something"
    assert wrap(f"not ({name}) now") == ["not", f"({name})", "now"], "a name is not broken at its hyphens"


# --- any names -------------------------------------------------------------------------------


@examples(40)
@given(trees(HOSTILE_NAMES), st.booleans())
def test_graphviz_reads_back_every_text_whatever_the_names(tree: Tree, expand: bool) -> None:
    items = diagram(tree, None, expand=expand)
    templates = {"templates": "expanded" if expand else "collapsed"}
    nodes, edges = read_dot(str(export(tree, "dot", templates)))
    # Graphviz draws a line that is only blanks as nothing.
    drawn = {name: [line for line in node.lines if line.strip()] for name, node in nodes.items()}
    lines = {item.id: [item.symbol or "", *item.lines] for item in items}
    assert drawn == {name: [line for line in part if line.strip()] for name, part in lines.items()}
    parents = [(items[item.parent].id, item.id) for item in items if item.parent is not None]
    assert sorted(edges) == sorted(parents)


@pytest.mark.parametrize("name", ["<b>bold</b>", "<>", "<", "&lt;", "\\N", "\\", '"', "a\\", '\\"'])
def test_graphviz_takes_a_name_for_what_it_is(name: str) -> None:
    tree = soda_tree()
    root = ControlNode("n1", "sequence", (ConditionNode("n2", tree.task.goal),), template=name)
    nodes, _ = read_dot(str(export(replace(tree, root=root), "dot", {"templates": "collapsed"})))
    assert nodes["n1"].lines == [name]


@given(trees(HOSTILE_NAMES))
def test_our_svg_is_well_formed_whatever_the_names(tree: Tree) -> None:
    text = str(export(tree, "svg", {"layout": "bbtc", "legend": "true"}))
    root = ET.fromstring(text)
    groups = [g for g in root.iter(f"{_SVG}g") if "data-id" in g.attrib]
    items = diagram(tree, None, expand=True)
    assert [group.get("data-id") for group in groups] == [item.id for item in items]
    for group, item in zip(groups, items, strict=True):
        texts = [element for element in group.findall(f"{_SVG}text") if element.get("class") != "symbol"]
        assert [element.text for element in texts] == list(item.lines)
    assert {element.tag for element in root.iter()} <= {
        f"{_SVG}{tag}"
        for tag in ("svg", "g", "title", "desc", "rect", "ellipse", "line", "path", "polygon", "text")
    }


@pytest.mark.parametrize("ids", [("a:b", "c"), ("same", "same"), ("node", "edge"), ("", "\\N"), ("<b>", '"')])
def test_any_ids_make_distinct_nodes(ids: tuple[str, str]) -> None:
    tree = soda_tree()
    leaves = tuple(ConditionNode(name, tree.task.goal) for name in ids)
    nodes, edges = read_dot(str(export(replace(tree, root=ControlNode("r", "fallback", leaves)), "dot")))
    assert len(nodes) == 3
    assert len(edges) == 2


# --- who draws -------------------------------------------------------------------------------


def no_programs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda *args, **kwargs: None)


def test_svg_never_fails_without_graphviz(monkeypatch: pytest.MonkeyPatch) -> None:
    no_programs(monkeypatch)
    text = str(export(soda_tree(), "svg"))
    assert text == export(soda_tree(), "svg", {"layout": "bbtc"})
    ET.fromstring(text)


def test_png_without_graphviz_is_refused_with_a_way_out(monkeypatch: pytest.MonkeyPatch) -> None:
    no_programs(monkeypatch)
    with pytest.raises(BbtcError) as caught:
        export(soda_tree(), "png")
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "BBT0706"
    assert diagnostic.hint is not None
    assert "bbtc[svg]" in diagnostic.hint


def fake_dot(folder: Path, body: str, monkeypatch: pytest.MonkeyPatch) -> None:
    program = folder / "dot"
    program.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.setattr(sysconfig, "get_path", lambda _name: str(folder))
    monkeypatch.setattr(sys, "executable", str(folder / "python"))


@pytest.mark.skipif(os.name == "nt", reason="the stand-in for dot is a shell script")
@pytest.mark.parametrize("body", ["echo broken >&2; exit 3", "exit 0", "kill -SEGV $$"])
def test_a_broken_graphviz_does_not_stop_svg(
    body: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_dot(tmp_path, body, monkeypatch)
    assert export(soda_tree(), "svg") == export(soda_tree(), "svg", {"layout": "bbtc"})
    with pytest.raises(BbtcError, match="BBT0706"):
        export(soda_tree(), "svg", {"layout": "dot"})


def test_graphviz_draws_where_it_is_installed() -> None:
    program = Path(graphviz_program()).name
    root = ET.fromstring(str(export(soda_tree(), "svg", {"layout": program})))
    count = len(list(walk(soda_tree().root)))
    assert len([g for g in root.iter(f"{_SVG}g") if g.get("class") == "node"]) == count
    picture = export(soda_tree(), "png", {"layout": program, "dpi": "50"})
    assert isinstance(picture, bytes)
    assert picture.startswith(b"\x89PNG")


def test_no_line_runs_over_a_node() -> None:
    # A wide subtree left of a leaf: lines to it could pass through its neighbour.
    ids = itertools.count()

    def wide(levels: int) -> Node:
        leaf = ConditionNode(f"c{next(ids)}", Is(0, Truth.TRUE), name="a leaf with a long name")
        children = (wide(levels - 1), leaf, wide(levels - 1)) if levels else (leaf,)
        return ControlNode(f"s{next(ids)}", "sequence", children)

    text = str(export(replace(soda_tree(), root=wide(4)), "dot"))
    run = subprocess.run(
        [graphviz_program(), "-Tplain"], input=text, capture_output=True, text=True, check=True, timeout=60
    )
    rows = [line.split(" ") for line in run.stdout.splitlines()]
    boxes = {row[1]: [float(number) for number in row[2:6]] for row in rows if row[0] == "node"}
    for _, tail, head, count, *numbers in (row for row in rows if row[0] == "edge"):
        points = [float(number) for number in numbers[: 2 * int(count)]]
        ends = (points[0], points[1]), (points[-2], points[-1])
        for x, y in ((a + (b - a) * step / 20 for a, b in zip(*ends, strict=True)) for step in range(21)):
            for name, (left, top, width, height) in boxes.items():
                over = abs(x - left) < 0.45 * width and abs(y - top) < 0.45 * height
                assert name in (tail, head) or not over


@pytest.mark.parametrize("dpi", ["0", "-5", "100000"])
def test_a_resolution_out_of_range_is_refused(dpi: str) -> None:
    with pytest.raises(BbtcError, match="BBT0704"):
        export(soda_tree(), "png", {"dpi": dpi})


# --- our layout ------------------------------------------------------------------------------

_GAP = 10.0


@st.composite
def forests(draw: st.DrawFn) -> tuple[list[Box], list[int | None]]:
    """A random tree as boxes and parent numbers, parents first, children from left to right."""
    children: list[list[int]] = [[]]
    for number in range(1, draw(st.integers(1, 30))):
        children[draw(st.integers(0, number - 1))].append(number)
        children.append([])
    boxes: list[Box] = []
    parents: list[int | None] = []
    stack: list[tuple[int, int | None]] = [(0, None)]
    while stack:
        node, parent = stack.pop()
        stack.extend((child, len(parents)) for child in reversed(children[node]))
        parents.append(parent)
        boxes.append(Box(draw(st.sampled_from([20.0, 50.0, 300.0])), draw(st.sampled_from([20.0, 80.0]))))
    return boxes, parents


@given(forests())
def test_the_layout_is_tidy(forest: tuple[list[Box], list[int | None]]) -> None:
    boxes, parents = forest
    layout = tidy(boxes, parents, _GAP, 30.0)
    numbers = range(len(boxes))
    slack = 1e-6
    for a in numbers:
        assert -slack <= layout.x[a] - boxes[a].width / 2
        assert layout.x[a] + boxes[a].width / 2 <= layout.width + slack
        assert -slack <= layout.y[a] - boxes[a].height / 2
        assert layout.y[a] + boxes[a].height / 2 <= layout.height + slack
        for b in range(a + 1, len(boxes)):
            if layout.y[a] == layout.y[b]:  # of two on one level, the first stands to the left
                assert layout.x[b] - layout.x[a] >= (boxes[a].width + boxes[b].width) / 2 + _GAP - slack
        below = [b for b in numbers if parents[b] == a]
        if below:
            assert layout.x[a] == pytest.approx((layout.x[below[0]] + layout.x[below[-1]]) / 2)
            assert all(layout.y[b] - boxes[b].height / 2 > layout.y[a] + boxes[a].height / 2 for b in below)


def test_a_small_subtree_stands_in_the_middle_of_the_room_its_neighbours_leave() -> None:
    # The root's first and last child have three children each, which keep them apart; two leaves between.
    parents = [None, 0, 1, 1, 1, 0, 0, 0, 7, 7, 7]
    layout = tidy([Box(20, 20)] * len(parents), parents, _GAP, 30.0)
    first, second, third, last = (layout.x[number] for number in (1, 5, 6, 7))
    assert last - first == pytest.approx(3 * 30)
    assert third - second == pytest.approx(30)
    alone = tidy([Box(20, 20)] * 10, [*parents[:6], 0, 6, 6, 6], _GAP, 30.0)
    assert alone.x[5] == pytest.approx(alone.x[0])


DEEP = amount(1_500, 3_000)


def test_a_very_deep_tree_is_drawn() -> None:
    tree = soda_tree()
    node: ControlNode | ConditionNode = ConditionNode("leaf", tree.task.goal)
    for level in range(DEEP):
        node = ControlNode(f"c{level}", "sequence", (node,))
    text = str(export(replace(tree, root=node), "svg", {"layout": "bbtc"}))
    assert len(re.findall("data-id=", text)) == DEEP + 1


def test_the_text_does_not_depend_on_the_hash_seed() -> None:
    code = (
        "from tests.strategies import soda_tree; from bbtc.backends.registry import *;"
        "print(*[(e := load_exporter(f)).export(soda_tree(), parse_options(e, o), None)"
        " for f, o in [('dot', {'legend': 'true'}), ('svg', {'layout': 'bbtc', 'legend': 'true'})]])"
    )
    outputs = {
        subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            check=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
            cwd=Path(__file__).resolve().parents[2],
        ).stdout
        for seed in ("1", "2")
    }
    assert len(outputs) == 1
