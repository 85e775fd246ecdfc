"""A task with hidden facts as a partially observable Markov decision process.

The robot sees the seen variables, what it knows, by a number which worlds it holds possible, and what an
observation has just told. The facts themselves are hidden. An action is drawn in a series of stages, which
tell the robot nothing but that time passes: one for each factor, observation and component, whatever
happens. What is possible is a part of the state, so that preconditions and the goal read it as everywhere;
how probable the worlds are is left to whoever analyses the process.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TypeAlias

from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import variables
from bbtc.ground.describe import describe
from bbtc.ground.task import NO_CHANGE, Change, Factor, GroundAction, Observation, Task, effects_of
from bbtc.limits import Limits
from bbtc.verifier.conditions import where_true
from bbtc.verifier.happenings import known_of
from bbtc.verifier.outcomes import (
    MOST_BRANCHES,
    Outcomes,
    applied,
    charged,
    combinations,
    draws,
    noted,
    relevant,
)
from bbtc.verifier.possible import Table, Tables, Test, tables_of
from bbtc.verifier.program import (
    NO,
    YES,
    AllOf,
    AnyOf,
    Branch,
    Cell,
    Command,
    Compare,
    Drafting,
    Expression,
    Negation,
    Program,
    Update,
    all_of,
    any_of,
    none_of,
    put,
)
from bbtc.verifier.start import Start, write_start

MOST_DRAWN = 4_096
"""Branches of a stage: what is drawn unseen is drawn at once, for the number of stages would tell of it."""

_ZERO, _ONE = Fraction(0), Fraction(1)
_Step: TypeAlias = Callable[[int, int], Iterable[Command]]
"""A stage: given its number and that of the next one, its commands."""


def partial_process_of(task: Task, limits: Limits) -> Program:
    """The process. States in which the goal is known are final; label ``goal``. Raises :class:`BbtcError`
    (BBT0430) where it is too large to be written, and ``LimitReached``."""
    return _Writer(task, limits).program()


@dataclass(frozen=True, slots=True)
class _Part:
    """The cells of a component: its facts, and the number of what is held possible."""

    facts: tuple[int, ...]
    possible: int
    tables: Tables


class _Writer:
    def __init__(self, task: Task, limits: Limits) -> None:
        self._task, self._limits, self._draft = task, limits, Drafting()
        self._commands: list[Command] = []
        self._start: Start = write_start(task, relevant(task, task.actions, self._read()), self._draft)
        self._cell_of = self._start.cell_of
        self._stage = self._draft.cell(Cell("control", "stage", "stage of what is being drawn; 0: none", 0))
        self._stages = 0
        self._parts = [self._part(number) for number in range(len(task.components))]
        self._note_of: dict[int, int] = {}
        """By cell: the one that holds what it becomes."""
        self._told: dict[str, int] = {}

    def _read(self) -> set[int]:
        """The variables that something reads."""
        found = {*variables(self._task.goal)}
        for action in self._task.actions:
            found.update(variables(action.precondition))
            found.update(variable for change in action.changes for variable in change.seen)
        for component in self._task.components:
            found.update(component.seen, (each.variable for each in component.known))
        return found

    def program(self) -> Program:
        """See :func:`partial_process_of`."""
        task, draft = self._task, self._draft
        won = draft.define("goal", "true", where_true(task.goal, self._cell_of))
        idle = all_of(self._start.begun, self._at(0))
        outcomes = Outcomes(draft, self._cell_of)
        self._chain(list(self._beginning()))
        first = min(1, self._stages)
        for action in task.actions:
            self._limits.check_time("writing the process")
            guard = all_of(idle, none_of(won), where_true(action.precondition, self._cell_of))
            if action.changes or combinations(action.factors) > MOST_BRANCHES:
                enter = Branch(_ONE, (put(self._stage, self._stages + 1),), (_ONE, action.cost, _ZERO))
                self._commands.append(Command(action.name, guard, (enter,)))
                self._chain(list(self._stages_of(action)))
                continue
            branches = outcomes.branches(action, [])
            if any(branch.updates for branch in branches):  # others never change anything
                self._commands.append(Command(action.name, guard, branches))
        self._commands.append(Command(None, all_of(idle, won), (_branch([]),), "the goal is reached"))
        draft.cells[self._stage] = replace(draft.cells[self._stage], highest=self._stages, initial=first)
        begun = self._start.begun
        hidden = {cell for part in self._parts for cell in part.facts} | {*self._note_of.values()}
        return Program(
            kind="pomdp",
            title=f"{task.domain}/{task.problem}",
            cells=tuple(draft.cells),
            formulas=tuple(draft.formulas),
            commands=(
                *self._start.commands,
                *(replace(each, guard=all_of(begun, each.guard)) for each in self._commands),
            ),
            labels=(("goal", all_of(idle, won)),),
            observables=tuple(cell for cell in range(len(draft.cells)) if cell not in hidden),
        )

    # --- cells -------------------------------------------------------------------------------

    def _part(self, number: int) -> _Part:
        component = self._task.components[number]
        tables = tables_of(self._task, number, self._limits)
        facts = [
            self._draft.cell(Cell("fact", fact, f"is {fact} true? 0 no, 2 yes", 2))
            for fact in component.facts
        ]
        meaning = f"number of what is possible of {', '.join(component.facts)}"
        highest = max(len(tables.possible) - 1, 1)
        possible = self._draft.cell(Cell("possible", component.facts[0], meaning, highest))
        return _Part(tuple(facts), possible, tables)

    def _local(self, change: Change) -> dict[int, int]:
        """The cells of the local variables of a change."""
        seen = (self._cell_of[variable] for variable in change.seen)
        return dict(enumerate((*self._parts[change.component].facts, *seen)))

    def _note(self, cell: int) -> int:
        """The cell that holds what another becomes."""
        if cell not in self._note_of:
            of = self._draft.cells[cell]
            subject = of.subject if of.kind == "variable" else f"{of.kind} {of.subject}"
            meaning = "what it becomes: 0 as it is, 1 false, 2 unknown, 3 true"
            self._note_of[cell] = self._draft.cell(Cell("pending", subject, meaning, 3))
        return self._note_of[cell]

    def _told_cells(self, changes: Iterable[Change]) -> list[list[int]]:
        """By change, the cells of what observations tell; those in words alike share one, if they belong to
        different actions."""
        taken: set[str] = set()
        found = []
        for change in changes:
            local = self._task.components[change.component].local(self._task, change.seen)
            own = []
            for observation in change.observations:
                name = words = describe(replace(self._task, variables=local), observation.condition)
                count = 1
                while name in taken:
                    count += 1
                    name = f"{words} {count}"
                taken.add(name)
                if name not in self._told:
                    meaning = f"is told whether {name}: 0 nothing, 1 no, 2 yes"
                    self._told[name] = self._draft.cell(Cell("told", name, meaning, 2))
                own.append(self._told[name])
            found.append(own)
        return found

    # --- stages ------------------------------------------------------------------------------

    def _at(self, stage: int) -> Expression:
        return Compare(self._stage, "=", stage)

    def _chain(self, steps: Sequence[_Step]) -> None:
        """Write stages, each of which leads to the next one."""
        for left, step in zip(reversed(range(len(steps))), steps, strict=True):
            self._stages += 1
            self._commands += step(self._stages, self._stages + 1 if left else 0)

    def _beginning(self) -> Iterator[_Step]:
        """What is true is drawn, and told what is told at first."""
        changes, tables = [], []
        for number, part in enumerate(self._parts):
            yield self._drawing_worlds(number)
            if part.tables.first is not None:
                changes.append(part.tables.first.change)
                tables.append(part.tables.first)
        if changes:
            yield from self._telling(changes, tables, set())

    def _stages_of(self, action: GroundAction) -> Iterator[_Step]:
        noted_cells: set[int] = set()
        for factors, local in (
            (action.factors, self._cell_of),
            *((change.factors, self._local(change)) for change in action.changes),
        ):
            sets = {v for effect in effects_of(factors) for v, _ in effect.sets if v in local}
            notes = {variable: self._note(local[variable]) for variable in sorted(sets)}
            noted_cells |= {local[variable] for variable in notes}
            for factor in (each for each in factors if each != NO_CHANGE):
                yield self._drawing(action, factor, local, notes)
        tables = [self._parts[change.component].tables.of_action[action.name] for change in action.changes]
        yield from self._telling(action.changes, tables, noted_cells)

    def _telling(
        self, changes: Sequence[Change], tables: Sequence[Table], noted_cells: set[int]
    ) -> Iterator[_Step]:
        """What is told, what is possible then, and the end, in which all applies that was noted."""
        told = self._told_cells(changes)
        for change, cells in zip(changes, told, strict=True):
            for cell, observation in zip(cells, change.observations, strict=True):
                yield self._reading(change, observation, cell)
        known = set()
        for change, table, cells in zip(changes, tables, told, strict=True):
            if all(row.then == row.possible for row in table.rows):
                continue
            every = self._task.components[change.component].known
            notes = {each.variable: self._note(self._cell_of[each.variable]) for each in every}
            known |= {self._cell_of[each.variable] for each in every}
            yield self._learning(table, cells, notes)
        ends: list[Update] = []
        for cell in sorted(noted_cells | known):
            note = self._note(cell)
            ends += [applied(cell, note), put(note, 0)]
        ends += [put(cell, 0) for cells in told for cell in cells]
        yield lambda own, then: [self._command(own, "", _branch([*ends, put(self._stage, then)]))]

    def _command(self, stage: int, remark: str, *branches: Branch, when: Expression = YES) -> Command:
        return Command(None, all_of(self._at(stage), when), branches, remark)

    def _drawing_worlds(self, number: int) -> _Step:
        def step(own: int, then: int) -> Iterator[Command]:
            facts, prior = self._parts[number].facts, self._task.components[number].prior
            branches = []
            for world, p in prior:
                true = (put(cell, 2) for bit, cell in enumerate(facts) if world >> bit & 1)
                branches.append(_branch([*true, put(self._stage, then)], p))
            yield self._command(own, "what is true is drawn", *branches)

        return step

    def _drawing(
        self, action: GroundAction, factor: Factor, local: Mapping[int, int], notes: Mapping[int, int]
    ) -> _Step:
        if combinations([factor]) > MOST_DRAWN:
            raise BbtcError.single("BBT0430", f"{action.name} draws more than {MOST_DRAWN:,} things at once")

        def step(own: int, then: int) -> Iterator[Command]:
            branches = [
                Branch(
                    p,
                    (*noted(effects, local, notes), put(self._stage, then)),
                    (_ZERO, cost, reward),
                    charged(charges, local),
                )
                for p, effects, charges, cost, reward, _ in draws([factor])
                if p
            ]
            yield self._command(own, f"{action.name}: a factor is drawn", *branches)

        return step

    def _reading(self, change: Change, observation: Observation, cell: int) -> _Step:
        local = self._local(change)
        sets = {local[v] for effect in effects_of(change.factors) for v, _ in effect.sets}
        true = self._after(where_true(observation.condition, local), sets)
        made = YES if observation.when is None else self._after(where_true(observation.when, local), sets)

        def step(own: int, then: int) -> Iterator[Command]:
            go_on = put(self._stage, then)
            yes_if = {True: observation.right(True), False: 1 - observation.right(False)}
            for when, yes in ((true, yes_if[True]), (none_of(true), yes_if[False])):
                if all_of(made, when) != NO:
                    branches = [
                        _branch([put(cell, value), go_on], p) for value, p in ((2, yes), (1, 1 - yes)) if p
                    ]
                    yield self._command(own, "", *branches, when=all_of(made, when))
            if made != YES:
                yield self._command(own, "", _branch([go_on]), when=none_of(made))

        return step

    def _learning(self, table: Table, told: Sequence[int], notes: Mapping[int, int]) -> _Step:
        change = table.change
        part, component = self._parts[change.component], self._task.components[change.component]
        known = [dict(known_of(component, possible)) for possible in part.tables.possible]
        facts = len(component.facts)
        sets = {v - facts for effect in effects_of(change.factors) for v, _ in effect.sets if v >= facts}

        def holds(test: Test, value: int | None) -> Expression:
            kind, at = test
            if kind == "told":
                return Compare(told[at], "=", 0 if value is None else 1 + value // 2)
            assert value is not None
            cell = self._cell_of[change.seen[at]]
            is_so = Compare(cell, "=", value)
            return self._after(is_so, {cell}) if kind == "after" and at in sets else is_so

        def step(own: int, then: int) -> Iterator[Command]:
            for possible, values, after in table.rows:
                asked = [holds(test, value) for test, value in zip(table.tests, values, strict=True)]
                learnt = [
                    put(notes[variable], value + 1)
                    for variable, value in known[after].items()
                    if value != known[possible][variable]
                ]
                updates = [put(part.possible, after), *learnt, put(self._stage, then)]
                when = all_of(Compare(part.possible, "=", possible), *asked)
                yield self._command(own, "", _branch(updates), when=when)

        return step

    def _after(self, expression: Expression, sets: set[int]) -> Expression:
        """An expression over cells as they will be, once what is noted for some of them applies."""
        match expression:
            case Compare(cell, "=", number) if cell in sets:
                note = self._note(cell)
                return any_of(
                    Compare(note, "=", number + 1), all_of(Compare(note, "=", 0), Compare(cell, "=", number))
                )
            case AllOf(parts):
                return all_of(*(self._after(part, sets) for part in parts))
            case AnyOf(parts):
                return any_of(*(self._after(part, sets) for part in parts))
            case Negation(part):
                return none_of(self._after(part, sets))
            case _:
                return expression


def _branch(updates: Sequence[Update], probability: Fraction = _ONE) -> Branch:
    return Branch(probability, tuple(updates), (_ZERO, _ZERO, _ZERO))
