"""A tree whose export has every idiom, and ways to change single places of a file."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction
from importlib.util import find_spec
from xml.etree import ElementTree as ET

from bbtc.backends.btcpp.exporter import btcpp
from bbtc.backends.btcpp.reader.xml import Imported, tree_from_btcpp
from bbtc.diagnostics import BbtcError, Diagnostic, Report
from bbtc.durations import Fixed
from bbtc.ground.condition import FALSE, TRUE, And, Condition, Is, Known, Not, Or
from bbtc.ground.task import Effect, Factor, GroundAction, InitialState, Outcome, Task, Variable
from bbtc.kleene import Truth
from bbtc.source import SourceFile
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree
from tests.replay.reference import expected_ticks
from tests.replay.ticks import TickWorld, random_script, trace

PROFILES = ("stock", "bbtc")


def idioms_task() -> Task:
    """Look for a can: light and a door that are seen at once, a can and a shelf that may be unknown."""
    lit, near, seen, shelf = range(4)

    def chance(*sets: tuple[int, Truth]) -> Factor:
        half = Fraction(1, 2)
        return Factor(tuple(Outcome(half, (Effect(None, (each,)),)) for each in sets))

    return Task(
        domain="kitchen",
        problem="find-can",
        variables=(
            Variable("lit", (), False),
            Variable("near", ("7",), True),
            Variable("seen", ("can",), True),
            Variable("seen", ("cup",), True),
        ),
        initial=(InitialState(Fraction(1), (Truth.FALSE, Truth.UNKNOWN, Truth.UNKNOWN, Truth.UNKNOWN)),),
        goal=Is(seen, Truth.TRUE),
        actions=(
            GroundAction(
                "go",
                ("7",),
                Is(lit, Truth.TRUE),
                (chance((near, Truth.TRUE), (near, Truth.FALSE)),),
                duration=Fixed(Fraction(2)),
                timeout=Fraction(30),
            ),
            GroundAction(
                "look",
                ("can",),
                And((Is(near, Truth.TRUE), Or((Is(seen, Truth.UNKNOWN), Is(shelf, Truth.TRUE))))),
                (chance((seen, Truth.TRUE), (seen, Truth.FALSE)),),
                during=Is(near, Truth.TRUE),
            ),
            GroundAction("look", ("cup",), TRUE, (chance((shelf, Truth.TRUE), (shelf, Truth.FALSE)),)),
            GroundAction("switch-on", (), TRUE, (chance((lit, Truth.TRUE), (lit, Truth.TRUE)),)),
        ),
        goal_probability=Fraction(1, 4),
    )


def idioms_tree() -> Tree:
    """A tree with every kind of node, written in every way there is."""
    task = idioms_task()
    lit, near, can, cup = (Is(index, Truth.TRUE) for index in range(4))
    number = iter(range(1, 100))

    def control(kind: ControlKind, *children: Node, **more: str) -> ControlNode:
        return replace(ControlNode(f"n{next(number)}", kind, children), **more)  # type: ignore[arg-type]

    def check(condition: Condition, name: str | None = None) -> ConditionNode:
        return ConditionNode(f"n{next(number)}", condition, name)

    def act(action: str, latched: bool = True, guarded: bool = False) -> ActionNode:
        return ActionNode(f"n{next(number)}", action, latched, guarded)

    light = control("fallback", check(lit), act("switch-on()"), reason="lit()")
    walk = ControlNode(
        f"n{next(number)}",
        "retry",
        (control("sequence", act("go(7)", False, True), check(near)),),
        attempts=2,
    )
    look = control(
        "sequence", act("look(can)", True, True), check(Known(2)), check(can), template="search(can)"
    )
    shelf = control("sequence", act("look(cup)"), check(Not(cup)), name="the shelf")
    conditions = control(
        "fallback",
        check(Is(3, Truth.UNKNOWN)),
        check(Is(1, Truth.UNKNOWN)),
        check(And((can, cup))),
        check(Or((And((near, can)), And((can, cup))))),
        check(And((lit, cup))),
        check(FALSE),
        check(Or((lit, cup)), "either"),
    )
    again = control("sequence", act("look(cup)", False), check(Known(1)))
    once = ControlNode(f"n{next(number)}", "retry", (act("switch-on()", False),), attempts=1)
    tried = control("sequence", act("go(7)", True, True), check(near), once)
    until = ControlNode(f"n{next(number)}", "retry-until-success", (tried,), "go there", attempts=3)
    root = control(
        "fallback",
        control("skipper", check(can), control("sequence", light, walk, look)),
        control("sequence", conditions, shelf),
        until,
        again,
    )
    return Tree(task, root, Fraction(1, 8), Fraction(1, 4), "stuck")


def exported(tree: Tree, nodes: str, **options: str | bool) -> str:
    """A file."""
    return btcpp.export(tree, {"nodes": nodes, **options}, None)


def elements(document: ET.Element) -> list[ET.Element]:
    """The root element, the BehaviorTrees and all nodes; not the palette."""
    palette = {part for model in document.iter("TreeNodesModel") for part in model.iter()}
    return [element for element in document.iter() if element not in palette and isinstance(element.tag, str)]


def text_of(document: ET.Element) -> str:
    """A file with every element on a line of its own."""
    ET.indent(document)
    return ET.tostring(document, encoding="unicode")


def parsed(text: str) -> ET.Element:
    """A file with its comments."""
    return ET.fromstring(text, ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))


def read(text: str, task: Task, **options: str) -> tuple[Imported, list[Diagnostic]]:
    """The tree of a file, and the doubts about it."""
    report = Report()
    return tree_from_btcpp(SourceFile("tree.xml", text), task, report, **options), list(report)  # type: ignore[arg-type]


def refusal(text: str, task: Task) -> list[Diagnostic]:
    """Why a file is refused; empty if it is read."""
    found: list[Diagnostic] = []
    try:
        read(text, task)
    except BbtcError as error:
        found = list(error.diagnostics)
    assert all(each.span is not None for each in found), found
    return found


def check_in_engine(tree: Tree, text: str, rng: random.Random, scripts: int = 3) -> None:
    """Fail unless the engine, where it is there, does with a file what the reference does with the tree that
    is read of it. ``tree`` is the one the file was made from."""
    if find_spec("behaviortreepy") is None:
        return
    from bbtc.replay.engines import BtcppReplay

    imported, doubts = read(text, tree.task)
    if any(doubt.code == "BBT0620" for doubt in doubts):
        return  # it ticks for ever, which the warning says
    replay = BtcppReplay(tree, text)
    replay.begin(TickWorld(tree.task, random_script(tree.task, rng, 1)))
    for _ in range(scripts):
        script = random_script(tree.task, rng, 12)
        assert trace(replay, script) == expected_ticks(tree.task, imported.tree.root, script), text


def lines_of(found: list[Diagnostic]) -> list[tuple[int, str]]:
    """The line of each diagnostic, and what is pointed at with the message."""
    result = []
    for each in found:
        assert each.span is not None
        result.append((each.span.source.position(each.span.start)[0], f"{each.span.text} {each.message}"))
    return result


def line_of(text: str, part: str) -> int:
    """The line of the only place of a text."""
    assert text.count(part) == 1, (part, text.count(part))
    return text[: text.index(part)].count("\n") + 1
