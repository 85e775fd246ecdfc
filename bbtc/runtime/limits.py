"""Actions that are given up after some time, copied into the py_trees modules that bbtc writes."""

from __future__ import annotations

import time
from collections.abc import Callable

from py_trees.common import Status


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
