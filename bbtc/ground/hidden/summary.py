"""Tells which facts of a task are hidden, and how they are grouped."""

from __future__ import annotations

from collections.abc import Iterator

from bbtc.ground.condition_diagram import diagrams_of
from bbtc.ground.task import Component, Task

_MOST_COMPONENTS = 8
_MOST_FACTS = 6


def hidden_summary(task: Task) -> Iterator[str]:
    """Lines on the components of a task; none where nothing is hidden."""
    components = task.components
    if not components:
        return
    facts = sum(len(component.facts) for component in components)
    grouped = f"{_counted(facts, 'hidden fact')} in {_counted(len(components), 'component')}"
    yield f"{task.domain}/{task.problem}: {grouped}"
    for component in components[:_MOST_COMPONENTS]:
        yield f"  {_facts(component)}: {_counted(_worlds(component), 'world')}"
    if len(components) > _MOST_COMPONENTS:
        yield f"  and {len(components) - _MOST_COMPONENTS} more"


def _worlds(component: Component) -> int:
    if component.diagram is None:
        return len(component.prior)
    found = diagrams_of(component)
    return found.diagrams.count(found.prior)


def _facts(component: Component) -> str:
    left = len(component.facts) - _MOST_FACTS
    shown = ", ".join(component.facts[:_MOST_FACTS])
    return f"{shown} and {left} more" if left > 0 else shown


def _counted(number: int, word: str) -> str:
    return f"{number:,} {word}" + ("" if number == 1 else "s")
