"""Formats are found by name; plugins join by entry point; whatever goes wrong is a diagnostic."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import bbtc
from bbtc.backends import registry
from bbtc.backends.exporter import Exporter, Files, Option
from bbtc.backends.registry import format_names, load_exporter, parse_options
from bbtc.diagnostics import BbtcError

DOMAINS = Path(__file__).parents[2] / "domains"


class Plain:
    """An exporter as a plugin would have it."""

    name = "plain"
    description = "for tests"
    suffix = ".txt"
    options = (
        Option("depth", 3, "levels"),
        Option("color", False, "colors"),
        Option("style", "wide", "layout", ("wide", "narrow")),
        Option("title", "", "any text"),
    )

    def export(self, tree: object, options: object, figures: object) -> str:
        """Nothing to see."""
        return ""


plain = Plain()
not_an_exporter = 7


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[..., None]]:
    """Install a package with such entry points of the group, by name and value."""

    def installed(**plugins: str) -> None:
        info = tmp_path / "strange-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: strange\nVersion: 1.0\n")
        points = "".join(f"{name} = {value}\n" for name, value in plugins.items())
        (info / "entry_points.txt").write_text(f"[{registry.GROUP}]\n{points}")
        monkeypatch.syspath_prepend(tmp_path)
        registry.plugins.cache_clear()

    yield installed
    monkeypatch.undo()
    registry.plugins.cache_clear()


def code_of(error: pytest.ExceptionInfo[BbtcError]) -> str:
    """The code of the only diagnostic."""
    (diagnostic,) = error.value.diagnostics
    return diagnostic.code


@pytest.mark.parametrize("name", ["btcpp", "py_trees"])
def test_built_ins_keep_the_protocol(name: str) -> None:
    exporter = load_exporter(name)
    assert isinstance(exporter, Exporter)
    assert exporter.name == name
    assert exporter.suffix.startswith(".")
    assert "\n" not in exporter.description
    assert all(option.help for option in exporter.options)


def test_an_unknown_format_is_an_error_with_the_nearest_name() -> None:
    with pytest.raises(BbtcError) as error:
        load_exporter("bt_cpp")
    assert code_of(error) == "BBT0701"
    assert error.value.diagnostics[0].hint == "did you mean 'btcpp'?"


def test_a_plugin_is_a_format_like_any_other(
    monkeypatch: pytest.MonkeyPatch, install: Callable[..., None]
) -> None:
    install(plain=f"{__name__}:plain")
    assert format_names()[-1] == "plain"
    assert load_exporter("plain") is plain


def test_a_plugin_with_the_name_of_a_built_in_is_an_error(install: Callable[..., None]) -> None:
    install(dot="elsewhere:dot")
    with pytest.raises(BbtcError) as error:
        load_exporter("dot")
    assert code_of(error) == "BBT0702"
    assert "elsewhere:dot" in str(error.value)
    assert load_exporter("btcpp").name == "btcpp"


@pytest.mark.parametrize("value", ["no.such.module:x", "bbtc.backends.registry:no_such_object"])
def test_a_plugin_that_does_not_load_is_an_error(install: Callable[..., None], value: str) -> None:
    install(mine=value)
    with pytest.raises(BbtcError) as error:
        load_exporter("mine")
    assert code_of(error) == "BBT0703"


def test_a_plugin_that_is_no_exporter_is_an_error(
    monkeypatch: pytest.MonkeyPatch, install: Callable[..., None]
) -> None:
    install(mine=f"{__name__}:not_an_exporter")
    with pytest.raises(BbtcError) as error:
        load_exporter("mine")
    assert code_of(error) == "BBT0703"


class Failing:
    """An exporter of a stranger; what it does instead of its work is set by the test."""

    name, description, suffix, options = "failing", "for tests", ".txt", ()

    def __init__(self, artefact: object) -> None:
        self.artefact = artefact

    def export(self, tree: object, options: object, figures: object) -> Any:
        if isinstance(self.artefact, Exception):
            raise self.artefact
        return self.artefact


failing = Failing(None)


@pytest.mark.parametrize(
    "artefact",
    [ZeroDivisionError("division by zero"), KeyError("x"), RecursionError(), OSError(28, "No space"), None, 7,
     "half a pair: \ud800", Files({"../x": ""}), Files({"/x": ""}), Files({"a//b": ""}),
     Files({"x": "\ud800"})],
    ids=repr,
)  # fmt: skip
def test_a_plugin_that_fails_is_told_as_its_own_fault(
    monkeypatch: pytest.MonkeyPatch, install: Callable[..., None], artefact: object
) -> None:
    install(failing=f"{__name__}:failing")
    monkeypatch.setattr(failing, "artefact", artefact)
    domain, problem = (DOMAINS / "household" / f"{name}.pddl" for name in ("domain", "look-for-soda"))
    tree = bbtc.plan(domain, problem, target="0.5").tree
    with pytest.raises(BbtcError) as error:
        bbtc.export(tree, "failing")
    assert code_of(error) == "BBT0703"
    assert f"the exporter failing ({__name__}:failing" in str(error.value)
    assert "not of bbtc" in str(error.value)


def test_options_are_typed_and_have_defaults() -> None:
    assert parse_options(plain, {}) == {"depth": 3, "color": False, "style": "wide", "title": ""}
    given = {"depth": "-12", "color": "yes", "style": "narrow", "title": "a=b"}
    assert parse_options(plain, given) == {"depth": -12, "color": True, "style": "narrow", "title": "a=b"}
    for value, words in {True: ("true", "yes", "on", "Yes"), False: ("false", "no", "off", "OFF")}.items():
        assert [parse_options(plain, {"color": word})["color"] for word in words] == [value] * len(words)


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("deptth", "1", "did you mean 'depth'?"),
        ("depth", "many", "a whole number"),
        ("depth", "9" * 5000, "a whole number"),
        ("color", "blue", "true or false"),
        ("style", "tall", "wide or narrow"),
    ],
)
def test_a_wrong_option_is_an_error(key: str, value: str, says: str) -> None:
    with pytest.raises(BbtcError) as error:
        parse_options(plain, {key: value})
    assert code_of(error) == "BBT0704"
    assert says in str(error.value)
