"""Names and numbers in models for model checkers: Storm reads each as what it stands for."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import pytest

from bbtc.backends.models.jani import jani
from bbtc.backends.models.jani import task_text as jani_task
from bbtc.backends.models.prism import prism
from bbtc.backends.models.prism import task_text as prism_task
from bbtc.belief.simulate import simulate
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import Is
from bbtc.ground.task import Charge, Effect, Factor, GroundAction, InitialState, Outcome, Task, Variable
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Tree
from bbtc.verifier.verdict import Engine, verify
from tests.long_form import LONG, amount
from tests.strategies import soda_tree
from tests.verifier.test_storm import ask, ask_about_jani

HALF = Fraction(1, 2)

# The words of the languages of PRISM and Storm: model types, sections, functions, operators, properties.
WORDS = [
    "A", "E", "F", "G", "P", "R", "S", "U", "W", "X", "C", "I", "T", "H", "L", "M", "LRA", "MP",
    "Pmax", "Pmin", "Rmax", "Rmin", "Tmax", "Tmin", "bool", "ceil", "clock", "const", "cos",
    "ctmc", "ctmdp", "double", "dtmc", "endinit", "endinvariant", "endmodule", "endobservables",
    "endplayer", "endrewards", "endsystem", "exp", "exists", "false", "filter", "floor",
    "forall", "formula", "func", "global", "idtmc", "imdp", "init", "int", "invariant", "iff",
    "implies", "label", "lts", "log", "ma", "max", "mdp", "min", "mod", "module", "multi",
    "nondeterministic", "not", "and", "or", "observable", "observables", "of", "player",
    "pomdp", "popta", "pow", "prob", "probabilistic", "pta", "quantile", "rate", "rewards",
    "round", "sin", "smg", "state", "stochastic", "system", "tan", "true", "xor",
]  # fmt: skip


def spellings() -> list[str]:
    """Every word itself, in other letter case, and as the beginning of a name."""
    forms = ("{}", "{}x", "{}_open", "{}-1", "{}2", "-{}", "my_{}", "x{}y")
    both = [case for word in WORDS for case in dict.fromkeys([word, word.upper(), word.capitalize()])]
    return [form.format(word) for word in both for form in forms]


def corridor(names: list[str]) -> Task:
    """One step from each name to the next; the first fails half the time, for good."""
    names = sorted(names)
    variables = tuple(sorted((Variable(name, (), False) for name in names), key=lambda v: v.name))
    index = {variable.predicate: number for number, variable in enumerate(variables)}
    actions = []
    for here, there in pairwise(names):
        sets = Effect(None, ((index[here], Truth.FALSE), (index[there], Truth.TRUE)))
        fails = Effect(None, ((index[here], Truth.FALSE),))
        certain = (Outcome(Fraction(1), (sets,)),)
        first = (Outcome(HALF, (sets,)), Outcome(HALF, (fails,)))
        factor = Factor(first if here == names[0] else certain)
        actions.append(GroundAction(here, (), Is(index[here], Truth.TRUE), (factor,)))
    start = tuple(Truth.of(variable.predicate == names[0]) for variable in variables)
    return Task(
        domain="corridor",
        problem="words",
        variables=variables,
        initial=(InitialState(Fraction(1), start),),
        goal=Is(index[names[-1]], Truth.TRUE),
        actions=tuple(sorted(actions, key=lambda action: action.name)),
    )


@pytest.mark.parametrize("part", range(3))
def test_every_word_of_the_languages_can_be_a_name_in_a_task(part: int) -> None:
    task = corridor(spellings()[part::3])
    assert ask(prism_task(task), ['Pmax=? [F "goal"]']) == [HALF]
    assert ask_about_jani(jani_task(task), "goal") == [HALF]


def test_every_word_of_the_languages_can_be_a_name_in_a_tree() -> None:
    """Of a node, for which its formulas are named, as well as of a predicate and an action."""
    task = corridor(["endmodule", "endmodule_open"])
    here, there = (ConditionNode(word, Is(number, Truth.TRUE)) for number, word in enumerate(["a b", "b a"]))
    tests = tuple(
        ControlNode(name, "fallback", (replace(here, id=f"{name} x"), replace(there, id=f"{name} y")))
        for name in spellings()[:: amount(26, 1)]
    )
    go = ControlNode("end module", "fallback", (there, ActionNode("endmodule action", "endmodule()")))
    root = ControlNode("endmodule ends", "sequence", (*tests, go))
    tree = Tree(task, root, HALF, HALF, "target-reached")
    figures = simulate(task, root, Limits())
    assert (figures.success, figures.actions) == (HALF, 1)
    asked = ['P=? [F "success"]', 'R{"actions"}=? [F "finished"]']
    assert ask(prism.export(tree, {"form": "auto"}, None), asked) == [HALF, 1]
    assert ask_about_jani(jani.export(tree, {"form": "walk"}, None), "success", "expected-actions") == [
        HALF,
        1,
    ]


# --- numbers ---------------------------------------------------------------------------------


def lever(probability: Fraction, cost: Fraction, charge: Fraction = Fraction(0)) -> Tree:
    """A lever that is pulled once, and what a pull costs more if the handle is hot, as it is."""
    moved = Effect(None, ((1, Truth.TRUE),))
    outcomes = (Outcome(probability, (moved,), cost=cost), Outcome(1 - probability, ()))
    charges = (
        Charge(Is(0, Truth.TRUE), charge, charge),
        Charge(Is(0, Truth.FALSE), Fraction(7), Fraction(7)),
    )
    hot = Factor((Outcome(Fraction(1), (), charges=charges),))
    task = Task(
        domain="lever",
        problem="pull",
        variables=(Variable("hot", (), False), Variable("moved", (), False)),
        initial=(InitialState(Fraction(1), (Truth.TRUE, Truth.FALSE)),),
        goal=Is(1, Truth.TRUE),
        actions=(GroundAction("pull", (), Is(1, Truth.FALSE), (hot, Factor(outcomes)), Fraction(0)),),
    )
    root = ControlNode("n1", "sequence", (ActionNode("n2", "pull()"), ConditionNode("n3", task.goal)))
    return Tree(task, root, probability, probability, "target-reached")


_LIMIT = 2**63
HUGE = [
    Fraction(123456789012345678901234567890),
    *(Fraction(_LIMIT * factor + more) for factor in (1, 2, 4) for more in (-1, 0, 1)),
    Fraction(10**199),
    Fraction(_LIMIT, 3),
    Fraction(2 * _LIMIT - 1, _LIMIT + 1),
    Fraction(10**199 + 1, 10**198 + 7),
    Fraction(1, _LIMIT + 1),
    Fraction(1, 10**199),
]


@pytest.mark.parametrize("number", HUGE, ids=lambda number: f"{float(number):.6g}-{number % 97}")
def test_numbers_of_any_length_are_read_exactly(number: Fraction) -> None:
    probability = number if number < 1 else 1 / number
    tree = lever(probability, number, 2 * number)
    figures = simulate(tree.task, tree.root, Limits())
    cost = 2 * number + probability * number
    assert (figures.success, figures.cost, figures.reward) == (probability, cost, 2 * number)
    asked = ['P=? [F "success"]', 'R{"cost"}=? [F "finished"]', 'R{"reward"}=? [F "finished"]']
    found = [probability, cost, 2 * number]
    assert ask(prism.export(tree, {"form": "auto"}, None), asked) == found
    names = ("success", "expected-cost", "expected-reward")
    assert ask_about_jani(jani.export(tree, {"form": "auto"}, None), *names) == found
    engine: Engine = "all" if LONG or HUGE.index(number) % 4 == 0 else "own"
    assert verify(tree, Limits(), engine).problems == ()


def test_a_number_that_a_json_text_has_no_room_for_is_refused() -> None:
    tree = lever(Fraction(1, 10**2000 + 1), Fraction(10**2500))
    assert "0.0" in prism.export(tree, {"form": "auto"}, None)
    with pytest.raises(BbtcError, match="BBT0113"):
        jani.export(tree, {"form": "auto"}, None)


def test_what_is_certain_is_written_without_a_probability() -> None:
    """As people write it, and on one line."""
    commands = [line for line in prism_task(corridor(["a", "b", "c"])).splitlines() if "->" in line]
    certain = [line for line in commands if line.endswith(";")]
    assert len(certain) == len(commands) - 1, "but for the first step, which fails half the time"
    assert not [line for line in certain if " : " in line.split("->")[1]]


def test_cells_are_explained_in_comments() -> None:
    text = str(prism.export(soda_tree(), {"form": "walk"}, None))
    (cell,) = (line for line in text.splitlines() if line.startswith("  at : ["))
    assert cell.endswith(" // the leaf being ticked, from the left; then success, failure, blocked")
    variables = [line for line in text.splitlines() if " : [0.." in line]
    assert [line for line in variables if line.rstrip().endswith("//")] == []
