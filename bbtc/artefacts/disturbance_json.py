"""Figures of disturbed worlds as JSON: members of what ``bbtc simulate --json`` writes."""

from __future__ import annotations

from typing import Any

from bbtc.artefacts.conditions import condition_to_json
from bbtc.artefacts.figures_json import truth_of, values_to_json
from bbtc.artefacts.numbers import figure_text, given_text
from bbtc.disturbance.intervals import CONFIDENCE, Interval
from bbtc.disturbance.perturbed import PerturbedRuns
from bbtc.disturbance.recovery import Recovery
from bbtc.tree.nodes import Tree


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


def recovery_to_json(tree: Tree, found: Recovery) -> dict[str, Any]:
    """What a tree attains from states that can be reached, beside the best; ``null`` intervals where all
    states were taken."""
    variables = tree.task.variables
    worst = None
    if found.worst is not None:
        worst = {
            "success": figure_text(found.worst.success),
            "best": figure_text(found.worst.best),
            "assign": values_to_json(tree, found.worst.state),
        }
    return {
        "states": found.states,
        "taken": found.taken,
        "seed": found.seed,
        "hopeless": found.hopeless,
        "attained": found.attained,
        "attained_interval": _interval(found.attained_interval),
        "mean": figure_text(found.mean),
        "mean_interval": _interval(found.mean_interval),
        "worst": worst,
        "lost": figure_text(found.lost),
        "goals_missed": figure_text(found.missed),
        "endless": figure_text(found.endless),
        "exact": found.exact,
        "gives_up": [
            {
                "p": figure_text(each.share),
                "states": each.states,
                "node": each.node,
                "condition": None if each.condition is None else condition_to_json(each.condition, variables),
                "value": None if each.condition is None else truth_of(each.status),
                "attempts_used_up": each.used_up,
                "assign": values_to_json(tree, each.example),
            }
            for each in found.given_up
        ],
    }


def _interval(interval: Interval | None) -> dict[str, str] | None:
    if interval is None:
        return None
    return {
        "confidence": given_text(CONFIDENCE),
        "lower": given_text(interval.lower),
        "upper": given_text(interval.upper),
    }
