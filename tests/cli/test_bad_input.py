"""Bad input: a clear message with place and code, the documented exit status, nothing written."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest

from tests.cli.program import bbtc

REPOSITORY = Path(__file__).parents[2]
HOUSEHOLD = REPOSITORY / "domains" / "household"
DOMAIN = (HOUSEHOLD / "domain.pddl").read_text()
PROBLEM = (HOUSEHOLD / "look-for-soda.pddl").read_text()

HOSTILE = 'a"); import os #'


def assert_refused(done: subprocess.CompletedProcess[str], folder: Path, *words: str, place: str = "") -> str:
    """Exit status 1, a message with a code (at the place), no traceback, no output file; its text."""
    assert done.returncode == 1, done.stderr
    assert re.search(r"error\[BBT\d{4}\]: ", done.stderr)
    assert "Traceback" not in done.stderr
    assert place in done.stderr
    for word in words:
        assert word in done.stderr
    assert done.stdout == ""
    assert (folder / "out.json").read_text() == "as it was"
    assert sorted(path.name for path in folder.iterdir() if path.name.startswith(".")) == []
    return done.stderr


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the household, and an output file that must survive."""
    (tmp_path / "domain.pddl").write_text(DOMAIN)
    (tmp_path / "problem.pddl").write_text(PROBLEM)
    (tmp_path / "out.json").write_text("as it was")
    return tmp_path


def line_of(text: str, part: str) -> int:
    """1-based line of the first occurrence of a text."""
    return text[: text.index(part)].count("\n") + 1


# What is replaced in the domain (or, where it is not there, in the problem) by what, the text
# that the place must point at, and words of the message.
EDITS = {
    "unknown predicate": ("(seen soda))\n  (:goal-p", "(sen soda))\n  (:goal-p", "sen soda", ["sen", "seen"]),
    "wrong arity": ("(:goal (seen soda))", "(:goal (seen soda sprayer))", "seen soda sprayer", ["1", "2"]),
    "wrong type": ("(:goal (seen soda))", "(:goal (seen table1))", "table1", ["place", "item"]),
    "unknown object": ("(:goal (seen soda))", "(:goal (seen sodda))", "sodda", ["sodda", "soda"]),
    "unknown parameter": ("(known (seen ?item))", "(known (seen ?itm))", "?itm", ["?itm", "?item"]),
    "unknown type": ("(:types place item)", "(:types palce item)", "place", ["place", "palce"]),
    "unknown keyword": (
        ":precondition (and (luminousity",
        ":precondtion (and (luminousity",
        ":precondtion",
        [],
    ),
    "probability above 1": ("0.95 (at", "1.2 (at", "1.2", ["1.2"]),
    "negative probability": ("0.95 (at", "-0.2 (at", "-0.2", ["-0.2"]),
    "sum above 1": ("0.5 (not (seen", "0.6 (not (seen", "", ["1.1"]),
    "goal probability": ("(:goal-probability 0.9)", "(:goal-probability 1.5)", "1.5", ["1.5"]),
    "unknown call": ("(goto ?place)\n", "(gotto ?place)\n", "gotto", ["gotto", "goto"]),
    "unsupported": (
        "(:action light_on",
        "(:process boil)\n  (:action light_on",
        ":process",
        [],
    ),
    "two domains": ("(define (domain", "(define (domain first))\n(define (domain", "household", ["domain"]),
}


@pytest.mark.parametrize("name", EDITS)
def test_an_error_in_the_text_points_at_its_place(folder: Path, name: str) -> None:
    before, after, at, words = EDITS[name]
    file = "domain.pddl" if before in DOMAIN else "problem.pddl"
    text = (folder / file).read_text()
    assert text.count(before) == 1
    edited = text.replace(before, after)
    (folder / file).write_text(edited)
    done = bbtc("plan", "domain.pddl", "problem.pddl", "-o", "out.json", folder=folder)
    place = ""
    if at:
        # The line: of the edit itself, wherever else the words may stand.
        start = edited.index(after) + (after.index(at) if at in after else 0)
        if at in after:
            place = f"{file}:{edited[:start].count(chr(10)) + 1}:"
    assert_refused(done, folder, *words, place=place)


@pytest.mark.parametrize("command", ["check", "compile", "plan", "simulate", "export"])
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\xff\xfe", ""),
        (b"{", ""),
        (b'{"format": "bbtc-tree", "version": 1}', ""),
        (None, "no such file"),
    ],
)
def test_no_usable_file(folder: Path, command: str, content: bytes | None, words: str) -> None:
    if content is not None:
        (folder / "odd").write_bytes(content)
    options = {"export": ["--to", "dot", "-o", "out.json"], "check": []}.get(command, ["-o", "out.json"])
    done = bbtc(command, "odd", *options, folder=folder)
    assert words in assert_refused(done, folder, "odd").lower()


@pytest.mark.parametrize("command", ["simulate", "verify", "run"])
@pytest.mark.parametrize(
    ("file", "advice"),
    [
        ("domain.pddl", "`bbtc plan` makes a tree"),
        ("task.json", "`bbtc plan` makes a tree of a task"),
        ("tree.xml", "`bbtc import` reads"),
    ],
)
def test_a_file_that_is_no_tree_is_told_what_makes_a_tree_of_it(
    folder: Path, command: str, file: str, advice: str
) -> None:
    bbtc("compile", "domain.pddl", "problem.pddl", "-o", "task.json", folder=folder)
    (folder / "tree.xml").write_text('<?xml version="1.0"?>\n<root BTCPP_format="4"/>\n')
    assert_refused(bbtc(command, file, folder=folder), folder, advice, place=f"{file}:")


def test_a_tree_is_no_task(folder: Path) -> None:
    assert bbtc("plan", "domain.pddl", "problem.pddl", "-o", "tree.json", folder=folder).returncode == 0
    done = bbtc("plan", "tree.json", "-o", "out.json", folder=folder)
    assert_refused(done, folder, "`bbtc compile` makes a task", place="tree.json:2:13")


def test_import_of_a_domain_says_that_it_is_none_of_its_files(folder: Path) -> None:
    done = bbtc("import", "domain.pddl", "problem.pddl", "-o", "out.json", folder=folder)
    assert_refused(done, folder, "this seems to be a domain or a problem", place="domain.pddl:1:1")


def test_a_folder_is_not_a_file(folder: Path) -> None:
    (folder / "sub").mkdir()
    assert_refused(bbtc("compile", "sub", "-o", "out.json", folder=folder), folder, "sub")


def test_an_unclosed_parenthesis_is_found_where_it_opens(folder: Path) -> None:
    broken = DOMAIN.replace("    :effect (luminousity_ok))", "    :effect (luminousity_ok)")
    assert broken != DOMAIN
    (folder / "domain.pddl").write_text(broken)
    done = bbtc("check", "domain.pddl", folder=folder)
    assert_refused(done, folder, place=f"domain.pddl:{line_of(broken, '(:action light_on')}:")


def test_an_unreachable_goal(folder: Path) -> None:
    (folder / "problem.pddl").write_text(
        PROBLEM.replace("(seen soda))\n  (:goal-p", "(grasped soda))\n  (:goal-p")
    )
    (folder / "domain.pddl").write_text(
        re.sub(r"0\.2 \(grasped \?item\)", "0.2 (not (grasped ?item))", DOMAIN)
    )
    done = bbtc("plan", "domain.pddl", "problem.pddl", "-o", "out.json", folder=folder)
    assert_refused(done, folder, "grasped", place="problem.pddl:8:")


def test_an_action_in_a_child_of_a_skipper_that_is_not_the_last(folder: Path) -> None:
    broken = DOMAIN.replace(":body (sequence\n      (goto", ":body (skipper\n      (goto")
    assert broken != DOMAIN
    (folder / "domain.pddl").write_text(broken)
    done = bbtc("plan", "domain.pddl", "problem.pddl", "-o", "out.json", folder=folder)
    assert_refused(done, folder, "skipper", place=f"domain.pddl:{line_of(broken, '(goto ?place)')}:")


def test_the_skipper_rule_holds_for_trees_made_elsewhere(folder: Path) -> None:
    assert (
        bbtc(
            "plan", "domain.pddl", "problem.pddl", "--strategy", "refine", "-o", "tree.json", folder=folder
        ).returncode
        == 0
    )
    tree = json.loads((folder / "tree.json").read_text())
    skipper = tree["root"]["children"][0]
    assert skipper["type"] == "skipper"
    skipper["children"].reverse()
    (folder / "tree.json").write_text(json.dumps(tree))
    for command in (["simulate"], ["export", "--to", "btcpp"]):
        done = bbtc(command[0], "tree.json", *command[1:], "-o", "out.json", folder=folder)
        assert_refused(done, folder, "kipper")


@pytest.mark.parametrize("name", [HOSTILE, "x'''", "a\\", "]]><b>", "a\nb", "\x1b[31mred"])
def test_a_name_meant_to_break_out_of_generated_code_is_refused(folder: Path, name: str) -> None:
    (folder / "problem.pddl").write_text(PROBLEM.replace("soda", name))
    done = bbtc("plan", "domain.pddl", "problem.pddl", "-o", "out.json", folder=folder)
    assert "\x1b[31m" not in assert_refused(done, folder, place="problem.pddl:")


@pytest.mark.parametrize("form", ["dot", "svg", "btcpp", "py_trees"])
def test_a_hostile_name_in_a_tree_stays_a_name(folder: Path, form: str) -> None:
    assert bbtc("plan", "domain.pddl", "problem.pddl", "-o", "tree.json", folder=folder).returncode == 0
    text = (folder / "tree.json").read_text().replace("soda", json.dumps(HOSTILE)[1:-1])
    (folder / "tree.json").write_text(text)
    done = bbtc("export", "tree.json", "--to", form, folder=folder)
    assert done.returncode == 0, done.stderr
    if form == "py_trees":
        code = compile(done.stdout, "generated", "exec")
        assert "os" not in code.co_names
    if form in {"svg", "btcpp"}:
        from xml.etree import ElementTree as ET

        ET.fromstring(done.stdout)


def test_errors_of_one_run_are_all_reported(folder: Path) -> None:
    broken = DOMAIN.replace("0.95 (at", "1.2 (at").replace("(known (seen ?item))", "(known (sen ?item))")
    (folder / "domain.pddl").write_text(broken)
    text = assert_refused(bbtc("check", "domain.pddl", "problem.pddl", folder=folder), folder)
    assert len(re.findall(r"error\[", text)) == 2


@pytest.mark.parametrize(
    "arguments",
    [
        ["plan"],
        ["plan", "domain.pddl", "--target", "1.5"],
        ["plan", "domain.pddl", "--target", "much"],
        ["plan", "domain.pddl", "--no-such-option"],
        ["export", "domain.pddl"],
        ["frobnicate"],
        ["plan", "no-such-file", "--strategy", "searhc"],
        ["plan", "no-such-file", "--strategy", "refine", "--max-actions", "3"],
        ["export", "no-such-file", "--to", "svgg"],
        ["export", "no-such-file", "--to", "dot", "-O", "size=1"],
        ["export", "no-such-file", "--to", "dot", "-O", "legend=maybe"],
        ["import", "no-such-file", "--to", "svgg"],
    ],
)
def test_wrong_usage_is_status_2(folder: Path, arguments: list[str]) -> None:
    done = bbtc(*arguments, folder=folder)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert (folder / "out.json").read_text() == "as it was"


def test_a_misspelt_command_is_told_what_is_meant(folder: Path) -> None:
    done = bbtc("plna", "domain.pddl", folder=folder)
    assert (done.returncode, done.stderr.splitlines()[-1]) == (
        2,
        "Error: No such command 'plna'. Did you mean 'plan'?",
    )


def test_a_limit_is_status_3_and_writes_the_best_tree(folder: Path) -> None:
    limited = ["--strategy", "refine", "--max-nodes", "26", "-o", "out.json"]
    done = bbtc("plan", "domain.pddl", "problem.pddl", *limited, folder=folder)
    assert done.returncode == 3, done.stderr
    tree = json.loads((folder / "out.json").read_text())
    assert (tree["status"], tree["success_probability"]) == ("limit-reached", "7/8")


def test_check_writes_nothing_and_fails_on_drift(folder: Path) -> None:
    plan = ["plan", "domain.pddl", "problem.pddl", "-o", "out.json"]
    assert_refused(bbtc(*plan, "--check", folder=folder), folder, "as it was")
    assert bbtc(*plan, folder=folder).returncode == 0
    before = (folder / "out.json").stat()
    assert bbtc(*plan, "--check", folder=folder).returncode == 0
    assert bbtc(*plan, folder=folder).returncode == 0
    after = (folder / "out.json").stat()
    assert (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns), "unchanged: untouched"


def test_input_from_stdin_and_output_to_stdout(folder: Path) -> None:
    done = bbtc("plan", "-", "--strategy", "refine", folder=folder, stdin=DOMAIN + PROBLEM)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["success_probability"] == "31/32"


@pytest.mark.parametrize("form", ["json", "sarif", "github"])
def test_diagnostics_for_machines(folder: Path, form: str) -> None:
    (folder / "domain.pddl").write_text(DOMAIN.replace("0.95 (at", "1.2 (at"))
    done = bbtc("check", "--format", form, "domain.pddl", "problem.pddl", folder=folder)
    assert done.returncode == 1
    if form == "json":
        (found,) = json.loads(done.stderr)
        assert found["place"]["file"] == "domain.pddl"
        assert found["code"].startswith("BBT")
    elif form == "sarif":
        (result,) = json.loads(done.stderr)["runs"][0]["results"]
        assert result["level"] == "error"
    else:
        assert done.stderr.startswith("::error file=domain.pddl,line=")


def test_an_output_that_cannot_be_written_is_an_error(folder: Path) -> None:
    done = bbtc("compile", "domain.pddl", "problem.pddl", "-o", "missing/task.json", folder=folder)
    assert_refused(done, folder, "missing/task.json")


@pytest.mark.parametrize(
    ("place", "why"),
    [("missing/x.json", "there is no folder missing"), ("sub", "it is a directory"), ("locked/x", "denied")],
)
@pytest.mark.parametrize(
    "command",
    [["compile"], ["plan"], ["plan", "--bounds"], ["export", "--to", "dot"], ["simulate"], ["import"]],
)
def test_a_place_that_cannot_be_written_to_is_told_before_any_work(
    folder: Path, command: list[str], place: str, why: str
) -> None:
    (folder / "sub").mkdir()
    (folder / "locked").mkdir(mode=0o555)
    done = bbtc(*command, "no-such-file", "-o", place, folder=folder, powerless=True)
    assert "no-such-file" not in assert_refused(done, folder, f"cannot write {place}", why)


def test_an_unchanged_file_in_a_folder_that_may_not_be_written_to_is_no_error(folder: Path) -> None:
    (folder / "sub").mkdir()
    compiled = ["compile", "domain.pddl", "problem.pddl", "-o", "sub/task.json"]
    assert bbtc(*compiled, folder=folder).returncode == 0
    (folder / "sub").chmod(0o555)
    assert bbtc(*compiled, folder=folder).returncode == 0
    (folder / "sub").chmod(0o755)


def test_a_percentage_that_looks_like_a_probability_is_told_how_to_write_it(folder: Path) -> None:
    done = bbtc("plan", "domain.pddl", "--target", "95", folder=folder)
    assert "95 is not between 0 and 1; write 95% for a percentage" in done.stderr


@pytest.mark.parametrize(
    ("switch", "value", "status", "told"),
    [
        ("--max-depth", "3", 1, "nested more than 3 deep"),
        ("--max-ground-actions", "1", 3, "raise it with --max-ground-actions"),
        ("--max-states", "1", 3, "raise it with --max-states"),
        ("--time-limit", "1e-9", 3, "raise it with --time-limit"),
    ],
)
def test_every_limit_has_its_switch(folder: Path, switch: str, value: str, status: int, told: str) -> None:
    done = bbtc("plan", "domain.pddl", "problem.pddl", switch, value, folder=folder)
    assert done.returncode == status, done.stderr
    assert told in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "command", [["simulate", "--scenarios", "3"], ["run", "--batch"], ["plan"], ["verify"]]
)
def test_a_hostile_name_does_not_steer_the_terminal(folder: Path, command: list[str]) -> None:
    """Nor does it begin a line, where it could be a command to a CI system."""
    made = "task.json" if command[0] == "plan" else "tree.json"
    source = ["compile" if command[0] == "plan" else "plan", "domain.pddl", "problem.pddl", "-o", made]
    assert bbtc(*source, folder=folder).returncode == 0
    hostile = "\x1b]0;x\x07\u202e\u0085\n::error::x"
    text = (folder / made).read_text().replace("soda", json.dumps(hostile)[1:-1])
    (folder / made).write_text(text)
    done = bbtc(command[0], made, *command[1:], folder=folder)
    assert done.returncode == 0, done.stderr
    shown = done.stderr if command[0] == "plan" else done.stdout + done.stderr
    assert not [line for line in shown.split("\n") if not line.isprintable() or line.startswith("::")]


HOSTILE_LINE = "\x1b]0;x\x07\u202e\x9b31m\x85\n::error::x"


def hostile_tree(folder: Path) -> None:
    """A tree, ``hostile.json``, whose ids, labels and names all try to steer the terminal."""
    planned = bbtc("plan", "domain.pddl", "problem.pddl", "-o", "tree.json", folder=folder)
    assert planned.returncode == 0
    tree = json.loads((folder / "tree.json").read_text().replace("soda", json.dumps(HOSTILE_LINE)[1:-1]))
    stack = [tree["root"]]
    while stack:
        node = stack.pop()
        node["id"] += HOSTILE_LINE
        node |= {key: node[key] + HOSTILE_LINE for key in ("template", "reason", "name") if key in node}
        stack += node.get("children", [])
    (folder / "hostile.json").write_text(json.dumps(tree))


def test_no_id_and_no_label_steers_the_terminal(folder: Path) -> None:
    hostile_tree(folder)
    for command in (
        "simulate hostile.json --scenarios 3",
        "verify hostile.json --engine own",
        "run --batch --full hostile.json",
        "diff tree.json hostile.json",
        "diff tree.json hostile.json --to markdown",
        "export hostile.json --to text -O ids=true",
        "export hostile.json --to json",
        "simulate hostile.json --json --scenarios 1",
        "import hostile.json --to text",
    ):
        done = bbtc(*command.split(), folder=folder)
        assert done.returncode == 0, done.stderr
        shown = done.stdout + done.stderr
        assert not [line for line in shown.split("\n") if not line.isprintable() or line.startswith("::")], (
            command
        )


@pytest.mark.parametrize("form", ["text", "json", "sarif", "github"])
@pytest.mark.parametrize("name", [HOSTILE_LINE.replace("/", "_"), "a\udcffb"])
def test_no_name_of_a_file_steers_what_reads_messages(folder: Path, name: str, form: str) -> None:
    (folder / name).write_text("(define (domain d) (:predicates (p)) (:action a :effect (p ?x)))\n")
    for file in (name, f"no-{name}"):
        done = bbtc("--format", form, "check", file, folder=folder)
        assert done.returncode == 1
        assert "bug in bbtc" not in done.stderr
        if form in {"json", "sarif"}:
            json.loads(done.stderr)
        for line in done.stderr.rstrip("\n").split("\n"):
            assert line.isprintable()
            assert line.startswith("::error ") == (form == "github")
