"""What becomes of public problems with hidden state: compiled, or refused, and by which codes.

``python -m tests.hidden.public_pairs`` prints the table, in some minutes.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from bbtc.diagnostics import BbtcError, LimitReached, Report, Severity
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources
from bbtc.source import SourceFile
from tests.conftest import corpus_folder
from tests.corpus import read_corpus

FAMILIES = ("contingent", "contingent-prob", "krep", "pomdp")
COMPILED = "compiled"


def pairs(folder: Path, families: Sequence[str] = FAMILIES) -> Iterator[tuple[str, str]]:
    """Domain and problem of every pair."""
    corpus = read_corpus(folder)
    for family in families:
        for problem in corpus.families[family]:
            yield from ((domain, problem) for domain in corpus.partners.get(problem, ()))
            if problem in corpus.both:
                yield problem, problem


def fate(folder: Path, domain: str, problem: str, seconds: float | None = None) -> str:
    """``compiled``, or the codes of what refuses a pair."""
    sources = [
        SourceFile(path, (folder / path).read_text("utf-8", errors="replace"))
        for path in dict.fromkeys((domain, problem))
    ]
    try:
        compile_sources(sources, Report(), Limits(seconds=seconds))
    except LimitReached as reached:
        return reached.diagnostics[0].code
    except BbtcError as error:
        found = {each.code for each in error.diagnostics if each.severity is Severity.ERROR}
        return " ".join(sorted(found))
    return COMPILED


def place(problem: str) -> str:
    """The family of a problem and its folder."""
    return "/".join(problem.split("/")[:2])


def table(fates: Sequence[tuple[str, str]]) -> str:
    """A row for each family: how many pairs compile, and the others by code."""
    rows: dict[str, Counter[str]] = {}
    for problem, found in fates:
        rows.setdefault(problem.split("/")[0], Counter())[found] += 1
    lines = ["| family | pairs | compiled | refused |", "|---|---|---|---|"]
    for family, counts in rows.items():
        others = ", ".join(f"{n} {code}" for code, n in sorted(counts.items()) if code != COMPILED)
        lines.append(f"| {family} | {counts.total()} | {counts[COMPILED]} | {others} |")
    return "\n".join(lines)


def main() -> int:
    """Print the table."""
    folder = corpus_folder()
    if folder is None:
        print("no corpus: set BBTC_CORPUS", file=sys.stderr)
        return 2
    fates = [(problem, fate(folder, domain, problem, 60)) for domain, problem in pairs(folder)]
    for problem, found in fates:
        if found != COMPILED:
            print(problem, found)
    print(table(fates))
    return 0


if __name__ == "__main__":
    sys.exit(main())
