"""A coverage-guided fuzz run of the front end with atheris, over bytes and over forms.

Run ``python -m tests.fuzz.fuzz_front_end FOLDER [SECONDS]`` (atheris is not a dependency: install it
first). Seeds are the pairs of the corpus and of ``domains/`` that are small; they, and the inputs that
reach new code, stand in ``FOLDER/seeds``. Every find goes to ``FOLDER/finds``, one file for each place
in the code that it fails at, with the traceback beside it, and the run goes on. Finds become regression
cases in ``tests/fuzz/regressions/``.
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

_LONGEST = 2048  # bytes: what is long is slow, and fails for the same reasons
_WORD = re.compile(rb"[^\s()]+")
_FORM = re.compile(rb"\([^()]*\)|[^\s()]+")


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


class Mutator:
    """Changes some of the inputs byte by byte, most of them form by form or word by word: those get
    further than the parser."""

    def __init__(self, seeds: list[bytes]) -> None:
        self.seeds = seeds

    def __call__(self, data: bytes, max_size: int, seed: int) -> bytes:
        """A changed input of at most ``max_size`` bytes."""
        draw = random.Random(seed)
        if draw.random() < 0.3 or not data:
            return bytes(atheris.Mutate(data, max_size))
        for _ in range(draw.choice([1, 1, 1, 2, 3])):
            data = self._step(data, draw)
        return data[:max_size]

    def _step(self, data: bytes, draw: random.Random) -> bytes:
        start, end = _form(data, draw)
        other = data if draw.random() < 0.5 or not self.seeds else draw.choice(self.seeds)
        from_, to = _form(other, draw)
        match draw.randrange(8):
            case 5 | 6 | 7:
                # One word instead of another: names that are declared, numbers, keywords.
                words = [*_WORD.finditer(data)]
                if len(words) < 2:
                    return data
                at, new = draw.choice(words), draw.choice(words).group()
                return data[: at.start()] + new + data[at.end() :]
            case 0:
                return data[:start] + data[end:]
            case 1:
                return data[:end] + b" " + data[start:end] + data[end:]
            case 2:
                return data[:start] + other[from_:to] + data[end:]
            case 3:
                return data[:end] + b" " + other[from_:to] + data[end:]
            case _:
                wrapper = draw.choice(
                    [b"(and %s)", b"(not %s)", b"(oneof %s)", b"(probabilistic 1/2 %s)", b"(when (p) %s)",
                     b"(forall (?x) %s)", b"(exists (?x - object) %s)", b"(unknown %s)", b"(or %s)",
                     b"(imply (q) %s)", b"(known %s)", b"(%s)"]
                )  # fmt: skip
                return data[:start] + wrapper.replace(b"%s", data[start:end]) + data[end:]


def _form(data: bytes, draw: random.Random) -> tuple[int, int]:
    """The place of a word or of a form in parentheses."""
    at = draw.randrange(len(data)) if data else 0
    if draw.random() < 0.5:
        match = _FORM.search(data, at)
        return (match.start(), match.end()) if match else (at, at)
    start = data.rfind(b"(", 0, at)
    depth = 0
    for end in range(max(start, 0), len(data)):
        depth += (data[end] == 0x28) - (data[end] == 0x29)
        if depth == 0:
            return max(start, 0), end + 1
    return at, at


class Run:
    """Counts the executions and keeps the finds."""

    def __init__(self, folder: Path) -> None:
        self.finds = folder / "finds"
        self.finds.mkdir(parents=True, exist_ok=True)
        self.tally = folder / f"tally-{int(time.time())}.json"
        self.start = time.time()
        self.reached: Counter[str] = Counter()

    def __call__(self, data: bytes) -> None:
        """Try one input."""
        try:
            self.reached[check_input(data)] += 1
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
    atheris.Setup([sys.argv[0], *options, str(folder / "seeds")], Run(folder), custom_mutator=Mutator(seeds))
    atheris.Fuzz()


if __name__ == "__main__":
    main()
