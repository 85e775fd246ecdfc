"""``bbtc run``: watch a tree tick against the simulated world."""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from bbtc.cli.output import on_terminal, show
from bbtc.cli.session import Count, Seed, Session, limit_options
from bbtc.cli.session import command as session_command

if TYPE_CHECKING:
    from bbtc.belief.stepper import Branch, Stepper
    from bbtc.tree.nodes import Tree

_COLORS = {"success": "green", "failure": "red", "running": "yellow"}
_MARKS = {"success": "✓", "failure": "✗", "running": "▸"}
_MOST_BRANCHES = 9  # that a key can choose
_ON = frozenset((" ", "\r", "\n", "n", "\x1b[C", "\x1b[B"))  # space, return, right, down
_BACK = frozenset(("b", "p", "\x7f", "\x08", "\x1b[D", "\x1b[A"))  # backspace, left, up
_QUIT = frozenset(("q", "\x1b", "\x04"))


def _choices(_ctx: click.Context, _parameter: click.Parameter, value: str | None) -> tuple[int, ...]:
    if not value:
        return ()
    parts = value.split(",")
    if not all(part.isascii() and part.isdecimal() and 0 < len(part) < 10 and int(part) for part in parts):
        raise click.BadParameter(f"'{value[:40]}' is not a list of numbers from 1 on, such as 1,2,1")
    return tuple(int(part) - 1 for part in parts)


@click.command("run")
@click.argument("tree", metavar="TREE")
@click.option(
    "--seed",
    type=Seed(),
    default=0,
    show_default=True,
    help="Seed of the outcomes that are drawn.",
)
@click.option(
    "--outcomes",
    callback=_choices,
    metavar="N,N,…",
    help="Take these outcomes, by number, first; the other ones are drawn.",
)
@click.option(
    "--steps",
    type=Count(0),
    default=1000,
    show_default=True,
    help="Most actions of a run that nobody steers.",
)
@click.option("--batch", is_flag=True, help="Print every tick; ask for no keys, even on a terminal.")
@click.option("--full", is_flag=True, help="Show subtrees that the tick did not reach, too.")
@limit_options
@session_command
def command(
    session: Session, tree: str, seed: int, outcomes: tuple[int, ...], steps: int, batch: bool, full: bool
) -> int:
    """Watch TREE tick against the simulated world: on a terminal with keys, step by step; else
    every tick is printed until the run ends."""
    from bbtc.belief.monitored import with_hidden
    from bbtc.belief.stepper import Stepper
    from bbtc.cli.inputs import tree_of

    loaded = tree_of(session.read(tree))
    loaded = replace(loaded, task=with_hidden(loaded.task))  # to show what is true, too
    stepper = Stepper(loaded.task, loaded.root, seed, session.limits)
    taken = _Taken(outcomes)
    stepper.start(taken.next(stepper.starts) if len(stepper.starts) > 1 else None)
    if not batch and on_terminal(sys.stdin) and on_terminal(sys.stdout):
        while not stepper.finished and (choice := taken.next(stepper.now.branches)) is not None:
            stepper.step(choice)
        session.watch.off()  # who looks at a tree has all the time there is
        _interact(loaded, stepper, full)
        return 0
    color = on_terminal(sys.stdout) and "NO_COLOR" not in os.environ
    for line in _frame(loaded, stepper, full):
        show(line, color=color)
    while not stepper.finished and len(stepper.moments) <= steps:
        stepper.step(taken.next(stepper.now.branches))
        show()
        for line in _frame(loaded, stepper, full):
            show(line, color=color)
    return 0


class _Taken:
    """The outcomes chosen on the command line, handed out one by one."""

    def __init__(self, choices: tuple[int, ...]) -> None:
        self._choices = iter(choices)

    def next(self, branches: Sequence[Branch]) -> int | None:
        """The next choice, None when there are no more; one that does not exist is wrong usage."""
        choice = next(self._choices, None)
        if choice is not None and choice >= len(branches):
            raise click.UsageError(
                f"Outcome {choice + 1} does not exist: there {'are' if len(branches) > 1 else 'is'} "
                f"{len(branches)} at this point."
            )
        return choice


def _interact(tree: Tree, stepper: Stepper, full: bool) -> None:
    color = "NO_COLOR" not in os.environ
    show_all = full
    _draw(tree, stepper, show_all, color)
    with _keys() as keys:
        for key in keys:
            if key in _QUIT:
                break
            show_all ^= key == "f"
            _act(stepper, key)
            _draw(tree, stepper, show_all, color)
    click.echo()


def _draw(tree: Tree, stepper: Stepper, full: bool, color: bool) -> None:
    click.echo("\x1b[H\x1b[2J", nl=False)
    for line in _fitted(_frame(tree, stepper, full), shutil.get_terminal_size().lines - 2):
        click.echo(line, color=color)
    keys = "b back, r start again, f whole tree, q quit"
    if not stepper.finished:
        last = min(len(stepper.now.branches), _MOST_BRANCHES)
        keys = f"space: draw an outcome, 1-{last}: choose one, " + keys
    click.secho(f"[{keys}]", dim=True, color=color, nl=False)


@contextlib.contextmanager
def _keys() -> Iterator[Iterator[str]]:
    """The keys pressed, as they come. The terminal does not echo meanwhile, and none is lost between
    two reads, as with ``click.getchar``, which serves where there are no such terminals."""
    try:
        import termios
        import tty
    except ImportError:
        yield iter(click.getchar, "")
        return
    terminal = sys.stdin.fileno()
    saved = termios.tcgetattr(terminal)
    try:
        tty.setcbreak(terminal, termios.TCSANOW)
        yield _read_keys(terminal)
    except KeyboardInterrupt:
        pass  # as good as q
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, saved)


def _read_keys(terminal: int) -> Iterator[str]:
    while pressed := os.read(terminal, 64).decode(errors="replace"):
        if pressed.startswith("\x1b"):
            yield pressed  # an arrow is one key
        else:
            yield from pressed


def _act(stepper: Stepper, key: str) -> None:
    """What a key does to the run; a key without a meaning does nothing."""
    if key in _BACK:
        stepper.back()
    elif key == "r":
        stepper.moments = stepper.moments[:1]
    elif stepper.finished:
        return
    elif key in _ON:
        stepper.step()
    elif key.isdecimal() and key.isascii() and 1 <= int(key) <= len(stepper.now.branches):
        stepper.step(int(key) - 1)


def _fitted(lines: list[str], height: int) -> list[str]:
    """The lines that fit on the screen: the end, where the outcomes are, matters most."""
    if len(lines) <= height:
        return lines
    left = max(1, height - 1)
    return [f"… {len(lines) - left} lines above", *lines[len(lines) - left :]]


def _frame(tree: Tree, stepper: Stepper, full: bool) -> list[str]:
    """One tick: what changed, the tree with what its nodes returned, and what may come."""
    from bbtc.cli.wording import changes
    from bbtc.printable import printable
    from bbtc.rounding import figure_text

    moments, now = stepper.moments, stepper.now
    if len(moments) == 1:
        head = [f"tick 1: {_state(tree, now.state.values)}"]
    else:
        before = moments[-2]
        assert before.action is not None
        did = changes(tree, before.state.values, now.state.values)
        head = [f"tick {len(moments)}: {printable(before.action.action)}: {did}"]
    lines = [*head, *_truth(stepper), *_tree_lines(tree, stepper, full)]
    if now.action is None:
        word = "blocked" if now.status.word == "running" else now.status.word
        return [*lines, f"end: {word}"]
    lines.append(f"starts {printable(now.action.action)}; its outcomes:")
    for number, branch in enumerate(now.branches, 1):
        did = changes(tree, now.state.values, branch.values)
        lines.append(f"  {number}. with probability {figure_text(branch.probability)}: {did}")
    return lines


def _truth(stepper: Stepper) -> list[str]:
    """What is true of what is hidden, if anything is."""
    from bbtc.printable import printable

    now = stepper.now
    if not now.worlds:
        return []
    anew = ""
    if len(stepper.moments) > 1:
        before = stepper.moments[-2]
        assert before.action is not None
        action, values = before.action.action, before.state.values
        if not stepper.truth.chance(action, values, before.worlds, now.state.values):
            anew = " (drawn anew: what was chosen could not be told in what was true)"
    facts = ", ".join(stepper.truth.facts(now.worlds)) or "nothing"
    return [f"hidden, but true: {printable(facts)}{anew}"]


def _tree_lines(tree: Tree, stepper: Stepper, full: bool) -> list[str]:
    from bbtc.backends.pictures.outline import label, outline
    from bbtc.tree.nodes import walk

    statuses = stepper.now.statuses
    lines: list[str] = []
    skip = 0
    for lead, node in outline(tree.root):
        if skip:
            skip -= 1
            continue
        status = statuses.get(node.id)
        text = label(tree.task, node)
        if status is None:
            size = sum(1 for _ in walk(node))
            if size > 1 and not full:
                skip = size - 1
                text += f"  … {skip} more"
            lines.append(f"  {lead}{click.style(text, dim=True)}")
            continue
        mark = click.style(f"{_MARKS[status.word]} ", fg=_COLORS[status.word])
        lines.append(f"{mark}{lead}{click.style(text, fg=_COLORS[status.word])}")
    return lines


def _state(tree: Tree, values: bytes) -> str:
    from bbtc.ground.describe import values_in_words
    from bbtc.printable import printable

    found = values_in_words(tree.task.variables, values)
    return printable(", ".join(f"{name} = {value}" for name, value in found.items()))
