"""``bbtc compile``: from text to a ground task."""

from __future__ import annotations

import click

from bbtc.cli.session import Session, grounding_limits, output_options, problem_options
from bbtc.cli.session import command as session_command


@click.command("compile")
@click.argument("files", nargs=-1, required=True, metavar="DOMAIN [PROBLEM]")
@click.option(
    "--emit",
    type=click.Choice(["ast", "model", "ground", "prism", "prism-pomdp", "jani"]),
    default="ground",
    show_default=True,
    help="What to write: the syntax trees, the resolved model, the ground task, or the task as a Markov "
    "decision process for model checkers (prism-pomdp: partially observable, where facts are hidden).",
)
@problem_options
@grounding_limits
@output_options
@session_command
def command(
    session: Session,
    files: tuple[str, ...],
    emit: str,
    output: str,
    check: bool,
    depfile: str | None,
) -> None:
    """Parse, check and ground the PROBLEM of DOMAIN, and write the task as JSON (or what --emit says)."""
    from bbtc import pipeline
    from bbtc.artefacts.jsontext import dumps

    session.expect_output(output, files, check=check, depfile=depfile)
    sources = [session.read(file) for file in files]
    if emit in {"ground", "prism", "prism-pomdp", "jani"}:
        reading = session.reading
        task = pipeline.compile_sources(sources, session.report, session.limits, reading, checks=True)
        if emit == "ground":
            from bbtc.artefacts.task_json import task_to_json

            text = dumps(task_to_json(task))
        else:
            text = pipeline.process_text(task, emit, session.limits)
        session.say(
            f"{task.domain}/{task.problem}: {len(task.variables)} variables, {len(task.actions)} actions, "
            f"{len(task.templates)} templates"
        )
    else:
        from bbtc.artefacts.stages_json import model_to_json, syntax_to_json

        documents = pipeline.parse_all(sources, session.report, session.limits)
        session.report.raise_errors()
        if emit == "ast":
            text = dumps(syntax_to_json(documents))
        else:
            inputs = pipeline.select(documents, session.report, session.reading)
            session.report.raise_errors()
            assert inputs is not None
            model = pipeline.resolve_model(inputs, session.report, session.reading, checks=True)
            text = dumps(model_to_json(model))
    session.write(output, text, check=check, depfile=depfile)
