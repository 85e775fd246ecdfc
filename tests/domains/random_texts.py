"""Random small domains with a problem, as text: all of the language but templates and what is refused."""

from __future__ import annotations

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
        self.fluents = {"p": [], "q": ["a"], "r": [random.choice(["top", _EITHER, "object"])]}
        self.static = {"h": [], "fixed": ["top"]}
        self.derived = {
            name: types for name, types in {"d": ["top"], "e": []}.items() if random.random() < 0.4
        }
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

    def condition(
        self, scope: Scope, depth: int, names: dict[str, list[str]], objects: list[str] | None = None
    ) -> str:
        def inner(inside: Scope = scope) -> str:
            return self.condition(inside, depth - 1, names, objects)

        atom = self.atom(scope, names, objects)
        drawn = self.random.random()
        if depth <= 0 or drawn < 0.45:
            terms = self.terms(scope, "object", self.constants)
            equal = f"(= {self.random.choice(terms)} {self.random.choice(terms)})" if terms else "()"
            return self.among(
                atom, atom, f"(not {atom})", f"( not  {atom} )", f"(unknown {atom})", f"(known {atom})", equal
            )
        if drawn < 0.75:
            kind = self.among("and", "and", "or")
            return f"({kind} {' '.join(inner() for _ in range(self.random.randint(0, 3)))})"
        if drawn < 0.85:
            return self.among(f"(imply {inner()} {inner()})", f"(not {inner()})")
        listed, more = self.parameters("?x ?y ?z", 2)
        return f"({self.among('exists', 'forall')} ({listed}) {inner({**scope, **more})})"

    def effect(self, scope: Scope, depth: int, *, sure: bool = True) -> str:
        def inner(inside: Scope = scope, *, sure: bool = sure) -> str:
            return self.effect(inside, depth - 1, sure=sure)

        drawn = self.random.random()
        if depth <= 0 or drawn < 0.4:
            atom = self.atom(scope, self.fluents)
            if self.cost and sure and drawn < 0.1:
                fluent = self.among(self.cost, self.cost, "total-cost")
                return f"(increase ({fluent}) {self.among(*_AMOUNTS)})"
            return self.among(atom, atom, f"(not {atom})", f"(unknown {atom})")
        if drawn < 0.55:
            return f"(and {' '.join(inner() for _ in range(self.random.randint(0, 3)))})"
        if drawn < 0.68:
            return f"(when {self.condition(scope, 1, self.declared)} {inner(sure=False)})"
        if drawn < 0.75:
            listed, more = self.parameters("?x ?y ?z", 1)
            return f"(forall ({listed}) {inner({**scope, **more})})"
        if drawn < 0.93:
            shares = self.random.choice(_CHANCES)
            return f"(probabilistic {shares.format(*(inner() for _ in range(3)))})"
        return f"(oneof {' '.join(inner() for _ in range(self.random.randint(1, 3)))})"

    def action(self, name: str) -> str:
        listed, scope = self.parameters("?x ?y", 2)
        atom, other = self.atom(scope, self.fluents), self.atom(scope, {**self.static, **self.derived})
        plain = self.among(
            "()", f"(not {atom})", atom, f"(unknown {atom})", f"(and (not {atom}) (not {other}))"
        )
        needs = self.among(plain, f"(not {other})", self.condition(scope, 2, self.declared))
        effects = " ".join(self.effect(scope, 3) for _ in range(self.random.randint(1, 3)))
        if self.cost:
            effects += f" (increase ({self.cost}) {self.among(*_AMOUNTS)})"
        fields = [f":parameters ({listed})", f":precondition {needs}", f":effect (and {effects})"]
        if self.random.random() < 0.2:
            self.random.shuffle(fields)
        return f"(:action {name} {' '.join(fields)})"

    def rules(self) -> list[str]:
        base = {**self.fluents, **self.static}
        found = [f"(:derived (e) {self.condition({}, 2, {**base, **self.derived, 'e': []})})"]
        found = [rule for rule in found if "e" in self.derived and "(e)" not in rule.lower()[12:]]
        if "d" not in self.derived:
            return found
        scope = {"?x": "top"}
        more = self.condition({"?w": "top", **scope}, 1, base)
        again = f"(exists (?w - {self.among('a', 'top')}) (and (d ?w) {more}))"
        body = self.among(again, self.condition(scope, 2, base))
        heads = f"(:derived (d ?x - {self.among('a', 'top')}) {body})"
        axiom = f"(:axiom :vars (?x - top) :context {self.condition(scope, 1, base)} :implies (d ?x))"
        return [heads, *([axiom] if self.random.random() < 0.5 else []), *found]

    def init(self) -> list[str]:
        names, every = {**self.fluents, **self.static}, list(self.objects)
        facts = dict.fromkeys(self.atom({}, names, every).lower() for _ in range(self.random.randint(0, 6)))
        found = [self.among(fact, fact, f"(unknown {fact})", f"(not {fact})") for fact in facts]
        for _ in range(self.random.choice([0, 1, 1, 2])):
            one, other = (self.atom({}, self.random.choice([names, self.static]), every) for _ in range(2))
            found.append(
                self.among(
                    f"(probabilistic 0.3 {one})",
                    f"(probabilistic 1/4 (unknown {one}) 1/2 (and {one} {other}))",
                    f"(probabilistic 0.5 (not {one}) 0.5 (probabilistic 0.5 {other} 0.1 {one}))",
                    "(forall (?x - a) (probabilistic 0.5 (q ?x)))",
                )
            )
        self.random.shuffle(found)
        return [*found, "(= (base) 2)"]

    def text(self) -> str:
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
        every = list(self.objects)
        atom, goal = self.atom({}, self.fluents, every), self.condition({}, 1, self.declared, every)
        goal = self.among(
            atom, atom, f"(unknown {atom})", f"(and {atom} {goal})", f"(and {atom} {goal})", goal
        )
        sections = [
            "(:types top - object a b - top both - (either a b))",
            f"(:predicates {predicates})",
            f"(:functions (base) {f'({self.cost})' if self.cost else ''})",
            f"(:constants {listed(self.constants)})",
            *self.rules(),
            *(self.action(name) for name in ["one", "two", "three"][: self.random.randint(1, 3)]),
        ]
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


def random_text(seed: int) -> str:
    """A domain and a problem; the same for the same seed."""
    return _Writer(seed).text()
