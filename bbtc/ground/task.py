"""The ground task: variables, initial belief, goal, actions and templates, all names resolved.

Conditions and effects refer to variables by index into :attr:`Task.variables`. Probabilities
and costs are exact rationals.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Literal, TypeAlias

from bbtc.diagrams import Diagram
from bbtc.durations import INSTANT, Duration, meanwhile
from bbtc.ground.condition import Condition
from bbtc.ground.variables import Digit as Digit
from bbtc.ground.variables import NumberVariable as NumberVariable
from bbtc.ground.variables import Variable as Variable
from bbtc.ground.variables import digit_name as digit_name
from bbtc.ground.variables import ground_name as ground_name
from bbtc.ground.variables import numbers_of as numbers_of
from bbtc.ground.variables import split_name as split_name
from bbtc.ground.variables import unused_name as unused_name
from bbtc.kleene import Truth
from bbtc.source import Span


@dataclass(frozen=True, slots=True)
class Effect:
    """Sets variables where ``when`` is true in the state before the action (None: always)."""

    when: Condition | None
    sets: tuple[tuple[int, Truth], ...]


@dataclass(frozen=True, slots=True)
class Charge:
    """Adds to cost and reward where ``when`` is true in the state before the action."""

    when: Condition
    cost: Fraction
    reward: Fraction


@dataclass(frozen=True, slots=True)
class Case:
    """What a number becomes where ``when`` is true before the action (None: always): the ``amount``, counted
    from the number's least value, or that much more than it was, no further than to its bounds."""

    when: Condition | None
    kind: Literal["assign", "add"]
    amount: int


@dataclass(frozen=True, slots=True)
class NumberChange:
    """What happens to the number with these digits: at most one of the cases is so."""

    digits: tuple[int, ...]
    cases: tuple[Case, ...]


@dataclass(frozen=True, slots=True)
class Outcome:
    """One thing that may happen, with its probability within its factor.

    ``factors`` are further independent choices made if this outcome happens (chance nested in
    a branch). ``reward`` is what the outcome adds to the reward fluent, ``cost`` what it adds to the
    action's cost; ``charges`` add to both under conditions.

    ``changes`` tell what happens to numbers, each of which has at most one in what happens at once. The
    effects do the same to their digits: whoever reads changes leaves out what effects set of digits.
    """

    probability: Fraction
    effects: tuple[Effect, ...]
    factors: tuple[Factor, ...] = ()
    reward: Fraction = Fraction(0)
    cost: Fraction = Fraction(0)
    charges: tuple[Charge, ...] = ()
    timed_out: bool = False
    """The action is given up, since its time-out passes; what else may happen stands in other outcomes."""
    changes: tuple[NumberChange, ...] = ()

    @property
    def does_something(self) -> bool:
        """Does it set or add anything, or draw further?"""
        return bool(self.effects or self.factors or self.reward or self.cost or self.charges)


@dataclass(frozen=True, slots=True)
class Factor:
    """A distribution over outcomes; probabilities sum to 1. ``oneof`` marks a choice whose
    probabilities are not known and count as equal."""

    outcomes: tuple[Outcome, ...]
    oneof: bool = False


MISREAD = "misread "
"""What begins the predicate of a fact that a reading which stays is wrong; no file can name it."""

# --- what is hidden --------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Observation:
    """The robot is told whether ``condition`` is true, if ``when`` is (None: always): rightly with
    probability ``accuracy``, and else wrongly; where it is false, rightly with ``accuracy_false``, unless
    that is None. Both are read in the state after the action; they are two-valued there."""

    condition: Condition
    accuracy: Fraction = Fraction(1)
    when: Condition | None = None
    accuracy_false: Fraction | None = None

    def right(self, true: bool) -> Fraction:
        """How probably it is right, where the condition is true, or false."""
        return self.accuracy if true or self.accuracy_false is None else self.accuracy_false

    @property
    def noisy(self) -> bool:
        """Is it left to chance what is told?"""
        return any(self.right(true) not in (0, 1) for true in (True, False))


@dataclass(frozen=True, slots=True)
class Change:
    """What an action does to the hidden facts of a component, and what the robot is told of them.

    Conditions and effects refer to *local* variables: first the facts of the component
    (:attr:`Component.facts`), which are two-valued in each world, then the task's variables of
    :attr:`seen`. One outcome of every factor happens, unseen, but for what it sets of the seen variables.
    """

    component: int
    seen: tuple[int, ...]
    factors: tuple[Factor, ...]
    observations: tuple[Observation, ...] = ()


@dataclass(frozen=True, slots=True)
class Knowledge:
    """A three-valued variable of the task tells what is believed of a condition over the facts of a component
    (local variables, as in :class:`Change`): it is true where the condition is so with a probability of
    ``at_least``, false where it is false with that, and else unknown. With 1, the default, it tells what is
    known: what holds in all worlds still possible. ``at_least`` is above 1/2."""

    variable: int
    condition: Condition
    at_least: Fraction = Fraction(1)

    def value(self, weight: int, total: int) -> Truth:
        """What is believed where worlds of this weight, of a total, make the condition true."""
        enough = self.at_least.numerator * total
        if weight * self.at_least.denominator >= enough:
            return Truth.TRUE
        return Truth.FALSE if (total - weight) * self.at_least.denominator >= enough else Truth.UNKNOWN


@dataclass(frozen=True)
class Component:
    """Hidden facts whose draws or changes depend on each other.

    A *world* is a truth value for each fact, as a number: bit i is set where fact i is true. ``prior`` has
    every possible world with its probability; where these are too many, it is empty, and ``diagram`` has
    weights of the worlds instead. ``known`` are the task's variables that tell what is known.
    ``first`` is what the robot is told before its first action; ``seen`` are the task's variables behind the
    facts in the local variables of that.
    """

    facts: tuple[str, ...]
    prior: tuple[tuple[int, Fraction], ...]
    known: tuple[Knowledge, ...]
    first: tuple[Observation, ...] = ()
    seen: tuple[int, ...] = ()
    diagram: Diagram | None = None

    def local(self, task: Task, seen: Sequence[int]) -> tuple[Variable, ...]:
        """The local variables: a two-valued one for each fact, then the seen variables of the task."""
        facts = (Variable(*split_name(fact), three_valued=False, hidden=True) for fact in self.facts)
        return (*facts, *(task.variables[variable] for variable in seen))

    @cached_property
    def memo(self) -> dict[str, object]:
        """What others work out of it once, and keep: it goes where the component goes, to other processes,
        too."""
        return {}


@dataclass(frozen=True, slots=True)
class GroundAction:
    """A schema with its arguments. One outcome of every factor happens, independently; all
    conditions are read before any effect. Where effects of one occurrence set a variable to
    different values, the Kleene maximum wins (delete before forget before add). ``changes`` tells what
    happens to hidden facts, at most one a component, independently of each other and of the factors.

    Where there is ``during``, events are drawn while the action goes on, and not after it: it goes on where
    that condition, which its precondition implies, is true then, and else ends with ``on_abort``.


    ``duration`` is how long it takes, drawn independently of the outcome (None: nobody says). After
    ``timeout`` seconds it is given up: one factor then has an outcome ``timed_out``, unless that is
    impossible, with the probability that it takes longer; the others are those of an action that does not."""

    schema: str
    args: tuple[str, ...]
    precondition: Condition
    factors: tuple[Factor, ...]
    cost: Fraction = Fraction(1)
    changes: tuple[Change, ...] = ()
    uninterruptible: bool = False
    """While it runs on a robot, nothing preempts it; figures do not ask."""
    span: Span | None = field(default=None, compare=False, repr=False)
    during: Condition | None = None
    on_abort: tuple[Factor, ...] = ()
    duration: Duration | None = None
    timeout: Fraction | None = None

    @property
    def name(self) -> str:
        """``schema(arg,…)``."""
        return ground_name(self.schema, self.args)

    @property
    def possible_factors(self) -> tuple[Factor, ...]:
        """Its factors, and those of its end by ``during``: not all of them happen at once."""
        return (*self.factors, *self.on_abort)


@dataclass(frozen=True, slots=True)
class GroundEvent:
    """What happens by itself, once an action: where the precondition is true, one outcome of every factor. By
    the ``rate`` of a second, each factor draws the one outcome that does something, at most once, with its
    probability for every second that the action takes (:func:`bbtc.durations.meanwhile`).

    The events of one ``round`` happen at once: all read the state that the action left, or the round before,
    and no two of them set a variable to different values."""

    schema: str
    args: tuple[str, ...]
    precondition: Condition
    factors: tuple[Factor, ...]
    round: int = 0
    span: Span | None = field(default=None, compare=False, repr=False)
    rate: Literal["action", "second"] = "action"

    @property
    def name(self) -> str:
        """``schema(arg,…)``."""
        return ground_name(self.schema, self.args)

    def during(self, action: GroundAction) -> GroundEvent:
        """The event as it happens with an action."""
        if self.rate == "action":
            return self
        return replace(self, factors=tuple(_over_time(each, action) for each in self.factors), rate="action")

    @property
    def possible_factors(self) -> tuple[Factor, ...]:
        """Its factors."""
        return self.factors


# --- templates -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class BodyControl:
    """A control node of a template body; a retry-until-success has one child, and ``attempts``."""

    kind: Literal["sequence", "fallback", "skipper", "retry-until-success"]
    children: tuple[Body, ...]
    attempts: int | None = None


@dataclass(frozen=True, slots=True)
class BodyCondition:
    """A condition of a template body."""

    condition: Condition


@dataclass(frozen=True, slots=True)
class BodyAction:
    """A call of a ground action, by name."""

    action: str


@dataclass(frozen=True, slots=True)
class BodyTemplate:
    """A call of another ground template, by name."""

    template: str


Body: TypeAlias = BodyControl | BodyCondition | BodyAction | BodyTemplate


@dataclass(frozen=True, slots=True)
class GroundTemplate:
    """A named subtree with its arguments, and the guide (precondition, factors) that tells the
    planner what it is for. Simulation runs the body only. ``factors`` is empty without a guide."""

    template: str
    args: tuple[str, ...]
    precondition: Condition
    factors: tuple[Factor, ...]
    body: Body
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def name(self) -> str:
        """``template(arg,…)``."""
        return ground_name(self.template, self.args)


# --- the task --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Signature:
    """The parameter names of a predicate or an action schema, as declared, without ``?``. They name
    the ports and arguments of exported leaves; where a task has none, exporters number them."""

    kind: Literal["predicate", "action", "function"]
    symbol: str
    parameters: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class InitialState:
    """A possible initial state: one value for every variable."""

    probability: Fraction
    values: tuple[Truth, ...]


@dataclass(frozen=True, slots=True)
class TrueWorld:
    """What is true, and what is false, of the hidden facts at the start of a simulated run, by name; others
    are false, if that can be."""

    true: frozenset[str]
    false: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Task:
    """A ground planning task. Actions, templates and variables are sorted by name, events by round and name,
    signatures by kind and symbol."""

    domain: str
    problem: str
    variables: tuple[Variable, ...]
    initial: tuple[InitialState, ...]
    goal: Condition
    actions: tuple[GroundAction, ...]
    templates: tuple[GroundTemplate, ...] = ()
    goal_probability: Fraction = Fraction(1)
    goal_reward: Fraction = Fraction(0)
    metric: Literal["cost", "reward"] = "cost"
    signatures: tuple[Signature, ...] = ()
    components: tuple[Component, ...] = ()
    """What is hidden from the robot. The variables that a component's ``known`` names are set by nothing
    else, and have in the initial states the value that the prior gives them before anything is told."""
    origin: Task | None = None
    """The task with hidden facts that this was made of, over the same variables, if a robot would have to
    work out what it knows: its readings stand there."""
    unlowered: Task | None = field(default=None, compare=False, repr=False)
    """The task with all hidden facts that this was made of, over the same variables, as long as it is at
    hand: artefacts do not hold it."""
    true_worlds: tuple[TrueWorld, ...] = ()
    """What the problem says is true at the start of simulated runs, which begin in one of them. Nothing else
    reads it."""
    events: tuple[GroundEvent, ...] = ()
    goal_span: Span | None = field(default=None, compare=False, repr=False)

    @cached_property
    def variable_index(self) -> dict[str, int]:
        """Index of each variable by name."""
        return {variable.name: index for index, variable in enumerate(self.variables)}

    @cached_property
    def numbers(self) -> tuple[NumberVariable, ...]:
        """The numbers, in the order of their first digits."""
        return numbers_of(self.variables)

    @cached_property
    def number_by_name(self) -> dict[str, NumberVariable]:
        """Each number by its name."""
        return {number.name: number for number in self.numbers}

    @cached_property
    def number_of_digit(self) -> dict[int, NumberVariable]:
        """By variable that is a digit: its number."""
        return {digit: number for number in self.numbers for digit in number.digits}

    @cached_property
    def action_by_name(self) -> dict[str, GroundAction]:
        """Each action by its ground name."""
        return {action.name: action for action in self.actions}

    @property
    def occurrences(self) -> tuple[GroundAction | GroundEvent, ...]:
        """Actions and events."""
        return (*self.actions, *self.events)

    @cached_property
    def _rounds(self) -> tuple[tuple[GroundEvent, ...], ...]:
        found: dict[int, list[GroundEvent]] = {}
        for event in self.events:
            found.setdefault(event.round, []).append(event)
        return tuple(tuple(found[number]) for number in sorted(found))

    @property
    def moves_by_time(self) -> bool:
        """Are there events that are the more probable, the longer an action takes?"""
        return any(event.rate == "second" for event in self.events)

    def rounds(self, action: GroundAction) -> tuple[tuple[GroundEvent, ...], ...]:
        """The events that happen with an action by round, in order."""
        if not self.moves_by_time:
            return self._rounds
        return tuple(tuple(event.during(action) for event in events) for events in self._rounds)

    @cached_property
    def endless_beliefs(self) -> bool:
        """May ever new beliefs follow from each other, since readings are noisy or hidden facts change by
        chance?"""
        changes = [change for action in self.actions for change in action.changes]
        noisy = any(each.noisy for change in changes for each in change.observations)
        return noisy or any(len(factor.outcomes) > 1 for change in changes for factor in change.factors)

    @cached_property
    def counts_reward(self) -> bool:
        """Is there anything that adds to the reward, or a metric of it?"""
        outcomes = outcomes_of(factor for each in self.occurrences for factor in each.possible_factors)
        return self.metric == "reward" or any(
            outcome.reward or any(charge.reward for charge in outcome.charges) for outcome in outcomes
        )

    @cached_property
    def template_by_name(self) -> dict[str, GroundTemplate]:
        """Each template by its ground name."""
        return {template.name: template for template in self.templates}


ZERO = Fraction(0)
ONE = Fraction(1)
NO_CHANGE = Factor((Outcome(ONE, ()),))


def _over_time(factor: Factor, action: GroundAction) -> Factor:
    """A factor that is drawn every second until something happens, while an action goes on."""
    happens = [each for each in factor.outcomes if each.does_something]
    chance = sum((each.probability for each in happens), ZERO)
    if not chance:
        return factor
    total = meanwhile(chance, INSTANT if action.duration is None else action.duration, action.timeout)
    scaled = [replace(each, probability=each.probability * total / chance) for each in happens]
    rest = () if total == 1 else (Outcome(1 - total, ()),)
    return replace(factor, outcomes=(*(each for each in scaled if each.probability), *rest))


def outcomes_of(factors: Iterable[Factor]) -> Iterator[Outcome]:
    """Every outcome of some factors, nested ones included, each before those nested in it."""
    for factor in factors:
        for outcome in factor.outcomes:
            yield outcome
            yield from outcomes_of(outcome.factors)


def merge_outcomes(outcomes: Iterable[Outcome]) -> tuple[Outcome, ...]:
    """Outcomes that do the same made one, with the sum of their probabilities."""
    merged: dict[tuple[object, ...], Outcome] = {}
    for outcome in outcomes:
        key = (
            *(outcome.effects, outcome.factors, outcome.reward, outcome.cost, outcome.charges),
            *(outcome.timed_out, outcome.changes),
        )
        before = merged.get(key)
        if before is not None:
            total = before.probability + outcome.probability
            merged[key] = replace(before, probability=total)
        else:
            merged[key] = outcome
    return tuple(merged.values())


def effects_of(factors: Iterable[Factor]) -> Iterator[Effect]:
    """Every effect that some occurrence of the factors can have."""
    return (effect for outcome in outcomes_of(factors) for effect in outcome.effects)


def charges_of(factors: Iterable[Factor]) -> Iterator[Charge]:
    """Every charge that some occurrence of the factors can make."""
    return (charge for outcome in outcomes_of(factors) for charge in outcome.charges)


def seen_factors(task: Task, action: GroundAction) -> tuple[Factor, ...]:
    """The factors of an action and, of what it does to hidden facts, all it might set of seen variables:
    more than can be, with no probabilities of their own, for what relaxes the task."""
    found = list(action.factors)
    for change in action.changes:
        facts = len(task.components[change.component].facts)
        for effect in effects_of(change.factors):
            sets = ((local - facts, value) for local, value in effect.sets if local >= facts)
            if seen := tuple((change.seen[at], value) for at, value in sets):
                found.append(Factor((Outcome(ONE, (Effect(None, seen),)),)))
    return tuple(found)


def apparent_factors(task: Task, doing: GroundAction | GroundEvent | GroundTemplate) -> tuple[Factor, ...]:
    """:func:`seen_factors` and all that an action might make known, or set where it is aborted, likewise; of
    a guide or an event, its factors."""
    if not isinstance(doing, GroundAction):
        return doing.factors
    if not doing.changes:
        return doing.possible_factors
    third = Fraction(1, 3)
    return seen_factors(task, doing) + tuple(
        Factor(tuple(Outcome(third, (Effect(None, ((knowledge.variable, value),)),)) for value in Truth))
        for change in doing.changes
        for knowledge in task.components[change.component].known
    )


def may_set(task: Task, action: GroundAction) -> frozenset[int]:
    """Every variable that an action may set while it runs, or make known: what it does to facts by itself
    never preempts it (docs/multi-tick-actions.md)."""
    return frozenset(
        variable
        for effect in effects_of((*apparent_factors(task, action), *action.on_abort))
        for variable, _ in effect.sets
    )


def walk_body(body: Body) -> Iterator[Body]:
    """Every part of a template body, parents first, from left to right. Called templates are not
    followed."""
    stack = [body]
    while stack:
        part = stack.pop()
        yield part
        if isinstance(part, BodyControl):
            stack.extend(reversed(part.children))
