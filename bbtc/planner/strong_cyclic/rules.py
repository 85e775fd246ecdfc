"""From a policy to rules, and from rules to a tree: ``Fallback(goal, Sequence(guard, action)…)``.

Rules are tried in the order of their distance to the goal. Every action reads its precondition before it
starts. Besides, the guard of a rule holds what keeps the action from being forbidden, and of what the rest of
the plan needs as much as tells the rule from others. Nothing that is read is ever unknown: what might be is
read as false then.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from bbtc.ground.condition import (
    TRUE,
    And,
    Condition,
    Is,
    Known,
    conjunction,
    conjuncts,
    disjunction,
    negation,
    replaced,
    variables,
)
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.strong_cyclic.determinised import Determinised
from bbtc.planner.strong_cyclic.exclusion import Exclusion
from bbtc.planner.strong_cyclic.partial_state import (
    PartialState,
    as_conditions,
    contains,
    contradict,
    literals,
    satisfied,
    united,
    without,
)
from bbtc.planner.strong_cyclic.policy import Covers
from bbtc.planner.strong_cyclic.sharing import Guarded, factored
from bbtc.planner.strong_cyclic.solve import Solved
from bbtc.rewrite.simplify import numbered
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node


@dataclass(frozen=True, slots=True)
class Rule:
    """Start ``action`` (its number in the task) where its precondition and one of ``guards`` hold."""

    guards: tuple[Guard, ...]
    action: int


@dataclass(frozen=True, slots=True)
class Guard:
    """Holds where ``partial`` does, and none of ``excluded``. ``kept`` are the bits of literals that are
    more than a help to tell rules apart."""

    partial: PartialState
    excluded: tuple[PartialState, ...]
    kept: int

    def holds(self, state: int) -> bool:
        """In a state?"""
        return contains(self.partial, state) and not any(contains(each, state) for each in self.excluded)


class Rules:
    """The rules of a policy."""

    def __init__(self, model: Determinised, exclusion: Exclusion, solved: Solved, limits: Limits) -> None:
        self.model, self.exclusion, self.solved, self.limits = model, exclusion, solved, limits
        self._plain = self._merged(self.plain())
        self._actions: dict[int, int] = {}
        """The action of each state met that is not in the goal, -1 where no rule applies."""
        self._of_action: dict[int, list[int]] = {}
        for number, rule in enumerate(self._plain):
            self._of_action.setdefault(rule.action, []).append(number)
        self._able: dict[int, list[int]] = {}
        """The states met, and decided, in which each action may start."""
        self.meet(solved.visited)

    def meet(self, states: Iterable[int]) -> bool:
        """From now on, short rules decide as plain ones in these states, too; False if they did so before."""
        new = [s for s in states if s not in self._actions and not satisfied(self.model.goal, s)]
        for state in new:
            able = self.model.applicable(state)
            numbers = sorted(number for action in able for number in self._of_action.get(action, ()))
            first = next((number for number in numbers if self._holds(self._plain[number], state)), None)
            self._actions[state] = -1 if first is None else self._plain[first].action
            if first is not None:
                for action in able:
                    self._able.setdefault(action, []).append(state)
        return bool(new)

    def plain(self) -> list[Rule]:
        """A rule for each pair, with all that the rest of the plan needs."""
        return [Rule((self._guard(pair.partial, pair.action),), pair.action) for pair in self.solved.pairs]

    def short(self) -> list[Rule]:
        """Rules that decide alike in all states met, with less in their guards, fewer of them."""
        actions = self._actions
        left = {state for state, action in actions.items() if action >= 0}
        found: list[Rule] = []
        for rule in self._plain:
            self.limits.check_time("the search for a small tree")
            able = [state for state in self._able.get(rule.action, ()) if state in left]
            others = [state for state in able if actions[state] != rule.action]
            waiting = [state for state in able if actions[state] == rule.action]
            guards: list[Guard] = []
            for long in rule.guards:
                if not any(long.holds(state) for state in waiting):
                    continue  # those before it, with less in them, decide all that it does
                guard = self._shorter(long, others)
                guards.append(guard)
                waiting = [state for state in waiting if not guard.holds(state)]
            if not guards:
                continue
            short = Rule(tuple(guards), rule.action)
            found.append(short)
            left.difference_update([state for state in able if self._holds(short, state)])
            if not left:
                break  # the rest decides nothing that is met
        return self._merged(found)

    def _guard(self, partial: PartialState, action: int) -> Guard:
        known = self.exclusion.closed(self.model.actions[action].common)
        kept = 0
        partial = without(partial, known.mask)
        excluded: list[PartialState] = []
        for each in self.solved.forbidden.of_action.get(action, ()):
            if contradict(each, known):
                continue
            apart = (each.value ^ partial.value) & each.mask & partial.mask
            if apart:  # it says already that this is not so
                bits = apart & partial.value or apart
                kept |= self._whole((bits & -bits).bit_length() - 1) & partial.mask
            elif contradict(each, self.exclusion.closed(united(known, partial))):
                kept |= partial.mask
            else:
                excluded.append(without(each, known.mask))
        alone = [each for each in excluded if self._opposite(each) is not None]
        for each in alone:
            opposite = self._opposite(each)
            assert opposite is not None
            partial, kept = united(partial, opposite), kept | opposite.mask
        rest = tuple(each for each in excluded if each not in alone)
        return Guard(partial, rest, kept)

    def _whole(self, bit: int) -> int:
        return self.model.packing.bits(self.model.packing.owner(bit))

    def _opposite(self, partial: PartialState) -> PartialState | None:
        if partial.mask.bit_count() == 1:
            variable = self.model.packing.owner(partial.mask.bit_length() - 1)
            if self.model.packing.unknown[variable] is None or not partial.mask >> variable & 1:
                return PartialState(partial.mask, partial.mask & ~partial.value)
        return None

    @staticmethod
    def _holds(rule: Rule, state: int) -> bool:
        """Does a rule apply in a state in which its action may start?"""
        return any(guard.holds(state) for guard in rule.guards)

    def _shorter(self, guard: Guard, others: list[int]) -> Guard:
        """Without what is not needed to hold in none of some states."""
        against = [state for state in others if not any(contains(each, state) for each in guard.excluded)]
        if any(contains(guard.partial, state) for state in against):
            return guard
        # The literals that tell most states apart are tried last.
        rated = []
        for literal in literals(self.model.packing, guard.partial):
            if not literal.mask & guard.kept:
                apart = sum(not contains(literal, state) for state in against)
                rated.append((apart, literal.value != 0, literal.mask, literal))
        for *_, literal in sorted(rated, key=lambda each: each[:3]):
            rest = without(guard.partial, literal.mask)
            if not any(contains(rest, state) for state in against):
                guard = replace(guard, partial=rest)
        return guard

    def _merged(self, rules: Sequence[Rule]) -> list[Rule]:
        """Rules of one action together, the later ones moved before others that apply elsewhere only."""
        found: list[Rule] = []
        where: list[list[PartialState]] = []
        last: dict[int, int] = {}
        for rule in rules:
            own = self._where(rule)
            at = last.get(rule.action, -1)
            if at >= 0 and all(_apart(where[other], own) for other in range(len(found) - 1, at, -1)):
                found[at] = Rule((*found[at].guards, *rule.guards), rule.action)
                where[at] = where[at] + own
            else:
                last[rule.action] = len(found)
                found.append(rule)
                where.append(own)
        return [Rule(_joined(rule.guards), rule.action) for rule in found]

    def _where(self, rule: Rule) -> list[PartialState]:
        """What holds for sure where a rule applies, for each of its guards."""
        needs = self.model.actions[rule.action].common
        return [self.exclusion.closed(united(needs, guard.partial)) for guard in rule.guards]


def _apart(one: Sequence[PartialState], other: Sequence[PartialState]) -> bool:
    for own in one:
        for its in other:
            if not contradict(own, its):
                return False
    return True


def _joined(guards: Sequence[Guard]) -> tuple[Guard, ...]:
    """Guards without those that hold only where one before them does."""
    found: list[Guard] = []
    general = Covers()
    for guard in dict.fromkeys(guards):
        if not any(
            set(found[number].excluded) <= set(guard.excluded) for number in general.entailed(guard.partial)
        ):
            found.append(guard)
            general.add(guard.partial)
    return tuple(found)


# --- the tree ---------------------------------------------------------------------------------


def tree_of(task: Task, model: Determinised, rules: Sequence[Rule]) -> Node:
    """The rules as a tree."""
    found: list[Guarded] = []
    for rule in rules:
        action = task.actions[rule.action]
        node = ActionNode("", action.name, latched=False, guarded=action.precondition != TRUE)
        found.append((conjuncts(_condition(task, model, rule)), node))
    goal = ConditionNode("", certainly(task, task.goal))
    return numbered(ControlNode("", "fallback", (goal, *factored(task, found))) if found else goal)


def _condition(task: Task, model: Determinised, rule: Rule) -> Condition:
    """The guards of a rule, what they share first. A precondition that may be unknown is read here, too: the
    action would wait for it."""
    shared = rule.guards[0].partial
    for guard in rule.guards[1:]:
        differ = shared.mask & guard.partial.mask & ~(shared.value ^ guard.partial.value)
        common = [each for each in literals(model.packing, shared) if each.mask & differ == each.mask]
        shared = PartialState(sum(each.mask for each in common), sum(each.value for each in common))
    precondition = task.actions[rule.action].precondition
    parts: list[Condition] = []
    if any(task.variables[variable].three_valued for variable in variables(precondition)):
        parts.append(certainly(task, precondition))
    parts.extend(_certain(task, model, shared))
    ways = []
    for guard in rule.guards:
        own = list(_certain(task, model, without(guard.partial, shared.mask)))
        own.extend(disjunction(_certain(task, model, each, negated=True)) for each in guard.excluded)
        ways.append(conjunction(own))
    return conjunction([*parts, disjunction(ways)])


def _certain(
    task: Task, model: Determinised, partial: PartialState, *, negated: bool = False
) -> Iterator[Condition]:
    for condition in as_conditions(model.packing, partial):
        whole = certainly(task, condition)
        yield (
            certainly(task, negation(condition))
            if negated and whole == condition
            else (negation(whole) if negated else whole)
        )


def certainly(task: Task, condition: Condition) -> Condition:
    """True where a condition is, and false where that is unknown, too."""

    def certain(leaf: Is | Known) -> Condition:
        if (
            isinstance(leaf, Is)
            and leaf.value is not Truth.UNKNOWN
            and task.variables[leaf.variable].three_valued
        ):
            return And((Known(leaf.variable), leaf))
        return leaf

    return replaced(condition, certain, numbers=lambda number: number)
