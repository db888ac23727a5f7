"""Stand: the smallest program that balances a humanoid, with everything spelled out.

Tasks are the robot's objectives, contacts support it, limits must hold always. The controller turns them into one
quadratic program (QP) at every tick. Try `--mode torque`, or another robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from _common import parse, report, upright

import wbc


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(
        __doc__, arguments, seconds=10.0, mode=("position", "torque"), robot=("hrp4_class", "talos", "g1")
    )
    description = wbc.load_robot(options.robot)
    torque = options.mode == "torque"
    plant = wbc.Plant(description, control_period=0.002 if torque else 0.005)

    robot = description.robot()  # the controller's model of the robot, standing with its soles on z = 0
    controller = wbc.Controller(robot, plant.control_period)
    com = controller.add(wbc.CoMTask())  # without a target, a task keeps the present value
    controller.add(
        wbc.PostureTask(), wbc.OrientationTask(robot.base_frame), wbc.OrientationTask(robot.torso_frame)
    )
    controller.add(wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))
    controller.add(wbc.JointLimits(), wbc.TorqueLimits())
    control = wbc.TorqueControl(controller) if torque else wbc.PositionControl(controller)

    with options.watch(plant) as view:
        while plant.time < options.seconds:
            plant.step(control.command(plant.measure()))
            view.update()

    error = np.linalg.norm(plant.truth().com - com.target)
    return report(upright=upright(plant), com_error_mm=1e3 * float(error))


if __name__ == "__main__":
    main()
