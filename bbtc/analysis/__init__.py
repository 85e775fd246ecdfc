"""From syntax to model, and the checks of a model."""
