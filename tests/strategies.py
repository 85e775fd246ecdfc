"""Hypothesis strategies: small random tasks and trees that obey every rule of theirs."""

from __future__ import annotations

import functools
import itertools
from fractions import Fraction
from typing import Literal

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

PLAIN_NAMES = st.sampled_from(["a", "at", "b-2", "door_open", "is", "n1", "true", "x", "y"])

# What a stranger may put into an identifier that reaches us through a JSON artefact.
HOSTILE_NAMES = st.one_of(
    PLAIN_NAMES,
    st.sampled_from(
        [
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
    ),
    st.text(st.characters(exclude_categories=["Cs"]), max_size=8),
)
_LABELS = st.none() | HOSTILE_NAMES
CONTROL_KINDS: list[ControlKind] = ["sequence", "fallback", "skipper"]
_RETRIES: st.SearchStrategy[ControlKind] = st.sampled_from(["retry", "retry-until-success"])
BODY_KINDS: list[Literal["sequence", "fallback", "skipper"]] = ["sequence", "fallback", "skipper"]
STATUSES: list[PlanStatus] = ["target-reached", "out-of-reach", "stuck", "limit-reached", "interrupted"]


# A random task takes hundreds of choices, and what Hypothesis does for each costs more than what most tests
# do with the task. So choices that belong together are one choice, from a list that is made once.

_DISTRIBUTIONS = st.sampled_from(
    [
        tuple(Fraction(weight, sum(weights)) for weight in weights)
        for count in (1, 2, 3)
        for weights in itertools.product(range(1, 10), repeat=count)
        for _ in range(9 ** (3 - count))
    ]
)


def distributions() -> st.SearchStrategy[tuple[Fraction, ...]]:
    """One to three positive probabilities that sum to 1."""
    return _DISTRIBUTIONS


def conditions(variables: tuple[Variable, ...]) -> st.SearchStrategy[Condition]:
    """Conditions over the variables of a task, of every kind."""
    return _conditions(len(variables), 2)


@functools.cache
def _conditions(count: int, depth: int) -> st.SearchStrategy[Condition]:
    return _condition(_atoms(count), depth)


@functools.cache
def _atoms(count: int) -> st.SearchStrategy[Condition]:
    found: list[Condition] = [Constant(True), Constant(False)]
    for i in range(count):
        found += [Is(i, Truth.TRUE), Is(i, Truth.FALSE), Is(i, Truth.UNKNOWN), Known(i)]
    return st.sampled_from(found)


_COMPOUNDS = [(Not, 1), (Not, 1), *((kind, size) for kind in (And, Or) for size in (0, 1, 2, 2, 3))]
_SHAPES = st.sampled_from([*[(None, 0)] * 6, *_COMPOUNDS])


@st.composite
def _condition(draw: st.DrawFn, atoms: st.SearchStrategy[Condition], depth: int) -> Condition:
    def condition(level: int) -> Condition:
        kind, size = draw(_SHAPES) if level else (None, 0)
        parts = tuple(condition(level - 1) for _ in range(size))
        match kind:
            case None:
                return draw(atoms)
            case type() if kind is Not:
                return Not(parts[0])
            case _:
                return And(parts) if kind is And else Or(parts)

    return condition(depth)


@functools.cache
def _settings(three_valued: tuple[bool, ...]) -> st.SearchStrategy[tuple[tuple[int, Truth], ...]]:
    """What an effect sets of so many variables: each with a chance of one in two."""
    choices = [
        [*[None] * len(truths), *((i, truth) for truth in truths)]
        for i, truths in enumerate(_TRUTHS[three] for three in three_valued)
    ]
    return st.sampled_from(
        [tuple(item for item in row if item is not None) for row in itertools.product(*choices)]
    )


def _effect(draw: st.DrawFn, variables: tuple[Variable, ...]) -> Effect:
    sets = draw(_settings(tuple(variable.three_valued for variable in variables)))
    return Effect(draw(conditions(variables)) if draw(_SOMETIMES) else None, sets)


def _charge(draw: st.DrawFn, variables: tuple[Variable, ...]) -> Charge:
    return Charge(draw(conditions(variables)), *draw(_AMOUNTS))


def _factor(draw: st.DrawFn, variables: tuple[Variable, ...], nested: int) -> Factor:
    """A chance of up to three outcomes; chance nested in chance ``nested`` times."""
    probabilities, oneof = draw(_CHANCES)
    outcomes = []
    for probability in probabilities:
        effects, factors, charges = draw(_SIZES if nested else _FLAT_SIZES)
        reward, cost = draw(_AMOUNTS)
        outcomes.append(
            Outcome(
                probability,
                tuple(_effect(draw, variables) for _ in range(effects)),
                tuple(_factor(draw, variables, nested - 1) for _ in range(factors)),
                reward=reward,
                cost=cost,
                charges=tuple(_charge(draw, variables) for _ in range(charges)),
            )
        )
    return Factor(tuple(outcomes), oneof)


def _precondition(draw: st.DrawFn, variables: tuple[Variable, ...]) -> Condition:
    return TRUE if draw(_OFTEN) else draw(conditions(variables))


def _goal(draw: st.DrawFn, variables: tuple[Variable, ...], initial: tuple[InitialState, ...]) -> Condition:
    """Seldom one that holds from the start: nothing would happen."""
    goal = draw(conditions(variables))
    held = all(evaluate(goal, state.values) is Truth.TRUE for state in initial)
    return Not(goal) if held and not draw(_SOMETIMES) else goal


_CHANCES = st.tuples(_DISTRIBUTIONS, st.booleans())
_FEW = st.sampled_from([0, 1, 1, 2])
_SIZES = st.sampled_from([*itertools.product([0, 1, 1, 1, 2, 2], [0, 1, 1, 2], [0, 0, 0, 1, 2])])
_FLAT_SIZES = st.sampled_from([*itertools.product([0, 1, 1, 1, 2, 2], [0], [0, 0, 0, 1, 2])])
_OFTEN = st.booleans()
_SOMETIMES = st.sampled_from([False, False, True])
_AMOUNTS = st.sampled_from(
    [*itertools.product([Fraction(0), Fraction(0), Fraction(1), Fraction(-1, 3)], repeat=2)]
)
_COSTS = st.sampled_from([Fraction(1), Fraction(0), Fraction(1, 3), Fraction("2.5")])
_TRUTHS = {True: (Truth.TRUE, Truth.FALSE, Truth.UNKNOWN), False: (Truth.TRUE, Truth.FALSE)}
_FLAGS: st.SearchStrategy[tuple[bool, bool]] = st.sampled_from(
    [(three, hidden) for three in (False, True) for hidden in (False, True)]
)
# Few tasks have no variable or no action: hardly anything happens in those.
_NUMBERS = {
    most: st.sampled_from([*range(most + 1), *range(1, most + 1), *range(2, most + 1)]) for most in (3, 4, 6)
}
_KINDS: st.SearchStrategy[Literal["predicate", "action"]] = st.sampled_from(["predicate", "action"])
_METRICS: st.SearchStrategy[Literal["cost", "reward"]] = st.sampled_from(["cost", "reward"])
_GOALS = st.sampled_from([Fraction(1), Fraction("0.9"), Fraction(2, 3)])
_REWARDS = st.sampled_from([Fraction(0), Fraction(100)])


@functools.cache
def _states(three_valued: tuple[bool, ...]) -> st.SearchStrategy[tuple[Truth, ...]]:
    return st.sampled_from([*itertools.product(*(_TRUTHS[three] for three in three_valued))])


@st.composite
def tasks(
    draw: st.DrawFn, names: st.SearchStrategy[str] = PLAIN_NAMES, nested: int = 1, most_actions: int = 3
) -> Task:
    """A task with a few variables, actions and templates. ``names`` are those of its symbols."""

    def args() -> tuple[str, ...]:
        return tuple(draw(names) for _ in range(draw(_FEW)))

    def chance() -> tuple[Factor, ...]:
        return tuple(_factor(draw, variables, nested) for _ in range(draw(_FEW)))

    made = [
        Variable(draw(names), args(), three, hidden)
        for three, hidden in (draw(_FLAGS) for _ in range(draw(_NUMBERS[4])))
    ]
    variables = tuple(sorted({v.name: v for v in made}.values(), key=lambda v: v.name))
    acts = [
        GroundAction(draw(names), args(), _precondition(draw, variables), chance(), draw(_COSTS))
        for _ in range(draw(_NUMBERS[most_actions]))
    ]
    actions = tuple(sorted({a.name: a for a in acts}.values(), key=lambda a: a.name))
    templates = [
        GroundTemplate(
            draw(names), args(), draw(conditions(variables)), chance(), _body(draw, variables, actions)
        )
        for _ in range(draw(_FEW))
    ]
    initial = tuple(
        InitialState(probability, draw(_states(tuple(v.three_valued for v in variables))))
        for probability in draw(distributions())
    )
    signatures = [Signature(draw(_KINDS), draw(names), args()) for _ in range(draw(_FEW))]
    return Task(
        domain=draw(names),
        problem=draw(names),
        variables=variables,
        initial=initial,
        goal=_goal(draw, variables, initial),
        actions=actions,
        templates=tuple(sorted({t.name: t for t in templates}.values(), key=lambda t: t.name)),
        goal_probability=draw(_GOALS),
        goal_reward=draw(_REWARDS),
        metric=draw(_METRICS),
        signatures=tuple(sorted(signatures, key=lambda s: (s.kind, s.symbol))),
    )


def _body(
    draw: st.DrawFn,
    variables: tuple[Variable, ...],
    actions: tuple[GroundAction, ...],
    depth: int = 2,
    passive: bool = False,
) -> Body:
    """A template body; ``passive`` ones have no actions."""
    shapes = ["condition", *(["action"] if actions and not passive else []), *(["control"] if depth else [])]
    match draw(st.sampled_from(shapes)):
        case "condition":
            return BodyCondition(draw(conditions(variables)))
        case "action":
            return BodyAction(draw(st.sampled_from(actions)).name)
        case _:
            kind = draw(st.sampled_from(BODY_KINDS))
            count = draw(st.integers(1, 3))
            passives = [passive or (kind == "skipper" and i < count - 1) for i in range(count)]
            return BodyControl(kind, tuple(_body(draw, variables, actions, depth - 1, p) for p in passives))


@st.composite
def nodes(draw: st.DrawFn, task: Task, depth: int = 3) -> Node:
    """A tree of nodes on a task, obeying the Skipper rule, with ids ``n1``, ``n2``, …"""
    counter = iter(range(1, 10_000))

    def node(level: int, passive: bool) -> Node:
        name = f"n{next(counter)}"
        shapes = ["condition"]
        if task.actions and not passive:
            shapes += ["action", "action"]
        if level:
            shapes += ["control"] * 3
        match draw(st.sampled_from(shapes)):
            case "condition":
                return ConditionNode(name, draw(conditions(task.variables)), draw(_LABELS), draw(_LABELS))
            case "action":
                action = draw(st.sampled_from(task.actions)).name
                return ActionNode(name, action, draw(st.booleans()), draw(st.booleans()), reason=draw(_LABELS))
            case _:
                if not draw(st.integers(0, 4)):
                    child = node(level - 1, passive)
                    attempts = draw(st.integers(1, 3))
                    return ControlNode(name, draw(_RETRIES), (child,), draw(_LABELS), attempts=attempts)
                kind = draw(st.sampled_from(CONTROL_KINDS))
                count = draw(st.integers(1, 3))
                children = tuple(
                    node(level - 1, passive or (kind == "skipper" and i < count - 1)) for i in range(count)
                )
                return ControlNode(name, kind, children, template=draw(_LABELS), reason=draw(_LABELS))

    return node(depth, False)


@st.composite
def trees(draw: st.DrawFn, names: st.SearchStrategy[str] = PLAIN_NAMES, depth: int = 3) -> Tree:
    """A tree with its task. Its claimed figures are random."""
    task = draw(tasks(names))
    probability = draw(st.fractions(0, 1, max_denominator=1000))
    target = draw(st.sampled_from([Fraction(1), Fraction("0.9"), Fraction(1, 3)]))
    bounds = draw(st.none() | st.just((probability, Fraction(1))))
    return Tree(task, draw(nodes(task, depth)), probability, target, draw(st.sampled_from(STATUSES)), bounds)


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
