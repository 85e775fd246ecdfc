"""Where a robot may keep what it believes, copied into the robots that bbtc writes."""

from __future__ import annotations

from urllib.parse import quote

from py_trees.blackboard import Blackboard


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
