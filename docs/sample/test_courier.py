"""A figure of the sample's trees that the manifest does not state."""

from __future__ import annotations

import bbtc


def test_one_letter_takes_few_actions() -> None:
    """The expected number of actions, over all runs."""
    figures = bbtc.simulate("trees/to-the-lab.tree.json")
    assert figures.actions is not None
    assert figures.actions < 4
