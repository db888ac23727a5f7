"""A frame seen from another frame of the robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.core.errors import Array, InputError
from wbc.core.robot import Robot
from wbc.tasks.motion.axes import POSE_AXES
from wbc.tasks.motion.frame import FrameTask, pose


class RelativeFrameTask(FrameTask):
    """Bring a frame to a pose in another frame of the robot, such as one hand in the other.

    Rows are along the axes of the reference frame: position of `frame`'s origin, m, then rotation, rad; the weight is
    a cost per (m/s²)² and (rad/s²)². With axes x, y, z it is a task on the position alone, with roll, pitch, yaw on
    the orientation. Moving both frames together costs nothing.
    """

    unit = "m|rad"

    def __init__(
        self,
        frame: str,
        reference: str,
        target: pin.SE3 | None = None,
        *,
        axes: Sequence[str] = POSE_AXES,
        joints: Sequence[str] | None = None,
        name: str | None = None,
        weight: ArrayLike = 1.0,
        stiffness: ArrayLike = 30.0,
        damping: ArrayLike | None = None,
        hard: bool = False,
    ) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot.
            reference: Frame of the robot from which it is seen.
            target: Pose of `frame` in `reference`; the present one when None.
            axes: Axes of the reference frame that matter, out of x, y, z, roll, pitch, yaw.
            joints: Joints that may be used; all of them when None.
            name: Name of the task; made from the frames when None.
            weight: Cost per (m/s²)² and (rad/s²)².
            stiffness: 1/s².
            damping: 1/s; critical when None.
            hard: Make it a constraint.

        Raises:
            InputError: Twice the same frame, an unknown axis, or a target that is not a pose.
        """
        if frame == reference:
            raise InputError(f"a relative task needs two frames, got '{frame}' twice")
        self.reference = reference
        name = name or f"{frame} in {reference}"
        super().__init__(frame, POSE_AXES, axes, joints, name, weight, stiffness, damping, hard)
        self._target: pin.SE3 | None = None
        self._error, self._drift = np.zeros(6), np.zeros(6)
        if target is not None:
            self.target = target

    @property
    def target(self) -> pin.SE3:
        """Pose of the frame in the reference frame."""
        if self._target is None:
            return self.robot.placement(self.reference).actInv(self.robot.placement(self.frame))
        return self._target.copy()

    @target.setter
    def target(self, value: pin.SE3) -> None:
        self._target = pose(f"target of task '{self.name}'", value)

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`.

        Raises:
            UnknownNameError: The robot has no such frame or joint.
        """
        super().bind(robot)
        self._reference_id = robot.frame_id(self.reference)
        self._reference_placement = robot.data.oMf[self._reference_id]
        self._target = self.target
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

        mine, theirs = (
            pin.getFrameJacobian(model, data, own, world),
            pin.getFrameJacobian(model, data, other, world),
        )
        mine -= theirs
        mine[:3] += np.dot(pin.skew(offset), theirs[3:])
        full = self._full
        np.dot(back, mine[:3], out=full[:3])
        np.dot(back, mine[3:], out=full[3:])
        self._write_jacobian(jacobian, full)

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
        np.subtract(target.translation, np.dot(back, offset), out=self._error[:3])
        self._error[3:] = pin.log3(np.dot(target.rotation, np.dot(self._rotation.T, rotation)))
        keep = self._keep
        error[:] = self._error if keep is None else self._error[keep]
        drift[:] = self._drift if keep is None else self._drift[keep]
