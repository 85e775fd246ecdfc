"""The declarations of a run: look-up by key, nearest names, and the errors about them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Protocol, TypeVar

from bbtc.analysis.undeclared import Uses, likely, slip, uses_of
from bbtc.diagnostics import Related, Report
from bbtc.model.domain import Function, Predicate, Threshold
from bbtc.model.formula import Equal, Formula, Quantified, Term
from bbtc.model.types import OBJECT, Object, Parameter, Type, TypeHierarchy
from bbtc.source import Span
from bbtc.syntax import ast
from bbtc.syntax.words import TEST_WORDS

Scope = Mapping[str, Parameter]
_NO_TYPE = ""
"""Stands for a type that is not known, which has been reported: it fits everything."""
_TOLD = 10
"""How many undeclared names of a kind are told one by one."""
_COMPARISONS = 30_000
"""How often an undeclared name is compared with a declared one, which takes time: beyond that, names count
as unlike any other. There are files that declare nothing."""
_TYPES = 1000
"""How many types are inferred."""


class Declared(Protocol):
    """Anything that was declared somewhere."""

    @property
    def name(self) -> str: ...
    @property
    def span(self) -> Span | None: ...


_D = TypeVar("_D", bound=Declared)


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
    events: dict[str, Signature] = field(default_factory=dict)
    templates: dict[str, Signature] = field(default_factory=dict)
    costs: frozenset[str] = frozenset({"total-cost"})
    rewards: frozenset[str] = frozenset({"reward"})
    counted: frozenset[str] = frozenset({"total-cost", "reward"})
    """Those of both that count: the one that a metric names takes the place of its like."""
    weights: dict[str, Fraction] = field(default_factory=dict)
    """How much each of them counts; 1 where nothing is said."""
    per_action: Fraction = Fraction(0)
    """What each action counts besides."""
    section: str = ""
    definitions: tuple[ast.Definition, ...] = ()
    derived: frozenset[str] = frozenset()
    """Keys of the predicates that have rules."""
    thresholds: dict[str, Threshold] = field(default_factory=dict)
    """What ``(believed …)`` asks, by the predicate that stands for it."""
    in_problem: bool = False
    """What is being read is the problem's."""
    lenient: bool = False
    """Names that are taken for slips are read as what they say, with a warning."""
    _told: set[tuple[str, str, str]] = field(default_factory=set)
    _known: dict[str, dict[str, Declared]] = field(default_factory=dict)
    _inferred: dict[tuple[str, str], None] = field(default_factory=dict)
    """Kind and key of what is taken as declared."""
    _counts: Counter[str] = field(default_factory=Counter)
    _comparisons: int = 0
    _slips: dict[tuple[str, str, int | None], str | None] = field(default_factory=dict)
    _told_in_sum: dict[str, ast.Term] = field(default_factory=dict)
    _uses: Uses | None = None

    def unknown(
        self, code: str, kind: str, name: ast.Term, known: Mapping[str, Declared], meant: str | None = None
    ) -> None:
        """Report a name that nothing declares, with what is ``meant`` where that is plain, else with the
        nearest name that is declared."""
        key = name.key
        if (self.section, kind, key) in self._told:
            return
        self._told.add((self.section, kind, key))
        if meant is not None:
            self.report.error(code, f"unknown {kind} `{name.text}`", name.span, meant)
            return
        near = None
        if self._compares(known):
            near = slip(key, known) or nearest(key, known)
        hint: str | None = None
        related: list[Related] = []
        if near is not None:
            hint = f"did you mean `{near}`?"
            if known[near].span is not None:
                related = [self._declared_here(kind, known[near])]
        elif not known:
            hint = f"no {kind} is declared"
        elif len(known) <= 8:
            hint = "declared: " + ", ".join(f"`{name}`" for name in known)
        self.report.error(code, f"unknown {kind} `{name.text}`", name.span, hint, related)

    # --- what is taken as declared -------------------------------------------------------

    @property
    def uses(self) -> Uses:
        """Where names stand; found when first asked for, since most files declare what they use."""
        if self._uses is None:
            self._uses = uses_of(self.definitions)
        return self._uses

    def _stands_alone(self, key: str) -> bool:
        """Does the name of a predicate or an object stand in one action, rule, `:init` or the like only?"""
        return len(self.uses.names.get(key, ())) < 2

    def _declared_here(self, kind: str, declared: Declared) -> Related:
        word = "first used" if (kind, declared.name) in self._inferred else "declared"
        return Related(f"`{declared.name}` is {word} here", declared.span)

    def _declared(self, kind: str, known: Mapping[str, _D]) -> Mapping[str, _D]:
        """Those of the known names that are declared, not inferred. What is declared is known before the
        first name is inferred."""
        if kind not in self._known:
            self._known[kind] = dict(known)
        return self._known[kind]  # type: ignore[return-value]

    def _compares(self, known: Collection[str]) -> bool:
        """May one more name be compared with these?"""
        self._comparisons += len(known)
        return self._comparisons <= _COMPARISONS

    def _slip(
        self, kind: str, key: str, known: Mapping[str, Declared], arity: int | None = None
    ) -> str | None:
        """The declared name that a name is a likely misspelling of; a predicate's has as many arguments."""
        about = (kind, key, arity)
        if about not in self._slips:
            if not self._compares(known):
                return None
            alike: Iterable[str] = known
            if arity is not None:
                alike = [each for each in known if len(self.predicates[each].parameters) == arity]
            self._slips[about] = slip(key, alike)
        return self._slips[about]

    def _infer(self, kind: str, name: ast.Term, reading: str, near: str | None = None) -> None:
        """Say that a name is taken as declared, and as what."""
        self._inferred[kind, name.key] = None
        self._counts[kind] += 1
        if self._counts[kind] > _TOLD:
            self._told_in_sum[kind] = name
            return
        hint = reading if near is None else f"{reading}; did you mean `{near}`?"
        self.report.warning("BBT0225", f"{kind} `{name.text}` is not declared", name.span, hint)

    def _let_through(self, kind: str, name: ast.Term, reading: str, near: str | None) -> None:
        """Say of a name that only a lenient reading takes what it is taken for."""
        self._inferred[kind, name.key] = None
        hint = reading if near is None else f"{reading}; did you mean `{near}`?"
        self.report.warning("BBT0230", f"{kind} `{name.text}` is not declared", name.span, hint)

    def finish(self) -> None:
        """Count what is taken as declared beyond the names that were told one by one."""
        for kind, name in self._told_in_sum.items():
            more = self._counts[kind] - _TOLD
            self.report.warning(
                "BBT0225",
                f"{more} more {kind}s are not declared, `{name.text}` the last of them"
                if more > 1
                else f"{kind} `{name.text}` is not declared",
                name.span,
                "they are taken as the ones above" if more > 1 else "it is taken as the ones above",
            )

    def predicate(self, name: ast.Name, args: Sequence[ast.Term]) -> Predicate | None:
        """The predicate of a name. One that is not declared is inferred from its use, or is an error where
        it seems misspelt, or where nothing gives it a value and one section alone reads it."""
        key = name.key
        found = self.predicates.get(key)
        if found is not None:
            return found
        known = self._declared("predicate", self.predicates)
        meant = self._no_predicate(key, args)
        if meant is not None:
            self.unknown("BBT0202", "predicate", name, known, meant)
            return None
        near, alone = self._slip("predicate", key, known, len(args)), self._stands_alone(key)
        if (alone and (near is not None or key not in self.uses.given)) or key in self.hierarchy.types:
            if not self.lenient:
                self.unknown("BBT0202", "predicate", name, known)
                return None
            self._let_through("predicate", name, "it is a predicate of its own", near)
        parameters = tuple(Parameter(f"?{number}") for number in range(1, len(args) + 1))
        derived = key in self.derived
        self.predicates[key] = Predicate(key, parameters, derived=derived, span=name.span, inferred=True)
        where = f"with {_count(len(args))}" if args else "without arguments"
        if ("predicate", key) not in self._inferred:
            self._infer("predicate", name, f"it is taken as a predicate {where}", near)
        return self.predicates[key]

    def _no_predicate(self, key: str, args: Sequence[ast.Term]) -> str | None:
        """What is meant by a name that has the place of a predicate and is a function, or a word of the
        language that lacks the parentheses within."""
        if key in TEST_WORDS and args:
            if isinstance(args[0], ast.Variable):
                return f"`({key} (p …))` tests a fact; a predicate of this name needs a declaration"
            return f"write `({key} ({' '.join(arg.text for arg in args[:8])}))`"
        if key in self.functions:
            return f"`{key}` is a function, whose values are numbers: `(= ({key}{' …' if args else ''}) 1)`"
        return None

    def _inferred_object(self, name: ast.Name, types: tuple[str, ...]) -> bool:
        """Take a name that actions use as a constant of the type that its place has. In a problem, where the
        objects are listed, it is an error, and so is a name that seems misspelt."""
        key = name.key
        if self.in_problem or len(types) > 1 or _NO_TYPE in types:
            return False
        known = self._declared("object", self.objects)
        near = self._slip("object", key, known)
        if key in known or (near is not None and self._stands_alone(key)):
            return False
        before = self.objects.get(key)
        if before is None:
            self._infer("object", name, f"it is taken as a constant of type {type_words(types)}", near)
            self.objects[key] = Object(key, types, name.span)
        elif not self.hierarchy.contains(types, before):
            self.objects[key] = Object(key, tuple(dict.fromkeys((*before.types, *types))), before.span)
        return True

    def _inferred_type(self, name: ast.Name) -> str:
        """The type that an undeclared name stands for: itself, taken as declared; ``object`` if nothing has
        it but the place of a predicate, where a type only says what may stand there; none after reporting
        what seems misspelt, be it here or in its declaration, or a type that one action alone knows."""
        key = name.key
        known = {k: t for k, t in self._declared("type", self.hierarchy.types).items() if k != OBJECT}
        near, alone = self._slip("type", key, known), len(self.uses.types[key]) < 2
        if self.section in {"predicates", "functions"} and key not in self.uses.bound:
            if ("type", key) not in self._inferred:
                self._infer("type", name, "anything is taken to fit here", near)
            return OBJECT
        idle = bool(known) and self.section != "objects"
        unused = near is not None and near not in self.uses.types  # then the declaration is misspelt
        refused = unused or self._counts["type"] >= _TYPES
        if not refused and (not alone or (near is None and not idle)):
            self._infer("type", name, "it is taken as a type without supertype", near)
            added = {key: Type(key, (), name.span)}
            self.hierarchy = TypeHierarchy({**self.hierarchy.types, **added})
            return key
        self.unknown("BBT0201", "type", name, known)
        return _NO_TYPE

    def type_test(self, atom: ast.Atom, scope: Scope) -> Formula | None:
        """``(room ?x)``, with the name of a type and not of a predicate: ``?x`` is of that type."""
        key = atom.predicate.key
        if key in self.predicates or key == OBJECT or len(atom.args) != 1 or key not in self.hierarchy.types:
            return None
        found = self.term(atom.args[0], scope)
        if found is None:
            return None
        if ("predicate", key) not in self._inferred:
            self._infer("predicate", atom.predicate, f"it is taken as a test for the type `{key}`")
        fresh = f"?{key}'"
        while fresh in {parameter.name for parameter in scope.values()}:
            fresh += "'"
        same = Equal(found[0], fresh, atom.span)
        return Quantified("exists", (Parameter(fresh, (key,), atom.span),), same, atom.span)

    # --- types ---------------------------------------------------------------------------

    def types(self, names: Sequence[ast.Name]) -> tuple[str, ...]:
        """Keys of the types of a typed list (``object`` where none is given)."""
        found: dict[str, None] = {}
        for name in names:
            if name.key in self.hierarchy.types:
                found[name.key] = None
            else:
                found[self._inferred_type(name)] = None
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

    def term(
        self, term: ast.Term, scope: Scope, wanted: tuple[str, ...] = (OBJECT,)
    ) -> tuple[Term, tuple[str, ...]] | None:
        """A term and its types, or None after reporting that it is unknown. ``wanted`` are the types of its
        place."""
        key = term.key
        if isinstance(term, ast.Variable):
            parameter = scope.get(key)
            if parameter is not None:
                return parameter.name, parameter.types
            self.unknown("BBT0204", "parameter", term, scope)
            return None
        if (key not in self.objects or ("object", key) in self._inferred) and not self.lenient:
            if f"?{key}" in scope:
                meant = f"did you mean the parameter `?{term.text}`?"
                self.unknown("BBT0203", "object", term, self.objects, meant)
                return None
            self._inferred_object(term, wanted)
        thing = self.objects.get(key)
        if thing is not None:
            return key, thing.types or (_NO_TYPE,)
        if self.lenient:
            # An object without a type: no parameter and no quantifier takes it.
            near = self._slip("object", key, self._declared("object", self.objects))
            self.objects[key] = Object(key, (), term.span)
            self._let_through("object", term, "it is an object of its own that no parameter takes", near)
            return key, (_NO_TYPE,)
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
                [self._declared_here(kind, declared)],
            )
            for arg in args:
                self.term(arg, scope)
            return None
        result: list[Term] = []
        for position, (arg, parameter) in enumerate(zip(args, parameters, strict=True), 1):
            found = self.term(arg, scope, parameter.types)
            if found is None:
                continue
            if not self._fits(arg, found[1], parameter.types):
                self.report.error(
                    "BBT0207",
                    f"argument {position} of {kind} `{shown}` must be {type_words(parameter.types)}, "
                    f"but `{arg.text}` is {type_words(found[1])}",
                    arg.span,
                    related=[self._declared_here(kind, declared)],
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
    from difflib import get_close_matches

    matches = get_close_matches(key[:100], likely(key, known), 1, 0.7)
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
