"""Strong cyclic policies over partial states: weak plans, regression, dead ends, rules."""
