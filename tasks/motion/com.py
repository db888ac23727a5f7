"""Tasks on the centre of mass: in the world, and over the feet."""

from __future__ import annotations

from typing import Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.frames import frame_jacobian
from wbc.core.qp.options import POSITION_AXES, MotionOptions
from wbc.core.qp.task import Task
from wbc.core.robot import Robot


class CoMTask(Task):
    """Task that brings the centre of mass to a point of the world.

    Error (m) and residual (m/s²) are along the chosen world axes. The weight is a cost per (m/s²)². By default the
    weight is 100 and the stiffness 30 1/s².
    """

    __slots__ = ("_base_force", "_base_rotation", "_bolted", "_gravity", "_mass")
    reads = "kinematics"
    # A push moves the centre of mass further than a motion moves a hand: hence the bound, m.
    usual = {"weight": 100.0, "stiffness": 30.0, "error_bound": 0.3}

    def __init__(self, target: ArrayLike | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task; the target has shape (3,), m, and is the present one when None."""
        super().__init__("com", POSITION_AXES, **options)
        if target is not None:
            self.target = target

    def present(self, robot: Robot) -> Array:
        """Return the centre of mass, shape (3,), m."""
        return np.array(robot.com)

    @checked
    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        super().bind(robot)
        self._bolted = None if robot.floating else (robot.model.createData(), np.zeros(robot.nv))
        self._base_rotation = robot.data.oMi[1].rotation
        self._gravity, self._mass = np.array(robot.model.gravity.linear), robot.total_mass
        self._base_force = robot.bias[:3]

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill Jacobian and error; see `Motion.measure`."""
        robot = self._robot
        assert robot is not None
        jacobian[:] = robot.com_jacobian
        np.subtract(self._target.value, robot.com, out=error)

    def drift(self) -> Array:
        """Return the acceleration of the CoM at zero generalised acceleration, shape (3,), m/s²; see `Motion.drift`.

        It needs no second pass over the kinematics: the forces on the base rows of the bias, turned into the world,
        are mass · (drift − gravity). A bolted base has no such rows.
        """
        if self._bolted is not None:
            data, none = self._bolted
            pin.centerOfMass(self.robot.model, data, self.robot.q, self.robot.v, none, False)
            return np.array(data.acom[0])
        acceleration: Array = self._base_rotation.dot(self._base_force)
        acceleration /= self._mass
        acceleration += self._gravity
        return acceleration


class CoMOverFeetTask(CoMTask):
    """Task that brings the centre of mass to a point over the middle of the soles; the target moves with the feet.

    The target is the vector from the middle of the soles' frames to the centre of mass, in world axes, m.
    """

    __slots__ = ("_places", "_soles")
    usual = {**CoMTask.usual, "name": "com over feet"}

    def present(self, robot: Robot) -> Array:
        """Return the vector from the middle of the soles to the centre of mass, shape (3,), m."""
        return np.asarray(robot.com - self._middle())

    @checked
    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        if not robot.soles:
            raise InputError(f"task '{self.name}' needs a robot with soles, '{robot.name}' has none")
        self._soles = [robot.frame_id(sole.frame) for sole in robot.soles]
        self._places = [robot.placement(sole) for sole in self._soles]
        super().bind(robot)

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill Jacobian and error; see `Motion.measure`."""
        super().measure(jacobian, error)
        model, data, share = self.robot.model, self.robot.data, 1.0 / len(self._soles)
        for sole in self._soles:
            jacobian -= share * frame_jacobian(model, data, sole, pin.LOCAL_WORLD_ALIGNED)[:3]
        error += self._middle()

    def drift(self) -> Array:
        """Return the acceleration of the CoM less that of the middle of the soles; see `Motion.drift`."""
        drift, share = super().drift(), 1.0 / len(self._soles)
        model, data, world = self.robot.model, self.robot.data, pin.LOCAL_WORLD_ALIGNED
        for sole in self._soles:
            drift -= share * pin.getFrameClassicalAcceleration(model, data, sole, world).linear
        return drift

    def _middle(self) -> Array:
        """Middle of the soles in the world, shape (3,), m."""
        middle = self._places[0].translation.copy()
        for place in self._places[1:]:
            middle += place.translation
        return np.asarray(middle / len(self._places))
