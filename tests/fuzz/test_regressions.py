"""What the fuzz runs once found stays mended."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.front_end import check_input

CASES = sorted((Path(__file__).parent / "regressions").iterdir())


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_no_input_makes_anything_but_a_diagnostic(case: Path) -> None:
    check_input(case.read_bytes())
