"""The default gait for the size of a robot."""

from __future__ import annotations

import math
from dataclasses import replace

from wbc.core.robot import Robot
from wbc.walking.plans.gait import Gait, StepGait
from wbc.walking.plans.reach import Reach

LENGTHS = ("step_length", "swing_height", "landing_height", "search_depth")
TIMES = (
    *("single_support", "double_support", "initial_double_support", "final_double_support"),
    *("takeoff_time", "landing_time", "search_time"),
)
SPEEDS = ("landing_speed",)

STEP = 0.99
"""Share of the legs' reach that a default step may take."""


def sized(gait: Gait, robot: Robot) -> Gait:
    """Return a gait whose values that are not given fit a robot's size (`Robot.length_scale`) and its legs."""
    scale = robot.length_scale
    default, changes = StepGait(), dict[str, float]()
    for names, factor in ((LENGTHS, scale), (TIMES, math.sqrt(scale)), (SPEEDS, math.sqrt(scale))):
        for name in names:
            if scale < 1.0 and getattr(gait, name) is None:
                changes[name] = round(factor * getattr(default, name), 4)
    if gait.step_length is None:
        reach = STEP * Reach.of(robot).max_length
        if reach < changes.get("step_length", default.step_length):
            changes["step_length"] = reach
    return replace(gait, **changes)
