"""Quantifiers of effects with their guards: the bindings under which these may be true."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from bbtc.ground.condition import FALSE, TRUE, Condition
from bbtc.ground.lower import Env, Frame, Lowered, Lowering
from bbtc.ground.reachability.atoms import Scope
from bbtc.model import formula as mf
from bbtc.model.types import Parameter


class Loop:
    """The bindings of some parameters under which a guard may be true. Each part of the guard is
    looked at as soon as what it reads is bound."""

    def __init__(
        self,
        lowering: Lowering,
        frame: Frame,
        parameters: tuple[Parameter, ...],
        guard: tuple[mf.Formula, ...],
    ) -> None:
        self._spend = lowering.spend
        pending = list(guard)
        later = {parameter.name for parameter in parameters}
        self._first = self._lower(lowering, frame, _ready(pending, later))
        self._levels: list[tuple[int, Callable[[Env], Sequence[int]], list[Lowered]]] = []
        for parameter in parameters:
            later.discard(parameter.name)
            slot, parts = frame.slot(parameter.name), _ready(pending, later)
            members = lowering.members(parameter, parts, frame)
            self._levels.append((slot, members, self._lower(lowering, frame, parts)))
        self.trivial = not self._levels and not self._first

    @staticmethod
    def _lower(lowering: Lowering, frame: Frame, parts: list[mf.Formula]) -> list[Lowered]:
        return [lowering.normal(part, frame, Scope.TRUTH) for part in parts]

    def guards(self, env: Env, above: list[Condition]) -> Iterator[list[Condition]]:
        """For each binding, which is then in ``env``: the guard's conditions (no constants),
        together with those above."""
        conditions = _met(self._first, env, above)
        if conditions is not None:
            yield from self._enter(0, env, conditions)

    def _enter(self, level: int, env: Env, above: list[Condition]) -> Iterator[list[Condition]]:
        if level == len(self._levels):
            yield above
            return
        slot, members_of, parts = self._levels[level]
        members = members_of(env)
        self._spend(len(members))
        for env[slot] in members:  # 1
            conditions = _met(parts, env, above)
            if conditions is not None:
                yield from self._enter(level + 1, env, conditions)


def _ready(pending: list[mf.Formula], later: set[str]) -> list[mf.Formula]:
    """The parts that can be looked at before what comes later is bound; they are pending no more."""
    ready = [part for part in pending if later.isdisjoint(mf.free(part))]
    pending[:] = [part for part in pending if not later.isdisjoint(mf.free(part))]
    return ready


def _met(parts: list[Lowered], env: Env, above: list[Condition]) -> list[Condition] | None:
    """The conditions of the parts after those above; None if one is false."""
    if not parts:
        return above
    found = list(above)
    for part in parts:
        condition = part(env)
        if condition is FALSE:  # 2
            return None
        if condition is not TRUE:
            found.append(condition)
    return found
