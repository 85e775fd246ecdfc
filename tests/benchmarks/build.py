"""``bbtc build`` when nothing has changed, beside reading and hashing the same files.

Run: ``python -m tests.benchmarks.build``. All measured in fresh processes, in turn: the least processor
time, less that of start-up, which is ``bbtc build`` in a project without trees, and hashing no file.
Target: at most 3 times.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.builder.projects import project, several

TREES = 200
RUNS = 25
PROGRAM = (sys.executable, "-m", "bbtc.cli.main")
HASH = (
    "import hashlib, sys\n"
    "for name in sys.stdin.read().splitlines():\n"
    "    with open(name, 'rb') as file: hashlib.sha256(file.read()).hexdigest()\n"
)


def cost(command: list[str], folder: Path, stdin: str = "") -> float:
    """Processor seconds of a command and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=folder, input=stdin, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    del done
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print the medians and the ratio."""
    with tempfile.TemporaryDirectory() as made:
        folder = several(Path(made), TREES, "[btcpp, dot]")
        subprocess.run([*PROGRAM, "build", "-q"], cwd=folder, check=True)
        empty = project(Path(made) / "empty", "trees: {}\n")
        subprocess.run([*PROGRAM, "build", "-q"], cwd=empty, check=True)
        state = json.loads((folder / ".bbtc/state.json").read_text())
        steps = [step for tree in state["trees"].values() for step in tree.values()]
        files = "\n".join(sorted({name for step in steps for part in step[1:] for name in part}))
        hashing = [sys.executable, "-c", HASH]
        rows = [
            (
                cost([*PROGRAM, "build", "-q"], folder),
                cost([*PROGRAM, "build", "-q"], empty),
                cost(hashing, folder, files),
                cost(hashing, folder),
            )
            for _ in range(RUNS)
        ]
        whole, start, whole_hash, start_hash = (min(column) * 1e3 for column in zip(*rows, strict=True))
        ours, theirs = whole - start, whole_hash - start_hash
        print(f"{TREES} trees, {len(files.splitlines())} files, best of {RUNS}")
        print(f"bbtc build, nothing changed {ours:7.1f} ms beyond a start-up of {start:.1f} ms")
        print(f"reading and hashing         {theirs:7.1f} ms beyond a start-up of {start_hash:.1f} ms")
        print(f"ratio                       {ours / theirs:7.2f}")
        (folder / "p7.pddl").write_text((folder / "p7.pddl").read_text() + "; edited\n")
        done = subprocess.run([*PROGRAM, "build"], cwd=folder, check=True, capture_output=True, text=True)
        print(f"one file changed: {done.stderr.splitlines()[-1]}")


if __name__ == "__main__":
    main()
