"""Caption of a picture of a replay."""

from __future__ import annotations

import math

from wbc.app.log.reader import Log
from wbc.app.log.stances import Drift
from wbc.app.scene.layers import stiffness_text
from wbc.core.robot import SIDES

EVENT_TIME = 2.0
"""Time for which an event is shown, s."""


def caption(log: Log, tick: int, drift: Drift | None = None) -> str:
    """Return program, phase, step, stiffness of the soles, drift and last event, one line each, as far as logged."""
    lines = []
    if "program/state" in log:
        lines.append(str(log.texts("program/state")[tick]))
    if "walk/phase" in log:
        phase, side = log.texts("walk/phase")[tick], log.texts("step/side")[tick]
        swing = f", {side} foot swings" if phase == "single support" and side else ""
        lines.append(f"{phase or ''}{swing}, {log['walk/steps_done'][tick]:.0f} steps done")
    stiffness = [
        float(log[f"foot/{side}/stiffness"][tick]) for side in SIDES if f"foot/{side}/stiffness" in log
    ]
    if stiffness and all(math.isfinite(value) for value in stiffness):
        lines.append(stiffness_text(stiffness))
    if drift is not None and "truth/com/x" in log and "foot/left/contact" in log:
        lines.append(drift.text(tick))
    now = float(log.time[tick])
    past = [text for time, text in log.events if now - EVENT_TIME <= time <= now]
    if past:
        lines.append(past[-1])
    return "\n".join(lines)
