"""Storm's analysis of the beliefs of a POMDP (Bork et al. 2022): a value from below, by unfolding, and one
from above, over a grid."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any


def bounds(text: str, folder: Path, most: int = 2_000) -> tuple[Fraction, Fraction, bool]:
    """The most probable that the label ``goal`` is reached: at least, at most, and whether both were found by
    looking at every belief."""
    import stormpy  # not everywhere
    import stormpy.pomdp

    file = folder / "task.prism"
    file.write_text(text, encoding="utf-8")
    program = stormpy.parse_prism_program(str(file))
    (asked,) = stormpy.parse_properties('Pmax=? [F "goal"]', program)
    model: Any = stormpy.build_model[stormpy.Rational](program, [asked])
    below = stormpy.pomdp.verify_with_belief_unfolding(model, asked, max_exploration_size=most)
    lower = Fraction(str(below.value))
    if below.completed_exploration:
        return lower, lower, True
    above = stormpy.pomdp.verify_with_belief_discretization(model, asked, 2)
    return lower, Fraction(str(above.value)), False
