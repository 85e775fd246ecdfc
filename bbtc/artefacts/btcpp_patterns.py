"""The idioms of exported BehaviorTree.CPP files (:mod:`bbtc.export.btcpp_idioms`), recognised again."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from bbtc.artefacts.xmltext import XmlElement
from bbtc.export.btcpp_idioms import LATCH, SKIPPER

_KINDS = ("Action", "Condition", "Control", "Decorator")
_SET = re.compile(r"(@?\w+) := (\d+)")
_CLEARED = re.compile(r"(@\w+) := false")
_RAISED = re.compile(r"@\w+ := true(?:; _started := 'yes')?")
_LEFT = re.compile(r"@?\w+ > 0(?: && @?\w+ > 0)*")
_USED = re.compile(r"@?\w+ -= 1(?:; @?\w+ -= 1)*")
_WORD = re.compile(r"@?[A-Za-z_]\w*")


def tag_of(element: XmlElement) -> str:
    """The id of a node; ``<Action ID="Detect"/>`` is another spelling of ``<Detect/>``."""
    if element.tag in _KINDS and "ID" in element.attributes:
        return element.attributes["ID"]
    return element.tag


def has(element: XmlElement, tag: str, children: int | None = None, **attributes: str) -> bool:
    """Whether an element has this tag, these values, and this many children."""
    return (
        tag_of(element) == tag
        and (children is None or len(element.children) == children)
        and all(element.attributes.get(name) == value for name, value in attributes.items())
    )


def is_skipper(element: XmlElement) -> bool:
    """Our node Skipper, or a Parallel that ends with the first child to end."""
    return has(element, SKIPPER) or has(element, "Parallel", success_count="1", failure_count="1")


def inside_until_blocked(element: XmlElement) -> XmlElement | None:
    """The tree in the guard against endless ticking; None if this is none."""
    if not is_skipper(element) or len(element.children) != 2:
        return None
    ticked, blocked = element.children
    if not has(ticked, "ReactiveSequence", 2) or not has(ticked.children[0], "Script"):
        return None
    cleared = _CLEARED.fullmatch(ticked.children[0].attributes.get("code", ""))
    if cleared is None or not has(blocked, "Precondition", 1, **{"if": f"!{cleared.group(1)}"}):
        return None
    return ticked.children[1]


def retry_of(element: XmlElement) -> tuple[str, int, XmlElement] | None:
    """Counter, attempts and child of a retry node; None if this is none."""
    if not has(element, "ReactiveSequence", 2):
        return None
    once = element.children[0]
    if not has(once, "RunOnce", 1, then_skip="false"):
        return None
    script = once.children[0]
    found = _SET.fullmatch(script.attributes.get("code", "")) if has(script, "Script", 0) else None
    if found is None or len(found.group(2)) > 6:
        return None
    return found.group(1), int(found.group(2)), element.children[1]


@dataclass(frozen=True, slots=True)
class ActionParts:
    """What an action idiom is made of: its leaf, what must be true before it starts, the counters of
    attempts it uses, and whether it keeps its status."""

    leaf: XmlElement
    guards: tuple[XmlElement, ...]
    counters: tuple[str, ...]
    latched: bool


def action_of(element: XmlElement) -> ActionParts | None:
    """The parts of an action idiom; None if this is none."""
    if has(element, LATCH):
        if not element.children or element.attributes.get("keep", "true") not in ("true", "false", "1", "0"):
            return None
        keep = element.attributes.get("keep", "true") in ("true", "1")
        return _parts(element.children[-1], element.children[:-1], keep)
    if has(element, "Switch2", 3, variable="{_latch}", case_1="success", case_2="failure"):
        return _latched(element.children)
    if has(element, "ReactiveSequence", 2):
        leaf = _running(element, ("", "", ""))
        return None if leaf is None else ActionParts(leaf, (), (), latched=False)
    if has(element, "ReactiveSequence", 3):
        return _unlatched(element)
    return None


def _latched(children: Sequence[XmlElement]) -> ActionParts | None:
    if not has(children[0], "AlwaysSuccess") or not has(children[1], "AlwaysFailure"):
        return None
    events = ("_latch := 'success'", "_latch := 'failure'", "_latch := 'success'")
    leaf = _running(children[2], events)
    if leaf is not None:
        return ActionParts(leaf, (), (), latched=True)
    if not has(children[2], "Sequence") or not children[2].children:
        return None
    *needed, last = children[2].children
    leaf = _running(last, events)
    return None if leaf is None else _parts(leaf, needed, latched=True)


def _unlatched(element: XmlElement) -> ActionParts | None:
    ready, *rest = element.children
    leaf = _running(XmlElement(element.tag, {}, element.start, rest), ("_started := 'no'",) * 3)
    if leaf is None or not has(ready, "Switch2", 3, variable="{_started}", case_1="yes", case_2="never"):
        return None
    needed = [ready.children[2]]
    if has(needed[0], "ReactiveSequence") and "name" not in needed[0].attributes and needed[0].children:
        last = needed[0].children[-1]
        if has(last, "Script") and _USED.fullmatch(last.attributes.get("code", "")):
            needed = needed[0].children
    return _parts(leaf, needed, latched=False)


def _running(element: XmlElement, events: tuple[str, str, str]) -> XmlElement | None:
    """The action under what sets the flag and withholds the status."""
    if not has(element, "ReactiveSequence", 2) or not has(element.children[0], "Script", 0):
        return None
    keep = element.children[1]
    if not _RAISED.fullmatch(element.children[0].attributes.get("code", "")):
        return None
    if not has(keep, "KeepRunningUntilFailure", 1) or not has(keep.children[0], "ForceSuccess", 1):
        return None
    leaf = keep.children[0].children[0]
    wanted = zip(("_onSuccess", "_onFailure", "_onHalted"), events, strict=True)
    return leaf if all(leaf.attributes.get(event, "") == script for event, script in wanted) else None


def _parts(leaf: XmlElement, needed: Sequence[XmlElement], latched: bool) -> ActionParts:
    """Splits what stands before an action into guards and the counting of attempts."""
    if len(needed) >= 2 and has(needed[-2], "ScriptCondition", 0) and has(needed[-1], "Script", 0):
        left, used = (part.attributes.get("code", "") for part in needed[-2:])
        counters = _counters(left)
        if _LEFT.fullmatch(left) and _USED.fullmatch(used) and counters == _counters(used):
            return ActionParts(leaf, tuple(needed[:-2]), counters, latched)
    return ActionParts(leaf, tuple(needed), (), latched)


def _counters(script: str) -> tuple[str, ...]:
    return tuple(_WORD.findall(script))


def known_test(element: XmlElement) -> tuple[bool, XmlElement] | None:
    """Whether a test asks for known (or for unknown), and the leaf it tests; None if this is none."""
    if not is_skipper(element) or len(element.children) != 2:
        return None
    forced, otherwise = element.children
    if has(forced, "ForceSuccess", 1) and has(otherwise, "AlwaysFailure", 0):
        return True, forced.children[0]
    if has(forced, "ForceFailure", 1) and has(otherwise, "AlwaysSuccess", 0):
        return False, forced.children[0]
    return None


def inside_register(element: XmlElement) -> XmlElement | None:
    """The Parallel whose result an entry of the blackboard holds; None if this is none."""
    if not has(element, "ReactiveSequence", 2) or not is_skipper(element.children[0]):
        return None
    read, answer = element.children
    if len(read.children) != 2 or not has(read.children[0], "ForceSuccess", 1):
        return None
    written = has(read.children[1], "Script", 0, code="_value := 'unknown'")
    asked = has(answer, "Precondition", 1, **{"if": "_value != 'unknown'", "else": "RUNNING"})
    if not written or not asked or not has(answer.children[0], "ScriptCondition", 0, code="_value == 'true'"):
        return None
    condition = read.children[0].children[0]
    stored = (condition.attributes.get("_onSuccess"), condition.attributes.get("_onFailure"))
    return condition if stored == ("_value := 'true'", "_value := 'false'") else None
