"""Wrenches by the residual of a momentum: of feet without force sensors, and of the surroundings (`OutsideWrench`).

The generalised momentum p = M v changes by dp/dt = Sᵀ τ + Cᵀ v − g + Jᵀ w, where g are the forces of gravity and of
springs and viscous damping beside the drives. The residual of this momentum (`MomentumResidual`) with the known force
Sᵀ τ + Cᵀ v − g is the generalised force Jᵀ w of the contacts.

A leg's own joints see the wrench of its foot alone, in six equations or so; the floating base sees the sum of both.
Weighted least squares put them together: the joints are off by friction, the base by masses that the model lacks.

Source: momentum observers of floating bases, G. Bledt, P. Wensing, S. Ingersoll, S. Kim, ICRA 2018.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Sequence
from typing import Annotated

import numpy as np
import pinocchio as pin
from pydantic import Field
from scipy.linalg.lapack import dposv

from wbc.base.errors import InputError
from wbc.base.numbers import Array, lag_gain
from wbc.base.settings import NonNegative, Positive, Share, settings
from wbc.base.vectors import Vector, add_cross
from wbc.core.frames import direction, frame_jacobian, net_wrench
from wbc.core.robot import BASE_DOF, GRAVITY, Robot


class MomentumResidual:
    """Observer of the unknown force on a momentum of some size.

    A momentum h changes by ḣ = f + w, with a known force f and an unknown one w. A first-order observer has w without
    a measured acceleration, ṙ = K (ḣ − f − r), since only the change of h from tick to tick is needed.

    Source: A. De Luca, A. Albu-Schäffer, S. Haddadin, G. Hirzinger, IROS 2006.

    Attributes:
        value: The residual r, which estimates the unknown force, shape (size,), N and Nm; the same array always.
        started: True once there is a momentum to compare the next one with.
    """

    def __init__(self, size: int, bandwidth: float) -> None:
        """Start at zero, with the gain K, 1/s."""
        self.value = np.zeros(size)
        self._time_constant = 1.0 / bandwidth
        self._momentum: Array = np.zeros(size)
        self.started = False

    def reset(self) -> None:
        """Forget the momentum, and return to zero."""
        self.value[:], self.started = 0.0, False

    def follow(self, momentum: Array) -> None:
        """Take over a momentum, shape (size,), without learning from its change."""
        self._momentum, self.started = momentum, True

    def update(self, momentum: Array, known: Array, dt: float) -> Array:
        """Return the residual for one more momentum, dt, s, after that which it follows, under a known force."""
        unknown = (momentum - self._momentum) / dt
        unknown -= known
        self._momentum = momentum
        unknown -= self.value
        unknown *= lag_gain(dt, self._time_constant)
        self.value += unknown
        return self.value


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


@settings
class WrenchSettings:
    """Settings of the estimate of contact wrenches.

    Attributes:
        bandwidth: Bandwidth of the momentum observer, rad/s.
        touch_down: Normal force from which a foot in the air has met the ground, as a share of the weight.
        lift_off: Normal force below which a foot on the ground has left it, as a share of the weight.
    """

    bandwidth: Annotated[Positive, "rad/s"] = 80.0
    touch_down: Share = 0.08
    lift_off: Share = 0.04


class WrenchEstimator:
    """Estimator of the wrench on each sole.

    Attributes:
        settings: Settings.
        contact: True for each foot that is on the ground, by its own leg's joints.
        wrench: Wrenches of the ground on the soles, [force; moment] in the sole frame at the sole centre, shape
            (number of soles, 6), N and Nm; zero for a foot in the air.
        outside: Generalised forces of whatever else holds a robot that is `held`, shape (nv,), N and Nm.
    """

    def __init__(self, robot: Robot, dt: float, settings: WrenchSettings | None = None) -> None:
        """Start with the robot standing still on all soles; its state is not used, dt is the control period, s."""
        self.settings = s = settings or WrenchSettings()
        if s.lift_off > s.touch_down:
            raise InputError(f"lift_off must not exceed touch_down, got {s.lift_off:g} and {s.touch_down:g}")
        self._model, self._data = robot.model, robot.model.createData()
        self._dt = dt
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
        self._residual = MomentumResidual(nv, s.bandwidth)
        self.wrench, self.outside = np.zeros((n, 6)), np.zeros(nv)
        self.reset()

    def reset(self) -> None:
        """Forget the past: the robot stands still on all soles."""
        self._residual.reset()
        self.contact = [True] * len(self._frames)
        self.wrench[:], self.outside[:] = 0.0, 0.0
        self.wrench[:, 2] = self._robot.mass * GRAVITY / len(self._frames)

    def update(
        self,
        q: Array,
        v: Array,
        torque: Array,
        passed: float | None = None,
        *,
        held: bool = False,
        lifts: Sequence[bool] = (),
    ) -> Array:
        """Take over a state, and the mean joint torques in the control period that led there, shape (na,), Nm.

        `passed` is the time since the last call, s, taken within a quarter and four control periods; one of them when
        None. Something else than the ground, such as a crane, may hold a robot that is `held`: the wrench of a foot is
        then what the joints of its leg tell, and the rest of the residual is `outside`. A foot that `lifts`, moving up
        or down, has no wrench: what loads its leg is not the ground. Returned is `wrench`, the same array each time.
        """
        model, data, s = self._model, self._data, self.settings
        mass = pin.crba(model, data, q, pin.Convention.WORLD)
        coriolis = pin.computeCoriolisMatrix(model, data, q, v)
        gravity = pin.computeGeneralizedGravity(model, data, q)
        momentum = mass.dot(v)
        known = coriolis.T.dot(v) - gravity
        known[BASE_DOF:] += torque
        if self._robot.springs is not None or self._robot.damping is not None:
            known[BASE_DOF:] -= self._robot.passive_torques(q, v)
        if self._residual.started:
            dt = self._dt
            if passed is not None and abs(passed - dt) > ON_TIME * dt:
                dt = min(max(passed, 0.25 * dt), 4.0 * dt)
            self._residual.update(momentum, known, dt)
        else:
            self._residual.follow(momentum)
            np.negative(known, out=self._residual.value)  # that of a robot at rest
        for frame, place in zip(self._frames, self._soles, strict=True):
            self._jacobian[place] = frame_jacobian(model, data, frame, pin.LOCAL)
        residual = self._scale * self._residual.value.take(self._rows)
        matrix = self._jacobian.take(self._rows, axis=1)
        matrix *= self._scale
        soles, alone, weight = [], [], self._robot.mass * GRAVITY
        for i, (leg, place) in enumerate(zip(self._legs, self._soles, strict=True)):
            alone.append(self._solve(matrix[place, leg], residual[leg]))
            normal = alone[i][2] / weight
            loaded = normal > (s.lift_off if self.contact[i] else s.touch_down)
            self.contact[i] = loaded and not (lifts and lifts[i])
            if self.contact[i]:
                soles.append(i)
        self.wrench[:] = 0.0
        if held:
            self.outside[:] = self._residual.value
            for i in soles:
                self.wrench[i] = alone[i]
                self.outside -= alone[i].dot(self._jacobian[self._soles[i]])
        elif soles:
            carrying = matrix.reshape(len(self._legs), 6, -1)[soles].reshape(6 * len(soles), -1)
            self.wrench[soles] = self._solve(carrying, residual).reshape(-1, 6)
        return self.wrench

    def _solve(self, matrix: Array, residual: Array) -> Array:
        """Return the wrenches of some soles, shape (6 · soles,), that explain rows of the scaled residual best.

        The scaled Jacobian of the soles has the shape (6 · soles, rows).
        """
        normal = matrix.dot(matrix.T)
        normal += self._prior[: len(matrix), : len(matrix)]
        wrench: Array = dposv(normal.T, matrix.dot(residual), overwrite_a=True, overwrite_b=True)[1]
        return wrench


logger = logging.getLogger(__name__)


@settings
class OutsideSettings:
    """Settings of the observer of the outside wrench.

    Attributes:
        bandwidth: Gain K of the observer, 1/s.
        settling: Time from the start until the tare begins, s.
        tare: Time over which the wrench of empty hands is averaged and then taken off, s; 0 for none.
        wait: Time for which the estimate waits after a foot has met the ground, s.
        largest: Greatest vertical force of a tare, over the weight. A greater one is something that the hands bear
            from the start, and no tare is taken.
        least_load: Share of the weight on the feet below which something else carries or the robot flies: the tare
            waits.
    """

    bandwidth: Annotated[Positive, Field(le=200.0), "1/s"] = 20.0
    settling: Annotated[NonNegative, "s"] = 0.5
    tare: Annotated[NonNegative, "s"] = 1.0
    wait: Annotated[NonNegative, "s"] = 0.04
    largest: Share = 0.03
    least_load: Share = 0.8


class OutsideWrench:
    """Observer of the outside wrench of one robot: what the surroundings do to it besides the ground under its feet.

    The momentum h = (m ċ; L) of the whole robot about its centre of mass c changes by
    ḣ = (m g; 0) + W_feet(c) + W_outside(c). So a `MomentumResidual` with the known force (m g; 0) + W_feet(c) is the
    sum of all other contacts, hands above all, from what a position-controlled robot measures: force sensors of the
    feet, encoders and IMU.

    Only the sum can be had: two hands that squeeze a box do nothing to it. Errors of model and sensors look like a
    constant wrench, so the residual is tared on empty hands. A robot whose hands bear more than such errors from the
    start is not tared. While a foot meets the ground, its wrench is right and the place where it acts is not: the
    observer waits.

    Source: A. De Luca, R. Mattone, ICRA 2005 (residual of the generalised momentum; this is its part for the base);
    S. Haddadin, A. De Luca, A. Albu-Schäffer, IEEE T-RO 33(6), 2017.

    Attributes:
        settings: Settings.
        wrench: [force; moment about the CoM] on the robot, in the world, without the tare, shape (6,), N and Nm.
        tare: Wrench of empty hands, [force; moment] in the heading of the base, shape (6,), N and Nm.
    """

    def __init__(self, robot: Robot, settings: OutsideSettings | None = None) -> None:
        """Start with empty hands; `update` reads the state of the estimated robot."""
        self.settings = settings or OutsideSettings()
        self._robot = robot
        self._soles = [robot.placement(sole.frame) for sole in robot.soles]
        self._residual = MomentumResidual(6, self.settings.bandwidth)
        self.reset()

    def reset(self) -> None:
        """Forget everything, the tare too."""
        self.wrench = np.zeros(6)
        self.tare = np.zeros(6)
        self._residual.reset()
        self._loaded = [True] * len(self._soles)
        self._time, self._waits, self._tared = 0.0, 0.0, 0.0
        self._sum = np.zeros(6)
        self._told = False  # that the hands are empty

    @property
    def ready(self) -> bool:
        """True when the tare has been taken."""
        return self._tared >= self.settings.tare

    def take_tare(self) -> None:
        """Take the tare anew from now on: the hands are empty, whatever they seem to bear."""
        self._sum, self._tared, self._time = np.zeros(6), 0.0, self.settings.settling
        self._told = True

    def explain(self, wrench: Vector) -> None:
        """Take a wrench off the estimate, [force; moment about the CoM] in the world, that the model accounts for now.

        The momentum that the model gains with its new masses is that of no force.
        """
        if self._residual.started:
            self._residual.follow(self._momentum_now())
        self._residual.value -= wrench
        self.wrench = self.wrench - wrench

    def update(self, wrenches: Array, dt: float) -> Array:
        """Take in measured wrenches on the soles, shape (soles, 6), after dt, s; return `wrench`, a new array.

        The robot's kinematics are up to date.
        """
        s, robot = self.settings, self._robot
        self._time += dt
        momentum = self._momentum_now()
        com = robot.com.tolist()
        weight = float(robot.total_mass) * GRAVITY
        force, moment, touched = self._feet(wrenches.tolist(), com, weight)
        self._waits = s.wait if touched else self._waits - dt
        if not self._residual.started or dt <= 0.0 or self._waits > 0.0:
            self._residual.follow(momentum)
            return self.wrench
        known = np.array((force[0], force[1], force[2] - weight, *moment))
        self._residual.update(momentum, known, dt)
        ahead = direction(robot.data.oMi[1].rotation)
        if self._tared < s.tare:
            if self._time >= s.settling and force[2] > s.least_load * weight and all(self._loaded):
                self._learn(ahead.conjugate(), weight, dt)
            return self.wrench
        self.wrench = self._residual.value - _turned(self.tare, ahead)
        return self.wrench

    def _momentum_now(self) -> Array:
        """[linear; angular about the CoM] of the model as it is, in the world, kg m/s and kg m²/s."""
        return np.array(pin.computeCentroidalMomentum(self._robot.model, self._robot.data).vector)

    def _feet(self, wrenches: list[list[float]], com: Vector, weight: float) -> tuple[Vector, Vector, bool]:
        """Force of the feet, their moment about the CoM, and whether a foot has just met the ground."""
        touched = False
        for i, row in enumerate(wrenches):
            loaded = row[2] > (0.04 if self._loaded[i] else 0.08) * weight
            touched = touched or (loaded and not self._loaded[i])
            self._loaded[i] = loaded
        fx, fy, fz, *moment = net_wrench(wrenches, self._soles).tolist()
        x, y, z = com
        return (fx, fy, fz), add_cross(moment, (-x, -y, -z), (fx, fy, fz)), touched

    def _learn(self, back: complex, weight: float, dt: float) -> None:
        """Average the residual in the heading of the base, to which `back` turns."""
        self._sum += dt * _turned(self._residual.value, back)
        self._tared += dt
        if self._tared < self.settings.tare:
            return
        tare = self._sum / self._tared
        borne = -float(tare[2])
        if self._told or abs(borne) <= self.settings.largest * weight:
            self.tare = tare
            return
        self.tare = np.zeros(6)
        what = "the hands bear" if borne > 0.0 else "the robot is held by"
        logger.warning("%s %.1f kg from the start: no tare is taken", what, abs(borne) / GRAVITY)


def _turned(wrench: Array, turn: complex) -> Array:
    """Return a wrench turned about the vertical, shape (6,)."""
    fx, fy, fz, mx, my, mz = wrench.tolist()
    force, moment = complex(fx, fy) * turn, complex(mx, my) * turn
    return np.array((force.real, force.imag, fz, moment.real, moment.imag, mz))


def moment_about(wrench: Array, com: Vector, point: Vector) -> tuple[float, float, float]:
    """Return the moment, Nm, of a wrench [force; moment about the CoM] in the world about another point, m."""
    fx, fy, fz, *moment = wrench.tolist()
    x, y, z = ((a - b) for a, b in zip(com, point, strict=True))
    return add_cross(moment, (x, y, z), (fx, fy, fz))
