"""What any policy can reach, in words and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from bbtc.artefacts.numbers import exact, figure_text
from bbtc.cli.counting import counted
from bbtc.cli.wording import at, block_line, external_note, oneof_note, steps_of, within
from bbtc.ground.describe import describe
from bbtc.ground.task import Task
from bbtc.printable import printable
from bbtc.tree.nodes import Tree

if TYPE_CHECKING:
    from bbtc.planner.bounds import TaskValue
    from bbtc.planner.why_not import DeadEnd

_MOST_ENDS = 10  # dead ends told
_MOST_BLOCKS = 3  # causes told of one of them


def best_possible(lower: Fraction, upper: Fraction) -> str:
    """``1/2 (0.5)``, or ``between 1/2 (0.5) and 1``."""
    return exact(lower) if lower == upper else f"between {exact(lower)} and {exact(upper)}"


def bounds_report(task: Task, value: TaskValue, target: Fraction) -> str:
    """The value of a task, as lines of text."""
    verdict = "undecided"
    if value.lower >= target:
        verdict = "can be reached"
    elif value.upper < target:
        verdict = "out of reach"
    lines = [
        f"{task.domain}/{task.problem}: goal {describe(task, task.goal)}",
        f"best success probability{within(value.max_actions)}: {best_possible(value.lower, value.upper)}",
        f"target {exact(target)}: {verdict}",
    ]
    if value.cost is not None:
        mark = "" if value.cost_exact else "about "
        lines.append(f"least expected cost of reaching it so often: {mark}{exact(value.cost)}")
    some = "" if value.expanded == value.states else f" found, {value.expanded} expanded"
    lines.append(f"{counted(value.states, 'state')}{some}, {counted(value.choices, 'choice')}")
    note = oneof_note(task)
    if note:
        lines.append(f"oneof: {note}")
    note = external_note(task)
    if note:
        lines.append(f"external: {note}")
    if value.stop is not None:
        lines.append(value.stop.message)
    if value.interrupted:
        lines.append("interrupted")
    return "".join(f"{printable(line)}\n" for line in lines)


def bounds_lines(tree: Tree, max_actions: int | None = None) -> list[str]:
    """What any policy can reach, within a number of actions, as far as the planner found out."""
    if tree.bounds is None:
        return []
    return [f"the best that any policy can do{within(max_actions)} is {best_possible(*tree.bounds)}"]


def dead_end_lines(tree: Tree, ends: Sequence[DeadEnd], max_actions: int | None = None) -> list[str]:
    """Why a target is out of reach: where runs end, the most probable first, with the line of the
    action it is due to, what that comes from, and the most probable run to it. Within a number of
    actions, those that lose no part of the goal by itself have run out of actions, and are told in sum."""
    lines = []
    late = sum((end.probability for end in ends if not end.lost), Fraction(0))
    if max_actions is not None and late:
        ends = [end for end in ends if end.lost]
        lines.append(f"  {exact(late)}: too few of the {counted(max_actions, 'action')} are left")
    for end in ends[:_MOST_ENDS]:
        why = " and ".join(end.lost) or "the goal as a whole"
        when = "from the start" if end.action is None else f"after {end.action}{at(end.span)}"
        lines.append(f"  {exact(end.probability)}: {when}, nothing can bring about {why}")
        lines.extend(f"    {block_line(block)}" for block in end.blocks[:_MOST_BLOCKS])
        if end.run is not None and end.run.steps:
            share = "" if end.run.probability == end.probability else f", {exact(end.run.probability)}"
            lines.append(f"    most probably so{share}:")
            lines.extend(f"      {line}" for line in steps_of(tree, end.run))
    rest = ends[_MOST_ENDS:]
    if rest:
        probability = exact(sum((end.probability for end in rest), Fraction(0)))
        lines.append(f"  {probability}: {counted(len(rest), 'more way')} to end without the goal")
    return lines


def bounds_json(value: TaskValue, target: Fraction) -> str:
    """The value of a task as a JSON object; numbers are exact, as text."""
    found: dict[str, object] = {
        "lower": figure_text(value.lower),
        "upper": figure_text(value.upper),
        "target": figure_text(target),
        "max_actions": value.max_actions,
        "cost": None if value.cost is None or not value.cost_exact else figure_text(value.cost),
        "states": value.states,
        "expanded": value.expanded,
        "choices": value.choices,
        "stop": None if value.stop is None else value.stop.message,
    }
    return json.dumps(found, indent=2, ensure_ascii=False) + "\n"
