"""What exported py_trees modules need while they run. bbtc copies it into them, or, with ``-O
runtime=imported``, they import it from here. It needs py_trees (2.2 or later) and nothing else."""

from __future__ import annotations

from bbtc.runtime.beliefs import Beliefs
from bbtc.runtime.limits import Within, within
from bbtc.runtime.monitor import HiddenWorld, Monitor, Move, Part, StopOutside, Telling, Walk, watched
from bbtc.runtime.moving import MovingWorld, Rounds, Test
from bbtc.runtime.nodes import (
    Action,
    Condition,
    Fact,
    Latch,
    Retry,
    Skipper,
    StopWhenBlocked,
    Try,
    UntilSuccess,
    WithBeliefs,
    WithSetup,
    all_of,
    any_of,
    fallback,
    in_words,
    negated,
    retry,
    run,
    sequence,
    skipper,
    until_success,
)
from bbtc.runtime.world import Factor, Outcome, State, When, World, draw, happen, simulate

__all__ = [
    "Action",
    "Beliefs",
    "Condition",
    "Fact",
    "Factor",
    "HiddenWorld",
    "Latch",
    "Monitor",
    "Move",
    "MovingWorld",
    "Outcome",
    "Part",
    "Retry",
    "Rounds",
    "Skipper",
    "State",
    "StopOutside",
    "StopWhenBlocked",
    "Telling",
    "Test",
    "Try",
    "UntilSuccess",
    "Walk",
    "When",
    "WithBeliefs",
    "WithSetup",
    "Within",
    "World",
    "all_of",
    "any_of",
    "draw",
    "fallback",
    "happen",
    "in_words",
    "negated",
    "retry",
    "run",
    "sequence",
    "simulate",
    "skipper",
    "until_success",
    "watched",
    "within",
]
