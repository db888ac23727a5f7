"""Reaction of the body to a leg that swings, as a motion of the centre of mass about that of the pendulum.

A foot that is thrown forward turns the body back. If the ground is to give that moment, the ZMP leaves the sole; if the
ZMP stays where the pendulum has it, the centre of mass is pushed,

    c̈ = ω² (c − z) + κ ẍ,   κ = −H / (m h),

with the acceleration ẍ of the foot, and the angular momentum H of a leg that carries its foot at unit speed. Of all
deviations d from the pendulum that solve this, one alone stays bounded,

    δ(t) = −(κ/ω) ∫ₜ^∞ e^{−ω(s − t)} ẍ(s) ds,   ḋ = ω (δ − d),

and δ, the deviation of the DCM, follows from the swings to come. A foot travels along a polynomial of fifth order from
rest to rest, for which it has a closed form.

Source: Takenaka, Matsumoto, Yoshiike, IROS 2009 (gait generation with masses in the legs).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.core.robot import Robot, joints_to
from wbc.tasks.stabilizer.pendulum import Pendulum

NEGLIGIBLE = 1e-6
"""Deviation below which the centre of mass is that of the pendulum, m."""


TRUNK = 1.15
"""Reaction of both legs over that of the swinging one: the trunk slows down over the stance foot while the other foot
is thrown forward, and both legs move against it. In walks of the built-in robots at 0.4 m/s it is 1.10 to 1.20."""


class Travel(NamedTuple):
    """Displacement of a foot through the air.

    Attributes:
        time: Time since it began, s; negative before.
        duration: Time from rest to rest, s.
        x: Displacement from lift-off to landing along the world's x axis, m.
        y: Displacement along the world's y axis, m.
    """

    time: float
    duration: float
    x: float
    y: float


def leg_share(robot: Robot, com_height: float) -> float:
    """Return κ: acceleration of the centre of mass over that of a swing foot, with the ZMP where it is.

    The first leg swings, from half-sitting, with the CoM at a height over the soles, m.
    """
    model, data = robot.model, robot.model.createData()
    frame = robot.frame_id(robot.soles[0].frame)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    jacobian = pin.computeFrameJacobian(model, data, robot.half_sitting, frame, axes)
    leg = [model.joints[j].idx_v for j in joints_to(model, frame)]
    v = np.zeros(model.nv)
    v[leg] = np.linalg.lstsq(jacobian[:, leg], np.array((1.0, 0.0, 0.0, 0.0, 0.0, 0.0)), rcond=None)[0]
    momentum = pin.computeCentroidalMomentum(model, data, robot.half_sitting, v)
    return -float(momentum.angular[1]) / (robot.mass * com_height)


class SwingReaction:
    """Deviation of the centre of mass from the pendulum, tick by tick.

    Attributes:
        dcm: Deviation δ of the DCM, m.
        acceleration: Acceleration κ ẍ of the centre of mass that needs no force of the ground, m/s².
    """

    def __init__(self, share: float, omega: float, period: float) -> None:
        """Begin without a deviation, with κ of the robot, the natural frequency, 1/s, and the control period, s."""
        self._share, self._omega = share, omega
        self._follow = 1.0 - math.exp(-omega * period)
        self.dcm = self._com = self.acceleration = (0.0, 0.0)

    @property
    def rests(self) -> bool:
        """True without a deviation."""
        return max(map(abs, (*self.dcm, *self._com))) < NEGLIGIBLE

    def update(self, travels: Sequence[Travel], weight: float) -> None:
        """Advance by one tick with the displacements of the foot in the air and of the next one, times `weight`."""
        x = y = ax = ay = 0.0
        for travel in travels:
            sway, acceleration = _unit(travel.time, travel.duration, self._omega)
            x, y = x + sway * travel.x, y + sway * travel.y
            ax, ay = ax + acceleration * travel.x, ay + acceleration * travel.y
        share = weight * TRUNK * self._share
        self.dcm, self.acceleration = (share * x, share * y), (share * ax, share * ay)
        com_x, com_y = self._com
        self._com = (
            com_x + self._follow * (self.dcm[0] - com_x),
            com_y + self._follow * (self.dcm[1] - com_y),
        )

    def moved(self, pendulum: Pendulum) -> Pendulum:
        """Return a pendulum with the deviation. Its ZMP stays, and its acceleration is that by the ground's force."""
        com, velocity, acceleration = (
            np.array(part) for part in (pendulum.com, pendulum.com_velocity, pendulum.com_acceleration)
        )
        omega = self._omega
        for axis in (0, 1):
            offset = self._com[axis]
            com[axis] += offset
            velocity[axis] += omega * (self.dcm[axis] - offset)
            acceleration[axis] += omega * omega * offset
        return pendulum._replace(com=com, com_velocity=velocity, com_acceleration=acceleration)


def _unit(time: float, duration: float, omega: float) -> tuple[float, float]:
    """δ/κ (m) and ẍ (m/s²) at a time of a foot that travels 1 m."""
    if time >= duration:
        return 0.0, 0.0
    if time < 0.0:
        return _unit(0.0, duration, omega)[0] * math.exp(omega * time), 0.0
    begin, acceleration = _derivatives(time / duration, duration, omega)
    end, _ = _derivatives(1.0, duration, omega)
    return (math.exp(omega * (time - duration)) * end - begin) / omega, acceleration


def _derivatives(s: float, duration: float, omega: float) -> tuple[float, float]:
    """Sum of the derivatives of ẍ over rising powers of ω, and ẍ, at a time over the duration."""
    square = duration * duration
    acceleration = s * (60.0 + s * (120.0 * s - 180.0)) / square
    jerk = (60.0 + s * (360.0 * s - 360.0)) / (square * duration)
    snap = (720.0 * s - 360.0) / (square * square)
    last = 720.0 / (square * square * duration)
    return (acceleration + (jerk + (snap + last / omega) / omega) / omega) / omega, acceleration
