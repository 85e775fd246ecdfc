"""The stages before the ground task as JSON, for ``bbtc compile --emit ast|model``.

Both are data classes all the way down, so their JSON is read off their fields: every node is an
object with ``node`` (its kind), its fields, and ``span`` (``[line, column, end line, end column]``
of the source, counted from 1). These artefacts are for looking and for other tools' reading; the
stages are never read back from them.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from fractions import Fraction
from typing import Any

from bbtc.artefacts.numbers import given_text
from bbtc.ground.task import ground_name
from bbtc.model.domain import Model
from bbtc.source import SourceFile, Span
from bbtc.syntax.ast import Document

_LATER = frozenset(("timing", "duration", "timeout", "during", "on_abort", "exogenous"))
"""Fields that came later: they stand only where they say something."""


def syntax_to_json(documents: Sequence[Document]) -> dict[str, Any]:
    """The syntax trees of the files, in the order given."""
    files = []
    for document in documents:
        tree = _plain(document)
        files.append({"file": document.source.name, **{k: v for k, v in tree.items() if k != "node"}})
    return {"format": "bbtc-ast", "version": 1, "files": files}


def model_to_json(model: Model) -> dict[str, Any]:
    """The resolved, still lifted model."""
    return {"format": "bbtc-model", "version": 1, **{k: v for k, v in _plain(model).items() if k != "node"}}


def _plain(value: Any) -> Any:
    if isinstance(value, Span):
        return [*value.source.position(value.start), *value.source.position(value.end)]
    if is_dataclass(value) and not isinstance(value, type):
        content = {
            f.name: getattr(value, f.name)
            for f in fields(value)
            if not f.name.startswith("_") and (f.name not in _LATER or getattr(value, f.name) != f.default)
        }
        return {
            "node": type(value).__name__,
            **{name: _plain(part) for name, part in content.items() if not isinstance(part, SourceFile)},
        }
    if isinstance(value, Fraction):
        return given_text(value)
    if isinstance(value, enum.Enum):
        return value.name.lower()
    if isinstance(value, Mapping):
        return {_key(key): _plain(part) for key, part in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(part) for part in value]
    if isinstance(value, frozenset):
        return sorted(_plain(part) for part in value)
    return value


def _key(key: Any) -> str:
    return key if isinstance(key, str) else ground_name(key[0], key[1])
