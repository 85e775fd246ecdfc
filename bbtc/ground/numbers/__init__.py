"""Whole numbers as part of the state: ranges and digits, and what conditions and effects say of them."""
