"""The notebook runs, and its objects show themselves."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).resolve().parents[2] / "examples" / "notebook.ipynb"


@pytest.mark.slow
def test_the_notebook_runs_and_shows_tables_a_figure_a_live_page_and_a_replay() -> None:
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "the notebook is stored without outputs"
    run = nbclient.NotebookClient(copy.deepcopy(notebook), timeout=300).execute()
    shown = [out["data"] for cell in run.cells for out in cell.get("outputs", []) if "data" in out]
    html = "\n".join(data.get("text/html", "") for data in shown)
    assert "completed" in "".join(data.get("text/plain", "") for data in shown) and html.count("<iframe") >= 2
    assert any("image/png" in data for data in shown)
    assert all(len(data.get("text/plain", "")) < 400 for data in shown)
