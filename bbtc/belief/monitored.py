"""What a tree needs to run on a robot, where facts are hidden: a table that works out what is known of what
the robot was told, and a task that holds what is true, to try it in.

The table has what the runs of the tree reach, and nothing else: no weights, no worlds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import prod

from bbtc.belief.chain import Chain, explore
from bbtc.belief.draws import Values, unbounded
from bbtc.belief.hidden import Readings, beliefs_of, case_of, number_in
from bbtc.belief.state import initial_belief
from bbtc.belief.worlds.kernel import Reading
from bbtc.diagrams import ONE, Diagram, Diagrams
from bbtc.ground.condition import TRUE, Condition, conjunction, negation, replaced, variables
from bbtc.ground.describe import describe
from bbtc.ground.hidden.given import given_worlds
from bbtc.ground.task import (
    NO_CHANGE,
    Change,
    Charge,
    Effect,
    Factor,
    GroundAction,
    Observation,
    Outcome,
    Task,
    Variable,
    effects_of,
    split_name,
)
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.markov import distribution, independent
from bbtc.tree.monitor import FIRST, Monitor, Move, Part, Row, Sets, Telling, Turn, Walk
from bbtc.tree.nodes import ActionNode, ConditionNode, Node, Tree, actions_of, walk

_TRUE = "really"


def monitored(tree: Tree, limits: Limits) -> Tree | None:
    """The tree with a monitor, and a task whose variables tell what is true beside what is known; None where
    the tree asks nothing that needs one. Raises :class:`bbtc.diagnostics.LimitReached`."""
    task = with_hidden(tree.task)
    asked = _asked(task, tree.root)
    parts = [
        index
        for index, component in enumerate(task.components)
        if any(knowledge.variable in asked for knowledge in component.known)
    ]
    if not parts:
        return None
    chain = explore(task, tree.root, limits)
    names = ObservationNames(task)
    tables = _Tables(task, chain, names, limits)
    world = _World(task, tree.root, parts, names, limits)
    monitor = Monitor(
        tuple(map(tables.part, parts)), tuple(world.priors()), tuple(world.tellings()), tuple(world.walks())
    )
    return replace(tree, task=world.task(), monitor=monitor)


def with_hidden(task: Task) -> Task:
    """The task with all that is hidden, as far as something has to be worked out."""
    origin = task.origin
    if origin is None or [each.name for each in origin.variables] != [each.name for each in task.variables]:
        return task  # what was added since, the one that it was made of does not know
    return replace(origin, variables=task.variables)


def _asked(task: Task, root: Node) -> set[int]:
    """The variables that a tree, or what its actions do openly, reads."""
    found: set[int] = set()
    for node in walk(root):
        if isinstance(node, ConditionNode):
            found.update(variables(node.condition))
        elif isinstance(node, ActionNode):
            action = task.action_by_name[node.action]
            if node.guarded:
                found.update(variables(action.precondition))
            for effect in effects_of(action.factors):
                found.update(() if effect.when is None else variables(effect.when))
    return found


class ObservationNames:
    """What the readings of an action are called: as what they tell of, with a number where two would be
    called alike."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._found: dict[str, dict[int, tuple[str, ...]]] = {}

    def of(self, action: str, component: int) -> tuple[str, ...]:
        """The names of the observations of a component that an action makes."""
        if action not in self._found:
            self._found[action] = self._name(changes_of(self._task, action))
        return self._found[action].get(component, ())

    def _name(self, changes: Iterable[Change]) -> dict[int, tuple[str, ...]]:
        taken: set[str] = set()
        found = {}
        for change in changes:
            local = self._task.components[change.component].local(self._task, change.seen)
            words_of = replace(self._task, variables=local)
            names = []
            for observation in change.observations:
                name = words = describe(words_of, observation.condition)
                number = 1
                while name in taken:
                    number += 1
                    name = f"{words} #{number}"
                taken.add(name)
                names.append(name)
            found[change.component] = tuple(names)
        return found


def changes_of(task: Task, action: str) -> Iterator[Change]:
    """The changes of an action, or what is told first."""
    if action != FIRST:
        yield from task.action_by_name[action].changes
        return
    for index, component in enumerate(task.components):
        if component.first:
            yield Change(index, component.seen, (), component.first)


class _Tables:
    """The table of every component."""

    def __init__(self, task: Task, chain: Chain, names: ObservationNames, limits: Limits) -> None:
        self._task, self._chain, self._names, self._limits = task, chain, names, limits
        self._asked: dict[str, dict[Values, None]] = {node.action: {} for node in chain.actions}
        for state, number in zip(chain.states, chain.action, strict=True):
            if number >= 0:
                self._asked[chain.actions[number].action][state.values] = None

    def part(self, component: int) -> Part:
        """The table of a component. Beliefs are numbered in the order of the chain."""
        task = self._task
        beliefs = beliefs_of(task.components[component])
        prior = beliefs.prior
        met = {number_in(task, state.values, component): None for state in self._chain.states}
        first = [change for change in changes_of(task, FIRST) if change.component == component]
        numbers = {number: at for at, number in enumerate(dict.fromkeys([prior, *met] if first else met))}
        moves = [self._first(change, prior, numbers) for change in first]
        for action, states in sorted(self._asked.items()):
            moves += [
                self._move(action, change, states, numbers)
                for change in task.action_by_name[action].changes
                if change.component == component
            ]
        known = tuple(knowledge.variable for knowledge in task.components[component].known)
        values = tuple(tuple(Truth(value) for _, value in beliefs.known(number)) for number in numbers)
        return Part(known, values, numbers[prior] if first else 0, tuple(moves))

    def _first(self, change: Change, prior: int, numbers: dict[int, int]) -> Move:
        starts = ((prior, bytes(values[at] for at in change.seen)) for values in initial_belief(self._task))
        return self._rows(FIRST, change, starts, numbers)

    def _move(self, action: str, change: Change, states: Iterable[Values], numbers: dict[int, int]) -> Move:
        asked = (case_of(self._task, change, values) for values in states)
        return self._rows(action, change, asked, numbers)

    def _rows(
        self, action: str, change: Change, asked: Iterable[tuple[int, bytes]], numbers: dict[int, int]
    ) -> Move:
        readings = Readings(self._task, change, unbounded)
        rows: list[Row] = []
        for number, seen in dict.fromkeys(asked):
            self._limits.check_time("writing down what is known")
            rows += [
                _row(numbers, number, seen, reading, len(change.observations))
                for reading in readings.after(number, seen)
            ]
        # What is the same whatever happens tells nothing.
        telling = [
            at for at in range(len(change.seen)) if len({(row.before[at], row.after[at]) for row in rows}) > 1
        ]
        return Move(
            action,
            tuple(change.seen[at] for at in telling),
            self._names.of(action, change.component),
            tuple(
                replace(
                    row,
                    before=tuple(row.before[at] for at in telling),
                    after=tuple(row.after[at] for at in telling),
                )
                for row in rows
            ),
        )


def _row(numbers: dict[int, int], number: int, seen: bytes, reading: Reading, observations: int) -> Row:
    before = tuple(map(Truth, seen))
    shown, told = dict(reading.shown), dict(reading.told)
    return Row(
        numbers[number],
        before,
        tuple(Truth(told_as(told.get(at))) for at in range(observations)),
        tuple(Truth(shown.get(at, value)) for at, value in enumerate(seen)),
        numbers[reading.belief],
    )


def told_as(told: int | None) -> Truth:
    """What an observation told, or unknown where it was not made."""
    return Truth.UNKNOWN if told is None else Truth.TRUE if told else Truth.FALSE


# --- what is true ----------------------------------------------------------------------------


class _World:
    """A task whose variables tell what is true."""

    def __init__(
        self, task: Task, root: Node, parts: Sequence[int], names: ObservationNames, limits: Limits
    ) -> None:
        self._task, self._parts, self._names, self._limits = task, parts, names, limits
        self._actions = sorted({node.action for node in actions_of(root)})
        changed = {change.component for name in self._actions for change in changes_of(task, name)}
        word = _TRUE
        while any(variable.predicate.startswith(f"{word} ") for variable in task.variables):
            word += "-"
        self._first: dict[int, int] = {}
        """Where the facts of a component stand among the variables."""
        self._variables = list(task.variables)
        for component in sorted(changed.union(parts)):
            self._first[component] = len(self._variables)
            for fact in task.components[component].facts:
                predicate, args = split_name(fact)
                self._variables.append(Variable(f"{word} {predicate}", args, three_valued=False))

    def task(self) -> Task:
        """The task, with the actions of the tree."""
        more = (Truth.FALSE,) * (len(self._variables) - len(self._task.variables))
        return replace(
            self._task,
            variables=tuple(self._variables),
            initial=tuple(replace(state, values=(*state.values, *more)) for state in self._task.initial),
            actions=tuple(self._action(self._task.action_by_name[name]) for name in self._actions),
            templates=(),
            components=(),
            origin=None,
        )

    def priors(self) -> Iterator[tuple[Sets, ...]]:
        """What may be true at the start: for each component, or, where the problem gives several worlds in
        which components differ, for these together."""
        given = [[each or {} for each in worlds] for worlds in given_worlds(self._task)]
        together = []
        for component in self._first:
            if self._walked(component):
                continue
            every = [each[component] for each in given] or [dict(self._task.components[component].prior)]
            if any(each != every[0] for each in every):
                together.append(component)
            else:
                yield tuple(self._sets({component: world}, p) for world, p in every[0].items() if p)
        if together:
            ways = (prod(len(each[component]) for component in together) for each in given)
            self._limits.check_states(sum(ways), "writing down what is true")
            drawn = distribution(
                (worlds, p / len(given))
                for each in given
                for worlds, p in independent([each[component] for component in together])
            )
            yield tuple(
                self._sets(dict(zip(together, worlds, strict=True)), p) for worlds, p in drawn.items()
            )

    def _sets(self, worlds: Mapping[int, int], probability: Fraction) -> Sets:
        """The facts of some components as in their worlds."""
        return Sets(
            probability,
            tuple(
                (self._first[component] + bit, Truth.of(bool(world >> bit & 1)))
                for component, world in worlds.items()
                for bit in range(len(self._task.components[component].facts))
            ),
        )

    def walks(self) -> Iterator[Walk]:
        """The same of the others."""
        for component, first in self._first.items():
            diagram = self._task.components[component].diagram
            if diagram is not None and self._walked(component):
                yield _walk(diagram, first)

    def _walked(self, component: int) -> bool:
        """Is it drawn from a diagram what is true of a component?"""
        given = given_worlds(self._task)
        listed = self._task.components[component].diagram is None
        return not listed and (not given or any(each[component] is None for each in given))

    def tellings(self) -> Iterator[Telling]:
        """What the actions tell."""
        for action in (FIRST, *self._actions):
            for change in changes_of(self._task, action):
                if change.component not in self._parts:
                    continue
                names = self._names.of(action, change.component)
                for name, observation in zip(names, change.observations, strict=True):
                    when = None if observation.when is None else self._moved(observation.when, change)
                    condition = self._moved(observation.condition, change)
                    told = Observation(condition, observation.accuracy, when)
                    if observation.accuracy_false is None:
                        yield Telling(action, name, told)
                        continue
                    # Two, of which one is made.
                    whether = TRUE if when is None else when
                    yield Telling(action, name, replace(told, when=conjunction([whether, condition])))
                    otherwise = conjunction([whether, negation(condition)])
                    accuracy = observation.accuracy_false
                    yield Telling(action, name, replace(told, accuracy=accuracy, when=otherwise))

    def _action(self, action: GroundAction) -> GroundAction:
        factors = [factor for factor in action.factors if factor != NO_CHANGE]
        factors += [
            self._factor(factor, change)
            for change in action.changes
            for factor in change.factors
            if factor != NO_CHANGE
        ]
        return replace(action, factors=tuple(factors) or (NO_CHANGE,), changes=())

    def _factor(self, factor: Factor, change: Change) -> Factor:
        return replace(factor, outcomes=tuple(self._outcome(outcome, change) for outcome in factor.outcomes))

    def _outcome(self, outcome: Outcome, change: Change) -> Outcome:
        effects = (
            Effect(
                None if effect.when is None else self._moved(effect.when, change),
                tuple((self._place(variable, change), value) for variable, value in effect.sets),
            )
            for effect in outcome.effects
        )
        charges = (
            Charge(self._moved(charge.when, change), charge.cost, charge.reward) for charge in outcome.charges
        )
        return replace(
            outcome,
            effects=tuple(effects),
            factors=tuple(self._factor(factor, change) for factor in outcome.factors),
            charges=tuple(charges),
        )

    def _moved(self, condition: Condition, change: Change) -> Condition:
        return replaced(condition, lambda leaf: replace(leaf, variable=self._place(leaf.variable, change)))

    def _place(self, variable: int, change: Change) -> int:
        """The variable that is the local one of a change."""
        facts = len(self._task.components[change.component].facts)
        return self._first[change.component] + variable if variable < facts else change.seen[variable - facts]


def _walk(diagram: Diagram, first: int) -> Walk:
    """How the facts of a component are drawn, whose variables stand from ``first`` on."""
    diagrams = Diagrams(diagram.order, len(diagram.nodes) + 2)
    diagrams.read(diagram)
    turns = tuple(
        Turn(level, chance, *(to - 2 if to > ONE else -1 for to in ends))
        for level, chance, ends in diagrams.turns()
    )
    return Walk(tuple(first + place for place in diagram.order), turns)
