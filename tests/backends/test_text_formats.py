"""The formats that are text for people and other programs: text, mermaid, json, yaml."""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import yaml
from hypothesis import given

from bbtc.artefacts import load_tree, tree_to_json
from bbtc.backends.pictures.diagram import diagram
from bbtc.backends.registry import load_exporter, parse_options
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import Is
from bbtc.kleene import Truth
from bbtc.source import SourceFile
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree, walk
from tests.long_form import amount
from tests.profiles import examples
from tests.strategies import HOSTILE_NAMES, soda_tree, trees


def export(
    tree: Tree,
    form: str,
    options: Mapping[str, str] | None = None,
    figures: Mapping[str, Fraction] | None = None,
) -> str:
    exporter = load_exporter(form)
    written = exporter.export(tree, parse_options(exporter, options or {}), figures)
    assert isinstance(written, str)
    return written


def depths(root: Node) -> list[int]:
    """The depth of every node, in the order of :func:`walk`."""
    children = root.children if isinstance(root, ControlNode) else ()
    return [0, *(depth + 1 for child in children for depth in depths(child))]


# --- text ------------------------------------------------------------------------------------


def small() -> Tree:
    """Light on, then detect: with a Skipper, and an action that may run again."""
    tree = soda_tree()
    dark, seen = ConditionNode("dark", Is(0, Truth.FALSE)), ConditionNode("seen", Is(1, Truth.TRUE))
    look = ControlNode("look", "skipper", (seen, ActionNode("detect", "detect(soda)")))
    light = ControlNode("light", "sequence", (dark, ActionNode("on", "light_on()", latched=False)))
    return replace(tree, root=ControlNode("root", "fallback", (look, light)))


def test_text_shows_a_tree_as_people_draw_it() -> None:
    assert export(small(), "text") == (
        "?\n"
        "├─ ⇒\n"
        "│  ├─ (seen(soda))\n"
        "│  └─ [detect(soda)]\n"
        "└─ →\n"
        "   ├─ (not luminousity_ok())\n"
        "   └─ [light_on()]+\n"
    )


def test_text_can_do_with_ascii_and_show_ids_and_probabilities() -> None:
    figures = {node.id: Fraction(1, 3) for node in walk(small().root)}
    shown = export(small(), "text", {"style": "ascii", "ids": "true"}, figures).splitlines()
    assert shown[:2] == ["?  1/3  #root", "|- =>  1/3  #look"]
    assert shown[-1] == "   `- [light_on()]+  1/3  #on"


@given(trees(HOSTILE_NAMES))
def test_text_has_one_indented_line_for_each_node_whatever_the_names(tree: Tree) -> None:
    for style in ("unicode", "ascii"):
        text = export(tree, "text", {"style": style})
        lines = text.split("\n")
        assert lines.pop() == ""
        indents = [re.match(r"(?:[├└│ |`][─ -] )*", line) for line in lines]
        assert [line for line in lines if not line.isprintable()] == []
        found = [len(indent.group()) // 3 for indent in indents if indent is not None]
        # A label may itself begin like a stroke, never a stroke like a label.
        assert all(seen >= depth for seen, depth in zip(found, depths(tree.root), strict=True))
        assert style == "unicode" or text.isascii()


# --- mermaid ---------------------------------------------------------------------------------


@dataclass
class Chart:
    """A Mermaid flowchart as its grammar reads it: only the few forms we write."""

    texts: dict[str, list[str]]
    classes: dict[str, str]
    edges: list[tuple[str, str]]
    labels: list[str]


def read_mermaid(text: str) -> Chart:
    """The chart; fails for any line that is not of a known form."""
    chart = Chart({}, {}, [], [])
    first, *lines = text.splitlines()
    assert first == "flowchart TD"
    for line in lines:
        node = re.fullmatch(r'  (n\d+)(?:\[|\(\[)"([^"]*)"(?:\]|\]\)):::(\w+)', line)
        edge = re.fullmatch(r'  (n\d+) -(?:-|\.-)>(?:\|"([^"]*)"\|)? (n\d+)', line)
        if node:
            chart.texts[node[1]] = [unescaped(part) for part in node[2].split("<br>")]
            chart.classes[node[1]] = node[3]
        elif edge:
            chart.edges.append((edge[1], edge[3]))
            chart.labels.append(unescaped(edge[2] or ""))
        else:
            assert re.fullmatch(r"  (classDef \w+|style n\d+|linkStyle [\d,]+) [#\w:,\- ]+", line), line
    return chart


def unescaped(text: str) -> str:
    """Mermaid's character codes as characters; everything else must be harmless."""
    assert not set(re.sub(r"#\d+;", "", text)) & set('<>&"`#[]{}|\\;\n%@$~^')
    return re.sub(r"#(\d+);", lambda code: chr(int(code[1])), text)


def test_mermaid_draws_the_colours_and_shapes_of_the_other_pictures() -> None:
    chart = read_mermaid(export(small(), "mermaid"))
    texts = ["?", "⇒", "seen(soda)", "detect(soda)", "→", "not luminousity_ok()", "light_on()"]
    assert chart.texts == {f"n{number}": [text] for number, text in enumerate(texts)}
    assert chart.edges == [("n0", "n1"), ("n1", "n2"), ("n1", "n3"), ("n0", "n4"), ("n4", "n5"), ("n4", "n6")]
    assert [chart.classes[f"n{i}"] for i in range(4)] == ["control", "control", "condition", "action"]
    assert "style n6 stroke-dasharray" in export(small(), "mermaid")  # may run again


@given(trees(HOSTILE_NAMES))
def test_mermaid_keeps_every_node_and_injects_nothing(tree: Tree) -> None:
    chart = read_mermaid(export(tree, "mermaid"))
    items = diagram(tree, None, expand=True)
    assert len(chart.texts) == len(items)
    for number, item in enumerate(items):
        expected = item.lines if item.symbol is None else (item.symbol, *item.lines)
        assert chart.texts[f"n{number}"] == list(expected)
        if item.parent is not None:
            assert (f"n{item.parent}", f"n{number}") in chart.edges


def test_mermaid_marks_what_no_run_reaches() -> None:
    nodes = list(walk(small().root))
    figures = {node.id: Fraction(1) for node in nodes[:-1]}
    text = export(small(), "mermaid", {"flow": "true"}, figures)
    assert read_mermaid(text).labels == ["1", "1", "1", "1", "1", "0"]
    assert "linkStyle 5 stroke" in text


def test_mermaid_can_stand_in_a_code_block() -> None:
    fenced = export(small(), "mermaid", {"fenced": "true"})
    assert fenced == f"```mermaid\n{export(small(), 'mermaid')}```\n"


# --- json and yaml ---------------------------------------------------------------------------


@examples(60)
@given(trees(HOSTILE_NAMES))
def test_json_is_the_artefact_and_yaml_holds_the_same(tree: Tree) -> None:
    text = export(tree, "json")
    assert export(load_tree(SourceFile("tree.json", text)), "json") == text
    assert yaml.safe_load(export(tree, "yaml")) == json.loads(text)


TEXTS = [
    *("yes", "no", "on", "off", "y", "n", "null", "~", "Null", "true", "1e3", "1E3", "-1e3", "0o7", "0x1F"),
    *("0b11", "1_000", "12:30", "12:30:45", "1.5", "+.5", ".5", "-.inf", ".nan", "=", "<<", "2020-01-01"),
    *(
        "2001-12-14t21:59:43.10-05:00",
        "---",
        "...",
        "?",
        ":",
        "-",
        "#",
        "!",
        "&",
        "*",
        "|",
        ">",
        "%",
        "@",
        "`",
    ),
    *("'", '"', "{", "}", "[", "]", ",", "1e", "0.", "08", "--", "!!str", "&a", "*a", "%YAML", "- a", "? a"),
    *("a: b", "a #b", " a", "a ", "  ", "a\n", "\na", "a\n\nb", "a" * 300, "b c " * 60, "\\"),
]
_CORE = re.compile(
    r"~|null|Null|NULL|true|True|TRUE|false|False|FALSE|[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+"
    r"|[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)|"
)
"""What a plain text of YAML 1.2 may be besides a string (core schema, 10.3.2)."""


def odd_texts() -> list[str]:
    """Every character that is white, ends a line, controls something or is no character at all, alone and
    at every place of a text; in the long form every character there is."""
    kinds = {"Zs", "Zl", "Zp", "Cc", "Cf"}
    odd = [chr(code) for code in range(0x110000) if unicodedata.category(chr(code)) in kinds]
    odd += ["\ud800", "\udfff", "\ufdd0", "\ufffe", "\uffff", "\U0001fffe", "\U0010ffff", "\U0001f600"]
    every = [f"a{chr(code)}b" for code in range(0x110000)] if amount(0, 1) else []
    return [*every, *(form.format(c) for c in odd for form in ("{}", "{}a", "a{}", "a{}b", "a {} b"))]


@pytest.mark.parametrize("form", ["json", "yaml"])
def test_every_character_of_a_name_survives(form: str) -> None:
    texts = [*TEXTS, *odd_texts()]
    nodes = tuple(ConditionNode(f"n{n}", Is(0, Truth.TRUE), name=text) for n, text in enumerate(texts))
    tree = replace(soda_tree(), root=ControlNode("root", "fallback", nodes))
    written = export(tree, form)
    found = json.loads(written) if form == "json" else yaml.safe_load(written)
    assert [node["name"] for node in found["root"]["children"]] == texts
    assert found == tree_to_json(tree)
    if form == "json":
        return
    written.encode()  # what is no character stands there as an escape
    stack: list[Any] = [yaml.compose(written)]
    while stack:
        node = stack.pop()
        if isinstance(node, yaml.ScalarNode):
            plain = node.style is None and node.tag.endswith(":str")
            assert not (plain and _CORE.fullmatch(node.value)), f"read as another in YAML 1.2: {node.value}"
        else:
            stack += [part for pair in node.value for part in (pair if isinstance(pair, tuple) else (pair,))]


@pytest.mark.parametrize("form", ["text", "mermaid", "dot", "btcpp", "svg"])
def test_a_character_that_does_not_print_is_replaced_where_people_read(form: str) -> None:
    """No two lines of what was one, nothing unseen, and what prints is as it was."""
    odd = ("\x85", "\u2028", "\u2029", "\ufeff", "\ud800", "\x00", "\x1b", "\n", "\t", "\uffff")
    for text in (f"a{each}b" for each in odd):
        node = ConditionNode("n1", Is(0, Truth.TRUE), name=text)
        tree = replace(soda_tree(), root=ControlNode("root", "fallback", (node,), name=f"ü→{text}"))
        written = export(tree, form)
        written.encode()
        unseen = {c for c in written if not c.isprintable() and c not in "\n\t"}
        assert not unseen, (form, text, unseen)
        assert (text in written) is False
        if form in {"btcpp", "svg"}:
            ET.fromstring(written)


def test_yaml_refuses_what_is_too_deep_for_its_library() -> None:
    tree = small()
    root = tree.root
    for level in range(2000):
        root = ControlNode(f"deep{level}", "sequence", (root,))
    with pytest.raises(BbtcError, match="BBT0705"):
        export(replace(tree, root=root), "yaml")


# --- nodes that count attempts -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("form", "retry", "until"),
    [
        ("text", "↻ at most 3", "↺ 3 attempts"),
        ("dot", "↻\\nat most 3", "↺\\n3 attempts"),
        ("mermaid", "↻<br>at most 3", "↺<br>3 attempts"),
        ("svg", "retry, at most 3 actions", "retry-until-success, 3 attempts"),
    ],
)
def test_pictures_tell_attempts_of_a_child_from_starts_of_actions(form: str, retry: str, until: str) -> None:
    """Both count up to three, but not the same."""
    tree = small()
    for kind, shown in (("retry", retry), ("retry-until-success", until)):
        root = ControlNode("again", kind, (tree.root,), attempts=3)  # type: ignore[arg-type]
        text = export(replace(tree, root=root), form, {"layout": "bbtc"} if form == "svg" else {})
        assert shown in text
    assert export(replace(tree, root=root), "text", {"style": "ascii"}).startswith("@@ 3 attempts")
