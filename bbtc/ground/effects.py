"""Lifted effects made ground: the factors of an action."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from typing_extensions import assert_never

from bbtc.diagnostics import Report
from bbtc.ground.atoms import Atoms, Binding
from bbtc.ground.condition import FALSE, TRUE, Condition
from bbtc.ground.normal import Block, Chance
from bbtc.ground.task import Effect, Factor, Outcome
from bbtc.kleene import Truth
from bbtc.model import effect as me

ZERO = Fraction(0)
ONE = Fraction(1)


@dataclass(slots=True)
class _Part:
    """What happens at once: settings by guard, what is added, and further draws."""

    sets: dict[Condition, dict[int, Truth]] = field(default_factory=dict)
    cost: Fraction = ZERO
    reward: Fraction = ZERO
    factors: list[Factor] = field(default_factory=list)

    def effects(self) -> tuple[Effect, ...]:
        """The settings as effects, unconditional ones first, in order of variables."""
        ordered = sorted(self.sets.items(), key=lambda entry: entry[0] != TRUE)
        return tuple(
            Effect(None if guard == TRUE else guard, tuple(sorted(sets.items()))) for guard, sets in ordered
        )


class EffectGrounder:
    """Grounds the effects of one model. ``guide`` effects of templates give no costs."""

    def __init__(self, atoms: Atoms, report: Report) -> None:
        self.atoms = atoms
        self.report = report

    def factors(self, block: Block, binding: Binding) -> tuple[tuple[Factor, ...], Fraction]:
        """Independent factors, and the cost that is certain.

        What is certain joins the outcomes of a single factor; beside several it is a factor of its
        own with probability 1.
        """
        part = self._part(block, binding)
        cost, part.cost = part.cost, ZERO
        return _arranged(part), cost

    def _part(self, block: Block, binding: Binding) -> _Part:
        part = _Part()
        for item in block.items:
            for each in self.atoms.bindings(item.parameters, binding):
                guard: Condition = TRUE
                if item.guard is not None:
                    guard = self.atoms.condition(item.guard, each, strict=True)
                if guard != FALSE:
                    self._leaf(part, item.leaf, each, guard)
        for chance in block.chances:
            for each in self.atoms.bindings(chance.parameters, binding):
                factor = self._chance(chance, each)
                if len(factor.outcomes) > 1:
                    part.factors.append(factor)
                else:
                    _absorb(part, factor.outcomes[0])
        return part

    def _leaf(self, part: _Part, leaf: me.Set | me.Add, binding: Binding, guard: Condition) -> None:
        match leaf:
            case me.Set(predicate, args, value):
                number = self.atoms.numbers.get(predicate, {}).get(self.atoms.row(args, binding))
                if number is not None:
                    _put(part.sets.setdefault(guard, {}), number, value)
            case me.Add(to, amount, sign, span):
                if guard != TRUE:
                    self.report.error(
                        "BBT0409",
                        f"a {to} that depends on a condition cannot be grounded",
                        span,
                        "write one action for each case",
                    )
                elif to == "cost":
                    part.cost += sign * self.amount(amount, binding)
                else:
                    part.reward += sign * self.amount(amount, binding)
            case _:
                assert_never(leaf)

    def _chance(self, chance: Chance, binding: Binding) -> Factor:
        """One draw. A draw nested in a branch as its only one is multiplied in (a sum of outcomes);
        several, or a mixture of known and unknown probabilities, stay nested."""
        outcomes: list[Outcome] = []
        for probability, block in chance.branches:
            part = self._part(block, binding)
            if len(part.factors) == 1 and part.factors[0].oneof == chance.oneof:
                (inner,) = part.factors
                for outcome in inner.outcomes:
                    joined = _join(part, outcome)
                    outcomes.append(_scaled(joined, probability))
            else:
                factors = tuple(part.factors)
                outcomes.append(Outcome(probability, part.effects(), factors, part.reward, part.cost))
        return _factor(outcomes, chance.oneof)

    def amount(self, amount: me.Amount, binding: Binding) -> Fraction:
        """The value of a number that no action changes. A missing one is reported and counts 0."""
        match amount:
            case me.Constant(value):
                return value
            case me.FunctionValue(function, args, span):
                names = tuple(self.atoms.names[index] for index in self.atoms.row(args, binding))
                found = self.atoms.model.init.numbers.get((function, names))
                if found is None:
                    shown = " ".join((function, *names))
                    self.report.error("BBT0410", f"`:init` gives no value for `({shown})`", span)
                    return ZERO
                return found
            case me.Arithmetic(operator, operands, span):
                values = [self.amount(operand, binding) for operand in operands]
                if operator == "/" and ZERO in values[1:]:
                    self.report.error("BBT0410", "division by zero", span)
                    return ZERO
                return _compute(operator, values)
            case _:
                assert_never(amount)


def _arranged(part: _Part) -> tuple[Factor, ...]:
    certain = part.effects()
    if len(part.factors) == 1:
        only = part.factors[0]
        return (_factor([_join(part, outcome) for outcome in only.outcomes], only.oneof),)
    plain = Outcome(ONE, certain, (), part.reward, part.cost)
    own = (Factor((plain,)),) if certain or part.reward or part.cost else ()
    return (*own, *part.factors)


def arrange(factors: Iterable[Factor]) -> tuple[Factor, ...]:
    """Factors in canonical form: what is certain joins the outcomes of a single chance, or stands
    first as a factor of its own; factors that do nothing are gone."""
    part = _Part()
    for factor in factors:
        if len(factor.outcomes) > 1:
            part.factors.append(factor)
        else:
            _absorb(part, factor.outcomes[0])
    return _arranged(part)


def _compute(operator: str, values: Sequence[Fraction]) -> Fraction:
    first, rest = values[0], values[1:]
    if operator == "-" and not rest:
        return -first
    for value in rest:
        match operator:
            case "+":
                first += value
            case "-":
                first -= value
            case "*":
                first *= value
            case _:
                first /= value
    return first


def _put(sets: dict[int, Truth], number: int, value: Truth) -> None:
    """Where one occurrence sets a variable twice, the Kleene maximum wins."""
    sets[number] = max(sets.get(number, value), value)


def _absorb(part: _Part, outcome: Outcome) -> None:
    for effect in outcome.effects:
        sets = part.sets.setdefault(TRUE if effect.when is None else effect.when, {})
        for number, value in effect.sets:
            _put(sets, number, value)
    part.cost += outcome.cost
    part.reward += outcome.reward
    part.factors.extend(outcome.factors)


def _join(part: _Part, outcome: Outcome) -> Outcome:
    """The outcome with everything that is certain beside it."""
    both = _Part({guard: dict(sets) for guard, sets in part.sets.items()}, part.cost, part.reward)
    _absorb(both, outcome)
    return Outcome(outcome.probability, both.effects(), tuple(both.factors), both.reward, both.cost)


def _scaled(outcome: Outcome, by: Fraction) -> Outcome:
    return Outcome(outcome.probability * by, outcome.effects, outcome.factors, outcome.reward, outcome.cost)


def _factor(outcomes: Iterable[Outcome], oneof: bool) -> Factor:
    return Factor(merge_outcomes(outcomes), oneof)


def merge_outcomes(outcomes: Iterable[Outcome]) -> tuple[Outcome, ...]:
    """Outcomes that do the same made one, with the sum of their probabilities."""
    merged: dict[tuple[object, ...], Outcome] = {}
    for outcome in outcomes:
        key = (outcome.effects, outcome.factors, outcome.reward, outcome.cost)
        before = merged.get(key)
        if before is not None:
            total = before.probability + outcome.probability
            merged[key] = replace(before, probability=total)
        else:
            merged[key] = outcome
    return tuple(merged.values())
