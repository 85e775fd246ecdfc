"""Compiler from probabilistic, three-valued planning domains to belief behavior trees."""
