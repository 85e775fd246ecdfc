"""Byte-level fuzzing of everything from text to ground task, and what it found."""
