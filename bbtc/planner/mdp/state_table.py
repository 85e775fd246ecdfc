"""A set of packed states that numbers them in the order of their arrival: open addressing with
linear probing, whole batches at a time. States are compared in full, so that no two states are
ever taken for one another."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bbtc.planner.mdp.packing import Words
from bbtc.planner.mdp.transitions import Index

_SMALLEST = 1 << 10


@dataclass(slots=True)
class StateTable:
    """Numbered states, ``words`` 64-bit words each."""

    words: int
    count: int = 0
    _slots: Index = field(init=False)
    _states: Words = field(init=False)

    def __post_init__(self) -> None:
        self._slots = np.full(_SMALLEST, -1, dtype=np.int64)
        self._states = np.empty((_SMALLEST, self.words), dtype=np.uint64)

    @property
    def states(self) -> Words:
        """All states, by number (a view)."""
        return self._states[: self.count]

    def number(self, batch: Words) -> Index:
        """The number of each state of a batch; new ones are numbered as they first appear."""
        size = len(batch)
        self._reserve(size)
        # The batch stands behind the known states meanwhile: a slot names the batch's row that
        # claimed it, and the first row of equal states wins.
        first = self.count
        self._states[first : first + size] = batch
        found = np.empty(size, dtype=np.int64)
        slots = self._slots
        mask = np.int64(len(slots) - 1)
        at = _hash(batch) & mask
        claimed: list[Index] = []
        open_rows = np.arange(size)
        while len(open_rows):
            holder = slots[at]
            empty = holder < 0
            if empty.any():
                # Of repeated indices the last assignment stays: assign in reverse order.
                free, rows = at[empty][::-1], open_rows[empty][::-1]
                slots[free] = first + rows
                claimed.append(free)
                holder = slots[at]
            same = self._states[holder, 0] == batch[open_rows, 0]
            for word in range(1, self.words):
                same &= self._states[holder, word] == batch[open_rows, word]
            found[open_rows[same]] = holder[same]
            open_rows, at = open_rows[~same], (at[~same] + 1) & mask
        new = np.flatnonzero(found == first + np.arange(size))
        if len(new) < size:
            renumbered = np.empty(size, dtype=np.int64)
            renumbered[new] = first + np.arange(len(new))
            inside = np.flatnonzero(found >= first)
            found[inside] = renumbered[found[inside] - first]
            for free in claimed:
                slots[free] = renumbered[slots[free] - first]
            self._states[first : first + len(new)] = batch[new]
        self.count = first + len(new)
        return found

    def _reserve(self, size: int) -> None:
        wanted = self.count + size
        if wanted > len(self._states):
            grown = np.empty((max(wanted, 2 * len(self._states)), self.words), dtype=np.uint64)
            grown[: self.count] = self.states
            self._states = grown
        if 2 * wanted > len(self._slots):
            size = len(self._slots)
            while 2 * wanted > size:
                size *= 2
            self._slots = np.full(size, -1, dtype=np.int64)
            at = _hash(self.states) & np.int64(size - 1)
            rows = np.arange(self.count)
            while len(rows):
                empty = self._slots[at] < 0
                self._slots[at[empty]] = rows[empty]
                lost = self._slots[at] != rows
                rows, at = rows[lost], (at[lost] + 1) & np.int64(size - 1)


def _hash(states: Words) -> Index:
    mixed = np.zeros(len(states), dtype=np.uint64)
    for word in range(states.shape[1]):
        mixed = (mixed ^ states[:, word]) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(32)
    mixed *= np.uint64(0xD6E8FEB86659FD93)
    mixed ^= mixed >> np.uint64(29)
    positive: Index = (mixed >> np.uint64(1)).astype(np.int64)
    return positive
