"""Sole outlines, stances and support of a logged run, for figures and replays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.app.drift import MIN_LOAD, Drift, sole_corners, yaw_of
from wbc.app.log.reader import Log
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.robot import GRAVITY, SIDES


def level_corners(size: tuple[float, float], centre: Array, yaw: Array) -> Array:
    """Return the corners of level soles from above, shape (n, 4, 2), m; centres have shape (n, ≥2), yaws (n,)."""
    c, s = np.cos(yaw), np.sin(yaw)
    return sole_corners(size, centre[:, :2], np.moveaxis(np.array([(c, -s), (s, c)]), -1, 0))


def _robot_of(log: Log) -> Mapping[str, Any]:
    """Return what the header says of the robot; `InputError` for a robot without two soles, or none."""
    robot: Mapping[str, Any] | None = log.header.get("robot")
    if robot is None or len(robot["soles"]) != len(SIDES):
        soles = "no robot" if robot is None else f"a robot with {len(robot['soles'])} soles"
        raise InputError(
            f"{log.path} is of {soles}; stances can be read for a robot with a left and a right sole"
        )
    return robot


def sole_sizes(log: Log) -> list[tuple[float, float]]:
    """Return length and width of the left and the right sole, m."""
    return [(float(s["length_m"]), float(s["width_m"])) for s in _robot_of(log)["soles"]]


def support_box(log: Log) -> tuple[Array, Array]:
    """Return lower and upper x and y of the support in every tick, shape (ticks, 2), m; NaN where no foot stands.

    Where no contact is planned, a foot stands that bears a share of the weight, `MIN_LOAD`.
    """
    low = np.full((len(log), 2), np.inf)
    high = np.full((len(log), 2), -np.inf)
    walk = "foot/left/contact" in log
    weight = float(_robot_of(log)["mass_kg"]) * GRAVITY
    for side, size in zip(SIDES, sole_sizes(log), strict=True):
        place = f"foot/{side}/{'reference' if walk else 'estimated'}"
        yaw = yaw_of(log.vector(f"{place}/orientation", 4))
        shape = level_corners(size, log.vector(f"{place}/position", 2), yaw)
        loaded = log[f"foot/{side}/wrench_measured/fz"] > MIN_LOAD * weight
        on = log[f"foot/{side}/contact"] > 0.5 if walk else loaded
        low[on] = np.minimum(low[on], shape[on].min(axis=1))
        high[on] = np.maximum(high[on], shape[on].max(axis=1))
    none = ~np.isfinite(low[:, 0])
    low[none] = high[none] = np.nan
    return low, high


@dataclass(frozen=True, eq=False)
class Stance:
    """One stance of a foot, from touch-down to lift-off.

    Attributes:
        side: "left" or "right".
        start: First tick.
        end: Tick after the last one.
        corners: Corners of the sole, shape (4, 3), m, level.
    """

    side: str
    start: int
    end: int
    corners: Array


def stances(log: Log, which: str = "reference", drift: Drift | None = None) -> list[Stance]:
    """Return all stances of both feet whose places are known, ordered by touch-down; the drift is that of the log."""
    made, drift = [], drift or Drift.of(log)
    for side, size in zip(SIDES, sole_sizes(log), strict=True):
        foot = f"foot/{side}/{'estimated' if which == 'truth' else 'reference'}"
        position = log.vector(f"truth/foot/{side}/position" if which == "truth" else f"{foot}/position", 3)
        yaw = yaw_of(log.vector(f"{foot}/orientation", 4))
        on = (log[f"foot/{side}/contact"] > 0.5).astype(int)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], on, [0]])))
        for start, end in edges.reshape(-1, 2).tolist():
            middle = (start + end) // 2  # the foot has settled by then
            turned = yaw[middle] + (drift.turn[middle] if which == "truth" else 0.0)
            flat = level_corners(size, position[middle : middle + 1], np.array([turned]))[0]
            shape = np.column_stack([flat, np.full(4, np.nan_to_num(position[middle, 2]))])
            shape = shape if which == "truth" else drift(shape, start)
            if np.isfinite(shape).all():
                made.append(Stance(side, start, end, shape))
    return sorted(made, key=lambda stance: stance.start)
