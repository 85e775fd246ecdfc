"""Ground templates: their bodies stay faithful, whatever can apply."""

from __future__ import annotations

from bbtc.ground import task as gt
from bbtc.ground.condition import FALSE, TRUE
from bbtc.ground.describe import describe
from bbtc.ground.task import Body, Task
from tests.ground.examples import task_of

_DOMAIN = """(define (domain home) (:types item place)
  (:constants hall attic - place soda - item)
  (:predicates (seen ?o - item) (at ?p - place) (stairs ?p - place))
  (:action go :parameters (?p - place) :precondition (not (stairs ?p))
    :effect (and (at ?p) (forall (?q - place) (when (not (= ?q ?p)) (not (at ?q))))))
  (:action look :parameters (?o - item ?p - place) :precondition (and (at ?p) (unknown (seen ?o)))
    :effect (probabilistic 0.5 (seen ?o) 0.5 (not (seen ?o))))
  (:template find :parameters (?o - item) :precondition (not (seen ?o))
    :effect (probabilistic 0.8 (seen ?o) 0.2 (not (seen ?o)))
    :body (fallback (foreach (?p - place) (find-in ?o ?p)) (condition (seen ?o))))
  (:template find-in :parameters (?o - item ?p - place)
    :body (sequence (action go ?p) (look ?o ?p) (condition (known (seen ?o)))))
  (:template idle :parameters (?p - place) :effect (stairs ?p) :body (condition (at ?p))))
"""
_PROBLEM = "(define (problem x) (:domain home) (:init (unknown (seen soda)) {init}) (:goal {goal}))"


def _home(init: str = "", goal: str = "(seen soda)") -> Task:
    return task_of(_DOMAIN + _PROBLEM.format(init=init, goal=goal))


def _words(task: Task, body: Body) -> str:
    match body:
        case gt.BodyControl(kind, children):
            return f"{kind}({', '.join(_words(task, child) for child in children)})"
        case gt.BodyCondition(condition):
            return describe(task, condition)
        case gt.BodyAction(name) | gt.BodyTemplate(name):
            return name


def test_foreach_becomes_children_in_order_of_declaration() -> None:
    task = _home()
    assert _words(task, task.template_by_name["find(soda)"].body) == (
        "fallback(find-in(soda,hall), find-in(soda,attic), seen(soda))"
    )
    assert _words(task, task.template_by_name["find-in(soda,attic)"].body) == (
        "sequence(go(attic), look(soda,attic), known seen(soda))"
    )


def test_a_called_action_that_can_never_apply_fails() -> None:
    task = _home("(stairs attic)")
    assert "go(attic)" not in task.action_by_name
    assert _words(task, task.template_by_name["find-in(soda,attic)"].body) == (
        "sequence(false, false, known seen(soda))"
    )


def test_guides_are_grounded_like_effects() -> None:
    task = _home()
    find = task.template_by_name["find(soda)"]
    assert describe(task, find.precondition) == "not seen(soda)"
    assert [str(outcome.probability) for outcome in find.factors[0].outcomes] == ["4/5", "1/5"]
    assert task.template_by_name["find-in(soda,hall)"].factors == ()
    assert task.template_by_name["find-in(soda,hall)"].precondition == TRUE


def test_templates_that_cannot_matter_are_left_out_with_their_actions() -> None:
    task = _home()
    assert [template.name for template in task.templates] == [
        "find(soda)",
        "find-in(soda,attic)",
        "find-in(soda,hall)",
    ]
    assert [action.name for action in task.actions] == [
        "go(attic)",
        "go(hall)",
        "look(soda,attic)",
        "look(soda,hall)",
    ]


def test_an_action_is_kept_for_the_template_that_calls_it() -> None:
    """Nothing reads where the robot is, yet the template's body goes there."""
    text = _DOMAIN.replace("(and (at ?p) (unknown (seen ?o)))", "(unknown (seen ?o))").replace(
        "(condition (at ?p))", "(condition (seen soda))"
    )
    task = task_of(text + _PROBLEM.format(init="", goal="(seen soda)"))
    assert [variable.name for variable in task.variables] == ["seen(soda)"]
    assert task.action_by_name["go(hall)"].factors == (gt.NO_CHANGE,)


def test_an_action_that_does_nothing_is_kept_for_the_template_that_calls_it() -> None:
    task = task_of(
        """(define (domain d) (:predicates (p) (q)) (:action wait :parameters () :effect (and))
        (:action act :parameters () :effect (p))
        (:template go :parameters () :effect (p) :body (sequence (action wait) (condition (p)))))
        (define (problem x) (:domain d) (:init) (:goal (p)))"""
    )
    assert list(task.action_by_name) == ["act()", "wait()"]
    assert _words(task, task.template_by_name["go()"].body) == "sequence(wait(), p())"


def test_a_called_template_is_kept_though_its_own_guide_can_never_apply() -> None:
    text = _DOMAIN.replace(
        "(?o - item ?p - place)\n    :body",
        "(?o - item ?p - place) :precondition (stairs ?p) :effect (seen ?o)\n    :body",
    )
    task = task_of(text + _PROBLEM.format(init="(stairs hall)", goal="(seen soda)"))
    assert task.template_by_name["find-in(soda,attic)"].precondition == FALSE


def test_what_guards_an_effect_on_the_goal_is_kept_beside_templates() -> None:
    task = task_of(
        """(define (domain d) (:predicates (p) (q) (r))
        (:action make :parameters () :effect (when (q) (p)))
        (:action turn :parameters () :effect (and (q) (r)))
        (:template go :parameters () :effect (p) :body (action make)))
        (define (problem x) (:domain d) (:init) (:goal (p)))"""
    )
    assert [variable.name for variable in task.variables] == ["p()", "q()"]
    assert list(task.action_by_name) == ["make()", "turn()"]
