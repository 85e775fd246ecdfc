"""Random domains with numbers, as text: everything that conditions and effects can say of them."""

from __future__ import annotations

import random

_FACTS = ("(p0)", "(p1)", "(q a)", "(q b)")
_NUMBERS = ("(n)", "(m a)", "(m b)")


class Writer:
    """Writes parts of a domain by chance."""

    def __init__(self, seed: int) -> None:
        self.draw = random.Random(seed)

    def amount(self, depth: int = 1) -> str:
        """A numeric expression."""
        chance = self.draw.random()
        if chance < 0.35 or not depth:
            return str(self.draw.randint(0, 4))
        if chance < 0.5:
            return self.draw.choice(("(c a)", "(c b)"))
        if chance < 0.75:
            return self.draw.choice(_NUMBERS)
        return f"({self.draw.choice('+-*')} {self.amount(depth - 1)} {self.amount(depth - 1)})"

    def condition(self, depth: int = 2) -> str:
        """A condition."""
        chance = self.draw.random()
        if chance < 0.3:
            return self.draw.choice(_FACTS)
        if chance < 0.4:
            return f"(not {self.draw.choice(_FACTS)})"
        if chance < 0.75 or not depth:
            operator = self.draw.choice(("<", "<=", "=", ">=", ">"))
            return f"({operator} {self.draw.choice(_NUMBERS)} {self.amount(self.draw.choice((0, 0, 1, 2)))})"
        if chance < 0.8:
            return f"(not {self.condition(depth - 1)})"
        if chance < 0.85:
            return "(forall (?x) (or (q ?x) (>= (m ?x) (c ?x))))"
        kind = self.draw.choice(("and", "or"))
        return f"({kind} {self.condition(depth - 1)} {self.condition(depth - 1)})"

    def effect(self, depth: int = 3) -> str:
        """An effect."""
        chance = self.draw.random()
        if chance < 0.22:
            return self.draw.choice(_FACTS)
        if chance < 0.33:
            return f"(not {self.draw.choice(_FACTS)})"
        if chance < 0.62 or not depth:
            operator = self.draw.choice(
                ("increase", "decrease", "increase", "decrease", "assign", "scale-up")
            )
            amount = (
                str(self.draw.randint(0, 2))
                if operator == "scale-up"
                else self.amount(self.draw.choice((0, 0, 1)))
            )
            return f"({operator} {self.draw.choice(_NUMBERS)} {amount})"
        if chance < 0.74:
            return f"(and {self.effect(depth - 1)} {self.effect(depth - 1)})"
        if chance < 0.78:
            return "(forall (?x) (when (q ?x) (decrease (m ?x) (c ?x))))"
        if chance < 0.88:
            return f"(when {self.condition(1)} {self.effect(depth - 1)})"
        one, other = self.draw.choice(("1/2", "1/3", "0.3")), self.draw.choice(("1/4", "0.5"))
        return f"(probabilistic {one} {self.effect(depth - 1)} {other} {self.effect(depth - 1)})"

    def events(self, *, time: bool = False) -> list[str]:
        """What happens by itself: each number, and each fact, is changed by one event at most."""
        made = []
        for number, target in enumerate(self.draw.sample([*_NUMBERS, *_FACTS], self.draw.randint(1, 3))):
            if target in _FACTS:
                effect = self.draw.choice((target, f"(not {target})"))
            else:
                effect = f"({self.draw.choice(('increase', 'decrease'))} {target} {self.draw.randint(1, 3)})"
            p = self.draw.choice(("0.5", "1/3", "1"))
            condition = self.condition(1)
            rate = " :per second" if time and self.draw.random() < 0.7 else ""
            made.append(
                f"(:exogenous e{number} :precondition {condition}{rate} :effect (probabilistic {p} {effect}))"
            )
        return made

    def timed(self) -> str:
        """How long an action takes, and when it is given up."""
        duration = self.draw.choice(
            ("1", "2", "(empirical (1 0.5) (4 0.5))", "(empirical (2 0.25) (5 0.75))")
        )
        timeout = ""
        if "empirical" in duration and self.draw.random() < 0.6:
            timeout = " :timeout 3"
            if self.draw.random() < 0.5:
                timeout += f" :on-timeout {self.effect(1)}"
        return f" :duration {duration}{timeout}"

    def domain(self, *, events: bool = False, time: bool = False) -> str:
        """A domain with its problem; with ``time``, actions take some, and some events take place by the
        second."""
        low, high = self.draw.randint(-2, 1), self.draw.randint(3, 9)
        most = self.draw.randint(2, 6)
        policies = [self.draw.choice(("", " :saturate", " :block", "")) for _ in range(2)]
        once = self.draw.random() < 0.5
        actions = []
        for number in range(self.draw.randint(2, 4)):
            ready, used = (f" (ready{number})", f" (not (ready{number}))") if once else ("", "")
            ends = ""
            if events and self.draw.random() < 0.4:
                held = self.draw.choice(_FACTS)
                ends = f" :while {held} :on-abort {self.effect(1)}"
                ready += f" {held}"
            if time:
                ends += self.timed()
            actions.append(
                f"(:action a{number} :precondition (and {self.condition()}{ready}){ends}"
                f" :effect (and {self.effect()} {self.effect()}{used}))"
            )
        flags = [f"(ready{number})" for number in range(len(actions))]
        start = " ".join([*(fact for fact in _FACTS if self.draw.random() < 0.4), *flags])
        values = f"(= (n) {self.draw.randint(low, high)}) " + " ".join(
            f"(= (m {each}) {self.draw.randint(0, most)}) (= (c {each}) {self.draw.randint(0, 3)})"
            for each in "ab"
        )
        return (
            f"(define (domain d) (:predicates (p0) (p1) (q ?x) {' '.join(flags)})\n"
            f"  (:functions (n) - (int {low} {high}{policies[0]})\n"
            f"    (m ?x) - (int 0 {most}{policies[1]}) (c ?x))\n  "
            + "\n  ".join([*actions, *(self.events(time=time) if events else ())])
            + f")\n(define (problem p) (:domain d) (:objects a b)\n  (:init {start} {values})\n"
            f"  (:goal {self.condition(1)}))\n"
        )
