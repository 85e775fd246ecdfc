"""Folders held open, in which files are made: what stands below them cannot be led astray by links.

A folder is a descriptor where the system works relative to one (``openat`` and its like): what is done in it
is done in that very folder, whatever becomes of its path in the meantime. Elsewhere it is a path, whose parts
are looked at before they are used. Below it no symbolic link is followed, neither to the outside nor to the
inside: it is an error.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field

_NO_FOLLOW: int = getattr(os, "O_NOFOLLOW", 0)
_DIRECTORY: int = getattr(os, "O_DIRECTORY", 0)
_COMMON: int = getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOINHERIT", 0)
_NO_WAITING: int = getattr(os, "O_NONBLOCK", 0)  # a named pipe must not wait for somebody
_RELATIVE = (os.open, os.mkdir, os.rename, os.stat, os.unlink, os.rmdir, os.link, os.access)

BY_DESCRIPTOR = bool(_NO_FOLLOW and _DIRECTORY) and {*_RELATIVE} <= os.supports_dir_fd
"""Does this system work relative to descriptors?"""

TEMPORARY = ".bbtc-tmp-"
"""How the names of files begin that are written aside."""

LINK = "a symbolic link is in the way"


class Folder:
    """An open folder. ``path`` is for messages. Everything raises ``OSError``."""

    def __init__(self, path: str, descriptor: int | None = None) -> None:
        """A folder by its path, links followed: it is where somebody who may say so says."""
        self.path = path
        self._descriptor = descriptor
        if descriptor is None and BY_DESCRIPTOR:
            self._descriptor = os.open(path or ".", os.O_RDONLY | _DIRECTORY | _COMMON)

    def __enter__(self) -> Folder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of it."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def where(self, name: str) -> tuple[str, int | None]:
        """A name as the functions of :mod:`os` want it: with the descriptor it is relative to, if any."""
        return (name if self._descriptor is not None else self.shown(name)), self._descriptor

    def shown(self, name: str) -> str:
        """The path of something in it."""
        return os.path.join(self.path, name)  # a name for messages, left as it is

    # --- looking -----------------------------------------------------------------------------

    def status(self, name: str) -> os.stat_result | None:
        """What stands under a name, a link as itself; None where nothing does."""
        path, relative = self.where(name)
        try:
            return os.stat(path, dir_fd=relative, follow_symlinks=False)
        except FileNotFoundError:
            return None

    def names(self) -> list[str]:
        """Everything in it."""
        return sorted(os.listdir(self.path or "." if self._descriptor is None else self._descriptor))

    def device(self) -> int:
        """The file system it is on."""
        if self._descriptor is not None:
            return os.fstat(self._descriptor).st_dev
        return os.stat(self.path or ".").st_dev

    def open(self, name: str, flags: int) -> int:
        """Open a regular file, and nothing else."""
        path, relative = self.where(name)
        self._refuse_link(name)
        try:
            opened = os.open(path, flags | _NO_FOLLOW | _COMMON | _NO_WAITING, 0o666, dir_fd=relative)
        except OSError as error:
            if error.errno in {errno.ELOOP, errno.EMLINK}:  # a link that was made just now
                raise OSError(errno.ELOOP, LINK, self.shown(name)) from None
            raise
        if not stat.S_ISREG(os.fstat(opened).st_mode):
            found = os.fstat(opened)
            os.close(opened)
            raise OSError(errno.EINVAL, what_it_is(found.st_mode))
        return opened

    def read(self, name: str, most: int) -> bytes:
        """The content of a regular file, as far as it goes to ``most`` bytes."""
        with os.fdopen(self.open(name, os.O_RDONLY), "rb") as stream:
            return stream.read(most)

    # --- changing ----------------------------------------------------------------------------

    def sub(self, name: str, *, make: bool = False) -> Folder:
        """A folder in it; with ``make`` it is made where it is missing."""
        path, relative = self.where(name)
        self._refuse_link(name)
        if make:
            with contextlib.suppress(FileExistsError):
                os.mkdir(path, dir_fd=relative)
        if relative is None:
            found = self.status(name)
            if found is not None and not stat.S_ISDIR(found.st_mode):
                raise NotADirectoryError(errno.ENOTDIR, "it is not a folder", path)
            os.stat(path)  # there is one
            return Folder(path)
        opened = os.open(path, os.O_RDONLY | _DIRECTORY | _NO_FOLLOW | _COMMON, dir_fd=relative)
        return Folder(self.shown(name), opened)

    def require_place(self, parts: tuple[str, ...], *, for_folder: bool = False) -> None:
        """Raise ``OSError`` now where it is plain that no file (``for_folder``: no folder) can be made at a
        path below: where something else stands there, or a link on the way."""
        with contextlib.ExitStack() as stack:
            folder = self
            for number, part in enumerate(parts, 1):
                folder._refuse_link(part)
                found = folder.status(part)
                if found is None:
                    return
                if number == len(parts) and not for_folder:
                    _require_file(found, folder.shown(part))
                else:
                    folder = stack.enter_context(folder.sub(part))

    def _refuse_link(self, name: str) -> None:
        found = self.status(name)
        if found is not None and _is_link(found):
            raise OSError(errno.ELOOP, LINK, self.shown(name))

    def rename(self, name: str, to: Folder, new: str) -> None:
        """Move a file, over one that is there."""
        (path, relative), (target, other) = self.where(name), to.where(new)
        if relative is None and other is None:
            os.replace(path, target)
        else:
            os.rename(path, target, src_dir_fd=relative, dst_dir_fd=other)

    def link(self, name: str, to: Folder, new: str) -> None:
        """A second name for a file, where there is nothing under that name yet."""
        (path, relative), (target, other) = self.where(name), to.where(new)
        os.link(path, target, src_dir_fd=relative, dst_dir_fd=other, follow_symlinks=False)

    def remove(self, name: str) -> None:
        """Remove a file, or a link as itself."""
        path, relative = self.where(name)
        os.unlink(path, dir_fd=relative)

    def remove_folder(self, name: str) -> None:
        """Remove a folder that is empty."""
        path, relative = self.where(name)
        os.rmdir(path, dir_fd=relative)

    def write_aside(self, data: bytes, mode: int | None) -> str:
        """Write a new file; its name. ``mode`` are its permissions, None: the usual ones. Where that fails,
        nothing is left."""
        name, opened = self._new_file()
        try:
            with os.fdopen(opened, "wb") as stream:
                stream.write(data)
                stream.flush()
                if mode is not None and hasattr(os, "fchmod"):
                    os.fchmod(stream.fileno(), mode)
        except BaseException:
            with contextlib.suppress(OSError):
                self.remove(name)
            raise
        return name

    def _new_file(self) -> tuple[str, int]:
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NO_FOLLOW | _COMMON
        while True:
            name = TEMPORARY + os.urandom(8).hex()
            path, relative = self.where(name)
            with contextlib.suppress(FileExistsError):
                return name, os.open(path, flags, 0o666, dir_fd=relative)


def _require_file(found: os.stat_result, shown: str) -> None:
    if _is_link(found):
        raise OSError(errno.ELOOP, LINK, shown)
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is a directory", shown)
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, what_it_is(found.st_mode), shown)


def what_it_is(mode: int) -> str:
    """What stands where a regular file should, by the mode that the system tells of it."""
    if stat.S_ISFIFO(mode):
        return "it is a named pipe, not a file"
    return "it is a device, not a file" if stat.S_ISCHR(mode) or stat.S_ISBLK(mode) else "it is not a file"


def _is_link(found: os.stat_result) -> bool:
    if sys.platform == "win32" and found.st_reparse_tag == stat.IO_REPARSE_TAG_MOUNT_POINT:
        return True  # a junction
    return stat.S_ISLNK(found.st_mode)


# --- several files at once -------------------------------------------------------------------


@dataclass(slots=True)
class _Aside:
    """A file that was written aside: where it is, and where it belongs. ``old`` is a second name, beside it,
    of what stood there."""

    folder: Folder
    name: str
    to: Folder
    new: str
    replaces: bool
    old: str | None = None


@dataclass(slots=True)
class Batch:
    """Files that are written together, all of them or none: each is written aside (in ``scratch``, or beside
    its place where that is on another file system), then all are renamed to their places. Used in a ``with``
    statement, at whose end what was not committed is gone, with every folder that was made for it."""

    scratch: Folder | None = None
    _aside: list[_Aside] = field(default_factory=list)
    _made: list[tuple[Folder, str]] = field(default_factory=list)
    _opened: list[Folder] = field(default_factory=list)

    def __enter__(self) -> Batch:
        return self

    def __exit__(self, *_: object) -> None:
        for each in self._aside:
            with contextlib.suppress(OSError):
                each.folder.remove(each.name)
        for folder, name in reversed(self._made):
            with contextlib.suppress(OSError):
                folder.remove_folder(name)
        for folder in reversed(self._opened):
            folder.close()

    def open(self, path: str) -> Folder:
        """A folder by its path, links followed, until the end."""
        self._opened.append(Folder(path))
        return self._opened[-1]

    def below(self, folder: Folder, parts: tuple[str, ...]) -> Folder:
        """A folder below another one, made where it is missing, no link followed."""
        for part in parts:
            missing = folder.status(part) is None
            inner = folder.sub(part, make=missing)
            self._opened.append(inner)
            if missing:
                self._made.append((folder, part))
            folder = inner
        return folder

    def put(self, folder: Folder, name: str, data: bytes) -> None:
        """Write a file aside that belongs into a folder under a name. What stands there must be a file that
        may be written to, or nothing."""
        found = folder.status(name)
        mode = None
        if found is not None:
            mode = stat.S_IMODE(found.st_mode) & 0o777
            _require_file(found, folder.shown(name))
            path, relative = folder.where(name)
            if not os.access(path, os.W_OK, dir_fd=relative):
                raise PermissionError(errno.EACCES, "permission denied")
        near = self.scratch
        if near is None or near.device() != folder.device():
            near = folder
        self._aside.append(_Aside(near, near.write_aside(data, mode), folder, name, found is not None))

    def commit(self) -> None:
        """Let every file take its place. Where one cannot, those that did give it back."""
        done: list[_Aside] = []
        try:
            for each in self._aside:
                self._keep(each)
                _take_place(each)
                done.append(each)
        except BaseException:
            for each in reversed(done):
                with contextlib.suppress(OSError):
                    if each.old is not None:
                        each.folder.rename(each.old, each.to, each.new)
                    elif not each.replaces:
                        each.to.remove(each.new)
            raise
        finally:
            for each in self._aside:
                if each.old is not None:
                    with contextlib.suppress(OSError):
                        each.folder.remove(each.old)
        self._aside.clear()
        self._made.clear()

    def _keep(self, each: _Aside) -> None:
        """Give what stands in the place of a file a second name, where there are several files."""
        if len(self._aside) > 1 and each.replaces:
            old = TEMPORARY + os.urandom(8).hex()
            with contextlib.suppress(OSError, NotImplementedError):  # not every file system can
                each.to.link(each.new, each.folder, old)
                each.old = old


def _take_place(each: _Aside) -> None:
    try:
        each.folder.rename(each.name, each.to, each.new)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        # The scratch folder turns out to be elsewhere.
        with os.fdopen(each.folder.open(each.name, os.O_RDONLY), "rb") as stream:
            data, mode = stream.read(), stat.S_IMODE(os.fstat(stream.fileno()).st_mode)
        beside = each.to.write_aside(data, mode)
        try:
            each.to.rename(beside, each.to, each.new)
        except OSError:
            each.to.remove(beside)
            raise
        each.folder.remove(each.name)


def leftovers(folder: Folder) -> Iterator[str]:
    """What was written aside in a folder and never took its place."""
    return (name for name in folder.names() if name.startswith(TEMPORARY))
