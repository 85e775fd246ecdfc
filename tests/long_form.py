"""How much the sweeps take: little, as part of every run, or much, with ``BBTC_LONG=1``."""

from __future__ import annotations

import os

LONG = bool(os.environ.get("BBTC_LONG"))
"""Is this the long form?"""


def amount(short: int, long: int) -> int:
    """The number for the form that is run."""
    return long if LONG else short
