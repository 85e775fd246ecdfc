"""The exit statuses of the program, and which of them a plan ends with. Imports nothing that takes time."""

from __future__ import annotations

from enum import IntEnum
from types import MappingProxyType


class ExitStatus(IntEnum):
    """How a command ended."""

    DONE = 0
    ERRORS = 1
    """Errors in the input, drift, a target provably out of reach, or a result that cannot be written."""
    USAGE = 2
    """The command line itself is wrong."""
    LIMIT = 3
    """A limit stopped the work; the best result is written."""
    INTERNAL = 70
    """A bug."""
    INTERRUPTED = 130
    """Ctrl-C, or SIGTERM."""


OF_TREE = MappingProxyType(
    {
        "target-reached": ExitStatus.DONE,
        "out-of-reach": ExitStatus.ERRORS,
        "stuck": ExitStatus.LIMIT,
        "limit-reached": ExitStatus.LIMIT,
        "interrupted": ExitStatus.INTERRUPTED,
    }
)
"""What planning ends with, by the status of the tree it made."""
