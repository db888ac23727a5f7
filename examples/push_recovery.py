"""Push recovery: a shove on the chest while standing, in position control and, with `--mode torque`, in torque control.

In torque control the controller estimates the robot's state and answers through the ground forces. In position control
(open loop, the default) stiff servos hold the robot, and the controller gets no feedback.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from _common import parse, report, upright

import wbc

IMPULSE = 0.15
"""Impulse of the push per mass, Ns/kg: the change of the velocity of the centre of mass, m/s."""

DURATION, START = 0.1, 0.5
"""Duration and start of the push, s."""

DIRECTIONS = {"forward": (1.0, 0.0), "left": (0.0, 1.0), "back": (-1.0, 0.0), "right": (0.0, -1.0)}


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=3.0, mode=("position", "torque"), direction=tuple(DIRECTIONS))
    description = wbc.load_robot("hrp4_class")
    torque = options.mode == "torque"
    plant = wbc.Plant(description, control_period=0.002 if torque else 0.005)
    controller = wbc.balance_controller(description.robot(), plant.control_period)
    control = wbc.TorqueControl(controller) if torque else wbc.PositionControl(controller)

    start = plant.truth().com
    force = IMPULSE * plant.robot.mass / DURATION * np.array([*DIRECTIONS[options.direction], 0.0])
    pushed, farthest = False, 0.0
    with options.watch(plant) as view:
        while plant.time < options.seconds:
            if not pushed and plant.time >= START:
                plant.push("torso", force, DURATION)
                pushed = True
            plant.step(control.command(plant.measure()))
            view.update()
            farthest = max(farthest, float(np.linalg.norm(plant.truth().com - start)))

    end = float(np.linalg.norm(plant.truth().com - start))
    return report(upright=upright(plant), farthest_mm=1e3 * farthest, at_the_end_mm=1e3 * end)


if __name__ == "__main__":
    main()
