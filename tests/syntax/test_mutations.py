"""Our own domains with one slip each, and texts that are hardly PDDL at all."""

from __future__ import annotations

import re
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from bbtc.diagnostics import Report
from bbtc.source import SourceFile
from bbtc.syntax.parser import parse
from tests.profiles import examples

FILES = sorted((Path(__file__).parents[2] / "domains").glob("*/*.pddl"))
TEXTS = {path: path.read_text("utf-8") for path in FILES}
PIECES = re.compile(r";[^\n]*|\s+|[()]|[^\s();]+")


def _errors(text: str) -> list[tuple[int, str]]:
    """Place and code of every error of a text; each is rendered, too."""
    report = Report()
    parse(SourceFile("test.pddl", text), report)
    found = []
    for diagnostic in report.errors:
        assert diagnostic.render()
        span = diagnostic.span
        assert span is None or 0 <= span.start <= span.end <= len(text)
        found.append((span.start if span else 0, diagnostic.code))
    return found


def _sections(text: str) -> list[tuple[int, int]]:
    report = Report()
    document = parse(SourceFile("test.pddl", text), report)
    assert not report.errors
    return [section.span[1:] for definition in document.definitions for section in definition.sections]


def test_a_parenthesis_too_few_or_too_many_gives_one_error_in_its_section() -> None:
    tried = exact = 0
    for text in TEXTS.values():
        sections = _sections(text)
        blanked = re.sub(r";[^\n]*", lambda match: " " * len(match.group()), text)
        # The last section cannot be told from the definition that ends with it.
        for at in [m.start() for m in re.finditer(r"[()]", blanked)][::7]:
            section = next(((s, e) for s, e in sections[:-1] if s <= at < e), None)
            for slip in (text[:at] + text[at + 1 :], text[:at] + text[at] + text[at:]):
                errors = _errors(slip)
                assert errors, slip
                if section is not None:
                    tried += 1
                    exact += len(errors) == 1 and section[0] - 1 <= errors[0][0] <= section[1] + 1
    assert exact > 0.9 * tried


@given(st.data())
@examples(100)
def test_no_slip_makes_anything_but_diagnostics(data: st.DataObject) -> None:
    text = TEXTS[data.draw(st.sampled_from(FILES))]
    pieces = PIECES.findall(text)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(pieces) - 1))
        pieces[at] = data.draw(
            st.one_of(
                st.sampled_from(
                    ["", "(", ")", "))", "((", "-", "?", ":effect", "(:action", "define", '"', "0.5", ";"]
                ),
                st.sampled_from(pieces),
                st.text(max_size=4),
            )
        )
    _errors("".join(pieces))


@given(st.lists(st.sampled_from([*"() ?-:;.\n", "define", "domain", ":action", "and", "a", "\x00", "é"])))
def test_no_text_makes_anything_but_diagnostics(pieces: list[str]) -> None:
    _errors("".join(pieces))
