"""The one registry of diagnostic codes and their titles.

Ranges: 00xx files and limits, 01xx syntax, 02xx names and types, 03xx checks (warnings),
04xx grounding, 05xx planning and trees, 06xx artefacts, 07xx exports.
"""

from __future__ import annotations

CODES: dict[str, str] = {
    # 00xx: files and limits
    "BBT0001": "file cannot be read",
    "BBT0002": "file is not text",
    "BBT0003": "file is empty",
    "BBT0004": "output cannot be written",
    "BBT0005": "input exceeds a limit",
    "BBT0006": "no domain, no problem, or more than one of them",
    "BBT0007": "a limit on time, states or nodes was reached",
    # 01xx: syntax
    # 02xx: names and types
    # 03xx: checks
    # 04xx: grounding
    # 05xx: planning and trees
    # 06xx: artefacts
    # 07xx: exports
    "BBT0701": "unknown export format",
    "BBT0702": "two exporters claim one format",
    "BBT0703": "exporter cannot be loaded",
    "BBT0704": "wrong export option",
}
