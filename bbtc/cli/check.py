"""``bbtc check``: diagnostics only."""

from __future__ import annotations

import click

from bbtc.cli.session import Session
from bbtc.cli.session import command as session_command
from bbtc.syntax.ast import Definition


@click.command("check")
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@session_command
def command(session: Session, files: tuple[str, ...]) -> None:
    """Report what is wrong or doubtful in FILES: syntax, names, types, probabilities, conditions
    that nothing makes true or known.

    Every problem is checked with the domain of its name among FILES; a problem without its domain
    is checked for syntax only.
    """
    from bbtc.analysis.check import check
    from bbtc.analysis.resolve import resolve
    from bbtc.cli.wording import counted
    from bbtc.diagnostics import Report
    from bbtc.pipeline import parse_all

    sources = [session.read(file) for file in files]
    documents = parse_all(sources, session.report)
    session.report.raise_errors()
    domains: dict[str, Definition] = {}
    problems: list[Definition] = []
    for document in documents:
        for definition in document.definitions:
            if definition.kind == "domain":
                domains.setdefault(definition.name.key, definition)
            else:
                problems.append(definition)
    pairs = [(_domain_of(problem, domains), problem) for problem in problems]
    used = {domain.name.key for domain, _ in pairs if domain is not None}
    tasks: list[tuple[Definition, Definition | None]] = [(d, p) for d, p in pairs if d is not None]
    tasks.extend((domain, None) for key, domain in domains.items() if key not in used)
    for domain, problem in tasks:
        # A report of its own: the errors of one pair do not hide the checks of the next.
        report = Report()
        model = resolve(domain, problem, report)
        for diagnostic in [*report, *(check(model) if model is not None else ())]:
            session.report.add(diagnostic)
    session.report.raise_errors()
    warnings = counted(len(list(session.report)), "warning")
    session.say(f"{counted(len(files), 'file')} checked, {warnings}")


def _domain_of(problem: Definition, domains: dict[str, Definition]) -> Definition | None:
    from bbtc.syntax.ast import DomainReference

    wanted = next((s.name.key for s in problem.sections if isinstance(s, DomainReference)), None)
    if wanted in domains:
        return domains[wanted]
    return next(iter(domains.values())) if len(domains) == 1 else None
