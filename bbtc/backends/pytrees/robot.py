"""Exporter ``py_trees_robot``: a robot to start from, for the module that ``py_trees`` writes.

It runs as it stands: conditions are read from beliefs on the blackboard, which begin as the problem
says, and every action says that it is to be written, and fails.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from bbtc.backends.exporter import Begun, Figures, Option, OptionValue
from bbtc.backends.interface import Interface, Leaf, action_symbol, variable_symbol
from bbtc.backends.names import PYTHON_RESERVED, module_name
from bbtc.backends.pytrees.exporter import PyTreesNames, py_trees_names
from bbtc.backends.pytrees.parts import (
    action_summary,
    condition_summary,
    condition_type,
    fact_of,
    harmless,
    method,
)
from bbtc.backends.pytrees.pycode import call, layout, literal
from bbtc.backends.pytrees.runtime import RUNTIME, copied, import_from, imports, needed
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import number_in
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.tree.monitor import FIRST, Monitor
from bbtc.tree.nodes import Tree

MODULE = Option("module", "", "the module that --to py_trees wrote; by default named after the problem")
NAMESPACE = Option("namespace", "", "of the blackboard's keys; by default /DOMAIN/PROBLEM")

_MODULE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)


def is_module(name: str) -> bool:
    """Can this be the name of a module that Python imports?"""
    return _MODULE.fullmatch(name) is not None and not PYTHON_RESERVED & set(name.split("."))


@dataclass(frozen=True, slots=True)
class PyTreesRobotExporter:
    """Writes a robot that has everything but the robot."""

    name: str = "py_trees_robot"
    description: str = "Python file to start from: the robot for the module of py_trees, to be filled in"
    suffix: str = ".py"
    options: tuple[Option, ...] = (MODULE, NAMESPACE, RUNTIME)

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> Begun:
        """The source text. Raises :class:`BbtcError` (BBT0704) for a module or a namespace that
        cannot be one."""
        del figures
        task = tree.task
        module = str(options[MODULE.name]) or module_name(task.problem)
        if not is_module(module):
            raise BbtcError.single(
                "BBT0704",
                f"option 'module' of format '{self.name}' must be a name of a Python module, not '{module}'",
            )
        given = [word for word in str(options[NAMESPACE.name]).split("/") if word]
        embedded = options[RUNTIME.name] == "embedded"
        lines = _lines(tree, py_trees_names(tree), module, given or [task.domain, task.problem], embedded)
        return Begun("\n".join(lines) + "\n")


py_trees_robot = PyTreesRobotExporter()


def _lines(
    tree: Tree, names: PyTreesNames, module: str, namespace: list[str], embedded: bool
) -> Iterator[str]:
    task = tree.task
    file = module.rpartition(".")[2]
    problem = harmless(task.problem)
    yield f'"""The robot of {file}.py for the problem {problem}. Begun by bbtc, to be filled in.'
    yield from [*_USAGE.format(file=file).splitlines(), ""]
    beliefs = "NumberBeliefs" if any(leaf.counts for leaf in names.interface.asked) else "Beliefs"
    used = {"Any", "Status", beliefs}
    if embedded:
        used = needed(used)
        yield from imports(used)
    else:
        yield from imports(used, ("bbtc.runtime", [beliefs]))
    yield ""
    watching = [] if tree.monitor is None else ["MONITOR", "Monitor"]
    yield from import_from(module, [*watching, "Robot", "create_root", "run"])
    for block in [*copied("beliefs", used), *copied("numbers", used)] if embedded else []:
        yield from ("", "", *block)
    yield from ("", "", *_class(tree, names, namespace))
    yield from ("", "", *_MAIN.splitlines())


def _class(tree: Tree, names: PyTreesNames, namespace: list[str]) -> Iterator[str]:
    yield from _HEAD.splitlines()
    counts = any(leaf.counts for leaf in names.interface.asked)
    yield from layout(
        call("NumberBeliefs" if counts else "Beliefs", *map(literal, namespace)), "self._beliefs = ", level=2
    )
    known = list(_believed_at_start(tree, names.interface))
    if known:
        yield "        # What the problem says of the start:"
    for value, fact in known:
        verb = "believe" if value in {"True", "False", "None"} else "count"
        yield from layout(call(f"self._beliefs.{verb}", value, *map(literal, fact)), level=2)
    if tree.monitor is not None:
        yield "        self.monitor = Monitor(MONITOR, self._beliefs.value)"
        if FIRST in tree.monitor.readings:
            yield "        # Once it is known what the robot is told before its first action:"
            yield from _telling("        ", (), tree.monitor.readings[FIRST])
    yield from _SETUP.splitlines()
    for leaf in names.interface.asked:
        verb = "number" if leaf.counts else "value"
        reading = layout(call(f"self._beliefs.{verb}", *fact_of(leaf)), "return ")
        name = names.methods[leaf.symbol]
        yield from method(name, leaf, condition_type(leaf), condition_summary(leaf), *reading)
    for leaf in names.interface.actions:
        failing = layout(call("self._to_do", *fact_of(leaf)), "return ")
        told = [] if tree.monitor is None else list(_tellings(tree.task, tree.monitor, leaf))
        yield from method(names.methods[leaf.symbol], leaf, "Status", action_summary(leaf), *told, *failing)
    yield from _TO_DO.splitlines()


_MOST_TOLD = 8
"""Actions of a schema whose readings are listed."""


def _tellings(task: Task, monitor: Monitor, leaf: Leaf) -> Iterator[str]:
    """What the actions of a schema tell, as comments in its method."""
    actions = [
        action
        for action in map(task.action_by_name.__getitem__, sorted(monitor.readings.keys() - {FIRST}))
        if action_symbol(action) == leaf.symbol
    ]
    if actions:
        yield "# In the moment in which its effects are seen, though it fails or is cancelled:"
    for action in actions[:_MOST_TOLD]:
        yield from _telling("", (action.schema, *action.args), monitor.readings[action.name])
    if len(actions) > _MOST_TOLD:
        yield f"# and so on: {len(actions)} in all, see MONITOR"


def _telling(indent: str, action: tuple[str, ...], readings: tuple[str, ...]) -> Iterator[str]:
    listed = ", ".join(f"{literal(reading)}: True" for reading in readings)
    items = [*map(literal, action), *([f"readings={{{listed}}}"] if readings else [])]
    yield f"{indent}# self.monitor.told({', '.join(items)})"


def _believed_at_start(tree: Tree, interface: Interface) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Facts that the tree may ask for, and what the problem says of them: the same in every initial state."""
    task = tree.task
    elsewhere = frozenset[int]() if tree.monitor is None else tree.monitor.known
    words = {Truth.TRUE: "True", Truth.FALSE: "False", Truth.UNKNOWN: "None"}
    for number in task.numbers:
        given = {number_in(number.digits, state.values) for state in task.initial}
        if variable_symbol(task.variables[number.digits[0]]) in interface.leaves and len(given) == 1:
            yield str(number.low + given.pop()), (number.function, *number.args)
    for index, variable in enumerate(task.variables):
        if variable.digit is not None:
            continue
        values = {state.values[index] for state in task.initial}
        asked = variable_symbol(variable) in interface.leaves and index not in elsewhere
        if asked and len(values) == 1:
            yield words[values.pop()], (variable.predicate, *variable.args)


_USAGE = '''
As a program, this file runs the tree. In ROS, give create_root(MyRobot()) to
py_trees_ros.trees.BehaviourTree.
"""
'''

_HEAD = '''\
class MyRobot:
    """Senses and acts. Change everything but the names of its methods."""

    def __init__(self) -> None:
'''

_SETUP = '''
    def setup(self, **kwargs: Any) -> None:
        """Called once, before the first tick. In ROS, kwargs["node"] is the node."""

    def heard_of(self, *fact: str, unknown: bool) -> bool:
        """Whether anything is believed of a fact. The tree waits for that before its first tick."""
        return self._beliefs.heard_of(*fact, unknown=unknown)

    def cancel(self, action: str) -> None:
        """The running action, named as in the tree, is no longer wanted."""
        print("stop", action)
'''

_TO_DO = """
    def _to_do(self, *action: str) -> Status:
        # In the place of this, an action starts when it is called first, returns RUNNING until it
        # ends, then SUCCESS once its effects are believed, or FAILURE.
        print("to do:", *action)
        return Status.FAILURE
"""

_MAIN = '''\
def main() -> None:
    """Run the tree with this robot."""
    robot: Robot = MyRobot()
    root = create_root(robot)
    print(f"The tree returned {run(root, period=0.1).value}.")
    if root.feedback_message:
        print(root.feedback_message)


if __name__ == "__main__":
    main()
'''
