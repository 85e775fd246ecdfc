"""Belief behavior trees as data."""
