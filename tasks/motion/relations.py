"""Tasks on one number: the distance of two frames, a sum of joint positions, the manipulability of a limb."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked, result
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array, finite_scalar
from wbc.base.settings import Number
from wbc.core.frames import frame_jacobian
from wbc.core.qp.motion import OPTIONS
from wbc.core.qp.move import Coordinates
from wbc.core.qp.options import GainOptions, joint_columns
from wbc.core.qp.task import SelectionTask, Task
from wbc.core.robot import Robot

NEAREST = 1e-3
"""Least distance that the distance task divides by, m."""

_WORLD = pin.LOCAL_WORLD_ALIGNED


class _Number(Task):
    """Base of tasks whose target is a number, in an array of shape (1,)."""

    __slots__ = ()
    reads = "kinematics"
    usual = {"stiffness": 30.0}
    _least: ClassVar[float] = 0.0  # target

    def checked(self, value: ArrayLike) -> Array:
        """Return a target after a check, shape (1,): a number, or an array of one."""
        what = f"target of task '{self.name}' ({self.unit})"
        return np.array([finite_scalar(what, np.squeeze(value), low=self._least)])


class DistanceTask(_Number):
    """Task that brings the origins of two frames to a distance, m; the direction from one to the other is free."""

    __slots__ = ("_distance", "_ids", "_line", "frames")

    @checked
    def __init__(
        self,
        frame: str,
        other: str,
        target: Annotated[Number, "m"] | None = None,
        **options: Unpack[GainOptions],
    ) -> None:
        """Describe the task; the target, ≥ 0, is the present distance when None."""
        if frame == other:
            raise InputError(f"a distance needs two frames, got '{frame}' twice")
        self.frames = frame, other
        super().__init__(f"{frame} to {other}", 1, **options)
        if target is not None:
            self.target = target

    @checked
    def bind(self, robot: Robot) -> None:
        """Resolve the frames."""
        super().bind(robot)
        self._ids = [robot.frame_id(frame) for frame in self.frames]

    def present(self, robot: Robot) -> Array:
        """Return the distance, shape (1,), m."""
        one, other = (robot.placement(frame).translation for frame in self.frames)
        return np.array([np.linalg.norm(one - other)])

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill the row u·(J₁ − J₂) of the unit vector u between the frames, and the error; see `Motion.measure`."""
        model, data, (one, other) = self.robot.model, self.robot.data, self._ids
        line = data.oMf[one].translation - data.oMf[other].translation
        self._distance = max(float(np.linalg.norm(line)), NEAREST)
        self._line = line / self._distance
        rows = frame_jacobian(model, data, one, _WORLD) - frame_jacobian(model, data, other, _WORLD)
        jacobian[0] = self._line @ rows[:3]
        error[0] = self._target[0] - self._distance

    def drift(self) -> Array:
        """Return the acceleration of the distance d, shape (1,); see `Motion.drift`.

        A relative velocity w across the line adds w² / d to that along it.
        """
        model, data, unit = self.robot.model, self.robot.data, self._line
        speeds = [pin.getFrameVelocity(model, data, each, _WORLD).linear for each in self._ids]
        rates = [pin.getFrameClassicalAcceleration(model, data, each, _WORLD).linear for each in self._ids]
        across = speeds[0] - speeds[1]
        turning = (across @ across - (unit @ across) ** 2) / self._distance
        return np.array([unit @ (rates[0] - rates[1]) + turning])


class JointCouplingTask(_Number):
    """Task that keeps a weighted sum of joint positions at a target: `JointCouplingTask({"elbow": 1, "wrist": -0.5})`.

    The sum is Σ coefficient · position, rad. With `hard=True` the joints are coupled exactly.
    """

    __slots__ = ("_coefficients", "_columns", "_values")
    coefficients: Mapping[str, float] = result("_coefficients", OPTIONS)
    unit = "rad"
    _least = -math.inf

    @checked
    def __init__(
        self,
        coefficients: Mapping[str, Number],
        target: Annotated[Number, "rad"] | None = None,
        **options: Unpack[GainOptions],
    ) -> None:
        """Describe the task by joint → coefficient and the target of the sum, which is the present sum when None."""
        if not any(coefficients.values()):
            raise InputError(
                f"a coupling needs a joint with a coefficient that is not zero, got {coefficients}"
            )
        self._coefficients = dict(coefficients)
        self._values = np.array(list(self._coefficients.values()))
        super().__init__(f"coupling of {', '.join(coefficients)}", 1, **options)
        if target is not None:
            self.target = target

    @checked
    def bind(self, robot: Robot) -> None:
        """Resolve the joints."""
        self._columns = joint_columns(robot, self.coefficients)
        super().bind(robot)

    def present(self, robot: Robot) -> Array:
        """Return the sum, shape (1,), rad."""
        return np.array([self._values @ robot.q[self._columns + robot.nq - robot.nv]])

    def measure(self, jacobian: Array, error: Array) -> None:
        """Fill the row of coefficients, and the error; see `Motion.measure`."""
        jacobian[:] = 0.0
        jacobian[0, self._columns] = self._values
        error[:] = self._target - self.present(self.robot)

    def drift(self) -> Array:
        """Return zero: the coefficients are constant."""
        return np.zeros(1)


class ManipulabilityTask(_Number):
    """Task that brings the manipulability √det(J Jᵀ) of the end of a limb to a target, away from singular postures.

    J is the Jacobian of the position of a frame over the joints of its limb. With a target that the
    limb cannot reach, the manipulability becomes as large as the other tasks allow.

    Source: T. Yoshikawa, "Manipulability of robotic mechanisms", IJRR 4(2), 1985.
    """

    __slots__ = ("_columns", "_data", "_frame", "_id")
    frame: str = result("_frame", OPTIONS)
    unit = "m³"

    @checked
    def __init__(self, frame: str, target: Number | None = None, **options: Unpack[GainOptions]) -> None:
        """Describe the task of a frame at the end of a limb; the target, m³, ≥ 0, is the present one when None."""
        self._frame = frame
        super().__init__(f"{frame} manipulability", 1, **options)
        if target is not None:
            self.target = target

    @checked
    def bind(self, robot: Robot) -> None:
        """Find the joints of the limb, which begins at the base."""
        self._id, self._data = robot.frame_id(self.frame), robot.model.createData()
        joints = robot.joints_between(self.frame, robot.base_frame)
        self._columns = robot.nv - robot.na + np.array(joints, dtype=np.intp)
        if len(joints) < 3:
            raise InputError(f"'{self.frame}' has {len(joints)} joints; 3 are required for '{self.name}'")
        super().bind(robot)

    def present(self, robot: Robot) -> Array:
        """Return the manipulability, shape (1,)."""
        rows = frame_jacobian(robot.model, robot.data, self._id, _WORLD)[:3, self._columns]
        return np.array([np.sqrt(max(np.linalg.det(rows @ rows.T), 0.0))])

    @property
    def reached(self) -> bool:
        """True while no move goes on and the manipulability is within a hundredth of its target."""
        near = abs(self.present(self.robot) - self._target)[0] <= 0.01 * self._target[0]
        return not self.moving and bool(near)

    def _gradient(self, jacobian: Array) -> tuple[float, Array]:
        """Return the manipulability w and its derivative w · tr(J⁺ ∂J/∂q), of rows of a frame, shape (6, n).

        Column j of J changes with joint i before it by ω_i × that column, and with one after it, in its linear part, by
        ω_j × column i.
        """
        rows = jacobian[:3]
        square = rows @ rows.T
        size = np.sqrt(max(np.linalg.det(square), 0.0))
        if size < ROUNDING:
            return size, np.zeros(rows.shape[1])
        inverse = np.linalg.solve(square, rows).T  # shape (n, 3)
        linear, spin = rows.T, jacobian[3:].T
        gradient = np.empty(rows.shape[1])
        for i in range(rows.shape[1]):
            change = np.concatenate((np.cross(spin[:i], linear[i]), np.cross(spin[i], linear[i:])))
            gradient[i] = size * float((inverse * change).sum())
        return float(size), gradient

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the gradient; its change with the velocity is a finite difference. See `Task.evaluate`."""
        robot, model = self.robot, self.robot.model
        columns, v = self._columns, robot.v
        size, gradient = self._gradient(frame_jacobian(model, robot.data, self._id, _WORLD)[:, columns])
        jacobian[:] = 0.0
        jacobian[0, columns] = gradient
        error[0], drift[0] = self._target[0] - size, 0.0
        speed = float(np.abs(v[columns]).max())
        if speed > ROUNDING:
            step = 1e-5 / speed
            ends = []
            for sign in (step, -step):
                q = pin.integrate(model, robot.q, sign * v)
                rows = pin.computeFrameJacobian(model, self._data, q, self._id, _WORLD).reshape(6, -1)
                ends.append(self._gradient(rows[:, columns])[1] @ v[columns])
            drift[0] = (ends[0] - ends[1]) / (2.0 * step)


class LowAccelerationTask(SelectionTask):
    """Task that keeps velocities: zero acceleration or, in inverse kinematics, the velocities of the last step."""

    __slots__ = ("columns",)
    unit = "rad/s"
    reads = "kinematics"
    of_velocity = True
    usual = {"weight": 1e-3}

    def __init__(self, **options: Unpack[GainOptions]) -> None:
        """Describe the task, which has no target."""
        super().__init__("low acceleration", 1, **options)

    @checked
    def bind(self, robot: Robot) -> None:
        """Take all coordinates."""
        self._resize(robot.nv)
        self.columns = slice(0, robot.nv)
        super().bind(robot)

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill an error of zero; see `Task.evaluate`."""
        error[:] = 0.0

    def _coordinates(self) -> Coordinates:
        raise InputError(f"task '{self.name}' has no target that could move")

    @property
    def reached(self) -> bool:
        """True, since the task has no target."""
        return True
