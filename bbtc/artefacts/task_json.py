"""The ground task as JSON, in and out. Fields are documented in ``docs/artefacts.md``.

A field that most tasks do not need is written only where it says something, so that what every
tool must read stays small.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal, TypeAlias

from bbtc.artefacts import duration_json, numbers_json
from bbtc.artefacts.bodies_json import at_node, body_to_json, children_at, kind_at
from bbtc.artefacts.conditions import condition_to_json, number_of
from bbtc.artefacts.cursor import At, Faults, check_distinct, clip, optional, run_reader
from bbtc.artefacts.hidden_json import (
    HiddenReader,
    component_to_json,
    observation_to_json,
    true_world,
    true_world_to_json,
)
from bbtc.artefacts.numbers import given_text
from bbtc.artefacts.prior_json import check_sum
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import TRUE, Condition
from bbtc.ground.describe import values_in_words
from bbtc.ground.events import clashes
from bbtc.ground.numbers.occurrences import with_digit_effects
from bbtc.ground.task import (
    Body,
    BodyAction,
    BodyCondition,
    BodyControl,
    BodyTemplate,
    Change,
    Charge,
    Effect,
    Factor,
    GroundAction,
    GroundEvent,
    GroundTemplate,
    InitialState,
    Outcome,
    Signature,
    Task,
    Variable,
    ground_name,
    split_name,
)
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.source import SourceFile
from bbtc.tree.validate import active_templates, body_problems

FORMAT = "bbtc-task"
VERSION = 1

MAX_NESTING = 20
"""Times that chance may be nested in chance."""

Json: TypeAlias = dict[str, object]

# --- out -------------------------------------------------------------------------------------


def task_to_json(task: Task) -> Json:
    """The task as a JSON object."""
    value: Json = {
        "format": FORMAT,
        "version": VERSION,
        "domain": task.domain,
        "problem": task.problem,
        "goal_probability": given_text(task.goal_probability),
    }
    if task.goal_reward:
        value["goal_reward"] = given_text(task.goal_reward)
    if task.metric != "cost":
        value["metric"] = task.metric
    value["variables"] = [_variable_to_json(each) for each in task.variables if each.digit is None]
    if task.numbers:
        value["numbers"] = [numbers_json.number_to_json(number) for number in task.numbers]
    value["initial"] = [
        {
            "p": given_text(state.probability),
            "assign": values_in_words(task.variables, state.values),
        }
        for state in task.initial
    ]
    value["goal"] = condition_to_json(task.goal, task.variables)
    if task.components:
        value["components"] = [component_to_json(component, task) for component in task.components]
    if task.true_worlds and task.origin is None:
        value["true_worlds"] = [true_world_to_json(world) for world in task.true_worlds]
    if task.origin is not None:
        value["origin"] = task_to_json(task.origin)
    value["actions"] = [_action_to_json(action, task) for action in task.actions]
    if task.events:
        value["events"] = [_event_to_json(event, task.variables) for event in task.events]
    if task.templates:
        value["templates"] = [_template_to_json(template, task.variables) for template in task.templates]
    if task.signatures:
        value["signatures"] = [
            {"kind": s.kind, "symbol": s.symbol, "parameters": list(s.parameters)} for s in task.signatures
        ]
    return value


def _variable_to_json(variable: Variable) -> Json:
    value: Json = {"name": variable.name}
    if split_name(variable.name) != (variable.predicate, variable.args):
        value |= {"predicate": variable.predicate, "args": list(variable.args)}
    value |= {"values": [truth.word for truth in variable.values], "hidden": variable.hidden}
    return value | ({"external": True} if variable.external else {})


def _change_to_json(change: Change, task: Task) -> Json:
    local = task.components[change.component].local(task, change.seen)
    value: Json = {"component": change.component}
    if change.seen:
        value["seen"] = [task.variables[variable].name for variable in change.seen]
    value |= _chance_to_json(change.factors, local)
    if change.observations:
        value["observations"] = [observation_to_json(each, local) for each in change.observations]
    return value


def _action_to_json(action: GroundAction, task: Task) -> Json:
    value = {
        "name": action.name,
        "schema": action.schema,
        "args": list(action.args),
        "cost": given_text(action.cost),
        "precondition": condition_to_json(action.precondition, task.variables),
        **_chance_to_json(action.factors, task.variables),
    }
    if action.changes:
        value["changes"] = [_change_to_json(change, task) for change in action.changes]
    if action.uninterruptible:
        value["uninterruptible"] = True
    if action.duration is not None:
        value["duration"] = duration_json.duration_to_json(action.duration)
    if action.timeout is not None:
        value["timeout"] = given_text(action.timeout)
    if action.during is not None:
        value["while"] = condition_to_json(action.during, task.variables)
    if action.on_abort:
        value["on_abort"] = _chance_to_json(action.on_abort, task.variables)
    return value


def _event_to_json(event: GroundEvent, variables: Sequence[Variable]) -> Json:
    value: Json = {
        "name": event.name,
        "schema": event.schema,
        "args": list(event.args),
        "precondition": condition_to_json(event.precondition, variables),
        **_chance_to_json(event.factors, variables),
    }
    value |= {"round": event.round} if event.round else {}
    return value | ({"per": event.rate} if event.rate != "action" else {})


def _chance_to_json(factors: tuple[Factor, ...], variables: Sequence[Variable]) -> Json:
    """``outcomes`` for one plain distribution, ``factors`` for anything more; ``oneof`` tells which
    of the factors have no known probabilities."""
    outcomes = [[_outcome_to_json(o, variables) for o in factor.outcomes] for factor in factors]
    plain = len(factors) == 1 and not any(outcome.factors for outcome in factors[0].outcomes)
    value: Json = {"outcomes": outcomes[0]} if plain else {"factors": outcomes}
    unknown = [number for number, factor in enumerate(factors) if factor.oneof]
    return value | ({"oneof": unknown} if unknown else {})


def _outcome_to_json(outcome: Outcome, variables: Sequence[Variable]) -> Json:
    value: Json = {
        "p": given_text(outcome.probability),
        "effects": [_effect_to_json(effect, variables) for effect in outcome.effects],
    }
    if outcome.factors:
        value |= _chance_to_json(outcome.factors, variables)
        # Never ``outcomes``: an outcome of an outcome would be easy to overlook.
        if "outcomes" in value:
            value["factors"] = [value.pop("outcomes")]
    if outcome.reward:
        value["reward"] = given_text(outcome.reward)
    if outcome.cost:
        value["cost"] = given_text(outcome.cost)
    if outcome.charges:
        value["charges"] = [_charge_to_json(charge, variables) for charge in outcome.charges]
    if outcome.timed_out:
        value["timed_out"] = True
    if outcome.changes:
        # What they do to digits is worked out again when they are read.
        shown = numbers_json.without_digits(outcome.effects, variables)
        value["effects"] = [_effect_to_json(effect, variables) for effect in shown]
        value["numbers"] = numbers_json.changes_to_json(outcome.changes, variables)
    return value


def _charge_to_json(charge: Charge, variables: Sequence[Variable]) -> Json:
    value: Json = {"when": condition_to_json(charge.when, variables)}
    if charge.cost:
        value["cost"] = given_text(charge.cost)
    if charge.reward:
        value["reward"] = given_text(charge.reward)
    return value


def _effect_to_json(effect: Effect, variables: Sequence[Variable]) -> Json:
    values: dict[int, Truth] = {}
    for variable, truth in effect.sets:
        # One value for each variable: the Kleene maximum wins, as between effects.
        values[variable] = max(truth, values.get(variable, truth))
    return {
        "when": None if effect.when is None else condition_to_json(effect.when, variables),
        "set": {variables[variable].name: values[variable].word for variable in sorted(values)},
    }


def _template_to_json(template: GroundTemplate, variables: Sequence[Variable]) -> Json:
    return {
        "name": template.name,
        "template": template.template,
        "args": list(template.args),
        "precondition": condition_to_json(template.precondition, variables),
        **_chance_to_json(template.factors, variables),
        "body": body_to_json(template.body, variables),
    }


# --- in --------------------------------------------------------------------------------------


def task_from_json(value: object, source: SourceFile | None = None) -> Task:
    """Inverse of :func:`task_to_json`. Raises :class:`BbtcError` with everything that is wrong;
    ``source`` is the text the value came from, for the places."""
    return run_reader(lambda faults: read_task(At(value), faults), source)


_WHENCE = {
    "bbtc-task": "`bbtc compile` makes a task of a domain and a problem",
    "bbtc-tree": "`bbtc plan` makes a tree of a task, or of a domain and a problem",
}


def check_header(at: At, name: str, version: int) -> None:
    """Raise a fault unless the value is an object of this format and version."""
    members = dict(at.entries())
    for field in ("format", "version"):
        if field not in members:
            raise at.fault("BBT0602", f"not a {name} artefact: field '{field}' is missing")
    if members["format"].value != name:
        hint = _WHENCE.get(name) if str(members["format"].value) in _WHENCE else None
        raise members["format"].fault("BBT0602", f"not a {name} artefact", hint)
    found = members["version"].value
    if found != version or isinstance(found, bool):
        newer = isinstance(found, int) and found > version
        hint = "it was written by a newer bbtc" if newer else None
        raise members["version"].fault("BBT0602", f"{name} is read in version {version} only", hint)


def read_task(at: At, faults: Faults) -> Task:
    """The task that stands at a place of an artefact. Where it has faults, they go on record and
    the result is of no use."""
    check_header(at, FORMAT, VERSION)
    members = at.members(
        ["format", "version", "domain", "problem", "variables", "initial", "goal", "actions"],
        [
            "numbers",
            "goal_probability",
            "goal_reward",
            "metric",
            "templates",
            "signatures",
            "components",
            "origin",
            "true_worlds",
            "events",
        ],
    )
    variables = faults.each(members["variables"].elements(), _variable)
    for digits in faults.each(optional(members, "numbers"), numbers_json.digits_from_json):
        variables += digits
    faults.stop_if_any()  # every mention of a variable would be a fault of its own
    variables.sort(key=lambda variable: variable.name)
    check_distinct(members["variables"], [variable.name for variable in variables])
    reader = _Reader.of(variables)
    components = tuple(faults.each(optional(members, "components"), reader.component))
    faults.stop_if_any()  # changes name them by number
    reader = replace(reader, components=components)
    actions = faults.each(members["actions"].elements(), reader.action)
    no_goal: Condition = TRUE
    origin = read_task(members["origin"], faults) if "origin" in members else None
    task = Task(
        domain=faults.attempt(members["domain"].string, ""),
        problem=faults.attempt(members["problem"].string, ""),
        variables=reader.variables,
        initial=tuple(faults.each(members["initial"].elements(), reader.initial_state)),
        goal=faults.attempt(lambda: reader.condition(members["goal"]), no_goal),
        actions=tuple(sorted(actions, key=lambda action: action.name)),
        templates=tuple(
            sorted(faults.each(optional(members, "templates"), reader.template), key=lambda t: t.name)
        ),
        goal_probability=faults.attempt(
            lambda: (
                members["goal_probability"].given_probability() if "goal_probability" in members else _ONE
            ),
            _ONE,
        ),
        goal_reward=faults.attempt(
            lambda: members["goal_reward"].given() if "goal_reward" in members else _ZERO, _ZERO
        ),
        metric=faults.attempt(lambda: _metric(members), "cost"),
        signatures=tuple(
            sorted(faults.each(optional(members, "signatures"), _signature), key=lambda s: (s.kind, s.symbol))
        ),
        components=components,
        origin=origin,
        true_worlds=(
            tuple(faults.each(optional(members, "true_worlds"), true_world))
            if origin is None
            else origin.true_worlds
        ),
        events=tuple(
            sorted(faults.each(optional(members, "events"), reader.event), key=lambda e: (e.round, e.name))
        ),
    )
    faults.stop_if_any()
    check_sum(members["initial"], [state.probability for state in task.initial])
    check_distinct(members["actions"], [action.name for action in task.actions])
    _check_events(members, task)
    _check_templates(members, task, faults)
    return task


def _check_events(members: Mapping[str, At], task: Task) -> None:
    """Raise a fault for events that contradict each other, or stand beside hidden facts."""
    if not task.events:
        return
    names = [each.name for each in task.occurrences]
    check_distinct(members["events"], sorted(names))
    if task.components:
        raise members["events"].fault("BBT0604", "events beside hidden facts are not supported")
    for finding in clashes(task.events, task.variables, Limits()):
        raise members["events"].fault("BBT0604", finding.message)


_BODIES = (
    *("sequence", "fallback", "skipper", "retry-until-success"),
    *("condition", "action", "template"),
)
_TEMPLATE_FIELDS = ("name", "template", "args", "precondition", "body")
_ZERO, _ONE = Fraction(0), Fraction(1)


def _metric(members: Mapping[str, At]) -> Literal["cost", "reward"]:
    return (
        "reward" if "metric" in members and members["metric"].word("cost", "reward") == "reward" else "cost"
    )


def _variable(at: At) -> Variable:
    members = at.members(["name", "values"], ["hidden", "predicate", "args", "external"])
    name = members["name"].string()
    if "predicate" in members or "args" in members:
        at.members(["predicate", "args"], list(members))  # both or neither
        predicate, args = members["predicate"].string(), members["args"].strings()
    else:
        predicate, args = split_name(name)
    _check_name(members["name"], predicate, args)
    values = [element.word("true", "false", "unknown") for element in members["values"].elements()]
    if sorted(values) not in (["false", "true"], ["false", "true", "unknown"]):
        raise members["values"].fault("BBT0604", "the values are true, false and, for some, unknown")
    hidden = "hidden" in members and members["hidden"].flag()
    external = "external" in members and members["external"].flag()
    return Variable(predicate, args, three_valued="unknown" in values, hidden=hidden, external=external)


def _check_name(at: At, symbol: str, args: tuple[str, ...]) -> None:
    expected = ground_name(symbol, args)
    if at.string() != expected:
        raise at.fault("BBT0604", f"the name must be '{clip(expected)}', not '{clip(at.string())}'")


def _signature(at: At) -> Signature:
    members = at.members(["kind", "symbol", "parameters"])
    kinds: Mapping[str, Literal["predicate", "action", "function"]]
    kinds = {"predicate": "predicate", "action": "action", "function": "function"}
    kind = kinds[members["kind"].word(*kinds)]
    return Signature(kind, members["symbol"].string(), members["parameters"].strings())


@dataclass(frozen=True, slots=True)
class _Reader(HiddenReader):
    """Reads what refers to the variables of a task."""

    def initial_state(self, at: At) -> InitialState:
        members = at.members(["p", "assign"])
        values = self._assignment(members["assign"])
        if len(values) < len(self.variables):
            first = next(v.name for i, v in enumerate(self.variables) if i not in values)
            raise members["assign"].fault("BBT0603", f"variable '{clip(first)}' has no initial value")
        probability = members["p"].given_probability(zero=False)
        return InitialState(probability, tuple(values[i] for i in range(len(self.variables))))

    def _assignment(self, at: At) -> dict[int, Truth]:
        values: dict[int, Truth] = {}
        for name, value in at.entries():
            if name in self.numbers:
                values.update(numbers_json.digits_of_value(value, self.numbers[name]))
                continue
            variable = number_of(value, name, self.index)
            truth = Truth.from_word(value.word("true", "false", "unknown"))
            if truth is Truth.UNKNOWN and not self.variables[variable].three_valued:
                raise value.fault("BBT0604", f"variable '{clip(name)}' cannot be unknown")
            values[variable] = truth
        return values

    def action(self, at: At) -> GroundAction:
        members = at.members(
            ["name", "schema", "args", "cost", "precondition"],
            [
                "outcomes",
                "factors",
                "oneof",
                "changes",
                "uninterruptible",
                "while",
                "on_abort",
                "duration",
                "timeout",
            ],
        )
        schema, args = members["schema"].string(), members["args"].strings()
        _check_name(members["name"], schema, args)
        factors = self.chance(at, members)
        if not duration_json.may_time_out(factors, "timeout" in members):
            message = "outcomes of a time-out belong into one distribution of an action that has one"
            raise at.fault("BBT0604", message)
        return GroundAction(
            schema,
            args,
            self.condition(members["precondition"]),
            factors,
            members["cost"].given(),
            tuple(self.change(each) for each in optional(members, "changes")),
            uninterruptible="uninterruptible" in members and members["uninterruptible"].flag(),
            during=self.condition(members["while"]) if "while" in members else None,
            on_abort=self._abort(members["on_abort"]) if "on_abort" in members else (),
            duration=duration_json.duration_from_json(members["duration"]) if "duration" in members else None,
            timeout=duration_json.timeout_from_json(members["timeout"]) if "timeout" in members else None,
        )

    def _abort(self, at: At) -> tuple[Factor, ...]:
        return self.chance(at, at.members([], ["outcomes", "factors", "oneof"]))

    def event(self, at: At) -> GroundEvent:
        members = at.members(
            ["name", "schema", "args", "precondition"], ["outcomes", "factors", "oneof", "round", "per"]
        )
        schema, args = members["schema"].string(), members["args"].strings()
        _check_name(members["name"], schema, args)
        number = members["round"].value if "round" in members else 0
        if isinstance(number, bool) or not isinstance(number, int) or number < 0:
            raise members["round"].fault("BBT0604", "must be the number of a round, from 0 on")
        factors = self.chance(at, members)
        event = GroundEvent(schema, args, self.condition(members["precondition"]), factors, number)
        if "per" not in members or members["per"].word("action", "second") == "action":
            return event
        if any(sum(each.does_something for each in factor.outcomes) > 1 for factor in factors):
            raise members["per"].fault(
                "BBT0604", "one outcome of each factor at most does something each second"
            )
        return replace(event, rate="second")

    def chance(self, at: At, members: Mapping[str, At], depth: int = 0) -> tuple[Factor, ...]:
        """The factors of an object with either ``outcomes`` or ``factors``."""
        if ("outcomes" in members) == ("factors" in members):
            raise at.fault("BBT0603", "either 'outcomes' or 'factors' must be there, not both")
        lists = members["factors"].elements() if "factors" in members else [members["outcomes"]]
        unknown: set[int] = set()
        for element in optional(members, "oneof"):
            number = element.value
            if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < len(lists):
                raise element.fault("BBT0604", f"must be the number of a factor, below {len(lists)}")
            unknown.add(number)
        return tuple(self._factor(part, i in unknown, depth) for i, part in enumerate(lists))

    def _factor(self, at: At, oneof: bool, depth: int) -> Factor:
        outcomes = tuple(self._outcome(element, depth) for element in at.elements())
        check_sum(at, [outcome.probability for outcome in outcomes])
        return Factor(outcomes, oneof)

    def _outcome(self, at: At, depth: int) -> Outcome:
        members = at.members(
            ["p", "effects"], ["factors", "oneof", "reward", "cost", "charges", "timed_out", "numbers"]
        )
        if depth > MAX_NESTING:
            raise at.fault("BBT0605", f"chance is nested in chance at most {MAX_NESTING} times")
        outcome = Outcome(
            members["p"].given_probability(zero=False),
            tuple(self._effect(element) for element in members["effects"].elements()),
            self.chance(at, members, depth + 1) if "factors" in members or "oneof" in members else (),
            members["reward"].given() if "reward" in members else _ZERO,
            members["cost"].given() if "cost" in members else _ZERO,
            tuple(self._charge(element) for element in optional(members, "charges")),
            "timed_out" in members and members["timed_out"].flag(),
        )
        if "numbers" not in members:
            return outcome
        changes = numbers_json.changes_from_json(members["numbers"], self.numbers, self.condition)
        sizes = {number.digits: number.high - number.low + 1 for number in self.numbers.values()}
        return with_digit_effects(replace(outcome, changes=changes), sizes)

    def _charge(self, at: At) -> Charge:
        members = at.members(["when"], ["cost", "reward"])
        return Charge(
            self.condition(members["when"]),
            members["cost"].given() if "cost" in members else _ZERO,
            members["reward"].given() if "reward" in members else _ZERO,
        )

    def _effect(self, at: At) -> Effect:
        members = at.members(["when", "set"])
        when = None if members["when"].value is None else self.condition(members["when"])
        return Effect(when, tuple(sorted(self._assignment(members["set"]).items())))

    def template(self, at: At) -> GroundTemplate:
        members = at.members(_TEMPLATE_FIELDS, ["outcomes", "factors", "oneof"])
        symbol, args = members["template"].string(), members["args"].strings()
        _check_name(members["name"], symbol, args)
        return GroundTemplate(
            symbol,
            args,
            self.condition(members["precondition"]),
            self.chance(at, members),
            self._body(members["body"], 1),
        )

    def _body(self, at: At, level: int) -> Body:
        kind = kind_at(at, *_BODIES)
        match kind:
            case "retry-until-success":
                members = at.members(["type", "attempts", "children"])
                tried = children_at(members["children"], level)
                if len(tried) != 1:
                    raise members["children"].fault("BBT0613", "what is tried again is one child")
                return BodyControl(kind, (self._body(tried[0], level + 1),), members["attempts"].count())
            case "sequence" | "fallback" | "skipper":
                children = children_at(at.members(["type", "children"])["children"], level)
                return BodyControl(kind, tuple(self._body(child, level + 1) for child in children))
            case "condition":
                return BodyCondition(self.condition(at.members(["type", "condition"])["condition"]))
            case "action":
                return BodyAction(at.members(["type", "action"])["action"].string())
            case _:
                return BodyTemplate(at.members(["type", "template"])["template"].string())


def _check_templates(members: Mapping[str, At], task: Task, faults: Faults) -> None:
    if not task.templates:
        return
    check_distinct(members["templates"], [template.name for template in task.templates])
    try:
        active = active_templates(task.template_by_name)
    except BbtcError as error:
        for found in error.diagnostics:
            faults.add(members["templates"].found(found.code, found.message))
        return
    for element in members["templates"].elements():
        parts = dict(element.entries())
        for problem in body_problems(task, task.template_by_name[parts["name"].string()], active):
            faults.add(at_node(problem, parts["body"].path))
