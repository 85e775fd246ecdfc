"""What every command shares: options, reading, reporting, and the exit status of a failure."""

from __future__ import annotations

import contextlib
import functools
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias, TypeVar, cast

import click
from click.core import ParameterSource

from bbtc.cli.output import ProgressLine, on_terminal, tell
from bbtc.cli.rendering import render
from bbtc.diagnostics import BbtcError, Diagnostic, Report
from bbtc.files.read_write import Outputs, read_file, reason, require_apart, require_writable
from bbtc.limits import PLANNING_SECONDS, Limits
from bbtc.printable import printable
from bbtc.source import AS_WRITTEN, Reading, SourceFile
from bbtc.tree.deep import stack_room
from bbtc.watch import Watch, watching

if TYPE_CHECKING:
    from bbtc.backends.exporter import Artefact

_Text = TypeVar("_Text", str, bytes, str | bytes)


@dataclass(slots=True)
class Session:
    """One run of a command: its diagnostics and where its messages go."""

    form: str
    limits: Limits
    report: Report = field(default_factory=Report)
    reading: Reading = AS_WRITTEN
    inputs: list[str] = field(default_factory=list)
    line: ProgressLine | None = None
    watch: Watch = field(default_factory=Watch)

    @classmethod
    @contextlib.contextmanager
    def begun(cls, form: str, limits: Limits, reading: Reading) -> Iterator[Session]:
        """A session that shows progress where people can see it, and whose limits are watched over."""
        line = ProgressLine.on_terminal() if form == "text" else None
        with watching(limits if line is None else replace(limits, watcher=line.watch)) as (watch, told):
            yield cls(form, told, reading=reading, line=line, watch=watch)

    def watch_planning(self) -> Limits:
        """The limits for planning on the way: bounded in time even where nobody asked for it."""
        context = click.get_current_context()
        if context.get_parameter_source("limit_seconds") is ParameterSource.DEFAULT:
            self.limits = self.watch.over(replace(self.limits, seconds=PLANNING_SECONDS))
        return self.limits

    def clear(self) -> None:
        """Take away what is shown of the progress."""
        if self.line is not None:
            self.line.erase()

    def say(self, text: str = "") -> None:
        """A message for people, one line on stderr; silent where diagnostics are written for machines. Names
        in it may come from strangers: what would steer a terminal is replaced."""
        if self.form == "text":
            self.clear()
            tell(printable(text))

    def read(self, path: str) -> SourceFile:
        """A source file, ``-`` for stdin; remembered for ``--depfile``."""
        from bbtc.files.sources import read_source

        self.inputs.append(path)
        return read_source(path, self.limits.file_bytes)

    def expect_output(
        self,
        output: str,
        inputs: Sequence[str],
        *,
        folder: bool = False,
        check: bool = False,
        depfile: str | None = None,
    ) -> None:
        """Refuse, before any work, a place that :meth:`write` could not write to, or where it would overwrite
        an input."""
        if check:
            return
        places = [output] if depfile is None else [output, depfile]
        require_apart(places, inputs)
        require_writable(output, folder=folder)
        if depfile is not None:
            require_writable(depfile)
            _rule(output, inputs)

    def write(
        self, output: str, artefact: Artefact, *, check: bool = False, depfile: str | None = None
    ) -> None:
        """Write what a command made, as ``-o``, ``--check`` and ``--depfile`` ask: all of it, or nothing."""
        self.clear()
        outputs = Outputs(check)
        if isinstance(artefact, str | bytes):
            for path, text in self._places({output: artefact}, "", check=check).items():
                outputs.add(path, text)
        else:
            outputs.add_files(output, self._places(artefact.texts, output, check=check))
        if not check:
            if depfile is not None:
                outputs.add(depfile, _rule(output, self.inputs))
            require_apart(outputs.paths, self.inputs)
        outputs.write()

    def _places(self, texts: Mapping[str, _Text], folder: str, *, check: bool) -> dict[str, _Text]:
        """The texts by where they go: not over what was begun here before, which is somebody's by now."""
        from bbtc.backends.exporter import Begun

        found: dict[str, _Text] = {}
        kept: list[str] = []
        for name, text in texts.items():
            path = Path(folder, name)
            if not isinstance(text, Begun) or name == "-" or not path.is_file():
                found[name] = text
                continue
            from bbtc.backends.begun import place_of

            try:
                old = read_file(path, self.limits.file_bytes)
            except OSError as error:
                raise BbtcError.single("BBT0004", f"cannot read {path}: {reason(error)}") from error
            place = place_of(name, old, text.encode(), shown=str(path), check=check)
            if place.path is not None:
                found[place.path] = text
            if place.warning is not None:
                self.report.add(place.warning)
            elif place.path is None:
                kept.append(str(path))
        if kept and not check:
            message = f"{', '.join(kept)}: yours, and left as it is"
            hint = "to begin it anew, delete it, or write to another place"
            self.report.add(Diagnostic("BBT1011", message, hint=hint))
        return found

    def show(self, diagnostics: Sequence[Diagnostic]) -> None:
        """Write diagnostics to stderr in the session's form (the machine forms even if empty)."""
        color = self.form == "text" and on_terminal(sys.stderr) and "NO_COLOR" not in os.environ
        text = render(diagnostics, self.form, color=color)
        if text:
            self.clear()
            tell(text, nl=False, color=color)


def _rule(output: str, inputs: Sequence[str]) -> bytes:
    from bbtc.files.depfile import depfile

    return depfile(output, inputs)


def _fail(session: Session, error: BbtcError) -> NoReturn:
    shown = [*session.report]
    shown.extend(d for d in error.diagnostics if d not in shown)
    session.show(shown)
    sys.exit(error.exit_status)


def command(function: Callable[..., int | None]) -> Callable[..., None]:
    """Make ``function(session, …)`` a command body: it gets a session, its diagnostics are written
    whatever happens, and its result or its :class:`BbtcError` becomes the exit status."""

    @functools.wraps(function)
    def run(ctx: click.Context, own_format: str | None, **arguments: Any) -> None:
        bounds = {key: arguments.pop(key) for key in list(arguments) if key.startswith("limit_")}
        limits = Limits(**{key.removeprefix("limit_"): value for key, value in bounds.items()})
        ways = {key: arguments.pop(key) for key in list(arguments) if key.startswith("reading_")}
        reading = Reading(**{key.removeprefix("reading_"): value for key, value in ways.items()})
        form = own_format or ctx.obj["format"]
        if ctx.obj["started"] is not None:
            limits = limits.since(ctx.obj["started"])
        with stack_room(), Session.begun(form, limits, reading) as session:
            try:
                status = function(session, **arguments)
            except BbtcError as error:
                session.watch.off()
                _fail(session, error)
            except RecursionError:
                if limits.depth <= Limits().depth:
                    raise  # a bug: what is nested no deeper than that never takes so many frames
                message = "an input is nested deeper than it can be worked with"
                hint = "nest it less, whatever --max-depth is"
                _fail(session, BbtcError.single("BBT0005", message, hint=hint))
            finally:
                session.clear()
            session.watch.off()
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


class Seconds(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A bound on time: a number of seconds, or ``none``."""

    name = "seconds"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The seconds; infinity for ``none``. Anything else is wrong usage."""
        if value == "none":
            return math.inf
        return click.FloatRange(0, min_open=True).convert(value, param, ctx)


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


class Time(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """An exact number of seconds above 0: ``0.5``, ``120``, ``1/3``."""

    name = "seconds"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Fraction:
        """The value as a rational; anything else is wrong usage."""
        if isinstance(value, Fraction):
            return value
        from bbtc.artefacts.numbers import parse_written
        from bbtc.durations import LONGEST

        try:
            seconds = parse_written(str(value), "a number of seconds such as 120 or 0.5")
        except ValueError as error:
            self.fail(str(error), param, ctx)
        if not 0 < seconds <= LONGEST:
            self.fail(f"{value} is not above 0 and at most {LONGEST} seconds", param, ctx)
        return seconds


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
_MOST = 10**12  # of an option: more than anybody needs, and no more than the system can count


class Count(click.IntRange):
    """A whole number from a bound on, which the system can count to."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """The number; one that is too large is wrong usage."""
        number: int = super().convert(value, param, ctx)
        if abs(number) > _MOST:
            self.fail(f"{number} is larger than {_MOST}", param, ctx)
        return number


class Seed(Count):
    """Any whole number that the system can count to."""

    name = "integer"

    def __init__(self) -> None:
        super().__init__()

    def _describe_range(self) -> str:
        return ""


# Option, field of Limits, smallest and largest value, unit (1: as it is), help.
_READING = (
    ("--max-file-size", "file_bytes", 1, None, _MIB, "MiB of an input file."),
    ("--max-depth", "depth", 1, 900, 1, "Nested parentheses."),
)
_GROUNDING = (
    ("--max-ground-actions", "actions", 1, None, 1, "Ground actions and templates."),
    ("--max-facts", "facts", 1, None, 1, "Facts derived in grounding."),
    ("--max-bindings", "bindings", 1, None, 1, "Objects that quantifiers are tried with."),
)
_MEMORY = (("--max-memory", "memory", 1, None, _MIB, "MiB of memory."),)
_RUNNING = (
    ("--max-states", "states", 1, None, 1, "States of a simulation."),
    ("--max-nodes", "nodes", 1, None, 1, "Nodes of a tree."),
)
_Table: TypeAlias = tuple[tuple[str, str, int, int | None, int, str], ...]


def _limits(
    *tables: _Table, seconds: float | None = None
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    rows = [row for table in tables for row in table]

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        for option, field_name, least, most, unit, told in reversed(rows):
            default = getattr(Limits(), field_name) // unit
            function = click.option(
                option,
                f"limit_{field_name}",
                type=Count(least, most),
                default=default,
                show_default=True,
                help=told,
                callback=lambda _context, _parameter, value, unit=unit: value * unit,
            )(function)
        return click.option(
            "--time-limit",
            "limit_seconds",
            type=Seconds(),
            default="none" if seconds is None else f"{seconds:g}",
            show_default=True,
            metavar="SECONDS",
            help="Seconds since the start, or none.",
            callback=lambda _context, _parameter, value: None if math.isinf(value) else value,
        )(function)

    return decorate


reading_limits = _limits(_READING, _MEMORY)
"""Options for a command that only reads; the values are in :attr:`Session.limits`."""

grounding_limits = _limits(_READING, _GROUNDING, _MEMORY)
"""Options for a command that reads and grounds."""

limit_options = _limits(_READING, _GROUNDING, _MEMORY, _RUNNING)
"""Options for a command that reads, grounds and simulates."""

planning_limits = _limits(_READING, _GROUNDING, _MEMORY, _RUNNING, seconds=PLANNING_SECONDS)
"""The same for a command that plans, which ends in any case."""
