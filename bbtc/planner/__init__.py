"""Planners: from a ground task to a tree."""
