"""Exporter ``py_trees``: a Python module for py_trees 2.2 and later.

It holds the interface that a robot implements, the behaviours that py_trees lacks (copied or imported
from :mod:`bbtc.runtime`), the tree, and a simulated world to run it in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from typing_extensions import assert_never

from bbtc.backends.commitment import Fact, first_variable, held_by
from bbtc.backends.exporter import Figures, Option, OptionValue
from bbtc.backends.interface import (
    Interface,
    action_symbol,
    during_of,
    guard_of,
    interface_of,
    variable_symbol,
)
from bbtc.backends.names import PYTHON_RESERVED, Symbol, identifiers
from bbtc.backends.pytrees.parts import (
    ConditionCode,
    action_summary,
    condition_summary,
    condition_type,
    fact_tuple,
    harmless,
    method,
    words_tuple,
)
from bbtc.backends.pytrees.pycode import Code, Group, Prefixed, call, layout, literal, mapping, sequence
from bbtc.backends.pytrees.runtime import RUNTIME, copied, defined, imports, needed, used_in
from bbtc.backends.pytrees.world import WorldWriter
from bbtc.backends.shape import fit, normal, words_of
from bbtc.ground.condition import Condition
from bbtc.ground.task import Task
from bbtc.printable import printable
from bbtc.rounding import brief
from bbtc.tree.nodes import (
    ActionNode,
    ConditionNode,
    ControlKind,
    ControlNode,
    Node,
    Tree,
    actions_of,
    retries_of,
    tries_without_end,
)

_DEEPEST_EXPRESSION = 10  # levels of nodes in one function; a deeper subtree gets a function


@dataclass(frozen=True, slots=True)
class PyTreesNames:
    """Which method of the generated interface stands for what."""

    interface: Interface
    methods: Mapping[Symbol, str]


def py_trees_names(tree: Tree) -> PyTreesNames:
    """The names used in the export of a tree."""
    interface = interface_of(tree)
    return PyTreesNames(interface, identifiers(interface.leaves, "snake", PYTHON_RESERVED))


@dataclass(frozen=True, slots=True)
class PyTreesExporter:
    """Writes a tree as a Python module."""

    name: str = "py_trees"
    description: str = "Python module for py_trees 2.2 or later, with a simulated world to run it in"
    suffix: str = ".py"
    options: tuple[Option, ...] = (RUNTIME,)

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> str:
        """The source text. Raises :class:`BbtcError` (BBT0705) for a tree that is too deep."""
        del figures  # a file that runs has no place for them
        return _Writer(tree, embedded=options[RUNTIME.name] == "embedded").module()


py_trees = PyTreesExporter()


class _Writer:
    """Writes one module. The tree comes first: it tells which helpers and imports are needed."""

    def __init__(self, tree: Tree, *, embedded: bool) -> None:
        self.embedded = embedded
        self.task: Task = tree.task
        self.monitor = tree.monitor
        self.claim = brief(tree.success_probability)
        self.root = fit(tree.root, "py_trees")
        self.names = py_trees_names(tree)
        self.conditions = ConditionCode(tree.task.variables)
        self.world = WorldWriter(tree, self.names.interface, self.names.methods, self.conditions)
        self.held = held_by(replace(tree, root=self.root))
        self.branches: list[list[str]] = []
        retries = [node for node, _ in retries_of(self.root)]
        self.tried = {action.id for node in retries for action in actions_of(node)}

    def module(self) -> str:
        """The source text."""
        root_kind = "StopWhenBlocked" if self.monitor is None else "StopOutside"
        body = layout(call(root_kind, "robot", self._code(self.root, 1), "READS"), "return ", level=1)
        view = ["    robot = view(robot)"] if self.held else []
        root = ["def create_root(robot: Robot) -> Behaviour:", *_CREATE_ROOT.splitlines(), *view, *body]
        trees, main = [*self.branches, root], self._main().splitlines()
        tables = [self._reads(), *self._own(), *self.world.tables()]
        # Without the methods of the robots, whose parameters may be named like anything.
        used = {"Fact", "Protocol", "Status", "run"}
        used |= {self.world.base} if self.monitor is None else {"HiddenWorld", "Monitor", "Part"}
        used |= used_in(line for block in [*trees, *tables, main] for line in block)
        if self.embedded:
            used = needed(used)
            nodes = [*copied("nodes", used), *copied("limits", used)]
            world, head = copied("world", used), imports(used)
            world += [*copied("monitor", used), *copied("moving", used), *copied("numbers", used)]
        else:
            nodes, world, head = [], [], imports(used, ("bbtc.runtime", defined(used)))
            head += ["", _PUBLIC if self.monitor is None else _PUBLIC_HIDDEN]
        lines = [*self._docstring(), "", *head]
        for block in [self._protocol(), *nodes, *trees, *world, *tables, self.world.world(), main]:
            lines += ["", "", *block]
        return "\n".join(lines) + "\n"

    def _main(self) -> str:
        if self.monitor is None:
            return _MAIN_MOVING if self.task.events else _MAIN
        walks = ", walks=WALKS" if self.monitor.walks else ""
        return _MAIN_HIDDEN.replace("parts=MONITOR", f"parts=MONITOR{walks}")

    def _docstring(self) -> list[str]:
        problem, domain = harmless(self.task.problem), harmless(self.task.domain)
        return [
            f'"""Behavior tree for the problem {problem} of the domain {domain}. Made by bbtc.',
            "",
            f"In the model of that domain it succeeds with probability {self.claim}.",
            *([_UNBOUNDED] if tries_without_end(self.root) else []),
            *_USAGE.splitlines(),
            _REQUIRED[self.embedded],
            '"""',
        ]

    # --- interface ---------------------------------------------------------------------------

    def _protocol(self) -> list[str]:
        methods = self.names.methods
        lines = (_PROTOCOL if self.monitor is None else _PROTOCOL_HIDDEN).splitlines()
        for leaf in self.names.interface.asked:
            lines += method(methods[leaf.symbol], leaf, condition_type(leaf), condition_summary(leaf))
        for leaf in self.names.interface.actions:
            lines += method(methods[leaf.symbol], leaf, "Status", action_summary(leaf))
        return lines

    def _reads(self) -> list[str]:
        interface = self.names.interface
        reads = dict.fromkeys(
            (fact_tuple(variable), str(interface.leaves[variable_symbol(variable)].three_valued))
            for variable in map(self.task.variables.__getitem__, interface.reads)
        )
        table = mapping(reads)
        return [
            *layout(table, "READS: dict[Fact, bool] = "),
            '"""The facts that the tree reads, and whether they can be unknown."""',
        ]

    def _own(self) -> list[list[str]]:
        """The table of what actions hold."""
        if not self.held:
            return []
        table = mapping(
            (literal(action), sequence(dict.fromkeys(map(self._asked, facts))))
            for action, facts in sorted(self.held.items())
        )
        return [
            [
                *layout(table, "OWN: dict[str, list[Fact]] = "),
                '"""What the tree reads and an action may itself set: held while it runs."""',
            ]
        ]

    # --- tree --------------------------------------------------------------------------------

    def _code(self, node: Node, level: int) -> Code:
        match node:
            case ControlNode():
                if level > _DEEPEST_EXPRESSION:
                    return self._branch(node)
                children = [self._code(child, level + 1) for child in node.children]
                bound = [] if node.attempts is None else [str(node.attempts)]
                return call(_FUNCTIONS[node.kind], literal(_label(node)), *bound, *children)
            case ConditionNode():
                condition = normal(self.task, node.condition)
                label = node.name or words_of(self.task, condition).short
                return call("Condition", literal(printable(label)), self._test(condition))
            case ActionNode():
                return self._action(node)
            case _:
                assert_never(node)

    def _branch(self, node: ControlNode) -> Code:
        body = layout(self._code(node, 1), "return ", level=1)
        name = f"branch_{len(self.branches) + 1}"
        title = [f'    """For {harmless(node.reason)}."""'] if node.reason else []
        self.branches.append([f"def {name}(robot: Robot) -> Behaviour:", *title, *body])
        return call(name, "robot")

    def _action(self, node: ActionNode) -> Code:
        action = self.task.action_by_name[node.action]
        method = f"robot.{self.names.methods[action_symbol(action)]}"
        name = literal(printable(node.name or node.action))
        act = _thunk(call(method, *map(literal, action.args)))
        items: list[Code] = [name, act, "robot.cancel"]
        if self.monitor is not None and node.action in self.monitor.readings:
            told = words_tuple((action.schema, *action.args))
            items = [name, Prefixed("*", call("watched", "robot", told, act))]
        elif action.timeout is not None:
            seconds = repr(float(action.timeout))
            items = [Prefixed("*", call("within", seconds, name, act, "robot.cancel"))]
        guard = guard_of(self.task, node)
        if guard is not None:
            items.append(Prefixed("guard=", self._test(guard)))
        if not node.latched:
            items.append("keep=False")
        during = during_of(self.task, node)
        if during is not None:
            test = self.conditions.write(during, lambda variable: self._read(variable, "live(robot)"))
            items.append(Prefixed("during=lambda: ", test))
        if node.action in self.held:
            items.append(f"own=OWN[{literal(node.action)}]")
        return call("Try" if node.id in self.tried else "Latch", *items)

    def _asked(self, fact: Fact) -> str:
        """What the tree calls to read a fact: a method, and its arguments."""
        variable = first_variable(fact)
        read = self.task.variables[variable]
        if self.monitor is not None and variable in self.monitor.known:
            return words_tuple(("monitor.value", read.predicate, *read.args))
        return words_tuple((self.names.methods[variable_symbol(read)], *read.args))

    def _test(self, condition: Condition) -> Code:
        return _thunk(self.conditions.write(condition, self._read))

    def _read(self, variable: int, robot: str = "robot") -> Code:
        read = self.task.variables[variable]
        if self.monitor is not None and variable in self.monitor.known:
            return call(f"{robot}.monitor.value", *map(literal, (read.predicate, *read.args)))
        return call(f"{robot}.{self.names.methods[variable_symbol(read)]}", *map(literal, read.args))


_FUNCTIONS: dict[ControlKind, str] = {
    "sequence": "sequence",
    "fallback": "fallback",
    "skipper": "skipper",
    "retry": "retry",
    "retry-until-success": "until_success",
}
"""The function of :mod:`bbtc.runtime` that makes a node of each kind."""


def _thunk(code: Code) -> Code:
    """A function without arguments that returns the value of the code."""
    if isinstance(code, Group) and not code.items:
        return code.head.removesuffix("(")
    return Prefixed("lambda: ", code)


def _label(node: ControlNode) -> str:
    reason = f"{node.kind} for {node.reason}" if node.reason else node.kind
    return printable(node.name or node.template or reason)


_CREATE_ROOT = '''\
    """The tree. Latches stay latched, so it runs once: make a new one for another run."""'''

_USAGE = """\
Implement the class Robot, and run

    run(create_root(MyRobot()), period=0.1)

As a program, this module runs the tree in a simulated world (--help tells how).
"""

_UNBOUNDED = "Nothing bounds how often it tries: with a robot that always fails, it never ends."

_REQUIRED = {
    True: "It needs py_trees 2.2 or later.",
    False: "It needs py_trees 2.2 or later, and bbtc.",
}

_PUBLIC = '__all__ = ["Robot", "SimulatedWorld", "create_root", "run"]'

_PUBLIC_HIDDEN = '__all__ = ["MONITOR", "Monitor", "Robot", "SimulatedWorld", "create_root", "run"]'

_PROTOCOL = '''\
class Robot(Protocol):
    """What the tree needs of a robot.

    A condition answers at once: True, False, or None where it is unknown. An action is called in
    every tick while it runs and answers at once with its status: RUNNING, and SUCCESS when the
    conditions show what it did.
    """

    def cancel(self, action: str) -> None:
        """The running action, named as in the tree, is no longer wanted."""
'''

_PROTOCOL_HIDDEN = '''\
class Robot(Protocol):
    """What the tree needs of a robot.

    A condition answers at once: True, False, or None where it is unknown. An action is called in
    every tick while it runs and answers at once with its status: RUNNING, and SUCCESS when the
    conditions show what it did. What is hidden the tree asks the monitor, Monitor(MONITOR, ...):
    tell that, by monitor.told, what every action of MONITOR told, in the moment in which its
    effects are seen.
    """

    monitor: Monitor

    def cancel(self, action: str) -> None:
        """The running action, named as in the tree, is no longer wanted."""
'''

_MAIN = '''\
def main() -> None:
    """Run the tree in the simulated world."""
    simulate(lambda rng, report: create_root(SimulatedWorld(INITIAL, ACTIONS, rng, report)))


if __name__ == "__main__":
    main()
'''

_MAIN_MOVING = '''\
def main() -> None:
    """Run the tree in the simulated world."""

    def make(rng: random.Random, report: Callable[[str], None]) -> Behaviour:
        world = SimulatedWorld(
            INITIAL, ACTIONS, rng, report, events=EVENTS, interrupted=INTERRUPTED
        )
        return create_root(world)

    simulate(make)


if __name__ == "__main__":
    main()
'''

_MAIN_HIDDEN = '''\
def main() -> None:
    """Run the tree in the simulated world."""

    def make(rng: random.Random, report: Callable[[str], None]) -> Behaviour:
        world = SimulatedWorld(
            INITIAL, ACTIONS, rng, report, priors=PRIORS, tellings=TELLINGS, parts=MONITOR
        )
        return create_root(world)

    simulate(make)


if __name__ == "__main__":
    main()
'''
