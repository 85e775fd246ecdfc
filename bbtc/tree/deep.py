"""Recursion as deep as a tree or a condition may be, though the interpreter's stack ends at some 1000 frames.

What is bounded by nothing but memory does not recurse. What may be as deep as a tree (256 levels) with more
than a frame or two for each level is written as a generator: it yields the calls whose results it needs, and
returns its own result; :func:`unwind` runs it. Exceptions go through as they do through calls. Conditions are
as deep as ``--max-depth`` allows: for them commands make room on the stack (:func:`stack_room`).
"""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Generator, Iterator
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


FRAME_BYTES = 1024
"""More of the machine's stack than a frame of ours ever takes: comparing nested frozen dataclasses, the
worst that happens, takes two thirds of it."""

_MOST_FRAMES = 20_000
_SPARED = 1 << 20  # bytes of the stack, for what is called at its end


@contextlib.contextmanager
def stack_room() -> Iterator[None]:
    """Let functions call themselves as deeply as the stack of the main thread holds, some 7000 frames where
    it has the usual 8 MiB, for as long as the context lasts. Changes nothing in other threads, and where the
    system does not tell the size of the stack."""
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(max(before, min(_MOST_FRAMES, (_stack_bytes() - _SPARED) // FRAME_BYTES)))
    try:
        yield
    finally:
        sys.setrecursionlimit(before)


def _stack_bytes() -> int:
    if threading.current_thread() is not threading.main_thread():
        return 0
    try:
        import resource
    except ImportError:  # Windows
        return 0
    soft, _ = resource.getrlimit(resource.RLIMIT_STACK)
    return sys.maxsize if soft == resource.RLIM_INFINITY else soft
