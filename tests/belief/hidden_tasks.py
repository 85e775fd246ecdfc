"""Small tasks with hidden facts whose figures are known in closed form."""

from __future__ import annotations

from fractions import Fraction

from bbtc.ground.condition import TRUE, And, Condition, Is
from bbtc.ground.task import (
    NO_CHANGE,
    Change,
    Component,
    Effect,
    Factor,
    GroundAction,
    InitialState,
    Knowledge,
    Observation,
    Outcome,
    Task,
    Variable,
)
from bbtc.kleene import Truth

ONE = Fraction(1)
HALF = Fraction(1, 2)


def certain(*effects: Effect) -> tuple[Factor, ...]:
    """What happens with certainty."""
    return (Factor((Outcome(ONE, effects),)),)


def tiger(accuracy: Fraction, believed: Fraction | None = None) -> Task:
    """Behind one of two doors is a tiger (Kaelbling, Littman, Cassandra 1998). To listen tells behind which,
    rightly with ``accuracy``; to open a door shows what was behind it. If ``believed`` is given, a door is
    opened only where the tiger is believed with that probability to be behind the other one."""
    dead, free, left = 0, 1, 2
    variables = (
        Variable("dead", (), three_valued=False),
        Variable("free", (), three_valued=False),
        Variable("tiger", ("left",), three_valued=True, hidden=True),
    )
    prior = ((0, HALF), (1, HALF))
    knowledge = Knowledge(left, Is(0, Truth.TRUE), believed or ONE)
    component = Component(("tiger(left)",), prior, (knowledge,))
    alive = Is(dead, Truth.FALSE)
    listen = GroundAction(
        "listen",
        (),
        alive,
        (NO_CHANGE,),
        ONE,
        (Change(0, (), (), (Observation(Is(0, Truth.TRUE), accuracy),)),),
    )

    def opened(door: str, deadly: Truth) -> GroundAction:
        ready: tuple[Condition, ...] = (alive, Is(free, Truth.FALSE))
        safe = Truth.FALSE if deadly is Truth.TRUE else Truth.TRUE
        if believed is not None:
            ready = (*ready, Is(left, safe))
        effects = Effect(Is(0, deadly), ((1, Truth.TRUE),)), Effect(Is(0, safe), ((2, Truth.TRUE),))
        change = Change(0, (dead, free), certain(*effects))
        return GroundAction("open", (door,), And(ready), (NO_CHANGE,), ONE, (change,))

    start = (Truth.FALSE, Truth.FALSE, Truth.UNKNOWN)
    actions = (listen, opened("left", Truth.TRUE), opened("right", Truth.FALSE))
    goal = Is(free, Truth.TRUE)
    return Task("tiger", "p", variables, (InitialState(ONE, start),), goal, actions, components=(component,))


def search(places: int, found: Fraction = ONE) -> Task:
    """A thing is in one of some places, each as likely. To look into one tells, with probability ``found``,
    if it is there, and never errs if it is not; it is to be taken where it is known to be."""
    have = places
    variables = (
        *(Variable("at", (str(place),), three_valued=True, hidden=True) for place in range(places)),
        Variable("have", (), three_valued=False),
    )
    seen = places  # a hidden fact of its own, drawn anew by each look
    worlds = tuple((1 << place, Fraction(1, places)) for place in range(places))
    known = tuple(Knowledge(place, Is(place, Truth.TRUE)) for place in range(places))
    component = Component((*(f"at({place})" for place in range(places)), "seen()"), worlds, known)

    def look(place: int) -> GroundAction:
        there, told = Is(place, Truth.TRUE), Is(seen, Truth.TRUE)
        shown = Effect(there, ((seen, Truth.TRUE),)), Effect(Is(place, Truth.FALSE), ((seen, Truth.FALSE),))
        missed = Effect(None, ((seen, Truth.FALSE),))
        outcomes = [Outcome(found, shown), *([Outcome(1 - found, (missed,))] if found < 1 else [])]
        change = Change(0, (), (Factor(tuple(outcomes)),), (Observation(told),))
        return GroundAction("look", (str(place),), TRUE, (NO_CHANGE,), ONE, (change,))

    def take(place: int) -> GroundAction:
        return GroundAction(
            "take", (str(place),), Is(place, Truth.TRUE), certain(Effect(None, ((have, Truth.TRUE),)))
        )

    actions = (*(look(place) for place in range(places)), *(take(place) for place in range(places)))
    start = InitialState(ONE, (*(Truth.UNKNOWN for _ in range(places)), Truth.FALSE))
    return Task("search", "p", variables, (start,), Is(have, Truth.TRUE), actions, components=(component,))


def part(accuracy: Fraction, upside_down: Fraction = Fraction(3, 10)) -> Task:
    """A part lies upside down with some probability; to weigh it tells, rightly with ``accuracy``; it can be
    turned. It is to lie as it should, which nothing shows for certain."""
    variables = (Variable("upside-down", (), three_valued=True, hidden=True),)
    prior = ((0, 1 - upside_down), (1, upside_down))
    component = Component(("upside-down()",), prior, (Knowledge(0, Is(0, Truth.TRUE)),))
    weighed = Change(0, (), (NO_CHANGE,), (Observation(Is(0, Truth.TRUE), accuracy),))
    up, down = Effect(Is(0, Truth.TRUE), ((0, Truth.FALSE),)), Effect(Is(0, Truth.FALSE), ((0, Truth.TRUE),))
    turned = Change(0, (), certain(up, down))
    actions = (
        GroundAction("turn", (), TRUE, (NO_CHANGE,), ONE, (turned,)),
        GroundAction("weigh", (), TRUE, (NO_CHANGE,), ONE, (weighed,)),
    )
    start, goal = InitialState(ONE, (Truth.UNKNOWN,)), Is(0, Truth.FALSE)
    return Task("part", "p", variables, (start,), goal, actions, components=(component,))
