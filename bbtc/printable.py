"""Texts of strangers (names, labels, paths) as what may be shown: on one line, steering no terminal."""

from __future__ import annotations

import re

_UNSEEN = re.compile("[\x7f-\x9f\u2028-\u202e\u2066-\u2069]")


def printable(text: str) -> str:
    """The text on one line, with a replacement character for whatever does not print (among it
    all that XML 1.0 cannot hold)."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


def printable_line(text: str) -> str:
    """The same, but tabs stay: for a line of a file."""
    return "\t".join(map(printable, text.split("\t")))


def escaped(text: str) -> str:
    """A JSON text with escapes for the characters in its strings that would steer a terminal, or change the
    direction of what is shown."""
    return _UNSEEN.sub(lambda match: f"\\u{ord(match[0]):04x}", text)
