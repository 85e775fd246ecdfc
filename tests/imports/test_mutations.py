"""Files changed at random: they are read or refused, with places; what is read is what is then written, and
what the engine does with the changed file."""

from __future__ import annotations

import copy
import random
from importlib.util import find_spec
from xml.etree import ElementTree as ET

import pytest

from bbtc.backends.btcpp.exporter import btcpp
from bbtc.backends.btcpp.reader.xml import tree_from_btcpp
from bbtc.diagnostics import BbtcError, Report
from bbtc.source import SourceFile
from bbtc.tree.nodes import Tree, walk
from bbtc.tree.validate import check_tree
from tests.imports.engine_nodes import NODES, SCRIPTS
from tests.long_form import amount
from tests.replay.random_trees import busy_tree, random_tree
from tests.replay.reference import expected_ticks
from tests.replay.ticks import TickWorld, random_script, trace

MUTANTS = amount(200, 20_000)
RUN = amount(350, 40_000)
"""Changed files whose behaviour is compared with the engine's, if they are read."""

Parents = dict[ET.Element, ET.Element]

_WRAPPERS = [(tag, ports) for kind in ("control", "decorator") for tag, ports in NODES[kind].items()] + [
    ("Skipper", {}),
    ("Latch", {}),
]
_LEAVES = [(tag, ports) for kind in ("action", "condition") for tag, ports in NODES[kind].items()]
_CONDITIONS = ["true", "false", "@acting", "!@acting", "_latch == 'success'"]
_ASSIGNMENTS = ["x := 1", "_latch := 'success'", "@acting := true", "_started := 'no'"]
_OTHERS = {
    "_autoremap": ["true", "false"],
    "keep": ["false", "true"],
    "flag": ["acting", "other"],
    "success_count": ["1", "2"],
    "failure_count": ["1", "2"],
    "else": ["FAILURE", "RUNNING", "SUCCESS"],
    "then_skip": ["true", "false"],
    "name": ["", "label", "skipper"],
}


def changed(document: ET.Element, rng: random.Random) -> None:
    """Change one thing: take away, repeat, move or wrap a node, add one of the engine's, or change an
    attribute or a tag."""
    parents: Parents = {child: parent for parent in document.iter() for child in parent}
    elements = [element for element in parents if element.tag not in ("input_port", "description")]
    element, other = rng.choice(elements), rng.choice(elements)
    parent = parents[element]
    place = list(parent).index(element)
    match rng.randrange(11):
        case 0:
            parent.remove(element)
        case 1:
            parent.insert(place, copy.deepcopy(element))
        case 2:
            parent[place], element.tag = element, other.tag
        case 3:
            tag, ports = rng.choice(_WRAPPERS)
            wrapper = ET.Element(tag, ports)
            parent[place] = wrapper
            wrapper.append(element)
        case 4 if element.attrib:
            element.attrib.pop(rng.choice(sorted(element.attrib)))
        case 5 if element.attrib and other.attrib:
            key = rng.choice(sorted(element.attrib))
            element.attrib[key] = other.attrib[rng.choice(sorted(other.attrib))]
        case 6:
            tag, ports = rng.choice(_LEAVES)
            parent.insert(place, ET.Element(tag, ports))
        case 7 | 8:
            script = rng.choice(SCRIPTS)
            texts = _CONDITIONS if script.endswith("If") or script == "_while" else _ASSIGNMENTS
            element.attrib[script] = rng.choice(texts)
        case 9:
            key = rng.choice(sorted(_OTHERS))
            element.attrib[key] = rng.choice(_OTHERS[key])
        case _:
            parent.insert(place, copy.deepcopy(other))


def mutant(text: str, rng: random.Random, most: int = 3) -> str:
    """A file with a few changes."""
    document = ET.fromstring(text, ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
    for _ in range(rng.randint(1, most)):
        changed(document, rng)
    return ET.tostring(document, encoding="unicode")


def read(text: str, tree: Tree, report: Report | None = None) -> Tree | None:
    """The tree of a file; None if it is refused, as it should be, with places and no more."""
    try:
        return tree_from_btcpp(SourceFile("t.xml", text), tree.task, report or Report()).tree
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
        found = read(mutant(text, rng), tree)
        if found is None:
            refused += 1
            continue
        accepted += 1
        check_tree(found)
        again = read(btcpp.export(found, {"nodes": nodes}, None), tree)
        assert again == found
    assert accepted > MUTANTS / 15
    assert refused > MUTANTS / 15


@pytest.mark.skipif(find_spec("behaviortreepy") is None, reason="behaviortreepy is not installed")
def test_what_is_read_of_a_changed_file_is_what_the_engine_does() -> None:
    """Tick by tick, with actions of many ticks, worlds that change, and trees that are halted."""
    from bbtc.replay.engines import BtcppReplay

    rng = random.Random(11)
    compared = different = not_loaded = 0
    for number in range(RUN):
        tree = busy_tree(number % 80, endless=number % 2 == 1)
        before = btcpp.export(tree, {"notes": False}, None)
        text, report = mutant(before, rng, most=2), Report()
        found = read(text, tree, report)
        if found is None or {"BBT0620", "BBT0433"} & {doubt.code for doubt in report}:
            continue  # it ticks for ever without its last branch, or holds less, which the warning says
        try:
            replay = BtcppReplay(tree, text)
            replay.begin(TickWorld(tree.task, random_script(tree.task, rng, 1)), haltable=True)
        except RuntimeError:  # a fault in a BehaviorTree that nobody calls
            not_loaded += 1
            continue
        for _ in range(4):
            script = random_script(tree.task, rng, 15)
            assert trace(replay, script) == expected_ticks(tree.task, found.root, script), (number, text)
        compared += 1
        different += _shape(found) != _shape(tree)
    assert not_loaded < RUN / 20
    assert compared > RUN / 15
    assert different > RUN / 30


def _shape(tree: Tree) -> list[str]:
    return [str(type(node)) + str(getattr(node, "kind", "")) for node in walk(tree.root)]


def test_changed_bytes_are_read_or_refused() -> None:
    rng = random.Random(7)
    for number in range(MUTANTS):
        tree = random_tree(number % 50 + 1)
        text = btcpp.export(tree, {"nodes": "bbtc"}, None)
        at = rng.randrange(len(text))
        letter = rng.choice("<>\"'&/=! {}@#;a0\x00\x1fé" + text[rng.randrange(len(text))])
        read(text[:at] + letter + text[at + rng.randrange(3) :], tree)
