"""What every command shares: options, reading, reporting, and the exit status of a failure."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, NoReturn, cast

import click

from bbtc.cli.main import EXIT_ERRORS, EXIT_LIMIT
from bbtc.cli.rendering import render
from bbtc.diagnostics import BbtcError, Diagnostic, LimitReached, Report
from bbtc.limits import Limits
from bbtc.source import SourceFile

_LONGEST_NUMBER = 1000  # characters; more digits than that are a mistake or an attack


@dataclass(slots=True)
class Session:
    """One run of a command: its diagnostics and where its messages go."""

    form: str
    report: Report = field(default_factory=Report)
    inputs: list[str] = field(default_factory=list)

    def say(self, text: str = "") -> None:
        """A message for people, on stderr; silent where diagnostics are written for machines."""
        if self.form == "text":
            click.echo(text, err=True)

    def read(self, path: str) -> SourceFile:
        """A source file, ``-`` for stdin; remembered for ``--depfile``."""
        from bbtc.syntax.reader import read_source

        self.inputs.append(path)
        return read_source(path)

    def show(self, diagnostics: Sequence[Diagnostic]) -> None:
        """Write diagnostics to stderr in the session's form (the machine forms even if empty)."""
        color = self.form == "text" and sys.stderr.isatty() and "NO_COLOR" not in os.environ
        text = render(diagnostics, self.form, color=color)
        if text:
            click.echo(text, err=True, nl=False, color=color)


def _fail(session: Session, error: BbtcError) -> NoReturn:
    shown = [*session.report]
    shown.extend(d for d in error.diagnostics if d not in shown)
    session.show(shown)
    sys.exit(EXIT_LIMIT if isinstance(error, LimitReached) else EXIT_ERRORS)


def command(function: Callable[..., int | None]) -> Callable[..., None]:
    """Make ``function(session, …)`` a command body: it gets a session, its diagnostics are written
    whatever happens, and its result or its :class:`BbtcError` becomes the exit status."""

    @functools.wraps(function)
    def run(ctx: click.Context, own_format: str | None, **arguments: Any) -> None:
        session = Session(own_format or ctx.obj["format"])
        try:
            status = function(session, **arguments)
        except BbtcError as error:
            _fail(session, error)
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
        text = str(value)[:_LONGEST_NUMBER]
        try:
            number = Fraction(text[:-1]) / 100 if text.endswith("%") else Fraction(text)
        except (ValueError, ZeroDivisionError):
            self.fail(f"'{text[:40]}' is not a probability such as 0.9, 9/10 or 90%", param, ctx)
        if not 0 <= number <= 1:
            self.fail(f"{text} is not between 0 and 1", param, ctx)
        return number


def output_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """``-o``, ``--check`` and ``--depfile``."""
    for option in (
        click.option("--depfile", metavar="FILE", help="Write a Make rule that names every input."),
        click.option("--check", is_flag=True, help="Write nothing; fail if the output would change."),
        click.option("-o", "--output", default="-", metavar="FILE", help="Where to write; default: stdout."),
    ):
        function = option(function)
    return function


time_limit_option = click.option(
    "--time-limit", type=click.FloatRange(0, min_open=True), metavar="SECONDS", help="Wall-clock time."
)


def limit_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """``--time-limit``, ``--max-states`` and ``--max-nodes``; see :func:`limits_from`."""
    defaults = Limits()
    at_least_one = click.IntRange(1)
    for option in (
        click.option(
            "--max-nodes", type=at_least_one, default=defaults.nodes, show_default=True, help="Tree nodes."
        ),
        click.option(
            "--max-states", type=at_least_one, default=defaults.states, show_default=True, help="States."
        ),
        time_limit_option,
    ):
        function = option(function)
    return function


def limits_from(time_limit: float | None, max_states: int, max_nodes: int) -> Limits:
    """The limits that the options of :func:`limit_options` ask for, from now on."""
    return Limits(seconds=time_limit, states=max_states, nodes=max_nodes)
