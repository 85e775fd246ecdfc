"""A choice of runs that shows as much as all of them."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence

from bbtc.belief.scenarios import Scenario


def covering(runs: Iterable[Scenario]) -> list[Scenario]:
    """Those in which something happens that happens in none before: a start, an outcome of the action of a
    node in some state, an end."""
    seen: set[Hashable] = set()
    found = []
    for run in runs:
        before = len(seen)
        seen.update(_happenings(run))
        if len(seen) > before:
            found.append(run)
    return found


def within_budget(runs: Sequence[Scenario], steps: int) -> list[Scenario]:
    """The covering ones, whatever they take; and from the first on, so many others as leave the steps of all
    within the budget."""
    chosen = covering(runs)
    kept = set(map(id, chosen))
    left = steps - sum(len(run.steps) for run in chosen)
    for run in runs:
        if id(run) in kept:
            continue
        left -= len(run.steps)
        if left < 0:
            break
        chosen.append(run)
    return chosen


def _happenings(run: Scenario) -> Iterator[Hashable]:
    yield "start", run.initial
    before = run.initial
    for step in run.steps:
        yield before, step.node.id, step.values
        before = step.values
    yield "end", run.status, run.end
