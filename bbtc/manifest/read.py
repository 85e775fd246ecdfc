"""From the text of a manifest to what it says, every fault reported with its place."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path, PurePosixPath
from typing import TypeVar, cast

from bbtc.artefacts.cursor import At, Faults, Stop, clip, run_reader
from bbtc.artefacts.marked import Marked, Written, read_toml, read_yaml
from bbtc.artefacts.numbers import parse_probability
from bbtc.backends.exporter import Exporter
from bbtc.backends.registry import files_read, load_exporter, parse_options
from bbtc.diagnostics import BbtcError, Unreadable
from bbtc.files.sources import decode_source
from bbtc.manifest import modules
from bbtc.manifest.entries import Export, Manifest, TreeEntry
from bbtc.manifest.expectations import Expectation, parse_expectation, success_in_time
from bbtc.manifest.places import Places
from bbtc.planner.options import Prefer, Retries
from bbtc.planner.strategies import DEFAULT, STRATEGIES
from bbtc.printable import printable
from bbtc.source import Reading

_T = TypeVar("_T")

DEFAULT_OUTPUT = "build"

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*(?:/[A-Za-z0-9_][A-Za-z0-9_.-]*)*")
_MOST = 1000  # expectations or exports of one tree
MOST_VALUES = 250_000
"""Settings, expectations and exports of all trees, those that are shared counted for each."""
_INPUTS = ("domain", "problem")
_READING = ("problem-name", "lenient")
_PLANNING = ("target", "strategy", "max-actions", "retries", "prefer", "closed-world", "guarded", "limits")
_SETTINGS = (*_INPUTS, *_READING, *_PLANNING, "exports", "expect", "perturb")
_LIMITS = {"time": "seconds", "states": "states", "nodes": "nodes", "ground-actions": "actions"}


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
    return run_reader(
        lambda faults: _Reader(marked, faults, Places(file)).manifest(start, file), None, marked.locate
    )


@dataclass(slots=True)
class _Reader:
    marked: Marked
    faults: Faults
    places: Places
    output: str = DEFAULT_OUTPUT
    exporters: dict[str, Exporter] = field(default_factory=dict)
    shared: dict[str, object] = field(default_factory=dict)
    left: int = MOST_VALUES

    def manifest(self, at: At, file: Path) -> Manifest:
        """The whole manifest."""
        members = self._members(at, ["trees"], ["version", "output", "defaults"])
        if "version" in members and members["version"].value != "1":
            raise members["version"].fault("BBT0602", "this version of bbtc reads version 1")
        if "output" in members:
            self.output = self.faults.attempt(lambda: _inside(members["output"]), DEFAULT_OUTPUT)
        defaults: dict[str, At] = {}
        if "defaults" in members:
            defaults = self.faults.attempt(lambda: self._members(members["defaults"], [], _SETTINGS), {})
        trees = []
        for name, entry in members["trees"].entries():
            try:
                trees.append(self._tree(name, entry, defaults))
            except Unreadable as fault:
                self.faults.add(fault.diagnostic)
        for wrong in self.places.faults():
            self.faults.add(wrong)
        return Manifest(file, tuple(trees))

    def _tree(self, name: str, at: At, defaults: dict[str, At]) -> TreeEntry:
        if not _NAME.fullmatch(name) or ".." in name:
            raise at.fault(
                "BBT0604",
                f"'{clip(name)}' cannot name a tree",
                "use letters, digits, '_', '-', '.', and '/' between parts",
            )
        found = {**defaults, **self._members(at, [], [*_SETTINGS, "tree"])}
        if "domain" not in found:
            raise at.fault("BBT0603", "field 'domain' is missing")
        attempt = self.faults.attempt
        given = [found[key] for key in _INPUTS if key in found]
        inputs = tuple(self.faults.each(given, _path))
        file = f"{self.output}/{name}.tree.json"
        if "tree" in found:
            file = attempt(lambda: _inside(found["tree"]), file)
        self.places.claim(found.get("tree", at), file, name)
        for path in inputs:
            self.places.read(path)

        def optional(key: str, read: Callable[[At], _T], default: _T) -> _T:
            if key not in found:
                return default
            if found[key] is not defaults.get(key) or key == "exports":  # whose files have the tree's name
                return attempt(lambda: read(found[key]), default)
            if key not in self.shared:
                self.shared[key] = attempt(lambda: read(found[key]), default)
            return cast("_T", self.shared[key])

        # Two names of one setting; what a tree says itself counts more than the defaults.
        worlds = {
            "closed-world": optional("closed-world", At.flag, False),
            "guarded": not optional("guarded", At.flag, True),
        }
        given_worlds = [key for key in worlds if key in found]
        own = [key for key in given_worlds if found[key] is not defaults.get(key)] or given_worlds
        if len({worlds[key] for key in own}) > 1:
            self.faults.add(found["guarded"].fault("BBT0604", "contradicts `closed-world`").diagnostic)
        entry = TreeEntry(
            name=name,
            inputs=inputs,
            file=file,
            target=optional("target", _target, None),
            strategy=optional("strategy", lambda each: _text(each) and each.word(*STRATEGIES), DEFAULT),
            max_actions=optional("max-actions", _count, None),
            retries=optional("retries", _retries, "unbounded"),
            prefer=optional("prefer", _prefer, "success"),
            closed_world=any(worlds[key] for key in own),
            reading=Reading(optional("problem-name", _text, None), optional("lenient", At.flag, False)),
            limits=optional("limits", self._limits, ()),
            exports=optional("exports", lambda each: self._exports(each, name), ()),
            expect=optional("expect", self._expectations, ()),
            perturb=optional("perturb", _target, None),
            span=self.marked.span(at.path),
            input_spans=tuple(self.marked.span(each.path) for each in given),
        )
        if entry.perturb is None and any(expectation.perturbed for expectation in entry.expect):
            hint = "say how often something changes, such as `perturb: 5%`"
            self.faults.add(
                at.found("BBT0603", "perturbed runs are expected, but field 'perturb' is missing", hint)
            )
        return entry

    def _limits(self, at: At) -> tuple[tuple[str, int | None], ...]:
        members = self._members(at, [], list(_LIMITS))
        return tuple(
            (_LIMITS[name], None if name == "time" and each.value == "none" else _count(each))
            for name, each in sorted(members.items())
        )

    def _expectations(self, at: At) -> tuple[Expectation, ...]:
        return tuple(self.faults.each(self._few(at.elements(), at), self._expectation))

    def _expectation(self, at: At) -> Expectation:
        span = self.marked.span(at.path)
        try:
            if isinstance(at.value, dict):
                outer = self._members(at, ["success_by"], [])
                by = self._members(outer["success_by"], ["seconds", "at_least"], [])
                return success_in_time(by["seconds"].string(), by["at_least"].string(), span)
            return parse_expectation(_text(at), span)
        except ValueError as error:
            raise at.fault("BBT0604", printable(str(error))) from None

    # --- exports -----------------------------------------------------------------------------

    def _exports(self, at: At, tree: str) -> tuple[Export, ...]:
        """A list of formats, or a mapping from names to what is to be made."""
        if isinstance(at.value, list):
            named = [(_text(each), At(None, each.path)) for each in self._few(at.elements(), at)]
        else:
            named = self._few(list(at.entries()), at)
        forms = [_form(name, each) for name, each in named]
        exports = []
        for name, each in named:
            try:
                exports.append(self._export(name, each, tree, forms))
            except Unreadable as fault:
                self.faults.add(fault.diagnostic)
        places = dict(named)
        return tuple(self._with_module(places[export.name], export, exports) for export in exports)

    def _with_module(self, at: At, export: Export, exports: list[Export]) -> Export:
        """The export, if it is a robot, with the module of its tree."""
        try:
            return modules.with_module(export, exports) if export.form == modules.ROBOT else export
        except ValueError as error:
            hint = "name its file otherwise, or say `options: {module: …}`"
            self.faults.add(at.found("BBT0707", printable(str(error)), hint))
            return export

    def _export(self, name: str, at: At, tree: str, forms: list[str]) -> Export:
        """One export: nothing, the file, or a mapping. ``forms`` are the formats of all."""
        members: dict[str, At] = {}
        if isinstance(at.value, str):
            members = {"file": at}
        elif at.value is not None:
            members = self._members(at, [], ["format", "file", "options"])
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
            own = modules.default_file(form, tree, forms) if form == name else None
            # A format of several files goes into a folder of its own.
            file = f"{self.output}/{own or f'{tree}{part}' + (exporter.suffix or f'-{form}')}"
        self.places.claim(at, file, f"{tree}, {name}", folder=not exporter.suffix)
        span = self.marked.span(at.path)
        reads = tuple(self._reads(exporter, dict(options)))
        for path in reads:
            self.places.read(path)
        return Export(name, form, file, options, not exporter.suffix, reads, span)

    def _reads(self, exporter: Exporter, texts: dict[str, str]) -> Iterator[str]:
        """The files that options of an export name, and what is read for these."""
        folder = self.places.file.parent
        for path in files_read(exporter, texts, folder):
            inside = Path(path)
            yield str(inside.relative_to(folder)) if inside.is_relative_to(folder) else path

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

    # --- how much ----------------------------------------------------------------------------

    def _members(self, at: At, required: list[str], optional: list[str] | tuple[str, ...]) -> dict[str, At]:
        """As :meth:`At.members`; where the value is no mapping, words that YAML's writers know."""
        if not isinstance(at.value, dict):
            raise at.fault("BBT0604", "must be a mapping of keys to values")
        self._spend(len(at.value), at)
        return at.members(required, optional)

    def _few(self, items: list[_T], at: At) -> list[_T]:
        if len(items) > _MOST:
            raise at.fault("BBT0604", f"more than {_MOST}")
        self._spend(len(items), at)
        return items

    def _spend(self, values: int, at: At) -> None:
        """Defaults and aliases let a short text say very much."""
        self.left -= values
        if self.left < 0:
            self.faults.add(at.found("BBT0005", f"the trees have more than {MOST_VALUES} settings in all"))
            raise Stop


def _form(name: str, at: At) -> str:
    """The format of an export, as far as it can be told before it is read."""
    given = at.value.get("format", name) if isinstance(at.value, dict) else name
    return str(given)


# --- single values ---------------------------------------------------------------------------


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
    return "least" if at.word("unbounded", "least") == "least" else "unbounded"


def _prefer(at: At) -> Prefer:
    word = at.word("success", "cost", "size")
    return "cost" if word == "cost" else "size" if word == "size" else "success"


def _target(at: At) -> Fraction:
    try:
        return parse_probability(at.string())
    except ValueError as error:
        raise at.fault("BBT0604", printable(str(error))) from None


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
