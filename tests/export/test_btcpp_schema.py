"""BehaviorTree.CPP files against the schema that the engine writes of its own nodes.

The engine's schema (4.10.0) has gaps, which docs/export-btcpp.md lists: it lacks nodes that are not the
engine's, for which it would write the types added here; the attribute ``_description``; and SubTrees in the
TreeNodesModel. Everything else must be valid.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from bbtc.backends.btcpp.exporter import btcpp
from bbtc.backends.btcpp.palette import btcpp_palette
from bbtc.tree.nodes import Tree
from tests.domains.problems import PROBLEMS, Problem, plan_of
from tests.replay.random_trees import random_tree

XS = "{http://www.w3.org/2001/XMLSchema}"
PROFILES = ["stock", "bbtc"]


@pytest.fixture(scope="module")
def engine_schema(shared: Path) -> str:
    pytest.importorskip("xmlschema", reason="xmlschema is not installed")
    return (shared / "backends" / "btcpp-builtin-4.10.0.xsd").read_text(encoding="utf-8")


def completed(schema: str, model: ET.Element) -> str:
    """The schema with the nodes of a TreeNodesModel, as the engine writes them once they are registered."""
    root = ET.fromstring(schema)
    (group,) = [part for part in root.iter(f"{XS}group") if part.get("name") == "oneNodeGroup"]
    for entry in model:
        if entry.tag == "SubTree":
            continue
        name = entry.attrib["ID"]
        ET.SubElement(group[0], f"{XS}element", name=name, type=f"{name}Type")
        kind = ET.SubElement(root, f"{XS}complexType", name=f"{name}Type")
        if entry.tag == "Control":
            ET.SubElement(kind, f"{XS}group", ref="oneNodeGroup", minOccurs="0", maxOccurs="unbounded")
        ET.SubElement(kind, f"{XS}attributeGroup", ref="commonAttributeGroup")
        for port in entry.iter("input_port"):
            use = "optional" if "default" in port.attrib else "required"
            ET.SubElement(kind, f"{XS}attribute", name=port.attrib["name"], use=use)
    return ET.tostring(root, encoding="unicode")


def assert_valid(schema: str, text: str) -> None:
    import xmlschema

    document = ET.fromstring(text)
    model = document.find("TreeNodesModel")
    assert model is not None
    checker = xmlschema.XMLSchema(completed(schema, model))
    for subtree in model.findall("SubTree"):
        model.remove(subtree)
    for element in document.iter():
        element.attrib.pop("_description", None)
    errors = [f"{error.path}: {error.reason}" for error in checker.iter_errors(document)]
    assert errors == []


def check(schema: str, tree: Tree) -> None:
    for nodes in PROFILES:
        assert_valid(schema, btcpp.export(tree, {"nodes": nodes, "namespace": "a"}, None))
        assert_valid(schema, btcpp_palette.export(tree, {"nodes": nodes}, None))


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_the_trees_of_the_domains_are_valid(problem: Problem, engine_schema: str) -> None:
    check(engine_schema, plan_of(problem).tree)


@pytest.mark.parametrize("seed", range(1, 9))
def test_random_trees_are_valid(seed: int, engine_schema: str) -> None:
    check(engine_schema, random_tree(seed, latched=0.7))


def test_the_schema_finds_what_is_wrong(engine_schema: str) -> None:
    text = btcpp.export(random_tree(1), {}, None)
    for old, new in (("<Script code", "<Script kode"), ("<ReactiveSequence", "<ReactiveSequenze")):
        wrong = text.replace(old, new).replace(old.replace("<", "</"), new.replace("<", "</"))
        assert wrong != text
        with pytest.raises(AssertionError):
            assert_valid(engine_schema, wrong)
