"""YAML and TOML as plain values, strictly, with the place of each."""

from __future__ import annotations

import re
import sys
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from bbtc.artefacts.cursor import clip
from bbtc.artefacts.jsontext import Path, path_text
from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.source import SourceFile, Span

if TYPE_CHECKING:
    import yaml

_MOST_LEVELS = 20
_MOST_REPEATED = 50  # keys that are told
_MOST_PARTS = 50  # of a dotted key
_CORE = "tag:yaml.org,2002:"
_NUMBERS = frozenset((f"{_CORE}int", f"{_CORE}float"))
_TEXTS = frozenset((f"{_CORE}str", f"{_CORE}timestamp", f"{_CORE}value"))
_TRUE = frozenset(("yes", "true", "on"))


class Written(str):
    """A number as it is written, so that it stays exact."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Marked:
    """A value made of dicts, lists, strings, :class:`Written` numbers, truth values and None.

    ``spans`` has the places of the values that were found in the text, by path, ``keys`` those of their
    keys.
    """

    value: object
    source: SourceFile
    spans: Mapping[Path, Span]
    keys: Mapping[Path, Span]

    def locate(self, faults: Sequence[Diagnostic]) -> list[Span | None]:
        """The place of each fault: of the key, if that is what is wrong, else of the value."""
        return [
            self.keys.get(fault.path) or self.span(fault.path)
            if fault.code == "BBT0603"
            else self.span(fault.path)
            for fault in faults
        ]

    def span(self, path: Path) -> Span | None:
        """The place of the value at a path, or of the innermost value around it that has one."""
        for length in range(len(path), -1, -1):
            if path[:length] in self.spans:
                return self.spans[path[:length]]
        return None


# --- YAML ------------------------------------------------------------------------------------


def read_yaml(source: SourceFile) -> Marked:
    """The value of a YAML document. Strict: a key that stands twice, a tag and a second document are
    errors. Aliases share a value, they never copy it, so that nothing grows beyond the text.

    Raises :class:`BbtcError` with the place.
    """
    import yaml

    try:
        loader: Any = yaml.SafeLoader(source.text)
    except yaml.reader.ReaderError as error:
        at = Span(source, error.position, error.position + 1)
        message = f"not valid YAML: the character U+{ord(source.text[error.position]):04X}"
        raise BbtcError.single("BBT1001", message, at) from None
    builder = _Builder(source, loader)
    try:
        while loader.check_event():
            builder.take(loader.get_event())
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        span = builder.span(mark, mark) if mark is not None else None
        raise BbtcError.single("BBT1001", f"not valid YAML: {clip(str(error.problem))}", span) from None
    except yaml.YAMLError as error:
        raise BbtcError.single("BBT1001", f"not valid YAML: {clip(str(error))}") from None
    finally:
        loader.dispose()
    if builder.repeated:
        raise BbtcError(builder.repeated)
    return Marked(builder.root, source, builder.spans, builder.keys)


@dataclass(slots=True)
class _Open:
    """A list or mapping whose end has not come; ``key`` is the one whose value comes next."""

    value: list[object] | dict[str, object]
    path: Path
    key: str | None = None


@dataclass(slots=True)
class _Builder:
    """Builds values from events, without recursion."""

    source: SourceFile
    loader: Any
    root: object = None
    spans: dict[Path, Span] = field(default_factory=dict)
    keys: dict[Path, Span] = field(default_factory=dict)
    repeated: list[Diagnostic] = field(default_factory=list)
    _open: list[_Open] = field(default_factory=list)
    _anchors: dict[str, object] = field(default_factory=dict)
    _documents: int = 0

    def span(self, start: Any, end: Any) -> Span:
        """The place between two marks, cut to its first line."""
        first = min(start.index, max(0, len(self.source.text) - 1))
        starts = self.source.line_starts
        following = bisect_right(starts, first)  # not by looking for a line end: a line may be very long
        stop = starts[following] - 1 if following < len(starts) else len(self.source.text)
        return Span(self.source, first, max(first + 1, min(end.index, stop)))

    def take(self, event: yaml.Event) -> None:
        """One event."""
        import yaml

        match event:
            case yaml.DocumentStartEvent():
                self._documents += 1
                if self._documents > 1:
                    raise self._refused(event, "a manifest is one document")
            case yaml.AliasEvent():
                anchor = str(event.anchor)
                if anchor not in self._anchors:
                    raise self._refused(event, f"the anchor '{clip(anchor)}' is not defined before")
                self._put(event, self._anchors[anchor])
            case yaml.ScalarEvent():
                self._scalar(event)
            case yaml.SequenceStartEvent() | yaml.MappingStartEvent():
                if len(self._open) >= _MOST_LEVELS:
                    raise BbtcError.single("BBT0605", "nested too deeply", self._place(event))
                if event.tag is not None:
                    raise self._refused(event, "tags are not used here")
                value: list[object] | dict[str, object] = (
                    [] if isinstance(event, yaml.SequenceStartEvent) else {}
                )
                path = self._put(event, value)
                self._open.append(_Open(value, path))
            case yaml.SequenceEndEvent() | yaml.MappingEndEvent():
                self._open.pop()
            case _:
                pass

    def _scalar(self, event: yaml.ScalarEvent) -> None:
        import yaml

        if event.tag is not None:
            raise self._refused(event, "tags are not used here")
        tag = self.loader.resolve(yaml.ScalarNode, event.value, event.implicit)
        inside = self._open[-1] if self._open else None
        if inside is not None and isinstance(inside.value, dict) and inside.key is None:
            self._key(event, inside, inside.value)
        elif tag in _NUMBERS:
            self._put(event, Written(event.value))
        elif tag == f"{_CORE}bool":
            self._put(event, event.value.lower() in _TRUE)
        elif tag == f"{_CORE}null":
            self._put(event, None)
        elif tag in _TEXTS:
            self._put(event, event.value)
        else:
            raise self._refused(event, f"'{clip(event.value)}' is not used here")

    def _key(self, event: yaml.ScalarEvent, inside: _Open, members: dict[str, object]) -> None:
        key = str(event.value)
        if key in members:
            message = f"at {path_text(inside.path)}: '{clip(key)}' stands twice"
            if len(self.repeated) < _MOST_REPEATED:
                self.repeated.append(Diagnostic("BBT0603", message, self._place(event)))
        inside.key = key
        self.keys.setdefault((*inside.path, key), self._place(event))

    def _put(self, event: Any, value: object) -> Path:
        """Put a value where it belongs; its path."""
        path: Path = ()
        if not self._open:
            self.root = value
        else:
            inside = self._open[-1]
            if isinstance(inside.value, list):
                path = (*inside.path, len(inside.value))
                inside.value.append(value)
            elif inside.key is None:
                raise self._refused(event, "a key must be plain text")
            else:
                path = (*inside.path, inside.key)
                inside.value[inside.key] = value
                inside.key = None
        # Of a mapping, the key tells more.
        key = self.keys.get(path) if isinstance(value, dict) else None
        self.spans[path] = key or self._place(event)
        anchor = getattr(event, "anchor", None)
        if anchor is not None:
            self._anchors[anchor] = value
        return path

    def _place(self, event: Any) -> Span:
        return self.span(event.start_mark, event.end_mark)

    def _refused(self, event: Any, message: str) -> BbtcError:
        return BbtcError.single("BBT1001", f"not valid here: {message}", self._place(event))


# --- TOML ------------------------------------------------------------------------------------


def read_toml(source: SourceFile) -> Marked:
    """The value of a TOML text. Raises :class:`BbtcError` with the place."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib

    deep = _TOML_DEEP.search(source.text)  # which takes the square of its length to read
    if deep is not None:
        at = Span(source, deep.end() - 1, deep.end())
        raise BbtcError.single("BBT0605", f"a key of more than {_MOST_PARTS} parts", at)
    try:
        value = _written(tomllib.loads(source.text, parse_float=Written))
    except tomllib.TOMLDecodeError as error:
        raise BbtcError.single(
            "BBT1001", f"not valid TOML: {clip(str(error))}", _toml_place(source, str(error))
        ) from None
    except ValueError:  # what Python says of numbers that take it long
        raise BbtcError.single("BBT1001", "not valid TOML: a whole number of too many digits") from None
    except RecursionError:
        raise BbtcError.single("BBT0605", "TOML nested too deeply") from None
    spans, keys = _toml_spans(source)
    return Marked(value, source, spans, keys)


def _toml_place(source: SourceFile, message: str) -> Span | None:
    found = re.search(r"line (\d+), column (\d+)", message)
    if found is None:
        return None
    line = min(int(found[1]), len(source.line_starts))
    start = source.line_starts[line - 1] + int(found[2]) - 1
    return Span(source, start, start + 1)


def _written(value: object) -> object:
    """The value with its whole numbers as they are written, like those of YAML."""
    if isinstance(value, dict):
        return {key: _written(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_written(part) for part in value]
    if isinstance(value, bool | str):
        return value
    return Written(value) if isinstance(value, int) else str(value)


_PART = r"""(?:[A-Za-z0-9_-]+|"[^"\\\n]*"|'[^'\n]*')"""
_DOTTED = rf"{_PART}(?:[ \t]*\.[ \t]*{_PART})*"
_TOML_DEEP = re.compile(rf"(?:^|[{{,\[])[ \t]*(?:{_PART}[ \t]*\.[ \t]*){{{_MOST_PARTS}}}", re.MULTILINE)
_TOML_LINE = re.compile(
    rf"^[ \t]*(?:\[[ \t]*(?P<table>{_DOTTED})[ \t]*\]|(?P<key>{_DOTTED})[ \t]*=[ \t]*(?P<value>[^\n]*))",
    re.MULTILINE,
)


def _toml_spans(source: SourceFile) -> tuple[dict[Path, Span], dict[Path, Span]]:
    """The places of values and of keys that stand at the start of a line, which is where people write
    them; what stands inside an inline table is located by its line."""
    spans: dict[Path, Span] = {}
    keys: dict[Path, Span] = {}
    table: Path = ()
    for match in _TOML_LINE.finditer(source.text):
        group = "table" if match["table"] is not None else "key"
        path: Path = tuple(part.strip("\"'") for part in re.findall(_PART, match[group]))
        if group == "table":
            table = path
        else:
            path = (*table, *path)
        spans.setdefault(path, Span(source, *match.span("table" if group == "table" else "value")))
        keys.setdefault(path, Span(source, *match.span(group)))
    return spans, keys
