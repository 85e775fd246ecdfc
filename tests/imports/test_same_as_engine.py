"""Edits that look like a tree of ours and are none: in the engine they do something else."""

from __future__ import annotations

import random
import re

import pytest

from bbtc.diagnostics import BbtcError
from tests.imports.samples import check_in_engine, exported, idioms_tree, read, refusal

TREE = idioms_tree()
STOCK, OURS = exported(TREE, "stock"), exported(TREE, "bbtc")
STATE, RETRY = "@find_can_attempt_1", 'RetryUntilSuccessful num_attempts="3"'
UNKNOWN_FIRST = '<ReactiveSequence><Seen item="can"/><Seen item="cup"/></ReactiveSequence>'
MINIMUM = '<Parallel success_count="2" failure_count="1"><Seen item="can"/><Lit/></Parallel>'


def ports(text: str) -> str:
    """A text with the ports as the sample has them, which has no parameters' names."""
    return text.replace("item=", "arg=")


def block(text: str, tag: str, inside: str) -> str:
    """The innermost element with some text in it."""
    end = text.index(inside)
    start = text.rindex(f"<{tag}", 0, end)
    depth, at = 0, start
    for found in re.finditer(rf"<(/?){tag}\b[^>]*?(/?)>", text[start:]):
        depth += {"": 1, "/": -1}[found.group(1)] - (found.group(2) == "/")
        at = start + found.end()
        if depth == 0:
            break
    return text[start:at]


def before_end(text: str, added: str) -> str:
    """A file with something more to do in its first ReactiveFallback."""
    at = text.index("<ReactiveFallback>") + len("<ReactiveFallback>")
    return text[:at] + added + text[at:]


ONCE = block(STOCK, "Switch2", "<SwitchOn")


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (before_end(STOCK, ports(f"<Inverter>{UNKNOWN_FIRST}</Inverter>")), "unknown part"),
        (before_end(STOCK, ports(f"<Inverter>{MINIMUM}</Inverter>")), "'Parallel'"),
        (before_end(STOCK, ports(f"<ReactiveSequence>{MINIMUM}</ReactiveSequence>")), "'Parallel'"),
        (before_end(STOCK, '<Inverter><ReactiveSequence/></Inverter>'), "'ReactiveSequence'"),
        (before_end(STOCK, '<Inverter name="x"><Lit/><Lit/></Inverter>'), "'Inverter'"),
        (before_end(STOCK, '<SubTree ID="FindCan_UnknownSeen" arg="7"/>'), "the number '7'"),
        (before_end(OURS, '<Latch flag="other"><SwitchOn/></Latch>'), "sets 'other'"),
        (before_end(OURS, '<Latch flag="{acting}"><SwitchOn/></Latch>'), "'flag'"),
        (before_end(OURS, '<Latch keep="{x}"><SwitchOn/></Latch>'), "'keep'"),
        (before_end(OURS, '<Latch keep="no"><SwitchOn/></Latch>'), "'keep'"),
        (STOCK.replace(ONCE, ONCE.replace("acting", "other")), "sets 'other'"),
        (STOCK.replace("@acting := true", "@other := true", 1), "'if'"),
        (STOCK.replace("@find_can_running := true", "@other := true", 1), "'_onSuccess'"),
        (STOCK.replace(ONCE, ONCE.replace("@find_can_running", "@other")), "does not tell that it runs"),
        (STOCK.replace("; @find_can_running := false", "", 3), "'_onSuccess'"),
        (STOCK.replace("held := 'true'", "@other := 'true'", 1), "'_onFailure'"),
        (STOCK.replace('case_1="true"', 'case_1="yes"', 1), "'case_1'"),
        (STOCK.replace('held="{@find_can_held_lit}"', 'held="{@find_can_held_seen_can}"', 1), "two facts"),
        (STOCK.replace('held="{@find_can_held_lit}"', 'held="{held}"', 1), "has no value"),
        (STOCK.replace("@acting := @find_can_running", "@acting := @other", 1), "'code'"),
        (STOCK.replace("@find_can_held_lit := 'live'; ", "", 1), "nothing sets '@find_can_held_lit' back"),
        (STOCK.replace("@find_can_ended == 'success'", "@find_can_ended == 'failure'", 1), "'code'"),
        (STOCK.replace("!@acting", "!@other", 1), "'if'"),
        (STOCK.replace('if="!@acting" else="RUNNING"', 'if="!@acting"', 1), "lacks the attribute 'else'"),
        (STOCK.replace('else="RUNNING"', 'else="SUCCESS"', 1), "'else'"),
        (STOCK.replace("; _started := 'yes'", "", 1), "'code'"),
        (STOCK.replace('then_skip="false"', 'then_skip="true"', 1), "'then_skip'"),
        (STOCK.replace("attempts_left_1 -= 1", "attempts_left_1 -= 2", 1), "'code'"),
        (STOCK.replace("attempts_left_1 &gt; 0", "attempts_left_1 &gt; 1", 1), "'code'"),
        (STOCK.replace("@find_can_attempts_left_1", "left"), "'code'"),
        (before_end(STOCK, block(STOCK, "ReactiveSequence", "attempts_left_1 := ")), "two retry nodes"),
        (before_end(STOCK, block(STOCK, "ReactiveSequence", f'code="{STATE} := ')), "two nodes tell by"),
        (before_end(STOCK, f"<{RETRY}><Lit/></RetryUntilSuccessful>"), "no counterpart"),
        (STOCK.replace(f"{STATE} == 'new'", f"{STATE} == 'begun'"), "'code'"),
        (STOCK.replace(f"{STATE} != 'hopeless'", "@other != 'hopeless'"), "'code'"),
        (STOCK.replace('num_attempts="3"', 'num_attempts="-1"'), "'num_attempts'"),
        (STOCK.replace(f"; {STATE} := 'new'", "", 1), "'_onFailure' must make everything below"),
        (STOCK.replace("@find_can_latch_1 := 'none'; ", ""), "must make everything below forget"),
        (STOCK.replace("left_2 := 1; @find", "left_2 := 9; @find"), "must make everything below"),
        (STOCK.replace("@find_can_latch_1", "_latch"), "keeps its status for good"),
        (STOCK.replace("_latch := ", "@kept := ").replace("{_latch}", "{@kept}"), "which nothing sets back"),
        (before_end(OURS, block(OURS, "ReactiveSequence", "<RunOnce")), "two retry nodes"),
    ],
)  # fmt: skip
def test_what_the_engine_would_do_otherwise_is_refused(text: str, named: str) -> None:
    found = refusal(text, TREE.task)
    assert any(named in each.message for each in found), found


def test_two_actions_of_a_tree_do_not_share_an_entry() -> None:
    latch = block(STOCK, "Switch2", "<SwitchOn")
    both = STOCK.replace(latch, f"<ReactiveSequence>{latch}{latch}</ReactiveSequence>", 1)
    with pytest.raises(BbtcError, match="keeps its state in '_latch'"):
        read(both, TREE.task)
    # In a BehaviorTree of its own, called twice, each has an entry of its own.
    call = next(iter(re.findall(r"<SubTree ID=\"\w+SwitchOnOnce\"[^>]*>", STOCK)))
    twice = STOCK.replace(
        call,
        f"<ReactiveSequence>{call}{call.replace('()', '(2)')}</ReactiveSequence>",
    )
    assert read(twice, TREE.task)[0].tree.root != TREE.root
    check_in_engine(TREE, twice, random.Random(2), 20)


@pytest.mark.parametrize("nodes", ["stock", "bbtc"])
def test_a_file_without_its_last_branch_is_read_with_a_warning(nodes: str) -> None:
    text = exported(TREE, nodes)
    around = "Committed" if nodes == "bbtc" else "ForceSuccess"
    inside = block(text, around, "<ReactiveFallback")
    inside = re.sub(r' _on\w+="@find_can_ended[^"]*"', "", inside[len(around) + 2 : -len(around) - 3])
    outer = text[text.index("<", text.index("Made by bbtc")) : text.index("</BehaviorTree>")]
    if nodes == "stock":  # the entries of facts that are held are set there, too
        found = refusal(text.replace(outer, inside), TREE.task)
        assert {each.code for each in found} == {"BBT0616"}
        assert all("back to 'live'" in each.message for each in found)
        return
    imported, doubts = read(text.replace(outer, inside), TREE.task)
    assert imported.tree == TREE
    # Only what tells that an action runs is left of what commits the tree to it.
    assert [(doubt.code, doubt.severity.value) for doubt in doubts] == [("BBT0620", "warning")]
