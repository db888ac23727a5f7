"""Reach while walking: one hand is carried in front of the pelvis, the other one goes to a point of the world.

The point is out of reach when the walk begins. That makes no robot fall: errors of tasks are bounded, and hands do not
pull at the balance. The hand strains forward, and arrives when the walk does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from _common import parse, report, upright

import wbc
from wbc.walking import FootstepPlan, WalkingControl, walk_distance

CARRIED = np.array([0.30, 0.20, 0.15])
"""Place of the left hand in front of the pelvis, m: forward, left, up."""

AHEAD = np.array([0.35, -0.25, 0.20])
"""Point that the right hand goes to, seen from where the pelvis will end, m."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, distance=1.0)
    description = wbc.load_robot("hrp4_class")
    plant = wbc.Plant(description, noise="realistic")

    robot = description.robot()
    end = robot.placement(robot.base_frame).translation + [options.distance, 0.0, 0.0]
    plan = walk_distance(FootstepPlan.standing(robot), options.distance)
    walking = WalkingControl(robot, plan, plant.control_period)
    left, right = walking.arms["left_hand"], walking.arms["right_hand"]
    left.reach(CARRIED, "pelvis")
    right.reach(end + AHEAD)  # in the world

    real, carried = description.robot(), []
    with options.watch(plant, walking) as view:
        while not walking.done:
            plant.step(walking.command(plant.measure()))
            view.update()
            truth = plant.truth()
            real.update(truth.q, truth.v)
            hand = real.placement(robot.base_frame).actInv(real.placement(left.frame)).translation
            if plant.time > 2.0:  # it is there by then
                carried.append(np.linalg.norm(hand - CARRIED))

    distance = np.linalg.norm(real.placement(right.frame).translation - (end + AHEAD))
    return report(
        upright=upright(plant),
        steps=walking.steps_done,
        carried_rms_mm=1e3 * float(np.sqrt(np.mean(np.square(carried)))),
        distance_mm=1e3 * float(distance),
    )


if __name__ == "__main__":
    main()
