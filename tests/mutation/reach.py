"""Which tests run which lines, and how long each takes: measured once, by coverage.py."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import accumulate
from math import inf
from pathlib import Path

_DURATION = re.compile(r"^(\d+\.\d+)s (?:setup|call|teardown) +(\S.*)$")
IMPORTED = ""
"""The name that coverage.py has for what runs in no test: while modules are imported."""


@dataclass(frozen=True, slots=True)
class Reach:
    """By file and line, the tests (pytest's node ids) that run it, and the seconds that each test takes."""

    tests: Mapping[str, Mapping[int, frozenset[str]]]
    seconds: Mapping[str, float]

    def running(self, file: str, lines: Iterable[int]) -> frozenset[str]:
        """The tests that run any of these lines."""
        found = self.tests.get(file, {})
        return frozenset().union(*(found.get(line, ()) for line in lines))

    def quick_first(self, tests: Iterable[str], most: float = inf) -> list[str]:
        """The tests, those that take long last; of many, those that together take at most so many seconds."""
        ordered = sorted(tests, key=lambda test: (self.seconds.get(test, 0.0), test))
        until = accumulate(self.seconds.get(test, 0.0) for test in ordered)
        return [test for test, end in zip(ordered, until, strict=True) if end <= most] or ordered[:1]


def reach_of(root: Path, data: Path, output: str) -> Reach:
    """What a run of pytest in the folder ``root`` found: ``data`` is what coverage.py wrote, with one context
    for each test, ``output`` has the durations of all tests."""
    from coverage import CoverageData

    measured = CoverageData(str(data))
    measured.read()
    tests: dict[str, dict[int, frozenset[str]]] = {}
    for file in measured.measured_files():
        path = Path(file)
        if path.is_relative_to(root):
            lines = measured.contexts_by_lineno(file)
            # pytest-cov tells a test's setup, its call and its teardown apart: `id|run`.
            named = {
                line: frozenset(context.rpartition("|")[0] or context for context in contexts)
                for line, contexts in lines.items()
            }
            tests[path.relative_to(root).as_posix()] = named
    seconds: dict[str, float] = {}
    for line in output.splitlines():
        if match := _DURATION.match(line):
            seconds[match[2]] = seconds.get(match[2], 0.0) + float(match[1])
    return Reach(tests, seconds)


def lines_of(source: str, start: int, end: int) -> range:
    """The lines of the characters from ``start`` to ``end``."""
    return range(source.count("\n", 0, start) + 1, source.count("\n", 0, end) + 2)


def function_around(source: str, line: int) -> range:
    """The lines of the innermost function's body that a line stands in; no line, if there is none."""
    found = range(0)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.end_lineno is not None:
            body = range(node.body[0].lineno, node.end_lineno + 1)
            if line in body and (not found or len(body) < len(found)):
                found = body
    return found
