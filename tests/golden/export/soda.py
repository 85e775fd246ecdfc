"""Behavior tree for the problem look-for-soda of the domain household. Made by bbtc.

In the model of that domain it succeeds with probability 1/2.
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
from py_trees.composites import Composite, Selector, Sequence
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

    def luminousity_ok(self) -> bool | None:
        """Whether luminousity_ok() holds."""

    def seen(self, arg: str) -> bool | None:
        """Whether seen(arg) holds; None where that is unknown."""

    def detect(self, arg: str) -> Status:
        """Start or continue detect(arg)."""

    def light_on(self) -> Status:
        """Start or continue light_on()."""


Fact = tuple[str, ...]
R = TypeVar("R")


def in_words(fact: Fact) -> str:
    """``predicate(object,…)``."""
    return f"{fact[0]}({','.join(fact[1:])})"


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


class Skipper(Composite):
    """Goes on to the next child while a child is RUNNING; returns the first SUCCESS or FAILURE."""

    def tick(self) -> Iterator[Behaviour]:
        status = Status.RUNNING
        for child in self.children:
            yield from child.tick()
            self.current_child = child
            status = child.status
            if status != Status.RUNNING:
                break
        if status != Status.RUNNING:
            for child in self.children:
                if child is not self.current_child and child.status != Status.INVALID:
                    child.stop(Status.INVALID)
            self.stop(status)
        self.status = status
        yield self


def sequence(name: str, *children: Behaviour) -> Behaviour:
    """Goes on while children succeed. Every tick starts at the first child."""
    return Sequence(name, memory=False, children=list(children))


def fallback(name: str, *children: Behaviour) -> Behaviour:
    """Goes on while children fail. Every tick starts at the first child."""
    return Selector(name, memory=False, children=list(children))


def skipper(name: str, *children: Behaviour) -> Behaviour:
    """Goes on while children are running. Every tick starts at the first child."""
    return Skipper(name, children=list(children))


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
        skipper(
            "skipper",
            Condition("seen(soda)", lambda: robot.seen("soda")),
            sequence(
                "sequence for seen(soda)",
                fallback(
                    "fallback",
                    sequence(
                        "sequence",
                        fallback(
                            "fallback for luminousity_ok()",
                            Condition("luminousity_ok()", robot.luminousity_ok),
                            sequence(
                                "sequence",
                                Latch(
                                    "light_on()",
                                    robot.light_on,
                                    robot.cancel,
                                    own=OWN["light_on()"],
                                ),
                                Condition("luminousity_ok()", robot.luminousity_ok),
                            ),
                        ),
                        Latch(
                            "detect(soda)",
                            lambda: robot.detect("soda"),
                            robot.cancel,
                            own=OWN["detect(soda)"],
                        ),
                        Condition("known seen(soda)", lambda: robot.seen("soda") is not None),
                    ),
                ),
                Condition("seen(soda)", lambda: robot.seen("soda")),
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


READS: dict[Fact, bool] = {("luminousity_ok",): False, ("seen", "soda"): True}
"""The facts that the tree reads, and whether they can be unknown."""


OWN: dict[str, list[Fact]] = {
    "detect(soda)": [("seen", "soda")],
    "light_on()": [("luminousity_ok",)],
}
"""What the tree reads and an action may itself set: held while it runs."""


INITIAL: list[tuple[str, State]] = [("1", {("luminousity_ok",): False, ("seen", "soda"): None})]
"""The states a run may start in, with their probabilities."""


ACTIONS: dict[Fact, list[Factor]] = {
    ("detect", "soda"): [
        [Outcome("1/2", {("seen", "soda"): True}), Outcome("1/2", {("seen", "soda"): False})],
    ],
    ("light_on",): [[Outcome("1", {("luminousity_ok",): True})]],
}
"""What each action does: independent choices between outcomes."""


class SimulatedWorld(World):
    """Plays the robot."""

    def luminousity_ok(self) -> bool | None:
        return self._value("luminousity_ok")

    def seen(self, arg: str) -> bool | None:
        return self._value("seen", arg)

    def detect(self, arg: str) -> Status:
        return self._act("detect", arg)

    def light_on(self) -> Status:
        return self._act("light_on")


def main() -> None:
    """Run the tree in the simulated world."""
    simulate(lambda rng, report: create_root(SimulatedWorld(INITIAL, ACTIONS, rng, report)))


if __name__ == "__main__":
    main()
