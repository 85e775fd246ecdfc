"""Behavior tree for the problem two-goals of the domain service-robot. Made by bbtc.

In the model of that domain it succeeds with probability 63/64.
Nothing bounds how often it tries: with a robot that always fails, it never ends.
Implement the class Robot, and run

    run(create_root(MyRobot()), period=0.1)

As a program, this module runs the tree in a simulated world (--help tells how).
It needs py_trees 2.2 or later.
"""

from __future__ import annotations

import argparse
import math
import random
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Any, Protocol, TypeVar, cast, runtime_checkable

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector, Sequence
from py_trees.decorators import Decorator
from py_trees.trees import BehaviourTree


class Robot(Protocol):
    """What the tree needs of a robot.

    A condition answers at once: True, False, or None where it is unknown. An action is called in
    every tick while it runs and answers at once with its status: RUNNING, and SUCCESS when the
    conditions show what it did.
    """

    def cancel(self, action: str) -> None:
        """The running action, named as in the tree, is no longer wanted."""

    def at(self, item: str, spot: str) -> bool | None:
        """Whether at(item, spot) holds; None where that is unknown."""

    def hand_free(self) -> bool | None:
        """Whether hand_free() holds."""

    def holding(self, item: str) -> bool | None:
        """Whether holding(item) holds."""

    def near(self, spot: str) -> bool | None:
        """Whether near(spot) holds."""

    def is_open(self, spot: str) -> bool | None:
        """Whether open(spot) holds."""

    def look_for(self, item: str, spot: str) -> Status:
        """Start or continue look_for(item, spot)."""

    def open(self, spot: str) -> Status:
        """Start or continue open(spot)."""

    def pick(self, item: str, spot: str) -> Status:
        """Start or continue pick(item, spot)."""

    def place(self, item: str, spot: str) -> Status:
        """Start or continue place(item, spot)."""

    def walk(self, to: str) -> Status:
        """Start or continue walk(to)."""


Fact = tuple[str, ...]
R = TypeVar("R")


def in_words(fact: Fact) -> str:
    """``predicate(object,…)``."""
    return f"{fact[0]}({','.join(fact[1:])})"


def all_of(*values: bool | None) -> bool | None:
    """Three-valued "and": False if any value is False, else None if any is unknown, else True."""
    if False in values:
        return False
    return None if None in values else True


def any_of(*values: bool | None) -> bool | None:
    """Three-valued "or": True if any value is True, else None if any is unknown, else False."""
    if True in values:
        return True
    return None if None in values else False


def negated(value: bool | None) -> bool | None:
    """Three-valued "not": unknown stays unknown."""
    return None if value is None else not value


class View:
    """A robot as the tree sees it: what is ``held``, by method and arguments, is not asked anew."""

    def __init__(self, robot: Any, held: dict[Fact, Any] | None = None, path: str = "") -> None:
        self.robot = robot
        self.held: dict[Fact, Any] = {} if held is None else held
        self.path = path

    def __getattr__(self, name: str) -> Any:
        method, path, held = getattr(self.robot, name), f"{self.path}{name}", self.held
        if not callable(method):
            return View(method, held, f"{path}.")

        def ask(*args: str) -> Any:
            key = (path, *args)
            return held[key] if key in held else method(*args)

        return ask


def view(robot: R) -> R:
    """The robot as the tree sees it."""
    return cast("R", View(robot))


class Condition(Behaviour):
    """SUCCESS, FAILURE or RUNNING for a condition that is True, False or None (unknown)."""

    def __init__(self, name: str, read: Callable[[], bool | None]) -> None:
        super().__init__(name=name)
        self._read = read

    def update(self) -> Status:
        value = self._read()
        self.feedback_message = "unknown" if value is None else ""
        if value is None:
            return Status.RUNNING
        return Status.SUCCESS if value else Status.FAILURE


class Action(Behaviour):
    """Calls the robot at every tick until the action ends; cancels it if it is no longer wanted."""

    def __init__(self, name: str, act: Callable[[], Status], cancel: Callable[[str], None]) -> None:
        super().__init__(name=name)
        self._act = act
        self._cancel = cancel

    def update(self) -> Status:
        status = self._act()
        if status not in (Status.SUCCESS, Status.FAILURE, Status.RUNNING):
            raise TypeError(f"{self.name} returned {status!r}, not SUCCESS, FAILURE or RUNNING")
        return status

    def terminate(self, new_status: Status) -> None:
        if self.status == Status.RUNNING and new_status == Status.INVALID:
            self._cancel(self.name)


class Latch(Decorator):
    """Runs its action once and returns how it ended at every later tick. The status is withheld
    until the next tick, because conditions to the left were read before the action's effect. An
    action interrupted after its start counts as run. A guard must be True for it to start; with
    ``keep=False`` it starts again whenever it is ticked. While it runs, the tree reads what is
    its ``own``, which the action may itself set, as it was in the tick that started it; where
    ``during`` is not True, it is cancelled."""

    def __init__(
        self,
        name: str,
        act: Callable[[], Status],
        cancel: Callable[[str], None],
        guard: Callable[[], bool | None] | None = None,
        keep: bool = True,
        *,
        own: Iterable[Fact] = (),
        during: Callable[[], bool | None] | None = None,
    ) -> None:
        super().__init__(name=name, child=Action(name, act, cancel))
        self._guard = guard
        self._keep = keep
        self._own = own
        self._during = during
        self._started = False
        self._final: Status | None = None

    def tick(self) -> Iterator[Behaviour]:
        if self._final is not None:
            self.stop(self._final)
            yield self
            return
        root = self._root()
        ready: bool | None = True
        if not self._started:
            ready = self._ready()
            if ready and root is not None and root.committed:
                # The tick has passed by an action that ran: what is held may be half changed.
                ready = None
        if ready:
            if not self._started:
                self._use_up()
            if root is not None:
                root.acts(self, () if self._started else self._own)
            if self._started and self._during is not None and not self._during():
                self.decorated.stop(Status.INVALID)
                self._end(Status.SUCCESS)
            else:
                self._started = True
                yield from self.decorated.tick()
                if self.decorated.status != Status.RUNNING:
                    self._end(self.decorated.status)
        if ready or ready is None:
            self.status = Status.RUNNING
        else:
            self.stop(Status.FAILURE)
        yield self

    def update(self) -> Status:
        return self.status

    def terminate(self, new_status: Status) -> None:
        if new_status == Status.INVALID and self._started:
            self._end(Status.SUCCESS)

    def _ready(self) -> bool | None:
        """Whether the action may start now."""
        ready = True if self._guard is None else self._guard()
        why = "unknown" if ready is None else "false"
        self.feedback_message = "" if ready else f"its precondition is {why}"
        return ready

    def _use_up(self) -> None:
        """The action starts."""

    def _root(self) -> StopWhenBlocked | None:
        above = self.parent
        while above is not None and not isinstance(above, StopWhenBlocked):
            above = above.parent
        return above

    @property
    def running(self) -> bool:
        """Has its action started, and neither ended nor been cancelled?"""
        return self._started

    def _end(self, status: Status) -> None:
        self._started = False
        self._final = status if self._keep else None


def sequence(name: str, *children: Behaviour) -> Behaviour:
    """Goes on while children succeed. Every tick starts at the first child."""
    return Sequence(name, memory=False, children=list(children))


def fallback(name: str, *children: Behaviour) -> Behaviour:
    """Goes on while children fail. Every tick starts at the first child."""
    return Selector(name, memory=False, children=list(children))


@runtime_checkable
class WithSetup(Protocol):
    """A robot that prepares itself before the first tick."""

    def setup(self, **kwargs: Any) -> None:
        """Called once, with what the owner of the tree hands on: in py_trees_ros, ``node``."""


@runtime_checkable
class WithBeliefs(Protocol):
    """A robot that can tell what it has not heard of yet."""

    def heard_of(self, *fact: str, unknown: bool) -> bool:
        """Whether a fact is known to be true or false, or, where ``unknown`` will do, unknown."""


class StopWhenBlocked(Decorator):
    """The root. It knows the action that runs, and holds what that may itself set, so that no
    action ends by what it does. A tick that passes it by cancels it and is RUNNING; all is read
    anew in the next one.

    FAILURE where the tree is RUNNING but no action is. Something is unknown then that
    nothing can observe, and nothing would ever change. Before its first tick the tree waits,
    however long, until the robot has heard of every fact in ``reads``, which tells for each whether
    it can be unknown."""

    def __init__(
        self,
        robot: object,
        child: Behaviour,
        reads: Mapping[Fact, bool] | None = None,
    ) -> None:
        super().__init__(name="stop when blocked", child=child)
        self._view = robot if isinstance(robot, View) else View(robot)
        self._robot: object = self._view.robot
        self._reads = dict(reads or {})
        self._said: float | None = None
        self._acting = False
        self._last: Latch | None = None
        self.committed = False
        """Was an action running when the tick began?"""

    def setup(self, **kwargs: Any) -> None:
        if isinstance(self._robot, WithSetup):
            self._robot.setup(**kwargs)

    def shutdown(self) -> None:
        # py_trees ends a tree with this alone, even where an action runs that nobody cancels.
        if self.status == Status.RUNNING:
            self.stop(Status.INVALID)

    def acts(self, latch: Latch, own: Iterable[Fact]) -> None:
        """A latch below is about to run its action in this tick, after it notes its ``own``."""
        for fact in own:
            ask: Any = self._robot
            for name in fact[0].split("."):
                ask = getattr(ask, name)
            self._view.held[fact] = ask(*fact[1:])
        self._last = latch
        self._acting = True

    def tick(self) -> Iterator[Behaviour]:
        if self._reads and self._waits():
            self.status = Status.RUNNING
            yield self
            return
        self._reads.clear()
        self._acting = False
        self.committed = self._last is not None and self._last.running
        if not self.committed:
            self._view.held.clear()
        yield from super().tick()

    def _waits(self) -> bool:
        if not isinstance(self._robot, WithBeliefs):
            return False
        heard, facts = self._robot.heard_of, self._reads.items()
        missing = [in_words(fact) for fact, unknown in facts if not heard(*fact, unknown=unknown)]
        self.feedback_message = f"waiting to hear of {', '.join(missing)}" if missing else ""
        now = time.monotonic()
        if missing and (self._said is None or now - self._said >= 10.0):
            self._said = now
            self.logger.warning(self.feedback_message)
        return bool(missing)

    def update(self) -> Status:
        if self.committed and not self._acting:
            if self._last is not None and self._last.running:
                self._last.stop(Status.INVALID)
            self.feedback_message = "" if self._last is None else f"{self._last.name}: cancelled"
            return Status.RUNNING
        if self.decorated.status == Status.RUNNING and not self._acting:
            self.feedback_message = "blocked: nothing can observe what is unknown" + self._refused()
            return Status.FAILURE
        if self.decorated.status == Status.FAILURE and self._last is None:
            self.feedback_message = "no action was started" + self._refused()
        return self.decorated.status

    def _refused(self) -> str:
        """The actions that were not started, and why."""
        latches = [node for node in self.decorated.iterate() if isinstance(node, Latch)]
        refused = [node for node in latches if node.feedback_message]
        return "".join(f"; {node.name}: {node.feedback_message}" for node in refused)


def run(root: Behaviour, period: float = 0.0) -> Status:
    """Set a tree up and tick it until it ends, with a pause of ``period`` seconds between ticks.
    An exception, such as that of Ctrl-C, cancels the action that runs."""
    tree = BehaviourTree(root)
    tree.setup()
    try:
        while True:
            tree.tick()
            if root.status != Status.RUNNING:
                return root.status
            time.sleep(period)
    finally:
        if root.status == Status.RUNNING:
            root.stop(Status.INVALID)


def create_root(robot: Robot) -> Behaviour:
    """The tree. Latches stay latched, so it runs once: make a new one for another run."""
    robot = view(robot)
    return StopWhenBlocked(
        robot,
        fallback(
            "fallback",
            Condition(
                "(known at(cup1,cupboard4) and at(cup1,cupboard4) and known …",
                lambda: all_of(
                    robot.at("cup1", "cupboard4") is not None,
                    robot.at("cup1", "cupboard4"),
                    robot.at("book3", "drawer6") is not None,
                    robot.at("book3", "drawer6"),
                ),
            ),
            Latch(
                "look_for(book3,cupboard4)",
                lambda: robot.look_for("book3", "cupboard4"),
                robot.cancel,
                guard=lambda: all_of(
                    robot.near("cupboard4"),
                    robot.at("book3", "cupboard4") is None,
                    robot.is_open("cupboard4"),
                ),
                keep=False,
                own=OWN["look_for(book3,cupboard4)"],
            ),
            Latch(
                "place(book3,drawer6)",
                lambda: robot.place("book3", "drawer6"),
                robot.cancel,
                guard=lambda: all_of(
                    robot.near("drawer6"),
                    robot.holding("book3"),
                    robot.is_open("drawer6"),
                ),
                keep=False,
                own=OWN["place(book3,drawer6)"],
            ),
            Latch(
                "place(cup1,cupboard4)",
                lambda: robot.place("cup1", "cupboard4"),
                robot.cancel,
                guard=lambda: all_of(
                    robot.near("cupboard4"),
                    robot.holding("cup1"),
                    robot.is_open("cupboard4"),
                ),
                keep=False,
                own=OWN["place(cup1,cupboard4)"],
            ),
            Latch(
                "look_for(book3,counter5)",
                lambda: robot.look_for("book3", "counter5"),
                robot.cancel,
                guard=lambda: all_of(robot.near("counter5"), robot.at("book3", "counter5") is None),
                keep=False,
                own=OWN["look_for(book3,counter5)"],
            ),
            Latch(
                "look_for(book3,shelf3)",
                lambda: robot.look_for("book3", "shelf3"),
                robot.cancel,
                guard=lambda: all_of(robot.near("shelf3"), robot.at("book3", "shelf3") is None),
                keep=False,
                own=OWN["look_for(book3,shelf3)"],
            ),
            sequence(
                "for near(drawer6)",
                Condition(
                    "((hand_free() and not open(drawer6) and not near(cupboard4)…",
                    lambda: any_of(
                        all_of(
                            robot.hand_free(),
                            negated(robot.is_open("drawer6")),
                            negated(robot.near("cupboard4")),
                        ),
                        all_of(
                            robot.is_open("drawer6"),
                            robot.holding("book3"),
                            robot.at("cup1", "shelf3") is not None,
                            negated(robot.at("cup1", "shelf3")),
                        ),
                    ),
                ),
                Latch(
                    "walk(drawer6)",
                    lambda: robot.walk("drawer6"),
                    robot.cancel,
                    guard=lambda: negated(robot.near("drawer6")),
                    keep=False,
                    own=OWN["walk(drawer6)"],
                ),
            ),
            Latch(
                "place(plate2,fridge2)",
                lambda: robot.place("plate2", "fridge2"),
                robot.cancel,
                guard=lambda: all_of(
                    robot.near("fridge2"),
                    robot.holding("plate2"),
                    robot.is_open("fridge2"),
                ),
                keep=False,
                own=OWN["place(plate2,fridge2)"],
            ),
            Latch(
                "open(drawer6)",
                lambda: robot.open("drawer6"),
                robot.cancel,
                guard=lambda: all_of(
                    robot.near("drawer6"),
                    negated(robot.is_open("drawer6")),
                    robot.hand_free(),
                ),
                keep=False,
                own=OWN["open(drawer6)"],
            ),
            sequence(
                "sequence",
                Condition(
                    "(near(drawer6) and open(cupboard4))",
                    lambda: all_of(robot.near("drawer6"), robot.is_open("cupboard4")),
                ),
                Latch(
                    "walk(table1)",
                    lambda: robot.walk("table1"),
                    robot.cancel,
                    guard=lambda: negated(robot.near("table1")),
                    keep=False,
                    own=OWN["walk(table1)"],
                ),
            ),
            Latch(
                "place(plate2,shelf3)",
                lambda: robot.place("plate2", "shelf3"),
                robot.cancel,
                guard=lambda: all_of(robot.near("shelf3"), robot.holding("plate2")),
                keep=False,
                own=OWN["place(plate2,shelf3)"],
            ),
            Latch(
                "place(plate2,counter5)",
                lambda: robot.place("plate2", "counter5"),
                robot.cancel,
                guard=lambda: all_of(robot.near("counter5"), robot.holding("plate2")),
                keep=False,
                own=OWN["place(plate2,counter5)"],
            ),
            sequence(
                "for near(shelf3)",
                Condition(
                    "((known at(cup1,shelf3) and at(cup1,shelf3) and open(cupboa…",
                    lambda: any_of(
                        all_of(
                            robot.at("cup1", "shelf3") is not None,
                            robot.at("cup1", "shelf3"),
                            robot.is_open("cupboard4"),
                        ),
                        all_of(negated(robot.hand_free()), robot.at("book3", "cupboard4") is None),
                    ),
                ),
                Latch(
                    "walk(shelf3)",
                    lambda: robot.walk("shelf3"),
                    robot.cancel,
                    guard=lambda: negated(robot.near("shelf3")),
                    keep=False,
                    own=OWN["walk(shelf3)"],
                ),
            ),
            sequence(
                "for near(fridge2)",
                Condition(
                    "(not holding(book3) and known at(cup1,fridge2) and at(cup1,…",
                    lambda: all_of(
                        negated(robot.holding("book3")),
                        robot.at("cup1", "fridge2") is not None,
                        robot.at("cup1", "fridge2"),
                        robot.is_open("cupboard4"),
                    ),
                ),
                Latch(
                    "walk(fridge2)",
                    lambda: robot.walk("fridge2"),
                    robot.cancel,
                    guard=lambda: negated(robot.near("fridge2")),
                    keep=False,
                    own=OWN["walk(fridge2)"],
                ),
            ),
            sequence(
                "for near(cupboard4)",
                Condition(
                    "((known at(cup1,shelf3) and not at(cup1,shelf3) and not han…",
                    lambda: any_of(
                        all_of(
                            robot.at("cup1", "shelf3") is not None,
                            negated(robot.at("cup1", "shelf3")),
                            negated(robot.hand_free()),
                            robot.is_open("cupboard4"),
                        ),
                        all_of(negated(robot.is_open("cupboard4")), robot.hand_free()),
                    ),
                ),
                Latch(
                    "walk(cupboard4)",
                    lambda: robot.walk("cupboard4"),
                    robot.cancel,
                    guard=lambda: negated(robot.near("cupboard4")),
                    keep=False,
                    own=OWN["walk(cupboard4)"],
                ),
            ),
            Latch(
                "pick(cup1,table1)",
                lambda: robot.pick("cup1", "table1"),
                robot.cancel,
                guard=lambda: all_of(
                    robot.near("table1"),
                    robot.at("cup1", "table1"),
                    robot.hand_free(),
                ),
                keep=False,
                own=OWN["pick(cup1,table1)"],
            ),
            Latch(
                "pick(cup1,fridge2)",
                lambda: robot.pick("cup1", "fridge2"),
                robot.cancel,
                guard=lambda: all_of(
                    robot.near("fridge2"),
                    robot.at("cup1", "fridge2"),
                    robot.hand_free(),
                    robot.is_open("fridge2"),
                ),
                keep=False,
                own=OWN["pick(cup1,fridge2)"],
            ),
            Latch(
                "pick(cup1,shelf3)",
                lambda: robot.pick("cup1", "shelf3"),
                robot.cancel,
                guard=lambda: all_of(
                    robot.near("shelf3"),
                    robot.at("cup1", "shelf3"),
                    robot.hand_free(),
                ),
                keep=False,
                own=OWN["pick(cup1,shelf3)"],
            ),
            sequence(
                "for holding(book3)",
                Condition(
                    "(known at(book3,drawer6) and not at(book3,drawer6))",
                    lambda: all_of(
                        robot.at("book3", "drawer6") is not None,
                        negated(robot.at("book3", "drawer6")),
                    ),
                ),
                Latch(
                    "pick(book3,shelf3)",
                    lambda: robot.pick("book3", "shelf3"),
                    robot.cancel,
                    guard=lambda: all_of(
                        robot.near("shelf3"),
                        robot.at("book3", "shelf3"),
                        robot.hand_free(),
                    ),
                    keep=False,
                    own=OWN["pick(book3,shelf3)"],
                ),
            ),
            sequence(
                "for holding(book3)",
                Condition(
                    "(known at(book3,drawer6) and not at(book3,drawer6))",
                    lambda: all_of(
                        robot.at("book3", "drawer6") is not None,
                        negated(robot.at("book3", "drawer6")),
                    ),
                ),
                Latch(
                    "pick(book3,counter5)",
                    lambda: robot.pick("book3", "counter5"),
                    robot.cancel,
                    guard=lambda: all_of(
                        robot.near("counter5"),
                        robot.at("book3", "counter5"),
                        robot.hand_free(),
                    ),
                    keep=False,
                    own=OWN["pick(book3,counter5)"],
                ),
            ),
            Latch(
                "place(plate2,cupboard4)",
                lambda: robot.place("plate2", "cupboard4"),
                robot.cancel,
                guard=lambda: all_of(
                    robot.near("cupboard4"),
                    robot.holding("plate2"),
                    robot.is_open("cupboard4"),
                ),
                keep=False,
                own=OWN["place(plate2,cupboard4)"],
            ),
            Latch(
                "open(cupboard4)",
                lambda: robot.open("cupboard4"),
                robot.cancel,
                guard=lambda: all_of(
                    robot.near("cupboard4"),
                    negated(robot.is_open("cupboard4")),
                    robot.hand_free(),
                ),
                keep=False,
                own=OWN["open(cupboard4)"],
            ),
            Latch(
                "place(book3,cupboard4)",
                lambda: robot.place("book3", "cupboard4"),
                robot.cancel,
                guard=lambda: all_of(
                    robot.near("cupboard4"),
                    robot.holding("book3"),
                    robot.is_open("cupboard4"),
                ),
                keep=False,
                own=OWN["place(book3,cupboard4)"],
            ),
            Latch(
                "place(cup1,shelf3)",
                lambda: robot.place("cup1", "shelf3"),
                robot.cancel,
                guard=lambda: all_of(robot.near("shelf3"), robot.holding("cup1")),
                keep=False,
                own=OWN["place(cup1,shelf3)"],
            ),
            sequence(
                "for hand_free()",
                Condition("not open(drawer6)", lambda: negated(robot.is_open("drawer6"))),
                Latch(
                    "place(book3,shelf3)",
                    lambda: robot.place("book3", "shelf3"),
                    robot.cancel,
                    guard=lambda: all_of(robot.near("shelf3"), robot.holding("book3")),
                    keep=False,
                    own=OWN["place(book3,shelf3)"],
                ),
            ),
            sequence(
                "for near(drawer6)",
                Condition(
                    "(not open(drawer6) or (known at(book3,drawer6) and not at(b…",
                    lambda: any_of(
                        negated(robot.is_open("drawer6")),
                        all_of(
                            robot.at("book3", "drawer6") is not None,
                            negated(robot.at("book3", "drawer6")),
                            robot.at("cup1", "shelf3") is not None,
                            robot.at("cup1", "shelf3"),
                        ),
                    ),
                ),
                Latch(
                    "walk(drawer6)",
                    lambda: robot.walk("drawer6"),
                    robot.cancel,
                    guard=lambda: negated(robot.near("drawer6")),
                    keep=False,
                    own=OWN["walk(drawer6)"],
                ),
            ),
            sequence(
                "for holding(book3)",
                Condition(
                    "(known at(book3,drawer6) and not at(book3,drawer6))",
                    lambda: all_of(
                        robot.at("book3", "drawer6") is not None,
                        negated(robot.at("book3", "drawer6")),
                    ),
                ),
                Latch(
                    "pick(book3,cupboard4)",
                    lambda: robot.pick("book3", "cupboard4"),
                    robot.cancel,
                    guard=lambda: all_of(
                        robot.near("cupboard4"),
                        robot.at("book3", "cupboard4"),
                        robot.hand_free(),
                        robot.is_open("cupboard4"),
                    ),
                    keep=False,
                    own=OWN["pick(book3,cupboard4)"],
                ),
            ),
            Latch(
                "place(book3,shelf3)",
                lambda: robot.place("book3", "shelf3"),
                robot.cancel,
                guard=lambda: all_of(robot.near("shelf3"), robot.holding("book3")),
                keep=False,
                own=OWN["place(book3,shelf3)"],
            ),
            sequence(
                "for near(drawer6)",
                Condition(
                    "(known at(book3,drawer6) and at(book3,drawer6))",
                    lambda: all_of(
                        robot.at("book3", "drawer6") is not None,
                        robot.at("book3", "drawer6"),
                    ),
                ),
                Latch(
                    "walk(drawer6)",
                    lambda: robot.walk("drawer6"),
                    robot.cancel,
                    guard=lambda: negated(robot.near("drawer6")),
                    keep=False,
                    own=OWN["walk(drawer6)"],
                ),
            ),
            sequence(
                "for near(shelf3)",
                Condition(
                    "((known at(book3,shelf3) and at(book3,shelf3)) or unknown a…",
                    lambda: any_of(
                        all_of(
                            robot.at("book3", "shelf3") is not None,
                            robot.at("book3", "shelf3"),
                        ),
                        robot.at("book3", "shelf3") is None,
                    ),
                ),
                Latch(
                    "walk(shelf3)",
                    lambda: robot.walk("shelf3"),
                    robot.cancel,
                    guard=lambda: negated(robot.near("shelf3")),
                    keep=False,
                    own=OWN["walk(shelf3)"],
                ),
            ),
            Latch(
                "walk(counter5)",
                lambda: robot.walk("counter5"),
                robot.cancel,
                guard=lambda: negated(robot.near("counter5")),
                keep=False,
                own=OWN["walk(counter5)"],
            ),
            sequence(
                "for near(cupboard4)",
                Condition(
                    "((known at(book3,cupboard4) and at(book3,cupboard4)) or unk…",
                    lambda: any_of(
                        all_of(
                            robot.at("book3", "cupboard4") is not None,
                            robot.at("book3", "cupboard4"),
                        ),
                        robot.at("book3", "cupboard4") is None,
                    ),
                ),
                Latch(
                    "walk(cupboard4)",
                    lambda: robot.walk("cupboard4"),
                    robot.cancel,
                    guard=lambda: negated(robot.near("cupboard4")),
                    keep=False,
                    own=OWN["walk(cupboard4)"],
                ),
            ),
            sequence(
                "for near(cupboard4)",
                Condition(
                    "(open(fridge2) or (known at(cup1,cupboard4) and at(cup1,cup…",
                    lambda: any_of(
                        robot.is_open("fridge2"),
                        all_of(
                            robot.at("cup1", "cupboard4") is not None,
                            robot.at("cup1", "cupboard4"),
                        ),
                    ),
                ),
                Latch(
                    "walk(cupboard4)",
                    lambda: robot.walk("cupboard4"),
                    robot.cancel,
                    guard=lambda: negated(robot.near("cupboard4")),
                    keep=False,
                    own=OWN["walk(cupboard4)"],
                ),
            ),
        ),
        READS,
    )


State = dict[Fact, bool | None]
T = TypeVar("T")


class When:
    """Changes that happen if a condition is True in the state before the action."""

    def __init__(self, condition: Callable[[State], bool | None], changes: State) -> None:
        self.condition = condition
        self.changes = changes


class Outcome:
    """One thing that may happen, with its probability: changes, and independent choices that
    follow."""

    def __init__(
        self, probability: str, changes: State, *conditional: When, then: list[Factor] | None = None
    ) -> None:
        self.probability = probability
        self.changes = changes
        self.conditional = conditional
        self.then = then or []


Factor = list[Outcome]


def draw(rng: random.Random, choices: list[tuple[str, T]]) -> T:
    """One of the values, with exactly the given probabilities."""
    weights = [Fraction(probability) for probability, _ in choices]
    whole = math.lcm(*(weight.denominator for weight in weights))
    point = rng.randrange(whole)
    for weight, (_, value) in zip(weights, choices, strict=True):
        point -= int(weight * whole)
        if point < 0:
            return value
    return choices[-1][1]


def happen(rng: random.Random, factors: list[Factor], before: State) -> State:
    """What an action changes: one outcome of every factor. All conditions are read before any
    change; where changes clash, True wins over None (unknown), and None over False."""
    changes: State = {}
    strength = {False: 0, None: 1, True: 2}
    for factor in factors:
        outcome = draw(rng, [(outcome.probability, outcome) for outcome in factor])
        drawn = [part.changes for part in outcome.conditional if part.condition(before)]
        for part in [outcome.changes, *drawn, happen(rng, outcome.then, before)]:
            for fact, value in part.items():
                if fact not in changes or strength[value] > strength[changes[fact]]:
                    changes[fact] = value
    return changes


class World:
    """A world that behaves as the domain says, by chance. The outcome of an action applies at
    once; the tree looks at it in the next tick."""

    def __init__(
        self,
        initial: list[tuple[str, State]],
        actions: dict[Fact, list[Factor]],
        rng: random.Random,
        report: Callable[[str], None],
    ) -> None:
        start: State = draw(rng, initial)
        self._state = dict(start)
        self._actions = actions
        self._rng = rng
        self._report = report

    def cancel(self, action: str) -> None:
        """Nothing to do: no action here runs for longer than a tick."""

    def _value(self, *fact: str) -> bool | None:
        return self._state[fact]

    def _act(self, *action: str) -> Status:
        changes = happen(self._rng, self._actions[action], self._state)
        self._state.update(changes)
        words = {True: "true", False: "false", None: "unknown"}
        told = ", ".join(f"{in_words(fact)} {words[value]}" for fact, value in changes.items())
        self._report(f"{in_words(action)}: {told or 'no change'}")
        return Status.SUCCESS


def simulate(make: Callable[[random.Random, Callable[[str], None]], Behaviour]) -> None:
    """Run trees in the simulated world as the command line says; ``make`` makes one."""
    parser = argparse.ArgumentParser(description="Run the tree in a simulated world.")
    parser.add_argument("--seed", type=int, default=0, help="of the random numbers (default: 0)")
    parser.add_argument("--runs", type=int, default=1, help="with more than one, count successes")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    if options.runs == 1:
        status = run(make(rng, print))
        print(f"The tree returned {status.value}.")
    else:
        ends = [run(make(rng, lambda _: None)) for _ in range(options.runs)]
        print(f"{ends.count(Status.SUCCESS)} of {options.runs} runs succeeded.")


READS: dict[Fact, bool] = {
    ("at", "book3", "counter5"): True,
    ("at", "book3", "cupboard4"): True,
    ("at", "book3", "drawer6"): True,
    ("at", "book3", "shelf3"): True,
    ("at", "cup1", "cupboard4"): True,
    ("at", "cup1", "fridge2"): True,
    ("at", "cup1", "shelf3"): True,
    ("at", "cup1", "table1"): True,
    ("hand_free",): False,
    ("holding", "book3"): False,
    ("holding", "cup1"): False,
    ("holding", "plate2"): False,
    ("near", "counter5"): False,
    ("near", "cupboard4"): False,
    ("near", "drawer6"): False,
    ("near", "fridge2"): False,
    ("near", "shelf3"): False,
    ("near", "table1"): False,
    ("open", "cupboard4"): False,
    ("open", "drawer6"): False,
    ("open", "fridge2"): False,
}
"""The facts that the tree reads, and whether they can be unknown."""


OWN: dict[str, list[Fact]] = {
    "look_for(book3,counter5)": [("at", "book3", "counter5")],
    "look_for(book3,cupboard4)": [("at", "book3", "cupboard4")],
    "look_for(book3,shelf3)": [("at", "book3", "shelf3")],
    "open(cupboard4)": [("is_open", "cupboard4")],
    "open(drawer6)": [("is_open", "drawer6")],
    "pick(book3,counter5)": [("at", "book3", "counter5"), ("hand_free",), ("holding", "book3")],
    "pick(book3,cupboard4)": [("at", "book3", "cupboard4"), ("hand_free",), ("holding", "book3")],
    "pick(book3,shelf3)": [("at", "book3", "shelf3"), ("hand_free",), ("holding", "book3")],
    "pick(cup1,fridge2)": [("at", "cup1", "fridge2"), ("hand_free",), ("holding", "cup1")],
    "pick(cup1,shelf3)": [("at", "cup1", "shelf3"), ("hand_free",), ("holding", "cup1")],
    "pick(cup1,table1)": [("hand_free",), ("holding", "cup1")],
    "place(book3,cupboard4)": [("at", "book3", "cupboard4"), ("hand_free",), ("holding", "book3")],
    "place(book3,drawer6)": [("at", "book3", "drawer6"), ("hand_free",), ("holding", "book3")],
    "place(book3,shelf3)": [("at", "book3", "shelf3"), ("hand_free",), ("holding", "book3")],
    "place(cup1,cupboard4)": [("at", "cup1", "cupboard4"), ("hand_free",), ("holding", "cup1")],
    "place(cup1,shelf3)": [("at", "cup1", "shelf3"), ("hand_free",), ("holding", "cup1")],
    "place(plate2,counter5)": [("hand_free",), ("holding", "plate2")],
    "place(plate2,cupboard4)": [("hand_free",), ("holding", "plate2")],
    "place(plate2,fridge2)": [("hand_free",), ("holding", "plate2")],
    "place(plate2,shelf3)": [("hand_free",), ("holding", "plate2")],
    "walk(counter5)": [
        ("near", "counter5"),
        ("near", "cupboard4"),
        ("near", "drawer6"),
        ("near", "fridge2"),
        ("near", "shelf3"),
        ("near", "table1"),
    ],
    "walk(cupboard4)": [
        ("near", "counter5"),
        ("near", "cupboard4"),
        ("near", "drawer6"),
        ("near", "fridge2"),
        ("near", "shelf3"),
        ("near", "table1"),
    ],
    "walk(drawer6)": [
        ("near", "counter5"),
        ("near", "cupboard4"),
        ("near", "drawer6"),
        ("near", "fridge2"),
        ("near", "shelf3"),
        ("near", "table1"),
    ],
    "walk(fridge2)": [
        ("near", "counter5"),
        ("near", "cupboard4"),
        ("near", "drawer6"),
        ("near", "fridge2"),
        ("near", "shelf3"),
        ("near", "table1"),
    ],
    "walk(shelf3)": [
        ("near", "counter5"),
        ("near", "cupboard4"),
        ("near", "drawer6"),
        ("near", "fridge2"),
        ("near", "shelf3"),
        ("near", "table1"),
    ],
    "walk(table1)": [
        ("near", "counter5"),
        ("near", "cupboard4"),
        ("near", "drawer6"),
        ("near", "fridge2"),
        ("near", "shelf3"),
        ("near", "table1"),
    ],
}
"""What the tree reads and an action may itself set: held while it runs."""


INITIAL: list[tuple[str, State]] = [
    (
        "1",
        {
            ("at", "book3", "counter5"): None,
            ("at", "book3", "cupboard4"): None,
            ("at", "book3", "drawer6"): False,
            ("at", "book3", "shelf3"): None,
            ("at", "cup1", "cupboard4"): False,
            ("at", "cup1", "fridge2"): False,
            ("at", "cup1", "shelf3"): False,
            ("at", "cup1", "table1"): True,
            ("at", "plate2", "counter5"): False,
            ("at", "plate2", "cupboard4"): False,
            ("at", "plate2", "fridge2"): True,
            ("at", "plate2", "shelf3"): False,
            ("hand_free",): True,
            ("holding", "book3"): False,
            ("holding", "cup1"): False,
            ("holding", "plate2"): False,
            ("near", "counter5"): False,
            ("near", "cupboard4"): False,
            ("near", "drawer6"): False,
            ("near", "fridge2"): False,
            ("near", "shelf3"): False,
            ("near", "table1"): True,
            ("open", "cupboard4"): False,
            ("open", "drawer6"): False,
            ("open", "fridge2"): False,
        },
    ),
]
"""The states a run may start in, with their probabilities."""


ACTIONS: dict[Fact, list[Factor]] = {
    ("look_for", "book3", "counter5"): [
        [
            Outcome("3/4", {("at", "book3", "counter5"): True}),
            Outcome("1/4", {("at", "book3", "counter5"): False}),
        ],
    ],
    ("look_for", "book3", "cupboard4"): [
        [
            Outcome("3/4", {("at", "book3", "cupboard4"): True}),
            Outcome("1/4", {("at", "book3", "cupboard4"): False}),
        ],
    ],
    ("look_for", "book3", "shelf3"): [
        [
            Outcome("3/4", {("at", "book3", "shelf3"): True}),
            Outcome("1/4", {("at", "book3", "shelf3"): False}),
        ],
    ],
    ("open", "cupboard4"): [[Outcome("19/20", {("open", "cupboard4"): True}), Outcome("1/20", {})]],
    ("open", "drawer6"): [[Outcome("19/20", {("open", "drawer6"): True}), Outcome("1/20", {})]],
    ("pick", "book3", "counter5"): [
        [
            Outcome(
                "9/10",
                {
                    ("at", "book3", "counter5"): False,
                    ("hand_free",): False,
                    ("holding", "book3"): True,
                },
            ),
            Outcome("1/10", {}),
        ],
    ],
    ("pick", "book3", "cupboard4"): [
        [
            Outcome(
                "9/10",
                {
                    ("at", "book3", "cupboard4"): False,
                    ("hand_free",): False,
                    ("holding", "book3"): True,
                },
            ),
            Outcome("1/10", {}),
        ],
    ],
    ("pick", "book3", "shelf3"): [
        [
            Outcome(
                "9/10",
                {
                    ("at", "book3", "shelf3"): False,
                    ("hand_free",): False,
                    ("holding", "book3"): True,
                },
            ),
            Outcome("1/10", {}),
        ],
    ],
    ("pick", "cup1", "fridge2"): [
        [
            Outcome(
                "9/10",
                {
                    ("at", "cup1", "fridge2"): False,
                    ("hand_free",): False,
                    ("holding", "cup1"): True,
                },
            ),
            Outcome("1/10", {}),
        ],
    ],
    ("pick", "cup1", "shelf3"): [
        [
            Outcome(
                "9/10",
                {("at", "cup1", "shelf3"): False, ("hand_free",): False, ("holding", "cup1"): True},
            ),
            Outcome("1/10", {}),
        ],
    ],
    ("pick", "cup1", "table1"): [
        [
            Outcome(
                "9/10",
                {("at", "cup1", "table1"): False, ("hand_free",): False, ("holding", "cup1"): True},
            ),
            Outcome("1/10", {}),
        ],
    ],
    ("place", "book3", "cupboard4"): [
        [
            Outcome(
                "19/20",
                {
                    ("at", "book3", "cupboard4"): True,
                    ("hand_free",): True,
                    ("holding", "book3"): False,
                },
            ),
            Outcome("1/20", {}),
        ],
    ],
    ("place", "book3", "drawer6"): [
        [
            Outcome(
                "19/20",
                {
                    ("at", "book3", "drawer6"): True,
                    ("hand_free",): True,
                    ("holding", "book3"): False,
                },
            ),
            Outcome("1/20", {}),
        ],
    ],
    ("place", "book3", "shelf3"): [
        [
            Outcome(
                "19/20",
                {
                    ("at", "book3", "shelf3"): True,
                    ("hand_free",): True,
                    ("holding", "book3"): False,
                },
            ),
            Outcome("1/20", {}),
        ],
    ],
    ("place", "cup1", "cupboard4"): [
        [
            Outcome(
                "19/20",
                {
                    ("at", "cup1", "cupboard4"): True,
                    ("hand_free",): True,
                    ("holding", "cup1"): False,
                },
            ),
            Outcome("1/20", {}),
        ],
    ],
    ("place", "cup1", "shelf3"): [
        [
            Outcome(
                "19/20",
                {("at", "cup1", "shelf3"): True, ("hand_free",): True, ("holding", "cup1"): False},
            ),
            Outcome("1/20", {}),
        ],
    ],
    ("place", "plate2", "counter5"): [
        [
            Outcome(
                "19/20",
                {
                    ("at", "plate2", "counter5"): True,
                    ("hand_free",): True,
                    ("holding", "plate2"): False,
                },
            ),
            Outcome("1/20", {}),
        ],
    ],
    ("place", "plate2", "cupboard4"): [
        [
            Outcome(
                "19/20",
                {
                    ("at", "plate2", "cupboard4"): True,
                    ("hand_free",): True,
                    ("holding", "plate2"): False,
                },
            ),
            Outcome("1/20", {}),
        ],
    ],
    ("place", "plate2", "fridge2"): [
        [
            Outcome(
                "19/20",
                {
                    ("at", "plate2", "fridge2"): True,
                    ("hand_free",): True,
                    ("holding", "plate2"): False,
                },
            ),
            Outcome("1/20", {}),
        ],
    ],
    ("place", "plate2", "shelf3"): [
        [
            Outcome(
                "19/20",
                {
                    ("at", "plate2", "shelf3"): True,
                    ("hand_free",): True,
                    ("holding", "plate2"): False,
                },
            ),
            Outcome("1/20", {}),
        ],
    ],
    ("walk", "counter5"): [
        [
            Outcome(
                "49/50",
                {
                    ("near", "counter5"): True,
                    ("near", "cupboard4"): False,
                    ("near", "drawer6"): False,
                    ("near", "fridge2"): False,
                    ("near", "shelf3"): False,
                    ("near", "table1"): False,
                },
            ),
            Outcome("1/50", {}),
        ],
    ],
    ("walk", "cupboard4"): [
        [
            Outcome(
                "49/50",
                {
                    ("near", "counter5"): False,
                    ("near", "cupboard4"): True,
                    ("near", "drawer6"): False,
                    ("near", "fridge2"): False,
                    ("near", "shelf3"): False,
                    ("near", "table1"): False,
                },
            ),
            Outcome("1/50", {}),
        ],
    ],
    ("walk", "drawer6"): [
        [
            Outcome(
                "49/50",
                {
                    ("near", "counter5"): False,
                    ("near", "cupboard4"): False,
                    ("near", "drawer6"): True,
                    ("near", "fridge2"): False,
                    ("near", "shelf3"): False,
                    ("near", "table1"): False,
                },
            ),
            Outcome("1/50", {}),
        ],
    ],
    ("walk", "fridge2"): [
        [
            Outcome(
                "49/50",
                {
                    ("near", "counter5"): False,
                    ("near", "cupboard4"): False,
                    ("near", "drawer6"): False,
                    ("near", "fridge2"): True,
                    ("near", "shelf3"): False,
                    ("near", "table1"): False,
                },
            ),
            Outcome("1/50", {}),
        ],
    ],
    ("walk", "shelf3"): [
        [
            Outcome(
                "49/50",
                {
                    ("near", "counter5"): False,
                    ("near", "cupboard4"): False,
                    ("near", "drawer6"): False,
                    ("near", "fridge2"): False,
                    ("near", "shelf3"): True,
                    ("near", "table1"): False,
                },
            ),
            Outcome("1/50", {}),
        ],
    ],
    ("walk", "table1"): [
        [
            Outcome(
                "49/50",
                {
                    ("near", "counter5"): False,
                    ("near", "cupboard4"): False,
                    ("near", "drawer6"): False,
                    ("near", "fridge2"): False,
                    ("near", "shelf3"): False,
                    ("near", "table1"): True,
                },
            ),
            Outcome("1/50", {}),
        ],
    ],
}
"""What each action does: independent choices between outcomes."""


class SimulatedWorld(World):
    """Plays the robot."""

    def at(self, item: str, spot: str) -> bool | None:
        return self._value("at", item, spot)

    def hand_free(self) -> bool | None:
        return self._value("hand_free")

    def holding(self, item: str) -> bool | None:
        return self._value("holding", item)

    def near(self, spot: str) -> bool | None:
        return self._value("near", spot)

    def is_open(self, spot: str) -> bool | None:
        return self._value("open", spot)

    def look_for(self, item: str, spot: str) -> Status:
        return self._act("look_for", item, spot)

    def open(self, spot: str) -> Status:
        return self._act("open", spot)

    def pick(self, item: str, spot: str) -> Status:
        return self._act("pick", item, spot)

    def place(self, item: str, spot: str) -> Status:
        return self._act("place", item, spot)

    def walk(self, to: str) -> Status:
        return self._act("walk", to)


def main() -> None:
    """Run the tree in the simulated world."""
    simulate(lambda rng, report: create_root(SimulatedWorld(INITIAL, ACTIONS, rng, report)))


if __name__ == "__main__":
    main()
