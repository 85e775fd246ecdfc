"""What changed from one tree to another: figures, task, and nodes."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from bbtc.artefacts import task_to_json
from bbtc.artefacts.tree_json import carried
from bbtc.backends.pictures.outline import label
from bbtc.belief.simulate import Figures
from bbtc.ground.task import Task
from bbtc.printable import printable
from bbtc.tree.difference import Difference, differences
from bbtc.tree.nodes import Node, Tree, actions_of, walk

_FIGURES = ("success", "failure", "blocked", "endless", "cost", "actions")


@dataclass(frozen=True, slots=True)
class FigureChange:
    """A figure of both trees: probabilities, expected cost and number of actions (None is infinite),
    numbers of nodes and of different actions, and the target."""

    name: str
    old: Fraction | None
    new: Fraction | None

    @property
    def differs(self) -> bool:
        """Are the two not the same?"""
        return self.old != self.new


@dataclass(frozen=True, slots=True)
class Comparison:
    """All that changed: ``figures``, sentences on the ``task``, and the alignment of the ``nodes``."""

    old: Tree
    new: Tree
    figures: tuple[FigureChange, ...]
    task: tuple[str, ...]
    nodes: Difference

    @property
    def differs(self) -> bool:
        """Is there any difference, but for the ids of nodes and what they were inserted for?"""
        return (
            any(figure.differs for figure in self.figures)
            or self.old.status != self.new.status
            or bool(self.task)
            or self.nodes.mark != "same"
        )


def compare(old: tuple[Tree, Figures], new: tuple[Tree, Figures]) -> Comparison:
    """The comparison of two trees with their figures. Of their tasks, what an artefact of the tree carries
    along is compared: not the actions that it leaves out."""
    first, second = carried(old[0]), carried(new[0])
    figures = [FigureChange(name, getattr(old[1], name), getattr(new[1], name)) for name in _FIGURES]
    sizes = [Fraction(sum(1 for _ in walk(tree.root))) for tree in (first, second)]
    kinds = [Fraction(len({node.action for node in actions_of(tree.root)})) for tree in (first, second)]
    figures += [
        FigureChange("nodes", *sizes),
        FigureChange("different actions", *kinds),
        FigureChange("target", first.target, second.target),
    ]
    nodes = differences(first.root, second.root, _keys(first.task), _keys(second.task))
    return Comparison(first, second, tuple(figures), tuple(_task_changes(first.task, second.task)), nodes)


class _keys:  # noqa: N801 (used as a function)
    """What a node is, but for its id, its reason and its children."""

    def __init__(self, task: Task) -> None:
        self._task = task

    def __call__(self, node: Node) -> Hashable:
        return type(node), label(self._task, node)


def _task_changes(old: Task, new: Task) -> Iterator[str]:
    first: Mapping[str, Any] = task_to_json(old)
    second: Mapping[str, Any] = task_to_json(new)
    for what in ("domain", "problem", "goal_probability", "goal", "metric", "goal_reward"):
        if first.get(what) != second.get(what):
            yield f"{what.replace('_', ' ')} changed"
    if _named(first["variables"]) == _named(second["variables"]) and first["initial"] != second["initial"]:
        yield "initial state changed"
    for noun, gone, come in (
        ("variable", "removed", "added"),
        ("action", "is no longer used", "is used now"),
    ):
        before, after = _named(first[f"{noun}s"]), _named(second[f"{noun}s"])
        for name in sorted({*before, *after}):
            if name not in after:
                yield f"{noun} {printable(name)} {gone}"
            elif name not in before:
                yield f"{noun} {printable(name)} {come}"
            elif before[name] != after[name]:
                parts = [
                    key.replace("_", " ") for key in after[name] if before[name].get(key) != after[name][key]
                ]
                yield f"{noun} {printable(name)} changed: {', '.join(parts) or 'fields left out'}"


def _named(values: list[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    return {str(value["name"]): value for value in values}
