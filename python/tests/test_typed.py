"""The program that type checkers read."""

from __future__ import annotations

import typed
from conftest import DATA


def test_the_typed_program_runs() -> None:
    assert typed.main(DATA / "pmsm.csv").verdict == "usable"
