"""Trees as models for probabilistic model checkers: PRISM and JANI."""
