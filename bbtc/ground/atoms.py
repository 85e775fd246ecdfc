"""The variables of a task, and lifted conditions made ground over them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import product

from typing_extensions import assert_never

from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import (
    FALSE,
    TRUE,
    Condition,
    Constant,
    Is,
    Known,
    conjunction,
    disjunction,
    negation,
)
from bbtc.ground.datalog import Row
from bbtc.ground.program import normal_form
from bbtc.ground.reach import Reach
from bbtc.ground.task import Variable
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import formula as mf
from bbtc.model.types import Parameter

Binding = Mapping[str, int]
_VALUES = (Truth.TRUE, Truth.FALSE, Truth.UNKNOWN)
_LARGEST_UNFOLDING = 100_000


class Atoms:
    """Ground atoms: those that can change, or stay unknown, are variables; others are constants.

    Ground leaves are made once and shared.
    """

    def __init__(self, model: md.Model, reach: Reach) -> None:
        self.model = model
        self.reach = reach
        self.names = tuple(model.objects)
        self.index = {name: position for position, name in enumerate(self.names)}
        self._members: dict[tuple[str, ...], list[int]] = {}
        self._rules: dict[str, list[md.Rule]] = {}
        for rule in model.rules:
            self._rules.setdefault(rule.predicate, []).append(rule)
        self._values = self._possible_values()
        self.variables = self._sorted_variables()
        self.numbers: dict[str, dict[Row, int]] = {}
        for number, (predicate, row) in enumerate(self._keys):
            self.numbers.setdefault(predicate, {})[row] = number
        self._leaves: dict[tuple[int, Truth], Is] = {}
        self._known: dict[int, Known] = {}
        self._unfolded: dict[tuple[str, Row], Condition] = {}
        self._unfoldings = 0

    def _possible_values(self) -> dict[tuple[str, Row], tuple[Truth, ...]]:
        """The values of every atom that may be something else than false."""
        reach = self.reach
        found: dict[tuple[str, Row], tuple[Truth, ...]] = {}
        for name in self.model.predicates:
            if name in self._rules:
                continue
            rows = reach.values[Truth.TRUE][name] | reach.values[Truth.UNKNOWN][name]
            for row in rows:
                found[name, row] = tuple(value for value in _VALUES if reach.can_be(value, name, row))
        return found

    def _sorted_variables(self) -> tuple[Variable, ...]:
        spans = {(fact.predicate, fact.args): fact.span for fact in self.model.init.facts}
        made = []
        for (predicate, row), values in self._values.items():
            if len(values) > 1 or values[0] is Truth.UNKNOWN:
                args = tuple(self.names[index] for index in row)
                span = spans.get((predicate, args)) or self.model.predicates[predicate].span
                made.append((Variable(predicate, args, Truth.UNKNOWN in values, span=span), (predicate, row)))
        made.sort(key=lambda each: each[0].name)
        self._keys = [key for _, key in made]
        return tuple(variable for variable, _ in made)

    # --- bindings ----------------------------------------------------------------------------

    def members(self, types: tuple[str, ...]) -> list[int]:
        """Indices of the objects of one of the types."""
        if types not in self._members:
            hierarchy = self.model.types
            self._members[types] = [
                index
                for index, each in enumerate(self.model.objects.values())
                if hierarchy.contains(types, each)
            ]
        return self._members[types]

    def bindings(self, parameters: Sequence[Parameter], binding: Binding) -> Iterable[Binding]:
        """The binding extended by the parameters in every way, in order of declaration."""
        if not parameters:
            return [binding]
        names = [parameter.name for parameter in parameters]
        rows = product(*(self.members(parameter.types) for parameter in parameters))
        return ({**binding, **dict(zip(names, row, strict=True))} for row in rows)

    def row(self, args: Iterable[mf.Term], binding: Binding) -> Row:
        """Object indices of the arguments."""
        return tuple([binding[arg] if arg[0] == "?" else self.index[arg] for arg in args])

    # --- conditions --------------------------------------------------------------------------

    def literal(self, predicate: str, row: Row, value: Truth, *, strict: bool) -> Condition:
        """``predicate(row)`` is ``value``; constant where it is always or never so. Where only
        truth matters (``strict``), a literal that can never be true is false."""
        values = self._values.get((predicate, row), (Truth.FALSE,))
        if values == (value,):
            return TRUE
        # A literal that can never be true may still be unknown, which matters unless strict.
        if value not in values and (strict or Truth.UNKNOWN not in values):
            return FALSE
        number = self.numbers[predicate][row]
        leaf = self._leaves.get((number, value))
        if leaf is None:
            leaf = self._leaves[number, value] = Is(number, value)
        return leaf

    def known(self, predicate: str, row: Row) -> Condition:
        """``(known p)``."""
        values = self._values.get((predicate, row), (Truth.FALSE,))
        if Truth.UNKNOWN not in values:
            return TRUE
        if len(values) == 1:
            return FALSE
        number = self.numbers[predicate][row]
        if number not in self._known:
            self._known[number] = Known(number)
        return self._known[number]

    def condition(self, formula: mf.Formula, binding: Binding, *, strict: bool = False) -> Condition:
        """A lifted condition made ground. ``strict``: only whether it is true matters."""
        return self._ground(normal_form(formula), binding, strict)

    def _ground(self, formula: mf.Formula, binding: Binding, strict: bool) -> Condition:
        match formula:
            case mf.Atom(predicate, args):
                row = self.row(args, binding)
                if predicate in self._rules:
                    return self._unfold(predicate, row, (), strict)
                return self.literal(predicate, row, Truth.TRUE, strict=strict)
            case mf.Not(mf.Atom(predicate, args)):
                row = self.row(args, binding)
                if predicate in self._rules:
                    return negation(self._unfold(predicate, row, (), False))
                return self.literal(predicate, row, Truth.FALSE, strict=strict)
            case mf.Equal(left, right):
                return Constant(self.row((left,), binding) == self.row((right,), binding))
            case mf.Not(mf.Equal(left, right)):
                return Constant(self.row((left,), binding) != self.row((right,), binding))
            case mf.Test(kind, atom):
                row = self.row(atom.args, binding)
                if atom.predicate in self._rules:
                    return self._derived_test(kind, atom, row)
                if kind == "known":
                    return self.known(atom.predicate, row)
                return self.literal(atom.predicate, row, Truth.UNKNOWN, strict=True)
            case mf.And(parts):
                return conjunction(self._ground(part, binding, strict) for part in parts)
            case mf.Or(parts):
                return disjunction(self._ground(part, binding, strict) for part in parts)
            case mf.Quantified(kind, parameters, inner):
                combine = conjunction if kind == "forall" else disjunction
                return combine(
                    self._ground(inner, each, strict) for each in self.bindings(parameters, binding)
                )
            case mf.Not():
                raise AssertionError("not in negation normal form")
            case _:
                assert_never(formula)

    # --- derived predicates ------------------------------------------------------------------

    def _unfold(
        self, predicate: str, row: Row, above: tuple[tuple[str, Row], ...], strict: bool
    ) -> Condition:
        """The condition a derived atom stands for.

        An atom within its own unfolding counts as false: in the least fixpoint, a proof that uses
        an atom to prove itself is never needed. Raises for a recursion that grows too large.
        """
        key = (predicate, row)
        if row not in self.reach.values[Truth.TRUE][predicate] and (
            strict or row not in self.reach.values[Truth.UNKNOWN][predicate]
        ):
            return FALSE
        if key in self._unfolded:
            return self._unfolded[key]
        if key in above:
            return FALSE
        self._unfoldings += 1
        if self._unfoldings > _LARGEST_UNFOLDING or len(above) > 200:
            raise BbtcError.single(
                "BBT0408",
                f"the derived predicate `{predicate}` is too deeply recursive to be unfolded",
                self._rules[predicate][0].span,
            )
        parts: list[Condition] = []
        for rule in self._rules[predicate]:
            binding: dict[str, int] = {}
            if not self._match(rule, row, binding):
                continue
            free = [parameter for parameter in rule.parameters if parameter.name not in binding]
            form = normal_form(rule.condition)
            every = self.bindings(free, binding)
            parts.extend(self._unfold_formula(form, each, (*above, key)) for each in every)
        result = disjunction(parts)
        if not above:
            self._unfolded[key] = result
        return result

    def _match(self, rule: md.Rule, row: Row, binding: dict[str, int]) -> bool:
        types = {parameter.name: parameter.types for parameter in rule.parameters}
        for arg, index in zip(rule.args, row, strict=True):
            if not mf.is_parameter(arg):
                if self.index[arg] != index:
                    return False
            elif binding.setdefault(arg, index) != index or index not in self.members(types[arg]):
                return False
        return True

    def _unfold_formula(
        self, formula: mf.Formula, binding: Binding, above: tuple[tuple[str, Row], ...]
    ) -> Condition:
        match formula:
            case mf.Atom(predicate, args) if predicate in self._rules:
                return self._unfold(predicate, self.row(args, binding), above, False)
            case mf.And(parts):
                return conjunction(self._unfold_formula(part, binding, above) for part in parts)
            case mf.Or(parts):
                return disjunction(self._unfold_formula(part, binding, above) for part in parts)
            case mf.Quantified(kind, parameters, inner):
                combine = conjunction if kind == "forall" else disjunction
                return combine(
                    self._unfold_formula(inner, each, above) for each in self.bindings(parameters, binding)
                )
            case _:
                # Negated and tested derived atoms are in a lower stratum: they start afresh.
                return self._ground(formula, binding, False)

    def _derived_test(self, kind: str, atom: mf.Atom, row: Row) -> Condition:
        value = self._unfold(atom.predicate, row, (), False)
        if isinstance(value, Constant):
            return Constant(kind == "known")
        if isinstance(value, Is) and value.value is not Truth.UNKNOWN:
            unknown = self.literal(*self._keys[value.variable], Truth.UNKNOWN, strict=True)
            return unknown if kind == "unknown" else negation(unknown)
        raise BbtcError.single(
            "BBT0408",
            f"`({kind} …)` of the derived predicate `{atom.predicate}` cannot be grounded",
            atom.span,
            "test the facts it is derived from",
        )
