"""From reachable bindings to a ground task: actions, templates and initial states made."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import compress, repeat
from operator import itemgetter

from typing_extensions import assert_never

from bbtc.diagnostics import Diagnostic, Report
from bbtc.durations import Duration, LogNormal
from bbtc.ground import task as gt
from bbtc.ground.condition import FALSE, Condition, conjunction, evaluate
from bbtc.ground.effects import EffectLowering, LoweredDuration, LoweredEffect, LoweredTimeOut, arrange
from bbtc.ground.events import clashes
from bbtc.ground.goal import unreachable
from bbtc.ground.lower import Env, Frame, Lowered, Lowering, extend, projection
from bbtc.ground.normal import conjuncts, normalise, timing_terms
from bbtc.ground.numbers.digits import digits_of, is_digit
from bbtc.ground.pruning.renumber import reordered
from bbtc.ground.reachability.atoms import Atoms
from bbtc.ground.reachability.bulk import Shared, consumed, instances
from bbtc.ground.reachability.reach import Reach, reach
from bbtc.ground.reachability.usage import called
from bbtc.ground.refused import refused
from bbtc.ground.start import Beginning, beginning
from bbtc.ground.universe import Row
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.model import domain as md
from bbtc.rounding import too_long


def reached_from(model: md.Model, report: Report, limits: Limits) -> tuple[Beginning, Reach]:
    """The start of a model, and what can be reached from it. Raises as
    :func:`bbtc.ground.instantiate.ground` does."""
    _refuse(model, report)
    begin = beginning(model, report, limits)
    report.raise_errors()
    reached = reach(model, begin, limits)
    limits.check_actions(sum(map(len, reached.actions)) + sum(map(len, reached.templates)))
    return begin, reached


def goal_of(model: md.Model, atoms: Atoms, report: Report, limits: Limits) -> Condition:
    """The goal. Raises with an error for each part of it that nothing can ever make true."""
    assert model.goal is not None
    lowering = Lowering(atoms, limits, report)
    parts = []
    for part in conjuncts(model.goal):
        if lowering.is_never(part):
            report.add(unreachable(model, part, atoms, limits))
        else:
            parts.append(lowering.ground(part))
    report.raise_errors()
    return conjunction(parts)


def _refuse(model: md.Model, report: Report) -> None:
    """Constructs that are read, but cannot be grounded yet."""
    for diagnostic in refused(model):
        report.add(diagnostic)
    if model.problem is None and model.goal is None:
        hint = "bbtc plans for a goal; a metric alone is none"
        report.error("BBT0411", "no problem is given", model.problem_span, hint)


def _signatures(model: md.Model) -> tuple[gt.Signature, ...]:
    actions = [
        gt.Signature("action", schema.name, tuple(p.name[1:] for p in schema.parameters))
        for schema in model.schemas.values()
        if schema.exogenous is None
    ]
    predicates = [
        gt.Signature("predicate", predicate.name, tuple(p.name[1:] for p in predicate.parameters))
        for predicate in model.predicates.values()
        if predicate.name not in model.thresholds and not is_digit(model, predicate.name)
    ]
    numbers = [
        gt.Signature("function", function.name, tuple(p.name[1:] for p in function.parameters))
        for function in model.functions.values()
        if function.range is not None
    ]
    return tuple(sorted([*actions, *predicates, *numbers], key=lambda each: (each.kind, each.symbol)))


class TaskBuilder:
    """Makes the task of what is reachable. ``lowering`` grounds conditions that are no part of it, before
    :meth:`task` is called: they may ask for variables."""

    def __init__(self, atoms: Atoms, report: Report, begin: Beginning, limits: Limits) -> None:
        self.model = atoms.model
        self.limits = limits
        self.reached = atoms.reach
        self.report = report
        self.begin = begin
        self.universe = atoms.universe
        self.atoms = atoms
        self.lowering = Lowering(atoms, limits, report)
        self.effects = EffectLowering(self.lowering, report)
        self._made: set[str] = set()
        self._asked: dict[str, tuple[str, Row]] = {}
        self._rows: dict[str, set[Row]] = {}
        self._happening: dict[str, list[gt.GroundAction]] = {}
        """By event, its instances."""
        self._makers = {
            name: _TemplateMaker(self, template) for name, template in self.model.templates.items()
        }

    def task(self, rows: list[list[Row]]) -> gt.Task:
        """The task with the actions of the given rows (which are used up), in the order of the
        model's schemas."""
        model, report, limits = self.model, self.report, self.limits
        goal = goal_of(model, self.atoms, report, limits)
        actions = self._actions(rows)
        events = self._events()
        templates = self._all_templates()
        # The last of them, since conditions ask for variables.
        variables = self.atoms.variables(digits_of(model))
        initial = self._initial(variables)
        for finding in (*clashes(events, variables, limits), *self._unknown_rates(events, actions)):
            report.add(finding)
        report.raise_errors()
        if all(evaluate(goal, state.values) is Truth.TRUE for state in initial):
            report.warning("BBT0413", "the goal already holds at the start", model.goal_span)
        limits.check_time("grounding")
        task = gt.Task(
            domain=model.domain,
            problem=model.problem or "",
            variables=variables,
            initial=initial,
            goal=goal,
            actions=actions,
            templates=templates,
            goal_probability=model.goal_probability,
            goal_reward=model.goal_reward,
            metric=model.metric,
            signatures=_signatures(model),
            goal_span=model.goal_span,
            events=events,
        )
        order = self.atoms.order()
        return task if order == list(range(len(variables))) else reordered(task, order)

    # --- actions -----------------------------------------------------------------------------

    def _actions(self, rows: list[list[Row]]) -> tuple[gt.GroundAction, ...]:
        """Every action that can ever apply, sorted by name."""
        names = called(self.model)
        made: dict[str, list[gt.GroundAction]] = {}
        for schema, each in zip(self.model.schemas.values(), rows, strict=True):
            if schema.exogenous is not None:
                self._happening[schema.name] = self._instances(schema, each)
                continue
            made[schema.name] = self._instances(schema, each)
            if schema.name in names:
                self._rows[schema.name] = {self.universe.row(action.args) for action in made[schema.name]}
        ordered = (action for name in sorted(made, key=lambda name: f"{name}(") for action in made[name])
        if self.universe.sorts_like_names:
            return tuple(ordered)
        return tuple(sorted(ordered, key=lambda action: action.name))

    def _instances(self, schema: md.Schema, rows: list[Row]) -> list[gt.GroundAction]:
        """The actions of a schema with the given rows, which are used up."""
        conditions = self.lowering.reached(schema.precondition, schema.parameters)
        block = self.reached.usage.blocks[schema.name] if schema.during is None else normalise(schema.effect)
        effects = self.effects.reached(block, schema.parameters, schema.span)
        unit, counts_cost = Fraction(1), self.model.counts_cost
        made: list[gt.GroundAction] = []
        for some in consumed(rows):
            self.limits.check_time("grounding")
            found = conditions.all(some)
            met = [condition is not FALSE for condition in found]
            chunk, found = list(compress(some, met)), list(compress(found, met))
            done = effects.all(chunk)
            if self.effects.changes.blocking:
                found = self.effects.changes.kept_within(found, [factors for factors, _ in done])
                met = [condition is not FALSE for condition in found]
                chunk, found = list(compress(chunk, met)), list(compress(found, met))
                done = list(compress(done, met))
            if schema.during is not None and counts_cost:  # it costs nothing where it does not happen
                done = [(self._with_cost(*each), Fraction(0)) for each in done]
            made += instances(
                gt.GroundAction,
                len(chunk),
                repeat(schema.name),
                self.universe.all_args(chunk),
                found,
                [factors or _NO_FACTORS for factors, _ in done],
                map(itemgetter(1), done) if counts_cost else repeat(unit),
                repeat(()),
                repeat(schema.uninterruptible),
                repeat(schema.span),
                *self._interruptions(schema, chunk),
            )
        return self._timed(schema, made)

    def _timed(self, schema: md.Schema, made: list[gt.GroundAction]) -> list[gt.GroundAction]:
        """The actions of a schema with how long they take, and when they are given up."""
        if schema.duration is None and schema.timeout is None:
            return made
        used = list(timing_terms(schema.duration, schema.timeout))
        slots, frame = projection(self.universe, schema.parameters, used)
        takes, most = schema.duration, schema.timeout
        duration = None if takes is None else LoweredDuration(self.effects, takes, frame)
        timeout = None if most is None else LoweredTimeOut(self.effects, most, frame)

        def timing(row: Row) -> tuple[Duration | None, Fraction | None]:
            env = frame.env(row)
            limit = None if timeout is None else timeout.seconds(env)
            return None if duration is None else duration.of(env), limit

        rows = [self.universe.row(action.args) for action in made]
        found = Shared(slots, len(schema.parameters), lambda some: list(map(timing, some))).all(rows)
        return [
            replace(action, duration=seconds, timeout=limit)
            for action, (seconds, limit) in zip(made, found, strict=True)
        ]

    def _interruptions(
        self, schema: md.Schema, rows: list[Row]
    ) -> tuple[Iterable[Condition | None], Iterable[tuple[gt.Factor, ...]]]:
        """Under which condition each instance goes on, and what happens where it does not."""
        if schema.during is None:
            return repeat(None), repeat(())
        frame = Frame(self.universe, schema.parameters)
        condition = self.lowering.condition(schema.during, frame)
        abort = self.effects.effect(normalise(schema.on_abort), frame, schema.span)
        envs = [frame.env(row) for row in rows]
        return [condition(env) for env in envs], [self._with_cost(*abort.factors(env)) for env in envs]

    @staticmethod
    def _with_cost(factors: tuple[gt.Factor, ...], cost: Fraction) -> tuple[gt.Factor, ...]:
        """What happens, with the cost that is certain among it."""
        return factors if not cost else arrange([*factors, gt.Factor((gt.Outcome(gt.ONE, (), cost=cost),))])

    # --- events ------------------------------------------------------------------------------

    def _events(self) -> tuple[gt.GroundEvent, ...]:
        """Every event that can ever happen, by round and name."""
        rounds = md.rounds_of(self.model)
        rates = {each.name: each.exogenous.per for each in self.model.events if each.exogenous is not None}
        found = [
            gt.GroundEvent(
                each.schema,
                each.args,
                each.precondition,
                self._with_cost(each.factors, each.cost if self.model.counts_cost else Fraction(0)),
                rounds[name],
                each.span,
                rates[name],
            )
            for name, instances_ in self._happening.items()
            for each in instances_
        ]
        return tuple(sorted(found, key=lambda event: (event.round, event.name)))

    @staticmethod
    def _unknown_rates(
        events: Iterable[gt.GroundEvent], actions: Iterable[gt.GroundAction]
    ) -> Iterator[Diagnostic]:
        """An error for each kind of action beside which events by time cannot be drawn."""
        by_time = [event for event in events if event.rate == "second"]
        told: set[str] = set()
        for action in actions if by_time else ():
            if isinstance(action.duration, LogNormal) and action.schema not in told:
                told.add(action.schema)
                message = f"event `{by_time[0].schema}` is drawn by time, and `{action.schema}` is lognormal"
                hint = "give it another duration: `(triangular least likely most)`, or `(empirical …)`"
                yield Diagnostic("BBT0452", message, action.span, hint)

    def is_action(self, name: str, row: Row) -> bool:
        """Whether an action with these arguments can ever apply."""
        return row in self._rows[name]

    # --- templates ---------------------------------------------------------------------------

    def _all_templates(self) -> tuple[gt.GroundTemplate, ...]:
        """Every template whose guide can apply, and those they call, sorted by name."""
        for name, rows in zip(self.model.templates, self.reached.templates, strict=True):
            for row in rows:
                self.template(name, row)
        made: dict[str, gt.GroundTemplate] = {}
        while self._asked:  # those that a template calls are asked for while it is made
            self.limits.check_time("grounding")
            name, (template, row) = self._asked.popitem()
            made[name] = self._makers[template].make(row)
            self._made.add(name)
        return tuple(template for _, template in sorted(made.items()))

    def template(self, template: str, row: Row) -> str:
        """The name of a ground template, which will be made if it is new."""
        name = gt.ground_name(template, self.universe.args(row))
        if name not in self._made:
            self._asked[name] = template, row
        return name

    # --- initial states ----------------------------------------------------------------------

    def _initial(self, variables: tuple[gt.Variable, ...]) -> tuple[gt.InitialState, ...]:
        """The initial states, equal ones merged."""
        merged: dict[tuple[Truth, ...], Fraction] = {}
        for probability, world in self.begin.states:
            facts = {**self.begin.facts, **world} if world else self.begin.facts
            values = tuple(facts.get((each.predicate, each.args), Truth.FALSE) for each in variables)
            merged[values] = merged.get(values, Fraction(0)) + probability
        if any(map(too_long, merged.values())):
            message = "the probability of an initial state has too many digits"
            self.report.error("BBT0113", message, self.model.problem_span)
        return tuple(gt.InitialState(probability, values) for values, probability in merged.items())


class _TemplateMaker:
    """One template, compiled when first asked for."""

    def __init__(self, builder: TaskBuilder, template: md.Template) -> None:
        self.builder = builder
        self.template = template
        self.frame = Frame(builder.universe, template.parameters)
        self._compiled: tuple[Lowered, LoweredEffect | None, _Bodies] | None = None

    def make(self, row: Row) -> gt.GroundTemplate:
        """The ground template for an argument row."""
        if self._compiled is None:
            lowering, template = self.builder.lowering, self.template
            self._compiled = (
                lowering.condition(template.precondition, self.frame),
                None
                if template.effect is None
                else self.builder.effects.effect(normalise(template.effect), self.frame, template.span),
                self._body(template.body),
            )
        precondition, guide, body = self._compiled
        env = self.frame.env(row)
        factors = () if guide is None else guide.factors(env)[0]
        (root,) = body(env)
        args = self.builder.universe.args(row)
        return gt.GroundTemplate(
            self.template.name, args, precondition(env), factors, root, self.template.span
        )

    def _body(self, body: md.Body) -> _Bodies:
        match body:
            case md.BodyControl(kind, children):
                parts = [self._body(child) for child in children]
                return lambda env: [gt.BodyControl(kind, tuple(each for part in parts for each in part(env)))]
            case md.BodyRetry(attempts, child):
                tried = self._body(child)
                return lambda env: [gt.BodyControl("retry-until-success", tuple(tried(env)), attempts)]
            case md.BodyCondition(formula):
                condition = self.builder.lowering.condition(formula, self.frame)
                return lambda env: [gt.BodyCondition(condition(env))]
            case md.BodyCall():
                return self._call(body)
            case md.BodyForeach(parameters, child):
                members = self.builder.universe.members
                loops = [(self.frame.slot(p.name), members(p.types)) for p in parameters]
                inner, spend = self._body(child), self.builder.lowering.spend
                return lambda env: [each for bound in extend(env, loops, spend) for each in inner(bound)]
            case _:
                assert_never(body)

    def _call(self, call: md.BodyCall) -> _Bodies:
        """A called action that can never apply fails, as its precondition would."""
        builder, name, rows = self.builder, call.name, self.frame.rows(call.args)
        if call.kind == "action":

            def action(env: Env) -> list[gt.Body]:
                row = rows(env)
                if builder.is_action(name, row):
                    return [gt.BodyAction(gt.ground_name(name, builder.universe.args(row)))]
                return [gt.BodyCondition(FALSE)]

            return action
        types = [parameter.types for parameter in builder.model.templates[name].parameters]

        def template(env: Env) -> list[gt.Body]:
            row = rows(env)
            # An argument of a type too general may not fit.
            if all(n in builder.universe.members(t) for n, t in zip(row, types, strict=True)):
                return [gt.BodyTemplate(builder.template(name, row))]
            return [gt.BodyCondition(FALSE)]

        return template


_Bodies = Callable[[Env], "list[gt.Body]"]
_NO_FACTORS = (gt.NO_CHANGE,)
