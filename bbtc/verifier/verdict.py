"""Does a tree do what it claims? Its figures, recomputed without the simulator and the planner."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Literal, TypeAlias

from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.rounding import brief, decimal
from bbtc.tree.nodes import Tree
from bbtc.verifier import storm
from bbtc.verifier.chain import chain_of, solvable_chain
from bbtc.verifier.explore import explore
from bbtc.verifier.prism import counted
from bbtc.verifier.program import REWARDS, Program
from bbtc.verifier.solve import Recomputed, recompute
from bbtc.verifier.worlds import space_of

if TYPE_CHECKING:
    from bbtc.verifier.timed import TimeFound

Engine: TypeAlias = Literal["auto", "own", "storm", "all"]

TOLERANCE = Fraction(1, 10**9)
"""The greatest difference between a claim and what Storm found; of our own solver, which is exact, none
is taken."""


@dataclass(frozen=True, slots=True)
class StormFigures:
    """What Storm found: bounds, equal where it computed exactly (None: infinite)."""

    version: str
    states: int
    exact: bool
    figures: tuple[tuple[str, storm.Answer], ...]

    @property
    def success(self) -> storm.Answer:
        """The probability of success."""
        return dict(self.figures)["success"]


@dataclass(frozen=True, slots=True)
class Verdict:
    """The figures that each engine found (None: it was not asked), and every disagreement. Where facts are
    ``hidden``, ``worlds`` are the figures of the runs world by world (None: there are too many of them)."""

    tree: Tree
    own: Recomputed | None
    storm: StormFigures | None
    problems: tuple[Diagnostic, ...]
    hidden: bool = False
    worlds: Recomputed | None = None
    time: TimeFound | None = None

    def raise_problems(self) -> None:
        """Raise :class:`BbtcError` unless the tree is what it claims to be."""
        if self.problems:
            raise BbtcError(self.problems)


def verify(tree: Tree, limits: Limits, engine: Engine = "auto", hidden: Task | None = None) -> Verdict:
    """Recompute the figures of a tree. ``auto`` asks Storm, too, where it is installed. ``hidden`` is the
    task with hidden facts that the task of the tree stands for: our own solver looks at its worlds, too.

    Raises ``LimitReached``, :class:`BbtcError` where Storm is wanted and cannot answer, and ``ValueError``
    for a tree whose own task hides facts; what disagrees stands in the verdict.
    """
    if tree.task.components:
        raise ValueError("the task hides facts: give one that it stands for, and this one as `hidden`")
    own = found = worlds = None
    time: TimeFound | None = None
    if engine != "storm":
        own = recompute(explore(solvable_chain(tree.task, tree.root), limits), limits)
        time = _time(tree, limits, hides=hidden is not None)
        space = None if hidden is None else space_of(hidden, tree.root, limits)
        worlds = None if space is None else recompute(space, limits)
    if engine in {"storm", "all"} or (engine == "auto" and storm.is_installed()):
        found = _ask_storm(chain_of(tree.task, tree.root), limits)
    looked = _Looked(own, found, hidden is not None, worlds)
    problems = (*_problems(tree, looked), *_late(tree, time))
    return Verdict(tree, own, found, problems, looked.hidden, worlds, time)


def _time(tree: Tree, limits: Limits, *, hides: bool) -> TimeFound | None:
    """The time that the tree takes; None where no action says how long it takes. Where facts are hidden, the
    program does not tell whether a goal that is believed is true: success in time is left out."""
    if all(action.duration is None for action in tree.task.actions):
        return None
    from bbtc.verifier.timed import time_found

    seconds = None if hides or tree.success_by is None else tree.success_by.seconds
    return time_found(tree.task, tree.root, limits, seconds)


def _late(tree: Tree, time: TimeFound | None) -> Iterator[Diagnostic]:
    """What the tree claims of a deadline, where that cannot be."""
    by, found = tree.success_by, None if time is None else time.by
    if by is None or found is None:
        return
    if by.at_least > Fraction(found[1]) + TOLERANCE or by.at_most < Fraction(found[0]) - TOLERANCE:
        claimed = f"from {decimal(by.at_least, 9)} to {decimal(by.at_most, 9)}"
        message = f"the tree claims success within {decimal(by.seconds, 12)} s {claimed}"
        yield _disagreement(f"{message}; it is from {found[0]:.9g} to {found[1]:.9g}")


def _ask_storm(program: Program, limits: Limits) -> StormFigures:
    properties = {end: f'P=? [F "{end}"]' for end in ("success", "failure", "blocked")}
    for number in counted(program):
        properties[REWARDS[number]] = f'R{{"{REWARDS[number]}"}}=? [F "finished"]'
    answers = storm.ask(program, list(properties.values()), limits)
    figures = tuple(zip(properties, answers.values, strict=True))
    return StormFigures(answers.version, answers.states, answers.exact, figures)


@dataclass(frozen=True, slots=True)
class _Looked:
    """What was found by those who looked. Where facts are hidden, a tree that stops where the goal is not
    true is no fault, but this is no success: its root succeeds at least as often as the tree claims to."""

    own: Recomputed | None
    storm: StormFigures | None
    hidden: bool
    worlds: Recomputed | None

    @property
    def success(self) -> tuple[Fraction, Fraction] | None:
        """Bounds on the success probability, found by our own solver: equal but for what is hidden in more
        worlds than are looked at."""
        if self.worlds is not None:
            return (self.worlds.success - self.worlds.without_goal,) * 2
        if self.own is None:
            return None
        return self.own.success - (self.own.without_goal if self.hidden else 0), self.own.success


def _problems(tree: Tree, looked: _Looked) -> Iterator[Diagnostic]:
    claimed, own, found, worlds = tree.success_probability, looked.own, looked.storm, looked.worlds
    if looked.success is not None and not looked.success[0] <= claimed <= looked.success[1]:
        told = " or ".join(dict.fromkeys(brief(bound) for bound in looked.success))
        yield _disagreement(f"the tree claims a success probability of {brief(claimed)}; it is {told}")
    if found is not None:
        least = found.success.lower or Fraction(0)
        short = claimed - least > TOLERANCE if looked.hidden else not _agree(found.success, claimed)
        if short:
            yield _disagreement(
                f"the tree claims a success probability of {brief(claimed)}; Storm finds {brief(least)}"
            )
    if own is not None and found is not None:
        for name, answer in found.figures:
            if not _agree(answer, own.figure(name)):
                yield _disagreement(f"the figure '{name}': our solver and Storm disagree")
    if own is not None and worlds is not None:
        for name in ("success", "failure", "blocked", "actions", "cost", "reward"):
            if worlds.figure(name) != own.figure(name):
                yield _disagreement(f"the figure '{name}' is another, world by world")
    yield from _contradictions(tree)
    if own is not None:
        yield from _unsound(own, looked.hidden)


def _agree(answer: storm.Answer, value: Fraction | None) -> bool:
    """Is the value at most the tolerance outside the bounds? It is relative where values exceed 1."""
    if value is None or answer.lower is None or answer.upper is None:
        return value is None and answer.lower is None
    slack = TOLERANCE * max(Fraction(1), abs(value))
    return answer.lower - slack <= value <= answer.upper + slack


def _contradictions(tree: Tree) -> Iterator[Diagnostic]:
    """What the tree says about itself that cannot all be true."""
    claimed = tree.success_probability if tree.success_by is None else tree.success_by.at_least
    contradicted = tree.status == ("out-of-reach" if claimed >= tree.target else "target-reached")
    if contradicted:
        yield _disagreement(
            f"the status is '{tree.status}', but the target is {brief(tree.target)} and the claim "
            f"{brief(claimed)}"
        )
    claimed = tree.success_probability
    if tree.bounds is not None and claimed > tree.bounds[1]:
        yield _disagreement(
            f"the tree claims {brief(claimed)}, more than the {brief(tree.bounds[1])} that it says any "
            "policy can reach"
        )


def _unsound(own: Recomputed, hidden: bool) -> Sequence[Diagnostic]:
    found = []
    if own.without_goal and not hidden:
        found.append(
            f"with probability {brief(own.without_goal)} the tree succeeds where the goal is not true"
        )
    if own.unready:
        found.append("an action can start where its precondition is not true")
    return [Diagnostic("BBT0802", message) for message in found]


def _disagreement(message: str) -> Diagnostic:
    return Diagnostic("BBT0801", message)
