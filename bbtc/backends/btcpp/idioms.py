"""What the nodes of a BBT are written as in BehaviorTree.CPP: from stock nodes, or with two of ours.

Two profiles: ``stock`` writes Skippers as Parallels and keeps latches in BehaviorTrees of their own;
``bbtc`` uses the control nodes Skipper and Latch of ``bbtc_nodes.hpp``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, TypeAlias
from xml.etree.ElementTree import Element, SubElement

from typing_extensions import assert_never

from bbtc.tree.nodes import ControlKind

Profile: TypeAlias = Literal["stock", "bbtc"]

SKIPPER, LATCH, HELD, COMMITTED, WHILE = "Skipper", "Latch", "Held", "Committed", "While"
"""Ids of our own nodes: two control nodes, and what stands around leaves and around the tree."""

UNTIL_SUCCESS = "RetryUntilSuccessful"
TIMEOUT = "Timeout"
RESULT = "_result"
"""The entry in which an action that may be given up tells how it ended by itself."""

SKIPPER_LABEL = "skipper"
"""The name that a Parallel gets where the Skipper has none."""

_RETRY_LABEL = re.compile("at most [0-9]+ attempts?")

BLOCKED_LABEL = "until blocked"
HOLD_LABEL = "hold what it may set"
WHILE_LABEL = "goes on while"
WHEN_READY_LABEL = "start when ready"


@dataclass(frozen=True, slots=True)
class Idioms:
    """Writes nodes in one profile. ``prefix`` comes before the names of entries of the root blackboard,
    ``own`` before those of entries that must outlive a tick: other trees may have that blackboard, too."""

    profile: Profile = "stock"
    prefix: str = ""
    own: str = ""

    @property
    def acting(self) -> str:
        """The entry that tells whether an action ran when the tick began, or runs by now."""
        return f"{self.prefix}acting"

    @property
    def running(self) -> str:
        """The entry that tells whether an action runs."""
        return f"@{self.own}running"

    def counter(self, number: int) -> str:
        """The entry that counts the attempts a retry node has left."""
        return f"@{self.own}attempts_left_{number}"

    def attempt_state(self, number: int) -> str:
        """The entry that tells how far the attempt of a retry-until-success node is."""
        return f"@{self.own}attempt_{number}"

    def latch_entry(self, number: int) -> str:
        """The entry that tells how an action ended that is latched for an attempt only."""
        return f"@{self.own}latch_{number}"

    # --- control nodes -----------------------------------------------------------------------

    def control(self, kind: ControlKind, children: Sequence[Element]) -> Element:
        """A memoryless control node (those that count attempts have a method each). The engine refuses
        control nodes without children; they return the status they go on with."""
        match kind:
            case "sequence":
                return _around("ReactiveSequence" if children else "AlwaysSuccess", children)
            case "fallback":
                return _around("ReactiveFallback" if children else "AlwaysFailure", children)
            case "skipper" if not children:
                return decorated("KeepRunningUntilFailure", Element("AlwaysSuccess"))
            case "skipper" if self.profile == "bbtc":
                return _around(SKIPPER, children)
            case "skipper":
                element = _around("Parallel", children)
                element.set("success_count", "1")
                element.set("failure_count", "1")
                return element
            case "retry" | "retry-until-success":
                raise ValueError("a retry node has its own form")
            case _:
                assert_never(kind)

    def retry(self, counter: str, attempts: int, child: Element) -> Element:
        """The child, and the number of attempts that actions below it may make, set once."""
        once = Element("RunOnce", then_skip="false")
        SubElement(once, "Script", code=full_again(counter, attempts))
        element = self.control("sequence", [once, child])
        element.set("name", f"at most {attempts} attempt{'s' if attempts > 1 else ''}")
        return element

    def retry_until_success(
        self, state: str, attempts: int, child: Element, forget: Sequence[str]
    ) -> Element:
        """The child, tried so often; after each time, scripts ``forget`` what is remembered below. After an
        attempt that fails in the tick that it begins in, the engine's node would be RUNNING, and what runs
        elsewhere be halted: such an attempt is the last, for the next ones would fail likewise."""
        once = Element("RunOnce", then_skip="false")
        SubElement(once, "Script", code=f"{state} := 'new'")
        begun = decorated("KeepRunningUntilFailure", Element("Script", code=f"{state} := 'begun'"))
        at_once = Element("ScriptCondition", code=f"{state} == 'new'", _onSuccess=f"{state} := 'hopeless'")
        attempt = self.control("fallback", [self.control("skipper", [child, begun]), at_once])
        for event, script in attempt_ends(state, forget).items():
            attempt.set(event, script)
        retry = decorated(UNTIL_SUCCESS, attempt)
        retry.set("num_attempts", str(attempts))
        done = Element("ScriptCondition", code=f"{state} != 'hopeless'")
        done.set("_onSuccess", f"{state} := 'new'")
        done.set("_onFailure", f"{state} := 'new'")
        return self.control("sequence", [once, retry, done])

    def until_blocked(self, root: Element, entries: Sequence[str]) -> Element:
        """The tree, and FAILURE as soon as it is running while no action is: nothing can change
        then, and a loop that ticks while RUNNING would never end. A tick that passes by an action that
        ran is RUNNING. While none runs, the facts of these entries are read as they are."""
        if self.profile == "bbtc":
            return decorated(COMMITTED, root)
        once = Element("RunOnce", then_skip="false")
        SubElement(once, "Script", code=f"{self.running} := false")
        first = [once]
        if entries:
            live = Element("Precondition", {"if": f"!{self.running}", "else": "SUCCESS"})
            SubElement(live, "Script", code="; ".join(f"{entry} := 'live'" for entry in entries))
            first.append(live)
        ended = f"@{self.own}ended"
        root.set("_onSuccess", f"{ended} := 'success'")
        root.set("_onFailure", f"{ended} := 'failure'")
        told = Element("Precondition", {"if": f"!@{self.acting}", "else": "RUNNING"})
        SubElement(told, "ScriptCondition", code=f"{ended} == 'success'")
        script = Element("Script", code=f"@{self.acting} := {self.running}")
        ticked = self.control("sequence", [*first, script, decorated("ForceSuccess", root), told])
        blocked = Element("Precondition", {"if": f"!@{self.acting}", "else": "RUNNING"})
        SubElement(blocked, "AlwaysFailure", name="blocked: nothing can observe what is unknown")
        outer = self.control("skipper", [ticked, blocked])
        outer.set("name", BLOCKED_LABEL)
        return outer

    # --- actions -----------------------------------------------------------------------------

    def start_conditions(
        self, guard: Element | None, counters: Sequence[str], notes: Sequence[Element] = ()
    ) -> list[Element]:
        """What must succeed, in this order, before an action starts: its guard; an attempt left of every
        retry node around it; that no action ran when the tick began; then the attempt is used up, and notes
        are made of what the action may set. Our own nodes do the third and the last."""
        needed = [] if guard is None else [guard]
        if counters:
            needed.append(Element("ScriptCondition", code=" && ".join(f"{c} > 0" for c in counters)))
        if self.profile == "stock":
            free = Element("Precondition", {"if": f"!@{self.acting}", "else": "RUNNING"})
            SubElement(free, "AlwaysSuccess")
            # All of it in each tick, until it succeeds.
            needed = [self.control("sequence", [*needed, free]) if needed else free]
        if counters:
            needed.append(Element("Script", code="; ".join(f"{c} -= 1" for c in counters)))
        if notes:
            needed.append(self.control("sequence", notes))
            needed[-1].set("name", HOLD_LABEL)
        return needed

    def latch(
        self, action: Element, needed: Sequence[Element], latched: bool, during: Element | None = None
    ) -> Element:
        """The action with our node Latch, which does what :meth:`latched` or :meth:`unlatched` does."""
        goes_on = [] if during is None else [decorated(WHILE, during)]
        element = _around(LATCH, [*needed, *goes_on, action])
        if not latched:
            element.set("keep", "false")
        return element

    def latched(
        self,
        action: Element,
        needed: Sequence[Element],
        during: Element | None = None,
        entry: str = "_latch",
    ) -> Element:
        """Runs the action once. Its status is withheld until the next tick, because conditions to the
        left were read before its effect; then it is kept. Halted after its start counts as run."""
        latch = Element("Switch2", variable=f"{{{entry}}}", case_1="success", case_2="failure")
        SubElement(latch, "AlwaysSuccess")
        SubElement(latch, "AlwaysFailure")
        own, more = "'success'", ""
        if len(action):  # given up, it counts as run; where it failed by itself, it has failed
            action[0][0].set("_onFailure", f"{RESULT} := 'failure'")
            own, more = RESULT, f"; {RESULT} := 'success'"
        for event, status in (("_onSuccess", own), ("_onFailure", "'failure'"), ("_onHalted", "'success'")):
            action.set(event, f"{entry} := {status}; {self.running} := false")
        # With memory: once the action runs, its own effect may end its precondition.
        started = SubElement(latch, "Sequence", name=WHEN_READY_LABEL)
        started.extend([*needed, self._running(action, more, during)])
        return latch

    def unlatched(self, action: Element, needed: Sequence[Element], during: Element | None = None) -> Element:
        """Runs the action whenever it is ticked, again and again."""
        for event in ("_onSuccess", "_onFailure", "_onHalted"):
            action.set(event, f"_started := 'no'; {self.running} := false")
        running = self._running(action, "; _started := 'yes'", during)
        ready = Element("Switch2", variable="{_started}", case_1="yes", case_2="never")
        SubElement(ready, "AlwaysSuccess")
        SubElement(ready, "AlwaysFailure")
        ready.append(needed[0] if len(needed) == 1 else self.control("sequence", needed))
        running.insert(0, ready)
        return running

    def _running(self, action: Element, more: str, during: Element | None) -> Element:
        """The action, which tells that it runs, and is halted where ``during`` is no longer true."""
        script = f"@{self.acting} := true; {self.running} := true{more}"
        keep = decorated("KeepRunningUntilFailure", decorated("ForceSuccess", action))
        started = [Element("Script", code=script), keep]
        if during is not None:
            begins = Element("ScriptCondition", code=f"!{self.running}")
            started.insert(0, self.control("fallback", [begins, during, self.control("skipper", [])]))
            started[0].set("name", WHILE_LABEL)
        return self.control("sequence", started)

    # --- what is held ------------------------------------------------------------------------

    def held(self, leaf: Element, entry: str) -> Element:
        """What a condition reads: what its entry (as the value of a port) says, unless that is ``live``."""
        if self.profile == "bbtc":
            return decorated(HELD, leaf)
        element = Element("Switch3", variable=entry, case_1="true", case_2="false", case_3="unknown")
        for tag in ("AlwaysSuccess", "AlwaysFailure"):
            SubElement(element, tag)
        element.extend([self.control("skipper", []), leaf])
        return element

    def note(self, leaf: Element, entry: str) -> Element:
        """Writes what a condition reads to an entry (by its name in a script)."""
        leaf.set("_onSuccess", f"{entry} := 'true'")
        leaf.set("_onFailure", f"{entry} := 'false'")
        unknown = Element("Script", code=f"{entry} := 'unknown'")
        return decorated("ForceSuccess", self.control("skipper", [leaf, unknown]))

    def given_up(self, leaf: Element, seconds: Fraction) -> Element:
        """The action, which has ended when it is given up after so many seconds."""
        limit = decorated(TIMEOUT, leaf)
        limit.set("msec", str(milliseconds(seconds)))
        return decorated("ForceSuccess", limit)

    # --- tests and registers -----------------------------------------------------------------

    def test(self, kind: Literal["known", "unknown"], leaf: Element) -> Element:
        """Success or failure for whether a condition is known (unknown)."""
        known = kind == "known"
        forced = decorated("ForceSuccess" if known else "ForceFailure", leaf)
        return self.control("skipper", [forced, Element("AlwaysFailure" if known else "AlwaysSuccess")])

    def read_at_once(self, condition: Element) -> Element:
        """The result of a Parallel, which is not left running when the tick ends: it goes to an entry
        of the blackboard, and is read back."""
        condition.set("_onSuccess", "_value := 'true'")
        condition.set("_onFailure", "_value := 'false'")
        unknown = Element("Script", code="_value := 'unknown'")
        read = self.control("skipper", [decorated("ForceSuccess", condition), unknown])
        answer = Element("Precondition", {"if": "_value != 'unknown'", "else": "RUNNING"})
        SubElement(answer, "ScriptCondition", code="_value == 'true'")
        return self.control("sequence", [read, answer])


def milliseconds(seconds: Fraction) -> int:
    """The next whole number of them."""
    return -int(-seconds * 1000 // 1)


def attempt_ends(state: str, forget: Sequence[str]) -> dict[str, str]:
    """By event, the script of the end of an attempt (:meth:`Idioms.retry_until_success`)."""
    failed = "; ".join([*forget, f"{state} := 'new'"])
    ends = {"_onFailure": failed, "_onHalted": failed}
    return {"_onSuccess": "; ".join(forget), **ends} if forget else ends


def forgotten(entry: str) -> str:
    """The script that makes an action forget how it ended."""
    return f"{entry} := 'none'"


def full_again(counter: str, attempts: int) -> str:
    """The script that gives a retry node all its attempts."""
    return f"{counter} := {attempts}"


def is_retry_label(text: str) -> bool:
    """Whether a name is the one that :meth:`Idioms.retry` gives."""
    return _RETRY_LABEL.fullmatch(text) is not None


def decorated(decorator: str, child: Element) -> Element:
    """A node around one other."""
    return _around(decorator, [child])


def _around(tag: str, children: Sequence[Element]) -> Element:
    element = Element(tag)
    element.extend(children)
    return element
