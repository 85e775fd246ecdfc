"""Where in a BehaviorTree.CPP file its reader is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace


@dataclass(frozen=True, slots=True)
class Scope:
    """Where in the file the reader is: the values of the ports there, the BehaviorTrees around, the retry
    nodes around, each with its counter, and the retry-until-success nodes around, each with the scripts that
    make what was read below it forget."""

    ports: Mapping[str, str] = field(default_factory=dict)
    trees: tuple[str, ...] = ()
    counters: tuple[str, ...] = ()
    level: int = 1
    forget: tuple[list[str], ...] = ()

    def down(self) -> Scope:
        """One level of the tree further down."""
        return replace(self, level=self.level + 1)
