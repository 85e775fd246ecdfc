"""Writing, as the commands name it; see :mod:`bbtc.files`."""

from __future__ import annotations

from bbtc.files import drift, write, write_depfile

__all__ = ["drift", "write", "write_depfile"]
