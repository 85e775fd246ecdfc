"""``bbtc verify``, ``--verify`` of ``plan`` and ``export``, and the exports to model checkers, in use."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given

from bbtc import pipeline
from bbtc.backends.models.jani import jani, task_text
from bbtc.backends.models.prism import prism, readable_names, tree_program
from bbtc.diagnostics import BbtcError
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.tree.nodes import Tree
from bbtc.verifier import storm, verdict
from bbtc.verifier.prism import KEYWORDS
from tests.domains.problems import REPOSITORY, bbtc
from tests.profiles import examples
from tests.strategies import HOSTILE_NAMES, soda_tree, trees

FILES = ("domains/household/domain.pddl", "domains/household/look-for-soda.pddl")


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's tree for the household."""
    file = tmp_path_factory.mktemp("planned") / "tree.json"
    assert bbtc("plan", *FILES, "--strategy", "refine", "-q", "-o", str(file)).status == 0
    return file


@pytest.fixture
def forged(planned: Path, tmp_path: Path) -> Path:
    """A tree that claims too much."""
    data = json.loads(planned.read_text(encoding="utf-8"))
    data["success_probability"] = "63/64"
    file = tmp_path / "forged.json"
    file.write_text(json.dumps(data), encoding="utf-8")
    return file


def test_a_true_claim_is_verified(planned: Path) -> None:
    done = bbtc("verify", str(planned), "--engine", "own")
    assert (done.status, done.err) == (0, "")
    assert done.out.decode().splitlines()[-1] == "verified"


def test_a_forged_claim_is_refused(forged: Path) -> None:
    done = bbtc("verify", str(forged), "--engine", "own")
    assert done.status == 1
    assert "BBT0801" in done.err
    assert done.out.decode().splitlines()[-1] == "refused"


def test_the_report_for_machines(planned: Path, forged: Path) -> None:
    found = json.loads(bbtc("verify", str(planned), "--engine", "own", "--json").out)
    assert (found["format"], found["claimed"], found["verified"]) == ("bbtc-verdict", "31/32", True)
    assert (found["own"]["success"], found["own"]["cost"], found["storm"]) == ("31/32", "31/8", None)
    found = json.loads(bbtc("verify", str(forged), "--engine", "own", "--json").out)
    assert (found["verified"], [p["code"] for p in found["problems"]]) == (False, ["BBT0801"])


def test_diagnostics_for_machines(forged: Path) -> None:
    done = bbtc("verify", str(forged), "--engine", "own", "--format", "json")
    assert [one["code"] for one in json.loads(done.err)] == ["BBT0801"]


def test_limits_end_it_with_their_status(planned: Path) -> None:
    assert bbtc("verify", str(planned), "--engine", "own", "--max-states", "3").status == 3


def test_nothing_is_exported_from_a_forged_tree(forged: Path, tmp_path: Path) -> None:
    done = bbtc("export", str(forged), "--verify", "--to", "dot", "-o", str(tmp_path / "tree.dot"))
    assert done.status == 1
    assert not (tmp_path / "tree.dot").exists()
    assert bbtc("export", str(forged), "--to", "dot", "-o", str(tmp_path / "tree.dot")).status == 0


def test_a_verified_plan_is_written_and_a_wrong_one_is_not(
    planned: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "tree.json"
    done = bbtc("plan", *FILES, "--strategy", "refine", "-q", "--verify", "-o", str(out))
    assert done.status == 0
    assert "verified by our own solver" in done.err
    assert out.read_bytes() == planned.read_bytes()
    out.unlink()
    honest = verdict.verify

    def other(tree: Tree, limits: Limits, engine: verdict.Engine, hidden: Task | None) -> verdict.Verdict:
        return honest(replace(tree, success_probability=tree.success_probability / 2), limits, engine, hidden)

    monkeypatch.setattr("bbtc.verifier.verdict.verify", other)
    done = bbtc("plan", *FILES, "--strategy", "refine", "-q", "--verify", "-o", str(out))
    assert done.status == 1
    assert not out.exists()


def test_without_storm_auto_does_without_and_all_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storm, "find_spec", lambda _: None)
    assert pipeline.verify_tree(soda_tree(), Limits()).storm is None
    engines: list[verdict.Engine] = ["storm", "all"]
    for engine in engines:
        with pytest.raises(BbtcError, match="BBT0803"):
            pipeline.verify_tree(soda_tree(), Limits(), engine)


@pytest.mark.parametrize("form", ["prism", "jani"])
def test_a_task_is_written_as_a_decision_process(form: str) -> None:
    text = bbtc("compile", *FILES, "--emit", form).out.decode()
    assert (json.loads(text)["type"] if form == "jani" else text.splitlines()[2]) == "mdp"


IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@examples(150)
@given(tree=trees(HOSTILE_NAMES))
def test_identifiers_are_valid_distinct_and_stable(tree: Tree) -> None:
    names = readable_names(tree_program(tree, {"form": "auto"}))
    assert names == readable_names(tree_program(tree, {"form": "auto"}))
    made = [*names.cells, *names.formulas, *names.actions.values()]
    assert all(IDENTIFIER.fullmatch(name) for name in made)
    assert len({name.casefold() for name in made}) == len(made)
    assert not {name.casefold() for name in made} & {word.casefold() for word in KEYWORDS}


@examples(150)
@given(tree=trees(HOSTILE_NAMES))
def test_no_name_leaves_its_comment(tree: Tree) -> None:
    """Outside comments the text holds only what PRISM is made of."""
    text = prism.export(tree, {"form": "auto"}, None)
    assert all(c.isprintable() or c == "\n" for c in text)
    for line in text.split("\n"):
        code = line.split("//")[0]
        assert re.fullmatch(r"[A-Za-z0-9_ .,:;=<>!&|?+'\"/()\[\]-]*", code), line


def test_the_layer_of_verification_is_told_apart() -> None:
    """The contract that import-linter checks is there, and forbids what it should."""
    text = (REPOSITORY / "pyproject.toml").read_text(encoding="utf-8")
    forbidden = 'forbidden_modules = ["bbtc.belief", "bbtc.rewrite", "bbtc.planner"]\n'
    contract = f'source_modules = ["bbtc.verifier"]\n{forbidden}'
    assert contract in text
    assert not text.split(contract)[1].startswith("allow_indirect_imports")


def test_verify_is_a_function_of_the_package() -> None:
    import bbtc as package

    assert package.verify(soda_tree(), engine="own").problems == ()


@pytest.mark.parametrize("form", ["auto", "walk"])
def test_momba_reads_the_jani_models(form: str) -> None:
    """Another implementation of the format, which checks the structure and every type."""
    momba = pytest.importorskip("momba.jani", reason="Momba is not installed: pip install 'bbtc[compare]'")
    tree = soda_tree()
    for text in (jani.export(tree, {"form": form}, None), task_text(tree.task)):
        network = momba.load_model(text)
        (automaton,) = network.ctx.automata
        assert len(list(automaton.edges)) == len(json.loads(text)["automata"][0]["edges"])
