"""The delete relaxation of a determinised task: how far the goal is, what helps, what is a dead end.

Costs are those of the additive heuristic, from which a relaxed plan is read off (Hoffmann, Nebel, "The FF
planning system", 2001; Keyder, Geffner, "Heuristics for planning with action costs revisited", 2008). A
variable takes a value, unknown among them, as a fact of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from heapq import heapify, heappop, heappush

from bbtc.limits import Limits
from bbtc.planner.mdp.packing import ALWAYS, BitTest, cubes, set_bits
from bbtc.planner.strong_cyclic.determinised import Determinised, Step
from bbtc.planner.strong_cyclic.exclusion import Exclusion
from bbtc.planner.strong_cyclic.partial_state import ANY_STATE, PartialState, literals, united, without

_NEVER = 1 << 60
_MOST_CUBES = 32  # disjuncts of one condition; with more, it counts as true
_MOST_WAYS = 64  # ways not to be where an action is forbidden; with more, it counts as allowed
_FEW_EXCLUDED = 2
_OPPOSITE_OF_TWO = {0: (2,), 2: (0,)}
_OPPOSITE_OF_THREE = {0: (1, 2), 1: (3,), 2: (0, 1), 3: (1,)}
_OPERATORS_AT_ONCE = 1024  # between two looks at the limits


@dataclass(frozen=True, slots=True)
class Estimate:
    """``steps`` of a relaxed plan, the actions of it that may start at once, and all of it: actions with the
    outcomes wanted, those that need least first. ``wanted`` are the facts that it reaches because something
    needs them, as bits that are to be set and bits that are to be clear."""

    steps: int
    helpful: tuple[int, ...]
    plan: tuple[tuple[int, Step], ...]
    wanted: tuple[int, int]


class Relaxation:
    """The relaxation, indexed once and asked for many states. Facts are numbered: variable v is false (4 v),
    unknown, true, or known; then the goal, and what always holds."""

    def __init__(self, model: Determinised, exclusion: Exclusion, limits: Limits) -> None:
        self.model, self.exclusion, self.limits = model, exclusion, limits
        self.packing = model.packing
        self.count = 4 * len(self.packing.unknown) + 2
        self.goal = self.count - 2
        self._always = self.count - 1
        self._full = self._two_valued = 0
        for variable, at in enumerate(self.packing.unknown):
            self._full |= self.packing.bits(variable)
            self._two_valued |= 0 if at is not None else 1 << variable
        self._build()

    # --- operators ------------------------------------------------------------------------------

    def _build(self) -> None:
        self._action: list[int] = []
        self._needs: list[tuple[int, ...]] = []
        self._adds: list[tuple[int, ...]] = []
        self._steps: list[dict[int, Step]] = []
        known = {3 + 4 * v for v, at in enumerate(self.packing.unknown) if at is not None}
        made: dict[tuple[tuple[int, ...], int], dict[int, Step]] = {}
        for action in self.model.actions:
            if action.number % _OPERATORS_AT_ONCE == 0:
                self.limits.check_time("planning")
            disjuncts = (ANY_STATE,) if action.needs is None else action.needs
            for need in disjuncts:
                for step in sorted(action.steps, key=_changes):
                    for when, sets in [(part.when, part.sets) for part in step.guarded] or [
                        (ALWAYS, step.sets)
                    ]:
                        adds = dict.fromkeys(self._added(sets, known), step)
                        for needs in self._facts_of(when, need):
                            made[needs, action.number] = adds | made.get((needs, action.number), {})
        self._users: list[list[int]] = [[] for _ in range(self.count)]
        self._counts: list[int] = []
        self._operators: dict[int, list[int]] = {}
        self._unwanted: dict[int, list[int]] = {}
        self._wanted = bytearray(self.count)
        self._masks = [0, 0, 0, 0]
        self._choices: dict[tuple[int, ...], int] = {}
        self._at: int | None = None
        self._ready: set[int] = set()
        self._left: list[int] = []
        self._cost: list[int] = []
        for needs in self._facts_of(self.model.goal, ANY_STATE):
            self._operate(needs, (self.goal,), -1, {})
        for (needs, number), steps in made.items():
            self._operate(needs, tuple([fact for fact in steps if fact not in needs]), number, steps)
        self._want(self.goal)

    def _operate(
        self, needs: tuple[int, ...], adds: tuple[int, ...], action: int, steps: dict[int, Step]
    ) -> None:
        """One more operator, for all steps of an action with the same needs: which of them adds a fact is
        told by ``steps``. What it adds counts where something needs it."""
        self._at = None
        operator = len(self._needs)
        self._steps.append(steps)
        self._needs.append(needs)
        self._counts.append(len(needs))
        self._action.append(action)
        self._operators.setdefault(action, []).append(operator)
        self._adds.append(tuple(fact for fact in adds if self._wanted[fact]))
        for fact in adds:
            if not self._wanted[fact]:
                self._unwanted.setdefault(fact, []).append(operator)
        for fact in needs:
            self._users[fact].append(operator)
            self._want(fact)

    def _want(self, fact: int) -> None:
        """From now on a fact matters."""
        if self._wanted[fact]:
            return
        self._wanted[fact] = 1
        if fact < self.goal:
            self._masks[fact % 4] |= 1 << fact // 4
        for operator in self._unwanted.pop(fact, ()):
            self._adds[operator] = (*self._adds[operator], fact)

    def _facts_of(self, test: BitTest, also: PartialState) -> Iterator[tuple[int, ...]]:
        found = cubes(test, _MOST_CUBES)
        for cube in [ANY_STATE] if found is None else found:
            if not (cube.value ^ also.value) & cube.mask & also.mask:
                yield tuple(self._facts(united(cube, also))) or (self._always,)

    def _facts(self, partial: PartialState) -> Iterator[int]:
        for literal in literals(self.packing, partial):
            variable = self.packing.owner((literal.mask & -literal.mask).bit_length() - 1)
            unknown = self.packing.unknown[variable]
            if literal.mask >> variable & 1:
                yield 4 * variable + (2 if literal.value >> variable & 1 else 0)
            else:
                assert unknown is not None
                yield 4 * variable + (1 if literal.value >> unknown & 1 else 3)

    @staticmethod
    def _added(sets: Iterable[tuple[int, int]], known: set[int]) -> Iterator[int]:
        for variable, value in sets:
            yield 4 * variable + int(value)
            if value != 1 and 4 * variable + 3 in known:
                yield 4 * variable + 3

    @property
    def size(self) -> int:
        """How many operators there are."""
        return len(self._needs)

    def forbid(self, action: int, partial: PartialState) -> None:
        """The action must not start where something holds: one of its literals must not hold."""
        self._at = None
        if not partial.mask:
            for operator in self._operators.pop(action, ()):
                self._counts[operator] += 1  # which nothing counts down
            return
        ways = tuple(fact for literal in literals(self.packing, partial) for fact in self._opposites(literal))
        if len(ways) > _MOST_WAYS:
            return
        fact = ways[0] if len(ways) == 1 else self._choice(ways)
        self._want(fact)
        for operator in self._operators.get(action, ()):
            if fact not in self._needs[operator]:
                self._needs[operator] = (*self._needs[operator], fact)
                self._users[fact].append(operator)
                self._counts[operator] += 1

    def _opposites(self, literal: PartialState) -> Iterator[int]:
        """The facts of which one holds where a literal does not."""
        (fact,) = self._facts(literal)
        two_valued = self.packing.unknown[fact // 4] is None
        for value in (_OPPOSITE_OF_TWO if two_valued else _OPPOSITE_OF_THREE)[fact % 4]:
            yield fact - fact % 4 + value

    def _choice(self, ways: tuple[int, ...]) -> int:
        """A fact that takes one of some others."""
        known = self._choices.get(ways)
        if known is None:
            known = self._choices[ways] = self.count
            self.count += 1
            self._users.append([])
            self._wanted.append(1)
            for way in ways:
                self._operate((way,), (known,), -1, {})
        return known

    def holding(self, state: int) -> list[int]:
        """The facts of a state that matter."""
        count = len(self.packing.unknown)
        unknown = 0
        for variable, at in enumerate(self.packing.unknown):
            if at is not None and state >> at & 1:
                unknown |= 1 << variable
        everything = (1 << count) - 1
        true = state & everything & ~unknown
        false = everything & ~true & ~unknown
        found = [4 * variable + 2 for variable in set_bits(true & self._masks[2])]
        found.extend(4 * variable for variable in set_bits(false & self._masks[0]))
        found.extend(4 * variable + 1 for variable in set_bits(unknown & self._masks[1]))
        found.extend(4 * variable + 3 for variable in set_bits(~unknown & everything & self._masks[3]))
        return found

    # --- the heuristic ----------------------------------------------------------------------------

    def _go_to(self, state: int) -> None:
        """Make a state the one that costs are counted from: ``_cost`` of its facts is 0, ``_left`` are the
        facts that operators need besides, and ``_ready`` the operators that need none."""
        if self._at is None:
            self._cost, self._left = [_NEVER] * self.count, self._counts.copy()
            self._ready = set()
            self._gain([*self.holding(state), self._always])
        elif self._at != state:
            changed = {self.packing.owner(bit) for bit in set_bits(self._at ^ state)}
            before = [fact for variable in changed for fact in self._facts_in(self._at, variable)]
            after = [fact for variable in changed for fact in self._facts_in(state, variable)]
            for fact in before:
                self._cost[fact] = _NEVER
                for operator in self._users[fact]:
                    if not self._left[operator]:
                        self._ready.remove(operator)
                    self._left[operator] += 1
            self._gain(after)
        self._at = state

    def _gain(self, facts: Iterable[int]) -> None:
        for fact in facts:
            self._cost[fact] = 0
            for operator in self._users[fact]:
                self._left[operator] -= 1
                if not self._left[operator]:
                    self._ready.add(operator)

    def _facts_in(self, state: int, variable: int) -> tuple[int, ...]:
        """The facts of one variable in a state."""
        at = self.packing.unknown[variable]
        if at is not None and state >> at & 1:
            return (4 * variable + 1,)
        value = 4 * variable + (2 if state >> variable & 1 else 0)
        return (value,) if at is None else (value, 4 * variable + 3)

    def estimate(self, state: int) -> Estimate | None:
        """A guess of the steps to the goal; None if it is out of reach, even in the relaxation."""
        self._go_to(state)
        users, adds, actions, goal = self._users, self._adds, self._action, self.goal
        cost, left = self._cost.copy(), self._left.copy()
        by = [-1] * self.count
        total = [0] * len(left)
        size = self.count
        queue: list[int] = []
        for operator in sorted(self._ready):
            price = int(actions[operator] >= 0)
            for added in adds[operator]:
                if price < cost[added]:
                    cost[added] = price
                    by[added] = operator
                    queue.append(price * size + added)
        heapify(queue)
        while queue:
            entry = heappop(queue)
            spent, fact = divmod(entry, size)
            if spent > cost[fact]:
                continue
            if fact == goal:
                return self._relaxed_plan(by, total)
            for operator in users[fact]:
                left[operator] -= 1
                total[operator] += spent
                if not left[operator]:
                    # Sums may double from step to step; what is far is not out of reach.
                    price = min(total[operator] + (actions[operator] >= 0), _NEVER - 1)
                    for added in adds[operator]:
                        if price < cost[added]:
                            cost[added] = price
                            by[added] = operator
                            heappush(queue, price * size + added)
        return None

    def _relaxed_plan(self, by: list[int], total: list[int]) -> Estimate:
        chosen: dict[int, dict[Step, None]] = {}
        wanted: list[int] = []
        seen = {self.goal}
        stack = [self.goal]
        while stack:
            reached = stack.pop()
            operator = by[reached]
            if operator < 0:
                continue
            if self._action[operator] >= 0:
                chosen.setdefault(operator, {})[self._steps[operator][reached]] = None
                wanted.append(reached)
            for fact in self._needs[operator]:
                if fact not in seen:
                    seen.add(fact)
                    stack.append(fact)
        operators = sorted(chosen, key=lambda operator: (total[operator], operator))
        helpful = {self._action[operator] for operator in operators if not total[operator]}
        plan = [(self._action[operator], step) for operator in operators for step in chosen[operator]]
        return Estimate(len(operators), tuple(sorted(helpful)), tuple(plan), self._bits(wanted))

    def _bits(self, facts: Iterable[int]) -> tuple[int, int]:
        """Bits that are set where facts hold, and bits that are clear."""
        found, clear = 0, 0
        for fact in facts:
            variable, kind = divmod(fact, 4)
            bits = self.packing.bits(variable)
            match kind:
                case 0:
                    clear |= bits
                case 1:
                    found |= bits & ~(1 << variable)
                case 2:
                    found |= 1 << variable
                case _:
                    clear |= bits & ~(1 << variable)
        return found, clear

    # --- dead ends ----------------------------------------------------------------------------------

    def generalised(self, state: int) -> PartialState:
        """Enough for the goal to be out of reach in the relaxation, of a state where it is: no literal of it
        can be left out."""
        reach = _Reach(self._users, self._adds, self._counts, self.goal)
        if not reach.add([*self.holding(state), self._always]):
            raise AssertionError("not a dead end")
        kept = self.exclusion.shortest(PartialState(self._full, state & self._full))
        # What would be true without them, and makes no difference.
        kept = without(kept, ~state & self._two_valued & ~self._masks[2])
        free, simple = 0, kept.mask & self._two_valued & ~(kept.value & self.exclusion.members)
        for bit in reach.each([*set_bits(simple)], lambda bit: (4 * bit, 4 * bit + 2)):
            free |= 1 << bit
        rest, kept = without(kept, simple), without(kept, free)
        for literal in sorted(literals(self.packing, rest), key=lambda each: each.value != 0):
            kept = self._freed(reach, kept, literal)
        return kept

    def _set_free(self, literals: PartialState, rest: PartialState) -> int:
        """The variables that may be true once some literals do not hold, which excluded them."""
        if not literals.value & self.exclusion.members:
            return 0
        return self.exclusion.implied(literals) & ~self.exclusion.implied(rest) & ~rest.mask

    def _freed(self, reach: _Reach, kept: PartialState, literal: PartialState) -> PartialState:
        """A partial state without a literal of it, if the goal stays out of reach."""
        rest = without(kept, literal.mask)
        mates = self._set_free(literal, rest)
        facts = self._other_facts(literal.mask)
        if reach.add([*facts, *self._other_facts(mates)]):
            return rest
        if mates and reach.add(facts):
            # It matters for what it excludes; if that is little, it is said instead.
            needed = 0
            for mate in set_bits(mates):
                if not reach.add(self._other_facts(1 << mate)):
                    needed |= 1 << mate
                    if needed.bit_count() > _FEW_EXCLUDED:
                        return kept
            return PartialState(rest.mask | needed, rest.value)
        return kept

    def _other_facts(self, bits: int) -> list[int]:
        """All values of the variables of some bits."""
        found: list[int] = []
        for bit in set_bits(bits):
            variable = self.packing.owner(bit)
            values = (0, 2) if self.packing.unknown[variable] is None else (0, 1, 2, 3)
            found.extend(4 * variable + value for value in values)
        return found


def _changes(step: Step) -> int:
    """How much a step sets: of those that add a fact, the one with the fewest side effects is wanted."""
    return sum(len(part.sets) for part in step.guarded) or len(step.sets)


class _Reach:
    """What is reached in the relaxation, growing as long as the goal is not."""

    def __init__(
        self, users: list[list[int]], adds: list[tuple[int, ...]], counts: list[int], goal: int
    ) -> None:
        self.users, self.adds, self.goal = users, adds, goal
        self.left = counts.copy()
        self.reached = bytearray(len(users))

    def add(self, facts: Iterable[int]) -> bool:
        """Add facts and what follows; unless the goal would be reached: then nothing changes."""
        reached = self.reached
        new = [fact for fact in facts if not reached[fact]]
        if not new:
            return True
        for fact in new:
            reached[fact] = 1
        used = 0
        for fact in new:  # grows while it is read
            if fact == self.goal:
                break
            used += 1
            for operator in self.users[fact]:
                self.left[operator] -= 1
                if not self.left[operator]:
                    for added in self.adds[operator]:
                        if not self.reached[added]:
                            self.reached[added] = 1
                            new.append(added)
        if used == len(new):
            return True
        for fact in new[:used]:
            for operator in self.users[fact]:
                self.left[operator] += 1
        for fact in new:
            self.reached[fact] = 0
        return False

    def each(self, items: list[int], facts: Callable[[int], tuple[int, ...]]) -> Iterator[int]:
        """Add the facts of some items, one after the other, as far as they do not reach the goal: the items
        that were added. More facts reach no less, so many are tried at once, and halves where that fails."""
        if self.add([fact for item in items for fact in facts(item)]):
            yield from items
        elif len(items) > 1:
            middle = len(items) // 2
            yield from self.each(items[:middle], facts)
            yield from self.each(items[middle:], facts)
