"""Random small domains with a problem, as text: all of the language but what is refused."""

from __future__ import annotations

import re
from random import Random

_ABOVE = {
    "a": {"a", "top", "object"},
    "b": {"b", "top", "object"},
    "both": {"both", "a", "b", "top", "object"},
    "top": {"top", "object"},
    "object": {"object"},
}
_EITHER = "(either a b)"
_CHANCES = ["0.5 {} 0.5 {}", "1/3 {} .25 {}", "0.2 {}", "1 {} 0 {}", "0.1 {} 0.2 {} 0.7 {}", "0.9 {}"]
_RATES = ["0.3", "0.3", "1/100", "1"]
_DURATIONS = ["2", "0", "1.5", "(uniform 1 4)", "(triangular 0 2 5)", "(empirical (1 0.5) (3 0.5))"]
_DRAWS = re.compile(r"probabilistic|oneof")
_AMOUNTS = ["1", "1/2", "(base)", "(+ 1 (base))", "(* 2 (+ (base) 0.5))"]

Scope = dict[str, str]
"""The type of each parameter."""


class _Writer:
    def __init__(self, seed: int) -> None:
        self.random = random = Random(seed)
        self.others = Random(~seed)
        every = {"o1": "a", "o2": "a", "o3": "b", "o4": random.choice(["both", _EITHER])}
        self.objects = {name: kind for name, kind in every.items() if name == "o1" or random.random() < 0.6}
        self.constants = [name for name in self.objects if random.random() < 0.5]
        # A predicate may have the name of a test.
        unary = random.choice(["q"] * 8 + ["known", "unknown"])
        self.fluents = {"p": [], unary: ["a"], "r": [random.choice(["top", _EITHER, "object"])]}
        self.static = {"h": [], "fixed": ["top"]}
        self.derived = {
            name: types
            for name, types in {"d": ["top"], "c": ["a"], "e": []}.items()
            if random.random() < 0.5
        }
        self.unary = unary
        self.callable: dict[str, list[str]] = {}
        self.scopes: dict[str, Scope] = {}
        self.declared = {**self.fluents, **self.static, **self.derived}
        self.cost = random.choice(["total-cost", "fuel", ""])

    def among(self, *texts: str) -> str:
        return self.random.choice(texts)

    def terms(self, scope: Scope, wanted: str, objects: list[str]) -> list[str]:
        types = {"a", "b"} if wanted == _EITHER else {wanted}

        def fits(kind: str) -> bool:
            given = {"a", "b"} if kind == _EITHER else {kind}
            return any(_ABOVE[name] & types for name in given)

        return [name for name, kind in scope.items() if fits(kind)] * 3 + [
            name for name in objects if fits(self.objects[name])
        ]

    def atom(self, scope: Scope, names: dict[str, list[str]], objects: list[str] | None = None) -> str:
        name = self.random.choice(list(names))
        found = [self.terms(scope, t, self.constants if objects is None else objects) for t in names[name]]
        if not all(found):
            return "(p)"
        return f"({' '.join([self.among(name, name, name.upper()), *map(self.random.choice, found)])})"

    def parameters(self, names: str, most: int) -> tuple[str, Scope]:
        chosen = self.random.sample(names.split(), self.random.randint(0, most))
        scope = {name: self.among("a", "b", "top", "object", "both", _EITHER) for name in chosen}
        return " ".join(f"{name} - {kind}" for name, kind in scope.items()), scope

    def read(self, scope: Scope, objects: list[str] | None = None) -> str:
        """An atom that a condition reads: as often of a rule's predicate as of another."""
        rules = bool(self.derived) and self.random.random() < 0.5
        return self.atom(scope, self.derived if rules else self.declared, objects)

    def tested(self, atom: str) -> str:
        """A test of an atom; of one without arguments also without its parentheses."""
        kind = self.among("unknown", "known")
        bare = atom in {"(p)", "(h)", "(e)"} and kind != self.unary and self.random.random() < 0.2
        return f"({kind} {atom[1:-1] if bare else atom})"

    def condition(
        self, scope: Scope, depth: int, names: dict[str, list[str]], objects: list[str] | None = None
    ) -> str:
        def inner(inside: Scope = scope) -> str:
            return self.condition(inside, depth - 1, names, objects)

        everything = names is self.declared
        atom = self.read(scope, objects) if everything else self.atom(scope, names, objects)
        drawn = self.random.random()
        if depth <= 0 or drawn < 0.45:
            terms = self.terms(scope, "object", self.constants)
            equal = f"(= {self.random.choice(terms)} {self.random.choice(terms)})" if terms else "()"
            return self.among(
                atom, atom, f"(not {atom})", f"( not  {atom} )", self.tested(atom), self.tested(atom), equal
            )
        if drawn < 0.75:
            kind = self.among("and", "and", "or")
            return f"({kind} {' '.join(inner() for _ in range(self.random.randint(0, 3)))})"
        if drawn < 0.85:
            return self.among(f"(imply {inner()} {inner()})", f"(not {inner()})")
        listed, more = self.parameters("?x ?y ?z", 2)
        return f"({self.among('exists', 'forall')} ({listed}) {inner({**scope, **more})})"

    def increase(self) -> str:
        fluent = self.among(self.cost, self.cost, "total-cost")
        return f"(increase ({fluent}) {self.among(*_AMOUNTS)})"

    def effect(self, scope: Scope, depth: int, *, priced: bool = True) -> str:
        def inner(inside: Scope = scope) -> str:
            return self.effect(inside, depth - 1, priced=priced)

        drawn = self.random.random()
        if depth <= 0 or drawn < 0.4:
            atom = self.atom(scope, self.fluents)
            if self.cost and priced and drawn < 0.1:
                return self.increase()
            return self.among(atom, atom, f"(not {atom})", f"(unknown {atom})")
        if drawn < 0.55:
            return f"(and {' '.join(inner() for _ in range(self.random.randint(0, 3)))})"
        if drawn < 0.68:
            return f"(when {self.condition(scope, 1, self.declared)} {inner()})"
        if drawn < 0.75:
            listed, more = self.parameters("?x ?y ?z", 1)
            return f"(forall ({listed}) {inner({**scope, **more})})"
        if drawn < 0.93:
            shares = self.random.choice(_CHANCES)
            return f"(probabilistic {shares.format(*(inner() for _ in range(3)))})"
        return f"(oneof {' '.join(inner() for _ in range(self.random.randint(1, 3)))})"

    def action(self, name: str) -> str:
        listed, scope = self.parameters("?x ?y", 2)
        self.scopes[name] = scope
        self.callable[name] = list(scope.values())
        atom, other = self.atom(scope, self.fluents), self.atom(scope, {**self.static, **self.derived})
        plain = self.among(
            "()", f"(not {atom})", atom, f"(unknown {atom})", f"(and (not {atom}) (not {other}))"
        )
        needs = self.among(
            *("()", plain, f"(not {other})"),
            self.tested(self.read(scope)),
            self.condition(scope, 2, self.declared),
        )
        effects = " ".join(self.effect(scope, 3) for _ in range(self.random.randint(1, 3)))
        if self.cost:
            effects += f" (increase ({self.cost}) {self.among(*_AMOUNTS)})"
            if self.random.random() < 0.6:
                read = self.atom(scope, self.fluents)
                read = self.among(
                    read, f"(not {read})", f"(unknown {read})", self.condition(scope, 1, self.declared)
                )
                more = f"(when {read} (increase ({self.cost}) {self.among(*_AMOUNTS)}))"
                perhaps = f"(probabilistic 0.5 {more} 0.3 {self.atom(scope, self.fluents)})"
                effects += f" {self.among(more, more, perhaps)}"
        fields = [f":parameters ({listed})", f":precondition {needs}", f":effect (and {effects})"]
        if self.random.random() < 0.2:
            self.random.shuffle(fields)
        return f"(:action {name} {' '.join(fields)})"

    def growing(
        self, scope: Scope, depth: int, names: dict[str, list[str]], again: dict[str, list[str]]
    ) -> str:
        """A condition that is no less true where atoms of ``again`` are truer."""
        drawn, other = self.random.random(), self.condition(scope, 1, names)
        if depth <= 0 or drawn < 0.3:
            return self.atom(scope, again)
        inner = self.growing(scope, depth - 1, names, again)
        if drawn < 0.8:
            return self.among(
                f"(and {other} {inner})",
                f"(or {other} {inner})",
                f"(imply {other} {inner})",
                f"(not (imply {inner} {other}))",
            )
        listed, more = self.parameters("?w ?z", 1)
        inside = {**scope, **more}
        inner = self.growing(inside, depth - 1, names, again)
        joined = f"(and {self.condition(inside, 1, names)} {inner})"
        return f"({self.among('exists', 'exists', 'forall')} ({listed}) {self.among(inner, joined)})"

    def rules(self) -> list[str]:
        """Rules over facts and over the predicates of earlier rules, however these are read; some are
        recursive, by themselves or through each other."""
        found: list[str] = []
        below = {**self.fluents, **self.static}
        waiting = list(self.derived)
        while waiting:
            size = 2 if self.random.random() < 0.3 else 1
            group = {name: self.derived[name] for name in waiting[:size]}
            waiting = waiting[size:]
            recursive = self.random.random() < 0.5
            for name, types in group.items():
                for _ in range(self.random.choice([1, 1, 2])):
                    kinds = [self.among(kind, "a", "both") if kind == "top" else kind for kind in types]
                    scope = {f"?{name}{place}": kind for place, kind in enumerate(kinds)}
                    plain = self.atom(scope, self.random.choice([below, self.static]))
                    body = self.among(plain, f"(not {plain})", *[self.condition(scope, 2, below)] * 2)
                    if recursive:
                        body = self.among(body, self.growing(scope, 2, below, group))
                    found.append(self.rule(name, scope, body))
            below = {**below, **group}
        self.random.shuffle(found)
        return found

    def rule(self, name: str, scope: Scope, body: str) -> str:
        listed = " ".join(f"{parameter} - {kind}" for parameter, kind in scope.items())
        if self.random.random() < 0.7:
            return f"(:derived ({name} {listed}) {body})"
        head = " ".join([name, *scope])
        fitting = self.terms({}, "a", self.constants)
        if scope and fitting and self.random.random() < 0.3:
            head = f"{name} {self.random.choice(fitting)}"
        return f"(:axiom :vars ({listed}) :context {body} :implies ({head}))"

    # --- templates ---------------------------------------------------------------------------

    def call(self, scope: Scope) -> str:
        name, kinds = self.random.choice(list(self.callable.items()))
        found = [self.terms(scope, kind, self.constants) for kind in kinds]
        if not all(found):
            return f"(condition {self.condition(scope, 1, self.declared)})"
        return f"({' '.join([name, *map(self.random.choice, found)])})"

    def body(self, scope: Scope, depth: int) -> str:
        drawn = self.random.random()
        if depth <= 0 or drawn < 0.35:
            condition = f"(condition {self.condition(scope, 1, self.declared)})"
            return self.among(self.call(scope), self.call(scope), condition)
        inner = [self.body(scope, depth - 1) for _ in range(self.random.randint(1, 3))]
        if drawn < 0.8:
            return f"({self.among('sequence', 'fallback')} {' '.join(inner)})"
        if drawn < 0.9:
            first = f"(condition {self.condition(scope, 1, self.declared)})"
            return f"(skipper {first} {inner[0]})"
        kind = self.among("a", "top")
        call = self.call({**scope, "?w": kind})
        return f"({self.among('sequence', 'fallback')} {inner[0]} (foreach (?w - {kind}) {call}))"

    def template(self, name: str) -> str:
        listed, scope = self.parameters("?x", 1)
        needs = self.among("()", self.condition(scope, 2, self.declared), self.tested(self.read(scope)))
        guide = " ".join(self.effect(scope, 1, priced=False) for _ in range(self.random.randint(1, 2)))
        text = (
            f"(:template {name} :parameters ({listed}) :precondition {needs}"
            f" :effect (and {guide}) :body {self.body(scope, 2)})"
        )
        self.callable[name] = list(scope.values())
        return text

    def init(self) -> list[str]:
        names, every = {**self.fluents, **self.static}, list(self.objects)
        facts = dict.fromkeys(self.atom({}, names, every).lower() for _ in range(self.random.randint(1, 7)))
        found = [
            self.among(fact, fact, f"(unknown {fact})", f"(unknown {fact})", f"(not {fact})")
            for fact in facts
        ]
        for _ in range(self.random.choice([0, 1, 1, 2])):
            one, other = (self.atom({}, self.random.choice([names, self.static]), every) for _ in range(2))
            found.append(
                self.among(
                    f"(probabilistic 0.3 {one})",
                    f"(probabilistic 1/4 (unknown {one}) 1/2 (and {one} {other}))",
                    f"(probabilistic 0.5 (not {one}) 0.5 (probabilistic 0.5 {other} 0.1 {one}))",
                    f"(forall (?x - a) (probabilistic 0.5 ({self.unary} ?x)))",
                )
            )
        if self.random.random() < 0.5:
            found.append(f"(unknown {self.atom({}, self.static, every).lower()})")
        found = [fact for place, fact in enumerate(found) if not self.contradicts(fact, found[:place])]
        self.random.shuffle(found)
        return [*found, "(= (base) 2)"]

    @staticmethod
    def contradicts(fact: str, given: list[str]) -> bool:
        """Does a fact stand beside its like with another value?"""
        return fact.startswith("(unknown (") and any(fact[9:-1] in other for other in given)

    def within_reach(self, actions: list[str], objects: list[str]) -> str:
        """A fact that some action names, with any objects for its parameters."""
        changed = re.findall(rf"\(((?:{'|'.join(self.fluents)})\b[^()]*)\)", " ".join(actions), re.IGNORECASE)
        if not changed:
            return self.atom({}, self.fluents, objects)
        name, *args = self.random.choice(changed).split()
        kinds = self.fluents[name.lower()]
        found = [
            [arg] if arg in objects else self.terms({}, kind, objects)
            for arg, kind in zip(args, kinds, strict=True)
        ]
        return f"({' '.join([name, *map(self.random.choice, found)])})" if all(found) else "(p)"

    def event(self, number: int, before: list[str]) -> str:
        """An event, most of the time before all of some others."""
        listed, scope = self.parameters("?x ?y", 1)
        needs = self.among(self.condition(scope, 1, self.declared), self.atom(scope, self.fluents))
        happens = self.effect(scope, 1, priced=self.random.random() < 0.3)
        rate = self.among("", ":per action")
        if self.random.random() < 0.3:
            happens, rate = self.among(self.effect(scope, 0, priced=False), happens), ":per second"
            happens = self.effect(scope, 0, priced=False) if _DRAWS.search(happens) else happens
        fields = [
            f":parameters ({listed})",
            f":precondition {self.among(needs, needs, '()')}",
            f":effect {self.among(happens, f'(probabilistic {self.among(*_RATES)} {happens})')}",
            rate,
        ]
        if before and self.random.random() < 0.8:
            fields.append(f":before {before[0] if len(before) == 1 else '(' + ' '.join(before) + ')'}")
        self.random.shuffle(fields)
        return f"(:exogenous event-{number} {' '.join(fields)})"

    def events(self, actions: list[str]) -> list[str]:
        """The actions, of which some go on only while something is true, and some events."""
        found = []
        for plain, scope in zip(actions, self.scopes.values(), strict=True):
            text = plain
            if self.random.random() < 0.5:
                text = f"{plain[:-1]} :duration {self.among(*_DURATIONS)})"
            if self.random.random() < 0.6:
                found.append(text)
                continue
            more = f" :while {self.condition(scope, 1, self.declared)}"
            if self.random.random() < 0.5:
                more += f" :on-abort {self.effect(scope, 1)}"
            found.append(f"{text[:-1]}{more})")
        names: list[str] = []
        for number in range(self.random.randint(1, 3)):
            found.append(self.event(number, names))
            names.append(f"event-{number}")
        self.random.shuffle(found)
        return found

    def text(self, *, events: bool = False) -> str:
        def listed(names: list[str]) -> str:
            return " ".join(f"{name} - {self.objects[name]}" for name in names)

        declared = {
            name: f"({' '.join([name, *(f'?{place} - {kind}' for place, kind in enumerate(types))])})"
            for name, types in self.declared.items()
        }
        # Drawn from elsewhere, so that all else is as without it: what others change counts as constant.
        external = {name for name in {**self.fluents, **self.static} if self.others.random() < 0.25}
        predicates = " ".join(
            f"(external {form})" if name in external else form for name, form in declared.items()
        )
        actions = [self.action(name) for name in ["one", "two", "three"][: self.random.randint(1, 3)]]
        count = self.random.choice([0, 0, 1, 2])
        templates = [self.template(name) for name in ["first", "second"][:count]]
        every = list(self.objects)
        atom, goal = self.within_reach(actions, every), self.condition({}, 1, self.declared, every)
        goal = self.among(
            *(atom, atom, f"(and {atom} {goal})", f"(and {goal} {atom})", f"(or {atom} {goal})", goal),
            *(self.tested(self.read({}, every)), f"(and {atom} {self.tested(self.read({}, every))})"),
            self.tested(atom),
        )
        sections = [
            "(:types top - object a b - top both - (either a b))",
            f"(:predicates {predicates})",
            f"(:functions (base) {f'({self.cost})' if self.cost else ''})",
            f"(:constants {listed(self.constants)})",
            *self.rules(),
            *actions,
            *templates,
        ]
        if events:  # last of all, so that all else is as without them
            changed = self.events(actions)
            sections = [each for each in sections if each not in actions and each not in templates] + changed
        metric = f"(:metric minimize ({self.cost}))" if self.cost else ""
        rest = [name for name in every if name not in self.constants]
        return "\n".join(
            [
                "(define (domain d)",
                *sections,
                ")",
                f"(define (problem q) (:domain d) (:objects {listed(rest)})",
                f"(:init {' '.join(self.init())})",
                f"(:goal {goal}) {metric})",
            ]
        )


def random_text(seed: int, *, events: bool = False) -> str:
    """A domain and a problem; the same for the same seed. With ``events``, things happen by themselves, and
    actions may go on while something is true only; there are no templates then."""
    return _Writer(seed).text(events=events)
