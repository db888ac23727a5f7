"""Where the feet are and what they bear, out of a log."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.app.log import Log
from wbc.core.errors import Array

SIDES = ("left", "right")


def yaw_of(quaternions: Array) -> Array:
    """Headings of frames given as quaternions xyzw, shape (n, 4) → (n,), rad."""
    x, y, z, w = quaternions.T
    heading: Array = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return heading


def corners(centre: Array, yaw: Array, size: tuple[float, float]) -> Array:
    """Corners of sole rectangles seen from above.

    Args:
        centre: Shape (n, 2) or more, m.
        yaw: Shape (n,), rad.
        size: Length and width, m.

    Returns:
        Shape (n, 4, 2), m, counter-clockwise.
    """
    local = 0.5 * np.array(size) * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y = local.T
    turned = np.stack([c * x - s * y, s * x + c * y], axis=-1)
    placed: Array = np.asarray(centre)[:, None, :2] + turned
    return placed


def sole_sizes(log: Log) -> list[tuple[float, float]]:
    """Length and width of the left and of the right sole, m."""
    return [(float(s["length_m"]), float(s["width_m"])) for s in log.header["robot"]["soles"]]


def support_box(log: Log) -> tuple[Array, Array]:
    """Least and greatest x and y of the soles on which the walk counts, in every tick.

    Returns:
        Least and greatest, each of shape (ticks, 2), m; NaN without a foot on the ground.
    """
    low = np.full((len(log), 2), np.inf)
    high = np.full((len(log), 2), -np.inf)
    for side, size in zip(SIDES, sole_sizes(log), strict=True):
        place = f"foot/{side}/reference"
        shape = corners(log[f"{place}/position"], yaw_of(log[f"{place}/orientation"]), size)
        on = log[f"foot/{side}/contact"] > 0.5
        low[on] = np.minimum(low[on], shape[on].min(axis=1))
        high[on] = np.maximum(high[on], shape[on].max(axis=1))
    none = ~np.isfinite(low[:, 0])
    low[none] = high[none] = np.nan
    return low, high


@dataclass(frozen=True, eq=False)
class Stance:
    """A foot on the ground for a while.

    Attributes:
        side: Which.
        start: First tick.
        end: Tick behind the last one.
        corners: Of the sole seen from above, shape (4, 2), m.
    """

    side: str
    start: int
    end: int
    corners: Array


def stances(log: Log, which: str = "reference") -> list[Stance]:
    """Every time that a foot was on the ground, in order.

    Args:
        log: The log.
        which: "reference": where the walk has it; "truth": where it is, heading that of the reference.
    """
    found = []
    for side, size in zip(SIDES, sole_sizes(log), strict=True):
        place = f"foot/{side}/reference"
        position = log["truth/" + f"foot/{side}/position"] if which == "truth" else log[f"{place}/position"]
        yaw = yaw_of(log[f"{place}/orientation"])
        on = (log[f"foot/{side}/contact"] > 0.5).astype(int)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], on, [0]])))
        for start, end in edges.reshape(-1, 2).tolist():
            middle = (start + end) // 2  # the foot has settled by then
            shape = corners(position[middle : middle + 1], yaw[middle : middle + 1], size)[0]
            found.append(Stance(side, start, end, shape))
    return sorted(found, key=lambda stance: stance.start)
