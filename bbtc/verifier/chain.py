"""A tree and its task as a Markov chain.

Two forms, of the same states between actions:

* *guards*: one step is one tick and the outcome of the action it starts. The command of an action node
  has for its guard that the tick comes to the node (every node to its left let the tick go on) and
  that the node then starts. What nodes return are formulas, one for each node and status.
* *walk*: one step is one leaf. A cell says at which leaf the tick is; each leaf leads on to the leaf
  that is ticked next if it succeeds, fails or runs. Longer runs, but a program whose size is that of
  the tree, where formulas written out would grow with its depth.

Source: the pages on semantics, not the simulator: this is its independent check.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal, TypeAlias

from typing_extensions import assert_never

from bbtc.ground.condition import variables
from bbtc.ground.describe import describe
from bbtc.ground.task import Task
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, actions_of, tree_depth, walk
from bbtc.verifier.conditions import where_false, where_true
from bbtc.verifier.outcomes import MOST_BRANCHES, Outcomes, relevant
from bbtc.verifier.program import (
    NO,
    YES,
    Branch,
    Cell,
    Choose,
    Command,
    Compare,
    Drafting,
    Expression,
    Increment,
    Program,
    Update,
    all_of,
    any_of,
    nesting,
    none_of,
    put,
    written_size,
)
from bbtc.verifier.start import Start, write_start

Form: TypeAlias = Literal["guards", "walk"]
Returned: TypeAlias = Literal["success", "failure", "running"]

MOST_WRITTEN = 200_000
"""Atoms that a program in the form *guards* may have with its formulas written out, and"""
DEEPEST = 100
"""levels of its expressions; beyond, readers of the program take too long or give up."""
DEEPEST_TREE = 50
"""Levels of a tree that has this form at all."""
_WIDE = 6  # children; of more, expressions are not nested in one another

_ZERO, _ONE = Fraction(0), Fraction(1)
_GO_ON: dict[str, Returned] = {"sequence": "success", "fallback": "failure", "skipper": "running"}


def chain_of(
    task: Task,
    root: Node,
    form: Form | None = None,
    most_branches: int = MOST_BRANCHES,
    most_written: int = MOST_WRITTEN,
) -> Program:
    """The Markov chain. ``form`` None takes *guards* where the program stays small, else *walk*.

    Labels: ``success``, ``failure``, ``blocked`` (the ends), ``finished`` (any of them), ``goal`` (it
    is true), ``unready`` (an action starts where its precondition is not true).
    """
    if form is None:
        if tree_depth(root) > DEEPEST_TREE:
            return chain_of(task, root, "walk", most_branches)
        program = chain_of(task, root, "guards", most_branches)
        roots = [*program.roots(), *(formula.expression for formula in program.formulas)]
        small = written_size(program) <= most_written and nesting(roots) <= DEEPEST
        return program if small else chain_of(task, root, "walk", most_branches)
    writer = _Guards(task, root, most_branches) if form == "guards" else _Walk(task, root, most_branches)
    writer.write()
    finished = writer.draft.define("", "finished", any_of(*writer.ends.values()))
    labels = [*writer.ends.items(), ("finished", finished)]
    goal = all_of(writer.start.begun, where_true(task.goal, writer.start.cell_of))
    labels += [("goal", goal), ("unready", any_of(*writer.unready))]
    stay = Branch(_ONE, (), (_ZERO, _ZERO, _ZERO))
    final = Command(None, finished, (stay,), "the run is over")
    return Program(
        kind="dtmc",
        title=f"{task.domain}/{task.problem}",
        cells=tuple(writer.draft.cells),
        formulas=tuple(writer.draft.formulas),
        commands=(*writer.start.commands, *writer.commands, *writer.outcomes.commands, final),
        labels=tuple(labels),
    )


def solvable_chain(task: Task, root: Node) -> Program:
    """The Markov chain with the fewest states, for a solver that computes each formula but once."""
    return chain_of(task, root, "walk" if tree_depth(root) > DEEPEST_TREE else "guards")


@dataclass(slots=True)
class _Tries:
    """Of a retry-until-success node: its number, the cell that counts its failed attempts, where there is a
    further one, the action nodes below it, and the cells of what is remembered there."""

    number: int
    failed: int
    left: Expression
    actions: set[str] = field(default_factory=set)
    below: set[int] = field(default_factory=set)


@dataclass(slots=True)
class _Writer:
    """What both forms share: the cells, and when an action node starts."""

    task: Task
    root: Node
    most_branches: int
    draft: Drafting = field(default_factory=Drafting)
    commands: list[Command] = field(default_factory=list)
    unready: list[Expression] = field(default_factory=list)
    ends: dict[str, Expression] = field(default_factory=dict)
    start: Start = field(init=False)
    outcomes: Outcomes = field(init=False)
    _done: dict[str, int] = field(default_factory=dict)
    _attempts: dict[str, list[tuple[int, int]]] = field(default_factory=dict)
    _tries: dict[str, _Tries] = field(default_factory=dict)

    def __post_init__(self) -> None:
        nodes = list(actions_of(self.root))
        names = sorted({node.action for node in nodes})
        actions = [self.task.action_by_name[name] for name in names]
        read = set(variables(self.task.goal))
        for action in actions:
            read.update(variables(action.precondition))
        for node in walk(self.root):
            if isinstance(node, ConditionNode):
                read.update(variables(node.condition))
        self.start = write_start(self.task, relevant(self.task, actions, read), self.draft)
        for node in nodes:
            if node.latched:
                meaning = f"has {node.action} finished?"
                self._done[node.id] = self.draft.cell(Cell("done", node.id, meaning, 1))
        self._note_attempts(self.root, [], ())
        self.outcomes = Outcomes(self.draft, self.start.cell_of, self.most_branches)
        self.outcomes.prepare(actions, self.task)

    def _note_attempts(self, node: Node, around: list[tuple[int, int]], tries: tuple[_Tries, ...]) -> None:
        match node:
            case ActionNode():
                self._attempts[node.id] = around
                for each in tries:
                    each.actions.add(node.id)
                    if node.latched:
                        each.below.add(self._done[node.id])
            case ConditionNode():
                pass
            case ControlNode():
                if node.attempts is not None:
                    what = "made" if node.kind == "retry" else "failed"
                    cell = Cell("attempts", node.id, f"attempts {what}, of {node.attempts}", node.attempts)
                    number = self.draft.cell(cell)
                    for each in tries:
                        each.below.add(number)
                    if node.kind == "retry":
                        around = [*around, (number, node.attempts)]
                    else:
                        left = Compare(number, "<", node.attempts - 1) if node.attempts > 1 else NO
                        own = _Tries(len(self._tries) + 1, number, left)
                        self._tries[node.id] = own
                        tries = (*tries, own)
                for child in node.children:
                    self._note_attempts(child, around, tries)
            case _:
                assert_never(node)

    @property
    def between(self) -> Expression:
        """Is a tick the next thing to happen?"""
        return all_of(self.start.begun, self.outcomes.idle)

    def leaf(self, node: ActionNode | ConditionNode, anew: _Tries | None = None) -> dict[str, Expression]:
        """Where the leaf succeeds, fails, and, in an action, starts; elsewhere it is running. ``anew`` is the
        outermost node of which an attempt has failed in this tick."""
        cell_of = self.start.cell_of
        if isinstance(node, ConditionNode):
            true, false = where_true(node.condition, cell_of), where_false(node.condition, cell_of)
            return {"success": true, "failure": false, "started": NO}
        gone = set() if anew is None else anew.below
        done: Expression = NO
        if node.latched and self._done[node.id] not in gone:
            done = Compare(self._done[node.id], "=", 1)
        true, false = YES, NO
        if node.guarded:
            precondition = self.task.action_by_name[node.action].precondition
            true, false = where_true(precondition, cell_of), where_false(precondition, cell_of)
        left = all_of(
            *(Compare(cell, "<", attempts) for cell, attempts in self._attempts[node.id] if cell not in gone)
        )
        refused = any_of(false, all_of(true, none_of(left)))
        return {
            "success": done,
            "failure": all_of(none_of(done), refused),
            "started": all_of(none_of(done), true, left),
        }

    def starting(
        self, node: ActionNode, guard: Expression, then: Sequence[Update], anew: _Tries | None = None
    ) -> None:
        """Write the command that starts the action where ``guard`` holds; ``then`` are updates
        besides those that the start itself makes."""
        action = self.task.action_by_name[node.action]
        gone = set() if anew is None else set(anew.below)
        for each in self._tries.values():  # what this start halts, or has ended before it
            if node.id not in each.actions:
                gone |= {each.failed, *each.below}
        made = [cell for cell, _ in self._attempts[node.id]]
        done = {self._done[node.id]} if node.latched else set()
        updates: list[Update] = [Increment(cell) for cell in made if cell not in gone]
        updates += [put(cell, 1) for cell in made if cell in gone]
        updates += [put(cell, 1) for cell in done]
        updates += [put(cell, 0) for cell in sorted(gone - done - set(made))]
        if anew is not None:
            updates.append(Increment(anew.failed))
        branches = self.outcomes.branches(action, [*updates, *then])
        self.commands.append(Command(node.action, guard, branches, f"node {node.id}"))
        ready = where_true(action.precondition, self.start.cell_of)
        self.unready.append(all_of(guard, none_of(ready)))

    def write(self) -> None:
        """Write the commands of a tick and the ends of a run."""
        raise NotImplementedError


# --- guards ----------------------------------------------------------------------------------


@dataclass(slots=True)
class _Guards(_Writer):
    _known: dict[tuple[str, Returned, int], Expression] = field(default_factory=dict)
    _guards: list[Expression] = field(default_factory=list)

    def write(self) -> None:
        self._tick(self.root, self.between)
        success, failure = self.returns(self.root, "success"), self.returns(self.root, "failure")
        blocked = none_of(success, failure, *self._guards)
        for end, holds in (("success", success), ("failure", failure), ("blocked", blocked)):
            self.ends[end] = self.draft.define("", end, all_of(self.between, holds))

    def returns(self, node: Node, status: Returned, anew: _Tries | None = None) -> Expression:
        """Where a tick of the node returns the status; one that starts an action is running."""
        key = (node.id, status, 0 if anew is None else anew.number)
        if key not in self._known:
            found = self._returns(node, status, anew)
            self._known[key] = self.draft.define(node.id, _aspect(status, anew), found)
        return self._known[key]

    def _returns(self, node: Node, status: Returned, anew: _Tries | None) -> Expression:
        match node:
            case ConditionNode() | ActionNode():
                if status == "running":
                    return none_of(self.returns(node, "success", anew), self.returns(node, "failure", anew))
                return self.leaf(node, anew)[status]
            case ControlNode(kind="retry"):
                return self.returns(node.children[0], status, anew)
            case ControlNode(kind="retry-until-success"):
                return self._tried(node, status, anew)
            case ControlNode():
                go_on = _GO_ON[node.kind]
                if status == go_on:
                    return all_of(*(self.returns(child, go_on, anew) for child in node.children))
                if len(node.children) > _WIDE:
                    return self._first(node, status, anew)
                found: Expression = NO
                for child in reversed(node.children):
                    later = NO if found == NO else all_of(self.returns(child, go_on, anew), found)
                    found = any_of(self.returns(child, status, anew), later)
                return found
            case _:
                assert_never(node)

    def _tried(self, node: ControlNode, status: Returned, anew: _Tries | None) -> Expression:
        """An attempt that fails in the tick that it begins in would fail again: no other one is made then."""
        (child,) = node.children
        first, tries = self.returns(child, status, anew), self._tries[node.id]
        if anew is not None or tries.left == NO:
            return first
        again = self.returns(child, status, tries)
        if status == "failure":
            return all_of(first, any_of(none_of(tries.left), again))
        return any_of(first, all_of(self.returns(child, "failure"), tries.left, again))

    def _first(self, node: ControlNode, status: Returned, anew: _Tries | None) -> Expression:
        """Some child returns the status, and all before it let the tick go on."""
        passed: Expression = YES
        cases = []
        for number, child in enumerate(node.children):
            if number:
                before = self.returns(node.children[number - 1], _GO_ON[node.kind], anew)
                aspect = _aspect(f"passes_{number}", anew)
                passed = self.draft.define(node.id, aspect, all_of(passed, before))
            cases.append(all_of(passed, self.returns(child, status, anew)))
        return any_of(*cases)

    def _tick(self, node: Node, comes: Expression, anew: _Tries | None = None) -> None:
        """Write the commands of the action nodes below, which a tick comes to where ``comes``."""
        match node:
            case ConditionNode():
                pass
            case ActionNode():
                starts = all_of(comes, self.leaf(node, anew)["started"])
                guard = self.draft.define(node.id, _aspect("starts", anew), starts)
                if guard != NO:
                    self._guards.append(guard)
                    self.starting(node, guard, [], anew)
            case ControlNode(kind="retry-until-success"):
                (child,) = node.children
                self._tick(child, comes, anew)
                tries = self._tries[node.id]
                if anew is None and tries.left != NO and tries.actions:
                    self._tick(child, all_of(comes, self.returns(child, "failure"), tries.left), tries)
            case ControlNode():
                for child in node.children:
                    if next(actions_of(child), None) is not None:
                        if isinstance(child, ControlNode):
                            comes = self.draft.define(child.id, _aspect("ticked", anew), comes)
                        self._tick(child, comes, anew)
                    if child is not node.children[-1]:
                        comes = all_of(comes, self.returns(child, _GO_ON[node.kind], anew))
            case _:
                assert_never(node)


def _aspect(what: str, anew: _Tries | None) -> str:
    return what if anew is None else f"{what}_anew_{anew.number}"


# --- walk ------------------------------------------------------------------------------------


@dataclass(slots=True)
class _Walk(_Writer):
    _at: int = 0
    _leaves: dict[str, int] = field(default_factory=dict)
    _next: dict[str, dict[Returned, int]] = field(default_factory=dict)
    _again: dict[str, tuple[int, int]] = field(default_factory=dict)
    """By retry-until-success node, where an attempt begins, and where a tick goes on after the last one."""

    def write(self) -> None:
        leaves = [node for node in walk(self.root) if not isinstance(node, ControlNode)]
        self._leaves = {node.id: number for number, node in enumerate(leaves)}
        ends = {end: len(leaves) + number for number, end in enumerate(("success", "failure", "blocked"))}
        first = self._entry(self.root, ends["success"], ends["failure"], ends["blocked"])
        meaning = "the leaf being ticked, from the left; then success, failure, blocked"
        if self._tries:
            meaning += ", failed attempts"
        highest = len(leaves) + 2 + len(self._tries)
        self._at = self.draft.cell(Cell("control", "at", meaning, highest, first))
        for end, place in ends.items():
            self.ends[end] = all_of(self.start.begun, Compare(self._at, "=", place))
        for leaf in leaves:
            self._leaf(leaf, first)
        for node, (entry, failure) in self._again.items():
            self._failed(node, entry, failure)

    def _entry(self, node: Node, success: int, failure: int, running: int) -> int:
        """Where a tick of the node begins, given where it goes on after each status."""
        match node:
            case ConditionNode() | ActionNode():
                self._next[node.id] = {"success": success, "failure": failure, "running": running}
                return self._leaves[node.id]
            case ControlNode(kind="retry"):
                return self._entry(node.children[0], success, failure, running)
            case ControlNode(kind="retry-until-success"):
                entry = self._entry(node.children[0], success, self._place(node.id), running)
                self._again[node.id] = entry, failure
                return entry
            case ControlNode():
                after = {"success": success, "failure": failure, "running": running}
                go_on = _GO_ON[node.kind]
                for child in reversed(node.children):
                    after[go_on] = self._entry(child, after["success"], after["failure"], after["running"])
                return after[go_on]
            case _:
                assert_never(node)

    def _place(self, node: str) -> int:
        """Where a tick is after an attempt of a node has failed."""
        return len(self._leaves) + 2 + self._tries[node].number

    def _failed(self, node: str, entry: int, failure: int) -> None:
        tries = self._tries[node]
        here = all_of(self.between, Compare(self._at, "=", self._place(node)))
        anew: list[Update] = [put(self._at, entry), Increment(tries.failed)]
        anew += [put(cell, 0) for cell in sorted(tries.below)]
        ends: list[Update] = [put(self._at, failure)]
        for holds, updates in ((tries.left, anew), (none_of(tries.left), ends)):
            if holds != NO:
                branch = Branch(_ONE, tuple(updates), (_ZERO, _ZERO, _ZERO))
                self.commands.append(Command(None, all_of(here, holds), (branch,), f"node {node}"))

    def _leaf(self, node: ActionNode | ConditionNode, first: int) -> None:
        here = all_of(self.between, Compare(self._at, "=", self._leaves[node.id]))
        at = self.leaf(node)
        if isinstance(node, ActionNode) and at["started"] != NO:
            self.starting(node, all_of(here, at["started"]), [put(self._at, first)])
        cases = tuple(self._cases(at, self._next[node.id]))
        go_on = Branch(_ONE, (Choose(self._at, cases),), (_ZERO, _ZERO, _ZERO))
        guard = all_of(here, none_of(at["started"]))
        if guard != NO:
            what = describe(self.task, node.condition) if isinstance(node, ConditionNode) else node.action
            self.commands.append(Command(None, guard, (go_on,), f"node {node.id}: {what}"))

    @staticmethod
    def _cases(at: dict[str, Expression], after: dict[Returned, int]) -> Iterator[tuple[Expression, int]]:
        for status in ("success", "failure"):
            if at[status] != NO:
                yield at[status], after[status]
            if at[status] == YES:
                return
        yield YES, after["running"]
