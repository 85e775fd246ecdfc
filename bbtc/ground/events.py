"""Whether events of one draw can contradict each other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations

from typing_extensions import assert_never

from bbtc.diagnostics import Diagnostic, Related
from bbtc.ground.condition import (
    TRUE,
    And,
    Condition,
    Constant,
    Is,
    Known,
    Not,
    Or,
    Within,
    conjunction,
    in_digits,
    replaced,
    variables,
)
from bbtc.ground.task import GroundEvent, Variable, ground_name, outcomes_of
from bbtc.kleene import Truth
from bbtc.limits import Limits

_MOST_TRIED = 4096  # partial assignments, of the variables that two events read


def clashes(
    events: Iterable[GroundEvent], task_variables: Sequence[Variable], limits: Limits
) -> Iterator[Diagnostic]:
    """An error for each two events of the language that may set a fact to different values in one draw."""
    setters: dict[tuple[int, int], list[tuple[GroundEvent, Truth, Condition]]] = {}
    for event in events:
        for variable, value, when in dict.fromkeys(_settings(event)):
            setters.setdefault((event.round, variable), []).append((event, value, when))
    told: set[tuple[str, str, str]] = set()
    for (_, variable), found in setters.items():
        for (one, first, when), (other, second, then) in combinations(found, 2):
            fact = task_variables[variable]
            called = fact.name if fact.digit is None else ground_name(fact.digit.function, fact.args)
            key = (one.schema, other.schema, called.partition("(")[0])
            # Two changes of a number do not add up, even where they agree on a digit.
            agree = first is second and fact.digit is None
            if one is other or agree or key in told:
                continue
            limits.check_time("grounding")
            if _may_be_true(conjunction([when, then]), task_variables):
                told.add(key)
                yield Diagnostic(
                    "BBT0451",
                    f"events `{one.name}` and `{other.name}` may happen at once, and "
                    + (
                        f"set {fact.name} to {first.word} and {second.word}"
                        if fact.digit is None
                        else f"both change {called}"
                    ),
                    other.span,
                    f"say which happens first: `:before {other.schema}` in `{one.schema}`, or the other way "
                    "round; or let their preconditions exclude each other",
                    related=(Related(f"`{one.schema}`", one.span),),
                )


def _settings(event: GroundEvent) -> Iterator[tuple[int, Truth, Condition]]:
    """What an event may set a variable to, and where."""
    for outcome in outcomes_of(event.factors):
        for effect in outcome.effects:
            when = conjunction([event.precondition, TRUE if effect.when is None else effect.when])
            yield from ((variable, value, when) for variable, value in effect.sets)


def _may_be_true(condition: Condition, task_variables: Sequence[Variable]) -> bool:
    """Whether the condition is true in some state, reachable or not; yes, where it takes too long to tell."""
    normal = replaced(condition, lambda leaf: leaf)
    order = tuple(dict.fromkeys(variables(normal)))
    waiting: list[dict[int, Truth]] = [{}]
    for _ in range(_MOST_TRIED):
        if not waiting:
            return False
        state = waiting.pop()
        if _can_be_true(normal, state):
            if len(state) == len(order):
                return True
            variable = order[len(state)]
            waiting += [{**state, variable: value} for value in task_variables[variable].values]
    return True


def _can_be_true(condition: Condition, state: Mapping[int, Truth]) -> bool:
    """Whether a condition in negation normal form may be true where some variables have these values."""
    match condition:
        case Is(variable, value):
            return state.get(variable, value) is value
        case Known(variable):
            return state.get(variable) is not Truth.UNKNOWN
        case Within():
            return _can_be_true(in_digits(condition), state)
        case And(parts):
            return all(_can_be_true(part, state) for part in parts)
        case Or(parts):
            return any(_can_be_true(part, state) for part in parts)
        case Constant(value):
            return value
        case Not():
            raise AssertionError("not in normal form")
        case _:
            assert_never(condition)
