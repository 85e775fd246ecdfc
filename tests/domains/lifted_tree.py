"""Runs of a written tree, by the words of the problem that it was planned for.

The tree is its JSON text: what its nodes do is read off the page on the semantics, what conditions and
actions mean off the problem's own text (:mod:`tests.domains.lifted`).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias

from tests.domains.lifted import Lifted, State, World

Node: TypeAlias = dict[str, Any]
FAILURE, RUNNING, SUCCESS = 0, 1, 2
_GOES_ON = {"sequence": SUCCESS, "fallback": FAILURE, "skipper": RUNNING}
_MOST_STEPS = 60


class Endless(Exception):
    """Some run of the tree goes on for longer than is worth a test."""


class Point(NamedTuple):
    """A state, the latched nodes that have finished, and the starts below each retry node."""

    state: State
    finished: frozenset[str]
    tries: frozenset[tuple[str, int]]


@dataclass
class Runs:
    """The probabilities of the ways to end, and what is wrong on the way there."""

    success: Fraction
    failure: Fraction
    blocked: Fraction
    cost: Fraction
    faults: list[str]


class TreeOnText:
    """A tree and the text of its problem."""

    def __init__(self, lifted: Lifted, text: str) -> None:
        self.lifted = lifted
        self.root: Node = json.loads(text)["root"]
        self.retries: dict[str, list[Node]] = {}
        self._around(self.root, [])

    def _around(self, node: Node, retries: list[Node]) -> None:
        inside = [*retries, node] if node["type"] == "retry" else retries
        if node["type"] == "action":
            self.retries[node["id"]] = inside
        for child in node.get("children", ()):
            self._around(child, inside)

    def value(self, condition: list[Any], world: World) -> int:
        """The Kleene value of a condition of the tree."""
        match condition:
            case ["true"]:
                return 2
            case ["false"]:
                return 0
            case ["is", name, "unknown"]:
                return 2 if world.get(_fact(name), 0) == 1 else 0
            case ["is", name, value]:
                found = world.get(_fact(name), 0)
                return found if value == "true" else 2 - found
            case ["known", name]:
                return 0 if world.get(_fact(name), 0) == 1 else 2
            case ["not", part]:
                return 2 - self.value(part, world)
            case ["and", *parts]:
                return min(self.value(part, world) for part in parts)
            case ["or", *parts]:
                return max(self.value(part, world) for part in parts)
            case _:
                raise ValueError(condition)

    def tick(self, node: Node, point: Point, world: World) -> int | Node:
        """What a node returns, or the action node that starts."""
        kind = node["type"]
        if kind == "condition":
            return self.value(node["condition"], world)
        if kind == "retry":
            return self.tick(node["children"][0], point, world)
        if kind != "action":
            for child in node["children"]:
                found = self.tick(child, point, world)
                if found != _GOES_ON[kind]:
                    return found
            return _GOES_ON[kind]
        if node["id"] in point.finished:
            return SUCCESS
        if node.get("guarded"):
            move = self.lifted.moves[node["action"]]
            holds = self.lifted.value(move.needs, move.bound, world)
            if holds != 2:
                return holds
        tries = dict(point.tries)
        if any(tries.get(retry["id"], 0) >= retry["attempts"] for retry in self.retries[node["id"]]):
            return FAILURE
        return node

    def runs(self) -> Runs:
        """All runs from the start, as long as they last. Raises :class:`Endless`."""
        found = Runs(Fraction(0), Fraction(0), Fraction(0), Fraction(0), [])
        open_ = {Point(s, frozenset(), frozenset()): p for s, p in self.lifted.start().items()}
        for _ in range(_MOST_STEPS):
            after: dict[Point, Fraction] = {}
            for point, p in open_.items():
                for follower, q in self._step(point, p, found):
                    after[follower] = after.get(follower, Fraction(0)) + p * q
            if not after:
                return found
            open_ = after
        raise Endless

    def _step(self, point: Point, p: Fraction, found: Runs) -> Iterator[tuple[Point, Fraction]]:
        lifted, world = self.lifted, self.lifted.world(point.state)
        ticked = self.tick(self.root, point, world)
        if isinstance(ticked, int):
            if ticked == SUCCESS and lifted.value(lifted.goal, {}, world) != 2:
                found.faults.append(f"success without the goal in {sorted(point.state)}")
            found.success += p * (ticked == SUCCESS)
            found.failure += p * (ticked == FAILURE)
            found.blocked += p * (ticked == RUNNING)
            return
        move = lifted.moves[ticked["action"]]
        if lifted.value(move.needs, move.bound, world) != 2:
            found.faults.append(f"{ticked['action']} starts in {sorted(point.state)}")
        cost, states = lifted.after(move, point.state)
        found.cost += p * cost
        finished = point.finished | {ticked["id"]} if ticked["latched"] else point.finished
        tries = dict(point.tries)
        for retry in self.retries[ticked["id"]]:
            tries[retry["id"]] = tries.get(retry["id"], 0) + 1
        for state, q in states.items():
            yield Point(state, finished, frozenset(tries.items())), q


def _fact(name: str) -> tuple[str, ...]:
    """The fact of a variable's name, ``p(a,b)``."""
    predicate, _, rest = name.removesuffix(")").partition("(")
    return (predicate, *rest.split(",")) if rest else (predicate,)
