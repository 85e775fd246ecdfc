"""Behavior tree for the problem last-parts of the domain bin-picking. Made by bbtc.

In the model of that domain it succeeds with probability ≈ 0.998328065605.
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

    def in_bin(self) -> int | None:
        """The value of in-bin(); None where that is unknown."""

    def in_tray(self) -> int | None:
        """The value of in-tray(); None where that is unknown."""

    def done(self) -> bool | None:
        """Whether done() holds."""

    def free_part(self) -> bool | None:
        """Whether free-part() holds; None where that is unknown."""

    def holding(self) -> bool | None:
        """Whether holding() holds."""

    def tray(self) -> bool | None:
        """Whether tray() holds."""

    def grasp(self) -> Status:
        """Start or continue grasp()."""

    def hand_over(self) -> Status:
        """Start or continue hand-over()."""

    def look(self) -> Status:
        """Start or continue look()."""

    def place(self) -> Status:
        """Start or continue place()."""

    def shake(self) -> Status:
        """Start or continue shake()."""

    def wait(self) -> Status:
        """Start or continue wait()."""


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


def live(robot: R) -> R:
    """The robot itself, of which nothing is held."""
    return cast("R", robot.robot) if isinstance(robot, View) else robot


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


class Within:
    """An action that is given up after so many seconds: it is cancelled then, and has ended."""

    def __init__(
        self, seconds: float, name: str, act: Callable[[], Status], cancel: Callable[[str], None]
    ) -> None:
        self._seconds = seconds
        self._name = name
        self._act = act
        self._cancel = cancel
        self._since: float | None = None

    def act(self) -> Status:
        now = time.monotonic()
        if self._since is None:
            self._since = now
        if now - self._since > self._seconds:
            self.cancel(self._name)
            return Status.SUCCESS
        status = self._act()
        if status != Status.RUNNING:
            self._since = None
        return status

    def cancel(self, name: str) -> None:
        self._since = None
        self._cancel(name)


def within(
    seconds: float, name: str, act: Callable[[], Status], cancel: Callable[[str], None]
) -> tuple[str, Callable[[], Status], Callable[[str], None]]:
    """The first three arguments of a Latch whose action is given up after so many seconds."""
    limited = Within(seconds, name, act, cancel)
    return name, limited.act, limited.cancel


def create_root(robot: Robot) -> Behaviour:
    """The tree. Latches stay latched, so it runs once: make a new one for another run."""
    robot = view(robot)
    return StopWhenBlocked(
        robot,
        fallback(
            "fallback",
            Condition("done()", robot.done),
            Latch(
                "hand-over()",
                robot.hand_over,
                robot.cancel,
                guard=lambda: between(robot.in_tray(), 2, None),
                keep=False,
                own=OWN["hand-over()"],
            ),
            Latch(
                "place()",
                robot.place,
                robot.cancel,
                guard=lambda: all_of(robot.holding(), robot.tray()),
                keep=False,
                during=lambda: live(robot).tray(),
                own=OWN["place()"],
            ),
            sequence(
                "sequence",
                Condition(
                    "(in-bin() >= 2 or in-tray() >= 1 or holding())",
                    lambda: any_of(
                        between(robot.in_bin(), 2, None),
                        between(robot.in_tray(), 1, None),
                        robot.holding(),
                    ),
                ),
                Latch(
                    "look()",
                    robot.look,
                    robot.cancel,
                    guard=lambda: all_of(
                        robot.free_part() is None,
                        between(robot.in_bin(), 1, None),
                    ),
                    keep=False,
                    own=OWN["look()"],
                ),
            ),
            sequence(
                "for holding()",
                Condition(
                    "((tray() and in-bin() >= 2) or (in-tray() >= 1 and tray()))",
                    lambda: any_of(
                        all_of(robot.tray(), between(robot.in_bin(), 2, None)),
                        all_of(between(robot.in_tray(), 1, None), robot.tray()),
                    ),
                ),
                Latch(
                    *within(3.0, "grasp()", robot.grasp, robot.cancel),
                    guard=lambda: all_of(
                        robot.free_part(),
                        negated(robot.holding()),
                        between(robot.in_bin(), 1, None),
                    ),
                    keep=False,
                    own=OWN["grasp()"],
                ),
            ),
            sequence(
                "sequence",
                Condition("holding()", robot.holding),
                Latch("wait()", robot.wait, robot.cancel, keep=False),
            ),
            sequence(
                "sequence",
                Condition(
                    "(in-bin() >= 2 or (known free-part() and not free-part() an…",
                    lambda: any_of(
                        between(robot.in_bin(), 2, None),
                        all_of(
                            robot.free_part() is not None,
                            negated(robot.free_part()),
                            between(robot.in_tray(), 1, None),
                        ),
                    ),
                ),
                Latch(
                    "shake()",
                    robot.shake,
                    robot.cancel,
                    guard=lambda: negated(robot.free_part()),
                    keep=False,
                    own=OWN["shake()"],
                ),
            ),
            sequence(
                "sequence",
                Condition(
                    "(in-bin() >= 2 or (known free-part() and free-part() and in…",
                    lambda: any_of(
                        between(robot.in_bin(), 2, None),
                        all_of(
                            robot.free_part() is not None,
                            robot.free_part(),
                            between(robot.in_tray(), 1, None),
                        ),
                    ),
                ),
                Latch("wait()", robot.wait, robot.cancel, keep=False),
            ),
            sequence(
                "sequence",
                Condition(
                    "(in-bin() = 0 and in-tray() = 0)",
                    lambda: all_of(
                        between(robot.in_bin(), None, 0),
                        between(robot.in_tray(), None, 0),
                    ),
                ),
                Latch("wait()", robot.wait, robot.cancel, keep=False),
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


Test = Callable[[State], bool | None]
Rounds = list[list[tuple[Test, list[Factor]]]]


class MovingWorld(World):
    """A world with events. ``events`` are, for each action, those of each round: where one may happen, and
    what it does. Of the actions that events may end: while what they go on, and what happens else."""

    def __init__(
        self,
        initial: list[tuple[str, State]],
        actions: dict[Fact, list[Factor]],
        rng: random.Random,
        report: Callable[[str], None],
        *,
        events: dict[Fact, Rounds],
        interrupted: dict[Fact, tuple[Test, list[Factor]]],
    ) -> None:
        super().__init__(initial, actions, rng, report)
        self._events = events
        self._interrupted = interrupted

    def _act(self, *action: str) -> Status:
        if action not in self._interrupted:
            status = super()._act(*action)
            self._happen(*action)
            return status
        self._happen(*action)
        goes_on, abort = self._interrupted[action]
        if goes_on(self._state) is True:
            return super()._act(*action)
        self._state.update(happen(self._rng, abort, self._state))
        self._report(f"{in_words(action)}: aborted")
        return Status.SUCCESS

    def _happen(self, *action: str) -> None:
        """The events of one draw: those of a round all read the state that it begins with."""
        for events in self._events[action]:
            due = [factors for test, factors in events if test(self._state) is True]
            changes = happen(self._rng, [factor for factors in due for factor in factors], self._state)
            words = {True: "true", False: "false", None: "unknown"}
            told = [
                f"{in_words(fact)} {words[value]}"
                for fact, value in changes.items()
                if value != self._state[fact]
            ]
            self._state.update(changes)
            if told:
                self._report(f"by itself: {', '.join(told)}")


Values = dict[Fact, Any]


def between(value: int | None, low: int | None, high: int | None) -> bool | None:
    """Whether a number is no less than one and no more than another; None where it is unknown."""
    if value is None:
        return None
    return (low is None or low <= value) and (high is None or value <= high)


class Shift(When):
    """Adds to a number, no further than to the bounds of its range, if a condition is True in the
    state before the action."""

    def __init__(
        self,
        fact: Fact,
        amount: int,
        low: int,
        high: int,
        condition: Callable[[State], bool | None] = lambda _: True,
    ) -> None:
        super().__init__(condition, {})
        self.fact = fact
        self.amount = amount
        self.low = low
        self.high = high

    def on(self, before: Values) -> When:
        """What it comes to in a state."""
        value = min(max(before[self.fact] + self.amount, self.low), self.high)
        changes: Values = {self.fact: value}
        return When(self.condition, changes)


def on_numbers(factors: list[Factor], before: Values) -> list[Factor]:
    """Factors in which numbers get the values that they come to in a state."""
    return [
        [
            Outcome(
                outcome.probability,
                outcome.changes,
                *(part.on(before) if isinstance(part, Shift) else part for part in outcome.conditional),
                then=on_numbers(outcome.then, before),
            )
            for outcome in factor
        ]
        for factor in factors
    ]


def number_changes(rng: random.Random, factors: list[Factor], before: State) -> Values:
    """What an action or an event changes, numbers included."""
    changes: Values = happen(rng, on_numbers(factors, before), before)
    return changes


def said(value: Any) -> str:
    """A value in words."""
    if value is None:
        return "unknown"
    return str(value).lower()


def in_short(changes: Values, before: State) -> str:
    """What differs from the state before, in words."""
    kept: Values = before
    return ", ".join(
        f"{in_words(fact)} {said(value)}" for fact, value in changes.items() if value != kept[fact]
    )


class MovingNumberWorld(MovingWorld):
    """A world with numbers among its facts, and with events."""

    def _number(self, *fact: str) -> int:
        state: Values = self._state
        value: int = state[fact]
        return value

    def _act(self, *action: str) -> Status:
        if action not in self._interrupted:
            self._change(action, self._actions[action], "no change")
            self._happen(*action)
            return Status.SUCCESS
        self._happen(*action)
        goes_on, abort = self._interrupted[action]
        if goes_on(self._state) is True:
            self._change(action, self._actions[action], "no change")
        else:
            self._change(action, abort, "aborted")
        return Status.SUCCESS

    def _change(self, action: Fact, factors: list[Factor], otherwise: str) -> None:
        changes = number_changes(self._rng, factors, self._state)
        told = in_short(changes, self._state)
        self._state.update(changes)
        self._report(f"{in_words(action)}: {told or otherwise}")

    def _happen(self, *action: str) -> None:
        for events in self._events[action]:
            due = [factors for test, factors in events if test(self._state) is True]
            factors = [factor for each in due for factor in each]
            changes = number_changes(self._rng, factors, self._state)
            told = in_short(changes, self._state)
            self._state.update(changes)
            if told:
                self._report(f"by itself: {told}")


READS: dict[Fact, bool] = {
    ("done",): False,
    ("free-part",): True,
    ("holding",): False,
    ("in-bin",): False,
    ("in-tray",): False,
    ("tray",): False,
}
"""The facts that the tree reads, and whether they can be unknown."""


OWN: dict[str, list[Fact]] = {
    "grasp()": [("free_part",), ("holding",), ("in_bin",)],
    "hand-over()": [("done",)],
    "look()": [("free_part",)],
    "place()": [("holding",), ("in_tray",)],
    "shake()": [("free_part",)],
}
"""What the tree reads and an action may itself set: held while it runs."""


INITIAL: list[tuple[str, Values]] = [
    (
        "1",
        {
            ("done",): False,
            ("free-part",): None,
            ("holding",): False,
            ("tray",): True,
            ("in-bin",): 3,
            ("in-tray",): 0,
        },
    ),
]
"""The states a run may start in, with their probabilities."""


ACTIONS: dict[Fact, list[Factor]] = {
    ("grasp",): [
        [
            Outcome("25/154", {("free-part",): None}),
            Outcome(
                "2967/3850",
                {("free-part",): None, ("holding",): True},
                Shift(("in-bin",), -1, 0, 9),
            ),
            Outcome("129/1925", {("free-part",): None}),
        ],
    ],
    ("hand-over",): [[Outcome("1", {("done",): True})]],
    ("look",): [
        [Outcome("17/20", {("free-part",): True}), Outcome("3/20", {("free-part",): False})],
    ],
    ("place",): [[Outcome("1", {("holding",): False}, Shift(("in-tray",), 1, 0, 9))]],
    ("shake",): [[Outcome("1", {("free-part",): None})]],
    ("wait",): [[Outcome("1", {})]],
}
"""What each action does: independent choices between outcomes."""


MOVES: Rounds = [
    [
        (
            lambda s: s[("holding",)],
            [
                [
                    Outcome("22633724291/1000000000000", {("holding",): False}),
                    Outcome("977366275709/1000000000000", {}),
                ],
            ],
        ),
        (
            lambda s: negated(s[("tray",)]),
            [
                [
                    Outcome("475313467869/1000000000000", {("tray",): True}),
                    Outcome("524686532131/1000000000000", {}),
                ],
            ],
        ),
        (
            lambda s: s[("tray",)],
            [
                [
                    Outcome("18883413521/1000000000000", {("tray",): False}),
                    Outcome("981116586479/1000000000000", {}),
                ],
            ],
        ),
    ],
]


MOVES_2: Rounds = [
    [
        (
            lambda s: s[("holding",)],
            [[Outcome("1/100", {("holding",): False}), Outcome("99/100", {})]],
        ),
        (
            lambda s: negated(s[("tray",)]),
            [[Outcome("1/4", {("tray",): True}), Outcome("3/4", {})]],
        ),
        (
            lambda s: s[("tray",)],
            [
                [
                    Outcome("8333333333/1000000000000", {("tray",): False}),
                    Outcome("991666666667/1000000000000", {}),
                ],
            ],
        ),
    ],
]


MOVES_3: Rounds = [
    [
        (
            lambda s: s[("holding",)],
            [
                [
                    Outcome("4012064419/1000000000000", {("holding",): False}),
                    Outcome("995987935581/1000000000000", {}),
                ],
            ],
        ),
        (
            lambda s: negated(s[("tray",)]),
            [
                [
                    Outcome("108698771017/1000000000000", {("tray",): True}),
                    Outcome("891301228983/1000000000000", {}),
                ],
            ],
        ),
        (
            lambda s: s[("tray",)],
            [
                [
                    Outcome("1670851953/500000000000", {("tray",): False}),
                    Outcome("498329148047/500000000000", {}),
                ],
            ],
        ),
    ],
]


MOVES_4: Rounds = [
    [
        (
            lambda s: s[("holding",)],
            [
                [
                    Outcome("12483296721/1000000000000", {("holding",): False}),
                    Outcome("987516703279/1000000000000", {}),
                ],
            ],
        ),
        (
            lambda s: negated(s[("tray",)]),
            [
                [
                    Outcome("150722249373/500000000000", {("tray",): True}),
                    Outcome("349277750627/500000000000", {}),
                ],
            ],
        ),
        (
            lambda s: s[("tray",)],
            [
                [
                    Outcome("520253571/50000000000", {("tray",): False}),
                    Outcome("49479746429/50000000000", {}),
                ],
            ],
        ),
    ],
]


MOVES_5: Rounds = [
    [
        (
            lambda s: s[("holding",)],
            [[Outcome("199/10000", {("holding",): False}), Outcome("9801/10000", {})]],
        ),
        (
            lambda s: negated(s[("tray",)]),
            [[Outcome("7/16", {("tray",): True}), Outcome("9/16", {})]],
        ),
        (
            lambda s: s[("tray",)],
            [
                [
                    Outcome("8298611111/500000000000", {("tray",): False}),
                    Outcome("491701388889/500000000000", {}),
                ],
            ],
        ),
    ],
]


MOVES_6: Rounds = [
    [
        (
            lambda s: s[("holding",)],
            [
                [
                    Outcome("5012562893/1000000000000", {("holding",): False}),
                    Outcome("994987437107/1000000000000", {}),
                ],
            ],
        ),
        (
            lambda s: negated(s[("tray",)]),
            [
                [
                    Outcome("16746824527/125000000000", {("tray",): True}),
                    Outcome("108253175473/125000000000", {}),
                ],
            ],
        ),
        (
            lambda s: s[("tray",)],
            [
                [
                    Outcome("4175383581/1000000000000", {("tray",): False}),
                    Outcome("995824616419/1000000000000", {}),
                ],
            ],
        ),
    ],
]


EVENTS: dict[Fact, Rounds] = {
    ("grasp",): MOVES,
    ("hand-over",): MOVES_2,
    ("look",): MOVES_3,
    ("place",): MOVES_4,
    ("shake",): MOVES_5,
    ("wait",): MOVES_6,
}
"""What happens by itself with each action, round by round: where it may, and what."""


INTERRUPTED: dict[Fact, tuple[Test, list[Factor]]] = {("place",): (lambda s: s[("tray",)], [])}
"""While what actions go on that events may end, and what happens else."""


class SimulatedWorld(MovingNumberWorld):
    """Plays the robot."""

    def in_bin(self) -> int | None:
        return self._number("in-bin")

    def in_tray(self) -> int | None:
        return self._number("in-tray")

    def done(self) -> bool | None:
        return self._value("done")

    def free_part(self) -> bool | None:
        return self._value("free-part")

    def holding(self) -> bool | None:
        return self._value("holding")

    def tray(self) -> bool | None:
        return self._value("tray")

    def grasp(self) -> Status:
        return self._act("grasp")

    def hand_over(self) -> Status:
        return self._act("hand-over")

    def look(self) -> Status:
        return self._act("look")

    def place(self) -> Status:
        return self._act("place")

    def shake(self) -> Status:
        return self._act("shake")

    def wait(self) -> Status:
        return self._act("wait")


def main() -> None:
    """Run the tree in the simulated world."""

    def make(rng: random.Random, report: Callable[[str], None]) -> Behaviour:
        world = SimulatedWorld(
            INITIAL, ACTIONS, rng, report, events=EVENTS, interrupted=INTERRUPTED
        )
        return create_root(world)

    simulate(make)


if __name__ == "__main__":
    main()
