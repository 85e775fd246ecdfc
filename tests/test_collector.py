"""The cycle collector does its work in processes that make one task after the other."""

from __future__ import annotations

import gc
from weakref import ref

import pytest

from bbtc.collector import collector_paused


class _Cycle:
    """Nothing but the collector frees it."""

    def __init__(self) -> None:
        self.own = self


@pytest.mark.parametrize(("rounds", "made"), [(3_000, 10), (20, 150_000)])
def test_cycles_are_freed_between_pauses(rounds: int, made: int) -> None:
    """With many objects made in each pause, and with few; some hundred by others in between."""
    gc.collect()
    alive = []
    for _ in range(rounds):
        alive.append(ref(_Cycle()))
        garbage = [_Cycle() for _ in range(100)]
        with collector_paused():
            new = [[number] for number in range(made)]
            assert not gc.isenabled()
        assert gc.isenabled()
        del garbage, new
    left = sum(each() is not None for each in alive)
    assert left < rounds / 2


def test_a_collector_that_was_off_stays_off() -> None:
    gc.disable()
    try:
        with collector_paused():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
