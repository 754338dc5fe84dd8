"""The programs of the guide and of both READMEs run."""

from __future__ import annotations

import contextlib
import io
import re
import warnings
from pathlib import Path
from typing import Any

import pytest
from conftest import DATA

import greybox as gb

ROOT = DATA.parents[1]


@pytest.mark.parametrize("page", ["README.md", "python/README.md", "docs/guide/14_coming_from.md", "docs/guide/18_python.md"])
def test_programs_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not (ROOT / page).is_file():
        pytest.skip("the repository is not there")
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.S)
    assert blocks
    names: dict[str, Any] = {}
    for block in blocks:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            # The example with all words declares a prior and cuts a record, of which notes are issued.
            warnings.simplefilter("ignore", gb.FitWarning)
            exec(compile(block, page, "exec"), names)
    fit = names["fit"]
    # Standard errors of the record: 2e-4 ohm. Half of it, and a Huber loss, within five.
    assert fit.parameters.rs == pytest.approx(0.63, abs=1e-3) and fit.verdict != "not usable"
