"""Table of the tour: runs of this library, with intervals, beside the published rows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from wbc.sim.studies import mean_interval, share_interval


class Published(NamedTuple):
    """Best row of a policy in MuJoCo: mean survival, s, runs completed, %, errors of place, cm, and heading, °.

    `other` is the mean survival in PhysX, s.
    """

    name: str
    survived: float
    completed: float
    position: float = math.nan
    heading: float = math.nan
    other: float = math.nan


SOURCE = "rhoyn/teleop-walking-benchmark, README at 0b2ea7ac (34 policies, 512 to 5,120 runs each)"

EFFORT = (
    "Energy and vibration are means over completed runs, of all joints, vibration in 10⁶ rad/s²; the best policies "
    "publish 5.9 to 7.3 kJ and 0.9 to 1.2."
)

PUBLISHED = (
    Published("gr00t_wbc", 85.2, 80, 17, 8, 82.9),
    Published("decoupled_wbc", 83.9, 75, 10, 7, 81.5),
    Published("homie", 78.2, 55, 17, 32, 79.0),
    Published("amo", 75.9, 54, 24, 17, 79.5),
    Published("grove", 74.9, 49, 21, 7, 80.5),
    Published("wbc_agile", 71.2, 34, 23, 8, 67.1),
    Published("sonic", 69.2, 36, 29, 9, 54.0),
    Published("run_residual", 50.7, 6),
    Published("mimic_lite", 47.9, 9),
    Published("asap", 46.3, 7),
    Published("robomimic", 44.7, 6),
    Published("falcon", 37.7, 2),
    Published("openwbt", 26.5, math.nan),
    Published("rl_lab", 25.5, math.nan),
    Published("holosoma", 5.9, math.nan),
    Published("rl_gym", 1.2, math.nan),
)
"""Rows of the benchmark, best first."""


def table(rows: Sequence[Mapping[str, Any]], name: str = "wbc", most: int | None = None) -> str:
    """Return a Markdown table of some runs beside the published ones, with 95 % intervals.

    Runs of one setup are a row; those in another engine than MuJoCo are its last column. The table has `most` rows,
    those of the runs and the best of the published ones; all when None.
    """
    setups: dict[str, dict[bool, list[Mapping[str, Any]]]] = {}
    for row in rows:
        there = row.get("engine", "mujoco") == "mujoco"
        setups.setdefault(str(row.get("setup", "")), {}).setdefault(there, []).append(row)
    lines = []
    for setup, found in setups.items():
        here, other = found.get(True, []), found.get(False, [])
        title = f"**{name}**" + (f", {setup}" if setup else "")
        cells = [f"{title}, {_runs(here or other)}", *([""] * 6 if not here else _figures(here))]
        cells.append(f"{_survived(other)} ({other[0]['engine']}, {_runs(other)})" if other else "")
        lines.append((float(np.mean([row["survived"] for row in here or other])), cells))
    for policy in PUBLISHED[: None if most is None else max(0, most - len(lines))]:
        rest = (
            policy.survived,
            policy.completed,
            policy.position,
            policy.heading,
            math.nan,
            math.nan,
            policy.other,
        )
        lines.append((policy.survived, [policy.name, *("" if math.isnan(v) else f"{v:g}" for v in rest)]))
    lines.sort(key=lambda line: -line[0])
    head = ["", "survived, s", "completed, %", "place, cm", "heading, °", "energy, kJ", "vibration"]
    head += ["survived in another engine, s"]
    body = [head, ["---"] * len(head), *(cells for _, cells in lines)]
    text = "\n".join("| " + " | ".join(cells) + " |" for cells in body)
    return f"{text}\n\nPublished: {SOURCE}; their other engine is PhysX. {EFFORT}"


def _runs(rows: Sequence[Mapping[str, Any]]) -> str:
    return f"{len(rows)} run{'s' if len(rows) > 1 else ''}"


def _survived(rows: Sequence[Mapping[str, Any]]) -> str:
    return mean_interval(np.array([row["survived"] for row in rows])).text()


def _figures(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return survival, share completed, errors, energy and vibration of some runs, with intervals."""
    completed = int(sum(row["completed"] for row in rows))
    low, high = share_interval(completed, len(rows))
    places, headings = (
        np.array([row[what] for row in rows if row[what] is not None])
        for what in ("position_error", "heading_error")
    )
    efforts = [
        np.array([sum(row[what].values()) / unit for row in rows if row["completed"] and what in row])
        for what, unit in (("energy", 1e3), ("vibration", 1e6))
    ]
    return [
        _survived(rows),
        f"{100.0 * completed / len(rows):.0f} [{100.0 * low:.0f}, {100.0 * high:.0f}]",
        mean_interval(100.0 * places).text(2),
        mean_interval(np.degrees(headings)).text(2),
        *(mean_interval(each).text(2) if each.size else "" for each in efforts),
    ]
