"""Sets that grow together (union-find)."""

from __future__ import annotations

from collections.abc import Iterable


class Groups:
    """A partition of some numbers; at first each is alone."""

    def __init__(self, numbers: Iterable[int]) -> None:
        self._leader = {number: number for number in numbers}

    def __contains__(self, number: int) -> bool:
        return number in self._leader

    def of(self, number: int) -> int:
        """The number that stands for the group of a number."""
        leader = self._leader
        while leader[number] != number:
            leader[number] = leader[leader[number]]
            number = leader[number]
        return number

    def join(self, numbers: Iterable[int]) -> bool:
        """Make the groups of some numbers one; tells whether they were not."""
        leaders = sorted({self.of(number) for number in numbers})
        for other in leaders[1:]:
            self._leader[other] = leaders[0]
        return len(leaders) > 1

    def all(self) -> list[tuple[int, ...]]:
        """The groups, ordered by their least numbers; each in order."""
        found: dict[int, list[int]] = {}
        for number in sorted(self._leader):
            found.setdefault(self.of(number), []).append(number)
        return [tuple(each) for each in found.values()]
