"""Three-valued conditions of BehaviorTree.CPP files, read back. The inverse of
:mod:`bbtc.backends.btcpp.conditions`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Generic, Protocol, TypeVar

from bbtc.artefacts.cursor import clip
from bbtc.backends.btcpp.reader.holding import Holds
from bbtc.backends.btcpp.reader.leaves import Leaves
from bbtc.backends.btcpp.reader.patterns import HELD_LEAF, KNOWN, NOTE, REGISTER, UNKNOWN
from bbtc.backends.btcpp.reader.shapes import Match, has, match, match_one, tag_of
from bbtc.backends.btcpp.reader.unread import Unread, unreadable
from bbtc.backends.btcpp.xmltext import XmlDocument, XmlElement
from bbtc.backends.commitment import Fact
from bbtc.backends.shape import DEEPEST_CONDITION, can_be_unknown
from bbtc.ground.condition import FALSE, TRUE, And, Condition, Is, Known, Or, negation
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.tree.deep import Deep

_CONSTANTS: Mapping[str, Condition] = {"AlwaysSuccess": TRUE, "AlwaysFailure": FALSE}


class PortScope(Protocol):
    """What a condition needs to know of its place."""

    @property
    def ports(self) -> Mapping[str, str]:
        """The values of the ports."""
        ...


S = TypeVar("S", bound=PortScope)


class ConditionReader(Generic[S]):
    """Reads conditions; ``call`` follows a SubTree, and ``count`` is called for each element read."""

    def __init__(
        self,
        task: Task,
        document: XmlDocument,
        leaves: Leaves,
        unread: Unread,
        holds: Holds,
        *,
        call: Callable[[XmlElement, S], tuple[XmlElement, S]],
        count: Callable[[], None],
    ) -> None:
        self._task = task
        self._document = document
        self._leaves = leaves
        self._unread = unread
        self._holds = holds
        self._call = call
        self._count = count

    def is_condition(self, element: XmlElement) -> bool:
        """Whether an element that is no sequence or fallback is written for a condition alone."""
        if has(element, "Inverter", 1) or tag_of(element) in _CONSTANTS:
            return True
        if match_one((KNOWN, UNKNOWN, *HELD_LEAF), element) is not None:
            return True
        return self._leaves.is_leaf(element) and not self._leaves.is_action(element)

    def could_be(self, element: XmlElement) -> bool:
        """Whether all that an element holds may be one condition, as far as it shows without a look into
        SubTrees."""
        stack = [element]
        while stack:
            part = stack.pop()
            self._count()
            if match(REGISTER, part) is not None or self.is_condition(part) or has(part, "SubTree"):
                continue
            if not (has(part, "ReactiveSequence") or has(part, "ReactiveFallback")) or not part.children:
                return False
            stack.extend(part.children)
        return True

    def read(
        self, element: XmlElement, scope: S, level: int = 1, *, registered: bool = False
    ) -> Deep[Condition]:
        """The condition, whose parts stand on some ``level`` of a larger one, ``registered`` where its
        result goes to the blackboard. Raises :class:`~bbtc.backends.btcpp.reader.unread.Unreadable`."""
        self._count()
        self._unread.took(element)
        if level > DEEPEST_CONDITION:
            self._unread.took(element, *element.attributes)  # what is too deep is not looked at any further
            message = f"a condition has at most {DEEPEST_CONDITION} levels"
            raise unreadable(self._document, element, "BBT0605", message)
        register = match(REGISTER, element)
        test = match(KNOWN, element) or match(UNKNOWN, element)
        if register is not None:
            self._unread.take(register)
            condition = yield self.read(register.part("condition"), scope, level, registered=True)
        elif test is not None:
            condition = self._test(test, scope)
        elif (held := match_one(HELD_LEAF, element)) is not None:
            condition = self._held(held, scope)
        elif has(element, "SubTree"):
            condition = yield self.read(*self._call(element, scope), level)
        elif has(element, "Inverter", 1):
            part: Condition = yield self.read(element.children[0], scope, level, registered=registered)
            condition = negation(part)
        elif tag_of(element) in _CONSTANTS and not element.children:
            condition = _CONSTANTS[tag_of(element)]
        elif (kind := self._kind(element, registered=registered)) is not None:
            condition = kind((yield self._parts(element, scope, level + 1, registered=registered)))
            if not has(element, "Parallel"):
                self._check_order(element, condition)
        elif self._leaves.is_leaf(element) and not element.children:
            condition = self._live(element, scope)
        else:
            message = f"'{clip(tag_of(element))}' is not part of a condition"
            raise unreadable(self._document, element, "BBT0616", message)
        result: Condition = condition
        return result

    def _test(self, test: Match, scope: S) -> Condition:
        self._unread.take(test)
        leaf, inside = test.part("leaf"), scope
        if has(leaf, "SubTree"):
            self._unread.took(leaf)
            leaf, inside = self._call(leaf, scope)
        held = match_one(HELD_LEAF, leaf)
        read = self._live(leaf, inside) if held is None else self._held(held, inside)
        if not isinstance(read, Is):
            message = f"'{clip(tag_of(leaf))}' is always known"
            raise unreadable(self._document, leaf, "BBT0616", message)
        variable = read.variable
        return Known(variable) if test.shape is KNOWN else Is(variable, Truth.UNKNOWN)

    def _live(self, leaf: XmlElement, scope: S) -> Condition:
        """What a leaf reads as it is."""
        condition = self._leaves.condition(leaf, scope.ports)
        self._holds.live.update(self._holds.facts_of(condition))
        return condition

    def _held(self, held: Match, scope: S) -> Condition:
        """What a leaf reads, where that may be held."""
        self._unread.take(held)
        leaf = held.part("leaf")
        if not self._leaves.is_leaf(leaf) or self._leaves.is_action(leaf):
            message = f"'{clip(tag_of(leaf))}' is no condition of the task that could be held"
            raise unreadable(self._document, leaf, "BBT0616", message)
        condition = self._leaves.condition(leaf, scope.ports)
        for fact in self._holds.facts_of(condition) if "held" in held.texts else ():
            self._holds.entry(leaf, held.texts["held"], scope.ports, fact)
        return condition

    def note(self, element: XmlElement, scope: S) -> Iterator[Fact]:
        """What a note tells of. Raises :class:`bbtc.diagnostics.Unreadable`."""
        self._count()
        self._unread.took(element)
        if has(element, "SubTree"):
            element, scope = self._call(element, scope)
        found = match(NOTE, element)
        if found is None:
            message = f"'{clip(tag_of(element))}' does not write down what an action may set"
            raise unreadable(self._document, element, "BBT0616", message)
        self._unread.take(found)
        leaf = found.part("leaf")
        for fact in self._holds.facts_of(self._leaves.condition(leaf, scope.ports)):
            self._holds.entry(leaf, found.texts["held"], scope.ports, fact)
            yield fact

    def _kind(
        self, element: XmlElement, *, registered: bool
    ) -> Callable[[tuple[Condition, ...]], And | Or] | None:
        """What a control node is for conditions: the minimum, the maximum, or nothing. A Parallel remembers
        what its parts returned, unless its result is fetched in the same tick."""
        if has(element, "ReactiveSequence") and element.children:
            return And
        if has(element, "ReactiveFallback") and element.children:
            return Or
        if not has(element, "Parallel") or not registered or len(element.children) < 2:
            return None
        counts = (element.attributes.get("success_count"), element.attributes.get("failure_count"))
        many = str(len(element.children))
        if counts not in ((many, "1"), ("1", many)):
            return None
        self._unread.took(element, "success_count", "failure_count")
        return And if counts[1] == "1" else Or

    def _parts(
        self, element: XmlElement, scope: S, level: int, *, registered: bool
    ) -> Deep[tuple[Condition, ...]]:
        parts: list[Condition] = []
        for child in element.children:
            parts.append((yield self.read(child, scope, level, registered=registered)))  # noqa: PERF401
        return tuple(parts)

    def _check_order(self, element: XmlElement, condition: And | Or) -> None:
        """A ReactiveSequence stops at what is unknown, where a condition would go on to what is false."""
        for part, child in zip(condition.parts[:-1], element.children[:-1], strict=True):
            if can_be_unknown(self._task, part):
                message = f"what stands behind an unknown part of '{clip(tag_of(element))}' would not be read"
                hint = "put the part that can be unknown last; if several can, export the condition anew"
                raise unreadable(self._document, child, "BBT0616", message, hint=hint)
