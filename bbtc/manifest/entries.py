"""What a manifest says, as data: a project, its trees, and what is made of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

from bbtc.manifest.expectations import Expectation
from bbtc.planner.options import Prefer, Retries
from bbtc.planner.strategies import DEFAULT
from bbtc.source import AS_WRITTEN, Reading, Span


@dataclass(frozen=True, slots=True)
class Export:
    """An artefact to make of a tree. ``file`` is relative to the project's folder; it is a folder
    where the format is several files (``many``). ``options`` are those given, by name; ``reads``
    are the files that they name, and what is read for these: relative to the project's folder, if they
    are in it."""

    name: str
    form: str
    file: str
    options: tuple[tuple[str, str], ...] = ()
    many: bool = False
    reads: tuple[str, ...] = ()
    span: Span | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class TreeEntry:
    """A tree of the project: what it is made from, how, into which files, and what is expected of it.

    ``inputs`` and ``file`` are relative to the project's folder. ``limits`` are fields of
    :class:`bbtc.limits.Limits`; ``target`` None stands for the problem's own. ``perturb`` is the rate of
    perturbed runs, for what is expected of those.
    """

    name: str
    inputs: tuple[str, ...]
    file: str
    target: Fraction | None = None
    strategy: str = DEFAULT
    max_actions: int | None = None
    retries: Retries = "unbounded"
    prefer: Prefer = "success"
    closed_world: bool = False
    reading: Reading = AS_WRITTEN
    limits: tuple[tuple[str, int | None], ...] = ()
    exports: tuple[Export, ...] = ()
    expect: tuple[Expectation, ...] = ()
    perturb: Fraction | None = None
    span: Span | None = field(default=None, compare=False)
    input_spans: tuple[Span | None, ...] = field(default=(), compare=False)
    """Where the manifest names the inputs."""

    @property
    def reads(self) -> tuple[str, ...]:
        """Its inputs, and the files that its exports read beside the tree."""
        return (*self.inputs, *(path for export in self.exports for path in export.reads))


@dataclass(frozen=True, slots=True)
class Manifest:
    """A project: the folder that its files are relative to, and its trees in the order given."""

    file: Path
    trees: tuple[TreeEntry, ...]

    @property
    def folder(self) -> Path:
        """The folder of the manifest."""
        return self.file.parent
