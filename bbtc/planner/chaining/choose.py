"""What to insert for a failed condition (paper, section "Iterative Behavior Tree Expansion").

Candidates are scored by the paper's three factors: the probability of a successful postcondition,
whether the preconditions hold in the current belief, and what was tried before.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.belief.draws import Values
from bbtc.belief.state import State, Transition, compile_action
from bbtc.ground.condition import (
    And,
    Condition,
    Constant,
    Is,
    Known,
    Not,
    Or,
    Within,
    conjuncts,
    evaluate,
    in_digits,
    variables,
)
from bbtc.ground.task import GroundAction, Task, apparent_factors, effects_of
from bbtc.kleene import Truth, negate
from bbtc.limits import Limits
from bbtc.planner.chaining.draft import Doing, Subgoal, changed_by
from bbtc.planner.mdp.h_add import Relaxation, possible

OBSERVABLE_SHARE = Fraction(1, 2)
"""An outcome that leaves a false condition unknown counts this much: it may still be observed true."""

UNMET_DISCOUNT = Fraction(4, 5)
"""A candidate's score is multiplied by this for every precondition that does not hold yet."""


_Tried: TypeAlias = tuple[frozenset[Condition], ...]


@dataclass(frozen=True, slots=True)
class Flaw:
    """A failed condition (a flaw, as partial-order planning has it): the subgoal, what it was (false or
    unknown), and the final states it fails in, with their probabilities."""

    subgoal: Subgoal
    value: Truth
    states: tuple[tuple[State, Fraction], ...]
    excluded: frozenset[str] = frozenset()
    """Keys of candidates not to insert: what was inserted already and never started in these states (once
    more, it would not start either), and what was taken back before."""

    @property
    def probability(self) -> Fraction:
        """Probability that a run ends because of this condition."""
        return sum((p for _, p in self.states), Fraction(0))


@dataclass(frozen=True, slots=True)
class Candidate:
    """Something that may resolve a flaw. ``success`` is the probability that the condition
    holds (is known, where it was unknown) after it, over the flaw's states, ``observable`` that it
    becomes unknown where it was false; ``conditions`` are what must hold first; ``unmet`` counts
    those that do not hold in some of the states."""

    doing: Doing | None
    conditions: tuple[Condition, ...]
    success: Fraction
    observable: Fraction
    unmet: int
    tried: int

    @property
    def name(self) -> str:
        """The ground name of what is inserted."""
        return self.doing.name if self.doing is not None else "(a part of the disjunction)"

    @property
    def key(self) -> str:
        """What tells it from the others of a subgoal: the ground name, or which part it is."""
        return self.name if self.doing is not None else repr(self.conditions)

    @property
    def score(self) -> Fraction:
        """Probability of success, discounted for every unmet precondition."""
        return (self.success + self.observable * OBSERVABLE_SHARE) * UNMET_DISCOUNT**self.unmet

    def rank(self) -> tuple[Fraction, int, Fraction, str]:
        """Sort key, best first: score, fewest tries, cost, name."""
        cost = self.doing.cost if isinstance(self.doing, GroundAction) else Fraction(0)
        return (-self.score, self.tried, cost, self.name)


class Chooser:
    """Finds the candidates for a flaw; everything that depends on the task only is indexed once."""

    def __init__(self, task: Task, transitions: dict[str, Transition], limits: Limits) -> None:
        self.task = task
        self.transitions = transitions
        self.limits = limits
        self.relaxation = Relaxation(task, limits)
        self._by_fact: dict[tuple[int, Truth], list[Doing]] = {}
        self._guides: dict[str, Transition] = {}
        self._helps: dict[tuple[Subgoal, _Tried, Truth, Values, frozenset[str]], bool] = {}
        doings: list[Doing] = [*task.actions, *task.templates]
        for doing in doings:
            effects = effects_of(apparent_factors(task, doing))
            for fact in sorted({fact for effect in effects for fact in effect.sets}):
                self._by_fact.setdefault(fact, []).append(doing)

    def helps(self, flaw: Flaw) -> bool:
        """Is there any candidate for a flaw of one state?"""
        ((state, _),) = flaw.states
        key = (flaw.subgoal, tried_parts(flaw.subgoal), flaw.value, state.values, flaw.excluded)
        if key not in self._helps:
            self._helps[key] = bool(self.candidates(flaw))
        return self._helps[key]

    def candidates(self, flaw: Flaw) -> list[Candidate]:
        """Everything worth inserting for a flaw, best first; empty if nothing helps."""
        goal = flaw.subgoal.condition
        ongoing = {
            attempt.doing.name
            for attempt in (flaw.subgoal.parent.ancestors() if flaw.subgoal.parent else ())
            if attempt.doing is not None
        }
        doings: dict[str, Doing] = {}
        for fact in helpful(goal, flaw.value):
            for doing in self._by_fact.get(fact, ()):
                if doing.name not in ongoing and doing.name not in flaw.excluded:
                    doings[doing.name] = doing
        found: list[Candidate] = []
        for doing in doings.values():
            found.extend(self._variants(flaw, doing))
        if not found:
            found = list(self._parts(flaw))
        return sorted(found, key=Candidate.rank)

    def _variants(self, flaw: Flaw, doing: Doing) -> Iterator[Candidate]:
        """The doing as it is, or, where its effect on the condition is guarded and the guard does
        not hold in the flaw's states, with the guard as a further precondition."""
        goal = flaw.subgoal.condition
        conditions = conjuncts(doing.precondition)
        if any(circular(condition, goal, flaw.value) for condition in conditions):
            return
        states = [(s, p) for s, p in flaw.states if self._applicable(conditions, s)]
        if not states:
            return
        tried = sum(a.doing is doing for a in flaw.subgoal.attempts())
        chances = self._chances(doing, flaw, {}, states)
        if any(chances):
            inserted = self._inserted(doing, conditions)
            yield Candidate(doing, inserted, *chances, _unmet(conditions, states), tried)
            return
        for guard in _guards(self.task, doing, frozenset(variables(goal))):
            more = (*conditions, *(c for c in conjuncts(guard) if c not in conditions))
            if any(circular(c, goal, flaw.value) for c in more):
                continue
            reachable = [(s, p) for s, p in states if self._applicable(more, s)]
            forced = _forced(guard)
            if reachable and forced is not None:
                chances = self._chances(doing, flaw, forced, reachable)
                if any(chances):
                    inserted = self._inserted(doing, more)
                    yield Candidate(doing, inserted, *chances, _unmet(more, reachable), tried)

    def _inserted(self, doing: Doing, conditions: tuple[Condition, ...]) -> tuple[Condition, ...]:
        """The preconditions that stand before the doing in the tree. Those a template's body can
        change itself are only a guide: read on every tick, they would stop it half way."""
        if isinstance(doing, GroundAction):
            return conditions
        changed = changed_by(self.task, doing.body)
        return tuple(c for c in conditions if changed.isdisjoint(variables(c)))

    def _applicable(self, conditions: tuple[Condition, ...], state: State) -> bool:
        facts = self.relaxation.facts(state.values)
        return all(possible(condition, facts) for condition in conditions)

    def _chances(
        self,
        doing: Doing,
        flaw: Flaw,
        forced: Mapping[int, Truth],
        states: list[tuple[State, Fraction]],
    ) -> tuple[Fraction, Fraction]:
        """Probabilities, given the states, that the doing makes the goal true (known, if it was
        unknown), and that it leaves it to be observed, with some variables forced to the values
        that its guard asks for."""
        transition = self._transition(doing)
        success = observable = Fraction(0)
        goal = flaw.subgoal.condition
        for state, probability in states:
            values = bytearray(state.values)
            for variable, value in forced.items():
                values[variable] = value
            may_hold = possible(goal, self.relaxation.facts(state.values))
            for result in transition(bytes(values)):
                after = evaluate(goal, result.values)
                if after is Truth.TRUE or (flaw.value is Truth.UNKNOWN and after is Truth.FALSE):
                    success += probability * result.probability
                elif after is Truth.UNKNOWN and flaw.value is Truth.FALSE and may_hold:
                    observable += probability * result.probability
        return success / flaw.probability, observable / flaw.probability

    def _transition(self, doing: Doing) -> Transition:
        store = self.transitions if isinstance(doing, GroundAction) else self._guides
        if doing.name not in store:
            if isinstance(doing, GroundAction):
                action = doing
            else:
                action = GroundAction(doing.template, doing.args, doing.precondition, doing.factors)
            store[doing.name] = compile_action(self.task, action, self.limits)
        return store[doing.name]

    def _parts(self, flaw: Flaw) -> Iterator[Candidate]:
        """For a disjunction or a conjunction that no single action achieves: its parts as
        conditions to achieve one after the other."""
        goal = flaw.subgoal.condition
        if isinstance(goal, Or):
            parts = goal.parts
        elif isinstance(goal, And):
            parts = (goal,)
        else:
            return
        tried = tried_parts(flaw.subgoal)
        for part in parts:
            conditions = conjuncts(part)
            states = [(s, p) for s, p in flaw.states if self._applicable(conditions, s)]
            if states and frozenset(conditions) not in tried:
                share = sum((p for _, p in states), Fraction(0)) / flaw.probability
                part_of_it = Candidate(None, conditions, share, Fraction(0), _unmet(conditions, states), 0)
                if part_of_it.key not in flaw.excluded:
                    yield part_of_it


def tried_parts(subgoal: Subgoal) -> _Tried:
    """What each attempt at a subgoal asks for first: what was tried is not tried again."""
    return tuple(frozenset(p.condition for p in attempt.preconditions) for attempt in subgoal.attempts())


def helpful(condition: Condition, value: Truth) -> Iterator[tuple[int, Truth]]:
    """The assignments that can make a condition true that now has the value: those that may make a part
    of it true, or unknown, so that it can be observed; of an unknown one, those that tell. Repeats are
    included."""
    match condition:
        case Is(variable, Truth.UNKNOWN):
            yield variable, Truth.UNKNOWN
        case Is(variable, wanted):
            yield variable, wanted
            yield variable, negate(wanted) if value is Truth.UNKNOWN else Truth.UNKNOWN
        case Known(variable):
            yield variable, Truth.TRUE
            yield variable, Truth.FALSE
        case Within():
            yield from helpful(in_digits(condition), value)
        case And(parts) | Or(parts):
            for part in parts:
                yield from helpful(part, value)
        case Not(part):
            for variable in variables(part):
                yield from ((variable, each) for each in Truth)
        case Constant():
            return
        case _:
            assert_never(condition)


def circular(condition: Condition, goal: Condition, value: Truth) -> bool:
    """Does a precondition ask for the goal itself, or for the value of what is unknown?"""
    if condition == goal:
        return True
    return (
        value is Truth.UNKNOWN
        and isinstance(condition, Is)
        and condition.value is not Truth.UNKNOWN
        and condition.variable in variables(goal)
    )


def _guards(task: Task, doing: Doing, wanted: frozenset[int]) -> list[Condition]:
    """The guards of the effects on some variables, each once."""
    guards = (
        effect.when
        for effect in effects_of(apparent_factors(task, doing))
        if any(variable in wanted for variable, _ in effect.sets)
    )
    return list(dict.fromkeys(guard for guard in guards if guard is not None))


def _unmet(conditions: tuple[Condition, ...], states: list[tuple[State, Fraction]]) -> int:
    return sum(
        any(evaluate(condition, state.values) is not Truth.TRUE for state, _ in states)
        for condition in conditions
    )


def _forced(guard: Condition) -> dict[int, Truth] | None:
    """The assignment a conjunction of literals asks for; None for other guards."""
    forced = {}
    for part in conjuncts(guard):
        if not isinstance(part, Is):
            return None
        forced[part.variable] = part.value
    return forced
