"""py_trees: a tree as a Python module."""
