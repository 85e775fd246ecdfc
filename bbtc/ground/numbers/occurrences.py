"""What happens to numbers where several changes come together, and what that does to their digits.

All changes of one occurrence read the state before it. Of several values assigned to a number the greatest
stays; what increases and decreases it adds up, on top of what is assigned; then the bounds of its range
apply.

1. Factors that change the same number are one draw: outcomes multiply. So each number is changed by what one
   draw decides, and what is inside that.
2. The changes of an outcome become one, with cases of which at most one is so.
3. Each case becomes effects on digits: digit ``i`` of ``x + c`` is ``x[i] xor c[i] xor carry``, where the
   carry is 1 if what the lower digits say is at least ``2^i - c mod 2^i``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import product

from bbtc.ground.condition import (
    FALSE,
    TRUE,
    Condition,
    Is,
    conjunction,
    disjunction,
    doubt,
    negation,
    within,
)
from bbtc.ground.task import (
    ONE,
    Case,
    Charge,
    Effect,
    Factor,
    NumberChange,
    Outcome,
    merge_outcomes,
    outcomes_of,
)
from bbtc.kleene import Truth

MOST_OUTCOMES = 4_096
"""Outcomes of draws that change the same number, multiplied out."""
MOST_CASES = 16_384
"""Cases of several changes of one number."""


class TooMuch(Exception):
    """More is to be told apart than is reasonable."""


def settled(factors: tuple[Factor, ...], sizes: Mapping[tuple[int, ...], int]) -> tuple[Factor, ...]:
    """Factors of which each number is changed by at most one, and by one change in what happens at once, with
    the effects on digits. ``sizes`` tells how many values each number has. Raises :class:`TooMuch`."""
    found = []
    for group in _groups(factors):
        if len(group) > 1 or any(_nested(outcome) for outcome in group[0].outcomes):
            joint = Factor(merge_outcomes(_flat(group)), any(factor.oneof for factor in group))
            found.append(_with_effects(joint, sizes))
        else:
            found.append(_with_effects(group[0], sizes))
    return tuple(found)


def _groups(factors: Sequence[Factor]) -> list[list[Factor]]:
    """The factors, those together that change a number in common."""
    groups: list[tuple[set[tuple[int, ...]], list[Factor]]] = []
    for factor in factors:
        changed = {change.digits for outcome in outcomes_of([factor]) for change in outcome.changes}
        mine = [factor]
        apart = []
        for others, members in groups:
            if others & changed:
                changed, mine = changed | others, [*members, *mine]
            else:
                apart.append((others, members))
        groups = [*apart, (changed, mine)]
    return [members for _, members in groups]


def _nested(outcome: Outcome) -> bool:
    return any(inner.changes for inner in outcomes_of(outcome.factors))


def _flat(factors: Iterable[Factor]) -> list[Outcome]:
    """What some draws may come to, as outcomes of one."""
    total = [Outcome(ONE, ())]
    for factor in factors:
        single = [
            inner
            for outcome in factor.outcomes
            for inner in (_both(replace(outcome, factors=()), each) for each in _flat(outcome.factors))
        ]
        total = [_both(one, other) for one in total for other in single]
        if len(total) > MOST_OUTCOMES:
            raise TooMuch
    return total


def _both(one: Outcome, other: Outcome) -> Outcome:
    sets: dict[Condition | None, dict[int, Truth]] = {}
    for effect in (*one.effects, *other.effects):
        mine = sets.setdefault(effect.when, {})
        for variable, value in effect.sets:
            mine[variable] = max(value, mine.get(variable, value))
    charges: dict[Condition, tuple[Fraction, Fraction]] = {}
    for charge in (*one.charges, *other.charges):
        cost, reward = charges.get(charge.when, (Fraction(0), Fraction(0)))
        charges[charge.when] = cost + charge.cost, reward + charge.reward
    return Outcome(
        one.probability * other.probability,
        tuple(Effect(when, tuple(sorted(each.items()))) for when, each in sets.items()),
        (*one.factors, *other.factors),
        one.reward + other.reward,
        one.cost + other.cost,
        tuple(Charge(when, *amounts) for when, amounts in charges.items()),
        one.timed_out or other.timed_out,
        (*one.changes, *other.changes),
    )


def _with_effects(factor: Factor, sizes: Mapping[tuple[int, ...], int]) -> Factor:
    return replace(factor, outcomes=merge_outcomes(_outcome(outcome, sizes) for outcome in factor.outcomes))


def _outcome(outcome: Outcome, sizes: Mapping[tuple[int, ...], int]) -> Outcome:
    factors = tuple(_with_effects(factor, sizes) for factor in outcome.factors)
    if not outcome.changes:
        return replace(outcome, factors=factors) if factors else outcome
    by_number: dict[tuple[int, ...], list[NumberChange]] = {}
    for change in outcome.changes:
        by_number.setdefault(change.digits, []).append(change)
    changes = tuple(NumberChange(digits, _together(each)) for digits, each in sorted(by_number.items()))
    return with_digit_effects(replace(outcome, factors=factors, changes=changes), sizes)


def with_digit_effects(outcome: Outcome, sizes: Mapping[tuple[int, ...], int]) -> Outcome:
    """An outcome whose changes do not yet show in its effects, with the effects that they have."""
    effects = [effect for change in outcome.changes for effect in digit_effects(change, sizes[change.digits])]
    merged: dict[Condition | None, dict[int, Truth]] = {}
    for effect in (*outcome.effects, *effects):
        sets = merged.setdefault(effect.when, {})
        for variable, value in effect.sets:
            sets[variable] = max(value, sets.get(variable, value))
    ordered = sorted(merged.items(), key=lambda entry: entry[0] is not None)
    return replace(
        outcome, effects=tuple(Effect(when, tuple(sorted(sets.items()))) for when, sets in ordered)
    )


def _together(changes: list[NumberChange]) -> tuple[Case, ...]:
    """The cases of several changes of one number that come together."""
    if len(changes) == 1:
        return tuple(case for case in changes[0].cases if case.when != FALSE)
    count = 1
    for change in changes:
        count *= len(change.cases) + 1
        if count > MOST_CASES:
            raise TooMuch
    merged: dict[tuple[str, int], list[Condition]] = {}
    for chosen in product(*([*change.cases, None] for change in changes)):
        conditions = []
        for change, case in zip(changes, chosen, strict=True):
            if case is None:
                conditions += [_not_true(each.when) for each in change.cases]
            else:
                conditions.append(TRUE if case.when is None else case.when)
        when = conjunction(conditions)
        assigned = [case.amount for case in chosen if case is not None and case.kind == "assign"]
        added = sum(case.amount for case in chosen if case is not None and case.kind == "add")
        if when == FALSE or (not assigned and not added):
            continue
        made = ("assign", max(assigned) + added) if assigned else ("add", added)
        merged.setdefault(made, []).append(when)
    return tuple(
        Case(
            None if (when := disjunction(parts)) == TRUE else when,
            "assign" if kind == "assign" else "add",
            amount,
        )
        for (kind, amount), parts in merged.items()
    )


def _not_true(when: Condition | None) -> Condition:
    """Where a condition is false or unknown."""
    if when is None:
        return FALSE
    return disjunction([negation(when), doubt(when, lambda variable: Is(variable, Truth.UNKNOWN))])


# --- digits ----------------------------------------------------------------------------------


def digit_effects(change: NumberChange, size: int) -> Iterator[Effect]:
    """What a change does to the digits of a number with so many values."""
    digits = change.digits
    zero = tuple((digit, Truth.FALSE) for digit in digits)
    for case in change.cases:
        when = TRUE if case.when is None else case.when
        if case.kind == "assign":
            value = min(max(case.amount, 0), size - 1)
            yield Effect(case.when, tuple((d, Truth.of(bool(value >> i & 1))) for i, d in enumerate(digits)))
            continue
        if not case.amount:
            continue
        yield Effect(case.when, zero)
        stays = within(digits, -case.amount, size - 1 - case.amount)
        top = (1 << len(digits)) - 1
        if case.amount > 0:
            beyond = within(digits, size - case.amount, top)
            if beyond != FALSE:
                ones = tuple((d, Truth.TRUE) for i, d in enumerate(digits) if size - 1 >> i & 1)
                yield from _guarded(conjunction([when, beyond]), ones)
        else:
            stays = within(digits, -case.amount, top)
        if stays == FALSE:
            continue
        for place, digit in enumerate(digits):
            one = _digit(digits, place, case.amount % (1 << len(digits)))
            yield from _guarded(conjunction([when, stays, one]), ((digit, Truth.TRUE),))


def _guarded(when: Condition, sets: tuple[tuple[int, Truth], ...]) -> Iterator[Effect]:
    if when != FALSE:
        yield Effect(None if when == TRUE else when, sets)


def _digit(digits: tuple[int, ...], place: int, amount: int) -> Condition:
    """Where a digit of the number is 1 once an amount is added, without regard to the range."""
    lower = (1 << place) - 1
    rest = amount & lower
    carry = within(digits[:place], lower + 1 - rest, lower) if rest else FALSE
    own = Is(digits[place], Truth.TRUE)
    flips = carry if not amount >> place & 1 else negation(carry)
    return disjunction([conjunction([own, negation(flips)]), conjunction([negation(own), flips])])


# --- bounds ----------------------------------------------------------------------------------


def stays_within(factors: Iterable[Factor], blocking: Mapping[tuple[int, ...], int]) -> Condition:
    """That no outcome leads a number out of its range: of those in ``blocking``, which tells how many values
    each has."""
    parts: list[Condition] = []
    for outcome in outcomes_of(factors):
        for change in outcome.changes if outcome.probability else ():
            size = blocking.get(change.digits)
            for case in change.cases if size is not None else ():
                assert size is not None
                if case.kind == "assign":
                    inside: Condition = TRUE if 0 <= case.amount < size else FALSE
                elif case.amount > 0:
                    inside = within(change.digits, 0, size - 1 - case.amount)
                else:
                    inside = within(change.digits, -case.amount, (1 << len(change.digits)) - 1)
                parts.append(disjunction([_not_true(case.when), inside]))
    return conjunction(parts)
