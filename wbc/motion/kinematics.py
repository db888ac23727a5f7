"""Motion of the whole body over a clip: soles, centre of mass, angular momentum and zero-moment point (ZMP)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.ndimage import gaussian_filter1d

from wbc.core.errors import Array
from wbc.core.robot import BASE_DOF, GRAVITY, Robot

TORQUE_SMOOTHING = 0.02
"""Standard deviation with which accelerations are smoothed for torques, s: differences of recordings are noisy."""


@dataclass(frozen=True, slots=True, eq=False)
class BodyMotion:
    """Quantities of every frame of a motion, in the world.

    Attributes:
        rate: Frames per second, Hz.
        q: Configurations, shape (T, nq).
        v: Velocities, shape (T, nv); central differences.
        sole_positions: Centres of left and right sole, shape (T, 2, 3), m.
        sole_rotations: Rotations of both sole frames, shape (T, 2, 3, 3).
        corners: Corners of both soles, shape (T, 2, 4, 3), m.
        com: Centre of mass, shape (T, 3), m.
        momentum: Angular momentum about the centre of mass, shape (T, 3), kg m²/s.
        mass: Mass of the robot, kg.
    """

    rate: float
    q: Array
    v: Array
    sole_positions: Array
    sole_rotations: Array
    corners: Array
    com: Array
    momentum: Array
    mass: float

    @classmethod
    def of(cls, robot: Robot, q: Array, rate: float) -> BodyMotion:
        """Compute all quantities.

        Args:
            robot: The robot; its state is not changed.
            q: Configurations, shape (T, nq).
            rate: Frames per second, Hz.
        """
        model, data = robot.model, robot.model.createData()
        v = velocities(model, q, rate)
        soles = [robot.frame_id(sole.frame) for sole in robot.soles[:2]]
        offsets = sole_corners(robot)
        count = len(q)
        positions, rotations = np.empty((count, 2, 3)), np.empty((count, 2, 3, 3))
        corners, com, momentum = np.empty((count, 2, 4, 3)), np.empty((count, 3)), np.empty((count, 3))
        for i in range(count):
            momentum[i] = pin.computeCentroidalMomentum(model, data, q[i], v[i]).angular
            com[i] = data.com[0]
            for side, frame in enumerate(soles):
                placement = pin.updateFramePlacement(model, data, frame)
                positions[i, side], rotations[i, side] = placement.translation, placement.rotation
                corners[i, side] = offsets[side] @ placement.rotation.T + placement.translation
        return cls(rate, q, v, positions, rotations, corners, com, momentum, robot.mass)

    @property
    def joint_speed(self) -> Array:
        """Joint velocities, shape (T, na), rad/s."""
        return self.v[:, BASE_DOF:]

    def zmp(self, ground: float = 0.0) -> Array:
        """Return the point on the ground about which gravity and inertia have no horizontal moment.

        Args:
            ground: Height of the ground, m.

        Returns:
            ZMP in the world, shape (T, 2), m. Where the centre of mass falls freely it is far away.
        """
        acceleration = second_difference(self.com, self.rate)
        moment = np.gradient(self.momentum, 1.0 / self.rate, axis=0) / self.mass
        lift = np.maximum(acceleration[:, 2] + GRAVITY, 0.05 * GRAVITY)
        height = self.com[:, 2] - ground
        x = self.com[:, 0] - (height * acceleration[:, 0] + moment[:, 1]) / lift
        y = self.com[:, 1] - (height * acceleration[:, 1] - moment[:, 0]) / lift
        return np.column_stack([x, y])

    def torque_share(self, robot: Robot) -> Array:
        """Return the torque of each joint as a share of its limit, shape (T, na); zero for the legs.

        Inverse dynamics of the joints above the legs do not depend on the forces at the feet; those of the legs do.

        Args:
            robot: The robot.
        """
        acceleration = gaussian_filter1d(
            np.gradient(self.v, 1.0 / self.rate, axis=0), TORQUE_SMOOTHING * self.rate, axis=0
        )
        data = robot.model.createData()
        torques = np.array(
            [
                pin.rnea(robot.model, data, q, v, a)[BASE_DOF:]
                for q, v, a in zip(self.q, self.v, acceleration, strict=True)
            ]
        )
        torques[:, leg_joints(robot)] = 0.0
        return np.asarray(abs(torques) / robot.torque_limit)

    def sole_speed(self) -> Array:
        """Return the speed of the fastest corner of each sole, shape (T, 2), m/s."""
        motion = np.gradient(self.corners, 1.0 / self.rate, axis=0)
        return np.asarray(np.linalg.norm(motion, axis=-1).max(axis=-1))


def leg_joints(robot: Robot) -> list[int]:
    """Return the joints of both legs as indices of shape (na,)."""
    return [j for sole in robot.soles[:2] for j in robot.joints_between(sole.frame, robot.base_frame)]


def sole_corners(robot: Robot) -> list[Array]:
    """Return the corners of left and right sole in their own frames, each of shape (4, 3), m."""
    return [
        np.array([(0.5 * x * s.length, 0.5 * y * s.width, 0.0) for x in (1, -1) for y in (1, -1)])
        for s in robot.soles[:2]
    ]


def velocities(model: pin.Model, q: Array, rate: float) -> Array:
    """Return velocities by central differences (one-sided at both ends), shape (T, nv)."""
    steps = np.array([pin.difference(model, q[i], q[i + 1]) for i in range(len(q) - 1)]) * rate
    return np.vstack([steps[:1], 0.5 * (steps[:-1] + steps[1:]), steps[-1:]])


def second_difference(values: Array, rate: float) -> Array:
    """Return second differences with a motion at rest before the first and after the last frame, shape of `values`."""
    padded = np.concatenate([values[:1], values, values[-1:]])
    return np.asarray((padded[2:] - 2.0 * padded[1:-1] + padded[:-2]) * rate**2)
