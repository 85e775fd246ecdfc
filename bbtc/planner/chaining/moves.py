"""What a search over refinements may do next: what to insert for a run that fails, and what to reorder
for runs that go round in circles.

Insertions are ranked by what it takes, in the delete relaxation, to reach the goal through them: the
inserted action with its preconditions, and what is still missing on the way from its place to the root.
Preconditions are ordered so that none is achieved at the expense of one before it (reasonable orders:
Koehler, Hoffmann, "On reasonable and forced goal orderings", 2000).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from bbtc.belief.draws import Values
from bbtc.ground.condition import And, Condition, Is, Or, conjuncts, evaluate, negation, variables
from bbtc.ground.task import GroundAction, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.chaining.choose import circular, helpful
from bbtc.planner.chaining.draft import Attempt, Draft, Subgoal
from bbtc.planner.mdp.h_add import Costs, Facts, Relaxation
from bbtc.rounding import rounded

_MOST_STEPS = 200
"""Operators looked at in a relaxed plan."""

_OBSERVING = 1.0
"""What observing costs where an action leaves the condition unknown."""


@dataclass(frozen=True, slots=True)
class Insertion:
    """An action (None: a part of a disjunction) to insert for a subgoal that has a value, with the
    conditions that must hold first, in order; ``cost`` estimates what the goal takes from there."""

    cost: float
    subgoal: Subgoal
    value: Truth
    doing: GroundAction | None
    conditions: tuple[Condition, ...]

    @property
    def name(self) -> str:
        """The name of what is inserted."""
        return "(a part of the disjunction)" if self.doing is None else self.doing.name

    def started(self, values: Values) -> Values:
        """The state with the variables as the conditions ask for, as far as they are plain."""
        changed = bytearray(values)
        for condition in self.conditions:
            if isinstance(condition, Is):
                changed[condition.variable] = condition.value
        return bytes(changed)

    @property
    def key(self) -> tuple[float, str, tuple[str, ...]]:
        """Sort key, best first."""
        return (self.cost, self.name, tuple(map(repr, self.conditions)))


class Moves:
    """Finds insertions in the states of one task."""

    def __init__(self, task: Task, limits: Limits) -> None:
        self.task = task
        self.limits = limits
        self.relaxed = Relaxation(task, limits)

    def insertions(self, subgoals: Iterable[Subgoal], draft: Draft, values: Values) -> list[Insertion]:
        """What may be inserted for any of some subgoals that are not true in a state, best first."""
        facts = self.relaxed.facts(values)
        costs = self.relaxed.operator_costs(facts)
        found: dict[tuple[Subgoal, str, tuple[Condition, ...]], Insertion] = {}
        for subgoal in dict.fromkeys(subgoals):
            above = self._above(subgoal, draft, facts, values)
            for each in self._for(subgoal, facts, costs, values):
                better = Insertion(each.cost + above, subgoal, each.value, each.doing, each.conditions)
                key = (subgoal, each.name, each.conditions)
                if key not in found or better.cost < found[key].cost:
                    found[key] = better
        return sorted(found.values(), key=lambda insertion: insertion.key)

    def _above(self, subgoal: Subgoal, draft: Draft, facts: Facts, values: Values) -> float:
        """What is missing for the goal besides the subgoal."""
        attempt = subgoal.parent
        siblings = draft.goals if attempt is None else attempt.preconditions
        missing = 0.0
        for each in siblings:
            if each is not subgoal and evaluate(each.condition, values) is not Truth.TRUE:
                missing += facts.cost(each.condition)
        if attempt is None:
            return missing
        own = rounded(attempt.doing.cost) if isinstance(attempt.doing, GroundAction) else 0.0
        return missing + own + self._above(attempt.subgoal, draft, facts, values)

    def _for(self, subgoal: Subgoal, facts: Facts, costs: Costs, values: Values) -> Iterator[Insertion]:
        goal = subgoal.condition
        value = evaluate(goal, values)
        if value is Truth.TRUE:
            return
        asked = {
            attempt.subgoal.condition
            for attempt in (subgoal.parent.ancestors() if subgoal.parent else ())
            if evaluate(attempt.subgoal.condition, values) is Truth.FALSE
        }
        present = {(a.doing, frozenset(p.condition for p in a.preconditions)) for a in subgoal.attempts()}

        def fits(doing: GroundAction | None, conditions: tuple[Condition, ...]) -> bool:
            return (
                (doing, frozenset(conditions)) not in present
                and asked.isdisjoint(conditions)
                and not any(circular(condition, goal, value) for condition in conditions)
            )

        never = float("inf")
        for variable, wanted in dict.fromkeys(helpful(goal, value)):
            opens = wanted is Truth.UNKNOWN and not (isinstance(goal, Is) and goal.value is Truth.UNKNOWN)
            for number in self.relaxed.makers(variable, wanted).tolist():
                operator = self.relaxed.operators[number]
                cost = float(costs[number])
                if operator.action < 0 or cost == never:
                    continue
                action = self.task.actions[operator.action]
                conditions = conjuncts(action.precondition)
                if operator.when is not None:
                    conditions += tuple(c for c in conjuncts(operator.when) if c not in conditions)
                if fits(action, conditions):
                    yield Insertion(cost + _OBSERVING * opens, subgoal, value, action, conditions)
        if value is Truth.FALSE and isinstance(goal, Or | And):
            for part in goal.parts if isinstance(goal, Or) else (goal,):
                conditions = conjuncts(part)
                if fits(None, conditions) and facts.cost(part) < never:
                    yield Insertion(facts.cost(part), subgoal, value, None, conditions)

    # --- orders ------------------------------------------------------------------------------

    def ordered(self, conditions: Iterable[Condition], values: Values) -> tuple[Condition, ...]:
        """The conditions in the order in which to achieve them from a state: what may turn out false
        first; nothing before what undoes it, or takes away what it needs."""
        waiting = list(conditions)
        facts = self.relaxed.facts(values)
        plans = {c: _Plan(self, c, facts, values) for c in waiting}
        uncertain = {c: any(self.task.variables[v].three_valued for v in variables(c)) for c in waiting}
        trouble: dict[tuple[Condition, Condition], int] = {}
        for a in waiting:
            self.limits.check_time("planning")
            trouble.update({(a, b): plans[a].trouble_before(plans[b]) for b in waiting if a is not b})
        found: list[Condition] = []
        while waiting:
            self.limits.check_time("planning")
            # How many of the others would rather come before; in doubt, as declared.
            before = [sum(trouble[o, c] < trouble[c, o] for o in waiting if o is not c) for c in waiting]
            first = min(
                range(len(waiting)),
                key=lambda i: (before[i], not uncertain[waiting[i]], i),
            )
            found.append(waiting.pop(first))
        return tuple(found)


class _Plan:
    """A relaxed plan for a condition: what it sets, and what of the state it builds on."""

    def __init__(self, moves: Moves, condition: Condition, facts: Facts, values: Values) -> None:
        relaxed = moves.relaxed
        costs = relaxed.operator_costs(facts)
        self.moves = moves
        self.condition = condition
        self.sets: set[tuple[int, Truth]] = set()
        self.needs: set[tuple[int, Truth]] = set()
        stack = [] if evaluate(condition, values) is Truth.TRUE else [condition]
        seen: set[int] = set()
        while stack and len(seen) < _MOST_STEPS:
            part = stack.pop()
            match part:
                case And(parts):
                    stack.extend(parts)
                case Or(parts) if parts:
                    stack.append(min(parts, key=facts.cost))
                case Is(variable, value) if values[variable] == value:
                    self.needs.add((variable, value))
                case Is() if len(makers := relaxed.makers(part.variable, part.value)):
                    best = int(makers[int(costs[makers].argmin())])
                    operator = relaxed.operators[best]
                    if best not in seen and operator.action >= 0:
                        seen.add(best)
                        self.sets.update(operator.sets)
                        stack.append(moves.task.actions[operator.action].precondition)
                        stack.extend([] if operator.when is None else [operator.when])
                case _:
                    pass

    def trouble_before(self, other: _Plan) -> int:
        """How bad is it to carry this plan out before the other? 3: the other makes this condition false
        again; 2: this takes what the other builds on, which only comes back at the expense of this
        condition; 1: this takes what the other builds on; 0: not at all."""
        if not set(_literals(negation(self.condition))).isdisjoint(other.sets):
            return 3
        kept = dict(other.needs)
        taken = [v for v, value in sorted(self.sets) if kept.get(v, value) is not value]
        if any(self._costs_own(variable, kept[variable]) for variable in taken):
            return 2
        return int(bool(taken))

    def _costs_own(self, variable: int, value: Truth) -> bool:
        """Does some action that sets the variable need this plan's condition, and end it?"""
        own = set(_literals(self.condition))
        against = set(_literals(negation(self.condition)))
        for number in self.moves.relaxed.makers(variable, value).tolist():
            operator = self.moves.relaxed.operators[number]
            if operator.action >= 0 and not against.isdisjoint(operator.sets):
                needed = self.moves.task.actions[operator.action].precondition
                if not own.isdisjoint(_literals(needed)):
                    return True
        return False


def _literals(condition: Condition) -> Iterator[tuple[int, Truth]]:
    match condition:
        case Is(variable, value):
            yield variable, value
        case And(parts) | Or(parts):
            for part in parts:
                yield from _literals(part)
        case _:
            return


# --- moves -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Move:
    """In a list of siblings, one goes to another place. The siblings are the goals (``owner`` None), the
    preconditions of an attempt, or the attempts at achieving or (``sensing``) observing a subgoal."""

    owner: Attempt | Subgoal | None
    sensing: bool
    old: int
    new: int
    name: str

    def apply(self, copy: Draft, copies: dict[Subgoal, Subgoal]) -> None:
        """Move in a copy of the draft it was found for."""
        match self.owner:
            case None:
                self._shift(copy.goals)
            case Subgoal():
                subgoal = copies[self.owner]
                self._shift(subgoal.sensing if self.sensing else subgoal.acting)
            case Attempt():
                attempt = copies[self.owner.preconditions[0]].parent
                assert attempt is not None
                self._shift(attempt.preconditions)

    def undone(self, draft: Draft) -> Condition:
        """The condition before which it moves the branch that undid it."""
        match self.owner:
            case None:
                return draft.goals[self.new].condition
            case Subgoal():
                return self.owner.condition
            case Attempt():
                return self.owner.preconditions[self.new].condition

    def _shift(self, siblings: list[Subgoal] | list[Attempt]) -> None:
        siblings.insert(self.new, siblings.pop(self.old))  # type: ignore[arg-type]


class _Step(NamedTuple):
    """A place on the way from the root to an attempt."""

    owner: Attempt | Subgoal | None
    sensing: bool
    at: int


def _path(draft: Draft, attempt: Attempt) -> list[_Step]:
    steps: list[_Step] = []
    while True:
        subgoal = attempt.subgoal
        sensing = attempt in subgoal.sensing
        siblings = subgoal.sensing if sensing else subgoal.acting
        steps.append(_Step(subgoal, sensing, siblings.index(attempt)))
        if subgoal.parent is None:
            steps.append(_Step(None, False, draft.goals.index(subgoal)))
            return steps[::-1]
        steps.append(_Step(subgoal.parent, False, subgoal.parent.preconditions.index(subgoal)))
        attempt = subgoal.parent


def separating(draft: Draft, attempts: Iterable[Attempt]) -> list[Move]:
    """Moves that may end a circle in which some attempts undo what one another did: of two branches side
    by side, the later goes before the earlier; of two attempts at the same, also the precondition that is
    fought for behind the others."""
    paths = [(attempt, _path(draft, attempt)) for attempt in attempts]
    found: dict[Move, None] = {}
    for position, (one, first) in enumerate(paths):
        for other, second in paths[position + 1 :]:
            depth = next((d for d, (a, b) in enumerate(zip(first, second, strict=False)) if a != b), None)
            if depth is None or first[depth][:2] != second[depth][:2]:
                continue
            earlier, later = sorted([(first, one), (second, other)], key=lambda pair: pair[0][depth].at)
            owner, sensing, old = later[0][depth]
            found[Move(owner, sensing, old, earlier[0][depth].at, _name(later[1]))] = None
            if isinstance(owner, Subgoal):
                for path, attempt in (earlier, later):
                    if len(path) > depth + 1 and isinstance(above := path[depth + 1].owner, Attempt):
                        last, at = len(above.preconditions) - 1, path[depth + 1].at
                        if at < last:
                            found[Move(above, False, at, last, _name(attempt))] = None
    return list(found)


def forward(draft: Draft, attempt: Attempt) -> list[Move]:
    """Moves that take the branch of an attempt before its siblings, the innermost first."""
    return [
        Move(step.owner, False, step.at, 0, _name(attempt))
        for step in reversed(_path(draft, attempt))
        if step.at > 0 and not isinstance(step.owner, Subgoal)
    ]


def _name(attempt: Attempt) -> str:
    return "(a part of the disjunction)" if attempt.doing is None else attempt.doing.name
