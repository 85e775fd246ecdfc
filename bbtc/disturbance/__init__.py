"""Trees in worlds that others change: facts that move by chance, and starts in any state that can be
reached."""
