"""A foot on the rig: pressed on a ground, and drawn from the side and from above.

python examples/paper/foot.py --stiffness 5 --terrain stones --amplitude 0.03 --seed 1 -o press.png
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wbc.feet import foot
from wbc.sim import FootTest, make_terrain, press

Array = NDArray[np.float64]

MARGIN = 0.03
"""Ground drawn around the foot, m."""

_GRID = 0.002  # m
_SOLE, _CONTACT, _SUPPORT, _GROUND = "#d98d40", "#c22f2f", "#2f6fc2", "#8a8178"


def press_figure(test: FootTest, result: Any) -> Figure:
    """Draw a pressed foot from the side and from above."""
    figure = _figure(8.0, 7.2)
    side, top = figure.subplots(2, 1, sharex=True, height_ratios=(3.0, 4.0))
    _draw_side(side, test, result.hold)
    image = _draw_top(top, test, result.hold, result.support)
    bar = figure.colorbar(image, ax=(side, top), label="ground (mm)")
    heights = np.asarray(image.get_array())
    bar.ax.set_ylim(bottom=float(heights.min()) - 0.5)  # without the colours that leave it pale
    figure.legend(loc="outside lower center", ncols=6, fontsize=7)
    hold = result.hold
    support = "" if result.support is None else f", support {1e4 * result.support.area:.0f} cm²"
    side.set_title(
        f"{_named(test)}, {hold.force_mean:.0f} N on {hold.contacts} contacts, contact area "
        f"{1e4 * hold.contact_area:.0f} cm²{support}",
        fontsize=9,
    )
    return figure


def _named(test: FootTest) -> str:
    ground = test.ground
    return (
        f"{type(test.foot).__name__} on {ground.name} ({1e3 * ground.amplitude:.0f} mm, seed {ground.seed})"
    )


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="compressed")


def _ground(test: FootTest, hold: Any, x: Array, y: Array) -> Array:
    """Return the height of the ground at plan points, m."""
    ankle = test.foot.fit(test.robot_sole).sole.ankle
    cos, sin = math.cos(test.yaw), math.sin(test.yaw)
    dx, dy = x - ankle[0], y - ankle[1]
    place = hold.ankle_place
    return np.asarray(test.ground.height(place[0] + cos * dx - sin * dy, place[1] + sin * dx + cos * dy))


def _draw_side(axes: Axes, test: FootTest, hold: Any) -> None:
    fitted = test.foot.fit(test.robot_sole).sole
    x = np.arange(-fitted.length / 2.0 - MARGIN, fitted.length / 2.0 + MARGIN, _GRID)
    y = np.linspace(-fitted.width / 2.0, fitted.width / 2.0, 41)
    z = 1e3 * _ground(test, hold, x[None, :], y[:, None])
    axes.fill_between(
        1e3 * x, z.min(axis=0), z.max(axis=0), color=_GROUND, alpha=0.35, lw=0, label="ground across"
    )
    axes.plot(1e3 * x, z[len(y) // 2], color=_GROUND, lw=1.2, label="ground, middle")
    line = 1e3 * np.array(hold.sole_line)
    columns = test.foot.contact.columns
    for column in range(columns):
        middle = column == columns // 2
        axes.plot(*line[column::columns, ::2].T, ".-", color=_SOLE, alpha=1.0 if middle else 0.4, ms=4)
    skeleton = 1e3 * np.array(hold.skeleton)
    axes.plot(skeleton[:, 0], skeleton[:, 2], "o-", color="#454a52", lw=2.5, ms=4)
    points, forces = 1e3 * np.array(hold.contact_points).reshape(-1, 3), np.array(hold.contact_forces)
    for point, force in zip(points, forces, strict=True):
        tip = (point[0], point[2] + 30.0 * force / forces.max())
        axes.annotate("", tip, (point[0], point[2]), arrowprops={"arrowstyle": "->", "color": _CONTACT})
    axes.axvline(1e3 * hold.centre_of_pressure[0], color=_CONTACT, ls=":", lw=1)
    axes.set_ylabel("z (mm)")
    axes.set_aspect("equal")


def _draw_top(axes: Axes, test: FootTest, hold: Any, support: Any) -> QuadMesh:
    fitted = test.foot.fit(test.robot_sole).sole
    half = (fitted.length / 2.0 + MARGIN, fitted.width / 2.0 + MARGIN)
    x, y = np.arange(-half[0], half[0], _GRID), np.arange(-half[1], half[1], _GRID)
    z = 1e3 * _ground(test, hold, x[None, :], y[:, None])
    low = z.min() - 2.0 * np.ptp(z) - 1.0  # pale, so that what is drawn over it can be seen
    image = axes.pcolormesh(1e3 * x, 1e3 * y, z, cmap="Greys_r", vmin=low, shading="nearest")
    corners = 500.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * (fitted.length, fitted.width)
    axes.plot(*corners.T, color=_SOLE, lw=1.2, label="sole")
    if support is not None and len(support.polygon) > 2:
        ring = 1e3 * np.array([*support.polygon, support.polygon[0]])
        axes.fill(*ring.T, color=_SUPPORT, alpha=0.25, lw=0, label="equivalent support")
    points, forces = np.array(hold.contact_points).reshape(-1, 3), np.array(hold.contact_forces)
    if len(points):
        size = 120.0 * forces / forces.max()
        axes.scatter(1e3 * points[:, 0], 1e3 * points[:, 1], s=size, color=_CONTACT, label="contacts")
    axes.plot(*(1e3 * np.array(hold.centre_of_pressure)), "x", color="black", label="centre of pressure")
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")
    axes.set_aspect("equal")
    return image


def main() -> None:
    """Test one foot, and draw it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--foot", default="soft")
    parser.add_argument("--stiffness", type=float, help="of the hinges of a soft sole, Nm/rad")
    parser.add_argument("--terrain", default="flat")
    parser.add_argument("--amplitude", type=float, help="m")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--load", type=float, default=200.0, help="on the ankle, N")
    parser.add_argument("-o", "--out", type=Path, required=True, help="picture")
    options = parser.parse_args()
    design = foot(options.foot, **({} if options.stiffness is None else {"stiffness": options.stiffness}))
    ground = make_terrain(options.terrain, options.amplitude, options.seed)
    test = FootTest(design, ground, load=options.load)
    result = press(test)
    if result.diverged:
        raise SystemExit("the simulation diverged")
    press_figure(test, result).savefig(options.out, dpi=150)


if __name__ == "__main__":
    main()
