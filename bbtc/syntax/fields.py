"""The fields of actions, templates, sensors and axioms: what stands behind each keyword, and which are
given."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

from bbtc.source import Span
from bbtc.syntax import ast
from bbtc.syntax.engine import Token
from bbtc.syntax.expressions import parameters_of
from bbtc.syntax.leaves import Misuse

_V_co = TypeVar("_V_co", covariant=True)


class Types(NamedTuple):
    """``- type`` or ``- (either type…)`` behind names."""

    names: tuple[ast.Name, ...]
    span: Span


class NumberRange(NamedTuple):
    """``- (int low high)`` behind a function, with what it spans."""

    range: ast.NumberRange
    span: Span


@dataclass(frozen=True, slots=True)
class Field(Generic[_V_co]):
    """One field of an action, a template, a sensor or an axiom: ``keyword value``."""

    keyword: Token
    value: _V_co


class Parameters(Field[ast.TypedList]):
    """``:parameters``, ``:vars``."""


class Condition(Field[ast.Formula]):
    """``:precondition``, ``:condition`` of a sensor, ``:context``."""


class Effect(Field[ast.Effect]):
    """``:effect``."""


class Observe(Field[ast.Observation | ast.SensingModel]):
    """``:observe``, ``:sensing-model``."""


class Distribution(Field[ast.Effect]):
    """``:distribution``."""


class Repeats(Field[bool]):
    """``:repeats``."""


class Uninterruptible(Field[bool]):
    """``:uninterruptible``."""


class Duration(Field[ast.Duration]):
    """``:duration``."""


class DurativeDuration(Field[ast.NumericExpression]):
    """``:duration`` of a durative action."""


class DurativeCondition(Field[ast.Timed]):
    """``:condition`` of a durative action."""


class DurativeEffect(Field[ast.Timed]):
    """``:effect`` of a durative action."""


class Timeout(Field[ast.NumericExpression]):
    """``:timeout``."""


class TimeoutProbability(Field[ast.Number]):
    """``:timeout-probability``."""


class OnTimeout(Field[ast.Effect]):
    """``:on-timeout``."""


class During(Field[ast.Formula]):
    """``:while``."""


class OnAbort(Field[ast.Effect]):
    """``:on-abort``."""


class Per(Field[ast.Name]):
    """``:per``."""


class Before(Field[tuple[ast.Name, ...]]):
    """``:before``."""


class Body(Field[ast.Body]):
    """``:body`` of a template."""


class Sensed(Field[ast.Observation]):
    """``:sensed``."""


class Implied(Field[ast.Formula]):
    """``:implies``."""


class Fields:
    """The fields of a form, by kind. Raises :class:`Misuse` if one is given twice."""

    def __init__(self, fields: Iterable[Field[object]]) -> None:
        self._found: dict[type, Field[object]] = {}
        for field in fields:
            before = self._found.setdefault(type(field), field)
            if before is not field:
                message = f"`{field.keyword.text.lower()}` is given twice"
                raise Misuse("BBT0110", message, field.keyword.span, None, before.keyword.span)

    def get(self, kind: type[Field[_V_co]]) -> _V_co | None:
        """The value of a kind of field, if it is given."""
        field = self._found.get(kind)
        return field.value if isinstance(field, kind) else None

    def need(self, kind: type[Field[_V_co]], keyword: str, what: str, name: Token) -> _V_co:
        """The value of a kind of field. Raises :class:`Misuse` if it is not given."""
        value = self.get(kind)
        if value is None:
            raise Misuse("BBT0111", f"{what} lacks `{keyword}`", name.span)
        return value

    def parameters(self, close: Token) -> ast.TypedList:
        """The parameters of a form that ends with a token."""
        return parameters_of(self.get(Parameters) or (), close)


def observed(formulas: list[ast.Formula]) -> ast.Observation:
    """What ``:observe`` or ``:sensed`` lists."""
    first, last = formulas[0].span, formulas[-1].span
    span = Span(first.source, first.start, last.end)
    content = formulas[0] if len(formulas) == 1 else ast.And(tuple(formulas), span)
    return ast.Observation(content, span)


def timing_of(fields: Fields, span: Span) -> ast.Timing | None:
    """What the fields of an action say of time, if anything."""
    duration, timeout = fields.get(Duration), fields.get(Timeout)
    chance, effect = fields.get(TimeoutProbability), fields.get(OnTimeout)
    given = any(each is not None for each in (duration, timeout, chance, effect))
    return ast.Timing(duration, timeout, chance, effect, span) if given else None
