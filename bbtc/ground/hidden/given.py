"""What a problem says is true at the start of simulated runs. Plans and figures never read it."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import TypeAlias

from bbtc.diagrams import Diagram
from bbtc.ground.task import MISREAD, Component, Task, TrueWorld

Weights: TypeAlias = Mapping[int, Fraction]
"""Worlds of a component that may be the case, with probabilities that sum to 1."""


def given_worlds(task: Task) -> list[list[Weights | None]]:
    """For each world that the problem gives, what may be the case of each component. It is the world in which
    nothing is true but what is given, if that can be; else each in which what is given is so; and each that
    can be, where none is. Whether a reading is wrong that stays is always drawn. Of a component whose worlds
    are not listed it is that one world, or None: it is drawn as without what is given."""
    return [[_fitting(component, world) for component in task.components] for world in task.true_worlds]


def _fitting(component: Component, given: TrueWorld) -> Weights | None:
    if component.diagram is not None:
        true = _true(component, given)
        return {true: Fraction(1)} if _is_possible(component.diagram, true) else None
    noise = sum(1 << bit for bit, fact in enumerate(component.facts) if fact.startswith(MISREAD))
    every = (1 << len(component.facts)) - 1
    for asked in (every & ~noise, _said(component, given), 0):
        found = {world: p for world, p in component.prior if p and _agrees(component, world, given, asked)}
        if found:
            whole = sum(found.values(), Fraction(0))
            return {world: p / whole for world, p in found.items()}
    raise AssertionError("a component has a world")


def contradicts(component: Component, given: TrueWorld) -> bool:
    """Can what is given of a component not be? Where its worlds are not listed, nobody looks."""
    if component.diagram is not None:
        return False
    said = _said(component, given)
    return not any(p and _agrees(component, world, given, said) for world, p in component.prior)


def _said(component: Component, given: TrueWorld) -> int:
    """The facts of which it is given whether they are true, as bits."""
    return sum(1 << bit for bit, f in enumerate(component.facts) if f in given.true or f in given.false)


def _agrees(component: Component, world: int, given: TrueWorld, asked: int) -> bool:
    """Is a world as given, as far as is asked?"""
    return (world ^ _true(component, given)) & asked == 0


def _true(component: Component, given: TrueWorld) -> int:
    """The world in which nothing else is true."""
    return sum(1 << bit for bit, fact in enumerate(component.facts) if fact in given.true)


def _is_possible(diagram: Diagram, world: int) -> bool:
    """Has a world a weight?"""
    number = len(diagram.nodes) + 1
    while number > 1:
        node = diagram.nodes[number - 2]
        weight, number = node.if_true if world >> node.place & 1 else node.if_false
        if not weight:
            return False
    return number == 1
