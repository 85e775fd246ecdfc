"""py_trees behaviours of a belief behavior tree, copied into the modules that bbtc writes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Protocol, TypeVar, cast, runtime_checkable

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite, Selector, Sequence
from py_trees.decorators import Decorator
from py_trees.trees import BehaviourTree

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


class Retry(Decorator):
    """Returns what its child returns, and bounds how many actions may start below it: every start
    is an attempt, and when all are used up, a further action fails instead of starting."""

    def __init__(self, name: str, attempts: int, child: Behaviour) -> None:
        super().__init__(name=name, child=child)
        self.attempts = attempts
        self.made = 0

    def update(self) -> Status:
        self.feedback_message = f"{self.made} of {self.attempts} attempts made"
        return self.decorated.status


class UntilSuccess(Decorator):
    """Ticks its child again where it fails, so many times in all, in the same tick: nothing has changed
    meanwhile. What the nodes below remember ends with the attempt; the attempts are counted anew after a
    success, the last failure and a halt. (``py_trees.decorators.Retry`` leaves a tick between attempts.)"""

    def __init__(self, name: str, attempts: int, child: Behaviour) -> None:
        super().__init__(name=name, child=child)
        self.attempts = attempts
        self.failed = 0

    def tick(self) -> Iterator[Behaviour]:
        yield from self.decorated.tick()
        while self.decorated.status == Status.FAILURE and self.failed + 1 < self.attempts:
            self.failed += 1
            self._forget()
            yield from self.decorated.tick()
        self.feedback_message = f"{self.failed} of {self.attempts} attempts failed"
        self.status = self.decorated.status
        if self.status != Status.RUNNING:
            self.stop(self.status)
        yield self

    def update(self) -> Status:
        return self.status

    def terminate(self, new_status: Status) -> None:
        del new_status
        self.failed = 0
        self._forget()

    def _forget(self) -> None:
        for node in self.decorated.iterate():
            if isinstance(node, Latch):
                if node.decorated.status == Status.RUNNING:
                    node.decorated.stop(Status.INVALID)
                node._started, node._final = False, None
            elif isinstance(node, Retry):
                node.made = 0
            elif isinstance(node, UntilSuccess):
                node.failed = 0


class Try(Latch):
    """An action below a Retry: it starts only if every Retry above it has an attempt left."""

    def _ready(self) -> bool | None:
        ready = super()._ready()
        if ready and any(retry.made >= retry.attempts for retry in self._retries()):
            return False
        return ready

    def _use_up(self) -> None:
        for retry in self._retries():
            retry.made += 1

    def _retries(self) -> Iterator[Retry]:
        above = self.parent
        while above is not None:
            if isinstance(above, Retry):
                yield above
            above = above.parent


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


def until_success(name: str, attempts: int, child: Behaviour) -> Behaviour:
    """Tries its child so many times at most."""
    return UntilSuccess(name, attempts, child)


def retry(name: str, attempts: int, child: Behaviour) -> Behaviour:
    """Lets at most so many actions start below."""
    return Retry(name, attempts, child)


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
