"""Figures of disturbed worlds in words."""

from __future__ import annotations

from fractions import Fraction

from bbtc.artefacts.numbers import exact
from bbtc.belief.draws import Values
from bbtc.cli.counting import counted
from bbtc.cli.wording import stopped
from bbtc.disturbance.intervals import Interval
from bbtc.disturbance.perturbed import PerturbedRuns
from bbtc.disturbance.recovery import Recovery
from bbtc.ground.condition import number_in
from bbtc.kleene import Truth
from bbtc.rounding import decimal
from bbtc.tree.nodes import Tree

_MOST_GROUPS = 6  # ways to give up that are told
_MOST_FACTS = 6  # facts of a state that are told


def perturbed_lines(found: PerturbedRuns) -> list[str]:
    """What came of the runs of a tree where facts change by chance."""
    won = found.cost_given_success
    given = "" if won is None else f"; {_near(won)} given success"
    ends = [
        ("missed ", found.missed, ": success without the goal"),
        ("failure", found.failures, ""),
        ("blocked", found.blocked, ""),
        ("cut    ", found.cut, f": no end after {counted(found.most_ticks, 'tick')}"),
    ]
    groups = f", {counted(found.groups, 'group')} of exclusive facts" if found.groups else ""
    how = f"{counted(found.runs, 'run')}, seed {found.seed}"
    what = f"{counted(found.facts, 'fact')} may change{groups}"
    unready = f"{found.unready} of {found.starts} started without their precondition"
    return [
        f"perturbed by {exact(found.rate)} a tick: {how}; {what}",
        f"  success   {_near(found.success)} ({_interval(found.interval)})",
        *(f"  {word}   {_near(Fraction(count, found.runs))}{note}" for word, count, note in ends if count),
        f"  actions   {_near(found.actions)} on average; {unready}",
        f"  cost      {_near(found.cost)} on average{given}",
        f"  changes   {_near(Fraction(found.changes, found.runs))} on average",
    ]


def recovery_lines(tree: Tree, found: Recovery, whole: bool) -> list[str]:
    """What a new tree attains from any state, and where it gives up; ``whole``: the task has all its
    actions."""
    what = f"{counted(found.states, 'state')} that {'' if whole else 'its '}actions lead to"
    which = f"all {what}" if found.taken == found.states else f"{found.taken} of {what}, seed {found.seed}"
    if found.hopeless:
        which += f"; from {found.hopeless} of them nothing reaches the goal, the others count"
    attained = f"from {found.attained} of {found.hopeful}{_bracketed(found.attained_interval)}"
    lines = [
        f"recovery from {which}",
        f"  attained  the best that is possible {attained}",
        f"  mean      {exact(found.mean)} of the best{_bracketed(found.mean_interval)}",
    ]
    if found.worst is not None:
        worst = found.worst
        where = _state(tree, worst.state)
        lines.append(f"  worst     {exact(worst.success)} of {exact(worst.best)}, from {where}")
    ends = [
        ("lost   ", found.lost, ": comes to where the goal is out of reach"),
        ("missed ", found.missed, ": success without the goal"),
        ("endless", found.endless, ""),
    ]
    lines.extend(f"  {word}   {exact(share)}{note}" for word, share, note in ends if share)
    if found.given_up:
        lines.append(
            "  gives up where the goal is in reach, by what is missing (shares of the runs from all of them):"
        )
    for each in found.given_up[:_MOST_GROUPS]:
        what = stopped(tree, each.node, each.condition, each.status)
        where = f"{counted(each.states, 'state')}, such as {_state(tree, each.example)}"
        lines.append(f"    {exact(each.share)}: {what}, node {each.node} ({where})")
    rest = sum((each.share for each in found.given_up[_MOST_GROUPS:]), Fraction(0))
    if rest:
        lines.append(f"    {exact(rest)}: in {len(found.given_up) - _MOST_GROUPS} other ways")
    return lines


def _state(tree: Tree, values: Values) -> str:
    """A state in words: what is true and what is unknown, in short."""
    pairs = list(zip(tree.task.variables, values, strict=True))
    told = [variable.name for variable, value in pairs if value == Truth.TRUE and variable.digit is None]
    told += [f"{each.name} = {each.low + number_in(each.digits, values)}" for each in tree.task.numbers]
    told += [f"unknown {variable.name}" for variable, value in pairs if value == Truth.UNKNOWN]
    more = f" and {len(told) - _MOST_FACTS} more" if len(told) > _MOST_FACTS else ""
    return ", ".join(told[:_MOST_FACTS]) + more if told else "nothing true"


def _bracketed(interval: Interval | None) -> str:
    return "" if interval is None else f" ({_interval(interval)})"


def _interval(interval: Interval) -> str:
    return f"95 %: {_near(interval.lower)} to {_near(interval.upper)}"


def _near(value: Fraction) -> str:
    return decimal(value, 6)
