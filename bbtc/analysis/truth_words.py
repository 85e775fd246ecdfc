"""What ``(known a)`` and ``(unknown a)`` say: the test of a fact, or a fact of a predicate with that name.

Where a predicate ``known`` with one argument is declared, ``(known a)`` is its fact, whatever ``a`` is; else
``a`` is short for the fact ``(a)``. ``(known (p))`` is the test always.
"""

from __future__ import annotations

from typing import Literal

from bbtc.analysis.names import Names
from bbtc.diagnostics import Diagnostic
from bbtc.kleene import Truth
from bbtc.syntax import ast
from bbtc.syntax.words import TEST_WORDS


def tested(names: Names, node: ast.Atom) -> ast.Test | None:
    """The test that a flat atom stands for; None where it is a fact."""
    key = node.predicate.key
    if key not in TEST_WORDS or len(node.args) != 1:
        return None
    (argument,) = node.args
    if not isinstance(argument, ast.Name):
        return None
    kind: Literal["known", "unknown"] = "known" if key == "known" else "unknown"
    atom = ast.Atom(argument, (), argument.span)
    test = ast.Test(kind, atom, node.span)
    declared = names.predicates.get(key)
    if declared is None or len(declared.parameters) != 1:
        return test
    fact = names.predicates.get(argument.key)
    if fact is None or fact.parameters or fact.inferred:
        return None
    # The argument names a fact, too: the test may have been meant.
    hint = f"the test of a fact is `({key} ({argument.text}))`"
    if argument.key in names.objects:
        message = f"`({key} {argument.text})` is read as a fact of the predicate `{key}`"
        names.report.add(Diagnostic("BBT0227", message, node.span, hint))
        return None
    meant = f"`{key}` is a predicate here; {hint}"
    names.unknown("BBT0203", "object", argument, names.objects, meant)
    return test


def assigned(names: Names, node: ast.Assign) -> ast.Assign | None:
    """What an assignment sets, ``(unknown p)`` read as ``(unknown (p))``; None after an error."""
    test = tested(names, node.atom)
    if test is None:
        return node
    assert isinstance(test.atom, ast.Atom)  # the argument
    if test.kind == "unknown" and node.value is Truth.TRUE:
        return ast.Assign(test.atom, Truth.UNKNOWN, node.span)
    names.report.error(
        "BBT0101",
        f"`({test.kind} {test.atom.predicate.text})` is a test, and no fact that can be set",
        node.span,
        "a fact is made true as `(p)`, false as `(not (p))`, unknown as `(unknown (p))`",
    )
    return None
