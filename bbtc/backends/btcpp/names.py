"""Which identifier stands for what in BehaviorTree.CPP files, and how an attribute holds a label."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from bbtc.backends.btcpp.bindings.bound import BoundNodes, bound_nodes
from bbtc.backends.btcpp.bindings.entries import Bindings
from bbtc.backends.btcpp.idioms import COMMITTED, HELD, LATCH, SKIPPER, WHILE
from bbtc.backends.interface import Interface, Leaf, interface_of
from bbtc.backends.names import Namer, Symbol, camel, identifiers, port_values
from bbtc.ground.task import Task
from bbtc.printable import printable
from bbtc.tree.nodes import Tree

RESERVED = frozenset(
    f"""
    AlwaysFailure AlwaysSuccess AsyncFallback AsyncSequence Delay Fallback ForceFailure ForceSuccess
    IfThenElse Inverter KeepRunningUntilFailure LoopBool LoopDouble LoopInt LoopString Parallel
    ParallelAll Precondition ReactiveFallback ReactiveSequence Repeat RetryUntilSuccessful
    RetryUntilSuccesful RunOnce Script ScriptCondition Sequence SequenceStar SequenceWithMemory
    SetBlackboard SkipUnlessUpdated Sleep SubTree SubTreePlus Switch2 Switch3 Switch4 Switch5 Switch6
    Timeout TryCatch UnsetBlackboard WaitValueUpdate WasEntryUpdated WhileDoElse EntryUpdated
    ConsumeQueue PopFromQueue QueueSize ManualSelector TestNode Root BehaviorTree TreeNodesModel Include
    Action Condition Control Decorator {SKIPPER} {LATCH} {HELD} {COMMITTED} {WHILE}
    """.split()
)
"""Ids with a meaning of their own in BehaviorTree.CPP 4 files, and those of our own nodes."""

_NUMBERED = re.compile(r"(?: #[0-9]+)+$")


@dataclass(frozen=True, slots=True)
class BtcppNames:
    """Ids of leaves, with the namespace in front and without it (``plain``), object names as values of ports,
    and the leaves that are nodes of others, whose ids are not for us (``taken``)."""

    interface: Interface
    namespace: str
    ids: Mapping[Symbol, str]
    plain: Mapping[Symbol, str]
    values: Mapping[str, str]
    bound: BoundNodes = field(default_factory=BoundNodes)
    taken: frozenset[str] = frozenset()

    def ours(self, leaf: Leaf) -> bool:
        """Is it a leaf of ours, and no node of others?"""
        return leaf.symbol not in self.bound.leaves


def btcpp_names(tree: Tree, namespace: str = "", bindings: Bindings | None = None) -> BtcppNames:
    """The names used in the export of a tree. ``namespace`` is any text; its CamelCase form comes
    before every id. Raises :class:`BbtcError` for bindings that do not fit the tree."""
    interface = interface_of(tree)
    prefix = camel(namespace) if namespace else ""
    taken = frozenset[str]() if bindings is None else bindings.reserved
    plain = identifiers(interface.leaves, "camel", _reserved(prefix, taken))
    ids = {symbol: f"{prefix}{name}" for symbol, name in plain.items()}
    bound = BoundNodes() if bindings is None else bound_nodes(tree, interface, bindings)
    return BtcppNames(interface, prefix, ids, plain, port_values(objects_of(tree.task)), bound, taken)


def objects_of(task: Task) -> list[str]:
    """The objects that variables and actions of a task are about, with repeats."""
    arguments = [arg for variable in task.variables for arg in variable.args]
    arguments += [arg for action in task.actions for arg in action.args]
    return arguments


def _reserved(prefix: str, taken: frozenset[str]) -> set[str]:
    """What may not follow the prefix, because the whole would be a reserved id."""
    folded = prefix.casefold()
    return {word[len(prefix) :] for word in RESERVED | taken if word.casefold().startswith(folded)}


class TreeIds:
    """Hands out ids of BehaviorTrees, all different from one another and from those of leaves. All but that
    of the main tree, :attr:`main`, begin with it: a factory that reads a second file with a BehaviorTree of
    the same id puts that in the place of the first, without a word."""

    def __init__(self, names: BtcppNames, problem: str) -> None:
        self._prefix = names.namespace
        self._namer = Namer({*_reserved(self._prefix, names.taken), *names.plain.values()})
        self._main = self._namer.take(camel(problem), seed=problem)
        self.main = f"{self._prefix}{self._main}"

    def take(self, title: str, seed: str) -> str:
        """An id that ends in the title, if it is free; otherwise in a digest of ``seed``."""
        return self._prefix + self._namer.take(f"{self._main}_{camel(title)}", seed=seed)


def ports_for(uses: Iterable[tuple[str, str]]) -> dict[str, str]:
    """A port for each object that may be passed to a SubTree, given the parameters that objects stand
    for: the first parameter of each names its port."""
    first: dict[str, str] = {}
    for parameter, arg in uses:
        if not is_numeric(arg):
            first.setdefault(arg, parameter)
    # Parameters of one name, of two predicates: the first keeps it.
    taken: set[str] = set()
    for arg, parameter in first.items():
        free = (f"{parameter}{suffix}" for suffix in ("", *(f"_{i}" for i in range(2, len(first) + 2))))
        first[arg] = next(name for name in free if name not in taken)
        taken.add(first[arg])
    return first


_NUMBER = re.compile(r"[+-]?(?:[0-9]|\.[0-9]|inf|nan)", re.IGNORECASE)


def is_numeric(value: str) -> bool:
    """Whether a value may change its type when it is passed to a SubTree: numbers do from 4.9 on."""
    return _NUMBER.match(value) is not None


# --- labels ----------------------------------------------------------------------------------


class Labels:
    """The labels of one BehaviorTree, in which no two SubTrees may share one."""

    def __init__(self) -> None:
        self._uses: dict[str, int] = {}

    def unique(self, label: str) -> str:
        """The label; with a number from its second use on."""
        while True:
            count = self._uses[label] = self._uses.get(label, 0) + 1
            if count == 1:
                return label
            label = f"{label} #{count}"


def without_number(label: str) -> str:
    """A label without the number that :class:`Labels` may have given it."""
    return _NUMBERED.sub("", label)


def shown(text: str) -> str:
    """A text as an attribute shows it."""
    return printable(text)
