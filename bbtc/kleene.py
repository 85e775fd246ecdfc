"""Strong Kleene logic: the three truth values and their tables.

Source: Kleene, "Introduction to Metamathematics" (1952), section 64; the paper
(Safronov et al. 2020, section IV) maps true/false/unknown to success/failure/running.
"""

from __future__ import annotations

import enum


class Truth(enum.IntEnum):
    """A truth value. The order is that of information-free minima and maxima:
    conjunction is ``min``, disjunction is ``max``, negation mirrors the order."""

    FALSE = 0
    UNKNOWN = 1
    TRUE = 2

    # That of the number it equals, as it must be; enumerations hash their names, in Python.
    __hash__ = int.__hash__

    @property
    def word(self) -> str:
        """The value as written in the language and in artefacts: ``true``, ``false``, ``unknown``."""
        return self.name.lower()

    @classmethod
    def of(cls, value: bool) -> Truth:
        """The two-valued truth of a Python bool."""
        return cls.TRUE if value else cls.FALSE

    @classmethod
    def from_word(cls, word: str) -> Truth:
        """Inverse of :attr:`word`. Raises ``ValueError`` for any other text."""
        try:
            return _WORDS[word]
        except KeyError:
            raise ValueError(f"not a truth value: {word!r}") from None


_WORDS = {value.word: value for value in Truth}


def negate(value: Truth) -> Truth:
    """Kleene negation: swaps true and false, keeps unknown."""
    return Truth(2 - value)
