"""Squat: move the centre of mass down and up again.

A target is an attribute; assign to it whenever it changes. Its velocity and acceleration are fed forward, so that
the robot follows without lag.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from _common import parse, report, upright

import wbc

DEPTH, PERIOD = 0.12, 4.0
"""Amplitude of the centre of mass, m, and duration of down and up together, s."""


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=8.0)
    description = wbc.load_robot("hrp4_class")
    plant = wbc.Plant(description)
    controller = wbc.balance_controller(description.robot(), plant.control_period)
    control = wbc.PositionControl(controller)

    controller.task("posture").weight = 1e-3  # it gives way to the centre of mass
    com = controller.task("com")
    start = com.target
    lowest, error, rate = start[2], 0.0, 2.0 * math.pi / PERIOD
    with options.watch(plant) as view:
        while plant.time < options.seconds:
            phase = rate * plant.time
            com.target = start - [0.0, 0.0, 0.5 * DEPTH * (1.0 - math.cos(phase))]
            com.feedforward_velocity = [0.0, 0.0, -0.5 * DEPTH * rate * math.sin(phase)]
            com.feedforward_acceleration = [0.0, 0.0, -0.5 * DEPTH * rate**2 * math.cos(phase)]
            plant.step(control.command(plant.measure()))
            view.update()
            height = plant.truth().com[2]
            lowest, error = min(lowest, height), max(error, abs(height - com.target[2]))

    lowered = 1e3 * float(start[2] - lowest)
    return report(upright=upright(plant), lowered_mm=lowered, largest_error_mm=1e3 * float(error))


if __name__ == "__main__":
    main()
