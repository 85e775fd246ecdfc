"""The chain of a tree with states that are alike in all that matters taken for one.

What a tick reads of a state is enough for the same action to be started; what of a state is enough for the
whole run to go the same way is an explanation of it (:mod:`bbtc.planner.strong_cyclic.visit`). States with
the explanation of another one have runs of the same actions, outcomes, costs and ends, with the same
probabilities: the chain over visited states is a quotient of the whole chain by a probabilistic
bisimulation (Larsen, Skou, "Bisimulation through probabilistic testing", 1991), and its figures are those
of the tree. All of it counts on invariants of reachable states only
(:mod:`bbtc.planner.strong_cyclic.exclusion`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.belief.chain import Chain, Edge
from bbtc.belief.draws import Values
from bbtc.belief.state import State, compile_action, initial_belief
from bbtc.belief.tick import STARTED, NodeStatus
from bbtc.ground.condition import Condition, variables
from bbtc.ground.task import Task, charges_of
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.packing import All, Cube, bit_test, set_bits
from bbtc.planner.strong_cyclic.determinised import Determinised, Step
from bbtc.planner.strong_cyclic.exclusion import Exclusion
from bbtc.planner.strong_cyclic.partial_state import ANY_STATE, PartialState, satisfied, united
from bbtc.planner.strong_cyclic.visit import Visit
from bbtc.tree.nodes import COUNTING, ActionNode, ConditionNode, ControlNode, Node, actions_of, walk


def quotient_chain(
    task: Task, root: Node, limits: Limits, model: Determinised, exclusion: Exclusion
) -> Chain:
    """The quotient of the chain of a tree that remembers nothing. Raises ``LimitReached``; ``ValueError``
    for a tree with latched actions or retry nodes."""
    if any(action.latched for action in actions_of(root)) or any(
        isinstance(node, ControlNode) and node.kind in COUNTING for node in walk(root)
    ):
        raise ValueError("a tree that remembers what it did")
    ticks = _Ticks(task, root, limits, model, exclusion)
    visit = Visit(ticks)
    packing = model.packing
    belief = {packing.pack(values): p for values, p in initial_belief(task).items()}
    for state in belief:
        visit.all_from(state)
    number = {state: index for index, state in enumerate(visit.nodes)}
    transitions = [compile_action(task, task.action_by_name[node.action], limits) for node in ticks.nodes]

    def edges_of(values: Values, choice: int) -> tuple[Edge, ...]:
        return tuple(
            Edge(result, number[visit.representative(packing.pack(result.values))])
            for result in transitions[choice](values)
        )

    states = [State(_values(packing.unknown, state), 0) for state in visit.nodes]
    started = [-1 if node.why_final is not None else node.choice for node in visit.nodes.values()]
    status = [
        NodeStatus.RUNNING if action >= 0 else NodeStatus(ticks.tick(state)[0])
        for state, action in zip(visit.nodes, started, strict=True)
    ]
    return Chain(
        tuple(ticks.nodes),
        tuple(states),
        tuple(status),
        tuple(started),
        tuple(
            edges_of(state.values, action) if action >= 0 else ()
            for state, action in zip(states, started, strict=True)
        ),
        tuple((p, number[visit.representative(state)]) for state, p in belief.items()),
    )


def _values(unknown: tuple[int | None, ...], state: int) -> Values:
    true = format(state & (1 << len(unknown)) - 1, f"0{len(unknown)}b")[::-1] if unknown else ""
    values = bytearray(true.encode().translate(_ONE_AS_TRUE))
    for variable, at in enumerate(unknown):
        if at is not None and state >> at & 1:
            values[variable] = Truth.UNKNOWN
    return bytes(values)


_ONE_AS_TRUE = bytes(int(Truth.TRUE) if digit == ord("1") else int(Truth.FALSE) for digit in range(256))
_MANY_CHILDREN = 8  # of a fallback, from which on an index pays
_MOST_FALSE = 2  # members of a group that are noted to be false one by one


class _Known:
    """What was read of a state so far, and what follows from it."""

    __slots__ = ("_exclusion", "closed", "read")

    def __init__(self, exclusion: Exclusion) -> None:
        self._exclusion = exclusion
        self.read = self.closed = ANY_STATE

    def note(self, partial: PartialState) -> None:
        if partial.mask & ~self.closed.mask:
            self.read = united(self.read, partial)
            self.closed = self._exclusion.closed(self.read)

    def note_first_of_group(self, literal: PartialState, state: int) -> None:
        """Note a literal; where it is one more of a group that is false, what is true of it instead."""
        mates = self._exclusion.mates.get(literal.mask.bit_length() - 1, 0)
        if not literal.value and (mates & self.read.mask).bit_count() >= _MOST_FALSE:
            literal = self._exclusion.strongest(literal, state)
        self.note(literal)


_Tick: TypeAlias = Callable[[int, _Known], int]


class _Ticks:
    """A tree as decisions, with what is read of a state for each."""

    def __init__(
        self, task: Task, root: Node, limits: Limits, model: Determinised, exclusion: Exclusion
    ) -> None:
        self.task, self.limits, self.model, self.exclusion = task, limits, model, exclusion
        self.nodes = list(actions_of(root))
        self._order = {node.id: index for index, node in enumerate(self.nodes)}
        self._numbers = {action.name: number for number, action in enumerate(task.actions)}
        self._root = self._compiled(root)
        self._ticked: dict[int, tuple[int, PartialState]] = {}

    # --- decisions ----------------------------------------------------------------------------

    def tick(self, state: int) -> tuple[int, PartialState]:
        """What the root returns, or ``STARTED`` and more, and what was read."""
        found = self._ticked.get(state)
        if found is None:
            known = _Known(self.exclusion)
            found = self._ticked[state] = self._root(state, known), known.read
        return found

    def final(self, state: int) -> PartialState | None:
        """What was read, where no action is started."""
        status, read = self.tick(state)
        return read if status < STARTED else None

    def decide(self, state: int) -> int:
        """The number of the action node that is started."""
        return self.tick(state)[0] - STARTED

    def action(self, choice: int) -> int:
        """The number of its action."""
        return self._numbers[self.nodes[choice].action]

    def why(self, state: int, choice: int) -> PartialState:
        """What was read, and what the costs depend on."""
        found = self.tick(state)[1]
        action = self.task.actions[self.action(choice)]
        for charge in charges_of(action.factors):
            test = bit_test(self.model.packing, charge.when)
            reasons = self.model.reasons
            how = reasons.why if satisfied(test, state) else reasons.why_not
            found = united(found, how(test, state, found.mask))
        return found

    def alone(self, state: int, choice: int, known: PartialState) -> PartialState:  # noqa: ARG002
        """What was read of a state settles what a tree does."""
        return known

    def note(self, choice: int, needed: PartialState) -> None:
        """What matters here is that runs are the same."""

    def blame(self, state: int, choice: int, step: Step, dead: int) -> None:
        """Trees have no dead ends: where nothing is started is final."""
        raise AssertionError(f"state {dead} after {state} by {choice}, {step} is a dead end")

    # --- ticks that take notes ------------------------------------------------------------------

    def _compiled(self, node: Node) -> _Tick:
        match node:
            case ConditionNode():
                return self._condition(node.condition)
            case ActionNode():
                started = STARTED + self._order[node.id]
                if not node.guarded:
                    return lambda _state, _known: started
                guard = self._condition(self.task.action_by_name[node.action].precondition)

                def guarded(state: int, known: _Known) -> int:
                    holds = guard(state, known)
                    return started if holds == NodeStatus.SUCCESS else holds

                return guarded
            case ControlNode():
                if node.kind in COUNTING:
                    raise ValueError("a tree that remembers what it did")
                children = [self._compiled(child) for child in node.children]
                if node.kind == "fallback" and len(children) >= _MANY_CHILDREN:
                    return self._of_many(children, [self._needed(child) for child in node.children])
                go_on = {
                    "sequence": NodeStatus.SUCCESS,
                    "fallback": NodeStatus.FAILURE,
                    "skipper": NodeStatus.RUNNING,
                }[node.kind]

                def control(state: int, known: _Known) -> int:
                    for child in children:
                        status = child(state, known)
                        if status != go_on:
                            return status
                    return int(go_on)

                return control
            case _:
                assert_never(node)

    def _needed(self, node: Node) -> int:
        """Bits of which each must be true for a node not to fail."""
        found = 0
        parts = node.children if isinstance(node, ControlNode) and node.kind == "sequence" else (node,)
        for part in parts:
            match part:
                case ConditionNode():
                    condition = part.condition
                case ActionNode() if part.guarded:
                    condition = self.task.action_by_name[part.action].precondition
                case _:
                    break
            if any(self.task.variables[variable].three_valued for variable in variables(condition)):
                break
            test = bit_test(self.model.packing, condition)
            for cube in test.parts if isinstance(test, All) else (test,):
                if isinstance(cube, Cube):
                    found |= cube.value
        return found

    def _of_many(self, children: list[_Tick], needed: list[int]) -> _Tick:
        """A fallback; children that fail by what was read already are passed over."""
        users: dict[int, int] = {}
        for number, bits in enumerate(needed):
            for bit in set_bits(bits):
                users[bit] = users.get(bit, 0) | 1 << number
        watched = sum(1 << bit for bit in users)
        ruled_out = dict.fromkeys(self.exclusion.mates, 0)
        for group in self.exclusion.groups:
            all_users = 0
            for member in group:
                all_users |= users.get(member, 0)
            for member in group:
                ruled_out[member] |= all_users & ~users.get(member, 0)

        def fallback(state: int, known: _Known) -> int:
            left, true, false = (1 << len(children)) - 1, 0, 0
            while left:
                read = known.read
                new = read.value & self.exclusion.members & ~true
                for bit in set_bits(new):
                    left &= ~ruled_out[bit]
                true |= new
                new = read.mask & ~read.value & watched & ~false
                for bit in set_bits(new):
                    left &= ~users[bit]
                false |= new
                if not left:
                    break
                lowest = left & -left
                left ^= lowest
                status = children[lowest.bit_length() - 1](state, known)
                if status != NodeStatus.FAILURE:
                    return status
            return int(NodeStatus.FAILURE)

        return fallback

    def _condition(self, condition: Condition) -> _Tick:
        packing, reasons = self.model.packing, self.model.reasons
        true, false = bit_test(packing, condition), bit_test(packing, condition, False)
        # What has to be so for it to be true may say nothing of a fact that makes it unknown: `p and not p`.
        if isinstance(true, Cube) and not any(
            self.task.variables[variable].three_valued for variable in variables(condition)
        ):
            return self._conjunction(true)

        def read(state: int, known: _Known) -> int:
            closed = known.closed
            if satisfied(true, state):
                known.note(reasons.why(true, state, closed.mask))
                return int(NodeStatus.SUCCESS)
            if satisfied(false, state):
                known.note(reasons.why(false, state, closed.mask))
                return int(NodeStatus.FAILURE)
            known.note(reasons.why_not(true, state, closed.mask))
            known.note(reasons.why_not(false, state, known.closed.mask))
            return int(NodeStatus.RUNNING)

        return read

    def _conjunction(self, cube: Cube) -> _Tick:
        """Of literals that are never unknown, the most common condition by far."""
        reasons, mask, value = self.model.reasons, cube.mask, cube.value

        def read(state: int, known: _Known) -> int:
            wrong = (state ^ value) & mask
            if not wrong:
                known.note(cube)
                return int(NodeStatus.SUCCESS)
            if not wrong & known.closed.mask:
                known.note_first_of_group(reasons.differs(cube, state), state)
            return int(NodeStatus.FAILURE)

        return read
