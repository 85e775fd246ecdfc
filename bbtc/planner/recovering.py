"""Rules for every state that actions lead to, or others may, and not only for those that a plan visits.

1. All states that any actions lead to are explored, and what one change
   (:mod:`bbtc.planner.changing_facts`) and any actions make of some of them.
2. P* and the least cost V are found for all of them.
3. A state that runs visit may take the choices that attain V, as in :mod:`bbtc.planner.synthesis.permissive`,
   and of these the ones that others' changes harm least (:mod:`bbtc.planner.exposure`); any other one those
   that attain P* and cost little more, since that costs the runs nothing.
4. Rules are learnt one by one, as in :mod:`bbtc.planner.synthesis.rules`, but for their guards: an action
   reads its precondition by itself, so a rule tells apart only states in which that is not false, and most
   rules need no test at all. What a rule decides must leave a way to the goal from everywhere; choices that
   would not are given up. States that no run visits any more are free to take what is near enough.
5. Where runs end since nothing leads to the goal any more, rules must not go on. Either each of them tells
   such states apart, or one condition before them all does, whichever takes fewer nodes.
6. What later rules made needless is taken out, and the rules are put in order
   (:mod:`bbtc.planner.rule_list`).
7. Last come rules for states without hope that only others lead to: an action, if possible one that the tree
   has, is tried until others have put things right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import numpy.typing as npt

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
from bbtc.limits import Limits
from bbtc.planner.changing_facts import ChangingFacts
from bbtc.planner.elsewhere import MOST_VISITED, changed, spread
from bbtc.planner.exposure import least_exposed
from bbtc.planner.mdp.contraction import contracted
from bbtc.planner.mdp.explore import Explorer
from bbtc.planner.mdp.graph import Floats, draw_probabilities, sums
from bbtc.planner.mdp.maxprob import Bounds, MaxProb, max_prob
from bbtc.planner.mdp.packing import Flags, bit_test, holds
from bbtc.planner.mdp.ssp import least_cost
from bbtc.planner.mdp.state_space import StateSpace
from bbtc.planner.mdp.transitions import Index
from bbtc.planner.rule_list import Rule, Setting, nearest_first, shortened
from bbtc.planner.strong_cyclic.rules import certainly
from bbtc.planner.strong_cyclic.sharing import Guarded, factored
from bbtc.planner.synthesis.rules import Stated, literals_of, rule_size, separating
from bbtc.rewrite.simplify import numbered, size
from bbtc.rounding import rounded
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
    facts = ChangingFacts.of(task, limits)
    space, all_of_them = _wide_space(task, facts, limits, everywhere=everywhere)
    found = max_prob(space, limits)
    choices = _choices(found, facts, limits)
    if choices is None:
        return None
    trees: list[Node] = []
    for apart in (False, True):
        learner = _Learner(task, found, choices, limits, apart=apart)
        learner.learn()
        trees += learner.trees()
        if not learner.stuck.any():
            break
    return Recovering(min(trees, key=size), found.initial, all_of_them)


def _wide_space(
    task: Task, facts: ChangingFacts, limits: Limits, *, everywhere: bool
) -> tuple[StateSpace, bool]:
    """All that any actions lead to, also behind the goal and from where others may leave some states, all of
    them if they are few; is that everything? Choices of goal states are left out. Raises ``LimitReached``."""
    explorer = Explorer(replace(task, goal=FALSE), limits)
    explorer.exhaust(limits)
    all_of_them = False
    looked_at = 0
    while True:
        space = explorer.space(np.zeros(explorer.count, dtype=np.bool_), None)
        few = explorer.count <= _FEW_STATES
        # What the others may become was found to be known before.
        fresh = range(looked_at, explorer.count) if few else spread(range(explorer.count), MOST_VISITED)
        looked_at = explorer.count
        rows = np.array(fresh, dtype=np.int64)
        rows = rows[~space.passing[rows]]
        states = map(bytes, space.packing.unpack(space.states[rows]).tolist())
        explorer.also_start(changed(facts, states, limits))
        if explorer.count == looked_at:
            all_of_them = few
            break
        try:
            explorer.exhaust(limits)
        except LimitReached:
            if everywhere:
                raise
            limits.check_time("the search for a tree that recovers")
            break
        if not few:
            space = explorer.space(np.zeros(explorer.count, dtype=np.bool_), None)
            break
    space = contracted(space, limits)
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
    )
    return wide, all_of_them


@dataclass(frozen=True, slots=True)
class _Choices:
    """Choices that attain the least cost, of these the ones least exposed to changes (``best``), all that are
    ``near`` enough elsewhere, and of these the ones after which the expected cost falls; the least cost of
    each state."""

    best: Flags
    near: Flags
    falling: Flags
    costs: Floats


def _choices(found: MaxProb, facts: ChangingFacts, limits: Limits) -> _Choices | None:
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
    rates = np.array([rounded(cost) for cost in costs] or [0.0])
    own = sums(space.edge_choice, weight * rates[space.edge_draw], count)
    onward = sums(space.edge_choice, weight * cheapest.values[space.edge_successor], count)
    values = cheapest.values[space.choice_state]
    more = own + onward - values - _CLOSE * (1 + values)
    best = least_exposed(found, best, facts, limits)
    near, falling = (found.best & (more <= share * own) for share in (_NEAR, _FALLING))
    return _Choices(best, near, falling, cheapest.values)


class _Learner:
    """Finds the rules."""

    def __init__(self, task: Task, found: MaxProb, choices: _Choices, limits: Limits, *, apart: bool) -> None:
        self.task, self.choices, self.limits = task, choices, limits
        self.graph, self.space = found.graph, found.space
        space = found.space
        self.hopeful = ~found.prob_0 & ~space.goal
        self._hoping = self.hopeful[space.choice_state]
        values = space.packing.unpack(space.states)
        self.literals = literals_of(task, values)
        self.stated = Stated(task, self.literals)
        columns = [literal.holds(values) for literal in self.literals]
        self.holds = np.array(columns, dtype=np.bool_).T.reshape(len(values), len(columns))
        self.given_up = np.zeros(len(space.choice_action), dtype=np.bool_)
        self.decided = np.full(len(values), -1, dtype=np.int64)
        """The action of each state that a rule decides."""
        self.undecided = self.hopeful.copy()
        self.rules: list[Rule] = []
        """Those that lead to the goal."""
        self._starts: dict[int, Flags] = {}
        self.stuck = self._stuck(self._visited())
        """Where runs may end without the goal."""
        self.ends = self._ending() if apart else []
        """Tests of which some hold where rules are not asked."""
        self.asked = np.ones(len(values), dtype=np.bool_)
        for tests in self.ends:
            self.asked &= ~self.holds[:, tests].all(axis=1)
        self.setting = Setting(
            self.graph,
            self.holds,
            self._may_start,
            self.hopeful,
            self.asked,
            choices.best,
            choices.near,
            choices.costs,
        )

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

    def learn(self) -> None:
        """Find the rules that lead to the goal."""
        visited = self._visited()
        before: Flags | None = None
        while True:
            self.limits.check_time("the search for a tree that recovers")
            free = self._free(visited)
            taken = self._taken(self.decided, free)
            found = self._best(taken, self._stuck(visited) & self.asked)
            if found is None:
                break
            rule, covered = found
            decided = self.decided.copy()
            decided[covered] = rule.action
            if before is None:
                before = self._getting_on(taken)
            after = self._getting_on(self._taken(decided, free))
            if self._given_up(rule.action, covered, before & ~after, taken):
                before = None
                continue
            self.decided = decided
            self.undecided[covered] = False
            visited, last = self._visited(), visited
            before = after if (visited == last).all() else None
            self.rules.append(rule)
        self.rules = shortened(self.setting, self.rules, self.limits)

    def _getting_on(self, taken: Flags) -> Flags:
        """The states from which choices may lead to the goal."""
        return self.graph.reach(self.space.goal, taken).found

    def _given_up(self, action: int, covered: Index, lost: Flags, taken: Flags) -> bool:
        """Give up choices of an action that would leave some states without a way; are there any? First those
        after which costs do not fall, then those in whose place something else may be done."""
        if not lost.any():
            return False
        states = self.space.choice_state
        culprits = np.zeros(len(lost), dtype=np.bool_)
        culprits[covered[lost[covered]] if lost[covered].any() else covered] = True
        own = culprits[states] & (self.space.choice_action == action) & ~self.given_up
        others = self.space.having(taken & (self.space.choice_action != action))
        for least in (own & ~self.choices.falling, own & others[states], own):
            if least.any():
                self.given_up |= least
                return True
        return False

    def _best(self, taken: Flags, stuck: Flags) -> tuple[Rule, Index] | None:
        """The rule that decides most states for its size, and these."""
        open_choices = taken & self.undecided[self.space.choice_state]
        best: tuple[tuple[float, int], Rule, Index] | None = None
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
                best = key, Rule((tuple(tests),), action), covered
        return None if best is None else best[1:]

    def waiting(self) -> list[Rule]:
        """Rules for states without hope that no run visits, one for each action, in any order; first of
        actions that the tree has."""
        visited = self._visited()
        stuck = self._stuck(visited)
        idle = ~self.hopeful & ~self.space.goal & ~visited
        for rule in self.rules:
            idle &= ~(self.asked & self.setting.applies(rule))
        rules: list[Rule] = []
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
                    covered |= self.setting.applies(other)
            if not (idle & ~left & ~covered).any():
                rules.remove(rule)
        ways: dict[int, tuple[tuple[int, ...], ...]] = {}
        for rule in rules:
            ways[rule.action] = ways.get(rule.action, ()) + rule.ways
        return [Rule(own, action) for action, own in ways.items()]

    def _best_wait(self, actions: list[int], idle: Flags, stuck: Flags) -> tuple[Rule, Flags] | None:
        best: tuple[float, Rule, Flags] | None = None
        for action in actions:
            wanted = idle & self._may_start(action)
            if not wanted.any():
                continue
            others = self.holds[stuck & self._may_start(action)]
            tests = separating(self.holds[wanted], others, self.stated.by(action))
            covered = wanted & self.holds[:, tests].all(axis=1)
            key = -int(covered.sum()) / rule_size(tests)
            if best is None or key < best[0]:
                best = key, Rule((tuple(tests),), action), covered
        return None if best is None else best[1:]

    # --- the tree ---------------------------------------------------------------------------------

    def trees(self) -> list[Node]:
        """The rules as trees, in good order, and as they were learnt, in which more may be shared."""
        waiting = factored(self.task, [self._guarded(rule) for rule in self.waiting()])
        ordered = nearest_first(self.setting, self.rules)
        orders = [ordered] if ordered == self.rules else [ordered, self.rules]
        return [self._tree(rules, waiting) for rules in orders]

    def _tree(self, rules: Sequence[Rule], waiting: Sequence[Node]) -> Node:
        """Rules that are asked only where none of ``ends`` holds, and what comes after them. Nothing that is
        read is ever unknown, but for an action's precondition."""
        branches = factored(self.task, [self._guarded(rule) for rule in rules])
        if self.ends and branches:
            going_on = conjunction(negation(self._all(tests)) for tests in self.ends)
            first = branches[0] if len(branches) == 1 else ControlNode("", "fallback", tuple(branches))
            branches = [ControlNode("", "sequence", (ConditionNode("", going_on), first))]
        goal = ConditionNode("", certainly(self.task, self.task.goal))
        branches = [*branches, *waiting]
        return numbered(ControlNode("", "fallback", (goal, *branches)) if branches else goal)

    def _guarded(self, rule: Rule) -> Guarded:
        action = self.task.actions[rule.action]
        node = ActionNode("", action.name, latched=False, guarded=action.precondition != TRUE)
        return conjuncts(disjunction(self._all(tests) for tests in rule.ways)), node

    def _all(self, tests: Sequence[int]) -> Condition:
        return conjunction(certainly(self.task, self.literals[test].condition) for test in tests)
