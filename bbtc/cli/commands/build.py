"""``bbtc build``: every artefact of a project, and only those that are out of date."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from bbtc.cli.counting import counted
from bbtc.cli.session import Session
from bbtc.cli.session import command as session_command
from bbtc.diagnostics import BbtcError
from bbtc.exit_status import ExitStatus

if TYPE_CHECKING:
    from bbtc.builder.runner import BuildReport, Tell

_POLL = 0.3  # seconds between two looks at the files
_BAR = 24  # characters


@click.command("build")
@click.argument("trees", nargs=-1, metavar="[TREES...]")
@click.option(
    "-m", "--manifest", metavar="FILE", help="The manifest; default: that of this folder or one around it."
)
@click.option(
    "-j",
    "--jobs",
    type=click.IntRange(1, 1000),
    metavar="N",
    help="Trees at once; default: one for each core.",
)
@click.option("--check", is_flag=True, help="Write nothing; fail, with a diff, if a file would change.")
@click.option("--watch", is_flag=True, help="Build again whenever a file changes, until Ctrl-C.")
@click.option("-f", "--force", is_flag=True, help="Build what is up to date, too.")
@click.option("-q", "--quiet", is_flag=True, help="Tell only what is wrong.")
@session_command
def command(
    session: Session,
    trees: tuple[str, ...],
    manifest: str | None,
    jobs: int | None,
    check: bool,
    watch: bool,
    force: bool,
    quiet: bool,
) -> int:
    """Build the TREES of the project's manifest (bbtc.yaml, or [tool.bbtc] in pyproject.toml), or all.

    What is made from files and settings that have not changed is left alone. A tree that fails
    touches none of its files and does not stop the others.
    """
    from bbtc.builder.runner import build
    from bbtc.manifest.find import find_manifest

    if watch and check:
        raise click.UsageError("--watch writes; it does not go with --check.")
    file = Path(manifest) if manifest is not None else find_manifest(Path())

    def once(force: bool) -> int:
        report = build(file, names=trees, jobs=jobs, check=check, force=force, tell=_bar(session))
        session.clear()
        _tell(session, report, check=check, quiet=quiet)
        return _status(report)

    if not watch:
        return once(force)
    while True:
        watched = _Watched(file)  # before the build reads them: it may take long
        try:
            once(force)
        except BbtcError as error:
            session.show(error.diagnostics)
        else:
            session.show([*session.report])
        session.report = type(session.report)()
        session.say("waiting for changes; Ctrl-C ends")
        watched.wait_for_change()
        force = False


def _tell(session: Session, report: BuildReport, *, check: bool, quiet: bool) -> None:
    for outcome in report.outcomes:
        for diagnostic in outcome.diagnostics:
            session.report.add(diagnostic)
        if outcome.status == "built" and not quiet and not check:
            changed = counted(len(outcome.changed), "file") if outcome.changed else "no file"
            session.say(f"{outcome.name}: {outcome.summary}; {changed} changed")
    if quiet:
        return
    built, failed = report.count("built"), report.count("failed")
    parts = [f"{built} {'compared' if check else 'built'}", f"{report.count('unchanged')} up to date"]
    parts += [f"{failed} failed"] if failed else []
    session.say(f"{counted(len(report.outcomes), 'tree')}: {', '.join(parts)}")


def _status(report: BuildReport) -> int:
    kinds = {outcome.failure for outcome in report.outcomes if outcome.status == "failed"}
    if "internal" in kinds:
        return ExitStatus.INTERNAL
    if "error" in kinds:
        return ExitStatus.ERRORS
    return ExitStatus.LIMIT if kinds else 0


def _bar(session: Session) -> Tell | None:
    """A bar on a terminal, nothing elsewhere."""
    line = session.line
    if line is None:
        return None

    def tell(done: int, of: int, name: str) -> None:
        filled = _BAR * done // of
        line.show(f"[{'#' * filled}{'.' * (_BAR - filled)}] {done}/{of} {name}")

    return tell


class _Watched:
    """The manifest and what the trees are made from, as they were at a moment."""

    def __init__(self, manifest: Path) -> None:
        from bbtc.builder.runner import sources_of

        self._files = sources_of(manifest)
        self._before = self._stamps()

    def wait_for_change(self) -> None:
        """Return when a file is not as it was at that moment, and has come to rest."""
        while (now := self._stamps()) == self._before:
            time.sleep(_POLL)
        while True:
            time.sleep(_POLL)
            if now == (now := self._stamps()):
                return

    def _stamps(self) -> list[tuple[int, int] | None]:
        found: list[tuple[int, int] | None] = []
        for file in self._files:
            try:
                status = file.stat()
                found.append((status.st_mtime_ns, status.st_size))
            except OSError:
                found.append(None)
        return found
