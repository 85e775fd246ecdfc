"""Random trees full of actions, on random small tasks, by seed."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction
from itertools import count

from bbtc.ground.condition import FALSE, TRUE, And, Condition, Is, Known, Not, Or
from bbtc.ground.task import Effect, Factor, GroundAction, InitialState, Outcome, Task, Variable
from bbtc.kleene import Truth
from bbtc.tree.nodes import (
    ActionNode,
    ConditionNode,
    ControlKind,
    ControlNode,
    Node,
    Tree,
    actions_of,
    retries_until_success_of,
)

KINDS: tuple[ControlKind, ...] = ("sequence", "fallback", "skipper")


def random_task(rng: random.Random) -> Task:
    """Up to five variables, two or three of them of one predicate, and up to four actions."""
    made = {}
    for _ in range(rng.randint(1, 5)):
        args = rng.choice([(), ("a",), ("b",), ("a", "b"), ("7",)])
        variable = Variable(f"{rng.choice('pqr')}{len(args)}", args, rng.random() < 0.7)
        made[variable.name] = variable
    variables = tuple(made[name] for name in sorted(made))
    acts = {}
    for _ in range(rng.randint(1, 4)):
        args = rng.choice([(), ("a",), ("b",), ("7",), ("a", "b"), ("a", "a")])
        action = GroundAction(
            f"{rng.choice('uvp')}{len(args)}",
            args,
            random_condition(rng, variables, 2),
            (random_factor(rng, variables, 1),),
        )
        acts[action.name] = action
    values = [random_initial(rng, variables) for _ in range(2)]
    return Task(
        "random",
        "one",
        variables,
        (InitialState(Fraction(1, 3), values[0]), InitialState(Fraction(2, 3), values[1])),
        random_condition(rng, variables, 2),
        tuple(acts[name] for name in sorted(acts)),
    )


def random_initial(rng: random.Random, variables: tuple[Variable, ...]) -> tuple[Truth, ...]:
    """A value for every variable."""
    return tuple(rng.choice(variable.values) for variable in variables)


def random_factor(rng: random.Random, variables: tuple[Variable, ...], nested: int) -> Factor:
    """Two outcomes, with conditional effects and chance in chance."""
    outcomes = []
    for probability in (Fraction(2, 7), Fraction(5, 7)):
        effects = []
        for _ in range(rng.randint(0, 2)):
            indices = [rng.randrange(len(variables)) for _ in range(2)]
            sets = tuple((index, rng.choice(variables[index].values)) for index in indices)
            when = random_condition(rng, variables, 1) if rng.random() < 0.4 else None
            effects.append(Effect(when, sets))
        then = (random_factor(rng, variables, 0),) if nested and rng.random() < 0.3 else ()
        outcomes.append(Outcome(probability, tuple(effects), then))
    return Factor(tuple(outcomes))


def random_condition(rng: random.Random, variables: tuple[Variable, ...], depth: int) -> Condition:
    """A literal, a test, or a compound of up to ``depth`` levels."""
    if depth and rng.random() < 0.4:
        if rng.random() < 0.3:
            return Not(random_condition(rng, variables, depth - 1))
        parts = tuple(random_condition(rng, variables, depth - 1) for _ in range(rng.randint(0, 3)))
        return And(parts) if rng.random() < 0.5 else Or(parts)
    index = rng.randrange(len(variables))
    if rng.random() < 0.05:
        return rng.choice([TRUE, FALSE])
    if rng.random() < 0.2:
        return Known(index)
    return Is(index, rng.choice([Truth.TRUE, Truth.TRUE, Truth.TRUE, Truth.FALSE, Truth.UNKNOWN]))


def random_tree(seed: int, latched: float = 0.85, guarded: float = 0.3, depth: int = 4) -> Tree:
    """A tree of up to ``depth`` levels of control nodes that obeys the Skipper rule, with at least
    three action nodes. ``latched`` and ``guarded`` are the shares of such action nodes."""
    rng = random.Random(seed)
    while True:
        task = random_task(rng)
        root = _Grower(rng, task, latched, guarded).node(depth, False)
        if sum(1 for _ in actions_of(root)) >= 3:
            root = _with_templates(root, random.Random(-seed - 1))
            return Tree(task, root, Fraction(1, 2), Fraction(1), "stuck")


def _with_templates(node: Node, rng: random.Random) -> Node:
    """The node with labels, as if parts of it were expansions of templates, some with the objects of
    the tasks for arguments."""
    if isinstance(node, ControlNode):
        node = replace(node, children=tuple(_with_templates(child, rng) for child in node.children))
    if rng.random() < 0.85:
        return node
    args = rng.sample(["a", "b", "7", "c"], rng.randint(0, 3))
    return replace(node, template=f"{rng.choice('st')}({','.join(args)})")


def busy_tree(seed: int, starts: int = 4, endless: bool = False) -> Tree:
    """A tree that may start in up to ``starts`` states and of which several parts get their turn, with
    at least three action nodes. Unless it may be ``endless``, all that are not latched stand below
    retry nodes."""
    rng = random.Random(seed)
    while True:
        task = random_task(rng)
        drawn = sorted({random_initial(rng, task.variables) for _ in range(starts)})
        share = Fraction(1, len(drawn))
        task = replace(task, initial=tuple(InitialState(share, values) for values in drawn))
        grower = _Grower(rng, task, latched=0.6, guarded=0.3)
        choices: list[tuple[ControlKind, ControlKind, Condition]] = [
            ("sequence", "fallback", TRUE),
            ("fallback", "sequence", FALSE),
        ]
        kind, inner, end = rng.choice(choices)
        parts = [grower.part() for _ in range(rng.randint(2, 4))]
        # Whatever becomes of a part, the next one follows.
        parts[:-1] = [grower.control(inner, part, grower.check(end)) for part in parts[:-1]]
        root: Node = grower.control(kind, *parts)
        if sum(1 for _ in actions_of(root)) >= 3:
            root = root if endless else _ending(root)
            return Tree(task, root, Fraction(1, 2), Fraction(1), "stuck")


def _ending(node: Node) -> Node:
    """The node, with all actions latched that do not stand below a retry node."""
    if isinstance(node, ActionNode):
        return replace(node, latched=True)
    if isinstance(node, ControlNode) and node.kind != "retry":
        return replace(node, children=tuple(_ending(child) for child in node.children))
    return node


class _Grower:
    def __init__(self, rng: random.Random, task: Task, latched: float, guarded: float) -> None:
        self.rng = rng
        self.task = task
        self.latched = latched
        self.guarded = guarded
        self.ids = count(1)

    def part(self) -> Node:
        """A subtree, often below a retry node."""
        below = self.node(3, False)
        if self.rng.random() < 0.6:
            return below
        return ControlNode(f"n{next(self.ids)}", "retry", (below,), attempts=self.rng.randint(2, 4))

    def node(self, level: int, passive: bool) -> Node:
        """A subtree; a ``passive`` one holds no actions."""
        if level == 0 or self.rng.random() < 0.2:
            return self.condition() if passive or self.rng.random() < 0.3 else self.action()
        if not passive and self.rng.random() < 0.5:
            return self.planned(level)
        if not passive and self.rng.random() < 0.15:
            below = self.node(level - 1, False)
            return ControlNode(f"n{next(self.ids)}", "retry", (below,), attempts=self.rng.randint(1, 3))
        kind = self.rng.choice(KINDS)
        width = self.rng.choice([0, 1, 2, 2, 2, 3, 3])
        closed = [passive or (kind == "skipper" and i < width - 1) for i in range(width)]
        return self.control(kind, *(self.node(level - 1, c) for c in closed))

    def planned(self, level: int) -> Node:
        """What a planner builds: attempts at a condition, and the condition again after them."""
        wanted = random_condition(self.rng, self.task.variables, 1)
        attempts = [
            self.control("sequence", self.node(level - 2 if level > 1 else 0, False), self.check(wanted))
            for _ in range(self.rng.randint(1, 2))
        ]
        if self.rng.random() < 0.5:
            return self.control("fallback", self.check(wanted), *attempts)
        after = self.control("sequence", self.control("fallback", *attempts), self.check(wanted))
        return self.control("skipper", self.check(wanted), after)

    def control(self, kind: ControlKind, *children: Node) -> ControlNode:
        return ControlNode(f"n{next(self.ids)}", kind, children)

    def check(self, condition: Condition) -> ConditionNode:
        return ConditionNode(f"n{next(self.ids)}", condition)

    def condition(self) -> ConditionNode:
        return self.check(random_condition(self.rng, self.task.variables, 2))

    def action(self) -> ActionNode:
        action = self.rng.choice(self.task.actions).name
        kept, guarded = self.rng.random() < self.latched, self.rng.random() < self.guarded
        return ActionNode(f"n{next(self.ids)}", action, kept, guarded)


def with_attempts(tree: Tree, seed: int) -> Tree:
    """The tree with retry-until-success nodes around some of its parts, at least one of which acts."""
    rng = random.Random(seed)
    ids = count(1)

    def tried(node: Node) -> Node:
        if isinstance(node, ControlNode):
            node = replace(node, children=tuple(map(tried, node.children)))
        if rng.random() < (0.2 if any(actions_of(node)) else 0.03):
            attempts = rng.choice([1, 2, 2, 3, 3, 4])
            node = ControlNode(f"u{next(ids)}", "retry-until-success", (node,), attempts=attempts)
        return node

    while True:
        root = tried(tree.root)
        if any(any(actions_of(node)) for node, _ in retries_until_success_of(root)):
            return replace(tree, root=root)
