"""The figures of a tree as JSON: what ``bbtc simulate --json`` writes."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bbtc.artefacts.conditions import condition_to_json
from bbtc.artefacts.numbers import figure_text
from bbtc.belief.draws import Values
from bbtc.belief.tick import NodeStatus
from bbtc.ground.describe import differences, values_in_words
from bbtc.kleene import Truth
from bbtc.tree.nodes import Tree

if TYPE_CHECKING:
    from bbtc.belief.scenarios import Sampling, Scenario
    from bbtc.belief.simulate import Figures
    from bbtc.belief.worst_world import WorstWorld
    from bbtc.planner.failing_runs import FailingRun


def figures_to_json(
    tree: Tree, figures: Figures, scenarios: Sequence[Scenario], sampling: Sampling | None
) -> dict[str, Any]:
    """The figures, the scenarios listed, and the sampling, if there was one. Probabilities and
    expectations are exact; ``null`` is infinite, or, given success, undefined."""
    variables = tree.task.variables
    data: dict[str, Any] = {
        "format": "bbtc-figures",
        "version": 1,
        "domain": tree.task.domain,
        "problem": tree.task.problem,
        "success": figure_text(figures.success),
        "failure": figure_text(figures.failure),
        "blocked": figure_text(figures.blocked),
        "endless": figure_text(figures.endless),
        "failures": [
            {
                "p": figure_text(share.probability),
                "node": share.node,
                "condition": condition_to_json(share.condition, variables) if share.condition else None,
                "value": truth_of(share.status),
            }
            for share in figures.failures
        ],
        "cost": _figure(figures.cost),
        "cost_given_success": _figure(figures.cost_given_success),
        "actions": _figure(figures.actions),
        "actions_given_success": _figure(figures.actions_given_success),
        "reward": _figure(figures.reward),
        "states": figures.states,
        **({"mistaken": figure_text(figures.mistaken)} if figures.mistaken else {}),
        **({"worst_world": _worst_world(figures.worst)} if figures.worst is not None else {}),
        **({} if figures.worst_untold is None else {"worst_world_untold": figures.worst_untold}),
        "scenarios": [
            {
                "p": figure_text(run.probability),
                "status": _ending(run.status),
                "initial": values_to_json(tree, run.initial),
                "steps": [
                    {
                        "node": step.node.id,
                        "action": step.node.action,
                        "assign": values_to_json(tree, step.values),
                    }
                    for step in run.steps
                ],
            }
            for run in scenarios
        ],
    }
    if sampling is not None:
        data["sampling"] = {
            "samples": sampling.samples,
            "seed": sampling.seed,
            "successes": sampling.successes,
            "cut": sampling.cut,
        }
    return data


def _worst_world(worst: WorstWorld) -> dict[str, Any]:
    facts = {fact: Truth.of(fact in worst.true).word for fact in worst.facts}
    return {"success": figure_text(worst.success), "facts": facts}


def values_to_json(tree: Tree, values: Values) -> dict[str, str | int]:
    """The value of each variable, and of each number, by name."""
    return values_in_words(tree.task.variables, values)


def failing_run_to_json(tree: Tree, failing: FailingRun) -> dict[str, Any]:
    """A run that fails: its actions with what each changed, the facts it lacks at the root, and where it
    stopped."""
    variables, run, stop = tree.task.variables, failing.run, failing.stop
    befores = [run.initial, *(step.values for step in run.steps)]
    return {
        "p": figure_text(run.probability),
        "status": _ending(run.status),
        "steps": [
            {
                "node": step.node.id,
                "action": step.node.action,
                "changes": differences(variables, before, step.values),
            }
            for before, step in zip(befores, run.steps, strict=False)
        ],
        "missing": [
            {
                "fact": block.fact,
                "needed": block.value.word,
                "now": block.now.word,
                "by": block.action,
                "setters": [*block.setters],
            }
            for block in failing.blocks
        ],
        "lost": [condition_to_json(part, variables) for part in failing.lost],
        "node": stop.node,
        "condition": None if stop.condition is None else condition_to_json(stop.condition, variables),
        "value": None if stop.status is None else truth_of(stop.status),
    }


def _ending(status: NodeStatus) -> str:
    return "blocked" if status is NodeStatus.RUNNING else status.word


def truth_of(status: NodeStatus) -> str:
    """What a condition was that did not succeed."""
    return "unknown" if status is NodeStatus.RUNNING else "false"


def _figure(value: Fraction | None) -> str | None:
    return None if value is None else figure_text(value)
