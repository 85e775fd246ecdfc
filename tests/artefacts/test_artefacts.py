"""Ground tasks and trees as JSON: the documented fields, and nothing lost on the way."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from jsonschema import Draft202012Validator

from bbtc.artefacts import (
    dumps,
    load_task,
    load_tree,
    task_from_json,
    task_to_json,
    tree_from_json,
    tree_to_json,
)
from bbtc.ground.condition import TRUE, Is
from bbtc.ground.task import NO_CHANGE, Effect, Factor, Outcome, Task
from bbtc.kleene import Truth
from bbtc.source import SourceFile
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree, actions_of
from bbtc.tree.validate import MAX_DEPTH, check_tree
from tests.conftest import GOLDEN
from tests.domains.problems import PROBLEMS, Problem
from tests.strategies import HOSTILE_NAMES, soda_task, soda_tree, tasks, trees

SCHEMAS = Path(__file__).resolve().parents[2] / "docs" / "schemas"


def validator(name: str) -> Draft202012Validator:
    schema = json.loads((SCHEMAS / f"bbtc-{name}-1.json").read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


TASK_SCHEMA = validator("task")
TREE_SCHEMA = validator("tree")


def as_json(value: object) -> Any:
    return json.loads(dumps(value))


# --- the documented fields -------------------------------------------------------------------


def test_a_task_has_the_documented_fields() -> None:
    value = as_json(task_to_json(soda_task()))
    assert list(value) == [
        "format",
        "version",
        "domain",
        "problem",
        "goal_probability",
        "variables",
        "initial",
        "goal",
        "actions",
    ]
    assert (value["format"], value["version"]) == ("bbtc-task", 1)
    assert (value["domain"], value["problem"]) == ("household", "look-for-soda")
    assert value["goal_probability"] == "0.9"
    assert value["variables"] == [
        {"name": "luminousity_ok()", "values": ["true", "false"], "hidden": False},
        {"name": "seen(soda)", "values": ["true", "false", "unknown"], "hidden": False},
    ]
    assert value["initial"] == [{"p": "1", "assign": {"luminousity_ok()": "false", "seen(soda)": "unknown"}}]
    assert value["goal"] == ["is", "seen(soda)", "true"]
    assert value["actions"][0] == {
        "name": "detect(soda)",
        "schema": "detect",
        "args": ["soda"],
        "cost": "1",
        "precondition": ["and", ["is", "luminousity_ok()", "true"], ["is", "seen(soda)", "unknown"]],
        "outcomes": [
            {"p": "0.5", "effects": [{"when": None, "set": {"seen(soda)": "true"}}]},
            {"p": "0.5", "effects": [{"when": None, "set": {"seen(soda)": "false"}}]},
        ],
    }


def test_a_tree_has_the_documented_fields() -> None:
    seen = Is(1, Truth.TRUE)
    root = ControlNode("n1", "fallback", (ConditionNode("n2", seen), ActionNode("n3", "detect(soda)")))
    tree = Tree(soda_task(), root, Fraction(31, 32), Fraction("0.9"), "target-reached")
    value = as_json(tree_to_json(tree))
    embedded = value.pop("task")
    assert value == {
        "format": "bbtc-tree",
        "version": 1,
        "domain": "household",
        "problem": "look-for-soda",
        "success_probability": "31/32",
        "target": "0.9",
        "status": "target-reached",
        "root": {
            "id": "n1",
            "type": "fallback",
            "children": [
                {"id": "n2", "type": "condition", "condition": ["is", "seen(soda)", "true"]},
                {"id": "n3", "type": "action", "action": "detect(soda)", "latched": True},
            ],
        },
    }
    assert [action["name"] for action in embedded["actions"]] == ["detect(soda)"]
    assert embedded["variables"] == as_json(task_to_json(soda_task()))["variables"]


def chance(*factors: Factor) -> dict[str, Any]:
    task = soda_task()
    action = as_json(task_to_json(replace(task, actions=(replace(task.actions[0], factors=factors),))))
    fields: dict[str, Any] = action["actions"][0]
    return {key: fields[key] for key in fields if key in ("outcomes", "factors", "oneof")}


def test_independent_chance_stands_as_factors_and_one_distribution_as_outcomes() -> None:
    plain = [{"p": "1", "effects": []}]
    assert chance(NO_CHANGE) == {"outcomes": plain}
    assert chance(NO_CHANGE, NO_CHANGE) == {"factors": [plain, plain]}
    assert chance() == {"factors": []}
    assert chance(NO_CHANGE, replace(NO_CHANGE, oneof=True)) == {"factors": [plain, plain], "oneof": [1]}
    nested = Factor((Outcome(Fraction(1), (), (replace(NO_CHANGE, oneof=True),)),))
    assert chance(nested) == {"factors": [[{"p": "1", "effects": [], "factors": [plain], "oneof": [0]}]]}


def test_an_effect_that_contradicts_itself_is_written_as_what_it_does() -> None:
    both = Factor((Outcome(Fraction(1), (Effect(None, ((1, Truth.TRUE), (1, Truth.FALSE))),)),))
    assert chance(both)["outcomes"][0]["effects"][0]["set"] == {"seen(soda)": "true"}


# --- round trips -----------------------------------------------------------------------------


@given(tasks(nested=2))
def test_a_task_survives_the_round_trip(task: Task) -> None:
    text = dumps(task_to_json(task))
    assert load_task(SourceFile("task.json", text)) == task


@given(tasks(HOSTILE_NAMES, nested=0))
def test_a_task_with_hostile_names_survives_the_round_trip(task: Task) -> None:
    text = dumps(task_to_json(task))
    assert load_task(SourceFile("task.json", text)) == task


@given(trees())
def test_a_tree_survives_the_round_trip(tree: Tree) -> None:
    text = dumps(tree_to_json(tree))
    again = load_tree(SourceFile("tree.json", text))
    used = {node.action for node in actions_of(tree.root)}
    kept = tuple(action for action in tree.task.actions if action.name in used)
    assert again == replace(tree, task=replace(tree.task, actions=kept, templates=()))
    assert dumps(tree_to_json(again)) == text
    assert load_tree(SourceFile("tree.json", text), tree.task) == tree


@given(trees(HOSTILE_NAMES))
def test_artefacts_match_their_schemas(tree: Tree) -> None:
    TASK_SCHEMA.validate(as_json(task_to_json(tree.task)))
    value = as_json(tree_to_json(tree))
    TREE_SCHEMA.validate(value)
    TASK_SCHEMA.validate(value["task"])


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_artefacts_of_our_domains_match_their_schemas(problem: Problem) -> None:
    task, tree = (
        json.loads((GOLDEN / str(problem) / f"{kind}.json").read_text("utf-8")) for kind in ("task", "tree")
    )
    TASK_SCHEMA.validate(task)
    TREE_SCHEMA.validate(tree)
    TASK_SCHEMA.validate(tree["task"])


def test_a_tree_that_carries_no_task_is_read_on_the_one_given() -> None:
    value = tree_to_json(soda_tree())
    del value["task"], value["target"]
    assert tree_from_json(value, soda_task()) == soda_tree()


def test_the_order_of_a_hand_edited_file_does_not_matter() -> None:
    value = as_json(task_to_json(soda_task()))
    for field in ("variables", "actions"):
        value[field].reverse()
    assert task_from_json(value) == soda_task()


def test_members_for_private_use_are_ignored() -> None:
    value = task_to_json(soda_task())
    value["x-comment"] = {"anything": ["at", "all"]}
    assert task_from_json(value) == soda_task()
    TASK_SCHEMA.validate(as_json(value))


def test_a_tree_of_the_greatest_depth_is_read_and_written() -> None:
    node: Node = ConditionNode(f"n{MAX_DEPTH}", TRUE)
    for level in range(MAX_DEPTH - 1, 0, -1):
        node = ControlNode(f"n{level}", "sequence", (node,))
    tree = replace(soda_tree(), root=node)
    check_tree(tree)
    text = dumps(tree_to_json(tree))
    assert dumps(tree_to_json(load_tree(SourceFile("tree.json", text)))) == text


@pytest.mark.parametrize("schema", [TASK_SCHEMA, TREE_SCHEMA])
def test_schemas_refuse_what_readers_refuse(schema: Draft202012Validator) -> None:
    value = as_json(task_to_json(soda_task()) if schema is TASK_SCHEMA else tree_to_json(soda_tree()))
    assert isinstance(schema.schema, dict)
    for field in list(schema.schema["required"]):
        assert not schema.is_valid({key: part for key, part in value.items() if key != field})
    assert not schema.is_valid({**value, "unknown": 1})
    assert not schema.is_valid({**value, "version": 2})
