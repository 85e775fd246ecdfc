"""Reading source files: what cannot be text of the language is refused here."""

from __future__ import annotations

import errno
import re
import sys

from bbtc.diagnostics import BbtcError
from bbtc.files.read_write import read_file, read_stream, reason
from bbtc.source import SourceFile, Span

MAX_BYTES = 64 * 1024 * 1024
"""Largest file that is read unless the caller allows more."""

_COMMENT = re.compile(rb";[^\r\n]*")
_NOT_ASCII = re.compile(rb"[\x80-\xff]")
_UTF16 = (b"\xff\xfe", b"\xfe\xff")


def read_source(path: str, max_bytes: int = MAX_BYTES) -> SourceFile:
    """The text of a file, or of standard input for ``-``, with Unix line ends.

    Raises :class:`BbtcError` for a file that cannot be read, is larger than
    ``max_bytes``, is not text, or is empty.
    """
    name = "<stdin>" if path == "-" else path
    try:
        # Never more than the limit, whatever the size claims.
        if path == "-":
            data = _standard_input(max_bytes + 1)
        else:
            data = read_file(path, max_bytes + 1, descriptors=True)
    except (OSError, ValueError) as error:
        raise BbtcError.single("BBT0001", f"cannot read {name}: {reason(error)}") from error
    if len(data) > max_bytes:
        raise BbtcError.single("BBT0005", f"{name} is larger than {max_bytes // 2**20} MiB")
    return decode_source(name, data)


def _standard_input(most: int) -> bytes:
    if sys.stdin is None:
        raise OSError(errno.EBADF, "it is closed")
    return read_stream(sys.stdin.buffer, most)


def decode_source(name: str, data: bytes) -> SourceFile:
    """The text that bytes stand for. Raises :class:`BbtcError` if they are not text, or nothing."""
    if data.startswith(_UTF16):
        raise BbtcError.single("BBT0002", f"{name} is UTF-16", hint="save it as UTF-8")
    if b"\0" in data:
        raise BbtcError.single("BBT0002", f"{name} is a binary file")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # Old files hold comments in Latin-1; there, any byte will do.
        source = SourceFile(name, _lines(data.decode("latin-1")))
        outside = _NOT_ASCII.search(_COMMENT.sub(lambda match: b" " * len(match.group()), data))
        if outside is not None:
            start = len(_lines(data[: outside.start()].decode("latin-1")))
            raise BbtcError.single(
                "BBT0002", f"{name} is not UTF-8 text", Span(source, start, start + 1), "save it as UTF-8"
            ) from error
        return source
    if not text.strip():
        raise BbtcError.single("BBT0003", f"{name} is empty")
    return SourceFile(name, _lines(text))


def _lines(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")
