"""Every place that is written to, in every state that it can be in.

What a user sees is said in the tables: the exit status, and a word of the message. Beside that, it holds
everywhere: a run that fails changes nothing at all, one that succeeds changes what it was asked for and
nothing else; nothing outside is touched unless the user named a link to it; no file is half written; nothing
is left aside; no traceback.
"""

from __future__ import annotations

import os
import stat
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from bbtc.files.folder import TEMPORARY
from tests.builder.projects import COIN
from tests.cli.forked import Commands, commands

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="permissions of root are dropped as in Linux")

OLD = "as it was\n"
FULL = 50  # bytes that a file may have on a disk that is full

LINK_OUT = "link to outside"
LINK_IN = "link to inside"
FOLDER = "folder"
FIFO = "named pipe"
READ_ONLY = "read-only"
IN_READ_ONLY = "in a read-only folder"
DISK_FULL = "full disk"
EXISTING = "existing file"
NEW = "nothing"
INPUT = "same as input"
SITUATIONS = (LINK_OUT, LINK_IN, FOLDER, FIFO, READ_ONLY, IN_READ_ONLY, DISK_FULL, EXISTING, NEW, INPUT)


@dataclass(frozen=True)
class Writer:
    """A command, and the place it writes to; ``expected`` tells status and message by situation. ``also`` are
    places beside it that it writes when it succeeds. ``replaced``: what stood there is not kept."""

    command: str
    place: str
    expected: dict[str, tuple[int, str]]
    also: tuple[str, ...] = ()
    replaced: bool = True


# A single file that the user names with -o: a link is followed, a pipe is written to.
NAMED = {
    LINK_OUT: (0, ""),
    LINK_IN: (0, ""),
    FOLDER: (1, "BBT0004]: cannot write {place}: it is a directory"),
    FIFO: (0, ""),
    READ_ONLY: (1, "BBT0004]: cannot write {place}: permission denied"),
    IN_READ_ONLY: (1, "BBT0004]: cannot write {place}: permission denied"),
    DISK_FULL: (1, "BBT0004]: cannot write {place}: File too large"),
    EXISTING: (0, ""),
    NEW: (0, ""),
    INPUT: (2, "BBT0009]: cannot write {place}: it is the input"),
}
# Below a folder that the user names, or in a project: no link is followed, nothing but files is written.
BELOW = NAMED | {
    LINK_OUT: (1, "a symbolic link is in the way"),
    LINK_IN: (1, "a symbolic link is in the way"),
    FIFO: (1, "it is a named pipe"),
}
IN_PROJECT = BELOW | {IN_READ_ONLY: (1, "permission denied"), INPUT: (1, "BBT1009]")}
# Held open for the build, or written after it; where it cannot be kept, the next build does everything anew.
OWN = IN_PROJECT | {EXISTING: (0, ""), INPUT: (0, "")}
FMT = NAMED | {
    FOLDER: (1, "BBT0001]: cannot read {place}: it is a directory"),
    FIFO: (1, "BBT0001]: cannot read {place}: it is a named pipe"),
    NEW: (1, "BBT0001]: cannot read {place}: there is no such file"),
    INPUT: (0, ""),  # in place, as it is meant
}
INIT = dict.fromkeys(SITUATIONS, (1, "BBT1007]: {place} is there already")) | {
    IN_READ_ONLY: (1, "BBT0004]: cannot write"),
    DISK_FULL: (1, "BBT0004]: cannot write"),
    NEW: (0, ""),
}
PLAN = "plan coin.pddl -q --target 0.5"

SOME_FILE_FULL = {DISK_FULL: (1, "BBT0004]: cannot write")}  # another file of the same run is met first
WRITERS = {
    "plan": Writer(f"{PLAN} -o out/x", "out/x", NAMED),
    "plan --bounds": Writer("plan coin.pddl --target 0.5 --bounds -o out/x", "out/x", NAMED),
    "compile": Writer("compile coin.pddl -o out/x", "out/x", NAMED),
    "simulate": Writer("simulate tree.json -o out/x", "out/x", NAMED),
    "verify": Writer("verify tree.json --engine own -o out/x", "out/x", NAMED),
    "diff": Writer("diff tree.json tree.json -o out/x", "out/x", NAMED),
    "export": Writer("export tree.json --to dot -o out/x", "out/x", NAMED),
    "import": Writer("import tree.json -o out/x", "out/x", NAMED),
    "depfile": Writer(f"{PLAN} -o made --depfile out/x", "out/x", NAMED | SOME_FILE_FULL, also=("made",)),
    "fmt": Writer("fmt out/x", "out/x", FMT),
    "folder export": Writer(
        "export tree.json --to btcpp_project -o out",
        "out/README.md",
        BELOW | SOME_FILE_FULL | {IN_READ_ONLY: (1, "BBT0004]: cannot write out: permission denied")},
        also=("out",),
    ),
    "init": Writer("init out", "out/domain.pddl", INIT, also=("out",)),
    "tree of a build": Writer("build", "build/c.tree.json", IN_PROJECT, also=("build", ".bbtc")),
    "export of a build": Writer("build", "build/c.dot", IN_PROJECT | SOME_FILE_FULL, also=("build", ".bbtc")),
    "state of a build": Writer(
        "build",
        ".bbtc/state.json",
        OWN | SOME_FILE_FULL | {READ_ONLY: (0, "")},
        also=("build", ".bbtc"),
        replaced=False,
    ),
    "lock of a build": Writer(
        "build", ".bbtc/lock", OWN | SOME_FILE_FULL, also=("build", ".bbtc"), replaced=False
    ),
    "gitignore of a build": Writer(
        "build",
        ".bbtc/.gitignore",
        dict.fromkeys(SITUATIONS, (0, "")) | SOME_FILE_FULL | {IN_READ_ONLY: (1, "permission denied")},
        also=("build", ".bbtc"),
        replaced=False,
    ),
}


@pytest.fixture(scope="module")
def program() -> Commands:
    return commands()


@pytest.fixture(scope="module")
def inputs(program: Commands, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What the commands read."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "coin.pddl").write_text(COIN)
    assert program.run(folder, *f"{PLAN} -o tree.json".split()).status == 0
    return {name: (folder / name).read_text() for name in ("coin.pddl", "tree.json")}


def arrange(work: Path, writer: Writer, situation: str) -> list[str]:
    """Bring the place into a situation; the arguments of the command."""
    place = work / writer.place
    if not (writer.command == "init out" and situation == NEW):
        place.parent.mkdir(exist_ok=True)
    arguments = writer.command.split()
    target = {LINK_OUT: work.parent / "outside" / "target", LINK_IN: work / "target"}.get(situation)
    content = COIN if arguments[0] == "fmt" else OLD
    if target is not None:
        target.write_text(content)
        place.symlink_to(os.path.relpath(target, place.parent))
    elif situation == FOLDER:
        place.mkdir()
    elif situation == FIFO:
        os.mkfifo(place)
    elif situation == INPUT and writer.expected[INPUT][0] and arguments[0] == "build":
        manifest = work / "bbtc.yaml"
        manifest.write_text(manifest.read_text().replace("coin.pddl", writer.place))
        place.write_text(COIN)
    elif situation == INPUT and arguments[0] not in {"fmt", "init", "build"}:
        source = next(name for name in ("coin.pddl", "tree.json") if name in arguments)
        (work / source).rename(place)
        arguments = [writer.place if each == source else each for each in arguments]
    elif not _absent(arguments[0], situation):
        place.write_text(content)
    if situation == READ_ONLY:
        place.chmod(0o444)
    if situation == IN_READ_ONLY:
        place.parent.chmod(0o555)
    return arguments


def _absent(command: str, situation: str) -> bool:
    """Is there nothing in the place? (`fmt` needs a file; `init` would stop at one.)"""
    if situation == IN_READ_ONLY:
        return command != "fmt"
    return situation == NEW or (situation == DISK_FULL and command == "init")


def snapshot(top: Path) -> dict[str, object]:
    """Everything below a folder: what it is, and its content."""
    found: dict[str, object] = {}
    for path in sorted(top.rglob("*")):
        mode = path.lstat().st_mode
        if stat.S_ISLNK(mode):
            found[str(path.relative_to(top))] = ("link", str(path.readlink()))
        elif stat.S_ISREG(mode):
            found[str(path.relative_to(top))] = path.read_bytes()
        else:
            found[str(path.relative_to(top))] = stat.S_IFMT(mode)
    return found


def belongs(name: str, places: tuple[str, ...]) -> bool:
    """Is a path below the working folder one of the places, or below one?"""
    return any(name == f"work/{place}" or name.startswith(f"work/{place}/") for place in places)


@pytest.mark.parametrize("situation", SITUATIONS)
@pytest.mark.parametrize("name", WRITERS)
def test_a_writer_in_a_situation(
    program: Commands, inputs: dict[str, str], tmp_path: Path, name: str, situation: str
) -> None:
    writer = WRITERS[name]
    status, told = writer.expected[situation]
    work = tmp_path / "work"
    for folder in (work, tmp_path / "outside"):
        folder.mkdir()
    for file, text in inputs.items():
        (work / file).write_text(text)
    (work / "bbtc.yaml").write_text("trees: {c: {domain: coin.pddl, target: 0.5, exports: [dot]}}\n")
    arguments = arrange(work, writer, situation)
    place = work / writer.place
    before = snapshot(tmp_path)
    poured = situation == FIFO and status == 0 and writer.replaced
    reader = os.open(place, os.O_RDONLY | os.O_NONBLOCK) if poured else None
    most = FULL if situation == DISK_FULL else None
    done = program.run(work, *arguments, most_bytes=most, powerless=situation in {READ_ONLY, IN_READ_ONLY})
    if situation == IN_READ_ONLY:
        place.parent.chmod(0o755)
    after = snapshot(tmp_path)

    assert done.status == status, done
    assert "Traceback" not in done.err
    assert "This is a bug" not in done.err
    assert told.format(place=writer.place) in done.err
    left = [file for file in after if TEMPORARY in file]
    assert left == []
    changed = {file for file in {*before, *after} if before.get(file) != after.get(file)}
    if status:
        # A build takes note of what it did; the files of the tree are what counts.
        assert {file for file in changed if not belongs(file, (".bbtc",))} == set()
        return
    followed = {LINK_OUT: "outside/target", LINK_IN: "work/target"}.get(situation)
    assert {file for file in changed if not belongs(file, (writer.place, *writer.also))} <= {followed}
    if followed is not None and writer.replaced:
        assert followed in changed
        assert place.is_symlink()
    if reader is not None:
        with os.fdopen(reader, "rb") as stream:
            assert stream.read().strip()
        assert stat.S_ISFIFO(place.lstat().st_mode)
    elif writer.replaced:
        assert place.read_text() not in {OLD, COIN, ""}
