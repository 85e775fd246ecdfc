"""From the model to the ground task: :func:`ground`."""

from __future__ import annotations

from fractions import Fraction

from typing_extensions import assert_never

from bbtc.diagnostics import Diagnostic, Report, Severity
from bbtc.ground import task as gt
from bbtc.ground.atoms import Atoms, Binding
from bbtc.ground.condition import FALSE, Condition, conjunction, evaluate
from bbtc.ground.datalog import Row
from bbtc.ground.effects import EffectGrounder
from bbtc.ground.normal import normalise
from bbtc.ground.prune import prune
from bbtc.ground.reach import reach
from bbtc.ground.start import Beginning, beginning
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf


def ground(model: md.Model, report: Report, limits: Limits) -> gt.Task:
    """The ground task of a model: reachable and relevant, static facts folded away.

    Raises :class:`bbtc.diagnostics.BbtcError` with everything in ``report`` where the model cannot
    be grounded or its goal is unreachable even if nothing were ever undone, and
    :class:`bbtc.diagnostics.LimitReached` at a limit.
    """
    return prune(instantiate(model, report, limits))


def instantiate(model: md.Model, report: Report, limits: Limits) -> gt.Task:
    """:func:`ground` without leaving out what cannot matter to the goal."""
    _refuse(model, report)
    begin = beginning(model, report, limits)
    report.raise_errors()
    reached = reach(model, begin, limits)
    builder = _TaskBuilder(model, Atoms(model, reached), report, begin)
    goal = builder.goal()
    report.raise_errors()
    actions = builder.actions(reached.actions)
    templates = builder.templates(reached.templates)
    initial = builder.initial()
    report.raise_errors()
    if all(evaluate(goal, state.values) is Truth.TRUE for state in initial):
        report.warning("BBT0413", "the goal already holds at the start", model.goal_span)
    return gt.Task(
        domain=model.domain,
        problem=model.problem or "",
        variables=builder.atoms.variables,
        initial=initial,
        goal=goal,
        actions=actions,
        templates=templates,
        goal_probability=model.goal_probability,
        goal_reward=model.goal_reward,
        metric=model.metric,
        signatures=_signatures(model),
        goal_span=model.goal_span,
    )


def _refuse(model: md.Model, report: Report) -> None:
    """Constructs that are read, but cannot be grounded yet."""
    for schema in model.schemas.values():
        if schema.observe is not None:
            report.error(
                "BBT0406",
                f"`:observe` of action `{schema.name}` cannot be grounded yet",
                schema.observe_span,
                "write it as an effect: `(probabilistic 1/2 p 1/2 (not p))` under `(unknown p)`",
            )
    for sensor in model.sensors:
        report.error("BBT0407", f"sensor `{sensor.name}` cannot be grounded yet", sensor.span)
    if model.goal is None:
        report.error(
            "BBT0411",
            f"problem `{model.problem}` has no goal to plan for" if model.problem else "no problem is given",
            model.problem_span,
            "bbtc plans for a goal; a metric alone is none",
        )


def _signatures(model: md.Model) -> tuple[gt.Signature, ...]:
    actions = [
        gt.Signature("action", schema.name, tuple(p.name[1:] for p in schema.parameters))
        for schema in model.schemas.values()
    ]
    predicates = [
        gt.Signature("predicate", predicate.name, tuple(p.name[1:] for p in predicate.parameters))
        for predicate in model.predicates.values()
    ]
    return tuple(sorted([*actions, *predicates], key=lambda each: (each.kind, each.symbol)))


class _TaskBuilder:
    def __init__(self, model: md.Model, atoms: Atoms, report: Report, begin: Beginning) -> None:
        self.model = model
        self.atoms = atoms
        self.report = report
        self.begin = begin
        self.effects = EffectGrounder(atoms, report)
        self._actions: dict[str, gt.GroundAction] = {}
        self._templates: dict[str, gt.GroundTemplate] = {}

    # --- actions -----------------------------------------------------------------------------

    def actions(self, rows: list[list[Row]]) -> tuple[gt.GroundAction, ...]:
        """Every action that can ever apply."""
        for schema, bindings in zip(self.model.schemas.values(), rows, strict=True):
            block = normalise(schema.effect)
            names = [parameter.name for parameter in schema.parameters]
            for row in bindings:
                binding = dict(zip(names, row, strict=True))
                precondition = self.atoms.condition(schema.precondition, binding, strict=True)
                if precondition == FALSE:
                    continue
                factors, cost = self.effects.factors(block, binding)
                action = gt.GroundAction(
                    schema.name,
                    self._args(row),
                    precondition,
                    factors or (gt.NO_CHANGE,),
                    cost if self.model.counts_cost else Fraction(1),
                    schema.span,
                )
                self._actions[action.name] = action
        return tuple(action for _, action in sorted(self._actions.items()))

    def _args(self, row: Row) -> tuple[str, ...]:
        names = self.atoms.names
        return tuple([names[index] for index in row])

    # --- templates ---------------------------------------------------------------------------

    def templates(self, rows: list[list[Row]]) -> tuple[gt.GroundTemplate, ...]:
        """Every template whose guide can apply, and those they call."""
        for template, bindings in zip(self.model.templates.values(), rows, strict=True):
            for row in bindings:
                self._template(template, row)
        return tuple(template for _, template in sorted(self._templates.items()))

    def _template(self, template: md.Template, row: Row) -> str:
        args = self._args(row)
        name = gt.ground_name(template.name, args)
        if name not in self._templates:
            binding = dict(zip([p.name for p in template.parameters], row, strict=True))
            factors: tuple[gt.Factor, ...] = ()
            if template.effect is not None:
                factors, _ = self.effects.factors(normalise(template.effect), binding)
            precondition = self.atoms.condition(template.precondition, binding, strict=True)
            # Templates do not recurse, so the depth is bounded by their number.
            (body,) = self._body(template.body, binding)
            self._templates[name] = gt.GroundTemplate(
                template.name, args, precondition, factors, body, template.span
            )
        return name

    def _body(self, body: md.Body, binding: Binding) -> list[gt.Body]:
        match body:
            case md.BodyControl(kind, children):
                made = [each for child in children for each in self._body(child, binding)]
                return [gt.BodyControl(kind, tuple(made))]
            case md.BodyCondition(condition):
                return [gt.BodyCondition(self.atoms.condition(condition, binding))]
            case md.BodyCall():
                return [self._call(body, binding)]
            case md.BodyForeach(parameters, child):
                every = self.atoms.bindings(parameters, binding)
                return [each for inner in every for each in self._body(child, inner)]
            case _:
                assert_never(body)

    def _call(self, call: md.BodyCall, binding: Binding) -> gt.Body:
        """A called action that can never apply fails, as its precondition would."""
        row = self.atoms.row(call.args, binding)
        if call.kind == "action":
            name = gt.ground_name(call.name, self._args(row))
            return gt.BodyAction(name) if name in self._actions else gt.BodyCondition(FALSE)
        template = self.model.templates[call.name]
        if any(i not in self.atoms.members(p.types) for i, p in zip(row, template.parameters, strict=True)):
            return gt.BodyCondition(FALSE)
        return gt.BodyTemplate(self._template(template, row))

    # --- initial states and goal -------------------------------------------------------------

    def initial(self) -> tuple[gt.InitialState, ...]:
        """The initial states, equal ones merged."""
        variables = self.atoms.variables
        merged: dict[tuple[Truth, ...], Fraction] = {}
        for probability, world in self.begin.states:
            facts = {**self.begin.facts, **world} if world else self.begin.facts
            values = tuple(facts.get((each.predicate, each.args), Truth.FALSE) for each in variables)
            merged[values] = merged.get(values, Fraction(0)) + probability
        return tuple(gt.InitialState(probability, values) for values, probability in merged.items())

    def goal(self) -> Condition:
        """The goal; an error names each part of it that nothing can ever make true."""
        assert self.model.goal is not None
        parts = []
        for part in _conjuncts(self.model.goal):
            if self.atoms.condition(part, {}, strict=True) == FALSE:
                self._unreachable(part)
            else:
                parts.append(self.atoms.condition(part, {}))
        return conjunction(parts)

    def _unreachable(self, part: mf.Formula) -> None:
        span = part.span or self.model.goal_span
        shown = " ".join(span.text.split()) if span is not None else "the goal"
        shown = shown if len(shown) <= 60 else shown[:57] + "..."
        self.report.add(
            Diagnostic(
                "BBT0412",
                f"the goal cannot be reached: no action ever achieves `{shown}`",
                span,
                self._achievers(part),
                Severity.ERROR,
            )
        )

    def _achievers(self, part: mf.Formula) -> str | None:
        """What could set the predicate of an unreachable literal, if it is one."""
        atom = part.part if isinstance(part, mf.Not) else part
        if not isinstance(atom, mf.Atom):
            return None
        value = Truth.FALSE if isinstance(part, mf.Not) else Truth.TRUE
        setters = [
            schema.name
            for schema in self.model.schemas.values()
            if any(
                isinstance(leaf, me.Set) and leaf.predicate == atom.predicate and leaf.value is value
                for leaf in me.leaves(schema.effect)
            )
        ]
        if not setters:
            return f"no action makes `{atom.predicate}` {value.word}"
        listed = ", ".join(f"`{name}`" for name in setters[:5])
        return f"only {listed} could, but never with these objects or never at all: check the preconditions"


def _conjuncts(formula: mf.Formula) -> list[mf.Formula]:
    if isinstance(formula, mf.And):
        return [each for part in formula.parts for each in _conjuncts(part)]
    return [formula]
