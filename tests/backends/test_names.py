"""Names of a domain become identifiers that are valid, distinct and stable."""

from __future__ import annotations

import keyword
import re
from typing import Literal

from hypothesis import given
from hypothesis import strategies as st

from bbtc.backends.names import (
    PYTHON_RESERVED,
    Symbol,
    identifiers,
    parameter_names,
    port_values,
)
from bbtc.printable import printable
from tests.strategies import HOSTILE_NAMES

KINDS: list[Literal["predicate", "action"]] = ["predicate", "action"]
SYMBOLS = st.sets(st.builds(Symbol, st.sampled_from(KINDS), HOSTILE_NAMES, st.integers(0, 2)), max_size=8)


def named(*symbols: Symbol, reserved: frozenset[str] = frozenset()) -> list[tuple[str, str]]:
    """The camel and snake identifiers of symbols, in their order."""
    camel, snake = identifiers(symbols, "camel", reserved), identifiers(symbols, "snake", reserved)
    return [(camel[symbol], snake[symbol]) for symbol in symbols]


def test_usual_names_read_as_in_the_domain() -> None:
    assert named(Symbol("action", "light-on", 0), Symbol("predicate", "luminousity_ok", 0)) == [
        ("LightOn", "light_on"),
        ("LuminousityOk", "luminousity_ok"),
    ]


def test_a_predicate_gives_way_to_an_action_of_its_name() -> None:
    assert named(Symbol("action", "open", 1), Symbol("predicate", "open", 1)) == [
        ("Open", "open"),
        ("IsOpen", "is_open"),
    ]


def test_reserved_names_get_a_prefix() -> None:
    reserved = frozenset({"Sleep", "in", "sleep"})
    assert named(Symbol("action", "sleep", 0), Symbol("predicate", "in", 2), reserved=reserved) == [
        ("DoSleep", "do_sleep"),
        ("IsIn", "is_in"),
    ]


def test_names_that_differ_in_case_or_separator_only_stay_apart() -> None:
    symbols = [Symbol("predicate", name, 0) for name in ("at-a", "at_a", "At_a", "ata")]
    results = named(*symbols)
    assert len({camel.casefold() for camel, _ in results}) == 4
    assert len({snake.casefold() for _, snake in results}) == 4
    assert results[3][1] == "ata"


@given(SYMBOLS)
def test_identifiers_are_valid_and_injective_even_ignoring_case(symbols: set[Symbol]) -> None:
    for style, reserved in (("camel", {"Sequence", "At"}), ("snake", PYTHON_RESERVED)):
        table = identifiers(symbols, "camel" if style == "camel" else "snake", reserved)
        assert table.keys() == symbols
        assert len({name.casefold() for name in table.values()}) == len(symbols)
        for name in table.values():
            assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name)
            assert len(name) <= 140
            assert name.casefold() not in {word.casefold() for word in reserved}


@given(st.sets(st.sampled_from(["at", "At", "a-t", "grasp", "x-1", "x1", "x_1", "lo lo", "ü", ""])))
def test_an_identifier_does_not_depend_on_names_it_does_not_collide_with(names: set[str]) -> None:
    symbols = [Symbol("predicate", name, 1) for name in sorted(names)]
    alone = identifiers(symbols, "snake", ())
    other = [Symbol("action", "zebra", 0), Symbol("predicate", "grasped", 1), Symbol("action", "ö", 3)]
    together = identifiers([*other, *symbols], "snake", ())
    assert {symbol: together[symbol] for symbol in symbols} == alone


@given(st.lists(HOSTILE_NAMES, max_size=4))
def test_parameters_of_a_leaf_are_distinct_and_never_reserved_by_an_engine(names: list[str]) -> None:
    made = parameter_names(tuple(names))
    assert len(made) == len(names) == len(set(made))
    for name in made:
        assert re.fullmatch(r"[a-z][a-z0-9_]*", name)
        assert name not in ("name", "id", "self")
        assert not keyword.iskeyword(name)


def test_parameters_keep_their_names() -> None:
    assert parameter_names(("object", "from-room")) == ("object", "from_room")
    assert parameter_names(("name", "class")) == ("arg_name", "arg_class")
    assert parameter_names(("x", "x")) == ("arg1", "arg2")


@given(st.sets(HOSTILE_NAMES, max_size=8))
def test_port_values_are_harmless_and_injective(names: set[str]) -> None:
    table = port_values(names)
    assert len(set(table.values())) == len(names)
    for name, value in table.items():
        assert re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.+-]*", value)
        if re.fullmatch(r"[a-z][a-z0-9_-]*", name):
            assert value == name


def test_a_port_value_made_up_for_one_name_never_hides_another() -> None:
    made = port_values(["{soda}"])["{soda}"]
    table = port_values(["{soda}", made])
    assert table[made] == made
    assert table["{soda}"] != made


@given(st.text(max_size=20))
def test_printable_text_has_no_control_characters(text: str) -> None:
    assert printable(text).isprintable()
