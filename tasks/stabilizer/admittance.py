"""Admittances of the feet: motion from wrench errors, for a robot whose joints are position-controlled.

    ankle rotation       θ̇_x = A_y (τ_x − τ_x*),   θ̇_y = A_x (τ_y − τ_y*)      in the sole frame
    foot heights         the foot that should press more moves down, the other up, and the mean leaks to zero

A foot's rotation and height are added to the reference of the walk; they stay while the foot stands, and start from
zero at each touch-down.

Through a stiffness K the ankle law is a first-order lag of rate A·K, and so is the height law.

Source: S. Caron et al., ICRA 2019, section V.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.base.vectors import Vector
from wbc.core.frames import pose_of
from wbc.tasks.stabilizer.gains import StabilizerGains, pair

HEIGHT_LEAK = 1.0
"""Decay of the feet's mean height on both feet, 1/s."""

MAX_SPEED, MAX_ROTATION, MAX_HEIGHT = 0.1, 0.4, 0.05
"""Greatest vertical speed of a foot, m/s, rotation of an ankle, rad, and offset of a foot's height, m."""


class FootCorrection(NamedTuple):
    """Correction of a foot by the admittances."""

    roll: float = 0.0  # rotation about the sole's x axis, rad
    pitch: float = 0.0  # rotation about its y axis, rad
    height: float = 0.0  # shift along the world's z axis, m
    roll_rate: float = 0.0  # rad/s
    pitch_rate: float = 0.0  # rad/s
    height_rate: float = 0.0  # m/s

    def apply(self, placement: pin.SE3) -> tuple[pin.SE3, Array]:
        """Correct a foot that stands; `placement` is its sole frame in the world, as the foot stood down.

        Returned are the corrected placement, and its [linear; angular] velocity in the sole frame, shape (6,), m/s and
        rad/s.
        """
        rotation = placement.rotation.dot(pin.exp3(np.array((self.roll, self.pitch, 0.0))))
        x, y, z = placement.translation.tolist()
        up_x, up_y, up_z = rotation[2].tolist()  # the world's vertical in the sole frame
        climb = self.height_rate
        velocity = np.array((climb * up_x, climb * up_y, climb * up_z, self.roll_rate, self.pitch_rate, 0.0))
        return pose_of(rotation, np.array((x, y, z + self.height))), velocity


class FootAdmittance:
    """Rotations and heights of both feet, integrated.

    Attributes:
        gains: Gains; assign to change them.
    """

    def __init__(self, gains: StabilizerGains) -> None:
        self.gains = gains
        self._state = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]  # roll, pitch, height
        self._rate = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]

    def reset(self, foot: int | None = None) -> None:
        """Set the correction of one foot (0 left, 1 right), or of both, to zero."""
        for i in (0, 1) if foot is None else (foot,):
            self._state[i] = [0.0, 0.0, 0.0]
            self._rate[i] = [0.0, 0.0, 0.0]

    def hold(self) -> None:
        """Keep the corrections and stop moving them."""
        self._rate = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]

    def correction(self, foot: int) -> FootCorrection:
        """Return the correction of a foot (0 left, 1 right) now."""
        return FootCorrection(*self._state[foot], *self._rate[foot])

    def update(
        self, measured: Sequence[Vector], target: Sequence[Vector], contact: tuple[bool, bool], dt: float
    ) -> None:
        """Integrate over one period, s; feet that are not in contact keep their correction.

        Measured and desired [force; moment] of both feet are in their sole frames, six numbers each, N and Nm.
        """
        g, heights = self.gains, (self._state[0][2], self._state[1][2])
        assert g.cop_admittance is not None, "gains.for_mass(mass) fills it in"
        (along, across), bound = pair(g.cop_admittance), g.max_angular_velocity
        if all(contact):
            force = (target[0][2] - target[1][2]) - (measured[0][2] - measured[1][2])
            difference, mean = g.force_difference * force, -HEIGHT_LEAK * (heights[0] + heights[1])
            left, right = 0.5 * (mean - difference), 0.5 * (mean + difference)
            climb = min(max(left, -MAX_SPEED), MAX_SPEED), min(max(right, -MAX_SPEED), MAX_SPEED)
        else:
            # An exact decay, however long the period.
            decay = (math.exp(-g.support_height_leak * dt) - 1.0) / dt
            climb = (decay * heights[0], decay * heights[1])
        for foot in (0, 1):
            if not contact[foot]:
                self._rate[foot] = [0.0, 0.0, 0.0]
                continue
            (roll, pitch, height), felt, wanted = self._state[foot], measured[foot], target[foot]
            roll_rate, pitch_rate = across * (felt[3] - wanted[3]), along * (felt[4] - wanted[4])
            self._state[foot] = x, y, z = [
                min(max(roll + dt * min(max(roll_rate, -bound), bound), -MAX_ROTATION), MAX_ROTATION),
                min(max(pitch + dt * min(max(pitch_rate, -bound), bound), -MAX_ROTATION), MAX_ROTATION),
                min(max(height + dt * climb[foot], -MAX_HEIGHT), MAX_HEIGHT),
            ]
            self._rate[foot] = [(x - roll) / dt, (y - pitch) / dt, (z - height) / dt]
