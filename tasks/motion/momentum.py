"""Task on the centroidal momentum: that of all masses, about the centre of mass."""

from __future__ import annotations

from typing import Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array
from wbc.core.qp.move import Coordinates
from wbc.core.qp.options import POSE_AXES, MotionOptions
from wbc.core.qp.task import SLOW, Task
from wbc.core.robot import BASE_DOF, Robot


class MomentumTask(Task):
    """Task that brings the centroidal momentum to a target: linear, kg m/s, and angular about the CoM, kg m²/s.

    The rows are the rate of the momentum along the chosen world axes, N and Nm. The weight is a cost per N² and (Nm)².
    A momentum is already a velocity, so `stiffness` is the rate of its convergence, 1/s,

        rate = feed-forward acceleration + stiffness · (target − momentum),

    and there is no damping. `feedforward_acceleration` is the rate of the target, N and Nm. The axes x, y, z are those
    of the linear momentum, and roll, pitch, yaw those of the angular momentum. By default the weight is 10⁻³, with
    which 100 N cost as much as 1 m/s² of a `CoMTask`, and the stiffness is 5 1/s.

    Source: Orin, Goswami, Lee, "Centroidal dynamics of a humanoid robot", Autonomous Robots 35, 2013.
    """

    __slots__ = ("_base", "_bolted", "_gravity", "_map", "_momentum")
    unit = "kg m/s|kg m²/s"
    of_velocity = True
    usual = {"weight": 1e-3, "stiffness": 5.0}

    def __init__(self, target: ArrayLike | None = None, **options: Unpack[MotionOptions]) -> None:
        """Describe the task; the target, [linear; angular] along the world axes, shape (6,), is zero when None."""
        super().__init__("momentum", POSE_AXES, **options)
        self.target = np.zeros(6) if target is None else target

    def _coordinates(self) -> Coordinates:
        raise InputError(f"task '{self.name}' has a momentum for its target, which is not moved: assign it")

    @property
    def damping(self) -> Array:
        """Damping, shape (dim,), which is zero: a momentum has no velocity that could be damped."""
        return super().damping

    @damping.setter
    def damping(self, value: ArrayLike | None) -> None:
        if value is not None and finite_array(f"damping of task '{self.name}' (1/s)", value).any():
            raise InputError(
                f"task '{self.name}' has no damping: its stiffness is a rate, 1/s; got {value!r}"
            )

    @property
    def residual_unit(self) -> str:
        """Unit of the residual, which is that of the rate of a momentum."""
        return "N|Nm"

    @property
    def reached(self) -> bool:
        """True if the momentum differs from its target by less than that of the robot at 0.05 m/s and 0.2 rad/s."""
        robot = self.robot
        inertia = robot.data.Ig.inertia.diagonal()
        bounds = np.concatenate([np.full(3, SLOW["m"] * robot.mass), SLOW["rad"] * inertia])
        error = self.evaluated()[1]
        return bool((abs(error) <= bounds[self._choice.keep]).all())

    def bind(self, robot: Robot) -> None:
        """Resolve names; see `Task.bind`."""
        super().bind(robot)
        self._map, self._momentum = robot.data.Ag.reshape(6, -1), robot.data.hg
        self._base = robot.data.oMi[1]
        self._bolted = None if robot.floating else (robot.model.createData(), np.zeros(robot.nv))
        self._gravity = np.array(robot.model.gravity.linear)

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill Jacobian and error; see `Motion.measure`."""
        jacobian[:] = self._map
        np.subtract(self._target.value, self._momentum.vector, out=error)

    def drift(self) -> Array:
        """Return the rate of the momentum at zero generalised acceleration, shape (6,); see `Motion.drift`.

        It needs no second pass over the dynamics: it is the wrench in the base rows of the bias minus the weight.
        """
        robot, base = self.robot, self._base
        if self._bolted is not None:  # a bolted base has no rows in the bias
            data, none = self._bolted
            rate = pin.computeCentroidalMomentumTimeVariation(robot.model, data, robot.q, robot.v, none)
            return np.asarray(rate.vector)
        drift = np.empty(6)
        force = base.rotation.dot(robot.bias[:3])
        np.add(force, robot.total_mass * self._gravity, out=drift[:3])
        np.dot(base.rotation, robot.bias[3:BASE_DOF], out=drift[3:])
        drift[3:] += pin.skew(base.translation - robot.com).dot(force)
        return drift
