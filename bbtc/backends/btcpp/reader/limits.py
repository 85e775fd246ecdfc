"""Time-outs of actions, read back: an action is given up when the task says so, which its figures rest on."""

from __future__ import annotations

import re

from bbtc.artefacts.cursor import clip
from bbtc.backends.btcpp.idioms import RESULT, TIMEOUT, milliseconds
from bbtc.backends.btcpp.reader.shapes import Hole, Pattern, Shape
from bbtc.backends.btcpp.reader.unread import unreadable
from bbtc.backends.btcpp.xmltext import XmlDocument, XmlElement
from bbtc.ground.task import GroundAction

_TIME = Pattern(re.compile("(?P<msec>[0-9]{1,13})"), "30000")

GIVEN_UP, GIVEN_UP_ONCE = (
    Shape("ForceSuccess", {}, (Shape(TIMEOUT, {"msec": _TIME}, (Hole("leaf", told),)),))
    for told in ({}, {"_onFailure": f"{RESULT} := 'failure'"})
)
"""An action that is given up after some time, which counts as its end; and one whose own end is kept by what
stands around it."""


def check_limit(document: XmlDocument, leaf: XmlElement, found: str | None, action: GroundAction) -> None:
    """Is the action given up when the task says so? Raises :class:`bbtc.diagnostics.Unreadable`."""
    wanted = None if action.timeout is None else str(milliseconds(action.timeout))
    if found == wanted:
        return
    if wanted is None:
        message = f"'{clip(action.name)}' is given up after {found} ms, and has no time-out in the task"
        hint = "say so in the domain: `:timeout`, in seconds"
    else:
        message = f"'{clip(action.name)}' has to be given up after {wanted} ms"
        hint = f'<ForceSuccess><Timeout msec="{wanted}">…</Timeout></ForceSuccess> does so'
    raise unreadable(document, leaf, "BBT0616", message, hint=hint)
