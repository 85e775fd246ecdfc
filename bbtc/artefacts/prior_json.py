"""What is thought of hidden facts at the start, as JSON, in and out: the worlds of a component one by one, or
a decision diagram."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

from bbtc.artefacts.conditions import variable_from_json
from bbtc.artefacts.cursor import At, clip
from bbtc.artefacts.numbers import given_text
from bbtc.diagrams import Diagram, Node, Weighted
from bbtc.ground.task import Component

_Worlds: TypeAlias = tuple[tuple[int, Fraction], ...]


def prior_to_json(component: Component) -> object:
    """The prior of a component."""
    facts, diagram = component.facts, component.diagram
    if diagram is None:
        return [
            {"p": given_text(p), "true": [fact for bit, fact in enumerate(facts) if world >> bit & 1]}
            for world, p in component.prior
        ]
    nodes = [
        {
            "fact": facts[node.place],
            "weights": [given_text(Fraction(edge.weight)) for edge in (node.if_false, node.if_true)],
            "to": [edge.node for edge in (node.if_false, node.if_true)],
        }
        for node in diagram.nodes
    ]
    return {"order": [facts[place] for place in diagram.order], "nodes": nodes}


def prior_from_json(at: At, places: Mapping[str, int]) -> tuple[_Worlds, Diagram | None]:
    """The prior of a component whose facts have these places."""
    if isinstance(at.value, dict):
        return (), _diagram(at, places)
    prior = tuple(_world(each, places) for each in at.elements())
    check_sum(at, [probability for _, probability in prior])
    return prior, None


def check_sum(at: At, probabilities: Sequence[Fraction]) -> None:
    """Raise a fault if probabilities do not sum to 1."""
    total = sum(probabilities, Fraction(0))
    if total != 1:
        raise at.fault("BBT0608", f"the probabilities sum to {clip(given_text(total))}, not to 1")


def _world(at: At, places: Mapping[str, int]) -> tuple[int, Fraction]:
    members = at.members(["p", "true"])
    world = 0
    for each in members["true"].elements():
        world |= 1 << variable_from_json(each, places)
    return world, members["p"].given_probability(zero=False)


def _diagram(at: At, places: Mapping[str, int]) -> Diagram:
    """A decision diagram in which some world has a weight."""
    members = at.members(["order", "nodes"])
    order = [variable_from_json(each, places) for each in members["order"].elements()]
    if sorted(order) != list(range(len(places))):
        raise members["order"].fault("BBT0604", "must have every fact of the component once")
    level = {place: number for number, place in enumerate(order)}
    levels, empty = [len(order)] * 2, [True, False]
    nodes = []
    for each in members["nodes"].elements():
        node = _node(each, places)
        for edge in (node.if_false, node.if_true):
            if not edge.node < len(levels) or levels[edge.node] <= level[node.place]:
                raise each.fault("BBT0604", "must lead to nodes that stand before it, of facts after its own")
        nodes.append(node)
        levels.append(level[node.place])
        empty.append(all(empty[edge.node] or not edge.weight for edge in (node.if_false, node.if_true)))
    if nodes and empty[-1]:
        raise members["nodes"].fault("BBT0604", "must leave some world possible")
    return Diagram(tuple(order), tuple(nodes))


def _node(at: At, places: Mapping[str, int]) -> Node:
    members = at.members(["fact", "weights", "to"])
    weights = [each.given() for each in members["weights"].elements()]
    if len(weights) != 2 or any(weight < 0 or weight.denominator != 1 for weight in weights):
        raise members["weights"].fault("BBT0604", "must be two whole numbers, not below 0")
    to = []
    for each in members["to"].elements():
        if isinstance(each.value, bool) or not isinstance(each.value, int) or each.value < 0:
            raise each.fault("BBT0604", "must be the number of a node")
        to.append(each.value)
    if len(to) != 2:
        raise members["to"].fault("BBT0604", "must be two numbers of nodes")
    low, high = (Weighted(int(weight), node) for weight, node in zip(weights, to, strict=True))
    return Node(variable_from_json(members["fact"], places), low, high)
