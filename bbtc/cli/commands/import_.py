"""``bbtc import``: an exported tree, edited by hand or not, as a tree again."""

from __future__ import annotations

import click

from bbtc.cli.commands.export import require_place
from bbtc.cli.session import Session, limit_options, output_options, problem_options
from bbtc.cli.session import command as session_command


@click.command("import")
@click.argument("file", metavar="FILE")
@click.argument("others", nargs=-1, metavar="[DOMAIN PROBLEM | TASK | TREE]")
@click.option(
    "--to", "form", default="json", show_default=True, metavar="FORMAT", help="What to write; see export."
)
@click.option("--namespace", default="", help="That of the ids in FILE, if its notes do not tell.")
@click.option(
    "--tree", "main", default=None, metavar="ID", help="The BehaviorTree of FILE to read; see docs/import.md."
)
@click.option("--bindings", default="", metavar="YAML", help="The bindings that FILE was exported with.")
@problem_options
@limit_options
@output_options
@session_command
def command(
    session: Session,
    file: str,
    others: tuple[str, ...],
    form: str,
    namespace: str,
    main: str | None,
    bindings: str,
    output: str,
    check: bool,
    depfile: str | None,
) -> None:
    """Read FILE, which `bbtc export` wrote as btcpp or json and a person may have edited, and write the
    tree with its figures computed anew. BehaviorTree.CPP files need the task that they are about: a
    DOMAIN and PROBLEM, a compiled TASK, or the TREE that was exported."""
    from bbtc.backends.btcpp.bindings.read import files_of
    from bbtc.pipeline import export_tree, import_tree

    read = files_of(bindings) if bindings else ()
    require_place(session, form, {}, output, (file, *others, *read), check=check, depfile=depfile)
    session.inputs += read
    sources = [session.read(path) for path in (file, *others)]
    first, *rest = sources
    report, limits, reading = session.report, session.limits, session.reading
    tree = import_tree(
        first, rest, report, limits, namespace=namespace, main=main, reading=reading, bindings=bindings
    )
    artefact = export_tree(tree, form, {}, session.limits)
    session.write(output, artefact, check=check, depfile=depfile)
