"""Python's cycle collector, out of the way while a great many objects are made."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


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
            if not gc.get_freeze_count():
                # Counts everything as old at once; else the collector would go through all of it as
                # soon as it is enabled, three times.
                gc.freeze()
                gc.unfreeze()
            gc.enable()
