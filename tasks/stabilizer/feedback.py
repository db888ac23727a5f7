"""DCM feedback: desired acceleration and wrench from the errors of the pendulum.

    c̈_d = c̈* + ω [k_p e_ξ + k_i ē_ξ + k_d ė_ξ] + ω k_v e_v − ω² k_ż ż*        in the yaw frame of the robot

with errors e = target − measured, ξ the DCM, ē its average and ė its derivative. The force goes through the
measured CoM, so that with k_v = 1 this is a feedback on the ZMP,

    z_d = z* − (1 + k_p/ω) e_ξ − (k_i/ω) ē_ξ − (k_d/ω) ė_ξ,

and k_p is the pole of the closed loop if the ZMP follows without lag. The pendulum gives ė = ω (e − e_zmp), at all
frequencies but with an offset when CoM or force sensors are off: a high-pass takes the offset away.

Source: Frizza et al., Humanoids 2022, eq. (3); S. Caron et al., ICRA 2019; Morisawa et al., Humanoids 2014.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wbc.base.numbers import Array, lag_gain
from wbc.core.robot import GRAVITY
from wbc.tasks.stabilizer.gains import StabilizerGains, pair
from wbc.tasks.stabilizer.pendulum import Pendulum

LEAST_VERTICAL = -0.5 * GRAVITY
"""Least desired vertical acceleration, m/s²: the ground can only push, and with little force a CoP means nothing."""


class PendulumErrors(NamedTuple):
    """Errors, target minus measured, in the world; heights are in the CoM alone."""

    com: Array  # shape (3,), m
    com_velocity: Array  # shape (3,), m/s
    dcm: Array  # shape (2,), m
    average: Array  # average of the DCM error, shape (2,), m
    rate: Array  # derivative of the DCM error, shape (2,), m/s
    zmp: Array  # shape (2,), m; zero without a measured ZMP


class DcmFeedback:
    """DCM feedback with its memory: average and derivative of the DCM error, as points of the plane, x + i y.

    Attributes:
        gains: Gains; assign to change them, which keeps the memory.
    """

    def __init__(self, gains: StabilizerGains) -> None:
        self.gains = gains
        self.reset()

    def reset(self) -> None:
        """Set the average and the derivative to zero."""
        self._average = 0j
        self._offset: complex | None = None  # of the derivative: its low-pass; None before the first one

    def errors(
        self,
        target: Pendulum,
        com: Array,
        com_velocity: Array,
        zmp: Array | None,
        dt: float,
        bias: Array | None = None,
    ) -> PendulumErrors:
        """Return target minus measured of one measurement, `dt` seconds after the last.

        CoM and its velocity are in the world, shape (3,), m and m/s; the ZMP, shape (2,) or (3,), m: without one the
        memory fades. By the `bias` of the measured DCM, shape (2,), m (`wbc.tasks.stabilizer.bias`), CoM and DCM errors
        are corrected alike, so that the velocity's stays as it is.
        """
        omega, (x, y, z), (u, v, w) = target.omega, target.com.tolist(), target.com_velocity.tolist()
        (at_x, at_y, at_z), (now_u, now_v, now_w) = com.tolist(), com_velocity.tolist()
        x, y, z, u, v, w = x - at_x, y - at_y, z - at_z, u - now_u, v - now_v, w - now_w
        if bias is not None:
            bias_x, bias_y = bias.tolist()
            x, y = x + bias_x, y + bias_y
        dcm = complex(x + u / omega, y + v / omega)
        gains, bound, rate, off, lasting = self.gains, self.gains.max_average_dcm_error, 0j, 0j, 0j
        if zmp is None:
            self._offset = None
        else:
            there, here = target.zmp.tolist(), zmp.tolist()
            off, lasting = complex(there[0] - here[0], there[1] - here[1]), dcm
            rate = omega * (dcm - off)
            offset = rate if self._offset is None else self._offset
            self._offset = offset = offset + lag_gain(dt, gains.derivator_time) * (rate - offset)
            rate -= offset
        average = self._average + lag_gain(dt, gains.integrator_time) * (lasting - self._average)
        average = complex(min(max(average.real, -bound), bound), min(max(average.imag, -bound), bound))
        self._average = average
        # One array and its parts: making an array costs more than a slice.
        plane = (dcm.real, dcm.imag, average.real, average.imag, rate.real, rate.imag, off.real, off.imag)
        all_ = np.array((x, y, z, u, v, w, *plane))
        return PendulumErrors(all_[:3], all_[3:6], all_[6:8], all_[8:10], all_[10:12], all_[12:])

    def acceleration(self, target: Pendulum, errors: PendulumErrors, yaw: float) -> Array:
        """Return the desired acceleration of the CoM by the law of this module, in the world, shape (3,), m/s².

        Gains are per axis of the frame turned by `yaw`, the heading of the robot, rad.
        """
        gains, omega, c, s = self.gains, target.omega, math.cos(yaw), math.sin(yaw)
        forward = sideways = 0.0
        for gain, factor, value in (
            (gains.dcm_p, 1.0, errors.dcm),
            (gains.dcm_i, 1.0, errors.average),
            (gains.dcm_d, 1.0, errors.rate),
            (gains.com_v, 1.0, errors.com_velocity),
            (gains.zmp_d, -omega, target.zmp_velocity),
        ):
            along, across = pair(gain)
            if along == across == 0.0:
                continue
            x, y = value.tolist()[:2]
            forward += factor * along * (c * x + s * y)
            sideways += factor * across * (c * y - s * x)
        x, y, z = target.com_acceleration.tolist()
        return np.array(
            (
                x + omega * (c * forward - s * sideways),
                y + omega * (s * forward + c * sideways),
                max(z, LEAST_VERTICAL),
            )
        )


def wrench_through(com: Array, acceleration: Array, mass: float) -> Array:
    """Return the contact wrench that accelerates a mass, kg, without turning it, by a force through `com`.

    [force; moment] is at the world origin in world axes, shape (6,), N and Nm; point (m) and acceleration (m/s²) have
    shape (3,).
    """
    x, y, z = com.tolist()
    ax, ay, az = acceleration.tolist()
    fx, fy, fz = mass * ax, mass * ay, mass * (az + GRAVITY)
    return np.array([fx, fy, fz, y * fz - z * fy, z * fx - x * fz, x * fy - y * fx])
