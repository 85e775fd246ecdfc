"""What the checks ask of a model: which predicates are read, set and reachable, by value."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import chain, islice

from typing_extensions import assert_never

from bbtc.kleene import Truth
from bbtc.markov import reachable
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.hidden import has_hidden_state

Value = tuple[str, Truth]


def plain(formula: mf.Formula) -> Iterator[str]:
    """Predicates whose unknown value makes the formula unknown: all but those in tests."""
    return (each.atom.predicate for each in mf.readings(formula) if each.value in (Truth.TRUE, Truth.FALSE))


def schema_conditions(schema: md.Schema) -> Iterator[mf.Formula]:
    """The precondition, guards and observed condition of an action."""
    yield schema.precondition
    yield from me.conditions(schema.effects)
    if isinstance(schema.observe, me.Choice):
        yield from me.conditions(schema.observe)
    elif schema.observe is not None:
        yield schema.observe
    for reading in schema.told:
        yield from (reading.condition, reading.when)


def template_conditions(template: md.Template) -> Iterator[mf.Formula]:
    """The guide's precondition and guards, and the conditions of the body."""
    yield template.precondition
    if template.effect is not None:
        yield from me.conditions(template.effect)
    yield from md.conditions(template.body)


def all_conditions(model: md.Model) -> Iterator[mf.Formula]:
    """Every condition of a model."""
    for schema in model.schemas.values():
        yield from schema_conditions(schema)
    for rule in model.rules:
        yield rule.condition
    for sensor in model.sensors:
        yield sensor.condition
        yield md.facts_told(sensor.sensed)
    for template in model.templates.values():
        yield from template_conditions(template)
    yield from (clause.condition for clause in model.init.clauses)
    if model.goal is not None:
        yield model.goal


def observed(schema: md.Schema) -> set[str]:
    """Predicates that ``:observe`` makes known."""
    found = {atom.predicate for reading in schema.told for atom in mf.atoms(reading.condition)}
    if schema.observe is not None:
        found |= {atom.predicate for atom in mf.atoms(md.facts_told(schema.observe))}
    return found


@dataclass(slots=True)
class Reached:
    """The values that some atom of each predicate can have, and the actions that can apply, if
    arguments are ignored and nothing is ever undone: whatever is not here never happens."""

    values: dict[Value, None] = field(default_factory=dict)
    actions: dict[str, None] = field(default_factory=dict)

    def possible(self, formula: mf.Formula, negative: bool = False) -> bool:
        """Whether the condition may be true at some time."""
        match formula:
            case mf.Atom(predicate):
                return (predicate, Truth.FALSE if negative else Truth.TRUE) in self.values
            case mf.Test(kind, atom):
                unknown = (kind == "unknown") is not negative
                return not unknown or (atom.predicate, Truth.UNKNOWN) in self.values
            case mf.Equal() | mf.Compare():
                return True
            case mf.Not(part):
                return self.possible(part, not negative)
            case mf.And(parts) | mf.Or(parts):
                every = isinstance(formula, mf.And) is not negative
                return (all if every else any)(self.possible(part, negative) for part in parts)
            case mf.Quantified(_, _, part):
                return self.possible(part, negative)
            case _:
                assert_never(formula)


@dataclass(eq=False)
class Known:
    """A model, and what is found out about it: once, at first use."""

    model: md.Model

    @cached_property
    def conditions(self) -> tuple[mf.Formula, ...]:
        """Every condition."""
        return tuple(all_conditions(self.model))

    @cached_property
    def readings(self) -> tuple[mf.Reading, ...]:
        """Every atom in them."""
        return tuple(reading for formula in self.conditions for reading in mf.readings(formula))

    @cached_property
    def reached(self) -> Reached:
        """What can be so, and what can happen, in a model with a problem."""
        return reached(self.model)

    @cached_property
    def relevant(self) -> set[str]:
        """The actions that can matter to the goal."""
        return relevant(self.model)


def reached(model: md.Model) -> Reached:
    """Predicate-level reachability from the initial state of a model with a problem."""
    result = Reached()
    for name in model.predicates:
        if md.is_number(name):  # what numbers can be is not traced
            result.values.update({(name, value): None for value in (Truth.TRUE, Truth.FALSE)})
    given: dict[str, set[Truth]] = {}
    for fact in model.init.facts:
        given.setdefault(fact.predicate, set()).add(fact.value)
        result.values[fact.predicate, fact.value] = None
        if fact.value is Truth.UNKNOWN and has_hidden_state(model):
            result.values.update({(fact.predicate, value): None for value in (Truth.TRUE, Truth.FALSE)})
    result.values.update({(name, value): None for name in model.thresholds for value in Truth})
    for choice in model.init.choices:
        for leaf in me.settings(choice):
            result.values[leaf.predicate, leaf.value] = None
            if isinstance(choice, me.Choice) and choice.oneof:
                # Nobody knows which of them it is.
                result.values[leaf.predicate, Truth.UNKNOWN] = None
    for clause in model.init.clauses:
        # Uncertain: any of the atoms may have any value.
        for atom in mf.atoms(clause.condition):
            result.values.update({(atom.predicate, value): None for value in Truth})
    for name, predicate in model.predicates.items():
        # Of a predicate with arguments some atom is false, or so it is taken.
        if predicate.parameters or Truth.FALSE in given.get(name, {Truth.FALSE}):
            result.values[name, Truth.FALSE] = None
        if predicate.derived:
            result.values[name, Truth.FALSE] = None
    _close(model, result)
    return result


def _close(model: md.Model, result: Reached) -> None:
    """Round by round; in each, only what reads a predicate that got a new value in the one before is
    looked at."""
    steps: list[tuple[set[str], Callable[[], None]]] = [
        *((_read_in([rule.condition]), partial(_conclude, rule, result)) for rule in model.rules),
        *(
            (_read_in(schema_conditions(schema)) | observed(schema), partial(_happen, schema, result))
            for schema in model.schemas.values()
        ),
        *(
            (_read_in([sensor.condition, md.facts_told(sensor.sensed)]), partial(_sense, sensor, result))
            for sensor in model.sensors
        ),
    ]
    readers: dict[str, list[int]] = {}
    for number, (reads, _) in enumerate(steps):
        for name in reads:
            readers.setdefault(name, []).append(number)
    due: Iterable[int] = range(len(steps))
    while due:
        before = len(result.values)
        for number in due:
            steps[number][1]()
        fresh = {name for name, _ in islice(reversed(result.values), len(result.values) - before)}
        due = sorted({number for name in fresh for number in readers.get(name, ())})


def _read_in(formulas: Iterable[mf.Formula]) -> set[str]:
    return {atom.predicate for formula in formulas for atom in mf.atoms(formula)}


def _conclude(rule: md.Rule, result: Reached) -> None:
    if result.possible(rule.condition):
        result.values[rule.predicate, Truth.TRUE] = None
    if any((name, Truth.UNKNOWN) in result.values for name in plain(rule.condition)):
        result.values[rule.predicate, Truth.UNKNOWN] = None


def _happen(schema: md.Schema, result: Reached) -> None:
    if schema.name in result.actions or result.possible(schema.precondition):
        result.actions[schema.name] = None
        _apply(schema.effects, result)
        _tell(observed(schema), result)


def _sense(sensor: md.Sensor, result: Reached) -> None:
    if result.possible(sensor.condition):
        _tell({atom.predicate for atom in mf.atoms(md.facts_told(sensor.sensed))}, result)


def _tell(predicates: set[str], result: Reached) -> None:
    """What was unknown turns out to be true, or false."""
    for name in sorted(predicates):
        if (name, Truth.UNKNOWN) in result.values:
            result.values.update({(name, value): None for value in (Truth.TRUE, Truth.FALSE)})


def _apply(effect: me.Effect, result: Reached) -> None:
    match effect:
        case me.Set(predicate, _, value):
            result.values[predicate, value] = None
        case me.Add() | me.Change():
            return
        case me.Together(parts):
            for part in parts:
                _apply(part, result)
        case me.When(condition, inner):
            if result.possible(condition):
                _apply(inner, result)
        case me.ForEach(_, inner):
            _apply(inner, result)
        case me.Choice(branches):
            for branch in branches:
                _apply(branch.effect, result)
        case _:
            assert_never(effect)


def relevant(model: md.Model) -> set[str]:
    """The actions that can matter to the goal, a reward metric or a template, as predicates tell: checks
    look at models that may be too large to ground. Grounding knows atoms, and finds more
    (:mod:`bbtc.ground.pruning.relevance`, :mod:`bbtc.ground.pruning.prune`)."""
    setters, rules = _setters(model)

    def leads(node: tuple[bool, str]) -> Iterator[tuple[bool, str]]:
        is_action, name = node
        if is_action:
            if name not in model.schemas:
                return iter(())
            kept = (
                (False, md.number_predicate(change.function))
                for change in me.changes(model.schemas[name].effects)
                if (range_ := model.functions[change.function].range) is not None and range_.blocks
            )
            return chain(read(schema_conditions(model.schemas[name])), kept)
        asked = model.thresholds.get(name)
        return chain(
            read(rule.condition for rule in rules.get(name, ())),
            read(() if asked is None else (asked.condition,)),
            ((True, action) for action in setters.get(name, ())),
        )

    def read(formulas: Iterable[mf.Formula]) -> Iterator[tuple[bool, str]]:
        return ((False, predicate) for predicate in _read_in(formulas))

    start = [] if model.goal is None else [*read([model.goal])]
    for template in model.templates.values():
        start += read(template_conditions(template))
        start += [(True, call.name) for call in md.calls(template.body) if call.kind == "action"]
    for sensor in model.sensors:
        start += read([sensor.condition, md.facts_told(sensor.sensed)])
    for name, schema in model.schemas.items():
        if schema.tells or (model.metric == "reward" and me.earns(schema.effects)):
            start.append((True, name))
    return {name for is_action, name in reachable(start, leads) if is_action}


def _setters(model: md.Model) -> tuple[dict[str, list[str]], dict[str, list[md.Rule]]]:
    """By predicate: the actions that set it, and the rules that derive it."""
    setters: dict[str, list[str]] = {}
    for name, schema in model.schemas.items():
        for predicate in {leaf.predicate for leaf in me.settings(schema.effects)}:
            setters.setdefault(predicate, []).append(name)
    rules: dict[str, list[md.Rule]] = {}
    for rule in model.rules:
        rules.setdefault(rule.predicate, []).append(rule)
    return setters, rules
