"""Runs parts of Fast Downward's translator, in a process of its own: see :mod:`tests.downward`.

Arguments: the folder that holds its package, what to do, and files. The answer is one line of JSON, the
last one printed.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from typing import Any


def _parse(files: list[str]) -> dict[str, Any]:
    """The seconds that parsing takes, pair by pair."""
    from fast_downward.translate.pddl_parser import pddl_file

    pairs = list(zip(files[::2], files[1::2], strict=True))
    seconds: list[float | None] = []
    for domain, problem in pairs:
        start = time.perf_counter()
        try:
            pddl_file.open(domain, problem)
        except (Exception, SystemExit):  # noqa: BLE001
            seconds.append(None)
            continue
        seconds.append(time.perf_counter() - start)
    return {"seconds": seconds}


def _explore(files: list[str], names: bool) -> dict[str, Any]:
    """Ground actions of a pair, with the seconds and the kilobytes they take."""
    from fast_downward.translate import instantiate, normalize
    from fast_downward.translate.options import set_options
    from fast_downward.translate.pddl_parser import pddl_file

    set_options(files)
    task = pddl_file.open(*files)
    normalize.normalize(task)
    start, used = time.perf_counter(), time.process_time()
    reachable, _, actions, _, _, _ = instantiate.explore(task)
    seconds, used = time.perf_counter() - start, time.process_time() - used
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = sorted(action.name for action in actions) if names else []
    return {
        "reachable": reachable,
        "actions": len(actions),
        "names": found,
        "seconds": seconds,
        "processor": used,
        "kilobytes": kilobytes,
    }


def main() -> None:
    """Do what the arguments say."""
    folder, what, *files = sys.argv[1:]
    sys.path.insert(0, folder)
    answer = _parse(files) if what == "parse" else _explore(files, what == "names")
    print("\n" + json.dumps(answer))


if __name__ == "__main__":
    main()
