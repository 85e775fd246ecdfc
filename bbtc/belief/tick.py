"""One tick of a tree in one physical state, and what a run remembers from tick to tick.

The paper's Algorithm 1 ticks a whole belief; since equal states are merged and a tick reads, but
never changes, the variables, ticking every state of the belief on its own is the same function,
and the status returned per state is the paper's ``r_i``.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from typing_extensions import assert_never

from bbtc.ground.condition import TRUE, Condition, compile_condition
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, actions_of, retries_of


class NodeStatus(enum.IntEnum):
    """What a node returns; named as in BehaviorTree.CPP. The numbers equal the truth values it means."""

    FAILURE = 0
    RUNNING = 1
    SUCCESS = 2

    @property
    def word(self) -> str:
        """``failure``, ``running`` or ``success``."""
        return self.name.lower()


STARTED = 3
"""A tick returns ``STARTED + i`` (running, to every control node) when it started action node i."""

Tick: TypeAlias = Callable[[Sequence[int], int], int]
Observer: TypeAlias = Callable[[Node, int], None]


class Counter(NamedTuple):
    """Where a memory counts the actions started below a retry node: bits from ``shift`` on."""

    node: str
    shift: int
    mask: int
    attempts: int

    def used_up(self, memory: int) -> bool:
        """Have all attempts been made?"""
        return memory >> self.shift & self.mask >= self.attempts


@dataclass(frozen=True, slots=True)
class Memory:
    """How the number :attr:`bbtc.belief.state.State.finished` is read: bit i tells that the i-th
    action node from the left, if latched, has finished; counters of retry nodes stand above.

    ``counters[i]`` are those of the retry nodes around action node i, and ``started[i]`` is what a
    start of it adds to the number.
    """

    counters: tuple[tuple[Counter, ...], ...]
    started: tuple[int, ...]


def memory_of(root: Node) -> Memory:
    """The memory of a tree."""
    shift = sum(1 for _ in actions_of(root))
    own: dict[str, Counter] = {}
    for retry, attempts in retries_of(root):
        bits = attempts.bit_length()
        own[retry.id] = Counter(retry.id, shift, (1 << bits) - 1, attempts)
        shift += bits
    counters: list[tuple[Counter, ...]] = []
    started: list[int] = []
    stack: list[tuple[Node, tuple[Counter, ...]]] = [(root, ())]
    while stack:
        node, around = stack.pop()
        match node:
            case ControlNode():
                around = (*around, own[node.id]) if node.id in own else around
                stack.extend((child, around) for child in reversed(node.children))
            case ActionNode():
                latch = 1 << len(started) if node.latched else 0
                started.append(latch + sum(1 << counter.shift for counter in around))
                counters.append(around)
            case ConditionNode():
                pass
            case _:
                assert_never(node)
    return Memory(tuple(counters), tuple(started))


def compile_tick(task: Task, root: Node, observe: Observer | None = None) -> Tick:
    """The tree as a function from values and finished latches to a status number, or
    ``STARTED + i``. ``observe`` is told every node ticked and what it returned, in the order in
    which the nodes return.
    """
    order = {node.id: index for index, node in enumerate(actions_of(root))}
    counters = memory_of(root).counters

    def build(node: Node) -> Tick:
        match node:
            case ConditionNode():
                test = compile_condition(node.condition)
                tick: Tick = lambda values, _: test(values)  # noqa: E731
            case ActionNode():
                guard = task.action_by_name[node.action].precondition if node.guarded else TRUE
                tick = _action(order[node.id], node.latched, guard)
                if counters[order[node.id]]:
                    tick = _limited(order[node.id], tick, counters[order[node.id]])
            case ControlNode():
                tick = _control(node.kind, [build(child) for child in node.children])
            case _:
                assert_never(node)
        return tick if observe is None else _observed(node, tick, observe)

    return build(root)


def _action(index: int, latched: bool, guard: Condition) -> Tick:
    bit, started = (1 << index if latched else 0), STARTED + index
    if guard == TRUE:
        return lambda _, finished: NodeStatus.SUCCESS if finished & bit else started
    test = compile_condition(guard)

    def tick(values: Sequence[int], finished: int) -> int:
        if finished & bit:
            return NodeStatus.SUCCESS
        holds = test(values)
        return started if holds == Truth.TRUE else holds

    return tick


def _limited(index: int, action: Tick, counters: tuple[Counter, ...]) -> Tick:
    """The action, refused (failure) where a retry node around it has no attempts left."""
    started = STARTED + index

    def tick(values: Sequence[int], finished: int) -> int:
        status = action(values, finished)
        if status == started and any(counter.used_up(finished) for counter in counters):
            return NodeStatus.FAILURE
        return status

    return tick


def _control(kind: str, children: list[Tick]) -> Tick:
    if kind == "retry":
        (child,) = children
        return child
    # Each kind goes on while the child returns one status (semantics page, table of nodes). A
    # started action is running, but no Skipper goes on after it: only its last child holds actions.
    go_on = int(
        {"sequence": NodeStatus.SUCCESS, "fallback": NodeStatus.FAILURE, "skipper": NodeStatus.RUNNING}[kind]
    )

    def tick(values: Sequence[int], finished: int) -> int:
        for child in children:
            status = child(values, finished)
            if status != go_on:
                return status
        return go_on

    return tick


def _observed(node: Node, tick: Tick, observe: Observer) -> Tick:
    def observed(values: Sequence[int], finished: int) -> int:
        status = tick(values, finished)
        observe(node, status)
        return status

    return observed
