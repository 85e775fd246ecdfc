"""The tool that tries mutants: on a project of two modules, of which is known what its tests notice."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mutation.__main__ import EQUIVALENT, PACKAGES, REPOSITORY, explained, report
from tests.mutation.mutants import Mutant, is_change, mutants_of
from tests.mutation.reach import IMPORTED, Reach
from tests.mutation.trial import Project, Tried, drawn, selection, try_all

_SUMS = '''"""Sums."""

from __future__ import annotations

_EFFORT = 3 * 7
LIMIT = 10


def total(values: list[int], most: int = LIMIT) -> int:
    """Their sum, at most the limit."""
    assert most > 0
    found = 0
    for value in values:
        found += value
    if found > most:
        return most
    return found
'''
_TESTS = """from toy.sums import total

def test_small(): assert total([1, 2]) == 3
def test_large(): assert total([7, 8]) == 10
"""


@pytest.fixture
def toy(tmp_path: Path) -> Project:
    """The project."""
    files = {
        "toy/sums.py": _SUMS,
        "tests/test_sums.py": _TESTS,
        "tests/test_other.py": "def test(): pass\n",
        "pytest.ini": "[pytest]\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return Project(tmp_path, {"toy": ("tests",)}, tuple(files))


def _changes(toy: Project) -> dict[tuple[str, str], Mutant]:
    return {(each.original, each.mutant): each for each in mutants_of(toy.root, "toy/sums.py")}


KILLED = ("found += value", "found -= value")
EQUAL = ("if found > most:", "if (found >= most):")
"""The limit is what is returned either way."""
NEVER = ("if found > most:", "if False:")


def test_the_mutants_of_a_module_are_told_by_their_statements(toy: Project) -> None:
    changes = _changes(toy)
    assert set(changes) == {
        ("LIMIT = 10", "LIMIT = 11"),
        ("found = 0", "found = 1"),
        KILLED,
        EQUAL,
        NEVER,
        ("if found > most:", "if True:"),
    }, "neither the assertion nor the bound of effort, nor annotations or texts"
    assert {each.function for each in changes.values()} == {"-", "total"}
    source = (toy.root / "toy/sums.py").read_text()
    assert all(is_change(source, each) for each in changes.values())
    shifted = "# a comment\n\n" + source
    (toy.root / "toy/sums.py").write_text(shifted)
    assert [each.key for each in _changes(toy).values()] == [each.key for each in changes.values()]


def test_a_mutant_dies_survives_or_runs_out_of_time_as_its_tests_say(toy: Project) -> None:
    changes = _changes(toy)
    before = {path: path.read_bytes() for path in toy.root.rglob("*") if path.is_file()}
    told: list[Tried] = []
    found = try_all(toy, [changes[KILLED], changes[EQUAL], changes[NEVER]], 2, 100, told.append)
    assert [each.fate for each in found] == ["killed", "survived", "killed"]
    assert found[0].by.startswith("tests/test_sums.py::test_")
    assert found[2].by.startswith("tests/test_sums.py::test_large")
    assert sorted(told, key=found.index) == found
    assert {path: path.read_bytes() for path in toy.root.rglob("*") if path.is_file()} == before


def test_what_never_ends_is_ended_and_counts_as_noticed(toy: Project) -> None:
    loop = "    while n > 0:\n        n -= 1\n        time.sleep(0.01)\n"  # endless, but not busy
    source = f"import time\ndef steps(n):\n{loop}    return n\n"
    (toy.root / "toy/sums.py").write_text(source)
    (toy.root / "tests/test_sums.py").write_text(
        "from toy.sums import steps\n\ndef test(): assert steps(2) == 0\n"
    )
    endless = next(each for each in mutants_of(toy.root, "toy/sums.py") if each.mutant == "n += 1")
    (found,) = try_all(toy, [endless], 1, 3, lambda _: None)
    assert found.fate == "timeout"


def test_nothing_is_tried_if_the_tests_fail_anyway(toy: Project) -> None:
    (toy.root / "tests/test_other.py").write_text("def test(): assert False\n")
    with pytest.raises(RuntimeError, match=r"without a mutant: tests/test_other\.py::test"):
        try_all(toy, [_changes(toy)[KILLED]], 1, 100, lambda _: None)


def test_a_sample_is_drawn_by_its_seed(toy: Project) -> None:
    every = drawn(toy, 100, 0)
    assert sorted(each.key for each in every) == sorted(each.key for each in _changes(toy).values())
    assert drawn(toy, 3, 5) == drawn(toy, 3, 5)
    assert len({tuple(each.key for each in drawn(toy, 3, seed)) for seed in range(10)}) > 1
    (toy.root / "toy/sums.py").write_text(_SUMS.replace("    return found\n", "    return found + 0\n"))
    new = drawn(toy, 100, 0)
    assert [each.key for each in new if "+ 0" not in each.original] == [each.key for each in every]


def test_the_tests_that_run_a_line_are_tried_quick_ones_first(toy: Project) -> None:
    changes = _changes(toy)
    file = "toy/sums.py"
    reach = Reach(
        {file: {6: frozenset({IMPORTED}), 12: frozenset({"slow"}), 14: frozenset({"slow", "quick"})}},
        {"slow": 2.0, "quick": 0.1},
    )
    assert selection(toy, reach, changes[KILLED]) == ["quick", "slow"]
    assert selection(toy, reach, changes[KILLED], most=1) == ["quick"]
    assert selection(toy, reach, changes[NEVER]) == ["quick", "slow"], "else those of the function"
    assert selection(toy, reach, changes["LIMIT = 10", "LIMIT = 11"]) == ["quick", "slow"]


def test_what_no_test_runs_survives(toy: Project) -> None:
    source = _SUMS + "\n\ndef never(n: int) -> int:\n    return n + 1\n"
    (toy.root / "toy/sums.py").write_text(source)
    (never,) = [each for each in mutants_of(toy.root, "toy/sums.py") if each.mutant == "return (n - 1)"]
    (found,) = try_all(toy, [never], 1, 100, lambda _: None)
    assert (found.fate, found.seconds) == ("survived", 0)


def test_survivors_have_to_be_explained_and_few(toy: Project) -> None:
    changes = _changes(toy)
    dead = [Tried(changes[KILLED], "killed", "", 0.0)] * 9
    alive = Tried(changes[EQUAL], "survived", "", 0.0)
    lines, good = report([*dead, alive], {})
    assert (good, lines[0]) == (False, "9 of 10 mutants killed (90.0%)")
    assert lines[-1].startswith("toy/sums.py\ttotal\tif found > most:\tif (found >= most):")
    lines, good = report([*dead, alive], {changes[EQUAL].key: "returns the same"})
    assert good
    assert "  returns the same" in lines
    assert not report([*dead, alive, alive], {changes[EQUAL].key: "returns the same"})[1], "below 90 %"


def test_what_is_explained_is_still_there() -> None:
    """A row about code that has changed since is no explanation of anything."""
    for file, function, original, mutant in explained(EQUIVALENT):
        keys = {each.key for each in mutants_of(REPOSITORY, file)}
        assert (file, function, original, mutant) in keys
    assert all(explained(EQUIVALENT).values())


def test_the_tests_of_every_package_are_there() -> None:
    for places in PACKAGES.values():
        assert [place for place in places if not (REPOSITORY / place).exists()] == []
