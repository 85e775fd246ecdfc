"""What a planner returns: the tree, its figures, and the refinements that led to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal, TypeAlias

from bbtc.belief.chain import Chain
from bbtc.belief.simulate import Figures
from bbtc.diagnostics import Diagnostic
from bbtc.kleene import Truth
from bbtc.tree.nodes import Tree


@dataclass(frozen=True, slots=True)
class Refinement:
    """One step of a planner: what stopped the runs, what was done about it, what came of it.

    ``condition`` was ``value`` in runs of total probability ``probability``; ``inserted`` names
    the action or template inserted, or whose branch was moved; once its preconditions hold,
    ``unmet`` of which did not hold yet, it makes the condition hold (known, if it was unknown) with
    probability ``chance``, and unknown, so that it can be observed, with ``observable``.
    ``success`` is the tree's success probability afterwards. A retreat takes back the last
    ``taken_back`` refinements, which brought nothing, the first of them being the one it names.
    """

    kind: Literal["insert", "move", "retreat"]
    condition: str
    value: Truth
    probability: Fraction
    inserted: str
    chance: Fraction = Fraction(0)
    observable: Fraction = Fraction(0)
    unmet: int = 0
    success: Fraction = Fraction(0)
    nodes: int = 0
    taken_back: int = 0


Progress: TypeAlias = Callable[[Refinement], None]


@dataclass(frozen=True, slots=True)
class Plan:
    """A planner's answer. ``initial_success`` is the probability before any refinement; ``stop``
    says which limit ended the search, if one did. ``rerolled`` names actions whose noisy readings the tree
    makes again, as if errors did not stay. ``chain`` is that of the tree, where it is at hand."""

    tree: Tree
    figures: Figures
    initial_success: Fraction
    refinements: tuple[Refinement, ...]
    stop: Diagnostic | None = None
    chain: Chain | None = field(default=None, compare=False, repr=False)
    rerolled: tuple[str, ...] = ()

    def _repr_svg_(self) -> str | None:
        """The picture of the tree, for notebooks."""
        return self.tree._repr_svg_()
