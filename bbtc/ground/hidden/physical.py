"""The physical task: what grounding makes of a model as if nothing were hidden, and what is hidden in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

from bbtc.diagnostics import Report
from bbtc.ground import task as gt
from bbtc.ground.condition import Condition, Constant, Is, Known, replaced
from bbtc.ground.lower import Frame, Lowered, Lowering
from bbtc.ground.normal import conjuncts, normal_form
from bbtc.ground.reachability.atoms import Atoms
from bbtc.ground.refused import noise
from bbtc.ground.start import Key, Prior
from bbtc.ground.task_builder import TaskBuilder, reached_from
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.source import Span


@dataclass(frozen=True, slots=True)
class Draw:
    """:class:`bbtc.ground.start.HiddenDraw` of variables."""

    variables: tuple[int, ...]
    branches: tuple[tuple[Fraction, frozenset[int]], ...]


@dataclass(frozen=True, slots=True)
class Clause:
    """A condition that holds at the start."""

    condition: Condition
    span: Span | None


@dataclass(frozen=True, slots=True)
class Physical:
    """A task in which what is hidden at the start is unknown, and what actions tell of it (``readings``, by
    the action's name). Its conditions are about the world, but for tests whether a fact is known."""

    task: gt.Task
    readings: Mapping[str, tuple[gt.Observation, ...]]
    draws: tuple[Draw, ...]
    clauses: tuple[Clause, ...]
    uncertain: frozenset[int]

    @property
    def start(self) -> tuple[Truth, ...]:
        """The value of each variable at the start."""
        return self.task.initial[0].values


def physical(model: md.Model, report: Report, limits: Limits) -> Physical:
    """The physical task of a model, with everything that is reachable. Raises as
    :func:`bbtc.ground.instantiate.ground` does."""
    begin, reached = reached_from(model, report, limits)
    assert begin.prior is not None
    atoms = Atoms(reached)
    builder = TaskBuilder(atoms, report, begin, limits)
    readings: dict[str, list[gt.Observation]] = {}
    for schema, rows in zip(model.schemas.values(), reached.actions, strict=True):
        if schema.observe is not None:
            limits.check_time("grounding")
            frame = Frame(atoms.universe, schema.parameters)
            told = _told(builder.lowering, schema.observe, frame)
            for row in rows:
                env = frame.env(row)
                made = [gt.Observation(condition(env), accuracy) for condition, accuracy in told]
                made = [each for each in made if not isinstance(each.condition, Constant)]
                readings[gt.ground_name(schema.name, atoms.universe.args(row))] = made
    clauses = [
        Clause(builder.lowering.ground(part), clause.span or part.span)
        for clause in begin.prior.clauses
        for part in conjuncts(normal_form(clause.condition))
    ]
    task = builder.task(reached.actions)
    return _numbered(task, readings, begin.prior, clauses, atoms)


def _told(
    lowering: Lowering, observed: mf.Formula | me.Choice, frame: Frame
) -> list[tuple[Lowered, Fraction]]:
    """What is told, and how likely it is right: every part of a conjunction by itself."""
    if not isinstance(observed, me.Choice):
        return [(lowering.condition(part, frame), Fraction(1)) for part in conjuncts(normal_form(observed))]
    noisy = noise(observed)
    assert noisy is not None  # others are refused
    fact, accuracy = noisy
    return [(lowering.condition(mf.Atom(fact.predicate, fact.args), frame), accuracy)]


def _numbered(
    task: gt.Task,
    readings: Mapping[str, list[gt.Observation]],
    prior: Prior,
    clauses: list[Clause],
    atoms: Atoms,
) -> Physical:
    """All of it over the variables of the task, which may have another order than those of the atoms."""
    renumber = {old: new for new, old in enumerate(atoms.order())}

    def leaf(read: Is | Known) -> Condition:
        return replace(read, variable=renumber[read.variable])

    def variable(key: Key) -> int:
        number = atoms.number(key[0], atoms.universe.row(key[1]))
        assert number is not None  # what is hidden has several values
        return renumber[number]

    draws = [
        Draw(
            tuple(map(variable, draw.atoms)),
            tuple((weight, frozenset(map(variable, true))) for weight, true in draw.branches),
        )
        for draw in prior.draws
    ]
    uncertain = frozenset(map(variable, prior.atoms))
    (first, *_) = task.initial
    values = tuple(
        Truth.UNKNOWN if number in uncertain else value for number, value in enumerate(first.values)
    )
    made = {action.name for action in task.actions}
    return Physical(
        replace(task, initial=(gt.InitialState(Fraction(1), values),)),
        {
            name: tuple(replace(each, condition=replaced(each.condition, leaf)) for each in told)
            for name, told in readings.items()
            if name in made
        },
        tuple(draws),
        tuple(Clause(replaced(each.condition, leaf), each.span) for each in clauses),
        uncertain,
    )
