"""A log of a walk whose values are known: two steps, with a drift of the estimate."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from log_writing import made_log

from wbc.app.log.reader import Log

TICKS = 40
SOLE = {"left": (0.2, 0.1), "right": (0.24, 0.12)}
ROBOT = {
    "name": "two soles",
    "mass_kg": 50.0,
    "soles": [{"name": side, "length_m": size[0], "width_m": size[1]} for side, size in SOLE.items()],
    "torque_limit_Nm": {},
}
TIME = 0.1 * np.arange(TICKS)
YAW = {"left": 0.3, "right": -0.2}
STANDS = {"left": (TIME < 1.95) | (TIME > 2.95), "right": TIME > 0.95}
TURN, SHIFT = 0.5, np.array([0.3, -0.2, 0.1])


def turned(angle: float, ticks: int = TICKS) -> np.ndarray:
    return np.tile([0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)], (ticks, 1))


def place(side: str) -> np.ndarray:
    """Place of a foot: it goes forward, at 0.1 m/s, while it is in the air."""
    away = np.cumsum(~STANDS[side]) * 0.01
    return np.column_stack([away, np.full(TICKS, 0.1 if side == "left" else -0.1), np.full(TICKS, 0.02)])


def about(points: np.ndarray) -> np.ndarray:
    """Places of points of the estimate in the true world: turned about the origin, and moved."""
    c, s = math.cos(TURN), math.sin(TURN)
    return np.asarray(points @ np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)]) + SHIFT)


def walk_columns() -> dict[str, Any]:
    sway = np.column_stack([0.1 * TIME, 0.05 * np.sin(TIME), np.full(TICKS, 0.8)])
    columns: dict[str, Any] = {"time": TIME}
    columns |= {"com/estimated": sway, "com/reference": sway + (0.01, 0.0, 0.0)}
    columns |= {"dcm/estimated": sway[:, :2] * 1.5, "dcm/reference": sway[:, :2] * 1.5 - (0.003, 0.004)}
    columns |= {"zmp/measured": sway * (1.0, 1.0, 0.0), "zmp/reference": sway * (0.9, 1.1, 0.0)}
    columns |= {"base/estimated/orientation": turned(0.1), "truth/base/orientation": turned(0.1 + TURN)}
    columns["truth/com"] = about(sway)
    for side in SOLE:
        columns |= {
            f"foot/{side}/contact": STANDS[side].astype(float),
            f"foot/{side}/reference/position": place(side),
            f"foot/{side}/reference/orientation": turned(YAW[side]),
            f"foot/{side}/estimated/position": place(side),
            f"foot/{side}/estimated/orientation": turned(YAW[side]),
            f"foot/{side}/wrench_measured": np.where(STANDS[side][:, None], 1.0, 0.0)
            * (0, 0, 250.0, 0, 0, 0),
            f"truth/foot/{side}/position": about(place(side)),
        }
    return columns


def other(path: Path, changed: dict[str, Any] | None = None, *gone: str, **header: Any) -> Log:
    """The log of the walk with other columns, and without some."""
    columns = {name: values for name, values in walk_columns().items() if not name.startswith(gone or ("-",))}
    return made_log(path / "other.arrow", columns | (changed or {}), **{"robot": ROBOT} | header)
