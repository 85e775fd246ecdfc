"""Hypothesis strategies: small random tasks and trees that obey every rule of theirs."""

from __future__ import annotations

import functools
import itertools
import struct
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Literal, TypeVar

from hypothesis import strategies as st

from bbtc.ground.condition import TRUE, And, Condition, Constant, Is, Known, Not, Or, evaluate
from bbtc.ground.task import (
    Body,
    BodyAction,
    BodyCondition,
    BodyControl,
    Charge,
    Effect,
    Factor,
    GroundAction,
    GroundTemplate,
    InitialState,
    Outcome,
    Signature,
    Task,
    Variable,
)
from bbtc.kleene import Truth
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, PlanStatus, Tree

T = TypeVar("T")

_PLAIN = ["a", "at", "b-2", "door_open", "is", "n1", "true", "x", "y"]
# What a stranger may put into an identifier that reaches us through a JSON artefact.
_HOSTILE = [
    'a"); import os #',
    "<b>&amp;</b>",
    "<",
    "\\",
    "\\N",
    "\\n\\l",
    "two\nlines",
    "tab\t",
    "a:b",
    "{x|y}",
    "]]>",
    "-->",
    "'''",
    "→ ü 漢字 🤖",
    "\u202edesrever",
    "\x00\x1b[31m",
    "a,b",
    "f(x",
    "",
    "next\x85line",
    "\u2028\u2029",
    "\ufeff",
    " around ",
    "yes",
    "~",
    "1e3",
]
_TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
PLAIN_NAMES = st.sampled_from(_PLAIN)
HOSTILE_NAMES = st.one_of(PLAIN_NAMES, st.sampled_from(_HOSTILE), _TEXTS)
CONTROL_KINDS: list[ControlKind] = ["sequence", "fallback", "skipper"]
_RETRIES: list[ControlKind] = ["retry", "retry-until-success"]
BODY_KINDS: list[Literal["sequence", "fallback", "skipper"]] = ["sequence", "fallback", "skipper"]
STATUSES: list[PlanStatus] = ["target-reached", "out-of-reach", "stuck", "limit-reached", "interrupted"]


# A random task takes hundreds of choices, and what Hypothesis does for each costs more than what most tests
# do with the task. So it draws bytes, many at a time, and what they choose is looked up in lists.

_BYTES = st.binary(min_size=64, max_size=64)


class _Choices:
    """One choice after the other. Small bytes choose first items: so Hypothesis makes examples simpler."""

    def __init__(self, draw: st.DrawFn) -> None:
        self._draw = draw
        self._numbers: Iterator[int] = iter(())

    def of(self, items: Sequence[T]) -> T:
        """One of the items, each as likely."""
        number = next(self._numbers, None)
        if number is None:
            self._numbers = iter(struct.unpack(">32H", self._draw(_BYTES)))
            number = next(self._numbers)
        return items[number * len(items) >> 16]

    def name(self, names: st.SearchStrategy[str]) -> str:
        """A name as the strategy says."""
        if names is PLAIN_NAMES:
            return self.of(_PLAIN)
        return self._hostile(self.of((0, 1, 2))) if names is HOSTILE_NAMES else self._draw(names)

    def label(self) -> str | None:
        """No text, or any."""
        kind = self.of((None, 0, 1, 2))
        return None if kind is None else self._hostile(kind)

    def _hostile(self, kind: int) -> str:
        return self.of((_PLAIN, _HOSTILE)[kind]) if kind < 2 else self._draw(_TEXTS)


_DISTRIBUTIONS = [
    tuple(Fraction(weight, sum(weights)) for weight in weights)
    for count, often in ((1, 8 * 81), (2, 2 * 9), (3, 1))
    for weights in itertools.product(range(1, 10), repeat=count)
    for _ in range(often)
]
"""One to three positive probabilities that sum to 1; seldom more than one: larger tasks tell little more."""


@st.composite
def conditions(draw: st.DrawFn, variables: tuple[Variable, ...]) -> Condition:
    """Conditions over the variables of a task, of every kind."""
    return _condition(_Choices(draw), variables)


def _condition(choose: _Choices, variables: tuple[Variable, ...], depth: int = 2) -> Condition:
    kind, size = choose.of(_SHAPES) if depth else (None, 0)
    parts = tuple(_condition(choose, variables, depth - 1) for _ in range(size))
    match kind:
        case None:
            return choose.of(_atoms(len(variables)))
        case type() if kind is Not:
            return Not(parts[0])
        case _:
            return And(parts) if kind is And else Or(parts)


@functools.cache
def _atoms(count: int) -> list[Condition]:
    found: list[Condition] = [Constant(True), Constant(False)]
    for i in range(count):
        found += [Is(i, Truth.TRUE), Is(i, Truth.FALSE), Is(i, Truth.UNKNOWN), Known(i)]
    return found


_COMPOUNDS = [(Not, 1), (Not, 1), *((kind, size) for kind in (And, Or) for size in (0, 1, 2, 2, 3))]
_SHAPES = [*[(None, 0)] * 6, *_COMPOUNDS]


@functools.cache
def _settings(three_valued: tuple[bool, ...]) -> list[tuple[tuple[int, Truth], ...]]:
    """What an effect sets of so many variables: each with a chance of one in two."""
    choices = [
        [*[None] * len(truths), *((i, truth) for truth in truths)]
        for i, truths in enumerate(_TRUTHS[three] for three in three_valued)
    ]
    return [tuple(item for item in row if item is not None) for row in itertools.product(*choices)]


def _effect(choose: _Choices, variables: tuple[Variable, ...]) -> Effect:
    sets = choose.of(_settings(tuple(variable.three_valued for variable in variables)))
    return Effect(_condition(choose, variables) if choose.of(_SOMETIMES) else None, sets)


def _charge(choose: _Choices, variables: tuple[Variable, ...]) -> Charge:
    return Charge(_condition(choose, variables), *choose.of(_AMOUNTS))


def _factor(choose: _Choices, variables: tuple[Variable, ...], nested: int) -> Factor:
    """A chance of up to three outcomes; chance nested in chance ``nested`` times."""
    probabilities, oneof = choose.of(_DISTRIBUTIONS), choose.of((False, True))
    outcomes = []
    for probability in probabilities:
        effects, factors, charges = choose.of(_SIZES if nested else _FLAT_SIZES)
        reward, cost = choose.of(_AMOUNTS)
        outcomes.append(
            Outcome(
                probability,
                tuple(_effect(choose, variables) for _ in range(effects)),
                tuple(_factor(choose, variables, nested - 1) for _ in range(factors)),
                reward=reward,
                cost=cost,
                charges=tuple(_charge(choose, variables) for _ in range(charges)),
            )
        )
    return Factor(tuple(outcomes), oneof)


def _precondition(choose: _Choices, variables: tuple[Variable, ...]) -> Condition:
    return TRUE if choose.of((False, True)) else _condition(choose, variables)


def _goal(choose: _Choices, variables: tuple[Variable, ...], initial: tuple[InitialState, ...]) -> Condition:
    """Seldom one that holds from the start: nothing would happen."""
    goal = _condition(choose, variables)
    held = all(evaluate(goal, state.values) is Truth.TRUE for state in initial)
    return Not(goal) if held and not choose.of(_SOMETIMES) else goal


_FEW = [0, 1, 1, 2]
_SIZES = [*itertools.product([0, 1, 1, 1, 2, 2], [0, 1, 1, 2], [0, 0, 0, 1, 2])]
_FLAT_SIZES = [*itertools.product([0, 1, 1, 1, 2, 2], [0], [0, 0, 0, 1, 2])]
_SOMETIMES = [False, False, True]
_AMOUNTS = [*itertools.product([Fraction(0), Fraction(0), Fraction(1), Fraction(-1, 3)], repeat=2)]
_COSTS = [Fraction(1), Fraction(0), Fraction(1, 3), Fraction("2.5")]
_TRUTHS = {True: (Truth.TRUE, Truth.FALSE, Truth.UNKNOWN), False: (Truth.TRUE, Truth.FALSE)}
_FLAGS = [(three, hidden) for three in (False, True) for hidden in (False, True)]
# Few tasks have no variable or no action: hardly anything happens in those.
_NUMBERS = {most: [*range(most + 1), *range(1, most + 1), *range(2, most + 1)] for most in (3, 4, 6)}
_KINDS: list[Literal["predicate", "action"]] = ["predicate", "action"]
_METRICS: list[Literal["cost", "reward"]] = ["cost", "reward"]
_GOALS = [Fraction(1), Fraction("0.9"), Fraction(2, 3)]
_REWARDS = [Fraction(0), Fraction(100)]


@functools.cache
def _states(three_valued: tuple[bool, ...]) -> list[tuple[Truth, ...]]:
    return [*itertools.product(*(_TRUTHS[three] for three in three_valued))]


@st.composite
def tasks(
    draw: st.DrawFn, names: st.SearchStrategy[str] = PLAIN_NAMES, nested: int = 1, most_actions: int = 3
) -> Task:
    """A task with a few variables, actions and templates. ``names`` are those of its symbols."""
    return _task(_Choices(draw), names, nested, most_actions)


def _task(choose: _Choices, names: st.SearchStrategy[str], nested: int = 1, most_actions: int = 3) -> Task:
    def args() -> tuple[str, ...]:
        return tuple(choose.name(names) for _ in range(choose.of(_FEW)))

    def chance() -> tuple[Factor, ...]:
        return tuple(_factor(choose, variables, nested) for _ in range(choose.of(_FEW)))

    made = [
        Variable(choose.name(names), args(), three, hidden)
        for three, hidden in (choose.of(_FLAGS) for _ in range(choose.of(_NUMBERS[4])))
    ]
    variables = tuple(sorted({v.name: v for v in made}.values(), key=lambda v: v.name))
    acts = [
        GroundAction(
            choose.name(names), args(), _precondition(choose, variables), chance(), choose.of(_COSTS)
        )
        for _ in range(choose.of(_NUMBERS[most_actions]))
    ]
    actions = tuple(sorted({a.name: a for a in acts}.values(), key=lambda a: a.name))
    templates = [
        GroundTemplate(
            choose.name(names),
            args(),
            _condition(choose, variables),
            chance(),
            _body(choose, variables, actions),
        )
        for _ in range(choose.of(_FEW))
    ]
    initial = tuple(
        InitialState(probability, choose.of(_states(tuple(v.three_valued for v in variables))))
        for probability in choose.of(_DISTRIBUTIONS)
    )
    signatures = [Signature(choose.of(_KINDS), choose.name(names), args()) for _ in range(choose.of(_FEW))]
    return Task(
        domain=choose.name(names),
        problem=choose.name(names),
        variables=variables,
        initial=initial,
        goal=_goal(choose, variables, initial),
        actions=actions,
        templates=tuple(sorted({t.name: t for t in templates}.values(), key=lambda t: t.name)),
        goal_probability=choose.of(_GOALS),
        goal_reward=choose.of(_REWARDS),
        metric=choose.of(_METRICS),
        signatures=tuple(sorted(signatures, key=lambda s: (s.kind, s.symbol))),
    )


def _body(
    choose: _Choices,
    variables: tuple[Variable, ...],
    actions: tuple[GroundAction, ...],
    depth: int = 2,
    passive: bool = False,
) -> Body:
    """A template body; ``passive`` ones have no actions."""
    shapes = ["condition", *(["action"] if actions and not passive else []), *(["control"] if depth else [])]
    match choose.of(shapes):
        case "condition":
            return BodyCondition(_condition(choose, variables))
        case "action":
            return BodyAction(choose.of(actions).name)
        case _:
            kind = choose.of(BODY_KINDS)
            count = choose.of((1, 2, 3))
            passives = [passive or (kind == "skipper" and i < count - 1) for i in range(count)]
            return BodyControl(kind, tuple(_body(choose, variables, actions, depth - 1, p) for p in passives))


@st.composite
def nodes(draw: st.DrawFn, task: Task, depth: int = 3) -> Node:
    """A tree of nodes on a task, obeying the Skipper rule, with ids ``n1``, ``n2``, …"""
    return _nodes(_Choices(draw), task, depth)


def _nodes(choose: _Choices, task: Task, depth: int) -> Node:
    counter = iter(range(1, 10_000))

    def node(level: int, passive: bool) -> Node:
        name = f"n{next(counter)}"
        shapes = ["condition"]
        if task.actions and not passive:
            shapes += ["action", "action"]
        if level:
            shapes += ["control"] * 3
        match choose.of(shapes):
            case "condition":
                condition = _condition(choose, task.variables)
                return ConditionNode(name, condition, choose.label(), choose.label())
            case "action":
                action = choose.of(task.actions).name
                latched, guarded = choose.of((False, True)), choose.of((False, True))
                return ActionNode(name, action, latched, guarded, reason=choose.label())
            case _:
                if not choose.of(range(5)):
                    child = node(level - 1, passive)
                    kind, attempts = choose.of(_RETRIES), choose.of((1, 2, 3))
                    return ControlNode(name, kind, (child,), choose.label(), attempts=attempts)
                kind = choose.of(CONTROL_KINDS)
                count = choose.of((1, 2, 3))
                children = tuple(
                    node(level - 1, passive or (kind == "skipper" and i < count - 1)) for i in range(count)
                )
                return ControlNode(name, kind, children, template=choose.label(), reason=choose.label())

    return node(depth, False)


@st.composite
def trees(draw: st.DrawFn, names: st.SearchStrategy[str] = PLAIN_NAMES, depth: int = 3) -> Tree:
    """A tree with its task. Its claimed figures are random."""
    choose = _Choices(draw)
    task = _task(choose, names)
    probability = draw(st.fractions(0, 1, max_denominator=1000))
    target = choose.of((Fraction(1), Fraction("0.9"), Fraction(1, 3)))
    bounds = choose.of((None, (probability, Fraction(1))))
    return Tree(task, _nodes(choose, task, depth), probability, target, choose.of(STATUSES), bounds)


def soda_task() -> Task:
    """A task by hand that resembles the paper's: look for a can, in the dark, in one place."""
    lit, seen = 0, 1
    half = Fraction(1, 2)
    detect = Factor(
        (
            Outcome(half, (Effect(None, ((seen, Truth.TRUE),)),)),
            Outcome(half, (Effect(None, ((seen, Truth.FALSE),)),)),
        )
    )
    light = Factor((Outcome(Fraction(1), (Effect(None, ((lit, Truth.TRUE),)),)),))
    is_lit = Is(lit, Truth.TRUE)
    return Task(
        domain="household",
        problem="look-for-soda",
        variables=(Variable("luminousity_ok", (), False), Variable("seen", ("soda",), True)),
        initial=(InitialState(Fraction(1), (Truth.FALSE, Truth.UNKNOWN)),),
        goal=Is(seen, Truth.TRUE),
        actions=(
            GroundAction("detect", ("soda",), And((is_lit, Is(seen, Truth.UNKNOWN))), (detect,)),
            GroundAction("light_on", (), TRUE, (light,)),
        ),
        goal_probability=Fraction("0.9"),
    )


def soda_tree() -> Tree:
    """The paper's second step on :func:`soda_task`: success probability 1/2."""
    seen, lit = Is(1, Truth.TRUE), Is(0, Truth.TRUE)
    turn_on = ControlNode(
        "n6",
        "fallback",
        (
            ConditionNode("n7", lit),
            ControlNode("n8", "sequence", (ActionNode("n9", "light_on()"), ConditionNode("n10", lit))),
        ),
        reason="luminousity_ok()",
    )
    look = ControlNode(
        "n5", "sequence", (turn_on, ActionNode("n11", "detect(soda)"), ConditionNode("n12", Known(1)))
    )
    attempts = ControlNode("n4", "fallback", (look,))
    root = ControlNode(
        "n1",
        "skipper",
        (
            ConditionNode("n2", seen),
            ControlNode("n3", "sequence", (attempts, ConditionNode("n13", seen)), reason="seen(soda)"),
        ),
    )
    return Tree(soda_task(), root, Fraction(1, 2), Fraction("0.9"), "out-of-reach")
