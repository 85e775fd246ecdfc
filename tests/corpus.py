"""How much of a corpus of public files loads, family by family: ``python -m tests.corpus``.

A file is *accepted* if it parses, resolves (a problem with each partner that ``PAIRS.tsv`` gives it), and
prints to a text that holds all it held. It is *rightly refused* if ``ODDITIES.tsv`` lists it, or if every
error names a construct the language does not have, or if it stands or falls with a partner that is rightly
refused. Anything else is *wrong*. What a text holds is read here, from parentheses and words, without our
parser.

``--every N`` takes each Nth file of a family only; ``--list`` names the files that are not accepted.
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from bbtc.analysis.resolve import resolve
from bbtc.diagnostics import BbtcError, Diagnostic, Report
from bbtc.files.sources import read_source
from bbtc.syntax.ast import Definition, Document, DomainReference
from bbtc.syntax.parser import parse
from bbtc.syntax.printer import print_document
from tests.conftest import corpus_folder

_T = TypeVar("_T")

REQUIRED = {
    "ppddl": Fraction(99, 100),
    "fond": Fraction(99, 100),
    "contingent": Fraction(98, 100),
    "contingent-prob": Fraction(98, 100),
    "classical": Fraction(97, 100),
}
"""Smallest share of the well-formed files of a family that is accepted; other families are only counted."""

UNSUPPORTED = "BBT0212"
"""The code of a construct that is refused by name."""

# --- what a text holds, read without our parser ----------------------------------------------

_COMMENT = re.compile(r";[^\n]*")
_TOKEN = re.compile(r"[()]|[^\s()]+")
_NOTHING = re.compile(r":parameters\s*\(\s*\)|\(\s*(and\s*)?\)")
_PART = re.compile(r"\??[^?-]+")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+|/\d+)?")
_KEPT = frozenset(
    re.findall(
        r"\S+",
        """probabilistic oneof when forall exists or imply not unknown known increase decrease assign reward
        total-cost :observe :init :hidden :goal :goal-reward :goal-probability :metric :action :derived""",
    )
)
"""Words whose every use, and what stands around it, must survive."""
_BRANCHING = frozenset({"probabilistic", "oneof", "when", "or", "imply", "not"})
"""Those whose number of parts must survive, too."""


@dataclass(frozen=True)
class Content:
    """``words`` counts the words, cut at ``-`` and before ``?``, where spaces may be missing. ``forms``
    counts each use of a word of :data:`_KEPT` with those around it, outermost first, and the parts of
    each form that branches. ``probabilities`` counts each probability of a ``probabilistic`` form. An
    ``and`` may be added around what stands together anyway and is not counted, nor is an empty list of
    parameters."""

    words: Counter[str]
    forms: Counter[tuple[str, ...]]
    probabilities: Counter[Fraction]


def content_of(text: str) -> Content:
    """What a text holds."""
    forms: Counter[tuple[str, ...]] = Counter()
    probabilities: Counter[Fraction] = Counter()
    words: list[str] = []
    open_: list[tuple[str, ...]] = [()]
    heads: list[str] = [""]
    sizes = [0]
    first = False
    for match in _TOKEN.finditer(_NOTHING.sub(" ", _COMMENT.sub("", text).lower())):
        token = match.group()
        if token == "(":
            sizes[-1] += 1
            sizes.append(0)
            open_.append(open_[-1])
            heads.append("")
            first = True
            continue
        if token == ")":
            if len(open_) > 1:
                if heads[-1] in _BRANCHING:
                    use = (*open_[-1], str(sizes[-1]))
                    forms[use] += 1
                open_.pop()
                heads.pop()
                sizes.pop()
            first = False
            continue
        sizes[-1] += 1
        words.append(token)
        if token in _KEPT:
            use = (*open_[-1], token)
            forms[use] += 1
        if first:
            heads[-1] = token
            if token in _KEPT:
                open_[-1] = (*open_[-1], token)
        elif heads[-1] == "probabilistic" and _NUMBER.fullmatch(token):
            probabilities[Fraction(token)] += 1
        first = False
    return Content(
        Counter(part for word in words for part in _PART.findall(word) if part != "and"), forms, probabilities
    )


def lost(before: str, after: str) -> str | None:
    """What the second text does not hold as the first does; None if it holds the same."""
    one, other = content_of(before), content_of(after)
    if one.probabilities != other.probabilities:
        return f"probabilities {_difference(one.probabilities, other.probabilities)}"
    if one.forms != other.forms:
        return f"forms {_difference(one.forms, other.forms)}"
    if one.words != other.words:
        return f"words {_difference(one.words, other.words)}"
    return None


def _difference(one: Counter[_T], other: Counter[_T]) -> str:
    """Some of what only one of two counts holds, with how often."""
    less, more = list((one - other).items())[:2], list((other - one).items())[:2]
    return ", ".join([*(f"-{n} {each}" for each, n in less), *(f"+{n} {each}" for each, n in more)])


# --- one file --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Verdict:
    """``kind`` is accepted, malformed, unsupported or wrong."""

    path: str
    kind: str
    why: str = ""


@dataclass(frozen=True)
class Corpus:
    """The tables of a corpus; ``both`` are the files that hold a domain and a problem."""

    folder: Path
    families: dict[str, list[str]]
    partners: dict[str, list[str]]
    odd: dict[str, str]
    both: frozenset[str]


def read_corpus(folder: Path) -> Corpus:
    """The tables of the corpus in a folder."""
    both: set[str] = set()
    families: dict[str, list[str]] = defaultdict(list)
    partners: dict[str, list[str]] = defaultdict(list)
    for row in _rows(folder / "INDEX.tsv"):
        families[row["family"]].append(row["path"])
        if row["kind"] == "both":
            both.add(row["path"])
    for row in _rows(folder / "PAIRS.tsv"):
        if row["domain"] not in {"-", row["problem"]}:
            partners[row["problem"]].append(row["domain"])
    odd = {row["path"]: row["odd"] for row in _rows(folder / "ODDITIES.tsv")}
    return Corpus(folder, dict(families), dict(partners), odd, frozenset(both))


def _rows(file: Path) -> Iterable[dict[str, str]]:
    with file.open(newline="", encoding="utf-8") as lines:
        yield from csv.DictReader(lines, delimiter="\t", quoting=csv.QUOTE_NONE)


def judge(corpus: Corpus, path: str) -> Verdict:
    """The verdict on one file."""
    report = Report()
    try:
        document = _parse(corpus, path, report)
        if report.errors:
            return _refused(corpus, path, report.errors)
        gone = lost(document.source.text, print_document(document))
        if gone is not None:
            return Verdict(path, "wrong", f"printing changed {gone}")
        for domain, problem in _pairs(corpus, path, document, report):
            resolve(domain, problem, report)
    except BbtcError as error:
        return _refused(corpus, path, error.diagnostics)
    return _refused(corpus, path, report.errors) if report.errors else Verdict(path, "accepted")


def _parse(corpus: Corpus, path: str, report: Report) -> Document:
    return parse(read_source(str(corpus.folder / path)), report)


@lru_cache(maxsize=4)
def _parse_domain(folder: Path, path: str) -> tuple[Document, Report]:
    report = Report()
    return parse(read_source(str(folder / path)), report), report


def _pairs(
    corpus: Corpus, path: str, document: Document, report: Report
) -> list[tuple[Definition, Definition | None]]:
    """What to resolve: each problem with its domains, here or in the partners; each domain alone."""
    domains = [definition for definition in document.definitions if definition.kind == "domain"]
    problems = [definition for definition in document.definitions if definition.kind == "problem"]
    pairs: list[tuple[Definition, Definition | None]] = [(domain, None) for domain in domains]
    for problem in problems:
        partners = [domain for domain in domains if domain.name.key == _domain_name(problem)] or domains[:1]
        for partner in corpus.partners.get(path, ()):
            other, errors = _parse_domain(corpus.folder, partner)
            for error in errors.errors:
                report.add(error)
            named = [d for d in other.definitions if d.kind == "domain"]
            partners += [d for d in named if d.name.key == _domain_name(problem)] or named[:1]
        pairs += [(partner, problem) for partner in partners]
    return pairs


def _domain_name(problem: Definition) -> str | None:
    return next((s.name.key for s in problem.sections if isinstance(s, DomainReference)), None)


def _refused(corpus: Corpus, path: str, diagnostics: Sequence[Diagnostic]) -> Verdict:
    errors = [d for d in diagnostics if d.severity.value == "error"]
    why = errors[0].render().splitlines()[0].replace(f"{corpus.folder}/", "")
    if path in corpus.odd:
        return Verdict(path, "malformed", why)
    own = [d for d in errors if d.span is None or d.span.source.name == str(corpus.folder / path)]
    if not own and any(partner in corpus.odd for partner in corpus.partners.get(path, ())):
        return Verdict(path, "malformed", why)
    wrong = [d for d in errors if d.code != UNSUPPORTED]
    if wrong:
        return Verdict(path, "wrong", wrong[0].render().splitlines()[0].replace(f"{corpus.folder}/", ""))
    return Verdict(path, "unsupported", why)


# --- the report ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tally:
    """The verdicts on a family."""

    family: str
    verdicts: tuple[Verdict, ...]

    def count(self, kind: str) -> int:
        """How many files have the verdict."""
        return sum(verdict.kind == kind for verdict in self.verdicts)

    @property
    def share(self) -> Fraction:
        """Accepted among those that are not rightly refused."""
        accepted = self.count("accepted")
        return Fraction(accepted, max(1, accepted + self.count("wrong")))

    @property
    def good(self) -> bool:
        """Whether enough is accepted."""
        return self.share >= REQUIRED.get(self.family, 0)


def tallies(corpus: Corpus, every: int = 1, workers: int = 1) -> list[Tally]:
    """The verdicts on each ``every``-th file of each family."""
    chosen = {family: sorted(paths)[::every] for family, paths in sorted(corpus.families.items())}
    flat = [path for paths in chosen.values() for path in paths]
    if workers == 1:
        verdicts = [judge(corpus, path) for path in flat]
    else:
        with ProcessPoolExecutor(workers) as pool:
            verdicts = list(pool.map(judge, [corpus] * len(flat), flat, chunksize=16))
    of = {verdict.path: verdict for verdict in verdicts}
    return [Tally(family, tuple(of[path] for path in paths)) for family, paths in chosen.items()]


def table(found: Iterable[Tally]) -> str:
    """The report as text, a line for each family."""
    lines = ["family           files  accepted  malformed  unsupported  wrong   share  required"]
    for tally in found:
        required = REQUIRED.get(tally.family)
        lines.append(
            f"{tally.family:<17}{len(tally.verdicts):>5}{tally.count('accepted'):>10}"
            f"{tally.count('malformed'):>11}{tally.count('unsupported'):>13}{tally.count('wrong'):>7}"
            f"{float(tally.share):>8.1%}  {f'{float(required):.0%}' if required else '-':>8}"
        )
    return "\n".join(lines)


def main() -> int:
    """Print the report; 1 if a family falls short."""
    parser = argparse.ArgumentParser(description="How much of the corpus loads.")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="each Nth file only")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes")
    parser.add_argument("--list", action="store_true", help="name the files that are not accepted")
    options = parser.parse_args()
    folder = corpus_folder()
    if folder is None:
        print("no corpus: set BBTC_CORPUS, or put it at ../shared/corpus")
        return 2
    found = tallies(read_corpus(folder), options.every, options.workers)
    if options.list:
        for tally in found:
            for verdict in tally.verdicts:
                if verdict.kind != "accepted":
                    print(f"{verdict.kind:<12}{verdict.path}: {verdict.why}")
        print()
    print(table(found))
    return 0 if all(tally.good for tally in found) else 1


if __name__ == "__main__":
    sys.exit(main())
