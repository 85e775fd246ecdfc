"""Trees in worlds that others change: facts that move by chance, starts in any state that can be reached."""
