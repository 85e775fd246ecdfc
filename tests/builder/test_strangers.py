"""``bbtc build`` in a project that a stranger made: it writes below the project's folder, over no source, and
believes no notes that it did not write there itself."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import stat
import sys
from pathlib import Path
from typing import Any

import pytest

from bbtc.builder.runner import BuildReport, build
from bbtc.diagnostics import BbtcError
from bbtc.files import folder as folders
from tests.builder.projects import COIN, bbtc, project, snapshot

MANIFEST = "trees: {c: {domain: c.pddl, target: 0.5, exports: [dot]}}\n"
needs_links = pytest.mark.skipif(not hasattr(os, "symlink"), reason="no symbolic links on this system")


def run(folder: Path, **options: Any) -> BuildReport:
    return build(folder / "bbtc.yaml", jobs=1, **options)


def codes(report: BuildReport) -> list[str]:
    return [diagnostic.code for outcome in report.outcomes for diagnostic in outcome.diagnostics]


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    """A folder beside the project, with things that must survive."""
    folder = tmp_path / "victim"
    folder.mkdir()
    for name in ("thesis.txt", f"{folders.TEMPORARY}mine", "c.tree.json", "state.json", "lock"):
        (folder / name).write_text("precious\n")
    return folder


@pytest.fixture
def stranger(tmp_path: Path) -> Path:
    return project(tmp_path / "project", MANIFEST, c_pddl=COIN)


# --- links -----------------------------------------------------------------------------------

LINKS = {
    ".bbtc": "",
    ".bbtc/scratch": "",
    ".bbtc/state.json": "state.json",
    ".bbtc/lock": "lock",
    ".bbtc/.gitignore": "new.txt",
    "build": "",
    "build/c.tree.json": "c.tree.json",
    "build/c.dot": "new.dot",
}


def link(place: Path, target: Path) -> None:
    place.parent.mkdir(exist_ok=True)
    place.symlink_to(os.path.relpath(target, place.parent))


@needs_links
@pytest.mark.parametrize("by_descriptor", [True, False])
@pytest.mark.parametrize("at_once", [True, False])
def test_links_lead_a_build_nowhere(
    stranger: Path, victim: Path, monkeypatch: pytest.MonkeyPatch, by_descriptor: bool, at_once: bool
) -> None:
    """Also on systems that do not work relative to descriptors."""
    monkeypatch.setattr(folders, "BY_DESCRIPTOR", by_descriptor and folders.BY_DESCRIPTOR)
    before = snapshot(victim)
    if at_once:
        for place in (".bbtc/scratch", ".bbtc/lock", ".bbtc/state.json", ".bbtc/.gitignore", "build"):
            link(stranger / place, victim / LINKS[place])
        with pytest.raises(BbtcError, match="BBT1008"):
            run(stranger)
    for place, target in {} if at_once else LINKS.items():
        shutil.rmtree(stranger / ".bbtc", ignore_errors=True)
        shutil.rmtree(stranger / "build", ignore_errors=True)
        link(stranger / place, victim / target)
        try:
            told = codes(run(stranger))
        except BbtcError as error:
            told = [diagnostic.code for diagnostic in error.diagnostics]
        # What ignores itself already is left alone.
        assert told == ([] if place.endswith(".gitignore") else ["BBT1008"]), place
        (stranger / place).unlink()
    assert snapshot(victim) == before
    assert sorted(path.name for path in victim.parent.iterdir()) == ["project", "victim"]


@needs_links
@pytest.mark.skipif(not folders.BY_DESCRIPTOR, reason="needs descriptors of folders")
@pytest.mark.parametrize("place", [place for place in LINKS if place != ".bbtc/.gitignore"])
def test_a_link_that_comes_after_the_look_is_not_followed_either(
    stranger: Path, victim: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    look = folders.Folder.status

    def before_the_link_comes(folder: folders.Folder, name: str) -> os.stat_result | None:
        found = look(folder, name)
        return None if found is not None and stat.S_ISLNK(found.st_mode) else found

    monkeypatch.setattr(folders.Folder, "status", before_the_link_comes)
    before = snapshot(victim)
    link(stranger / place, victim / LINKS[place])
    with contextlib.suppress(BbtcError):
        assert not run(stranger).ok or not (stranger / place).is_symlink(), "replaced, not followed"
    assert snapshot(victim) == before


@needs_links
def test_the_project_itself_may_be_reached_through_a_link_and_read_through_links(tmp_path: Path) -> None:
    home = project(tmp_path / "home", MANIFEST)
    (tmp_path / "elsewhere.pddl").write_text(COIN)
    (home / "c.pddl").symlink_to("../elsewhere.pddl")
    (tmp_path / "short").symlink_to("home")
    assert run(tmp_path / "short").ok
    assert (home / "build/c.dot").exists()
    assert (tmp_path / "elsewhere.pddl").read_text() == COIN


@needs_links
def test_init_writes_through_no_link(tmp_path: Path, victim: Path) -> None:
    before = snapshot(victim)
    home = tmp_path / "home"
    home.mkdir()
    (home / "domain.pddl").symlink_to("../victim/new.pddl")
    done = bbtc(tmp_path, "init", "home")
    assert (done.returncode, "BBT1007" in done.stderr) == (1, True)
    assert snapshot(victim) == before
    assert [path.name for path in home.iterdir()] == ["domain.pddl"]


# --- sources ---------------------------------------------------------------------------------

TREE = "trees:\n  c:\n    domain: sub/c.pddl\n    target: 0.5\n"
IN_THE_WAY = {
    "the domain": ("    tree: sub/c.pddl\n", "BBT1009"),
    "the domain, said otherwise": ("    tree: ./sub//c.pddl\n", "BBT1009"),
    "the manifest": ("    tree: bbtc.yaml\n", "BBT1009"),
    "the other manifest": ("    exports: {dot: pyproject.toml}\n", "BBT1009"),
    "the folder of the domain": ("    tree: sub\n", "BBT1009"),
    "an export of files around the domain": ("    exports: {btcpp_project: sub}\n", "BBT1009"),
    "git": ("    exports: {dot: .git/config}\n", "BBT1009"),
    "git in capitals": ("    exports: {dot: .GIT/config}\n", "BBT1009"),
    "git further down": ("    exports: {dot: lib/.git/hooks/pre-commit}\n", "BBT1009"),
    "the state": ("    tree: .bbtc/state.json\n", "BBT1009"),
    "the scratch folder": ("    tree: .bbtc/scratch/x\n", "BBT1009"),
    "an export in a file": ("    exports: {dot: build/c.tree.json/x}\n", "BBT1003"),
    "an export in the folder of another": ("    exports: {btcpp_project: o, dot: o/x.dot}\n", "BBT1003"),
    "a tree in the folder of an export": ("    tree: o/a/t\n    exports: {btcpp_project: o}\n", "BBT1003"),
    "two exports in one folder": (
        "    exports: {a: {format: btcpp_project, file: o}, b: {format: btcpp_project, file: o}}\n",
        "BBT1003",
    ),
}


@pytest.mark.parametrize("name", IN_THE_WAY)
def test_an_artefact_takes_no_source_s_place(tmp_path: Path, name: str) -> None:
    settings, code = IN_THE_WAY[name]
    folder = project(tmp_path / "p", TREE + settings)
    for file, text in {
        "sub/c.pddl": COIN,
        ".git/config": "[core]\n",
        "pyproject.toml": "[project]\n",
    }.items():
        (folder / file).parent.mkdir(exist_ok=True)
        (folder / file).write_text(text)
    before = snapshot(folder)
    done = bbtc(folder, "build")
    assert done.returncode == 1
    assert f"error[{code}]" in done.stderr
    assert "bbtc.yaml:5:" in done.stderr or "bbtc.yaml:6:" in done.stderr
    assert snapshot(folder) == before


@pytest.mark.parametrize("how", ["hard link", "symbolic link"])
def test_an_artefact_is_no_source_by_another_name(stranger: Path, how: str) -> None:
    (stranger / "build").mkdir()
    if how == "hard link":
        os.link(stranger / "c.pddl", stranger / "build/c.dot")
    else:
        link(stranger / "build/c.dot", stranger / "c.pddl")
    before = snapshot(stranger)
    with pytest.raises(BbtcError, match=r"build/c\.dot is the source c\.pddl by another name"):
        run(stranger)
    assert snapshot(stranger) == before


def test_letter_case_tells_places_apart_where_the_system_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bbtc.manifest import places

    text = "trees: {c: {domain: C.pddl, target: 0.5, tree: c.PDDL, exports: {dot: a/x, text: A/X}}}\n"
    folder = project(tmp_path, text)
    (folder / "C.pddl").write_text(COIN)
    if not (folder / "c.PDDL").exists():
        assert run(folder).ok
    monkeypatch.setattr(places, "ignores_case", lambda path: True)
    (folder / "bbtc.yaml").write_text(text + "# changed\n")
    with pytest.raises(BbtcError) as error:
        run(folder)
    assert [diagnostic.code for diagnostic in error.value.diagnostics] == ["BBT1009", "BBT1003"]


# --- notes of the last build -----------------------------------------------------------------


def edited(folder: Path, edit: Any) -> None:
    """Change the state as somebody with an editor would."""
    file = folder / ".bbtc/state.json"
    state = json.loads(file.read_text())
    edit(state)
    file.write_text(json.dumps(state))


@pytest.mark.parametrize("how", ["all trees gone", "one tree gone", "no steps", "taken along"])
def test_a_state_that_was_not_written_here_is_not_believed(tmp_path: Path, how: str) -> None:
    trees = "trees: {a: {domain: c.pddl, target: 0.5}, b: {domain: c.pddl, target: 0.75}}\n"
    folder = project(tmp_path / "made", trees, c_pddl=COIN)
    assert run(folder).ok
    good = (folder / "build/a.tree.json").read_bytes()
    copy = tmp_path / "unpacked"
    shutil.copytree(folder, copy, symlinks=True)  # as an archive brings it
    (copy / "build/a.tree.json").write_text("evil\n")

    def edit(state: dict[str, Any]) -> None:
        if how == "all trees gone":
            state["trees"] = {}
        elif how == "one tree gone":
            del state["trees"]["b"]
        elif how == "no steps":
            state["trees"] = {"a": {}, "b": {}}
        else:
            import hashlib

            state["trees"]["a"]["tree"][2] = {"build/a.tree.json": hashlib.sha256(b"evil\n").hexdigest()}

    edited(copy, edit)
    (copy / "build/b.tree.json").unlink()
    assert not run(copy, check=True).ok
    report = run(copy)
    assert [outcome.name for outcome in report.outcomes] == ["a", "b"]
    assert report.count("built") == 2
    assert (copy / "build/a.tree.json").read_bytes() == good
    assert run(copy).count("unchanged") == 2


def test_an_emptied_state_in_its_place_is_no_reason_to_build_nothing(tmp_path: Path) -> None:
    folder = project(tmp_path, MANIFEST, c_pddl=COIN)
    assert run(folder).ok
    edited(folder, lambda state: state.update(trees={}))
    (folder / "build/c.dot").unlink()
    report = run(folder)
    assert [outcome.name for outcome in report.outcomes] == ["c"]
    assert (folder / "build/c.dot").exists()


# --- inputs ----------------------------------------------------------------------------------


def test_an_absolute_path_of_an_input_is_that_path(tmp_path: Path) -> None:
    (tmp_path / "lib").mkdir()
    domain = tmp_path / "lib" / "c.pddl"
    domain.write_text(COIN)
    folder = project(tmp_path / "p", f"trees: {{c: {{domain: {domain}, target: 0.5}}}}\n")
    assert run(folder).ok
    assert run(folder).count("unchanged") == 1
    domain.write_text(COIN.replace("1/2", "3/4"))
    assert run(folder).count("built") == 1
    missing = project(tmp_path / "q", "trees: {c: {domain: /no/such/file.pddl, target: 0.5}}\n")
    assert "cannot read /no/such/file.pddl: there is no such file" in bbtc(missing, "build").stderr


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes exist on Unix only")
@pytest.mark.parametrize("what", ["domain", "manifest", "state", "domain is a device"])
def test_what_would_keep_a_reader_waiting_is_refused(tmp_path: Path, what: str) -> None:
    folder = project(tmp_path, MANIFEST, c_pddl=COIN)
    arguments = ["build"]
    if what == "domain":
        (folder / "c.pddl").unlink()
        os.mkfifo(folder / "c.pddl")
    elif what == "domain is a device":
        (folder / "c.pddl").unlink()
        (folder / "c.pddl").symlink_to("/dev/zero")
    elif what == "manifest":
        os.mkfifo(folder / "m.yaml")
        arguments += ["-m", "m.yaml"]
    else:
        (folder / ".bbtc").mkdir()
        os.mkfifo(folder / ".bbtc/state.json")
    done = bbtc(folder, *arguments)
    assert done.returncode == 1
    assert ("it is a device" if "device" in what else "it is a named pipe") in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_pipe_named_pyproject_is_no_manifest(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pyproject.toml")
    done = bbtc(tmp_path, "build")
    assert (done.returncode, "BBT1002" in done.stderr) == (1, True)
