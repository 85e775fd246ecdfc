"""Which constructs of the language each of our domains uses."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

from bbtc.diagnostics import Report
from bbtc.files.sources import read_source
from bbtc.kleene import Truth
from bbtc.syntax import ast
from bbtc.syntax.parser import parse
from tests.domains.problems import PROBLEMS, REPOSITORY, Problem, task_of

Path: TypeAlias = tuple[Any, ...]
"""A node and the nodes around it, the outermost first."""


def paths(node: Any, above: Path = ()) -> Iterator[Path]:
    """Every node of a syntax tree, with what is around it."""
    if isinstance(node, tuple):
        for each in node:
            yield from paths(each, above)
    elif dataclasses.is_dataclass(node) and not isinstance(node, type):
        path = (*above, node)
        yield path
        for field in dataclasses.fields(node):
            if field.compare:
                yield from paths(getattr(node, field.name), path)


def _last(
    kind: type | tuple[type, ...], test: Callable[[Any], bool] = lambda _: True
) -> Callable[[Path], bool]:
    return lambda path: isinstance(path[-1], kind) and test(path[-1])


def _inside(kind: type, inner: Callable[[Path], bool]) -> Callable[[Path], bool]:
    return lambda path: inner(path) and any(isinstance(node, kind) for node in path[:-1])


def _sum(node: ast.Probabilistic) -> object:
    return sum(branch.probability.value for branch in node.branches)


_UNKNOWN = _last(ast.Assign, lambda node: node.value is Truth.UNKNOWN)

CONSTRUCTS: dict[str, Callable[[Path], bool]] = {
    "type hierarchy": _last(
        ast.TypedSection,
        lambda node: node.kind == "types" and any(t.key != "object" for g in node.entries for t in g.types),
    ),
    "`(either …)`": _last(ast.TypedGroup, lambda node: len(node.types) > 1),
    "`:constants`": _last(ast.TypedSection, lambda node: node.kind == "constants"),
    "`(= ?a ?b)`": _last(ast.Equality),
    "`not` in a condition": _last(ast.Not),
    "`or`": _last(ast.Or),
    "`imply`": _last(ast.Imply),
    "`exists`": _last(ast.Quantified, lambda node: node.kind == "exists"),
    "`forall` in a condition": _last(ast.Quantified, lambda node: node.kind == "forall"),
    "`forall` in an effect": _last(ast.EffectForall),
    "`when`": _last(ast.When),
    "`(unknown p)` in a condition": _last(ast.Test, lambda node: node.kind == "unknown"),
    "`(known p)`": _last(ast.Test, lambda node: node.kind == "known"),
    "`(unknown p)` as an effect": _inside(ast.Action, _UNKNOWN),
    "`(unknown p)` in `:init`": _inside(ast.Init, _UNKNOWN),
    "three-valued predicate declared": _last(ast.PredicateDeclaration, lambda node: node.three_valued),
    "`probabilistic`": _inside(ast.Action, _last(ast.Probabilistic)),
    "nested `probabilistic`": _inside(ast.Probabilistic, _last(ast.Probabilistic)),
    "`probabilistic` in `when`": _inside(ast.When, _last(ast.Probabilistic)),
    "probabilities that sum below 1": _last(ast.Probabilistic, lambda node: bool(_sum(node) != 1)),
    "fractions": _last(ast.Number, lambda node: "/" in node.text),
    "`probabilistic` in `:init`": _inside(ast.Init, _last(ast.Probabilistic)),
    "`oneof`": _last(ast.OneOf),
    "`:observe`": _last(ast.Action, lambda node: node.observe is not None),
    "noisy `:observe`": _last(ast.Observation, lambda node: isinstance(node.content, ast.Probabilistic)),
    "`:derived`": _last(ast.Derived),
    "`:exogenous`": _last(ast.Exogenous),
    "`:per second`": _last(ast.Exogenous, lambda node: node.per is not None and node.per.key == "second"),
    "`:while`": _last(ast.Action, lambda node: node.during is not None),
    "`:duration`": _last(ast.Timing, lambda node: node.duration is not None),
    "`:timeout`": _last(ast.Timing, lambda node: node.timeout is not None),
    "numbers as state": _last(ast.FunctionDeclaration, lambda node: node.range is not None),
    "action costs": _last(ast.FluentEffect, lambda node: node.fluent.name.key == "total-cost"),
    "cost of one outcome": _inside(
        ast.Probabilistic, _last(ast.FluentEffect, lambda node: node.fluent.name.key == "total-cost")
    ),
    "cost from a function": _inside(ast.FluentEffect, _last(ast.FluentRef, lambda node: bool(node.args))),
    "rewards": _last(ast.FluentEffect, lambda node: node.fluent.name.key == "reward"),
    "`:metric`": _last(ast.Metric),
    "`:goal-probability`": _last(ast.GoalNumber, lambda node: node.kind == "goal-probability"),
    "`:goal-reward`": _last(ast.GoalNumber, lambda node: node.kind == "goal-reward"),
    "goal of several conditions": _last(ast.Goal, lambda node: isinstance(node.formula, ast.And)),
    "`:template`": _last(ast.Template),
    "template without a guide": _last(ast.Template, lambda node: node.effect is None),
    "`sequence`": _last(ast.BodyControl, lambda node: node.kind == "sequence"),
    "`fallback`": _last(ast.BodyControl, lambda node: node.kind == "fallback"),
    "`skipper`": _last(ast.BodyControl, lambda node: node.kind == "skipper"),
    "`condition`": _last(ast.BodyCondition),
    "`foreach`": _last(ast.BodyForeach),
    "call of an action or template": _last(ast.BodyCall, lambda node: node.kind is None),
    "`(action …)`": _last(ast.BodyCall, lambda node: node.kind == "action"),
}
"""What to look for in the syntax tree of a file."""

INDEPENDENT = "independent chance effects (`factors`)"
"""Found in the ground task, not in the text."""


def used_by(problem: Problem) -> set[str]:
    """The constructs that a problem and its domain use."""
    report = Report()
    documents = [parse(read_source(str(REPOSITORY / file)), report) for file in problem.files]
    report.raise_errors()
    found = {
        name
        for document in documents
        for path in paths(document.definitions)
        for name, matches in CONSTRUCTS.items()
        if matches(path)
    }
    if any(len(action.factors) > 1 for action in task_of(problem).actions):
        found.add(INDEPENDENT)
    return found


def users() -> dict[str, list[str]]:
    """For each construct the domains that use it, in the order of the alphabet."""
    used = {problem: used_by(problem) for problem in PROBLEMS}
    return {
        name: sorted({problem.domain for problem in PROBLEMS if name in used[problem]})
        for name in [*CONSTRUCTS, INDEPENDENT]
    }
