"""DCM stabilizer: measured pendulum and foot wrenches in, desired wrenches and corrections out.

    errors → desired acceleration → net wrench → foot wrenches → corrections of the feet

The stabilizer knows neither tasks nor a simulator. In the air the corrections of the feet stay, and feedback starts
with an empty memory at landing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.numbers import Array, lag_gain
from wbc.base.vectors import Vector
from wbc.core.frames import net_wrench
from wbc.core.robot import GRAVITY, force_scale
from wbc.tasks.stabilizer.admittance import FootAdmittance, FootCorrection
from wbc.tasks.stabilizer.distribution import FootWrenches, WrenchDistribution, left_foot_ratio
from wbc.tasks.stabilizer.feedback import DcmFeedback, PendulumErrors, wrench_through
from wbc.tasks.stabilizer.gains import StabilizerGains
from wbc.tasks.stabilizer.pendulum import MIN_FORCE, Pendulum, level_zmp, zmp_offset


class StabilizerOutput(NamedTuple):
    """Result of one tick, in the world unless said otherwise.

    Attributes:
        measured_zmp: Unfiltered, on the level of the target ZMP, shape (3,), m; NaN in the air. With hands
            that press, the point about which the pendulum turns.
    """

    errors: PendulumErrors  # target minus measured
    com_acceleration: Array  # desired acceleration of the CoM, shape (3,), m/s²
    net_wrench: Array  # desired [force; moment] at the world origin, shape (6,), N and Nm
    zmp: Array  # ZMP of the desired wrench, shape (3,), m
    measured_zmp: Array
    feet: FootWrenches  # desired foot wrenches in the sole frames, left then right
    corrections: tuple[FootCorrection, FootCorrection]  # corrections of left and right foot
    in_air: bool  # True while neither foot is loaded: their corrections stay


class Stabilizer:
    """Feedback, distribution and admittances of one robot.

    Attributes:
        mass: Mass of the robot with its load, kg; assign it when the load changes.
        distribution: Wrench distribution.
        feet: Admittances of the feet; reset a foot when it leaves or meets the ground.
    """

    def __init__(
        self,
        mass: float,
        distribution: WrenchDistribution,
        gains: StabilizerGains | None = None,
        *,
        yields: bool = True,
    ) -> None:
        """Start on the ground, with an empty memory, for a mass above zero, kg, and its soles.

        With `yields` False the feet have no corrections: drives that are commanded torques need none.
        """
        self._mass, self._yields = mass, yields
        self.distribution = distribution
        self._given = gains or StabilizerGains()
        self._gains = self._given.for_mass(mass)  # of this robot
        self._feedback = DcmFeedback(self._gains)
        self.feet = FootAdmittance(self._gains)
        self._wrench: Array | None = None  # on the soles, after the low-pass, shape (2, 6)
        self._in_air = False

    @property
    def mass(self) -> float:
        """Mass of the robot with its load, kg."""
        return self._mass

    @mass.setter
    def mass(self, mass: float) -> None:
        if mass != self._mass:
            self._mass, self.gains = mass, self._given

    @property
    def gains(self) -> StabilizerGains:
        """Gains as they were given, before `StabilizerGains.for_mass`; assign others at any time: memory stays."""
        return self._given

    @gains.setter
    @checked
    def gains(self, value: StabilizerGains) -> None:
        self._given = value
        self._gains = self._feedback.gains = self.feet.gains = value.for_mass(self._mass)

    def reset(self) -> None:
        """Forget everything: errors, corrections, filtered wrenches."""
        self._feedback.reset()
        self.feet.reset()
        self._wrench, self._in_air = None, False

    def update(
        self,
        target: Pendulum,
        com: Array,
        com_velocity: Array,
        wrenches: Array,
        soles: Sequence[pin.SE3],
        contact: tuple[bool, bool],
        yaw: float,
        dt: float,
        *,
        bias: Array | None = None,
        outside: Array | None = None,
    ) -> StabilizerOutput:
        """Run feedback, distribution and admittances for one tick.

        Args:
            target: Reference of the pendulum.
            com: Measured CoM, shape (3,), m.
            com_velocity: Its velocity, shape (3,), m/s.
            wrenches: Measured wrenches on the soles in their frames, shape (2, 6), N and Nm.
            soles: Measured placements of the left and of the right sole.
            contact: True for each foot that should carry load.
            yaw: Heading of the robot, rad.
            dt: Control period, s.
            bias: Bias of the measured DCM, shape (2,), m.
            outside: Wrench of the surroundings on the robot except its feet, about the origin of the world, shape (6,),
                N and Nm; None for none.
        """
        rows = wrenches.tolist()
        # Both feet without load are in the air; the first tick on the ground starts with an empty memory.
        in_air = max(row[2] for row in rows) < self._gains.min_force
        if self._in_air and not in_air:
            self._feedback.reset()
            self._wrench = None
        self._in_air = in_air
        measured_zmp = self._measured_zmp(target, rows, soles, contact, outside)
        idle = self._in_air or math.isnan(measured_zmp[0])
        zmp = None if idle else measured_zmp  # that feedback and admittances go by

        errors = self._feedback.errors(target, com, com_velocity, zmp, dt, bias)
        if idle:
            acceleration, pivot = target.com_acceleration, target.com
        else:
            acceleration, pivot = self._feedback.acceleration(target, errors, yaw), com
            if bias is not None:
                pivot = com.copy()
                pivot[:2] -= bias
        net = wrench_through(pivot, acceleration, self._mass)
        feet_zmp = target.zmp
        if outside is not None:
            feet_zmp = feet_zmp + self._zmp_offset(outside, target.zmp)
            net = net - outside
        net[2] = max(net[2], MIN_FORCE)  # the ground only pushes
        desired_zmp = level_zmp(net, target.zmp)
        ratio = float(contact[0])
        if all(contact):
            ratio = left_foot_ratio(feet_zmp, soles[0].translation, soles[1].translation)
        feet = self.distribution.solve(net, soles, desired_zmp, ratio, contact)
        if self._yields:
            self._yield_to(wrenches, None if idle else feet.wrenches, contact, dt)
        turned = self.feet.correction(0), self.feet.correction(1)
        return StabilizerOutput(
            errors, acceleration, net, desired_zmp, measured_zmp, feet, turned, self._in_air
        )

    def _yield_to(
        self, wrenches: Array, desired: Array | None, contact: tuple[bool, bool], dt: float
    ) -> None:
        """Low-pass the measured wrenches, and correct the feet towards the desired ones; None in the air."""
        before = wrenches if self._wrench is None else self._wrench
        self._wrench = before + lag_gain(dt, self._gains.wrench_time) * (wrenches - before)
        if desired is None:
            self.feet.hold()
        else:
            wrench, scale = self._wrench, force_scale(self._mass)
            if scale < 1.0:  # a light robot's feet yield to its smaller wrenches
                wrench, desired = wrench / scale, desired / scale
            self.feet.update(wrench.tolist(), desired.tolist(), contact, dt)

    def _zmp_offset(self, outside: Array, zmp: Array) -> Array:
        """Return by how much an outside wrench moves the ZMP of the feet, shape (3,), m."""
        return np.array((*zmp_offset(outside, zmp, self.mass * GRAVITY), 0.0))

    def _measured_zmp(
        self,
        target: Pendulum,
        wrenches: Sequence[Vector],
        soles: Sequence[pin.SE3],
        contact: tuple[bool, bool],
        outside: Array | None,
    ) -> Array:
        """ZMP of the feet in contact without the part of an outside wrench, on the level of the target, shape (3,), m.

        It is NaN without load.
        """
        standing = slice(0 if contact[0] else 1, 2 if contact[1] else 1)
        total = net_wrench(wrenches[standing], soles[standing])
        if total[2] < MIN_FORCE:
            return np.full(3, np.nan)
        zmp = level_zmp(total, target.zmp)
        return zmp if outside is None else zmp - self._zmp_offset(outside, zmp)
