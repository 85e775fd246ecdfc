"""A coverage-guided fuzz run of the front end with atheris, over bytes and over forms.

Run ``python -m tests.fuzz.fuzz_front_end FOLDER [SECONDS]`` (atheris is not a dependency: install it
first). Seeds are the pairs of the corpus and of ``domains/`` that are small; they, and the inputs that
reach new code, stand in ``FOLDER/seeds``. Every find goes to ``FOLDER/finds``, one file for each place
in the code that it fails at, with the traceback beside it, and the run goes on; ``FOLDER/tally-….json``
counts how far the inputs came. Finds become regression cases in ``tests/fuzz/regressions/``.
"""

from __future__ import annotations

import hashlib
import json
import random
import re
import sys
import time
import traceback
from collections import Counter
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["bbtc"]):
    # The pipeline imports these when it needs them, which would be too late.
    import bbtc.analysis.check
    import bbtc.analysis.resolve
    import bbtc.ground.instantiate  # noqa: F401
    from tests.fuzz.front_end import check_input

from tests.conftest import REPOSITORY, corpus_folder
from tests.fuzz.mutate import Changes

_LONGEST = 2048  # bytes: what is long is slow, and fails for the same reasons
_POOL, _KNOWN = 3000, 30_000


def write_seeds(folder: Path) -> list[bytes]:
    """Domain and problem of every small pair in one file each; returns them all."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = []
    for domain in sorted((REPOSITORY / "domains").glob("*/domain.pddl")):
        texts += [
            domain.read_bytes() + b"\n" + p.read_bytes() for p in sorted(domain.parent.glob("[!d]*.pddl"))
        ]
    corpus = corpus_folder()
    if corpus is not None:
        for line in (corpus / "PAIRS.tsv").read_text().splitlines()[1:]:
            domain_name, problem_name = line.split("\t")
            if domain_name != "-" and problem_name != "-":
                texts.append(
                    (corpus / domain_name).read_bytes() + b"\n" + (corpus / problem_name).read_bytes()
                )
        texts += [
            (corpus / line.split("\t")[0]).read_bytes()
            for line in (corpus / "ODDITIES.tsv").read_text().splitlines()[1:]
        ]
    small = [_squeezed(text) for text in texts if len(text) <= 3 * _LONGEST]
    small = sorted({text for text in small if len(text) <= _LONGEST})
    for text in small:
        (folder / hashlib.sha1(text, usedforsecurity=False).hexdigest()).write_bytes(text)
    return small


def _squeezed(text: bytes) -> bytes:
    """Without the spaces that indent."""
    return re.sub(rb"\n\s+", b"\n", re.sub(rb"[ \t]+", b" ", text))


class Pool:
    """Inputs that got past the parser: the seeds, and later ones that take the places of others."""

    def __init__(self, seeds: list[bytes]) -> None:
        self.seeds = seeds
        self.texts = list(seeds)
        self._draw = random.Random(0)
        self._known: dict[bytes, None] = dict.fromkeys(map(_checksum, seeds))

    def add(self, data: bytes) -> None:
        """Keep some of the inputs; forget the oldest of very many checksums."""
        self._known[_checksum(data)] = None
        if len(self._known) > _KNOWN:
            del self._known[next(iter(self._known))]
        if len(self.texts) < _POOL:
            self.texts.append(data)
        elif self._draw.random() < 0.1:
            self.texts[self._draw.randrange(len(self.seeds), _POOL)] = data

    def __contains__(self, data: bytes) -> bool:
        return _checksum(data) in self._known


def _checksum(data: bytes) -> bytes:
    return hashlib.sha1(data, usedforsecurity=False).digest()


class Mutator:
    """Changes one input in ten byte by byte, the others form by form and word by word. What the parser
    refused is seldom changed further: more of it would be refused, too."""

    def __init__(self, pool: Pool) -> None:
        self.pool = pool

    def __call__(self, data: bytes, max_size: int, seed: int) -> bytes:
        """A changed input of at most ``max_size`` bytes."""
        draw = random.Random(seed)
        if not data or (data not in self.pool and draw.random() < 0.85):
            data = draw.choice(self.pool.texts)
        if draw.random() < 0.1:
            return bytes(atheris.Mutate(data, max_size))
        change = Changes(self.pool.texts, draw)
        for _ in range(draw.choice([1, 1, 2, 2, 3, 5])):
            changed = change(data)
            if len(changed) <= max_size:
                data = changed
        return data


class Run:
    """Counts the executions and keeps the finds."""

    def __init__(self, folder: Path, pool: Pool) -> None:
        self.pool = pool
        self.finds = folder / "finds"
        self.finds.mkdir(parents=True, exist_ok=True)
        self.tally = folder / f"tally-{int(time.time())}.json"
        self.start = time.time()
        self.reached: Counter[str] = Counter()

    def __call__(self, data: bytes) -> None:
        """Try one input."""
        try:
            reached = check_input(data)
            self.reached[reached] += 1
            if reached != "refused":
                self.pool.add(data)
        except Exception as error:  # noqa: BLE001
            self.reached["find"] += 1
            self._keep(data, error)
        if sum(self.reached.values()) % 500 == 0:
            self.tally.write_text(json.dumps({"seconds": time.time() - self.start, **self.reached}))

    def _keep(self, data: bytes, error: Exception) -> None:
        frames = [f"{Path(f.filename).name}:{f.lineno}" for f in traceback.extract_tb(error.__traceback__)]
        ours = [f for f in frames if not f.startswith(("front_end", "fuzz_"))]
        key = f"{type(error).__name__} {ours[-2:]} {str(error)[:30] if not ours else ''}"
        name = hashlib.sha1(key.encode(), usedforsecurity=False).hexdigest()[:10]
        file = self.finds / name
        if not file.exists() or len(data) < file.stat().st_size:
            file.write_bytes(data)
            trace = "".join(traceback.format_exception(error, limit=-12))
            (self.finds / f"{name}.txt").write_text(trace)


def _gets_past(seed: bytes) -> bool:
    try:
        return check_input(seed) != "refused"
    except AssertionError:
        return False


def main() -> None:
    """Fuzz until the time is over."""
    folder = Path(sys.argv[1])
    seconds = int(sys.argv[2]) if len(sys.argv) > 2 else 3600
    seeds = write_seeds(folder / "seeds")
    words = sorted(
        {w for s in seeds for w in re.findall(rb":[\w-]+|\(\w[\w-]+", s)}, key=lambda w: (len(w), w)
    )
    keys = folder / "words.dict"
    keys.write_text("".join(f'"{w.decode("latin-1")}"\n' for w in words[:300] if w.isascii()))
    options = [
        f"-max_total_time={seconds}", f"-max_len={_LONGEST}", "-timeout=60", "-rss_limit_mb=3000",
        f"-dict={keys}", f"-artifact_prefix={folder}/crash-", "-verbosity=1", "-len_control=0",
    ]  # fmt: skip
    pool = Pool([seed for seed in seeds if _gets_past(seed)])
    atheris.Setup(
        [sys.argv[0], *options, str(folder / "seeds")], Run(folder, pool), custom_mutator=Mutator(pool)
    )
    atheris.Fuzz()


if __name__ == "__main__":
    main()
