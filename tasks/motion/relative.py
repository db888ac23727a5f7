"""Task on the pose of a frame relative to another frame of the robot."""

from __future__ import annotations

from typing import Unpack

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, InputError
from wbc.core.robot import Robot
from wbc.tasks.motion.axes import POSE_AXES
from wbc.tasks.motion.frame import PoseTargetTask
from wbc.tasks.options import MotionOptions


class RelativeFrameTask(PoseTargetTask):
    """Bring a frame to a pose in another frame of the robot, such as one hand in the other.

    Rows are along the axes of the reference frame: position of `frame`'s origin, m, then rotation, rad; the weight is
    a cost per (m/s²)² and (rad/s²)². With axes x, y, z it is a task on the position alone, with roll, pitch, yaw on
    the orientation. Moving both frames together costs nothing. Weight 1 and stiffness 30 1/s² by default.
    """

    def __init__(
        self, frame: str, reference: str, target: pin.SE3 | None = None, **options: Unpack[MotionOptions]
    ) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot.
            reference: Frame of the robot that the pose is relative to.
            target: Pose of `frame` in `reference`; the present one when None.
            **options: See `MotionOptions`.
        """
        if frame == reference:
            raise InputError(f"a relative task needs two frames, got '{frame}' twice")
        self.reference = reference
        super().__init__(frame, f"{frame} in {reference}", POSE_AXES, options)
        self._difference, self._drift = np.zeros(6), np.zeros(6)
        if target is not None:
            self.target = target

    def _present(self, robot: Robot) -> pin.SE3:
        return robot.placement(self.reference).actInv(robot.placement(self.frame))

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        super().bind(robot)
        self._reference_id = robot.frame_id(self.reference)
        self._reference_placement = robot.data.oMf[self._reference_id]
        # [I, [d]×; 0, I] takes the reference's velocity to where the frame is; rotated, into the reference's axes.
        self._full = np.zeros((6, robot.nv))

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `MotionTask.evaluate`.

        With d from the reference to the frame, ω the reference's angular velocity and R its rotation,

            Rᵀ(v_f − v_r − ω × d)                                       velocity
            Rᵀ(a_f − a_r − α × d − ω × (ω × d) − 2 ω × (v_f − v_r − ω × d)),  Rᵀ(α_f − α_r − ω × ω_f)   acceleration.
        """
        model, data, world = self._model, self._data, self._world
        own, other = self._id, self._reference_id
        rotation = self._reference_placement.rotation
        back = rotation.T
        offset = self._translation - self._reference_placement.translation

        mine = pin.getFrameJacobian(model, data, own, world)
        theirs = pin.getFrameJacobian(model, data, other, world)
        mine -= theirs
        mine[:3] += np.dot(pin.skew(offset), theirs[3:])
        full = self._full
        np.dot(back, mine[:3], out=full[:3])
        np.dot(back, mine[3:], out=full[3:])

        velocity = pin.getFrameVelocity(model, data, other, world)
        moving = pin.getFrameVelocity(model, data, own, world)
        turn = pin.skew(velocity.angular)
        carried = np.dot(turn, offset)
        slip = moving.linear - velocity.linear - carried
        acceleration = pin.getFrameClassicalAcceleration(model, data, own, world)
        base = pin.getFrameClassicalAcceleration(model, data, other, world)
        linear = acceleration.linear - base.linear + np.dot(pin.skew(offset), base.angular)
        linear -= np.dot(turn, carried + 2.0 * slip)
        angular = acceleration.angular - base.angular - np.dot(turn, moving.angular)
        np.dot(back, linear, out=self._drift[:3])
        np.dot(back, angular, out=self._drift[3:])

        target = self._target
        assert target is not None
        np.subtract(target.translation, np.dot(back, offset), out=self._difference[:3])
        self._difference[3:] = pin.log3(np.dot(target.rotation, np.dot(self._rotation.T, rotation)))
        self._write((jacobian, error, drift), (full, self._difference, self._drift))
