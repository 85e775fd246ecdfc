"""Options and text that the BehaviorTree.CPP exporters share."""

from __future__ import annotations

import re
from collections.abc import Mapping
from xml.etree.ElementTree import Element, indent, tostring

from bbtc.backends.btcpp.idioms import Profile
from bbtc.backends.exporter import Option, OptionValue
from bbtc.backends.names import snake
from bbtc.diagnostics import BbtcError

NODES = Option(
    "nodes",
    "stock",
    "stock: the engine's own nodes only; bbtc: our control nodes Skipper and Latch, for shorter trees",
    ("stock", "bbtc"),
)
NAMESPACE = Option("namespace", "", "put before every id and every entry of the root blackboard")

_NAMESPACE = re.compile(r"[A-Za-z][A-Za-z0-9]*(?:[-_][A-Za-z0-9]+)*")


def profile_of(options: Mapping[str, OptionValue]) -> Profile:
    """The profile that the option ``nodes`` names."""
    return "bbtc" if options.get("nodes") == "bbtc" else "stock"


def namespace_of(format_name: str, options: Mapping[str, OptionValue]) -> str:
    """The option ``namespace``. Raises :class:`BbtcError` (BBT0704) unless it is empty or letters and
    digits, in words that ``-`` or ``_`` separate."""
    text = str(options.get("namespace", ""))
    if text and not (_NAMESPACE.fullmatch(text) and len(text) <= 40):
        raise BbtcError.single(
            "BBT0704",
            f"option 'namespace' of format '{format_name}' must be a name of letters, digits, - and _ "
            "that begins with a letter, of at most 40 characters",
        )
    return text


def entry_prefix(namespace: str) -> str:
    """What comes before the names of blackboard entries in a namespace."""
    return f"{snake(namespace)}_" if namespace else ""


def xml_text(document: Element) -> str:
    """The document as the text of a file."""
    indent(document, "  ")
    text: str = tostring(document, encoding="unicode", short_empty_elements=True)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'
