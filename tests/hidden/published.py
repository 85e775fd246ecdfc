"""Published problems with known best probabilities, in our language: what they are about is told in a
sentence each; what others found for them is in :data:`PUBLISHED`.

The problems and the bounds are those of Ho, Feather, Rossi, Sunberg, Lahijanian, "Sound heuristic search
value iteration for undiscounted POMDPs with reachability objectives" (UAI 2024), table 1, and of the
benchmarks that come with it; most are older: grid-avoid from Littman, Cassandra and Kaelbling (1995),
refuel and drone from Junges et al. (2021), crypt and nrp from Norman, Parker and Zou (2017).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from itertools import pairwise
from math import ceil, floor
from typing import NamedTuple, TypeAlias

Cell: TypeAlias = tuple[int, int]

_REQUIREMENTS = (
    "(:requirements :typing :equality :negative-preconditions :disjunctive-preconditions"
    " :conditional-effects :probabilistic-effects :existential-preconditions :contingent)"
)


def _name(cell: Cell) -> str:
    return f"c{cell[0]}-{cell[1]}"


def _square(side: int) -> list[Cell]:
    return [(x, y) for x in range(side) for y in range(side)]


_MOVES = {"east": (1, 0), "west": (-1, 0), "north": (0, 1), "south": (0, -1)}


def _steps(cells: Collection[Cell], far: int) -> Iterator[str]:
    """The cells that a step of some length ends in, at the wall at the latest."""
    last = max(x for x, _ in cells)
    for move, (dx, dy) in _MOVES.items():
        for x, y in cells:
            after = (min(max(x + far * dx, 0), last), min(max(y + far * dy, 0), last))
            if after != (x, y):
                yield f"({move} {_name((x, y))} {_name(after)})"


def grid_avoid(side: int, slip: float, obstacles: Collection[Cell], target: Cell, starts: list[Cell]) -> str:
    """A robot somewhere on a grid sees neither where it is nor walls, only the target and obstacles, and both
    too late. Each step may leave it where it is."""
    cells = _square(side)
    free = [cell for cell in cells if cell != target and cell not in obstacles]
    steps = [step for step in _steps(cells, 1) if any(f" {_name(cell)} " in step for cell in free)]
    moves = "".join(
        f"""
  (:action go-{move}
    :precondition (and (not (arrived)) (not (crashed)))
    :effect (probabilistic {slip} (and) {1 - slip:.1f} (forall (?a ?b - cell)
      (when (and (at ?a) ({move} ?a ?b))
        (and (not (at ?a)) (at ?b) (when (target ?b) (arrived)) (when (obstacle ?b) (crashed)))))))"""
        for move in _MOVES
    )
    return f"""
(define (domain grid-avoid)
  {_REQUIREMENTS}
  (:types cell)
  (:predicates (at ?c - cell) (observed (arrived)) (observed (crashed)) (target ?c - cell)
    (obstacle ?c - cell) {" ".join(f"({move} ?a ?b - cell)" for move in _MOVES)}){moves})
(define (problem grid-avoid-{side})
  (:domain grid-avoid)
  (:objects {" ".join(map(_name, cells))} - cell)
  (:init (oneof {" ".join(f"(at {_name(cell)})" for cell in starts)}) (target {_name(target)})
    {" ".join(f"(obstacle {_name(cell)})" for cell in obstacles)} {" ".join(steps)})
  (:goal (arrived)))
"""


def _diagonal(last: int) -> list[Cell]:
    return [(at, at) for at in range(1, last + 1)]


def refuel(size: int) -> str:
    """A robot must cross a grid, whose cells it tells apart only by walls and stations, before its fuel is
    used up; a step may be two. It fills up at stations, and must not meet the obstacle."""
    cells, last = _square(size + 1), size
    capacity = size - 1
    stations = [(0, 0), *((at, at) for at in (ceil(size / 3), floor(2 * size / 3)))]
    seen: dict[str, Callable[[int, int], bool]] = {
        "no-east": lambda x, y: x == last,
        "no-west": lambda x, y: x == 0,
        "no-north": lambda x, y: y == last,
        "no-south": lambda x, y: y == 0,
        "home": lambda x, y: x == y == last,
        "crashed": lambda x, y: x == y == last - 1,
        "station": lambda x, y: (x, y) in stations,
    }
    told = " ".join(
        f"(when (has-{fact} ?b) ({fact})) (when (not (has-{fact} ?b)) (not ({fact})))" for fact in seen
    )
    moves = "".join(
        f"""
  (:action go-{move}
    :parameters (?full ?less - level)
    :precondition (and (fuel ?full) (next ?less ?full) (or (not (station)) (top ?full))
      (not (no-{move})) (not (home)) (not (crashed)))
    :effect (and (not (fuel ?full)) (fuel ?less) (probabilistic
      0.7 (forall (?a ?b - cell) (when (and (at ?a) ({move} ?a ?b))
        (and (not (at ?a)) (at ?b) {told})))
      0.3 (forall (?a ?b - cell) (when (and (at ?a) ({move}-2 ?a ?b))
        (and (not (at ?a)) (at ?b) {told}))))))"""
        for move in _MOVES
    )
    steps = [*_steps(cells, 1), *(step.replace(" ", "-2 ", 1) for step in _steps(cells, 2))]
    facts = [f"(has-{fact} {_name(cell)})" for fact, where in seen.items() for cell in cells if where(*cell)]
    return f"""
(define (domain refuel)
  {_REQUIREMENTS}
  (:types cell level)
  (:predicates (at ?c - cell) {" ".join(f"(observed ({fact})) (has-{fact} ?c - cell)" for fact in seen)}
    (fuel ?l - level) (next ?a ?b - level) (top ?l - level)
    {" ".join(f"({move} ?a ?b - cell) ({move}-2 ?a ?b - cell)" for move in _MOVES)}){moves}
  (:action refuel
    :parameters (?now ?full - level)
    :precondition (and (fuel ?now) (top ?full) (not (= ?now ?full)) (station))
    :effect (and (not (fuel ?now)) (fuel ?full))))
(define (problem refuel-{size})
  (:domain refuel)
  (:objects {" ".join(map(_name, cells))} - cell {" ".join(f"l{at}" for at in range(capacity + 1))} - level)
  (:init (oneof (at {_name((0, 0))})) (no-west) (no-south) (station) (fuel l{capacity}) (top l{capacity})
    {" ".join(f"(next l{at} l{at + 1})" for at in range(capacity))}
    {" ".join(facts)} {" ".join(steps)})
  (:goal (home)))
"""


def drone(side: int, radius: int) -> str:
    """A drone must cross a grid on which somebody walks about at random, whom it sees only when near, and
    must not meet. Its moves may fail; both move in turn."""
    cells = _square(side + 1)
    near = [
        f"(near {_name(a)} {_name(b)})"
        for a in cells
        for b in cells
        if max(abs(a[0] - b[0]), abs(a[1] - b[1])) <= radius
    ]
    look = " ".join(
        f"(exists (?d - cell) (and (drone ?d) (near ?d {_name(cell)}) (walker {_name(cell)})))"
        for cell in cells
    )
    flights = "".join(
        f"""
  (:action fly-{move}
    :parameters (?from ?to - cell)
    :precondition (and (my-turn) (drone ?from) ({move} ?from ?to) (not (drone {_name((side, side))}))
      (not (crashed)))
    :effect (and (not (my-turn)) (probabilistic 0.3 (and) 0.7 (and (not (drone ?from)) (drone ?to)
      (when (walker ?to) (crashed)))))
    :observe (and {look}))"""
        for move in _MOVES
    )
    steps = " ".join(
        f"0.25 (forall (?a ?b - cell) (when (and (walker ?a) ({move} ?a ?b))"
        " (and (not (walker ?a)) (walker ?b) (when (drone ?b) (crashed)))))"
        for move in _MOVES
    )
    return f"""
(define (domain drone)
  {_REQUIREMENTS}
  (:types cell)
  (:constants {" ".join(map(_name, cells))} - cell)
  (:predicates (observed (drone ?c - cell)) (walker ?c - cell) (near ?a ?b - cell) (my-turn)
    (observed (crashed))
    {" ".join(f"({move} ?a ?b - cell)" for move in _MOVES)}){flights}
  (:action wait
    :precondition (and (not (my-turn)) (not (drone {_name((side, side))})) (not (crashed)))
    :effect (and (my-turn) (probabilistic {steps}))
    :observe (and {look})))
(define (problem drone-{side}-{radius})
  (:domain drone)
  (:init (oneof (walker {_name((side - 1, side))})) (drone {_name((0, 0))}) {" ".join(near)}
    {" ".join(_steps(cells, 1))})
  (:goal (drone {_name((side, side))})))
"""


def rocks(size: int) -> str:
    """A robot crosses a field with two rocks, either of which may be worth taking; sampling tells. It must
    take one that is, and leave the field."""
    cells = _square(size)
    half = size // 2
    places = {"near": (1, half), "far": (half, half)}
    return f"""
(define (domain rocks)
  {_REQUIREMENTS}
  (:types cell rock)
  (:predicates (at ?c - cell) (lies ?r - rock ?c - cell) (good ?r - rock) (observed (taken)) (left)
    (border ?c - cell) {" ".join(f"({move} ?a ?b - cell)" for move in _MOVES)})
  {
        " ".join(
            f'''(:action go-{move} :parameters (?a ?b - cell)
    :precondition (and (at ?a) ({move} ?a ?b) (not (left))) :effect (and (not (at ?a)) (at ?b)))'''
            for move in _MOVES
        )
    }
  (:action check
    :parameters (?r - rock ?c - cell)
    :precondition (and (at ?c) (not (left)))
    :observe (probabilistic 0.75 (good ?r)))
  (:action sample
    :parameters (?r - rock ?c - cell)
    :precondition (and (at ?c) (lies ?r ?c) (not (left)))
    :effect (when (good ?r) (and (taken) (not (good ?r)))))
  (:action leave
    :parameters (?c - cell)
    :precondition (and (at ?c) (border ?c) (not (left)))
    :effect (left)))
(define (problem rocks-{size})
  (:domain rocks)
  (:objects {" ".join(map(_name, cells))} - cell {" ".join(places)} - rock)
  (:init (unknown (good near)) (unknown (good far)) (at {_name((0, 0))})
    {" ".join(f"(lies {rock} {_name(cell)})" for rock, cell in places.items())}
    {" ".join(f"(border {_name((size - 1, y))})" for y in range(size))} {" ".join(_steps(cells, 1))})
  (:goal (and (taken) (left))))
"""


def crypt(diners: int) -> str:
    """Of some who dine, one pays, but not the last. Each tosses a coin that the next one sees, too, and tells
    whether both coins show the same; who pays tells it wrongly. The last, who sees two coins, guesses who
    pays."""
    last = diners
    payers = range(1, last)
    hidden = [f"(heads {at})".replace(" ", " d") for at in range(2, last)]
    same = {
        at: f"(or (and {one} {other}) (and (not {one}) (not {other})))"
        for at in range(1, last + 1)
        for one, other in [(f"(heads d{at})", f"(heads d{at % last + 1})")]
    }
    tells = "".join(
        f"""
  (:action hear-{at}
    :precondition (not (heard-{at}))
    :effect (heard-{at})
    :observe (or (and (not (pays d{at})) {same[at]}) (and (pays d{at}) (not {same[at]}))))"""
        for at in payers
    )
    return f"""
(define (domain crypt)
  {_REQUIREMENTS}
  (:types diner)
  (:constants {" ".join(f"d{at}" for at in range(1, last + 1))} - diner)
  (:predicates (pays ?d - diner) (heads ?d - diner) (observed (right)) (guessed)
    {" ".join(f"(heard-{at})" for at in payers)})
  (:action look-left :precondition (unknown (heads d1)) :observe (heads d1))
  (:action look-own :precondition (unknown (heads d{last})) :observe (heads d{last})){tells}
  (:action guess
    :parameters (?d - diner)
    :precondition (not (guessed))
    :effect (and (guessed) (when (pays ?d) (right)))))
(define (problem crypt-{diners})
  (:domain crypt)
  (:init (oneof {" ".join(f"(pays d{at})" for at in payers)}) (unknown (heads d1)) (unknown (heads d{last}))
    {" ".join(f"(unknown {fact})" for fact in hidden)})
  (:goal (right)))
"""


def repudiation(rounds: int) -> str:
    """A message is sent in as many rounds as its sender has drawn. Who decodes in the last one has it, and
    need not acknowledge it; whoever waits for another round may have waited in vain."""
    names = [f"r{at}" for at in range(1, rounds + 1)]
    return f"""
(define (domain repudiation)
  {_REQUIREMENTS}
  (:types round)
  (:predicates (last ?r - round) (now ?r - round) (next ?a ?b - round) (observed (over)) (observed (gained)))
  (:action decode
    :parameters (?r - round)
    :precondition (and (now ?r) (not (over)))
    :effect (and (over) (when (last ?r) (gained))))
  (:action acknowledge
    :parameters (?r ?s - round)
    :precondition (and (now ?r) (next ?r ?s) (not (over)))
    :effect (and (not (now ?r)) (now ?s) (when (last ?r) (over)))))
(define (problem repudiation-{rounds})
  (:domain repudiation)
  (:objects {" ".join(names)} - round)
  (:init (now r1) (oneof {" ".join(f"(last {name})" for name in names)})
    {" ".join(f"(next {a} {b})" for a, b in pairwise(names))})
  (:goal (gained)))
"""


class Published(NamedTuple):
    """A problem, with the bounds on its best probability that were found, as they are printed, and the
    seconds that it took."""

    text: Callable[[], str]
    lower: str
    upper: str
    seconds: float


def _start(side: int, without: Collection[Cell]) -> list[Cell]:
    return [cell for cell in _square(side) if cell not in without]


PUBLISHED = {
    "nrp8": Published(lambda: repudiation(8), "0.125", "0.125", 0.001),
    "crypt4": Published(lambda: crypt(4), "0.33333", "0.33334", 15.6),
    "rocks12": Published(lambda: rocks(12), "0.75", "0.75", 2.8),
    "grid-avoid4": Published(
        lambda: grid_avoid(4, 0.1, [(1, 1)], (3, 0), _start(4, [(1, 1), (3, 0)])), "0.92847", "0.92864", 0.002
    ),
    "grid-avoid10": Published(
        lambda: grid_avoid(10, 0.3, _diagonal(3), (9, 0), _start(5, _diagonal(3))), "0.7728", "0.7738", 8.2
    ),
    "grid-avoid20": Published(
        lambda: grid_avoid(20, 0.5, _diagonal(6), (19, 9), _start(5, _diagonal(6))),
        "0.78248",
        "0.78282",
        33.3,
    ),
    "refuel06": Published(lambda: refuel(6), "0.67206", "0.67219", 1.4),
    "refuel08": Published(lambda: refuel(8), "0.44585", "0.44631", 20.0),
    "refuel20": Published(lambda: refuel(20), "0.32826", "0.99966", 7362.5),
    "drone4-1": Published(lambda: drone(4, 1), "0.88783", "0.95634", 7437.8),
    "drone4-2": Published(lambda: drone(4, 2), "0.96450", "0.97641", 7223.9),
}
