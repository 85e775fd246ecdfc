"""Writing: whole files or nothing, unchanged files untouched, drift shown, Make dependencies."""

from __future__ import annotations

import contextlib
import difflib
import os
import stat
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from bbtc.diagnostics import BbtcError


def write(path: str, content: str | bytes, *, check: bool = False, scratch: str | None = None) -> bool:
    """Write an artefact to ``path`` (``-``: stdout); whether anything was written.

    A file is written beside its place, or in the folder ``scratch`` if that is on the same file system,
    and renamed; it is left untouched if it has the content already. A device or a pipe is written to as
    it is. With ``check`` nothing is written, and a difference raises :class:`BbtcError` with a diff.
    Raises :class:`BbtcError` if the file cannot be written.
    """
    data = content.encode() if isinstance(content, str) else content
    if path == "-":
        if not check:
            sys.stdout.flush()
            sys.stdout.buffer.write(data)
            sys.stdout.buffer.flush()
        return not check
    if _is_special(path):
        return not check and _pour(path, data)
    try:
        old = Path(path).read_bytes()
    except FileNotFoundError:
        old = None
    except IsADirectoryError:
        raise BbtcError.single("BBT0004", f"cannot write {path}: it is a directory") from None
    except OSError as error:
        raise BbtcError.single("BBT0004", f"cannot read {path}: {error.strerror}") from error
    if old == data:
        return False
    if check:
        raise drift(path, old, data)
    _replace(path, data, scratch)
    return True


def require_writable(path: str, *, folder: bool = False) -> None:
    """Raise :class:`BbtcError` now where it is plain that :func:`write` (with ``folder``
    :func:`write_files`) could not write to ``path``: before long work, whose result would be lost."""
    if path == "-":
        return
    target = Path(os.path.realpath(path))
    if folder:
        _refuse(path, target.exists() and not target.is_dir(), "it is not a directory")
        while not target.exists():  # what is missing is made
            target = target.parent
    else:
        _refuse(path, target.is_dir(), "it is a directory")
        if target.exists():
            return  # it may have the wanted content already
        target = target.parent
        _refuse(path, not target.is_dir(), f"there is no folder {Path(path).parent}")
    _refuse(path, not os.access(target, os.W_OK | os.X_OK), "permission denied")


def _refuse(path: str, wrong: bool, why: str) -> None:
    if wrong:
        raise BbtcError.single("BBT0004", f"cannot write {path}: {why}")


def _is_special(path: str) -> bool:
    """Is it something that must not be renamed over, and need not give back what it was given?"""
    try:
        mode = Path(path).stat().st_mode
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def _pour(path: str, data: bytes) -> bool:
    try:
        with Path(path).open("wb") as stream:
            stream.write(data)
    except OSError as error:
        raise BbtcError.single("BBT0004", f"cannot write {path}: {error.strerror}") from error
    return True


def write_files(directory: str, texts: Mapping[str, str], *, check: bool = False) -> None:
    """Write files, named by relative paths with ``/``, below a directory, which is made where it is
    missing; other files in it stay. With ``check`` nothing is written, and the first difference
    raises. Raises :class:`BbtcError` as :func:`write` does, and where ``directory`` is not one."""
    root = Path(directory)
    _refuse(directory, root.exists() and not root.is_dir(), "it is not a directory")
    for name, text in texts.items():
        target = root.joinpath(*name.split("/"))
        if not check:
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise BbtcError.single("BBT0004", f"cannot write {target}: {error.strerror}") from error
        write(str(target), text, check=check)


def drift(path: str, old: bytes | None, new: bytes) -> BbtcError:
    """The error that shows how a file (None: there is none) differs from what would be written."""
    return BbtcError.single("BBT0008", _diff(path, old, new), hint="run the same command without --check")


def _replace(path: str, data: bytes, scratch: str | None) -> None:
    target = Path(os.path.realpath(path))  # through a symbolic link, not over it
    temporary = None
    try:
        folder = target.parent
        if scratch is not None and Path(scratch).stat().st_dev == folder.stat().st_dev:
            folder = Path(scratch)
        handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", dir=folder)
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        mode = target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~_umask()
        Path(temporary).chmod(mode)
        Path(temporary).replace(target)
    except OSError as error:
        raise BbtcError.single("BBT0004", f"cannot write {path}: {error.strerror}") from error
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                Path(temporary).unlink()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _diff(path: str, old: bytes | None, new: bytes) -> str:
    if old is None:
        return f"{path} does not exist"
    try:
        before, after = old.decode().splitlines(), new.decode().splitlines()
    except UnicodeDecodeError:
        return f"{path} differs from what would be written"
    diff = "\n".join(difflib.unified_diff(before, after, path, f"{path} (as it would be)", lineterm=""))
    return f"{path} differs from what would be written:\n{diff}"


def write_depfile(path: str, target: str, inputs: Iterable[str]) -> None:
    """A Make rule that lets ``target`` depend on every input file."""
    names = " ".join(_make_name(name) for name in inputs if name != "-")
    write(path, f"{_make_name(target)}: {names}\n")


def _make_name(name: str) -> str:
    return name.replace("\\", "\\\\").replace(" ", "\\ ").replace("#", "\\#").replace("$", "$$")
