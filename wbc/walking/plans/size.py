"""The default gait for the size of a robot."""

from __future__ import annotations

import math
from dataclasses import fields, replace

from wbc.base.settings import in_units
from wbc.core.robot import Robot
from wbc.walking.plans.gait import Gait, StepGait
from wbc.walking.plans.reach import Reach

STEP = 0.99
"""Share of the legs' reach that a default step may take."""


def sized(gait: Gait, robot: Robot) -> Gait:
    """Return a gait whose values that are not given fit a robot's size (`Robot.length_scale`) and its legs.

    A pendulum of half the height falls in √½ of the time: times and speeds go with the root of lengths.
    """
    root = math.sqrt(robot.length_scale)
    usual = StepGait()
    own = in_units(usual, {"m": root**2, "s": root, "m/s": root})
    changes = {
        field.name: round(value, 4)
        for field in fields(gait)
        if getattr(gait, field.name) is None
        and (value := getattr(own, field.name)) != getattr(usual, field.name)
    }
    if gait.step_length is None:
        reach = STEP * Reach.of(robot).max_length
        if reach < changes.get("step_length", usual.step_length):
            changes["step_length"] = reach
    return replace(gait, **changes)
