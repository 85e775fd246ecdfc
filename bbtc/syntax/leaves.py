"""Names, numbers and flat atoms from the text of a token.

Most of a planning file is flat atoms, so these functions decide how fast files load. They fill the
slots of the frozen nodes directly: the generated ``__init__`` of a frozen dataclass takes longer than
all the rest.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import TypeVar

from bbtc.diagnostics import Diagnostic, Related, Unreadable
from bbtc.kleene import Truth
from bbtc.source import SourceFile, Span
from bbtc.syntax.ast import (
    Assign,
    Atom,
    Equality,
    FluentRef,
    FluentValue,
    InitElement,
    Name,
    Not,
    Number,
    Term,
    TypedGroup,
    Variable,
)
from bbtc.syntax.engine import Token
from bbtc.syntax.scan import without_comments
from bbtc.syntax.words import BODY_WORDS, FORM_WORDS

_N = TypeVar("_N")
_new: Callable[[type[_N]], _N] = object.__new__
_tuple = tuple.__new__


def _setter(node: type, slot: str) -> Callable[[object, object], None]:
    """Writes a slot of a frozen node."""
    write: Callable[[object, object], None] = getattr(node, slot).__set__
    return write


_name_text, _name_source, _name_start = (_setter(Name, s) for s in ("text", "_source", "_start"))
_variable_text, _variable_source, _variable_start = (
    _setter(Variable, s) for s in ("text", "_source", "_start")
)
_atom_predicate, _atom_args, _atom_span = (_setter(Atom, s) for s in ("predicate", "args", "span"))
_assign_atom, _assign_value, _assign_span = (_setter(Assign, s) for s in ("atom", "value", "span"))

_WORD = re.compile(r"\??[^\s()?]+|\?")
_GLUED = re.compile(r"[^ ]\?|\?(?: |$)")
_LITERAL = re.compile(r"\(([^()]*)\)|\(\s*not\s*(\([^()]*\))\s*\)", re.IGNORECASE)
_TOKEN = re.compile(r"[()]|[^\s()]+")
# A fact whose words stand one space apart, any fact, or the value of a fluent.
_FACT = re.compile(r"\(([^\s()]+(?: [^\s()]+)*)\)|(\([^()]*\))|\(\s*=\s*(\([^()]*\))\s*([^\s()]+)\s*\)")

NUMBER_LENGTH = 200
"""Longest number, in characters."""
EXPONENT_LIMIT = 300
"""Largest decimal exponent of a number: its exact value must fit a small space."""
_EXPONENT = re.compile(r"e[-+]?0*([0-9]+)$", re.IGNORECASE)
_ZERO_DENOMINATOR = re.compile(r"/0+$")


class Misuse(Unreadable):
    """A form that fits the grammar's rules one by one but not together; reported like a syntax error."""

    def __init__(
        self, code: str, message: str, span: Span, hint: str | None = None, first: Span | None = None
    ) -> None:
        related = (Related("first given here", first),) if first else ()
        super().__init__(Diagnostic(code, message, span, hint, related=related))


def name(token: Token) -> Name:
    """The symbol a token holds."""
    return Name(token.text, token.span)


def _term(word: str, at: int, source: SourceFile) -> Term:
    if word[0] == "?":
        variable = _new(Variable)
        _variable_text(variable, word)
        _variable_source(variable, source)
        _variable_start(variable, at)
        return variable
    node = _new(Name)
    _name_text(node, word)
    _name_source(node, source)
    _name_start(node, at)
    return node


def terms(text: str, offset: int, source: SourceFile) -> list[Term]:
    """The words of a text that starts at an offset of the source, as names and variables.

    Raises :class:`Misuse` for a word that is neither.
    """
    # The usual way to write an atom is one space between words, which str.split takes apart fast.
    # Other white space and `robot?r` take the slow path.
    if not text.isprintable() or " -" in text or ("?" in text and _GLUED.search(text)):
        return _terms_slowly(text, offset, source)
    found: list[Term] = []
    at = offset
    for word in text.split(" "):
        if not word:
            at += 1
            continue
        found.append(_term(word, at, source))
        at += len(word) + 1
    return found


def _terms_slowly(text: str, offset: int, source: SourceFile) -> list[Term]:
    found: list[Term] = []
    for match in _WORD.finditer(text):
        word = match.group()
        span = Span(source, offset + match.start(), offset + match.end())
        if word in {"-", "?"}:
            hint = "types stand in declarations only" if word == "-" else None
            raise Misuse("BBT0101", f"expected a name or a variable, found `{word}`", span, hint)
        found.append(Variable(word, span) if word[0] == "?" else Name(word, span))
    return found


def _flat(inner: str, span: Span) -> Atom:
    """The atom ``(inner)`` that stands at a span."""
    words = terms(inner, span[1] + 1, span[0])
    node = _new(Atom)
    _atom_predicate(node, words[0])
    _atom_args(node, tuple(words[1:]))
    _atom_span(node, span)
    return node


def flat(token: Token) -> Atom:
    """The atom of a token ``(p a ?x)``."""
    return _flat(token.text[1:-1], token.span)


def atom(token: Token) -> Atom:
    """The atom of a token ``(p a ?x)`` or ``p``. Raises :class:`Misuse` for a bare keyword, which
    printing would turn into a form."""
    if token.kind == "FLAT":
        return flat(token)
    refuse_head(token.text, token.span, "a condition or an effect")
    return Atom(name(token), (), token.span)


def names(run: Token) -> Iterator[Name]:
    """The symbols of a run of them; the first one, also of ``(name`` and ``(name ?x - t)``."""
    for match in _WORD.finditer(run.text):
        start, end = match.span()
        yield Name(match.group(), Span(run.source, run.start + start, run.start + end))


def declared(kind: str, word: Name) -> Name:
    """The name of what is declared. Raises :class:`Misuse` for one that no use could have, since it heads a
    form of the language: ``(and a)`` is no fact of a predicate ``and``."""
    if word.key in (BODY_WORDS if kind == "template" else FORM_WORDS):
        hint = f"`({word.key} …)` has a meaning of its own; choose another name"
        raise Misuse("BBT0228", f"a {kind} cannot be called `{word.text}`", word.span, hint)
    return word


def refuse_head(text: str, span: Span, expected: str) -> None:
    """Raise :class:`Misuse` for a bare word that heads a form: printing it would turn it into one."""
    if text.lower() in FORM_WORDS:
        hint = f"its parts stand with it in parentheses: `({text.lower()} …)`"
        raise Misuse("BBT0101", f"expected {expected}, found `{text}`", span, hint)


def negated(token: Token) -> Atom:
    """The atom within a token ``(not (p a))``."""
    opening = token.text.index("(", 1)
    inner = token.text[opening + 1 : token.text.index(")")]
    start = token.start + opening
    return _flat(inner, Span(token.source, start, start + len(inner) + 2))


def assign(fact: Atom, value: Truth, span: Span) -> Assign:
    """The assignment of a value to an atom."""
    node = _new(Assign)
    _assign_atom(node, fact)
    _assign_value(node, value)
    _assign_span(node, span)
    return node


def facts(run: Token) -> list[InitElement]:
    """The elements of a run of ground facts ``(p a)`` and values ``(= (f a) 3)``."""
    source, base, true = run.source, run.start, Truth.TRUE
    plain = "?" not in run.text and " -" not in run.text
    found: list[InitElement] = []
    for match in _FACT.finditer(run.text):
        start, end = match.span()
        span = _tuple(Span, (source, base + start, base + end))
        if match[1] is not None and plain:
            words: list[Name] = []
            at = base + start + 1
            for word in match[1].split(" "):
                node = _new(Name)
                _name_text(node, word)
                _name_source(node, source)
                _name_start(node, at)
                words.append(node)
                at += len(word) + 1
            fact = _new(Atom)
            _atom_predicate(fact, words[0])
            _atom_args(fact, tuple(words[1:]))
            _atom_span(fact, span)
            element = _new(Assign)
            _assign_atom(element, fact)
            _assign_value(element, true)
            _assign_span(element, span)
            found.append(element)
        elif match[4] is None:
            found.append(assign(_flat(match.group()[1:-1], span), true, span))
        else:
            at = base + match.start(3)
            head = _flat(match[3][1:-1], Span(source, at, base + match.end(3)))
            value = number(match[4], Span(source, base + match.start(4), base + match.end(4)))
            found.append(FluentValue(FluentRef(head.predicate, head.args, head.span), value, span))
    return found


def equation(text: str, offset: int, source: SourceFile) -> Equality:
    """The equation ``(= a ?x)`` at an offset."""
    sign = text.index("=") + 1
    left, right = terms(text[sign:-1], offset + sign, source)
    return Equality(left, right, Span(source, offset, offset + len(text)))


def literals(token: Token) -> Iterator[Atom | Equality | Not]:
    """The parts of a token ``(and (p a) (not (q b)) (= a ?x))``."""
    source, base, text = token.source, token.start, token.text
    for match in _LITERAL.finditer(text, text.index("(", 1)):
        start, end = match.span()
        span = _tuple(Span, (source, base + start, base + end))
        if match[2] is None:
            inner = match[1]
            yield equation(match.group(), base + start, source) if "=" in inner else _flat(inner, span)
            continue
        inner, at = match[2], base + match.start(2)
        if "=" in inner:
            yield Not(equation(inner, at, source), span)
        else:
            yield Not(_flat(inner[1:-1], Span(source, at, at + len(inner))), span)


def groups(text: str, offset: int, source: SourceFile, *, variables: bool) -> tuple[TypedGroup, ...]:
    """The groups of a typed list ``a b - t c``, of variables or of names.

    Raises :class:`Misuse` where a hyphen has no names before it or no type after it, and for a name
    among variables.
    """
    found: list[TypedGroup] = []
    names: list[Term] = []
    start, typed = offset, False
    for word, at in _entries(text, offset, variables=variables):
        if typed:
            kind = Name(word, Span(source, at, at + len(word)))
            found.append(TypedGroup(tuple(names), (kind,), Span(source, start, at + len(word))))
            names, typed = [], False
        elif word == "-":
            typed = True
        else:
            start = start if names else at
            names.append(_entry(word, at, source, variables))
        if (typed and not names) or (word == "-") is not typed:
            raise Misuse(
                "BBT0101", f"expected names before a type, found `{word}`", Span(source, at, at + len(word))
            )
    end = offset + len(text)
    if typed:
        raise Misuse("BBT0101", "expected a type after `-`", Span(source, end, end + 1))
    if names:
        found.append(TypedGroup(tuple(names), (), Span(source, start, names[-1].span.end)))
    return tuple(found)


def _entries(text: str, offset: int, *, variables: bool) -> Iterator[tuple[str, int]]:
    """The words of a typed list and where they stand. Among variables, a hyphen may lack its spaces, for what
    has no question mark can only be a type: `?x- block`, `?x -block`."""
    found = [(match.group(), offset + match.start()) for match in _WORD.finditer(text)]
    if not variables or "-" not in text:
        yield from found
        return
    after_dash = False
    for (word, at), (following, _) in zip(found, [*found[1:], ("?", 0)], strict=True):
        if word == "-" or after_dash:
            yield word, at
            after_dash = word == "-" and not after_dash
        elif word[0] == "-":
            yield from (("-", at), (word[1:], at + 1))
        elif word[-1] == "-" and following[0] not in "?-":
            yield from ((word[:-1], at), ("-", at + len(word) - 1))
            after_dash = True
        else:
            yield word, at


def _entry(word: str, at: int, source: SourceFile, variables: bool) -> Term:
    if variables is not word.startswith("?") or word == "?":
        what = "a parameter `?x`" if variables else "a name"
        hint = f"write `?{word}` for a parameter, `- {word}` for a type" if variables else None
        raise Misuse("BBT0101", f"expected {what}, found `{word}`", Span(source, at, at + len(word)), hint)
    return _term(word, at, source)


def number(text: str, span: Span) -> Number:
    """A number. Raises :class:`Misuse` if its exact value cannot be formed in a small space."""
    if len(text) > 4 or "/" in text:
        if _ZERO_DENOMINATOR.search(text):
            raise Misuse("BBT0112", f"`{text[:40]}` divides by zero", span)
        exponent = _EXPONENT.search(text)
        huge = exponent is not None and (len(exponent[1]) > 4 or int(exponent[1]) > EXPONENT_LIMIT)
        if huge or len(text) > NUMBER_LENGTH:
            raise Misuse("BBT0113", f"number `{text[:40]}` has too many digits", span)
    return Number(text, span)


def plain_text(first: Token, last: Token) -> str:
    """The source from one token to another on one line, without comments."""
    words = " ".join(_TOKEN.findall(without_comments(first.to(last).text)))
    return words.replace("( ", "(").replace(" )", ")")
