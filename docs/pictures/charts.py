"""Draw the charts of the measurements from the tables of their pages: `python docs/pictures/charts.py [FOLDER]`."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import matplotlib as mpl
import numpy as np
from arguments import target
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from wbc.app.plot.style import AMBER, BLUE, GREEN, ORANGE, PINK, SKY
from wbc.sim.studies.intervals import share_interval

DOCS = Path(__file__).parents[1]
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
    parts: dict[str, list[list[str]]],
    columns: dict[int, tuple[str, str]],
    names: int = 1,
    what: str = "completed (%)",
) -> None:
    """Shares of walks, "k of n" in columns of tables, with the 95 % intervals of independent walks.

    Args:
        path: File of the figure.
        parts: Title of a part of the figure → cells of its table.
        columns: Column → its colour and its name in the legend.
        names: Number of the first columns that name a row.
        what: What is counted.
    """
    counts = [len(rows) for rows in parts.values()]
    height = 0.55 + 0.34 * len(counts) + 0.33 * sum(counts)
    figure, axes = plt.subplots(
        len(parts),
        figsize=(8.4, height),
        sharex=True,
        squeeze=False,
        height_ratios=counts,
        layout="constrained",
    )
    for axis, (title, rows) in zip(axes[:, 0], parts.items(), strict=True):
        for k, (column, (colour, label)) in enumerate(columns.items()):
            places, shares = [], []
            for i, row in enumerate(rows):
                if len(found := numbers(row[column])) < 2:
                    continue
                done, count = (int(value) for value in found[:2])
                place = i + 0.3 * (k - 0.5 * (len(columns) - 1))
                axis.plot(100.0 * np.array(share_interval(done, count)), [place] * 2, color=colour, lw=1.8)
                places.append(place)
                shares.append(100.0 * done / count)
            axis.plot(shares, places, "o", ms=5, color=colour, label=label)
        labels = [", ".join(filter(None, row[:names])) for row in rows]
        axis.set_title(title, loc="left", fontsize=10)
        axis.set_yticks(np.arange(len(rows)), labels, fontsize=9)
        axis.set_ylim(len(rows) - 0.5, -0.5)
        axis.set_xlim(0.0, 102.0)
        axis.grid(axis="x", color="0.9")
        axis.set_axisbelow(True)
    axes[-1, 0].set_xlabel(what)
    if len(columns) > 1:
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, frameon=False, loc="outside upper right", ncols=len(columns))
    save(figure, path)


def draw_rough(path: Path) -> None:
    """Share of walks of g1 with free steps that arrive over rough ground, blind."""
    rows = table("measured_walks.md", "Free steps, blind, flat feet")
    title = "g1, 3 m, free steps, blind, flat feet (older law)"
    draw_shares(path, {title: rows}, {1: (BLUE, "g1")}, what="walks that arrive (%)")


def draw_speeds(path: Path) -> None:
    """Greatest velocities of free steps that are granted and were walked, by robot and direction."""
    rows = [row[0].split(", ") + row[1:2] for row in table("measured_walks.md", "Robot, direction")]
    figure, axes = plt.subplots(1, 2, figsize=(8.4, 2.8), width_ratios=(3, 1), layout="constrained")
    for axis, directions, unit in (
        (axes[0], ["ahead", "back", "aside"], "m/s"),
        (axes[1], ["turn"], "rad/s"),
    ):
        for k, (robot, colour) in enumerate((("g1", ORANGE), ("hrp4_class", AMBER), ("talos", BLUE))):
            granted = {direction: numbers(cell)[0] for name, direction, cell in rows if name == robot}
            places = np.arange(len(directions)) + 0.27 * (k - 1)
            bars = axis.bar(places, [granted[each] for each in directions], 0.25, color=colour, label=robot)
            axis.bar_label(bars, fmt="%.2f", fontsize=8)
        axis.set_xticks(range(len(directions)), directions)
        axis.set_ylabel(f"greatest velocity ({unit})")
        axis.margins(y=0.1)
    figure.legend(*axes[0].get_legend_handles_labels(), frameon=False, loc="outside upper center", ncols=3)
    save(figure, path)


def draw_own_soles(path: Path) -> None:
    """Share of walks on own soles that arrive on a soft floor."""
    rows = table("measured_floors.md", "Floor and robot")
    title = "1.5 m, free steps, own flat soles"
    draw_shares(path, {title: rows}, {1: (BLUE, "arrive")}, what="walks that arrive (%)")


def draw_standing(path: Path) -> None:
    """Largest impulse that a standing robot recovers from, by direction."""
    rows = table("measured_pushes.md", "Largest impulse held standing, Ns/kg")
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


def draw_changes(path: Path) -> None:
    """Punches that changes of the law and of its constants gain and lose, with p."""
    rows = [row for row in table("measured_pushes.md", "Change of the law") if " to " not in row[1]]
    names = [textwrap.fill(f"{row[0].partition(';')[0]} ({row[1]} pairs)", 60) for row in rows]
    gained, lost = np.array([numbers(row[2]) for row in rows]).T
    figure, axis = plt.subplots(figsize=(8.4, 0.9 + 0.3 * len(rows)), layout="constrained")
    bars = axis.barh(names, gained, color=BLUE)
    axis.barh(names, -lost, color=ORANGE)
    axis.bar_label(bars, [f"p = {row[3]}" for row in rows], padding=3, fontsize=8)
    axis.axvline(0.0, color="black", lw=1.0)
    axis.xaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    axis.set_xlim(-1.1 * max(lost), 1.3 * max(gained))
    axis.invert_yaxis()
    axis.tick_params(axis="y", labelsize=8)
    axis.set_xlabel("punches lost (left) and gained (right)")
    save(figure, path)


def draw_slip(path: Path) -> None:
    """Error of the estimated place after feet have slipped, without and with the rule, joined by a line."""
    rows = table("measured_estimate.md", "Free steps (older law)")
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
    heads = {
        "usual heights": "usual heights",
        "1.5 times the heights": "about 1.5 times the heights, older law",
        "other layouts": "usual heights, other layouts, older law",
    }
    parts = {title: table("measured_seeing.md", f"Steps, sole ({head})") for head, title in heads.items()}
    draw_shares(
        path,
        parts,
        {1: (ORANGE, "blind"), 2: (BLUE, "with a depth camera")},
        what="walks of hrp4_class completed (%)",
    )


def draw_policies(path: Path) -> None:
    """Share of policies that are taken over in time, in a walk and after a push."""
    rows = table("measured_policies.md", "Taken over")
    draw_shares(path, {"": rows}, {3: (BLUE, "stood")}, names=2, what="runs in which the robot stood (%)")


def draw_libraries(path: Path) -> None:
    """Times of other libraries over those of this one: a tick of Talos, and steps of inverse kinematics."""
    bars = [
        (f"tick of Talos: {row[0]}", numbers(row[2])[0], BLUE)
        for row in table("measured_controller.md", "A tick of Talos")
        if not row[0].startswith("wbc")
    ]
    for row in table("measured_controller.md", "A step (two busy cores)"):
        robot, ratios = row[0].partition(":")[0], [numbers(cell)[0] for cell in row[2:]]
        for library, ratio in zip(("Pink 4.4", "mink 1.3", "PlaCo 0.10"), ratios, strict=True):
            bars.append((f"step of {robot}: {library}", ratio, SKY))
    names, values, colours = zip(*bars, strict=True)
    figure, axis = plt.subplots(figsize=(8.4, 3.0), layout="constrained")
    axis.bar_label(axis.barh(names, values, color=colours), fmt="%.2g", padding=3, fontsize=9)
    axis.axvline(1.0, color="black", lw=1.0)
    axis.invert_yaxis()
    axis.margins(x=0.08)
    axis.set_xlabel("time divided by that of wbc (above 1, wbc is faster)")
    save(figure, path)


def draw_period(path: Path) -> None:
    """Parts of the wall time of a control period of simulated walks."""
    rows = table("measured_simulation.md", "Wall time, µs")
    parts = ["physics", "sensors, observer", "walk, stabilizer", "QP", "rest of the tick, result"]
    figure, axis = plt.subplots(figsize=(8.4, 2.5), layout="constrained")
    left = np.zeros(len(rows))
    for column, (part, colour) in enumerate(
        zip(parts, (GREY, SKY, BLUE, ORANGE, AMBER), strict=True), start=1
    ):
        widths = np.array([numbers(row[column])[0] for row in rows])
        axis.barh([row[0] for row in rows], widths, left=left, color=colour, label=part)
        left += widths
    axis.invert_yaxis()
    axis.set_xlabel("wall time of a control period (µs)")
    figure.legend(frameon=False, loc="outside upper center", ncols=len(parts), fontsize=8)
    save(figure, path)


def draw_bar(path: Path) -> None:
    """Depth of the ankle and largest angle of a hinge of feet on a bar, over the load."""
    rows = table("measured_simulation.md", "Load on a bar")
    loads = [50, 100, 200, 400]
    figure, axes = plt.subplots(1, 2, figsize=(8.4, 3.4), layout="constrained")
    for k, row in enumerate(rows):
        axis, colour = axes[k // 3], (ORANGE, AMBER, BLUE)[k % 3]
        axis.plot(
            loads, [numbers(cell)[0] for cell in row[1:]], "o-", color=colour, label=row[0].partition(": ")[2]
        )
    for axis, label in zip(
        axes, ("depth of the ankle (mm)", "largest angle of a hinge (degrees)"), strict=True
    ):
        axis.set_xlabel("load (N)")
        axis.set_ylabel(label)
        axis.set_ylim(0.0)
        axis.grid(color="0.9")
    figure.legend(*axes[0].get_legend_handles_labels(), frameon=False, loc="outside upper center", ncols=3)
    save(figure, path)


def draw_carts(path: Path) -> None:
    """Distance of the cart from its place at the end of each run."""
    rows = table("measured_hands.md", "Cart: control, robot")
    figure, axis = plt.subplots(figsize=(8.4, 1.1 + 0.28 * len(rows)), layout="constrained")
    for control, colour in (("position", ORANGE), ("torque", BLUE)):
        own = [row for row in rows if row[0].startswith(control)]
        names = [f"{row[0].partition(', ')[2]}, {row[2]}, seed {row[1]} ({control})" for row in own]
        bars = axis.barh(names, [numbers(row[4])[0] for row in own], color=colour, label=f"{control} control")
        axis.bar_label(bars, padding=3, fontsize=9)
    axis.invert_yaxis()
    axis.margins(x=0.08)
    axis.set_xlabel("distance of the cart from its place at the end (mm)")
    axis.tick_params(axis="y", labelsize=9)
    axis.legend(frameon=False, loc="lower right")
    save(figure, path)


def main() -> None:
    """Draw all charts."""
    folder = target(__doc__)
    folder.mkdir(parents=True, exist_ok=True)
    mpl.use("Agg")
    mpl.rcParams |= {"svg.hashsalt": "wbc", "svg.fonttype": "none", "font.family": "sans-serif"}
    for name, draw in (
        ("measured_bar.svg", draw_bar),
        ("measured_carts.svg", draw_carts),
        ("measured_changes.svg", draw_changes),
        ("measured_libraries.svg", draw_libraries),
        ("measured_own_soles.svg", draw_own_soles),
        ("measured_period.svg", draw_period),
        ("measured_policies.svg", draw_policies),
        ("measured_rough.svg", draw_rough),
        ("measured_seeing.svg", draw_seeing),
        ("measured_slip.svg", draw_slip),
        ("measured_speeds.svg", draw_speeds),
        ("measured_standing.svg", draw_standing),
        ("measured_tour.svg", draw_tour),
    ):
        draw(folder / name)
        print(f"wrote {folder / name}")


if __name__ == "__main__":
    main()
