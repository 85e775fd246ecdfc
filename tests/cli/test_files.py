"""What may be read and written: pipes, devices, links, odd names and numbers; and what ``--check`` tells."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.builder.projects import COIN
from tests.cli.forked import Commands, commands

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="files as POSIX has them")
MANIFEST = "trees: {c: {domain: coin.pddl, target: 0.5, exports: [dot]}}\n"


@pytest.fixture(scope="module")
def program() -> Commands:
    return commands()


@pytest.fixture
def folder(program: Commands, tmp_path: Path) -> Path:
    (tmp_path / "coin.pddl").write_text(COIN)
    (tmp_path / "bbtc.yaml").write_text(MANIFEST)
    assert (
        program.run(tmp_path, *["plan", "coin.pddl", "-q", "--target", "0.5", "-o", "tree.json"]).status == 0
    )
    return tmp_path


# --- inputs ----------------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["pipe", "link to a pipe", "/dev/zero", "link to /dev/zero"])
@pytest.mark.parametrize(
    "command",
    ["check x", "fmt x", "compile x", "plan x", "simulate x", "verify x", "run x", "diff tree.json x",
     "export x --to dot", "import x coin.pddl", "import tree.json x"],
)  # fmt: skip
def test_what_might_keep_a_reader_waiting_is_no_file(
    program: Commands, folder: Path, command: str, what: str
) -> None:
    if not os.access("/dev/zero", os.R_OK):
        pytest.skip("no /dev/zero")
    target = "/dev/zero" if what.endswith("zero") else str(folder / "p")
    os.mkfifo(folder / "p")
    name = target
    if what.startswith("link"):
        name = "x"
        (folder / "x").symlink_to(target)
    done = program.run(folder, *(name if word == "x" else word for word in command.split()))
    assert done.status == 1
    assert "error[BBT0001]: cannot read" in done.err
    assert ("it is a device" if target == "/dev/zero" else "it is a named pipe") in done.err


def test_a_shell_s_process_substitution_and_stdin_are_read(folder: Path) -> None:
    if not Path("/bin/bash").exists() or not Path("/dev/fd").exists():
        pytest.skip("no bash, or no /dev/fd")
    bbtc = f"{sys.executable} -m bbtc.cli.main"
    env = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    for command in (f"{bbtc} compile <(cat coin.pddl)", f"cat coin.pddl | {bbtc} compile /dev/stdin"):
        done = subprocess.run(
            ["/bin/bash", "-c", command], cwd=folder, env=env, capture_output=True, check=False, timeout=60
        )
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["domain"] == "coin"


# --- outputs ---------------------------------------------------------------------------------

SAME = {
    "by its name": ("plan coin.pddl -o coin.pddl", "coin.pddl"),
    "said otherwise": ("plan coin.pddl -o ./sub/../coin.pddl", "coin.pddl"),
    "through a link": ("compile coin.pddl -o link", "coin.pddl"),
    "by another name of it": ("compile coin.pddl -o hard", "coin.pddl"),
    "where the input is a link": ("compile link -o coin.pddl", "coin.pddl"),
    "a tree": ("export tree.json --to json -o tree.json", "tree.json"),
    "of simulate": ("simulate tree.json -o tree.json", "tree.json"),
    "of verify": ("verify tree.json -o tree.json", "tree.json"),
    "of diff": ("diff tree.json coin.pddl -o coin.pddl", "coin.pddl"),
    "of import": ("import tree.json coin.pddl -o coin.pddl", "coin.pddl"),
    "of bounds": ("plan coin.pddl --bounds -o coin.pddl", "coin.pddl"),
    "the depfile": ("plan coin.pddl -o t.json --depfile coin.pddl", "coin.pddl"),
    "the depfile and the output": ("plan coin.pddl -o t.json --depfile ./t.json", "coin.pddl"),
    "twice stdout": ("plan coin.pddl --depfile -", "coin.pddl"),
    "git": ("plan coin.pddl -o .git/config", ".git/config"),
    "the notes of a build": ("plan coin.pddl -o .bbtc/state.json", "coin.pddl"),
    "git, by a depfile": ("plan coin.pddl -o t.json --depfile .git/config", ".git/config"),
    "a file of a project": ("export sub/README.md --to btcpp_project -o sub", "sub/README.md"),
    "a depfile among them": ("export tree.json --to btcpp_project -o s --depfile s/README.md", "coin.pddl"),
}  # fmt: skip


@pytest.mark.parametrize("name", SAME)
def test_an_output_takes_no_input_s_place(program: Commands, folder: Path, name: str) -> None:
    command, kept = SAME[name]
    (folder / "sub").mkdir()
    (folder / ".git").mkdir()
    (folder / ".git/config").write_text("[core]\n")
    (folder / "link").symlink_to("coin.pddl")
    os.link(folder / "coin.pddl", folder / "hard")
    if name == "a depfile among them":
        (folder / "s").mkdir()
    if name == "a file of a project":
        (folder / "sub/README.md").write_bytes((folder / "tree.json").read_bytes())
    files = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    done = program.run(folder, *command.split(), *(["--target", "0.5"] if "plan" in command else []))
    assert done.status == 2, done
    assert "error[BBT0009]: cannot write" in done.err
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == files
    assert files[folder / kept]


@pytest.mark.parametrize("option", ["-o", "--depfile"])
def test_a_name_that_is_too_long_is_told(program: Commands, folder: Path, option: str) -> None:
    rest = [] if option == "-o" else ["-o", "made.json"]
    before = sorted(folder.iterdir())
    done = program.run(folder, "plan", "coin.pddl", *rest, option, "x" * 300)
    assert (done.status, "File name too long" in done.err) == (1, True)
    assert sorted(folder.iterdir()) == before
    longest = "x" * 255
    assert program.run(folder, "compile", "coin.pddl", "-o", longest).status == 0
    assert (folder / longest).exists()


def test_what_is_made_together_is_written_together(program: Commands, folder: Path) -> None:
    """A project of which one file cannot be written, in the midst of others that could."""
    assert program.run(folder, *["export", "tree.json", "--to", "btcpp_project", "-o", "one"]).status == 0
    names = sorted(path.name for path in (folder / "one").iterdir() if path.is_file())
    for name in names:
        (folder / "two" / name).mkdir(parents=True)
        done = program.run(folder, *["export", "tree.json", "--to", "btcpp_project", "-o", "two"])
        assert done.status == 1
        assert [path.name for path in (folder / "two").iterdir()] == [name]
        (folder / "two" / name).rmdir()
    done = program.run(
        folder, *["export", "tree.json", "--to", "btcpp_project", "-o", "deep/er/two"], most_bytes=200
    )
    assert done.status == 1
    assert not (folder / "deep").exists()


@pytest.mark.parametrize(
    "command",
    ["plan coin.pddl --max-file-size", "plan coin.pddl --max-states", "plan coin.pddl --max-memory",
     "plan coin.pddl --max-nodes", "plan coin.pddl --max-actions", "plan coin.pddl --max-ground-actions",
     "plan coin.pddl --max-facts", "plan coin.pddl --max-bindings", "simulate tree.json --samples",
     "simulate tree.json --scenarios", "simulate tree.json --seed", "run tree.json --seed",
     "run tree.json --steps", "build --jobs", "check coin.pddl --max-depth"],
)  # fmt: skip
def test_a_number_beyond_what_the_system_counts_is_wrong_usage(
    program: Commands, folder: Path, command: str
) -> None:
    for number in ("9" * 30, "9" * 5000):
        assert program.run(folder, *command.split(), number).status == 2


def test_the_largest_limits_are_no_trouble(program: Commands, folder: Path) -> None:
    for option in ("file-size", "states", "memory", "nodes", "ground-actions", "facts", "bindings"):
        arguments = [
            "plan",
            "coin.pddl",
            "--target",
            "0.5",
            f"--max-{option}",
            "999999999999",
            "-o",
            "x.json",
        ]
        assert program.run(folder, *arguments).status == 0, option


# --- what --check tells ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda text: text.replace(b"\n", b"\r\n"), " in its line ends only"),
        (lambda text: b"\xef\xbb\xbf" + text, " by a byte order mark at its start"),
        (lambda text: text.removesuffix(b"\n"), " in the line end at its end"),
        (lambda text: text + b"\n", " in the line end at its end"),
        (lambda text: text.replace(b"\n", b" \x1b[31m\n", 1), ":\n---"),
    ],
    ids=["CRLF", "BOM", "no line end", "one more", "a hostile line"],
)
@pytest.mark.parametrize(
    ("command", "file"),
    [
        ("fmt --check layout.pddl", "layout.pddl"),
        ("plan coin.pddl --target 0.5 -o tree.json --check", "tree.json"),
        ("export tree.json --to dot -o x.dot --check", "x.dot"),
        ("build --check", "build/c.dot"),
    ],
)
def test_check_tells_every_difference(
    program: Commands, folder: Path, command: str, file: str, change: object, told: str
) -> None:
    (folder / "layout.pddl").write_text(COIN)
    for making in ("fmt layout.pddl", "export tree.json --to dot -o x.dot", "build"):
        assert program.run(folder, *making.split()).status == 0
    assert program.run(folder, *command.split()).status == 0
    assert callable(change)
    changed = change((folder / file).read_bytes())
    (folder / file).write_bytes(changed)
    done = program.run(folder, *command.split())
    if file == "layout.pddl" and told.startswith(":"):
        assert "BBT0104" in done.err  # such a letter is no text of the language
        return
    assert done.status == 1
    assert f"{file} differs from what would be written{told}" in done.err
    assert "\x1b" not in done.err
    assert (folder / file).read_bytes() == changed


def test_check_with_a_depfile_writes_neither(program: Commands, folder: Path) -> None:
    done = program.run(
        folder, *["plan", "coin.pddl", "--target", "0.5", "-o", "tree.json", "--check", "--depfile", "x.d"]
    )
    assert done.status == 0
    assert not (folder / "x.d").exists()
