"""The semantics page as plainly as it can be written: the oracle of the oracle.

Shares nothing with :mod:`bbtc.belief` but the data: its own Kleene tables, its own tick, one state
at a time, and outcomes drawn from nowhere (any assignment may follow an action).
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field

from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within
from bbtc.ground.task import Factor, GroundAction, Task
from bbtc.kleene import Truth
from bbtc.replay.script import Run, Script, Values
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, walk
from tests.replay.ticks import Tick, TickScript, TickWorld

AND = {"TT": "T", "TU": "U", "TF": "F", "UT": "U", "UU": "U", "UF": "F", "FT": "F", "FU": "F", "FF": "F"}
OR = {"TT": "T", "TU": "T", "TF": "T", "UT": "T", "UU": "U", "UF": "U", "FT": "T", "FU": "U", "FF": "F"}
NOT = {"T": "F", "U": "U", "F": "T"}
STATUS = {"T": "success", "U": "running", "F": "failure"}
GOES_ON = {"sequence": "success", "fallback": "failure", "skipper": "running"}


def value_of(condition: Condition, values: Values) -> str:
    """T, U or F."""
    if isinstance(condition, Constant):
        return "T" if condition.value else "F"
    if isinstance(condition, Known):
        return "F" if values[condition.variable] == 1 else "T"
    if isinstance(condition, Is):
        letter = "FUT"[values[condition.variable]]
        if condition.value is Truth.UNKNOWN:
            return "T" if letter == "U" else "F"
        return letter if condition.value is Truth.TRUE else NOT[letter]
    if isinstance(condition, Within):
        digits = enumerate(condition.digits)
        number = sum(2**place for place, digit in digits if values[digit] == 2)
        return "T" if condition.low <= number <= condition.high else "F"
    if isinstance(condition, Not):
        return NOT[value_of(condition.part, values)]
    result, table = ("T", AND) if isinstance(condition, And) else ("F", OR)
    assert isinstance(condition, And | Or)
    for part in condition.parts:
        result = table[result + value_of(part, values)]
    return result


@dataclass
class Ticking:
    """One run of a tree: the values now, and the latched nodes that have finished."""

    task: Task
    values: Values
    finished: set[str] = field(default_factory=set)
    tries: dict[str, int] = field(default_factory=dict)
    started: ActionNode | None = None
    around: list[ControlNode] = field(default_factory=list)
    lost: dict[str, int] = field(default_factory=dict)
    """The attempts of retry-until-success nodes that have failed."""
    going: set[str] = field(default_factory=set)
    """Those of them that are running in this tick."""
    below: dict[str, frozenset[str]] = field(default_factory=dict)
    """The nodes of the tree by the one that they are below of, itself included, as far as they were asked
    for."""

    def tick_all(self, root: Node) -> str:
        """One tick of a tree. What it does not leave running is halted."""
        self.started = None
        self.going.clear()
        status = self.tick(root)
        self.halt(root)
        return status

    def halt(self, root: Node) -> None:
        """Every retry-until-success that is not running begins anew."""
        if self.lost.keys() <= self.going:
            return
        for node in walk(root):
            if node.id in self.lost and node.id not in self.going:
                self.forget(node)

    def forget(self, node: Node) -> None:
        """Nothing is remembered of a node and of what is below it."""
        if node.id not in self.below:
            self.below[node.id] = frozenset(each.id for each in walk(node))
        below = self.below[node.id]
        self.finished -= below
        for made in (self.tries, self.lost):
            for each in below & made.keys():
                del made[each]

    def until_success(self, node: ControlNode) -> str:
        """The status of the child, which is tried again where it fails."""
        (child,) = node.children
        assert node.attempts is not None
        while True:
            self.lost.setdefault(node.id, 0)
            status = self.tick(child)
            if status == "running":
                self.going.add(node.id)
                return status
            if status == "failure" and self.lost[node.id] + 1 < node.attempts:
                self.lost[node.id] += 1
                self.forget(child)
                continue
            self.forget(node)
            return status

    def tick(self, node: Node) -> str:
        """The status a node returns; :attr:`started` is the action it started."""
        if isinstance(node, ConditionNode):
            return STATUS[value_of(node.condition, self.values)]
        if isinstance(node, ActionNode):
            return self.act(node)
        assert isinstance(node, ControlNode)
        if node.kind == "retry":
            self.around.append(node)
            status = self.tick(node.children[0])
            self.around.pop()
            return status
        if node.kind == "retry-until-success":
            return self.until_success(node)
        for child in node.children:
            status = self.tick(child)
            if status != GOES_ON[node.kind]:
                return status
        return GOES_ON[node.kind]

    def act(self, node: ActionNode) -> str:
        """The status of an action node, which starts its action where it may."""
        if node.id in self.finished:
            return "success"
        if node.guarded:
            allowed = value_of(self.task.action_by_name[node.action].precondition, self.values)
            if allowed != "T":
                return STATUS[allowed]
        if any(self.tries.get(retry.id, 0) == retry.attempts for retry in self.around):
            return "failure"
        if self.passed_by():
            return "running"
        assert self.started is None, "a tick starts at most one action"
        self.started = node
        for retry in self.around:
            self.tries[retry.id] = self.tries.get(retry.id, 0) + 1
        return "running"

    def passed_by(self) -> bool:
        """Whether nothing starts, since the tick has passed by an action that ran."""
        return False

    def started_now(self) -> ActionNode | None:
        """The action the last tick started."""
        return self.started


@dataclass
class Running(Ticking):
    """A run in which actions take many ticks: docs/multi-tick-actions.md, as plainly."""

    world: TickWorld = field(kw_only=True)
    runs: ActionNode | None = None
    ran: bool = False
    """Whether an action was running when the tick began."""
    called: bool = False
    failed: set[str] = field(default_factory=set)
    before: Values = ()
    """All values in the tick that started the running action."""

    def act(self, node: ActionNode) -> str:
        """The status of an action node, which calls its action if it runs or may start."""
        if node is self.runs:
            during = self.task.action_by_name[node.action].during
            if during is not None and value_of(during, self.world.values) != "T":
                self.called = True
                self._cancel()
                return "running"
            self._call(node, self.world.go_on(node.id))
            return "running"
        if node.id in self.failed:
            return "failure"
        status = super().act(node)
        if self.started is node:
            assert self.runs is None
            self.before = self.values
            self._call(node, self.world.start(node.action, node.id))
        return status

    def passed_by(self) -> bool:
        return self.ran

    def _call(self, node: ActionNode, ended: bool) -> None:
        self.called = True
        self.runs = None if ended else node
        if ended and node.latched:
            (self.finished if self.world.succeeds else self.failed).add(node.id)

    def _cancel(self) -> None:
        if self.runs is not None:
            self.world.cancel(self.runs.id)
            if self.runs.latched:
                self.finished.add(self.runs.id)
            self.runs = None

    def forget(self, node: Node) -> None:
        below = {each.id for each in walk(node)}
        if self.runs is not None and self.runs.id in below:
            self.world.cancel(self.runs.id)
            self.runs = None
        self.failed -= below
        super().forget(node)

    def view(self) -> Values:
        """What the tree reads: what the running action may set is as it was when it started."""
        if self.runs is None:
            return self.world.values
        action = self.task.action_by_name[self.runs.action]
        if action.uninterruptible:
            return self.before
        own = set_by(self.task, action)
        return tuple(
            old if variable in own else new
            for variable, (old, new) in enumerate(zip(self.before, self.world.values, strict=True))
        )

    def tick_root(self, root: Node) -> str:
        """One tick. What it does not call is cancelled; where nothing is called, nothing runs."""
        self.values, self.called, self.ran = self.view(), False, self.runs is not None
        status = self.tick_all(root)
        if self.called:
            return status
        self._cancel()
        self.halt(root)
        if self.ran:
            return "running"
        return "failure" if status == "running" else status

    def trace(self, root: Node, script: TickScript) -> list[Tick]:
        """What happens in every tick of a script, until the tree ends."""
        for number in range(len(script.before)):
            self.world.next_tick()
            status = self.tick_root(root)
            self.world.tick_ended(status)
            if status != "running":
                break
            if number in script.halts:
                self._cancel()
                self.going.clear()
                self.halt(root)
        return self.world.ticks


def set_by(task: Task, action: GroundAction) -> set[int]:
    """The variables that an action may set, or make known."""
    found: set[int] = set()

    def look(factors: tuple[Factor, ...], names: dict[int, int]) -> None:
        for factor in factors:
            for outcome in factor.outcomes:
                for effect in outcome.effects:
                    found.update(names[variable] for variable, _ in effect.sets if variable in names)
                look(outcome.factors, names)

    look(action.factors + action.on_abort, {number: number for number in range(len(task.variables))})
    for change in action.changes:
        facts = len(task.components[change.component].facts)
        look(change.factors, {facts + at: variable for at, variable in enumerate(change.seen)})
        found |= {knowledge.variable for knowledge in task.components[change.component].known}
    return found


def expected_ticks(task: Task, root: Node, script: TickScript) -> list[Tick]:
    """What the page says that happens in every tick."""
    return Running(task, (), world=TickWorld(task, script)).trace(root, script)


def expected_run(task: Task, root: Node, script: Script) -> Run:
    """What a tree does with a script."""
    run = Ticking(task, script.initial)
    names: list[str] = []
    for step in range(len(script.steps) + 1):
        status = run.tick_all(root)
        started = run.started_now()
        if started is None:
            return Run(tuple(names), "success" if status == "success" else "failure", run.values)
        names.append(started.action)
        if step == len(script.steps) or script.steps[step][0] != started.action:
            break
        run.values = script.steps[step][1]
        if started.latched:
            run.finished.add(started.id)
    return Run(tuple(names), "cut", run.values)


def varied_runs(task: Task, root: Node, seed: int, keep: int = 8, most: int = 8) -> list[tuple[Script, Run]]:
    """Up to ``keep`` different runs of a tree: of many random ones those with the most actions, and
    two short ones. Empty for a tree that hardly ever acts."""
    rng = random.Random(seed)
    runs = dict.fromkeys(random_run(task, root, rng, most) for _ in range(5 * keep))
    ordered = sorted(runs, key=lambda made: -len(made[0].steps))
    if len(ordered[0][0].steps) < 2:
        return []
    return [*ordered[: keep - 2], *ordered[keep - 2 :][-2:]]


def random_run(task: Task, root: Node, rng: random.Random, most: int) -> tuple[Script, Run]:
    """A run with random outcomes, cut when it starts more than ``most`` actions."""
    run = Ticking(task, ())
    run.values = initial = _lively_values(run, root, rng)
    steps: list[tuple[str, Values]] = []
    while True:
        status = run.tick_all(root)
        names = tuple(name for name, _ in steps)
        started = run.started_now()
        if started is None:
            ended = Run(names, "success" if status == "success" else "failure", run.values)
            return Script(initial, tuple(steps)), ended
        assert status == "running"
        if len(steps) == most:
            return Script(initial, tuple(steps)), Run((*names, started.action), "cut", run.values)
        if started.latched:
            run.finished.add(started.id)
        run.values = _lively_values(run, root, rng)
        steps.append((started.action, run.values))


def _lively_values(run: Ticking, root: Node, rng: random.Random) -> Values:
    # Random outcomes end a tree soon: of a few, take one that keeps it going, most of the time.
    for _ in range(rng.choice([1, 6, 6, 6])):
        values = _random_values(run.task, rng, run.values)
        ahead = Ticking(
            run.task, values, set(run.finished), dict(run.tries), lost=dict(run.lost), below=run.below
        )
        ahead.tick_all(root)
        if ahead.started is not None:
            break
    return values


def _random_values(task: Task, rng: random.Random, before: Values) -> Values:
    """Any assignment; after another one, one that keeps about half of it."""
    drawn = tuple(int(rng.choice(variable.values)) for variable in task.variables)
    return tuple(rng.choice(pair) for pair in zip(before, drawn, strict=True)) if before else drawn
