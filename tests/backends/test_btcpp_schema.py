"""BehaviorTree.CPP files against what the engine says of its own nodes, ``tests/btcpp_nodes.tsv``.

The engine's schema (4.10.0) has gaps, which docs/export-btcpp.md lists: it lacks nodes that are not the
engine's, which it would describe once they are registered; the attribute ``_description``; and SubTrees in
the TreeNodesModel. Everything else must be valid.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

import pytest

from bbtc.backends.btcpp.exporter import btcpp
from bbtc.backends.btcpp.palette import btcpp_palette
from bbtc.tree.nodes import Tree
from tests.btcpp_nodes import faults, registered
from tests.domains.problems import PROBLEMS, Problem, tree_of
from tests.replay.random_trees import random_tree

PROFILES = ["stock", "bbtc"]
SCRIPT = r"(<Script code=[^>]*?)/>"


def faults_of(text: str) -> list[str]:
    """What the schema has against a file, apart from the gaps above."""
    document = ET.fromstring(text)
    model = document.find("TreeNodesModel")
    assert model is not None
    more = registered(model)
    for subtree in model.findall("SubTree"):
        model.remove(subtree)
    for element in document.iter():
        element.attrib.pop("_description", None)
    return faults(document, more)


def check(tree: Tree) -> None:
    for nodes in PROFILES:
        assert faults_of(btcpp.export(tree, {"nodes": nodes, "namespace": "a"}, None)) == []
        assert faults_of(btcpp_palette.export(tree, {"nodes": nodes}, None)) == []


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_the_trees_of_the_domains_are_valid(problem: Problem) -> None:
    check(tree_of(problem))


@pytest.mark.parametrize("seed", range(1, 9))
def test_random_trees_are_valid(seed: int) -> None:
    check(random_tree(seed, latched=0.7))


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (SCRIPT, "<Skript/>", "no such element"),
        (r"<(/?)ReactiveSequence\b", r"<\1ReactiveSequenze", "no such element"),
        (r"<Script code=", "<Script kode=", "no attribute kode"),
        (r"<Script code=", "<Script kode=", "code is missing"),
        (r"<(/?)BehaviorTree\b", r"<\1Tree", "no such element"),
        (r'<root BTCPP_format="4"', "<root", "BTCPP_format is missing"),
        (r"(<BehaviorTree [^>]*>)", r"\1<AlwaysSuccess/>", "not node"),
        (r"(<ReactiveSequence>)", r"\1words", "holds text"),
        (SCRIPT, r"\1><AlwaysFailure/></Script>", "not nothing"),
        (SCRIPT, '<Sleep msec="long"/>', "no integer"),
        (SCRIPT, r'<RunOnce then_skip="perhaps">\1/></RunOnce>', "no boolean"),
        (SCRIPT, r'<LoopInt value="x" queue="{q}">\1/></LoopInt>', "value='x' is no entry"),
        (SCRIPT, "<Inverter/>", "not node"),
        (r"(<TreeNodesModel>)", r"<TreeNodesModel/>\1", "holds"),
    ],
)
def test_the_schema_finds_what_is_wrong(old: str, new: str, fault: str) -> None:
    text = btcpp.export(random_tree(1), {}, None)
    wrong = re.sub(old, new, text, flags=re.DOTALL)
    assert wrong != text
    assert any(fault in found for found in faults_of(wrong)), faults_of(wrong)[:9]
