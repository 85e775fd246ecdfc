"""What the last build did: for every step of every tree, what it was made from and what it made.

The state stands in ``.bbtc/`` beside the manifest, which is nobody's source: it can be deleted at any time,
and everything is built again. A step is up to date if the digest of its settings, the contents of its
inputs and those of its outputs are all what they were.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bbtc.diagnostics import BbtcError
from bbtc.files import write
from bbtc.version import __version__

FOLDER = ".bbtc"
_FORMAT = "bbtc-build"
_VERSION = 1
_DIGEST = 64  # characters


@dataclass(frozen=True, slots=True)
class Step:
    """A step that was done: the digest of its settings, and the SHA-256 of its files by path."""

    settings: str
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]


Steps = dict[str, Step]
"""The steps of a tree, by name."""


@dataclass(slots=True)
class State:
    """What was done last; ``manifest`` is the SHA-256 of the manifest it was done for, and ``versions`` tells
    by which tool and which plugins."""

    versions: Mapping[str, str] = field(default_factory=dict)
    manifest: str = ""
    trees: dict[str, Steps] = field(default_factory=dict)


def digest(data: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def settings_digest(*settings: object) -> str:
    """One digest for values made of strings, numbers, lists and None."""
    return digest(json.dumps(settings, ensure_ascii=True, default=str).encode())


def tool_version() -> str:
    """The version of bbtc, and a digest of what is installed: a changed copy of the same version
    builds anew."""
    package = Path(__file__).parents[1]
    record = package.parent / f"bbtc-{__version__}.dist-info" / "RECORD"
    with contextlib.suppress(OSError):
        listed = [line for line in record.read_bytes().splitlines() if line.startswith(b"bbtc/")]
        if listed:
            return f"{__version__}+{digest(b''.join(sorted(listed)))[:16]}"
    whole = hashlib.sha256()
    for folder, folders, names in os.walk(package):
        folders.sort()
        for name in sorted(names):
            if name.endswith(".py"):
                whole.update(Path(folder, name).read_bytes())
    return f"{__version__}+{whole.hexdigest()[:16]}"


def plugin_version(form: str) -> str:
    """The version of the package that an export format comes from; empty for a built-in one."""
    from bbtc.export.registry import BUILT_INS, GROUP

    if form in BUILT_INS:
        return ""
    from importlib.metadata import entry_points

    for point in entry_points(group=GROUP):
        if point.name == form:
            return f"{point.value} {point.dist.name} {point.dist.version}" if point.dist else point.value
    return ""


# --- files -----------------------------------------------------------------------------------


class Contents:
    """The files of a project as they are now, each read once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._prefix = os.path.join(folder, "")  # noqa: PTH118 - thousands of paths are made of it
        self._digests: dict[str, str | None] = {}

    def read(self, path: str) -> bytes:
        """The content of a file. Raises ``OSError``."""
        with open(self._prefix + path, "rb") as stream:  # noqa: PTH123 - the same
            data = stream.read()
        self._digests[path] = digest(data)
        return data

    def digest(self, path: str) -> str | None:
        """The digest of a file; None where it cannot be read."""
        if path not in self._digests:
            try:
                self.read(path)
            except (OSError, ValueError):
                self._digests[path] = None
        return self._digests[path]

    def wrote(self, path: str, data: bytes) -> str:
        """Take note that a file has a new content; its digest."""
        self._digests[path] = digest(data)
        return digest(data)

    def fresh(self, step: Step) -> bool:
        """Are the files of a step as they were when it was done?"""
        return all(
            self.digest(path) == known
            for files in (step.inputs, step.outputs)
            for path, known in files.items()
        )


# --- on disk ---------------------------------------------------------------------------------


def load_state(folder: Path) -> State:
    """The state of a project; an empty one where there is none, or none that this version reads."""
    try:
        data = json.loads((folder / FOLDER / "state.json").read_bytes())
        if data["format"] != _FORMAT or data["version"] != _VERSION:
            return State()
        return State(
            {str(name): str(text) for name, text in data["versions"].items()},
            str(data["manifest"]),
            {
                str(name): {str(step): _step(value) for step, value in steps.items()}
                for name, steps in data["trees"].items()
            },
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return State()


def _step(value: Any) -> Step:
    settings, inputs, outputs = value
    for files in (inputs, outputs):
        if not all(len(each) == _DIGEST for each in files.values()):
            raise ValueError("no digest")
    return Step(settings, inputs, outputs)


def save_state(folder: Path, state: State) -> None:
    """Write the state. A project whose folder cannot be written keeps none."""
    value = {
        "format": _FORMAT,
        "version": _VERSION,
        "versions": dict(state.versions),
        "manifest": state.manifest,
        "trees": {
            name: {
                step: [done.settings, dict(done.inputs), dict(done.outputs)] for step, done in steps.items()
            }
            for name, steps in state.trees.items()
        },
    }
    with contextlib.suppress(BbtcError):
        write(str(folder / FOLDER / "state.json"), json.dumps(value), scratch=scratch_folder(folder))


def scratch_folder(folder: Path) -> str:
    """Where files are written before they are renamed to their places."""
    return str(folder / FOLDER / "scratch")


@contextlib.contextmanager
def sole_builder(folder: Path) -> Iterator[None]:
    """Hold the project for one build: another one waits. What a killed build left is cleared away.

    Raises :class:`BbtcError` if the folder cannot be written."""
    own = folder / FOLDER
    try:
        (own / "scratch").mkdir(parents=True, exist_ok=True)
        ignore = own / ".gitignore"
        if not ignore.exists():
            ignore.write_text("*\n")
        lock = (own / "lock").open("wb")
    except OSError as error:
        raise BbtcError.single("BBT0004", f"cannot write {own}: {error.strerror}") from error
    with lock:
        try:
            import fcntl
        except ImportError:  # no such locks on this system
            pass
        else:
            with contextlib.suppress(OSError):
                fcntl.flock(lock, fcntl.LOCK_EX)
        for left in (own / "scratch").iterdir():
            with contextlib.suppress(OSError):
                left.unlink()
        yield
