"""The shape of ground effects: what is kept apart, what is merged, what they cost."""

from __future__ import annotations

from fractions import Fraction

import pytest

from bbtc.diagnostics import BbtcError, Report
from bbtc.ground.describe import describe
from bbtc.ground.instantiate import ground, instantiate
from bbtc.ground.task import Factor, GroundAction, Task, charges_of, effects_of
from bbtc.kleene import Truth
from bbtc.limits import Limits
from tests.ground.examples import model_of, task_of

_EFFECT = """(define (domain d) (:types t) (:predicates (p) (q) (r) (s ?x - t) (fixed ?x - t))
  (:functions (total-cost) (length ?x - t)) (:constants a b c - t)
  (:action act :parameters () :effect {effect})
  (:action use :precondition (and (p) (q) (r) (s a) (s b) (s c)) :effect (p)))
(define (problem x) (:domain d) (:init (fixed a) (= (length a) 2.5) {init})
  (:goal (or (and (p) (q) (r) (s a) (s b) (s c)) (not (p)) (not (q)) (not (r)))) {metric})"""


def _task(effect: str, init: str = "", metric: str = "") -> Task:
    model = model_of(_EFFECT.format(effect=effect, init=init, metric=metric))
    return instantiate(model, Report(), Limits())


def _act(effect: str, init: str = "(p) (q)") -> list[str]:
    """The factors of ``act``, in words."""
    task = _task(effect, init)
    return [_words(task, factor) for factor in task.action_by_name["act()"].factors]


def _words(task: Task, factor: Factor) -> str:
    outcomes = []
    for outcome in factor.outcomes:
        effects = []
        for effect in outcome.effects:
            sets = " ".join(f"{task.variables[index].name}={value.word}" for index, value in effect.sets)
            effects.append(sets if effect.when is None else f"[{describe(task, effect.when)}] {sets}")
        nested = [f"<{_words(task, each)}>" for each in outcome.factors]
        outcomes.append(f"{outcome.probability}: {'; '.join([*effects, *nested])}".rstrip())
    return " | ".join(outcomes)


RULES = {
    1: [("(forall (?x - t) (s ?x))", ["1: s(a)=true s(b)=true s(c)=true"])],
    2: [
        ("(and (r) (when (fixed a) (not (q))) (when (fixed b) (not (p))))", ["1: q()=false r()=true"]),
        ("(when (or (fixed a) (p)) (not (q)))", ["1: q()=false"]),
        ("(when (and (fixed a) (p)) (and (not (p)) (not (q))))", ["1: [p()] p()=false q()=false"]),
    ],
    3: [
        (
            "(when (q) (probabilistic 0.5 (not (p)) 0.5 (not (q))))",
            ["1/2: [q()] p()=false | 1/2: [q()] q()=false"],
        ),
    ],
    4: [
        ("(and (not (p)) (unknown (p)) (q) (not (q)))", ["1: p()=unknown q()=true"]),
        (
            "(when (p) (and (not (p)) (unknown (p)) (r) (not (r))))",
            ["1: [p()] p()=unknown r()=true"],
        ),
    ],
    5: [
        (
            "(probabilistic 0.5 (probabilistic 0.2 (not (p)) 0.8 (not (q))) 0.5 (r))",
            ["1/10: p()=false | 2/5: q()=false | 1/2: r()=true"],
        ),
        (
            "(probabilistic 0.5 (oneof (not (p)) (not (q))) 0.5 (r))",
            ["1/2: <1/2: p()=false | 1/2: q()=false> | 1/2: r()=true"],
        ),
    ],
    6: [
        ("(probabilistic 0.3 (r) 0.5 (not (p)) 0.2 (r))", ["1/2: r()=true | 1/2: p()=false"]),
        (
            "(probabilistic 0.3 (when (p) (r)) 0.5 (not (p)) 0.2 (when (p) (r)))",
            ["1/2: [p()] r()=true | 1/2: p()=false"],
        ),
    ],
    7: [
        ("(and (not (p)) (probabilistic 0.4 (r) 0.6 (r)))", ["1: p()=false r()=true"]),
        (
            "(and (probabilistic 0.4 (r) 0.6 (r)) (probabilistic 0.5 (not (p))))",
            ["1/2: p()=false r()=true | 1/2: r()=true"],
        ),
    ],
    8: [
        (
            "(and (r) (probabilistic 0.2 (not (p)) 0.8 (not (q))))",
            ["1/5: p()=false r()=true | 4/5: q()=false r()=true"],
        ),
        (
            "(and (probabilistic 0.2 (not (p))) (probabilistic 0.5 (not (q))) (r))",
            ["1: r()=true", "1/5: p()=false | 4/5:", "1/2: q()=false | 1/2:"],
        ),
    ],
}
"""For each rule of ``bbtc.ground.effects`` effects, and the factors that they come to."""


@pytest.mark.parametrize(("effect", "factors"), [pair for pairs in RULES.values() for pair in pairs])
def test_an_effect_is_rewritten(effect: str, factors: list[str]) -> None:
    assert _act(effect) == factors


def test_what_is_certain_joins_the_only_chance() -> None:
    assert _act("(and (not (p)) (probabilistic 0.2 (q) 0.8 (not (q))))") == [
        "1/5: p()=false q()=true | 4/5: p()=false q()=false"
    ]


def test_several_chances_stay_apart() -> None:
    assert _act("(and (not (p)) (probabilistic 0.2 (not (q))) (probabilistic 0.3 (r)))") == [
        "1: p()=false",
        "1/5: q()=false | 4/5:",
        "3/10: r()=true | 7/10:",
    ]


def test_chance_under_forall_is_a_factor_for_each_object() -> None:
    assert _act("(forall (?x - t) (probabilistic 0.5 (s ?x)))") == [
        "1/2: s(a)=true | 1/2:",
        "1/2: s(b)=true | 1/2:",
        "1/2: s(c)=true | 1/2:",
    ]


def test_a_static_guard_decides_which_chances_there_are() -> None:
    assert _act("(forall (?x - t) (when (fixed ?x) (probabilistic 0.5 (s ?x))))") == ["1/2: s(a)=true | 1/2:"]


def test_a_guard_moves_into_the_chance() -> None:
    assert _act("(and (not (q)) (when (q) (probabilistic 0.5 (not (p)) 0.5 (unknown (r)))))") == [
        "1/2: q()=false; [q()] p()=false | 1/2: q()=false; [q()] r()=unknown"
    ]


def test_a_single_nested_chance_is_multiplied_in() -> None:
    assert _act("(probabilistic 0.5 (and (not (p)) (probabilistic 0.5 (not (q)))) 0.5 (r))") == [
        "1/4: p()=false q()=false | 1/4: p()=false | 1/2: r()=true"
    ]


def test_several_nested_chances_stay_nested() -> None:
    assert _act(
        "(probabilistic 0.5 (forall (?x - t) (when (fixed ?x) (oneof (s a) (s b)))) 0.5 (not (p)))"
    ) == ["1/2: <1/2: s(a)=true | 1/2: s(b)=true> | 1/2: p()=false"]
    assert _act(
        "(probabilistic 0.5 (and (probabilistic 0.5 (not (p))) (probabilistic 0.5 (r))) 0.5 (s a))"
    ) == ["1/2: <1/2: p()=false | 1/2:>; <1/2: r()=true | 1/2:> | 1/2: s(a)=true"]


def test_equal_outcomes_are_merged_and_impossible_ones_dropped() -> None:
    assert _act("(probabilistic 0.2 (and (r) (not (p))) 0.3 (and (not (p)) (r)) 0 (q) 0.5 (and))") == [
        "1/2: p()=false r()=true | 1/2:"
    ]


def test_branches_that_add_nothing_to_what_is_certain_are_no_chance() -> None:
    assert _act("(and (r) (oneof (r) (and)))") == ["1: r()=true"]
    assert not _task("(and (r) (oneof (r) (and)))").action_by_name["act()"].factors[0].oneof


def test_a_oneof_is_marked_and_counts_as_equally_likely() -> None:
    task = _task("(oneof (not (p)) (not (q)) (and))", "(p) (q)")
    (factor,) = task.action_by_name["act()"].factors
    assert factor.oneof
    assert [outcome.probability for outcome in factor.outcomes] == [Fraction(1, 3)] * 3


def test_true_wins_over_unknown_and_unknown_over_false() -> None:
    assert _act("(and (p) (not (p)) (unknown (p)) (not (r)) (unknown (r)))") == ["1: p()=true r()=unknown"]


def test_rounded_probabilities_become_exact() -> None:
    third = "0.3333333333333333"
    (factor,) = _task(f"(probabilistic {third} (p) {third} (q) {third} (r))").action_by_name["act()"].factors
    assert [outcome.probability for outcome in factor.outcomes] == [Fraction(1, 3)] * 3


# --- costs and rewards -----------------------------------------------------------------------


def _only(task: Task) -> GroundAction:
    return task.action_by_name["act()"]


def test_costs_come_from_the_effect_and_the_initial_numbers() -> None:
    action = _only(_task("(and (p) (increase (total-cost) (* 2 (+ (length a) 1/2))))"))
    assert action.cost == 6
    assert _task("(and (p) (s b) (s c))", "(q) (r) (s a)").action_by_name["use()"].cost == 0


@pytest.mark.parametrize(
    ("amount", "cost"),
    [
        ("(+ 7 (- 3))", "4"),
        ("(- 7 3)", "4"),
        ("(- (- 3))", "3"),
        ("(* 7 (- (- 1/2)))", "7/2"),
        ("(/ 7 2)", "7/2"),
        ("(+ (length a) (* 2 3))", "17/2"),
        ("(- 7 (length a))", "9/2"),
    ],
)
def test_arithmetic_is_that_of_school(amount: str, cost: str) -> None:
    assert _only(_task(f"(and (p) (increase (total-cost) {amount}))")).cost == Fraction(cost)


def test_a_branch_may_cost_more() -> None:
    action = _only(
        _task("(and (increase (total-cost) 1) (probabilistic 0.5 (and (p) (increase (total-cost) 3))))")
    )
    (factor,) = action.factors
    assert (action.cost, [outcome.cost for outcome in factor.outcomes]) == (1, [3, 0])


def test_without_a_cost_fluent_every_action_costs_one() -> None:
    task = task_of(
        "(define (domain d) (:predicates (p)) (:action a :effect (p)))"
        "(define (problem x) (:domain d) (:init) (:goal (p)))"
    )
    assert [action.cost for action in task.actions] == [1]


def test_rewards_are_kept_by_outcome() -> None:
    action = _only(
        _task(
            "(probabilistic 0.5 (and (p) (increase (reward) 5)) 0.5 (decrease (reward) 1))",
            "",
            "(:metric maximize (reward))",
        )
    )
    (factor,) = action.factors
    assert [outcome.reward for outcome in factor.outcomes] == [5, -1]


@pytest.mark.parametrize(
    ("metric", "cost", "reward"),
    [
        ("", "5", "7"),
        ("(:metric minimize (total-cost))", "5", "7"),
        ("(:metric minimize (fuel))", "2", "7"),
        ("(:metric minimize (length))", "0", "7"),
        ("(:metric maximize (joy))", "5", "3"),
        ("(:metric minimize (total-time))", "1", "7"),
        ("(:metric minimize total-time)", "1", "7"),
        ("(:metric maximize (goal-probability))", "5", "7"),
    ],
)
def test_only_the_fluent_that_the_metric_names_counts(metric: str, cost: str, reward: str) -> None:
    other = next((f"(increase ({name}) {n})" for name, n in (("fuel", 2), ("joy", 3)) if name in metric), "")
    text = f"""(define (domain d) (:predicates (p)) (:functions (total-cost) (fuel) (joy) (length))
      (:action go :effect (and (p) (increase (total-cost) 5) (increase (reward) 7) {other})))
      (define (problem x) (:domain d) (:init) (:goal (p)) {metric})"""
    (action,) = task_of(text).actions
    (outcome,) = action.factors[0].outcomes
    assert (action.cost, outcome.reward) == (Fraction(cost), Fraction(reward))


def test_a_total_time_that_the_domain_declares_is_a_fluent_like_any_other() -> None:
    text = """(define (domain d) (:predicates (p)) (:functions (total-time))
      (:action go :effect (and (p) (increase (total-time) 4))))
      (define (problem x) (:domain d) (:init) (:goal (p)) (:metric minimize (total-time)))"""
    (action,) = task_of(text).actions
    assert action.cost == 4


@pytest.mark.parametrize(
    "metric",
    [
        "maximize (total-cost)",
        "minimize (reward)",
        "maximize (total-time)",
        "minimize (goal-probability)",
        "minimize (* -2 (total-cost))",
        "minimize (+ (total-cost) 1)",
        "maximize (- (reward) (total-cost))",
        "minimize (is-violated p)",
        "minimize (- (reward))",
        "minimize 3",
    ],
)
def test_a_metric_that_is_not_what_is_counted_is_refused_at_its_place(metric: str) -> None:
    with pytest.raises(BbtcError) as caught:
        _task("(and (p) (increase (total-cost) 1) (increase (reward) 1))", "", f"(:metric {metric})")
    assert [(each.code, each.span and each.span.text) for each in caught.value.diagnostics] == [
        ("BBT0212", f"(:metric {metric})")
    ]


def test_a_goal_probability_to_maximise_makes_no_reward_of_the_cost() -> None:
    text = _EFFECT.format(effect="(p)", init="", metric="(:metric maximize (goal-probability))")
    assert task_of(text).metric == "cost"


def test_costs_and_rewards_under_a_condition_are_charges_of_the_outcome() -> None:
    action = _only(
        _task(
            "(and (p) (not (q)) (increase (total-cost) 3)"
            " (when (q) (and (increase (total-cost) 1) (increase (total-cost) 1/2) (decrease (reward) 2))))",
            "(q)",
        )
    )
    (outcome,) = action.factors[0].outcomes
    (charge,) = outcome.charges
    assert (action.cost, outcome.cost, outcome.reward) == (3, 0, 0)
    assert (charge.cost, charge.reward) == (Fraction(3, 2), -2)


def test_what_only_a_cost_reads_stays_in_the_task() -> None:
    """No precondition and no goal reads `q`, and `spoil` does nothing else than to set it."""
    text = """(define (domain d) (:predicates (p) (q) (r)) (:functions (total-cost))
      (:action spoil :effect (and (q) (r)))
      (:action go :effect (and (p) (when (q) (increase (total-cost) 5)))))
      (define (problem x) (:domain d) (:init) (:goal (p)))"""
    task = task_of(text)
    assert [variable.name for variable in task.variables] == ["p()", "q()"]
    assert [action.name for action in task.actions] == ["go()", "spoil()"]


def test_a_missing_number_is_named() -> None:
    with pytest.raises(BbtcError, match=r"no value for `\(length b\)`"):
        _task("(and (p) (increase (total-cost) (length b)))")


# --- pruning ---------------------------------------------------------------------------------


def test_effects_on_what_nothing_reads_are_left_out() -> None:
    task = task_of(
        """(define (domain d) (:predicates (p) (noise) (more))
          (:action a :effect (and (p) (probabilistic 0.5 (noise) 0.3 (more))))
          (:action b :precondition (noise) :effect (more)))
        (define (problem x) (:domain d) (:init) (:goal (p)))"""
    )
    assert [variable.name for variable in task.variables] == ["p()"]
    assert [action.name for action in task.actions] == ["a()"]
    (factor,) = task.actions[0].factors
    assert [outcome.probability for outcome in factor.outcomes] == [1]


def test_static_facts_and_hopeless_actions_are_left_out() -> None:
    task = task_of(
        """(define (domain d) (:types t) (:predicates (road ?x ?y - t) (at ?x - t) (broken))
          (:action go :parameters (?x ?y - t) :precondition (and (at ?x) (road ?x ?y) (not (broken)))
            :effect (and (at ?y) (not (at ?x)))))
        (define (problem x) (:domain d) (:objects a b c d - t)
          (:init (at a) (road a b) (road b a) (road c d)) (:goal (at b)))"""
    )
    assert [action.name for action in task.actions] == ["go(a,b)", "go(b,a)"]
    assert [variable.name for variable in task.variables] == ["at(a)", "at(b)"]
    assert describe(task, task.actions[0].precondition) == "at(a)"


_IDLE = """(define (domain d) (:types t) (:constants a b - t)
  (:predicates (fixed ?x - t) (p ?x - t) (q ?x - t))
  (:action guarded :parameters (?x ?y - t)
    :effect (forall (?z - t) (when (and (fixed ?x) (fixed ?z)) (p ?z))))
  (:action undo :parameters (?x - t) :precondition (fixed ?x) :effect (and (not (q b)) (not (p ?x))))
  (:action cost :parameters (?x - t) :effect (increase (total-cost) 1))
  (:action reward :parameters (?x - t) :effect (when (fixed ?x) (increase (reward) 1))))
(define (problem x) (:domain d) (:init (fixed a)) (:goal (p a)))"""


def test_actions_that_can_do_nothing_are_left_out() -> None:
    task = instantiate(model_of(_IDLE), Report(), Limits())
    assert list(task.action_by_name) == ["guarded(a,a)", "guarded(a,b)", "reward(a)", "undo(a)"]
    relevant = ground(model_of(_IDLE), Report(), Limits())
    assert list(relevant.action_by_name) == ["guarded(a,a)", "guarded(a,b)", "undo(a)"]


def test_grounding_twice_gives_the_same() -> None:
    text = _EFFECT.format(effect="(and (p) (q) (r) (s a) (s b) (s c))", init="", metric="")
    first, second = (ground(model_of(text), Report(), Limits()) for _ in range(2))
    assert first == second


def test_the_guards_of_an_action_kept_early_matter_when_their_effect_turns_out_to() -> None:
    task = task_of(
        """(define (domain d) (:predicates (p) (q) (r) (one) (two))
          (:action first :effect (and (when (one) (p)) (when (two) (q))))
          (:action last :precondition (q) :effect (r))
          (:action toggle :effect (oneof (and (one) (not (two))) (and (two) (not (one))))))
        (define (problem x) (:domain d) (:init) (:goal (and (p) (r))))"""
    )
    assert [variable.name for variable in task.variables] == ["one()", "p()", "q()", "r()", "two()"]


@pytest.mark.parametrize(
    ("when", "charged"), [("(when (x) {})", "x()"), ("(forall (?s) (when (at ?s) {}))", "at(a)")]
)
def test_a_cost_under_a_condition_that_nothing_else_reads_is_counted(when: str, charged: str) -> None:
    task = task_of(
        f"""(define (domain d) (:predicates (x) (at ?s) (g)) (:functions (total-cost)) (:constants a b)
      (:action flip :effect (and (not (x)) (not (at a)) (increase (total-cost) 1)))
      (:action go :effect (and (g) {when.format("(increase (total-cost) 5)")})))
    (define (problem p) (:domain d) (:init (x) (at a)) (:goal (g)) (:metric minimize (total-cost)))"""
    )
    (charge,) = charges_of(task.action_by_name["go()"].factors)
    assert (describe(task, charge.when), charge.cost) == (charged, 5)
    assert "flip()" in task.action_by_name, "it spares the cost"


def test_quantifiers_side_by_side_may_use_one_name() -> None:
    task = task_of(
        """(define (domain d) (:predicates (p ?x) (q ?x) (done)) (:constants a b)
          (:action set :effect (and (when (p b) (q a)) (p a) (q b)))
          (:action end :precondition (and (exists (?x) (p ?x)) (exists (?x) (q ?x))) :effect (done)))
        (define (problem x) (:domain d) (:init) (:goal (done)))"""
    )
    # p(b) and q(a) are never true here, but others may make them so.
    precondition = task.action_by_name["end()"].precondition
    assert describe(task, precondition) == "((p(a) or p(b)) and (q(a) or q(b)))"
    (outcome,) = task.action_by_name["set()"].factors[0].outcomes
    assert [effect.when for effect in outcome.effects] == [None]


def test_a_quantifier_two_levels_down_may_use_a_name_from_outside() -> None:
    model = model_of(
        """(define (domain d) (:types t) (:constants a b c - t) (:predicates (s ?x - t) (p))
        (:action act :parameters (?y - t) :effect
          (and (forall (?y - t) (forall (?y - t) (p))) (forall (?z - t) (s ?y)))))
        (define (problem x) (:domain d) (:init) (:goal (s a)))"""
    )
    task = instantiate(model, Report(), Limits())
    for action in task.actions:
        (outcome,) = action.factors[0].outcomes
        names = [task.variables[index].name for effect in outcome.effects for index, _ in effect.sets]
        assert names == ["p()", f"s({action.args[0]})"]


def test_an_object_outside_the_declared_type_of_a_predicate_stays_outside_that_of_an_action() -> None:
    task = task_of(
        """(define (domain d) (:types small) (:predicates (p ?x - small) (q ?x - object))
          (:constants a - small b)
          (:action any :parameters (?x) :effect (p ?x))
          (:action few :parameters (?x - small) :precondition (p ?x) :effect (q ?x)))
        (define (problem x) (:domain d) (:init) (:goal (and (q a) (forall (?x) (p ?x)))))"""
    )
    assert [action.name for action in task.actions] == ["any(a)", "any(b)", "few(a)"]


_LONG = "0." + "7" * 190


def _nested(levels: int) -> str:
    return f"(probabilistic {_LONG} " * levels + "(p)" + ")" * levels


@pytest.mark.parametrize(
    ("effect", "metric"),
    [
        (_nested(60), ""),
        (f"(probabilistic {' '.join(f'1/{10**190 + n} (p)' for n in range(60))})", ""),
        (f"(and (p) (increase (total-cost) {f'(* {10**190} ' * 80} 2 {')' * 80}))", "cost"),
        ("(and (p) (increase (total-cost) 1e300) " + "(increase (total-cost) 1e-300)" * 2 + ")", ""),
        (f"(and (p) {' '.join(f'(increase (total-cost) 1/{10**190 + n})' for n in range(60))})", "cost"),
    ],
)
def test_numbers_whose_exact_value_grows_without_bound_are_refused(effect: str, metric: str) -> None:
    if "1e300" in effect:
        assert _only(_task(effect)).factors  # long, but not too long
        return
    with pytest.raises(BbtcError) as caught:
        _task(effect, metric="(:metric minimize (total-cost))" if metric else "")
    assert {diagnostic.code for diagnostic in caught.value.diagnostics} == {"BBT0113"}
    assert all(diagnostic.span is not None for diagnostic in caught.value.diagnostics)


def test_what_an_action_sets_in_vain_is_left_out_for_these_arguments_only() -> None:
    """Only the hall is ever dirty: to clean the attic sets one fact, to clean the hall sets two."""
    task = task_of("""(define (domain d) (:predicates (seen ?r) (dirty ?r))
      (:action clean :parameters (?r) :effect (and (not (dirty ?r)) (seen ?r))))
    (define (problem p) (:domain d) (:objects attic hall) (:init (dirty hall))
      (:goal (and (seen attic) (seen hall) (not (dirty hall)))))""")
    names = [variable.name for variable in task.variables]
    sets = {
        action.name: {(names[v], value) for effect in effects_of(action.factors) for v, value in effect.sets}
        for action in task.actions
    }
    assert sets == {
        "clean(attic)": {("seen(attic)", Truth.TRUE)},
        "clean(hall)": {("dirty(hall)", Truth.FALSE), ("seen(hall)", Truth.TRUE)},
    }


@pytest.mark.parametrize(
    ("metric", "kept"), [("(:metric maximize (reward))", ["shut()", "wave()"]), ("", ["shut()"])]
)
def test_what_earns_a_reward_matters_where_rewards_count(metric: str, kept: list[str]) -> None:
    """Nobody asks whether somebody waved, or sang for a fee."""
    task = task_of(f"""(define (domain d) (:requirements :rewards :action-costs)
      (:predicates (closed) (waved) (sung)) (:functions (total-cost))
      (:action shut :effect (closed))
      (:action wave :effect (and (waved) (increase (reward) 2)))
      (:action sing :effect (and (sung) (increase (total-cost) 2))))
    (define (problem p) (:domain d) (:init) (:goal (closed)) {metric})""")
    assert [action.name for action in task.actions] == kept


def test_charges_under_one_condition_that_come_to_nothing_are_none() -> None:
    task = task_of("""(define (domain d) (:requirements :rewards) (:predicates (lit) (done))
      (:action act :effect (and (done)
        (when (lit) (increase (reward) 2)) (when (lit) (decrease (reward) 2))))
      (:action press :effect (lit)))
    (define (problem p) (:domain d) (:init) (:goal (and (done) (lit))) (:metric maximize (reward)))""")
    act = task.action_by_name["act()"]
    assert list(charges_of(act.factors)) == []
