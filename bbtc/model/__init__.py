"""The resolved model: every name bound to its declaration, still lifted."""
