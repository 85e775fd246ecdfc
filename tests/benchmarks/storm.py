"""Exploring and solving a task beside the model checker Storm: ``python -m tests.benchmarks.storm``.

The task is triangle-tireworld p04 (843,098 states), for Storm as the text that
``bbtc compile --emit prism`` writes. Each side runs in a process of its own, ours and Storm's by turns.
Counted are, of ours, the exploration from the ground task and the solution, and, of Storm, the building
of the model from the parsed program and the check of ``Pmax=? [F "goal"]``, with the settings of its
command line (``--sound`` takes those that bound the error, as we do). Exits with 1 where ours is not
three times as fast in processor time, or the two do not agree on the states and the value.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from tests.conftest import corpus_folder

PROBLEM = "ppddl/probfd-triangle-tireworld-ippc08"
WANTED = 3.0


def clocks() -> tuple[float, float]:
    """Wall-clock and processor seconds."""
    return time.perf_counter(), time.process_time()


def since(before: tuple[float, float]) -> list[float]:
    """Seconds passed on both clocks."""
    return [now - then for now, then in zip(clocks(), before, strict=True)]


def ours(domain: Path, problem: Path) -> dict[str, Any]:
    """Explore and solve, from the ground task."""
    from bbtc.diagnostics import Report
    from bbtc.files.sources import read_source
    from bbtc.limits import Limits
    from bbtc.pipeline import compile_sources
    from bbtc.planner.mdp.explore import explore_space
    from bbtc.planner.mdp.maxprob import max_prob

    task = compile_sources([read_source(str(domain)), read_source(str(problem))], Report(), Limits())
    limits = Limits(states=10_000_000)
    start = clocks()
    space = explore_space(task, limits)
    first = since(start)
    start = clocks()
    value = max_prob(space, limits).initial
    second = since(start)
    return {"first": first, "second": second, "states": len(space.states), "value": float(value.lower)}


def storms(program: Path, *, sound: bool) -> dict[str, Any]:
    """Build and check, from the parsed program."""
    import stormpy

    parsed = stormpy.parse_prism_program(str(program))
    asked = stormpy.parse_properties('Pmax=? [F "goal"]', parsed)
    environment = stormpy.environments.sound() if sound else stormpy.Environment()
    start = clocks()
    model = stormpy.build_model[float](parsed, asked)
    first = since(start)
    start = clocks()
    result = stormpy.model_checking(model, asked[0], environment=environment, only_initial_states=True)
    (initial,) = model.initial_states
    value = result.get_value(initial)
    second = since(start)
    return {"first": first, "second": second, "states": model.nr_states, "value": value}


def write_program(domain: Path, problem: Path, path: Path) -> None:
    """The task as text for Storm."""
    from bbtc.diagnostics import Report
    from bbtc.files.sources import read_source
    from bbtc.limits import Limits
    from bbtc.pipeline import compile_sources
    from bbtc.verifier.naming import numbered
    from bbtc.verifier.prism import prism_text
    from bbtc.verifier.process import process_of

    task = compile_sources([read_source(str(domain)), read_source(str(problem))], Report(), Limits())
    program = process_of(task)
    path.write_text(prism_text(program, numbered(program)), encoding="utf-8")


def in_a_process(*arguments: str) -> dict[str, Any]:
    """One side, measured in a fresh process."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks.storm", *arguments],
        capture_output=True,
        text=True,
        check=True,
    )
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def main() -> int:
    """Print what each run took, and the ratio of the best of each side."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--problem", default="p04.pddl")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--sound", action="store_true")
    parser.add_argument("--worker", choices=["ours", "storm", "write"], help=argparse.SUPPRESS)
    parser.add_argument("--program", default="build/benchmark-storm.prism")
    options = parser.parse_args()
    folder = corpus_folder()
    if folder is None:
        print("needs the corpus")
        return 2
    domain, problem = folder / PROBLEM / "domain.pddl", folder / PROBLEM / options.problem
    program = Path(options.program)
    if options.worker == "ours":
        print(json.dumps(ours(domain, problem)))
        return 0
    if options.worker == "storm":
        print(json.dumps(storms(program, sound=options.sound)))
        return 0
    program.parent.mkdir(exist_ok=True)
    write_program(domain, problem, program)
    shared = [
        "--problem",
        options.problem,
        "--program",
        str(program),
        *(["--sound"] if options.sound else []),
    ]
    best: dict[str, tuple[float, float]] = {}
    answers = set()
    print("       explore/build       solve/check             both      states  value")
    for _ in range(options.repeat):
        for side in ("ours", "storm"):
            found = in_a_process("--worker", side, *shared)
            both = [a + b for a, b in zip(found["first"], found["second"], strict=True)]
            columns = "".join(
                f"{wall:9.2f} ({cpu:5.2f})" for wall, cpu in (found["first"], found["second"], both)
            )
            print(f"{side:6}{columns}{found['states']:>10}  {found['value']:.9f}", flush=True)
            known = best.get(side, (float("inf"), float("inf")))
            best[side] = min(known[0], both[0]), min(known[1], both[1])
            answers.add((found["states"], round(found["value"], 5)))
    wall, cpu = (best["storm"][clock] / best["ours"][clock] for clock in (0, 1))
    print(f"Storm takes {wall:.2f} times as long by the wall clock, {cpu:.2f} times the processor time")
    if len(answers) > 1:
        print(f"they do not agree: {sorted(answers)}")
    return int(len(answers) > 1 or cpu < WANTED)


if __name__ == "__main__":
    sys.exit(main())
