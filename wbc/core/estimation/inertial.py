"""Attitude, gyro bias and velocity of an inertial measurement unit, aided by a velocity from the legs.

Gyroscope and accelerometer are integrated to attitude and velocity, both with a drift. The velocity from the stance
foot corrects attitude, velocity and gyro bias: an attitude with a small tilt error turns gravity into a false
horizontal acceleration, so the direction in which the velocity drifts is that of the tilt error. Unlike a filter that
takes the accelerometer for the vertical, this one is not tilted by the accelerations of the gait.

A tilt error obeys s³ + s²/τ_v + s/(τ_v τ_t) + 1/(τ_v τ_t τ_b) = 0 with the time constants of the settings.

Source: velocity-aided attitude observers, M.-D. Hua, Control Engineering Practice 18(7), 2010; gyro bias as
the integral of the correction, R. Mahony, T. Hamel, J.-M. Pflimlin, IEEE TAC 53(5), 2008.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc.base.checked import result
from wbc.base.numbers import Array, lag_gain, scalar
from wbc.base.settings import SMALLEST, Positive, settings
from wbc.base.vectors import Vector
from wbc.core.robot import GRAVITY


@settings
class InertialSettings:
    """Time constants with which the velocity of the legs corrects the inertial estimate.

    Attributes:
        velocity_time_constant: Cross-over between accelerometer (faster) and velocity of the legs (slower), s.
        tilt_time_constant: Decay of a roll or pitch error, s; far above `velocity_time_constant`.
        yaw_time_constant: Decay of a yaw error towards the feet, s.
        bias_time_constant: Integral time of the gyro bias, s; 4 tilt time constants are critically damped,
            infinity keeps the bias at zero.
        flight_time_constant: Decay of the velocity when no foot is loaded, s.
    """

    velocity_time_constant: Annotated[Positive, "s"] = 0.05
    tilt_time_constant: Annotated[Positive, "s"] = 2.0
    yaw_time_constant: Annotated[Positive, "s"] = 1.0
    bias_time_constant: Annotated[float, Field(ge=SMALLEST, allow_inf_nan=True), "s"] = 8.0
    flight_time_constant: Annotated[Positive, "s"] = 1.0


UNKNOWN = 1.0
"""Time of a stand, s, for which a gyro bias of zero counts in the first one: a few readings say nothing yet."""

MOST_OFF = 0.01
"""Greatest error of the gyro bias that a tick of a stand tells, rad/s: soles turn at 0.05 rad/s on stones."""

NOISE_TIME = 0.2
"""Low-pass of the turn of the feet, s, whose change in one tick is the noise of encoders."""

STEADY = 0.3
"""Time constant with which the steady velocity follows the legs, s."""

_HALF = scalar(0.5)


@dataclass(slots=True)
class Correction:
    """Correction of the inertial estimate by the legs in one period.

    Attributes:
        legs: Velocity of the IMU point by the legs in the world, m/s; None in flight.
        unexplained: Change of the legs' horizontal velocity that the accelerometer does not show, x + iy in the world,
            m/s; zero in flight.
        turned: Angle by which the feet have turned about the vertical, by the gyroscope, rad: the yaw follows the feet.
        left: Difference of the legs' horizontal velocity from the estimate that is left, x + iy in the world, m/s.
        yaw_left: Yaw error that is left, rad.
    """

    legs: Vector | None = None
    unexplained: complex = 0j
    turned: float = 0.0
    left: complex = 0j
    yaw_left: float = 0.0


class InertialFilter:
    """Filter for attitude, velocity and gyro bias of an IMU.

    Attributes:
        rotation: Attitude of the IMU in the world, shape (3, 3).
        velocity: Velocity of the IMU point in the world, shape (3,), m/s.
        steady: Horizontal velocity of that point, x + iy, m/s, which follows the legs with the time constant `STEADY`.
            A foot that begins to slip pulls it less than `velocity`.
        gyro_bias: Bias of the gyroscope in the IMU frame, measured minus true, shape (3,), rad/s.
        correction: Correction in the last period.
        settings: Its `InertialSettings`, read-only; `Observer.retune` changes them.
    """

    settings: InertialSettings = result("_settings", "`Observer.retune` changes it")

    def __init__(self, settings: InertialSettings | None = None) -> None:
        self._settings = settings or InertialSettings()
        self.rotation: Array = np.eye(3)
        self.velocity: Array = np.zeros(3)
        self.steady = 0j
        self.gyro_bias: Array = np.zeros(3)
        self.correction = Correction()
        self._bias_at_rest = np.zeros(3)
        self._turning = 0.0  # rate by which feet seem to turn in a stand, low-passed, rad/s
        self._rested = UNKNOWN  # time over which `_bias_at_rest` is the mean, s
        self._last: tuple[Array, Array] | None = None
        self._dt, self._half_period = 0.0, scalar(0.0)

    def reset(self, rotation: Array, velocity: Array | None = None) -> None:
        """Restart from attitude (3, 3) and velocity (3,), m/s, of the IMU in the world; the gyro bias is kept."""
        self.rotation = np.array(rotation)
        self._take(np.zeros(3) if velocity is None else np.array(velocity))
        self._last, self.correction = None, Correction()

    def retune(self, settings: InertialSettings) -> None:
        """Go on with other settings."""
        self._settings = settings

    def _take(self, velocity: Array) -> None:
        """Take a velocity of the IMU point in the world over, shape (3,), m/s, as the steady one, too."""
        self.velocity, self.steady = velocity, complex(velocity[0], velocity[1])

    def learn_bias(self) -> None:
        """Learn the gyro bias in a tick of a stand, after `correct`: a robot that stands does not turn.

        About the vertical it is what the feet seem to turn by, the mean over the stands of the last
        `bias_time_constant`. `gyro_bias` is disturbed there for many seconds by feet that have turned in a walk. Feet
        that seem to turn faster than a bias explains do turn, and count as little as a bias would.
        """
        if self.correction.legs is None:
            return
        self._rested = min(self._rested + self._dt, self._settings.bias_time_constant)
        up = self.rotation[2]
        if self._dt > 0.0:
            self._turning += lag_gain(self._dt, NOISE_TIME) * (
                self.correction.turned / self._dt - self._turning
            )
        most = MOST_OFF * self._dt / self._rested
        off = min(max(self._turning * self._dt / self._rested, -most), most)
        off += float(up.dot(self._bias_at_rest - self.gyro_bias))
        self._bias_at_rest = self.gyro_bias + off * up

    def predict(self, angular_velocity: Array, specific_force: Array, dt: float) -> None:
        """Integrate gyroscope and accelerometer over dt, s, with the mean of the samples at its two ends."""
        gyro, force = self._last or (angular_velocity, specific_force)
        self._last = (angular_velocity.copy(), specific_force.copy())
        if dt <= 0.0:
            return
        if dt != self._dt:
            self._dt, self._half_period = dt, scalar(0.5 * dt)
        half_period = self._half_period
        rate = gyro + angular_velocity
        rate *= _HALF
        rate -= self.gyro_bias
        rate *= half_period
        half = pin.exp3(rate)
        middle = self.rotation.dot(half)
        push = middle.dot(force + specific_force)
        push *= half_period
        self.velocity += push
        x, y, _ = push.tolist()
        self.steady += complex(x, y)
        self.velocity[2] -= dt * GRAVITY
        self.rotation = middle.dot(half)

    def correct(
        self, legs: Vector | None, yaw_error: float, dt: float, *, struck: bool = False, slides: bool = False
    ) -> None:
        """Correct the state with velocity and yaw from the legs, `dt` seconds after the last call.

        Args:
            legs: Velocity of the IMU point in the world by the legs, m/s; None in flight, and while no foot rests.
            yaw_error: Yaw of the IMU from the feet minus that of the filter, rad.
            dt: Time since the last call, s.
            struck: True where the velocity of the legs counts at once, as at the start and after an impact.
            slides: True while a foot slips. What it has added to the horizontal velocity is taken back to the steady
                one; where feet rest again, the steady velocity follows at once.
        """
        s, correction = self._settings, self.correction
        before, correction.legs = correction.legs, legs
        if legs is None:
            if slides:
                self.velocity[:2] = self.steady.real, self.steady.imag
            self.velocity *= math.exp(-dt / s.flight_time_constant)
            correction.unexplained = correction.left = 0j
            correction.turned, correction.yaw_left = correction.yaw_left, 0.0
            return
        if struck:
            self._take(np.array(legs))
        (x, y, z), (u, v, w) = legs, self.velocity.tolist()
        found = complex(x - u, y - v)
        gain, yaw = lag_gain(dt, s.velocity_time_constant), lag_gain(dt, s.yaw_time_constant)
        self.velocity += np.array((gain * (x - u), gain * (y - v), gain * (z - w)))
        self.steady += lag_gain(dt, STEADY) * (complex(x, y) - self.steady)
        if slides:
            self._take(self.velocity)
        # A tilt δ shows as the innovation −g τ_v (δ × z) once the velocity has settled: turn against it.
        tilt, slowly = gain / (GRAVITY * s.tilt_time_constant), 1.0 / s.bias_time_constant
        roll, pitch, heading = -tilt * found.imag, tilt * found.real, yaw * yaw_error
        drift = dt * float(self.rotation[2].dot(self.gyro_bias - self._bias_at_rest))
        correction.unexplained = 0j if before is None else found - correction.left
        correction.left = found * (1.0 - gain)
        correction.turned = drift - (yaw_error - correction.yaw_left)
        correction.yaw_left = (1.0 - yaw) * yaw_error
        # In plain numbers: NumPy takes three times as long to divide an array by one.
        self.gyro_bias -= np.array((slowly * roll, slowly * pitch, slowly * heading)).dot(self.rotation)
        self.rotation = pin.exp3(np.array((roll, pitch, heading))).dot(self.rotation)
