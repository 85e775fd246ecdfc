"""From the text of a manifest to what it says, every fault reported with its place."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path, PurePosixPath
from typing import TypeVar

from bbtc.artefacts.cursor import At, Fault, Faults, clip, legible, run_reader
from bbtc.artefacts.numbers import parse_probability
from bbtc.diagnostics import BbtcError
from bbtc.export.registry import Exporter, load_exporter, parse_options
from bbtc.manifest.expectations import Expectation, parse_expectation
from bbtc.manifest.marked import Marked, Written, read_toml, read_yaml
from bbtc.plan.options import Retries
from bbtc.plan.strategies import DEFAULT, STRATEGIES
from bbtc.source import Span
from bbtc.syntax.reader import decode_source

_T = TypeVar("_T")

DEFAULT_OUTPUT = "build"

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*(?:/[A-Za-z0-9_][A-Za-z0-9_.-]*)*")
_MOST = 1000  # expectations or exports of one tree
_INPUTS = ("domain", "problem")
_PLANNING = ("target", "strategy", "max-actions", "retries", "guarded", "limits")
_SETTINGS = (*_INPUTS, *_PLANNING, "exports", "expect")
_LIMITS = {"time": "seconds", "states": "states", "nodes": "nodes", "ground-actions": "actions"}


@dataclass(frozen=True, slots=True)
class Export:
    """An artefact to make of a tree. ``file`` is relative to the project's folder; it is a folder
    where the format is several files (``many``). ``options`` are those given, by name."""

    name: str
    form: str
    file: str
    options: tuple[tuple[str, str], ...] = ()
    many: bool = False
    span: Span | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class TreeEntry:
    """A tree of the project: what it is made from, how, into which files, and what is expected of it.

    ``inputs`` and ``file`` are relative to the project's folder. ``limits`` are fields of
    :class:`bbtc.limits.Limits`; ``target`` None stands for the problem's own.
    """

    name: str
    inputs: tuple[str, ...]
    file: str
    target: Fraction | None = None
    strategy: str = DEFAULT
    max_actions: int | None = None
    retries: Retries = "least"
    guarded: bool = False
    limits: tuple[tuple[str, int | None], ...] = ()
    exports: tuple[Export, ...] = ()
    expect: tuple[Expectation, ...] = ()
    span: Span | None = field(default=None, compare=False)
    input_spans: tuple[Span | None, ...] = field(default=(), compare=False)
    """Where the manifest names the inputs."""


@dataclass(frozen=True, slots=True)
class Manifest:
    """A project: the folder that its files are relative to, and its trees in the order given."""

    file: Path
    trees: tuple[TreeEntry, ...]

    @property
    def folder(self) -> Path:
        """The folder of the manifest."""
        return self.file.parent


# --- what it says ----------------------------------------------------------------------------


def read_manifest(file: Path, data: bytes, shown: str | None = None) -> Manifest:
    """What a manifest says; ``shown`` is the name that messages give it. Raises :class:`BbtcError` with
    every fault and its place."""
    source = decode_source(shown or file.name, data)
    toml = file.suffix == ".toml"
    marked = read_toml(source) if toml else read_yaml(source)
    start = At(marked.value)
    for key in ("tool", "bbtc") if toml else ():
        start = dict(start.entries()).get(key, At({}, (*start.path, key)))
    return run_reader(lambda faults: _Reader(marked, faults).manifest(start, file), None, marked.locate)


@dataclass(slots=True)
class _Reader:
    marked: Marked
    faults: Faults
    output: str = DEFAULT_OUTPUT
    owners: dict[str, str] = field(default_factory=dict)
    exporters: dict[str, Exporter] = field(default_factory=dict)

    def manifest(self, at: At, file: Path) -> Manifest:
        """The whole manifest."""
        members = _members(at, ["trees"], ["version", "output", "defaults"])
        if "version" in members and members["version"].value != "1":
            raise members["version"].fault("BBT0602", "this version of bbtc reads version 1")
        if "output" in members:
            self.output = self.faults.attempt(lambda: _inside(members["output"]), DEFAULT_OUTPUT)
        defaults: dict[str, At] = {}
        if "defaults" in members:
            defaults = self.faults.attempt(lambda: _members(members["defaults"], [], _SETTINGS), {})
        trees = []
        for name, entry in members["trees"].entries():
            try:
                trees.append(self._tree(name, entry, defaults))
            except Fault as fault:
                self.faults.add(fault)
        return Manifest(file, tuple(trees))

    def _tree(self, name: str, at: At, defaults: dict[str, At]) -> TreeEntry:
        if not _NAME.fullmatch(name) or ".." in name:
            raise at.fault(
                "BBT0604",
                f"'{clip(name)}' cannot name a tree",
                "use letters, digits, '_', '-', '.', and '/' between parts",
            )
        found = {**defaults, **_members(at, [], [*_SETTINGS, "tree"])}
        if "domain" not in found:
            raise at.fault("BBT0603", "field 'domain' is missing")
        attempt = self.faults.attempt
        given = [found[key] for key in _INPUTS if key in found]
        inputs = tuple(self.faults.each(given, _path))
        file = f"{self.output}/{name}.tree.json"
        if "tree" in found:
            file = attempt(lambda: _inside(found["tree"]), file)
        self._claim(found.get("tree", at), file, name)

        def optional(key: str, read: Callable[[At], _T], default: _T) -> _T:
            return attempt(lambda: read(found[key]), default) if key in found else default

        return TreeEntry(
            name=name,
            inputs=inputs,
            file=file,
            target=optional("target", _target, None),
            strategy=optional("strategy", lambda each: _text(each) and each.word(*STRATEGIES), DEFAULT),
            max_actions=optional("max-actions", _count, None),
            retries=optional("retries", _retries, "least"),
            guarded=optional("guarded", At.flag, False),
            limits=optional("limits", self._limits, ()),
            exports=optional("exports", lambda each: self._exports(each, name), ()),
            expect=optional("expect", self._expectations, ()),
            span=self.marked.span(at.path),
            input_spans=tuple(self.marked.span(each.path) for each in given),
        )

    def _limits(self, at: At) -> tuple[tuple[str, int | None], ...]:
        members = _members(at, [], list(_LIMITS))
        return tuple(
            (_LIMITS[name], None if name == "time" and each.value == "none" else _count(each))
            for name, each in sorted(members.items())
        )

    def _expectations(self, at: At) -> tuple[Expectation, ...]:
        return tuple(self.faults.each(_few(at.elements(), at), self._expectation))

    def _expectation(self, at: At) -> Expectation:
        try:
            return parse_expectation(_text(at), self.marked.span(at.path))
        except ValueError as error:
            raise at.fault("BBT0604", legible(str(error))) from None

    # --- exports -----------------------------------------------------------------------------

    def _exports(self, at: At, tree: str) -> tuple[Export, ...]:
        """A list of formats, or a mapping from names to what is to be made."""
        if isinstance(at.value, list):
            named = [(_text(each), At(None, each.path)) for each in _few(at.elements(), at)]
        else:
            named = _few(list(at.entries()), at)
        exports = []
        for name, each in named:
            try:
                exports.append(self._export(name, each, tree))
            except Fault as fault:
                self.faults.add(fault)
        return tuple(exports)

    def _export(self, name: str, at: At, tree: str) -> Export:
        """One export: nothing, the file, or a mapping."""
        members: dict[str, At] = {}
        if isinstance(at.value, str):
            members = {"file": at}
        elif at.value is not None:
            members = _members(at, [], ["format", "file", "options"])
        form = _text(members["format"]) if "format" in members else name
        if form not in self.exporters:
            self.exporters[form] = _diagnosed(members.get("format", at), lambda: load_exporter(form))
        exporter = self.exporters[form]
        options = self._options(members["options"], exporter) if "options" in members else ()
        if "file" in members:
            file = _inside(members["file"])
        else:
            part = f"-{name}" if form != name else ""
            if not _NAME.fullmatch(name) or ".." in name or "/" in name:
                raise at.fault("BBT0604", f"'{clip(name)}' cannot name an export: give its file")
            # A format of several files goes into a folder of its own.
            file = f"{self.output}/{tree}{part}{exporter.suffix or f'-{form}'}"
        self._claim(at, file, f"{tree}, {name}")
        span = self.marked.span(at.path)
        return Export(name, form, file, options, not exporter.suffix, span)

    @staticmethod
    def _options(at: At, exporter: Exporter) -> tuple[tuple[str, str], ...]:
        texts = {}
        for name, each in at.entries():
            if isinstance(each.value, bool):
                texts[name] = str(each.value).lower()
            else:
                texts[name] = each.string()
        _diagnosed(at, lambda: parse_options(exporter, texts))
        return tuple(sorted(texts.items()))

    def _claim(self, at: At, file: str, owner: str) -> None:
        """Every file is made once."""
        other = self.owners.setdefault(file, owner)
        if other != owner:
            self.faults.add(at.fault("BBT1003", f"{file} is made twice: for '{other}' and for '{owner}'"))


# --- single values ---------------------------------------------------------------------------


def _members(at: At, required: list[str], optional: list[str] | tuple[str, ...]) -> dict[str, At]:
    """As :meth:`At.members`; where the value is no mapping, words that YAML's writers know."""
    if not isinstance(at.value, dict):
        raise at.fault("BBT0604", "must be a mapping of keys to values")
    return at.members(required, optional)


def _few(items: list[_T], at: At) -> list[_T]:
    if len(items) > _MOST:
        raise at.fault("BBT0604", f"more than {_MOST}")
    return items


def _text(at: At) -> str:
    if isinstance(at.value, Written):
        raise at.fault("BBT0604", f"must be a text, not the number {clip(at.value)}", "put it in quotes")
    return at.string()


def _count(at: At) -> int:
    text = at.value
    if not isinstance(text, Written) or not text.isascii() or not text.isdecimal() or len(text) > 9:
        raise at.fault("BBT0604", "must be a whole number")
    return int(text)


def _retries(at: At) -> Retries:
    return "unbounded" if at.word("least", "unbounded") == "unbounded" else "least"


def _target(at: At) -> Fraction:
    try:
        return parse_probability(at.string())
    except ValueError as error:
        raise at.fault("BBT0604", legible(str(error))) from None


def _path(at: At) -> str:
    """A path, relative to the manifest, with ``/``."""
    text = _text(at)
    if not text or not text.isprintable() or "\\" in text or text == "-":
        raise at.fault("BBT0604", f"'{clip(text)}' is not a path", "separate its parts by '/'")
    return text


def _inside(at: At) -> str:
    """A path inside the project, in its plainest form: what is written stays there."""
    text = _path(at)
    path = PurePosixPath(text)
    if path.is_absolute() or ".." in path.parts or not path.parts or ":" in text:
        raise at.fault("BBT0604", f"'{clip(text)}' is not inside the project's folder")
    return str(path)


def _diagnosed(at: At, read: Callable[[], _T]) -> _T:
    """The result of ``read``; what it finds wrong is a fault at this place."""
    try:
        return read()
    except BbtcError as error:
        first = error.diagnostics[0]
        raise at.fault(first.code, first.message, first.hint) from None
