"""Syntax errors in the words of the language: what was expected, what stands there, what may be meant."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

from bbtc.diagnostics import Diagnostic
from bbtc.source import SourceFile
from bbtc.syntax.tables import END

CONNECTIVES = (
    "and",
    "or",
    "not",
    "imply",
    "forall",
    "exists",
    "when",
    "oneof",
    "probabilistic",
    "unknown",
    "known",
    "increase",
    "decrease",
    "assign",
    "preference",
)
"""The words that head conditions and effects."""

_MARK = re.compile(r"\(\s*([^\s()?]*)|\)|(?<![^\s()]):[a-z-]+", re.IGNORECASE | re.ASCII)
_FOUND = re.compile(r"\(\s*[^\s()]*|\)|[^\s()]+")
_KEYWORD = re.compile(r"(?:\\\(\\s\*)?(:?)(?:\(([a-z|-]+)\)|([a-z-]+))(?:\(\?=|\\s\*)")
_TERM = re.compile(r"\s*\??(?!-(?:[\s()?]|$))[a-z0-9_.*+@#$%!~-]+", re.IGNORECASE)
_ATOM_HEAD = re.compile(r"\(\s*((?![-*+][\s()?])[a-z0-9_.*+@#$%!~-][^\s()?]*)[^()]*\(", re.IGNORECASE)
_NAME = re.compile(r"(?![-*+]$)[a-z0-9_.*+@#$%!~-]", re.IGNORECASE)
_PERCENTAGE = re.compile(r"(\d{1,9}(?:\.\d{1,9})?|\.\d{1,9})%", re.ASCII)
_BARE_PARAMETERS = frozenset({("forall", ""), ("exists", ""), (":action", ":parameters")})
_BARE_NOT = re.compile(r"\(\s*not\s+([^\s()]+(?:\s+[^\s()]+){1,8})\s*\)", re.IGNORECASE)

# What may stand at a place, by the first terminal of the list that may.
_SLOTS: tuple[tuple[str, str], ...] = (
    ("DEFINE_DOMAIN", "`(define (domain …) …)` or `(define (problem …) …)`"),
    ("REQUIREMENTS", "a section such as `(:action …)`"),
    ("FACTS", "a fact `(p …)`"),
    ("WHEN", "an effect"),
    ("IMPLY", "a condition"),
    ("ONEOF", "a fact `(p …)`"),
    ("SEQUENCE", "a tree: `(sequence …)`, `(fallback …)`, `(skipper …)`, `(condition …)`, `(action …)`"),
    ("FLAT", "an atom `(p …)`"),
    ("HEAD", "a declaration `(name ?x - type …)`"),
    ("NUMBER", "a number"),
    ("KEY", "a requirement such as `:typing`"),
    ("DIRECTION", "`minimize` or `maximize`"),
    ("VARIABLES", "a parameter `?x`"),
    ("NAMES", "a name"),
    ("EITHER", "a type"),
    ("NAME", "a name"),
    ("OPEN", "`(`"),
)
_FIELDS = {
    "PARAMETERS": ":parameters",
    "VARS": ":vars",
    "PRECONDITION": ":precondition",
    "CONDITION_FIELD": ":condition",
    "OBSERVE": ":observe",
    "SENSED": ":sensed",
    "REPEATS": ":repeats",
    "UNINTERRUPTIBLE": ":uninterruptible",
    "DISTRIBUTION": ":distribution",
    "CONTEXT": ":context",
    "IMPLIES": ":implies",
    "EFFECT": ":effect",
    "BODY": ":body",
}
_NOT_IN_CONDITION = {
    "when": "`when` stands in effects only",
    "probabilistic": "chance stands in effects only",
    "oneof": "a choice of outcomes stands in effects and in `:init` only",
    "increase": "costs and rewards change in effects only",
    "decrease": "costs and rewards change in effects only",
    "assign": "numbers change in effects only",
}
NOT_IN_EFFECT = {
    "or": "an effect cannot leave open what happens: say `(oneof …)` or `(probabilistic …)`",
    "imply": "a conditional effect is `(when condition effect)`",
    "exists": "an effect changes given objects: use `(forall …)` and `(when …)`",
    "known": "an action makes a fact true or false, or `(unknown p)`",
    "=": "numbers change by `increase` and `decrease`; objects stay what they are",
}
"""Why a word that heads a condition cannot head an effect."""


class Form(NamedTuple):
    """A form that is open at a place: its start, its first word, and its last field before the place."""

    start: int
    word: str
    field: str


def nearest(word: str, candidates: Iterable[str]) -> str | None:
    """The candidate that a word may be meant for, if one is near enough."""
    import difflib

    word, choices = word.lower(), sorted(candidates)
    swapped = [c for c in choices if sorted(c) == sorted(word)]
    near = difflib.get_close_matches(word, choices, n=1, cutoff=0.75)
    # `adn`, `:pre` and `:observe-agent` are near, too.
    begun = [c for c in choices if min(len(word), len(c)) > 3 and (c.startswith(word) or word.startswith(c))]
    return next(iter(swapped + near + begun), None)


def keywords(terminals: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """The keywords of each terminal, read off its regular expression."""
    found = {}
    for kind, regex in terminals.items():
        match = _KEYWORD.match(regex)
        if match:
            found[kind] = tuple(match[1] + word for word in (match[2] or match[3]).split("|"))
    return found


def open_forms(text: str, position: int) -> list[Form]:
    """The forms around a position, the outermost first."""
    stack: list[Form] = []
    for match in _MARK.finditer(text, 0, position):
        mark = match.group()
        if mark == ")":
            if stack:
                stack.pop()
        elif mark[0] == "(":
            stack.append(Form(match.start(), match[1].lower(), ""))
        elif stack:
            stack[-1] = stack[-1]._replace(field=mark.lower())
    return stack


class Place(NamedTuple):
    """Where the parser stopped."""

    source: SourceFile
    text: str
    position: int
    accepted: Collection[str]
    """The terminals that may stand there."""
    words: Mapping[str, tuple[str, ...]]
    """The keywords of each terminal."""


def explain(place: Place) -> tuple[Diagnostic, list[Form]]:
    """The error at a place, and the forms around it."""
    forms = open_forms(place.text, place.position)
    special = _unheaded(place) or _misspelt(place, forms) or _overfull_not(place, forms)
    if special is not None:
        return special, forms
    match = _FOUND.match(place.text, place.position)
    found = match.group() if match else ""
    head = found[1:].strip() if found.startswith("(") else ""
    if head and _NAME.match(head) and ("FLAT" in place.accepted or "FACTS" in place.accepted):
        inner = _bad_argument(place, head)
        if inner is not None:
            return inner, forms
    shown = f"`{'(' + head if found.startswith('(') else found}`" if found else "the end of the file"
    message = f"expected {_expected(place.accepted, forms)}{_where(forms)}, found {shown}"
    hint = _misplaced(place, (head or found).lower()) or _near(place, head or found)
    hint = hint or _joined(place, found, forms)
    return Diagnostic(
        "BBT0101", message, place.source.span(place.position, place.position + len(found)), hint
    ), forms


def _unheaded(place: Place) -> Diagnostic | None:
    """A definition that does not start with ``(domain name)`` or ``(problem name)``."""
    define = re.compile(r"\(\s*define\s*", re.IGNORECASE).match(place.text, place.position)
    if define is None or "DEFINE_DOMAIN" not in place.accepted:
        return None
    match = _FOUND.match(place.text, define.end())
    found = match.group() if match else ""
    near = nearest(found.lstrip("( "), ("domain", "problem"))
    message = f"expected `(domain name)` or `(problem name)`, found {f'`{found}`' if found else 'nothing'}"
    start = define.end() if found else place.position
    return Diagnostic(
        "BBT0101",
        message,
        place.source.span(start, start + len(found)),
        f"did you mean `({near}`?" if near else None,
    )


def _misspelt(place: Place, forms: list[Form]) -> Diagnostic | None:
    """A form whose first word is not quite a keyword."""
    if "SEQUENCE" in place.accepted:
        body = _ATOM_HEAD.match(place.text, place.position)
        start, word, field = (place.position, body[1], "") if body else (0, "", "")
        known = {keyword for kind in place.accepted for keyword in place.words.get(kind, ())}
    elif "NESTED" in place.accepted and forms:
        start, word, field = forms[-1]
        known = set(CONNECTIVES)
    else:
        return None
    near = None if field or word in known or word.startswith(":") else nearest(word, known)
    if near is None:
        return None
    return Diagnostic(
        "BBT0101",
        f"`({word}` is no keyword",
        place.source.span(start, start + 1 + len(word)),
        f"did you mean `({near}`?",
    )


def _overfull_not(place: Place, forms: list[Form]) -> Diagnostic | None:
    """An effect ``(not (p) (q))``: the grammar stops at the first atom, the mistake is the second."""
    if not forms or forms[-1].word != "not" or set(place.accepted) != {"NAME"}:
        return None
    first = re.compile(r"\([^()]*\)\s*").match(place.text, place.position)
    start = first.end() if first and not _heads_form(first.group()) else place.position
    match = _FOUND.match(place.text, start)
    found = match.group() if match else ""
    message = f"an effect `(not …)` holds one atom, found `{found}`"
    return Diagnostic(
        "BBT0101",
        message,
        place.source.span(start, start + len(found)),
        "negate each atom, and join them with `(and …)`",
    )


def _heads_form(text: str) -> bool:
    return (
        text.lstrip("( ").split(None, 1)[0].rstrip(")").lower() in CONNECTIVES if text.strip("() ") else False
    )


def _expected(accepted: Collection[str], forms: list[Form]) -> str:
    """What may stand here, in words."""
    fields = [f"`{word}`" for kind, word in _FIELDS.items() if kind in accepted]
    slot = next((words for kind, words in _SLOTS if kind in accepted), None)
    if slot == "a number" and forms and forms[-1].word == "probabilistic":
        slot = "a probability such as 0.5 or 1/2"
    parts = [slot] if slot is not None else []
    parts.extend(fields)
    if "DASH" in accepted and not parts:
        parts.append("`- type`")
    if "CLOSE" in accepted and len(parts) < 2:
        parts.append("`)`")
    if not parts:
        parts.append("the end of the file" if END in accepted else "something else")
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} or {parts[-1]}"


def _where(forms: list[Form]) -> str:
    """The form in which something is expected, in words."""
    if not forms:
        return ""
    inner = forms[-1] if forms[-1].word or len(forms) == 1 else forms[-2]
    if inner.field:
        return f" after `{inner.field}`"
    return f" in `({inner.word}`" if inner.word else ""


def _near(place: Place, word: str) -> str | None:
    """The keyword that may be meant."""
    possible = {keyword for kind in place.accepted for keyword in place.words.get(kind, ())}
    if len(word) < 2 or word.lower() in possible:
        return None
    near = nearest(word, possible)
    return f"did you mean `{near}`?" if near else None


def _misplaced(place: Place, word: str) -> str | None:
    """Why a keyword that has its place elsewhere cannot stand here."""
    if "WHEN" in place.accepted:
        return NOT_IN_EFFECT.get(word)
    if "SEQUENCE" in place.accepted and word in CONNECTIVES:
        return "a condition in a tree is `(condition …)`"
    return _NOT_IN_CONDITION.get(word) if "IMPLY" in place.accepted else None


def _joined(place: Place, found: str, forms: list[Form]) -> str | None:
    """Advice where one part is given too many, or parentheses or a question mark are missing."""
    percentage = _PERCENTAGE.fullmatch(found)
    if "NUMBER" in place.accepted and percentage:
        from decimal import Decimal

        return f"write `{Decimal(percentage[1]).scaleb(-2).normalize():f}`"
    bare = _BARE_NOT.match(place.text, forms[-1].start) if forms else None
    if bare is not None and place.position < bare.end():
        return f"write `(not ({' '.join(bare[1].split())}))`"
    if found.startswith(("//", "/*", "#|")):
        return "comments start with `;` and end with the line"
    if found.startswith("?") and forms and (forms[-1].word, forms[-1].field) in _BARE_PARAMETERS:
        return f"parameters stand in parentheses: `({found} - type)`"
    if found.startswith("(") and forms and forms[-1].word in {"unknown", "known"}:
        return f"`{forms[-1].word}` is about one fact: `({forms[-1].word} (p …))`"
    if "VARIABLES" in place.accepted and _NAME.match(found):
        return f"parameters start with `?`: `?{found}`"
    if "HEAD" in place.accepted and _NAME.match(found):
        return f"write `({found})`"
    if "KEY" in place.accepted and _NAME.match(found):
        return f"write `:{found}`"
    after_form = found.startswith("(") and place.text[: place.position].rstrip().endswith(")")
    if not (after_form and forms and "CLOSE" in place.accepted):
        return None
    inner = forms[-1]
    if inner.word == ":goal" or inner.field in (":precondition", ":effect"):
        return "join several with `(and …)`"
    if inner.word in ("not", "when", "imply", "forall", "exists"):
        return f"`{inner.word}` is complete before this; join several with `(and …)`"
    return None


def _bad_argument(place: Place, head: str) -> Diagnostic | None:
    """The argument that keeps ``(p …)`` from being an atom."""
    if head.lower() in CONNECTIVES:
        return None
    at = place.text.index("(", place.position) + 1
    while term := _TERM.match(place.text, at):
        at = term.end()
    rest = _FOUND.search(place.text, at)
    if rest is None or rest.group() == ")":
        return None
    shown = rest.group().replace(" ", "")
    message = f"expected names and variables in `({head}`, found `{shown}`"
    hint = "types stand in declarations only" if shown.startswith("-") else None
    return Diagnostic("BBT0101", message, place.source.span(rest.start(), rest.end()), hint)
