"""The physical task: what grounding makes of a model as if nothing were hidden, and what is hidden in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from bbtc.diagnostics import Report
from bbtc.ground import task as gt
from bbtc.ground.condition import FALSE, TRUE, Condition, Constant, Is, Known, replaced, variables
from bbtc.ground.lower import Frame, Lowered, Lowering, extend
from bbtc.ground.normal import conjuncts, normal_form
from bbtc.ground.reachability.atoms import Atoms
from bbtc.ground.refused import noise
from bbtc.ground.start import Key, Prior, contradicted
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
    the action's name); ``first`` is what sensors tell at the start. Its conditions are about the world, but
    for tests whether a fact is known."""

    task: gt.Task
    readings: Mapping[str, tuple[gt.Observation, ...]]
    first: tuple[gt.Observation, ...]
    draws: tuple[Draw, ...]
    clauses: tuple[Clause, ...]
    uncertain: frozenset[int]
    observed: frozenset[int]
    """The facts that are declared as always seen: ``first`` and ``readings`` tell them."""
    read: Mapping[str, frozenset[int]]
    """By schema: what the ``:observe`` of its actions tells of."""

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
    for clause in clauses:
        if clause.condition == FALSE:  # of facts that are given, or never true
            contradicted(report, clause.span or model.init.span)
            report.raise_errors()
    sensors = list(_sensed(builder.lowering, model.sensors, limits))
    for name, predicate in model.predicates.items():
        if predicate.observed:
            sensors += [gt.Observation(Is(number, Truth.TRUE)) for number in atoms.numbers[name].values()]
    task = builder.task(reached.actions)
    return _numbered(
        task, readings=readings, sensors=sensors, prior=begin.prior, clauses=clauses, atoms=atoms
    )


def _sensed(lowering: Lowering, sensors: Iterable[md.Sensor], limits: Limits) -> Iterator[gt.Observation]:
    """What each sensor tells, and when."""
    universe = lowering.universe
    for sensor in sensors:
        limits.check_time("grounding")
        frame = Frame(universe, sensor.parameters)
        when = lowering.condition(sensor.condition, frame)
        told = _told(lowering, sensor.sensed, frame)
        loops = [(frame.slot(p.name), universe.members(p.types)) for p in sensor.parameters]
        for env in extend(frame.env([-1] * len(loops)), loops, lowering.spend):
            condition = when(env)
            if condition == FALSE:
                continue
            for sensed, accuracy in told:
                found = sensed(env)
                if not isinstance(found, Constant):
                    yield gt.Observation(found, accuracy, None if condition == TRUE else condition)


def _told(
    lowering: Lowering, observed: mf.Formula | me.Choice, frame: Frame
) -> list[tuple[Lowered, Fraction]]:
    """What is told, and how likely it is right: every part of a conjunction by itself."""
    if not isinstance(observed, me.Choice):
        return [(lowering.condition(normal_form(part), frame), Fraction(1)) for part in conjuncts(observed)]
    noisy = noise(observed)
    assert noisy is not None  # others are refused
    fact, accuracy = noisy
    return [(lowering.condition(mf.Atom(fact.predicate, fact.args), frame), accuracy)]


def _numbered(
    task: gt.Task,
    *,
    readings: Mapping[str, list[gt.Observation]],
    sensors: list[gt.Observation],
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
    observed = {name for name, predicate in atoms.model.predicates.items() if predicate.observed}
    (first, *_) = task.initial
    values = tuple(
        Truth.UNKNOWN if number in uncertain else value for number, value in enumerate(first.values)
    )

    def observation(made: gt.Observation) -> gt.Observation:
        when = None if made.when is None else replaced(made.when, leaf)
        return replace(made, condition=replaced(made.condition, leaf), when=when)

    read: dict[str, set[int]] = {}
    for action in task.actions:
        if action.name in readings:
            of = read.setdefault(action.schema, set())
            of.update(renumber[each] for told in readings[action.name] for each in variables(told.condition))
    told_first = [observation(each) for each in sensors]
    of_sensors = _after_actions(task, told_first)
    return Physical(
        replace(task, initial=(gt.InitialState(Fraction(1), values),)),
        {
            action.name: (*map(observation, readings.get(action.name, ())), *of_sensors[action.name])
            for action in task.actions
        },
        tuple(told_first),
        tuple(draws),
        tuple(Clause(replaced(each.condition, leaf), each.span) for each in clauses),
        uncertain,
        frozenset(number for number, each in enumerate(task.variables) if each.predicate in observed),
        {schema: frozenset(numbers) for schema, numbers in read.items()},
    )


def _after_actions(task: gt.Task, sensors: Sequence[gt.Observation]) -> dict[str, list[gt.Observation]]:
    """What sensors tell after each action, by its name: those that read what it may change."""
    readers: dict[int, list[int]] = {}
    for number, sensor in enumerate(sensors):
        for variable in {*variables(sensor.condition), *variables(sensor.when or TRUE)}:
            readers.setdefault(variable, []).append(number)
    found = {}
    for action in task.actions:
        sets = {variable for effect in gt.effects_of(action.factors) for variable, _ in effect.sets}
        numbers = {number for variable in sets for number in readers.get(variable, ())}
        found[action.name] = [sensors[number] for number in sorted(numbers)]
    return found
