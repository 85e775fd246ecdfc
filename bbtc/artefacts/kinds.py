"""Telling what a text is before it is read."""

from __future__ import annotations

import json

from bbtc.source import SourceFile


def is_artefact(source: SourceFile) -> bool:
    """Is this JSON rather than the language? (No file of the language starts with a brace.)"""
    return source.text.lstrip()[:1] == "{"


def is_xml(source: SourceFile) -> bool:
    """Is this XML? (Neither the language nor JSON begins with an angle bracket.)"""
    return source.text.lstrip()[:1] == "<"


def is_tree(source: SourceFile) -> bool:
    """Does the JSON artefact say that it is a tree?"""
    try:
        data = json.loads(source.text)
    except (ValueError, RecursionError):
        return False
    return isinstance(data, dict) and data.get("format") == "bbtc-tree"
