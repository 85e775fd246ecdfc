"""The model checker Storm (Hensel et al. 2022), where its Python package ``stormpy`` is installed.

It runs in a process of its own: it can be stopped when the time is over, and whatever it does to that
process, this one goes on.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from importlib.util import find_spec

from bbtc.diagnostics import BbtcError
from bbtc.limits import Limits
from bbtc.verifier.naming import numbered
from bbtc.verifier.prism import prism_text
from bbtc.verifier.program import Program


@dataclass(frozen=True, slots=True)
class Answer:
    """What Storm says to a property: the value is at least ``lower`` and at most ``upper``, equal where
    it was found in exact arithmetic. None: infinite."""

    lower: Fraction | None
    upper: Fraction | None


@dataclass(frozen=True, slots=True)
class Answers:
    """Answers in the order of the properties, and the number of states of Storm's model."""

    version: str
    states: int
    exact: bool
    values: tuple[Answer, ...]


def is_installed() -> bool:
    """Is stormpy there?"""
    return find_spec("stormpy") is not None


def ask(program: Program, properties: Sequence[str], limits: Limits) -> Answers:
    """The values of properties in the initial state. Raises ``LimitReached`` when the time is over, and
    :class:`BbtcError` where Storm is missing or fails."""
    if not is_installed():
        raise BbtcError.single(
            "BBT0803",
            "Storm is not installed",
            hint="pip install 'bbtc[storm]', or leave out --engine",
        )
    question = {
        "program": prism_text(program, numbered(program)),
        "properties": list(properties),
        "memory": limits.memory,
    }
    limits.check_time("the recomputation")
    try:
        done = subprocess.run(
            [sys.executable, "-m", "bbtc.verifier.storm_worker"],
            input=json.dumps(question),
            capture_output=True,
            text=True,
            timeout=limits.remaining,
            check=False,
        )
    except subprocess.TimeoutExpired:
        limits.check_time("Storm")
        raise limits.reached("the time limit ended Storm", "--time-limit") from None
    try:
        answer = json.loads(done.stdout.splitlines()[-1])
        return Answers(
            answer["version"],
            answer["states"],
            answer["exact"],
            tuple(Answer(*map(_number, bounds)) for bounds in answer["values"]),
        )
    except (IndexError, KeyError, ValueError, TypeError) as error:
        told = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
        raise BbtcError.single(
            "BBT0804",
            f"Storm gave no answer (status {done.returncode}): {told[-1] if told else 'it said nothing'}",
            hint="--engine own does without it",
        ) from error


def _number(text: str | None) -> Fraction | None:
    return None if text is None else Fraction(text)
