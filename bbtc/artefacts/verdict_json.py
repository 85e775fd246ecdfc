"""What ``bbtc verify --json`` writes: a claim, what was found, and whether they agree."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bbtc.artefacts.numbers import figure_text

if TYPE_CHECKING:
    from bbtc.verifier.solve import Recomputed
    from bbtc.verifier.timed import TimeFound
    from bbtc.verifier.verdict import StormFigures, Verdict

_FIGURES = (
    "success",
    "failure",
    "blocked",
    "endless",
    "actions",
    "actions_given_success",
    "cost",
    "cost_given_success",
    "reward",
)


def verdict_to_json(verdict: Verdict) -> dict[str, Any]:
    """The verdict as a JSON object. ``own`` and ``storm`` are null where that engine was not asked.
    Of Storm's figures the bounds are given, equal where it computed exactly; ``null`` is infinite, or,
    given success, undefined."""
    tree = verdict.tree
    return {
        "format": "bbtc-verdict",
        "version": 1,
        "domain": tree.task.domain,
        "problem": tree.task.problem,
        "claimed": figure_text(tree.success_probability),
        "verified": not verdict.problems,
        "own": None if verdict.own is None else _own(verdict.own),
        **({"worlds": _worlds(verdict.worlds)} if verdict.hidden else {}),
        "storm": None if verdict.storm is None else _storm(verdict.storm),
        **({} if verdict.time is None else {"time": _time(verdict.time)}),
        "problems": [{"code": problem.code, "message": problem.message} for problem in verdict.problems],
    }


def _own(found: Recomputed) -> dict[str, Any]:
    figures: dict[str, Any] = {name: _figure(found.figure(name)) for name in _FIGURES}
    return figures | {"states": found.states}


def _time(found: TimeFound) -> dict[str, Any]:
    expected = {"expected": _figure(found.expected), "given_success": _figure(found.given_success)}
    return expected | ({} if found.by is None else {"success_by": list(found.by)})


def _worlds(found: Recomputed | None) -> dict[str, Any] | None:
    if found is None:
        return None
    figures = {name: _figure(found.figure(name)) for name in _FIGURES}
    figures["success"] = figure_text(found.success - found.without_goal)
    return figures | {"mistaken": figure_text(found.without_goal), "states": found.states}


def _storm(found: StormFigures) -> dict[str, Any]:
    figures: dict[str, Any] = {
        name: [_figure(answer.lower), _figure(answer.upper)] for name, answer in found.figures
    }
    return figures | {"states": found.states, "exact": found.exact, "version": found.version}


def _figure(value: Fraction | None) -> str | None:
    return None if value is None else figure_text(value)
