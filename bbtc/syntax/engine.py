"""The LALR automaton of the grammar, run by a loop of our own.

Lark computes the tables (:mod:`bbtc.syntax.tables`). Its own loop makes an object with line and column for
every token and one more for every rule, which takes three times as long as the loop below; and planning
files come in megabytes.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from typing import Generic, NamedTuple, TypeAlias, TypeVar, cast

from bbtc.source import SourceFile, Span
from bbtc.syntax.tables import END, FLAGS, Production, Tables

_T = TypeVar("_T")
_SPACE = re.compile(r"\s*", FLAGS)
_tuple = tuple.__new__


class Token(NamedTuple):
    """A terminal as it stands in a file, with its range of characters."""

    kind: str
    text: str
    start: int
    end: int
    source: SourceFile

    @property
    def span(self) -> Span:
        """Where it stands."""
        return _tuple(Span, (self.source, self.start, self.end))

    def to(self, last: Token) -> Span:
        """The range from the start of this token to the end of another."""
        return _tuple(Span, (self.source, self.start, last.end))


# What completing a production does to the stack of values.
_CALL, _SINGLE, _LIST, _APPEND = range(4)
_Reduction: TypeAlias = tuple[int, str, tuple[int, ...], Callable[..., object] | None, int]
_Scanner: TypeAlias = Callable[[str, int], "re.Match[str] | None"]


class Unexpected(Exception):
    """No token of the grammar may stand at a position of the text."""

    def __init__(self, position: int, stack: list[int]) -> None:
        super().__init__(position)
        self.position, self.stack = position, stack


class TooDeep(Exception):
    """The stack of states is higher than allowed."""


class Engine(Generic[_T]):
    """A parser for one grammar; what the method of the start rule returns is a ``_T``.

    ``builder`` has a method for every rule or alias. The method takes the rule's children: tokens, what the
    methods of other rules returned, and a list for ``item*`` or ``item+``. To the engine all of them are
    objects: a test holds the types of the methods to the productions of the grammar.
    """

    def __init__(self, tables: Tables, builder: object) -> None:
        self._start, self._end = tables.start, tables.end
        self._actions = tables.actions
        self._goto = tables.goto
        self._reductions = [_reduction(production, builder) for production in tables.productions]
        self.terminals = tables.terminals
        self._scanners: dict[int, _Scanner] = {}
        self._compiled: dict[frozenset[str], _Scanner] = {}

    def parse(self, text: str, source: SourceFile, max_stack: int = sys.maxsize) -> _T:
        """The value of the start rule for a text, whose characters stand where those of the source do.

        Raises :class:`Unexpected` for a syntax error, and :class:`TooDeep` where the stack of states
        would exceed ``max_stack``. Every form that is open takes at least one state.
        """
        actions, goto, reductions, scanners = self._actions, self._goto, self._reductions, self._scanners
        token_of, state, end = tuple.__new__, self._start, self._end
        states: list[int] = [state]
        values: list[object] = []
        position = _SPACE.match(text).end()  # type: ignore[union-attr]
        while True:
            match = (scanners.get(state) or self._scanner(state))(text, position)
            if match is not None:
                kind: str = match.lastgroup  # type: ignore[assignment]  # every terminal is a group
                start, stop = match.span(match.lastindex or 0)
                token: Token | None = token_of(Token, (kind, text[start:stop], start, stop, source))
            elif position == len(text):
                kind, token = END, None
            else:
                raise Unexpected(position, states)
            while True:
                action = actions[state].get(kind)
                if action is None:
                    raise Unexpected(position, states)
                if action >= 0:
                    break
                size, origin, empty, call, shape = reductions[-1 - action]
                if shape == _APPEND:
                    # `list: list item` leaves the stack as it was before the item.
                    del states[-1]
                    value = values.pop()
                    values[-1].append(value)  # type: ignore[attr-defined]  # the list
                    state = states[-1]
                    continue
                if shape == _SINGLE:
                    del states[-1]
                else:
                    first = len(values) - size
                    children = values[first:]
                    del states[first + 1 :], values[first:]
                    if empty:
                        for at in empty:
                            children.insert(at, [])
                    values.append(children if call is None else call(*children))
                state = goto[states[-1]][origin]
                states.append(state)
                if state == end and kind == END:
                    return cast("_T", values[-1])
            states.append(action)
            if len(states) > max_stack:
                raise TooDeep
            values.append(token)
            state = action
            position = match.end()  # type: ignore[union-attr]

    def accepted(self, stack: list[int]) -> frozenset[str]:
        """The terminals that may follow where a stack of states stands."""
        return frozenset(kind for kind in self._actions[stack[-1]] if self._accepts(stack, kind))

    def _accepts(self, stack: list[int], kind: str) -> bool:
        states = list(stack)
        while True:
            action = self._actions[states[-1]].get(kind)
            if action is None:
                return False
            if action >= 0:
                return True
            size, origin, *_ = self._reductions[-1 - action]
            if size:
                del states[-size:]
            states.append(self._goto[states[-1]][origin])
            if states[-1] == self._end and kind == END:
                return True

    def _scanner(self, state: int) -> _Scanner:
        """The scanner for the terminals that a state can take, made when first needed."""
        kinds = frozenset(self._actions[state])
        if kinds not in self._compiled:
            choices = "|".join(
                f"(?P<{kind}>{regex})" for kind, regex in self.terminals.items() if kind in kinds
            )
            self._compiled[kinds] = re.compile(rf"(?:{choices or '(?!)'})\s*", FLAGS).match
        self._scanners[state] = self._compiled[kinds]
        return self._compiled[kinds]


def _reduction(production: Production, builder: object) -> _Reduction:
    origin, size, empty, call, single, grows = production
    if call is None:
        return size, origin, empty, None, _APPEND if grows else _LIST
    return size, origin, empty, None if single else getattr(builder, call), _SINGLE if single else _CALL
