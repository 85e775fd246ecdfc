"""Bodies of templates as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.artefacts.conditions import condition_to_json
from bbtc.ground.task import Body, BodyAction, BodyCondition, BodyControl, BodyTemplate, Variable

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
