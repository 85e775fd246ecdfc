"""The rules of the passes that rewrite trees, and of the one that writes policies as trees: what stands
before, and what comes of it."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from bbtc.belief.chain import explore
from bbtc.ground.condition import And, Condition, Is, Known
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.synthesis.permissive import MultiPolicy
from bbtc.planner.synthesis.tree import in_phases, synthesize
from bbtc.rewrite.repeat import with_repeats
from bbtc.rewrite.retry import with_least_attempts
from bbtc.rewrite.shrink import shrunk
from bbtc.rewrite.simplify import numbered, simplified, without_idle_branches
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node
from tests.planner.test_refine import action, task

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN
ALWAYS = Is(0, F)

TASK = task(
    "won a b c",
    {1: U, 2: T},
    Is(0, T),
    action("try", ALWAYS, ("1/2", {0: T}), ("1/2", {3: T})),
    action("again", ALWAYS, ("1/2", {0: T}), ("1/2", {})),
    action("look", Is(1, U), ("1/2", {1: T}), ("1/2", {1: F})),
    action("sure", Is(3, T), ("1", {0: T})),
    action("risk", Is(3, F), ("1/2", {0: T}), ("1/2", {3: T})),
)
"""At first a is unknown, b holds, and nothing changes b."""

NAMES = {"won": 0, "a": 1, "b": 2, "c": 3}


_KINDS: dict[str, ControlKind] = {"sequence": "sequence", "fallback": "fallback", "skipper": "skipper"}


def tree_of(text: str) -> Node:
    """``fallback(won, retry2(try!), until2(try!!), known:a, a?, not:c)``: tests by the name of what they are
    about, actions with a mark, latched ones with two."""
    words = re.findall(r"[\w:?!]+|[()]", text)

    def node() -> Node:
        word = words.pop(0)
        if words[:1] != ["("]:
            latched = word.endswith("!!")
            return ActionNode("", word.rstrip("!") + "()", latched) if word[-1] == "!" else test(word)
        words.pop(0)
        children = []
        while words[0] != ")":
            children.append(node())
        words.pop(0)
        if word.startswith("until"):
            return ControlNode("", "retry-until-success", tuple(children), attempts=int(word[5:]))
        if word.startswith("retry"):
            return ControlNode("", "retry", tuple(children), attempts=int(word[5:]))
        return ControlNode("", _KINDS[word], tuple(children))

    def test(word: str) -> Node:
        value = Truth.UNKNOWN if word.endswith("?") else Truth.FALSE if word.startswith("not:") else T
        variable = NAMES[word.removeprefix("not:").removeprefix("known:").removesuffix("?")]
        return ConditionNode("", Known(variable) if word.startswith("known:") else Is(variable, value))

    return numbered(node())


def text_of(node: Node) -> str:
    match node:
        case ActionNode(action=name, latched=latched):
            return name.removesuffix("()") + ("!!" if latched else "!")
        case ConditionNode(condition=condition):
            return condition_text(condition)
        case _:
            children = ", ".join(map(text_of, node.children))
            word = "until" if node.kind == "retry-until-success" else node.kind
            return f"{word}{node.attempts or ''}({children})"


def condition_text(condition: Condition) -> str:
    names = list(NAMES)
    match condition:
        case Is(variable, value):
            return {T: names[variable], F: f"not:{names[variable]}", U: f"{names[variable]}?"}[value]
        case Known(variable):
            return f"known:{names[variable]}"
        case And(parts):
            return " and ".join(map(condition_text, parts))
        case _:
            raise AssertionError(condition)


@pytest.mark.parametrize(
    ("rule", "before", "after"),
    [
        (1, "fallback(won, sequence(b, try!))", "fallback(won, try!)"),
        (1, "fallback(won, not:b, try!)", "fallback(won, try!)"),
        (1, "fallback(won, sequence(not:b, again!), try!)", "fallback(won, try!)"),
        (1, "fallback(won, skipper(again!), b, try!)", "fallback(won, again!)"),
        (1, "sequence(won, not:b, try!)", "won"),
        (2, "fallback(won, fallback(sequence(c, again!), try!))", "fallback(won, sequence(c, again!), try!)"),
        (3, "fallback(won, sequence(try!))", "fallback(won, try!)"),
        (1, "fallback(won, again!, again!)", "fallback(won, again!)"),
        (
            4,
            "fallback(won, sequence(a?, look!), sequence(c, a, again!), sequence(c, not:a, sure!), try!)",
            "fallback(won, sequence(a?, look!), sequence(c, fallback(sequence(a, again!), sure!)), try!)",
        ),
        (
            5,
            "fallback(won, sequence(a?, look!), sequence(a, c, again!), sequence(not:a, again!), try!)",
            "fallback(won, sequence(a?, look!), sequence(fallback(sequence(a, c), not:a), again!), try!)",
        ),
    ],
)
def test_simplification(rule: int, before: str, after: str) -> None:
    del rule  # its number in the docstring of the module
    assert text_of(simplified(TASK, tree_of(before), Limits(), closed_world=True)) == after


@pytest.mark.parametrize(
    ("rule", "before", "after"),
    [
        (1, "fallback(won, sequence(not:b, again!), try!)", "fallback(won, try!)"),
        (1, "fallback(won, not:b, sequence(b, try!))", "fallback(won, not:b, sequence(b, try!))"),
        (3, "sequence(b, fallback(sequence(not:b, again!), try!))", "sequence(b, try!)"),
    ],
)
def test_branches_without_use(rule: int, before: str, after: str) -> None:
    del rule
    root = tree_of(before)
    found = without_idle_branches(TASK, root, explore(TASK, root, Limits()), Limits())
    assert text_of(found) == after
    assert (found is root) == (before == after)


@pytest.mark.parametrize(
    ("rule", "target", "before", "after"),
    [
        (
            1,
            "1/2",
            "fallback(won, sequence(c, sure!), sequence(not:c, risk!))",
            "fallback(won, sequence(not:c, risk!))",
        ),
        (
            1,
            "1",
            "fallback(won, sequence(c, sure!), sequence(not:c, risk!))",
            "fallback(won, sequence(c, sure!), sequence(not:c, risk!))",
        ),
        (1, "1/2", "fallback(fallback(won, sequence(c, sure!)), fallback(won, try!))", "fallback(won, try!)"),
    ],
)
def test_alternatives_that_a_target_does_not_take(rule: int, target: str, before: str, after: str) -> None:
    del rule
    assert text_of(shrunk(TASK, tree_of(before), Fraction(target), Limits(), closed_world=True)) == after


@pytest.mark.parametrize(
    ("rule", "target", "before", "after"),
    [
        (1, "3/4", "fallback(won, again!)", "fallback(won, retry2(again!))"),
        (1, "7/8", "fallback(won, again!)", "fallback(won, retry3(again!))"),
        (1, "1/2", "fallback(won, sequence(c, sure!), try!)", "fallback(won, sequence(c, sure!), try!)"),
    ],
)
def test_attempts(rule: int, target: str, before: str, after: str) -> None:
    del rule
    assert text_of(with_least_attempts(TASK, tree_of(before), Fraction(target), Limits())) == after


_TWICE = "sequence(try!!, again!!, won)"
_PAIR = "sequence(try!!, again!!)"


@pytest.mark.parametrize(
    ("rule", "before", "after"),
    [
        (1, "fallback(won, sequence(again!!, won), sequence(again!!, won))", "fallback(won, retry2(again!))"),
        (2, f"fallback(won, {_TWICE}, {_TWICE})", f"fallback(won, until2({_TWICE}))"),
        (2, f"fallback(won, {_TWICE}, {_TWICE}, {_TWICE}, c)", f"fallback(won, until3({_TWICE}), c)"),
        # What follows would be given up as soon as it runs: the node begins anew.
        (2, f"fallback(won, {_TWICE}, {_TWICE}, again!!)", None),
        (2, f"fallback(won, sequence(fallback({_PAIR}, {_PAIR}), sure!!))", None),
        # In between the tick leaves the attempt, which would begin anew.
        (2, f"fallback(won, sequence(c, again!!, won), {_TWICE}, {_TWICE})", None),
        # Not neighbours.
        (2, f"fallback(won, {_TWICE}, again!!, {_TWICE})", None),
    ],
)
def test_repeats(rule: int, before: str, after: str | None) -> None:
    del rule
    tree = tree_of(before)
    found = with_repeats(TASK, tree, explore(TASK, tree, Limits()), Limits())
    assert text_of(found) == (before if after is None else after)


def policy_of(text: str, of: Task = TASK) -> MultiPolicy:
    """``FUTF look try, …``: states as the values of won, a, b and c, and what is chosen there."""
    states, choices, actions = [], [], []
    names = [each.name for each in of.actions]
    for row, line in enumerate(text.split(", ")):
        values, *chosen = line.split()
        states.append([{"T": T, "F": F, "U": U}[each] for each in values])
        for name in chosen:
            choices.append(row)
            actions.append(names.index(f"{name}()"))
    values_of = np.array(states, dtype=np.uint8)
    nothing = np.zeros(0, dtype=np.int32)
    return MultiPolicy(
        goal=values_of[:, 0] == T,
        choice_state=np.array(choices, dtype=np.int32),
        choice_action=np.array(actions, dtype=np.int32),
        edge_choice=nothing,
        edge_successor=nothing,
        values=values_of,
        idle=np.zeros(len(states), dtype=np.bool_),
        initial=np.arange(len(states)),
        beliefs=np.zeros((len(states), 0), dtype=np.uint32),
    )


@pytest.mark.parametrize(
    ("rule", "before", "after"),
    [
        (1, "TFTF, FFTF try", "fallback(won, try!)"),
        (2, "TFTF, UFTF look, FFTF try", "fallback(skipper(won, look!), try!)"),
        (3, "TFTF, TFFF try, FFFF try", "fallback(sequence(won, b), try!)"),
        (3, "TFTF, FFUF try", "fallback(won and b, try!)"),
        (4, "FTTF try, FFTF, FFTT", "fallback(won, sequence(a, try!))"),
        (5, "FTTF try, FUTF, FFTF", "fallback(won, sequence(known:a, a, try!))"),
        (6, "FTFF try, FFTF try, FFFF", "fallback(won, sequence(fallback(a, b), try!))"),
        (
            7,
            "FTTF try, FTTT try, FTFT again, FTFF risk, FFTF, FFFT, FFFF, FFTT",
            "fallback(won, sequence(a, fallback(sequence(b, try!), sequence(c, again!), risk!)))",
        ),
    ],
)
def test_policies_as_trees(rule: int, before: str, after: str) -> None:
    of = replace(TASK, goal=And((Is(0, T), Is(2, T)))) if rule == 3 else TASK
    assert text_of(synthesize(of, policy_of(before, of), Limits())) == after


def test_phases() -> None:
    """Rule 8 of policies."""
    phases = [(2, policy_of("FTTF try")), (1, policy_of("FTTF again"))]
    assert (
        text_of(in_phases(TASK, phases, Limits()))
        == "fallback(retry2(fallback(won, try!)), retry1(fallback(won, again!)))"
    )
