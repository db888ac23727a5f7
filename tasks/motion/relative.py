"""Task on the pose of a frame relative to another frame of the robot."""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
import pinocchio as pin

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError
from wbc.core.robot import Robot
from wbc.tasks.motion.axes import POSE_AXES
from wbc.tasks.motion.frame import FrameTask, pose
from wbc.tasks.motion.moving import Course, Placing
from wbc.tasks.options import MotionOptions


class RelativeFrameTask(FrameTask):
    """Bring a frame to a pose in another frame of the robot, such as one hand in the other.

    Rows are along the axes of the reference frame: position of `frame`'s origin, m, then rotation, rad; the weight is
    a cost per (m/s²)² and (rad/s²)². With axes x, y, z it is a task on the position alone, with roll, pitch, yaw on
    the orientation. Moving both frames together costs nothing. Weight 1 and stiffness 30 1/s² by default.
    """

    unit = "m|rad"

    @checked
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
        self._target: pin.SE3 | None = None
        self._difference, self._drift = np.zeros(6), np.zeros(6)
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
        target = pose(f"target of task '{self.name}'", value)
        if self._held:
            self._take_over()
        self._target = target

    def follow(self, target: pin.SE3, velocity: Array, acceleration: Array) -> None:
        """Set target and feed-forwards for one tick, unchecked: for a controller that makes them itself.

        Args:
            target: Pose of the frame in the reference frame; kept, not copied.
            velocity: [linear; angular] along the task's axes, shape (dim,), m/s and rad/s.
            acceleration: Its derivative, shape (dim,), m/s² and rad/s².
        """
        self._target = target
        self._rows.velocity[:] = velocity
        self._rows.acceleration[:] = acceleration

    def _course(self) -> Course:
        return Placing(self.target, lambda value: pose(f"target of task '{self.name}'", value))

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        self._target = target
        self._feed(velocity, acceleration)

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
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
