"""Files of BehaviorTree.CPP held against what the engine says of its own nodes, ``btcpp_nodes.tsv``."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

_VALUES = {
    "text": re.compile(r".*", re.DOTALL),
    "entry": re.compile(r"\{.*\}"),
    "integer": re.compile(r"\s*[-+]?[0-9]+\s*|\{.*\}"),
    "boolean": re.compile(r"\s*(true|false|0|1)\s*|\{.*\}"),
}
_MORE = "*"


@dataclass(frozen=True)
class Form:
    """What an element may hold. ``attributes`` gives the type of each, and the name ``*`` if others may
    be there, too."""

    kind: str
    content: str
    attributes: Mapping[str, str]
    required: frozenset[str]

    def holds(self, children: list[str]) -> bool:
        """Are these its children? The name of a node is ``node``."""
        names = "" if self.content == "text" else self.content.replace(",", "")
        return (
            re.fullmatch(re.sub(r"\w+", r"(?:\g<0>;)", names), "".join(f"{c};" for c in children)) is not None
        )


def _read() -> dict[str, Form]:
    lines = Path(__file__).with_suffix(".tsv").read_text(encoding="utf-8").splitlines()
    rows = csv.DictReader((line for line in lines if not line.startswith("#")), delimiter="\t")
    return {row["name"]: _form(row["kind"], row["content"], row["attributes"]) for row in rows}


def _form(kind: str, content: str, attributes: str) -> Form:
    given = [word.partition(":") for word in attributes.split()]
    return Form(
        kind,
        content,
        {name: what.rstrip("!") for name, _, what in given},
        frozenset(name for name, _, what in given if what.endswith("!")),
    )


_ALL = _read()
EVERY_NODE = _ALL.pop("node")
"""What every node may hold."""
FILE = {name: form for name, form in _ALL.items() if form.kind == "file"}
"""The elements that are no nodes of a tree."""
NODES = {name: form for name, form in _ALL.items() if form.kind != "file"}
"""The nodes of the engine."""


def registered(model: ET.Element) -> dict[str, Form]:
    """The nodes of a TreeNodesModel, as the engine describes them once they are registered."""
    found = {}
    for entry in model:
        if entry.tag == "SubTree":
            continue
        ports = {port.attrib["name"]: port for port in entry.iter("input_port")}
        required = frozenset(name for name, port in ports.items() if "default" not in port.attrib)
        content = {"Control": "node*", "Decorator": "node"}.get(entry.tag, "")
        found[entry.attrib["ID"]] = Form(entry.tag, content, dict.fromkeys(ports, "text"), required)
    return found


def faults(document: ET.Element, more: Mapping[str, Form]) -> list[str]:
    """What the engine's schema, completed by more nodes, has against a file."""
    if document.tag != "root":
        return [f"{document.tag}: no file begins so"]
    return list(_faults(document, "", {**NODES, **more}))


def _faults(element: ET.Element, path: str, nodes: Mapping[str, Form]) -> Iterator[str]:
    in_tree = "/BehaviorTree" in path
    path = f"{path}/{element.tag}"
    form = (nodes if in_tree else FILE).get(element.tag)
    if form is None:
        yield f"{path}: no such element"
        return
    types = {**EVERY_NODE.attributes, **form.attributes} if in_tree else form.attributes
    for name, value in element.attrib.items():
        if name in types:
            if not _VALUES[types[name]].fullmatch(value):
                yield f"{path}: {name}={value!r} is no {types[name]}"
        elif _MORE not in types:
            yield f"{path}: no attribute {name}"
    yield from (f"{path}: {name} is missing" for name in sorted(form.required - set(element.attrib)))
    within = in_tree or element.tag == "BehaviorTree"
    children = ["node" if within and child.tag in nodes else child.tag for child in element]
    if not form.holds(children):
        yield f"{path}: holds {[child.tag for child in element]}, not {form.content or 'nothing'}"
    if form.content != "text" and "".join([element.text or "", *(c.tail or "" for c in element)]).strip():
        yield f"{path}: holds text"
    for child in element:
        yield from _faults(child, path, nodes)
