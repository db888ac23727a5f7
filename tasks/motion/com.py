"""Tasks on the centre of mass: in the world, and over the feet."""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError, finite_array
from wbc.core.qp.task import read_only
from wbc.core.robot import Robot
from wbc.tasks.motion.axes import POSITION_AXES, AxesTask
from wbc.tasks.motion.moving import Course
from wbc.tasks.options import MotionOptions

ERROR_BOUND = 0.3
"""Greatest component of the error that acts, m: a push moves the centre of mass further than a motion moves a hand."""


class CoMTask(AxesTask):
    """Bring the centre of mass to a point of the world.

    Error and residual are along the chosen world axes, in m and m/s²; the weight is a cost per (m/s²)². Weight 100 and
    stiffness 30 1/s² by default.
    """

    unit = "m"

    @checked
    def __init__(self, target: ArrayLike | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task.

        Args:
            target: Point in the world, shape (3,), m; the present one when None.
            **options: See `MotionOptions`.
        """
        super().__init__("com", POSITION_AXES, {"weight": 100.0, "stiffness": 30.0, **options})
        self._target: Array | None = None
        if target is not None:
            self.target = target

    def _default_bound(self) -> ArrayLike:
        return ERROR_BOUND

    @property
    def target(self) -> Array:
        """Point in the world, shape (3,), m, read-only; assign one, or see `move_to`."""
        return read_only(np.array(self.robot.com) if self._target is None else self._target)

    @target.setter
    def target(self, value: ArrayLike) -> None:
        target = finite_array(f"target of task '{self.name}' (m)", value, (3,))
        if self._held:
            self._take_over()
        self._target = target

    def follow(self, com: Array, velocity: Array, acceleration: Array) -> None:
        """Set target and feed-forwards for one tick, unchecked: for a controller that makes them itself.

        Args:
            com: Point in the world, shape (3,), m; kept, not copied.
            velocity: Its velocity along the task's axes, shape (dim,), m/s.
            acceleration: Its acceleration along them, shape (dim,), m/s².
        """
        self._target = com
        self._rows.velocity[:] = velocity
        self._rows.acceleration[:] = acceleration

    def _course(self) -> Course:
        return Course(
            self.target, lambda value: finite_array(f"target of task '{self.name}' (m)", value, (3,))
        )

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        self._target = target
        self._feed(velocity, acceleration)

    def bind(self, robot: Robot) -> None:
        """Take the present centre of mass as target when none was given.

        Raises:
            UnknownNameError: The robot has no such joint.
        """
        super().bind(robot)
        self._base_rotation = robot.data.oMi[1].rotation
        self._gravity, self._mass = np.array(robot.model.gravity.linear), robot.total_mass
        self._base_force = robot.bias[:3]
        if self._target is None:
            self._target = np.array(robot.com)

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `MotionTask.evaluate`.

        The drift needs no second pass over the kinematics: at zero generalised acceleration the forces on the base
        rows of the bias, turned into the world, are mass · (drift − gravity).
        """
        robot = self.robot
        assert self._target is not None
        difference = self._target - robot.com
        acceleration = self._base_rotation.dot(self._base_force)
        acceleration /= self._mass
        acceleration += self._gravity
        self._write((jacobian, error, drift), (robot.com_jacobian, difference, acceleration))


class CoMOverFeetTask(CoMTask):
    """Bring the centre of mass to a point over the middle of the soles: the target goes with the feet.

    The target is the way from the middle of the soles' frames to the centre of mass, along the axes of the world, m.
    """

    @checked
    def __init__(self, target: ArrayLike | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task.

        Args:
            target: Centre of mass minus the middle of the soles, shape (3,), m; the present one when None.
            **options: See `MotionOptions`.
        """
        given: MotionOptions = {"name": "com over feet", **options}
        super().__init__(target, **given)

    @property
    def target(self) -> Array:
        """Centre of mass minus the middle of the soles, shape (3,), m, read-only; assign one, or see `move_to`."""
        if self._target is None:
            return read_only(self.robot.com - self._middle(self.robot))
        return read_only(self._target)

    @target.setter
    def target(self, value: ArrayLike) -> None:
        target = finite_array(f"target of task '{self.name}' (m)", value, (3,))
        if self._held:
            self._take_over()
        self._target = target

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`.

        Raises:
            InputError: A robot without soles.
        """
        if not robot.soles:
            raise InputError(f"task '{self.name}' needs a robot with soles, '{robot.name}' has none")
        place = self._target
        super().bind(robot)
        self._soles = [robot.frame_id(sole.frame) for sole in robot.soles]
        self._target = robot.com - self._middle(robot) if place is None else place

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `MotionTask.evaluate`."""
        robot, data, world = self.robot, self.robot.data, pin.LOCAL_WORLD_ALIGNED
        assert self._target is not None
        acceleration = self._base_rotation.dot(self._base_force) / self._mass + self._gravity
        rows, share = np.array(robot.com_jacobian), 1.0 / len(self._soles)
        for sole in self._soles:
            rows -= share * pin.getFrameJacobian(robot.model, data, sole, world)[:3]
            acceleration -= share * pin.getFrameClassicalAcceleration(robot.model, data, sole, world).linear
        difference = self._target + self._middle(robot) - robot.com
        self._write((jacobian, error, drift), (rows, difference, acceleration))

    @staticmethod
    def _middle(robot: Robot) -> Array:
        """Middle of the soles in the world, shape (3,), m."""
        places = [robot.placement(sole.frame).translation for sole in robot.soles]
        return np.asarray(sum(places[1:], places[0].copy()) / len(places))
