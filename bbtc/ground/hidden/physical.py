"""The physical task: what grounding makes of a model as if nothing were hidden, and what is hidden in it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from bbtc.diagnostics import Report
from bbtc.ground import task as gt
from bbtc.ground.condition import FALSE, TRUE, Condition, Constant, Is, Known, replaced, variables
from bbtc.ground.hidden.repeats import Keeping
from bbtc.ground.lower import Env, Frame, Lowered, Lowering, extend
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
    thresholds: Mapping[int, tuple[Condition, Fraction]]
    """By variable that stands for what is believed: the condition, and how probable it has to be."""
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
    readings: dict[str, list[_Reading]] = {}
    for schema, rows in zip(model.schemas.values(), reached.actions, strict=True):
        if schema.tells:
            limits.check_time("grounding")
            frame = Frame(atoms.universe, schema.parameters)
            told = [] if schema.observe is None else _told(builder.lowering, schema.observe, frame)
            besides = [_besides(builder.lowering, each, frame) for each in schema.told]
            for row in rows:
                env = frame.env(row)
                made = [replace(each, condition=condition(env)) for condition, each in told]
                made += [observed(env) for observed in besides]
                made = [
                    each for each in made if not isinstance(each.condition, Constant) and each.when != FALSE
                ]
                args = atoms.universe.args(row)
                source = (schema.name, args) if schema.repeats else None
                readings[gt.ground_name(schema.name, args)] = [_Reading(each, source) for each in made]
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
            numbers = atoms.numbers[name].values()
            sensors += [_Reading(gt.Observation(Is(number, Truth.TRUE))) for number in numbers]
    thresholds = {}
    for name, threshold in model.thresholds.items():
        frame = Frame(atoms.universe, threshold.parameters)
        believed = builder.lowering.condition(normal_form(threshold.condition), frame)
        for row, number in list(atoms.numbers[name].items()):
            thresholds[number] = believed(frame.env(row)), threshold.at_least
    task = builder.task(reached.actions)
    return _numbered(
        task,
        readings=readings,
        sensors=sensors,
        prior=begin.prior,
        clauses=clauses,
        atoms=atoms,
        thresholds=thresholds,
    )


@dataclass(frozen=True, slots=True)
class _Reading:
    """An observation, and of one that is kept what makes it, by name and arguments."""

    observation: gt.Observation
    source: tuple[str, tuple[str, ...]] | None = None


def _sensed(lowering: Lowering, sensors: Iterable[md.Sensor], limits: Limits) -> Iterator[_Reading]:
    """What each sensor tells, and when."""
    universe = lowering.universe
    for sensor in sensors:
        limits.check_time("grounding")
        frame = Frame(universe, sensor.parameters)
        when = lowering.condition(sensor.condition, frame)
        told = _told(lowering, sensor.sensed, frame)
        loops = [(frame.slot(p.name), universe.members(p.types)) for p in sensor.parameters]
        slots = [slot for slot, _ in loops]
        for env in extend(frame.env([-1] * len(loops)), loops, lowering.spend):
            condition = when(env)
            if condition == FALSE:
                continue
            for sensed, each in told:
                found = sensed(env)
                if not isinstance(found, Constant):
                    made = replace(each, condition=found, when=None if condition == TRUE else condition)
                    args = universe.args(tuple(env[slot] for slot in slots))
                    yield _Reading(made, (sensor.name, args) if sensor.repeats else None)


def _besides(lowering: Lowering, reading: md.Reading, frame: Frame) -> Callable[[Env], gt.Observation]:
    """A reading as an observation, in each environment."""
    condition = lowering.condition(normal_form(reading.condition), frame)
    when = lowering.condition(normal_form(reading.when), frame)

    def observation(env: Env) -> gt.Observation:
        guard = when(env)
        made = None if guard == TRUE else guard
        return gt.Observation(condition(env), reading.accuracy, made, reading.accuracy_false)

    return observation


def _told(
    lowering: Lowering, observed: mf.Formula | me.Choice, frame: Frame
) -> list[tuple[Lowered, gt.Observation]]:
    """What is told, every part of a conjunction by itself, and as what observation, but for the condition."""
    if not isinstance(observed, me.Choice):
        exact = gt.Observation(TRUE)
        return [(lowering.condition(normal_form(part), frame), exact) for part in conjuncts(observed)]
    noisy = noise(observed)
    assert noisy is not None  # others are refused
    fact, accuracy, accuracy_false = noisy
    condition = lowering.condition(mf.Atom(fact.predicate, fact.args), frame)
    return [(condition, gt.Observation(TRUE, accuracy, accuracy_false=accuracy_false))]


def _numbered(
    task: gt.Task,
    *,
    readings: Mapping[str, list[_Reading]],
    sensors: list[_Reading],
    prior: Prior,
    clauses: list[Clause],
    atoms: Atoms,
    thresholds: Mapping[int, tuple[Condition, Fraction]],
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
    asked = {renumber[number]: (replaced(c, leaf), q) for number, (c, q) in thresholds.items()}
    uncertain = frozenset(map(variable, prior.atoms)) - asked.keys()
    observed = {name for name, predicate in atoms.model.predicates.items() if predicate.observed}
    (first, *_) = task.initial
    values = tuple(
        Truth.UNKNOWN if number in uncertain or number in asked else value
        for number, value in enumerate(first.values)
    )

    keeping = Keeping(task)

    def observation(reading: _Reading) -> gt.Observation:
        made = reading.observation
        when = None if made.when is None else replaced(made.when, leaf)
        told = replaced(made.condition, leaf)
        made = replace(made, condition=told, when=when)
        if reading.source is None or not made.noisy:
            return made
        return gt.Observation(keeping.told(made, *reading.source), when=when)

    told_first = [observation(each) for each in sensors]
    of_sensors = _after_actions(task, told_first)
    told_after = {
        action.name: (*map(observation, readings.get(action.name, ())), *of_sensors[action.name])
        for action in task.actions
    }
    found = Physical(
        replace(task, initial=(gt.InitialState(Fraction(1), values),)),
        told_after,
        tuple(told_first),
        tuple(draws),
        tuple(Clause(replaced(each.condition, leaf), each.span) for each in clauses),
        uncertain,
        frozenset(number for number, each in enumerate(task.variables) if each.predicate in observed),
        asked,
        _read(task, readings, renumber),
    )
    return _with_kept(found, keeping) if keeping.facts else found


def _read(
    task: gt.Task, readings: Mapping[str, list[_Reading]], renumber: Mapping[int, int]
) -> dict[str, frozenset[int]]:
    """By schema: what its actions tell of."""
    read: dict[str, set[int]] = {}
    for action in task.actions:
        if action.name in readings:
            of = read.setdefault(action.schema, set())
            told = (reading.observation.condition for reading in readings[action.name])
            of.update(renumber[each] for condition in told for each in variables(condition))
    return {schema: frozenset(numbers) for schema, numbers in read.items()}


def _with_kept(found: Physical, keeping: Keeping) -> Physical:
    """With the facts that readings are wrong that are kept: drawn at the start, and where actions say so."""
    more = [variable for variable, _ in keeping.facts]
    start = gt.InitialState(Fraction(1), (*found.start, *[Truth.UNKNOWN] * len(more)))
    draws = (
        Draw((number,), ((1 - wrong, frozenset()), (wrong, frozenset([number]))))
        for number, wrong in keeping.odds().items()
    )
    return replace(
        found,
        task=replace(
            found.task,
            variables=(*found.task.variables, *more),
            initial=(start,),
            actions=keeping.actions(),
        ),
        draws=(*found.draws, *draws),
        uncertain=found.uncertain.union(keeping.odds()),
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
