"""Behavior tree for the problem look-for-soda of the domain household. Made by bbtc.

In the model of that domain it succeeds with probability 1/2.
Implement the class Robot, and run

    run(create_root(MyRobot()), period=0.1)

As a program, this module runs the tree in a simulated world (--help tells how).
It needs py_trees 2.2 or later, and bbtc.
"""

from __future__ import annotations

from typing import Protocol

from bbtc.runtime import (
    Condition,
    Fact,
    Factor,
    Latch,
    Outcome,
    State,
    StopWhenBlocked,
    World,
    fallback,
    run,
    sequence,
    simulate,
    skipper,
    view,
)
from py_trees.behaviour import Behaviour
from py_trees.common import Status

__all__ = ["Robot", "SimulatedWorld", "create_root", "run"]


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
