"""Loops are solved exactly, not cut off."""

from __future__ import annotations

from fractions import Fraction

from bbtc.belief.simulate import simulate
from bbtc.ground.condition import Is, conjunction
from bbtc.ground.task import Effect, Factor, GroundAction, InitialState, Outcome, Task, Variable
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node

HELD, BROKEN = 0, 1


def pick_task(hold: Fraction, breaks: Fraction) -> Task:
    """Picking holds, breaks the thing, or changes nothing."""
    outcomes = (
        Outcome(hold, (Effect(None, ((HELD, Truth.TRUE),)),)),
        Outcome(breaks, (Effect(None, ((BROKEN, Truth.TRUE),)),)),
        Outcome(1 - hold - breaks, ()),
    )
    pick = GroundAction("pick", (), Is(BROKEN, Truth.FALSE), (Factor(outcomes),), cost=Fraction(2))
    return Task(
        "pick",
        "once",
        (Variable("held", (), False), Variable("broken", (), False)),
        (InitialState(Fraction(1), (Truth.FALSE, Truth.FALSE)),),
        Is(HELD, Truth.TRUE),
        (pick,),
    )


def retry_tree(*, latched: bool) -> Node:
    """Fallback(held, Sequence(not broken, pick, held))."""
    attempt = ControlNode(
        "n3",
        "sequence",
        (
            ConditionNode("n4", Is(BROKEN, Truth.FALSE)),
            ActionNode("n5", "pick()", latched=latched),
            ConditionNode("n6", Is(HELD, Truth.TRUE)),
        ),
    )
    return ControlNode("n1", "fallback", (ConditionNode("n2", Is(HELD, Truth.TRUE)), attempt))


def test_an_unlatched_action_is_tried_until_it_holds() -> None:
    figures = simulate(pick_task(Fraction(1, 3), Fraction(0)), retry_tree(latched=False), Limits())
    assert figures.success == 1
    # A geometric number of attempts: 1/p of them on average, each of cost 2.
    assert figures.actions == 3
    assert figures.cost == 6


def test_a_loop_with_two_ways_out_divides_by_their_ratio() -> None:
    figures = simulate(pick_task(Fraction(3, 10), Fraction(1, 10)), retry_tree(latched=False), Limits())
    assert figures.success == Fraction(3, 4)
    assert figures.failure == Fraction(1, 4)
    assert figures.actions == Fraction(10, 4)
    assert figures.actions_given_success == Fraction(10, 4)
    assert [(share.node, share.probability) for share in figures.failures] == [("n4", Fraction(1, 4))]


def test_a_latched_action_is_tried_once() -> None:
    figures = simulate(pick_task(Fraction(3, 10), Fraction(1, 10)), retry_tree(latched=True), Limits())
    assert (figures.success, figures.failure, figures.actions) == (Fraction(3, 10), Fraction(7, 10), 1)


def test_a_loop_that_nothing_leaves_is_endless() -> None:
    figures = simulate(pick_task(Fraction(0), Fraction(0)), retry_tree(latched=False), Limits())
    assert (figures.success, figures.failure, figures.blocked, figures.endless) == (0, 0, 0, 1)
    assert figures.cost is None
    assert figures.actions is None


def test_a_loop_of_several_states_is_solved_exactly() -> None:
    """A walk on 0..3 from 1, up with 2/3: reaches 3 before 0 with (1-r)/(1-r^3), r = 1/2."""
    low, high = 0, 1  # position in binary: 00, 01, 10, 11
    values = {0: (0, 0), 1: (0, 1), 2: (1, 0), 3: (1, 1)}

    def at(position: int) -> list[Is]:
        bits = values[position]
        return [Is(low, Truth.of(bool(bits[0]))), Is(high, Truth.of(bool(bits[1])))]

    def step(position: int) -> GroundAction:
        def go(to: int, p: Fraction) -> Outcome:
            return Outcome(p, (Effect(None, tuple((i.variable, i.value) for i in at(to))),))

        factor = Factor((go(position + 1, Fraction(2, 3)), go(position - 1, Fraction(1, 3))))
        return GroundAction(f"step{position}", (), conjunction(at(position)), (factor,))

    task = Task(
        "walk",
        "ruin",
        (Variable("a", (), False), Variable("b", (), False)),
        (InitialState(Fraction(1), (Truth.FALSE, Truth.TRUE)),),
        conjunction(at(3)),
        (step(1), step(2)),
    )
    children: list[Node] = [ConditionNode("n1", task.goal)]
    for position in (1, 2):
        here = ConditionNode(f"c{position}", conjunction(at(position)))
        act = ActionNode(f"a{position}", f"step{position}()", latched=False)
        children.append(ControlNode(f"s{position}", "sequence", (here, act)))
    figures = simulate(task, ControlNode("n0", "fallback", tuple(children)), Limits())
    ratio = Fraction(1, 2)
    assert figures.success == (1 - ratio) / (1 - ratio**3) == Fraction(4, 7)
    assert figures.success + figures.failure == 1
