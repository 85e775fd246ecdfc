"""The sample project by CMake, with the commands of its README; its other ones are run with all snippets."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from tests.integration.tools import REPOSITORY, program, run, tool

SAMPLE = REPOSITORY / "docs" / "sample"


def test_the_sample_is_built_and_installed_by_cmake(tmp_path: Path) -> None:
    tool("cmake"), tool("make")
    folder = tmp_path / "courier"
    shutil.copytree(SAMPLE, folder)
    path = program(tmp_path).parent
    (cmake,) = re.findall(r"^```sh\n(.*?)^```$", (SAMPLE / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    for command in cmake.splitlines():
        run("sh", "-c", command, cwd=folder, path=path)
    installed = {file.name for file in (folder / "install/share/courier_trees").rglob("*") if file.is_file()}
    assert {"package.xml", "to-the-lab.xml", "to-the-lab_nodes.xml", "two-letters.tree.json"} <= installed
