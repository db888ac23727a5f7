"""Wrench of the surroundings on the hands and elsewhere, by the residual of the momentum of the whole robot."""

from __future__ import annotations

import logging
from typing import Annotated

import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc.base.checked import fixed
from wbc.base.numbers import Array, read_only
from wbc.base.settings import NonNegative, Positive, Share, settings
from wbc.base.vectors import Vector, add_cross
from wbc.core.estimation.momentum import LIFT_OFF, TOUCH_DOWN, MomentumResidual
from wbc.core.frames import direction, net_wrench
from wbc.core.robot import GRAVITY, Robot

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
        settings: Its `OutsideSettings`.
        wrench: [force; moment about the CoM] on the robot, in the world, without the tare, shape (6,), N and Nm.
        tare: Wrench of empty hands, [force; moment] in the heading of the base, shape (6,), N and Nm; read-only.
    """

    settings: OutsideSettings = fixed("make another observer")

    def __init__(self, robot: Robot, settings: OutsideSettings | None = None) -> None:
        """Start with empty hands; `update` reads the state of the estimated robot."""
        self.settings = settings or OutsideSettings()
        self._robot = robot
        self._soles = [robot.placement(sole.frame) for sole in robot.soles]
        self._residual = MomentumResidual(6, self.settings.bandwidth)
        self.reset()

    def reset(self) -> None:
        """Forget everything, the tare too."""
        self.wrench, self._tare = np.zeros(6), np.zeros(6)
        self._begin_tare(empty=False)
        self._residual.reset()
        self._loaded = [True] * len(self._soles)
        self._time, self._waits = 0.0, 0.0

    def _begin_tare(self, *, empty: bool) -> None:
        """Average anew; hands that are known to be `empty` may seem to bear anything."""
        self._sum, self._averaged, self._empty = np.zeros(6), 0.0, empty

    @property
    def tare(self) -> Array:
        """See the attributes of the class."""
        return read_only(self._tare)

    @property
    def ready(self) -> bool:
        """True when the tare has been taken."""
        return self._averaged >= self.settings.tare

    def take_tare(self) -> None:
        """Take the tare anew from now on: the hands are empty, and `wrench` is zero until it is taken."""
        self.wrench = np.zeros(6)
        self._time = self.settings.settling
        self._begin_tare(empty=True)

    def explain(self, wrench: Vector) -> None:
        """Take a wrench off the estimate, [force; moment about the CoM] in the world, that the model accounts for now.

        The momentum that the model gains with its new masses is that of no force.
        """
        if self._residual.started:
            self._residual.follow(self._momentum_now())
        taken = np.array(wrench)
        self._residual.value -= taken
        if self.ready:
            self.wrench = self.wrench - taken
        else:
            self._sum -= self._averaged * _turned(taken, self._ahead.conjugate())

    def update(self, wrenches: Array, dt: float) -> None:
        """Take in measured wrenches on the soles, shape (soles, 6), after dt, s; `wrench` is then a new array.

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
            return
        known = np.array((force[0], force[1], force[2] - weight, *moment))
        self._residual.update(momentum, known, dt)
        if self.ready:
            self.wrench = self._residual.value - _turned(self._tare, self._ahead)
        elif self._time >= s.settling and force[2] > s.least_load * weight and all(self._loaded):
            self._average(_turned(self._residual.value, self._ahead.conjugate()), weight, dt)

    def _average(self, wrench: Array, weight: float, dt: float) -> None:
        """Average a wrench over dt, s; the mean is the tare when there is enough, but not of hands that bear."""
        self._sum += dt * wrench
        self._averaged += dt
        if not self.ready:
            return
        mean = self._sum / self._averaged
        borne = -float(mean[2])
        if not self._empty and abs(borne) > self.settings.largest * weight:
            what = "the hands bear" if borne > 0.0 else "the robot is held by"
            logger.warning("%s %.1f kg from the start: no tare is taken", what, abs(borne) / GRAVITY)
            mean = np.zeros(6)
        self._tare = mean

    @property
    def _ahead(self) -> complex:
        """Heading of the base."""
        return direction(self._robot.data.oMi[1].rotation)

    def _momentum_now(self) -> Array:
        """[linear; angular about the CoM] of the model as it is, in the world, kg m/s and kg m²/s."""
        return np.array(pin.computeCentroidalMomentum(self._robot.model, self._robot.data).vector)

    def _feet(self, wrenches: list[list[float]], com: Vector, weight: float) -> tuple[Vector, Vector, bool]:
        """Force of the feet, their moment about the CoM, and whether a foot has just met the ground."""
        touched = False
        for i, row in enumerate(wrenches):
            loaded = row[2] > (LIFT_OFF if self._loaded[i] else TOUCH_DOWN) * weight
            touched = touched or (loaded and not self._loaded[i])
            self._loaded[i] = loaded
        fx, fy, fz, *moment = net_wrench(wrenches, self._soles).tolist()
        x, y, z = com
        return (fx, fy, fz), add_cross(moment, (-x, -y, -z), (fx, fy, fz)), touched


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
