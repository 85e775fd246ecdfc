"""The process in which Storm runs: a question as JSON on stdin, the answer as JSON on stdout."""

from __future__ import annotations

import json
import sys
import tempfile
from fractions import Fraction
from pathlib import Path
from typing import Any

MOST_EXACT = 20_000
"""States of a model that is solved in exact arithmetic; of more, with bounds in floats."""
PRECISION = Fraction(1, 10**11)
"""Relative width of the bounds asked for."""


def answer(question: dict[str, Any]) -> dict[str, Any]:
    """Build the model, check the properties."""
    import stormpy

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "program.prism"
        file.write_text(question["program"], encoding="utf-8")
        program = stormpy.parse_prism_program(str(file))
    asked = stormpy.parse_properties("; ".join(question["properties"]), program)
    # Floats are quick to build, and do for the number of states; rewards may have no place among them.
    plain = [one for one, text in zip(asked, question["properties"], strict=True) if not text.startswith("R")]
    states = stormpy.build_model[float](program, plain).nr_states
    exact = states <= MOST_EXACT
    if exact:
        model = stormpy.build_model[stormpy.Rational](program, asked)
        environment = stormpy.environments.exact()
    else:
        model = stormpy.build_model[float](program, asked)
        environment = stormpy.environments.sound()
        for solver in (environment.solver().native(), environment.solver().min_max()):
            solver.precision = stormpy.Rational(str(PRECISION))
    (initial,) = model.initial_states
    values = []
    for one in asked:
        result = stormpy.model_checking(model, one, environment=environment)
        value = result.get_value(initial)
        if exact or value == float("inf"):
            bounds = [_text(value)] * 2
        else:
            slack = PRECISION * max(Fraction(1), abs(Fraction(value)))
            bounds = [str(Fraction(value) - slack), str(Fraction(value) + slack)]
        values.append(bounds)
    return {"version": stormpy.__version__, "states": states, "exact": exact, "values": values}


def _text(value: Any) -> str | None:
    text = str(value)
    return None if text == "inf" else text


def main() -> None:
    """Answer one question."""
    question = json.load(sys.stdin)
    if question["memory"] is not None:
        try:
            import resource

            resource.setrlimit(resource.RLIMIT_AS, (question["memory"],) * 2)
        except (ImportError, ValueError, OSError):
            pass  # this system has no such limit
    print(json.dumps(answer(question)))


if __name__ == "__main__":
    main()
