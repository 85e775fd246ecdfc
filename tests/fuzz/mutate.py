"""Changes to planning files that mostly leave them well formed, so that they get past the parser.

A text is taken apart into forms, each of a *kind* told by its place: a condition, an effect, an initial
fact, a list of parameters, a section, a definition. A form is replaced by others of its kind, doubled, left
out, wrapped, or laid open; a word gives way to another of its kind. The rest is noise on purpose.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

_TOKEN = re.compile(rb"[()]|[^\s()]+")
_COMMENT = re.compile(rb";[^\n]*")
_FIELDS = {
    b":precondition": "condition", b":condition": "condition", b":context": "condition", b":effect": "effect",
    b":parameters": "parameters", b":vars": "parameters", b":observe": "condition", b":sensed": "condition",
    b":implies": "atom", b":body": "body",
}  # fmt: skip
_SECTIONS = {
    b":init": "initial", b":hidden": "initial", b":goal": "condition", b":predicates": "declaration",
    b":functions": "function", b":metric": "number", b":derived": "condition", b":axiom": "condition",
}  # fmt: skip
_BODIES = {b"sequence", b"fallback", b"skipper"}
_WRAPPERS: dict[str, tuple[bytes, ...]] = {
    "condition": (
        b"(and %s)", b"(not %s)", b"(or %s (p))", b"(imply %s %s)", b"(forall (?x) %s)", b"(or)", b"(and)",
        b"(exists (?z - object) %s)", b"(unknown (p))", b"(known (p))", b"(= ?x ?x)", b"()",
        b"(preference q %s)",
    ),
    "effect": (
        b"(and %s)", b"(and %s %s)", b"(oneof %s %s)", b"(oneof %s)", b"(probabilistic 1/2 %s)",
        b"(probabilistic .25 %s 0.5 (p))", b"(when (p) %s)", b"(when (not (unknown (p))) %s)",
        b"(forall (?x) %s)", b"(forall (?z - (either object object)) %s)", b"()", b"(unknown (p))",
        b"(increase (total-cost) 1)", b"(decrease reward 1/3)",
    ),
    "initial": (
        b"(oneof %s (p))", b"(unknown (p))", b"(or %s (p))", b"(probabilistic 0.5 %s)", b"(and %s %s)",
        b"(not (p))", b"(= (total-cost) 0)", b"(probabilistic 1/3 %s 2/3 (p))",
    ),
    "body": (
        b"(sequence %s)", b"(fallback %s %s)", b"(skipper (condition (p)) %s)", b"(condition (p))",
        b"(sequence (foreach (?z) %s))",
    ),
    "parameters": (b"()", b"(?x)", b"(?x ?y - object)", b"(?x - (either object object) ?y)"),
    "number": (b"(+ 1 %s)", b"(* %s 2)", b"1/3", b"(- 1)"),
    "atom": (b"(p)", b"p"),
    "declaration": (b"(p)", b"(unknown (q))", b"(p ?x - object)", b"(q ?x ?y)"),
}  # fmt: skip
_NUMBERS = (
    b"0", b"1", b".5", b"1/3", b"0.333333333", b"-1", b"1e9", b"1e-9", b"2", b"1/0", b"7.", b"0.9999999999",
    b"12345678901234567890", b"1e400", b"100/101",
)  # fmt: skip
_SPACE = (b" ", b"\n", b"\n\n", b"\t", b" ; note\n", b"\n; note\n", b"\n\n  ;; note\n\n", b"\r\n")
_NUMBER = re.compile(rb"[-+]?[0-9./]+(e[-+]?[0-9]+)?")


@dataclass(frozen=True, slots=True)
class Form:
    """A form in parentheses."""

    start: int
    end: int
    kind: str
    head: bytes


@dataclass(slots=True)
class _Open:
    start: int
    kind: str
    head: bytes = b""
    within: str = ""
    """The kind of the next form inside."""
    count: int = 0


def forms(text: bytes) -> list[Form]:
    """The forms of a text, comments aside, each after those within it."""
    text = _COMMENT.sub(lambda match: b" " * len(match.group()), text)
    found: list[Form] = []
    stack = [_Open(0, "", within="definition")]
    for match in _TOKEN.finditer(text):
        token, above = match.group(), stack[-1]
        if token == b"(":
            stack.append(_Open(match.start(), _kind(above)))
            above.count += 1
        elif token == b")":
            if len(stack) > 1:
                found.append(Form(above.start, match.end(), above.kind, above.head))
                stack.pop()
        elif not above.head and not above.count and len(stack) > 1:
            above.head = token.lower()
            above.within = _SECTIONS.get(above.head, "section" if above.head == b"define" else above.kind)
        elif token.lower() in _FIELDS:
            above.within = _FIELDS[token.lower()]
    return found


def _kind(above: _Open) -> str:
    """The kind of a form by what it stands in."""
    match above.head:
        case b"forall" | b"exists" | b"foreach" if above.count == 0:
            return "parameters"
        case b"when":
            return "effect" if above.count else "condition"
        case b"condition":
            return "condition"
        case b"not" | b"unknown" | b"known" if above.kind != "condition":
            return "atom"
        case b"unknown" | b"known":
            return "atom"
        case b"increase" | b"decrease" | b"assign" | b"=" | b"+" | b"-" | b"*":
            return "number"
        case b":derived":
            return "condition" if above.count else "head"
        case b"define":
            return "section" if above.count else "head"
        case _:
            return above.within


class Changes:
    """Random changes; what is put in stems from the text itself or from ``others``."""

    def __init__(self, others: Sequence[bytes], draw: random.Random) -> None:
        self.others, self.draw = others, draw

    def __call__(self, text: bytes) -> bytes:
        """The text after one change."""
        steps: list[Callable[[bytes], bytes]] = [
            self.replace, self.replace, self.insert, self.wrap, self.wrap, self.lay_open, self.leave_out,
            self.word, self.word, self.number, self.space, self.swap,
        ]  # fmt: skip
        return self.draw.choice(steps)(text)

    def _pick(self, text: bytes, kind: str | None = None) -> Form | None:
        wanted = [form for form in forms(text) if form.kind not in {"head", ""} and kind in {None, form.kind}]
        # Of the many small forms and the few large ones each kind gets its share.
        kinds = sorted({form.kind for form in wanted})
        if not wanted:
            return None
        chosen = self.draw.choice(kinds)
        return self.draw.choice([form for form in wanted if form.kind == chosen])

    def _another(self, text: bytes, form: Form) -> bytes | None:
        """A form of the same kind, from this text or another."""
        other = text if self.draw.random() < 0.4 or not self.others else self.draw.choice(self.others)
        found = self._pick(other, form.kind)
        return other[found.start : found.end] if found else None

    def replace(self, text: bytes) -> bytes:
        """A form gives way to another of its kind."""
        form = self._pick(text)
        new = self._another(text, form) if form else None
        return text if form is None or new is None else text[: form.start] + new + text[form.end :]

    def insert(self, text: bytes) -> bytes:
        """A form of the same kind after a form, as lists have them."""
        form = self._pick(text)
        if form is None or form.kind in {"parameters", "atom"}:
            return text
        new = self._another(text, form) or b"()"
        return text[: form.end] + b" " + new + text[form.end :]

    def swap(self, text: bytes) -> bytes:
        """Two forms of a kind change places."""
        one = self._pick(text)
        other = self._pick(text, one.kind) if one else None
        if one is None or other is None or one.end > other.start:
            return text
        return (
            text[: one.start] + text[other.start : other.end] + text[one.end : other.start]
            + text[one.start : one.end] + text[other.end :]
        )  # fmt: skip

    def leave_out(self, text: bytes) -> bytes:
        """A form goes."""
        form = self._pick(text)
        return text if form is None else text[: form.start] + text[form.end :]

    def wrap(self, text: bytes) -> bytes:
        """A form comes to stand in a new one, or gives way to one."""
        form = self._pick(text)
        wrappers = _WRAPPERS.get(form.kind) if form else None
        if form is None or wrappers is None:
            return text
        new = self.draw.choice(wrappers).replace(b"%s", text[form.start : form.end])
        return text[: form.start] + new + text[form.end :]

    def lay_open(self, text: bytes) -> bytes:
        """A form gives way to one of its kind within it."""
        form = self._pick(text)
        if form is None:
            return text
        inner = [
            each for each in forms(text)
            if form.start < each.start and each.end < form.end and each.kind == form.kind
        ]  # fmt: skip
        if not inner:
            return text
        one = self.draw.choice(inner)
        return text[: form.start] + text[one.start : one.end] + text[form.end :]

    def word(self, text: bytes) -> bytes:
        """A word gives way to one of its kind."""
        words = [*_words(text)]
        if not words:
            return text
        at = self.draw.choice(words)
        alike = [each.group() for each in words if _sort(each.group()) == _sort(at.group())]
        return text[: at.start()] + self.draw.choice(alike) + text[at.end() :]

    def number(self, text: bytes) -> bytes:
        """A number gives way to an odd one."""
        words = [each for each in _words(text) if _sort(each.group()) == "number"]
        if not words:
            return text
        at = self.draw.choice(words)
        return text[: at.start()] + self.draw.choice(_NUMBERS) + text[at.end() :]

    def space(self, text: bytes) -> bytes:
        """Comments and empty lines between words."""
        at = self.draw.choice([0, *(match.end() for match in _TOKEN.finditer(text))])
        return text[:at] + self.draw.choice(_SPACE) + text[at:]


def _words(text: bytes) -> Iterator[re.Match[bytes]]:
    """Words that do not head a form of the language."""
    for match in re.finditer(rb"[^\s()]+", _COMMENT.sub(lambda found: b" " * len(found.group()), text)):
        if not match.group().startswith(b":") and match.group().lower() not in _KEYWORDS:
            yield match


_KEYWORDS = frozenset(
    b"""define domain problem and or not imply when forall exists oneof probabilistic unknown known increase
    decrease assign either - = sequence fallback skipper condition foreach action minimize maximize""".split()
)


def _sort(word: bytes) -> str:
    if word.startswith(b"?"):
        return "variable"
    return "number" if _NUMBER.fullmatch(word) else "name"
