"""Broken artefacts: a diagnostic with code and place for each fault, never a traceback."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.artefacts import dumps, load_task, load_tree, task_to_json, tree_from_json, tree_to_json
from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.source import SourceFile
from tests.profiles import examples
from tests.strategies import soda_task, soda_tree

Edit = Callable[[Any], object]


def task_value() -> Any:
    return json.loads(dumps(task_to_json(soda_task())))


def tree_value() -> Any:
    return json.loads(dumps(tree_to_json(soda_tree())))


def node(value: Any, *children: int) -> Any:
    found = value["root"]
    for child in children:
        found = found["children"][child]
    return found


def deep_condition(levels: int) -> list[object]:
    condition: list[object] = ["true"]
    for _ in range(levels):
        condition = ["not", condition]
    return condition


def deep_node(levels: int) -> dict[str, object]:
    found: dict[str, object] = {"id": "leaf", "type": "condition", "condition": ["true"]}
    for level in range(levels):
        found = {"id": f"d{level}", "type": "sequence", "children": [found]}
    return found


def template(**body: object) -> dict[str, object]:
    return {"name": "t()", "template": "t", "args": [], "precondition": ["true"], "factors": [], "body": body}


NOTHING = {"type": "condition", "condition": ["true"]}
LOOK = {"type": "action", "action": "detect(soda)"}

TASK_FAULTS: list[tuple[str, Edit, str, str]] = [
    ("another format", lambda v: v.update(format="bbtc-tree"), "BBT0602", "format"),
    ("a newer version", lambda v: v.update(version=2), "BBT0602", "version"),
    ("a version that only equals 1", lambda v: v.update(version=True), "BBT0602", "version"),
    ("no format", lambda v: v.pop("format"), "BBT0602", "the top level"),
    ("no goal", lambda v: v.pop("goal"), "BBT0603", "the top level"),
    ("an unknown field", lambda v: v.update(goals=[]), "BBT0603", "goals"),
    ("a number for a name", lambda v: v.update(domain=3), "BBT0604", "domain"),
    ("half a character", lambda v: v.update(domain="\ud800"), "BBT0604", "domain"),
    ("an object for a list", lambda v: v.update(actions={}), "BBT0604", "actions"),
    ("a variable twice", lambda v: v["variables"].append(v["variables"][0]), "BBT0607", "variables"),
    ("an action twice", lambda v: v["actions"].append(v["actions"][0]), "BBT0607", "actions"),
    (
        "a value that is none",
        lambda v: v["variables"][0].update(values=["true"]),
        "BBT0604",
        "variables[0].values",
    ),
    (
        "a name without brackets",
        lambda v: v["variables"][0].update(name="lit"),
        "BBT0604",
        "variables[0].name",
    ),
    (
        "a predicate without args",
        lambda v: v["variables"][0].update(predicate="p"),
        "BBT0603",
        "variables[0]",
    ),
    (
        "an action under a false name",
        lambda v: v["actions"][0].update(args=["tea"]),
        "BBT0604",
        "actions[0].name",
    ),
    (
        "probability 1.2",
        lambda v: v["actions"][0]["outcomes"][0].update(p="1.2"),
        "BBT0604",
        "actions[0].outcomes[0].p",
    ),
    (
        "probability 0",
        lambda v: v["actions"][0]["outcomes"][0].update(p="0"),
        "BBT0604",
        "actions[0].outcomes[0].p",
    ),
    (
        "a float",
        lambda v: v["actions"][0]["outcomes"][0].update(p=0.5),
        "BBT0604",
        "actions[0].outcomes[0].p",
    ),
    ("a word for a number", lambda v: v["actions"][0].update(cost="much"), "BBT0604", "actions[0].cost"),
    ("a sum below 1", lambda v: v["actions"][0]["outcomes"].pop(), "BBT0608", "actions[0].outcomes"),
    ("no initial state", lambda v: v.update(initial=[]), "BBT0608", "initial"),
    (
        "an effect on nothing known",
        lambda v: v["actions"][1]["outcomes"][0]["effects"][0].update(set={"lit()": "true"}),
        "BBT0606",
        'actions[1].outcomes[0].effects[0].set."lit()"',
    ),
    (
        "a two-valued variable unknown",
        lambda v: v["initial"][0]["assign"].update({"luminousity_ok()": "unknown"}),
        "BBT0604",
        'initial[0].assign."luminousity_ok()"',
    ),
    (
        "a variable without a value",
        lambda v: v["initial"][0]["assign"].pop("seen(soda)"),
        "BBT0603",
        "initial[0].assign",
    ),
    ("both forms of chance", lambda v: v["actions"][0].update(factors=[]), "BBT0603", "actions[0]"),
    ("no form of chance", lambda v: v["actions"][0].pop("outcomes"), "BBT0603", "actions[0]"),
    ("oneof of no factor", lambda v: v["actions"][0].update(oneof=[1]), "BBT0604", "actions[0].oneof[0]"),
    (
        "a condition on nothing known",
        lambda v: v.update(goal=["is", "seen(sodas)", "true"]),
        "BBT0606",
        "goal[1]",
    ),
    ("a condition of no kind", lambda v: v.update(goal=["xor", ["true"]]), "BBT0604", "goal[0]"),
    ("an empty condition", lambda v: v.update(goal=[]), "BBT0604", "goal"),
    ("not with two parts", lambda v: v.update(goal=["not", ["true"], ["true"]]), "BBT0604", "goal"),
    ("a deep condition", lambda v: v.update(goal=deep_condition(300)), "BBT0605", "goal[1]"),
    (
        "a body with an unknown action",
        lambda v: v.update(templates=[template(type="action", action="detect()")]),
        "BBT0606",
        "templates[0].body",
    ),
    (
        "a body with an unknown template",
        lambda v: v.update(
            templates=[template(type="sequence", children=[{"type": "template", "template": "u()"}])]
        ),
        "BBT0606",
        "templates[0].body.children[0]",
    ),
    (
        "a template that calls itself",
        lambda v: v.update(templates=[template(type="template", template="t()")]),
        "BBT0612",
        "templates",
    ),
    (
        "an action in the first child of a Skipper",
        lambda v: v.update(templates=[template(type="skipper", children=[LOOK, NOTHING])]),
        "BBT0610",
        "templates[0].body.children[0]",
    ),
    (
        "a body that is empty",
        lambda v: v.update(templates=[template(type="fallback", children=[])]),
        "BBT0611",
        "templates[0].body",
    ),
]

TREE_FAULTS: list[tuple[str, Edit, str, str]] = [
    ("another format", lambda v: v.update(format="bbtc-task"), "BBT0602", "format"),
    ("no root", lambda v: v.pop("root"), "BBT0603", "the top level"),
    ("no task", lambda v: v.pop("task"), "BBT0609", "the top level"),
    ("a fault in its task", lambda v: v["task"].pop("goal"), "BBT0603", "task"),
    ("the task of another problem", lambda v: v.update(problem="other"), "BBT0604", "problem"),
    ("a status of no kind", lambda v: v.update(status="fine"), "BBT0604", "status"),
    (
        "a probability above 1",
        lambda v: v.update(success_probability="3/2"),
        "BBT0604",
        "success_probability",
    ),
    ("a node of no kind", lambda v: node(v, 1).update(type="parallel"), "BBT0604", "root.children[1].type"),
    ("a node without a type", lambda v: node(v, 1).pop("type"), "BBT0603", "root.children[1]"),
    (
        "an unknown action",
        lambda v: node(v, 1, 0, 0, 1).update(action="detect(sodas)"),
        "BBT0606",
        "root.children[1].children[0].children[0].children[1]",
    ),
    ("an id twice", lambda v: node(v, 1).update(id="n2"), "BBT0607", "root.children[1]"),
    ("a misspelt field", lambda v: node(v, 0).update(resaon="x"), "BBT0603", "root.children[0].resaon"),
    (
        "a word for a truth value",
        lambda v: node(v, 1, 0, 0, 1).update(latched="yes"),
        "BBT0604",
        "root.children[1].children[0].children[0].children[1].latched",
    ),
    ("children that are none", lambda v: node(v, 1).update(children=[]), "BBT0611", "root.children[1]"),
    (
        "children of a condition",
        lambda v: node(v, 0).update(children=[]),
        "BBT0603",
        "root.children[0].children",
    ),
    ("a child that is a string", lambda v: node(v)["children"].append("n9"), "BBT0604", "root.children[2]"),
    (
        "an action in the first child of a Skipper",
        lambda v: node(v)["children"].reverse(),
        "BBT0610",
        "root.children[0]",
    ),
    (
        "too many levels",
        lambda v: node(v)["children"].append(deep_node(256)),
        "BBT0605",
        "root.children[2].children[0]",
    ),
]


def faults_of(load: Callable[[SourceFile], object], value: object) -> BbtcError:
    with pytest.raises(BbtcError) as caught:
        load(SourceFile("x.json", json.dumps(value, indent=1)))
    for diagnostic in caught.value.diagnostics:
        assert diagnostic.span is not None, "every fault has its place"
        diagnostic.render()
    return caught.value


@pytest.mark.parametrize(
    ("edit", "code", "path"), [f[1:] for f in TASK_FAULTS], ids=[f[0] for f in TASK_FAULTS]
)
def test_faults_of_tasks_are_told_with_their_place(edit: Edit, code: str, path: str) -> None:
    value = task_value()
    edit(value)
    (diagnostic,) = faults_of(load_task, value).diagnostics
    assert diagnostic.code == code
    assert diagnostic.message.startswith(f"at {path}")


@pytest.mark.parametrize(
    ("edit", "code", "path"), [f[1:] for f in TREE_FAULTS], ids=[f[0] for f in TREE_FAULTS]
)
def test_faults_of_trees_are_told_with_their_place(edit: Edit, code: str, path: str) -> None:
    value = tree_value()
    edit(value)
    (diagnostic,) = faults_of(load_tree, value).diagnostics
    assert diagnostic.code == code
    assert diagnostic.message.startswith(f"at {path}")


def test_every_fault_is_told_in_one_run() -> None:
    value = tree_value()
    node(value, 0)["condition"][1] = "sen(soda)"
    node(value, 1, 0, 0, 1)["latched"] = 1
    value["status"] = "done"
    value["target"] = "2"
    error = faults_of(load_tree, value)
    assert sorted(d.code for d in error.diagnostics) == ["BBT0604", "BBT0604", "BBT0604", "BBT0606"]
    assert "did you mean 'seen(soda)'?" in str(error)


def test_very_many_faults_end_the_reading() -> None:
    value = task_value()
    value["actions"] = [None] * 100_000
    assert len(faults_of(load_task, value).diagnostics) == 50


def test_a_value_without_its_text_is_refused_by_path() -> None:
    value = tree_value()
    node(value, 0)["id"] = "n1"
    with pytest.raises(BbtcError, match=r"at root\.children\[0\]: two nodes have the id 'n1'"):
        tree_from_json(value)


@pytest.mark.parametrize(
    "text", ["", "null", "[]", "0", '"bbtc-task"', "{}", "(define (domain d))", "\ufeff{}"]
)
def test_what_is_no_artefact_at_all_is_refused(text: str) -> None:
    for load in (load_task, load_tree):
        with pytest.raises(BbtcError):
            load(SourceFile("x.json", text))


# --- anything at all -------------------------------------------------------------------------

_JUNK = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.sampled_from(["", "x", "is", "seen(soda)", "1"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["id", "type", "p", "x"]), inner, max_size=3)
    ),
    max_leaves=5,
)


@st.composite
def damaged(draw: st.DrawFn, value: Any) -> Any:
    """The value with a random part replaced, removed or repeated."""
    part = value
    while True:
        keys = list(part) if isinstance(part, dict) else list(range(len(part)))
        key = draw(st.sampled_from(keys))
        inner = part[key]
        if isinstance(inner, (dict, list)) and inner and draw(st.integers(0, 3)):
            part = inner
            continue
        match draw(st.sampled_from(["replace", "remove", "repeat"])):
            case "replace":
                part[key] = draw(_JUNK)
            case "remove":
                del part[key]
            case _ if isinstance(part, list):
                part.append(inner)
            case _:
                part["again"] = inner
        return value


@examples(300)
@given(st.data())
def test_a_damaged_artefact_is_read_or_refused_with_places(data: st.DataObject) -> None:
    kinds: list[tuple[Any, Callable[[SourceFile], object]]] = [
        (task_value(), load_task),
        (tree_value(), load_tree),
    ]
    for value, load in kinds:
        text = json.dumps(data.draw(damaged(value)))
        diagnostics: tuple[Diagnostic, ...] = ()
        try:
            load(SourceFile("x.json", text))
        except BbtcError as error:
            diagnostics = error.diagnostics
        assert all(diagnostic.span for diagnostic in diagnostics)
