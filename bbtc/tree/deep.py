"""Recursion as deep as a tree may be, without the interpreter's stack, which ends at some 1000 frames.

A function that calls itself is written as a generator: it yields the calls whose results it needs, and
returns its own result. Exceptions go through as they do through calls.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, TypeAlias, TypeVar

T = TypeVar("T")

Deep: TypeAlias = Generator[Any, Any, T]
"""A call that :func:`unwind` makes; ``result = yield function(…)`` is a call inside one."""


def unwind(call: Deep[T]) -> T:
    """The result of a deep call."""
    stack: list[Deep[Any]] = [call]
    value: Any = None
    error: Exception | None = None
    while stack:
        try:
            if error is None:
                inner = stack[-1].send(value)
            else:
                raised, error = error, None
                inner = stack[-1].throw(raised)
        except StopIteration as done:
            stack.pop()
            value = done.value
        except Exception as raised:
            stack.pop()
            if not stack:
                raise
            error = raised
        else:
            stack.append(inner)
            value = None
    result: T = value
    return result
