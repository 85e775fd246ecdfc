"""What a tree attains in the worst world at the start, and which that is."""

from __future__ import annotations

import json
from collections import Counter
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import Phase, given, seed, settings

import bbtc
from bbtc.artefacts import dumps, tree_to_json
from bbtc.cli.wording import figures_report, worst_world_line
from bbtc.diagnostics import BbtcError, LimitReached, Report
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task, simulate_tree, with_worst_world
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from bbtc.source import SourceFile
from tests.cli.program import bbtc as program
from tests.domains.lifted import TooLarge
from tests.ground.examples import task_of
from tests.hidden.reference import HiddenText, World
from tests.hidden.texts import texts
from tests.hidden.tree_on_beliefs import TreeOnBeliefs, formulas_of
from tests.long_form import amount
from tests.profiles import examples
from tests.strategies import soda_tree


def _named(world: World) -> set[str]:
    return {f"{name}({','.join(args)})" for name, *args in world}


def _compared(text: str, *, lower: bool, noise: bool) -> str:
    """Plan a tree and compare the worst world with the worst of all, each tried by itself."""
    reference = HiddenText.of(text)
    options = Options(max_actions=2) if noise else None
    try:
        if not reference.prior or (not noise and len(reference.mdp(60).goals) < 2):
            return "not planned"
        task = compile_sources([SourceFile("x", text)], Report(), Limits()) if lower else task_of(text)
        plan = plan_task(task, None, "policy", Limits(states=300, nodes=40), lambda _: None, options=options)
        tree = TreeOnBeliefs(reference, dumps(tree_to_json(plan.tree)), formulas_of(plan.tree.task))
        success = {world: tree.success_in(world) for world, _ in reference.prior}
    except (BbtcError, LimitReached, TooLarge):
        return "none"
    worst = plan.figures.worst
    if worst is None:
        assert not any(variable.hidden for variable in plan.tree.task.variables), text
        return "nothing hidden"
    least = min(success.values())
    assert worst.success == least, text
    facts = {*worst.facts}
    found = [p for world, p in success.items() if _named(world) & facts == worst.true]
    assert found, text
    assert not facts or set(found) == {least}, text
    return "the same in every world" if least == plan.figures.success else "worse"


@pytest.mark.parametrize("lower", [False, True])
@pytest.mark.parametrize("noise", [False, True])
def test_each_world_by_itself_is_no_worse(noise: bool, lower: bool) -> None:
    done: Counter[str] = Counter()

    @seed(2 * noise + lower)
    @settings(examples(amount(20, 1_000)), phases=[Phase.generate])
    @given(texts(noise=noise))
    def each(text: str) -> None:
        done[_compared(text, lower=lower, noise=noise)] += 1

    each()
    assert done["worse"] > 1, done


CUPS = """(define (domain cups) (:types cup)
  (:predicates (ball ?c - cup) (lifted ?c - cup) (found))
  (:action lift :parameters (?c - cup) :precondition (forall (?o - cup) (not (lifted ?o)))
    :effect (and (lifted ?c) (when (ball ?c) (found))) :observe (ball ?c)))
(define (problem three) (:domain cups) (:objects a b c - cup)
  (:init {init}) (:goal (found)) (:goal-probability {target}))"""


def planned(text: str, options: Options | None = None) -> Plan:
    task = compile_sources([SourceFile("x.pddl", text)], Report(), Limits())
    return plan_task(task, None, "policy", Limits(), lambda _: None, options=options)


@pytest.mark.parametrize(
    ("init", "mean"),
    [
        ("(oneof (ball a) (ball b) (ball c))", Fraction(1, 3)),
        ("(probabilistic 0.2 (ball a) 0.7 (ball b) 0.1 (ball c))", Fraction(7, 10)),
    ],
)
def test_who_may_lift_one_cup_only_finds_nothing_in_the_worst_world(init: str, mean: Fraction) -> None:
    plan = planned(CUPS.format(init=init, target=mean))
    assert plan.figures.success == mean
    worst = plan.figures.worst
    assert worst is not None
    assert worst.success == 0
    lifted = next(node for node in bbtc.dumps(plan).split('"') if node.startswith("lift("))[5]
    assert f"ball({lifted})" not in worst.true
    assert len(worst.true) == 1


def test_the_worst_world_is_told() -> None:
    plan = planned(CUPS.format(init="(oneof (ball a) (ball b) (ball c))", target="1/3"))
    assert plan.figures.worst is not None
    (true,) = plan.figures.worst.true
    where = f"where {true}, and no other hidden fact, is true at the start"
    assert f"worst     0 {where}" in figures_report(plan.tree, plan.figures)
    assert worst_world_line(plan.figures) == [f"success probability 0 {where}, the worst world"]


def test_the_program_tells_it(tmp_path: Path) -> None:
    text = CUPS.format(init="(oneof (ball a) (ball b) (ball c))", target="1/3")
    (tmp_path / "cups.pddl").write_text(text, "utf-8")
    done = program("plan", "cups.pddl", "-q", "-o", "tree.json", folder=tmp_path)
    assert "the worst world" in done.stderr
    shown = json.loads(program("simulate", "tree.json", "--json", folder=tmp_path).stdout)["worst_world"]
    assert shown["success"] == "0"
    assert sorted(shown["facts"].values()) == ["false", "false", "true"]


def test_a_tree_that_surely_succeeds_does_so_in_every_world() -> None:
    text = CUPS.format(init="(oneof (ball a) (ball b) (ball c))", target=1).replace(
        ":precondition (forall (?o - cup) (not (lifted ?o)))", ""
    )
    worst = bbtc.simulate(planned(text)).worst
    assert worst is not None
    assert (worst.success, worst.facts) == (1, ())


def test_with_readings_as_wrong_both_ways_all_worlds_are_alike() -> None:
    text = """(define (domain ward) (:predicates (ill) (done) (well))
      (:action test :precondition (not (done)) :observe (probabilistic 0.85 (ill)))
      (:action give :precondition (not (done)) :effect (and (done) (when (ill) (well))))
      (:action spare :precondition (not (done)) :effect (and (done) (when (not (ill)) (well)))))
    (define (problem p) (:domain ward) (:init (unknown (ill))) (:goal (well)) (:goal-probability 0.9))"""
    plan = planned(text, Options(allow_guess=True))
    worst = plan.figures.worst
    assert worst is not None
    assert worst.success == plan.figures.success == Fraction(289, 298)
    assert "worst     289/298 (≈ 0.969799) in every world" in figures_report(plan.tree, plan.figures)


def test_very_many_worlds_are_not_tried() -> None:
    cups = " ".join(f"c{number}" for number in range(13))
    text = CUPS.format(init="", target="1/10000").replace("a b c - cup", f"{cups} - cup")
    text = text.replace("(:init )", f"(:init {' '.join(f'(unknown (ball {cup}))' for cup in cups.split())})")
    text = text.replace("(when (ball ?c) (found))", "").replace(
        "(:goal (found))", f"(:goal (and {' '.join(f'(ball {cup})' for cup in cups.split())}))"
    )
    task = compile_sources([SourceFile("x.pddl", text)], Report(), Limits())
    plan = plan_task(task, None, "policy", Limits(seconds=20), lambda _: None)
    assert plan.figures.worst is None
    (line,) = worst_world_line(plan.figures)
    assert line.endswith("not told: the hidden facts that matter to the tree have more than 4,096 worlds")
    assert any(each.startswith("worst     not told: ") for each in figures_report(plan.tree, plan.figures))


def test_very_many_states_are_not_looked_at() -> None:
    plan = planned(CUPS.format(init="(oneof (ball a) (ball b) (ball c))", target="1/3"))
    figures, _ = simulate_tree(plan.tree, Limits())
    found = with_worst_world(plan.tree, figures, Limits(states=2))
    assert found.worst is None
    assert found.worst_untold is not None
    assert found.worst_untold.startswith("more than 2 states ")


def test_a_tree_without_its_worlds_says_so(tmp_path: Path) -> None:
    """What the robot sees at once needs no worlds; with the domain at hand, they are known."""
    text = """(define (domain well) (:predicates (dry) (looked) (water))
      (:action look :precondition (not (looked)) :effect (looked) :observe (dry))
      (:action draw :precondition (not (dry)) :effect (probabilistic 0.5 (water) 0.5 (dry))))
    (define (problem p) (:domain well) (:init (unknown (dry))) (:goal (water)) (:goal-probability 0.25))"""
    (tmp_path / "well.pddl").write_text(text, "utf-8")
    program("plan", "well.pddl", "-q", "-o", "tree.json", folder=tmp_path)
    alone = program("simulate", "tree.json", folder=tmp_path).stdout
    assert "worst     not told: the tree does not hold the worlds of its hidden facts" in alone
    shown = json.loads(program("simulate", "tree.json", "--json", folder=tmp_path).stdout)
    assert "give the domain and the problem" in shown["worst_world_untold"]
    beside = program("simulate", "tree.json", "well.pddl", folder=tmp_path).stdout
    assert "worst     0 where dry() is true at the start" in beside


def test_nothing_is_said_where_nothing_is_hidden_or_all_succeeds() -> None:
    seen, _ = simulate_tree(soda_tree(), Limits())
    assert with_worst_world(soda_tree(), seen, Limits()).worst_untold is None
    sure = planned(
        CUPS.format(init="(oneof (ball a) (ball b) (ball c))", target=1).replace(
            ":precondition (forall (?o - cup) (not (lifted ?o)))", ""
        )
    )
    assert with_worst_world(sure.tree, sure.figures, Limits()).worst_untold is None
