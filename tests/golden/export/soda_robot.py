"""The robot of look_for_soda.py for the problem look-for-soda. Begun by bbtc, to be filled in.

As a program, this file runs the tree. In ROS, give create_root(MyRobot()) to
py_trees_ros.trees.BehaviourTree.
"""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

from py_trees.blackboard import Blackboard
from py_trees.common import Status

from look_for_soda import Robot, create_root, run


class Beliefs:
    """What a robot believes of every fact: True, False or None (unknown). It stands on the py_trees
    blackboard, where any behaviour can write it and any tool can watch it. All of a process share
    one blackboard: every robot needs a namespace of its own, which is made of words."""

    def __init__(self, *namespace: str) -> None:
        self.namespace = namespace

    def key(self, *fact: str) -> str:
        """The key of a fact, that is, a predicate and its arguments: ``/namespace/seen/soda``. What
        is no letter, digit, ``_``, ``-`` or ``~`` stands as ``%`` and hexadecimal digits."""
        words = [
            quote(word, safe="", errors="surrogatepass").replace(".", "%2E")
            for word in (*self.namespace, *fact)
        ]
        return "".join(f"/{word or '%'}" for word in words)

    def value(self, *fact: str) -> bool | None:
        """What is believed of a fact; None if nothing is."""
        try:
            value = Blackboard.get(self.key(*fact))
        except KeyError:
            return None
        if value is None or isinstance(value, bool):
            return value
        raise TypeError(f"{self.key(*fact)} is {value!r}, not True, False or None")

    def heard_of(self, *fact: str, unknown: bool = True) -> bool:
        """Whether anything was believed of a fact yet: that it is true or false, or, where
        ``unknown`` will do, unknown."""
        return Blackboard.exists(self.key(*fact)) and (unknown or self.value(*fact) is not None)

    def believe(self, value: bool | None, *fact: str) -> None:
        """From now on, this is believed of a fact."""
        Blackboard.set(self.key(*fact), value)


class MyRobot:
    """Senses and acts. Change everything but the names of its methods."""

    def __init__(self) -> None:
        self._beliefs = Beliefs("household", "look-for-soda")
        # What the problem says of the start:
        self._beliefs.believe(False, "luminousity_ok")
        self._beliefs.believe(None, "seen", "soda")

    def setup(self, **kwargs: Any) -> None:
        """Called once, before the first tick. In ROS, kwargs["node"] is the node."""

    def heard_of(self, *fact: str, unknown: bool) -> bool:
        """Whether anything is believed of a fact. The tree waits for that before its first tick."""
        return self._beliefs.heard_of(*fact, unknown=unknown)

    def cancel(self, action: str) -> None:
        """The running action, named as in the tree, is no longer wanted."""
        print("stop", action)

    def luminousity_ok(self) -> bool | None:
        """Whether luminousity_ok() holds."""
        return self._beliefs.value("luminousity_ok")

    def seen(self, arg: str) -> bool | None:
        """Whether seen(arg) holds; None where that is unknown."""
        return self._beliefs.value("seen", arg)

    def detect(self, arg: str) -> Status:
        """Start or continue detect(arg)."""
        return self._to_do("detect", arg)

    def light_on(self) -> Status:
        """Start or continue light_on()."""
        return self._to_do("light_on")

    def _to_do(self, *action: str) -> Status:
        # In the place of this, an action starts when it is called first, returns RUNNING until it
        # ends, then SUCCESS once its effects are believed, or FAILURE.
        print("to do:", *action)
        return Status.FAILURE


def main() -> None:
    """Run the tree with this robot."""
    robot: Robot = MyRobot()
    root = create_root(robot)
    print(f"The tree returned {run(root, period=0.1).value}.")
    if root.feedback_message:
        print(root.feedback_message)


if __name__ == "__main__":
    main()
