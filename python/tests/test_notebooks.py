"""The notebooks run from begin to end; their cells assert what their text says."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import DATA

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))


def test_there_are_notebooks() -> None:
    assert [one.stem for one in NOTEBOOKS] == ["drive", "from_idnlgrey", "from_lmfit"]


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda one: one.stem)
def test_notebook(notebook: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    monkeypatch.setenv("GREYBOX_DATA", str(DATA))
    cells = nbformat.read(notebook, as_version=4)
    nbclient.NotebookClient(cells, timeout=300, kernel_name="python3").execute()
    # A fit is shown with its verdict, its table and a picture.
    shown = "".join(str(output.get("data", {}).get("text/html", "")) for cell in cells.cells for output in cell.get("outputs", []))
    assert "Verdict: usable." in shown and "<svg" in shown
