"""What editors such as Groot2 do to a file when they save it: the tree stays the same."""

from __future__ import annotations

import random
import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Protocol
from xml.etree import ElementTree as ET

import pytest

from bbtc.artefacts import dumps, tree_to_json
from bbtc.diagnostics import BbtcError, Report
from bbtc.files.sources import decode_source
from bbtc.limits import Limits
from bbtc.pipeline import import_tree
from bbtc.source import SourceFile
from bbtc.tree.nodes import Tree
from tests.domains.problems import PROBLEMS, Problem, tree_of
from tests.imports.samples import PROFILES, check_in_engine, elements, exported, idioms_tree, parsed, read


class Saved(Protocol):
    def __call__(self, document: ET.Element) -> str | None: ...


def _text(document: ET.Element) -> str:
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(document, encoding="unicode")


def without_main_tree(document: ET.Element) -> None:
    """Groot2 does not keep which tree is run."""
    del document.attrib["main_tree_to_execute"]


def remapping_told(document: ET.Element) -> None:
    for call in _nodes(document, "SubTree"):
        call.set("_autoremap", "false")


def attributes_in_another_order(document: ET.Element) -> None:
    rng = random.Random(1)
    for element in document.iter():
        items = list(element.attrib.items())
        rng.shuffle(items)
        element.attrib.clear()
        element.attrib.update(items)


def trees_in_another_order(document: ET.Element) -> None:
    """Sorted by their ids."""
    trees = sorted(document.findall("BehaviorTree"), key=lambda tree: tree.attrib["ID"])
    for tree in trees:
        document.remove(tree)
    document[:0] = trees


def palette_first(document: ET.Element) -> None:
    for model in document.findall("TreeNodesModel"):
        document.remove(model)
        document.insert(0, model)


def palette_dropped(document: ET.Element) -> None:
    for model in document.findall("TreeNodesModel"):
        document.remove(model)


def palette_of_editor(document: ET.Element) -> None:
    """Entries that may be edited, with the engine's nodes, defaults, types and fields among them."""
    for model in document.findall("TreeNodesModel"):
        for entry in model:
            if entry.tag != "SubTree":
                entry.set("editable", "true")
                for port in entry.findall("input_port"):
                    port.set("default", "")
        sequence = ET.SubElement(model, "Control", ID="Sequence", editable="false")
        fields = ET.SubElement(sequence, "MetadataFields")
        ET.SubElement(fields, "Metadata", key="value")


def paths_and_numbers(document: ET.Element) -> None:
    for number, element in enumerate(elements(document)[1:]):
        element.set("_fullpath", f"a/{number}")
        element.set("_uid", str(number))


def collapsed(document: ET.Element) -> None:
    for element in elements(document)[1:]:
        element.set("_collapsed", "true")


def project(document: ET.Element) -> None:
    document.set("project_name", "Project")


def empty_names(document: ET.Element) -> None:
    """A name that is there, and empty."""
    for element in elements(document):
        if element.tag not in ("root", "BehaviorTree", "SubTree"):
            element.attrib.setdefault("name", "")


def pairs_of_tags(document: ET.Element) -> str:
    return '<?xml version="1.0"?>' + ET.tostring(document, encoding="unicode", short_empty_elements=False)


def one_line(document: ET.Element) -> str:
    for element in document.iter():
        element.tail = None
        if not (element.text or "").strip():
            element.text = None
    return _text(document)


def dos_lines(document: ET.Element) -> str:
    return _text(document).replace("\n", "\r\n")


def byte_order_mark(document: ET.Element) -> str:
    return "\ufeff" + _text(document)


def single_quotes(document: ET.Element) -> str:
    return re.sub(r'="([^"\']*)"', r"='\1'", _text(document))


def long_tags(document: ET.Element) -> None:
    """The other spelling of nodes, which the engine does not take everywhere."""
    for element in elements(document)[1:]:
        if element.tag not in ("BehaviorTree", "SubTree"):
            element.set("ID", element.tag)
            element.tag = "Control" if len(element) > 1 else "Action"


WAYS: list[Saved] = [
    without_main_tree,
    remapping_told,
    attributes_in_another_order,
    trees_in_another_order,
    palette_first,
    palette_dropped,
    palette_of_editor,
    paths_and_numbers,
    collapsed,
    project,
    empty_names,
    pairs_of_tags,
    one_line,
    dos_lines,
    byte_order_mark,
    single_quotes,
    long_tags,
]


def _nodes(document: ET.Element, tag: str) -> list[ET.Element]:
    return [element for element in elements(document) if element.tag == tag]


def saved(text: str, *ways: Saved) -> SourceFile:
    """A file as an editor leaves it, read from its bytes."""
    document = parsed(text)
    result = None
    for way in ways:
        result = way(document)
    return decode_source("saved.xml", (_text(document) if result is None else result).encode())


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
@pytest.mark.parametrize("nodes", PROFILES)
def test_a_saved_file_is_the_same_tree(nodes: str, way: Saved) -> None:
    tree = idioms_tree()
    imported, doubts = read(saved(exported(tree, nodes), way).text, tree.task)
    assert imported.tree == tree
    assert not doubts


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_every_problem_survives_an_editor(problem: Problem) -> None:
    """All at once, in both profiles, with the comment and without it."""
    tree = tree_of(problem)
    together = [way for way in WAYS if way not in (palette_dropped, pairs_of_tags, byte_order_mark, one_line)]
    for nodes in PROFILES:
        text = exported(tree, nodes)
        assert read(saved(text, *together).text, tree.task)[0].tree == tree
        bare = exported(tree, nodes, notes=False)
        once, _ = read(bare, tree.task)
        again, _ = read(saved(bare, *together).text, tree.task)
        assert again.tree == once.tree
        assert again.claimed is None


# --- which tree, and what is claimed ---------------------------------------------------------


def sources(tree: Tree, text: str) -> tuple[SourceFile, list[SourceFile]]:
    return SourceFile("file.xml", text), [SourceFile("tree.json", dumps(tree_to_json(tree)))]


def imported(tree: Tree, text: str, main: str | None = None) -> tuple[Tree, list[str]]:
    """The tree, and what is said about it."""
    report = Report()
    file, others = sources(tree, text)
    found = import_tree(file, others, report, Limits(), main=main)
    return found, [d.message for d in report]


OTHER = '<BehaviorTree ID="Other"><Inverter><Lit/></Inverter></BehaviorTree>'


def test_of_several_trees_that_nobody_calls_one_is_chosen() -> None:
    tree = idioms_tree()
    text = exported(tree, "bbtc").replace(' main_tree_to_execute="FindCan"', "")
    both = text.replace("<TreeNodesModel>", OTHER + "<TreeNodesModel>")
    with pytest.raises(BbtcError) as error:
        imported(tree, both)
    (found,) = error.value.diagnostics
    assert found.code == "BBT0619"
    assert "FindCan, Other" in found.message
    assert found.hint is not None
    assert "--tree" in found.hint
    first, said = imported(tree, both, "FindCan")
    assert first.root == tree.root
    assert any("Other" in each for each in said)
    other, _ = imported(tree, both, "Other")
    assert other.root != tree.root
    with pytest.raises(BbtcError, match="no BehaviorTree 'Nobody'"):
        imported(tree, both, "Nobody")


def test_trees_that_all_are_called_are_refused() -> None:
    circle = '<root BTCPP_format="4">' + "".join(
        f'<BehaviorTree ID="{a}"><SubTree ID="{b}"/></BehaviorTree>' for a, b in ("xy", "yx")
    )
    with pytest.raises(BbtcError) as error:
        imported(idioms_tree(), f"{circle}</root>")
    assert [d.code for d in error.value.diagnostics] == ["BBT0619"]


def test_a_tree_artefact_has_no_trees_to_choose_from() -> None:
    tree = idioms_tree()
    source, _ = sources(tree, dumps(tree_to_json(tree)))
    with pytest.raises(BbtcError) as error:
        import_tree(source, [], Report(), Limits(), main="FindCan")
    assert [d.code for d in error.value.diagnostics] == ["BBT0619"]


def test_what_a_file_claims_is_compared_and_nothing_else() -> None:
    tree = idioms_tree()
    right, _ = imported(tree, exported(tree, "stock"))
    figure = right.success_probability
    exact = replace(tree, success_probability=figure, status=right.status)
    assert imported(exact, exported(exact, "stock"))[1] == []
    wrong = replace(exact, success_probability=Fraction(1, 3))
    (said,) = imported(wrong, exported(wrong, "stock"))[1]
    assert "claims success probability 1/3" in said
    assert f"it is {figure}" in said


def test_a_file_without_claims_is_told_none() -> None:
    tree = idioms_tree()
    right, _ = imported(tree, exported(tree, "stock"))
    figure = right.success_probability
    exact = replace(tree, success_probability=figure)
    bare, said = imported(exact, exported(exact, "stock", notes=False))
    assert said == [f"file.xml claims no success probability; it is {figure}"]
    assert bare.success_probability == figure
    # The description is read by people: where it tells what is not so, they are told.
    wrong = replace(exact, success_probability=Fraction(1, 3))
    _, said = imported(wrong, exported(wrong, "stock", notes=False))
    assert len(said) == 2
    assert "description" in said[1]
    assert "1/3" in said[1]


def test_a_default_of_the_palette_counts_for_a_subtree() -> None:
    tree = idioms_tree()
    text = exported(tree, "stock")
    call = re.search(r'<SubTree ID="(FindCan_UnknownSeen\w*)"( \w+)="cup"', text)
    assert call is not None
    port = call.group(2).strip()
    bare = text.replace(call.group(), f'<SubTree ID="{call.group(1)}"', 1)
    model = f'<SubTree ID="{call.group(1)}">'
    with pytest.raises(BbtcError, match="needs the port"):
        read(bare, tree.task)
    begin = bare.index(model)
    given = bare[:begin] + bare[begin:].replace(f'name="{port}"', f'name="{port}" default="cup"', 1)
    assert read(given, tree.task)[0].tree == tree
    check_in_engine(tree, given, random.Random(1))
    remapped = bare.replace(
        f'<SubTree ID="{call.group(1)}"', f'<SubTree ID="{call.group(1)}" _autoremap="true"', 1
    )
    with pytest.raises(BbtcError, match="has no value here"):
        read(remapped, tree.task)


def test_utf_16_is_refused_with_what_to_do(tmp_path: Path) -> None:
    from bbtc.files.sources import read_source

    file = tmp_path / "tree.xml"
    file.write_bytes(exported(idioms_tree(), "stock").encode("utf-16"))
    with pytest.raises(BbtcError, match="UTF-16"):
        read_source(str(file))
