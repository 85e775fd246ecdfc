"""A tidy layout of a tree with nodes of different sizes.

After Reingold and Tilford, "Tidier Drawings of Trees" (1981): subtrees are laid out first and then
moved as close to one another as their outlines allow, parents stand over the middle of their
children. Children are packed twice, from the left and from the right, and stand in the middle of
both places: that spreads the room left over evenly (the aim of Walker 1990, Buchheim 2002), and it
is safe, because what must hold between two neighbours, a least distance, holds of the mean as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

_STEEP = 150.0  # how far a line may go sideways before its level gets more room
_MOST_GAPS = 2.5  # how much more, at most


@dataclass(frozen=True, slots=True)
class Box:
    """Size of a node."""

    width: float
    height: float


@dataclass(frozen=True, slots=True)
class Layout:
    """Middles of the nodes, and the size of the whole; y grows downwards."""

    x: tuple[float, ...]
    y: tuple[float, ...]
    width: float
    height: float


@dataclass(slots=True)
class _Outline:
    """Left and right edge of a subtree on each of its levels, seen from the middle of its root."""

    left: list[float]
    right: list[float]


def tidy(boxes: Sequence[Box], parents: Sequence[int | None], gap: float, level_gap: float) -> Layout:
    """Place the nodes of a tree. ``parents`` gives the number of each node's parent; parents come
    before their children, children from left to right. ``gap`` is the least distance between
    neighbours, ``level_gap`` that between levels, which grows where lines would be too flat."""
    children: list[list[int]] = [[] for _ in boxes]
    for number, parent in enumerate(parents):
        if parent is not None:
            children[parent].append(number)

    # 1. From the leaves up: place children relative to their parent.
    offset = [0.0] * len(boxes)
    outlines: dict[int, _Outline] = {}
    for number in reversed(range(len(boxes))):
        half = boxes[number].width / 2
        parts = [outlines.pop(child) for child in children[number]]
        places = _pack(parts, gap)
        for child, place in zip(children[number], places, strict=True):
            offset[child] = place
        left, right = _merge(parts, places)
        outlines[number] = _Outline([-half, *left], [half, *right])

    # 2. From the root down: add up the offsets; a level is as high as its highest node.
    level = [0] * len(boxes)
    x = [0.0] * len(boxes)
    for number, parent in enumerate(parents):
        if parent is not None:
            level[number] = level[parent] + 1
            x[number] = x[parent] + offset[number]
    heights = [0.0] * (max(level) + 1)
    reach = [0.0] * len(heights)  # how far a line goes sideways on its way up from a level
    for number, box in enumerate(boxes):
        heights[level[number]] = max(heights[level[number]], box.height)
        reach[level[number]] = max(reach[level[number]], abs(offset[number]))
    middles: list[float] = []
    bottom = 0.0
    for depth, height in enumerate(heights):
        if depth:
            bottom += level_gap * min(max(1.0, reach[depth] / _STEEP), _MOST_GAPS)
        middles.append(bottom + height / 2)
        bottom += height

    # 3. Shift everything to start at 0.
    outline = outlines[0]
    leftmost = min(outline.left)
    return Layout(
        tuple(place - leftmost for place in x),
        tuple(middles[depth] for depth in level),
        max(outline.right) - leftmost,
        bottom,
    )


def _pack(parts: Sequence[_Outline], gap: float) -> list[float]:
    """Places for subtrees beside one another, their mean place between first and last at 0."""
    if not parts:
        return []
    from_left = _pack_left(parts, gap)
    mirrored = [_Outline([-edge for edge in p.right], [-edge for edge in p.left]) for p in reversed(parts)]
    from_right = [-place for place in reversed(_pack_left(mirrored, gap))]
    shift = from_left[-1] - from_right[-1]  # the last subtree stands where the first packing put it
    places = [(a + b + shift) / 2 for a, b in zip(from_left, from_right, strict=True)]
    middle = (places[0] + places[-1]) / 2
    return [place - middle for place in places]


def _pack_left(parts: Sequence[_Outline], gap: float) -> list[float]:
    places: list[float] = []
    edge: list[float] = []  # right edge of what is placed, level by level
    for part in parts:
        place = max((e + gap - left for e, left in zip(edge, part.left, strict=False)), default=0.0)
        places.append(place)
        moved = [right + place for right in part.right]
        # Levels that only the earlier subtrees reach keep their edge.
        edge = [max(a, b) for a, b in zip(edge, moved, strict=False)] + (
            edge[len(moved) :] or moved[len(edge) :]
        )
    return places


def _merge(parts: Sequence[_Outline], places: Sequence[float]) -> tuple[list[float], list[float]]:
    """The outline of all subtrees together."""
    depth = max((len(part.left) for part in parts), default=0)
    left = [float("inf")] * depth
    right = [float("-inf")] * depth
    for part, place in zip(parts, places, strict=True):
        for level, edge in enumerate(part.left):
            left[level] = min(left[level], edge + place)
        for level, edge in enumerate(part.right):
            right[level] = max(right[level], edge + place)
    return left, right
