"""The notebook runs, and its objects show themselves."""

from __future__ import annotations

import copy
import json
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from recorded import recorded_stand

import wbc
from wbc.app import draw
from wbc.sim.balance.standing import stand
from wbc.sim.trial.spec import TrialResult

NOTEBOOK = Path(__file__).resolve().parents[2] / "examples" / "notebook.ipynb"


class Cells(HTMLParser):
    """Texts of the cells of tables, row by row, and all tags."""

    def __init__(self, shown: Any) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.tags: set[str] = set()
        self.feed(shown._repr_html_())

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.add(tag)
        if tag == "tr":
            self.rows.append([])
        elif tag == "td":
            self.rows[-1].append("")

    def handle_data(self, data: str) -> None:
        self.rows[-1][-1] += data


def test_objects_show_themselves_as_tables() -> None:
    """A row for each joint, task, contact and number; names of strangers are text."""
    description = wbc.load_robot("g1")
    rows = Cells(description).rows
    joints = {row[0]: row for row in rows if row[0] in description.joint_names}
    assert list(joints) == list(description.joint_names) and {len(row) for row in joints.values()} == {9}
    controller = wbc.balance_controller(description.robot(), 0.005)
    controller.add(wbc.PositionTask("left_hand", name="<b>&hand"))
    solution, ik = controller.solve(), wbc.InverseKinematics(description.robot(), dt=0.01)
    ik.add(wbc.PostureTask())
    ik.step()
    for shown, names in (
        (controller, ["com", "<b>&hand", "contact left_foot"]),
        (solution, ["com", "<b>&hand", "left_foot"]),
        (ik.solution, ["posture"]),
    ):
        cells = Cells(shown)
        assert {*names} <= {row[0] for row in cells.rows} and cells.tags == {"table", "tr", "td"}
    result = stand(robot="g1", seconds=0.1)
    rows = {row[0]: row[-1] for row in Cells(result).rows}
    assert rows["seconds"] == "0.1 s" and rows["robot"] == "g1" and isinstance(result, TrialResult)


def test_a_figure_is_a_picture_without_a_backend_of_notebooks(tmp_path: Path) -> None:
    figure: Any = draw("balance", [recorded_stand(tmp_path / "stand.arrow")])
    assert figure._repr_png_().startswith(b"\x89PNG")


@pytest.mark.slow
def test_the_notebook_runs_and_shows_tables_a_figure_a_live_page_and_a_replay() -> None:
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    run = nbclient.NotebookClient(copy.deepcopy(notebook), timeout=300).execute()
    shown = [out["data"] for cell in run.cells for out in cell.get("outputs", []) if "data" in out]
    html = "\n".join(data.get("text/html", "") for data in shown)
    assert "completed" in "".join(data.get("text/plain", "") for data in shown) and html.count("<iframe") >= 2
    assert any("image/png" in data for data in shown)
    assert html.count("<table") >= 4  # robot, controller, solution, result
    assert all(len(data.get("text/plain", "")) < 400 for data in shown)


def test_tables_and_pictures_are_there_when_the_notebook_opens() -> None:
    """Rows of the stored tables are those of the objects; nothing leads to a server that has ended."""
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    shown = [out.get("data", {}) for cell in notebook["cells"] for out in cell.get("outputs", [])]
    html = ["".join(data.get("text/html", "")) for data in shown]
    assert sum("image/png" in data for data in shown) == 1 and not any("<iframe" in text for text in html)
    tables = [text for text in html if "<table" in text]
    description = wbc.load_robot("g1")
    assert len(tables) == 4 and tables[0] == description._repr_html_()
    assert NOTEBOOK.stat().st_size < 3e5
