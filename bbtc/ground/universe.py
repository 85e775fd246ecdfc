"""The objects of a model by number."""

from __future__ import annotations

from bbtc.model import domain as md

Row = tuple[int, ...]
"""The arguments of a ground atom, action or template."""


class Universe:
    """Numbers the objects in alphabetical order, so that rows sort like the names they stand for."""

    def __init__(self, model: md.Model) -> None:
        self._model = model
        self.names = tuple(sorted(model.objects))
        self.index = {name: number for number, name in enumerate(self.names)}
        self._members: dict[tuple[str, ...], tuple[int, ...]] = {}
        # `a,` sorts before `a-b,` as `a` does before `a-b`; with characters below the comma it may not.
        self.sorts_like_names = all(char > "," for name in self.names for char in name)

    def members(self, types: tuple[str, ...]) -> tuple[int, ...]:
        """The objects of one of the types, in order of declaration."""
        found = self._members.get(types)
        if found is None:
            contains = self._model.types.contains
            objects = self._model.objects.items()
            found = tuple(self.index[name] for name, thing in objects if contains(types, thing))
            self._members[types] = found
        return found

    def args(self, row: Row) -> tuple[str, ...]:
        """The names of the objects of a row."""
        names = self.names
        return tuple([names[number] for number in row])

    def all_args(self, rows: list[Row]) -> list[tuple[str, ...]]:
        """:meth:`args` of many rows of one length."""
        if not rows or not rows[0]:
            return [()] * len(rows)
        name = self.names.__getitem__
        return list(zip(*(map(name, column) for column in zip(*rows, strict=True)), strict=True))

    def row(self, args: tuple[str, ...]) -> Row:
        """The numbers of named objects."""
        return tuple([self.index[name] for name in args])
