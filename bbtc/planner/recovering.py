"""Rules for every state that actions lead to, or others may, and not only for those that a plan visits.

1. All states that any actions lead to are explored, and what one change
   (:mod:`bbtc.planner.changing_facts`) and any actions make of some of them.
2. P* and the least cost V are found for all of them.
3. A state that runs visit may take the choices that attain V, as in :mod:`bbtc.planner.synthesis.permissive`;
   any other one those that attain P* and cost little more, since that costs the runs nothing.
4. Rules are learnt one by one, as in :mod:`bbtc.planner.synthesis.rules`, but for their guards: an action
   reads its precondition by itself, so a rule tells apart only states in which that is not false, and most
   rules need no test at all. What a rule decides must leave a way to the goal from everywhere; choices that
   would not are given up. States that no run visits any more are free to take what is near enough.
5. Where runs end since nothing leads to the goal any more, rules must not go on. Either each of them tells
   such states apart, or one condition before them all does, whichever takes fewer nodes.
6. Last come rules for states without hope that only others lead to: an action, if possible one that the tree
   has, is tried until others have put things right.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from bbtc.belief.draws import Values
from bbtc.belief.state import initial_belief
from bbtc.diagnostics import LimitReached
from bbtc.ground.condition import (
    FALSE,
    TRUE,
    Condition,
    conjunction,
    conjuncts,
    disjunction,
    negation,
)
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.changing_facts import ChangingFacts
from bbtc.planner.elsewhere import MOST_VISITED, also_at, changed, spread
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.graph import draw_probabilities, sums
from bbtc.planner.mdp.maxprob import Bounds, MaxProb, max_prob
from bbtc.planner.mdp.packing import Flags, bit_test, holds
from bbtc.planner.mdp.ssp import least_cost
from bbtc.planner.mdp.state_space import StateSpace
from bbtc.planner.mdp.transitions import Index
from bbtc.planner.strong_cyclic.rules import certainly
from bbtc.planner.strong_cyclic.sharing import Guarded, factored
from bbtc.planner.synthesis.rules import Literal, Stated, literals_of, rule_size, separating
from bbtc.rewrite.simplify import numbered, size
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node

_NEAR = 1.5
"""A choice off the way may lead to where V is by so much of its own cost more than it should be."""

_FALLING = 0.95
"""Choices that lead to where V is at most so much too high get on in any case: expected cost falls."""

_CLOSE = 1e-9

_LITTLE = Fraction(1, 1000)
"""What an action without cost counts as, of the least cost there is."""

_FEW_STATES = 2_000
"""Where there are no more, all that may change is looked at in each of them, again and again."""


@dataclass(frozen=True, slots=True)
class Recovering:
    """A tree of the least expected cost among those of the best success probability, which is in ``bounds``.
    It does what it can from every state that was looked at; ``everywhere``: these are all that any actions
    and any changes lead to."""

    root: Node
    bounds: Bounds
    everywhere: bool


def recovering_tree(task: Task, limits: Limits, *, everywhere: bool = False) -> Recovering | None:
    """A tree that does what it can from anywhere; None where costs are not known. Raises ``LimitReached``,
    and with ``everywhere`` also where not all states are looked at."""
    space, all_of_them = _wide_space(task, limits, everywhere=everywhere)
    found = max_prob(space, limits)
    choices = _choices(found, limits)
    if choices is None:
        return None
    trees = []
    for apart in (False, True):
        learner = _Learner(task, found, choices, limits, apart=apart)
        trees.append(_tree(task, learner.stated_ends(), list(learner.deciding()), learner.waiting()))
        if not learner.stuck.any():
            break
    return Recovering(min(trees, key=size), found.initial, all_of_them)


def _wide_space(task: Task, limits: Limits, *, everywhere: bool) -> tuple[StateSpace, bool]:
    """All that any actions lead to, also behind the goal and from where others may leave some states, all of
    them if they are few; is that everything? Choices of goal states are left out. Raises ``LimitReached``."""
    endless = replace(task, goal=FALSE)
    space = _whole(endless, limits)
    facts = ChangingFacts.of(task, limits)
    own = initial_belief(task)
    wider, all_of_them = endless, False
    looked_at: set[Values] = set()
    while True:
        states = space.packing.values(space.states)
        few = len(states) <= _FEW_STATES
        known = set(states)
        # What the others may become was found to be known before.
        fresh = [values for values in states if values not in looked_at]
        starts = changed(facts, fresh if few else spread(states, MOST_VISITED), limits)
        looked_at = known
        new = [tuple(map(Truth, values)) for values in starts if values not in known]
        if not new:
            all_of_them = few
            break
        wider = also_at(endless, [*[each.values for each in wider.initial[len(endless.initial) :]], *new])
        try:
            space = _whole(wider, limits)
        except LimitReached:
            if everywhere:
                raise
            limits.check_time("the search for a tree that recovers")
            break
        if not few:
            break
    numbers = dict(zip(initial_belief(wider), (number for _, number in space.initial), strict=False))
    goal = holds(space.packing, bit_test(space.packing, task.goal), space.states)
    kept = ~goal[space.choice_state]
    edges = kept[space.edge_choice]
    wide = replace(
        space,
        task=task,
        goal=goal,
        choice_state=space.choice_state[kept],
        choice_action=space.choice_action[kept],
        edge_choice=(np.cumsum(kept) - 1)[space.edge_choice[edges]].astype(np.int32),
        edge_successor=space.edge_successor[edges],
        edge_draw=space.edge_draw[edges],
        initial=tuple((probability, numbers[values]) for values, probability in own.items()),
    )
    return wide, all_of_them


def _whole(task: Task, limits: Limits) -> StateSpace:
    space = explore_space(task, limits)
    space.require_complete()
    return space


@dataclass(frozen=True, slots=True)
class _Choices:
    """Choices that attain the least cost (``best``), all that are ``near`` enough elsewhere, and of these the
    ones after which the expected cost falls."""

    best: Flags
    near: Flags
    falling: Flags


def _choices(found: MaxProb, limits: Limits) -> _Choices | None:
    cheapest = least_cost(found, limits)
    if cheapest is None:
        return None
    best, space = cheapest.best, found.space
    costs = [draw.cost for draw in space.draws]
    if not all(costs):
        # What costs nothing could go on for ever: of equally cheap choices, those of the fewest actions.
        narrowed = replace(found, policy=cheapest.policy, best=best)
        cheapest = least_cost(narrowed, limits, [Fraction(1)] * len(costs))
        assert cheapest is not None
        best = cheapest.best
        least = min((cost for cost in costs if cost > 0), default=Fraction(1)) * _LITTLE
        costs = [cost or least for cost in costs]
        cheapest = least_cost(found, limits, costs)
        assert cheapest is not None
    count = len(space.choice_action)
    weight = draw_probabilities(space)
    rates = np.array([float(cost) for cost in costs] or [0.0])
    own = sums(space.edge_choice, weight * rates[space.edge_draw], count)
    onward = sums(space.edge_choice, weight * cheapest.values[space.edge_successor], count)
    values = cheapest.values[space.choice_state]
    more = own + onward - values - _CLOSE * (1 + values)
    return _Choices(best, found.best & (more <= _NEAR * own), found.best & (more <= _FALLING * own))


@dataclass(frozen=True, slots=True)
class _Rule:
    """Start ``action`` (its number in the task) where its precondition and all of ``tests`` hold."""

    tests: tuple[int, ...]
    action: int


class _Learner:
    """Finds the rules."""

    def __init__(self, task: Task, found: MaxProb, choices: _Choices, limits: Limits, *, apart: bool) -> None:
        self.task, self.choices, self.limits = task, choices, limits
        self.graph, self.space = found.graph, found.space
        space = found.space
        self.hopeful = ~found.prob_0 & ~space.goal
        self._hoping = self.hopeful[space.choice_state]
        values = space.packing.unpack(space.states)
        self.literals = literals_of(values)
        self.stated = Stated(task, self.literals)
        columns = [literal.holds(values) for literal in self.literals]
        self.holds = np.array(columns, dtype=np.bool_).T.reshape(len(values), len(columns))
        self.given_up = np.zeros(len(space.choice_action), dtype=np.bool_)
        self.decided = np.full(len(values), -1, dtype=np.int64)
        """The action of each state that a rule decides."""
        self.undecided = self.hopeful.copy()
        self.rules: list[_Rule] = []
        self._starts: dict[int, Flags] = {}
        self.stuck = self._stuck(self._visited())
        """Where runs may end without the goal."""
        self.ends = self._ending() if apart else []
        """Tests of which some hold where rules are not asked."""
        self.asked = np.ones(len(values), dtype=np.bool_)
        for tests in self.ends:
            self.asked &= ~self.holds[:, tests].all(axis=1)

    def _stuck(self, visited: Flags) -> Flags:
        return visited & ~self.hopeful & ~self.space.goal

    def _ending(self) -> list[tuple[int, ...]]:
        """Conjunctions of which some hold in each state in which runs end, and none where there is hope."""
        left, found = self.stuck.copy(), []
        while left.any():
            tests = separating(self.holds[left], self.holds[self.hopeful], np.zeros(len(self.literals)))
            left &= ~self.holds[:, tests].all(axis=1)
            found.append(tuple(tests))
        return found

    # --- what may be chosen where -----------------------------------------------------------------

    def _taken(self, decided: npt.NDArray[np.int64], free: Flags) -> Flags:
        """The choices that are taken, and where nothing is decided, those that are free."""
        own = decided[self.space.choice_state]
        taken: Flags = np.where(own >= 0, self.space.choice_action == own, free)
        return taken & self._hoping

    def _free(self, visited: Flags) -> Flags:
        """The choices that may be taken where nothing is decided, and runs visit some states."""
        fit = np.where(visited[self.space.choice_state], self.choices.best, self.choices.near)
        free: Flags = fit & ~self.given_up
        return free

    def _visited(self) -> Flags:
        """The states that runs may visit."""
        taken = self._taken(self.decided, self.choices.best)
        found = np.zeros(len(self.decided), dtype=np.bool_)
        found[self.space.closure(self.space.start, taken)] = True
        return found

    def _may_start(self, action: int) -> Flags:
        """Where an action's precondition is not false: unknown, it would be waited for."""
        if action not in self._starts:
            prevented = bit_test(self.space.packing, self.task.actions[action].precondition, False)
            self._starts[action] = ~holds(self.space.packing, prevented, self.space.states)
        return self._starts[action]

    # --- rules ------------------------------------------------------------------------------------

    def deciding(self) -> Iterator[tuple[tuple[Literal, ...], int]]:
        """The rules that lead to the goal."""
        visited = self._visited()
        before: Flags | None = None
        while True:
            self.limits.check_time("the search for a tree that recovers")
            free = self._free(visited)
            taken = self._taken(self.decided, free)
            found = self._best(taken, self._stuck(visited) & self.asked)
            if found is None:
                return
            rule, covered = found
            decided = self.decided.copy()
            decided[covered] = rule.action
            if before is None:
                before = self._getting_on(taken)
            after = self._getting_on(self._taken(decided, free))
            if self._given_up(rule.action, covered, before & ~after):
                before = None
                continue
            self.decided = decided
            self.undecided[covered] = False
            visited, last = self._visited(), visited
            before = after if (visited == last).all() else None
            self.rules.append(rule)
            yield self._stated(rule)

    def _getting_on(self, taken: Flags) -> Flags:
        """The states from which choices may lead to the goal."""
        return self.graph.reach(self.space.goal, taken).found

    def _given_up(self, action: int, covered: Index, lost: Flags) -> bool:
        """Give up choices of an action that would leave some states without a way; are there any?"""
        if not lost.any():
            return False
        culprits = np.zeros(len(lost), dtype=np.bool_)
        culprits[covered[lost[covered]] if lost[covered].any() else covered] = True
        own = culprits[self.space.choice_state] & (self.space.choice_action == action) & ~self.given_up
        roundabout = own & ~self.choices.falling
        self.given_up |= roundabout if roundabout.any() else own
        return bool(own.any())

    def _best(self, taken: Flags, stuck: Flags) -> tuple[_Rule, Index] | None:
        """The rule that decides most states for its size, and these."""
        open_choices = taken & self.undecided[self.space.choice_state]
        best: tuple[tuple[float, int], _Rule, Index] | None = None
        for action in np.unique(self.space.choice_action[open_choices]).tolist():
            able = np.zeros(len(stuck), dtype=np.bool_)
            able[self.space.choice_state[open_choices & (self.space.choice_action == action)]] = True
            against = (self.undecided & ~able | stuck) & self._may_start(action)
            wanted, others = np.flatnonzero(able), np.flatnonzero(against)
            at_best = (-len(wanted) / 3, 1) if len(others) else (-float(len(wanted)), 0)
            if best is not None and best[0] <= at_best:
                continue
            tests = separating(self.holds[wanted], self.holds[others], self.stated.by(action))
            covered = wanted[self.holds[wanted][:, tests].all(axis=1)]
            key = (-len(covered) / rule_size(tests), len(tests))
            if best is None or key < best[0]:
                best = key, _Rule(tuple(tests), action), covered
        return None if best is None else best[1:]

    def waiting(self) -> list[tuple[tuple[Literal, ...], int]]:
        """Rules for states without hope that no run visits; first of actions that the tree has."""
        visited = self._visited()
        stuck = self._stuck(visited)
        idle = ~self.hopeful & ~self.space.goal & ~visited
        for rule in self.rules:
            idle &= ~(self.asked & self._applies(rule))
        rules: list[_Rule] = []
        left = idle.copy()
        used = {rule.action for rule in self.rules}
        for actions in (sorted(used), [a for a in range(len(self.task.actions)) if a not in used]):
            while True:
                found = self._best_wait(actions, left, stuck)
                if found is None:
                    break
                rule, covered = found
                left &= ~covered
                rules.append(rule)
        for rule in list(rules):  # what later ones made needless
            covered = np.zeros(len(idle), dtype=np.bool_)
            for other in rules:
                if other is not rule:
                    covered |= self._applies(other)
            if not (idle & ~left & ~covered).any():
                rules.remove(rule)
        return [self._stated(rule) for rule in rules]

    def _applies(self, rule: _Rule) -> Flags:
        """Where a rule has its action started, if it is asked."""
        found: Flags = self.holds[:, rule.tests].all(axis=1) & self._may_start(rule.action)
        return found

    def _best_wait(self, actions: list[int], idle: Flags, stuck: Flags) -> tuple[_Rule, Flags] | None:
        best: tuple[float, _Rule, Flags] | None = None
        for action in actions:
            wanted = idle & self._may_start(action)
            if not wanted.any():
                continue
            others = self.holds[stuck & self._may_start(action)]
            tests = separating(self.holds[wanted], others, self.stated.by(action))
            covered = wanted & self.holds[:, tests].all(axis=1)
            key = -int(covered.sum()) / rule_size(tests)
            if best is None or key < best[0]:
                best = key, _Rule(tuple(tests), action), covered
        return None if best is None else best[1:]

    def stated_ends(self) -> list[tuple[Literal, ...]]:
        """The same as literals."""
        return [tuple(self.literals[test] for test in tests) for tests in self.ends]

    def _stated(self, rule: _Rule) -> tuple[tuple[Literal, ...], int]:
        return tuple(self.literals[test] for test in rule.tests), rule.action


_Stated: TypeAlias = tuple[tuple[Literal, ...], int]
"""Start an action where these hold."""


def _tree(task: Task, ends: list[tuple[Literal, ...]], rules: list[_Stated], waiting: list[_Stated]) -> Node:
    """The rules as a tree, the first of them only where none of ``ends`` holds. Nothing that is read is ever
    unknown, but for an action's precondition."""
    goal = ConditionNode("", certainly(task, task.goal))
    last = _merged([_guarded(task, rule) for rule in waiting])
    if not ends or not rules:
        branches = factored(task, [*[_guarded(task, rule) for rule in rules], *last])
    else:
        going_on = conjunction(
            negation(conjunction(certainly(task, literal.condition) for literal in tests)) for tests in ends
        )
        inner = factored(task, [_guarded(task, rule) for rule in rules])
        first = inner[0] if len(inner) == 1 else ControlNode("", "fallback", tuple(inner))
        branches = [ControlNode("", "sequence", (ConditionNode("", going_on), first))]
        branches += factored(task, last)
    return numbered(ControlNode("", "fallback", (goal, *branches)) if branches else goal)


def _guarded(task: Task, rule: _Stated) -> Guarded:
    tests, number = rule
    action = task.actions[number]
    node = ActionNode("", action.name, latched=False, guarded=action.precondition != TRUE)
    needed = [certainly(task, literal.condition) for literal in tests]
    return tuple(part for each in needed for part in conjuncts(each)), node


def _merged(rules: list[Guarded]) -> list[Guarded]:
    """Rules whose order does not matter, one for each action."""
    needed: dict[ActionNode, list[Condition]] = {}
    for guards, action in rules:
        needed.setdefault(action, []).append(conjunction(guards))
    return [(conjuncts(disjunction(own)), action) for action, own in needed.items()]
