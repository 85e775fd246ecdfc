"""What the last build did: for every step of every tree, what it was made from and what it made.

The state stands in ``.bbtc/`` beside the manifest, which is nobody's source: it can be deleted at any time,
and everything is built again. A step is up to date if the digest of its settings, the contents of its
inputs and those of its outputs are all what they were.

A state counts only in the folder that it was written in: it names the lock beside it by what the system gave
that file when it was made. One that came along with a stranger's project is none, nor is one that was edited.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bbtc.diagnostics import BbtcError
from bbtc.files.folder import LINK, Batch, Folder, leftovers
from bbtc.files.read_write import read_file, reason
from bbtc.limits import Limits
from bbtc.manifest.find import source_name
from bbtc.source import Span
from bbtc.version import __version__

FOLDER = ".bbtc"
_FORMAT = "bbtc-build"
_VERSION = 1
_DIGEST = 64  # characters
_LOCK = "lock"
_STATE = "state.json"
_MOST_BYTES = 1 << 30
"""Largest file that is looked at: a state, or an artefact that was made before."""


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
    from bbtc.backends.registry import BUILT_INS, GROUP

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

    def read(self, path: str, most: int = _MOST_BYTES) -> bytes:
        """The content of a file. Raises ``OSError``, also where it has more bytes than ``most``."""
        whole = path if os.path.isabs(path) else self._prefix + path  # noqa: PTH117 - as above
        data = read_file(whole, most + 1)
        if len(data) > most:
            raise OSError(errno.EFBIG, f"it is larger than {most >> 20} MiB")
        self._digests[path] = digest(data)
        return data

    def source(self, path: str) -> bytes:
        """The content of a file that something is made from. Raises ``OSError``."""
        return self.read(path, Limits().file_bytes)

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
    """The state of a project; an empty one where there is none, or none that this version wrote here."""
    try:
        data = json.loads(read_file(folder / FOLDER / _STATE, _MOST_BYTES))
        seal = data.pop("seal")
        if (
            data["format"] != _FORMAT
            or data["version"] != _VERSION
            or data["lock"] != _lock_id(folder)
            or seal != settings_digest(data)
        ):
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


def _lock_id(folder: Path) -> list[int]:
    """What the system gave the lock, and gives no copy of it: its number, and the time of its making (no
    time of a file that a user can set). Raises ``OSError``."""
    status = (folder / FOLDER / _LOCK).lstat()
    return [status.st_ino, status.st_ctime_ns]


def _step(value: Any) -> Step:
    settings, inputs, outputs = value
    for files in (inputs, outputs):
        if not all(len(each) == _DIGEST for each in files.values()):
            raise ValueError("no digest")
    return Step(settings, inputs, outputs)


# --- the folder of a project, held for one build ---------------------------------------------


@dataclass(frozen=True, slots=True)
class Held:
    """The folder of a project, its ``.bbtc``, and where files are written aside, all held open."""

    path: Path
    project: Folder
    own: Folder
    scratch: Folder

    def save(self, state: State) -> None:
        """Write the state. A project that it cannot be written in keeps the one it has."""
        value = {
            "format": _FORMAT,
            "version": _VERSION,
            "lock": _lock_id(self.path),
            "versions": dict(state.versions),
            "manifest": state.manifest,
            "trees": {
                name: {
                    step: [done.settings, dict(done.inputs), dict(done.outputs)]
                    for step, done in steps.items()
                }
                for name, steps in state.trees.items()
            },
        }
        value["seal"] = settings_digest(value)
        with contextlib.suppress(OSError), Batch(self.scratch) as batch:
            batch.put(self.own, _STATE, json.dumps(value).encode())
            batch.commit()


@contextlib.contextmanager
def sole_builder(folder: Path) -> Iterator[Held]:
    """Hold the project for one build: another one waits. What a killed build left is cleared away. Below the
    folder no link is followed.

    Raises :class:`BbtcError` if the folder cannot be written, or a link is in the way."""
    with contextlib.ExitStack() as stack:
        at = FOLDER
        try:
            shown = source_name(folder, "")
            project = stack.enter_context(Folder("" if shown == "." else shown))
            own = stack.enter_context(project.sub(FOLDER, make=True))
            at = f"{FOLDER}/scratch"
            scratch = stack.enter_context(own.sub("scratch", make=True))
            at = f"{FOLDER}/{_STATE}"
            own.require_place((_STATE,))
            at = f"{FOLDER}/{_LOCK}"
            lock = own.open(_LOCK, os.O_RDWR | os.O_CREAT)
        except OSError as error:
            raise cannot_build(source_name(folder, at), error) from error
        stack.callback(os.close, lock)
        try:
            import fcntl
        except ImportError:  # no such locks on this system
            pass
        else:
            with contextlib.suppress(OSError):
                fcntl.flock(lock, fcntl.LOCK_EX)
        for left in leftovers(scratch):
            with contextlib.suppress(OSError):
                scratch.remove(left)
        try:
            _ignore_itself(own, scratch)  # not before: another build would clear away what is written aside
        except OSError as error:
            raise cannot_build(source_name(folder, f"{FOLDER}/.gitignore"), error) from error
        yield Held(folder, project, own, scratch)


def _ignore_itself(own: Folder, scratch: Folder) -> None:
    if own.status(".gitignore") is None:
        with Batch(scratch) as batch:
            batch.put(own, ".gitignore", b"*\n")
            batch.commit()


def cannot_build(path: str, error: OSError, span: Span | None = None) -> BbtcError:
    """The error for a file or folder of a project that cannot be written to."""
    if error.strerror != LINK:
        return BbtcError.single("BBT0004", f"cannot write {path}: {reason(error)}", span)
    hint = "a build writes through no link: put a file or folder in its place, or name another one"
    at = f": {error.filename}" if error.filename and error.filename != path else ""
    return BbtcError.single("BBT1008", f"cannot write {path}: {LINK}{at}", span, hint)
