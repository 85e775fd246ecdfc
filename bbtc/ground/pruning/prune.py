"""Leaves out of a task with templates what cannot matter to its goal.

What the body of a template calls, and with which arguments, is known only once it is made; without
templates :mod:`bbtc.ground.pruning.relevance` tells from argument rows, before anything is made.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Literal, TypeAlias

from typing_extensions import assert_never

from bbtc.ground import task as gt
from bbtc.ground.condition import Condition, variables
from bbtc.ground.pruning.renumber import reordered
from bbtc.markov import reachable


def prune(task: gt.Task) -> gt.Task:
    """The task without variables that nothing kept reads, without the effects on them, and without
    actions and templates that change nothing that matters.

    Backward relevance: the goal's variables matter; what sets a variable that matters is kept, and
    with it the variables its precondition and guards read. A template is kept if its guide sets a
    variable that matters (only its guide makes a planner insert it), or if a kept one calls it;
    then all its body is kept. An event is kept if it sets a variable that matters, and with it every action.
    Outcomes that become equal are merged. Under a reward metric actions with rewards are kept too.
    """
    relevant = _relevant(task)
    actions = [each for index, each in enumerate(task.actions) if ("action", index) in relevant]
    events = [each for index, each in enumerate(task.events) if ("event", index) in relevant]
    templates = [each for index, each in enumerate(task.templates) if ("template", index) in relevant]
    kept = [index for index in range(len(task.variables)) if ("variable", index) in relevant]
    if len(actions) < len(task.actions) or len(templates) < len(task.templates):
        task = replace(task, actions=tuple(actions), templates=tuple(templates))
    if len(events) < len(task.events):
        task = replace(task, events=tuple(events))
    return task if len(kept) == len(task.variables) else reordered(task, kept)


# --- relevance -------------------------------------------------------------------------------

_Node: TypeAlias = tuple[Literal["variable", "action", "event", "template"], int]


def _relevant(task: gt.Task) -> set[_Node]:
    """What can be reached from the goal where a variable leads to what sets it and to the guards of that, and
    an action or a template to what it reads and calls."""
    actions = {action.name: index for index, action in enumerate(task.actions)}
    templates = {template.name: index for index, template in enumerate(task.templates)}
    setters: dict[int, list[_Node]] = {}
    owners: list[tuple[_Node, tuple[gt.Factor, ...]]] = [
        *((("action", index), action.possible_factors) for index, action in enumerate(task.actions)),
        *((("event", index), event.factors) for index, event in enumerate(task.events)),
        *((("template", index), template.factors) for index, template in enumerate(task.templates)),
    ]
    for owner, factors in owners:
        for effect in gt.effects_of(factors):
            for variable, _ in effect.sets:
                setters.setdefault(variable, []).extend([owner, *_read(effect.when)])

    def leads(node: _Node) -> Iterator[_Node]:
        kind, index = node
        if kind == "variable":
            yield from setters.get(index, ())
            return
        if kind == "event":
            yield from _read(task.events[index].precondition)
            # An action that does nothing else may be there to wait for it.
            yield from (("action", number) for number in range(len(task.actions)))
            return
        each = task.actions[index] if kind == "action" else task.templates[index]
        yield from _read(each.precondition)
        factors = each.possible_factors if isinstance(each, gt.GroundAction) else each.factors
        for charge in gt.charges_of(factors):
            yield from _read(charge.when)
        for part in gt.walk_body(each.body) if isinstance(each, gt.GroundTemplate) else ():
            match part:
                case gt.BodyCondition(condition):
                    yield from _read(condition)
                case gt.BodyAction(action):
                    yield "action", actions[action]
                case gt.BodyTemplate(called):
                    yield "template", templates[called]
                case gt.BodyControl():
                    pass
                case _:
                    assert_never(part)

    start = list(_read(task.goal))
    if task.metric == "reward":
        start += [node for node, factors in owners if node[0] == "action" and _earns(factors)]
    start += [node for node, factors in owners if node[0] == "event" and _counts(factors)]
    return reachable(start, leads)


def _read(condition: Condition | None) -> Iterator[_Node]:
    return (("variable", number) for number in (() if condition is None else variables(condition)))


def _earns(factors: Iterable[gt.Factor]) -> bool:
    return any(
        outcome.reward or any(charge.reward for charge in outcome.charges)
        for outcome in gt.outcomes_of(factors)
    )


def _counts(factors: Iterable[gt.Factor]) -> bool:
    return any(outcome.cost or outcome.reward or outcome.charges for outcome in gt.outcomes_of(factors))


# --- leaving out -----------------------------------------------------------------------------
