"""Which facts are hidden: those that the start leaves open, and what follows from them.

1. A fact that is drawn at the start, stands in a condition there, or is unknown, is hidden.
2. What an effect sets is hidden where it reads a hidden fact, or makes it unknown.
3. A fact that an observation tells, and that chance may change, is hidden, and so is what it comes from:
   there would be nothing to tell of it else. What is declared as always seen needs no such thing.

All others are seen: the robot knows them at all times.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from bbtc.ground.condition import variables
from bbtc.ground.hidden.parts import all_settings, facts_read, parts_of
from bbtc.ground.hidden.physical import Physical
from bbtc.kleene import Truth
from bbtc.markov import reachable


def hidden_facts(physical: Physical) -> frozenset[int]:
    """The variables that are hidden."""
    leads: dict[int, set[int]] = {}
    comes: dict[int, set[int]] = {}
    hidden, drawn = set(physical.uncertain), set[int]()
    for action in physical.task.actions:
        for setting in all_settings(action.factors):
            for read in facts_read(setting.when):
                leads.setdefault(read, set()).add(setting.variable)
                comes.setdefault(setting.variable, set()).add(read)
            if setting.value is Truth.UNKNOWN:
                hidden.add(setting.variable)
        drawn.update(setting.variable for setting in all_settings(parts_of(action.factors).draws))
    hidden = _closed(hidden, leads)
    told = {
        variable
        for readings in (*physical.readings.values(), physical.first)
        for reading in readings
        for variable in variables(reading.condition)
        if variable not in physical.observed
    }
    by_chance = _closed(drawn, leads)
    sources = reachable(
        (told & by_chance) - hidden, lambda variable: comes.get(variable, set[int]()) & by_chance
    )
    return frozenset(_closed(hidden | sources, leads))


def _closed(start: Iterable[int], leads: Mapping[int, set[int]]) -> set[int]:
    return reachable(start, lambda variable: leads.get(variable, ()))
