"""Printing and parsing are inverse to each other, on random trees and on texts with random comments."""

from __future__ import annotations

import re

from hypothesis import given
from hypothesis import strategies as st

from bbtc.diagnostics import Report
from bbtc.source import SourceFile
from bbtc.syntax import ast
from bbtc.syntax.parser import parse
from bbtc.syntax.printer import print_document
from tests.long_form import amount
from tests.profiles import examples
from tests.syntax.trees import documents

SLOW = examples(amount(60, 600))
GAPS = st.sampled_from(["", "", "", " ; c\n", "\n; own\n", "\n\n  ;; own\n"])


def _parse(text: str) -> ast.Document:
    report = Report()
    document = parse(SourceFile("printed.pddl", text), report)
    assert not report.errors, "\n".join(d.render() for d in report) + "\n" + text
    return document


@given(documents)
@SLOW
def test_parsing_what_is_printed_gives_the_tree(document: ast.Document) -> None:
    text = print_document(document)
    again = _parse(text)
    assert again.definitions == document.definitions, text
    assert print_document(again) == text


@given(documents, st.data())
@SLOW
def test_comments_stay_between_the_same_words(document: ast.Document, data: st.DataObject) -> None:
    words = re.findall(r"[()]|[^\s()]+", print_document(document))
    gaps = data.draw(st.lists(GAPS, min_size=len(words), max_size=len(words)))
    # What opens a form is one word in print: `( ; one⏎ define` has no place for that comment.
    gaps = ["" if word in {"(", ":metric"} else gap for word, gap in zip(words, gaps, strict=True)]
    text = "".join(f"{word}{gap or ' '}" for word, gap in zip(words, gaps, strict=True))
    given_document = _parse(text)
    assert given_document.definitions == document.definitions
    printed = print_document(given_document)
    again = _parse(printed)
    assert again == given_document, printed
    assert print_document(again) == printed
