"""Hypothesis strategies: small random tasks and trees that obey every rule of theirs."""

from __future__ import annotations

import functools
from fractions import Fraction
from typing import Literal

from hypothesis import strategies as st

from bbtc.ground.condition import TRUE, And, Condition, Constant, Is, Known, Not, Or
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
CONTROL_KINDS: list[ControlKind] = ["sequence", "fallback", "skipper"]
BODY_KINDS: list[Literal["sequence", "fallback", "skipper"]] = ["sequence", "fallback", "skipper"]
STATUSES: list[PlanStatus] = ["target-reached", "out-of-reach", "stuck", "limit-reached", "interrupted"]


@st.composite
def distributions(draw: st.DrawFn, most: int = 3) -> list[Fraction]:
    """Positive probabilities that sum to 1."""
    weights = draw(st.lists(st.integers(1, 9), min_size=1, max_size=most))
    return [Fraction(weight, sum(weights)) for weight in weights]


def conditions(variables: tuple[Variable, ...]) -> st.SearchStrategy[Condition]:
    """Conditions over the variables of a task, of every kind."""
    return _conditions(len(variables))


# One strategy for all tasks of a size: making strategies anew costs more than drawing from them.
@functools.cache
def _conditions(count: int) -> st.SearchStrategy[Condition]:
    constants: st.SearchStrategy[Condition] = st.builds(Constant, st.booleans())
    if not count:
        return constants
    index = st.integers(0, count - 1)
    atoms = st.one_of(
        st.builds(Is, index, st.sampled_from([Truth.TRUE, Truth.FALSE])),
        st.builds(Is, index, st.just(Truth.UNKNOWN)),
        st.builds(Known, index),
        constants,
    )
    return st.recursive(
        atoms,
        lambda inner: st.one_of(
            st.builds(And, st.lists(inner, max_size=3).map(tuple)),
            st.builds(Or, st.lists(inner, max_size=3).map(tuple)),
            st.builds(Not, inner),
        ),
        max_leaves=4,
    )


def _effect(draw: st.DrawFn, variables: tuple[Variable, ...]) -> Effect:
    sets = [(i, draw(_TRUTHS[v.three_valued])) for i, v in enumerate(variables) if draw(_SOMETIMES)]
    return Effect(draw(conditions(variables)) if draw(_SOMETIMES) else None, tuple(sets))


def _charge(draw: st.DrawFn, variables: tuple[Variable, ...]) -> Charge:
    return Charge(draw(conditions(variables)), draw(_AMOUNTS), draw(_AMOUNTS))


def _factor(draw: st.DrawFn, variables: tuple[Variable, ...], nested: int) -> Factor:
    """A chance of up to three outcomes; chance nested in chance ``nested`` times."""
    outcomes = [
        Outcome(
            probability,
            tuple(_effect(draw, variables) for _ in range(draw(_FEW))),
            tuple(_factor(draw, variables, nested - 1) for _ in range(draw(_FEW) if nested else 0)),
            reward=draw(_AMOUNTS),
            cost=draw(_AMOUNTS),
            charges=tuple(_charge(draw, variables) for _ in range(draw(_SELDOM))),
        )
        for probability in draw(distributions())
    ]
    return Factor(tuple(outcomes), draw(st.booleans()))


_FEW = st.sampled_from([0, 1, 1, 2])
_SELDOM = st.sampled_from([0, 0, 0, 1, 2])
_SOMETIMES = st.sampled_from([False, False, True])
_AMOUNTS = st.sampled_from([Fraction(0), Fraction(0), Fraction(1), Fraction(-1, 3)])
_COSTS = st.sampled_from([Fraction(1), Fraction(0), Fraction(1, 3), Fraction("2.5")])
_TRUTHS = {
    True: st.sampled_from([Truth.TRUE, Truth.FALSE, Truth.UNKNOWN]),
    False: st.sampled_from([Truth.TRUE, Truth.FALSE]),
}
_KINDS: list[Literal["predicate", "action"]] = ["predicate", "action"]
_METRICS: list[Literal["cost", "reward"]] = ["cost", "reward"]


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
        Variable(draw(names), args(), draw(st.booleans()), draw(st.booleans()))
        for _ in range(draw(st.integers(0, 4)))
    ]
    variables = tuple(sorted({v.name: v for v in made}.values(), key=lambda v: v.name))
    acts = [
        GroundAction(draw(names), args(), draw(conditions(variables)), chance(), draw(_COSTS))
        for _ in range(draw(st.integers(0, most_actions)))
    ]
    actions = tuple(sorted({a.name: a for a in acts}.values(), key=lambda a: a.name))
    templates = [
        GroundTemplate(
            draw(names), args(), draw(conditions(variables)), chance(), _body(draw, variables, actions)
        )
        for _ in range(draw(_FEW))
    ]
    initial = tuple(
        InitialState(probability, tuple(draw(_TRUTHS[v.three_valued]) for v in variables))
        for probability in draw(distributions())
    )
    signatures = [Signature(draw(st.sampled_from(_KINDS)), draw(names), args()) for _ in range(draw(_FEW))]
    return Task(
        domain=draw(names),
        problem=draw(names),
        variables=variables,
        initial=initial,
        goal=draw(conditions(variables)),
        actions=actions,
        templates=tuple(sorted({t.name: t for t in templates}.values(), key=lambda t: t.name)),
        goal_probability=draw(st.sampled_from([Fraction(1), Fraction("0.9"), Fraction(2, 3)])),
        goal_reward=draw(st.sampled_from([Fraction(0), Fraction(100)])),
        metric=draw(st.sampled_from(_METRICS)),
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
    labels = st.none() | HOSTILE_NAMES

    def node(level: int, passive: bool) -> Node:
        name = f"n{next(counter)}"
        shapes = ["condition"]
        if task.actions and not passive:
            shapes += ["action", "action"]
        if level:
            shapes += ["control"] * 3
        match draw(st.sampled_from(shapes)):
            case "condition":
                return ConditionNode(name, draw(conditions(task.variables)), draw(labels), draw(labels))
            case "action":
                action = draw(st.sampled_from(task.actions)).name
                return ActionNode(name, action, draw(st.booleans()), draw(st.booleans()), reason=draw(labels))
            case _:
                if not draw(st.integers(0, 4)):
                    child = node(level - 1, passive)
                    attempts = draw(st.integers(1, 3))
                    return ControlNode(name, "retry", (child,), draw(labels), attempts=attempts)
                kind = draw(st.sampled_from(CONTROL_KINDS))
                count = draw(st.integers(1, 3))
                children = tuple(
                    node(level - 1, passive or (kind == "skipper" and i < count - 1)) for i in range(count)
                )
                return ControlNode(name, kind, children, template=draw(labels), reason=draw(labels))

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
