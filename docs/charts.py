"""Draw the charts of the measurements from the tables of their pages: `python docs/charts.py [FOLDER]`."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib as mpl
import numpy as np
from arguments import target
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from wbc.app.plot.style import AMBER, BLUE, GREEN, ORANGE, PINK, SKY
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


def save(figure: Figure, path: Path) -> None:
    """Write a figure, the same bytes for the same numbers, and forget it."""
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def draw_tour(path: Path) -> None:
    """Survived time and completed runs of the public tour, ours with intervals."""
    rows = table("../examples/tour/README.md", "| survived, s | completed, % |")[::-1]
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
    save(figure, path)


def draw_shares(
    path: Path,
    rows: list[list[str]],
    columns: dict[int, tuple[str, str]],
    names: int = 1,
    what: str = "completed (%)",
) -> None:
    """Shares of walks, "k of n" in columns of a table, with the 95 % intervals of independent walks.

    Args:
        path: File of the figure.
        rows: Cells of the table.
        columns: Column → its colour and its name in the legend.
        names: Number of the first columns that name a row.
        what: What is counted.
    """
    figure, axis = plt.subplots(figsize=(8.4, 0.9 + 0.34 * len(rows)), layout="constrained")
    for column, (colour, label) in columns.items():
        shift = 0.3 * (list(columns).index(column) - 0.5 * (len(columns) - 1))
        places, shares = [], []
        for i, row in enumerate(rows):
            if len(found := numbers(row[column])) < 2:
                continue
            done, count = (int(value) for value in found[:2])
            low, high = share_interval(done, count)
            axis.plot([100.0 * low, 100.0 * high], [i + shift] * 2, color=colour, lw=1.8)
            places.append(i + shift)
            shares.append(100.0 * done / count)
        axis.plot(shares, places, "o", ms=5, color=colour, label=label)
    labels = [", ".join(filter(None, row[:names])) for row in rows]
    axis.set_yticks(np.arange(len(rows)), labels, fontsize=9)
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.set_xlabel(what)
    axis.set_xlim(0.0, 102.0)
    axis.grid(axis="x", color="0.9")
    axis.set_axisbelow(True)
    if len(columns) > 1:
        axis.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=len(columns))
    save(figure, path)


def draw_rough(path: Path) -> None:
    """Share of walks of g1 with free steps that arrive over rough ground, blind."""
    draw_shares(path, table("measured_walks.md", "Free steps, blind, flat feet"), {1: (BLUE, "g1")})


def draw_own_soles(path: Path) -> None:
    """Share of walks on own soles that arrive on a soft floor and over tilting plates."""
    draw_shares(path, table("measured_floors.md", "Free steps, 1.5 m, own flat soles"), {1: (BLUE, "arrive")})


def draw_standing(path: Path) -> None:
    """Largest impulse that a standing robot recovers from, by direction."""
    rows = table("measured_pushes.md", "Largest impulse, Ns/kg")
    figure, axis = plt.subplots(figsize=(8.4, 3.0), layout="constrained")
    colours = {"hrp4_class": (ORANGE, AMBER, PINK), "talos": (BLUE, SKY, GREEN)}
    modes = ["position", "torque", "hybrid"]
    width = 0.8 / len(rows)
    for k, row in enumerate(rows):
        robot, mode = row[0].split(", ")
        places = np.arange(4) + width * (k - 0.5 * (len(rows) - 1))
        heights = [numbers(cell)[0] for cell in row[1:5]]
        axis.bar(places, heights, 0.9 * width, color=colours[robot][modes.index(mode)], label=row[0])
    axis.set_xticks(range(4), ["forward", "left", "back", "right"])
    axis.set_ylabel("largest impulse (Ns/kg)")
    axis.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=8)
    save(figure, path)


def draw_slip(path: Path) -> None:
    """Error of the estimated place after feet have slipped, without and with the rule, joined by a line."""
    rows = table("measured_floors.md", "Error of the place at the end, mm")
    figure, axis = plt.subplots(figsize=(8.4, 0.9 + 0.3 * len(rows)), layout="constrained")
    without, with_it = ([numbers(row[k])[0] for row in rows] for k in (1, 2))
    for i, pair in enumerate(zip(without, with_it, strict=True)):
        axis.plot(pair, [i, i], color=GREY, lw=2.0, zorder=0)
    axis.plot(without, range(len(rows)), "o", color=ORANGE, label="without the rule")
    axis.plot(with_it, range(len(rows)), "o", color=BLUE, label="with it")
    axis.set_yticks(range(len(rows)), [row[0] for row in rows], fontsize=9)
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.set_xlim(0.0)
    axis.set_xlabel("error of the place (mm)")
    axis.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    save(figure, path)


def draw_seeing(path: Path) -> None:
    """Share of completed walks over rough ground, blind and with a depth camera."""
    columns = {1: (ORANGE, "blind"), 2: (BLUE, "depth camera")}
    rows = []
    for heights in ("usual heights", "about 1.5 times as high", "usual heights, other layouts"):
        found = table("measured_seeing.md", f"`hrp4_class`, 3 m, {heights} |")
        suffix = heights.removeprefix("usual heights").removeprefix(", ")
        rows += [[", ".join(filter(None, (row[0], suffix))), *row[1:]] for row in found]
    draw_shares(path, rows, columns)


def draw_policies(path: Path) -> None:
    """Share of policies that are taken over in time, in a walk and after a push."""
    columns = {3: (BLUE, "stood")}
    draw_shares(path, table("measured_policies.md", "Taken over"), columns, names=2, what="stood (%)")


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
    save(figure, path)


def main() -> None:
    """Draw all charts."""
    folder = target(__doc__)
    folder.mkdir(parents=True, exist_ok=True)
    mpl.use("Agg")
    mpl.rcParams |= {"svg.hashsalt": "wbc", "svg.fonttype": "none", "font.family": "sans-serif"}
    for name, draw in (
        ("measured_kinematics.svg", draw_kinematics),
        ("measured_own_soles.svg", draw_own_soles),
        ("measured_policies.svg", draw_policies),
        ("measured_rough.svg", draw_rough),
        ("measured_seeing.svg", draw_seeing),
        ("measured_slip.svg", draw_slip),
        ("measured_standing.svg", draw_standing),
        ("measured_tour.svg", draw_tour),
    ):
        draw(folder / name)
        print(f"wrote {folder / name}")


if __name__ == "__main__":
    main()
