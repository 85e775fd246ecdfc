"""Figures and refinements in words."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from bbtc.artefacts.numbers import exact
from bbtc.belief.tick import NodeStatus
from bbtc.cli.counting import counted
from bbtc.ground.condition import Condition
from bbtc.ground.describe import describe, differences
from bbtc.ground.task import Factor, Task
from bbtc.kleene import Truth
from bbtc.printable import printable
from bbtc.source import Span
from bbtc.tree.nodes import Tree, retries_of, walk

if TYPE_CHECKING:
    from bbtc.belief.scenarios import Scenario
    from bbtc.belief.simulate import Figures
    from bbtc.belief.worst_world import WorstWorld
    from bbtc.planner.failing_runs import FailingRun
    from bbtc.planner.result import Plan, Refinement
    from bbtc.planner.why_not import Block

_MOST_NAMED = 5  # actions named of many
_MOST_BLOCKS = 3  # causes told of one run
_MOST_STEPS = 12  # actions told of one run


def changes(tree: Tree, before: bytes, after: bytes) -> str:
    """``seen(soda) = true, …``: the variables that differ, with their new values."""
    found = differences(tree.task.variables, before, after)
    changed = [f"{name} = {value}" for name, value in found.items()]
    return printable(", ".join(changed)) or "no change"


def refinement_line(number: int, step: Refinement) -> list[str]:
    """One refinement as lines of text: what stopped the runs, what was done, what came of it."""
    why = f"{step.condition} is {step.value.word} in {exact(step.probability)} of the runs"
    if step.kind == "retreat":
        taken = counted(step.taken_back, "refinement")
        return [
            f"{number:3d}. no progress: take back {taken} and never again insert {step.inserted} here",
            f"     success {exact(step.success)}, {step.nodes} nodes",
        ]
    if step.kind == "move":
        what = f"move the branch of {step.inserted}, which undid it, before it"
    else:
        verb = "observe" if step.value is Truth.UNKNOWN else "achieve"
        chances = [f"with probability {exact(step.chance)}"] if step.chance else []
        if step.observable:
            chances.append(f"to be observed with probability {exact(step.observable)}")
        if step.unmet:
            chances.append(f"after {counted(step.unmet, 'precondition')} not yet met")
        what = f"insert {step.inserted} to {verb} it ({', '.join(chances)})"
    return [f"{number:3d}. {why}", f"     {what}", f"     success {exact(step.success)}, {step.nodes} nodes"]


def simplified_line(last: Refinement, tree: Tree) -> list[str]:
    """What was made of the tree after its last refinement, if anything was."""
    nodes = sum(1 for _ in walk(tree.root))
    if (nodes, tree.success_probability) == (last.nodes, last.success):
        return []
    bounded = ", with no more attempts than the target takes" if any(retries_of(tree.root)) else ""
    return [
        f"     then simplified{bounded}:",
        f"     success {exact(tree.success_probability)}, {nodes} nodes",
    ]


def worst_world_line(figures: Figures) -> list[str]:
    """What a tree attains in the worst world, where that is less than in the mean, or why nobody knows."""
    worst = figures.worst
    if figures.worst_untold is not None:
        return [f"the worst world is not told: {figures.worst_untold}"]
    if worst is None or worst.success == figures.success:
        return []
    return [f"success probability {exact(worst.success)} {worst_world(worst)}, the worst world"]


def plan_summary(plan: Plan, max_actions: int | None = None) -> list[str]:
    """How planning ended, in words; ``max_actions``: within that many actions."""
    tree = plan.tree
    reached = f"success probability {exact(tree.success_probability)}"
    wanted = exact(tree.target)
    match tree.status:
        case "target-reached":
            return [f"target {wanted} reached: {reached}"]
        case "out-of-reach":
            policy = f"any policy{within(max_actions)}"
            return [f"target {wanted} is out of reach of {policy}; the best tree has {reached}"]
        case "stuck":
            return [f"target {wanted} not reached: nothing is left to insert; the best tree has {reached}"]
        case "limit-reached":
            stop = f"{plan.stop.message} ({plan.stop.hint})" if plan.stop is not None else "a limit"
            return [f"target {wanted} not reached: {stop}; the best tree so far has {reached}"]
        case "interrupted":
            return [f"interrupted; the best tree so far has {reached}"]


def within(max_actions: int | None) -> str:
    """`` with at most 3 actions``; nothing where their number is not bounded."""
    return "" if max_actions is None else f" with at most {counted(max_actions, 'action')}"


def oneof_note(task: Task) -> str:
    """Which actions have outcomes whose probabilities nobody knows; empty where none has."""
    names = list(dict.fromkeys(a.schema for a in task.actions if any(map(_has_oneof, a.factors))))
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    listed = printable(", ".join(names[:_MOST_NAMED]))
    return f"outcomes of {listed}{more} count as equally likely" if names else ""


def external_note(task: Task) -> str:
    """Which facts others may change though figures take them to stay; empty where there are none."""
    names = list(dict.fromkeys(variable.predicate for variable in task.variables if variable.external))
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    listed = printable(", ".join(names[:_MOST_NAMED]))
    return f"others may change {listed}{more}; figures take it that they do not" if names else ""


def _has_oneof(factor: Factor) -> bool:
    return factor.oneof or any(_has_oneof(inner) for each in factor.outcomes for inner in each.factors)


def rerolled_note(actions: Sequence[str]) -> list[str]:
    """That figures rest on noisy readings that are made again; nothing where there are none."""
    if not actions:
        return []
    more = f" and {len(actions) - _MOST_NAMED} more" if len(actions) > _MOST_NAMED else ""
    listed = printable(", ".join(actions[:_MOST_NAMED]))
    return [f"of {listed}{more} are made again, and count as drawn anew (see :repeats)"]


def worst_world(worst: WorstWorld) -> str:
    """Which world is the worst, in words."""
    listed = [fact for fact in worst.facts if fact in worst.true]
    if len(worst.facts) == 1 and not listed:
        return f"where {printable(worst.facts[0])} is false at the start"
    more = f" and {len(listed) - _MOST_NAMED} more" if len(listed) > _MOST_NAMED else ""
    others = "" if len(listed) == len(worst.facts) else ", and no other hidden fact,"
    shown = f"{printable(', '.join(listed[:_MOST_NAMED]))}{more}{others}" if listed else "no hidden fact"
    return f"where {shown} {'is' if len(listed) < 2 else 'are'} true at the start"


def figures_report(tree: Tree, figures: Figures) -> list[str]:
    """The figures of a tree as lines of text."""
    lines = [f"success   {exact(figures.success)}", f"failure   {exact(figures.failure)}"]
    if figures.mistaken:
        lines.append(f"mistaken  {exact(figures.mistaken)}: the tree succeeds, but the goal is not true")
    if figures.blocked:
        lines.append(f"blocked   {exact(figures.blocked)}")
    if figures.endless:
        lines.append(f"endless   {exact(figures.endless)}")
    if figures.worst is not None and figures.worst.success < 1:
        alike = figures.worst.success == figures.success
        where = "in every world" if alike else worst_world(figures.worst)
        lines.append(f"worst     {exact(figures.worst.success)} {where}")
    if figures.worst_untold is not None:
        lines.append(f"worst     not told: {figures.worst_untold}")
    for share in figures.failures:
        what = stopped(tree, share.node, share.condition, share.status)
        lines.append(f"  {exact(share.probability)}: {what}, node {share.node}")
    lines.append(f"cost      {expected(figures.cost, figures.cost_given_success)}")
    lines.append(f"actions   {expected(figures.actions, figures.actions_given_success)}")
    if tree.task.counts_reward:
        lines.append(f"reward    {expected(figures.reward, None)}")
    lines.append(f"states    {figures.states}")
    note = oneof_note(tree.task)
    if note:
        lines.append(f"oneof     {note}")
    note = external_note(tree.task)
    if note:
        lines.append(f"external  {note}")
    return lines


def stopped(tree: Tree, node: str, condition: Condition | None, status: NodeStatus) -> str:
    """What stopped a run at a node, in words."""
    if condition is not None:
        word = "unknown" if status is NodeStatus.RUNNING else "false"
        return f"{describe(tree.task, condition)} is {word}"
    number = {retry.id: attempts for retry, attempts in retries_of(tree.root)}.get(node)
    if number is None:
        return "no condition failed"
    what = "the only attempt used up" if number == 1 else f"all {number} attempts used up"
    return f"{what} (blocked)" if status is NodeStatus.RUNNING else what


def failing_lines(tree: Tree, runs: Sequence[FailingRun], rest: Fraction) -> list[str]:
    """The most probable runs that fail: what each lacks, and what it did; the others in sum."""
    lines = ["failing runs, the most probable first:"] if runs else []
    for each in runs:
        status = each.run.status
        ending = ", blocked" if status is NodeStatus.RUNNING else ""
        whys = [block_line(block, " of the tree") for block in each.blocks[:_MOST_BLOCKS]]
        if not whys and each.lost:
            lost = " and ".join(describe(tree.task, part) for part in each.lost)
            whys = [f"no action of the tree can bring about {lost}"]
        if not whys:
            node, condition = each.stop.node or tree.root.id, each.stop.condition
            what = stopped(tree, node, condition, status if each.stop.status is None else each.stop.status)
            whys = [f"{what}, node {node}: the goal may be in reach, but the tree has nothing left to try"]
        lines.append(f"  {exact(each.run.probability)}{ending}: {whys[0]}")
        lines.extend(f"    and {why}" for why in whys[1:])
        lines.extend(f"    {line}" for line in steps_of(tree, each.run))
    if rest and runs:
        lines.append(f"  {exact(rest)}: other runs")
    return lines


def run_lines(tree: Tree, run: Scenario) -> list[str]:
    """The actions of a run, each with what its outcome changed."""
    befores = [run.initial, *(step.values for step in run.steps)]
    return [
        f"{step.node.action}: {changes(tree, before, step.values)}"
        for before, step in zip(befores, run.steps, strict=False)
    ]


def steps_of(tree: Tree, run: Scenario) -> list[str]:
    """The actions of a run; of very many, the last ones."""
    lines = run_lines(tree, run) or ["no action started"]
    left_out = len(lines) - _MOST_STEPS
    if left_out <= 1:
        return lines
    return [f"{counted(left_out, 'action')} before, then", *lines[left_out:]]


def block_line(block: Block, whose: str = "") -> str:
    """A fact that nothing brings back, in words. ``whose`` says which actions were asked, if not all."""
    needing = f"the goal{at(block.span)}" if block.action is None else f"{block.action}{at(block.span)}"
    if block.setters:
        listed = ", ".join(block.setters[:_MOST_BLOCKS])
        more = f" and {len(block.setters) - _MOST_BLOCKS} more" if len(block.setters) > _MOST_BLOCKS else ""
        lead = {Truth.TRUE: "", Truth.FALSE: "not ", Truth.UNKNOWN: "unknown "}[block.value]
        return (
            f"{needing} needs {lead}{block.fact}, and no action{whose} brings it back: "
            f"{listed}{more} can never do so"
        )
    if block.value is Truth.UNKNOWN:
        return f"{needing} needs {block.fact} to be unknown, and no action{whose} makes it that"
    negation = "" if block.value is Truth.TRUE else "not "
    if block.now is Truth.UNKNOWN:
        return (
            f"{needing} needs {negation}{block.fact}, which is unknown: "
            f"no action{whose} observes or achieves it"
        )
    return f"{needing} needs {negation}{block.fact}, and no action{whose} makes that true"


def at(span: Span | None) -> str:
    """Where it stands, in brackets; nothing where that is not known."""
    return "" if span is None else f" [{span.place}]"


def expected(value: Fraction | None, given_success: Fraction | None) -> str:
    """An expectation, overall (None: infinite) and given success (None: there is none)."""
    text = f"{exact(value)} expected" if value is not None else "infinite"
    return text + (f"; {exact(given_success)} given success" if given_success is not None else "")
