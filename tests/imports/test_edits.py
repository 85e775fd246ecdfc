"""Files edited by hand: what was edited counts, and the rest keeps its ids; and files that no tree can
stand for are refused with the place of everything that is wrong."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction

import pytest

from bbtc.backends.btcpp.exporter import btcpp
from bbtc.backends.btcpp.reader.xml import tree_from_btcpp
from bbtc.diagnostics import BbtcError, LimitReached, Report
from bbtc.limits import Limits
from bbtc.pipeline import import_tree
from bbtc.source import SourceFile
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Tree, walk
from tests.strategies import soda_tree


def exported(tree: Tree, **options: str | bool) -> str:
    return btcpp.export(tree, options, None)


def read(text: str, tree: Tree | None = None, limits: Limits | None = None) -> Tree:
    task = (tree or soda_tree()).task
    return tree_from_btcpp(SourceFile("tree.xml", text), task, Report(), limits).tree


def faults(text: str) -> list[tuple[str, str, str]]:
    """Code, place and message of everything that is wrong with a file."""
    with pytest.raises(BbtcError) as error:
        read(text)
    return [
        (d.code, "" if d.span is None else d.span.place.removeprefix("tree.xml:"), d.message)
        for d in error.value.diagnostics
    ]


def swap(text: str, old: str, new: str, count: int = 1) -> str:
    assert old in text
    return text.replace(old, new, count)


def place_of(text: str, part: str) -> str:
    """Line and column of the first place of some text."""
    before = text[: text.index(part)]
    return f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"


STOCK, OURS = exported(soda_tree()), exported(soda_tree(), nodes="bbtc")
BARE = re.sub(r"<Held>\s*(<[^>]*/>)\s*</Held>", r"\1", OURS)
"""The same with conditions that nothing holds."""


# --- what was edited counts ------------------------------------------------------------------


def test_a_condition_added_by_hand_is_read_and_the_other_nodes_keep_their_ids() -> None:
    known = '<SubTree ID="LookForSoda_KnownSeen"'
    edited = swap(OURS, known, f"<Inverter><LuminousityOk /></Inverter>{known}")
    tree, before = read(edited), soda_tree()
    old, new = list(walk(before.root)), list(walk(tree.root))
    assert len(new) == len(old) + 1
    added = [node for node in new if node.id not in {each.id for each in old}]
    assert [type(node) for node in added] == [ConditionNode]
    kept = {node.id: node for node in new}
    assert all(kept[node.id] == node for node in old if not isinstance(node, ControlNode))


@pytest.mark.parametrize("text", [STOCK, OURS], ids=["stock", "bbtc"])
def test_an_action_removed_by_hand_changes_the_figures(text: str) -> None:
    found = re.search(
        r" *<(SubTree ID=\"\w+_LightOnOnce\"|Latch name=\"light_on)[^>]*>(?:\s*<LightOn />\s*</Latch>)?",
        text,
    )
    assert found is not None
    report = Report()
    source = SourceFile("tree.xml", swap(text, found.group(), ""))
    task = SourceFile("tree.json", _json(soda_tree()))
    tree = import_tree(source, [task], report, Limits())
    assert [node.action for node in walk(tree.root) if isinstance(node, ActionNode)] == ["detect(soda)"]
    assert tree.success_probability == Fraction(0)
    # The BehaviorTree that nobody calls any longer is told, too.
    assert [d.code for d in report] == (["BBT0801", "BBT0618"] if text is STOCK else ["BBT0801"])
    assert tree.bounds == soda_tree().bounds


def _json(tree: Tree) -> str:
    from bbtc.artefacts import dumps, tree_to_json

    return dumps(tree_to_json(tree))


def test_labels_and_reasons_edited_by_hand_are_read() -> None:
    edited = swap(OURS, '_description="for seen(soda)"', 'name="look" _description="for the soda"')
    (node,) = [node for node in walk(read(edited).root) if node.name == "look"]
    assert node.reason == "the soda"


def test_a_latch_turned_off_by_hand_is_read() -> None:
    tree = read(swap(OURS, '<Latch name="detect(soda)"', '<Latch name="detect(soda)" keep="false"'))
    assert [node.latched for node in walk(tree.root) if isinstance(node, ActionNode)] == [True, False]


def test_a_subtree_made_by_hand_is_read_in_its_place() -> None:
    own = (
        '<BehaviorTree ID="Look"><ReactiveSequence><Latch><Detect arg="{thing}" /></Latch>'
        '<Seen arg="{thing}" /></ReactiveSequence></BehaviorTree>'
    )
    edited = swap(OURS, '<Latch name="detect(soda)"', '<SubTree ID="Look" thing="soda" name="look"/><Latch')
    tree = read(swap(edited, "<TreeNodesModel>", own + "<TreeNodesModel>"))
    (look,) = [node for node in walk(tree.root) if node.name == "look"]
    assert isinstance(look, ControlNode)
    assert [type(child) for child in look.children] == [ActionNode, ConditionNode]


def test_the_long_spelling_of_nodes_is_read() -> None:
    edited = re.sub(r"<Skipper( name=\"[^\"]*\")?>", r'<Control ID="Skipper"\1>', OURS)
    edited = edited.replace("</Skipper>", "</Control>")
    edited = edited.replace('<Detect arg="soda" />', '<Action ID="Detect" arg="soda" />')
    edited = edited.replace('<Seen arg="soda" />', '<Condition ID="Seen" arg="soda" />')
    assert read(edited) == soda_tree()


def test_a_file_without_the_guard_against_endless_ticking_is_read() -> None:
    assert read(re.sub(r"</?Committed>", "", OURS)) == soda_tree()


def test_notes_of_another_tree_change_nothing_but_ids_and_claims() -> None:
    other = exported(replace(soda_tree(), success_probability=Fraction(1, 7)))
    notes = other[other.index("<!--") : other.index("-->")]
    edited = OURS[: OURS.index("<!--")] + notes.replace('"n4"', '"x"') + OURS[OURS.index("-->") :]
    tree = read(edited)
    assert tree.success_probability == Fraction(1, 7)
    assert [node.id for node in walk(tree.root)][3] == "x"


@pytest.mark.parametrize(
    "notes", ["", "[]", "{}", '{"version": 1}', "[" * 100_000, '{"version": 1, "ids": [["n1"]]}', "\\u0000"]
)
def test_notes_that_are_broken_are_left_out_with_a_warning(notes: str) -> None:
    edited = re.sub(r"shows?:.*-->|show:.*-->", lambda _: f"show:{notes}-->", OURS, flags=re.DOTALL)
    report = Report()
    tree = tree_from_btcpp(SourceFile("tree.xml", edited), soda_tree().task, report).tree
    assert [d.code for d in report] == ["BBT0617"]
    assert [node.id for node in walk(tree.root)][:2] == ["n1", "n2"]


# --- what a tree cannot hold is named with its place -----------------------------------------

ATTEMPT = '<ScriptCondition code="@x &gt; 0" /><Script code="@x -= 1" />'


@pytest.mark.parametrize(
    ("old", "new", "code", "at"),
    [
        ('<Seen arg="soda" />', '<Sleep msec="3" />', "BBT0616", "<Sleep"),
        ('<Seen arg="soda" />', '<Detect arg="soda" />', "BBT0616", "<Detect"),
        ('<Seen arg="soda" />', '<Sene arg="soda" />', "BBT0616", "<Sene"),
        ('<Seen arg="soda" />', '<Seen arg="cola" />', "BBT0606", 'arg="cola"'),
        ('<Seen arg="soda" />', '<Seen arg="{item}" />', "BBT0606", 'arg="{item}"'),
        ('<Seen arg="soda" />', "<Seen />", "BBT0603", "<Seen />"),
        ('<Seen arg="soda" />', '<Seen item="soda" />', "BBT0603", 'item="soda"'),
        ('<Seen arg="soda" />', '<Seen arg="soda" x="1" />', "BBT0603", 'x="1"'),
        ('<Seen arg="soda" />', '<Seen arg="soda" _skipIf="true" />', "BBT0616", '_skipIf="true"'),
        ('<Seen arg="soda" />', '<Inverter><Detect arg="soda" /></Inverter>', "BBT0606", "<Detect"),
        ('<Seen arg="soda" />', "<ReactiveSequence />", "BBT0611", "<ReactiveSequence />"),
        ('<Seen arg="soda" />', '<SubTree ID="Gone" />', "BBT0606", 'ID="Gone"'),
        ('<Seen arg="soda" />', '<SubTree ID="LookForSoda" />', "BBT0612", '<SubTree ID="LookForSoda"'),
        ("<Held>", '<Held><Detect arg="soda" /></Held><Held>', "BBT0616", "<Detect"),
        ("<Held>", "<Held><Inverter><LuminousityOk /></Inverter></Held><Held>", "BBT0616", "<Inverter"),
        ("<Held>", "<Held><LuminousityOk /><LuminousityOk /></Held><Held>", "BBT0616", "<Held><Lumin"),
        ("<Held>", '<Latch sets="Seen"><Detect arg="soda" /></Latch><Held>', "BBT0616", 'sets="Seen"'),
        ("<Held>", '<Latch sets="Seen(arg=x)"><Detect arg="soda" /></Latch><Held>', "BBT0606", "<Latch sets"),
        ('<Seen arg="soda" />', '<include path="x.xml" />', "BBT0616", "<include"),
        ('<Detect arg="soda" />', '<Grasp arg="soda" />', "BBT0616", "<Grasp"),
        ('<Detect arg="soda" />', '<LuminousityOk/><Detect arg="soda" />', "BBT0616", "<LuminousityOk/>"),
        ('<Detect arg="soda" />', f'{ATTEMPT}<Detect arg="soda" />', "BBT0613", '<Latch name="detect(soda)"'),
        ("<LuminousityOk />", '<LightOn /><LuminousityOk />', "BBT0616", "<LightOn />"),
        ("<ReactiveFallback>", "<Fallback>", "BBT0616", "<Fallback"),
        ('BTCPP_format="4"', 'BTCPP_format="3"', "BBT0615", "<root"),
        ('main_tree_to_execute="LookForSoda"', 'main_tree_to_execute="X"', "BBT0615", "main_tree_to"),
        ("<Skipper>", "<Skipper><Latch><LightOn /></Latch>", "BBT0610", "<Latch><LightOn"),
    ],
)  # fmt: skip
def test_what_has_no_counterpart_is_named_with_its_place(old: str, new: str, code: str, at: str) -> None:
    edited = swap(OURS if "<Held>" in old else BARE, old, new)
    if new == "<Fallback>":  # the outer one of two
        end = edited.rindex("</ReactiveFallback>")
        edited = edited[:end] + edited[end:].replace("ReactiveFallback", "Fallback", 1)
    found = faults(edited)
    assert (code, place_of(edited, at)) in [(code, place) for code, place, _ in found], found
    assert all(place for _, place, _ in found)


def test_everything_that_is_wrong_is_reported_at_once() -> None:
    edited = swap(swap(OURS, 'arg="soda"', 'arg="a"'), '<Detect arg="soda"', '<Detect arg="b"')
    assert [code for code, _, _ in faults(edited)] == ["BBT0606", "BBT0606"]


@pytest.mark.parametrize("script", ["_latch := 'success'", "@acting := true"])
def test_an_idiom_whose_scripts_were_edited_is_refused(script: str) -> None:
    edited = STOCK.replace(script, "x := 1")
    assert {code for code, _, _ in faults(edited)} == {"BBT0616"}


def test_a_tree_for_another_problem_is_refused() -> None:
    tree = soda_tree()
    other = replace(tree, task=replace(tree.task, problem="another"))
    with pytest.raises(BbtcError) as error:
        read(OURS, other)
    assert [d.code for d in error.value.diagnostics] == ["BBT0604"]


# --- files of strangers ----------------------------------------------------------------------

LAUGHS = '<!DOCTYPE root [<!ENTITY a "ha">' + "".join(
    f'<!ENTITY {chr(98 + i)} "&{chr(97 + i)};&{chr(97 + i)};&{chr(97 + i)};">' for i in range(20)
)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (LAUGHS + "]><root>&u;</root>", "BBT0614"),
        ('<!DOCTYPE root SYSTEM "file:///etc/passwd"><root/>', "BBT0614"),
        ('<!DOCTYPE root [<!ENTITY x SYSTEM "file:///etc/passwd">]><root>&x;</root>', "BBT0614"),
        ("<root>&undefined;</root>", "BBT0614"),
        ("<root", "BBT0614"),
        ("<root></toor>", "BBT0614"),
        ("<root/><root/>", "BBT0614"),
        ('<root a="1" a="2"/>', "BBT0614"),
        ("<root>\x01</root>", "BBT0614"),
        ("<a>" * 100_000, "BBT0605"),
        ("<svg/>", "BBT0615"),
        ('<root BTCPP_format="4"/>', "BBT0615"),
        ('<root BTCPP_format="4"><BehaviorTree ID="a"/></root>', "BBT0615"),
        ('<root BTCPP_format="4"><BehaviorTree ID="a"><SubTree ID="a"/></BehaviorTree></root>', "BBT0612"),
    ],
)
def test_hostile_files_are_refused(text: str, code: str) -> None:
    assert [found for found, _, _ in faults(text)] == [code]
    assert all(place for _, place, _ in faults(text))


@pytest.mark.parametrize("leaf", ["<LuminousityOk/>", "<Inverter><LuminousityOk/></Inverter>"])
@pytest.mark.parametrize("both", ["ReactiveSequence", 'ReactiveSequence name="(x and y)"'])
def test_trees_that_double_and_double_again_meet_a_limit(both: str, leaf: str) -> None:
    trees = "".join(
        f'<BehaviorTree ID="t{i}"><{both}><SubTree ID="t{i + 1}"/><SubTree ID="t{i + 1}"/>'
        f"</{both.split(maxsplit=1)[0]}></BehaviorTree>"
        for i in range(60)
    )
    text = (
        f'<root BTCPP_format="4" main_tree_to_execute="t0">{trees}'
        f'<BehaviorTree ID="t60">{leaf}</BehaviorTree></root>'
    )
    with pytest.raises(LimitReached):
        read(text, limits=Limits(nodes=500))


def named(*trees: str) -> str:
    """A file of trees M, t1, t2, …"""
    ids = ["M", *(f"t{number}" for number in range(1, len(trees)))]
    inside = "".join(
        f'<BehaviorTree ID="{name}">{tree}</BehaviorTree>' for name, tree in zip(ids, trees, strict=True)
    )
    return f'<root BTCPP_format="4" main_tree_to_execute="M">{inside}</root>'


def around(tag: str, inside: str, times: int = 1) -> str:
    """Elements in others."""
    return f"<{tag}>" * times + inside + f"</{tag.split(maxsplit=1)[0]}>" * times


MANY = 20_000
PORTS = " ".join(f'a{number}="x"' for number in range(MANY))
SCRIPTED = " ".join(f'_a{number}="x"' for number in range(MANY))
LATER = [f'<SubTree ID="t{number}" _autoremap="true"/>' for number in range(2, 202)]


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (named(f"<LuminousityOk {PORTS}/>"), "BBT0603"),
        (named(f"<LuminousityOk {SCRIPTED}/>"), "BBT0616"),
        (named("<LuminousityOk/>").replace("<root", f"<root {PORTS}"), "BBT0616"),
        (named(f'<SubTree ID="t1" {PORTS}/>', *LATER, "<LuminousityOk/>"), "BBT0007"),
        (named(around("ReactiveSequence", "<LuminousityOk/>" * MANY)), "BBT0007"),
        (named(around("ReactiveSequence", '<LuminousityOk _skipIf="x"/>' * 900)), "BBT0616"),
        (named("<LuminousityOk/>" + "x<!-- -->" * MANY), "BBT0616"),
        (named(around("ReactiveSequence name='x'", "<LuminousityOk/>" * 900, 100)), "BBT0007"),
        (named("<LuminousityOk/>").replace("M", "M" * MANY, 1), "BBT0615"),
        (named("<LuminousityOk/>").replace('ID="M"', "").replace('main_tree_to_execute="M"', ""), "BBT0615"),
        (named("<LuminousityOk/>", "<LuminousityOk/>").replace("t1", "M"), "BBT0607"),
        (named("<LuminousityOk/>", '<SubTree ID="M"/>').replace('"M"', '"t1"', 1), ""),
        (named('<SubTree ID="t1"/>', '<SubTree ID="M"/>'), "BBT0612"),
    ],
)  # fmt: skip
def test_files_made_to_be_slow_end_soon(text: str, code: str) -> None:
    """They take work that grows with the file, or meet a limit; and 50 messages at most."""
    report = Report()
    try:
        tree_from_btcpp(SourceFile("tree.xml", text), soda_tree().task, report, Limits(nodes=2_000))
    except BbtcError as error:
        found = list(error.diagnostics)
    else:
        found = []
    assert {each.code for each in found} == ({code} if code else set())
    assert len(found) <= 50


def test_a_condition_nested_through_trees_is_refused() -> None:
    """BehaviorTrees that call one another make levels that XML does not have."""

    def nested(tag: str) -> str:
        calls = [around(tag, f'<SubTree ID="t{number}"/>', 100) for number in range(1, 101)]
        return named(*calls, "<LuminousityOk/>")

    assert isinstance(read(nested("Inverter"), None).root, ConditionNode)
    deep = nested("ReactiveSequence").replace('ID="M">', 'ID="M"><Inverter>', 1)
    deep = deep.replace("</BehaviorTree>", "</Inverter></BehaviorTree>", 1)
    assert [code for code, _, _ in faults(deep)] == ["BBT0605"]


def test_a_chain_of_very_many_trees_is_refused() -> None:
    chain = "".join(f'<BehaviorTree ID="t{i}"><SubTree ID="t{i + 1}"/></BehaviorTree>' for i in range(3000))
    text = (
        f'<root BTCPP_format="4" main_tree_to_execute="t0">{chain}'
        '<BehaviorTree ID="t3000"><LuminousityOk/></BehaviorTree></root>'
    )
    assert [code for code, _, _ in faults(text)] == ["BBT0605"]


def test_a_tree_deeper_than_trees_are_is_refused() -> None:
    inner = "<ReactiveSequence>" * 200 + '<SubTree ID="b"/>' + "</ReactiveSequence>" * 200
    outer = inner.replace('<SubTree ID="b"/>', "<LuminousityOk/>")
    text = (
        '<root BTCPP_format="4" main_tree_to_execute="a">'
        f'<BehaviorTree ID="a">{inner}</BehaviorTree><BehaviorTree ID="b">{outer}</BehaviorTree></root>'
    )
    assert [code for code, _, _ in faults(text)] == ["BBT0605"]
