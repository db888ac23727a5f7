"""Walk with a velocity: forwards, sideways, turning, or all at once; then stop on command.

    python walk_velocity.py --forward 0.1 --left 0.05 --turn 0.1 --view

The distance is open. After `--seconds` a stop is commanded: the robot lands the swing foot, brings the other one beside
it, and stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from _common import parse, report, upright

import wbc
from wbc.walking import FootstepPlan, WalkingControl, walk_velocity

STOPPING_TIME = 5.0
"""Longest time from the stop command to standing, s: two steps, and 0.8 s to come to rest."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=10.0, forward=0.1, left=0.0, turn=0.0)
    description = wbc.load_robot("hrp4_class")
    plant = wbc.Plant(description, noise="realistic")

    robot = description.robot()
    start = FootstepPlan.standing(robot)
    cycle = start.gait.single_support + start.gait.double_support
    steps = 2 + round(options.seconds / cycle)  # more than are needed
    plan = walk_velocity(start, (options.forward, options.left, options.turn), steps)
    walking = WalkingControl(robot, plan, plant.control_period)

    began = plant.truth()
    end = options.seconds + STOPPING_TIME
    with options.watch(plant, walking) as view:
        while plant.time < end and not walking.done:
            if plant.time >= options.seconds:
                walking.stop()  # may be repeated
            plant.step(walking.command(plant.measure()))
            view.update()

    truth = plant.truth()
    forward, left = (truth.com - began.com)[:2]
    turned = 2.0 * np.arctan2(truth.q[5], truth.q[6])  # of the pelvis, which is level
    return report(
        upright=upright(plant),
        stands=walking.finished,
        steps=walking.steps_done,
        forward_m=float(forward),
        left_m=float(left),
        turned_deg=float(np.degrees(turned)),
    )


if __name__ == "__main__":
    main()
