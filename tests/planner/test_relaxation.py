"""What is possible in the relaxation of a task, and what it takes."""

from __future__ import annotations

from bbtc.ground.condition import FALSE, Is
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.h_add import Relaxation, possible
from tests.planner.test_refine import action, task

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN


def test_what_an_action_does_that_is_never_applicable_is_impossible() -> None:
    """Whatever else holds."""
    of = task(
        "won lit last",
        {2: T},
        Is(0, T),
        action("cheat", FALSE, ("1", {0: T})),
        action("light", Is(2, T), ("1", {1: T})),
    )
    for last in (T, F, U):
        facts = Relaxation(of, Limits()).facts(bytes([F, F, last]))
        assert not possible(Is(0, T), facts)
        assert possible(Is(1, T), facts) == (last is T)
