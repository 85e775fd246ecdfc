"""What every command shares: options, reading, reporting, and the exit status of a failure."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias, cast

import click

from bbtc.cli.main import EXIT_ERRORS, EXIT_LIMIT, EXIT_USAGE
from bbtc.cli.output import ProgressLine
from bbtc.cli.rendering import render
from bbtc.diagnostics import BbtcError, Diagnostic, LimitReached, Report
from bbtc.files import require_writable, write, write_depfile, write_files
from bbtc.limits import Limits
from bbtc.source import AS_WRITTEN, Reading, SourceFile

if TYPE_CHECKING:
    from bbtc.export.registry import Artefact


@dataclass(slots=True)
class Session:
    """One run of a command: its diagnostics and where its messages go."""

    form: str
    limits: Limits
    report: Report = field(default_factory=Report)
    reading: Reading = AS_WRITTEN
    inputs: list[str] = field(default_factory=list)
    line: ProgressLine | None = None

    @classmethod
    def begun(cls, form: str, limits: Limits, reading: Reading) -> Session:
        """A session that shows progress where people can see it."""
        line = ProgressLine.on_terminal() if form == "text" else None
        watched = limits if line is None else replace(limits, watcher=line.watch)
        return cls(form, watched, reading=reading, line=line)

    def clear(self) -> None:
        """Take away what is shown of the progress."""
        if self.line is not None:
            self.line.erase()

    def say(self, text: str = "") -> None:
        """A message for people, one line on stderr; silent where diagnostics are written for machines. Names
        in it may come from strangers: what would steer a terminal is replaced."""
        from bbtc.export.names import printable

        if self.form == "text":
            self.clear()
            click.echo(printable(text), err=True)

    def read(self, path: str) -> SourceFile:
        """A source file, ``-`` for stdin; remembered for ``--depfile``."""
        from bbtc.syntax.reader import read_source

        self.inputs.append(path)
        return read_source(path, self.limits.file_bytes)

    def expect_output(self, output: str, *, folder: bool = False, check: bool = False) -> None:
        """Refuse, before any work, a place that :meth:`write` could not write to."""
        if not check:
            require_writable(output, folder=folder)

    def write(self, output: str, artefact: Artefact, *, check: bool, depfile: str | None) -> None:
        """Write what a command made, as ``-o``, ``--check`` and ``--depfile`` ask."""
        self.clear()
        if isinstance(artefact, str | bytes):
            write(output, artefact, check=check)
        else:
            write_files(output, artefact.texts, check=check)
        if depfile is not None:
            write_depfile(depfile, output, self.inputs)

    def show(self, diagnostics: Sequence[Diagnostic]) -> None:
        """Write diagnostics to stderr in the session's form (the machine forms even if empty)."""
        color = self.form == "text" and sys.stderr.isatty() and "NO_COLOR" not in os.environ
        text = render(diagnostics, self.form, color=color)
        if text:
            self.clear()
            click.echo(text, err=True, nl=False, color=color)


# What is wrong with the command line itself: a strategy, a format or an option of theirs.
_WRONG_USAGE = frozenset({"BBT0501", "BBT0503", "BBT0701", "BBT0704"})


def _fail(session: Session, error: BbtcError) -> NoReturn:
    shown = [*session.report]
    shown.extend(d for d in error.diagnostics if d not in shown)
    session.show(shown)
    if isinstance(error, LimitReached):
        sys.exit(EXIT_LIMIT)
    usage = all(each.code in _WRONG_USAGE for each in error.diagnostics)
    sys.exit(EXIT_USAGE if usage else EXIT_ERRORS)


def command(function: Callable[..., int | None]) -> Callable[..., None]:
    """Make ``function(session, …)`` a command body: it gets a session, its diagnostics are written
    whatever happens, and its result or its :class:`BbtcError` becomes the exit status."""

    @functools.wraps(function)
    def run(ctx: click.Context, own_format: str | None, **arguments: Any) -> None:
        bounds = {key: arguments.pop(key) for key in list(arguments) if key.startswith("limit_")}
        limits = Limits(**{key.removeprefix("limit_"): value for key, value in bounds.items()})
        ways = {key: arguments.pop(key) for key in list(arguments) if key.startswith("reading_")}
        reading = Reading(**{key.removeprefix("reading_"): value for key, value in ways.items()})
        session = Session.begun(own_format or ctx.obj["format"], limits, reading)
        try:
            status = function(session, **arguments)
        except BbtcError as error:
            _fail(session, error)
        except RecursionError:
            if limits.depth <= Limits().depth:
                raise  # a bug: what is nested no deeper than that never takes so many frames
            message = "an input is nested deeper than it can be worked with"
            _fail(session, BbtcError.single("BBT0005", message, hint="nest it less, whatever --max-depth is"))
        finally:
            session.clear()
        session.show([*session.report])
        sys.exit(status or 0)

    option = click.option(
        "--format",
        "own_format",
        type=click.Choice(["text", "json", "sarif", "github"]),
        default=None,
        help="How diagnostics are written to stderr.",
    )
    return option(click.pass_context(cast("Callable[..., None]", run)))


class Probability(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """An exact probability: ``0.9``, ``9/10``, ``90%``."""

    name = "probability"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Fraction:
        """The value as a rational in [0, 1]; anything else is wrong usage."""
        if isinstance(value, Fraction):
            return value
        from bbtc.artefacts.numbers import parse_probability

        try:
            return parse_probability(str(value))
        except ValueError as error:
            self.fail(str(error), param, ctx)


def output_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """``-o``, ``--check`` and ``--depfile``."""
    for option in (
        click.option("--depfile", metavar="FILE", help="Write a Make rule that names every input."),
        click.option("--check", is_flag=True, help="Write nothing; fail if the output would change."),
        click.option("-o", "--output", default="-", metavar="FILE", help="Where to write; default: stdout."),
    ):
        function = option(function)
    return function


lenient_option = click.option(
    "--lenient",
    "reading_lenient",
    is_flag=True,
    help="Read names that seem misspelt as planners do: as others than those declared.",
)
"""An option for every command that reads domains; the value is in :attr:`Session.reading`."""


def problem_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """``--problem`` and ``--lenient``, for commands that read one problem."""
    option = click.option(
        "--problem", "reading_problem", metavar="NAME", help="Of several problems, this one."
    )
    return option(lenient_option(function))


_MIB = 1 << 20
# Option, field of Limits, smallest and largest value, unit (1: as it is), help.
_READING = (
    ("--max-file-size", "file_bytes", 1, None, _MIB, "MiB of an input file."),
    ("--max-depth", "depth", 1, 900, 1, "Nested parentheses."),
)
_GROUNDING = (
    ("--max-ground-actions", "actions", 1, None, 1, "Ground actions and templates."),
    ("--max-facts", "facts", 1, None, 1, "Facts derived in grounding."),
    ("--max-bindings", "bindings", 1, None, 1, "Objects that quantifiers are tried with."),
    ("--max-memory", "memory", 1, None, _MIB, "MiB of memory."),
)
_RUNNING = (
    ("--max-states", "states", 1, None, 1, "States of a simulation."),
    ("--max-nodes", "nodes", 1, None, 1, "Nodes of a tree."),
)
_Table: TypeAlias = tuple[tuple[str, str, int, int | None, int, str], ...]


def _limits(*tables: _Table, timed: bool) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    rows = [row for table in tables for row in table]

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        for option, field_name, least, most, unit, told in reversed(rows):
            default = getattr(Limits(), field_name) // unit
            function = click.option(
                option,
                f"limit_{field_name}",
                type=click.IntRange(least, most),
                default=default,
                show_default=True,
                help=told,
                callback=lambda _context, _parameter, value, unit=unit: value * unit,
            )(function)
        if timed:
            function = click.option(
                "--time-limit",
                "limit_seconds",
                type=click.FloatRange(0, min_open=True),
                metavar="SECONDS",
                help="Wall-clock time.",
            )(function)
        return function

    return decorate


reading_limits = _limits(_READING, timed=False)
"""Options for a command that only reads; the values are in :attr:`Session.limits`."""

grounding_limits = _limits(_READING, _GROUNDING, timed=True)
"""Options for a command that reads and grounds."""

limit_options = _limits(_READING, _GROUNDING, _RUNNING, timed=True)
"""Options for a command that reads, grounds, plans and simulates."""
