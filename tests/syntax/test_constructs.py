"""Every construct of the language, and the tree it stands for."""

from __future__ import annotations

import pytest

from bbtc.diagnostics import Report
from bbtc.kleene import Truth
from bbtc.source import SourceFile, Span
from bbtc.syntax import ast
from bbtc.syntax.parser import parse

S = Span(SourceFile("none", ""), 0, 0)


def name(text: str) -> ast.Name:
    return ast.Name(text, S)


def term(text: str) -> ast.Term:
    return ast.Variable(text, S) if text.startswith("?") else name(text)


def atom(text: str) -> ast.Atom:
    predicate, *args = text.split()
    return ast.Atom(name(predicate), tuple(map(term, args)), S)


def group(names: str, *types: str) -> ast.TypedGroup:
    return ast.TypedGroup(tuple(map(term, names.split())), tuple(map(name, types)), S)


def number(text: str) -> ast.Number:
    return ast.Number(text, S)


def fluent(text: str) -> ast.FluentRef:
    found = atom(text)
    return ast.FluentRef(found.predicate, found.args, S)


def true(text: str) -> ast.Assign:
    return ast.Assign(atom(text), Truth.TRUE, S)


def false(text: str) -> ast.Assign:
    return ast.Assign(atom(text), Truth.FALSE, S)


def unknown(text: str) -> ast.Assign:
    return ast.Assign(atom(text), Truth.UNKNOWN, S)


def definitions(text: str) -> tuple[ast.Definition, ...]:
    report = Report()
    document = parse(SourceFile("test.pddl", text), report)
    assert not report.errors, "\n".join(d.render() for d in report)
    return document.definitions


def section(text: str, kind: str = "domain") -> ast.Section:
    [definition] = definitions(f"(define ({kind} d) {text})")
    [found] = definition.sections
    return found


def action(text: str) -> ast.Action:
    found = section(f"(:action a {text})")
    assert isinstance(found, ast.Action)
    return found


ENERGY = ast.FluentRef(name("energy"), (term("?r"),), S)
CONDITIONS: dict[str, ast.Formula] = {
    "()": ast.Empty(S),
    "( )": ast.Empty(S),
    "(and)": ast.And((), S),
    "p": atom("p"),
    "(p)": atom("p"),
    "(p a ?x)": atom("p a ?x"),
    "(p\n  a\t?x )": atom("p a ?x"),
    "(p?x?y)": atom("p ?x ?y"),
    "(3d 1 0-1)": atom("3d 1 0-1"),
    "(NOT (P A))": ast.Not(atom("P A"), S),
    "(not p)": ast.Not(atom("p"), S),
    "(and (p) (not (q a)))": ast.And((atom("p"), ast.Not(atom("q a"), S)), S),
    "(and (p) (or (q) r) s)": ast.And((atom("p"), ast.Or((atom("q"), atom("r")), S), atom("s")), S),
    "(and (= ?x a) (not (= ?x ?y)))": ast.And(
        (ast.Equality(term("?x"), name("a"), S), ast.Not(ast.Equality(term("?x"), term("?y"), S), S)), S
    ),
    "(or)": ast.Or((), S),
    "(imply (p) (and q))": ast.Imply(atom("p"), ast.And((atom("q"),), S), S),
    "(= ?x a)": ast.Equality(term("?x"), name("a"), S),
    "(= ?x 1)": ast.Equality(term("?x"), name("1"), S),
    "(not (= ?x ?y))": ast.Not(ast.Equality(term("?x"), term("?y"), S), S),
    "(exists (?x ?y - t) (p ?x ?y))": ast.Quantified("exists", (group("?x ?y", "t"),), atom("p ?x ?y"), S),
    "(forall (?x) (p ?x))": ast.Quantified("forall", (group("?x"),), atom("p ?x"), S),
    "(forall () (p))": ast.Quantified("forall", (), atom("p"), S),
    "(unknown (p a))": ast.Test("unknown", atom("p a"), S),
    "(known p)": atom("known p"),  # the test of `(p)`, unless a predicate `known` is declared
    "(not (known (p ?x)))": ast.Not(ast.Test("known", atom("p ?x"), S), S),
    "(known ?x)": atom("known ?x"),
    "(unknown a b)": atom("unknown a b"),
    "(condition a)": atom("condition a"),
    "(>= (energy ?r) 8)": ast.Comparison(">=", ENERGY, ast.Number("8", S), S),
    "(= (energy ?r) 8)": ast.Comparison("=", ENERGY, ast.Number("8", S), S),
    "(< 3 (* 2 (energy ?r)))": ast.Comparison(
        "<", ast.Number("3", S), ast.Arithmetic("*", (ast.Number("2", S), ENERGY), S), S
    ),
    "(> (energy ?r) ?r)": ast.Unsupported("comparison of objects", "(> (energy ?r) ?r)", S),
    "(= (place ?r) hall)": ast.Unsupported("object fluent", "(= (place ?r) hall)", S),
    "(clear (place ?r))": ast.Unsupported("object fluent", "(clear (place ?r))", S),
    "(preference p1\n (and (q)\n r) )": ast.Unsupported("preference", "(preference p1 (and (q) r))", S),
    "(sometime (p))": ast.Unsupported("trajectory constraint", "(sometime (p))", S),
}

EFFECTS: dict[str, ast.Effect] = {
    "()": ast.Empty(S),
    "(and)": ast.EffectAnd((), S),
    "p": true("p"),
    "(p a)": true("p a"),
    "(not (p a))": false("p a"),
    "(not p)": false("p"),
    "(unknown (p a))": unknown("p a"),
    "(and (p) (not (q)) (unknown (r)))": ast.EffectAnd((true("p"), false("q"), unknown("r")), S),
    "(and (p) (unknown r))": ast.EffectAnd((true("p"), true("unknown r")), S),
    "(when (p) (not (q)))": ast.When(atom("p"), false("q"), S),
    "(when (and (p) (q)) (and (r) (s)))": ast.When(
        ast.And((atom("p"), atom("q")), S), ast.EffectAnd((true("r"), true("s")), S), S
    ),
    "(forall (?x - t) (when (p ?x) (q ?x)))": ast.EffectForall(
        (group("?x", "t"),), ast.When(atom("p ?x"), true("q ?x"), S), S
    ),
    "(probabilistic .5 a 1/10 (b) 0 ())": ast.Probabilistic(
        (
            ast.Branch(number(".5"), true("a"), S),
            ast.Branch(number("1/10"), true("b"), S),
            ast.Branch(number("0"), ast.Empty(S), S),
        ),
        S,
    ),
    "(probabilistic 1 (probabilistic 0.1460833899262879 (p)))": ast.Probabilistic(
        (
            ast.Branch(
                number("1"),
                ast.Probabilistic((ast.Branch(number("0.1460833899262879"), true("p"), S),), S),
                S,
            ),
        ),
        S,
    ),
    "(oneof (p))": ast.OneOf((true("p"),), S),
    "(oneof (probabilistic 1e-3 p) (when q (oneof (and) r)))": ast.OneOf(
        (
            ast.Probabilistic((ast.Branch(number("1e-3"), true("p"), S),), S),
            ast.When(atom("q"), ast.OneOf((ast.EffectAnd((), S), true("r")), S), S),
        ),
        S,
    ),
    "(increase (total-cost) 3)": ast.FluentEffect("increase", fluent("total-cost"), number("3"), S),
    "(decrease reward 1)": ast.FluentEffect("decrease", fluent("reward"), number("1"), S),
    "(increase (total-cost) (distance ?a ?b))": ast.FluentEffect(
        "increase", fluent("total-cost"), fluent("distance ?a ?b"), S
    ),
    "(increase (total-cost) (+ (* 2 (d ?a)) (- 1)))": ast.FluentEffect(
        "increase",
        fluent("total-cost"),
        ast.Arithmetic(
            "+",
            (
                ast.Arithmetic("*", (number("2"), fluent("d ?a")), S),
                ast.Arithmetic("-", (number("1"),), S),
            ),
            S,
        ),
        S,
    ),
    "(assign (place ?r) ?to)": ast.Unsupported("object fluent", "(assign (place ?r) ?to)", S),
}

INITIAL: dict[str, ast.InitElement] = {
    "(p a b)": true("p a b"),
    "p": true("p"),
    "(not (p a))": false("p a"),
    "(not p)": false("p"),
    "(unknown (p a))": unknown("p a"),
    "(= (total-cost) 0)": ast.FluentValue(fluent("total-cost"), number("0"), S),
    "(= (distance a b) 4.5)": ast.FluentValue(fluent("distance a b"), number("4.5"), S),
    "(= reward -1)": ast.FluentValue(fluent("reward"), number("-1"), S),
    "(and (p) (or (q) (not (r))) (oneof (s) t))": ast.InitAnd(
        (
            true("p"),
            ast.InitClause(ast.Or((atom("q"), ast.Not(atom("r"), S)), S), S),
            ast.OneOf((true("s"), true("t")), S),
        ),
        S,
    ),
    "(oneof (oneof (p) (q)) (and (r) (not (s))))": ast.OneOf(
        (ast.OneOf((true("p"), true("q")), S), ast.EffectAnd((true("r"), false("s")), S)), S
    ),
    "(probabilistic 0.5 (and (p) q) 0.25 (oneof (r) s))": ast.Probabilistic(
        (
            ast.Branch(number("0.5"), ast.EffectAnd((true("p"), true("q")), S), S),
            ast.Branch(number("0.25"), ast.OneOf((true("r"), true("s")), S), S),
        ),
        S,
    ),
    "(or (and (p) (q)) (r))": ast.InitClause(ast.Or((ast.And((atom("p"), atom("q")), S), atom("r")), S), S),
    "(not (and (p) (q)))": ast.InitClause(ast.Not(ast.And((atom("p"), atom("q")), S), S), S),
    "(imply (p) (q))": ast.InitClause(ast.Imply(atom("p"), atom("q"), S), S),
    "(invariant (p) (not (q)))": ast.Invariant((atom("p"), ast.Not(atom("q"), S)), S),
    "(forall (?x - t) (probabilistic 0.5 (p ?x)))": ast.EffectForall(
        (group("?x", "t"),),
        ast.Probabilistic((ast.Branch(number("0.5"), true("p ?x"), S),), S),
        S,
    ),
    "(at 5 (p a))": ast.Unsupported("timed initial literal", "(at 5 (p a))", S),
    "(= (place b) hall)": ast.Unsupported("object fluent", "(= (place b) hall)", S),
}

TYPED_LISTS: dict[str, ast.TypedList] = {
    "": (),
    "a b": (group("a b"),),
    "a b - t c": (group("a b", "t"), group("c")),
    "a - (either t u) b - t": (group("a", "t", "u"), group("b", "t")),
    "a -t b- u c-d": (group("a -t b- u c-d"),),
    "-a -1 - t b- - -u .c- @d - --": (group("-a -1", "t"), group("b-", "-u"), group(".c- @d", "--")),
}

SECTIONS: dict[str, ast.Section] = {
    "(:requirements)": ast.Requirements((), S),
    "(:requirements :strips :TYPING)": ast.Requirements((name(":strips"), name(":TYPING")), S),
    "(:predicates (p) (q ?x ?y - t ?z) (r ?x - (either t u)))": ast.Predicates(
        (
            ast.PredicateDeclaration(name("p"), (), False, S),
            ast.PredicateDeclaration(name("q"), (group("?x ?y", "t"), group("?z")), False, S),
            ast.PredicateDeclaration(name("r"), (group("?x", "t", "u"),), False, S),
        ),
        S,
    ),
    "(:predicates (unknown (p ?x)) (unknown ?x))": ast.Predicates(
        (
            ast.PredicateDeclaration(name("p"), (group("?x"),), True, S),
            ast.PredicateDeclaration(name("unknown"), (group("?x"),), False, S),
        ),
        S,
    ),
    "(:predicates (observed (p ?x)) (observed ?x))": ast.Predicates(
        (
            ast.PredicateDeclaration(name("p"), (group("?x"),), False, S, observed=True),
            ast.PredicateDeclaration(name("observed"), (group("?x"),), False, S),
        ),
        S,
    ),
    "(:predicates (external (p)) (external (unknown (q ?x))) (external ?x) (external))": ast.Predicates(
        (
            ast.PredicateDeclaration(name("p"), (), False, S, external=True),
            ast.PredicateDeclaration(name("q"), (group("?x"),), True, S, external=True),
            ast.PredicateDeclaration(name("external"), (group("?x"),), False, S),
            ast.PredicateDeclaration(name("external"), (), False, S),
        ),
        S,
    ),
    "(:functions (total-cost) - number (d ?a ?b - t) reward)": ast.Functions(
        (
            ast.FunctionDeclaration(name("total-cost"), (), (name("number"),), S),
            ast.FunctionDeclaration(name("d"), (group("?a ?b", "t"),), (), S),
            ast.FunctionDeclaration(name("reward"), (), (), S),
        ),
        S,
    ),
    "(:derived (p ?x - t) (q ?x))": ast.Derived(
        "derived", (group("?x", "t"),), atom("p ?x"), atom("q ?x"), S
    ),
    "(:axiom :vars (?x - t) :context (q ?x) :implies (p ?x))": ast.Derived(
        "axiom", (group("?x", "t"),), atom("p ?x"), atom("q ?x"), S
    ),
    "(:axiom (p ?x) (q ?x))": ast.Derived("derived", (group("?x"),), atom("p ?x"), atom("q ?x"), S),
    "(:axiom a :parameters (?x) :body (q ?x) :head (and (p ?x) (r)))": ast.Derived(
        "axiom", (group("?x"),), atom("p ?x"), atom("q ?x"), S, name("a"), (atom("r"),)
    ),
    "(:sensor s :parameters (?x) :condition (p ?x) :sensed (q ?x))": ast.Sensor(
        name("s"), (group("?x"),), atom("p ?x"), ast.Observation(atom("q ?x"), S), S
    ),
    "(:sensor s :sense (p) (q))": ast.Sensor(
        name("s"), (), None, ast.Observation(ast.And((atom("p"), atom("q")), S), S), S
    ),
    "(:sensor s :sensed (probabilistic 0.9 (p)) :repeats)": ast.Sensor(
        name("s"),
        (),
        None,
        ast.Observation(ast.Probabilistic((ast.Branch(number("0.9"), true("p"), S),), S), S),
        S,
        repeats=True,
    ),
    "(:variable v (p) (forall (?x - t) (q ?x)))": ast.StateVariable(
        "variable",
        name("v"),
        None,
        (atom("p"), ast.Quantified("forall", (group("?x", "t"),), atom("q ?x"), S)),
        S,
    ),
    "(:obs-variable (v ?x - t) (p ?x))": ast.StateVariable(
        "obs-variable", name("v"), (group("?x", "t"),), (atom("p ?x"),), S
    ),
    "(:observable (p) (q))": ast.AtomList("observable", (atom("p"), atom("q")), S),
    "(:observables (o ?x))": ast.Observables(
        "observables", (ast.PredicateDeclaration(name("o"), (group("?x"),), False, S),), S
    ),
    "(:observation n :condition (p) :distribution (probabilistic 0.9 (o)))": ast.ObservationModel(
        name("n"),
        (),
        atom("p"),
        ast.Probabilistic((ast.Branch(number("0.9"), true("o"), S),), S),
        S,
    ),
    "(:init-belief (prob (p a) 0.3) (joint 1/2 (and (p) (not (q)))))": ast.InitBelief(
        (
            ast.FactBelief(atom("p a"), number("0.3"), S),
            ast.JointBelief(number("1/2"), ast.And((atom("p"), ast.Not(atom("q"), S)), S), S),
        ),
        S,
    ),
    "(:goal (believed (or (p) (q)) 0.95))": ast.Goal(
        ast.Believed(ast.Or((atom("p"), atom("q")), S), number("0.95"), S), S
    ),
    "(:sticky (p))": ast.AtomList("sticky", (atom("p"),), S),
    "(:default-sensing-model (when (p) (q)))": ast.DefaultSensing(ast.When(atom("p"), true("q"), S), S),
    "(:domain d)": ast.DomainReference(name("d"), S),
    "(:init)": ast.Init((), S),
    "(:hidden (p a) (not (q)))": ast.Hidden((true("p a"), false("q")), S),
    "(:goal (and (p) (q)))": ast.Goal(ast.And((atom("p"), atom("q")), S), S),
    "(:goal)": ast.Goal(ast.Empty(S), S),
    "(:goal-probability 0.9)": ast.GoalNumber("goal-probability", number("0.9"), S),
    "(:goal-reward 100)": ast.GoalNumber("goal-reward", number("100"), S),
    "(:metric maximize (reward))": ast.Metric("maximize", fluent("reward"), S),
    "(:metric minimize total-cost)": ast.Metric("minimize", fluent("total-cost"), S),
    "(:process flow :parameters () :effect (and))": ast.Unsupported(
        ":process", "(:process flow :parameters () :effect (and))", S
    ),
    "(:durative-action go :duration (= ?duration 5) :condition (and (at start (p)) (over all (q))) "
    ":effect (when (at start (p)) (at end (not (p)))))": ast.DurativeAction(
        name("go"),
        (),
        number("5"),
        ast.TimedAll(
            (ast.TimedFormula("at start", atom("p"), S), ast.TimedFormula("over all", atom("q"), S)), S
        ),
        ast.TimedWhen(
            ast.TimedFormula("at start", atom("p"), S), ast.TimedChange("at end", false("p"), S), S
        ),
        S,
    ),
    "(:constraints (and(always (p))))": ast.Unsupported(
        ":constraints", "(:constraints (and (always (p))))", S
    ),
}


@pytest.mark.parametrize("text", CONDITIONS)
def test_condition(text: str) -> None:
    assert action(f":precondition {text}").precondition == CONDITIONS[text]
    assert section(f"(:goal {text})", "problem") == ast.Goal(CONDITIONS[text], S)


@pytest.mark.parametrize("text", EFFECTS)
def test_effect(text: str) -> None:
    assert action(f":effect {text}").effect == EFFECTS[text]


@pytest.mark.parametrize("text", INITIAL)
def test_initial_element(text: str) -> None:
    assert section(f"(:init {text})", "problem") == ast.Init((INITIAL[text],), S)


def test_initial_elements_mix() -> None:
    assert section(f"(:init {' '.join(INITIAL)})", "problem") == ast.Init(tuple(INITIAL.values()), S)


@pytest.mark.parametrize("text", TYPED_LISTS)
@pytest.mark.parametrize("kind", ["types", "constants", "objects"])
def test_typed_list(text: str, kind: str) -> None:
    found = section(f"(:{kind} {text})")
    assert isinstance(found, ast.TypedSection)
    assert (found.kind, found.entries) == (kind, TYPED_LISTS[text])


@pytest.mark.parametrize("text", SECTIONS)
def test_section(text: str) -> None:
    assert section(text) == SECTIONS[text]


def test_action_fields_in_any_order() -> None:
    expected = ast.Action(
        name("a"), (group("?x", "t"),), atom("p ?x"), ast.Observation(atom("q ?x"), S), true("r ?x"), S
    )
    assert action(":parameters (?x - t) :precondition (p ?x) :observe (q ?x) :effect (r ?x)") == expected
    assert action(":effect (r ?x) :observe (q ?x) :precondition (p ?x) :parameters (?x - t)") == expected


def test_action_without_fields() -> None:
    assert action("") == ast.Action(name("a"), (), None, None, None, S)
    assert action(":parameters () :precondition ()").precondition == ast.Empty(S)


def test_observations() -> None:
    both = ast.And((atom("p"), atom("q")), S)
    assert action(":observe (p) (q)").observe == ast.Observation(both, S)
    assert action(":observe (and (p) (q))").observe == ast.Observation(both, S)
    noisy = ast.Probabilistic((ast.Branch(number("0.8"), true("p"), S),), S)
    assert action(":observe (probabilistic 0.8 (p))").observe == ast.Observation(noisy, S)


def test_missing_spaces_in_parameters() -> None:
    split = (group("?b", "block"), group("?c-d"))
    assert action(":parameters (?b-block ?c-d) :effect (p ?b ?c-d)").parameters == split
    assert action(":parameters (?loc -zone) :effect (p ?loc)").parameters == (group("?loc", "zone"),)
    assert action(":parameters (?loc- zone ?b- - box)").parameters == (
        group("?loc", "zone"),
        group("?b-", "box"),
    )
    assert action(":parameters (?a- ?-b -zone ?c-)").parameters == (group("?a- ?-b", "zone"), group("?c-"))
    assert action(":parameters (?a --zone ?b - -zone)").parameters == (
        group("?a", "-zone"),
        group("?b", "-zone"),
    )
    kept = (group("?from-floor", "floor"),)
    assert action(":parameters (?from-floor - floor) :effect (at ?from-floor)").parameters == kept
    assert action(":parameters (?from-floor - floor)").parameters == kept


def test_template() -> None:
    body = ast.BodyControl(
        "skipper",
        (
            ast.BodyCondition(atom("seen ?o"), S),
            ast.BodyForeach(
                (group("?p", "place"),),
                ast.BodyControl(
                    "sequence",
                    (
                        ast.BodyCall("action", name("goto"), (term("?p"),), S),
                        ast.BodyCall(None, name("look"), (term("?o"), name("hall")), S),
                    ),
                    S,
                ),
                S,
            ),
            ast.BodyControl("fallback", (), S),
        ),
        S,
    )
    found = section(
        "(:template find :parameters (?o) :precondition (lit) :effect (seen ?o) :body"
        " (skipper (condition (seen ?o))"
        " (foreach (?p - place) (sequence (action goto ?p) (look ?o hall))) (fallback)))"
    )
    assert found == ast.Template(name("find"), (group("?o"),), atom("lit"), true("seen ?o"), body, S)


def test_definitions_in_one_file_and_in_any_case() -> None:
    found = definitions("(DEFINE (Problem P) (:Domain D)) (define (domain D)) (define (problem q))")
    assert [(d.kind, d.name.text) for d in found] == [("problem", "P"), ("domain", "D"), ("problem", "q")]
    assert found[0].sections == (ast.DomainReference(name("D"), S),)


def test_comments_are_kept_with_their_places() -> None:
    text = "; first\n(define (domain d) ; naïve\n ;; own (\n)"
    report = Report()
    document = parse(SourceFile("test.pddl", text), report)
    assert not report.errors
    assert [(c.text, c.own_line) for c in document.comments] == [
        ("; first", True),
        ("; naïve", False),
        (";; own (", True),
    ]
    assert [c.span.text for c in document.comments] == [c.text for c in document.comments]


def test_spans_cover_what_was_written() -> None:
    text = "(define (domain d) (:action Go :parameters (?x ?y - t) :effect (and (at ?x) (not (at ?y)))))"
    [definition] = definitions(text)
    [go] = definition.sections
    assert definition.span.text == text
    assert isinstance(go, ast.Action)
    assert (go.name.span.text, go.span.text) == ("Go", text[19:-1])
    assert [g.span.text for g in go.parameters] == ["?x ?y - t"]
    assert [n.span.text for g in go.parameters for n in (*g.names, *g.types)] == ["?x", "?y", "t"]
    assert isinstance(go.effect, ast.EffectAnd)
    assert [e.span.text for e in go.effect.parts] == ["(at ?x)", "(not (at ?y))"]
    away = go.effect.parts[1]
    assert isinstance(away, ast.Assign)
    assert (away.atom.span.text, away.atom.args[0].span.place) == ("(at ?y)", "test.pddl:1:86")
