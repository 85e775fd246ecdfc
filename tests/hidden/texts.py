"""Random small domains with hidden state, as text."""

from __future__ import annotations

import functools

from hypothesis import strategies as st

HIDDEN = ("h", "i", "j")
SEEN = ("s", "t")
ATOMS = (*HIDDEN, *SEEN)


@functools.cache  # to make a strategy takes longer than to draw from it
def _literal(atoms: tuple[str, ...]) -> st.SearchStrategy[str]:
    return st.builds(lambda atom, true: f"({atom})" if true else f"(not ({atom}))",
                     st.sampled_from(atoms), st.booleans())  # fmt: skip


@functools.cache
def conditions(atoms: tuple[str, ...]) -> st.SearchStrategy[str]:
    literal = _literal(atoms)
    several = st.lists(literal, min_size=2, max_size=2)
    joined = st.builds(
        lambda word, parts: f"({word} {' '.join(parts)})", st.sampled_from(["and", "or", "imply"]), several
    )
    denied = st.builds(lambda part: f"(not {part})", joined)
    return st.one_of(literal, literal, joined, joined, denied)


@functools.cache
@st.composite
def _needs(draw: st.DrawFn, atoms: tuple[str, ...]) -> str:
    """A precondition: now and then it asks what is known."""
    found = draw(conditions(atoms))
    if draw(st.integers(0, 5)):
        return found
    return f"(and ({draw(st.sampled_from(['known', 'unknown']))} ({draw(st.sampled_from(HIDDEN))})) {found})"


@functools.cache
@st.composite
def _effect(draw: st.DrawFn) -> str:
    parts = []
    for _ in range(draw(st.integers(1, 2))):
        # A seen fact that reads a hidden one would be hidden: that happens, too, but seldom.
        target = draw(_literal(SEEN if draw(st.integers(0, 2)) else HIDDEN))
        kind = draw(st.integers(0, 6))
        if kind == 3 and not draw(st.integers(0, 2)):
            target = f"(unknown ({draw(st.sampled_from(HIDDEN))}))"
        elif kind == 0:
            target = f"(when {draw(conditions(ATOMS))} {target})"
        elif kind == 1:
            target = f"(probabilistic 1/3 {target})"
        elif kind == 2:
            target = f"(oneof {target} {draw(_literal(ATOMS))})"
        parts.append(target)
    return f"(and {' '.join(parts)})"


def _is_clause(condition: str) -> bool:
    """Is it more than a literal, and not several of them?"""
    return condition.startswith(("(or", "(imply", "(not (and", "(not (or", "(not (imply"))


@functools.cache
def _clause() -> st.SearchStrategy[str]:
    return conditions(("i", "j")).filter(_is_clause)


@st.composite
def texts(draw: st.DrawFn, *, noise: bool = False) -> str:
    """A domain and a problem with up to three hidden facts and two seen ones. With ``noise``, some readings
    may be wrong."""
    actions = []
    for number in range(draw(st.integers(2, 5))):
        form = f"(:action a{number}"
        if draw(st.booleans()):
            form += f" :precondition {draw(_needs(ATOMS))}"
        kind = draw(st.integers(0, 3))
        if kind < 3:
            told = draw(conditions(HIDDEN)) if draw(st.booleans()) else f"({draw(st.sampled_from(ATOMS))})"
            if noise and draw(st.booleans()):
                fact = draw(st.sampled_from(HIDDEN))
                other = draw(st.sampled_from(["", "", f" 1/2 (not ({fact}))", f" 1 (not ({fact}))"]))
                told = f"(probabilistic 3/4 ({fact}){other})"
            form += f" :observe {told}"
        if kind in {0, 3}:
            form += f" :effect {draw(_effect())}"
        actions.append(form + ")")
    init = [f"({atom})" for atom in SEEN if draw(st.booleans())]
    for atom in HIDDEN:
        kind = draw(st.integers(0, 3))
        init += [f"(unknown ({atom}))"] if kind < 2 else [f"({atom})"] if kind == 2 else []
    kind = draw(st.integers(0, 6))
    if kind == 1:
        init = [each for each in init if each[1] in "ust"]
        init.append(f"(oneof {' '.join(f'({atom})' for atom in HIDDEN)})")
    elif kind == 2:
        init = [each for each in init if each[1] in "ust"]
        init.append(f"(or (h) {draw(_literal(('i', 'j')))})")
    elif kind == 3:
        init = [each for each in init if each != "(h)" and each != "(unknown (h))"]
        init.append("(probabilistic 1/4 (h))")
    elif kind == 4:
        init = [each for each in init if each[1] in "ust"]
        init.append("(oneof (and (h) (i)) (and (i) (j)) (h))")
    elif kind == 5:
        init = [each for each in init if each[1] in "ust"]
        init.append(f"(probabilistic 1/4 (h) 1/3 (i)) {draw(_clause())}")
    elif kind == 6:
        init = [each for each in init if each[1] in "ust"]
        init.append("(probabilistic 1/2 (h)) (probabilistic 1/3 (and (h) (j)) 1/3 (i)) (unknown (j))")
    goal = " ".join(draw(st.lists(_literal(ATOMS), min_size=1, max_size=2, unique_by=lambda each: each[-4:])))
    return (
        f"(define (domain d) (:predicates {' '.join(f'({atom})' for atom in ATOMS)})\n  "
        + "\n  ".join(actions)
        + "\n  (:action mark :observe (h)))\n"
        f"(define (problem x) (:domain d) (:init {' '.join(init)}) (:goal (and {goal})))"
    )
