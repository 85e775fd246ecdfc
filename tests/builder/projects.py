"""Small projects for the tests of building."""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path

TEMPLATE = Path(__file__).parents[2] / "bbtc" / "builder" / "template"
REPOSITORY = Path(__file__).parents[2]

COIN = """(define (domain coin)
  (:requirements :strips :probabilistic-effects)
  (:predicates (heads))
  (:action throw :effect (probabilistic 1/2 (heads))))
(define (problem once) (:domain coin) (:goal (heads)))
"""
"""A domain in which a tree of one refinement succeeds with probability 1/2, of two with 3/4."""


def bbtc(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder. What is built is built in one process, unless the arguments tell how many
    jobs are done at once: each process more is one to be loaded."""
    from tests.cli import program

    one = ("-j", "1") if arguments[:1] == ("build",) and "-j" not in arguments else ()
    return program.bbtc(*arguments, *one, folder=folder)


def project(folder: Path, manifest: str, **sources: str) -> Path:
    """A folder with a manifest and source files (``name_pddl=text``)."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "bbtc.yaml").write_text(manifest)
    for name, text in sources.items():
        (folder / name.replace("_pddl", ".pddl")).write_text(text)
    return folder


def several(folder: Path, count: int, exports: str = "[dot]", per_domain: int = 5) -> Path:
    """A project of so many trees; each domain is shared by a few."""
    lines = ["defaults:", f"  exports: {exports}", "  target: 0.75", "  retries: least", "trees:"]
    sources = {}
    for number in range(count):
        domain = f"d{number // per_domain}"
        sources[f"{domain}_pddl"] = COIN.partition("(define (problem")[0] + f"; {domain}\n"
        sources[f"p{number}_pddl"] = f"(define (problem p{number}) (:domain coin) (:goal (heads)))\n"
        lines += [f"  t{number}:", f"    domain: {domain}.pddl", f"    problem: p{number}.pddl"]
    return project(folder, "\n".join(lines) + "\n", **sources)


def digest(data: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def snapshot(folder: Path) -> dict[str, tuple[str, int]]:
    """Every file but the build's own notes: digest of its content, and the time it was written."""
    return {
        str(path.relative_to(folder)): (
            hashlib.sha256(path.read_bytes()).hexdigest(),
            path.stat().st_mtime_ns,
        )
        for path in sorted(folder.rglob("*"))
        if path.is_file() and ".bbtc" not in path.parts
    }
