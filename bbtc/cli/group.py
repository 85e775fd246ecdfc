"""The command ``bbtc``: its subcommands, loaded when used."""

from __future__ import annotations

import keyword
from importlib import import_module
from pathlib import Path

import click

from bbtc.version import __version__

COMMANDS = {
    "fmt": "Give domains and problems their canonical layout.",
    "check": "Report what is wrong or doubtful in domains and problems.",
    "compile": "Parse, check and ground a problem into a task.",
    "plan": "Plan a tree that reaches the goal with the wanted probability.",
    "simulate": "Print the exact figures of a tree.",
    "verify": "Recompute a tree's figures by other means, and compare.",
    "run": "Watch a tree tick against the simulated world.",
    "diff": "Tell what changed from one tree to another.",
    "export": "Write a tree for people or for an execution engine.",
    "import": "Read an exported tree back, with what was edited in it.",
    "build": "Build every artefact of a project that is out of date.",
    "init": "Make a small project to start from.",
    "explain": "Explain what a code of a message means.",
}


class LazyGroup(click.Group):
    """A group whose commands are imported when they run, so that ``--help`` stays instant."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Every command, in the order of the pipeline."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """The command, imported now."""
        if cmd_name not in COMMANDS:
            return None
        module = f"{cmd_name}_" if keyword.iskeyword(cmd_name) else cmd_name
        command = import_module(f"bbtc.cli.commands.{module}").command
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command of the first argument; for one that there is not, what may be meant."""
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            from difflib import get_close_matches

            near = get_close_matches(args[0], COMMANDS, n=1)
            if near and args[0] not in COMMANDS:
                raise click.UsageError(f"{error.message} Did you mean '{near[0]}'?", ctx) from error
            raise

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """The commands with their one-line help, without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


def _print_version(ctx: click.Context, _parameter: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing:
        click.echo(f"bbtc {__version__}")
        ctx.exit()


def _print_cmake_dir(ctx: click.Context, _parameter: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing:
        click.echo(Path(__file__).parents[1] / "cmake")
        ctx.exit()


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_version,
    help="Print the version.",
)
@click.option(
    "--cmake-dir",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_cmake_dir,
    help="Print the folder of the CMake package: cmake -Dbbtc_DIR=$(bbtc --cmake-dir).",
)
@click.option("--debug", is_flag=True, help="Show a traceback for an internal error.")
@click.option(
    "--format",
    "diagnostic_format",
    type=click.Choice(["text", "json", "sarif", "github"]),
    default="text",
    show_default=True,
    help="How diagnostics are written to stderr (every command takes it, too).",
)
@click.pass_context
def cli(ctx: click.Context, debug: bool, diagnostic_format: str) -> None:
    """Turn what a robot can do, see and fail at into a behavior tree with a proven probability
    of success.

    DOMAIN and PROBLEM are files in the bbtc language, a superset of PPDDL; one file may hold both,
    and `-` is the standard input.
    """
    ctx.obj = {"format": diagnostic_format, "started": ctx.obj}
    del debug  # read by bbtc.cli.main, which must know it before anything can fail
