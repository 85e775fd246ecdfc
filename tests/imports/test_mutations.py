"""Files changed at random: they are read or refused, with places; what is read is what is then written."""

from __future__ import annotations

import copy
import random
from xml.etree import ElementTree as ET

import pytest

from bbtc.artefacts.btcpp_xml import tree_from_btcpp
from bbtc.diagnostics import BbtcError, Report
from bbtc.export.btcpp import btcpp
from bbtc.source import SourceFile
from bbtc.tree.nodes import Tree
from bbtc.tree.validate import check_tree
from tests.long_form import amount
from tests.replay.random_trees import random_tree

MUTANTS = amount(600, 20_000)

Parents = dict[ET.Element, ET.Element]


def changed(document: ET.Element, rng: random.Random) -> None:
    """Change one thing: take away, repeat, move or wrap a node, or change an attribute or a tag."""
    parents: Parents = {child: parent for parent in document.iter() for child in parent}
    elements = [element for element in parents if element.tag not in ("input_port", "description")]
    element, other = rng.choice(elements), rng.choice(elements)
    parent = parents[element]
    place = list(parent).index(element)
    match rng.randrange(7):
        case 0:
            parent.remove(element)
        case 1:
            parent.insert(place, copy.deepcopy(element))
        case 2:
            parent[place], element.tag = element, other.tag
        case 3:
            wrapper = ET.Element(rng.choice(["ReactiveSequence", "Skipper", "Inverter", "Latch", "Delay"]))
            parent[place] = wrapper
            wrapper.append(element)
        case 4 if element.attrib:
            element.attrib.pop(rng.choice(sorted(element.attrib)))
        case 5 if element.attrib and other.attrib:
            key = rng.choice(sorted(element.attrib))
            element.attrib[key] = other.attrib[rng.choice(sorted(other.attrib))]
        case _:
            parent.insert(place, copy.deepcopy(other))


def read(text: str, tree: Tree) -> Tree | None:
    """The tree of a file; None if it is refused, as it should be, with places and no more."""
    report = Report()
    try:
        return tree_from_btcpp(SourceFile("t.xml", text), tree.task, report).tree
    except BbtcError as error:
        refusal = error
    assert refusal.diagnostics
    assert all(diagnostic.span is not None for diagnostic in refusal.diagnostics), refusal
    return None


@pytest.mark.parametrize("nodes", ["stock", "bbtc"])
def test_a_changed_file_is_read_or_refused(nodes: str) -> None:
    rng = random.Random(nodes)
    accepted = refused = 0
    for number in range(MUTANTS):
        tree = random_tree(number % 50 + 1, latched=0.7)
        text = btcpp.export(tree, {"nodes": nodes, "notes": number % 3 > 0}, None)
        document = ET.fromstring(text, ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
        for _ in range(rng.randint(1, 3)):
            changed(document, rng)
        found = read(ET.tostring(document, encoding="unicode"), tree)
        if found is None:
            refused += 1
            continue
        accepted += 1
        check_tree(found)
        again = read(btcpp.export(found, {"nodes": nodes}, None), tree)
        assert again == found
    assert accepted > 20
    assert refused > 20


def test_changed_bytes_are_read_or_refused() -> None:
    rng = random.Random(7)
    for number in range(MUTANTS):
        tree = random_tree(number % 50 + 1)
        text = btcpp.export(tree, {"nodes": "bbtc"}, None)
        at = rng.randrange(len(text))
        letter = rng.choice("<>\"'&/=! {}@#;a0\x00\x1fé" + text[rng.randrange(len(text))])
        read(text[:at] + letter + text[at + rng.randrange(3) :], tree)
