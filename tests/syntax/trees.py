"""Hypothesis strategies: random syntax trees that some text stands for."""

from __future__ import annotations

from hypothesis import strategies as st

from bbtc.kleene import Truth
from bbtc.source import SourceFile, Span
from bbtc.syntax import ast
from bbtc.syntax.words import BODY_WORDS, FORM_WORDS

S = Span(SourceFile("none", ""), 0, 0)

# Words that have a meaning of their own somewhere, or that lexers trip over.
_ODD = [
    "a-b",
    "x1",
    "_",
    "3d",
    "p.q",
    "at",
    "domain",
    "define",
    "condition",
    "action",
    "number",
    "object",
    "e5",
    "known",
    "unknown",
]
_RESERVED = {*FORM_WORDS, "invariant"}
WORDS = st.one_of(st.sampled_from(_ODD), st.from_regex(r"\A[A-Za-z0-9_.*+@#$%!~-]{1,9}\Z")).filter(
    lambda word: word.lower() not in _RESERVED and word not in {"-", "*", "+"}
)
names = WORDS.map(lambda text: ast.Name(text, S))
_template_names = names.filter(lambda name: name.key not in BODY_WORDS)
# An object in an equation must not look like a number.
objects = st.from_regex(r"\A[A-Za-z_][a-z0-9]{0,5}\Z").map(lambda text: ast.Name(text, S))
variables = WORDS.map(lambda text: ast.Variable(f"?{text}", S))
# A variable with a hyphen may be read as one that lacks the space before its type.
parameters = st.from_regex(r"\A\?[A-Za-z_][a-z0-9_]{0,5}\Z").map(lambda text: ast.Variable(text, S))
numbers = st.one_of(
    st.sampled_from(["0", "1", ".5", "1/10", "0.1460833899262879", "1e-3", "7.", "100"]),
    st.integers(0, 999).map(str),
).map(lambda text: ast.Number(text, S))
terms = st.one_of(names, variables)


def tuples(
    items: st.SearchStrategy[object], low: int = 0, high: int = 3
) -> st.SearchStrategy[tuple[object, ...]]:
    return st.lists(items, min_size=low, max_size=high).map(tuple)


def build(node: type, *parts: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    """The node with random parts."""
    return st.builds(lambda *given: node(*given, S), *parts)


def typed_lists(words: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    """Groups with types, and at the end maybe one without."""
    typed = build(ast.TypedGroup, tuples(words, 1), tuples(names, 1, 2))
    untyped = build(ast.TypedGroup, tuples(words, 1), st.just(()))
    return st.builds(lambda many, last: (*many, *last), tuples(typed, 0, 2), tuples(untyped, 0, 1))


atoms = build(ast.Atom, names, tuples(terms))
fluents = build(ast.FluentRef, names, tuples(terms))
facts = st.builds(lambda atom, value: ast.Assign(atom, value, S), atoms, st.sampled_from(Truth))


def _formula(inner: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    return st.one_of(
        build(ast.Not, inner),
        build(ast.And, tuples(inner)),
        build(ast.Or, tuples(inner)),
        build(ast.Imply, inner, inner),
        build(ast.Quantified, st.sampled_from(["exists", "forall"]), typed_lists(parameters), inner),
        build(ast.Believed, inner, numbers),
        build(ast.Test, st.sampled_from(["unknown", "known"]), build(ast.Believed, inner, numbers)),
    )


ENERGY = ast.FluentRef(ast.Name("energy", S), (ast.Variable("?r", S),), S)
formulas = st.recursive(
    st.one_of(
        atoms,
        st.just(ast.Empty(S)),
        build(ast.Equality, st.one_of(objects, parameters), st.one_of(objects, parameters)),
        build(ast.Test, st.sampled_from(["unknown", "known"]), atoms),
        st.just(ast.Comparison(">=", ENERGY, ast.Number("8", S), S)),
        st.just(ast.Unsupported("preference", "(preference p1 (and (q) r))", S)),
    ),
    _formula,
    max_leaves=6,
)
expressions = st.recursive(
    st.one_of(numbers, fluents),
    lambda inner: build(ast.Arithmetic, st.sampled_from("+-*/"), tuples(inner, 1)),
    max_leaves=3,
)
changes = build(
    ast.FluentEffect,
    st.sampled_from(["increase", "decrease", "assign", "scale-up", "scale-down"]),
    fluents,
    expressions,
)


def _chance(inner: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    return build(ast.Probabilistic, tuples(build(ast.Branch, numbers, inner)))


def _effect(inner: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    return st.one_of(
        build(ast.EffectAnd, tuples(inner)),
        build(ast.When, formulas, inner),
        build(ast.EffectForall, typed_lists(parameters), inner),
        _chance(inner),
        build(ast.OneOf, tuples(inner)),
    )


effects = st.recursive(st.one_of(facts, changes, st.just(ast.Empty(S))), _effect, max_leaves=6)
choices = st.recursive(
    st.one_of(facts, st.just(ast.Empty(S))),
    lambda inner: st.one_of(
        build(ast.EffectAnd, tuples(inner)),
        build(ast.OneOf, tuples(inner)),
        _chance(inner),
        build(ast.EffectForall, typed_lists(parameters), inner),
    ),
    max_leaves=4,
)
clauses = st.one_of(build(ast.Or, tuples(formulas)), build(ast.Imply, formulas, formulas)).map(
    lambda formula: ast.InitClause(formula, S)  # type: ignore[arg-type]
)
initial = st.recursive(
    st.one_of(
        # `(and …)` and `()` stand for themselves at this level.
        choices.filter(lambda choice: not isinstance(choice, ast.EffectAnd)),
        clauses,
        build(ast.FluentValue, fluents, numbers),
        st.builds(
            lambda parts, word: ast.Invariant(parts, S, word),
            *(tuples(formulas, 1), st.sampled_from(["invariant", "at-least-one"])),
        ),
        st.just(ast.Unsupported("timed initial literal", "(at 5 (p a))", S)),
    ),
    lambda inner: build(ast.InitAnd, tuples(inner)),
    max_leaves=4,
)
calls = WORDS.filter(lambda word: word.lower() not in BODY_WORDS).map(lambda text: ast.Name(text, S))
bodies = st.recursive(
    st.one_of(
        build(ast.BodyCondition, formulas),
        build(ast.BodyCall, st.sampled_from([None, "action"]), calls, tuples(terms)),
    ),
    lambda inner: st.one_of(
        build(ast.BodyControl, st.sampled_from(["sequence", "fallback", "skipper"]), tuples(inner)),
        build(ast.BodyForeach, typed_lists(parameters), inner),
    ),
    max_leaves=5,
)
observations = st.one_of(formulas, _chance(effects)).map(lambda content: ast.Observation(content, S))  # type: ignore[arg-type]


def _derived(parameters: ast.TypedList, head: ast.Name, condition: ast.Formula) -> ast.Derived:
    args = tuple(name for group in parameters for name in group.names)
    return ast.Derived("derived", parameters, ast.Atom(head, args, S), condition, S)


_values = st.one_of(atoms, build(ast.Quantified, st.just("forall"), typed_lists(parameters), atoms))


_models = st.builds(
    lambda effect, word: ast.SensingModel(effect, S, word),
    *(effects, st.sampled_from(["sensing-model", "observation"])),
)


def optional(strategy: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    return st.one_of(st.none(), strategy)


sections = st.one_of(
    build(ast.Requirements, tuples(st.sampled_from([ast.Name(":typing", S), ast.Name(":ADL", S)]))),
    build(ast.TypedSection, st.sampled_from(["types", "constants", "objects"]), typed_lists(names)),
    build(
        ast.Predicates,
        tuples(
            st.builds(
                lambda name, parameters, three_valued, mark: ast.PredicateDeclaration(
                    name, parameters, three_valued, S, mark == "external", mark == "observed"
                ),
                names,
                typed_lists(variables),
                st.booleans(),
                st.sampled_from(["", "external", "observed"]),
            )
        ),
    ),
    build(
        ast.Functions,
        tuples(
            st.one_of(
                build(ast.FunctionDeclaration, names, typed_lists(variables), tuples(names, 0, 1)),
                st.builds(
                    lambda name, parameters, given: ast.FunctionDeclaration(name, parameters, (), S, given),
                    names,
                    typed_lists(variables),
                    build(ast.NumberRange, numbers, numbers, optional(st.just(ast.Name(":block", S)))),
                ),
            )
        ),
    ),
    st.builds(
        lambda *fields: ast.Action(*fields[:-1], S, fields[-1]),  # type: ignore[call-arg]
        names,
        typed_lists(parameters),
        optional(formulas),
        optional(st.one_of(observations, _models)),
        optional(effects),
        st.booleans(),
    ),
    build(
        ast.Template, _template_names, typed_lists(parameters), optional(formulas), optional(effects), bodies
    ),
    st.builds(
        lambda *fields: ast.Sensor(*fields[:-1], S, fields[-1]),  # type: ignore[call-arg]
        *(names, typed_lists(parameters), optional(formulas), observations, st.booleans()),
    ),
    st.builds(_derived, typed_lists(parameters), names, formulas),
    build(ast.Derived, st.just("axiom"), typed_lists(parameters), atoms, formulas),
    st.builds(
        lambda *fields: ast.Derived("axiom", *fields[:-2], S, *fields[-2:]),  # type: ignore[call-arg]
        *(typed_lists(parameters), atoms, formulas, names, tuples(atoms, 0, 2)),
    ),
    build(
        ast.StateVariable,
        st.sampled_from(["variable", "obs-variable"]),
        names,
        optional(typed_lists(parameters)),
        tuples(_values),
    ),
    build(ast.AtomList, st.sampled_from(["observable", "sticky"]), tuples(_values)),
    build(ast.DefaultSensing, effects),
    build(ast.ObservationModel, names, typed_lists(parameters), optional(formulas), effects),
    build(
        ast.InitBelief,
        tuples(st.one_of(build(ast.FactBelief, atoms, numbers), build(ast.JointBelief, numbers, formulas))),
    ),
    build(
        ast.Observables,
        st.sampled_from(["observables", "observations"]),
        tuples(build(ast.PredicateDeclaration, names, typed_lists(variables), st.just(False))),
    ),
    build(ast.DomainReference, names),
    build(ast.Init, tuples(initial, 0, 5)),
    build(ast.Hidden, tuples(facts.filter(lambda fact: fact.value is not Truth.UNKNOWN))),
    build(ast.Goal, formulas),
    build(ast.GoalNumber, st.sampled_from(["goal-probability", "goal-reward"]), numbers),
    build(ast.Metric, st.sampled_from(["minimize", "maximize"]), expressions),
    st.just(ast.Unsupported(":constraints", "(:constraints (and (always (p))))", S)),
)
definitions = build(ast.Definition, st.sampled_from(["domain", "problem"]), names, tuples(sections, 0, 4))
documents = tuples(definitions, 1, 2).map(lambda found: ast.Document(SourceFile("none", ""), found))  # type: ignore[arg-type]
