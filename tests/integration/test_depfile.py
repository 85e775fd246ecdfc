"""A depfile says to Make and to Ninja what it means, whatever letters names have, or is not written.

The tools themselves tell: an output is made again after its input has changed, and only then, and nothing is
run that a name spells out. The long form (``BBTC_LONG=1``) tries many more random names.
"""

from __future__ import annotations

import os
import random
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from bbtc.diagnostics import BbtcError
from bbtc.files.depfile import depfile
from tests.builder.projects import COIN, bbtc
from tests.integration.tools import tool
from tests.long_form import amount

NAMES = amount(25, 3000)
OTHERS = ("first.pddl", "last.pddl")

WRITTEN = [
    "plain.pddl", "a b.pddl", "a#b", "a$b", "a$(id)b", "${x}", "a:b.pddl", "a=b.pddl", "a\\b", "a!b", "a%b",
    "%", "a,b", "(a)b", "a@b", "a~b", "ä ö#ü", "b]", "{a,b}", "a  b", "a\u00a0b", "\u2028", "x+", "-n",
    "--file=x",
]  # fmt: skip
REFUSED = [
    "x;id>pwned;.pddl", "x\nall:;id>pwned;#.pddl", "a\tb", "a|b", "a&b", "a'b", 'a"b', "a*b", "a?b",
    "a[1]", "a<b", "a>b", "a^b", "a`id`b", "a\rb", "a\x0bb", "~root", "=a", "+=a", "a:", "a ", " a", "lib(a)",
    "a\\ b", "a\\#b", "a\\", "a\\:b", "\x7f",
]  # fmt: skip
TARGETS = ["out", "o t", "o#t", "o$t", "o:t", "o(t", "ö", "o!t"]
REFUSED_TARGETS = ["o%t", "o=t", "o;t", ".PHONY", ".SUFFIXES", "o*", "o|t", "export", "o&", "o:", "o(t)"]


def rule_of(target: str, name: str) -> bytes | None:
    """The rule with the name among others; None where it is refused."""
    try:
        return depfile(target, [OTHERS[0], name, OTHERS[1]])
    except BbtcError as error:
        return None if error.diagnostics[0].code == "BBT0010" else b""


def made_by_make(folder: Path, target: str, name: str, rule: bytes) -> list[bool]:
    """Is the target made while it is newer than all, and once the input is newer?"""
    (folder / "rule.mk").write_bytes(rule.rstrip(b"\n") + b"\n\t@echo REMAKE\n")
    (folder / "Makefile").write_text("all:;\ninclude rule.mk\n")
    found = []
    for now in (1000, 3000):
        for file in (*OTHERS, name):
            os.utime(folder / file, (1000, 1000))
        os.utime(folder / name, (now, now))
        os.utime(folder / target, (2000, 2000))
        done = subprocess.run(
            [tool("make"), "-r", "--", target], cwd=folder, capture_output=True, check=False, timeout=60
        )
        found.append(done.returncode == 0 and b"REMAKE" in done.stdout)
    return found


def made_by_ninja(folder: Path, target: str, name: str, rule: bytes) -> list[bool]:
    """Is it made at first, again at once, and once the input is newer?"""
    (folder / "out.src").write_bytes(rule)
    spelt = target.replace("$", "$$").replace(" ", "$ ").replace(":", "$:")
    command = f"cp out.src out.d && touch -- {shlex.quote(target)}".replace("$", "$$")
    text = f"rule r\n  command = {command}\n  depfile = out.d\nbuild {spelt}: r {OTHERS[0]}\n"
    (folder / "build.ninja").write_text(text)

    def made() -> bool:
        done = subprocess.run(
            [tool("ninja")], cwd=folder, capture_output=True, text=True, check=False, timeout=60
        )
        assert done.returncode == 0, done
        return "no work to do" not in done.stdout

    found = [made(), made()]
    later = (folder / target).stat().st_mtime + 10
    os.utime(folder / name, (later, later))
    return [*found, made()]


def assert_understood(folder: Path, target: str, name: str, rule: bytes) -> None:
    folder.mkdir()
    for file in (*OTHERS, name, target):
        (folder / file).touch()
    there = {path.name for path in folder.iterdir()}
    assert made_by_make(folder, target, name, rule) == [False, True], (target, name, rule)
    assert made_by_ninja(folder, target, name, rule) == [True, False, True], (target, name, rule)
    ours = {"Makefile", "rule.mk", "out.src", "out.d", "build.ninja", ".ninja_log", ".ninja_deps"}
    assert {path.name for path in folder.iterdir()} - ours == there
    shutil.rmtree(folder)


@pytest.mark.parametrize("name", WRITTEN)
def test_a_name_that_is_written_is_understood(tmp_path: Path, name: str) -> None:
    rule = rule_of("out", name)
    assert rule is not None
    assert_understood(tmp_path / "f", "out", name, rule)


@pytest.mark.parametrize("target", TARGETS)
def test_a_target_that_is_written_is_understood(tmp_path: Path, target: str) -> None:
    rule = rule_of(target, "a b")
    assert rule is not None
    assert_understood(tmp_path / "f", target, "a b", rule)


def test_random_names_are_understood_or_refused(tmp_path: Path) -> None:
    rng = random.Random(7)
    letters = "ab1 !#$%()+,-.:=@\\]_{}~é"
    understood = 0
    while understood < NAMES:
        name, target = ("".join(rng.choices(letters, k=rng.randint(1, 6))) for _ in range(2))
        target = rng.choice((target, "out"))
        taken = {".", "..", "-", *OTHERS, "out.d", "all"}
        rule = None if name == target or {name, target} & taken else rule_of(target, name)
        if rule is not None:
            assert_understood(tmp_path / "f", target, name, rule)
            understood += 1


@pytest.mark.parametrize("name", REFUSED)
def test_a_name_that_no_spelling_saves_is_refused(name: str) -> None:
    assert rule_of("out", name) is None
    assert rule_of(name, "a") is None


@pytest.mark.parametrize("target", REFUSED_TARGETS)
def test_a_target_that_means_something_else_is_refused(target: str) -> None:
    assert rule_of(target, "a") is None


def test_a_name_with_an_equals_sign_does_not_come_first() -> None:
    """There it would set a variable."""
    assert depfile("out", ["a=b", "c"]) == b"out: c a=b\n"
    for alone in (["a=b"], ["a=b", "c=d"], ["export", "a=b"]):
        with pytest.raises(BbtcError, match="BBT0010"):
            depfile("out", alone)


@pytest.mark.parametrize("name", ["x;id>pwned;.pddl", "x\nall:;id>pwned;#.pddl", "a|b.pddl"])
def test_the_command_refuses_the_name_before_it_writes_anything(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(COIN)
    done = bbtc(tmp_path, "plan", name, "-q", "--target", "0.5", "-o", "out.json", "--depfile", "out.d")
    assert done.returncode == 1
    assert "error[BBT0010]" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.skipif(os.name != "posix", reason="names are bytes on POSIX only")
def test_a_name_that_is_not_utf8_is_written_as_it_is(tmp_path: Path) -> None:
    name = os.fsdecode(b"a\xffb.pddl")
    try:
        (tmp_path / name).write_text(COIN)
    except OSError:
        pytest.skip("this file system takes UTF-8 only")
    done = bbtc(tmp_path, "plan", name, "-q", "--target", "0.5", "-o", "out.json", "--depfile", "out.d")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out.d").read_bytes() == b"out.json: a\xffb.pddl\n"
