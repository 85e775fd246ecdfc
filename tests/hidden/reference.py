"""What a problem with hidden state is worth, from its text alone, by the pages on language and semantics.

Worlds are listed whole, every fact of them, and a belief is a distribution over worlds: nothing is grouped,
left out as irrelevant or named. What the robot sees after an action is what its seen facts are then, and what
it is told; what it believes then is what Bayes' rule makes of it. For small problems only.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import Any, TypeAlias

from tests.domains.lifted import Fact, Form, Lifted, Move, TooLarge, typed
from tests.hidden.exact_mdp import Choice, Mdp

World: TypeAlias = frozenset[Fact]
"""The facts that are true."""
Belief: TypeAlias = frozenset[tuple[World, Fraction]]
_Told: TypeAlias = tuple[World, tuple[bool, ...]]
"""The seen facts that are true, and the readings."""

_HALF, _ONE = Fraction(1, 2), Fraction(1)
_LISTS = {"and", "forall", "probabilistic", "oneof", "="}
_MOST_OPEN = 10


def _fact(form: Form, bound: Mapping[str, str]) -> Fact:
    return (form,) if isinstance(form, str) else (form[0], *(bound.get(word, word) for word in form[1:]))


def _open(fact: Fact) -> Fact:
    """The mark, among the values of a world, that it is not known whether a fact is true."""
    return ("?", *fact)


@dataclass(frozen=True)
class Setting:
    """Something in an effect that sets a fact: to 2 (true), 1 (unknown) or 0, the facts that its conditions
    read, and whether it is one of several things that may happen."""

    fact: Fact
    value: int
    reads: frozenset[Fact]
    chance: bool


@dataclass
class HiddenText(Lifted):
    """The domain and the problem of a text in which facts are hidden."""

    _after: dict[tuple[str, Belief], dict[Belief, Fraction]] = field(default_factory=dict)

    # --- conditions ----------------------------------------------------------------------

    def value(self, form: Form, bound: Mapping[str, str], world: Mapping[Fact, int]) -> int:
        """The value of a condition in a world; what is asked of knowledge is among the marks."""
        match form:
            case ["unknown" | "known" as kind, part] if not self.is_fact(form):
                return 2 if (_open(_fact(part, bound)) in world) == (kind == "unknown") else 0
            case _:
                return super().value(form, bound, world)

    def mentioned(self, form: Form, bound: Mapping[str, str]) -> Iterator[Fact]:
        """The facts whose truth a condition reads."""
        match form:
            case [] | ["=", *_]:
                return
            case ["and" | "or" | "not" | "imply", *parts]:
                for part in parts:
                    yield from self.mentioned(part, bound)
            case ["forall" | "exists", parameters, part]:
                for each in self.bindings(typed(parameters), bound):
                    yield from self.mentioned(part, each)
            case ["unknown" | "known", _] if not self.is_fact(form):
                return
            case _:
                yield _fact(form, bound)

    # --- what is hidden ------------------------------------------------------------------

    def settings(
        self, form: Form, bound: Mapping[str, str], reads: frozenset[Fact] = frozenset()
    ) -> list[Setting]:
        """All that an effect may set."""
        match form:
            case []:
                return []
            case ["and", *parts]:
                return [each for part in parts for each in self.settings(part, bound, reads)]
            case ["forall", parameters, part]:
                rows = self.bindings(typed(parameters), bound)
                return [each for row in rows for each in self.settings(part, row, reads)]
            case ["when", condition, part]:
                return self.settings(part, bound, reads | {*self.mentioned(condition, bound)})
            case ["increase", *_]:
                return []
            case ["probabilistic" | "oneof" as kind, *parts]:
                if kind == "probabilistic":
                    shares = [Fraction(share) for share in parts[::2]]
                    named = zip([*shares, 1 - sum(shares)], [*parts[1::2], []], strict=True)
                    parts = [part for share, part in named if share]
                branches = [self.settings(part, bound, reads) for part in parts]
                found = []
                for each in dict.fromkeys(one for branch in branches for one in branch):
                    sure = all(each in branch for branch in branches)
                    found.append(each if sure else Setting(each.fact, each.value, each.reads, True))
                return found
            case ["not", part]:
                return [Setting(_fact(part, bound), 0, reads, False)]
            case ["unknown", part] if not self.is_fact(form):
                return [Setting(_fact(part, bound), 1, reads, False)]
            case _:
                return [Setting(_fact(form, bound), 2, reads, False)]

    @cached_property
    def uncertain(self) -> list[Fact]:
        """The facts that the start leaves open."""
        found: list[Fact] = []
        drawn: set[Fact] = set()
        for form in self.init:
            if form[0] == "unknown":
                found.append(_fact(form[1], {}))
            elif form[0] in {"probabilistic", "oneof"}:
                facts = [each.fact for each in self.settings(form, {})]
                found += facts
                drawn.update(facts if form[0] == "probabilistic" else ())
            elif form[0] not in _LISTS and (form[0] in {"or", "imply"} or _denies_more(form)):
                found += self.mentioned(form, {})
        return [fact for fact in dict.fromkeys(found) if fact in drawn or fact not in self.given]

    @cached_property
    def given(self) -> dict[Fact, bool]:
        """What the start says is true, or false."""
        found: dict[Fact, bool] = {}
        for form in self.init:
            if form[0] == "not" and not _denies_more(form):
                found[_fact(form[1], {})] = False
            elif form[0] not in {*_LISTS, "unknown", "or", "imply", "not"}:
                found[_fact(form, {})] = True
        return found

    @cached_property
    def hidden(self) -> frozenset[Fact]:
        """The facts that the robot does not see."""
        every = [each for move in self.possible.values() for each in self.settings(move.effect, move.bound)]

        def closed(found: set[Fact]) -> set[Fact]:
            size = -1
            while size < len(found):
                size = len(found)
                found |= {each.fact for each in every if each.reads & found}
            return found

        hidden = closed({*self.uncertain, *(each.fact for each in every if each.value == 1)})
        chance = closed({each.fact for each in every if each.chance})
        told = {
            fact
            for name, move in self.possible.items()
            for form, _ in self.told(name)
            for fact in self.mentioned(form, move.bound)
        }
        sources = (told & chance) - hidden
        size = -1
        while size < len(sources):
            size = len(sources)
            sources |= {r for each in every if each.fact in sources for r in each.reads if r in chance}
        return frozenset(closed(hidden | sources))

    @cached_property
    def possible(self) -> dict[str, Move]:
        """The actions that may ever start, if facts once made true or false stay possible."""
        may: dict[Fact, set[bool]] = {fact: {True, False} for fact in self.uncertain}

        def holds(form: Form, bound: Mapping[str, str], wanted: bool) -> bool:
            match form:
                case ["not", part]:
                    return holds(part, bound, not wanted)
                case ["and" | "or" as kind, *parts]:
                    some = any if (kind == "or") == wanted else all
                    return some(holds(part, bound, wanted) for part in parts)
                case [str(head), *_] if head in {"imply", "forall", "exists", "unknown", "known", "="}:
                    return True
                case []:
                    return wanted
                case _:
                    fact = _fact(form, bound)
                    return wanted in may.get(fact, {self.given.get(fact, False)})

        def values(form: Form, bound: Mapping[str, str], reached: dict[Fact, set[bool]]) -> None:
            match form:
                case ["and" | "oneof", *parts]:
                    for part in parts:
                        values(part, bound, reached)
                case ["probabilistic", *branches]:
                    for share, part in zip(branches[::2], branches[1::2], strict=True):
                        values(part if Fraction(share) else [], bound, reached)
                case ["forall", parameters, part]:
                    for row in self.bindings(typed(parameters), bound):
                        values(part, row, reached)
                case ["when", condition, part]:
                    values(part if holds(condition, bound, True) else [], bound, reached)
                case [] | ["increase", *_]:
                    return
                case ["not", part]:
                    reached.setdefault(_fact(part, bound), set()).add(False)
                case ["unknown", part] if not self.is_fact(form):
                    reached.setdefault(_fact(part, bound), set()).update([True, False])
                case _:
                    reached.setdefault(_fact(form, bound), set()).add(True)

        found: dict[str, Move] = {}
        before: object = None
        while before != (len(found), {fact: len(each) for fact, each in may.items()}):
            before = (len(found), {fact: len(each) for fact, each in may.items()})
            found = {n: m for n, m in self.moves.items() if holds(m.needs, m.bound, True)}
            reached: dict[Fact, set[bool]] = {}
            for move in found.values():
                values(move.effect, move.bound, reached)
            for fact, each in reached.items():
                may.setdefault(fact, {self.given.get(fact, False)}).update(each)
        return found

    # --- what is told --------------------------------------------------------------------

    def told(self, name: str) -> list[tuple[Form, tuple[Fraction, Fraction]]]:
        """What an action tells, and how probably it is right where that is true, and where it is false."""
        schema = name.partition("(")[0]
        (observed,) = (each.get(":observe", ["and"]) for each in self.actions if each[":name"] == schema)
        if observed[0] == "probabilistic":
            return [(observed[2], (Fraction(observed[1]), Fraction(observed[3 if len(observed) > 3 else 1])))]
        return [(part, (_ONE, _ONE)) for part in _parts(observed)]

    def readings(self, name: str, bound: Mapping[str, str], world: World) -> dict[tuple[bool, ...], Fraction]:
        """What may be told in a world."""
        found: dict[tuple[bool, ...], Fraction] = {(): _ONE}
        for form, rights in self.told(name):
            true = self.value(form, bound, dict.fromkeys(world, 2)) == 2
            right = rights[0 if true else 1]
            both = [(true, right), (not true, 1 - right)]
            found = {(*so_far, each): p * q for so_far, p in found.items() for each, q in both if q}
        return found

    # --- beliefs -------------------------------------------------------------------------

    @cached_property
    def prior(self) -> Belief:
        """The worlds of the start. Empty where they contradict each other."""
        drawn, checks = [], []
        for form in self.init:
            if form[0] == "probabilistic":
                drawn.append([(p, {f for f, v in change.items() if v == 2}, {*change})
                              for p, change, _ in self.effect(form, {}, {})])  # fmt: skip
            elif form[0] == "oneof" and any(part[0] == "and" for part in form[1:]):
                every = {each.fact for each in self.settings(form, {})}
                drawn.append([(Fraction(1, len(form) - 1),
                               {_fact(f, {}) for f in _parts(part) if f[0] != "not"}, every)
                              for part in form[1:]])  # fmt: skip
            elif form[0] in {"oneof", "or", "imply"} or _denies_more(form):
                checks.append(form)
        free = [f for f in self.uncertain if not any(f in sets for draw in drawn for _, _, sets in draw)]
        if len(free) > _MOST_OPEN:
            raise TooLarge
        weights: dict[World, Fraction] = {}
        for picked in product([False, True], repeat=len(free)):
            one_by_one = {fact for fact, true in zip(free, picked, strict=True) if true}
            for results in product(*drawn):
                world = self._agreed(results, one_by_one)
                if world is not None and all(self._meets(form, world) for form in checks):
                    weight = _ONE
                    for p, _, _ in results:
                        weight *= p
                    weights[world] = weights.get(world, Fraction(0)) + weight
        return _belief(weights)

    def _agreed(
        self, results: Iterable[tuple[Fraction, set[Fact], set[Fact]]], free: set[Fact]
    ) -> World | None:
        """The world of some results; two weighted draws of a fact make it true if one does, and what is drawn
        by branches is what all of them say."""
        found = {fact for fact, true in self.given.items() if true}
        true = {fact for _, facts, _ in results for fact in facts}
        false = {fact for _, facts, sets in results for fact in sets - facts}
        world = frozenset((found - false) | true | free)
        if any(
            world.__contains__(fact) != given
            for fact, given in self.given.items()
            if fact not in self.uncertain
        ):
            return None
        return world

    def _meets(self, form: Form, world: World) -> bool:
        values = dict.fromkeys(world, 2)
        if form[0] == "oneof":
            return sum(self.value(part, {}, values) == 2 for part in form[1:]) == 1
        return self.value(form, {}, values) == 2

    def values_in(self, belief: Belief) -> Iterator[tuple[dict[Fact, int], World, Fraction]]:
        """The worlds of a belief, with marks for what is not known."""
        worlds = [world for world, _ in belief]
        some, every = frozenset().union(*worlds), worlds[0].intersection(*worlds)
        marks = {_open(fact): 2 for fact in some - every}
        for world, p in belief:
            yield {**dict.fromkeys(world, 2), **marks}, world, p

    def _drawn_anew(self, world: World, change: Mapping[Fact, int]) -> Iterator[tuple[World, Fraction]]:
        """The worlds after a change, in which what becomes unknown is drawn."""
        coins = [fact for fact, value in change.items() if value == 1]
        kept = {fact for fact in world if change.get(fact, 2) == 2} | {f for f, v in change.items() if v == 2}
        for picked in product([False, True], repeat=len(coins)):
            heads = {fact for fact, true in zip(coins, picked, strict=True) if true}
            p = _ONE
            for fact in coins:
                p *= self.odds.get(fact, _HALF) if fact in heads else 1 - self.odds.get(fact, _HALF)
            yield frozenset(kept | heads), p

    @cached_property
    def odds(self) -> dict[Fact, Fraction]:
        """How probable the start makes facts that have draws of their own."""
        draws = [self.effect(form, {}, {}) for form in self.init if form[0] == "probabilistic"]
        found: dict[Fact, Fraction] = {}
        for fact in self.uncertain:
            mine = [draw for draw in draws if any(fact in change for _, change, _ in draw)]
            if mine and all({*change} <= {fact} for draw in mine for _, change, _ in draw):
                misses = _ONE
                for draw in mine:
                    misses *= sum((p for p, change, _ in draw if change.get(fact) != 2), Fraction(0))
                found[fact] = 1 - misses
        return found

    def chance(self, form: Form, belief: Belief) -> Fraction:
        """How probable a condition is."""
        true = (p for values, _, p in self.values_in(belief) if self.value(form, {}, values) == 2)
        return sum(true, Fraction(0))

    def known(self, form: Form, bound: Mapping[str, str], belief: Belief) -> bool:
        """Is a condition true in every world?"""
        return all(self.value(form, bound, values) == 2 for values, _, _ in self.values_in(belief))

    def results(self, name: str, belief: Belief) -> dict[Belief, Fraction]:
        """What may be believed after an action, and how likely that is."""
        if (name, belief) not in self._after:
            self._after[name, belief] = self._results(name, belief)
        return self._after[name, belief]

    def happens(self, name: str, belief: Belief) -> Iterator[tuple[World, _Told, World, Fraction]]:
        """What an action may do: the world before it, what is seen then, the world after, the probability."""
        move = self.moves[name]
        for values, world, p in self.values_in(belief):
            for q, change, _ in self.effect(move.effect, move.bound, values):
                for after, r in self._drawn_anew(world, change):
                    for told, s in self.readings(name, move.bound, after).items():
                        yield world, (after - self.hidden, told), after, p * q * r * s

    def _results(self, name: str, belief: Belief) -> dict[Belief, Fraction]:
        found: dict[Belief, Fraction] = {}
        for mass in self._by_told(name, belief).values():
            after_it = _belief(mass)
            found[after_it] = found.get(after_it, Fraction(0)) + sum(mass.values())
        return found

    def _by_told(self, name: str, belief: Belief) -> dict[_Told, dict[World, Fraction]]:
        by_told: dict[_Told, dict[World, Fraction]] = {}
        for _, told, after, p in self.happens(name, belief):
            mass = by_told.setdefault(told, {})
            mass[after] = mass.get(after, Fraction(0)) + p
        return by_told

    def results_in(self, name: str, belief: Belief, world: World) -> dict[tuple[Belief, World], Fraction]:
        """What an action leads to in one of the worlds of a belief: what is believed, and the world after."""
        beliefs = {told: _belief(mass) for told, mass in self._by_told(name, belief).items()}
        whole = dict(belief)[world]
        found: dict[tuple[Belief, World], Fraction] = {}
        for before, told, after, p in self.happens(name, belief):
            if before == world:
                both = beliefs[told], after
                found[both] = found.get(both, Fraction(0)) + p / whole
        return found

    def mdp(self, most: int) -> Mdp:
        """Every belief that can be reached. Raises :class:`TooLarge` where there are more than so many."""
        beliefs, number = [self.prior], {self.prior: 0}
        goals: list[bool] = []
        choices: list[list[Choice]] = []
        for belief in beliefs:
            goals.append(self.known(self.goal, {}, belief))
            own: list[Choice] = []
            choices.append(own)
            for name, move in () if goals[-1] else self.possible.items():
                if not self.known(move.needs, move.bound, belief):
                    continue
                found = self.results(name, belief)
                for each in found:
                    if each not in number:
                        number[each] = len(beliefs)
                        beliefs.append(each)
                own.append((_ONE, [(number[each], p) for each, p in found.items()]))
            if len(beliefs) > most:
                raise TooLarge
        return Mdp(goals, choices)

    def within(self, steps: int, most: int) -> Fraction:
        """The best probability of knowing the goal to be true after so many actions at most. Raises
        :class:`TooLarge` where so many beliefs are looked at."""
        known: dict[tuple[Belief, int], Fraction] = {}

        def best(belief: Belief, left: int) -> Fraction:
            if (belief, left) not in known:
                if len(known) > most:
                    raise TooLarge
                found = Fraction(self.known(self.goal, {}, belief))
                if not found and left:
                    for name, move in self.possible.items():
                        if self.known(move.needs, move.bound, belief):
                            after = self.results(name, belief).items()
                            found = max(found, sum((p * best(b, left - 1) for b, p in after), Fraction(0)))
                known[belief, left] = found
            return known[belief, left]

        return best(self.prior, steps)


def _denies_more(form: Form) -> bool:
    """Is it a negation of more than a fact?"""
    return bool(form[0] == "not" and form[1][0] in {"and", "or", "not", "imply"})


def _parts(form: Form) -> list[Any]:
    """The parts of nested conjunctions."""
    return [each for part in form[1:] for each in _parts(part)] if form[:1] == ["and"] else [form]


def _belief(weights: Mapping[World, Fraction]) -> Belief:
    whole = sum(weights.values())
    return frozenset((world, weight / whole) for world, weight in weights.items() if weight)
