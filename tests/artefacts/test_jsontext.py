"""Canonical JSON out, strict JSON in, and places in it."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.artefacts.jsontext import Path, dumps, loads, locate, path_text
from bbtc.diagnostics import BbtcError
from bbtc.source import SourceFile

_TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=5) | st.sampled_from(
    ['"', "\\", "{", "[,]"]
)
_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**12), 10**12) | _TEXTS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(_TEXTS, inner, max_size=4),
    max_leaves=20,
)


@given(_VALUES)
def test_the_layout_is_that_of_the_standard_library(value: object) -> None:
    # But what would steer a terminal, or turn the direction of what is shown, is escaped.
    codes = [*range(0x7F, 0xA0), *range(0x2028, 0x202F), *range(0x2066, 0x206A)]
    escapes = {code: f"\\u{code:04x}" for code in codes}
    assert dumps(value) == json.dumps(value, indent=2, ensure_ascii=False).translate(escapes) + "\n"


@given(_VALUES)
def test_reading_gives_back_what_was_written(value: object) -> None:
    assert loads(SourceFile("x.json", dumps(value))) == value


def test_deep_values_are_written_without_recursion() -> None:
    value: object = []
    for _ in range(5000):
        value = [value]
    assert dumps(value).count("[") == 5001


def _values(value: object, path: Path = ()) -> dict[Path, object]:
    found: dict[Path, object] = {path: value}
    if isinstance(value, dict):
        for key, part in value.items():
            found |= _values(part, (*path, key))
    elif isinstance(value, list):
        for number, part in enumerate(value):
            found |= _values(part, (*path, number))
    return found


@given(_VALUES, st.sampled_from([None, 1]))
def test_every_part_is_found_where_it_stands(value: object, indent: int | None) -> None:
    source = SourceFile("x.json", json.dumps(value, indent=indent, ensure_ascii=False))
    parts = _values(value)
    places = locate(source, list(parts))
    assert places.keys() == parts.keys()
    for path, span in places.items():
        part, _ = json.JSONDecoder().raw_decode(source.text, span.start)
        assert part == parts[path]


@pytest.mark.parametrize(
    ("text", "code", "place"),
    [
        ("", "BBT0601", "x.json:1:1"),
        ("{", "BBT0601", "x.json:1:2"),
        ('{\n  "a": 1,\n}', "BBT0601", "x.json:"),
        ('{"a": NaN}', "BBT0601", "x.json:1:1"),
        ('{"a": 1} x', "BBT0601", "x.json:1:10"),
        ("\x00\x01\x02", "BBT0601", "x.json:1:1"),
        ('{"a": 1,\n "b": [{"c": 1, "c": 2}]}', "BBT0603", "x.json:2:17"),
        ('{"a": {"a": 1}, "\\u0061": 2}', "BBT0603", "x.json:1:17"),
        ("[" * 100_000, "BBT0605", "x.json:1:1"),
        ('{"a":' * 100_000, "BBT0605", "x.json:1:1"),
    ],
)
def test_bad_texts_are_refused_with_their_place(text: str, code: str, place: str) -> None:
    with pytest.raises(BbtcError) as caught:
        loads(SourceFile("x.json", text))
    diagnostic = caught.value.diagnostics[0]
    assert diagnostic.code == code
    assert diagnostic.span is not None
    assert diagnostic.span.place.startswith(place)


def test_a_huge_whole_number_is_no_reason_to_stop() -> None:
    # Python refuses to convert more than 4300 digits, and takes quadratic time for fewer.
    assert loads(SourceFile("x.json", f"[{'9' * 2_000_000}]")) != [9]


def test_paths_are_shown_as_one_would_write_them() -> None:
    assert path_text(("root", "children", 1, "action")) == "root.children[1].action"
    assert path_text(("assign", "seen(soda)")) == 'assign."seen(soda)"'
    assert path_text(()) == "the top level"
