"""A task of your own: keep looking at a point, whatever the body does.

A task gives three things for its rows: the velocity per joint velocity (Jacobian), target minus measured (error), and
the acceleration without joint acceleration (drift). Weight, stiffness and damping come with the base class.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from _common import parse, report, upright

import wbc
from wbc.tasks import MotionTask


class GazeTask(MotionTask):
    """Orientation of a frame whose x axis points at a place in the world.

    Its rows are y and z of that place in the frame, m: both are zero when it is straight ahead.
    """

    def __init__(
        self, frame: str, place: Sequence[float], weight: float = 1.0, stiffness: float = 100.0
    ) -> None:
        super().__init__("gaze", 2, weight=weight, stiffness=stiffness)
        self.frame, self.place = frame, np.array(place)

    def bind(self, robot: wbc.Robot) -> None:
        """Look the frame up."""
        super().bind(robot)
        self.frame_id = robot.frame_id(self.frame)

    def evaluate(self, jacobian: np.ndarray, error: np.ndarray, drift: np.ndarray) -> None:
        """Fill the rows: p = Rᵀ (place − origin) has the velocity −v − ω × p, all in the frame."""
        model, data, local = self.robot.model, self.robot.data, pin.LOCAL
        p = self.robot.placement(self.frame_id).actInv(self.place)
        velocity = pin.getFrameVelocity(model, data, self.frame_id, local)
        acceleration = pin.getFrameAcceleration(model, data, self.frame_id, local)
        rows, spin = pin.getFrameJacobian(model, data, self.frame_id, local), velocity.angular
        jacobian[:] = (pin.skew(p) @ rows[3:] - rows[:3])[1:]
        error[:] = -p[1:]
        p_velocity = -velocity.linear - np.cross(spin, p)
        drift[:] = (-acceleration.linear - np.cross(acceleration.angular, p) - np.cross(spin, p_velocity))[1:]


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example: the robot sways its hips and looks at a spot on the wall."""
    options = parse(__doc__, arguments, seconds=6.0)
    description = wbc.load_robot("hrp4_class")
    plant = wbc.Plant(description)
    robot = description.robot()
    controller = wbc.balance_controller(robot, plant.control_period)
    control = wbc.PositionControl(controller)

    com = controller.task("com")
    start = com.target
    gaze = controller.add(GazeTask("head", place=(1.5, 0.4, 1.0)))
    with options.watch(plant) as view:
        while plant.time < options.seconds:
            com.target = start + [0.0, 0.04 * np.sin(2.0 * plant.time), 0.0]
            plant.step(control.command(plant.measure()))
            view.update()

    truth, real = plant.truth(), description.robot()
    real.update(truth.q, truth.v)
    ahead = real.placement(gaze.frame).actInv(gaze.place)
    angle = np.degrees(np.arctan2(np.linalg.norm(ahead[1:]), ahead[0]))
    return report(upright=upright(plant), gaze_error_deg=float(angle))


if __name__ == "__main__":
    main()
