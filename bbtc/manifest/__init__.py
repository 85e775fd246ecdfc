"""The manifest of a project: ``bbtc.yaml``, or ``[tool.bbtc]`` in ``pyproject.toml``."""
