"""Table of the tour: runs of this library, with intervals, beside the published rows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from wbc.sim.studies import mean_interval, share_interval


class Published(NamedTuple):
    """Best row of a policy in MuJoCo: mean survival, s, runs completed, %, errors of place, cm, and heading, °."""

    name: str
    survived: float
    completed: float
    position: float = math.nan
    heading: float = math.nan


SOURCE = "rhoyn/teleop-walking-benchmark, README at 0b2ea7ac (34 policies, 512 to 5,120 runs each)"

PUBLISHED = (
    Published("gr00t_wbc", 85.2, 80, 17, 8),
    Published("decoupled_wbc", 83.8, 74, 10, 7),
    Published("homie", 78.2, 55, 17, 32),
    Published("amo", 75.9, 54, 24, 17),
    Published("grove", 74.9, 49, 21, 7),
    Published("wbc_agile", 71.2, 34, 23, 8),
    Published("sonic", 69.2, 36, 29, 9),
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


def table(rows: Sequence[Mapping[str, Any]], name: str = "wbc") -> str:
    """Return a Markdown table of some runs beside the published ones, with 95 % intervals."""
    survived = np.array([row["survived"] for row in rows])
    completed = int(sum(row["completed"] for row in rows))
    places, headings = (
        np.array([row[what] for row in rows if row[what] is not None])
        for what in ("position_error", "heading_error")
    )
    low, high = share_interval(completed, len(rows))
    own = [
        f"**{name}**, {len(rows)} runs",
        mean_interval(survived).text(),
        f"{100.0 * completed / len(rows):.0f} [{100.0 * low:.0f}, {100.0 * high:.0f}]",
        mean_interval(100.0 * places).text(2),
        mean_interval(np.degrees(headings)).text(2),
    ]
    lines = [(float(survived.mean()), own)]
    for policy in PUBLISHED:
        rest = (policy.completed, policy.position, policy.heading)
        cells = [policy.name, f"{policy.survived:g}", *("" if math.isnan(v) else f"{v:g}" for v in rest)]
        lines.append((policy.survived, cells))
    lines.sort(key=lambda line: -line[0])
    head = ["", "survived, s", "completed, %", "place, cm", "heading, °"]
    body = [head, ["---"] * len(head), *(cells for _, cells in lines)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in body) + f"\n\nPublished: {SOURCE}."
