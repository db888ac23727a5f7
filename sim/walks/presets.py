"""Presets of walks: parts of a spec by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wbc.base.registry import Registry

FAST_LANDING = {"apex": 0.5, "landing_height": 0.0, "landing_speed": 0.05}
"""Swing of mc_rtc: the highest point in the middle, no slow part before the landing."""

FRIZZA: Mapping[str, Any] = {
    "foot": "paper",
    "terrain": "random",
    "gains": "frizza",
    "gait": FAST_LANDING,
    "plan": {"distance": 3.0},
    "changes": {
        "stiffness.decide_at": 0.75,
        "stiffness.early_landing": 0.0,
        "stiffness.deadline": 0.0,
    },
}
"""The paper's walk: its law and gains, its foot (0 to 80 Nm/rad, set at once), the scan evaluated at 75 % of the single
support, over a unidirectional ground as in its experiment 1.

Source: gains, foot and time of the decision from the paper, sections II, IV-B and IV-C; phases and swing height, from
the public configuration of its authors' controller, are the usual ones (22 steps of 0.145 m are the paper's 3 m)."""

WALK_PRESETS: Registry[Mapping[str, Any]] = Registry("preset of walks", {"frizza": FRIZZA})
"""Presets by name, each as parts of a `WalkSpec` in plain values."""
