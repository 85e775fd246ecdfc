"""Files that are no text of the language, and the oddities of those that are."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

import pytest

from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.files.sources import read_source


def _refused(path: str, max_bytes: int = 1000) -> Diagnostic:
    with pytest.raises(BbtcError) as caught:
        read_source(path, max_bytes)
    [diagnostic] = caught.value.diagnostics
    return diagnostic


def _file(folder: Path, data: bytes) -> str:
    path = folder / "file.pddl"
    path.write_bytes(data)
    return str(path)


def test_missing_file_and_directory(tmp_path: Path) -> None:
    missing = _refused(str(tmp_path / "none.pddl"))
    assert missing.code == "BBT0001"
    assert "no such file" in missing.message
    directory = _refused(str(tmp_path))
    assert directory.code == "BBT0001"
    assert "directory" in directory.message
    assert _refused("a\0b").code == "BBT0001"


@pytest.mark.parametrize("data", [b"(define\0)", b"\x7fELF\x02\x01\x01\0\0", "(define)".encode("utf-16")])
def test_binary_files(tmp_path: Path, data: bytes) -> None:
    assert _refused(_file(tmp_path, data)).code == "BBT0002"


def test_text_in_another_encoding_is_refused_at_its_place(tmp_path: Path) -> None:
    found = _refused(_file(tmp_path, "; naïve\r\n(define (domain café))".encode("latin-1")))
    assert found.code == "BBT0002"
    assert found.span is not None
    assert found.span.source.position(found.span.start) == (2, 20)


@pytest.mark.parametrize("data", [b"", b" \n\t\r\n", b"\xef\xbb\xbf"])
def test_empty_files(tmp_path: Path, data: bytes) -> None:
    assert _refused(_file(tmp_path, data)).code == "BBT0003"


def test_large_files_and_devices(tmp_path: Path) -> None:
    assert _refused(_file(tmp_path, b"(" * 1001)).code == "BBT0005"
    assert read_source(_file(tmp_path, b"(" * 1000), 1000).text == "(" * 1000
    if os.path.exists("/dev/zero"):  # noqa: PTH110
        assert _refused("/dev/zero").code == "BBT0001"


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"\xef\xbb\xbf(define)\n", "(define)\n"),
        (b"(define\r\n(domain d)\r)\r\n", "(define\n(domain d)\n)\n"),
        ("; Übung\n()".encode(), "; Übung\n()"),
        ("; Übung\n()".encode("latin-1"), "; Übung\n()"),
    ],
)
def test_text_is_normalised(tmp_path: Path, data: bytes, text: str) -> None:
    path = _file(tmp_path, data)
    source = read_source(path)
    assert (source.name, source.text) == (path, text)


def test_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"(define)")))
    source = read_source("-")
    assert (source.name, source.text) == ("<stdin>", "(define)")
