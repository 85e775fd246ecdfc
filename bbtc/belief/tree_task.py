"""A task without hidden facts that the runs of a tree cannot tell from its own.

What is believed of each component, as far as the runs lead, is written down as variables; what an action
does then is a table: from what is believed and seen before it to what may be told. Programs that know nothing
of worlds run, export and check the tree by it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from bbtc.belief.chain import Chain, explore
from bbtc.belief.draws import PLACES, Draw, Values, unbounded
from bbtc.belief.hidden import case_of, compile_change, number_in, place_of
from bbtc.ground.condition import TRUE, Condition, Is, conjunction
from bbtc.ground.task import (
    NO_CHANGE,
    Change,
    Charge,
    Effect,
    Factor,
    GroundAction,
    InitialState,
    Outcome,
    Task,
    Variable,
    unused_name,
)
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.markov import distribution
from bbtc.tree.nodes import Node

_NAME = "belief"


def tree_task(task: Task, root: Node, limits: Limits) -> Task:
    """The task for the runs of one tree: with its actions, and nothing hidden. Raises
    :class:`bbtc.diagnostics.LimitReached`."""
    if not task.components:
        return task
    chain = explore(task, root, limits)
    codes = _codes(task, chain)
    starts = distribution((_coded(task, codes, chain.states[at].values), p) for p, at in chain.initial)
    made = _Tables(task, codes, chain, limits)
    named = {node.action for node in chain.actions}  # some may never be started
    return replace(
        task,
        variables=(*task.variables, *(variable for code in codes for variable in code.variables)),
        initial=tuple(InitialState(p, tuple(map(Truth, values))) for values, p in starts.items()),
        actions=tuple(made.action(action) for action in task.actions if action.name in named),
        templates=(),
        components=(),
    )


@dataclass(frozen=True, slots=True)
class _Code:
    """What is believed of a component, by number, as bits: the values of ``variables``, which stand in the
    task of the tree from ``first`` on."""

    by_number: Mapping[int, int]
    first: int
    variables: tuple[Variable, ...]

    def sets(self, number: int) -> tuple[tuple[int, Truth], ...]:
        """The values of the variables for a belief."""
        code = self.by_number[number]
        return tuple(
            (self.first + bit, Truth.TRUE if code >> bit & 1 else Truth.FALSE)
            for bit in range(len(self.variables))
        )


def _codes(task: Task, chain: Chain) -> list[_Code]:
    """Codes for all beliefs that a chain has. They do not depend on the numbers of beliefs, but on the order
    of the chain."""
    name = unused_name(_NAME, {variable.predicate for variable in task.variables})
    codes: list[_Code] = []
    first = len(task.variables)
    for component in range(len(task.components)):
        met = dict.fromkeys(number_in(task, state.values, component) for state in chain.states)
        variables = tuple(
            Variable(name, (str(component + 1), str(bit + 1)), three_valued=False)
            for bit in range((len(met) - 1).bit_length())
        )
        codes.append(_Code({number: code for code, number in enumerate(met)}, first, variables))
        first += len(variables)
    return codes


def _coded(task: Task, codes: Sequence[_Code], values: Values) -> Values:
    """The values of a state in the task of the tree."""
    found = values[: len(task.variables)]
    for component, code in enumerate(codes):
        found += bytes(value for _, value in code.sets(number_in(task, values, component)))
    return found


class _Tables:
    """Actions as tables."""

    def __init__(self, task: Task, codes: Sequence[_Code], chain: Chain, limits: Limits) -> None:
        self._task, self._codes, self._limits = task, codes, limits
        self._asked: dict[str, dict[Values, None]] = {}
        """By action: the states it is started in."""
        for state, number in zip(chain.states, chain.action, strict=True):
            if number >= 0:
                self._asked.setdefault(chain.actions[number].action, {})[state.values] = None

    def action(self, action: GroundAction) -> GroundAction:
        """An action with its changes as factors."""
        if not action.changes:
            return action
        factors = [factor for factor in action.factors if factor != NO_CHANGE]
        for change in action.changes:
            factors += self._factors(change, self._asked.get(action.name, {}))
        return replace(action, factors=tuple(factors) or (NO_CHANGE,), changes=())

    def _factors(self, change: Change, states: Iterable[Values]) -> Iterator[Factor]:
        """One factor for all that is certain, and one for each belief, and what is seen, that leaves open
        what will be told."""
        draw = compile_change(self._task, change, unbounded)
        code = self._codes[change.component]
        certain: list[Effect] = []
        charges: list[Charge] = []
        done: set[tuple[int, bytes]] = set()
        for values in states:
            self._limits.check_time("writing down what is believed")
            case = number, seen = case_of(self._task, change, values)
            if case in done:
                continue
            done.add(case)
            sees = ((variable, Truth(value)) for variable, value in zip(change.seen, seen, strict=True))
            when = conjunction(Is(variable, value) for variable, value in (*code.sets(number), *sees))
            drawn = draw(values)
            if len(drawn) > 1:
                parts = ((p, *self._told(change, when, each)) for each, p in drawn.items())
                yield Factor(tuple(Outcome(p, (effect,), charges=added) for p, effect, added in parts))
            else:
                effect, added = self._told(change, when, next(iter(drawn)))
                certain.append(effect)
                charges += added
        if certain:
            yield Factor((Outcome(Fraction(1), tuple(certain), charges=tuple(charges)),))

    def _told(self, change: Change, when: Condition, draw: Draw) -> tuple[Effect, tuple[Charge, ...]]:
        """What one outcome does under a condition, and what it adds to cost and reward."""
        delta, cost, reward = draw
        first = place_of(self._task, change.component)
        number = int.from_bytes([value for place, value in delta if first <= place < first + PLACES], "big")
        sets = [(place, Truth(value)) for place, value in delta if place < len(self._task.variables)]
        effect = Effect(None if when == TRUE else when, (*sets, *self._codes[change.component].sets(number)))
        return effect, (Charge(when, cost, reward),) if cost or reward else ()
