"""Files that bbtc begins and people fill in: they are written once. What the tree asks of such a file is
compared with what it offers, so that people hear of a change, and find beside it how it would begin now."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass

from bbtc.backends.pytrees.parts import can_be_unknown, is_summary
from bbtc.diagnostics import Diagnostic

BESIDE = ".new"
"""What the name of a file that is filled in gets for what it would be now."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a text that begins a file goes: to ``path``, or nowhere (None). ``warning`` tells of a file that
    does not offer what the tree asks for."""

    path: str | None
    warning: Diagnostic | None = None


def place_of(path: str, old: bytes | None, new: bytes, *, shown: str = "", check: bool = False) -> Place:
    """Where the text ``new`` goes that begins the file ``path``, which holds ``old`` (None: there is none)
    and which messages call ``shown``. What differs from it may be somebody's work and is never written over;
    with ``check`` it is no drift."""
    if old is None or old == new:
        return Place(path)
    changes = interface_changes(path, old, new)
    if not changes:
        return Place(None)
    name = shown or path
    message = f"{name} is yours and stays as it is, but it does not fit the tree: {'; '.join(changes)}"
    hint = f"{name}{BESIDE} is how it would begin now: take over what you need, and delete it"
    if check:
        hint = f"without --check, {name}{BESIDE} is made: how it would begin now"
    warning = Diagnostic("BBT1012", message, hint=hint)
    return Place(None if check else path + BESIDE, warning)


def interface_changes(path: str, old: bytes, new: bytes) -> list[str]:
    """What the tree asks of a file that begins as ``new`` today and ``old`` does not offer, in words. Empty
    where it fits, and for files of which nothing is asked."""
    read = {".py": _python, ".hpp": _cpp}.get(path[path.rfind(".") :])
    if read is None:
        return []
    wanted = read(new.decode())
    try:
        offered = read(old.decode())
    except (SyntaxError, ValueError, RecursionError):
        return ["it cannot be read, so what it offers is not known"]
    asked, has = wanted.offers, offered.offers
    lacks = (
        [] if offered.more else [asked[name].words for name in asked if asked[name].begun and name not in has]
    )
    gone = [has[name].words for name in has if has[name].begun and name not in asked]
    other = [asked[name].words for name in asked if name in has and has[name].differs(asked[name])]
    found = (("it lacks", lacks), ("other than it was is", other), ("no longer used is", gone))
    changes = [f"{words} {', '.join(names)}" for words, names in found if names]
    if offered.module not in ("", wanted.module):
        changes.append(f"it imports {offered.module}, but the module of the tree is {wanted.module}")
    return changes


@dataclass(frozen=True, slots=True)
class _Offer:
    """A method or node. ``takes`` are its parameters (None: any); ``unknown``, whether it can answer so
    (None: it does not say); ``begun``, whether bbtc began it."""

    name: str
    takes: tuple[str, ...] | None
    unknown: bool | None = None
    begun: bool = False
    by_name: bool = False
    """Whether the names of the parameters matter, and not their number only."""

    @property
    def words(self) -> str:
        """For people."""
        return f"{self.name}({', '.join(self.takes or ())}){', which can be unknown' if self.unknown else ''}"

    def differs(self, other: _Offer) -> bool:
        """Is it not what the other one is?"""
        if None not in (self.unknown, other.unknown) and self.unknown != other.unknown:
            return True
        if self.takes is None or other.takes is None:
            return False
        if self.by_name:
            return set(self.takes) != set(other.takes)
        return len(self.takes) != len(other.takes)


@dataclass(frozen=True, slots=True)
class _Interface:
    """What a file offers, by name; ``module`` is where it imports the tree from, and ``more`` tells that it
    may inherit what is not seen here."""

    offers: dict[str, _Offer]
    module: str = ""
    more: bool = False


# --- Python ----------------------------------------------------------------------------------

_TREE = frozenset(("Robot", "create_root"))
"""What a robot imports from the module of its tree."""


def _python(text: str) -> _Interface:
    """The public methods of the classes of a module."""
    offers: dict[str, _Offer] = {}
    module, more = "", False
    parsed = ast.parse(text)
    classes = [node for node in ast.walk(parsed) if isinstance(node, ast.ClassDef)]
    known = {"object", "Protocol", *_TREE, *(each.name for each in classes)}
    for each in classes:
        more = more or any(ast.unparse(base) not in known for base in each.bases)
        for offer in _members(each):
            more = more or offer.name == "__getattr__"
            if not offer.name.startswith("_"):
                offers[offer.name] = offer
    for node in ast.walk(parsed):
        if isinstance(node, ast.ImportFrom) and _TREE & {alias.name for alias in node.names}:
            module = "." * node.level + (node.module or "")
    return _Interface(offers, module, more)


def _members(each: ast.ClassDef) -> Iterator[_Offer]:
    """The methods and attributes of a class."""
    for node in each.body:
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                yield _method(node)
            case ast.Assign(targets=targets):
                yield from (_Offer(target.id, None) for target in targets if isinstance(target, ast.Name))
            case ast.AnnAssign(target=ast.Name(id=name)):
                yield _Offer(name, None)
            case _:
                pass


def _method(node: ast.FunctionDef | ast.AsyncFunctionDef) -> _Offer:
    args = node.args
    names = tuple(parameter.arg for parameter in (*args.posonlyargs, *args.args))[1:]
    summary = (ast.get_docstring(node) or "").partition("\n")[0]
    begun = is_summary(summary)
    plain = args.vararg is None and not args.defaults and not node.decorator_list
    return _Offer(node.name, names if plain else None, can_be_unknown(summary) if begun else None, begun)


# --- C++ -------------------------------------------------------------------------------------

_CPP = re.compile(
    r"^class (?P<name>\w+)"
    r'|InputPort<[^>]*>\(\s*"(?P<port>[^"\\\n]*)"'
    r'|registerNodeType<(?P<registered>\w+)>\(\s*"(?P<id>[^"\\\n]*)"',
    re.MULTILINE,
)


def _cpp(text: str) -> _Interface:
    """The nodes that a header registers, with their ports."""
    ports: dict[str, list[str]] = {}
    offers: dict[str, _Offer] = {}
    current: list[str] = []
    for match in _CPP.finditer(text):
        if match["name"] is not None:
            current = ports.setdefault(match["name"], [])
        elif match["port"] is not None:
            current.append(match["port"])
        else:
            takes = tuple(ports.get(match["registered"], ()))
            offers[match["id"]] = _Offer(match["id"], takes, begun=True, by_name=True)
    return _Interface(offers)
