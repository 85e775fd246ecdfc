"""How long the runs of a tree take: durations added up along its chain, and success by a time."""
