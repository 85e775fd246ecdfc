"""Python's cycle collector, out of the way while a great many objects are made."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

_MANY = 100_000
"""New objects of which it would take the collector noticeable time to find that there is no cycle in them."""

_EACH = 10
"""After so many pauses with many new objects, all is looked through."""

_pauses = count(1)


@contextmanager
def collector_paused() -> Iterator[None]:
    """For making millions of small objects, none of them in a cycle: looking for cycles meanwhile takes
    longer than making them."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            # Few are left to the collector, which otherwise would never come to look for older cycles.
            if gc.get_count()[0] > _MANY and not gc.get_freeze_count():
                if next(_pauses) % _EACH == 0:
                    gc.collect()
                # Counts everything as old at once; else the collector would go through all of it as
                # soon as it is enabled, three times.
                gc.freeze()
                gc.unfreeze()
            gc.enable()
