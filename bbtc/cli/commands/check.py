"""``bbtc check``: diagnostics only."""

from __future__ import annotations

from collections.abc import Iterable

import click

from bbtc.cli.counting import counted
from bbtc.cli.session import Session, lenient_option, reading_limits
from bbtc.cli.session import command as session_command
from bbtc.codes import CODES
from bbtc.diagnostics import Diagnostic, Report, Severity


class CodePrefixes(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """Codes or beginnings of codes, comma-separated: ``BBT0301``, ``BBT03``."""

    name = "codes"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, ...]:
        """The prefixes in capitals; one that no code begins with is wrong usage."""
        prefixes = tuple(part.strip().upper() for part in str(value).split(",") if part.strip())
        for prefix in prefixes:
            if not any(code.startswith(prefix) for code in CODES):
                self.fail(f"no code begins with '{prefix[:40]}'", param, ctx)
        return prefixes


@click.command("check")
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option(
    "--select",
    type=CodePrefixes(),
    multiple=True,
    metavar="CODES",
    help="Show only the warnings and notes with these codes, or whose codes begin so.",
)
@click.option(
    "--ignore",
    type=CodePrefixes(),
    multiple=True,
    metavar="CODES",
    help="Do not show the warnings and notes with these codes. The longer of two prefixes decides.",
)
@click.option("--strict", is_flag=True, help="Fail if there are warnings.")
@lenient_option
@reading_limits
@session_command
def command(
    session: Session,
    files: tuple[str, ...],
    select: tuple[tuple[str, ...], ...],
    ignore: tuple[tuple[str, ...], ...],
    strict: bool,
) -> int:
    """Report what is wrong or doubtful in FILES: syntax, names, types, probabilities, conditions
    that nothing makes true or known.

    Every problem is checked with the domain of its name among FILES; a problem without its domain
    is checked for syntax only, and a note says so. What rests on the problem, such as an action
    that it never needs, is a note; with several problems it is reported only if it holds for all of
    them, as a warning.
    Of hidden state it tells which facts are hidden, and how they are grouped. Errors are always shown. `bbtc
    explain CODE` tells more about a code.
    """
    from bbtc.pipeline import check_documents, parse_all

    report = Report()
    hidden: list[str] = []
    try:
        documents = parse_all([session.read(file) for file in files], report, session.limits)
        if not report.errors:
            hidden = check_documents(documents, report, session.reading, session.limits)
    finally:
        for diagnostic in chosen(report, sum(select, ()), sum(ignore, ())):
            session.report.add(diagnostic)
    session.report.raise_errors()
    found = [diagnostic.severity for diagnostic in session.report]
    warnings, notes = found.count(Severity.WARNING), found.count(Severity.NOTE)
    summary = f"{counted(len(files), 'file')} checked, {counted(warnings, 'warning')}"
    for line in hidden:
        session.say(line)
    session.say(summary + (f", {counted(notes, 'note')}" if notes else ""))
    return 1 if strict and warnings else 0


def chosen(
    diagnostics: Iterable[Diagnostic], select: tuple[str, ...], ignore: tuple[str, ...]
) -> list[Diagnostic]:
    """All errors, and the warnings and notes that are selected (without ``select``: all) and not
    ignored. Where prefixes of both kinds fit a code, the longer one decides."""

    def fit(code: str, prefixes: tuple[str, ...]) -> int:
        return max((len(prefix) for prefix in prefixes if code.startswith(prefix)), default=-1)

    def shown(diagnostic: Diagnostic) -> bool:
        selected = fit(diagnostic.code, select or ("",))
        return diagnostic.severity is Severity.ERROR or selected > fit(diagnostic.code, ignore)

    return [diagnostic for diagnostic in diagnostics if shown(diagnostic)]
