"""Reading and writing files: regular ones, whole or not at all; unchanged ones untouched; drift shown."""

from __future__ import annotations

import errno
import os
import stat
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import BinaryIO

from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.files.folder import Batch, Folder, what_it_is
from bbtc.printable import printable

KEPT = frozenset((".git", ".bbtc"))
"""Folders that nothing is written to: they belong to git and to ``bbtc build``."""

_PIECE = 1 << 20  # bytes
_MOST_COMPARED = 4000  # lines that differ; beyond, finding out how takes too long

# --- reading ---------------------------------------------------------------------------------


def read_file(path: str | os.PathLike[str], most: int, *, descriptors: bool = False) -> bytes:
    """The content of a regular file, as far as it goes to ``most`` bytes. Raises ``OSError``, whose
    ``strerror`` says why: also for a named pipe and a device, which could keep a reader waiting for ever.
    ``descriptors`` allows for those under ``/dev/fd``, which the process was given (``<(…)`` in a shell)."""
    flags = os.O_RDONLY | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    opened = os.open(path, flags | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0))
    with os.fdopen(opened, "rb") as stream:
        mode = os.fstat(opened).st_mode
        if not stat.S_ISREG(mode):
            if not (descriptors and _was_given(os.fspath(path))):
                raise OSError(errno.EINVAL, what_it_is(mode))
            os.set_blocking(opened, True)
        return read_stream(stream, most)


def read_stream(stream: BinaryIO, most: int) -> bytes:
    """What a stream gives, as far as it goes to ``most`` bytes, without room for all of them beforehand."""
    parts: list[bytes] = []
    while most > 0 and (part := stream.read(min(most, _PIECE))):
        parts.append(part)
        most -= len(part)
    return b"".join(parts)


def _was_given(path: str) -> bool:
    """Does a path name a descriptor of this process?"""
    if path == "/dev/stdin":
        return True
    own = {os.path.realpath(folder) for folder in ("/dev/fd", "/proc/self/fd")}
    return os.path.realpath(os.path.dirname(path)) in own


def reason(error: OSError | ValueError) -> str:
    """Why the system refuses something, in words."""
    if isinstance(error, IsADirectoryError):
        return "it is a directory"
    if isinstance(error, FileNotFoundError):
        return "there is no such file"
    if isinstance(error, PermissionError):
        return "permission denied" if error.errno == errno.EACCES else os.strerror(error.errno or 0)
    return getattr(error, "strerror", None) or str(error)


_TROUBLE = frozenset((errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG, errno.EROFS))


def system_trouble(error: BaseException) -> str | None:
    """Why the system could not write, where that is what an exception is about: nobody's bug."""
    if isinstance(error, OSError) and error.errno in _TROUBLE:
        return f"{error.strerror}: {error.filename}" if error.filename else error.strerror
    return None


# --- where to write --------------------------------------------------------------------------


def require_writable(path: str, *, folder: bool = False) -> None:
    """Raise :class:`BbtcError` now where it is plain that :class:`Outputs` could not write to ``path`` (with
    ``folder``: files below it): before long work, whose result would be lost."""
    if path == "-":
        return
    try:
        there = stat.S_ISDIR(os.stat(path).st_mode)  # may be too long for a name
    except FileNotFoundError:
        there = None
    except OSError as error:
        raise cannot_write(path, reason(error)) from None
    target = os.path.realpath(path)
    if folder:
        _refuse(path, there is False, "it is not a directory")
        while not os.path.exists(target):  # what is missing is made
            target = os.path.dirname(target)
        _refuse(path, not os.path.isdir(target), f"{target} is not a directory")
    else:
        _refuse(path, there is True, "it is a directory")
        if there is not None:
            return  # it may have the wanted content already
        target = os.path.dirname(target)
        shown = os.path.dirname(path) or "."
        _refuse(path, not os.path.isdir(target), f"there is no folder {shown}")
    _refuse(path, not os.access(target, os.W_OK | os.X_OK), "permission denied")


def require_apart(outputs: Iterable[str], inputs: Iterable[str]) -> None:
    """Raise :class:`BbtcError` where an output is the file of an input or of another output, by whatever
    name, or belongs to git or to ``bbtc build``."""
    inputs = [name for name in inputs if name != "-"]
    known = SameFiles()
    for name in inputs:
        known.note(name, name)
    for output in outputs:
        if any(part.casefold() in KEPT for part in output.replace(os.sep, "/").split("/")):
            kept = " or ".join(sorted(KEPT))
            raise BbtcError.single("BBT0009", f"cannot write {output}: nothing is written into {kept}")
        other = known.find(output)
        if other is not None:
            what = "the input" if other in inputs else "the output"
            message = f"cannot write {output}: it is {what}" + (f" {other}" if other != output else "")
            raise BbtcError.single("BBT0009", message, hint="name another file")
        known.note(output, output)


class SameFiles:
    """Knows paths by the files that they are, or would be. Devices and pipes are nobody's."""

    def __init__(self) -> None:
        self._names: dict[object, str] = {}

    def note(self, path: str, name: str) -> None:
        """Keep the name of a path, unless its file has one."""
        self._names.setdefault(_identity(path), name)

    def find(self, path: str) -> str | None:
        """The name that was kept for the file of a path."""
        return self._names.get(_identity(path))


def _identity(path: str) -> object:
    if path == "-":
        return path
    try:
        status = os.stat(path)
    except OSError:
        real = os.path.realpath(path)
        return real.casefold() if ignores_case(os.path.dirname(real)) else real
    known = stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)
    return (status.st_dev, status.st_ino) if known else object()


def ignores_case(path: str) -> bool:
    """Is the file or folder of this path found by its name in other letters, too?"""
    folder, name = os.path.split(path)
    try:
        return name.swapcase() != name and os.path.samefile(path, os.path.join(folder, name.swapcase()))
    except OSError:
        return False


def cannot_write(path: str, why: str) -> BbtcError:
    """The error for a place that cannot be written to."""
    return BbtcError.single("BBT0004", f"cannot write {path}: {why}")


def _refuse(path: str, wrong: bool, why: str) -> None:
    if wrong:
        raise cannot_write(path, why)


# --- writing ---------------------------------------------------------------------------------


def write(path: str, content: str | bytes, *, check: bool = False) -> bool:
    """Write an artefact to ``path`` (``-``: stdout); whether anything was written. See :class:`Outputs`."""
    outputs = Outputs(check)
    outputs.add(path, content)
    return bool(outputs.write())


@dataclass(frozen=True, slots=True)
class _Output:
    """What is to be written: to a path, or below a folder."""

    path: str
    data: bytes
    folder: str | None = None
    parts: tuple[str, ...] = ()


@dataclass(slots=True)
class Outputs:
    """Artefacts that are written together: all of them, or none.

    A file is written beside its place and renamed; it is left untouched if it has the content already. A
    symbolic link that is named is followed. A device or a pipe is written to as it is, and so is stdout
    (``-``). With ``check`` nothing is written, and a difference raises :class:`BbtcError` with a diff.
    """

    check: bool = False
    _outputs: list[_Output] = field(default_factory=list)

    @property
    def paths(self) -> list[str]:
        """Where the artefacts go."""
        return [output.path for output in self._outputs]

    def add(self, path: str, content: str | bytes) -> None:
        """An artefact for a file."""
        self._outputs.append(_Output(path, content.encode() if isinstance(content, str) else content))

    def add_files(self, directory: str, texts: Mapping[str, str]) -> None:
        """Artefacts for files, named by relative paths with ``/``, below a directory, which is made where it
        is missing; other files in it stay. Below it no link is followed."""
        for name, text in texts.items():
            parts = relative_parts(name)
            path = os.path.join(directory, *parts)
            self._outputs.append(_Output(path, text.encode(), directory, parts))

    def write(self) -> list[str]:
        """Write what differs; the paths of what was written. Raises :class:`BbtcError` where something cannot
        be written, and then nothing was, as far as the system allows (not if a pipe took it already)."""
        changed = [output for output in self._outputs if self._differs(output)]
        if self.check:
            return []
        poured = [output for output in changed if _is_poured(output)]
        with Batch() as batch:
            roots: dict[str, Folder] = {}
            for output in changed:
                if output not in poured:
                    try:
                        _put(batch, roots, output)
                    except OSError as error:
                        raise cannot_write(output.path, reason(error)) from error
            for output in poured:
                _pour(output.path, output.data)
            try:
                batch.commit()
            except OSError as error:
                named = ", ".join(output.path for output in changed if output not in poured)
                raise cannot_write(named, reason(error)) from error
        return [output.path for output in changed]

    def _differs(self, output: _Output) -> bool:
        if _is_poured(output):
            return not self.check
        most = sys.maxsize if self.check else len(output.data) + 1
        try:
            old = read_file(output.path, most)
        except FileNotFoundError:
            old = None
        except IsADirectoryError:
            raise cannot_write(output.path, "it is a directory") from None
        except OSError as error:
            raise cannot_write(output.path, reason(error)) from error
        if old != output.data and self.check:
            raise drift(output.path, old, output.data)
        return old != output.data


def write_files(directory: str, texts: Mapping[str, str], *, check: bool = False) -> None:
    """Write files below a directory: see :meth:`Outputs.add_files`."""
    outputs = Outputs(check)
    outputs.add_files(directory, texts)
    outputs.write()


def relative_parts(name: str) -> tuple[str, ...]:
    """The parts of a relative path with ``/``. Raises ``ValueError`` for one that leads out of its folder."""
    parts = tuple(name.split("/"))
    if any(part in {"", ".", ".."} or "\0" in part or part != os.path.basename(part) for part in parts):
        raise ValueError(f"'{printable(name)}' is no path below a folder")
    return parts


def _is_poured(output: _Output) -> bool:
    """Is it something that must not be renamed over, and need not give back what it was given?"""
    if output.path == "-":
        return True
    if output.folder is not None:
        return False
    try:
        mode = os.stat(output.path).st_mode
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def _pour(path: str, data: bytes) -> None:
    shown = "the standard output" if path == "-" else path
    try:
        if path == "-":
            if sys.stdout is None:
                raise cannot_write(shown, "it is closed")
            sys.stdout.flush()
            _pour_into(sys.stdout.buffer, data)
        else:
            with open(path, "wb") as stream:
                _pour_into(stream, data)
    except BrokenPipeError:
        if path == "-":
            raise
        raise cannot_write(shown, "its reader has gone") from None
    except OSError as error:
        raise cannot_write(shown, reason(error)) from error


def _pour_into(stream: BinaryIO, data: bytes) -> None:
    stream.write(data)
    stream.flush()


def _put(batch: Batch, roots: dict[str, Folder], output: _Output) -> None:
    if output.folder is None:
        target = os.path.realpath(output.path)  # through a symbolic link, not over it
        folder, name = os.path.split(target)
        batch.put(batch.open(folder), name, output.data)
        return
    if output.folder not in roots:
        there = os.path.realpath(output.folder)
        missing: list[str] = []
        while not os.path.lexists(there):
            there, name = os.path.split(there)
            missing.insert(0, name)
        roots[output.folder] = batch.below(batch.open(there), tuple(missing))
    folder_of_it = batch.below(roots[output.folder], output.parts[:-1])
    batch.put(folder_of_it, output.parts[-1], output.data)


# --- differences -----------------------------------------------------------------------------


def drift(path: str, old: bytes | None, new: bytes) -> BbtcError:
    """The error that shows how a file (None: there is none) differs from what would be written."""
    hint = "run the same command without --check"
    if old is None:
        return BbtcError.single("BBT0008", f"{path} does not exist", hint=hint)
    lines: tuple[str, ...] = ()
    message = f"{path} differs from what would be written"
    try:
        how, lines = _difference(path, old.decode(), new.decode())
    except UnicodeDecodeError:
        how = ""
    return BbtcError([Diagnostic("BBT0008", message + how, hint=hint, lines=lines)])


def _difference(path: str, old: str, new: str) -> tuple[str, tuple[str, ...]]:
    """How a text differs: the rest of the sentence, and a diff."""
    before, after = old.split("\n"), new.split("\n")
    bare, wanted = [line.removesuffix("\r") for line in before], [line.removesuffix("\r") for line in after]
    if bare == wanted:
        return " in its line ends only (CRLF or LF)", ()
    if bare[0].startswith("\ufeff") and [bare[0][1:], *bare[1:]] == wanted:
        return " by a byte order mark at its start", ()
    if bare == [*wanted, ""] or wanted == [*bare, ""]:
        return " in the line end at its end", ()
    pairs = zip([*bare, None], [*wanted, None], strict=False)
    first = next(number for number, (one, other) in enumerate(pairs) if one != other)
    if max(len(bare), len(wanted)) - first > _MOST_COMPARED:
        return f", first in line {first + 1}", ()
    if bare[-1] == wanted[-1] == "":  # both end with a line end: no empty line follows it
        bare, wanted = bare[:-1], wanted[:-1]
    import difflib

    shown = printable(path)
    diff = difflib.unified_diff(bare, wanted, shown, f"{shown} (as it would be)", lineterm="")
    return ":", tuple(diff)
