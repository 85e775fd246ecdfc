"""Lifted conditions made ground: each is compiled once into a function of the argument row."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import combinations, repeat
from operator import is_, itemgetter
from typing import Any

from typing_extensions import assert_never

from bbtc.diagnostics import BbtcError, Report
from bbtc.ground.condition import (
    FALSE,
    TRUE,
    And,
    Condition,
    Constant,
    Is,
    Or,
    conjunction,
    disjunction,
    doubt,
    negation,
)
from bbtc.ground.normal import conjuncts, disjuncts, normal_form
from bbtc.ground.numbers.amounts import Amounts
from bbtc.ground.reachability.atoms import Atoms, Leaves, OpenLeaves, Scope
from bbtc.ground.reachability.bulk import Shared, instances, picker
from bbtc.ground.universe import Row, Universe
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.model import domain as md
from bbtc.model import formula as mf
from bbtc.model.types import Parameter

Env = list[int]
"""Numbers of objects: arguments first, then constants and the current values of quantifiers."""
Lowered = Callable[[Env], Condition]

_LOOK = 4096  # bindings between two looks at the clock
_MOST_UNFOLDINGS = 100_000
_LARGEST_UNFOLDING = 100_000  # literals, those of shared parts counted each time
_DEEPEST_UNFOLDING = 80


class Frame:
    """Where each term of one lifted thing stands in its environment. A name always has the same
    place: parameters in scope never share a name."""

    def __init__(self, universe: Universe, parameters: Iterable[Parameter]) -> None:
        self.universe = universe
        self._slots = {parameter.name: slot for slot, parameter in enumerate(parameters)}
        self._tail: list[int] = []

    def slot(self, term: mf.Term) -> int:
        """The place of a term; a new one for an object or a quantifier's parameter."""
        if term not in self._slots:
            self._slots[term] = len(self._slots)
            self._tail.append(-1 if mf.is_parameter(term) else self.universe.index[term])
        return self._slots[term]

    def env(self, row: Iterable[int]) -> Env:
        """The environment for an argument row (ask once everything is compiled)."""
        return [*row, *self._tail]

    def rows(self, args: tuple[mf.Term, ...]) -> Callable[[Env], Row]:
        """Reads the arguments of an atom from an environment."""
        slots = [self.slot(arg) for arg in args]
        if not slots:
            return lambda _env: ()
        if len(slots) == 1:
            only = slots[0]
            return lambda env: (env[only],)
        getter: Any = itemgetter(*slots)
        return getter  # type: ignore[no-any-return]

    def columns(self, args: tuple[mf.Term, ...]) -> Callable[[list[Row]], Iterable[Row]]:
        """Reads the arguments of an atom (parameters or objects) from many argument rows."""
        if all(map(mf.is_parameter, args)):
            return picker([self.slot(arg) for arg in args])
        getters = [
            itemgetter(self.slot(arg)) if mf.is_parameter(arg) else self.universe.index[arg] for arg in args
        ]

        def read(rows: list[Row]) -> Iterable[Row]:
            size = len(rows)
            columns = (repeat(get, size) if isinstance(get, int) else map(get, rows) for get in getters)
            return zip(*columns, strict=True)

        return read


def projection(
    universe: Universe, parameters: tuple[Parameter, ...], read: Iterable[str]
) -> tuple[list[int], Frame]:
    """The places of the parameters that are read, and a frame of these alone."""
    names = set(read)
    used = [slot for slot, parameter in enumerate(parameters) if parameter.name in names]
    return used, Frame(universe, [parameters[slot] for slot in used])


class Lowering:
    """Compiles the conditions of one model."""

    def __init__(self, atoms: Atoms, limits: Limits, report: Report | None = None) -> None:
        self.atoms = atoms
        self.universe = atoms.universe
        self.amounts = Amounts(atoms, report or Report())
        self._limits = limits
        self._bindings = self._unlooked = 0
        model = _Derived(self, Scope.MODEL)
        self._derived = {Scope.WORLD: _Derived(self, Scope.WORLD), Scope.MODEL: model, Scope.TRUTH: model}

    def condition(self, formula: mf.Formula, frame: Frame, scope: Scope = Scope.WORLD) -> Lowered:
        """The condition, which means what the text says wherever ``scope`` asks for it."""
        return self.normal(normal_form(formula), frame, scope)

    def reached(self, formula: mf.Formula, parameters: tuple[Parameter, ...]) -> Shared[Condition]:
        """:meth:`condition` for many argument rows, of which reachability has found that the formula can
        be true of them: there, parts that never change are true. It is false where a closer look finds that
        it can never be true in the model."""
        parts = sorted(conjuncts(normal_form(formula)), key=self._late)
        parts = [part for part in parts if not self._settled(part, Scope.WORLD)]
        names = (name for part in parts for name in mf.free(part))
        used, frame = projection(self.universe, parameters, names)
        read = tuple(parameters[slot] for slot in used)
        return Shared(used, len(parameters), _Conjunction(self, parts, read, frame).all)

    def lowered(self, part: mf.Formula, parameters: tuple[Parameter, ...]) -> Shared[Condition]:
        """:meth:`normal` for many argument rows; false where it can never be true in the model."""
        used, frame = projection(self.universe, parameters, mf.free(part))
        condition, can_be_true = self.normal(part, frame, Scope.WORLD), self.atoms.can_be_true

        def make(rows: list[Row]) -> list[Condition]:
            found = [condition(frame.env(row)) for row in rows]
            return [each if can_be_true(each) else FALSE for each in found]

        return Shared(used, len(parameters), make)

    def spend(self, count: int) -> None:
        """Count objects that a quantifier is tried with. Raises at the limits."""
        self._bindings += count
        self._limits.check_bindings(self._bindings)
        self._unlooked += count
        if self._unlooked > _LOOK:
            self.look()

    def look(self) -> None:
        """Raise if the time is over or the memory is used up."""
        self._unlooked = 0
        self._limits.check_time("grounding")

    def ground(self, formula: mf.Formula, scope: Scope = Scope.WORLD) -> Condition:
        """A condition without free parameters."""
        frame = Frame(self.universe, ())
        return self.condition(formula, frame, scope)(frame.env(()))

    def is_never(self, formula: mf.Formula) -> bool:
        """Whether a condition without free parameters is true in no state, even if nothing is ever undone."""
        return self.ground(formula, Scope.TRUTH) is FALSE

    def normal(self, formula: mf.Formula, frame: Frame, scope: Scope) -> Lowered:
        """:meth:`condition` of a formula in normal form."""
        match formula:
            case mf.Atom(predicate, args):
                return self._literal(predicate, args, Truth.TRUE, frame, scope)
            case mf.Not(mf.Atom(predicate, args)):
                return self._literal(predicate, args, Truth.FALSE, frame, scope)
            case mf.Test(kind, atom):
                value = Truth.UNKNOWN if kind == "unknown" else None
                return self._literal(atom.predicate, atom.args, value, frame, scope)
            case mf.Equal(left, right):
                return _equal(frame.slot(left), frame.slot(right), TRUE, FALSE)
            case mf.Not(mf.Equal(left, right)):
                return _equal(frame.slot(left), frame.slot(right), FALSE, TRUE)
            case mf.Compare():
                return self.amounts.compare(formula, frame.rows)
            case mf.And():
                parts = sorted(conjuncts(formula), key=self._late)
                return _all([self.normal(part, frame, scope) for part in parts])
            case mf.Or():
                parts = sorted(disjuncts(formula), key=self._late)
                return _any([self.normal(part, frame, scope) for part in parts])
            case mf.Quantified(kind, (parameter,), inner):
                slot, members = frame.slot(parameter.name), self.universe.members(parameter.types)
                lowered = self.normal(inner, frame, scope)
                if kind == "forall":
                    return _for_all(slot, members, lowered, self.spend)
                return _for_some(slot, members, lowered, self.spend)
            case mf.Not() | mf.Quantified():
                raise AssertionError("not in normal form")
            case _:
                assert_never(formula)

    def number(self, predicate: str, args: tuple[mf.Term, ...], frame: Frame) -> Callable[[Env], int | None]:
        """The variable that setting an atom sets; None for an atom that the model never changes."""
        rows, get = frame.rows(args), self.atoms.numbers[predicate].get
        return lambda env: get(rows(env))

    def numbers(
        self, predicate: str, args: tuple[mf.Term, ...], frame: Frame
    ) -> Callable[[list[Row]], list[int | None]]:
        """:meth:`number` of many argument rows."""
        get, read = self.atoms.numbers[predicate].get, frame.columns(args)
        return lambda rows: list(map(get, read(rows)))

    def read(
        self, predicate: str, args: tuple[mf.Term, ...], frame: Frame
    ) -> Callable[[list[Row]], list[int | None]]:
        """The variable that a condition reads for an atom, of many argument rows; None for a constant."""
        atoms, rows_of = self.atoms, frame.columns(args)
        get = atoms.numbers[predicate].get
        if predicate not in atoms.reach.usage.open:
            return lambda rows: list(map(get, rows_of(rows)))

        def read(rows: list[Row]) -> list[int | None]:
            found = list(rows_of(rows))
            numbers = list(map(get, found))
            if None in numbers:
                return [atoms.number(predicate, row) for row in found]
            return numbers

        return read

    def members(
        self, parameter: Parameter, parts: list[mf.Formula], frame: Frame
    ) -> Callable[[Env], Sequence[int]]:
        """The objects to bind a parameter to. Of the parts, which are to hold of it, an atom that never
        changes is taken out if there is one: then only those objects are given that it is true of."""
        every = self.universe.members(parameter.types)
        for part in parts:
            if isinstance(part, mf.Atom) and parameter.name in part.args and self._settled(part, Scope.TRUTH):
                if part.predicate in self.atoms.reach.usage.derived:
                    continue
                parts.remove(part)
                return self._related(parameter, every, part, frame)
        return lambda _env: every

    def _related(
        self, parameter: Parameter, every: tuple[int, ...], part: mf.Atom, frame: Frame
    ) -> Callable[[Env], Sequence[int]]:
        here = [place for place, arg in enumerate(part.args) if arg == parameter.name]
        others = [place for place, arg in enumerate(part.args) if arg != parameter.name]
        found: dict[Row, list[int]] = {}
        order = {number: position for position, number in enumerate(every)}
        for row, leaf in self.atoms.leaves(part.predicate, Truth.TRUE, Scope.TRUTH).items():
            number = row[here[0]]
            if leaf is TRUE and number in order and all(row[place] == number for place in here):
                found.setdefault(tuple([row[place] for place in others]), []).append(number)
        for numbers in found.values():
            numbers.sort(key=order.__getitem__)
        read = frame.rows(tuple(part.args[place] for place in others))
        return lambda env: found.get(read(env), ())

    def _late(self, part: mf.Formula) -> int:
        """Constant parts first: they often settle the whole without a look at the rest. Parts that
        are not constant keep their order."""
        match part:
            case mf.Equal() | mf.Not(mf.Equal()):
                return 0
            case mf.Atom(predicate) | mf.Not(mf.Atom(predicate)):
                usage = self.atoms.reach.usage
                return 1 if usage.is_static(predicate) and predicate not in usage.open else 2
            case _:
                return 2

    def _settled(self, part: mf.Formula, scope: Scope) -> bool:
        """Whether the part is the same in all states of the scope."""
        match part:
            case mf.Equal() | mf.Not(mf.Equal()):
                return True
            case mf.Atom(predicate) | mf.Not(mf.Atom(predicate)):
                usage = self.atoms.reach.usage
                if predicate in usage.derived:
                    return predicate in (usage.fixed if scope is Scope.WORLD else usage.unchanging)
                value = Truth.TRUE if isinstance(part, mf.Atom) else Truth.FALSE
                leaves = self.atoms.leaves(predicate, value, scope)
                return not isinstance(leaves, OpenLeaves) and all(
                    isinstance(leaf, Constant) for leaf in leaves.values()
                )
            case _:
                return False

    def _literal(
        self, predicate: str, args: tuple[mf.Term, ...], value: Truth | None, frame: Frame, scope: Scope
    ) -> Lowered:
        rows = frame.rows(args)
        if predicate in self.atoms.reach.usage.derived:
            return self._derived[scope].literal(predicate, rows, value)
        leaves = self.atoms.leaves(predicate, value, scope)
        if isinstance(leaves, OpenLeaves):
            return lambda env: leaves[rows(env)]
        get, other = leaves.get, leaves.other
        return lambda env: get(rows(env), other)


# --- combinations ----------------------------------------------------------------------------


def _equal(left: int, right: int, same: Condition, different: Condition) -> Lowered:
    return lambda env: same if env[left] == env[right] else different


def _all(parts: list[Lowered]) -> Lowered:
    return parts[0] if len(parts) == 1 else lambda env: _every(part(env) for part in parts)


def _any(parts: list[Lowered]) -> Lowered:
    return parts[0] if len(parts) == 1 else lambda env: _some(part(env) for part in parts)


def _for_all(slot: int, members: tuple[int, ...], inner: Lowered, spend: Callable[[int], None]) -> Lowered:
    return lambda env: _every(map(inner, extend(env, [(slot, members)], spend)))


def _for_some(slot: int, members: tuple[int, ...], inner: Lowered, spend: Callable[[int], None]) -> Lowered:
    return lambda env: _some(map(inner, extend(env, [(slot, members)], spend)))


def _every(parts: Iterable[Condition]) -> Condition:
    """The conjunction; nothing is looked at after a part that is false."""
    found = _until(FALSE, parts)
    return FALSE if found is None else conjoin(found)


def _some(parts: Iterable[Condition]) -> Condition:
    """The disjunction; nothing is looked at after a part that is true."""
    found = _until(TRUE, parts)
    return TRUE if found is None else disjunction(found)


def _until(end: Condition, parts: Iterable[Condition]) -> list[Condition] | None:
    """The parts that are no constants; None if one of them is ``end``."""
    found = []
    for part in parts:
        if part is end:
            return None
        if part is not TRUE and part is not FALSE:
            found.append(part)
    return found


_FEW_COLUMNS = 5
"""So many columns are compared two by two, which is faster."""


class _Conjunction:
    """The conjunction of some parts in normal form, for many argument rows at once."""

    def __init__(
        self,
        lowering: Lowering,
        parts: Sequence[mf.Formula],
        parameters: tuple[Parameter, ...],
        frame: Frame,
    ) -> None:
        self._columns: list[Callable[[list[Row]], list[Condition]]] = []
        # Of what value each column is, if it is of nothing but literals of one predicate.
        self._kinds: list[tuple[str, Truth] | None] = []
        for part in parts:
            match part:
                case mf.Atom(predicate, args) | mf.Not(mf.Atom(predicate, args)) if (
                    predicate not in lowering.atoms.reach.usage.derived
                ):
                    value = Truth.TRUE if isinstance(part, mf.Atom) else Truth.FALSE
                    leaves = lowering.atoms.leaves(predicate, value, Scope.WORLD)
                    self._columns.append(_leaf_column(leaves, frame.columns(args)))
                    plain = all(type(leaf) is Is for leaf in leaves.values())
                    self._kinds.append((predicate, value) if plain else None)
                case _:
                    self._columns.append(lowering.lowered(part, parameters).all)
                    self._kinds.append(None)
        alike: dict[tuple[str, Truth], list[int]] = {}
        for number, kind in enumerate(self._kinds):
            if kind is not None:
                alike.setdefault(kind, []).append(number)
        self._alike = [numbers for numbers in alike.values() if len(numbers) > 1]

    def all(self, rows: list[Row]) -> list[Condition]:
        """The condition of each row."""
        columns = [column(rows) for column in self._columns]
        if not columns:
            return [TRUE] * len(rows)
        if not self._distinct_leaves(columns):
            return list(map(_every, zip(*columns, strict=True)))
        if len(columns) == 1:
            return columns[0]
        return [*instances(And, len(rows), zip(*columns, strict=True))]

    def _distinct_leaves(self, columns: list[list[Condition]]) -> bool:
        """Whether there is nothing to leave out in any row: no constant, nothing twice."""
        for kind, column in zip(self._kinds, columns, strict=True):
            if kind is None or (kind[1] is Truth.FALSE and any(map(is_, column, repeat(TRUE)))):
                return False
        return not any(_repeats([columns[number] for number in numbers]) for numbers in self._alike)


def _repeats(columns: list[list[Condition]]) -> bool:
    """Whether the same leaf stands in two of the columns, in some row."""
    if len(columns) <= _FEW_COLUMNS:
        return any(any(map(is_, one, other)) for one, other in combinations(columns, 2))
    return any(len(set(map(id, row))) < len(row) for row in zip(*columns, strict=True))


def _leaf_column(
    leaves: Leaves, read: Callable[[list[Row]], Iterable[Row]]
) -> Callable[[list[Row]], list[Condition]]:
    get = leaves.__getitem__
    return lambda rows: list(map(get, read(rows)))


def conjoin(parts: list[Condition]) -> Condition:
    """:func:`bbtc.ground.condition.conjunction` of parts that are no constants; leaves, which are
    shared, are told apart by identity, which is faster."""
    if not parts:
        return TRUE
    if len(parts) == 1:
        return parts[0]
    unique: dict[int, Condition] = {}
    for part in parts:
        if type(part) is Is:
            unique[id(part)] = part
        elif type(part) is And and all(type(each) is Is for each in part.parts):
            unique.update(zip(map(id, part.parts), part.parts, strict=True))
        else:
            return conjunction(parts)
    return And(tuple(unique.values())) if len(unique) > 1 else parts[0]


# --- derived predicates ----------------------------------------------------------------------


class _Derived:
    """Replaces derived atoms by the condition they stand for.

    An atom within its own unfolding counts as false: in the least fixpoint, a proof that uses an
    atom to prove itself is never needed. Results are kept where no such cut was made.
    """

    def __init__(self, lowering: Lowering, scope: Scope) -> None:
        self._lowering = lowering
        self._scope = scope
        self._reach = lowering.atoms.reach
        self._rules: dict[str, list[tuple[md.Rule, Frame, list[int], Lowered]]] = {}
        self._known: dict[tuple[str, Row], Condition] = {}
        self._sizes: dict[int, tuple[int, Condition]] = {}  # by identity; what it is of stays alive
        self._depth: dict[tuple[str, Row], int] = {}
        self._lowest = _DEEPEST_UNFOLDING
        self._count = 0

    def literal(self, predicate: str, rows: Callable[[Env], Row], value: Truth | None) -> Lowered:
        """The condition that a derived atom is true, false, unknown or (None) known."""
        if value is Truth.TRUE:
            return lambda env: self._unfold(predicate, rows(env))
        if value is Truth.FALSE:
            return lambda env: negation(self._unfold(predicate, rows(env)))
        return lambda env: self._test(predicate, rows(env), value)

    def _unfold(self, predicate: str, row: Row) -> Condition:
        key = (predicate, row)
        usage = self._reach.usage
        if self._scope is not Scope.WORLD or predicate in usage.fixed:
            if row not in self._reach.values[Truth.TRUE][predicate]:
                if row not in self._reach.values[Truth.UNKNOWN][predicate]:
                    return FALSE
            elif predicate in usage.unchanging:
                return TRUE
        if key in self._known:
            return self._known[key]
        if key in self._depth:
            self._lowest = min(self._lowest, self._depth[key])
            return FALSE
        self._count += 1
        depth = len(self._depth)
        if self._count > _MOST_UNFOLDINGS or depth >= _DEEPEST_UNFOLDING:
            raise self._refused(predicate, "is too deeply recursive")
        self._lowering.look()
        above, self._lowest = self._lowest, _DEEPEST_UNFOLDING
        self._depth[key] = depth
        try:
            result = _absorbed(disjunction(self._instances(predicate, row)))
        except RecursionError:  # each level may have many of Python's
            raise self._refused(predicate, "is too deeply recursive") from None
        if self._size(result) > _LARGEST_UNFOLDING:
            raise self._refused(predicate, f"stands for more than {_LARGEST_UNFOLDING:,} literals, too many")
        del self._depth[key]
        if self._lowest >= depth:
            self._known[key] = result
            self._lowest = above
        else:
            self._lowest = min(above, self._lowest)
        return result

    def _refused(self, predicate: str, why: str) -> BbtcError:
        rules = self._reach.usage.model.rules
        place = next(rule.span for rule in rules if rule.predicate == predicate)
        return BbtcError.single("BBT0408", f"the derived predicate `{predicate}` {why} to be unfolded", place)

    def _size(self, condition: Condition) -> int:
        """How many literals a condition has. Parts that stand in several places are looked at once."""
        known = self._sizes.get(id(condition))
        if known is not None:
            return known[0]
        if not isinstance(condition, And | Or):
            return 1
        size = sum(map(self._size, condition.parts))
        self._sizes[id(condition)] = size, condition
        return size

    def _instances(self, predicate: str, row: Row) -> Iterator[Condition]:
        if predicate not in self._rules:
            self._rules[predicate] = list(self._compile(predicate))
        members = self._lowering.universe.members
        for rule, frame, head, condition in self._rules[predicate]:
            env = frame.env([-1] * len(rule.parameters))
            slots = dict(enumerate(rule.parameters))
            if all(self._bind(env, slot, number, slots) for slot, number in zip(head, row, strict=True)):
                unbound = [(slot, members(p.types)) for slot, p in slots.items() if env[slot] < 0]
                for bound in extend(env, unbound, self._lowering.spend):
                    yield condition(bound)

    def _bind(self, env: Env, slot: int, number: int, slots: dict[int, Parameter]) -> bool:
        if env[slot] < 0 and number not in self._lowering.universe.members(slots[slot].types):
            return False
        if env[slot] < 0:
            env[slot] = number
        return env[slot] == number

    def _compile(self, predicate: str) -> Iterator[tuple[md.Rule, Frame, list[int], Lowered]]:
        for rule in self._reach.usage.model.rules:
            if rule.predicate == predicate:
                frame = Frame(self._lowering.universe, rule.parameters)
                head = [frame.slot(arg) for arg in rule.args]
                yield rule, frame, head, self._lowering.condition(rule.condition, frame, self._scope)

    def _test(self, predicate: str, row: Row, value: Truth | None) -> Condition:
        """``(unknown p)`` or ``(known p)`` of a derived atom."""
        unknown = doubt(self._unfold(predicate, row), self._unknown)
        return negation(unknown) if value is None else unknown

    def _unknown(self, variable: int) -> Condition:
        predicate, row = self._lowering.atoms.keys[variable]
        return self._lowering.atoms.leaves(predicate, Truth.UNKNOWN, self._scope)[row]


def _absorbed(condition: Condition) -> Condition:
    """Without alternatives that another one makes needless: x or (x and y) is x."""
    if not isinstance(condition, Or):
        return condition
    alternatives = set(condition.parts)
    return disjunction(
        part
        for part in condition.parts
        if not (isinstance(part, And) and not alternatives.isdisjoint(part.parts))
    )


def extend(env: Env, loops: list[tuple[int, tuple[int, ...]]], spend: Callable[[int], None]) -> Iterator[Env]:
    """The environment with the given slots bound in every way (always the same list)."""
    if not loops:
        yield env
        return
    slot, members = loops[0]
    spend(len(members))
    for env[slot] in members:
        yield from extend(env, loops[1:], spend)
