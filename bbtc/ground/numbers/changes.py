"""Changes of numbers, made ground: what each does in which case."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction

from typing_extensions import assert_never

from bbtc.diagnostics import Report
from bbtc.ground.condition import (
    FALSE,
    TRUE,
    Condition,
    Within,
    conjunction,
    conjuncts,
    disjunction,
    within,
)
from bbtc.ground.numbers.amounts import (
    FEWER,
    Amounts,
    Env,
    Number,
    Rows,
    TooManyCases,
    Value,
    cases,
    combined,
    too_many,
)
from bbtc.ground.numbers.occurrences import TooMuch, settled, stays_within
from bbtc.ground.task import Case, Factor, NumberChange, outcomes_of
from bbtc.model import effect as me
from bbtc.model.amount import Amount
from bbtc.source import Span


class Changes:
    """The changes of one model."""

    def __init__(self, amounts: Amounts, report: Report) -> None:
        self.amounts = amounts
        self.report = report
        self.sizes: dict[tuple[int, ...], int] = {}
        """How many values each number has that something changes."""
        self.blocking: dict[tuple[int, ...], int] = {}
        """The same, of those that actions may not lead out of their range."""
        self.found: dict[tuple[int, ...], Number] = {}
        """Numbers whose range was found."""

    def depends(self, amount: Amount) -> bool:
        """Does an expression read numbers of the state?"""
        return self.amounts.depends(amount)

    def target(self, function: str, row: tuple[int, ...]) -> Number | None:
        """The number that a change sets; None for one that never changes, or that nothing reads."""
        number = self.amounts.changed(function, row)
        if number is not None:
            self.sizes[number.digits] = number.size
            if number.blocks:
                self.blocking[number.digits] = number.size
            if number.found:
                self.found[number.digits] = number
        return number

    def cases(
        self, amount: Amount, rows: Rows, span: Span | None
    ) -> Callable[[Env], list[tuple[Condition, Fraction]]]:
        """An amount as a function of the environment: its value in each case."""
        lowered = self.amounts.lower(amount, rows)

        def found(env: Env) -> list[tuple[Condition, Fraction]]:
            return [(when, value) for when, value in self.told_apart(lowered(env), span) if value]

        return found

    def told_apart(self, value: Value, span: Span | None) -> list[tuple[Condition, Fraction]]:
        """The value of an expression in each case; cases in which it is the same are one."""
        merged: dict[Fraction, list[Condition]] = {}
        try:
            for when, state in cases(value.reads):
                result = value.of(state)
                if result is None:
                    self.report.error("BBT0410", "division by zero", span)
                    return []
                merged.setdefault(result, []).append(when)
        except TooManyCases:
            self.report.error("BBT0440", too_many("amount"), span, FEWER)
            return []
        return [(disjunction(parts), result) for result, parts in merged.items()]

    def settled(self, factors: tuple[Factor, ...], span: Span | None) -> tuple[Factor, ...]:
        """Factors in which each number is changed once, with what that does to its digits."""
        if not any(outcome.changes for outcome in outcomes_of(factors)):
            return factors
        twice = self._twice(factors)
        if twice is not None:
            message = f"`{twice.name}` is changed by several effects at once, so that its range is not found"
            self.report.error("BBT0440", message, span, "declare its range in `:functions`")
            return ()
        try:
            return settled(factors, self.sizes)
        except TooMuch:
            message = "so many effects change the same number at once that they cannot be told apart"
            self.report.error("BBT0440", message, span, FEWER)
            return ()

    def _twice(self, factors: Iterable[Factor]) -> Number | None:
        """A number whose range was found, and that several changes may change in one occurrence."""
        if not self.found:
            return None
        for digits, number in self.found.items():
            if sum(_most(factor, digits) for factor in factors) > 1:
                return number
        return None

    def kept_within(
        self, conditions: Sequence[Condition], factors: Sequence[tuple[Factor, ...]]
    ) -> list[Condition]:
        """The preconditions of actions that also keep numbers in their ranges."""
        return [
            _narrowed(conjunction([condition, stays_within(each, self.blocking)]))
            for condition, each in zip(conditions, factors, strict=True)
        ]


def _narrowed(condition: Condition) -> Condition:
    """The condition, with what it asks of each number as one test."""
    parts = conjuncts(condition)
    spans: dict[tuple[int, ...], tuple[int, int]] = {}
    for part in parts:
        if isinstance(part, Within):
            low, high = spans.get(part.digits, (0, part.most))
            spans[part.digits] = max(low, part.low), min(high, part.high)
    others = [part for part in parts if not isinstance(part, Within)]
    return conjunction([*others, *(within(digits, *span) for digits, span in spans.items())])


def _most(factor: Factor, digits: tuple[int, ...]) -> int:
    """How many changes of a number come together at most in a draw."""
    return max(
        (
            sum(change.digits == digits for change in outcome.changes)
            + sum(_most(inner, digits) for inner in outcome.factors)
            for outcome in factor.outcomes
        ),
        default=0,
    )


class Changing:
    """A change of a number."""

    def __init__(self, owner: Changes, leaf: me.Change, rows: Rows) -> None:
        self._owner = owner
        self._leaf = leaf
        self._row = rows(leaf.args)
        self._amount = owner.amounts.lower(leaf.amount, rows)

    def digits(self, env: Env) -> tuple[int, ...]:
        """The variables that it may set."""
        number = self._owner.target(self._leaf.function, self._row(env))
        return () if number is None else number.digits

    def read(self, env: Env, *, blocking: bool = False) -> Iterator[Condition]:
        """Conditions that read all that the new value depends on; with ``blocking``, of a number that keeps
        actions from starting only."""
        number = self._owner.target(self._leaf.function, self._row(env))
        if number is None or (blocking and not number.blocks):
            return
        for each in (number, *self._amount(env).reads):
            yield each.between(each.low, each.low)

    def made(self, env: Env, guard: Condition) -> tuple[NumberChange, ...]:
        """The change, where the guard is true; none, if it never matters."""
        number = self._owner.target(self._leaf.function, self._row(env))
        if number is None:
            return ()
        made = [
            Case(
                None if (when := conjunction([guard, each.when or TRUE])) == TRUE else when,
                each.kind,
                each.amount,
            )
            for each in self._cases(number, self._amount(env))
        ]
        found = tuple(case for case in made if case.when != FALSE)
        return (NumberChange(number.digits, found),) if found else ()

    def _cases(self, number: Number, amount: Value) -> Iterator[Case]:
        leaf = self._leaf
        own = Value((number,), lambda state: Fraction(state[number]), {number: Fraction(1)})
        match leaf.operator:
            case "increase" | "decrease":
                sign = 1 if leaf.operator == "increase" else -1
                value, shift = amount, 0
                for when, result in self._owner.told_apart(value, leaf.span):
                    yield self._case(number, when, "add", sign * result)
                return
            case "assign":
                value, shift = amount, number.low
            case "scale-up":
                value, shift = combined("*", (own, amount)), number.low
            case "scale-down":
                value, shift = combined("/", (own, amount)), number.low
            case _:
                assert_never(leaf.operator)
        for when, result in self._owner.told_apart(value, leaf.span):
            yield self._case(number, when, "assign", result - shift)

    def _case(self, number: Number, when: Condition, kind: str, result: Fraction) -> Case:
        if result.denominator != 1:
            what = f"`{self._leaf.operator} {number.name}` leads to a value that is no whole number"
            self._owner.report.error("BBT0440", what, self._leaf.span, "count in a smaller unit")
        return Case(None if when == TRUE else when, "add" if kind == "add" else "assign", int(result))
