"""Models of nodes (``TreeNodesModel``) that packages ship, read strictly."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from bbtc.artefacts.cursor import clip
from bbtc.backends.btcpp.bindings.entries import Direction, NodeModel, PortModel
from bbtc.backends.btcpp.xmltext import XmlDocument, XmlElement, parse_xml
from bbtc.diagnostics import BbtcError
from bbtc.source import SourceFile

KINDS = ("Action", "Condition", "Control", "Decorator", "SubTree")
_PORTS: Mapping[str, Direction] = MappingProxyType(
    {
        "input_port": "input",
        "output_port": "output",
        "inout_port": "inout",
        "bidirectional_port": "inout",  # as Nav2 writes it
    }
)


def read_models(source: SourceFile) -> dict[str, NodeModel]:
    """The models in a file, by the id of the node. Raises :class:`BbtcError`: BBT0614 for what is no XML,
    BBT0709 for a file without models, and for a model without id or of a node that has one."""
    document = parse_xml(source)
    found: dict[str, NodeModel] = {}
    lists = [each for each in (document.root, *document.root.children) if each.tag == "TreeNodesModel"]
    if not lists:
        span = document.span(document.root)
        raise BbtcError.single("BBT0709", f"no TreeNodesModel in {source.name}", span)
    for element in (each for model in lists for each in model.children):
        if element.tag not in KINDS:
            listed = ", ".join(KINDS)
            raise BbtcError.single(
                "BBT0709", f"<{clip(element.tag)}> is none of {listed}", document.span(element)
            )
        model = _model(document, element)
        if model.id in found:
            message = f"the node '{clip(model.id)}' has two models"
            raise BbtcError.single("BBT0709", message, document.span(element, "ID"))
        found[model.id] = model
    return found


def _model(document: XmlDocument, element: XmlElement) -> NodeModel:
    ports: dict[str, PortModel] = {}
    for child in element.children:
        direction = _PORTS.get(child.tag)
        if direction is None:
            continue  # a description, and what editors keep there
        given = child.attributes
        name = _required(document, child, "name")
        if name in ports:
            message = f"the port '{clip(name)}' stands twice"
            raise BbtcError.single("BBT0709", message, document.span(child, "name"))
        ports[name] = PortModel(name, direction, given.get("type", ""), given.get("default"))
    return NodeModel(_required(document, element, "ID"), element.tag, ports)


def _required(document: XmlDocument, element: XmlElement, name: str) -> str:
    text = element.attributes.get(name, "")
    if not text:
        message = f"<{element.tag}> has no {name}"
        raise BbtcError.single("BBT0709", message, document.span(element))
    return text
