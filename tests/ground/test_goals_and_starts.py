"""Goals that cannot be reached or hold already, initial states, refusals and limits."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.diagnostics import BbtcError, LimitReached, Report
from bbtc.ground.condition import evaluate
from bbtc.ground.describe import describe
from bbtc.ground.instantiate import ground, instantiate
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.maxprob import max_prob
from bbtc.planner.mdp.ssp import least_cost
from tests.ground.examples import model_of, task_of

_DOMAIN = """(define (domain d) (:types t) (:predicates (p ?x - t) (q) (r) (on ?x ?y - t) (above ?x ?y - t))
  (:constants a b c - t)
  (:action set :parameters (?x - t) :precondition (q) :effect (p ?x))
  (:action put :parameters (?x ?y - t) :precondition (not (above ?y ?x)) :effect (on ?x ?y))
  (:action lift :parameters (?x ?y - t) :effect (not (on ?x ?y)))
  (:derived (above ?x ?y) (or (on ?x ?y) (exists (?z - t) (and (on ?x ?z) (above ?z ?y))))))"""


def _text(init: str, goal: str, more: str = "") -> str:
    return f"{_DOMAIN} (define (problem x) (:domain d) (:init {init}) (:goal {goal}) {more})"


def _task(init: str, goal: str, more: str = "") -> Task:
    return task_of(_text(init, goal, more))


def _errors(init: str, goal: str, more: str = "") -> list[tuple[str, str, str | None]]:
    with pytest.raises(BbtcError) as caught:
        _task(init, goal, more)
    return [(d.code, d.span.text if d.span else "", d.hint) for d in caught.value.diagnostics]


# --- goals -----------------------------------------------------------------------------------


def test_every_unreachable_part_of_the_goal_is_pointed_at() -> None:
    assert _errors("(q)", "(and (p a) (r) (not (q)))") == [
        ("BBT0412", "(r)", "no action makes `r()` true, nor does `:init` give it"),
        ("BBT0412", "(not (q))", "no action makes `q()` false"),
    ]


def test_an_unreachable_goal_names_the_fact_that_is_missing_at_its_root() -> None:
    needs = "`set` needs `q()`, and no action makes it so, nor does `:init` give it"
    assert _errors("", "(p a)") == [("BBT0412", "(p a)", needs)]


def test_a_goal_that_holds_already_is_a_warning() -> None:
    report = Report()
    task = ground(model_of(_text("(q)", "(q)")), report, Limits())
    assert [d.code for d in report] == ["BBT0413"]
    assert task.actions == ()


def test_the_goal_may_be_the_preconditions_of_an_action() -> None:
    task = _task("(unknown (q)) (on a b)", "(and (action put a b) (p b))".replace("(p b)", "(not (on a b))"))
    assert describe(task, task.goal) == describe(
        task, _task("", "(and (not (above b a)) (not (on a b)))").goal
    )


# --- derived predicates ----------------------------------------------------------------------


def test_a_recursive_derived_predicate_is_unfolded() -> None:
    task = _task("", "(above a c)")
    assert describe(task, task.goal) == "(on(a,c) or (on(a,b) and on(b,c)))"


def test_what_is_derived_for_certain_of_one_object_is_never_false_of_it() -> None:
    """`k` holds of `a` by a fact that never changes, of `b` by one that does: only `b` can be not `k`."""
    task = task_of(
        """(define (domain d) (:types t) (:predicates (fixed ?x - t) (s ?x - t) (k ?x - t) (g ?x - t) (done))
          (:constants a b - t)
          (:derived (k ?x) (or (fixed ?x) (s ?x)))
          (:action put :parameters (?x - t) :effect (s ?x))
          (:action go :parameters (?x - t) :precondition (not (k ?x)) :effect (g ?x))
          (:action end :precondition (or (g a) (g b) (s b)) :effect (done)))
        (define (problem x) (:domain d) (:init (fixed a)) (:goal (done)))"""
    )
    assert "go(b)" in task.action_by_name
    assert "go(a)" not in task.action_by_name


@given(st.lists(st.sampled_from(list(Truth)), min_size=9, max_size=9))
def test_a_derived_atom_has_the_value_of_the_least_fixpoint(values: list[Truth]) -> None:
    task = _task(" ".join(f"(unknown (on {x} {y}))" for x in "abc" for y in "abc"), "(above a c)")
    pairs = [(x, y) for x in "abc" for y in "abc"]
    on = dict(zip(pairs, values, strict=True))
    above = dict.fromkeys(pairs, Truth.FALSE)
    for _ in range(9):
        above = {(x, y): max(on[x, y], max(min(on[x, z], above[z, y]) for z in "abc")) for x, y in pairs}
    state = [on[v.args[0], v.args[1]] for v in task.variables]
    assert evaluate(task.goal, state) is above["a", "c"]


# --- initial states --------------------------------------------------------------------------


def test_a_probabilistic_start_is_spelled_out() -> None:
    task = _task(
        "(q) (probabilistic 0.25 (p a) 0.25 (on a b)) (probabilistic 0.5 (p a))", "(and (p a) (on a b))"
    )
    states = {
        tuple(
            v.name for v, value in zip(task.variables, state.values, strict=True) if value is Truth.TRUE
        ): state
        for state in task.initial
    }
    assert {names: state.probability for names, state in states.items()} == {
        (): Fraction(1, 4),
        ("p(a)",): Fraction(1, 2),
        ("on(a,b)",): Fraction(1, 8),
        ("on(a,b)", "p(a)"): Fraction(1, 8),
    }


def test_a_draw_of_probability_0_is_no_initial_state() -> None:
    """Nor does it make anything possible: the goal is refused as if it were not written."""
    init = "(probabilistic 1 (q) 0 (on a b)) (probabilistic 0 (p b) 1/4 (p a))"
    task = instantiate(model_of(_text(init, "(p c)")), Report(), Limits())
    states = [
        (
            state.probability,
            [v.name for v, value in zip(task.variables, state.values, strict=True) if value is Truth.TRUE],
        )
        for state in task.initial
    ]
    assert sorted(states) == [(Fraction(1, 4), ["p(a)"]), (Fraction(3, 4), [])]
    assert [code for code, _, _ in _errors("(q) (probabilistic 1 (p a) 0 (r))", "(r)")] == ["BBT0412"]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("(probabilistic 0.5 (q))", "(probabilistic 0.5 (not (q)))"),
        ("(probabilistic 0.5 (q))", "(probabilistic 1 (unknown (q)))"),
        ("(forall (?x - t) (probabilistic 0.5 (p ?x)))", "(probabilistic 0.25 (not (p a)) 0.75 (p b))"),
    ],
)
def test_the_order_of_draws_at_the_start_does_not_matter(first: str, second: str) -> None:
    """Where two of them set a fact, the greater value stays, as in effects."""

    def start(init: str) -> dict[tuple[Truth, ...], Fraction]:
        task = instantiate(model_of(_text(init, "(p c)")), Report(), Limits())
        return {state.values: state.probability for state in task.initial}

    assert start(f"{first} {second}") == start(f"{second} {first}")


def test_of_two_values_in_one_draw_the_greater_stays() -> None:
    states = _task("(probabilistic 0.3 (and (q) (not (q))))", "(q)").initial
    assert {state.values: state.probability for state in states} == {
        (Truth.TRUE,): Fraction(3, 10),
        (Truth.FALSE,): Fraction(7, 10),
    }


_TWO_CHANCES = """(define (domain d) (:types t) (:predicates (g) (w) (h) (k) (s ?x - t)) (:constants a b - t)
  (:derived (k) (or (h) (exists (?x - t) (s ?x))))
  (:action try :effect (probabilistic 1/2 (w)))
  (:action blur :effect (unknown (s b)))
  (:action go :precondition {condition} :effect (g)))
  (define (problem x) (:domain d) (:init {init}) (:goal (g)))"""


@pytest.mark.parametrize(
    ("init", "condition", "best", "cost"),
    [
        # Nothing changes h, but it is true in some initial states only.
        ("(probabilistic 1/3 (h))", "(h)", "1/3", "1/3"),
        ("(probabilistic 1/3 (h))", "(not (h))", "2/3", "2/3"),
        ("(probabilistic 1/3 (h))", "(forall (?x - t) (not (h)))", "2/3", "2/3"),
        ("(probabilistic 1/3 (unknown (h)))", "(not (h))", "2/3", "2/3"),
        ("(h) (probabilistic 1/3 (not (h)))", "(not (h))", "1/3", "1/3"),
        ("(probabilistic 1/3 (s a))", "(forall (?x - t) (not (s ?x)))", "2/3", "2/3"),
        # Nor does anything change what derives from it.
        ("(probabilistic 1/3 (h))", "(k)", "1/3", "1/3"),
        ("(probabilistic 1/3 (h))", "(not (k))", "2/3", "2/3"),
        # h is never known, s(a) never true: as constants they are still what they are.
        ("(unknown (h))", "(unknown (h))", "1", "1"),
        ("(unknown (h))", "(or (known (h)) (w))", "1", "3"),
        ("(unknown (h))", "(or (not (h)) (w))", "1", "3"),
        ("(unknown (h))", "(or (h) (w))", "1", "3"),
        ("(unknown (h))", "(or (not (k)) (w))", "1", "3"),
        ("(unknown (s a))", "(or (exists (?x - t) (known (s ?x))) (w))", "1", "1"),
        ("(unknown (s a)) (s b)", "(or (exists (?x - t) (not (s ?x))) (w))", "1", "3"),
    ],
)
def test_what_no_action_changes_has_the_value_it_starts_with(
    init: str, condition: str, best: str, cost: str
) -> None:
    task = task_of(_TWO_CHANCES.format(init=init, condition=condition))
    found = max_prob(explore_space(task, Limits()), Limits())
    cheapest = least_cost(found, Limits())
    assert found.initial.exact == Fraction(best)
    assert cheapest is not None
    assert cheapest.initial == Fraction(cost)


def test_an_action_whose_precondition_rests_on_what_is_never_false_is_left_out() -> None:
    task = task_of(
        """(define (domain d) (:predicates (h) (k) (g)) (:derived (k) (h))
          (:action one :precondition (not (k)) :effect (g)) (:action two :effect (g)))
        (define (problem x) (:domain d) (:init (unknown (h)) (probabilistic 0.3 (h))) (:goal (g)))"""
    )
    assert ([a.name for a in task.actions], [v.name for v in task.variables]) == (["two()"], ["g()"])


# --- what others change ----------------------------------------------------------------------

_ERRAND = """(define (domain d) (:types spot)
  (:predicates (near ?a ?b - spot) {charged} (at ?s - spot) (blocked ?s - spot) (safe ?s - spot) (done))
  (:constants hall lab - spot)
  (:derived (safe ?s - spot) (and {reads} (not (blocked ?s))))
  (:action charge :precondition (not (charged)) :effect {charge})
  (:action clear :parameters (?s - spot) :precondition (blocked ?s) :effect (not (blocked ?s)))
  (:action go :parameters (?a ?b - spot) :precondition (and (at ?a) (near ?a ?b) (safe ?b))
    :effect (and (not (at ?a)) (at ?b)))
  (:action work :precondition (at lab) :effect (done)))
(define (problem x) (:domain d) (:init (charged) (near hall lab) (at hall))
  (:goal (and (done) (charged) (exists (?s - spot) (near ?s lab)))))"""


@pytest.mark.parametrize(
    ("charged", "charge"), [("(charged)", "(charged)"), ("(external (charged))", "(and)")]
)
def test_what_effects_mention_or_is_external_stays_and_a_map_does_not(charged: str, charge: str) -> None:
    """The model never changes `charged` and `blocked`; derived conditions read them, too."""
    task = task_of(_ERRAND.format(charged=charged, charge=charge, reads="(charged)"))
    assert [action.name for action in task.actions] == ["go(hall,lab)", "work()"]
    assert describe(task, task.goal) == "(done() and charged())"
    go = task.action_by_name["go(hall,lab)"].precondition
    assert describe(task, go) == "(at(hall) and charged() and not blocked(lab))"
    names = [variable.name for variable in task.variables]
    assert names == ["at(hall)", "at(lab)", "blocked(lab)", "charged()", "done()"]
    assert [value.word for value in task.initial[0].values] == ["true", "false", "false", "true", "false"]


def test_a_fact_that_nothing_mentions_is_fixed() -> None:
    task = task_of(_ERRAND.format(charged="(charged)", charge="(and)", reads="(charged)"))
    assert describe(task, task.goal) == "done()"
    go = task.action_by_name["go(hall,lab)"].precondition
    assert describe(task, go) == "(at(hall) and not blocked(lab))"


def test_a_derived_predicate_that_never_holds_here_is_read_where_others_can_make_it_hold() -> None:
    task = task_of(
        """(define (domain d) (:predicates (external (lift)) (external (stairs)) (way) (g) (p))
          (:derived (way) (and (lift) (stairs)))
          (:action go :precondition (or (way) (p)) :effect (g)) (:action help :effect (p)))
        (define (problem x) (:domain d) (:init (stairs)) (:goal (and (g) (not (way)))))"""
    )
    assert describe(task, task.action_by_name["go()"].precondition) == "((lift() and stairs()) or p())"
    assert describe(task, task.goal) == "(g() and (not lift() or not stairs()))"


def test_an_unreachable_goal_tells_that_only_others_could_help() -> None:
    text = """(define (domain d) (:predicates (external (open)) (in))
        (:action enter :precondition (open) :effect (in)))
      (define (problem x) (:domain d) (:init) (:goal (open)))"""
    with pytest.raises(BbtcError) as caught:
        task_of(text)
    (told,) = caught.value.diagnostics
    assert (told.code, told.hint) == ("BBT0412", "only others can make `open()` true: no plan counts on that")


@pytest.mark.parametrize(
    ("init", "code", "place"),
    [
        ("(or (known (p a)) (p b))", "BBT0405", "(or (known (p a)) (p b))"),
        ("(oneof (p a) (p b)) (not (p a)) (not (p b))", "BBT0414", "(oneof (p a) (p b))"),
        (
            " ".join(
                f"(probabilistic 0.5 (on {x} {y}) 0.25 (unknown (on {x} {y})))" for x in "abc" for y in "abc"
            ),
            "BBT0403",
            "(probabilistic 0.5 (on b c) 0.25 (unknown (on b c)))",
        ),
    ],
)
def test_starts_that_cannot_be_grounded_yet_are_refused_by_name(init: str, code: str, place: str) -> None:
    assert [each[:2] for each in _errors(f"(q) {init}", "(p a)")] == [(code, place)]


def test_noise_of_several_facts_is_refused_by_name() -> None:
    text = """(define (domain d) (:predicates (p) (q))
          (:action look :observe (probabilistic 0.9 (and (p) (q)))) (:action a :effect (p)))
        (define (problem x) (:domain d) (:init) (:goal (p)))"""
    with pytest.raises(BbtcError) as caught:
        task_of(text)
    assert [d.code for d in caught.value.diagnostics] == ["BBT0406"]


def test_a_metric_alone_is_no_goal() -> None:
    text = """(define (domain d) (:predicates (p)) (:action a :effect (and (p) (increase (reward) 1))))
        (define (problem x) (:domain d) (:init) (:metric maximize (reward)))"""
    with pytest.raises(BbtcError) as caught:
        task_of(text)
    assert [d.code for d in caught.value.diagnostics] == ["BBT0411"]


# --- limits ----------------------------------------------------------------------------------


def _wide(parameters: int, objects: int) -> str:
    names = " ".join(f"?p{i}" for i in range(parameters))
    return (
        f"(define (domain d) (:predicates (p) (q ?x ?y ?z)) (:action wide :parameters ({names}) :effect (p))"
        " (:action all :precondition (p) :effect (forall (?x ?y ?z) (q ?x ?y ?z))))"
        f"(define (problem x) (:domain d) (:objects {' '.join(f'o{i}' for i in range(objects))})"
        " (:init) (:goal {goal}))"
    )


def test_twelve_parameters_over_a_thousand_objects_meet_the_limit() -> None:
    with pytest.raises(LimitReached, match="limit of 50000 ground actions"):
        task_of(_wide(12, 1000).replace("{goal}", "(p)"), Limits(actions=50_000))


def test_a_quantified_effect_over_a_thousand_objects_meets_the_limit() -> None:
    with pytest.raises(LimitReached, match="derived facts"):
        task_of(_wide(1, 1000).replace("{goal}", "(p)"), Limits(facts=100_000))


def test_a_quantified_goal_over_a_thousand_objects_meets_the_limit() -> None:
    goal = "(and (p) (not (exists (?x ?y ?z) (and (= ?x ?y) (not (= ?x ?y))))))"
    with pytest.raises(LimitReached, match="quantifier bindings"):
        task_of(
            _wide(1, 1000).replace("(forall (?x ?y ?z) (q ?x ?y ?z))", "(p)").replace("{goal}", goal),
            Limits(bindings=10**6),
        )


def test_memory_is_bounded() -> None:
    with pytest.raises(LimitReached, match="of memory ended grounding"):
        task_of(_wide(12, 1000).replace("{goal}", "(p)"), Limits(memory=160_000_000))


def test_time_is_bounded() -> None:
    with pytest.raises(LimitReached, match="time limit"):
        task_of(_wide(12, 1000).replace("{goal}", "(p)"), Limits(seconds=0.2))


# --- names -----------------------------------------------------------------------------------


def test_actions_and_variables_are_sorted_by_name() -> None:
    names = ["a", "a-b", "a_b", "ab", "a0", "a+", "a*b", "b"]
    text = f"""(define (domain d) (:predicates (p ?x ?y)) (:constants {" ".join(names)})
        (:action one :parameters (?x ?y) :effect (p ?x ?y))
        (:action one-more :parameters (?x) :effect (p ?x ?x)))
        (define (problem x) (:domain d) (:init) (:goal (forall (?x ?y) (p ?x ?y))))"""
    task = task_of(text)
    actions, variables = [a.name for a in task.actions], [v.name for v in task.variables]
    assert (len(actions), len(variables)) == (72, 64)
    assert (actions, variables) == (sorted(actions), sorted(variables))


def test_large_tasks_are_grounded_like_small_ones() -> None:
    """Past some size another process runs the Datalog program: 40 places on a ring."""
    places = [f"c{i}" for i in range(40)]
    roads = " ".join(f"(road {x} {y})" for x, y in zip(places, places[1:] + places[:1], strict=True))
    things = [f"t{i}" for i in range(20)]
    facts = " ".join(f"(at {thing} c{i})" for i, thing in enumerate(things))
    text = f"""(define (domain d) (:types place thing)
        (:predicates (road ?x ?y - place) (at ?t - thing ?x - place))
        (:action move :parameters (?t - thing ?x ?y - place) :precondition (and (at ?t ?x) (road ?x ?y))
          :effect (and (not (at ?t ?x)) (at ?t ?y))))
        (define (problem x) (:domain d)
          (:objects {" ".join(places)} - place {" ".join(things)} - thing)
          (:init {roads} {facts}) (:goal (at t0 c7)))"""
    task = task_of(text)
    assert (len(task.actions), len(task.variables)) == (40, 40)


def test_a_variable_has_the_place_where_it_is_given_or_else_where_it_is_declared() -> None:
    task = task_of("""(define (domain d) (:predicates (dirty ?r) (seen ?r))
      (:action clean :parameters (?r) :effect (and (not (dirty ?r)) (seen ?r))))
    (define (problem p) (:domain d) (:objects hall) (:init (dirty hall))
      (:goal (and (seen hall) (not (dirty hall)))))""")
    places = {variable.name: variable.span for variable in task.variables}
    words = {name: span.text for name, span in places.items() if span is not None}
    assert words == {"dirty(hall)": "(dirty hall)", "seen(hall)": "seen"}
