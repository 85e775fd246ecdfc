"""Exporter ``py_trees_robot``: a robot to start from, for the module that ``py_trees`` writes.

It runs as it stands: conditions are read from beliefs on the blackboard, which begin as the problem
says, and every action says that it is to be written, and fails.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from bbtc.backends.exporter import Begun, Figures, Option, OptionValue
from bbtc.backends.interface import Interface, variable_symbol
from bbtc.backends.names import PYTHON_RESERVED, module_name
from bbtc.backends.pytrees.exporter import PyTreesNames, py_trees_names
from bbtc.backends.pytrees.parts import (
    CONDITION_TYPE,
    action_summary,
    condition_summary,
    fact_of,
    harmless,
    method,
)
from bbtc.backends.pytrees.pycode import call, layout, literal
from bbtc.backends.pytrees.runtime import RUNTIME, copied, import_from, imports, needed
from bbtc.diagnostics import BbtcError
from bbtc.ground.task import Task
from bbtc.kleene import Truth
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
        lines = _lines(task, py_trees_names(tree), module, given or [task.domain, task.problem], embedded)
        return Begun("\n".join(lines) + "\n")


py_trees_robot = PyTreesRobotExporter()


def _lines(
    task: Task, names: PyTreesNames, module: str, namespace: list[str], embedded: bool
) -> Iterator[str]:
    file = module.rpartition(".")[2]
    problem = harmless(task.problem)
    yield f'"""The robot of {file}.py for the problem {problem}. Begun by bbtc, to be filled in.'
    yield from [*_USAGE.format(file=file).splitlines(), ""]
    used = {"Any", "Status", "Beliefs"}
    if embedded:
        used = needed(used)
        yield from imports(used)
    else:
        yield from imports(used, ("bbtc.runtime", ["Beliefs"]))
    yield ""
    yield from import_from(module, ["Robot", "create_root", "run"])
    for block in copied("beliefs", used) if embedded else []:
        yield from ("", "", *block)
    yield from ("", "", *_class(task, names, namespace))
    yield from ("", "", *_MAIN.splitlines())


def _class(task: Task, names: PyTreesNames, namespace: list[str]) -> Iterator[str]:
    yield from _HEAD.splitlines()
    yield from layout(call("Beliefs", *map(literal, namespace)), "self._beliefs = ", level=2)
    known = list(_believed_at_start(task, names.interface))
    if known:
        yield "        # What the problem says of the start:"
    for value, fact in known:
        yield from layout(call("self._beliefs.believe", value, *map(literal, fact)), level=2)
    yield from _SETUP.splitlines()
    for leaf in names.interface.conditions:
        reading = layout(call("self._beliefs.value", *fact_of(leaf)), "return ")
        name = names.methods[leaf.symbol]
        yield from method(name, leaf, CONDITION_TYPE, condition_summary(leaf), *reading)
    for leaf in names.interface.actions:
        failing = layout(call("self._to_do", *fact_of(leaf)), "return ")
        yield from method(names.methods[leaf.symbol], leaf, "Status", action_summary(leaf), *failing)
    yield from _TO_DO.splitlines()


def _believed_at_start(task: Task, interface: Interface) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Facts that the tree may read, and what the problem says of them: the same in every initial state."""
    words = {Truth.TRUE: "True", Truth.FALSE: "False", Truth.UNKNOWN: "None"}
    for index, variable in enumerate(task.variables):
        values = {state.values[index] for state in task.initial}
        if variable_symbol(variable) in interface.leaves and len(values) == 1:
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
