"""The declarations of a run: look-up by key, nearest names, and the errors about them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from bbtc.diagnostics import Related, Report
from bbtc.model.domain import Function, Predicate
from bbtc.model.formula import Term
from bbtc.model.types import OBJECT, Object, Parameter, Type, TypeHierarchy
from bbtc.source import Span
from bbtc.syntax import ast

Scope = Mapping[str, Parameter]
_NO_TYPE = ""
"""Stands for a type that is not known, which has been reported: it fits everything."""


class Declared(Protocol):
    """Anything that was declared somewhere."""

    @property
    def name(self) -> str: ...
    @property
    def span(self) -> Span | None: ...


class Parameterised(Declared, Protocol):
    """A declaration with parameters."""

    @property
    def parameters(self) -> tuple[Parameter, ...]: ...


@dataclass(frozen=True, slots=True)
class Signature:
    """Name and parameters of an action or a template, known before its body is read."""

    name: str
    parameters: tuple[Parameter, ...]
    span: Span | None


@dataclass(slots=True)
class Names:
    """What has been declared so far. ``section`` names what is being read (``action detect``):
    an unknown name is reported once per section, not at every use."""

    report: Report
    hierarchy: TypeHierarchy = field(default_factory=lambda: TypeHierarchy({OBJECT: Type(OBJECT, ())}))
    objects: dict[str, Object] = field(default_factory=dict)
    predicates: dict[str, Predicate] = field(default_factory=dict)
    functions: dict[str, Function] = field(default_factory=dict)
    actions: dict[str, Signature] = field(default_factory=dict)
    templates: dict[str, Signature] = field(default_factory=dict)
    costs: frozenset[str] = frozenset({"total-cost"})
    rewards: frozenset[str] = frozenset({"reward"})
    section: str = ""
    _told: set[tuple[str, str, str]] = field(default_factory=set)

    def unknown(self, code: str, kind: str, name: ast.Term, known: Mapping[str, Declared]) -> None:
        """Report a name that nothing declares, with the nearest one that is."""
        key = name.key
        if (self.section, kind, key) in self._told:
            return
        self._told.add((self.section, kind, key))
        near = nearest(key, known)
        hint: str | None = None
        related: list[Related] = []
        if near is not None:
            hint = f"did you mean `{near}`?"
            if known[near].span is not None:
                related = [Related(f"`{near}` is declared here", known[near].span)]
        elif not known:
            hint = f"no {kind} is declared"
        elif len(known) <= 8:
            hint = "declared: " + ", ".join(f"`{name}`" for name in known)
        self.report.error(code, f"unknown {kind} `{name.text}`", name.span, hint, related)

    # --- types ---------------------------------------------------------------------------

    def types(self, names: Sequence[ast.Name]) -> tuple[str, ...]:
        """Keys of the types of a typed list (``object`` where none is given)."""
        found: dict[str, None] = {}
        for name in names:
            if name.key in self.hierarchy.types:
                found[name.key] = None
            else:
                known = {key: type_ for key, type_ in self.hierarchy.types.items() if key != OBJECT}
                self.unknown("BBT0201", "type", name, known)
                found[_NO_TYPE] = None
        return tuple(found) or (OBJECT,)

    def parameters(self, groups: ast.TypedList) -> tuple[Parameter, ...]:
        """A parameter list; a name given twice is an error."""
        result: dict[str, Parameter] = {}
        for group in groups:
            types = self.types(group.types)
            for name in group.names:
                if name.key in result:
                    self.report.error(
                        "BBT0208",
                        f"parameter `{name.text}` is declared twice",
                        name.span,
                        related=[Related("first declared here", result[name.key].span)],
                    )
                else:
                    result[name.key] = Parameter(name.key, types, name.span)
        return tuple(result.values())

    # --- terms ---------------------------------------------------------------------------

    def term(self, term: ast.Term, scope: Scope) -> tuple[Term, tuple[str, ...]] | None:
        """A term and its types, or None after reporting that it is unknown."""
        key = term.key
        if isinstance(term, ast.Variable):
            parameter = scope.get(key)
            if parameter is not None:
                return parameter.name, parameter.types
            self.unknown("BBT0204", "parameter", term, scope)
            return None
        thing = self.objects.get(key)
        if thing is not None:
            return key, thing.types
        self.unknown("BBT0203", "object", term, self.objects)
        return None

    def arguments(
        self,
        kind: str,
        name: ast.Name,
        declared: Parameterised,
        args: Sequence[ast.Term],
        scope: Scope,
        *,
        span: Span,
    ) -> tuple[Term, ...] | None:
        """The arguments of a use, checked against the declared parameters; None after an error."""
        shown, parameters = name.text, declared.parameters
        if len(args) != len(parameters):
            self.report.error(
                "BBT0206",
                f"{kind} `{shown}` takes {_count(len(parameters))}, not {len(args)}",
                span,
                f"write it as `{written(declared.name, parameters)}`",
                [Related(f"`{declared.name}` is declared here", declared.span)],
            )
            for arg in args:
                self.term(arg, scope)
            return None
        result: list[Term] = []
        for position, (arg, parameter) in enumerate(zip(args, parameters, strict=True), 1):
            found = self.term(arg, scope)
            if found is None:
                continue
            if not self._fits(arg, found[1], parameter.types):
                self.report.error(
                    "BBT0207",
                    f"argument {position} of {kind} `{shown}` must be {type_words(parameter.types)}, "
                    f"but `{arg.text}` is {type_words(found[1])}",
                    arg.span,
                    related=[Related(f"`{declared.name}` is declared here", declared.span)],
                )
                continue
            result.append(found[0])
        return tuple(result) if len(result) == len(args) else None

    def _fits(self, arg: ast.Term, given: tuple[str, ...], wanted: tuple[str, ...]) -> bool:
        """An object must be of the wanted type. A parameter may be of a more general one, as in
        many public files: its bindings decide."""
        if wanted in {given, (OBJECT,)} or _NO_TYPE in given or _NO_TYPE in wanted:
            return True
        if isinstance(arg, ast.Name):
            return self.hierarchy.contains(wanted, self.objects[arg.key])
        return self.hierarchy.overlaps(given, wanted)


def nearest(key: str, known: Iterable[str]) -> str | None:
    """The known name closest in spelling, if one is close."""
    # Spelling distance is quadratic: on a very large problem look at likely names only.
    names = list(known)
    if len(names) > 2000:
        names = [name for name in names if name[:1] == key[:1] and abs(len(name) - len(key)) <= 2][:2000]
    matches = difflib.get_close_matches(key[:100], names, 1, 0.7)
    return matches[0] if matches else None


def type_words(types: Sequence[str]) -> str:
    """``block`` or ``(either block table)``, as text for messages."""
    return f"`{types[0]}`" if len(types) == 1 else f"`(either {' '.join(types)})`"


def written(name: str, parameters: Sequence[Parameter]) -> str:
    """How something with parameters is written: ``(on ?x - block ?y - block)``."""
    parts = [name]
    for parameter in parameters:
        types = parameter.types
        suffix = "" if types == (OBJECT,) else f" - {type_words(types).strip('`')}"
        parts.append(f"{parameter.name}{suffix}")
    return f"({' '.join(parts)})"


def _count(number: int) -> str:
    return "no arguments" if number == 0 else "1 argument" if number == 1 else f"{number} arguments"
