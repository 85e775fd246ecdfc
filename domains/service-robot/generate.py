"""Writes service-robot problems of any size: ``python domains/service-robot/generate.py ITEMS PLACES``.

A flat with ``ITEMS`` items on ``PLACES`` pieces of furniture each may stand on, to be told apart by
their numbers only; the same numbers give the same problem. The goals are spread over the flat: every
third one starts an appliance, the others bring an item somewhere else, and of every second item it is not
known on which of three pieces of furniture it is.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

SURFACES = ("table", "shelf", "counter", "desk", "windowsill")
CONTAINERS = ("fridge", "cupboard", "drawer", "wardrobe")
APPLIANCES = ("lamp", "radio", "oven")
ITEMS = ("cup", "plate", "book", "bottle", "apple", "towel", "phone", "box")
STEP = 7
"""Places of an item are so many pieces of furniture apart."""


def furniture(count: int) -> list[tuple[str, str]]:
    """Names and types of pieces of furniture: four surfaces, four containers, two appliances in ten."""
    kinds = ["surface", "container"] * 4 + ["appliance", "surface"]
    names = {"surface": SURFACES, "container": CONTAINERS, "appliance": APPLIANCES}
    made = []
    for number in range(count):
        kind = kinds[number % len(kinds)]
        name = names[kind][number // 2 % len(names[kind])]
        made.append((f"{name}{number + 1}", kind))
    return made


def problem(items: int, places: int, goals: int = 3, pieces: int | None = None, target: str = "0.9") -> str:
    """The text of a problem with about 2 * ``items`` * ``places`` ground actions."""
    flat = furniture(pieces if pieces is not None else max(12, items // 5))
    spots = [name for name, kind in flat if kind != "appliance"]
    devices = [name for name, kind in flat if kind == "appliance"]
    named = [f"{ITEMS[number % len(ITEMS)]}{number + 1}" for number in range(items)]
    fits = {
        item: [spots[(number + STEP * place) % len(spots)] for place in range(min(places, len(spots)))]
        for number, item in enumerate(named)
    }
    wanted, unsure = [], set[str]()
    for goal in range(goals):
        if goal % 3 == 2:
            wanted.append(f"(switched_on {devices[goal // 3 % len(devices)]})")
            continue
        item = named[(goal * items // goals + goal) % items]
        wanted.append(f"(at {item} {fits[item][-1]})")
        if goal % 2:
            unsure.add(item)
    return "".join(_lines(flat, fits, wanted, unsure)) + f"  (:goal-probability {target}))\n"


def _lines(
    flat: list[tuple[str, str]],
    fits: dict[str, list[str]],
    wanted: list[str],
    unsure: set[str],
) -> Iterator[str]:
    yield f"; {len(fits)} items on {len(flat)} pieces of furniture; made by generate.py.\n"
    places = len(next(iter(fits.values())))
    yield f"(define (problem flat-{len(fits)}-{places})\n  (:domain service-robot)\n  (:objects\n"
    for name, kind in flat:
        yield f"    {name} - {kind}\n"
    yield f"    {' '.join(fits)} - item)\n  (:init\n    (near {flat[0][0]}) (hand_free)\n"
    for name, kind in flat:
        if kind == "container":
            yield f"    (has_door {name})\n"
    for item, spots in fits.items():
        yield "".join(f"    (fits {item} {spot})\n" for spot in spots)
        if item in unsure:
            yield "".join(f"    (unknown (at {item} {spot}))\n" for spot in spots[:3])
        else:
            yield f"    (at {item} {spots[0]})\n"
    yield f"  )\n  (:goal (and {' '.join(wanted)}))\n"


def main() -> None:
    """Print or write a problem."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("items", type=int)
    parser.add_argument("places", type=int, help="pieces of furniture each item may stand on")
    parser.add_argument("--goals", type=int, default=3)
    parser.add_argument("--furniture", type=int, help="pieces of furniture; default: a fifth of the items")
    parser.add_argument("--target", default="0.9")
    parser.add_argument("-o", "--output", type=Path, help="where to write it; default: standard output")
    given = parser.parse_args()
    text = problem(given.items, given.places, given.goals, given.furniture, given.target)
    if given.output is None:
        print(text, end="")
    else:
        given.output.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
