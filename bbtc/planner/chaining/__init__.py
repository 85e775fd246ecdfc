"""Backward chaining: trees refined by what achieves a condition that fails."""
