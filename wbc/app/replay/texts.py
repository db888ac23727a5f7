"""What a picture of a replay says in words."""

from __future__ import annotations

import math

from wbc.app.log import Log
from wbc.app.log.columns import SIDES

LAST_EVENTS = 2.0
"""How long an event stays to be read, s."""


def caption(log: Log, tick: int) -> str:
    """Phase, step, stiffness of the soles and the last event, a line each; empty for a run without these."""
    lines = []
    if "walk/phase" in log:
        phase, side = log.texts("walk/phase")[tick], log.texts("step/side")[tick]
        swing = f", {side} foot swings" if phase == "single support" and side else ""
        lines.append(f"{phase or ''}{swing}, {log['walk/steps_done'][tick]:.0f} steps done")
    stiffness = [
        float(log[f"foot/{side}/stiffness"][tick]) for side in SIDES if f"foot/{side}/stiffness" in log
    ]
    if stiffness and all(math.isfinite(value) for value in stiffness):
        lines.append("soles " + " and ".join(f"{value:.1f}" for value in stiffness) + " Nm/rad")
    now = float(log.time[tick])
    past = [text for time, text in log.events if now - LAST_EVENTS <= time <= now]
    if past:
        lines.append(past[-1])
    return "\n".join(lines)
