"""The outcomes of actions as commands of a program.

An action of few outcomes is one command that has a branch for each combination of what its factors
can do. Of more, it is a series of stages: each draws one factor and notes in *pending* cells what is
to be set, and the last sets it. So the size of the program is that of the action, not of the product
of its factors, and no condition is read after an effect.

Events are drawn in stages of their own, one after the other: what they set in one round is noted, too, and
applies at its end.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TypeAlias

from bbtc.ground.condition import variables
from bbtc.ground.task import (
    Charge,
    Effect,
    Factor,
    GroundAction,
    GroundEvent,
    NumberChange,
    Outcome,
    Task,
    charges_of,
    effects_of,
    outcomes_of,
)
from bbtc.verifier.conditions import FALSE, TRUE, UNKNOWN, Cells, where_true
from bbtc.verifier.program import (
    NO,
    YES,
    Branch,
    Cell,
    Charged,
    Choose,
    Command,
    Compare,
    Count,
    Drafting,
    Expression,
    Update,
    all_of,
    any_of,
    none_of,
    put,
)

MOST_BRANCHES = 64
"""Branches of one command; an action of more is written in stages."""

_ZERO, _ONE = Fraction(0), Fraction(1)
_Amounts: TypeAlias = tuple[Fraction, Fraction, Fraction]  # actions, cost, reward
_Rounds: TypeAlias = tuple[tuple[GroundEvent, ...], ...]
Drawn: TypeAlias = tuple[
    Fraction, tuple[Effect, ...], tuple[Charge, ...], Fraction, Fraction, tuple[NumberChange, ...]
]


def relevant(task: Task, actions: Iterable[GroundAction], read: Iterable[int]) -> list[int]:
    """The variables on which those ``read`` depend, by way of the conditions of effects and events, in order,
    and those on which costs and rewards do. The others can change, but change nothing that matters."""
    actions = list(actions)
    factors = [factor for action in actions for factor in action.possible_factors]
    effects: list[tuple[Effect, tuple[int, ...]]] = [(effect, ()) for effect in effects_of(factors)]
    needed = {*read, *(variable for charge in charges_of(factors) for variable in variables(charge.when))}
    for action in actions if task.events else ():
        needed.update(() if action.during is None else variables(action.during))
    for event in task.events:
        happens = tuple(variables(event.precondition))
        effects += [(effect, happens) for effect in effects_of(event.factors)]
        if _charges(event):
            needed.update(happens)
            needed.update(v for charge in charges_of(event.factors) for v in variables(charge.when))
    while True:
        more = {
            variable
            for effect, happens in effects
            if any(changed in needed for changed, _ in effect.sets)
            for variable in (*happens, *(() if effect.when is None else variables(effect.when)))
        }
        if more <= needed:
            return [index for index in range(len(task.variables)) if index in needed]
        needed |= more


@dataclass(slots=True)
class Outcomes:
    """Writes what follows the start of an action. ``cell_of`` gives the cells of the relevant
    variables; ``commands`` are those of the stages."""

    draft: Drafting
    cell_of: Mapping[int, int]
    most_branches: int = MOST_BRANCHES
    commands: list[Command] = field(default_factory=list)
    stage: int | None = None
    _stages: int = 1  # 0: no action is under way; 1: the outcome is drawn, and applies now
    _events: dict[str, int] = field(
        default_factory=dict
    )  # by action, the first stage of what happens after it
    _pending: dict[int, int] = field(default_factory=dict)
    _notes: dict[int, int] = field(default_factory=dict)  # those of numbers, by cell
    _entry: dict[str, int] = field(default_factory=dict)

    def prepare(self, actions: Sequence[GroundAction], task: Task) -> None:
        """Write the stages of those actions that need them, and of the events of the task."""
        meanwhile = {action.name: self._meanwhile(task, action) for action in actions}
        moving = any(any(rounds) for rounds in meanwhile.values())
        interrupted = [action for action in actions if action.during is not None and moving]
        staged = [
            action
            for action in actions
            if action in interrupted or combinations(action.factors) > self.most_branches
        ]
        if not staged and not moving:
            return
        self.stage = self.draft.cell(Cell("control", "stage", "stage of the outcome being drawn; 0: none", 0))
        drawn = [factor for action in staged for factor in action.possible_factors]
        drawn += [factor for event in task.events for factor in event.factors]
        touched = {v for effect in effects_of(drawn) for v, _ in effect.sets}
        touched |= {change.digits[0] for outcome in outcomes_of(drawn) for change in outcome.changes}
        for variable in sorted(touched & self.cell_of.keys()):
            of = self.draft.cells[self.cell_of[variable]]
            if of.kind == "number":
                self._pending[variable] = self._note_of(self.cell_of[variable])
                continue
            self._pending[variable] = self.draft.cell(
                Cell("pending", of.subject, "what it becomes: 0 as it is, 1 false, 2 unknown, 3 true", 3)
            )
        known: dict[_Rounds, int] = {}
        applying: dict[int, int] = {0: 1}  # by what comes next: the stage in which an outcome applies
        for action in actions:
            rounds = meanwhile[action.name]
            if action in interrupted:
                self._entry[action.name] = self._happen(rounds, self._going_on(action))
                continue
            if rounds not in known:
                known[rounds] = self._happen(rounds, 0)
            self._events[action.name] = known[rounds]
        for action in staged:
            if action not in interrupted:
                after = self._events.get(action.name, 0)
                if after not in applying:
                    applying[after] = self._new_stage()
                self._entry[action.name] = self._series(action.factors, applying[after])
        highest = self._stages
        self.draft.cells[self.stage] = Cell("control", "stage", self.draft.cells[self.stage].meaning, highest)
        for after, stage in applying.items():
            self._apply(stage, after, "the outcome applies")

    def _meanwhile(self, task: Task, action: GroundAction) -> _Rounds:
        """The events that happen with an action and matter, by round."""
        rounds = (tuple(filter(self._matters, events)) for events in task.rounds(action))
        return tuple(events for events in rounds if events)

    def _note_of(self, number: int) -> int:
        """The pending cell of a number."""
        if number not in self._notes:
            of = self.draft.cells[number]
            meaning = "what it becomes: 0 as it is, else one more than that"
            self._notes[number] = self.draft.cell(Cell("pending", of.subject, meaning, of.highest + 1))
        return self._notes[number]

    def _apply(self, stage: int, after: int, remark: str) -> None:
        """What is noted is set in one stage, then comes another."""
        assert self.stage is not None
        notes = {self.cell_of[variable]: pending for variable, pending in self._pending.items()}
        apply = [
            Count(cell, note, ((none_of(Compare(note, "=", 0)), "add", -1),), self.draft.cells[cell].highest)
            if cell in self._notes
            else applied(cell, note)
            for cell, note in notes.items()
        ]
        clear = [put(note, 0) for note in notes.values()]
        branch = Branch(_ONE, (*apply, *clear, put(self.stage, after)), (_ZERO, _ZERO, _ZERO))
        self.commands.append(Command(None, Compare(self.stage, "=", stage), (branch,), remark))

    def _new_stage(self) -> int:
        self._stages += 1
        return self._stages

    # --- events -------------------------------------------------------------------------------

    def _matters(self, event: GroundEvent) -> bool:
        """Does it set what has a cell, or add to costs or rewards?"""
        sets = (variable for effect in effects_of(event.factors) for variable, _ in effect.sets)
        return _charges(event) or any(variable in self.cell_of for variable in sets)

    def _happen(self, rounds: Sequence[Sequence[GroundEvent]], after: int) -> int:
        """Write the stages that draw the events, then go to the stage ``after``; the first one."""
        assert self.stage is not None
        for events in reversed(rounds):
            applies = self._new_stage()
            self._apply(applies, after, "what has happened applies")
            after = applies
            for event in reversed(events):
                happens = self._series(event.factors, after)
                guard = where_true(event.precondition, self.cell_of)
                if guard == YES:
                    after = happens
                    continue
                own = self._new_stage()
                for holds, then in ((guard, happens), (none_of(guard), after)):
                    if holds != NO:
                        branch = Branch(_ONE, (put(self.stage, then),), (_ZERO, _ZERO, _ZERO))
                        here = all_of(Compare(self.stage, "=", own), holds)
                        self.commands.append(Command(None, here, (branch,), f"does {event.name} happen?"))
                after = own
        return after

    def _going_on(self, action: GroundAction) -> int:
        """Write the stages in which an action goes on or is aborted; the first one."""
        assert self.stage is not None
        assert action.during is not None
        applies = self._new_stage()
        self._apply(applies, 0, f"{action.name} has ended")
        ends, aborted = self._series(action.factors, applies), self._series(action.on_abort, applies)
        own = self._new_stage()
        guard = where_true(action.during, self.cell_of)
        for holds, then in ((guard, ends), (none_of(guard), aborted)):
            branch = Branch(_ONE, (put(self.stage, then),), (_ZERO, _ZERO, _ZERO))
            here = all_of(Compare(self.stage, "=", own), holds)
            if holds != NO:
                self.commands.append(Command(None, here, (branch,), f"does {action.name} go on?"))
        return own

    @property
    def idle(self) -> Expression:
        """Is no outcome being drawn?"""
        return YES if self.stage is None else Compare(self.stage, "=", 0)

    def branches(self, action: GroundAction, updates: Sequence[Update]) -> tuple[Branch, ...]:
        """What may happen when the action starts; ``updates`` happen in any case."""
        if action.name in self._entry:
            assert self.stage is not None
            rewards = (_ONE, action.cost, _ZERO)
            return (Branch(_ONE, (*updates, put(self.stage, self._entry[action.name])), rewards),)
        if self._events.get(action.name):
            assert self.stage is not None
            updates = (*updates, put(self.stage, self._events[action.name]))
        merged: dict[tuple[tuple[Update, ...], _Amounts, tuple[Charged, ...]], Fraction] = {}
        for probability, effects, charges, cost, reward, changes in draws(action.factors):
            if probability:
                amounts = (_ONE, action.cost + cost, reward)
                sets = (*self._set(effects), *self._count(changes))
                key = ((*updates, *sets), amounts, charged(charges, self.cell_of))
                merged[key] = merged.get(key, _ZERO) + probability
        return tuple(
            Branch(p, changed, amounts, charges) for (changed, amounts, charges), p in merged.items()
        )

    # --- one command --------------------------------------------------------------------------

    def _set(self, effects: Sequence[Effect]) -> Iterator[Update]:
        """Where several effects set a variable, true wins over unknown, and that over false."""
        for variable, guards in _guards(effects, self.cell_of).items():
            cases: list[tuple[Expression, int]] = []
            for value in (TRUE, UNKNOWN, FALSE):
                if guards[value] != NO:
                    cases.append((guards[value], value))
                if guards[value] == YES:
                    break
            yield Choose(self.cell_of[variable], tuple(cases))

    def _count(self, changes: Iterable[NumberChange]) -> Iterator[Update]:
        """What happens to numbers."""
        for change in changes:
            cell = self.cell_of.get(change.digits[0])
            if cell is not None:
                yield self._counted(change, cell, cell, 0)

    def _counted(self, change: NumberChange, cell: int, source: int, shift: int) -> Count:
        cases = tuple(
            (YES if case.when is None else where_true(case.when, self.cell_of), case.kind, case.amount)
            for case in change.cases
        )
        return Count(cell, source, cases, self.draft.cells[source].highest, shift)

    def _noted(self, outcome: Outcome) -> Iterator[Update]:
        """Notes in *pending* cells what an outcome does."""
        yield from noted(outcome.effects, self.cell_of, self._pending)
        for change in outcome.changes:
            source = self.cell_of.get(change.digits[0])
            if source is not None:
                yield self._counted(change, self._pending[change.digits[0]], source, 1)

    # --- in stages ----------------------------------------------------------------------------

    def _series(self, factors: Sequence[Factor], after: int) -> int:
        """Write the stages that draw the factors, then go to the stage ``after``; the first one."""
        for factor in reversed(factors):
            after = self._draw(factor, after)
        return after

    def _draw(self, factor: Factor, after: int) -> int:
        assert self.stage is not None
        branches = []
        for outcome in factor.outcomes:
            if outcome.probability:
                then = put(self.stage, self._series(outcome.factors, after))
                updates = (*self._noted(outcome), then)
                amounts = (_ZERO, outcome.cost, outcome.reward)
                charges = charged(outcome.charges, self.cell_of)
                branches.append(Branch(outcome.probability, updates, amounts, charges))
        own = self._new_stage()
        self.commands.append(
            Command(None, Compare(self.stage, "=", own), tuple(branches), "a factor is drawn")
        )
        return own


def _charges(event: GroundEvent) -> bool:
    """Does an event ever add to cost or reward?"""
    return any(outcome.cost or outcome.reward or outcome.charges for outcome in outcomes_of(event.factors))


def noted(
    effects: Sequence[Effect], cell_of: Mapping[int, int], pending: Mapping[int, int]
) -> Iterator[Update]:
    """Notes in *pending* cells what effects set, where nothing greater is noted."""
    for variable, guards in _guards(effects, cell_of).items():
        note = pending[variable]
        cases = [
            (all_of(guards[value], Compare(note, "<", value + 1)), value + 1)
            for value in (TRUE, UNKNOWN, FALSE)
            if guards[value] != NO
        ]
        yield Choose(note, tuple(cases))


def applied(cell: int, pending: int) -> Choose:
    """The cell gets what is noted for it."""
    return Choose(cell, tuple((Compare(pending, "=", value + 1), value) for value in (FALSE, UNKNOWN, TRUE)))


def charged(charges: Iterable[Charge], cell_of: Mapping[int, int]) -> tuple[Charged, ...]:
    """What the charges add, by condition."""
    found: dict[Expression, _Amounts] = {}
    for charge in charges:
        when = where_true(charge.when, cell_of)
        _, cost, reward = found.get(when, (_ZERO, _ZERO, _ZERO))
        if when != NO:
            found[when] = (_ZERO, cost + charge.cost, reward + charge.reward)
    return tuple(Charged(when, amounts) for when, amounts in found.items())


def _guards(effects: Sequence[Effect], cell_of: Mapping[int, int]) -> dict[int, list[Expression]]:
    """Of each variable with a cell that is set: where it is set to false, to unknown, to true."""
    found: dict[int, list[Expression]] = {}
    for effect in effects:
        sets = [
            (variable, value)
            for variable, value in effect.sets
            if variable in cell_of and not (isinstance(cell_of, Cells) and variable in cell_of.numbers)
        ]
        when = where_true(effect.when, cell_of) if effect.when is not None and sets else YES
        for variable, value in sets if when != NO else ():
            guards = found.setdefault(variable, [NO, NO, NO])
            guards[value] = any_of(guards[value], when)
    return {variable: found[variable] for variable in sorted(found)}


def combinations(factors: Sequence[Factor]) -> int:
    """How many combinations of outcomes the factors have."""
    product = 1
    for factor in factors:
        product *= sum(combinations(outcome.factors) for outcome in factor.outcomes)
    return product


def draws(factors: Sequence[Factor]) -> Iterator[Drawn]:
    """Every combination of outcomes: probability, effects, charges, cost, reward, changes of numbers."""
    if not factors:
        yield _ONE, (), (), _ZERO, _ZERO, ()
        return
    *before, last = factors
    for p, effects, charges, cost, reward, changes in draws(before):
        for outcome in last.outcomes:
            for p2, effects2, charges2, cost2, reward2, changes2 in draws(outcome.factors):
                yield (
                    p * outcome.probability * p2,
                    (*effects, *outcome.effects, *effects2),
                    (*charges, *outcome.charges, *charges2),
                    cost + outcome.cost + cost2,
                    reward + outcome.reward + reward2,
                    (*changes, *outcome.changes, *changes2),
                )
