"""What every simulated world of an exported program is made of: the exact outcome distribution of the
task, as far as the tree can tell."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from bbtc.backends.interface import guard_of
from bbtc.backends.shape import normal
from bbtc.ground.condition import FALSE, TRUE, Condition, variables
from bbtc.ground.task import GroundAction, Outcome, Task, effects_of
from bbtc.kleene import Truth
from bbtc.markov import distribution
from bbtc.tree.nodes import ActionNode, ConditionNode, Tree, actions_of, walk


@dataclass(frozen=True, slots=True)
class Changes:
    """What an outcome sets if a condition in normal form is true in the state before the action."""

    when: Condition
    sets: dict[int, Truth]


def actions_used(tree: Tree) -> list[GroundAction]:
    """The actions that a tree runs, by name."""
    names = dict.fromkeys(node.action for node in actions_of(tree.root))
    return [tree.task.action_by_name[name] for name in sorted(names)]


def relevant_variables(tree: Tree) -> list[int]:
    """What the tree, an effect or an observation reads, or an action of the tree sets."""
    task = tree.task
    found: set[int] = set()
    for node in walk(tree.root):
        if isinstance(node, ConditionNode):
            found.update(variables(normal(task, node.condition)))
        elif isinstance(node, ActionNode):
            found.update(variables(guard_of(task, node) or TRUE))
    factors = [factor for action in actions_used(tree) for factor in action.possible_factors]
    for action in actions_used(tree) if task.events else ():
        found.update(variables(normal(task, action.during or TRUE)))
    for event in task.events:
        found.update(variables(normal(task, event.precondition)))
        factors += event.factors
    for effect in effects_of(factors):
        found.update(index for index, _ in effect.sets)
        if effect.when is not None:
            found.update(variables(normal(task, effect.when)))
    if tree.monitor is not None:
        found |= tree.monitor.seen | tree.monitor.known | tree.monitor.drawn
        for telling in tree.monitor.tellings:
            found.update(variables(telling.observation.condition))
            found.update(variables(telling.observation.when or TRUE))
    return sorted(found)


def initial_values(task: Task, relevant: list[int]) -> dict[tuple[Truth, ...], Fraction]:
    """The values that some variables may start with, and how probably."""
    return distribution(
        (tuple(state.values[index] for index in relevant), state.probability) for state in task.initial
    )


def changes_of(task: Task, outcome: Outcome) -> list[Changes]:
    """What an outcome itself sets: always, which comes first, and under conditions. Where an effect sets a
    variable twice, the Kleene maximum wins."""
    always = Changes(TRUE, {})
    found = [always]
    for effect in outcome.effects:
        when = TRUE if effect.when is None else normal(task, effect.when)
        changes = always if when == TRUE else Changes(when, {})
        for index, value in effect.sets:
            changes.sets[index] = max(value, changes.sets.get(index, Truth.FALSE))
        if when not in (TRUE, FALSE) and changes.sets:
            found.append(changes)
    return found
