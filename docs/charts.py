"""Draw the charts of the measurements from the tables of their pages: `python docs/charts.py [FOLDER]`."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt

from wbc.app.plot.style import AMBER, BLUE, ORANGE
from wbc.sim.studies.intervals import share_interval

DOCS = Path(__file__).parent
GREY = "0.75"


def table(page: str, corner: str) -> list[list[str]]:
    """Return the cells of the table of a page whose head begins with a text, without head, bold type and code marks."""
    lines = (DOCS / page).read_text(encoding="utf-8").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(f"| {corner}"))
    rows = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip().replace("**", "").replace("`", "") for cell in line.strip("|").split("|")])
    return rows


def numbers(cell: str) -> list[float]:
    """Return the numbers of a cell in their order."""
    return [float(found) for found in re.findall(r"-?\d+(?:\.\d+)?", cell.replace("−", "-"))]


def draw_tour(path: Path) -> None:
    """Survived time and completed runs of the public tour, ours with intervals."""
    rows = table("stepping.md", "| survived, s | completed, % |")[::-1]
    figure, axes = plt.subplots(1, 2, figsize=(8.4, 3.6), sharey=True, layout="constrained")
    names = [row[0].partition(",")[0] for row in rows]
    for axis, column, label in ((axes[0], 1, "survived (s)"), (axes[1], 2, "completed (%)")):
        found = [numbers(row[column]) for row in rows]
        values = [each[0] for each in found]
        axis.barh(names, values, color=[BLUE if name == "wbc" else GREY for name in names])
        for name, each in zip(names, found, strict=True):
            if len(each) == 3:
                axis.plot(each[1:], [name, name], color="black", lw=1.6)
        axis.set_xlabel(label)
    figure.savefig(path)
    plt.close(figure)


def draw_seeing(path: Path) -> None:
    """Share of completed walks over rough ground, blind and with a depth camera, with 95 % intervals."""
    rows = [row for row in table("measured_seeing.md", "Steps, sole and height") if "soft" not in row[0]]
    figure, axis = plt.subplots(figsize=(8.4, 3.4), layout="constrained")
    for shift, column, colour, label in ((-0.12, 1, ORANGE, "blind"), (0.12, 2, BLUE, "depth camera")):
        for i, row in enumerate(rows):
            done, count = (int(value) for value in numbers(row[column])[:2])
            low, high = share_interval(done, count)
            axis.plot([i + shift] * 2, [100.0 * low, 100.0 * high], color=colour, lw=1.6)
            axis.plot(i + shift, 100.0 * done / count, "o", color=colour, label=None if i else label)
    axis.set_xticks(
        np.arange(len(rows)),
        [
            row[0].replace(" of its size", "").replace("times as high", "× high").replace(", ", "\n")
            for row in rows
        ],
        fontsize=8,
    )
    axis.set_ylabel("completed (%)")
    axis.set_ylim(0.0, 104.0)
    axis.legend(frameon=False, loc="lower left")
    figure.savefig(path)
    plt.close(figure)


def draw_kinematics(path: Path) -> None:
    """Time of a step of inverse kinematics of other libraries, over that of this one."""
    rows = table("measured_controller.md", "time divided by that of `wbc`")
    figure, axis = plt.subplots(figsize=(8.4, 2.4), layout="constrained")
    for k, (name, colour) in enumerate((("Pink 4.4", BLUE), ("mink 1.3", ORANGE), ("PlaCo 0.10", AMBER))):
        places = np.arange(len(rows)) + 0.25 * (1 - k)
        axis.barh(places, [numbers(row[1 + k])[0] for row in rows], 0.22, color=colour, label=name)
    axis.axvline(1.0, color="black", lw=1.0)
    axis.set_yticks(np.arange(len(rows)), [row[0].partition(":")[0] for row in rows])
    axis.set_xlabel("time over that of wbc (1: as fast)")
    axis.legend(frameon=False)
    figure.savefig(path)
    plt.close(figure)


def main() -> None:
    """Draw all charts."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "images"
    mpl.use("Agg")
    mpl.rcParams |= {"svg.hashsalt": "wbc", "svg.fonttype": "none", "font.family": "sans-serif"}
    for name, draw in (
        ("measured_kinematics.svg", draw_kinematics),
        ("measured_seeing.svg", draw_seeing),
        ("measured_tour.svg", draw_tour),
    ):
        draw(folder / name)
        print(f"wrote {folder / name}")


if __name__ == "__main__":
    main()
