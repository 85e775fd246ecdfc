"""The idioms of exported BehaviorTree.CPP files (:mod:`bbtc.backends.btcpp.idioms`), recognised again."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from bbtc.backends.btcpp.idioms import (
    COMMITTED,
    HELD,
    HOLD_LABEL,
    LATCH,
    RESULT,
    SKIPPER,
    TIMEOUT,
    UNTIL_SUCCESS,
    WHILE,
)
from bbtc.backends.btcpp.reader.shapes import (
    Hole,
    Holes,
    Match,
    Pattern,
    Shape,
    Value,
    boolean_of,
    has,
    match,
)
from bbtc.backends.btcpp.xmltext import XmlElement

_COUNTER = r"@[A-Za-z_]\w*"
_LEFT = re.compile(rf"{_COUNTER} > 0(?: && {_COUNTER} > 0)*")
_USED = re.compile(rf"{_COUNTER} -= 1(?:; {_COUNTER} -= 1)*")
_WORD = re.compile(_COUNTER)
_NAME = re.compile(r"[A-Za-z_]\w*")


def _script(code: Value) -> Shape:
    return Shape("Script", {"code": code})


def _running(script: Value, leaf: Hole, *first: Shape) -> Shape:
    kept = Shape("KeepRunningUntilFailure", {}, (Shape("ForceSuccess", {}, (leaf,)),))
    return Shape("ReactiveSequence", {}, (*first, _script(script), kept))


_RUNNING = rf"(?P<running>{_COUNTER})"
_FLAG = rf"@(?P<flag>{_NAME.pattern})"
_SUCCESS, _FAILURE = Shape("AlwaysSuccess", {}), Shape("AlwaysFailure", {})
_EVENTS = ("_onSuccess", "_onFailure", "_onHalted")
_UNKNOWN = Shape("KeepRunningUntilFailure", {}, (_SUCCESS,))

_ENDED = rf"(?P<ended>{_COUNTER})"
_FREE = Pattern(re.compile(rf"!@(?P<flag>{_NAME.pattern})"), "!@acting")
_ONCE = Shape(
    "RunOnce",
    {"then_skip": "false"},
    (_script(Pattern(re.compile(rf"{_RUNNING} := false"), "@x_running := false")),),
)
_LIVE = Shape(
    "Precondition",
    {"if": Pattern(re.compile(rf"!{_RUNNING}"), "!@x_running"), "else": "SUCCESS"},
    (
        _script(
            Pattern(re.compile(rf"(?P<live>{_COUNTER} := 'live'(?:; {_COUNTER} := 'live')*)"), "@x := 'live'")
        ),
    ),
)
_BLOCKED = Shape("Precondition", {"if": _FREE, "else": "RUNNING"}, (_FAILURE,))


def _committed(*live: Shape) -> Shape:
    begins = Pattern(re.compile(rf"@(?P<flag>{_NAME.pattern}) := {_RUNNING}"), "@acting := @x_running")
    ends: dict[str, Value] = {
        event: Pattern(re.compile(rf"{_ENDED} := '{status}'"), f"@x_ended := '{status}'")
        for event, status in (("_onSuccess", "success"), ("_onFailure", "failure"))
    }
    told = Shape(
        "ScriptCondition", {"code": Pattern(re.compile(rf"{_ENDED} == 'success'"), "@x_ended == 'success'")}
    )
    ticked = Shape(
        "ReactiveSequence",
        {},
        (
            _ONCE,
            *live,
            _script(begins),
            Shape("ForceSuccess", {}, (Hole("tree", ends),)),
            Shape("Precondition", {"if": _FREE, "else": "RUNNING"}, (told,)),
        ),
    )
    return Shape(SKIPPER, {}, (ticked, _BLOCKED))


UNTIL_BLOCKED = (_committed(_LIVE), _committed(), Shape(COMMITTED, {}, (Hole("tree"),)))
"""The tree, and FAILURE where it is running and no action is; RUNNING where it has passed one by."""

GATE = Shape("Precondition", {"if": _FREE, "else": "RUNNING"}, (_SUCCESS,))
"""Nothing starts where an action was running when the tick began."""

_ENTRY_IN_PORT = Pattern(re.compile(rf"\{{(?P<held>@?{_NAME.pattern})\}}"), "{held}")
HELD_LEAF = (
    Shape(
        "Switch3",
        {"variable": _ENTRY_IN_PORT, "case_1": "true", "case_2": "false", "case_3": "unknown"},
        (_SUCCESS, _FAILURE, _UNKNOWN, Hole("leaf")),
    ),
    Shape(HELD, {}, (Hole("leaf"),)),
)
"""A leaf whose fact may be held, in an entry of the blackboard or by our node."""


def _noted(value: str) -> Pattern:
    return Pattern(re.compile(rf"(?P<held>@?{_NAME.pattern}) := '{value}'"), f"held := '{value}'")


NOTE = Shape(
    "ForceSuccess",
    {},
    (
        Shape(
            SKIPPER,
            {},
            (
                Hole("leaf", {"_onSuccess": _noted("true"), "_onFailure": _noted("false")}),
                _script(_noted("unknown")),
            ),
        ),
    ),
)
"""Writes what a leaf reads to the entry of its fact."""

NOT_COMMITTED = Shape(
    SKIPPER,
    {},
    (
        Shape(
            "ReactiveSequence",
            {},
            (
                _script(Pattern(re.compile(rf"@(?P<flag>{_NAME.pattern}) := false"), "@acting := false")),
                Hole("tree"),
            ),
        ),
        _BLOCKED,
    ),
)
"""The same of files in which nothing is held while an action runs."""

RETRY = Shape(
    "ReactiveSequence",
    {},
    (
        Shape(
            "RunOnce",
            {"then_skip": "false"},
            (
                _script(
                    Pattern(re.compile(rf"(?P<counter>{_COUNTER}) := (?P<attempts>[0-9]{{1,6}})"), "@x := 3")
                ),
            ),
        ),
        Hole("child"),
    ),
)
"""A node below which every action uses up an attempt."""

_ENTRY = rf"(?P<entry>_latch|{_COUNTER})"


def _state(relation: str, word: str) -> Pattern:
    code = f"{relation} '{word}'"
    return Pattern(re.compile(rf"(?P<state>{_COUNTER}) {code}"), f"@x {code}")


_NEW = _state(":=", "new")
TRIED = Shape(
    "ReactiveSequence",
    {},
    (
        Shape("RunOnce", {"then_skip": "false"}, (_script(_NEW),)),
        Shape(
            UNTIL_SUCCESS,
            {"num_attempts": Pattern(re.compile("(?P<attempts>[1-9][0-9]{0,5})"), "3")},
            (
                Shape(
                    "ReactiveFallback",
                    {},
                    (
                        Shape(
                            SKIPPER,
                            {},
                            (
                                Hole("child"),
                                Shape("KeepRunningUntilFailure", {}, (_script(_state(":=", "begun")),)),
                            ),
                        ),
                        Shape(
                            "ScriptCondition",
                            {"code": _state("==", "new"), "_onSuccess": _state(":=", "hopeless")},
                        ),
                    ),
                ),
            ),
        ),
        Shape(
            "ScriptCondition",
            {"code": _state("!=", "hopeless"), "_onSuccess": _NEW, "_onFailure": _NEW},
        ),
    ),
)
"""A node that tries its child again; scripts of the ReactiveFallback make all below forget."""

_SWITCH: dict[str, Value] = {
    "variable": Pattern(re.compile(rf"\{{{_ENTRY}\}}"), "{_latch}"),
    "case_1": "success",
    "case_2": "failure",
}


_GOES_ON = Shape(
    "ReactiveFallback",
    {},
    (
        Shape("ScriptCondition", {"code": Pattern(re.compile(rf"!{_RUNNING}"), "!@x_running")}),
        Hole("during"),
        _UNKNOWN,
    ),
)
"""Halts an action that runs where a condition is no longer true."""


_Forms: TypeAlias = tuple[tuple[Shape, str | None], ...]
"""Shapes of the same elements, with the entry that an action keeps its status in."""


def _actions(*first: Shape, committed: bool) -> tuple[_Forms, ...]:
    """The forms of actions. Where the tree is ``committed`` to actions, they tell when they run."""

    def tells(script: str, example: str, value: str) -> Pattern:
        if committed:
            return Pattern(
                re.compile(rf"{script}; {_RUNNING} := {value}"), f"{example}; @x_running := {value}"
            )
        return Pattern(re.compile(script), example)

    def ends(entry: str, example: str, statuses: tuple[str, str, str]) -> dict[str, Value]:
        return {
            event: tells(f"{entry} := '{status}'", f"{example} := '{status}'", "false")
            for event, status in zip(_EVENTS, statuses, strict=True)
        }

    begins = tells(f"{_FLAG} := true", "@acting := true", "true")
    started = Pattern(
        re.compile(f"{begins.pattern.pattern}; _started := 'yes'"), f"{begins.example}; _started := 'yes'"
    )
    ended = ends(_ENTRY, "_latch", ("success", "failure", "success"))
    timed = Pattern(
        re.compile(f"{begins.pattern.pattern}; (?P<result>{RESULT}) := 'success'"),
        f"{begins.example}; {RESULT} := 'success'",
    )
    told = {"_onSuccess": tells(f"{_ENTRY} := {RESULT}", f"_latch := {RESULT}", "false")}
    once = [
        _running(begins, Hole("leaf", ended), *first),
        _running(timed, Hole("leaf", {**ended, **told}), *first),
    ]
    again = _running(started, Hole("leaf", ends("_started", "_started", ("no", "no", "no"))), *first)
    ready: dict[str, Value] = {"variable": "{_started}", "case_1": "yes", "case_2": "never"}
    latched: list[_Forms] = [
        tuple((Shape("Switch2", _SWITCH, (_SUCCESS, _FAILURE, last)), "_latch") for last in lasts)
        for lasts in (once, [Shape("Sequence", {}, (Holes("needed"), shape)) for shape in once])
    ]
    repeated = Shape(
        "ReactiveSequence",
        {},
        (Shape("Switch2", ready, (_SUCCESS, _FAILURE, Hole("ready"))), *again.children),
    )
    return (*latched, ((_running(begins, Hole("leaf")), None),), ((repeated, "_started"),))


_ACTIONS = (
    *_actions(_GOES_ON, committed=True),
    *(one + other for one, other in zip(_actions(committed=True), _actions(committed=False), strict=True)),
)

KNOWN = Shape(SKIPPER, {}, (Shape("ForceSuccess", {}, (Hole("leaf"),)), _FAILURE))
UNKNOWN = Shape(SKIPPER, {}, (Shape("ForceFailure", {}, (Hole("leaf"),)), _SUCCESS))
"""Tests for whether what a leaf reads is known, or unknown."""

REGISTER = Shape(
    "ReactiveSequence",
    {},
    (
        Shape(
            SKIPPER,
            {},
            (
                Shape(
                    "ForceSuccess",
                    {},
                    (
                        Hole(
                            "condition", {"_onSuccess": "_value := 'true'", "_onFailure": "_value := 'false'"}
                        ),
                    ),
                ),
                _script("_value := 'unknown'"),
            ),
        ),
        Shape(
            "Precondition",
            {"if": "_value != 'unknown'", "else": "RUNNING"},
            (Shape("ScriptCondition", {"code": "_value == 'true'"}),),
        ),
    ),
)
"""A Parallel whose result an entry of the blackboard holds."""


def _tags(shape: Shape) -> Iterator[str]:
    yield shape.tag
    for child in shape.children:
        if isinstance(child, Shape):
            yield from _tags(child)


READ = frozenset(
    (
        "ReactiveSequence",
        "ReactiveFallback",
        "Parallel",
        "SubTree",
        "Inverter",
        "ScriptCondition",
        LATCH,
        TIMEOUT,
        WHILE,
    )
).union(
    *(
        _tags(shape)
        for shape in (
            *UNTIL_BLOCKED,
            NOT_COMMITTED,
            GATE,
            *HELD_LEAF,
            NOTE,
            RETRY,
            TRIED,
            KNOWN,
            UNKNOWN,
            REGISTER,
            *(shape for forms in _actions(committed=True) for shape, _ in forms),
        )
    )
)
"""The nodes that mean something in some place, besides the leaves of a task."""


# --- actions ---------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ActionParts:
    """What an action idiom is made of: its leaf, what must be true before it starts, the counters of
    attempts it uses, whether it keeps its status, the flag that tells that it runs, the entry of the
    blackboard that it remembers its state in, and how it was recognised; the notes of what it may set, or
    the text that lists that, and whether it waits where another ran."""

    leaf: XmlElement
    guards: tuple[XmlElement, ...]
    counters: tuple[str, ...]
    latched: bool
    flag: str
    entry: str | None
    found: Match
    notes: tuple[XmlElement, ...] = ()
    sets: str = ""
    waits: bool = False
    during: XmlElement | None = None


def action_of(element: XmlElement) -> ActionParts | None:
    """The parts of an action idiom; None if this is none."""
    if has(element, LATCH) and element.children:
        return _latch(element)
    for forms in _ACTIONS:
        ways = [(found, keeps) for shape, keeps in forms if (found := match(shape, element)) is not None]
        if not ways:
            continue
        found, keeps = min(ways, key=lambda way: (bool(way[0].wrong), "result" not in way[0].texts))
        needed: Sequence[XmlElement] = found.parts.get("needed", [])
        if "ready" in found.parts:
            needed = _needed(found.part("ready"), found)
        leaf = found.part("leaf")
        entry = found.texts.get("entry", keeps)
        needed, notes, waits = _committing(needed, found)
        parts = _parts(
            leaf, needed, found, latched=keeps == "_latch", flag=found.texts.get("flag", ""), entry=entry
        )
        during = found.part("during") if "during" in found.parts else None
        return replace(parts, notes=notes, waits=waits, during=during)
    return None


def _latch(element: XmlElement) -> ActionParts:
    found = Match(read=[(element, ())])
    keep = boolean_of(element.attributes.get("keep", "true"))
    flag = element.attributes.get("flag", "acting")
    entry = element.attributes.get("entry")
    for name, fits, example in (
        ("keep", keep is not None, "true"),
        ("flag", _NAME.fullmatch(flag) is not None, "acting"),
        ("entry", entry is None or _WORD.fullmatch(entry) is not None, "@x"),
        ("sets", True, ""),
    ):
        if name in element.attributes:
            found.read.append((element, (name,)))
            if not fits:
                found.wrong.append((element, name, example))
    *needed, leaf = element.children
    during = None
    if needed and has(needed[-1], WHILE, 1):
        found.read.append((needed[-1], ()))
        during = needed.pop().children[0]
    parts = _parts(leaf, needed, found, latched=keep is not False, flag=flag, entry=entry)
    return replace(parts, sets=element.attributes.get("sets", ""), waits=True, during=during)


def _committing(
    needed: Sequence[XmlElement], found: Match
) -> tuple[Sequence[XmlElement], tuple[XmlElement, ...], bool]:
    """What stands before an action without what commits the tree to it: that it waits where another ran,
    after its conditions, and notes of what it may set, at last."""
    first = needed[0] if needed else None
    if first is not None and has(first, "ReactiveSequence") and any(map(_is_gate, first.children[-1:])):
        found.read.append((first, ()))
        needed = [*first.children, *needed[1:]]
    at = next((number for number, each in enumerate(needed) if _is_gate(each)), None)
    gate = None if at is None else match(GATE, needed[at])
    if at is not None and gate is not None:
        found.read.extend(gate.read)
        found.wrong.extend(gate.wrong)
        if found.texts.setdefault("flag", gate.texts.get("flag", "")) != gate.texts.get("flag"):
            found.wrong.append((needed[at], "if", f"!@{found.texts['flag']}"))
        needed = [*needed[:at], *needed[at + 1 :]]
    notes: tuple[XmlElement, ...] = ()
    if needed and has(needed[-1], "ReactiveSequence") and needed[-1].attributes.get("name") == HOLD_LABEL:
        found.read.append((needed[-1], ()))
        notes, needed = tuple(needed[-1].children), needed[:-1]
    return needed, notes, gate is not None


def _is_gate(element: XmlElement) -> bool:
    return match(GATE, element) is not None


def _needed(ready: XmlElement, found: Match) -> Sequence[XmlElement]:
    """What must succeed before an action starts: several nodes if the first of them waits, or the last of
    them uses up an attempt."""
    if has(ready, "ReactiveSequence") and ready.children and not _is_gate(ready.children[-1]):
        first = ready.children[0]
        if _is_gate(first) or (has(first, "ReactiveSequence") and any(map(_is_gate, first.children[-1:]))):
            found.read.append((ready, ()))
            return ready.children
    if has(ready, "ReactiveSequence") and ready.children and has(ready.children[-1], "Script"):
        found.read.append((ready, ()))
        return ready.children
    return [ready]


def _parts(
    leaf: XmlElement,
    needed: Sequence[XmlElement],
    found: Match,
    *,
    latched: bool,
    flag: str,
    entry: str | None,
) -> ActionParts:
    """Splits what stands before an action into guards and the counting of attempts."""
    guards, counters = tuple(needed), tuple[str, ...]()
    if len(needed) >= 2 and has(needed[-2], "ScriptCondition", 0) and has(needed[-1], "Script", 0):
        left, used = (part.attributes.get("code", "") for part in needed[-2:])
        guards, counters = tuple(needed[:-2]), tuple(_WORD.findall(left))
        found.read.extend((part, ("code",)) for part in needed[-2:])
        if _LEFT.fullmatch(left) is None:
            found.wrong.append((needed[-2], "code", "@x > 0"))
        elif _USED.fullmatch(used) is None or tuple(_WORD.findall(used)) != counters:
            found.wrong.append((needed[-1], "code", "; ".join(f"{counter} -= 1" for counter in counters)))
    return ActionParts(leaf, guards, counters, latched, flag, entry, found)
