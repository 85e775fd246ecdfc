"""Behavior tree for the problem sharp-camera of the domain shelves. Made by bbtc.

In the model of that domain it succeeds with probability 1.
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
    conditions show what it did. What is hidden the tree asks the monitor, Monitor(MONITOR, ...):
    tell that, by monitor.told, what every action of MONITOR told, in the moment in which its
    effects are seen.
    """

    monitor: Monitor

    def cancel(self, action: str) -> None:
        """The running action, named as in the tree, is no longer wanted."""

    def robot_at(self, shelf: str) -> bool | None:
        """Whether robot-at(shelf) holds."""

    def drive(self, arg_from: str, to: str) -> Status:
        """Start or continue drive(arg_from, to)."""

    def grasp(self, shelf: str) -> Status:
        """Start or continue grasp(shelf)."""

    def look(self, shelf: str) -> Status:
        """Start or continue look(shelf)."""


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
    return StopOutside(
        robot,
        fallback(
            "fallback",
            Condition("holding()", lambda: robot.monitor.value("holding")),
            sequence(
                "sequence",
                Condition(
                    "(known tin-at(middle) and tin-at(middle))",
                    lambda: all_of(
                        robot.monitor.value("tin-at", "middle") is not None,
                        robot.monitor.value("tin-at", "middle"),
                    ),
                ),
                Latch(
                    "drive(left,middle)",
                    lambda: robot.drive("left", "middle"),
                    robot.cancel,
                    guard=lambda: robot.robot_at("left"),
                    keep=False,
                    own=OWN["drive(left,middle)"],
                ),
            ),
            sequence(
                "for holding()",
                Condition(
                    "(known tin-at(right) and tin-at(right))",
                    lambda: all_of(
                        robot.monitor.value("tin-at", "right") is not None,
                        robot.monitor.value("tin-at", "right"),
                    ),
                ),
                Latch(
                    "grasp(right)",
                    *watched(robot, ("grasp", "right"), lambda: robot.grasp("right")),
                    guard=lambda: all_of(
                        robot.robot_at("right"),
                        negated(robot.monitor.value("holding")),
                        negated(robot.monitor.value("spilt")),
                    ),
                    keep=False,
                    own=OWN["grasp(right)"],
                ),
            ),
            sequence(
                "for robot-at(right)",
                Condition(
                    "(known tin-at(right) and tin-at(right))",
                    lambda: all_of(
                        robot.monitor.value("tin-at", "right") is not None,
                        robot.monitor.value("tin-at", "right"),
                    ),
                ),
                Latch(
                    "drive(left,right)",
                    lambda: robot.drive("left", "right"),
                    robot.cancel,
                    guard=lambda: robot.robot_at("left"),
                    keep=False,
                    own=OWN["drive(left,right)"],
                ),
            ),
            sequence(
                "for holding()",
                Condition(
                    "(known tin-at(middle) and tin-at(middle))",
                    lambda: all_of(
                        robot.monitor.value("tin-at", "middle") is not None,
                        robot.monitor.value("tin-at", "middle"),
                    ),
                ),
                Latch(
                    "grasp(middle)",
                    *watched(robot, ("grasp", "middle"), lambda: robot.grasp("middle")),
                    guard=lambda: all_of(
                        robot.robot_at("middle"),
                        negated(robot.monitor.value("holding")),
                        negated(robot.monitor.value("spilt")),
                    ),
                    keep=False,
                    own=OWN["grasp(middle)"],
                ),
            ),
            sequence(
                "for holding()",
                Condition(
                    "(known tin-at(left) and tin-at(left))",
                    lambda: all_of(
                        robot.monitor.value("tin-at", "left") is not None,
                        robot.monitor.value("tin-at", "left"),
                    ),
                ),
                Latch(
                    "grasp(left)",
                    *watched(robot, ("grasp", "left"), lambda: robot.grasp("left")),
                    guard=lambda: all_of(
                        robot.robot_at("left"),
                        negated(robot.monitor.value("holding")),
                        negated(robot.monitor.value("spilt")),
                    ),
                    keep=False,
                    own=OWN["grasp(left)"],
                ),
            ),
            sequence(
                "for robot-at(middle)",
                Condition(
                    "(known tin-at(right) and not tin-at(right))",
                    lambda: all_of(
                        robot.monitor.value("tin-at", "right") is not None,
                        negated(robot.monitor.value("tin-at", "right")),
                    ),
                ),
                Latch(
                    "drive(right,middle)",
                    lambda: robot.drive("right", "middle"),
                    robot.cancel,
                    guard=lambda: robot.robot_at("right"),
                    keep=False,
                    own=OWN["drive(right,middle)"],
                ),
            ),
            sequence(
                "for robot-at(left)",
                Condition(
                    "(known tin-at(middle) and not tin-at(middle))",
                    lambda: all_of(
                        robot.monitor.value("tin-at", "middle") is not None,
                        negated(robot.monitor.value("tin-at", "middle")),
                    ),
                ),
                Latch(
                    "drive(middle,left)",
                    lambda: robot.drive("middle", "left"),
                    robot.cancel,
                    guard=lambda: robot.robot_at("middle"),
                    keep=False,
                    own=OWN["drive(middle,left)"],
                ),
            ),
            sequence(
                "for robot-at(right)",
                Condition(
                    "((known tin-at(right) and tin-at(right)) or unknown tin-at(…",
                    lambda: any_of(
                        all_of(
                            robot.monitor.value("tin-at", "right") is not None,
                            robot.monitor.value("tin-at", "right"),
                        ),
                        robot.monitor.value("tin-at", "right") is None,
                    ),
                ),
                Latch(
                    "drive(middle,right)",
                    lambda: robot.drive("middle", "right"),
                    robot.cancel,
                    guard=lambda: robot.robot_at("middle"),
                    keep=False,
                    own=OWN["drive(middle,right)"],
                ),
            ),
            Latch(
                "look(middle)",
                *watched(robot, ("look", "middle"), lambda: robot.look("middle")),
                guard=lambda: all_of(
                    robot.robot_at("middle"),
                    robot.monitor.value("tin-at", "middle") is None,
                ),
                keep=False,
                own=OWN["look(middle)"],
            ),
            sequence(
                "for robot-at(left)",
                Condition(
                    "((known tin-at(left) and tin-at(left)) or unknown tin-at(le…",
                    lambda: any_of(
                        all_of(
                            robot.monitor.value("tin-at", "left") is not None,
                            robot.monitor.value("tin-at", "left"),
                        ),
                        robot.monitor.value("tin-at", "left") is None,
                    ),
                ),
                Latch(
                    "drive(right,left)",
                    lambda: robot.drive("right", "left"),
                    robot.cancel,
                    guard=lambda: robot.robot_at("right"),
                    keep=False,
                    own=OWN["drive(right,left)"],
                ),
            ),
            Latch(
                "look(right)",
                *watched(robot, ("look", "right"), lambda: robot.look("right")),
                guard=lambda: all_of(
                    robot.robot_at("right"),
                    robot.monitor.value("tin-at", "right") is None,
                ),
                keep=False,
                own=OWN["look(right)"],
            ),
            Latch(
                "look(left)",
                *watched(robot, ("look", "left"), lambda: robot.look("left")),
                guard=lambda: all_of(
                    robot.robot_at("left"),
                    robot.monitor.value("tin-at", "left") is None,
                ),
                keep=False,
                own=OWN["look(left)"],
            ),
            Latch(
                "drive(left,right)",
                lambda: robot.drive("left", "right"),
                robot.cancel,
                guard=lambda: robot.robot_at("left"),
                keep=False,
                own=OWN["drive(left,right)"],
            ),
            Latch(
                "drive(middle,left)",
                lambda: robot.drive("middle", "left"),
                robot.cancel,
                guard=lambda: robot.robot_at("middle"),
                keep=False,
                own=OWN["drive(middle,left)"],
            ),
            Latch(
                "drive(right,left)",
                lambda: robot.drive("right", "left"),
                robot.cancel,
                guard=lambda: robot.robot_at("right"),
                keep=False,
                own=OWN["drive(right,left)"],
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


Entry = int | bool | None
Rows = dict[tuple[Entry, ...], int]


class Move:
    """What an action may tell. ``rows`` lead from what was believed, the ``seen`` facts before the
    action, the ``readings`` (None: not made), and the seen facts after it, to what is believed
    then."""

    def __init__(self, seen: list[Fact], readings: list[str], rows: Rows) -> None:
        self.seen = seen
        self.readings = readings
        self.rows = rows


class Part:
    """Facts that depend on each other: what is known of them (None: it is unknown) in each belief,
    by number, the belief to begin with, and what each action may tell of them."""

    def __init__(
        self,
        facts: list[Fact],
        values: list[tuple[bool | None, ...]],
        start: int,
        moves: dict[Fact, Move],
    ) -> None:
        self.facts = facts
        self.values = values
        self.start = start
        self.moves = moves


class Monitor:
    """Knows of hidden facts what follows from all that the robot was told. ``see`` tells what the
    robot sees of a fact that is not hidden.

    Call :meth:`told` for every action that tells anything, in the moment in which its effects are
    seen. What cannot be in the model ends that: :attr:`outside` says what it was, and nothing is
    known from then on.
    """

    def __init__(self, parts: list[Part], see: Callable[..., bool | None]) -> None:
        self.outside = ""
        self._parts = parts
        self._see = see
        self._beliefs = [part.start for part in parts]
        self._place: dict[Fact, tuple[int, int]] = {}
        for number, part in enumerate(parts):
            self._place.update((fact, (number, at)) for at, fact in enumerate(part.facts))
        self._before: dict[Fact, list[tuple[bool | None, ...]]] = {}
        self._waits = self.listens()

    def listens(self, *action: str) -> bool:
        """Does the action tell anything? Without an action: is anything told before the first?"""
        return any(action in part.moves for part in self._parts)

    def waits(self) -> bool:
        """Is what the robot is told before its first action still missing?"""
        return self._waits

    def value(self, *fact: str) -> bool | None:
        """What is known of a hidden fact: None if it is unknown."""
        if self.outside:
            return None
        number, at = self._place[fact]
        return self._parts[number].values[self._beliefs[number]][at]

    def known(self) -> State:
        """What is known of every fact."""
        return {fact: self.value(*fact) for fact in self._place}

    def begin(self, *action: str) -> None:
        """The action starts. The tree calls this."""
        if not self.listens(*action):
            return
        for earlier in self._before:
            self._leave(f"{in_words(earlier)} told nothing")
        moves = [part.moves.get(action) for part in self._parts]
        self._before[action] = [
            tuple(self._see(*fact) for fact in move.seen) if move else () for move in moves
        ]

    def told(self, *action: str, readings: Mapping[str, bool | None] | None = None) -> None:
        """What the action told: of each observation that was made, by name, whether it seemed true.
        Seen facts are read now, but for those that stand here, too, by name. Without an action:
        what the robot was told before its first one."""
        if not self.listens(*action):
            return
        told = dict(readings or {})
        name = in_words(action) if action else "what is told at the start"
        before = self._before.pop(action, None)
        if before is None and not (self._waits and not action):
            self._leave(f"{name}: it was not started")
            return
        self._waits = self._waits and action != ()
        used: set[str] = set()
        for number, part in enumerate(self._parts):
            move = part.moves.get(action)
            if move is None:
                continue
            after = [told[in_words(f)] if in_words(f) in told else self._see(*f) for f in move.seen]
            used.update(move.readings, map(in_words, move.seen))
            read = [told.get(reading) for reading in move.readings]
            # Before the first action nothing has changed.
            seen = tuple(after) if before is None else before[number]
            row = move.rows.get((self._beliefs[number], *seen, *read, *after))
            if row is None:
                names = [*move.readings, *map(in_words, move.seen)]
                what = [f"{n} {v}" for n, v in zip(names, [*read, *after], strict=True)]
                self._leave(f"{name}: {', '.join(what) or 'at this point'}")
            else:
                self._beliefs[number] = row
        for reading in told.keys() - used:
            self._leave(f"{name}: it has no reading {reading}")

    def _leave(self, why: str) -> None:
        self.outside = self.outside or f"outside the model: {why}"


class WithMonitor(Protocol):
    """A robot with a monitor."""

    monitor: Monitor

    def cancel(self, action: str) -> None:
        """The running action is no longer wanted."""


def watched(
    robot: WithMonitor, action: Fact, act: Callable[[], Status]
) -> tuple[Callable[[], Status], Callable[[str], None]]:
    """The calls that run and cancel an action, so that the monitor learns when it starts."""
    running = False

    def go_on() -> Status:
        nonlocal running
        if not running:
            robot.monitor.begin(*action)
        running = True
        status = act()
        running = status == Status.RUNNING
        return status

    def cancel(name: str) -> None:
        nonlocal running
        running = False
        robot.cancel(name)

    return go_on, cancel


class StopOutside(StopWhenBlocked):
    """The root of a tree of a robot with a monitor: FAILURE, too, where what happened is outside
    the model. Before its first tick the tree waits for what the robot is told before its first
    action."""

    def __init__(
        self, robot: WithMonitor, child: Behaviour, reads: Mapping[Fact, bool] | None = None
    ) -> None:
        super().__init__(robot, child, reads)
        self._watching = cast("WithMonitor", self._robot)

    def tick(self) -> Iterator[Behaviour]:
        monitor = self._watching.monitor
        if not monitor.outside and not monitor.waits():
            yield from super().tick()
            return
        if monitor.outside:
            self.feedback_message = monitor.outside
            self.stop(Status.FAILURE)
        else:
            self.feedback_message = "waiting for what is told at the start"
            self.status = Status.RUNNING
        yield self


class Telling:
    """An observation of a simulated action: its name, how probably it is right, what it tells of,
    and when it is made (None: always)."""

    def __init__(
        self,
        name: str,
        accuracy: str,
        tells: Callable[[State], bool | None],
        when: Callable[[State], bool | None] | None = None,
    ) -> None:
        self.name = name
        self.accuracy = accuracy
        self.tells = tells
        self.when = when


class HiddenWorld(World):
    """A world with hidden facts: they are drawn at the start, one choice for each of ``priors``,
    and one after the other along ``walks``, and the robot is told no more than ``tellings`` say."""

    def __init__(
        self,
        initial: list[tuple[str, State]],
        actions: dict[Fact, list[Factor]],
        rng: random.Random,
        report: Callable[[str], None],
        *,
        priors: list[list[tuple[str, State]]],
        tellings: dict[Fact, list[Telling]],
        parts: list[Part],
        walks: Iterable[Callable[[random.Random], State]] = (),
    ) -> None:
        super().__init__(initial, actions, rng, report)
        hidden: State = {}
        for prior in priors:
            drawn: State = draw(rng, prior)
            hidden.update(drawn)
        for walk in walks:
            hidden.update(walk(rng))
        self._state.update(hidden)
        self._tellings = tellings
        self.monitor = Monitor(parts, self._value)
        truth = [in_words(fact) for fact, value in hidden.items() if value]
        report(f"the truth: {', '.join(truth) or 'nothing'}")
        self._listen()

    def _act(self, *action: str) -> Status:
        status = super()._act(*action)
        self._listen(*action)
        return status

    def _listen(self, *action: str) -> None:
        if self.monitor.listens(*action):
            readings = {
                telling.name: self._reading(telling)
                for telling in self._tellings.get(action, [])
                if telling.when is None or telling.when(self._state)
            }
            self.monitor.told(*action, readings=readings)
            told = [f"{name} {'true' if value else 'false'}" for name, value in readings.items()]
            self._report(f"  told: {', '.join(told) or 'nothing'}; known: {self._words()}")
        self._state.update(self.monitor.known())

    def _reading(self, telling: Telling) -> bool:
        false = str(1 - Fraction(telling.accuracy))
        right = draw(self._rng, [(telling.accuracy, True), (false, False)])
        return bool(telling.tells(self._state)) == right

    def _words(self) -> str:
        known = [each for each in self.monitor.known().items() if each[1] is not None]
        words = [f"{'' if value else 'not '}{in_words(fact)}" for fact, value in known]
        return self.monitor.outside or ", ".join(words) or "nothing"


READS: dict[Fact, bool] = {
    ("robot-at", "left"): False,
    ("robot-at", "middle"): False,
    ("robot-at", "right"): False,
}
"""The facts that the tree reads, and whether they can be unknown."""


OWN: dict[str, list[Fact]] = {
    "drive(left,middle)": [("robot_at", "left"), ("robot_at", "middle")],
    "drive(left,right)": [("robot_at", "left"), ("robot_at", "right")],
    "drive(middle,left)": [("robot_at", "left"), ("robot_at", "middle")],
    "drive(middle,right)": [("robot_at", "middle"), ("robot_at", "right")],
    "drive(right,left)": [("robot_at", "left"), ("robot_at", "right")],
    "drive(right,middle)": [("robot_at", "middle"), ("robot_at", "right")],
    "grasp(left)": [
        ("monitor.value", "holding"),
        ("monitor.value", "spilt"),
        ("monitor.value", "tin-at", "left"),
        ("monitor.value", "tin-at", "middle"),
        ("monitor.value", "tin-at", "right"),
    ],
    "grasp(middle)": [
        ("monitor.value", "holding"),
        ("monitor.value", "spilt"),
        ("monitor.value", "tin-at", "left"),
        ("monitor.value", "tin-at", "middle"),
        ("monitor.value", "tin-at", "right"),
    ],
    "grasp(right)": [
        ("monitor.value", "holding"),
        ("monitor.value", "spilt"),
        ("monitor.value", "tin-at", "left"),
        ("monitor.value", "tin-at", "middle"),
        ("monitor.value", "tin-at", "right"),
    ],
    "look(left)": [
        ("monitor.value", "holding"),
        ("monitor.value", "spilt"),
        ("monitor.value", "tin-at", "left"),
        ("monitor.value", "tin-at", "middle"),
        ("monitor.value", "tin-at", "right"),
    ],
    "look(middle)": [
        ("monitor.value", "holding"),
        ("monitor.value", "spilt"),
        ("monitor.value", "tin-at", "left"),
        ("monitor.value", "tin-at", "middle"),
        ("monitor.value", "tin-at", "right"),
    ],
    "look(right)": [
        ("monitor.value", "holding"),
        ("monitor.value", "spilt"),
        ("monitor.value", "tin-at", "left"),
        ("monitor.value", "tin-at", "middle"),
        ("monitor.value", "tin-at", "right"),
    ],
}
"""What the tree reads and an action may itself set: held while it runs."""


INITIAL: list[tuple[str, State]] = [
    (
        "1",
        {("robot-at", "left"): True, ("robot-at", "middle"): False, ("robot-at", "right"): False},
    ),
]
"""The states a run may start in, with their probabilities."""


ACTIONS: dict[Fact, list[Factor]] = {
    ("drive", "left", "middle"): [
        [Outcome("1", {("robot-at", "left"): False, ("robot-at", "middle"): True})],
    ],
    ("drive", "left", "right"): [
        [Outcome("1", {("robot-at", "left"): False, ("robot-at", "right"): True})],
    ],
    ("drive", "middle", "left"): [
        [Outcome("1", {("robot-at", "left"): True, ("robot-at", "middle"): False})],
    ],
    ("drive", "middle", "right"): [
        [Outcome("1", {("robot-at", "middle"): False, ("robot-at", "right"): True})],
    ],
    ("drive", "right", "left"): [
        [Outcome("1", {("robot-at", "left"): True, ("robot-at", "right"): False})],
    ],
    ("drive", "right", "middle"): [
        [Outcome("1", {("robot-at", "middle"): True, ("robot-at", "right"): False})],
    ],
    ("grasp", "left"): [
        [
            Outcome(
                "1",
                {},
                When(lambda s: s[("really tin-at", "left")], {("really holding",): True}),
                When(lambda s: negated(s[("really tin-at", "left")]), {("really spilt",): True}),
            ),
        ],
    ],
    ("grasp", "middle"): [
        [
            Outcome(
                "1",
                {},
                When(lambda s: s[("really tin-at", "middle")], {("really holding",): True}),
                When(lambda s: negated(s[("really tin-at", "middle")]), {("really spilt",): True}),
            ),
        ],
    ],
    ("grasp", "right"): [
        [
            Outcome(
                "1",
                {},
                When(lambda s: s[("really tin-at", "right")], {("really holding",): True}),
                When(lambda s: negated(s[("really tin-at", "right")]), {("really spilt",): True}),
            ),
        ],
    ],
    ("look", "left"): [[Outcome("1", {})]],
    ("look", "middle"): [[Outcome("1", {})]],
    ("look", "right"): [[Outcome("1", {})]],
}
"""What each action does: independent choices between outcomes."""


MONITOR: list[Part] = [
    Part(
        [("holding",), ("spilt",), ("tin-at", "left"), ("tin-at", "middle"), ("tin-at", "right")],
        [
            (False, False, None, None, None),
            (False, False, False, None, None),
            (False, False, True, False, False),
            (True, False, True, False, False),
            (False, False, False, False, True),
            (False, False, False, True, False),
            (True, False, False, False, True),
            (True, False, False, True, False),
        ],
        0,
        {
            ("grasp", "left"): Move([], ["holding()"], {(2, True): 3}),
            ("grasp", "middle"): Move([], ["holding()"], {(5, True): 7}),
            ("grasp", "right"): Move([], ["holding()"], {(4, True): 6}),
            ("look", "left"): Move([], ["tin-at(left)"], {(0, True): 2, (0, False): 1}),
            ("look", "middle"): Move([], ["tin-at(middle)"], {}),
            ("look", "right"): Move([], ["tin-at(right)"], {(1, False): 5, (1, True): 4}),
        },
    ),
]
"""What is known, by what the robot was told. It has what the runs of the tree reach."""


PRIORS: list[list[tuple[str, State]]] = [
    [
        (
            "1/3",
            {
                ("really holding",): False,
                ("really spilt",): False,
                ("really tin-at", "left"): True,
                ("really tin-at", "middle"): False,
                ("really tin-at", "right"): False,
            },
        ),
        (
            "1/3",
            {
                ("really holding",): False,
                ("really spilt",): False,
                ("really tin-at", "left"): False,
                ("really tin-at", "middle"): True,
                ("really tin-at", "right"): False,
            },
        ),
        (
            "1/3",
            {
                ("really holding",): False,
                ("really spilt",): False,
                ("really tin-at", "left"): False,
                ("really tin-at", "middle"): False,
                ("really tin-at", "right"): True,
            },
        ),
    ],
]
"""What may be true at the start, with probabilities: independent choices."""


TELLINGS: dict[Fact, list[Telling]] = {
    ("grasp", "left"): [Telling("holding()", "1", lambda s: s[("really holding",)])],
    ("grasp", "middle"): [Telling("holding()", "1", lambda s: s[("really holding",)])],
    ("grasp", "right"): [Telling("holding()", "1", lambda s: s[("really holding",)])],
    ("look", "left"): [Telling("tin-at(left)", "1", lambda s: s[("really tin-at", "left")])],
    ("look", "middle"): [Telling("tin-at(middle)", "1", lambda s: s[("really tin-at", "middle")])],
    ("look", "right"): [Telling("tin-at(right)", "1", lambda s: s[("really tin-at", "right")])],
}
"""What each action tells."""


class SimulatedWorld(HiddenWorld):
    """Plays the robot."""

    def robot_at(self, shelf: str) -> bool | None:
        return self._value("robot-at", shelf)

    def drive(self, arg_from: str, to: str) -> Status:
        return self._act("drive", arg_from, to)

    def grasp(self, shelf: str) -> Status:
        return self._act("grasp", shelf)

    def look(self, shelf: str) -> Status:
        return self._act("look", shelf)


def main() -> None:
    """Run the tree in the simulated world."""

    def make(rng: random.Random, report: Callable[[str], None]) -> Behaviour:
        world = SimulatedWorld(
            INITIAL, ACTIONS, rng, report, priors=PRIORS, tellings=TELLINGS, parts=MONITOR
        )
        return create_root(world)

    simulate(make)


if __name__ == "__main__":
    main()
