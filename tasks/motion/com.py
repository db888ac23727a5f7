"""Tasks on the centre of mass, in the world and over the feet, and on the centroidal momentum."""

from __future__ import annotations

from typing import Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_array
from wbc.core.frames import frame_jacobian
from wbc.core.qp.move import Coordinates
from wbc.core.qp.options import POSE_AXES, POSITION_AXES, MotionOptions
from wbc.core.qp.task import SLOW, Task
from wbc.core.robot import BASE_DOF, Robot


class CoMTask(Task):
    """Task that brings the centre of mass to a point of the world.

    Error (m) and residual (m/s²) are along the chosen world axes. The weight is a cost per (m/s²)². By default the
    weight is 100 and the stiffness 30 1/s².
    """

    __slots__ = ()
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

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill Jacobian and error; see `Motion.measure`."""
        robot = self._robot
        assert robot is not None
        jacobian[:] = robot.com_jacobian
        np.subtract(self._target, robot.com, out=error)

    def drift(self) -> Array:
        """Return the acceleration of the CoM at zero generalised acceleration; see `Motion.drift`."""
        return self.robot.com_drift()


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
        np.subtract(self._target, self._momentum.vector, out=error)

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
