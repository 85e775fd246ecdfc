r"""A Make rule that lets an output depend on its inputs, as GNU Make and Ninja both read it.

They read more out of a name than its letters: recipes, variables, patterns, several names. Where there is a
spelling that both take for the name (``\ ``, ``\#``, ``\:``, ``$$``), that is written; a name without one is
refused, for what is read as a recipe is run.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable

from bbtc.diagnostics import BbtcError

# What Ninja takes for a part of a name; of those, `[` is a pattern for Make.
_TAKEN = re.compile(r"(?:[A-Za-z0-9!#$%()+,./:=@\\\]_{}~ -]|[^\x00-\x7f])+")
_SPECIAL = re.compile(r"[ #:]")
_REFUSED = (
    re.compile(r"\\(?![A-Za-z0-9_.])"),  # could be taken for the escape of what follows
    re.compile(r"^~"),  # a home folder
    re.compile(r"^[:+!]*="),  # an assignment
    re.compile(r"[: ]$|^ "),
    re.compile(r"\)$"),  # a member of an archive
)
_REFUSED_AS_TARGET = re.compile(r"[%=]|^\.[A-Z_]+$|^-$")  # a pattern, a variable, a special target
_WORDS = frozenset(("define", "endef", "export", "override", "private", "undefine", "unexport"))


def depfile(target: str, inputs: Iterable[str]) -> bytes:
    """The rule. Raises :class:`BbtcError` for a name that it cannot hold."""
    names = [name for name in inputs if name != "-"]
    # Not so the first one: `target: name=...` sets a variable.
    names.sort(key=lambda name: "=" in name or name in _WORDS)
    if names and any("=" in name for name in names) and ("=" in names[0] or names[0] in _WORDS):
        raise _refused(next(name for name in names if "=" in name))
    if _REFUSED_AS_TARGET.search(target) or target in _WORDS:
        raise _refused(target)
    return os.fsencode(f"{_spelt(target)}: {' '.join(map(_spelt, names))}\n")


def _spelt(name: str) -> str:
    name = name.replace(os.sep, "/")
    if not _TAKEN.fullmatch(name) or any(pattern.search(name) for pattern in _REFUSED):
        raise _refused(name)
    return _SPECIAL.sub(r"\\\g<0>", name.replace("$", "$$"))


def _refused(name: str) -> BbtcError:
    return BbtcError.single(
        "BBT0010",
        f"a depfile cannot hold the name {name}: Make or Ninja would read something else",
        hint="rename the file, or leave --depfile out",
    )
