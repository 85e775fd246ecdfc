"""``bbtc explain``: what a code means, why it is reported, and how to mend it."""

from __future__ import annotations

import difflib
import re

import click

from bbtc.cli.output import show
from bbtc.cli.session import Session
from bbtc.cli.session import command as session_command
from bbtc.codes import CODES
from bbtc.pages import page
from bbtc.printable import printable


def _code(text: str) -> str:
    """The code that a text stands for: ``bbt0202``, ``0202`` and ``202`` are BBT0202.

    Raises :class:`click.UsageError` for an unknown one, with the nearest.
    """
    digits = re.fullmatch(r"(?:BBT)?(\d{1,4})", text.strip().strip("[]").upper())
    code = f"BBT{digits[1]:>04}" if digits else text.upper()
    if code in CODES:
        return code
    if digits:
        near = sorted(CODES, key=lambda each: abs(int(each[3:]) - int(digits[1])))[:3]
    else:
        near = difflib.get_close_matches(code[:20], CODES, 3, 0.7)
    hint = f" Near ones: {', '.join(near)}." if near else ""
    raise click.UsageError(f"There is no code '{printable(text[:40])}'.{hint} `bbtc explain` lists all.")


@click.command("explain")
@click.argument("code", required=False)
@session_command
def command(session: Session, code: str | None) -> None:  # noqa: ARG001
    """Explain what CODE (such as BBT0202) means, why it is reported, and how to mend it. Without
    CODE, list all codes."""
    if code is None:
        show("".join(f"{each.code}  {each.title}\n" for each in CODES.values()), nl=False)
    else:
        show(page(_code(code)), nl=False)
