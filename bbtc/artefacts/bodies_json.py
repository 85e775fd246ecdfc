"""Bodies of templates as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.artefacts.conditions import condition_to_json
from bbtc.artefacts.cursor import At
from bbtc.artefacts.jsontext import Path
from bbtc.diagnostics import Diagnostic
from bbtc.ground.task import Body, BodyAction, BodyCondition, BodyControl, BodyTemplate, Variable
from bbtc.tree.validate import MAX_DEPTH

Json: TypeAlias = dict[str, object]


def body_to_json(body: Body, variables: Sequence[Variable]) -> Json:
    """A body as a JSON object."""
    match body:
        case BodyControl(kind, children, attempts):
            counted = {} if attempts is None else {"attempts": attempts}
            inner = [body_to_json(child, variables) for child in children]
            return {"type": kind, **counted, "children": inner}
        case BodyCondition(condition):
            return {"type": "condition", "condition": condition_to_json(condition, variables)}
        case BodyAction(action):
            return {"type": "action", "action": action}
        case BodyTemplate(template):
            return {"type": "template", "template": template}
        case _:
            assert_never(body)


def at_node(problem: Diagnostic, root: Path) -> Diagnostic:
    """A broken rule of a tree or body with the path to its node in JSON."""
    steps = (step for number in problem.path for step in ("children", number))
    return replace(problem, path=(*root, *steps))


def kind_at(at: At, *kinds: str) -> str:
    """The type of a node."""
    for name, value in at.entries():
        if name == "type":
            return value.word(*kinds)
    raise at.fault("BBT0603", "field 'type' is missing")


def children_at(at: At, level: int) -> list[At]:
    """The children of a control node that stands at a level, the root's being 1."""
    children = at.elements()
    if level >= MAX_DEPTH and children:
        raise at.fault("BBT0605", f"a tree has at most {MAX_DEPTH} levels")
    return children
