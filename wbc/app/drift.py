"""Geometry of pictures and figures: the drift of the estimate, headings, and the corners of soles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from wbc.base.numbers import Array
from wbc.core.robot import SIDES

if TYPE_CHECKING:
    from wbc.app.log.reader import Log

MIN_LOAD = 0.01
"""Share of the weight from which on a foot or a contact counts as support in pictures and figures: noise of force
sensors is less."""


class Drift:
    """Placement of the world of the estimate in the true one, by the middle of the feet and the heading of the base.

    Attributes:
        turn: Heading of the estimate's world, shape (ticks,), rad.
        size: Horizontal distance between the middle of the feet and where it is estimated, shape (ticks,), m.
    """

    def __init__(self, turn: Array, estimated: Array, true: Array) -> None:
        """Store heading, and the middle of the feet as estimated and true, each of shape (ticks, 3), m."""
        self.turn = np.arctan2(np.sin(turn), np.cos(turn))
        self._from, self._to = estimated, true
        self.size: Array = np.linalg.norm((true - estimated)[:, :2], axis=1)

    @classmethod
    def of(cls, log: Log) -> Drift:
        """Return the drift of a log; none without ground truth, and of a robot that has not two feet."""
        robot, known = log.header.get("robot"), ("truth/base", "base/estimated")
        other = robot is not None and len(robot["soles"]) != len(SIDES)
        if other or any(f"{base}/orientation/x" not in log for base in known):
            return cls(np.zeros(len(log)), *np.zeros((2, len(log), 3)))
        turn = yaw_of(log.vector("truth/base/orientation", 4)) - yaw_of(
            log.vector("base/estimated/orientation", 4)
        )
        estimated = np.mean([log.vector(f"foot/{side}/estimated/position", 3) for side in SIDES], axis=0)
        true = np.mean([log.vector(f"truth/foot/{side}/position", 3) for side in SIDES], axis=0)
        return cls(turn, estimated, true)

    def text(self, tick: int) -> str:
        """Return what a page says of the drift at a tick."""
        return f"estimate {1e3 * self.size[tick]:.0f} mm and {round(math.degrees(self.turn[tick]), 1) + 0.0:+.1f}° off"

    def __call__(self, points: Array, tick: int | slice = slice(None)) -> Array:
        """Return points of the estimate's world in the true one, one a tick or all of one tick, shape (…, 2 or 3)."""
        turn, size = self.turn[tick], points.shape[-1]
        c, s, (x, y) = np.cos(turn), np.sin(turn), (points - self._from[tick, :size]).T[:2]
        moved: Array = points - self._from[tick, :size] + self._to[tick, :size]
        moved[..., 0] += c * x - s * y - x
        moved[..., 1] += s * x + c * y - y
        return moved


def yaw_of(quaternions: Array) -> Array:
    """Return the headings (rad), shape (n,), of frames given as quaternions xyzw, shape (n, 4)."""
    x, y, z, w = quaternions.T
    heading: Array = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return heading


def sole_corners(size: tuple[float, float], centre: Array, axes: Array) -> Array:
    """Return the corners of soles, counter-clockwise from above, shape (…, 4, k), m.

    The size is length and width, m; centres have shape (…, k), m, and axes (…, k, 2 or 3): forward and left are the
    first two columns. In the plane k is 2, in space 3.
    """
    local = 0.5 * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * size
    corners: Array = centre[..., None, :] + local @ axes[..., :2].swapaxes(-1, -2)
    return corners
