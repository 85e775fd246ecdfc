"""One run of a tree, a tick at a time, forwards and back."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from bbtc.belief.draws import Values
from bbtc.belief.state import State, Transition, compile_action, initial_belief
from bbtc.belief.tick import STARTED, Memory, NodeStatus, Tick, compile_tick, memory_of
from bbtc.belief.truth import HiddenTruth, Worlds
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.markov import distribution
from bbtc.tree.nodes import ActionNode, Node, actions_of


@dataclass(frozen=True, slots=True)
class Branch:
    """What may come next: its probability, and the values of the variables then."""

    probability: Fraction
    values: Values


@dataclass(frozen=True, slots=True)
class Moment:
    """A tick: the state it reads, the status every node it reached returned (by node id), and the
    action node it started, None at the end of the run. ``branches`` are the possible outcomes of
    that action, the most probable first; outcomes that differ only in cost are one. ``after`` is what is
    remembered then."""

    state: State
    statuses: dict[str, NodeStatus]
    status: NodeStatus
    action: ActionNode | None
    branches: tuple[Branch, ...]
    after: int = 0
    worlds: Worlds = ()
    """What is true, where facts are hidden."""


@dataclass(slots=True)
class Stepper:
    """A run that can be taken on, outcome by outcome, and back.

    Drawn outcomes depend on the seed and on the number of the step alone, so that going back and on
    again draws what was drawn before. A step raises :class:`bbtc.diagnostics.LimitReached` where an
    action has too many outcomes for the limits.
    """

    task: Task
    root: Node
    seed: int = 0
    limits: Limits = field(default_factory=Limits)
    moments: list[Moment] = field(default_factory=list, init=False)
    _transitions: dict[str, Transition] = field(default_factory=dict, init=False)
    _statuses: dict[str, NodeStatus] = field(default_factory=dict, init=False)
    _actions: list[ActionNode] = field(init=False)
    _memory: Memory = field(init=False)
    _returned: Tick = field(init=False)
    truth: HiddenTruth = field(init=False)

    def __post_init__(self) -> None:
        self.truth = HiddenTruth(self.task, self.seed)
        self._actions = list(actions_of(self.root))
        self._memory = memory_of(self.root)
        self._returned = compile_tick(self.task, self.root, self._observe)

    @property
    def starts(self) -> tuple[Branch, ...]:
        """The initial belief, the most probable first."""
        return _branches(initial_belief(self.task))

    @property
    def now(self) -> Moment:
        """The last tick made. Raises ``IndexError`` before :meth:`start`."""
        return self.moments[-1]

    @property
    def finished(self) -> bool:
        """Has the last tick started no action?"""
        return self.now.action is None

    def start(self, choice: int | None = None) -> None:
        """Begin again: in the initial state number ``choice`` (from 0), or in a drawn one. What is true is
        as the problem says, as far as it says that and it can be in that state."""
        starts, given = self.starts, self.truth.given()
        real = starts
        if given is not None:
            chances = (each.probability * self.truth.begins(each.values, given) for each in starts)
            real = tuple(Branch(p, each.values) for p, each in zip(chances, starts, strict=True))
        begun = real[self._draw(real, 0) if choice is None else choice]
        worlds = given if given is not None and begun.probability else self.truth.first(begun.values)
        self.moments = [self._tick(State(begun.values, 0), worlds)]

    def step(self, choice: int | None = None) -> None:
        """Take outcome number ``choice`` (from 0) of the running action, or a drawn one, and tick."""
        moment = self.now
        assert moment.action is not None
        step, action = len(self.moments), moment.action.action
        index = self._draw(self._really(moment, action), step) if choice is None else choice
        values = moment.branches[index].values
        worlds = moment.worlds
        if worlds:
            worlds = self.truth.after(action, moment.state.values, worlds, values, step)
        self.moments.append(self._tick(State(values, moment.after), worlds))

    def _really(self, moment: Moment, action: str) -> Sequence[Branch]:
        """What may come next, as probable as it is in what is true."""
        if not moment.worlds:
            return moment.branches
        before = moment.state.values
        return [
            Branch(
                branch.probability * self.truth.chance(action, before, moment.worlds, branch.values),
                branch.values,
            )
            for branch in moment.branches
        ]

    def back(self) -> bool:
        """Take the last step back; False at the start."""
        if len(self.moments) < 2:
            return False
        self.moments.pop()
        return True

    def _draw(self, branches: Sequence[Branch], step: int) -> int:
        point = Fraction(random.Random(f"{self.seed}:{step}").getrandbits(64), 1 << 64)
        for index, branch in enumerate(branches):
            point -= branch.probability
            if point < 0:
                return index
        return len(branches) - 1

    def _observe(self, node: Node, returned: int) -> None:
        self._statuses[node.id] = NodeStatus.RUNNING if returned >= STARTED else NodeStatus(returned)

    def _tick(self, state: State, worlds: Worlds) -> Moment:
        statuses = self._statuses = {}
        returned = self._returned(state.values, state.finished)
        if returned < STARTED:
            return Moment(state, statuses, NodeStatus(returned), None, (), 0, worlds)
        action = self._actions[self._memory.action(returned)]
        if action.action not in self._transitions:
            ground = self.task.action_by_name[action.action]
            self._transitions[action.action] = compile_action(self.task, ground, self.limits)
        results = self._transitions[action.action](state.values)
        after = distribution((result.values, result.probability) for result in results)
        remembered = self._memory.after(state.finished, returned)
        return Moment(state, statuses, NodeStatus.RUNNING, action, _branches(after), remembered, worlds)


def _branches(belief: dict[Values, Fraction]) -> tuple[Branch, ...]:
    ranked = sorted(belief.items(), key=lambda item: (-item[1], item[0]))
    return tuple(Branch(probability, values) for values, probability in ranked)
