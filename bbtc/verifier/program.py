"""Markov chains and decision processes as programs of the PRISM language, as data.

A program has *cells* (bounded integer variables), *commands* (guard, and a distribution over updates
of the cells) and *labels* (sets of states). In a Markov chain one command is enabled in every state,
in a decision process a policy picks one of those enabled, which may see a part of the cells only. All
right-hand sides read the state before the update. Source: Kwiatkowska, Norman, Parker, "PRISM 4.0" (2011),
reactive modules.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal, TypeAlias

from typing_extensions import assert_never

# --- expressions -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Compare:
    """The value of a cell, compared with a number."""

    cell: int
    relation: Literal["=", "<"]
    number: int


@dataclass(frozen=True, slots=True)
class AllOf:
    """Conjunction."""

    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class AnyOf:
    """Disjunction."""

    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Negation:
    """Negation."""

    part: Expression


@dataclass(frozen=True, slots=True)
class Literally:
    """True or false."""

    value: bool


@dataclass(frozen=True, slots=True)
class Use:
    """The formula of this index."""

    formula: int


Expression: TypeAlias = Compare | AllOf | AnyOf | Negation | Literally | Use
"""A two-valued expression."""

YES, NO = Literally(True), Literally(False)


def all_of(*parts: Expression) -> Expression:
    """Conjunction, flattened, without constants, and without atoms that repeat or contradict others."""
    kept = _distinct(inner for part in parts for inner in (part.parts if isinstance(part, AllOf) else [part]))
    atoms = {part for part in kept if is_atom(part)}
    if NO in atoms or any(isinstance(part, Negation) and part.part in atoms for part in atoms):
        return NO
    left = tuple(part for part in kept if part != YES)
    return AllOf(left) if len(left) > 1 else left[0] if left else YES


def any_of(*parts: Expression) -> Expression:
    """Disjunction, flattened, without constants, and without atoms that repeat or, next to others, say
    nothing."""
    kept = _distinct(inner for part in parts for inner in (part.parts if isinstance(part, AnyOf) else [part]))
    atoms = {part for part in kept if is_atom(part)}
    if YES in atoms or any(isinstance(part, Negation) and part.part in atoms for part in atoms):
        return YES
    reduced = [_besides(part, atoms) if isinstance(part, AllOf) else part for part in kept]
    if any(one is not other for one, other in zip(reduced, kept, strict=True)):
        return any_of(*reduced)
    left = tuple(part for part in kept if part != NO)
    return AnyOf(left) if len(left) > 1 else left[0] if left else NO


def _distinct(parts: Iterable[Expression]) -> list[Expression]:
    """The parts without atoms that repeat. (To compare larger ones would cost more than it gains.)"""
    seen: set[Expression] = set()
    found = []
    for part in parts:
        if not is_atom(part):
            found.append(part)
        elif part not in seen:
            seen.add(part)
            found.append(part)
    return found


def _besides(part: AllOf, others: Collection[Expression]) -> Expression:
    """What the part adds to a disjunction with others: without atoms that one of them negates."""
    kept = [inner for inner in part.parts if not is_atom(inner) or none_of(inner) not in others]
    return part if len(kept) == len(part.parts) else all_of(*kept)


def none_of(*parts: Expression) -> Expression:
    """The negation of the disjunction."""
    part = any_of(*parts)
    match part:
        case Literally(value):
            return Literally(not value)
        case Negation(inner):
            return inner
        case Compare() | AllOf() | AnyOf() | Use():
            return Negation(part)
        case _:
            assert_never(part)


def is_atom(expression: Expression) -> bool:
    """Is it too small to deserve a name of its own?"""
    inner = expression.part if isinstance(expression, Negation) else expression
    return not isinstance(inner, AllOf | AnyOf)


def parts_of(expression: Expression) -> tuple[Expression, ...]:
    """The expressions directly inside."""
    match expression:
        case AllOf(parts) | AnyOf(parts):
            return parts
        case Negation(part):
            return (part,)
        case Compare() | Literally() | Use():
            return ()
        case _:
            assert_never(expression)


# --- programs --------------------------------------------------------------------------------

CellKind: TypeAlias = Literal[
    "variable", "number", "fact", "possible", "told", "done", "attempts", "pending", "control"
]


@dataclass(frozen=True, slots=True)
class Cell:
    """A variable of a program, with values from 0 to ``highest``.

    ``subject`` is what it is about (the ground predicate, the id of the node); ``meaning`` says in
    words what its values stand for. Both hold names of the domain as they are.
    """

    kind: CellKind
    subject: str
    meaning: str
    highest: int
    initial: int = 0


@dataclass(frozen=True, slots=True)
class Formula:
    """A named expression. It uses earlier formulas only. ``subject`` is the id of a node."""

    subject: str
    aspect: str
    expression: Expression


@dataclass(frozen=True, slots=True)
class Choose:
    """The cell gets the number of the first case that holds in the state before; without one it
    keeps its value."""

    cell: int
    cases: tuple[tuple[Expression, int], ...]


@dataclass(frozen=True, slots=True)
class Increment:
    """The cell is counted up by one."""

    cell: int


@dataclass(frozen=True, slots=True)
class Count:
    """The cell gets what the first case that holds in the state before says: the amount, or that much more
    than ``source``, a cell, no further than 0 and ``most``; and ``shift`` on top. Without one it keeps its
    value."""

    cell: int
    source: int
    cases: tuple[tuple[Expression, Literal["assign", "add"], int], ...]
    most: int
    shift: int = 0

    def assigned(self, amount: int) -> int:
        """What an amount that is assigned comes to."""
        return min(max(amount, 0), self.most) + self.shift


Update: TypeAlias = Choose | Increment | Count


def put(cell: int, number: int) -> Choose:
    """The cell gets the number."""
    return Choose(cell, ((YES, number),))


@dataclass(frozen=True, slots=True)
class Charged:
    """What is added to each reward of the program where ``when`` holds in the state before."""

    when: Expression
    rewards: tuple[Fraction, ...]


@dataclass(frozen=True, slots=True)
class Branch:
    """One thing that may happen: its probability, the cells it changes, and what it adds to each
    reward of the program, always and under conditions."""

    probability: Fraction
    updates: tuple[Update, ...]
    rewards: tuple[Fraction, ...]
    charges: tuple[Charged, ...] = ()


_MOST_TOGETHER = 8
"""Conditions of which it is looked at which may hold together."""


@dataclass(frozen=True, slots=True)
class Command:
    """``action`` is the ground action it starts, None where it starts none; ``remark`` is a comment.
    The probabilities of the branches sum to 1."""

    action: str | None
    guard: Expression
    branches: tuple[Branch, ...]
    remark: str = ""

    def reward(self, number: int) -> Fraction:
        """The expectation over the branches of what is always added to a reward."""
        return sum((b.probability * b.rewards[number] for b in self.branches), Fraction(0))

    def charges(self, number: int) -> dict[Expression, Fraction]:
        """By condition, the expectation over the branches of what is added to a reward where it holds."""
        found: dict[Expression, Fraction] = {}
        for branch in self.branches:
            for charge in branch.charges:
                amount = branch.probability * charge.rewards[number]
                found[charge.when] = found.get(charge.when, Fraction(0)) + amount
        return {when: amount for when, amount in found.items() if amount}

    def least(self, number: int) -> Fraction:
        """What is added to a reward is in no state less than this."""
        below = [(when, amount) for when, amount in self.charges(number).items() if amount < 0]
        if len(below) > _MOST_TOGETHER:
            return self.reward(number) + sum((amount for _, amount in below), Fraction(0))
        sums = [(self.guard, self.reward(number))]
        for when, amount in below:
            more = [(all_of(held, when), total + amount) for held, total in sums]
            sums += [(held, total) for held, total in more if held != NO]
        return min(total for _, total in sums)


REWARDS = ("actions", "cost", "reward")
"""What a program counts, in the order of :attr:`Branch.rewards`: actions started, their cost, and the
task's reward."""

Kind: TypeAlias = Literal["dtmc", "mdp", "pomdp"]


@dataclass(frozen=True, slots=True)
class Program:
    """A Markov chain (dtmc) or decision process (mdp, or pomdp: a policy sees the cells that are
    ``observables``). ``labels`` name sets of states; the one called ``finished``, in a chain, holds those
    that are never left."""

    kind: Kind
    title: str
    cells: tuple[Cell, ...]
    formulas: tuple[Formula, ...]
    commands: tuple[Command, ...]
    labels: tuple[tuple[str, Expression], ...]
    observables: tuple[int, ...] = ()

    def label(self, name: str) -> Expression:
        """The expression of a label. Raises ``KeyError``."""
        return dict(self.labels)[name]

    def roots(self) -> Iterator[Expression]:
        """Every expression that is not part of another, those of the formulas left out."""
        for command in self.commands:
            yield command.guard
            for branch in command.branches:
                yield from (charge.when for charge in branch.charges)
                for update in branch.updates:
                    if isinstance(update, Choose | Count):
                        yield from (case[0] for case in update.cases)
        yield from (expression for _, expression in self.labels)


@dataclass(slots=True)
class Drafting:
    """A program being written: cells and formulas get their numbers here."""

    cells: list[Cell] = field(default_factory=list)
    formulas: list[Formula] = field(default_factory=list)

    def cell(self, cell: Cell) -> int:
        """Add a cell; its number."""
        self.cells.append(cell)
        return len(self.cells) - 1

    def define(self, subject: str, aspect: str, expression: Expression) -> Expression:
        """The expression under a name, or itself if it is an atom."""
        if is_atom(expression):
            return expression
        self.formulas.append(Formula(subject, aspect, expression))
        return Use(len(self.formulas) - 1)


def written_size(program: Program) -> int:
    """How many atoms, and words that join them, the program has with all formulas written out, as the tools
    that read it do."""
    sizes: list[int] = []
    for formula in program.formulas:
        sizes.append(_size(formula.expression, sizes))
    return sum(_size(root, sizes) for root in program.roots())


def _size(expression: Expression, formulas: Sequence[int]) -> int:
    if isinstance(expression, Use):
        return formulas[expression.formula]
    return sum((_size(part, formulas) for part in parts_of(expression)), 1)


def nesting(expressions: Iterable[Expression]) -> int:
    """The levels of the deepest of some expressions, formulas counted as atoms."""
    deepest = 0
    stack = [(expression, 1) for expression in expressions]
    while stack:
        expression, level = stack.pop()
        deepest = max(deepest, level)
        stack.extend((part, level + 1) for part in parts_of(expression))
    return deepest
