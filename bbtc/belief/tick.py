"""One tick of a tree in one physical state, and what a run remembers from tick to tick.

The paper's Algorithm 1 ticks a whole belief; since equal states are merged and a tick reads, but
never changes, the variables, ticking every state of the belief on its own is the same function,
and the status returned per state is the paper's ``r_i``.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from typing_extensions import assert_never

from bbtc.ground.condition import TRUE, Condition, compile_condition
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.tree.nodes import (
    COUNTING,
    ActionNode,
    ConditionNode,
    ControlNode,
    Node,
    actions_of,
    walk,
)


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
"""A tick returns a number from ``STARTED`` on (running, to every control node) when it started an action:
:meth:`Memory.action` tells which, :meth:`Memory.after` what is remembered then."""

Tick: TypeAlias = Callable[[Sequence[int], int], int]
Observer: TypeAlias = Callable[[Node, int], None]


class Counter(NamedTuple):
    """Where a memory counts what a retry node counts: bits from ``shift`` on."""

    node: str
    shift: int
    mask: int
    attempts: int

    def used_up(self, memory: int) -> bool:
        """Have all attempts been made?"""
        return memory >> self.shift & self.mask >= self.attempts


class Attempts(NamedTuple):
    """Of a retry-until-success node: the counter of its failed attempts, the bits of what is remembered below
    it, and ``failed``, what a tick adds to the number it returns where an attempt failed in it and the next
    one started an action."""

    counter: Counter
    below: int
    failed: int

    @property
    def bits(self) -> int:
        """All that is forgotten when the node ends or is halted."""
        return self.below | self.counter.mask << self.counter.shift


@dataclass(frozen=True, slots=True)
class Memory:
    """How the number :attr:`bbtc.belief.state.State.finished` is read: bit i tells that the i-th
    action node from the left, if latched, has finished; counters of retry nodes stand above.

    ``counters[i]`` are those of the retry nodes around action node i, and ``started[i]`` is what a
    start of it adds to the number; ``attempts[i]`` belong to the retry-until-success nodes around it, the
    outermost first, and ``kept[i]`` are the bits that no halted one of the others forgets.
    """

    counters: tuple[tuple[Counter, ...], ...]
    started: tuple[int, ...]
    attempts: tuple[tuple[Attempts, ...], ...]
    kept: tuple[int, ...]

    @property
    def forgets(self) -> bool:
        """Is there anything that is not remembered for good?"""
        return any(self.attempts)

    def action(self, returned: int) -> int:
        """The number of the action node that a tick has started."""
        return (returned - STARTED) % len(self.started)

    def after(self, finished: int, returned: int) -> int:
        """What is remembered after a tick that started an action (once that has finished)."""
        return self.during(finished, returned) + self.started[self.action(returned)]

    def during(self, finished: int, returned: int) -> int:
        """What is remembered while the action that a tick started is running, but for this start."""
        action = self.action(returned)
        for each in self.attempts[action]:
            if (returned - STARTED) // len(self.started) & each.failed // len(self.started):
                finished = (finished & ~each.below) + (1 << each.counter.shift)
        return finished & self.kept[action]


def memory_of(root: Node) -> Memory:
    """The memory of a tree."""
    actions = 0
    retries: list[ControlNode] = []
    until_success: list[ControlNode] = []
    for node in walk(root):  # once: planners ask about many trees
        if isinstance(node, ActionNode):
            actions += 1
        elif isinstance(node, ControlNode) and node.attempts is not None:
            (retries if node.kind == "retry" else until_success).append(node)
    shift = actions
    own: dict[str, Counter] = {}
    for node in (*retries, *until_success):
        attempts = node.attempts or 0
        bits = attempts.bit_length()
        own[node.id] = Counter(node.id, shift, (1 << bits) - 1, attempts)
        shift += bits
    until = _attempts(root, own, until_success, actions)
    counters: list[tuple[Counter, ...]] = []
    started: list[int] = []
    above: list[tuple[Attempts, ...]] = []
    stack: list[tuple[Node, tuple[Counter, ...], tuple[Attempts, ...]]] = [(root, (), ())]
    while stack:
        node, around, tries = stack.pop()
        match node:
            case ControlNode():
                if node.id in until:
                    tries = (*tries, until[node.id])
                elif node.id in own:
                    around = (*around, own[node.id])
                stack.extend((child, around, tries) for child in reversed(node.children))
            case ActionNode():
                latch = 1 << len(started) if node.latched else 0
                started.append(latch + sum(1 << counter.shift for counter in around))
                counters.append(around)
                above.append(tries)
            case ConditionNode():
                pass
            case _:
                assert_never(node)
    kept = []
    for tries in above:
        lost = 0
        for each in until.values():
            lost |= 0 if each in tries else each.bits
        kept.append(~lost)
    return Memory(tuple(counters), tuple(started), tuple(above), tuple(kept))


def _attempts(
    root: Node, own: Mapping[str, Counter], until_success: Sequence[ControlNode], actions: int
) -> dict[str, Attempts]:
    """By id, what belongs to each retry-until-success node, outer ones first."""
    if not until_success:
        return {}
    order = {node.id: number for number, node in enumerate(actions_of(root))}
    found: dict[str, Attempts] = {}
    levels: dict[str, int] = {}
    for node in until_success:
        below = 0
        for each in walk(node.children[0]):
            if each.id in order:
                below |= 1 << order[each.id]
            elif each.id in own:
                below |= own[each.id].mask << own[each.id].shift
                levels[each.id] = levels.get(each.id, 0) + 1
        found[node.id] = Attempts(own[node.id], below, actions << levels.get(node.id, 0))
    return found


def compile_tick(task: Task, root: Node, observe: Observer | None = None) -> Tick:
    """The tree as a function from values and what is remembered to a status number, or a number from
    ``STARTED`` on (:class:`Memory`). ``observe`` is told every node ticked and what it returned, in the
    order in which the nodes return.
    """
    order = {node.id: index for index, node in enumerate(actions_of(root))}
    memory = memory_of(root)
    counters = memory.counters
    until = {each.counter.node: each for tries in memory.attempts for each in tries}

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
                children = [build(child) for child in node.children]
                if node.id in until:
                    tick = _until_success(children[0], until[node.id])
                else:
                    # A retry-until-success without actions returns what its child does: nothing changes
                    # from one attempt to the next.
                    tick = children[0] if node.kind in COUNTING else _control(node.kind, children)
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


def _until_success(child: Tick, attempts: Attempts) -> Tick:
    """The child, and where it fails, the child once more with nothing remembered: if it fails then, too, it
    would do so ever after, and no attempt is left."""
    counter, _, failed = attempts

    def tick(values: Sequence[int], finished: int) -> int:
        status = child(values, finished)
        if status == NodeStatus.FAILURE and not counter.used_up(finished + (1 << counter.shift)):
            status = child(values, finished & ~attempts.below)
            return status + failed if status >= STARTED else status
        return status

    return tick


def _control(kind: str, children: list[Tick]) -> Tick:
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
