"""Where the artefacts of a project go: each into a place of its own, and none into that of a source."""

from __future__ import annotations

import os
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from bbtc.artefacts.cursor import At
from bbtc.backends.begun import BESIDE
from bbtc.diagnostics import Diagnostic
from bbtc.files.read_write import KEPT, ignores_case
from bbtc.manifest.find import TOML_NAME, YAML_NAME


@dataclass(frozen=True, slots=True)
class _Claim:
    """A file, or a folder of files, that is made for somebody; ``at`` is where the manifest says so."""

    at: At
    file: str
    owner: str
    folder: bool


@dataclass(slots=True)
class Places:
    """The files that the manifest ``file`` names, as they are met."""

    file: Path
    _claims: list[_Claim] = field(default_factory=list)
    _sources: list[str] = field(default_factory=list)

    def read(self, path: str) -> None:
        """A file that something is made from."""
        self._sources.append(path)

    def claim(self, at: At, file: str, owner: str, *, folder: bool = False) -> None:
        """A file, or a folder of files, that is made."""
        self._claims.append(_Claim(at, file, owner, folder))

    def faults(self) -> Iterator[Diagnostic]:
        """Every place that is not its maker's alone."""
        fold = ignores_case(str(self.file))
        owners: dict[tuple[str, ...], _Claim] = {}
        sources = {_parts(name, fold): name for name in (YAML_NAME, TOML_NAME, self.file.name)}
        for path in self._sources:
            inside = os.path.relpath(self.file.parent / path, self.file.parent)
            sources.setdefault(_parts(inside.replace(os.sep, "/"), fold), path)
        around = {parts[:length]: name for parts, name in sources.items() for length in range(1, len(parts))}
        for claim in self._claims:
            parts = _parts(claim.file, fold)
            if KEPT & {part.casefold() for part in parts}:
                kept = " or ".join(sorted(KEPT))
                yield claim.at.found("BBT1009", f"{claim.file}: nothing is made in {kept}")
            elif parts in sources:
                yield claim.at.found("BBT1009", f"{claim.file} is a source of the project")
            elif parts in around:
                what = "is a folder of" if claim.folder else "is the folder of"
                yield claim.at.found("BBT1009", f"{claim.file} {what} the source {around[parts]}")
            other = owners.setdefault(parts, claim)
            if other is not claim:
                owners_of_it = f"'{other.owner}' and for '{claim.owner}'"
                yield _twice(claim, f"{claim.file} is made twice: for {owners_of_it}")
        for parts, claim in owners.items():
            # Beside a file that people fill in, its name with this ending is for how it would begin now.
            beside = owners.get((*parts[:-1], parts[-1] + BESIDE))
            if beside is not None:
                yield _twice(
                    beside, f"{beside.file} and {claim.file}, for '{claim.owner}', differ by {BESIDE} only"
                )
            for length in range(1, len(parts)):
                outer = owners.get(parts[:length])
                if outer is not None:
                    what = "folder" if outer.folder else "file"
                    yield _twice(claim, f"{claim.file} is inside the {what} that is made for '{outer.owner}'")


def _twice(claim: _Claim, message: str) -> Diagnostic:
    return claim.at.found("BBT1003", message)


def _parts(path: str, fold: bool) -> tuple[str, ...]:
    return tuple((unicodedata.normalize("NFC", path).casefold() if fold else path).split("/"))
