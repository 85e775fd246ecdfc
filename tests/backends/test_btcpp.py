"""BehaviorTree.CPP files: their form, whatever the names and however deep the tree."""

from __future__ import annotations

import json
import random
import re
from dataclasses import replace
from fractions import Fraction
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given

import bbtc
from bbtc.backends.btcpp.names import RESERVED
from bbtc.backends.registry import load_exporter, parse_options
from bbtc.backends.shape import DEEPEST_CONDITION, DEEPEST_TREE
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import TRUE, And, Condition, Is, Known, Not, Or
from bbtc.ground.task import GroundAction, InitialState, Task, Variable
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.replay.engines import BtcppReplay, PyTreesReplay
from bbtc.replay.script import TIMINGS, Run, Script
from bbtc.source import SourceFile
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree
from tests import btcpp_nodes
from tests.conftest import Golden
from tests.profiles import examples
from tests.replay.random_trees import random_tree
from tests.replay.reference import STATUS, random_run, value_of, varied_runs
from tests.strategies import HOSTILE_NAMES, soda_tree, trees


def export(tree: Tree, **options: str) -> str:
    exporter = load_exporter("btcpp")
    text = exporter.export(tree, parse_options(exporter, options), None)
    assert isinstance(text, str)
    return text


def tree_of(root: Node, *variables: Variable, actions: tuple[GroundAction, ...] = ()) -> Tree:
    initial = (InitialState(Fraction(1), (Truth.FALSE,) * len(variables)),)
    return Tree(
        Task("d", "p", variables, initial, TRUE, actions), root, Fraction(1), Fraction(1), "target-reached"
    )


def check_form(text: str) -> ET.Element:
    """Fail unless the file keeps every rule of the engine that an XML reader can check."""
    root = ET.fromstring(text)
    assert root.attrib["BTCPP_format"] == "4"
    assert [child.tag for child in root] == ["BehaviorTree"] * (len(root) - 1) + ["TreeNodesModel"]
    trees_by_id = {tree.attrib["ID"]: tree for tree in root.iter("BehaviorTree")}
    assert len(trees_by_id) == len(root) - 1
    assert root.attrib["main_tree_to_execute"] in trees_by_id
    model = root[-1]
    entries = {entry.attrib["ID"]: entry for entry in model}
    assert len(entries) == len(model)
    ids = [
        *trees_by_id,
        *(name for name, entry in entries.items() if entry.tag not in ("SubTree", "Control", "Decorator")),
    ]
    assert len({name.casefold() for name in ids}) == len(ids)
    assert not {name.casefold() for name in ids} & {name.casefold() for name in RESERVED}
    for name in ids:
        assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name)
    for tree in trees_by_id.values():
        assert len(tree) == 1
        check_nodes(tree, entries, set(trees_by_id))
    return root


def check_nodes(tree: ET.Element, entries: dict[str, ET.Element], tree_ids: set[str]) -> None:
    """Fail unless every node of a BehaviorTree is known, has its ports, and its children."""
    assert depth(tree) <= 250
    names = [node.attrib["name"] for node in tree.iter("SubTree") if "name" in node.attrib]
    assert len(set(names)) == len(names)
    for node in list(tree.iter())[1:]:
        own = {key for key in node.attrib if not key.startswith("_") and key not in ("name", "ID")}
        if node.tag == "SubTree":
            assert node.attrib["ID"] in tree_ids
            model = entries.get(node.attrib["ID"])
            assert own == ({port.attrib["name"] for port in model} if model is not None else set())
            assert not any(re.match(r"[0-9.+-]", node.attrib[port]) for port in own)
        elif node.tag in ("Skipper", "Latch", "Held", "While", "Committed"):
            assert own <= {port.attrib["name"] for port in entries[node.tag].iter("input_port")}
            assert len(node) == 1 if node.tag in ("Held", "While", "Committed") else len(node) >= 1
        elif node.tag in entries:
            assert own == {port.attrib["name"] for port in entries[node.tag].iter("input_port")}
            assert len(node) == 0
        else:
            assert node.tag in RESERVED
        if node.tag in ("ReactiveSequence", "ReactiveFallback", "Parallel", "Sequence"):
            assert len(node) >= 1
        if node.tag in ("Inverter", "ForceSuccess", "ForceFailure", "KeepRunningUntilFailure"):
            assert len(node) == 1


def depth(element: ET.Element) -> int:
    deepest, stack = 0, [(element, 0)]
    while stack:
        node, level = stack.pop()
        deepest = max(deepest, level)
        stack.extend((child, level + 1) for child in node)
    return deepest


def test_the_soda_tree(golden: Golden) -> None:
    for options, file in (
        ({}, "soda.xml"),
        ({"nodes": "bbtc", "namespace": "kitchen"}, "soda-nodes.xml"),
    ):
        text = export(soda_tree(), **options)
        check_form(text)
        golden(f"export/{file}", text)


def test_the_palette_has_the_leaves_and_control_nodes_alone(golden: Golden) -> None:
    text = palette(soda_tree(), nodes="bbtc")
    golden("export/soda-palette.xml", text)
    (model,) = ET.fromstring(text)
    assert [entry.tag for entry in model] == ["Condition"] * 2 + ["Action"] * 2 + ["Control"] * 2 + [
        "Decorator"
    ] * 3
    assert [entry.tag for entry in ET.fromstring(palette(soda_tree()))[0]] == ["Condition"] * 2 + [
        "Action"
    ] * 2


def palette(tree: Tree, **options: str) -> str:
    exporter = load_exporter("btcpp_palette")
    text = exporter.export(tree, parse_options(exporter, options), None)
    assert isinstance(text, str)
    return text


def templated(*templates: str) -> Tree:
    """A sequence of expansions ``look(x)``: go to x, and see."""
    variables = tuple(Variable("seen", (name,), True) for name in ("a", "b"))
    actions = tuple(GroundAction("go", (name,), TRUE, ()) for name in ("a", "b"))
    steps = tuple(
        ControlNode(
            f"s{i}",
            "sequence",
            (
                ActionNode(f"g{i}", f"go({template[-2]})"),
                ConditionNode(f"c{i}", Known("ab".index(template[-2]))),
            ),
            template=template,
        )
        for i, template in enumerate(templates)
    )
    return tree_of(ControlNode("r", "sequence", steps), *variables, actions=actions)


def trees_called(text: str, name: str) -> list[str]:
    return [
        tree.attrib["ID"] for tree in ET.fromstring(text).iter("BehaviorTree") if name in tree.attrib["ID"]
    ]


@pytest.mark.parametrize("nodes", ["stock", "bbtc"])
def test_expansions_of_a_template_share_a_tree_with_its_arguments_as_ports(nodes: str) -> None:
    text = export(templated("look(a)", "look(b)", "look(a)"), nodes=nodes)
    check_form(text)
    assert trees_called(text, "Look") == ["P_Look"]
    main = ET.fromstring(text)[0]
    calls = [call.attrib for call in main.iter("SubTree") if call.attrib["ID"] == "P_Look"]
    assert [(call["name"], call["arg"]) for call in calls] == [
        ("look(a)", "a"),
        ("look(b)", "b"),
        ("look(a) #2", "a"),
    ]


def test_expansions_that_differ_in_more_than_arguments_have_trees_of_their_own() -> None:
    # The second does not say that it is about b: its leaves have b for themselves.
    text = export(templated("look(a)", "look(?b)"))
    check_form(text)
    assert len(trees_called(text, "Look")) == 2


@pytest.mark.parametrize("nodes", ["stock", "bbtc"])
@pytest.mark.parametrize("seed", range(20))
def test_trees_of_several_problems_fit_into_one_program_and_share_its_leaves(seed: int, nodes: str) -> None:
    # Of two BehaviorTrees of one id, a factory keeps the later one, without a word.
    trees_made, entries = [], []
    for number, problem in enumerate(("fetch", "fetch-all")):
        tree = random_tree(2 * seed + number)
        text = export(replace(tree, task=replace(tree.task, problem=problem)), nodes=nodes)
        root = check_form(text)
        trees_made.append({each.attrib["ID"] for each in root.iter("BehaviorTree")})
        entries.append(set(re.findall(r"@\w+", text)) - {"@acting"})  # set anew in every tick
        model = root.find("TreeNodesModel")
        assert model is not None
        assert not any(leaf.attrib["ID"].startswith("Fetch") for leaf in model if leaf.tag != "SubTree")
    assert not trees_made[0] & trees_made[1]
    assert not entries[0] & entries[1]


def test_a_namespace_comes_before_every_id_and_entry() -> None:
    text = export(soda_tree(), namespace="my-kitchen")
    root = check_form(text)
    named = [tree.attrib["ID"] for tree in root.iter("BehaviorTree")]
    named += [entry.attrib["ID"] for entry in root[-1]] if root[-1].tag == "TreeNodesModel" else []
    assert all(name.startswith("MyKitchen") for name in named)
    lasting = ("running", "ended", "held_luminousity_ok", "held_seen_soda")
    entries = {f"@my_kitchen_look_for_soda_{word}" for word in lasting}
    assert set(re.findall(r"@\w+", text)) == {"@my_kitchen_acting"} | entries


@pytest.mark.parametrize("namespace", ["a b", "1a", "-", "ä", "a.b", "x" * 41, 'a"'])
def test_a_namespace_that_is_no_name_is_refused(namespace: str) -> None:
    with pytest.raises(BbtcError) as error:
        export(soda_tree(), namespace=namespace)
    assert error.value.diagnostics[0].code == "BBT0704"


def test_a_namespace_never_makes_an_id_of_the_engine() -> None:
    # Parallel + All, Re + active…: the whole would be a node of the engine.
    actions = tuple(GroundAction(name, (), TRUE, ()) for name in ("all", "sequence"))
    steps = tuple(ActionNode(f"n{i}", action.name) for i, action in enumerate(actions))
    tree = tree_of(ControlNode("r", "sequence", steps), actions=actions)
    for namespace in ("Parallel", "Reactive", "reactive"):
        check_form(export(tree, namespace=namespace))


def test_a_tree_that_tries_without_end_says_so_in_either_engine() -> None:
    go = GroundAction("go", (), TRUE, ())
    often, once = ActionNode("a", "go()", latched=False), ActionNode("b", "go()")
    bounded = ControlNode("r", "retry", (often,), attempts=2)
    py_trees = load_exporter("py_trees")
    for root, expected in (
        (ControlNode("f", "fallback", (once, often)), True),
        (ControlNode("f", "fallback", (bounded, replace(often, id="c"))), True),
        (ControlNode("f", "fallback", (bounded, once)), False),
    ):
        tree = tree_of(root, actions=(go,))
        texts = export(tree), str(py_trees.export(tree, parse_options(py_trees, {}), None))
        assert ["Nothing bounds how often it tries" in text for text in texts] == [expected] * 2


def test_the_model_can_be_left_out() -> None:
    assert "TreeNodesModel" not in export(soda_tree(), model="no")


def test_stock_nodes_are_those_of_the_engine() -> None:
    assert set(btcpp_nodes.NODES) <= RESERVED


@pytest.mark.parametrize("seed", range(60))
def test_random_trees_keep_the_rules_of_the_engine(seed: int) -> None:
    tree = random_tree(seed, latched=0.7)
    text = export(tree)
    check_form(text)
    check_form(export(tree, nodes="bbtc"))
    assert export(tree) == text


@examples(60)
@given(trees(HOSTILE_NAMES))
def test_hostile_names_neither_break_the_file_nor_change_what_it_does(tree: Tree) -> None:
    pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    check_form(export(tree))
    check_form(export(tree, nodes="bbtc", namespace="class"))
    assert ET.fromstring(palette(tree, nodes="bbtc"))[0].tag == "TreeNodesModel"
    replay = BtcppReplay(tree)
    rng = random.Random(1)
    for _ in range(3):
        script, expected = random_run(tree.task, tree.root, rng, most=4)
        assert replay.run(script) == expected


def test_names_that_look_alike_are_never_taken_for_one_another() -> None:
    pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    variables = tuple(Variable(name, (), True) for name in ("p", "q\x01", "q\x02"))
    either = [And((Is(0, Truth.TRUE), Is(index, Truth.TRUE))) for index in (1, 2)]
    checks = tuple(ConditionNode(f"n{i}", condition, name="same") for i, condition in enumerate(either))
    tree = tree_of(ControlNode("n", "fallback", checks), *variables)
    check_form(export(tree))
    replay = BtcppReplay(tree)
    for values, status in (((2, 0, 2), "success"), ((2, 2, 0), "success"), ((2, 0, 0), "failure")):
        assert replay.run(Script(values, ())).status == status


def test_conditions_of_one_name_stay_apart() -> None:
    known = tuple(ConditionNode(f"n{index}", Known(index), name="same") for index in (0, 1))
    check_form(export(tree_of(ControlNode("n", "fallback", known), *(Variable(n, (), True) for n in "pq"))))


def test_an_object_that_looks_like_a_number_reaches_the_action_as_it_is() -> None:
    pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    actions = tuple(GroundAction("go", (name,), TRUE, ()) for name in ("007", "1e5", "inf", "nan"))
    steps: tuple[Node, ...] = tuple(ActionNode(f"n{i}", action.name) for i, action in enumerate(actions))
    tree = tree_of(ControlNode("n", "sequence", steps), actions=actions)
    check_form(export(tree))
    script = Script((), tuple((action.name, ()) for action in actions))
    expected = Run(tuple(action.name for action in actions), "success", ())
    assert BtcppReplay(tree).run(script) == expected


KLEENE: list[Condition] = [
    *(Is(0, value) for value in Truth),
    Known(0),
    Not(Is(0, Truth.UNKNOWN)),
    And((Is(0, Truth.TRUE), Is(1, Truth.TRUE))),
    Or((Is(0, Truth.TRUE), Is(1, Truth.FALSE))),
    And((Is(0, Truth.TRUE), Is(2, Truth.TRUE))),
    Or((Is(0, Truth.FALSE), Is(2, Truth.TRUE), Known(1))),
    And((Or((Is(0, Truth.TRUE), Is(1, Truth.TRUE))), Not(And((Is(0, Truth.TRUE), Is(1, Truth.FALSE)))))),
    Or((And((Is(2, Truth.TRUE), Is(1, Truth.TRUE))), And((Is(0, Truth.TRUE), Is(1, Truth.UNKNOWN))))),
    And(()),
    Or(()),
]


@pytest.mark.parametrize("condition", KLEENE, ids=str)
def test_a_condition_has_its_kleene_value_in_every_state_and_after_every_other(condition: Condition) -> None:
    # The condition stands alone in a Skipper before an action: true ends it with success, false with
    # failure, unknown starts the action, whose outcome is another state, in which it is read again.
    pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    variables = (Variable("p", (), True), Variable("q", ("a",), True), Variable("r", (), False))
    go = ControlNode("n3", "sequence", (ActionNode("n4", "go()", latched=False),))
    root = ControlNode("n1", "skipper", (ConditionNode("n2", condition), go))
    tree = tree_of(root, *variables, actions=(GroundAction("go", (), TRUE, ()),))
    replay = BtcppReplay(tree)
    states = [(p, q, r) for p in (0, 1, 2) for q in (0, 1, 2) for r in (0, 2)]
    for first in states:
        for second in states:
            status = STATUS[value_of(condition, first)]
            run = replay.run(Script(first, (("go()", second),)), "between")
            if status == "running":
                after = STATUS[value_of(condition, second)]
                started = ("go()", "go()") if after == "running" else ("go()",)
                assert run == Run(started, "cut" if after == "running" else after, second)  # type: ignore[arg-type]
            else:
                assert run == Run((), status, first)  # type: ignore[arg-type]


def nested(levels: int, kinds: tuple[ControlKind, ...]) -> Tree:
    """A chain of control nodes with an action at its end."""
    node: Node = ActionNode("n0", "go()")
    for level in range(levels):
        node = ControlNode(f"n{level + 1}", kinds[level % len(kinds)], (node,))
    return tree_of(node, actions=(GroundAction("go", (), TRUE, ()),))


@pytest.mark.parametrize(
    ("levels", "kinds"), [(DEEPEST_TREE - 1, ("sequence", "fallback", "skipper")), (5000, ("sequence",))]
)
def test_deep_trees_are_cut_or_flattened_to_what_the_engine_takes(
    levels: int, kinds: tuple[ControlKind, ...]
) -> None:
    pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    tree = nested(levels, kinds)
    check_form(export(tree))
    run = BtcppReplay(tree).run(Script((), (("go()", ()),)))
    assert run == Run(("go()",), "success", ())


def test_a_tree_too_deep_for_the_engine_is_an_error() -> None:
    with pytest.raises(BbtcError) as error:
        export(nested(5000, ("sequence", "fallback")))
    assert error.value.diagnostics[0].code == "BBT0705"


def test_a_condition_too_deep_to_write_is_an_error() -> None:
    condition: Condition = Is(0, Truth.TRUE)
    for _ in range(5000):
        condition = Not(condition)
    with pytest.raises(BbtcError) as error:
        export(tree_of(ConditionNode("n1", condition), Variable("p", (), True)))
    assert error.value.diagnostics[0].code == "BBT0705"


@pytest.mark.parametrize("around", [0, 9, 119, 120, DEEPEST_TREE - 1])
def test_the_deepest_condition_that_is_taken_keeps_its_value(around: int) -> None:
    pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    condition: Condition = Is(0, Truth.TRUE)
    for level in range(DEEPEST_CONDITION - 1):
        part = Is(1, Truth.TRUE if level % 3 else Truth.FALSE)
        condition = Or((part, condition)) if level % 2 else And((part, condition))
    variables = Variable("p", (), True), Variable("q", (), True)
    root: Node = ConditionNode("n1", condition)
    for level in range(around):
        kind: ControlKind = "fallback" if level % 2 else "sequence"
        root = ControlNode(f"around{level}", kind, (root,))
    tree = tree_of(root, *variables)
    assert Limits().depth <= DEEPEST_CONDITION
    for replay in (BtcppReplay(tree), PyTreesReplay(tree)):
        for values in ((p, q) for p in range(3) for q in range(3)):
            expected = "success" if value_of(condition, values) == "T" else "failure"
            assert replay.run(Script(values, ())).status == expected


def test_a_subtree_cut_out_for_its_depth_behaves_as_in_place() -> None:
    pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    for seed in range(20):
        inner = random_tree(seed)
        root = inner.root
        for level in range(130):
            kind: ControlKind = "fallback" if level % 2 else "sequence"
            root = ControlNode(f"outer{level}", kind, (root,))
        tree = replace(inner, root=root)
        replay = BtcppReplay(tree)
        assert "Part" in replay.source
        for script, expected in varied_runs(tree.task, tree.root, seed, keep=4):
            for timing in TIMINGS:
                assert replay.run(script, timing) == expected


def test_the_notes_say_which_object_a_port_value_stands_for_that_is_spelt_otherwise() -> None:
    text = """(define (domain d) (:predicates (seen ?r))
      (:action look :parameters (?r) :effect (probabilistic 1/2 (seen ?r))))
    (define (problem p) (:domain d) (:objects $left right) (:init) (:goal (and (seen $left) (seen right))))"""
    xml = bbtc.export(bbtc.plan(SourceFile("d.pddl", text), target=0), "btcpp")
    told = re.findall(r'"objects": (\{.*?\})', xml)
    plain = bbtc.export(bbtc.plan(SourceFile("d.pddl", text.replace("$", "")), target=0), "btcpp")
    assert (len(told), '"objects"' in plain) == (1, False)
    ((value, name),) = json.loads(told[0]).items()
    assert name == "$left"
    assert re.fullmatch(r"[A-Za-z_]\w*", value)
