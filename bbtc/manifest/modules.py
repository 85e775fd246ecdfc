"""Python modules among the exports of a tree: a robot imports the module of its tree, by a name that Python
can import and under which that module is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePosixPath

from bbtc.backends.names import module_name
from bbtc.backends.pytrees.exporter import py_trees
from bbtc.backends.pytrees.robot import MODULE, is_module, py_trees_robot
from bbtc.manifest.entries import Export

TREE, ROBOT = py_trees.name, py_trees_robot.name


def default_file(form: str, tree: str, forms: Sequence[str]) -> str | None:
    """The file, in the output folder, of an export of a tree that has those of ``forms``, too; None where it
    is called as it would be in any format."""
    path = PurePosixPath(tree)
    if form == ROBOT:
        return str(path.with_name(f"{module_name(path.name)}_robot.py"))
    if form == TREE and ROBOT in forms:
        return str(path.with_name(f"{module_name(path.name)}.py"))
    return None


def with_module(robot: Export, exports: Sequence[Export]) -> Export:
    """The export of a robot with the module to import, if one of ``exports`` writes it: the one in the folder
    of the robot, or below it, or else the first. Raises ``ValueError`` where Python cannot import that."""
    files = [PurePosixPath(export.file) for export in exports if export.form == TREE]
    if not files or MODULE.name in dict(robot.options):
        return robot
    folder = PurePosixPath(robot.file).parent
    below = [file.relative_to(folder) for file in files if file.is_relative_to(folder)]
    # From elsewhere it is imported by its name alone: its folder must be on Python's path.
    file = min(below, key=lambda each: len(each.parts), default=PurePosixPath(files[0].name))
    names = file.with_suffix("").parts
    if file.suffix != ".py" or not all(is_module(name) and "." not in name for name in names):
        raise ValueError(f"{file} is no module that Python can import, and {robot.file} imports it")
    return replace(robot, options=tuple(sorted((*robot.options, (MODULE.name, ".".join(names))))))
