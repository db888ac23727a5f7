"""Parts of walks: presets by name, and one part over another, for programs, files and the command alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wbc.base.registry import Registry
from wbc.sim.walks.plan import KINDS

FAST_LANDING = {"apex": 0.5, "landing_height": 0.0, "landing_speed": 0.05}
"""Swing of mc_rtc: the highest point in the middle, no slow part before the landing."""

FRIZZA: Mapping[str, Any] = {
    "foot": "paper",
    "terrain": "random",
    "gains": "frizza",
    "gait": FAST_LANDING,
    "plan": {"distance": 3.0},
    "changes": {"stiffness.decide_at": 0.75, "stiffness.early_landing": 0.0, "stiffness.deadline": 0.0},
}
"""The paper's walk: its law and gains, its foot (0 to 80 Nm/rad, set at once), the scan evaluated at 75 % of the single
support, over a unidirectional ground as in its experiment 1.

Source: gains, foot and time of the decision from the paper, sections II, IV-B and IV-C; phases and swing height, from
the public configuration of its authors' controller, are the usual ones (22 steps of 0.145 m are the paper's 3 m)."""

STONES: Mapping[str, Any] = {"foot": "long_arch", "terrain": "stones", "amplitude": 0.02, "eyes": "depth"}
"""An unknown ground that the robot sees, and the sole on which most walks arrive: the walk of the command."""

WALK_PRESETS: Registry[Mapping[str, Any]] = Registry("preset of walks", {"stones": STONES, "frizza": FRIZZA})
"""Presets by name, each as parts of a `WalkSpec` in plain values; what they leave out is as in a program."""

USUAL = "stones"
"""Preset of the command where no other one is given."""

FOLLOWERS = {
    "foot": ("stiffness", "foot_changes", "policy", "policy_params"),
    "terrain": ("amplitude", "terrain_params"),
    "scene": ("scene_params",),
}
"""Field of a spec → those that belong to its value, and go with it."""


def over(upper: Mapping[str, Any], lower: Mapping[str, Any]) -> dict[str, Any]:
    """Return parts of a walk over others; what belongs to a value that is replaced is dropped with it."""
    kept = dict(lower)
    for name, followers in FOLLOWERS.items():
        if upper.get(name, kept.get(name)) != kept.get(name):
            kept = {key: value for key, value in kept.items() if key not in followers}
    for name, value in upper.items():
        below = kept.get(name)
        if not (isinstance(value, Mapping) and isinstance(below, Mapping)):
            kept[name] = value
        elif name == "plan":
            kept[name] = plan_over(value, below)
        else:
            others = {key: old for key, old in below.items() if not any(_same(key, new) for new in value)}
            kept[name] = {**others, **value}
    return kept


def plan_over(upper: Mapping[str, Any], lower: Mapping[str, Any]) -> dict[str, Any]:
    """Return fields of a plan over those of another; a plan of another kind takes its place."""
    kept = {name: value for name, value in lower.items() if value is not None}
    kinds = [name for name in KINDS if upper.get(name) is not None]
    if kinds and not any(name in kept for name in kinds):
        kept = {}
    return {**kept, **upper}


def _same(one: str, other: str) -> bool:
    """Return True for two names of one setting: dcm_p is gains.dcm_p."""
    return one == other or one.endswith(f".{other}") or other.endswith(f".{one}")
