"""``bbtc check``: which doubts are shown, how gravely, and what the exit status says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cli import program

DOMAIN = """(define (domain d)
  (:predicates (a) (b) (c) (unused))
  (:action make-a :effect (a))
  (:action make-b :effect (b))
  (:action make-c :effect (c)))
"""
FOR_A = "(define (problem pa) (:domain d) (:goal (a)))\n"
FOR_B = "(define (problem pb) (:domain d) (:goal (b)))\n"


def bbtc(*arguments: str, folder: Path) -> tuple[int, str]:
    """Exit status and messages."""
    done = program.bbtc(*arguments, folder=folder)
    return done.returncode, done.stderr


def findings(messages: str) -> set[tuple[str, str, str]]:
    """Severity, code and the name between backquotes, of each message."""
    return set(re.findall(r"(error|warning|note)\[(BBT\d{4})\]: [^`\n]*`\(?([\w-]+)\)?`", messages))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "domain.pddl").write_text(DOMAIN)
    (tmp_path / "a.pddl").write_text(FOR_A)
    (tmp_path / "b.pddl").write_text(FOR_B)
    return tmp_path


UNUSED = ("warning", "BBT0301", "unused")


def test_what_one_problem_does_not_need_is_a_note(folder: Path) -> None:
    status, messages = bbtc("check", "domain.pddl", "a.pddl", folder=folder)
    assert status == 0
    assert findings(messages) == {
        UNUSED,
        ("note", "BBT0301", "b"),
        ("note", "BBT0301", "c"),
        ("note", "BBT0307", "make-b"),
        ("note", "BBT0307", "make-c"),
    }
    assert "2 files checked, 1 warning, 4 notes\n" in messages


def test_what_none_of_several_problems_needs_is_a_warning(folder: Path) -> None:
    status, messages = bbtc("check", "domain.pddl", "a.pddl", "b.pddl", folder=folder)
    assert status == 0
    assert findings(messages) == {UNUSED, ("warning", "BBT0301", "c"), ("warning", "BBT0307", "make-c")}


def test_a_doubt_about_a_problem_is_not_hidden_by_another_problem(folder: Path) -> None:
    (folder / "b.pddl").write_text(FOR_B.replace("(b)", "(and (b) (unused))"))
    _, messages = bbtc("check", "domain.pddl", "a.pddl", "b.pddl", folder=folder)
    assert ("warning", "BBT0316", "unused") in findings(messages)
    assert UNUSED not in findings(messages), "the second problem's goal reads it"


def test_both_definitions_in_one_file_are_told_apart(folder: Path) -> None:
    for text in (DOMAIN + FOR_A, FOR_A + DOMAIN):
        (folder / "both.pddl").write_text(text.replace("(:goal (a))", "(:goal (a))"))
        _, messages = bbtc("check", "both.pddl", folder=folder)
        assert ("note", "BBT0307", "make-c") in findings(messages)
        (folder / "both.pddl").write_text(text.replace("(:goal (a))", "(:goal (and (a) (unused)))"))
        _, messages = bbtc("check", "both.pddl", folder=folder)
        assert ("warning", "BBT0316", "unused") in findings(messages)


@pytest.mark.parametrize(
    ("options", "codes"),
    [
        (["--select", "BBT0307"], {"BBT0307"}),
        (["--select", "bbt030", "--ignore", "BBT0307"], {"BBT0301"}),
        (["--ignore", "BBT03"], set()),
        (["--ignore", "BBT03", "--select", "BBT0301"], {"BBT0301"}),
        (["--select", "BBT0301,BBT0307"], {"BBT0301", "BBT0307"}),
    ],
)
def test_codes_are_selected_and_ignored_by_prefix(folder: Path, options: list[str], codes: set[str]) -> None:
    status, messages = bbtc("check", "domain.pddl", "a.pddl", *options, folder=folder)
    assert status == 0
    assert {code for _, code, _ in findings(messages)} == codes


def test_errors_cannot_be_ignored(folder: Path) -> None:
    (folder / "a.pddl").write_text(FOR_A.replace("(a)", "(missing)"))
    status, messages = bbtc("check", "domain.pddl", "a.pddl", "--ignore", "BBT", folder=folder)
    assert status == 1
    assert findings(messages) == {("error", "BBT0202", "missing")}


def test_a_prefix_of_no_code_is_wrong_usage(folder: Path) -> None:
    status, messages = bbtc("check", "domain.pddl", "--ignore", "E501", folder=folder)
    assert status == 2
    assert "E501" in messages


def test_strict_fails_on_warnings_but_not_on_notes(folder: Path) -> None:
    assert bbtc("check", "domain.pddl", "a.pddl", "--strict", folder=folder)[0] == 1
    assert bbtc("check", "domain.pddl", "a.pddl", "--strict", "--ignore", "BBT0301", folder=folder)[0] == 0


@pytest.mark.parametrize("command", ["compile", "plan"])
def test_other_commands_show_warnings_but_no_notes(folder: Path, command: str) -> None:
    status, messages = bbtc(command, "domain.pddl", "a.pddl", "-o", "out.json", folder=folder)
    assert status == 0
    assert findings(messages) == {UNUSED}


def test_a_problem_without_its_domain_is_noted(folder: Path) -> None:
    status, messages = bbtc("check", "a.pddl", folder=folder)
    assert status == 0
    assert findings(messages) == {("note", "BBT0006", "pa")}


def test_two_domains_of_one_name_are_both_checked(folder: Path) -> None:
    (folder / "other.pddl").write_text(DOMAIN.replace("(unused)", "(idle)"))
    status, messages = bbtc(
        "check", "domain.pddl", "other.pddl", "a.pddl", "--select", "BBT02", folder=folder
    )
    assert status == 0
    assert findings(messages) == {("warning", "BBT0208", "d")}
    _, messages = bbtc("check", "domain.pddl", "other.pddl", "a.pddl", folder=folder)
    assert {UNUSED, ("warning", "BBT0301", "idle")} <= findings(messages)


NOT_YET = """(define (domain look)
  (:requirements :contingent)
  (:predicates (unknown (seen)) (here) (there))
  (:action look :precondition (unknown (seen)) :observe (probabilistic 0.9 (and (seen) (here))))
  (:action go :precondition (here) :effect (there))
  (:sensor eye :sensed (known (here))))
(define (problem p) (:domain look)
  (:init (unknown (seen)) (oneof (here) (there)) (or (unknown (here)) (there)))
  (:metric minimize (total-cost)))
"""


def test_what_compile_will_refuse_is_noted(tmp_path: Path) -> None:
    """Each construct that is read and checked, but not compiled yet, has one note: the error of compile."""
    (tmp_path / "look.pddl").write_text(NOT_YET)
    status, checked = bbtc("check", "look.pddl", folder=tmp_path)
    noted = set(re.findall(r"(\S+): note\[(BBT04\d\d)\]", checked))
    assert {code for _, code in noted} == {"BBT0405", "BBT0406", "BBT0407", "BBT0411"}
    assert status == 0
    status, compiled = bbtc("compile", "look.pddl", folder=tmp_path)
    assert set(re.findall(r"(\S+): error\[(BBT04\d\d)\]", compiled)) == noted
    assert status == 1


HIDING = """(define (domain chest)
  (:requirements :contingent :conditional-effects :disjunctive-preconditions)
  (:predicates (gold ?x) (lead ?x) (rich))
  (:action look :parameters (?x) :observe (gold ?x))
  (:action take :parameters (?x) :precondition (or (gold ?x) (lead ?x)) :effect (when (gold ?x) (rich))))
(define (problem two) (:domain chest) (:objects a b)
  (:init (oneof (gold a) (lead a)) (oneof (gold b) (lead b)){}) (:goal (rich)))
"""


def test_what_is_hidden_is_told_with_its_groups(tmp_path: Path) -> None:
    (tmp_path / "chest.pddl").write_text(HIDING.format(""))
    status, messages = bbtc("check", "chest.pddl", folder=tmp_path)
    assert status == 0
    # Whether one is rich depends on both.
    assert "chest/two: 5 hidden facts in 1 component\n" in messages
    assert "  gold(a), gold(b), lead(a), lead(b), rich(): 4 worlds\n" in messages


def test_a_start_that_contradicts_itself_is_an_error_of_a_check(tmp_path: Path) -> None:
    (tmp_path / "chest.pddl").write_text(HIDING.format(" (not (gold a)) (not (lead a))"))
    status, messages = bbtc("check", "chest.pddl", folder=tmp_path)
    assert status == 1
    assert re.findall(r"(\S+): error\[(BBT\d+)\]", messages) == [("chest.pddl:7:10", "BBT0414")]


# --- root causes -----------------------------------------------------------------------------

HOUSEHOLD = Path(__file__).parents[2] / "domains" / "household"
CANS = """(define (domain cans)
  (:requirements :typing :unknown :probabilistic-effects)
  (:types item)
  (:predicates (seen ?item - item) (grasped ?item - item) (lit))
  (:action light :effect (lit))
  (:action detect :parameters (?item - item) :precondition (and (lit) (unknown (seen ?item)))
    :effect (probabilistic 0.5 (seen ?item) 0.5 (not (seen ?item))))
  (:action grasp :parameters (?item - item) :precondition (seen ?item) :effect (grasped ?item)))
"""
TIDY = "(define (problem tidy) (:domain cans) (:objects soda - item) (:init {}) (:goal (grasped soda)))\n"


def heads(messages: str) -> list[str]:
    """The first line of each message."""
    return re.findall(r"^.*(?:error|warning|note)\[BBT\d{4}\]: .*$", messages, re.MULTILINE)


def test_a_forgotten_unknown_is_told_first_and_without_what_follows_from_it(tmp_path: Path) -> None:
    (tmp_path / "cans.pddl").write_text(CANS)
    (tmp_path / "tidy.pddl").write_text(TIDY.format("(unknown (seen soda))"))
    status, messages = bbtc("check", "--strict", "cans.pddl", "tidy.pddl", folder=tmp_path)
    assert (status, heads(messages)) == (0, [])
    (tmp_path / "tidy.pddl").write_text(TIDY.format(""))
    status, messages = bbtc("check", "--strict", "cans.pddl", "tidy.pddl", folder=tmp_path)
    assert status == 1
    first, second = heads(messages)
    assert first == "tidy.pddl:1:62: warning[BBT0315]: nothing makes `seen(soda)` unknown"
    assert "hint: add `(unknown (seen soda))` to `:init`" in messages
    assert second.endswith("warning[BBT0316]: nothing can make the goal `(grasped soda)` true")


def test_planning_with_a_forgotten_unknown_says_so_in_one_message(tmp_path: Path) -> None:
    (tmp_path / "both.pddl").write_text(CANS + TIDY.format(""))
    status, messages = bbtc("plan", "both.pddl", folder=tmp_path)
    assert status == 1
    (only,) = heads(messages)
    assert "error[BBT0412]: the goal cannot be reached" in only
    assert "to be unknown, and nothing makes it so: add `(unknown (seen soda))` to `:init`" in messages


@pytest.mark.parametrize(
    ("problem", "fact", "severity"),
    [
        # Going anywhere makes `seen` unknown, so that a plan exists; nothing does that to `in_fridge`.
        ("look-for-soda", "seen", "note"),
        ("look-in-fridge", "in_fridge", "warning"),
    ],
)
def test_the_household_without_its_unknown_facts_gives_one_message(
    tmp_path: Path, problem: str, fact: str, severity: str
) -> None:
    text = (HOUSEHOLD / f"{problem}.pddl").read_text("utf-8")
    forgotten = text.replace(f"(unknown ({fact} soda))", "")
    assert forgotten != text
    (tmp_path / "domain.pddl").write_text((HOUSEHOLD / "domain.pddl").read_text("utf-8"))
    (tmp_path / "problem.pddl").write_text(forgotten)
    status, messages = bbtc("check", "--strict", "domain.pddl", "problem.pddl", folder=tmp_path)
    assert status == (severity == "warning")
    (only,) = heads(messages)
    assert f"{severity}[BBT0315]: nothing makes `{fact}(soda)` unknown" in only
    assert f"add `(unknown ({fact} soda))` to `:init`" in messages
    # Who means it says so.
    (tmp_path / "problem.pddl").write_text(text.replace(f"(unknown ({fact} soda))", f"(not ({fact} soda))"))
    assert "BBT0315" not in bbtc("check", "domain.pddl", "problem.pddl", folder=tmp_path)[1]


def test_no_problem_of_the_project_is_doubted() -> None:
    for domain in sorted(HOUSEHOLD.parent.glob("*/domain.pddl")):
        files = sorted(str(path) for path in domain.parent.glob("*.pddl"))
        status, messages = bbtc("check", *files, "--select", "BBT0315,BBT0316", folder=HOUSEHOLD)
        assert (status, heads(messages)) == (0, [])


def test_a_root_cause_comes_before_what_the_domain_has_of_its_own(folder: Path) -> None:
    (folder / "z.pddl").write_text("(define (problem z) (:domain d) (:init) (:goal (never-set)))")
    (folder / "domain.pddl").write_text(DOMAIN.replace("(unused)", "(unused) (never-set)"))
    status, messages = bbtc("check", "--strict", "domain.pddl", "z.pddl", folder=folder)
    assert status == 1
    assert [head.split(" ")[1].rstrip(":") for head in heads(messages)] == [
        "warning[BBT0316]",
        "warning[BBT0301]",
    ]


@pytest.mark.parametrize(("goal", "warned"), [("(q)", True), ("(p n1 n0 n2)", False)])
def test_a_goal_too_large_to_look_into_is_judged_by_predicates_alone(
    tmp_path: Path, goal: str, warned: bool
) -> None:
    """A check has bounds of its own, and ends well where they end the search."""
    names = " ".join(f"n{number}" for number in range(120))
    (tmp_path / "wide.pddl").write_text(
        "(define (domain w) (:requirements :typing) (:types t) (:predicates (p ?a ?b ?c - t) (q))"
        " (:action a :parameters (?a ?b ?c - t) :effect (p ?a ?b ?c)))"
        f"(define (problem x) (:domain w) (:objects {names} - t) (:init) (:goal (and (p n0 n1 n2) {goal})))"
    )
    status, messages = bbtc("check", "wide.pddl", folder=tmp_path)
    assert status == 0
    assert ("nothing can make the goal `(q)` true" in messages) is warned
    assert "BBT0007" not in messages


def test_a_goal_of_what_cannot_be_compiled_yet_is_judged_by_predicates_alone(tmp_path: Path) -> None:
    domain = """(define (domain d) (:requirements :typing :unknown) (:predicates (shut) (done) (other))
      (:action look :precondition (unknown (shut)) :observe (shut))
      (:sensor eye :sensed (known (shut)))
      (:action act :precondition (shut) :effect (done)))
      (define (problem x) (:domain d) (:init (unknown (shut))) (:goal {}))"""
    for goal, warned in (("(done)", False), ("(other)", True)):
        (tmp_path / "look.pddl").write_text(domain.format(goal))
        _, messages = bbtc("check", "look.pddl", folder=tmp_path)
        assert ("BBT0316" in messages) is warned
        assert "BBT0407" in messages
