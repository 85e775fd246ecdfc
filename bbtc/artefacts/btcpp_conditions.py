"""Three-valued conditions of BehaviorTree.CPP files, read back. The inverse of
:mod:`bbtc.export.btcpp_conditions`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Generic, Protocol, TypeVar

from bbtc.artefacts.btcpp_leaves import Leaves, unreadable
from bbtc.artefacts.btcpp_patterns import has, inside_register, known_test, tag_of
from bbtc.artefacts.cursor import clip
from bbtc.artefacts.xmltext import XmlDocument, XmlElement
from bbtc.ground.condition import FALSE, TRUE, And, Condition, Is, Known, Or, negation
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
    """Reads conditions; ``call`` follows a SubTree, ``count`` is called for each element read."""

    def __init__(
        self,
        document: XmlDocument,
        leaves: Leaves,
        call: Callable[[XmlElement, S], tuple[XmlElement, S]],
        count: Callable[[], None],
    ) -> None:
        self._document = document
        self._leaves = leaves
        self._call = call
        self._count = count

    def is_condition(self, element: XmlElement) -> bool:
        """Whether an element that is no sequence or fallback is written for a condition alone."""
        if has(element, "Inverter", 1) or tag_of(element) in _CONSTANTS:
            return True
        if known_test(element) is not None:
            return True
        return self._leaves.is_leaf(element) and not self._leaves.is_action(element)

    def could_be(self, element: XmlElement) -> bool:
        """Whether all that an element holds may be one condition."""
        stack = [element]
        while stack:
            part = stack.pop()
            if inside_register(part) is not None or self.is_condition(part) or has(part, "SubTree"):
                continue
            if not (has(part, "ReactiveSequence") or has(part, "ReactiveFallback")) or not part.children:
                return False
            stack.extend(part.children)
        return True

    def read(self, element: XmlElement, scope: S) -> Deep[Condition]:
        """The condition. Raises :class:`~bbtc.artefacts.btcpp_leaves.Unreadable`."""
        self._count()
        inner = inside_register(element)
        test = known_test(element)
        if inner is not None:
            condition = yield self._kleene(inner, scope)
        elif test is not None:
            known, leaf = test
            variable = self._leaves.variable(leaf, scope.ports)
            condition = Known(variable) if known else Is(variable, Truth.UNKNOWN)
        elif has(element, "SubTree"):
            condition = yield self.read(*self._call(element, scope))
        elif has(element, "Inverter", 1):
            part: Condition = yield self.read(element.children[0], scope)
            condition = negation(part)
        elif tag_of(element) in _CONSTANTS and not element.children:
            condition = _CONSTANTS[tag_of(element)]
        elif has(element, "ReactiveSequence") or has(element, "ReactiveFallback"):
            parts = yield self._parts(element, scope)
            condition = And(parts) if has(element, "ReactiveSequence") else Or(parts)
        elif self._leaves.is_leaf(element) and not element.children:
            condition = Is(self._leaves.variable(element, scope.ports), Truth.TRUE)
        else:
            raise unreadable(
                self._document, element, "BBT0616", f"'{clip(tag_of(element))}' is not part of a condition"
            )
        result: Condition = condition
        return result

    def _parts(self, element: XmlElement, scope: S) -> Deep[tuple[Condition, ...]]:
        parts: list[Condition] = []
        for child in element.children:
            parts.append((yield self._kleene(child, scope)))  # noqa: PERF401
        return tuple(parts)

    def _kleene(self, element: XmlElement, scope: S) -> Deep[Condition]:
        """A condition, or a Parallel that stands for minimum or maximum."""
        counts = (element.attributes.get("success_count"), element.attributes.get("failure_count"))
        many = str(len(element.children))
        if has(element, "Parallel") and counts in ((many, "1"), ("1", many)) and len(element.children) > 1:
            parts: tuple[Condition, ...] = yield self._parts(element, scope)
            return And(parts) if counts[1] == "1" else Or(parts)
        condition: Condition = yield self.read(element, scope)
        return condition
