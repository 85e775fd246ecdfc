"""Exporters ``json`` and ``yaml``: the tree artefact itself, for other programs.

They stand here because artefacts come after the other exporters in the order of the stages.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from bbtc.artefacts.jsontext import dumps
from bbtc.artefacts.tree_json import tree_to_json
from bbtc.backends.exporter import Figures, Option, OptionValue
from bbtc.diagnostics import BbtcError
from bbtc.tree.nodes import Tree

_NUMBER = re.compile(r"[-+]?(?:0[box]|[.0-9])[.0-9a-f_:]*(?:e[-+]?[0-9]+)?", re.IGNORECASE)
"""What a reader of YAML 1.1 or 1.2 might take for a number."""


@dataclass(frozen=True, slots=True)
class JsonExporter:
    """What ``bbtc plan`` writes. Deterministic."""

    name: str = "json"
    description: str = "the tree artefact: what plan writes and simulate reads"
    suffix: str = ".json"
    options: tuple[Option, ...] = ()

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> str:  # noqa: ARG002
        """The tree as canonical JSON."""
        return dumps(tree_to_json(tree))


@dataclass(frozen=True, slots=True)
class YamlExporter:
    """The fields of the JSON artefact, in its order, as YAML. Deterministic."""

    name: str = "yaml"
    description: str = "the tree artefact as YAML"
    suffix: str = ".yaml"
    options: tuple[Option, ...] = ()

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> str:  # noqa: ARG002
        """The tree as YAML that any safe loader of YAML 1.1 or 1.2 reads. Raises :class:`BbtcError` for
        a tree that is too deep for the YAML library."""
        import yaml

        class Dumper(yaml.SafeDumper):
            """No anchors: what stands twice is written twice. Quotes where a text needs them."""

            def ignore_aliases(self, data: object) -> bool:  # noqa: ARG002
                return True

            def represent_text(self, data: str) -> yaml.ScalarNode:
                # Between double quotes the library escapes what a reader would take for an end of a line.
                style = '"' if not data.isprintable() else "'" if _NUMBER.fullmatch(data) else None
                return self.represent_scalar("tag:yaml.org,2002:str", data, style)

        Dumper.add_representer(str, Dumper.represent_text)
        try:
            text: str = yaml.dump(
                tree_to_json(tree), Dumper=Dumper, allow_unicode=True, sort_keys=False, width=100
            )
        except RecursionError:
            raise BbtcError.single(
                "BBT0705", "the tree is too deep for YAML", hint="export to json"
            ) from None
        return text


json_format = JsonExporter()
yaml_format = YamlExporter()
