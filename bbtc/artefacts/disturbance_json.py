"""Figures of disturbed worlds as JSON: members of what ``bbtc simulate --json`` writes."""

from __future__ import annotations

from typing import Any

from bbtc.artefacts.numbers import figure_text, given_text
from bbtc.disturbance.intervals import CONFIDENCE, Interval
from bbtc.disturbance.perturbed import PerturbedRuns


def perturbed_to_json(found: PerturbedRuns) -> dict[str, Any]:
    """The runs of a tree where facts change by chance. Counts are whole numbers, means exact."""
    won = found.cost_given_success
    return {
        "rate": given_text(found.rate),
        "runs": found.runs,
        "seed": found.seed,
        "max_ticks": found.most_ticks,
        "success": figure_text(found.success),
        "interval": _interval(found.interval),
        "successes": found.successes,
        "goals_missed": found.missed,
        "failures": found.failures,
        "blocked": found.blocked,
        "cut": found.cut,
        "starts": found.starts,
        "starts_without_precondition": found.unready,
        "changes": found.changes,
        "facts": found.facts,
        "groups": found.groups,
        "cost": figure_text(found.cost),
        "cost_given_success": None if won is None else figure_text(won),
        "actions": figure_text(found.actions),
    }


def _interval(interval: Interval) -> dict[str, str]:
    return {
        "confidence": given_text(CONFIDENCE),
        "lower": given_text(interval.lower),
        "upper": given_text(interval.upper),
    }
