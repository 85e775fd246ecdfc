"""What an exporter is: its protocol, its options, and what it makes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol, TypeAlias, runtime_checkable

from bbtc.tree.nodes import Tree

OptionValue: TypeAlias = bool | int | str
"""The value of an option; its type is that of the option's default."""

Figures: TypeAlias = Mapping[str, Fraction]
"""By node id: the probability that a tick reaches the node at least once in a run."""


class Begun(str):
    """A text to start from. Once it is written and filled in, the file is the user's: it is never written
    over. It is an artefact, or one of those in :class:`Files`."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Files:
    """An artefact of several files, such as a project: relative paths with ``/`` and their texts,
    in the order they are written. It goes into a directory."""

    texts: Mapping[str, str]


Artefact: TypeAlias = str | bytes | Files
"""What an exporter makes: text (:class:`Begun` where people fill it in), bytes for a binary format, or files
for a directory."""


@dataclass(frozen=True, slots=True)
class Option:
    """A declared option of an exporter. The type of ``default`` (bool, int or str) is the type of
    the option; a str option with ``choices`` takes only those. Where it names a file (unless it is empty),
    ``reads`` gives that and all others that are read for it."""

    name: str
    default: OptionValue
    help: str
    choices: tuple[str, ...] = ()
    reads: Callable[[str], tuple[str, ...]] | None = None


@runtime_checkable
class Exporter(Protocol):
    """A back-end. ``description`` is one line; ``suffix`` is that of its files, with the dot, empty
    for a directory."""

    @property
    def name(self) -> str: ...

    @property
    def description(self) -> str: ...

    @property
    def suffix(self) -> str: ...

    @property
    def options(self) -> tuple[Option, ...]: ...

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> Artefact:
        """The artefact. ``options`` holds a value for every declared option. Deterministic. Raises
        :class:`BbtcError` for a tree it cannot write."""
        ...
