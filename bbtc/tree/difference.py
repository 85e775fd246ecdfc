"""What changed from one tree to another: an alignment of their nodes.

The alignment is the cheapest one from the top down, in which children keep their order and a node
that is added or removed goes with its whole subtree (Selkow, The tree-to-tree editing problem, 1977).
Control nodes may change in place; conditions and actions are the same or they are others.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from bbtc.tree.nodes import ControlNode, Node, walk

Mark: TypeAlias = Literal["same", "changed", "added", "removed"]

_MOST_PAIRS = 400_000  # pairs of nodes that are compared before subtrees are taken as they are
_DEEPEST = 100  # levels that are aligned; what is below is the same, or replaced


@dataclass(frozen=True, slots=True)
class Difference:
    """A node of the old tree, of the new one, or of both. ``same`` says that the whole subtree is;
    ``changed`` that the node or something below it is not, ``relabelled`` that the node itself is
    not. Added and removed nodes have their subtree in ``new`` or ``old``, not in ``children``."""

    mark: Mark
    old: Node | None
    new: Node | None
    relabelled: bool = False
    children: tuple[Difference, ...] = ()


def differences(old: Node, new: Node, old_key: Key, new_key: Key) -> Difference:
    """The alignment of two trees. ``old_key`` and ``new_key`` tell what a node is but for its
    children: nodes with equal keys are the same."""
    aligner = _Aligner(old_key, new_key)
    aligner.read(old, old_key)
    aligner.read(new, new_key)
    if aligner.may_match(old, new):
        return aligner.difference(old, new)
    both = Difference("removed", old, None), Difference("added", None, new)
    return Difference("changed", None, None, children=both)


def counts(difference: Difference) -> tuple[int, int, int]:
    """The numbers of nodes added, removed and relabelled."""
    added = removed = relabelled = 0
    for each in walk_differences(difference):
        relabelled += each.relabelled
        if each.mark == "added" and each.new is not None:
            added += sum(1 for _ in walk(each.new))
        if each.mark == "removed" and each.old is not None:
            removed += sum(1 for _ in walk(each.old))
    return added, removed, relabelled


def walk_differences(difference: Difference) -> Iterator[Difference]:
    """Every entry, parents before children, in order."""
    stack = [difference]
    while stack:
        each = stack.pop()
        yield each
        stack.extend(reversed(each.children))


Key: TypeAlias = Callable[[Node], Hashable]
_Pairs: TypeAlias = list[tuple[Node | None, Node | None]]


@dataclass(slots=True)
class _Aligner:
    old_key: Key
    new_key: Key
    _shape: dict[int, int] = field(default_factory=dict)  # by id(node): equal for equal subtrees
    _size: dict[int, int] = field(default_factory=dict)
    _shapes: dict[Hashable, int] = field(default_factory=dict)
    _known: dict[tuple[int, int], tuple[int, _Pairs]] = field(default_factory=dict)
    _pairs: int = 0
    _depth: int = 0

    def read(self, root: Node, key: Key) -> None:
        """Number the subtrees so that equal ones get equal numbers, and count their nodes."""
        for node in reversed(list(walk(root))):  # children before their parents
            children = node.children if isinstance(node, ControlNode) else ()
            shape = (key(node), tuple(self._shape[id(child)] for child in children))
            self._shape[id(node)] = self._shapes.setdefault(shape, len(self._shapes))
            self._size[id(node)] = 1 + sum(self._size[id(child)] for child in children)

    def may_match(self, old: Node, new: Node) -> bool:
        """May they stand for each other? Control nodes may, others if they are equal."""
        both = isinstance(old, ControlNode) and isinstance(new, ControlNode)
        return both or self._shape[id(old)] == self._shape[id(new)]

    def difference(self, old: Node, new: Node) -> Difference:
        """The alignment of two nodes that may match."""
        if self._shape[id(old)] == self._shape[id(new)]:
            return Difference("same", old, new)
        children = []
        for first, second in self._align(old, new)[1]:
            if second is None:
                children.append(Difference("removed", first, None))
            elif first is None:
                children.append(Difference("added", None, second))
            else:
                children.append(self.difference(first, second))
        relabelled = self.old_key(old) != self.new_key(new)
        return Difference("changed", old, new, relabelled, tuple(children))

    def _cost(self, old: Node, new: Node) -> int | None:
        """Nodes to remove and to add, twice, and nodes to relabel; None if they may not match."""
        if not self.may_match(old, new):
            return None
        return 0 if self._shape[id(old)] == self._shape[id(new)] else self._align(old, new)[0]

    def _align(self, old: Node, new: Node) -> tuple[int, _Pairs]:
        assert isinstance(old, ControlNode)
        assert isinstance(new, ControlNode)
        known = self._known.get((id(old), id(new)))
        if known is None:
            relabel = int(self.old_key(old) != self.new_key(new))
            self._depth += 1
            cost, pairs = self._align_children(old.children, new.children)
            self._depth -= 1
            known = self._known[id(old), id(new)] = cost + relabel, pairs
        return known

    def _align_children(self, old: tuple[Node, ...], new: tuple[Node, ...]) -> tuple[int, _Pairs]:
        start, end = 0, 0  # equal children at both ends stay: no alignment is cheaper without them
        least = min(len(old), len(new))
        while start < least and self._same(old[start], new[start]):
            start += 1
        while end < least - start and self._same(old[-1 - end], new[-1 - end]):
            end += 1
        first, second = old[start : len(old) - end], new[start : len(new) - end]
        self._pairs += len(first) * len(second)
        too_much = self._pairs > _MOST_PAIRS or self._depth > _DEEPEST
        cost, middle = (self._replaced if too_much else self._table)(first, second)
        head = list(zip(old[:start], new[:start], strict=True))
        tail = list(zip(old[len(old) - end :], new[len(new) - end :], strict=True))
        return cost, [*head, *middle, *tail]

    def _same(self, old: Node, new: Node) -> bool:
        return self._shape[id(old)] == self._shape[id(new)]

    def _replaced(self, old: tuple[Node, ...], new: tuple[Node, ...]) -> tuple[int, _Pairs]:
        cost = 2 * sum(self._size[id(node)] for node in (*old, *new))
        return cost, [*((node, None) for node in old), *((None, node) for node in new)]

    def _table(self, old: tuple[Node, ...], new: tuple[Node, ...]) -> tuple[int, _Pairs]:
        """The cheapest alignment of two sequences, by dynamic programming from their ends."""
        columns = len(new) + 1
        best = [[0] * columns for _ in range(len(old) + 1)]
        for i in range(len(old), -1, -1):
            for j in range(len(new), -1, -1):
                best[i][j] = min(
                    (cost + best[i + di][j + dj] for cost, di, dj in self._moves(old, new, i, j)), default=0
                )
        pairs: _Pairs = []
        i = j = 0
        while i < len(old) or j < len(new):
            di, dj = next(
                (di, dj)
                for cost, di, dj in self._moves(old, new, i, j)
                if cost + best[i + di][j + dj] == best[i][j]
            )
            pairs.append((old[i] if di else None, new[j] if dj else None))
            i, j = i + di, j + dj
        return best[0][0], pairs

    def _moves(
        self, old: tuple[Node, ...], new: tuple[Node, ...], i: int, j: int
    ) -> Iterator[tuple[int, int, int]]:
        """The first steps of an alignment from child i and child j on, each with its cost: match
        both, remove the old one, add the new one."""
        if i < len(old) and j < len(new):
            cost = self._cost(old[i], new[j])
            if cost is not None:
                yield cost, 1, 1
        if i < len(old):
            yield 2 * self._size[id(old[i])], 1, 0
        if j < len(new):
            yield 2 * self._size[id(new[j])], 0, 1
