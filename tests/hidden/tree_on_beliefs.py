"""Runs of a written tree on the worlds of a text with hidden state: what its nodes read is what is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from bbtc.artefacts import task_to_json
from bbtc.ground.task import Task
from tests.domains.lifted import Fact, Move, TooLarge
from tests.domains.lifted_tree import FAILURE, RUNNING, SUCCESS, Node, Point, TreeOnText
from tests.hidden.exact_mdp import Row, reached
from tests.hidden.reference import Belief, HiddenText, World

_MOST_POINTS = 400


@dataclass
class Ends:
    """The probabilities of the ways to end, and what is wrong on the way there."""

    success: Fraction
    success_without_goal: Fraction
    failure: Fraction
    blocked: Fraction
    faults: list[str]


class TreeOnBeliefs(TreeOnText):
    """A tree as JSON, the text of its problem, and which conditions its variables on formulas stand for."""

    def __init__(self, lifted: HiddenText, text: str, formulas: Mapping[Fact, tuple[Any, Fraction]]) -> None:
        super().__init__(lifted, text)
        self.text = lifted
        self.formulas = formulas

    def knowledge(self, belief: Belief) -> dict[Fact, int]:
        """What the variables of the tree read."""
        worlds = [world for world, _ in belief]
        every = frozenset[Fact]().union(*worlds)
        found = {fact: 2 if all(fact in world for world in worlds) else 1 for fact in every}
        for name, (formula, enough) in self.formulas.items():
            true = sum(p for world, p in belief if self.value(formula, dict.fromkeys(world, 2)) == 2)
            found[name] = 2 if true >= enough else 0 if 1 - true >= enough else 1
        return found

    def tick(self, node: Node, point: Point, world: Mapping[Fact, int]) -> int | Node:
        """What a node returns, or the action node that starts; one that is guarded reads what is known of its
        precondition."""
        if node.get("guarded") and node["id"] not in point.finished:
            move = self.text.moves[node["action"]]
            belief: Belief = point.state  # type: ignore[assignment]
            held = {
                self.text.value(move.needs, move.bound, values)
                for values, _, _ in self.text.values_in(belief)
            }
            if held != {2}:
                return 0 if held == {0} else 1
            node = {**node, "guarded": False}
        return super().tick(node, point, world)

    def ends(self) -> Ends:
        """How runs end. Raises :class:`TooLarge` for too many points."""
        text = self.text
        points = [Point(text.prior, frozenset(), frozenset())]  # type: ignore[arg-type]
        number = {points[0]: 0}
        rows: dict[int, Row] = {}
        faults: list[str] = []
        stopped: list[tuple[Fraction, ...]] = []
        for at, point in enumerate(points):
            belief: Belief = point.state  # type: ignore[assignment]
            ticked = self.tick(self.root, point, self.knowledge(belief))
            if isinstance(ticked, int):
                won = Fraction(ticked == SUCCESS)
                true = text.chance(text.goal, belief)
                ends = won * true, won * (1 - true), Fraction(ticked == FAILURE), Fraction(ticked == RUNNING)
                stopped.append(ends)
                continue
            stopped.append((Fraction(0),) * 4)
            move: Move = text.moves[ticked["action"]]
            if not text.known(move.needs, move.bound, belief):
                faults.append(f"{ticked['action']} starts in {sorted(sorted(w) for w, _ in belief)}")
            rows[at] = []
            for after, p in text.results(ticked["action"], belief).items():
                follower = self._after(point, ticked, after)
                if follower not in number:
                    number[follower] = len(points)
                    points.append(follower)
                rows[at].append((number[follower], p))
            if len(points) > _MOST_POINTS:
                raise TooLarge
        success, without, failure, blocked = (
            reached(rows, column)[0] for column in zip(*stopped, strict=True)
        )
        return Ends(success, without, failure, blocked, faults)

    def success_in(self, world: World) -> Fraction:
        """How often it succeeds with the goal true, if this world is the case at the start. Raises
        :class:`TooLarge` for too many points."""
        text, won = self.text, list[Fraction]()
        points = [(Point(text.prior, frozenset(), frozenset()), world)]  # type: ignore[arg-type]
        number = {points[0]: 0}
        rows: dict[int, Row] = {}
        for at, (point, real) in enumerate(points):
            belief: Belief = point.state  # type: ignore[assignment]
            ticked = self.tick(self.root, point, self.knowledge(belief))
            if isinstance(ticked, int):
                values = next(values for values, other, _ in text.values_in(belief) if other == real)
                won.append(Fraction(ticked == SUCCESS and text.value(text.goal, {}, values) == 2))
                continue
            won.append(Fraction(0))
            rows[at] = []
            for (after, then), p in text.results_in(ticked["action"], belief, real).items():
                follower = self._after(point, ticked, after), then
                if follower not in number:
                    number[follower] = len(points)
                    points.append(follower)
                rows[at].append((number[follower], p))
            if len(points) > _MOST_POINTS:
                raise TooLarge
        return reached(rows, won)[0]

    def _after(self, point: Point, started: Node, belief: Belief) -> Point:
        finished = point.finished | {started["id"]} if started["latched"] else point.finished
        tries = dict(point.tries)
        for retry in self.retries[started["id"]]:
            tries[retry["id"]] = tries.get(retry["id"], 0) + 1
        return Point(belief, finished, frozenset(tries.items()))  # type: ignore[arg-type]


def formulas_of(task: Task) -> dict[Fact, tuple[Any, Fraction]]:
    """What the variables on formulas of a tree's task stand for, as a written tree has it, and how probable
    that has to be."""
    found: dict[Fact, tuple[Any, Fraction]] = {}
    written: Any = task_to_json(task)
    for component in written.get("components", ()):
        for known in component["known"]:
            name, _, rest = known["variable"].removesuffix(")").partition("(")
            if known["variable"] not in component["facts"]:
                fact = (name, *rest.split(",")) if rest else (name,)
                found[fact] = known["condition"], Fraction(known.get("at_least", 1))
    return found
