"""The actions of a task as tables over packed states: which apply, and what they lead to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from bbtc.belief.draws import Values
from bbtc.belief.state import Transition, compile_action
from bbtc.ground.condition import Condition
from bbtc.ground.task import NO_CHANGE, ZERO, Charge, Effect, Factor, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.packing import (
    WORD,
    BitTest,
    Cube,
    Flags,
    Packing,
    Words,
    bit_test,
    cubes,
    every,
    holds,
    set_bits,
)
from bbtc.planner.mdp.passing import Passing, Step

Index: TypeAlias = npt.NDArray[np.int64]

MOST_OUTCOMES = 128
"""Joint outcomes of one action; above, results are merged factor by factor."""

MOST_CUBES = 32
"""Disjuncts of one condition; above, it is evaluated state by state."""
_FEW_CELLS = 1 << 16  # states times preconditions that are tried one with each other


@dataclass(frozen=True, slots=True)
class Draw:
    """An outcome that may happen, as figures: probability, what it adds to the action's cost
    (the action's own included), and reward."""

    probability: Fraction
    cost: Fraction
    reward: Fraction


_Joint: TypeAlias = tuple[frozenset[Effect], Fraction, Fraction, tuple[Charge, ...]]
"""Effects, cost, reward, and what is added to both under conditions."""


@dataclass(slots=True)
class _Masks:
    """Bits to clear, and bits to set once cleared, of one set of assignments. ``kill`` are the
    unknown bits of variables set to true: true wins over unknown."""

    clear: int = 0
    true: int = 0
    unknown: int = 0
    kill: int = 0

    @classmethod
    def of(cls, packing: Packing, sets: Iterable[tuple[int, Truth]]) -> _Masks:
        masks = cls()
        for variable, value in sets:
            bits = packing.bits(variable)
            masks.clear |= bits
            if value is Truth.TRUE:
                masks.true |= 1 << variable
                masks.kill |= bits & ~(1 << variable)
            elif value is Truth.UNKNOWN:
                masks.unknown |= packing.assigned(variable, value)
        return masks


@dataclass(slots=True)
class ActionTables:
    """All actions, and behind them the steps of stages. ``draws`` grows when actions with very many outcomes,
    or with costs or rewards under conditions, are expanded."""

    task: Task
    limits: Limits
    packing: Packing = field(init=False)
    draws: list[Draw] = field(default_factory=list)

    # Applicability: rows of cubes, ordered by action; other preconditions one by one.
    pre_action: Index = field(init=False)
    pre_mask: Words = field(init=False)
    pre_value: Words = field(init=False)
    repeats: bool = field(init=False, default=False)
    _literal: Index = field(init=False)
    _literal_first: Index = field(init=False)
    general: list[tuple[int, BitTest]] = field(init=False, default_factory=list)

    # Outcomes: rows ordered by action, numbered as `draws`; guarded parts in rows of their own.
    first: Index = field(init=False)
    count: Index = field(init=False)
    masks: tuple[Words, Words, Words, Words] = field(init=False)
    keep: Words = field(init=False)
    set: Words = field(init=False)
    guard_first: Index = field(init=False)
    guard_count: Index = field(init=False)
    guard_mask: Words = field(init=False)
    guard_value: Words = field(init=False)
    guard_masks: tuple[Words, Words, Words, Words] = field(init=False)
    by_reference: dict[int, Transition] = field(init=False, default_factory=dict)
    """Actions with too many joint outcomes, or that change what is believed, as the simulator runs them."""
    levels: int = field(init=False, default=1)
    """So many steps lead from one decision to the next, at most."""
    _steps: tuple[Step, ...] = field(init=False)
    _whole: bool = field(init=False)
    """Are there events, but no stages?"""
    _charges: dict[int, tuple[tuple[BitTest, Charge], ...]] = field(init=False, default_factory=dict)
    """By outcome: what it adds to cost and reward under conditions."""
    _draw_index: dict[tuple[tuple[int, int], ...], int] = field(init=False, default_factory=dict)
    """By the figures as ratios, whose hashes take little time."""

    @property
    def count_steps(self) -> int:
        """How many actions there are, and steps of stages behind them."""
        return len(self._steps)

    def __post_init__(self) -> None:
        passing = Passing.of(self.task)
        if passing is None or not self._compile(passing):
            self.draws.clear()
            self._charges.clear()
            self.general.clear()
            self._compile(None)

    def _compile(self, passing: Passing | None) -> bool:
        """Fill the tables; without stages, actions are run with the events by the simulator. False where a
        step of a stage has too many outcomes."""
        self._whole = passing is None
        stages = passing or Passing.none(self.task)
        actions = [
            Step(
                0,
                action.precondition,
                (NO_CHANGE,) if number in stages.interrupted else action.factors,
                after,
            )
            for number, (action, after) in enumerate(zip(self.task.actions, stages.after, strict=True))
        ]
        self._steps = (*actions, *stages.steps)
        self.packing = Packing.of(self.task, stages.bits)
        self.levels = stages.levels
        self._compile_preconditions()
        return self._compile_outcomes()

    def _compile_preconditions(self) -> None:
        rows: list[tuple[int, Cube]] = []
        for number, step in enumerate(self._steps):
            test = bit_test(self.packing, step.precondition)
            if self.packing.stage_bits:
                test = every((self.packing.in_stage(step.stage), test))
            found = cubes(test, MOST_CUBES)
            if found is None:
                self.general.append((number, test))
            else:
                rows.extend((number, cube) for cube in found)
                self.repeats = self.repeats or len(found) > 1
        self.pre_action = np.array([number for number, _ in rows], dtype=np.int64)
        self.pre_mask = self.packing.split(cube.mask for _, cube in rows)
        self.pre_value = self.packing.split(cube.value for _, cube in rows)
        # The literals of each row as numbers: bit b clear is b, bit b set is b behind all of those, and
        # an empty condition has a literal of its own, which always holds.
        width = self.packing.words * WORD
        literals: list[int] = []
        firsts: list[int] = []
        for _, cube in rows:
            firsts.append(len(literals))
            numbers = [bit + width * (cube.value >> bit & 1) for bit in set_bits(cube.mask)]
            literals.extend(numbers or [2 * width])
        self._literal = np.array(literals, dtype=np.int64)
        self._literal_first = np.array(firsts, dtype=np.int64)

    def _compile_outcomes(self) -> bool:
        base: list[_Masks] = []
        guards: list[list[tuple[Cube, _Masks]]] = []
        first, count = [], []
        for number, step in enumerate(self._steps):
            action = self.task.actions[number] if number < len(self.task.actions) else None
            first.append(len(base))
            joint = None if action and (action.changes or self._whole) else _joint(step.factors)
            rows = None if joint is None else [self._outcome(effects) for effects, *_ in joint]
            if joint is None or rows is None or any(row is None for row in rows):
                if action is None:
                    return False
                self.by_reference[number] = compile_action(self.task, action, self.limits)
                count.append(0)
                continue
            stage = self.packing.in_stage(step.after)
            own = ZERO if action is None else action.cost
            for row, ((_, cost, reward, charges), probability) in zip(rows, joint.items(), strict=True):
                assert row is not None
                if charges:
                    tests = tuple((bit_test(self.packing, charge.when), charge) for charge in charges)
                    self._charges[len(base)] = tests
                row[0].clear |= stage.mask
                row[0].true |= stage.value
                base.append(row[0])
                guards.append(row[1])
                self.draws.append(Draw(probability, own + cost, reward))
            count.append(len(rows))
        self.first = np.array(first, dtype=np.int64)
        self.count = np.array(count, dtype=np.int64)
        self.masks = clear, true, unknown, kill = self._columns(base)
        self.keep, self.set = ~clear, true | (unknown & ~kill)
        self.guard_count = np.array([len(rows) for rows in guards], dtype=np.int64)
        self.guard_first = np.cumsum(self.guard_count) - self.guard_count
        self.guard_mask = self.packing.split(cube.mask for rows in guards for cube, _ in rows)
        self.guard_value = self.packing.split(cube.value for rows in guards for cube, _ in rows)
        self.guard_masks = self._columns([masks for rows in guards for _, masks in rows])
        return True

    def _columns(self, rows: list[_Masks]) -> tuple[Words, Words, Words, Words]:
        split = self.packing.split
        return (
            split(row.clear for row in rows),
            split(row.true for row in rows),
            split(row.unknown for row in rows),
            split(row.kill for row in rows),
        )

    def _outcome(self, effects: frozenset[Effect]) -> tuple[_Masks, list[tuple[Cube, _Masks]]] | None:
        """The unconditional assignments, and the guarded ones for each cube of their guard; None
        if a guard takes too many cubes."""
        sets: list[tuple[int, Truth]] = []
        by_guard: dict[Condition, list[tuple[int, Truth]]] = {}
        for effect in effects:
            (sets if effect.when is None else by_guard.setdefault(effect.when, [])).extend(effect.sets)
        guarded: list[tuple[Cube, _Masks]] = []
        for guard, assignments in by_guard.items():
            found = cubes(bit_test(self.packing, guard), MOST_CUBES)
            if found is None:
                return None
            guarded.extend((cube, _Masks.of(self.packing, assignments)) for cube in found)
        return _Masks.of(self.packing, sets), guarded

    def drawn(self, states: Words, rows: Index, outcomes: Index) -> Index:
        """The numbers in :attr:`draws` of outcomes in the state of each row: their own, but where costs or
        rewards depend on the state."""
        if not self._charges:
            return outcomes
        numbers: Index = outcomes.copy()
        charged = np.zeros(len(self.draws), dtype=np.bool_)
        charged[list(self._charges)] = True
        places = np.flatnonzero(charged[outcomes])
        places = places[np.argsort(outcomes[places], kind="stable")]
        starts = np.flatnonzero(np.diff(outcomes[places], prepend=-1))
        for at in np.split(places, starts[1:]) if len(places) else ():
            numbers[at] = self._drawn(int(outcomes[at[0]]), states[rows[at]])
        return numbers

    def _drawn(self, outcome: int, states: Words) -> Index:
        """The numbers of the figures of one outcome in some states."""
        tests, own = self._charges[outcome], self.draws[outcome]
        due = np.array([holds(self.packing, test, states) for test, _ in tests])
        kinds, kind = np.unique(due, axis=1, return_inverse=True)
        made = []
        for flags in kinds.T:
            charges = [charge for flag, (_, charge) in zip(flags, tests, strict=True) if flag]
            cost = sum((charge.cost for charge in charges), own.cost)
            reward = sum((charge.reward for charge in charges), own.reward)
            made.append(self._draw_number(own.probability, cost, reward))
        return np.array([made[each] for each in kind.reshape(-1).tolist()], dtype=np.int64)

    def _draw_number(self, probability: Fraction, cost: Fraction, reward: Fraction) -> int:
        """The number of an outcome's figures in :attr:`draws`."""
        ratios = (probability.as_integer_ratio(), cost.as_integer_ratio(), reward.as_integer_ratio())
        number = self._draw_index.setdefault(ratios, len(self.draws))
        if number == len(self.draws):
            self.draws.append(Draw(probability, cost, reward))
        return number

    # --- use -----------------------------------------------------------------------------------

    @property
    def width(self) -> int:
        """How many array cells one state may take while it is expanded."""
        return max(1, len(self.pre_action), len(self.guard_count))

    def applicable(self, states: Words) -> tuple[Index, Index]:
        """Pairs of state row and action whose precondition is true, ordered by both."""
        rows, columns = self._fitting(states)
        actions = self.pre_action[columns]
        if not self.general and not self.repeats:
            return rows, actions
        pieces_rows, pieces_actions = [rows], [actions]
        for number, test in self.general:
            found = np.flatnonzero(holds(self.packing, test, states))
            pieces_rows.append(found)
            pieces_actions.append(np.full(len(found), number, dtype=np.int64))
        total = len(self._steps)
        keys = np.unique(np.concatenate(pieces_rows) * total + np.concatenate(pieces_actions))
        return keys // total, keys % total

    def _fitting(self, states: Words) -> tuple[Index, Index]:
        """Pairs of state row and row of :attr:`pre_action` that fit, ordered by both.

        A precondition is tried only where its rarest literal holds.
        """
        if len(states) * len(self.pre_action) <= _FEW_CELLS:
            state_rows, columns = np.nonzero(self._fits(states, slice(None)))
            return state_rows, columns
        bits = self.packing.bit_columns(states)
        often = bits.sum(axis=1, dtype=np.int64)
        often = np.concatenate([len(states) - often, often, [len(states)]])[self._literal]
        rarest = np.minimum.reduceat(often, self._literal_first)
        owner = np.repeat(np.arange(len(rarest)), np.diff(self._literal_first, append=len(often)))
        least = np.flatnonzero(often == rarest[owner])
        least = least[np.unique(owner[least], return_index=True)[1]]
        pivot = self._literal[least]
        used = np.flatnonzero(rarest)
        used = used[np.argsort(pivot[used], kind="stable")]
        keys = []
        starts = np.flatnonzero(np.diff(pivot[used], prepend=-1))
        for group in np.split(used, starts[1:]):
            if not len(group):
                continue
            literal = int(pivot[group[0]])
            if literal == 2 * len(bits):
                rows = np.arange(len(states))
            else:
                rows = np.flatnonzero(bits[literal % len(bits)] == (literal >= len(bits)))
            found = np.nonzero(self._fits(states[rows], group))
            keys.append(rows[found[0]] * len(self.pre_action) + group[found[1]])
        joined = np.concatenate(keys) if keys else np.empty(0, dtype=np.int64)
        joined.sort()
        return np.divmod(joined, max(1, len(self.pre_action)))

    def _fits(self, states: Words, rows: Index | slice) -> Flags:
        """Which of some rows of :attr:`pre_action` (columns) hold in each state (rows)."""
        mask, value = self.pre_mask[rows], self.pre_value[rows]
        fits: Flags | None = None
        for word in range(self.packing.words):
            if mask[:, word].any():
                part = (states[:, word, None] & mask[None, :, word]) == value[None, :, word]
                fits = part if fits is None else fits & part
        return np.ones((len(states), len(mask)), dtype=np.bool_) if fits is None else fits

    def successors(self, states: Words, rows: Index, outcomes: Index) -> Words:
        """The state after each outcome in the state of each row."""
        after = states[rows]
        after &= self.keep[outcomes]
        after |= self.set[outcomes]
        if len(self.guard_mask):
            guarded = np.flatnonzero(self.guard_count[outcomes])
            after[guarded] = self._guarded_successors(states[rows[guarded]], outcomes[guarded])
        return after

    def _guarded_successors(self, states: Words, outcomes: Index) -> Words:
        clear, true, unknown, kill = (masks[outcomes] for masks in self.masks)
        at = np.arange(len(outcomes))
        step = 0
        while len(at):
            guard = self.guard_first[outcomes[at]] + step
            active = ((states[at] & self.guard_mask[guard]) == self.guard_value[guard]).all(axis=1)
            for total, part in zip((clear, true, unknown, kill), self.guard_masks, strict=True):
                total[at[active]] |= part[guard[active]]
            step += 1
            at = at[self.guard_count[outcomes[at]] > step]
        return (states & ~clear) | true | (unknown & ~kill)

    def reference_results(self, values: Values, action: int) -> Iterator[tuple[int, int]]:
        """Packed state and number of the figures of each result of an action with very many
        joint outcomes, as the simulator computes them."""
        for probability, cost, reward, after in self.by_reference[action](values):
            yield self.packing.pack(after), self._draw_number(probability, cost, reward)


def _joint(factors: tuple[Factor, ...]) -> dict[_Joint, Fraction] | None:
    """The joint outcomes of independent factors, equal ones merged; None if there are too many.
    Taking effects as a set is exact: assignments that clash are settled by their maximum."""
    total: dict[_Joint, Fraction] | None = None
    for factor in factors:
        drawn = _drawn(factor)
        if drawn is None or (0 if total is None else len(total)) * len(drawn) > 8 * MOST_OUTCOMES:
            return None
        if total is None:
            total = drawn
            continue
        combined: dict[_Joint, Fraction] = {}
        for (effects, cost, reward, charges), p in total.items():
            for (effects2, cost2, reward2, charges2), p2 in drawn.items():
                key = (effects | effects2, cost + cost2, reward + reward2, charges + charges2)
                combined[key] = combined.get(key, Fraction(0)) + p * p2
        total = combined
    if total is None:
        return {(frozenset(), Fraction(0), Fraction(0), ()): Fraction(1)}
    return total if len(total) <= MOST_OUTCOMES else None


def _drawn(factor: Factor) -> dict[_Joint, Fraction] | None:
    drawn: dict[_Joint, Fraction] = {}
    for outcome in factor.outcomes:
        if not outcome.probability:
            continue
        key = (frozenset(outcome.effects), outcome.cost, outcome.reward, outcome.charges)
        if not outcome.factors:
            drawn[key] = drawn[key] + outcome.probability if key in drawn else outcome.probability
            continue
        nested = _joint(outcome.factors)
        if nested is None:
            return None
        for (effects, cost, reward, charges), p in nested.items():
            joined = (key[0] | effects, key[1] + cost, key[2] + reward, key[3] + charges)
            drawn[joined] = drawn.get(joined, Fraction(0)) + p * outcome.probability
    return drawn
