"""What holds where a node is ticked: worked out from the tree, and compared with ticks in every state."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.belief.tick import STARTED, NodeStatus, compile_tick, memory_of
from bbtc.ground.condition import FALSE, TRUE, And, Condition, Is, Known, Not, Or, evaluate
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.rewrite.ensured import Facts, at_most, may_return, worth
from bbtc.tree.nodes import Node
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import conditions, nodes, tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN


def states(of: Task) -> list[tuple[int, ...]]:
    return list(product(*[(0, 1, 2) if each.three_valued else (0, 2) for each in of.variables]))


@examples(150)
@given(data=st.data())
def test_a_node_returns_only_what_it_may(data: st.DataObject) -> None:
    """Latches and counters as they may be, whether or not any run of the tree remembers that."""
    of = data.draw(tasks())
    root = data.draw(nodes(of))
    may = may_return(of, root)
    seen: list[tuple[Node, int]] = []
    tick = compile_tick(of, root, lambda node, status: seen.append((node, status)))
    rng = Random(5)
    most = 3 * sum(memory_of(root).started) + 1
    for values in states(of):
        for remembered in (0, *(rng.randrange(most) for _ in range(3))):
            tick(values, remembered)
    for node, status in seen:
        assert min(status, STARTED) in may[node.id], node


@examples(150)
@given(data=st.data())
def test_what_follows_from_conditions_holds_in_every_state_that_satisfies_them(data: st.DataObject) -> None:
    of = data.draw(tasks())
    draw = conditions(of.variables)
    given_: Sequence[tuple[Condition, NodeStatus]] = data.draw(
        st.lists(st.tuples(draw, st.sampled_from(list(NodeStatus))), max_size=4)
    )
    asked = data.draw(draw)
    facts = Facts(of)
    for condition, status in given_:
        facts.add(worth(condition, status))
    left = [values for values in states(of) if all(evaluate(c, values) == s for c, s in given_)]
    if facts.impossible:
        assert left == []
    if facts.sure(asked):
        assert all(evaluate(asked, values) is T for values in left)
    if facts.never_unknown(asked):
        assert all(evaluate(asked, values) is not U for values in left)
    if not facts.possible(at_most(asked, F)):
        assert all(evaluate(asked, values) is not F for values in left)


OF = task("a b c d", {0: U, 1: U}, Is(3, T), action("go", TRUE, ("1", {3: T})))
A, B, C = (Is(number, T) for number in range(3))


@pytest.mark.parametrize(
    ("known", "follows"),
    [
        ([(A, T)], A),
        ([(A, U)], Is(0, U)),
        ([(A, F)], And((Is(0, F), Known(0)))),
        ([(And((A, B)), T)], B),
        ([(Or((A, B)), T), (A, F)], B),
        ([(And((A, B)), F), (A, T)], Is(1, F)),
        ([(Or((And((A, B)), And((A, C)))), T)], A),
        ([(Or((A, B)), T)], Or((B, A))),
        ([(Or((A, B)), T), (Not(C), T)], And((Or((A, B)), Is(2, F)))),
        ([(Or((And((A, C)), B)), T)], And((Or((A, B)), Or((C, B))))),
        ([(FALSE, T)], C),
    ],
)
def test_what_conditions_ensure(known: list[tuple[Condition, Truth]], follows: Condition) -> None:
    facts = Facts(OF)
    with facts.meanwhile():
        for condition, value in known:
            facts.add(worth(condition, NodeStatus(int(value))))
        assert facts.sure(follows)
    assert not facts.sure(follows), "it is forgotten"
