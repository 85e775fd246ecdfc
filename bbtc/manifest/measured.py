"""The figures of a tree that can be expected, each worked out when it is first asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING

from bbtc.belief.simulate import Figures
from bbtc.limits import Limits
from bbtc.tree.nodes import Tree

if TYPE_CHECKING:
    from bbtc.disturbance.perturbed import PerturbedRuns
    from bbtc.disturbance.recovery import Recovery


@dataclass(slots=True)
class Measured:
    """A tree with its exact figures. ``whole`` gives it on all of its task, also the actions that it does not
    use; ``rate`` is that of perturbed runs. Raises :class:`bbtc.diagnostics.LimitReached` where it is
    asked."""

    tree: Tree
    figures: Figures
    whole: Callable[[], Tree]
    rate: Fraction = Fraction(0)
    limits: Limits = field(default_factory=Limits)
    _recovery: Recovery | None = field(default=None, init=False)
    _perturbed: PerturbedRuns | None = field(default=None, init=False)

    @property
    def recovery(self) -> Recovery:
        """What it attains from any state."""
        if self._recovery is None:
            from bbtc.disturbance.recovery import recovery

            tree = self.whole()
            self._recovery = recovery(tree.task, tree.root, self.limits)
        return self._recovery

    def success_by(self, seconds: Fraction) -> tuple[Fraction, Fraction]:
        """Bounds of the probability of success within so many seconds. Raises
        :class:`bbtc.diagnostics.BbtcError` where it is not known how long actions take."""
        from bbtc.belief.chain import explore
        from bbtc.timing.figures import success_by

        task = self.tree.task
        by = success_by(task, explore(task, self.tree.root, self.limits), seconds, self.limits)
        return by.at_least, by.at_most

    @property
    def recovery_worst(self) -> Fraction:
        """What it attains of the best in the state where that is least."""
        worst = self.recovery.worst
        return Fraction(1) if worst is None else worst.success / worst.best

    @property
    def perturbed(self) -> PerturbedRuns:
        """What comes of perturbed runs: as many as by default, with seed 0."""
        if self._perturbed is None:
            from bbtc.disturbance.perturbed import perturbed_runs

            tree = self.whole()
            self._perturbed = perturbed_runs(tree.task, tree.root, self.rate, self.limits)
        return self._perturbed
