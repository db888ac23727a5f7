"""Tasks on the centre of mass: in the world, and over the feet."""

from __future__ import annotations

from typing import Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.core.errors import Array, InputError
from wbc.core.robot import Robot
from wbc.tasks.motion.axes import POSITION_AXES
from wbc.tasks.motion.target import TargetTask
from wbc.tasks.options import MotionOptions

ERROR_BOUND = 0.3
"""Greatest component of the error that acts, m: a push moves the centre of mass further than a motion moves a hand."""


class CoMTask(TargetTask[Array]):
    """Bring the centre of mass to a point of the world.

    Error and residual are along the chosen world axes, in m and m/s²; the weight is a cost per (m/s²)². Weight 100 and
    stiffness 30 1/s² by default.
    """

    unit = "m"

    def __init__(self, target: ArrayLike | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task.

        Args:
            target: Point in the world, shape (3,), m; the present one when None.
            **options: See `MotionOptions`.
        """
        super().__init__("com", POSITION_AXES, {"weight": 100.0, "stiffness": 30.0, **options})
        if target is not None:
            self.target = target

    def _default_bound(self) -> ArrayLike:
        return ERROR_BOUND

    def _present(self, robot: Robot) -> Array:
        return np.array(robot.com)

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        super().bind(robot)
        self._base_rotation = robot.data.oMi[1].rotation
        self._gravity, self._mass = np.array(robot.model.gravity.linear), robot.total_mass
        self._base_force = robot.bias[:3]

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

    The target is the vector from the middle of the soles' frames to the centre of mass, in world axes, m.
    """

    def __init__(self, target: ArrayLike | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task.

        Args:
            target: Centre of mass minus the middle of the soles, shape (3,), m; the present one when None.
            **options: See `MotionOptions`.
        """
        given: MotionOptions = {"name": "com over feet", **options}
        super().__init__(target, **given)

    def _present(self, robot: Robot) -> Array:
        return np.asarray(robot.com - self._middle(robot))

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`.

        Raises:
            InputError: A robot without soles.
        """
        if not robot.soles:
            raise InputError(f"task '{self.name}' needs a robot with soles, '{robot.name}' has none")
        super().bind(robot)
        self._soles = [robot.frame_id(sole.frame) for sole in robot.soles]

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
