"""Exact numbers as text: short where they were given, as fractions where they were computed."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.artefacts.numbers import MAX_LENGTH, exact, figure_text, given_text, parse_number


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("0.95", "0.95"),
        ("1/2", "0.5"),
        ("1/3", "1/3"),
        ("1", "1"),
        ("0", "0"),
        ("-5/4", "-1.25"),
        ("100", "100"),
        ("0.0001", "0.0001"),
        ("0.3333333333333333", "0.3333333333333333"),
        (f"1/{2**40}", f"1/{2**40}"),
    ],
)
def test_given_numbers_are_decimals_where_those_are_short(value: str, text: str) -> None:
    assert given_text(Fraction(value)) == text


@pytest.mark.parametrize(
    ("value", "text"), [("31/32", "31/32"), ("0.5", "1/2"), ("1", "1"), ("0", "0"), ("-3/4", "-3/4")]
)
def test_computed_figures_are_fractions(value: str, text: str) -> None:
    assert figure_text(Fraction(value)) == text


@given(st.fractions())
def test_both_spellings_keep_the_value(value: Fraction) -> None:
    assert Fraction(given_text(value)) == value  # the standard library's reading is the judge
    assert Fraction(figure_text(value)) == value
    assert parse_number(given_text(value)) == value
    assert parse_number(figure_text(value)) == value


@given(st.integers(0, 10**9), st.integers(0, 12))
def test_a_short_decimal_is_written_back_as_it_was(digits: int, places: int) -> None:
    value = Fraction(digits, 10**places)
    assert "/" not in given_text(value)


def test_numbers_of_more_digits_than_python_converts_are_kept() -> None:
    value = Fraction(7**6000, 10**5000 + 1)
    text = figure_text(value)
    assert len(text) > 9000
    assert parse_number(text) == value


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1e5",
        ".5",
        "5.",
        "1/0",
        "1//2",
        "0x10",
        " 1",
        "1 ",
        "1_0",
        "nan",
        "inf",
        "+1",
        "1/2/3",
        "٣",
        "--1",
        "1\n",
    ],
)
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r".+"):
        parse_number(text)


def test_a_number_of_a_million_digits_is_refused_at_once() -> None:
    with pytest.raises(ValueError, match=r".+"):
        parse_number("1" * (MAX_LENGTH + 1))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (Fraction(10**400), "≈ 1e+400"),
        (Fraction(-25 * 10**399, 3), "≈ -8.33333e+399"),
        (Fraction(1, 10**400), "≈ 1e-400"),
        (Fraction(10**9000 + 1), "≈ 1e+9000"),
        (Fraction(10**24), "1" + "0" * 24),
        (Fraction(7, 8), "7/8 (0.875)"),
        (Fraction(0), "0"),
    ],
)
def test_numbers_for_people_may_be_beyond_all_floats(value: Fraction, text: str) -> None:
    assert exact(value).replace("≈ ", "") == text.replace("≈ ", "")
