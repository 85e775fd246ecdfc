"""Everything that BehaviorTree.CPP gives a meaning to, in every place of a file: it is in the tree that is
read, or it is refused by its name and line."""

from __future__ import annotations

import random
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from bbtc.backends.btcpp.idioms import LATCH, SKIPPER
from bbtc.backends.btcpp.reader.patterns import READ
from bbtc.backends.btcpp.reader.unread import WITHOUT_MEANING
from bbtc.tree.nodes import ControlNode, Node, Tree
from tests import btcpp_nodes
from tests.imports.engine_nodes import NODES, PORTS, SCRIPTS
from tests.imports.samples import (
    PROFILES,
    check_in_engine,
    elements,
    exported,
    idioms_tree,
    line_of,
    lines_of,
    parsed,
    read,
    refusal,
    text_of,
)
from tests.long_form import LONG, amount

TREE = idioms_tree()
FILES = {nodes: exported(TREE, nodes) for nodes in PROFILES}
MARK = "zzz"


def test_the_sample_has_every_node_that_is_read() -> None:
    tags = {element.tag for text in FILES.values() for element in elements(parsed(text))}
    assert tags >= READ | {SKIPPER, LATCH}
    for text in FILES.values():
        assert read(text, TREE.task)[0].tree == TREE


def places(nodes: str) -> range:
    """The numbers of the elements of the sample."""
    return range(len(elements(parsed(FILES[nodes]))))


def in_files(names: Sequence[str], always: Collection[str] = ()) -> list[tuple[str, str]]:
    """Each name with both samples; in the short form with one or the other, unless it is among ``always``."""
    return [
        (nodes, name)
        for at, name in enumerate(names)
        for number, nodes in enumerate(PROFILES)
        if LONG or name in always or number == at % len(PROFILES)
    ]


# --- attributes ------------------------------------------------------------------------------

ATTRIBUTES = sorted(
    {
        *SCRIPTS,
        *PORTS,
        "_unknown",
        "unknown",
        "_else",
        "xmlns:x",
        "x:y",
        "keep",
        "flag",
        "__shared_blackboard",
    }
    - {"ID"}
)


@pytest.mark.parametrize(("nodes", "attribute"), in_files([*ATTRIBUTES, "ID"]))
def test_an_attribute_is_refused_by_its_name_and_line(nodes: str, attribute: str) -> None:
    # In all places at once, which is quick; where one is not named then, with those of its tag, and alone.
    tags = [element.tag for element in elements(parsed(FILES[nodes]))]
    left = not_named(nodes, attribute, [*places(nodes)])
    left = [
        number
        for tag in dict.fromkeys(tags[number] for number in left)
        for number in not_named(nodes, attribute, [number for number in left if tags[number] == tag])
    ]
    if left and not are_unread_ports(nodes, attribute, left):
        for number in left:
            if not named(nodes, attribute, [number]):
                check_port(nodes, attribute, number)


def not_named(nodes: str, attribute: str, numbers: list[int]) -> list[int]:
    """The places where an attribute is not refused by its name, even without those where it is."""
    while numbers and (found := named(nodes, attribute, numbers)):
        numbers = [number for number in numbers if number not in found]
    return numbers


def with_attribute(nodes: str, attribute: str, numbers: list[int]) -> tuple[str, list[ET.Element]]:
    """The sample with an attribute in some places, each with a value of its own."""
    document = parsed(FILES[nodes])
    changed = [elements(document)[number] for number in numbers]
    for number, element in zip(numbers, changed, strict=True):
        element.set(attribute, f"{MARK}{number}")
    prefix = ' xmlns:x="urn:x"' if attribute == "x:y" else ""
    return text_of(document).replace("<root", f"<root{prefix}", 1), changed


def named(nodes: str, attribute: str, numbers: list[int]) -> set[int]:
    """The places where an attribute is refused by its name, or its element's, and its line."""
    text, changed = with_attribute(nodes, attribute, numbers)
    found = lines_of(refusal(text, TREE.task))
    result = set()
    for number, element in zip(numbers, changed, strict=True):
        line = line_of(text, f'{attribute}="{MARK}{number}"')
        if any(at == line and (attribute in words or element.tag in words) for at, words in found):
            result.add(number)
    return result


def are_unread_ports(nodes: str, attribute: str, numbers: list[int]) -> bool:
    """Whether an attribute is, in all these places, a port of a SubTree that changes nothing."""
    text, changed = with_attribute(nodes, attribute, numbers)
    if not attribute.isidentifier() or attribute[0] == "_" or {each.tag for each in changed} != {"SubTree"}:
        return False
    return not refusal(text, TREE.task) and read(text, TREE.task)[0].tree == TREE


def check_port(nodes: str, attribute: str, number: int) -> None:
    """Fail unless an attribute that is read is a port of a SubTree, one that nothing inside reads."""
    text, (element,) = with_attribute(nodes, attribute, [number])
    found = refusal(text, TREE.task)
    if (element.tag, attribute) == ("BehaviorTree", "ID"):
        assert found  # nobody finds the tree under its name
        return
    assert element.tag == "SubTree", (attribute, ET.tostring(element)[:200])
    assert attribute.isidentifier()
    assert attribute[0] != "_"
    # A value that is none, where something inside reads it.
    assert {each.code for each in found} == {"BBT0606"} if found else read(text, TREE.task)[0].tree == TREE


@pytest.mark.parametrize("attribute", [name for name in SCRIPTS if name.startswith("_on")])
def test_a_script_of_an_idiom_counts_as_it_is(attribute: str) -> None:
    """Where an idiom has the attribute, another value of it is refused, and so is its absence."""
    has = [number for number, each in enumerate(elements(parsed(FILES["stock"]))) if attribute in each.attrib]
    assert len(has) > 2
    for number in has:
        for value in ("x := 1", None):
            document = parsed(FILES["stock"])
            element = elements(document)[number]
            del element.attrib[attribute]
            if value is not None:
                element.set(attribute, value)
            found = lines_of(refusal(text_of(document), TREE.task))
            assert any(attribute in words for _, words in found), found


def without_labels(tree: Tree) -> Node:
    """The nodes alone."""

    def plain(node: Node) -> Node:
        if isinstance(node, ControlNode):
            node = replace(node, children=tuple(plain(child) for child in node.children), template=None)
        return replace(node, name=None, reason=None)

    return plain(tree.root)


@pytest.mark.parametrize("place", WITHOUT_MEANING)
@pytest.mark.parametrize("nodes", PROFILES)
def test_what_is_listed_as_without_meaning_changes_nothing(nodes: str, place: str) -> None:
    for attribute in WITHOUT_MEANING[place]:
        for value in ("", "some words"):
            document = parsed(FILES[nodes])
            changed = 0
            for element in elements(document):
                where = element.tag if element.tag in ("root", "BehaviorTree") else "node"
                if where == place and not attribute.startswith("xs") and attribute not in element.attrib:
                    element.set(attribute, f"{value} {changed}" if value else value)
                    changed += 1
            imported, doubts = read(text_of(document), TREE.task)
            assert without_labels(imported.tree) == without_labels(TREE)
            assert not doubts
            assert changed or attribute.startswith("xs")


def test_a_file_may_name_a_schema_for_editors() -> None:
    names = ' xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="x.xsd"'
    text = FILES["stock"].replace("<root", f"<root{names}", 1)
    assert read(text, TREE.task)[0].tree == TREE


def test_the_page_lists_what_is_without_meaning() -> None:
    page = (Path(__file__).parents[2] / "docs" / "import.md").read_text(encoding="utf-8")
    for names in WITHOUT_MEANING.values():
        for name in names:
            assert f"`{name}`" in page, name


# --- nodes -----------------------------------------------------------------------------------

STEP = amount(72, 1)
"""Of the places in the sample every so many are tried with a node, others with another."""

OF_ENGINE = {tag: ports for nodes in NODES.values() for tag, ports in nodes.items()}
INNER = {*NODES["control"], *NODES["decorator"]}


def edits(nodes: str, tag: str, ports: dict[str, str]) -> list[ET.Element]:
    """The sample with a node added, around or before every other, or in the place of every other."""
    changed = []
    first = random.Random(f"{nodes} {tag}").randrange(STEP)
    for number in places(nodes)[first::STEP]:
        for way in ("before", "around", "instead"):
            document = parsed(FILES[nodes])
            element = elements(document)[number]
            parents = {child: parent for parent in document.iter() for child in parent}
            parent = parents.get(element)
            if parent is None or element.tag == "BehaviorTree":
                continue
            added = ET.Element(tag, ports | {"name": MARK})
            place = list(parent).index(element)
            if way == "before":
                parent.insert(place, added)
                if tag in INNER:
                    added.append(ET.Element("AlwaysSuccess"))
            elif way == "around" and tag in INNER:
                parent[place] = added
                added.append(element)
            elif way == "instead" and element.tag != tag:
                parent[place] = added
                added.extend(element)
            else:
                continue
            changed.append(document)
    return changed


@pytest.mark.parametrize(("nodes", "tag"), in_files([*OF_ENGINE], always=READ))
def test_a_node_is_read_or_refused_by_its_name_and_line(nodes: str, tag: str) -> None:
    ports, rng = OF_ENGINE[tag], random.Random(tag)
    done = 0
    for document in edits(nodes, tag, ports):
        text = text_of(document)
        found = refusal(text, TREE.task)
        if found:
            if tag not in READ:
                line = line_of(text, f'name="{MARK}"')
                alone = {(at, words) for at, words in lines_of(found) if "holds one node" in words}
                named = any(at == line and tag in words for at, words in lines_of(found))
                assert named or alone, (text, lines_of(found))
            continue
        assert tag in READ, text
        done += 1
        if nodes == "stock" and done % 4 == 0:
            check_in_engine(TREE, text, rng)


def test_the_nodes_are_those_of_the_engine() -> None:
    """Those that the engine itself lists."""
    for name, form in btcpp_nodes.NODES.items():
        ports = NODES[form.kind.lower()][name]
        assert set(form.attributes) - {"*", "ID"} == set(ports) - {"ID"}, name
    own = {name for name in btcpp_nodes.EVERY_NODE.attributes if name.startswith("_")}
    assert own == set(SCRIPTS)


# --- the rest of a file ----------------------------------------------------------------------


@pytest.mark.parametrize("added", ["words", "<![CDATA[words]]>", "&#119;ords"])
@pytest.mark.parametrize("nodes", PROFILES)
def test_text_between_nodes_is_refused(nodes: str, added: str) -> None:
    for first in range(0, len(places(nodes)), 40):
        document = parsed(FILES[nodes])
        numbers = places(nodes)[first : first + 40]
        text_of(document)
        for number in numbers:
            elements(document)[number].text = f"{MARK}{number};"
        text = ET.tostring(document, encoding="unicode")
        found = lines_of(refusal(text.replace(MARK, added), TREE.task))
        for number in numbers:
            line = line_of(text, f"{MARK}{number};")
            assert any(at == line and "text in" in words for at, words in found), (number, found)


@pytest.mark.parametrize(
    ("added", "named"),
    [
        ("<?robot stop?>", "processing instruction"),
        ("<Robot/>", "'Robot'"),
        ('<include path="other.xml"/>', "'include'"),
        ('<include path="other.xml" ros_pkg="robots"/>', "'include'"),
        ("<TreeNodesModel/>", "TreeNodesModel"),
        ('<Sequence name="x"/>', "'Sequence'"),
        ("words", "text in 'root'"),
    ],
)
def test_what_stands_beside_the_trees_is_refused(added: str, named: str) -> None:
    text = FILES["stock"].replace("<TreeNodesModel>", f"\n{added}\n<TreeNodesModel>", 1)
    line = text[: text.index(added)].count("\n") + 1 + (added == "<TreeNodesModel/>")
    found = lines_of(refusal(text, TREE.task))
    assert [at for at, words in found if named in words] in ([line], [line + 1]), found


@pytest.mark.parametrize("added", ["<!-- words -->", "<!-- <Timeout/> -->"])
def test_comments_say_nothing(added: str) -> None:
    text = FILES["stock"].replace("<ReactiveSequence>", f"{added}<ReactiveSequence>{added}")
    assert read(f"{added}{text.partition('?>')[2]}{added}", TREE.task)[0].tree == TREE


def test_the_palette_says_nothing_of_leaves() -> None:
    entry = (
        '<Action ID="Look" editable="true"><input_port name="x" default="y">words</input_port><Any/></Action>'
    )
    for text in FILES.values():
        begin, end = text.index("<TreeNodesModel>"), text.index("</TreeNodesModel>")
        assert read(text[:begin] + f"<TreeNodesModel>{entry}" + text[end:], TREE.task)[0].tree == TREE
