"""Lifted effects made ground: the factors of an action.

What stands in a block (:mod:`bbtc.ground.normal`) becomes independent factors by these rules, ``chance``
being ``probabilistic`` or ``oneof``:

1. ``(forall (?x) (e ?x))`` → ``(and (e a) (e b))``, with all objects of the type of ``?x``
2. ``(when true e)`` → ``e``, and ``(when false e)`` → ``(and)``
3. ``(when f (chance p d q e))`` → ``(chance p (when f d) q (when f e))``
4. ``(and (not p) (unknown p) p)`` → ``p``: what one occurrence sets a variable to is the Kleene maximum
5. ``(chance p (chance r d s e) q c)`` → ``(chance p·r d p·s e q c)``, if the two chances are of one kind
   and the inner one is the only one of its branch
6. ``(chance p e q e)`` → ``(chance p+q e)``
7. ``(chance 1 e)`` → ``e``
8. ``(and c (chance p d q e))`` → ``(chance p (and c d) q (and c e))``, if there is no other chance; beside
   several chances, what is certain is a factor of its own, which stands first
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import repeat

from typing_extensions import assert_never

from bbtc import durations
from bbtc.diagnostics import Report
from bbtc.durations import Duration, Empirical
from bbtc.ground.condition import TRUE, Condition, conjunction
from bbtc.ground.loops import Loop
from bbtc.ground.lower import Env, Frame, Lowering, conjoin, projection
from bbtc.ground.normal import Block, Chance, groups, reads
from bbtc.ground.numbers.changes import Changes, Changing
from bbtc.ground.reachability.atoms import Atoms
from bbtc.ground.reachability.bulk import Shared
from bbtc.ground.settings import Numbers, Settings, certain, drawn
from bbtc.ground.task import (
    ONE,
    ZERO,
    Charge,
    Effect,
    Factor,
    NumberChange,
    Outcome,
    merge_outcomes,
    outcomes_of,
)
from bbtc.ground.universe import Row
from bbtc.kleene import Truth
from bbtc.model import effect as me
from bbtc.model.types import Parameter
from bbtc.rounding import too_long
from bbtc.source import Span


@dataclass(slots=True)
class _Part:
    """What happens at once: settings by guard, what is added (cost, reward), always and by guard, and
    further draws."""

    sets: dict[Condition, dict[int, Truth]] = field(default_factory=dict)
    cost: Fraction = ZERO
    reward: Fraction = ZERO
    charges: dict[Condition, tuple[Fraction, Fraction]] = field(default_factory=dict)
    factors: list[Factor] = field(default_factory=list)
    changes: list[NumberChange] = field(default_factory=list)

    def __bool__(self) -> bool:
        """Does anything happen, further draws aside?"""
        return bool(self.sets or self.cost or self.reward or self.charges or self.changes)

    def add(self, guard: Condition, cost: Fraction, reward: Fraction) -> None:
        """Add to cost and reward where the guard is true."""
        if guard is TRUE:
            self.cost, self.reward = self.cost + cost, self.reward + reward
            return
        before = self.charges.pop(guard, (ZERO, ZERO))
        both = before[0] + cost, before[1] + reward
        if any(both):
            self.charges[guard] = both

    def draw(self, factors: Iterable[Factor]) -> None:
        """Draw further factors; what is certain of them is no draw (rule 7), unless it is a time-out."""
        for factor in factors:
            if len(factor.outcomes) > 1 or factor.outcomes[0].timed_out:
                self.factors.append(factor)
            else:
                _absorb(self, factor.outcomes[0])

    def outcome(self, probability: Fraction, factors: tuple[Factor, ...]) -> Outcome:
        """All of it as one outcome, with further draws."""
        charges = tuple(Charge(guard, cost, reward) for guard, (cost, reward) in self.charges.items())
        changes = tuple(self.changes)
        return Outcome(probability, self.effects(), factors, self.reward, self.cost, charges, changes=changes)

    def effects(self) -> tuple[Effect, ...]:
        """The settings as effects, unconditional ones first, in order of variables."""
        ordered = sorted(self.sets.items(), key=lambda entry: entry[0] is not TRUE)
        return tuple(
            Effect(None if guard is TRUE else guard, tuple(sorted(sets.items()))) for guard, sets in ordered
        )


# --- compiled effects ----------------------------------------------------------------------------


class EffectLowering:
    """Compiles the effects of one model."""

    def __init__(self, lowering: Lowering, report: Report) -> None:
        self.lowering = lowering
        self.atoms: Atoms = lowering.atoms
        self.report = report
        self.changes = Changes(lowering.amounts, report)

    def reached(
        self, block: Block, parameters: tuple[Parameter, ...], span: Span | None
    ) -> Shared[tuple[tuple[Factor, ...], Fraction]]:
        """:meth:`LoweredEffect.factors` for many argument rows of an action."""
        used, frame = projection(self.lowering.universe, parameters, reads(block))
        return Shared(used, len(parameters), self.effect(block, frame, span).all)

    def effect(self, block: Block, frame: Frame, span: Span | None) -> LoweredEffect:
        """The effect of an action or of a template's guide, which stands at ``span``."""
        return LoweredEffect(self, block, frame, span)

    def short(self, value: Fraction, span: Span | None) -> Fraction:
        """A computed number; one that no artefact could hold is reported and counts 0."""
        if too_long(value):
            what = "a probability, cost or reward"
            self.report.error("BBT0113", f"{what} that is computed here has too many digits", span)
            return ZERO
        return value


class LoweredEffect:
    """A compiled block."""

    def __init__(self, owner: EffectLowering, block: Block, frame: Frame, span: Span | None = None) -> None:
        self._owner = owner
        self._span = span
        self._frame = frame
        self._costs: list[_Addition] = []
        self._groups: list[tuple[Loop, list[_Leaf]]] = []
        lowering = owner.lowering
        always: list[me.Set] = []
        for group in groups(block):
            loop = Loop(lowering, frame, group.parameters, group.guard)
            leaves: list[_Leaf] = []
            for leaf in group.leaves:
                match leaf:
                    case me.Set() if loop.trivial:
                        always.append(leaf)
                    case me.Set(predicate, args, value):
                        leaves.append(_Setting(lowering.number(predicate, args, frame), value))
                    case me.Add(to="cost") if loop.trivial and not owner.changes.depends(leaf.amount):
                        self._costs.append(_Addition(owner, leaf, frame))
                    case me.Add():
                        leaves.append(_Addition(owner, leaf, frame))
                    case me.Change():
                        leaves.append(Changing(owner.changes, leaf, frame.rows))
                    case _:
                        assert_never(leaf)
            if leaves:
                self._groups.append((loop, leaves))
        self._always = Settings(lowering, always, frame)
        self._chances = [_LoweredChance(owner, chance, frame) for chance in block.chances]
        self._draw = (
            None if self._groups or len(block.chances) != 1 else self._plain_draw(owner, block, always)
        )

    def _plain_draw(self, owner: EffectLowering, block: Block, always: list[me.Set]) -> _Draw | None:
        """The only chance, if its branches do nothing but set variables."""
        (chance,) = block.chances
        if chance.parameters or chance.guard or chance.timeout is not None:
            return None
        branches = []
        for probability, branch in chance.branches:
            leaves = [item.leaf for item in branch.items if not item.parameters and not item.guard]
            sets = [leaf for leaf in leaves if isinstance(leaf, me.Set)]
            if branch.chances or len(sets) < len(branch.items):
                return None
            branches.append((probability, Settings(owner.lowering, [*always, *sets], self._frame)))
        return _Draw(branches, chance.oneof)

    @property
    def plain(self) -> list[Numbers] | None:
        """The variables set by an effect without quantifiers and guards; None for others."""
        if self._draw is not None:
            return [numbers for _, settings in self._draw.branches for numbers in settings.columns()]
        return None if self._groups or self._chances else self._always.columns()

    def factors(self, env: Env) -> tuple[tuple[Factor, ...], Fraction]:
        """Independent factors, and the cost that is certain.

        What is certain joins the outcomes of a single factor; beside several it is a factor of its
        own with probability 1.
        """
        part = self.part(env, [])
        cost, part.cost = part.cost, ZERO
        factors = self._owner.changes.settled(_arranged(part), self._span)
        for outcome in outcomes_of(factors):
            charged = (number for charge in outcome.charges for number in (charge.cost, charge.reward))
            for number in (outcome.probability, outcome.cost, outcome.reward, *charged):
                self._owner.short(number, self._span)
        return factors, self._owner.short(cost, self._span)

    def all(self, rows: list[Row]) -> list[tuple[tuple[Factor, ...], Fraction]]:
        """:meth:`factors` of many argument rows."""
        if self._groups or (self._chances and self._draw is None):
            return [self.factors(self._frame.env(row)) for row in rows]
        if self._draw is None:
            made = certain(self._always.all(rows))
        else:
            sets = [(probability, settings.all(rows)) for probability, settings in self._draw.branches]
            made = [
                self.factors(self._frame.env(row))[0] if factors is None else factors
                for row, factors in zip(rows, drawn(sets, oneof=self._draw.oneof), strict=True)
            ]
        costs = [self._cost(self._frame.env(row)) for row in rows] if self._costs else repeat(ZERO, len(rows))
        return list(zip(made, costs, strict=True))

    def _cost(self, env: Env) -> Fraction:
        cost = self._costs[0].amount(env)
        for each in self._costs[1:]:
            cost = self._owner.short(cost + each.amount(env), self._span)
        return cost

    def settings(self, env: Env, above: list[Condition]) -> Iterator[tuple[int, list[Condition]]]:
        """Every variable that may be set, with the conditions under which it is."""
        for always in self._always.numbers(env):
            yield always, above
        for loop, leaves in self._groups:
            setters = [leaf for leaf in leaves if isinstance(leaf, _Setting | Changing)]
            for conditions in loop.guards(env, above):
                for leaf in setters:
                    if isinstance(leaf, Changing):
                        more = [*conditions, *leaf.read(env)]
                        yield from ((digit, more) for digit in leaf.digits(env))
                        continue
                    number = leaf.number(env)
                    if number is not None:
                        yield number, conditions
        for chance in self._chances:
            yield from chance.settings(env, above)

    def charged(self, env: Env, above: list[Condition]) -> Iterator[list[Condition]]:
        """The conditions under which something is added to cost or reward, or that keep the action from
        starting since a number would leave its range."""
        if self._costs and above:
            yield above
        for loop, leaves in self._groups:
            if any(isinstance(leaf, _Addition | Changing) for leaf in leaves):
                for conditions in loop.guards(env, above):
                    read = [
                        part
                        for leaf in leaves
                        for part in (
                            leaf.read(env, blocking=True)
                            if isinstance(leaf, Changing)
                            else leaf.read(env)
                            if isinstance(leaf, _Addition)
                            else ()
                        )
                    ]
                    yield [*conditions, *read]
        for chance in self._chances:
            yield from chance.charged(env, above)

    def part(self, env: Env, above: list[Condition]) -> _Part:
        """What happens in an environment, under the conditions above."""
        part = _Part()
        for addition in self._costs:
            addition.run(part, env, conjoin(above))
        sets = self._always.values(env)
        if sets:
            part.sets[conjoin(above)] = sets
        for loop, leaves in self._groups:
            for conditions in loop.guards(env, above):
                guard = conjoin(conditions)
                for leaf in leaves:
                    if isinstance(leaf, Changing):
                        part.changes += leaf.made(env, guard)
                    else:
                        leaf.run(part, env, guard)
        for chance in self._chances:
            part.draw(chance.factors(env, above))
        return part


@dataclass(frozen=True, slots=True)
class _Draw:
    """A chance whose branches only set variables: what each sets, with what is certain."""

    branches: list[tuple[Fraction, Settings]]
    oneof: bool


@dataclass(frozen=True, slots=True)
class _Setting:
    number: Callable[[Env], int | None]
    value: Truth

    def run(self, part: _Part, env: Env, guard: Condition) -> None:
        number = self.number(env)
        if number is not None:
            _put(part.sets.setdefault(guard, {}), number, self.value)


class _Addition:
    """An increase of cost or reward."""

    def __init__(self, owner: EffectLowering, leaf: me.Add, frame: Frame) -> None:
        self._owner = owner
        self._leaf = leaf
        self._depends = owner.changes.depends(leaf.amount)
        self._value = None if self._depends else _Amounts(owner, frame).lower(leaf.amount)
        self._cases = owner.changes.cases(leaf.amount, frame.rows, leaf.span) if self._depends else None

    def amount(self, env: Env) -> Fraction:
        """What is added, with its sign; for one that depends on no number of the state."""
        assert self._value is not None
        value = self._value(env)
        return value if self._leaf.sign == 1 else self._leaf.sign * value

    def read(self, env: Env) -> Iterator[Condition]:
        """Conditions that read all numbers which the amount depends on."""
        return iter(()) if self._cases is None else (condition for condition, _ in self._cases(env))

    def run(self, part: _Part, env: Env, guard: Condition) -> None:
        """Count it where the guard is true."""
        if self._cases is None:
            self._count(part, guard, self.amount(env))
            return
        for condition, value in self._cases(env):
            self._count(part, conjunction([guard, condition]), self._leaf.sign * value)

    def _count(self, part: _Part, guard: Condition, value: Fraction) -> None:
        leaf, amount = self._leaf, self._owner.short(value, self._leaf.span)
        part.add(guard, *((amount, ZERO) if leaf.to == "cost" else (ZERO, amount)))
        for total in (part.cost, part.reward, *part.charges.get(guard, ())):
            self._owner.short(total, leaf.span)


_Leaf = _Setting | _Addition | Changing


class _LoweredChance:
    """A compiled chance."""

    def __init__(self, owner: EffectLowering, chance: Chance, frame: Frame) -> None:
        self._loop = Loop(owner.lowering, frame, chance.parameters, chance.guard)
        self._branches = [(p, LoweredEffect(owner, block, frame)) for p, block in chance.branches]
        self._oneof = chance.oneof
        self._timeout = None if chance.timeout is None else LoweredTimeOut(owner, chance.timeout, frame)

    def settings(self, env: Env, above: list[Condition]) -> Iterator[tuple[int, list[Condition]]]:
        """Every variable that some branch may set, with the conditions under which it does."""
        for conditions in self._loop.guards(env, above):
            for _, branch in self._branches:
                yield from branch.settings(env, conditions)

    def charged(self, env: Env, above: list[Condition]) -> Iterator[list[Condition]]:
        """The conditions under which some branch adds to cost or reward."""
        for conditions in self._loop.guards(env, above):
            for _, branch in self._branches:
                yield from branch.charged(env, conditions)

    def factors(self, env: Env, above: list[Condition]) -> Iterator[Factor]:
        """One draw for every binding."""
        for conditions in self._loop.guards(env, above):
            outcomes: list[Outcome] = []
            for probability, branch in self._branches if self._timeout is None else self._given_up(env):
                part = branch.part(env, conditions)  # 3
                if len(part.factors) == 1 and part.factors[0].oneof == self._oneof:  # 5
                    for inner in part.factors[0].outcomes:
                        joined = _join(part, inner)
                        outcomes.append(replace(joined, probability=joined.probability * probability))
                else:
                    outcomes.append(part.outcome(probability, tuple(part.factors)))
                if self._timeout is not None and branch is self._branches[0][1]:
                    outcomes = [replace(each, timed_out=True) for each in outcomes]
            yield Factor(merge_outcomes(outcomes), self._oneof)

    def _given_up(self, env: Env) -> list[tuple[Fraction, LoweredEffect]]:
        """The branches of a time-out that can be, with their probabilities."""
        assert self._timeout is not None
        late = self._timeout.probability(env)
        both = zip((late, 1 - late), self._branches, strict=True)
        return [(probability, branch) for probability, (_, branch) in both if probability]


# --- numbers -------------------------------------------------------------------------------------


class LoweredDuration:
    """A compiled duration. What makes no sense is reported, and takes no time."""

    def __init__(self, owner: EffectLowering, duration: me.LiftedDuration, frame: Frame) -> None:
        self._owner = owner
        self._duration = duration
        self._amounts = [_Amounts(owner, frame).lower(amount) for amount in duration.amounts]

    def of(self, env: Env) -> Duration:
        """The duration in an environment."""
        found = me.duration_of(self._duration, [each(env) for each in self._amounts])
        wrong = durations.problem(found)
        if wrong is not None:
            self._owner.report.error("BBT0443", wrong, self._duration.span)
            return durations.INSTANT
        return durations.plain(durations.empirical(found.points) if isinstance(found, Empirical) else found)


class LoweredTimeOut:
    """A compiled time-out."""

    def __init__(self, owner: EffectLowering, timeout: me.TimeOut, frame: Frame) -> None:
        self._owner = owner
        self._timeout = timeout
        self._amount = _Amounts(owner, frame).lower(timeout.seconds)
        self._duration = None if timeout.duration is None else LoweredDuration(owner, timeout.duration, frame)

    def seconds(self, env: Env) -> Fraction:
        """After so many seconds the action is given up."""
        seconds = self._amount(env)
        if not 0 < seconds <= durations.LONGEST:
            wrong = "is not above 0" if seconds <= 0 else "is too long"
            self._owner.report.error("BBT0444", f"a time-out {wrong}", self._timeout.span)
            return ONE
        return seconds

    def probability(self, env: Env) -> Fraction:
        """How probably it comes to that."""
        if self._duration is None:
            return ZERO if self._timeout.probability is None else self._timeout.probability
        return durations.exceeding(self._duration.of(env), self.seconds(env))


class _Amounts:
    """Compiles numbers that no action changes. A missing one is reported and counts 0."""

    def __init__(self, owner: EffectLowering, frame: Frame) -> None:
        self._owner = owner
        self._frame = frame

    def lower(self, amount: me.Amount) -> Callable[[Env], Fraction]:
        """The number as a function of the environment."""
        match amount:
            case me.Constant(value):
                return lambda _env: value
            case me.FunctionValue():
                return self._value(amount)
            case me.Arithmetic(operator, operands):
                lowered = [self.lower(operand) for operand in operands]
                return lambda env: self._compute(amount, operator, [each(env) for each in lowered])
            case _:
                assert_never(amount)

    def _value(self, amount: me.FunctionValue) -> Callable[[Env], Fraction]:
        universe, numbers = self._owner.atoms.universe, self._owner.atoms.model.init.numbers
        rows = self._frame.rows(amount.args)
        if self._owner.changes.depends(amount):
            message = f"`{amount.function}` changes, and what is worked out here may not"
            self._owner.report.error("BBT0440", message, amount.span)

        def value(env: Env) -> Fraction:
            args = universe.args(rows(env))
            found = numbers.get((amount.function, args))
            if found is None:
                shown = " ".join((amount.function, *args))
                self._owner.report.error("BBT0410", f"`:init` gives no value for `({shown})`", amount.span)
                return ZERO
            return found

        return value

    def _compute(self, amount: me.Arithmetic, operator: str, values: Sequence[Fraction]) -> Fraction:
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
                case _ if value:
                    first /= value
                case _:
                    self._owner.report.error("BBT0410", "division by zero", amount.span)
            first = self._owner.short(first, amount.span)
        return first


# --- putting together ----------------------------------------------------------------------------


def _put(sets: dict[int, Truth], number: int, value: Truth) -> None:
    """Set a variable, maybe once more (rule 4)."""
    sets[number] = max(sets.get(number, value), value)


def _absorb(part: _Part, outcome: Outcome) -> None:
    for effect in outcome.effects:
        sets = part.sets.setdefault(TRUE if effect.when is None else effect.when, {})
        for number, value in effect.sets:
            _put(sets, number, value)
    part.add(TRUE, outcome.cost, outcome.reward)
    for charge in outcome.charges:
        part.add(charge.when, charge.cost, charge.reward)
    part.factors.extend(outcome.factors)
    part.changes.extend(outcome.changes)


def _join(part: _Part, outcome: Outcome) -> Outcome:
    """The outcome with everything that is certain beside it (rule 8)."""
    sets = {guard: dict(sets) for guard, sets in part.sets.items()}
    both = _Part(sets, part.cost, part.reward, dict(part.charges), changes=list(part.changes))
    _absorb(both, outcome)
    return replace(both.outcome(outcome.probability, tuple(both.factors)), timed_out=outcome.timed_out)


def _arranged(part: _Part) -> tuple[Factor, ...]:
    if len(part.factors) == 1:
        only = part.factors[0]
        if not part:
            return (only,)
        joined = merge_outcomes(_join(part, outcome) for outcome in only.outcomes)
        # With what is certain (rule 8), all branches may come to the same.
        return (Factor(joined, only.oneof),) if len(joined) > 1 else arrange([Factor(joined)])
    own = (Factor((part.outcome(ONE, ()),)),) if part else ()
    return (*own, *part.factors)


def arrange(factors: Iterable[Factor]) -> tuple[Factor, ...]:
    """Factors in canonical form (rules 7 and 8); those that do nothing are gone."""
    part = _Part()
    part.draw(factors)
    return _arranged(part)
