"""How long ``bbtc --help`` takes, beside ``python -c "import click"``, in turn.

Run: ``python -m tests.benchmarks.startup``. Target: the median ratio is at most 1.5.
"""

from __future__ import annotations

import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

RUNS = 21


def seconds(command: list[str]) -> float:
    """Wall-clock seconds of one run of a command."""
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def main() -> None:
    """Print the median times and the median of the ratios of neighbouring runs."""
    beside = Path(sys.executable).with_name("bbtc")
    program = str(beside) if beside.exists() else shutil.which("bbtc")
    if program is None:
        sys.exit("bbtc is not installed in this environment")
    ours, theirs = [program, "--help"], [sys.executable, "-c", "import click"]
    seconds(ours), seconds(theirs)  # warm the file caches
    pairs = [(seconds(ours), seconds(theirs)) for _ in range(RUNS)]
    print(f"bbtc --help     median {statistics.median(a for a, _ in pairs) * 1e3:6.1f} ms")
    print(f"import click    median {statistics.median(b for _, b in pairs) * 1e3:6.1f} ms")
    print(f"ratio           median {statistics.median(a / b for a, b in pairs):6.2f}")


if __name__ == "__main__":
    main()
