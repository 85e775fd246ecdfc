"""Exact semantics: beliefs, ticks, self-simulation."""
