"""The exporters: the built-in ones, and plugins.

A built-in is named in :data:`BUILT_INS` and imported when it is used. Another package adds a format
by an entry point of the group ``bbtc.exporters`` that loads an object of the protocol
:class:`~bbtc.backends.exporter.Exporter`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from bbtc.backends.exporter import Artefact, Exporter, Figures, Files, Option, OptionValue
from bbtc.diagnostics import BbtcError
from bbtc.files.read_write import relative_parts
from bbtc.tree.nodes import Tree

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "bbtc.exporters"

BUILT_INS: Mapping[str, str] = MappingProxyType(
    {
        "dot": "bbtc.backends.pictures.graphviz:dot",
        "svg": "bbtc.backends.pictures.graphviz:svg",
        "png": "bbtc.backends.pictures.graphviz:png",
        "btcpp": "bbtc.backends.btcpp.exporter:btcpp",
        "btcpp_palette": "bbtc.backends.btcpp.palette:btcpp_palette",
        "btcpp_project": "bbtc.backends.btcpp.project:btcpp_project",
        "py_trees": "bbtc.backends.pytrees.exporter:py_trees",
        "py_trees_robot": "bbtc.backends.pytrees.robot:py_trees_robot",
        "prism": "bbtc.backends.models.prism:prism",
        "jani": "bbtc.backends.models.jani:jani",
        "mermaid": "bbtc.backends.pictures.mermaid:mermaid",
        "text": "bbtc.backends.pictures.text:text",
        "json": "bbtc.backends.data:json_format",
        "yaml": "bbtc.backends.data:yaml_format",
    }
)


def format_names() -> tuple[str, ...]:
    """Every format that can be asked for: built-ins in their order, then plugins by name."""
    return tuple(dict.fromkeys([*BUILT_INS, *sorted(point.name for point in plugins())]))


def load_exporter(name: str) -> Exporter:
    """The exporter of a format, imported now. Raises :class:`BbtcError` for an unknown format,
    for a name that two exporters claim, and for a plugin that does not load."""
    claims = [point for point in plugins() if point.name == name]
    owners = sorted({point.value for point in claims} | ({BUILT_INS[name]} if name in BUILT_INS else set()))
    if len(owners) > 1:
        raise BbtcError.single(
            "BBT0702",
            f"{len(owners)} exporters claim the format '{name}': {', '.join(owners)}",
            hint="uninstall all of them but one",
        )
    if name in BUILT_INS:
        module, attribute = BUILT_INS[name].split(":")
        exporter: object = getattr(import_module(module), attribute)
    elif claims:
        exporter = _load_plugin(claims[0])
    else:
        raise BbtcError.single(
            "BBT0701", f"unknown export format '{name}'", hint=_nearest(name, format_names())
        )
    if not isinstance(exporter, Exporter):
        raise BbtcError.single(
            "BBT0703", f"the plugin for the format '{name}' is not an exporter: {owners[0]}"
        )
    return exporter


def run_exporter(
    exporter: Exporter,
    form: str,
    tree: Tree,
    options: Mapping[str, OptionValue],
    figures: Figures | None,
) -> Artefact:
    """What an exporter makes. Raises :class:`BbtcError` where it refuses the tree, and where one of another
    package fails, or makes what cannot be written."""
    if form in BUILT_INS:
        return exporter.export(tree, options, figures)
    try:
        artefact: object = exporter.export(tree, options, figures)
        return _written(artefact)
    except BbtcError:
        raise
    except Exception as error:  # whatever a stranger's exporter raises is its failure, not ours
        raise _failed(form, f"{type(error).__name__}: {error}") from error


def _written(artefact: object) -> Artefact:
    """The artefact, if it can be written. Raises ``TypeError`` and ``ValueError``."""
    match artefact:
        case str():
            artefact.encode()
        case Files():
            for name, text in artefact.texts.items():
                relative_parts(name)
                text.encode()
        case bytes():
            pass
        case _:
            raise TypeError(f"it made {type(artefact).__name__}, which is no artefact")
    return artefact


def _failed(form: str, why: str) -> BbtcError:
    named = form
    for point in plugins():
        if point.name == form:
            package = f" of {point.dist.name} {point.dist.version}" if point.dist is not None else ""
            named = f"{form} ({point.value}{package})"
    hint = "this is a fault of the package that brings the exporter, not of bbtc: report it there"
    return BbtcError.single("BBT0703", f"the exporter {named} failed: {why}", hint=hint)


def parse_options(exporter: Exporter, texts: Mapping[str, str]) -> dict[str, OptionValue]:
    """Options given as text (``key=value`` on a command line), typed, with the defaults filled in.
    Raises :class:`BbtcError` for a name or a value that the exporter does not declare."""
    declared = {option.name: option for option in exporter.options}
    for key in texts:
        if key not in declared:
            raise BbtcError.single(
                "BBT0704",
                f"format '{exporter.name}' has no option '{key}'",
                hint=_nearest(key, tuple(declared)),
            )
    return {
        option.name: _parse_value(exporter.name, option, texts[option.name])
        if option.name in texts
        else option.default
        for option in exporter.options
    }


def files_read(exporter: Exporter, texts: Mapping[str, str], folder: str | Path = "") -> list[str]:
    """The files that options of a format name, relative to a folder, and those that are read for them."""
    given = [(option, texts.get(option.name)) for option in exporter.options]
    return [
        path
        for option, text in given
        if option.reads and text
        for path in option.reads(str(Path(folder, text)))
    ]


def with_paths(
    form: str, texts: Iterable[tuple[str, str]], place: Callable[[str], str]
) -> tuple[tuple[str, str], ...]:
    """Options of a format in which every name of a file is replaced by where it is."""
    files = {option.name for option in load_exporter(form).options if option.reads}
    return tuple((name, place(text) if name in files and text else text) for name, text in texts)


def _parse_value(format_name: str, option: Option, text: str) -> OptionValue:
    if isinstance(option.default, bool):
        allowed = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}
        if text.lower() in allowed:
            return allowed[text.lower()]
        expected = "true or false"
    elif isinstance(option.default, int):
        if text.removeprefix("-").isdecimal() and text.isascii() and len(text) <= 18:
            return int(text)
        expected = "a whole number"
    elif not option.choices or text in option.choices:
        return text
    else:
        expected = " or ".join(option.choices)
    raise BbtcError.single(
        "BBT0704", f"option '{option.name}' of format '{format_name}' must be {expected}, not '{text}'"
    )


@cache
def plugins() -> tuple[EntryPoint, ...]:
    """What other packages bring. It is looked up once: to look through all that is installed takes long, and
    a build asks for every export; ``plugins.cache_clear()`` has it looked up again."""
    from importlib.metadata import entry_points

    return tuple(entry_points(group=GROUP))


def _load_plugin(point: EntryPoint) -> object:
    try:
        return point.load()
    except Exception as error:  # whatever a stranger's module raises at import is its failure, not ours
        raise BbtcError.single(
            "BBT0703", f"the plugin for the format '{point.name}' does not load: {point.value}: {error}"
        ) from error


def _nearest(name: str, known: tuple[str, ...]) -> str:
    from difflib import get_close_matches

    near = get_close_matches(name, known, n=1)
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known) or 'none'}"
