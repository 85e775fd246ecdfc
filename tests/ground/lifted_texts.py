"""Random small domains with a problem, as text (Hypothesis strategies)."""

from __future__ import annotations

from hypothesis import strategies as st
from hypothesis.strategies import DrawFn

_TYPES = {"a": ["a1", "a2"], "b": ["b1"], "top": ["a1", "a2", "b1"], "object": ["a1", "a2", "b1"]}
_PREDICATES = {
    "p": [],
    "q": ["a"],
    "r": ["top", "a"],
    "s": ["object"],
    "fixed": ["top"],
    "link": ["a", "top"],
}
_FLUENTS = ["p", "q", "r", "s"]
_BELOW = {
    "a": {"a", "top", "object"},
    "b": {"b", "top", "object"},
    "top": {"top", "object"},
    "object": {"object"},
}

Scope = dict[str, str]


def _terms(scope: Scope, wanted: str) -> list[str]:
    fitting = [name for name, type_ in scope.items() if wanted in _BELOW[type_] or type_ in _BELOW[wanted]]
    return fitting + _TYPES[wanted]


def _atom(draw: DrawFn, scope: Scope, names: list[str]) -> str:
    name = draw(st.sampled_from(names))
    args = [draw(st.sampled_from(_terms(scope, wanted))) for wanted in _PREDICATES[name]]
    return f"({' '.join([name, *args])})"


def _quantifier(draw: DrawFn, scope: Scope) -> tuple[str, Scope]:
    # Names may shadow those around.
    chosen = draw(st.lists(st.sampled_from(["?x", "?y", "?z"]), min_size=1, max_size=2, unique=True))
    types = [draw(st.sampled_from(sorted(_TYPES))) for _ in chosen]
    listed = " ".join(f"{name} - {type_}" for name, type_ in zip(chosen, types, strict=True))
    return listed, {**scope, **dict(zip(chosen, types, strict=True))}


def _condition(draw: DrawFn, scope: Scope, depth: int) -> str:
    kinds = ["atom", "atom", "not", "unknown", "known", "="]
    if depth:
        kinds += ["and", "and", "or", "imply", "not-any", "exists", "forall"]
    kind = draw(st.sampled_from(kinds))
    atom = _atom(draw, scope, list(_PREDICATES))
    match kind:
        case "atom":
            return atom
        case "not" | "unknown" | "known":
            return f"({kind} {atom})"
        case "=":
            left, right = (draw(st.sampled_from(_terms(scope, "top"))) for _ in range(2))
            return draw(st.sampled_from([f"(= {left} {right})", f"(not (= {left} {right}))"]))
        case "and" | "or":
            parts = [_condition(draw, scope, depth - 1) for _ in range(draw(st.integers(0, 3)))]
            return f"({' '.join([kind, *parts])})"
        case "imply":
            return f"(imply {_condition(draw, scope, depth - 1)} {_condition(draw, scope, depth - 1)})"
        case "not-any":
            return f"(not {_condition(draw, scope, depth - 1)})"
        case _:
            listed, inside = _quantifier(draw, scope)
            return f"({kind} ({listed}) {_condition(draw, inside, depth - 1)})"


def _effect(draw: DrawFn, scope: Scope, depth: int) -> str:
    kinds = ["set", "set", "set"]
    if depth:
        kinds += ["and", "when", "forall", "probabilistic", "oneof"]
    kind = draw(st.sampled_from(kinds))
    match kind:
        case "set":
            atom = _atom(draw, scope, _FLUENTS)
            return draw(st.sampled_from([atom, f"(not {atom})", f"(unknown {atom})"]))
        case "and" | "oneof":
            least = 1 if kind == "oneof" else 0
            parts = [_effect(draw, scope, depth - 1) for _ in range(draw(st.integers(least, 3)))]
            return f"({' '.join([kind, *parts])})"
        case "when":
            return f"(when {_condition(draw, scope, 1)} {_effect(draw, scope, depth - 1)})"
        case "forall":
            listed, inside = _quantifier(draw, scope)
            return f"(forall ({listed}) {_effect(draw, inside, depth - 1)})"
        case _:
            shares = draw(
                st.sampled_from([["0.5", "0.5"], ["1/3", ".25"], ["0.2"], ["1", "0"], ["0.1", "0.2", "0.7"]])
            )
            parts = [f"{share} {_effect(draw, scope, depth - 1)}" for share in shares]
            return f"(probabilistic {' '.join(parts)})"


def _precondition(draw: DrawFn, scope: Scope) -> str:
    """Mostly one that can be met: enough actions are to apply for their effects to meet."""
    easy = ["()", f"(not {_atom(draw, scope, _FLUENTS)})"]
    return draw(st.sampled_from([*easy, *easy, _condition(draw, scope, 2)]))


def _action(draw: DrawFn, name: str) -> str:
    chosen = draw(st.lists(st.sampled_from(["?x", "?y"]), max_size=2, unique=True))
    scope = {parameter: draw(st.sampled_from(sorted(_TYPES))) for parameter in chosen}
    listed = " ".join(f"{parameter} - {type_}" for parameter, type_ in scope.items())
    effects = " ".join(_effect(draw, scope, 3) for _ in range(draw(st.integers(1, 4))))
    return (
        f"(:action {name} :parameters ({listed}) :precondition {_precondition(draw, scope)}"
        f" :effect (and {effects}))"
    )


@st.composite
def lifted_texts(draw: DrawFn) -> str:
    """A domain with four predicates that may change and two that do not, and a problem for it."""
    actions = [_action(draw, name) for name in ("one", "two", "three")[: draw(st.integers(1, 3))]]
    facts = {_atom(draw, {}, list(_PREDICATES)) for _ in range(draw(st.integers(0, 12)))}
    init = [
        draw(st.sampled_from([fact, fact, fact, f"(unknown {fact})", f"(not {fact})"]))
        for fact in sorted(facts)
    ]
    predicates = " ".join(
        f"({' '.join([name, *(f'?{i} - {type_}' for i, type_ in enumerate(types))])})"
        for name, types in _PREDICATES.items()
    )
    goal = _condition(draw, {}, 2)
    if draw(st.integers(0, 3)):
        # One that can be reached whatever comes out.
        atom = _atom(draw, {}, _FLUENTS)
        goal = f"(or {atom} (not {atom}) (unknown {atom}) {goal})"
    return "\n".join(
        [
            "(define (domain d) (:types top - object a b - top)",
            f"(:predicates {predicates})",
            "(:constants a1 a2 - a b1 - b)",
            *actions,
            ")",
            f"(define (problem q) (:domain d) (:init {' '.join(init)})",
            f"(:goal {goal}))",
        ]
    )
