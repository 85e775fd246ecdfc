"""Runs of a tree in a world whose facts change by chance, and what came of them.

Before every tick, the first one included, one change happens with a given probability
(:meth:`bbtc.planner.changing_facts.ChangingFacts.changes`). Then the root is ticked; if it starts an action,
one of its outcomes applies before the next change. The rules of a tick are those of the exact simulation.
"""

from __future__ import annotations

import enum
import itertools
import math
import random
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction

from bbtc.belief.draws import Values
from bbtc.belief.hidden import chance_of
from bbtc.belief.state import initial_belief
from bbtc.belief.tick import STARTED, NodeStatus, compile_tick, memory_of
from bbtc.disturbance.execution import careful_actions
from bbtc.disturbance.intervals import Interval, wilson
from bbtc.ground.condition import compile_condition
from bbtc.ground.task import GroundAction, Task, charges_of, outcomes_of
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.changing_facts import ChangingFacts
from bbtc.tree.nodes import Node, actions_of

RUNS = 10_000
"""Runs unless somebody says otherwise."""
MOST_TICKS = 1_000
"""Ticks after which a run is cut off, unless somebody says otherwise."""

_BITS = 64  # of each draw
_MOST_KEPT = 200_000  # states of which it is remembered what they lead to
_DOING = "the perturbed runs"


class Draw:
    """Draws from a finite distribution by 64 bits, exactly but for a part in 2 to the 64th."""

    __slots__ = ("_bounds", "_count")

    def __init__(self, chances: Iterable[Fraction]) -> None:
        ratios = [chance.as_integer_ratio() for chance in chances]
        scale = math.lcm(*(denominator for _, denominator in ratios))
        sums = itertools.accumulate(numerator * (scale // denominator) for numerator, denominator in ratios)
        self._bounds = [-((-total << _BITS) // scale) for total in sums]  # thresholds, rounded up
        self._count = len(self._bounds)

    def __call__(self, bits: int) -> int:
        """The number that 64 random bits stand for."""
        return min(bisect_right(self._bounds, bits), self._count - 1)


def bits_of(seed: int, run: int) -> Callable[[], int]:
    """The source of chance of one run, 64 bits a call: one for the start, one before each tick, one more for
    a change, and one for each action. Each run has its own, so that any can be made alone, here or in an
    engine."""
    draw = random.Random(f"perturb:{seed}:{run}").getrandbits
    return lambda: draw(_BITS)


def threshold(rate: Fraction) -> int:
    """64 random bits are below it with this probability."""
    return math.ceil(rate * (1 << _BITS))


@dataclass(frozen=True, slots=True)
class PerturbedRuns:
    """What came of the runs of a tree in a disturbed world. Every run is one of ``successes`` (the root
    succeeded and the goal was true in that tick), ``missed`` (the root succeeded without the goal),
    ``failures``, ``blocked`` and ``cut`` (``most_ticks`` ticks were made).

    ``starts`` are all starts of actions, of which ``unready`` were without their precondition; ``changes``
    are those of the world. ``cost`` and ``actions`` are means over all runs, ``cost_given_success`` over
    those that are successes (None: there are none). ``interval`` is the 95 % confidence interval of the
    success probability. Of the ``facts`` that may change, some move in so many ``groups``."""

    rate: Fraction
    runs: int
    seed: int
    most_ticks: int
    successes: int
    missed: int
    failures: int
    blocked: int
    cut: int
    starts: int
    unready: int
    changes: int
    cost: Fraction
    cost_given_success: Fraction | None
    actions: Fraction
    interval: Interval
    facts: int
    groups: int

    @property
    def success(self) -> Fraction:
        """The share of successes."""
        return Fraction(self.successes, self.runs)


class _Ending(enum.Enum):
    SUCCESS = "success"
    MISSED = "missed"
    FAILURE = "failure"
    BLOCKED = "blocked"
    CUT = "cut"


_ENDINGS = {
    (NodeStatus.SUCCESS, True): _Ending.SUCCESS,
    (NodeStatus.SUCCESS, False): _Ending.MISSED,
    (NodeStatus.FAILURE, False): _Ending.FAILURE,
    (NodeStatus.RUNNING, False): _Ending.BLOCKED,
}
"""How a run ended, by the root's status and whether the goal was true where that is success."""


_NOTHING = Draw(())


class _Node:
    """A state in which the tree is ticked, and what may come next. ``status`` is the root's; of a started
    action ``draw`` and ``next`` say what it leads to, and ``costs`` at what scaled cost; of an end ``won`` is
    how probably the goal is true."""

    __slots__ = ("change", "changed", "costs", "draw", "memory", "next", "ready", "status", "values", "won")

    def __init__(self, values: Values, memory: int) -> None:
        self.values, self.memory = values, memory
        self.change: Draw | None = None
        self.changed: list[_Node] = []
        self.status = -1
        self.ready, self.won = False, Fraction(0)
        self.draw = _NOTHING
        self.next: list[_Node] = []
        self.costs: list[Fraction | int] = []


class _Sampler:
    """Runs with everything that depends on the state alone worked out once."""

    def __init__(self, task: Task, root: Node, facts: ChangingFacts, limits: Limits) -> None:
        self.limits = limits
        self._facts = facts
        self._tick = compile_tick(task, root)
        self._goal = _goal_of(task)
        actions = [task.action_by_name[node.action] for node in actions_of(root)]
        self._ready = [compile_condition(action.precondition) for action in actions]
        careful = careful_actions(task, root, limits)
        self._run = [careful[action.name] for action in actions]
        self._memory = memory_of(root)
        self.scale = math.lcm(1, *(cost.denominator for action in actions for cost in _costs(action)))
        self._nodes: dict[tuple[Values, int], _Node] = {}
        self._after: dict[Values, tuple[Draw, list[Values]]] = {}
        self._outcome: dict[tuple[int, Values], tuple[Draw, list[Fraction | int], list[Values]]] = {}
        belief = list(initial_belief(task).items())
        self.start = Draw(chance for _, chance in belief)
        self._starts = [values for values, _ in belief]

    def starts(self) -> list[_Node]:
        """The nodes of the initial states. What is remembered is forgotten where it has become too much."""
        if len(self._nodes) > _MOST_KEPT or len(self._after) > _MOST_KEPT:
            self._nodes.clear()
            self._after.clear()
            self._outcome.clear()
        return [self._node(values, 0) for values in self._starts]

    def _node(self, values: Values, memory: int) -> _Node:
        key = (values, memory)
        found = self._nodes.get(key)
        if found is None:
            found = self._nodes[key] = _Node(values, memory)
            if len(self._nodes) % 256 == 0:
                self.limits.check_time(_DOING)
        return found

    def ticked(self, node: _Node) -> int:
        """The root's status in a state that is ticked for the first time."""
        status = node.status = self._tick(node.values, node.memory)
        if status == NodeStatus.SUCCESS:
            node.won = self._goal(node.values)
        if status >= STARTED:
            action = self._memory.action(status)
            node.ready = self._ready[action](node.values) == Truth.TRUE
            node.draw, node.costs, after = self._outcomes(action, node.values)
            memory = self._memory.after(node.memory, status)
            node.next = [self._node(values, memory) for values in after]
        return status

    def _outcomes(self, action: int, state: Values) -> tuple[Draw, list[Fraction | int], list[Values]]:
        """What an action may lead to, and at what scaled cost; whatever the tree remembers."""
        key = (action, state)
        found = self._outcome.get(key)
        if found is None:
            results = self._run[action](state)
            draw = Draw(result.probability for result in results)
            scaled = [result.cost * self.scale for result in results]
            costs = [int(cost) if cost.denominator == 1 else cost for cost in scaled]  # these are quick
            found = self._outcome[key] = draw, costs, [result.values for result in results]
        return found

    def changes(self, node: _Node) -> Draw:
        """What a change may do in a state that meets one for the first time."""
        if node.values not in self._after:
            found = self._facts.changes(node.values)
            self._after[node.values] = Draw(chance for chance, _ in found), [after for _, after in found]
        node.change, after = self._after[node.values]
        node.changed = [self._node(values, node.memory) for values in after]
        return node.change


def perturbed_runs(
    task: Task,
    root: Node,
    rate: Fraction,
    limits: Limits,
    *,
    runs: int = RUNS,
    seed: int = 0,
    most_ticks: int = MOST_TICKS,
) -> PerturbedRuns:
    """Run a tree so often in a world in which something changes before each tick with probability ``rate``.
    The same seed gives the same result.

    Raises :class:`ValueError` for a rate outside [0, 1], and for less than one run or tick;
    :class:`bbtc.diagnostics.LimitReached` when the time is over.
    """
    if not 0 <= rate <= 1:
        raise ValueError(f"the rate {rate} is not between 0 and 1")
    if runs < 1 or most_ticks < 1:
        raise ValueError("there must be at least one run of at least one tick")
    # What is hidden stays as the model has it, and with it what is believed: exactly right, since the robot
    # sees all that others change.
    hidden = (number for number, variable in enumerate(task.variables) if variable.hidden)
    facts = ChangingFacts.of(task, limits).but(hidden)
    sampler = _Sampler(task, root, facts, limits)
    below = threshold(rate)
    count = dict.fromkeys(_Ending, 0)
    starts = unready = changes = 0
    cost: Fraction | int = 0
    won_cost: Fraction | int = 0
    for run in range(runs):
        if run % 64 == 0:
            limits.check_time(_DOING, run)
        bits = bits_of(seed, run)
        first = sampler.starts()
        node, ending = first[sampler.start(bits())], _Ending.CUT
        own: Fraction | int = 0
        for _ in range(most_ticks):
            if bits() < below:
                draw = node.change or sampler.changes(node)
                number = draw(bits())
                if node.changed:
                    node = node.changed[number]
                    changes += 1
            status = node.status if node.status >= 0 else sampler.ticked(node)
            if status < STARTED:
                won = node.won == 1 or (node.won > 0 and bits() < threshold(node.won))
                ending = _ENDINGS[NodeStatus(status), won]
                break
            starts += 1
            unready += not node.ready
            number = node.draw(bits())
            own += node.costs[number]
            node = node.next[number]
        count[ending] += 1
        cost += own
        won_cost += own if ending is _Ending.SUCCESS else 0
    successes = count[_Ending.SUCCESS]
    return PerturbedRuns(
        rate=rate,
        runs=runs,
        seed=seed,
        most_ticks=most_ticks,
        successes=successes,
        missed=count[_Ending.MISSED],
        failures=count[_Ending.FAILURE],
        blocked=count[_Ending.BLOCKED],
        cut=count[_Ending.CUT],
        starts=starts,
        unready=unready,
        changes=changes,
        cost=Fraction(cost) / (sampler.scale * runs),
        cost_given_success=Fraction(won_cost) / (sampler.scale * successes) if successes else None,
        actions=Fraction(starts, runs),
        interval=wilson(successes, runs),
        facts=sum(len(each.variables) for each in facts.movables),
        groups=sum(len(each.variables) > 1 for each in facts.movables),
    )


def _goal_of(task: Task) -> Callable[[Values], Fraction]:
    """How probable it is in a state that the goal is true."""
    if task.components:
        return lambda values: chance_of(task, task.goal, values)
    goal = compile_condition(task.goal)
    return lambda values: Fraction(goal(values) == Truth.TRUE)


def _costs(action: GroundAction) -> Iterator[Fraction]:
    """Everything that a start of an action may add to the cost."""
    yield action.cost
    yield from (outcome.cost for outcome in outcomes_of(action.factors))
    yield from (charge.cost for charge in charges_of(action.factors))
