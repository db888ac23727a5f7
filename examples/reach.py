"""Reach: bring a hand to a point in space while the rest of the body keeps the balance.

One more task is enough. The hand follows a straight line; the lean of the torso results from the QP, and the weights of
the tasks decide which of them give way when not all are possible.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from _common import parse, report, upright

import wbc

REACH = np.array([0.30, -0.05, 0.25])
"""Vector from the hand's initial position to the point, m: forward, inward, up."""

DURATION = 1.5
"""Duration of the motion, s."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=4.0)
    description = wbc.load_robot("hrp4_class")
    plant = wbc.Plant(description)
    robot = description.robot()
    controller = wbc.balance_controller(robot, plant.control_period)
    control = wbc.PositionControl(controller)

    controller.task("posture").weight = 1e-3  # the arm's posture gives way to the hand
    hand = controller.add(wbc.PositionTask(robot.frames["left_hand"], weight=10.0, stiffness=100.0))
    start = hand.target
    with options.watch(plant) as view:
        while plant.time < options.seconds:
            s = min(plant.time / DURATION, 1.0)  # minimum jerk: at rest at both ends
            hand.target = start + REACH * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
            hand.feedforward_velocity = REACH * (30.0 * s**2 - 60.0 * s**3 + 30.0 * s**4) / DURATION
            plant.step(control.command(plant.measure()))
            view.update()

    truth, real = plant.truth(), description.robot()
    real.update(truth.q, truth.v)
    distance = np.linalg.norm(real.placement(hand.frame).translation - (start + REACH))
    return report(upright=upright(plant), distance_mm=1e3 * float(distance))


if __name__ == "__main__":
    main()
