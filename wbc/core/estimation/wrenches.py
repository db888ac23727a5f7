"""Wrenches of feet without force sensors, by the residual of the momentum of the whole robot.

The generalised momentum p = M v changes by dp/dt = Sᵀ τ + Cᵀ v − g + Jᵀ w, where g are the forces of gravity and of
springs and viscous damping beside the drives. The residual of this momentum (`MomentumResidual`) with the known force
Sᵀ τ + Cᵀ v − g is the generalised force Jᵀ w of the contacts.

A leg's own joints see the wrench of its foot alone, in six equations or so; the floating base sees the sum of both.
Weighted least squares put them together: the joints are off by friction, the base by masses that the model lacks.

Source: momentum observers of floating bases, G. Bledt, P. Wensing, S. Ingersoll, S. Kim, ICRA 2018.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dposv

from wbc.base.checked import checked
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import NonNegative, Period
from wbc.core.estimation.momentum import LIFT_OFF, TOUCH_DOWN, MomentumResidual
from wbc.core.frames import frame_jacobian
from wbc.core.robot import BASE_DOF, GRAVITY, Robot
from wbc.core.signals import Command, Measurement, WrenchSource

BANDWIDTH = 80.0
"""Bandwidth of the momentum observer, rad/s."""

ON_TIME = 0.01
"""Share of a control period by which a measurement may come early or late and still count as one period apart."""

TORQUE_STD = 0.5
"""Standard deviation of a leg joint's torque, Nm: friction, errors of the drive; of a light robot, its share."""

FORCE_STD, MOMENT_STD = 0.03, 3.0
"""Standard deviation of the force by the momentum of the whole robot, over its weight, for masses that are off; and of
the moment, Nm, of which a light robot has its share."""

WRENCH_STD = 3.0
"""Expected size of a wrench over the weight (and over the weight times 0.1 m): bounds what a leg near a singularity
makes of errors."""


class WrenchEstimator:
    """Estimator of the wrench on each sole.

    The torques of the joints are those that drives report, or else those of the commands (`sent`).

    Attributes:
        source: Origin of the torques of the last measurement that was observed.
        contact: True for each foot that is on the ground, by its own leg's joints.
        wrench: Wrenches of the ground on the soles, [force; moment] in the sole frame at the sole centre, shape
            (number of soles, 6), N and Nm; zero for a foot in the air.
        outside: Generalised forces of whatever else holds a robot that is `held`, shape (nv,), N and Nm.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        dt: Period,
        *,
        gains: tuple[Array, Array] | None = None,
        delay: Annotated[NonNegative, "s"] = 0.0,
    ) -> None:
        """Start with the robot standing still on all soles, without any command; its state is not used.

        dt is the control period, s. Gains are kp and kd for commands that bring none, each of shape (na,), those of the
        robot's servos, or zero, when None. The delay is the sum of those of measurement and command, s.
        """
        self._model, self._data = robot.model, robot.model.createData()
        if gains is None and robot.servos is not None:
            gains = robot.servos.kp, robot.servos.kd
        none = np.zeros(robot.na)
        self._dt, self._own = dt, (none, none) if gains is None else gains
        self._limits = robot.torque_lower, robot.torque_upper
        whole = int(delay / dt + ROUNDING)
        self._part = max(delay / dt - whole, 0.0)  # of a period, in which an older command still acted
        self._commands: deque[Command] = deque(maxlen=whole + 2)
        self._robot, weight = robot, robot.mass * GRAVITY
        self._frames = [robot.frame_id(sole.frame) for sole in robot.soles]
        n, nv = len(self._frames), robot.nv
        legs = [robot.joints_between(sole.frame, robot.base_frame) for sole in robot.soles]
        ends = BASE_DOF + np.cumsum([0, *(len(leg) for leg in legs)])
        # Of the rows of the residual that are explained: the base, then each leg in its place.
        self._rows = np.array([*range(BASE_DOF), *(BASE_DOF + joint for leg in legs for joint in leg)])
        self._legs = [slice(start, stop) for start, stop in itertools.pairwise(ends.tolist())]
        self._soles = [slice(6 * i, 6 * i + 6) for i in range(n)]
        std = np.full(nv, TORQUE_STD * robot.force_scale)
        std[:3], std[3:BASE_DOF] = FORCE_STD * weight, MOMENT_STD * robot.force_scale
        self._scale = 1.0 / std[self._rows]
        expected = WRENCH_STD * weight * np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
        self._prior = np.diag(np.tile(1.0 / expected**2, n))
        self._jacobian = np.zeros((6 * n, nv))
        self._residual = MomentumResidual(nv, BANDWIDTH)
        self.wrench, self.outside = np.zeros((n, 6)), np.zeros(nv)
        self.reset()

    def reset(self) -> None:
        """Forget the past: the robot stands still on all soles."""
        self._residual.reset()
        self._commands.clear()
        self.source: WrenchSource = "commanded torques"
        self._time = math.nan  # of the last measurement with torques, s
        self.contact = [True] * len(self._frames)
        self.wrench[:], self.outside[:] = 0.0, 0.0
        self.wrench[:, 2] = self._robot.mass * GRAVITY / len(self._frames)

    def sent(self, command: Command) -> None:
        """Take over the command that is sent now."""
        self._commands.append(command.copy())

    def torque(self, measurement: Measurement) -> Array | None:
        """Return the torques that led to a measurement, shape (na,), Nm; None before there are any.

        Of commands it is the mean in the period before the measurement.
        """
        commands = self._commands
        if measurement.joint_torque is not None:
            return measurement.joint_torque
        if not commands:
            return None
        if len(commands) < (commands.maxlen or 0):
            return self._applied(commands[0], measurement)
        torque = (1.0 - self._part) * self._applied(commands[1], measurement)
        if self._part > 0.0:
            torque += self._part * self._applied(commands[0], measurement)
        return torque

    def _applied(self, command: Command, measurement: Measurement) -> Array:
        torque = command.drive_torque(measurement.joint_position, measurement.joint_velocity, self._own)
        return np.asarray(np.clip(torque, *self._limits))

    def fill(self, measurement: Measurement) -> Measurement:
        """Return a measurement with the wrenches as they are estimated at present."""
        return replace(measurement, sole_wrench=self.wrench.copy(), wrench_source=self.source)

    def observe(self, measurement: Measurement, q: Array, v: Array, lifts: Sequence[bool]) -> Measurement:
        """Update the estimate by a measurement and the state at its time, and return it with the wrenches.

        Arguments are as in `update`. Before any torques are known nothing changes.
        """
        torque = self.torque(measurement)
        self.source = "commanded torques" if measurement.joint_torque is None else "measured torques"
        if torque is not None:
            passed, self._time = measurement.time - self._time, measurement.time
            self.update(q, v, torque, passed, lifts=lifts)
        return self.fill(measurement)

    def update(
        self,
        q: Array,
        v: Array,
        torque: Array,
        passed: float,
        *,
        held: bool = False,
        lifts: Sequence[bool] = (),
    ) -> Array:
        """Take over a state, and the mean joint torques in the control period that led there, shape (na,), Nm.

        `passed` is the time since the last call, s, taken within a quarter and four control periods; one of them when
        NaN. Something else than the ground, such as a crane, may hold a robot that is `held`: the wrench of a foot is
        then what the joints of its leg tell, and the rest of the residual is `outside`. A foot that `lifts`, moving up
        or down, has no wrench: what loads its leg is not the ground. Returned is `wrench`, the same array each time.
        """
        whole = self._observe_momentum(q, v, torque, passed)
        for frame, place in zip(self._frames, self._soles, strict=True):
            self._jacobian[place] = frame_jacobian(self._model, self._data, frame, pin.LOCAL)
        residual = self._scale * whole.take(self._rows)
        matrix = self._jacobian.take(self._rows, axis=1)
        matrix *= self._scale
        alone = [
            self._solve(matrix[place, leg], residual[leg])
            for leg, place in zip(self._legs, self._soles, strict=True)
        ]
        self._touch([float(wrench[2]) for wrench in alone], lifts)
        soles = [i for i, on in enumerate(self.contact) if on]
        self.wrench[:] = 0.0
        if held:
            self.outside[:] = whole
            for i in soles:
                self.wrench[i] = alone[i]
                self.outside -= alone[i].dot(self._jacobian[self._soles[i]])
        elif soles:
            carrying = matrix.reshape(len(self._legs), 6, -1)[soles].reshape(6 * len(soles), -1)
            self.wrench[soles] = self._solve(carrying, residual).reshape(-1, 6)
        return self.wrench

    def _observe_momentum(self, q: Array, v: Array, torque: Array, passed: float) -> Array:
        """Return the residual of the generalised momentum, shape (nv,); arguments are as in `update`."""
        model, data, residual, dt = self._model, self._data, self._residual, self._dt
        mass = pin.crba(model, data, q, pin.Convention.WORLD)
        coriolis = pin.computeCoriolisMatrix(model, data, q, v)
        gravity = pin.computeGeneralizedGravity(model, data, q)
        momentum = mass.dot(v)
        known = coriolis.T.dot(v) - gravity
        known[BASE_DOF:] += torque
        if self._robot.springs is not None or self._robot.damping is not None:
            known[BASE_DOF:] -= self._robot.passive_torques(q, v)
        if not residual.started:
            residual.follow(momentum, -known)  # the residual of a robot at rest
            return residual.value
        if abs(passed - dt) > ON_TIME * dt:
            dt = min(max(passed, 0.25 * dt), 4.0 * dt)
        return residual.update(momentum, known, dt)

    def _touch(self, normal: Sequence[float], lifts: Sequence[bool]) -> None:
        """Find the feet on the ground by the normal forces that their legs tell, N."""
        weight = self._robot.mass * GRAVITY
        for i, force in enumerate(normal):
            loaded = force / weight > (LIFT_OFF if self.contact[i] else TOUCH_DOWN)
            self.contact[i] = loaded and not (lifts and lifts[i])

    def _solve(self, matrix: Array, residual: Array) -> Array:
        """Return the wrenches of some soles, shape (6 · soles,), that explain rows of the scaled residual best.

        The scaled Jacobian of the soles has the shape (6 · soles, rows).
        """
        normal = matrix.dot(matrix.T)
        normal += self._prior[: len(matrix), : len(matrix)]
        wrench: Array = dposv(normal.T, matrix.dot(residual), overwrite_a=True, overwrite_b=True)[1]
        return wrench
