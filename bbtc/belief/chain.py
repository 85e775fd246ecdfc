"""The Markov chain that a tree induces on the physical states it can reach.

This is the paper's Algorithm 2 (self-simulation) with equal states merged: a step is a root tick
that starts an action, and that action's outcome; a state in which no action starts is final.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import NamedTuple

from bbtc.belief.draws import Values
from bbtc.belief.hidden import chance_of
from bbtc.belief.state import Result, State, Transition, compile_action, initial_belief
from bbtc.belief.tick import STARTED, NodeStatus, compile_tick, memory_of
from bbtc.ground.task import ONE, ZERO, Task
from bbtc.limits import Limits
from bbtc.tree.nodes import ActionNode, Node, actions_of

MOST_BELIEVED = 5_000
"""States of a chain where there may be beliefs without end: their weights have ever more digits."""


class Edge(NamedTuple):
    """A possible result of a state's action, and the index of the state it leads to."""

    result: Result
    successor: int


@dataclass(frozen=True, slots=True)
class Chain:
    """States in breadth-first order from the initial ones.

    ``status[i]`` is the root's status in state i; ``action[i]`` is the index (from the left) of
    the action node it starts, -1 in a final state. ``edges[i]`` is empty exactly in final states.
    """

    actions: tuple[ActionNode, ...]
    states: tuple[State, ...]
    status: tuple[NodeStatus, ...]
    action: tuple[int, ...]
    edges: tuple[tuple[Edge, ...], ...]
    initial: tuple[tuple[Fraction, int], ...]
    forgets: bool = False
    """May latched actions start again, as the tree has retry-until-success nodes?"""
    given_up: tuple[int, ...] = ()
    """States whose action is running when the next tick gives it up, though nothing has changed."""
    doubtful: Mapping[int, Fraction] = field(default_factory=dict)
    """Final states in which the root succeeds though the goal need not be true, and how probably it is."""

    def won(self, state: int) -> Fraction:
        """How probably a final state is one in which the root succeeds and the goal is true."""
        return self.doubtful.get(state, ONE) if self.status[state] is NodeStatus.SUCCESS else ZERO

    @property
    def final(self) -> list[int]:
        """Indices of the states in which no action starts."""
        return [index for index, action in enumerate(self.action) if action < 0]


def explore(
    task: Task,
    root: Node,
    limits: Limits,
    transitions: dict[str, Transition] | None = None,
    starts: Mapping[Values, Fraction] | None = None,
) -> Chain:
    """Every state the tree can reach, from the initial belief or from other ``starts`` with their
    probabilities. ``transitions`` may be shared between calls on one task.

    Raises :class:`bbtc.diagnostics.LimitReached` past the limit on states or time.
    """
    transitions = {} if transitions is None else transitions
    actions = tuple(actions_of(root))
    steps = []
    for node in actions:
        if node.action not in transitions:
            transitions[node.action] = compile_action(task, task.action_by_name[node.action], limits)
        steps.append(transitions[node.action])
    tick = compile_tick(task, root)
    memory = memory_of(root)
    index: dict[State, int] = {}
    states: list[State] = []

    def number(state: State) -> int:
        known = index.get(state)
        if known is None:
            known = index[state] = len(states)
            states.append(state)
        return known

    belief = initial_belief(task) if starts is None else starts
    initial = tuple((p, number(State(values, 0))) for values, p in belief.items())
    status: list[NodeStatus] = []
    started: list[int] = []
    edges: list[tuple[Edge, ...]] = []
    given_up: list[int] = []
    doubtful: dict[int, Fraction] = {}
    if task.endless_beliefs:
        limits = replace(limits, states=min(limits.states, MOST_BELIEVED))
    for state in states:  # grows while it is read: breadth first
        limits.check_states(len(states), "the simulation")
        returned = tick(state.values, state.finished)
        if returned < STARTED:
            if task.components and returned == NodeStatus.SUCCESS:
                chance = chance_of(task, task.goal, state.values)
                if chance < 1:
                    doubtful[len(status)] = chance
            status.append(NodeStatus(returned))
            started.append(-1)
            edges.append(())
            continue
        action = memory.action(returned)
        finished = memory.after(state.finished, returned)
        if memory.forgets and tick(state.values, memory.during(state.finished, returned)) != STARTED + action:
            given_up.append(len(status))
        status.append(NodeStatus.RUNNING)
        started.append(action)
        edges.append(tuple(Edge(r, number(State(r.values, finished))) for r in steps[action](state.values)))
    return Chain(
        actions,
        tuple(states),
        tuple(status),
        tuple(started),
        tuple(edges),
        initial,
        memory.forgets,
        tuple(given_up),
        doubtful,
    )
