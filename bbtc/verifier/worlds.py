"""What a tree does where facts are hidden, as the runs of a world of which the robot knows a part.

A state is what is seen, which world is the case, which worlds the robot holds possible, and what the tree
remembers. A world is drawn from the prior, and actions change it by their outcomes; the robot crosses out the
worlds in which it could not have been told what it was told. No probability is ever conditioned: beliefs and
their updates, on which planner and simulator rest, have no part in it. Only where something is *believed*
(:attr:`bbtc.ground.task.Knowledge.at_least` below 1), possible worlds have weights.

Source: the pages on semantics and language, not the simulator: this is its independent check.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import islice, product
from typing import NamedTuple, TypeAlias

from typing_extensions import assert_never

from bbtc.ground.condition import FALSE, TRUE, Condition, Is, Known, evaluate, replaced, variables
from bbtc.ground.task import Change, Component, Factor, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node
from bbtc.verifier.explore import Space, Step
from bbtc.verifier.happenings import (
    Amounts,
    Outcome,
    Possible,
    Shown,
    add,
    holds,
    is_weighed,
    known_of,
    outcomes_of_change,
    possible_worlds,
    prior_worlds,
    together,
)
from bbtc.verifier.program import YES, Command

MOST_STATES = 50_000
"""A tree that has more of them is not checked in this way."""

_ZERO, _ONE = Fraction(0), Fraction(1)
_GO_ON = {"sequence": Truth.TRUE, "fallback": Truth.FALSE, "skipper": Truth.UNKNOWN}
_ENDS = {Truth.TRUE: "success", Truth.FALSE: "failure", Truth.UNKNOWN: "blocked"}
_STEP = Command(None, YES, (), "")

_Values: TypeAlias = tuple[int, ...]
_Prior: TypeAlias = Sequence[tuple[int, Fraction]]


class _State(NamedTuple):
    """``worlds`` are None for components of which nothing has happened yet: they are as the prior has it.
    ``memory`` has, by node: 1 for a latched action that has finished, the starts below a retry node, and one
    more than the failed attempts of a retry-until-success node that is running."""

    values: _Values
    worlds: tuple[int | None, ...]
    possible: tuple[Possible, ...]
    memory: tuple[tuple[str, int], ...]


def space_of(task: Task, root: Node, limits: Limits) -> Space | None:
    """The chain of a tree for a task with hidden facts, with the labels of
    :func:`bbtc.verifier.chain.chain_of`; ``goal`` is where it is true in the world. None beyond
    :data:`MOST_STATES`, or so many worlds. Raises ``LimitReached``."""
    priors = [list(islice(_worlds(component), MOST_STATES + 1)) for component in task.components]
    if any(len(prior) > MOST_STATES for prior in priors):
        return None
    runs = _Runs(task, root, priors)
    states: list[_State] = []
    number: dict[_State, int] = {}

    def place(state: _State) -> int:
        found = number.get(state)
        if found is None:
            found = number[state] = len(states) + 1
            states.append(state)
        return found

    start = tuple(Step(place(state), p, (_ZERO,) * 3) for p, state in runs.start())
    choices: list[tuple[tuple[Command, tuple[Step, ...]], ...]] = [((_STEP, start),)]
    labels: dict[str, set[int]] = {name: set() for name in (*_ENDS.values(), "goal", "unready")}
    for state in states:  # grows while it is read
        if len(states) > MOST_STATES:
            return None
        limits.check_time("the recomputation")
        at = number[state]
        ticked, memory = runs.tick(state)
        if isinstance(ticked, ActionNode):
            action = task.action_by_name[ticked.action]
            if evaluate(action.precondition, runs.known(state)) is not Truth.TRUE:
                labels["unready"].add(at)
            touched = [change.component for change in action.changes]
        else:
            touched = runs.of_goal
        drawn = runs.drawn(state, touched)
        if drawn is not None:
            steps = [Step(place(after), p, (_ZERO,) * 3) for p, after in drawn]
        elif isinstance(ticked, ActionNode):
            found = runs.after(state._replace(memory=memory), ticked)
            steps = [Step(place(after), p, (_ONE, *amounts)) for p, after, amounts in found]
        else:
            steps = []
            labels[_ENDS[ticked]].add(at)
            if runs.goal_is_true(state):
                labels["goal"].add(at)
        choices.append(((_STEP, tuple(steps)),))
    finished = set[int]().union(*(labels[end] for end in _ENDS.values()))
    named = {name: frozenset(found) for name, found in {**labels, "finished": finished}.items()}
    return Space(tuple(choices), named)


def _worlds(component: Component) -> Iterator[tuple[int, Fraction]]:
    """The worlds of the prior, with their probabilities; of a diagram, by all its paths."""
    diagram = component.diagram
    if diagram is None:
        yield from component.prior
        return
    level = {place: number for number, place in enumerate(diagram.order)}
    levels = [len(level)] * 2 + [level[node.place] for node in diagram.nodes]

    def total(number: int, above: int) -> Fraction:
        """The weight of a node's worlds by the facts after a level."""
        return totals[number] * (1 << (levels[number] - above - 1))

    totals = [_ZERO, _ONE]
    for node in diagram.nodes:
        above = level[node.place]
        totals.append(sum((weight * total(to, above) for weight, to in (node.if_false, node.if_true)), _ZERO))
    waiting = [(len(levels) - 1, -1, 0, _ONE / total(len(levels) - 1, -1))]
    while waiting:
        number, above, world, p = waiting.pop()
        at = above + 1
        if at < levels[number]:  # nothing is asked of the fact of this level
            waiting += [(number, at, world | value << diagram.order[at], p) for value in (1, 0)]
        elif at == len(level):
            yield world, p
        else:
            node = diagram.nodes[number - 2]
            for value, (weight, to) in ((1, node.if_true), (0, node.if_false)):
                if weight and totals[to]:
                    waiting.append((to, at, world | value << node.place, p * weight))


class _Runs:
    """What happens next, state by state."""

    def __init__(self, task: Task, root: Node, priors: Sequence[_Prior]) -> None:
        self._task = task
        self._priors = priors
        self._weighed = [is_weighed(component) for component in task.components]
        self._root = root
        self._around: dict[str, tuple[ControlNode, ...]] = {}
        self._below: dict[str, frozenset[str]] = {}
        self._until: set[str] = set()
        self._note(root, ())
        self._kernels: dict[tuple[int, int, _Values], list[Outcome]] = {}
        self._kept: list[Change] = []
        self._knows: dict[tuple[int, Possible], list[tuple[int, int]]] = {}
        self._by_variable = {each.variable: (number, each.condition)
                             for number, component in enumerate(task.components)
                             for each in component.known}  # fmt: skip
        of_goal = (self._by_variable.get(variable) for variable in variables(task.goal))
        self.of_goal = sorted({found[0] for found in of_goal if found is not None})

    def _note(self, node: Node, around: tuple[ControlNode, ...]) -> frozenset[str]:
        """Note which counting nodes are around each action, and what may be remembered below each of them."""
        match node:
            case ActionNode():
                self._around[node.id] = around
                return frozenset([node.id])
            case ConditionNode():
                return frozenset()
            case ControlNode():
                inside = around if node.attempts is None else (*around, node)
                found = frozenset[str]().union(*(self._note(child, inside) for child in node.children))
                if node.attempts is not None:
                    self._below[node.id] = found
                    found |= {node.id}
                if node.kind == "retry-until-success":
                    self._until.add(node.id)
                return found
            case _:
                assert_never(node)

    def start(self) -> Iterator[tuple[Fraction, _State]]:
        """The first states, once the robot was told what it is told at first."""
        task = self._task
        priors = [
            prior_worlds(prior, weighed) for prior, weighed in zip(self._priors, self._weighed, strict=True)
        ]
        at_first = [number for number, component in enumerate(task.components) if component.first]
        for initial in task.initial:
            if not initial.probability:
                continue
            values = tuple(map(int, initial.values))
            state = _State(values, (None,) * len(priors), tuple(priors), ())
            for p, drawn in self.drawn(state, at_first) or [(_ONE, state)]:
                changes = [Change(c, task.components[c].seen, (), task.components[c].first) for c in at_first]
                for q, after, _ in self._changed(drawn, (), changes):
                    yield initial.probability * p * q, after

    def drawn(self, state: _State, components: Iterable[int]) -> list[tuple[Fraction, _State]] | None:
        """The state with a world for each of the components; None where they have one."""
        waiting = [number for number in components if state.worlds[number] is None]
        if not waiting:
            return None
        found = []
        for picked in product(*(self._priors[number] for number in waiting)):
            worlds, p = list(state.worlds), _ONE
            for number, (world, probability) in zip(waiting, picked, strict=True):
                worlds[number], p = world, p * probability
            if p:
                found.append((p, state._replace(worlds=tuple(worlds))))
        return found

    # --- what is known -----------------------------------------------------------------------

    def known(self, state: _State) -> list[int]:
        """The values of the task's variables for the robot."""
        values = list(state.values)
        for number, possible in enumerate(state.possible):
            key = number, possible
            if key not in self._knows:
                self._knows[key] = known_of(self._task.components[number], possible)
            for variable, value in self._knows[key]:
                values[variable] = value
        return values

    def goal_is_true(self, state: _State) -> bool:
        """Is the goal true in the world? What it asks of knowledge is asked of the robot's."""
        values = self.known(state)
        known = list(values)
        for variable, (number, condition) in self._by_variable.items():
            world = state.worlds[number]
            if world is not None:
                values[variable] = 2 * holds(self._task.components[number], condition, world)
        return evaluate(_settled(self._task.goal, known), values) is Truth.TRUE

    # --- ticks -------------------------------------------------------------------------------

    def tick(self, state: _State) -> tuple[Truth | ActionNode, tuple[tuple[str, int], ...]]:
        """What the root returns, or the action that starts; and what is remembered then."""
        memory = dict(state.memory)
        ticked = self._ticked(self._root, self.known(state), memory)
        if isinstance(ticked, ActionNode):
            around = self._around[ticked.id]
            for halted in self._until - {node.id for node in around}:
                self._forget(halted, memory)
            if ticked.latched:
                memory[ticked.id] = 1
            for node in around:
                if node.kind == "retry":
                    memory[node.id] = memory.get(node.id, 0) + 1
        return ticked, tuple(sorted(memory.items()))

    def _forget(self, node: str, memory: dict[str, int]) -> None:
        for each in self._below[node] | {node}:
            memory.pop(each, None)

    def _ticked(self, node: Node, values: Sequence[int], memory: dict[str, int]) -> Truth | ActionNode:
        match node:
            case ConditionNode():
                return evaluate(node.condition, values)
            case ActionNode():
                if node.latched and node.id in memory:
                    return Truth.TRUE
                if node.guarded:
                    ready = evaluate(self._task.action_by_name[node.action].precondition, values)
                    if ready is not Truth.TRUE:
                        return ready
                tries = [each for each in self._around[node.id] if each.kind == "retry"]
                used = any(memory.get(each.id, 0) >= (each.attempts or 0) for each in tries)
                return Truth.FALSE if used else node
            case ControlNode(kind="retry"):
                return self._ticked(node.children[0], values, memory)
            case ControlNode(kind="retry-until-success"):
                return self._tried(node, values, memory)
            case ControlNode():
                found: Truth | ActionNode = _GO_ON[node.kind]
                for child in node.children:
                    found = self._ticked(child, values, memory)
                    if found is not _GO_ON[node.kind]:
                        break
                return found
            case _:
                assert_never(node)

    def _tried(self, node: ControlNode, values: Sequence[int], memory: dict[str, int]) -> Truth | ActionNode:
        """A tick of a retry-until-success node: where the attempt under way fails, one more is made."""
        (child,), failed = node.children, memory.get(node.id, 1) - 1
        found = self._ticked(child, values, memory)
        if found is Truth.FALSE and node.id in memory and failed + 1 < (node.attempts or 0):
            failed += 1
            self._forget(node.id, memory)
            found = self._ticked(child, values, memory)
        if found is Truth.TRUE or found is Truth.FALSE:
            self._forget(node.id, memory)
        else:
            memory[node.id] = failed + 1
        return found

    # --- actions -----------------------------------------------------------------------------

    def after(self, state: _State, node: ActionNode) -> Iterator[tuple[Fraction, _State, Amounts]]:
        """What may come of an action."""
        action = self._task.action_by_name[node.action]
        for p, after, (cost, reward) in self._changed(state, action.factors, action.changes):
            yield p, after, (action.cost + cost, reward)

    def _changed(
        self, state: _State, factors: Sequence[Factor], changes: Sequence[Change]
    ) -> Iterator[tuple[Fraction, _State, Amounts]]:
        """What factors and changes make of a state; they happen independently."""
        known = self.known(state)
        visible = together(factors, known)
        hidden = list(product(*(self._happenings(state, change, known) for change in changes)))
        for (p, sets, amounts), happening in product(visible, hidden):
            set_to, worlds, possible = dict(sets), list(state.worlds), list(state.possible)
            probability, (cost, reward) = p, amounts
            for change, each in zip(changes, happening, strict=True):
                probability *= each.probability
                cost, reward = cost + each.amounts[0], reward + each.amounts[1]
                worlds[change.component], possible[change.component] = each.world, each.possible
                add(set_to, each.sets)
            values = list(state.values)
            for variable, value in set_to.items():
                values[variable] = value
            after = state._replace(values=tuple(values), worlds=tuple(worlds), possible=tuple(possible))
            yield probability, after, (cost, reward)

    def _happenings(self, state: _State, change: Change, known: Sequence[int]) -> list[_Happening]:
        """What a change may do in the world of a state, with the worlds that are possible for the robot
        then."""
        seen = tuple(known[variable] for variable in change.seen)
        world, possible = state.worlds[change.component], state.possible[change.component]
        assert world is not None
        after: dict[Shown, dict[int, Fraction]] = {}
        for other, weight in possible:
            for each in self._kernel(change, other, seen):
                mass = after.setdefault(each.told, {})
                mass[each.world] = mass.get(each.world, _ZERO) + weight * each.probability
        weighed = self._weighed[change.component]
        left = {told: possible_worlds(mass, weighed) for told, mass in after.items()}
        found: dict[_Happening, Fraction] = {}
        for each in self._kernel(change, world, seen):
            key = _Happening(each.world, left[each.told], each.told, each.sets, each.amounts)
            found[key] = found.get(key, _ZERO) + each.probability
        return [each._replace(probability=p) for each, p in found.items()]

    def _kernel(self, change: Change, world: int, seen: _Values) -> list[Outcome]:
        """All that a change may do in a world, and what the robot is told of it."""
        key = id(change), world, seen
        found = self._kernels.get(key)
        if found is None:
            self._kept.append(change)  # so that its id stays its own
            found = self._kernels[key] = list(
                outcomes_of_change(self._task.components[change.component], change, world, seen)
            )
        return found


class _Happening(NamedTuple):
    """The same, with the worlds that are possible for the robot after it."""

    world: int
    possible: Possible
    told: Shown
    sets: tuple[tuple[int, int], ...]
    amounts: Amounts
    probability: Fraction = _ZERO


def _settled(goal: Condition, known: Sequence[int]) -> Condition:
    """The goal in which what it asks of knowledge is answered."""

    def leaf(read: Is | Known) -> Condition:
        if isinstance(read, Known) or read.value is Truth.UNKNOWN:
            return TRUE if evaluate(read, known) is Truth.TRUE else FALSE
        return read

    return replaced(goal, leaf)
