"""Motion of the whole body over a clip: soles, centre of mass, angular momentum and zero-moment point (ZMP)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.ndimage import gaussian_filter1d

from wbc.core.errors import Array
from wbc.core.qp.contact import mean_distance
from wbc.core.robot import BASE_DOF, GRAVITY, Robot

TORQUE_SMOOTHING = 0.02
"""Standard deviation with which accelerations are smoothed for torques, s: differences of recordings are noisy."""


SLIP_PASSES = 8
"""Passes of least squares for the friction that two soles need."""


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
        """Compute all quantities of configurations, shape (T, nq), at a rate, Hz; the robot's state is not changed."""
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

    def soles(self, side: int) -> list[pin.SE3]:
        """Return the sole frame of a side, 0 left and 1 right, in each frame."""
        pairs = zip(self.sole_rotations[:, side], self.sole_positions[:, side], strict=True)
        return [pin.SE3(rotation, position) for rotation, position in pairs]

    def zmp(self, ground: float = 0.0) -> Array:
        """Return the point on the ground, at a height, m, about which gravity and inertia have no horizontal moment.

        ZMP in the world, shape (T, 2), m. Where the centre of mass falls freely it is far away.
        """
        acceleration = second_difference(self.com, self.rate)
        moment = np.gradient(self.momentum, 1.0 / self.rate, axis=0) / self.mass
        lift = np.maximum(acceleration[:, 2] + GRAVITY, 0.05 * GRAVITY)
        height = self.com[:, 2] - ground
        x = self.com[:, 0] - (height * acceleration[:, 0] + moment[:, 1]) / lift
        y = self.com[:, 1] - (height * acceleration[:, 1] - moment[:, 0]) / lift
        return np.column_stack([x, y])

    def friction(self, robot: Robot, standing: Array, ground: float = 0.0) -> Array:
        """Return the least coefficient of friction with which the soles that stand do not slip, shape (T,).

        A sole of load N transmits every horizontal force f and yaw moment τ in the ellipsoid |f|² + (τ/d)² ≤ (μN)²,
        with d the mean distance of its points from its centre (`mean_distance`). The ZMP on a `ground` at that height,
        m, says how two soles share the load. By duality μ is the greatest ratio of the power of the needed wrench to Σ
        N √(|v|² + (dω)²) over all motions of the ground under both soles; the motion is found by repeated least
        squares.

        Source: R. D. Howe, M. R. Cutkosky, IJRR 15(6), 1996 (ellipsoid).
        """
        smoothing = TORQUE_SMOOTHING * self.rate
        acceleration = gaussian_filter1d(second_difference(self.com, self.rate), smoothing, axis=0)
        force = self.mass * acceleration[:, :2]
        turning = gaussian_filter1d(np.gradient(self.momentum[:, 2], 1.0 / self.rate), smoothing)
        zmp = gaussian_filter1d(self.zmp(ground), smoothing, axis=0)
        weight = self.mass * np.maximum(acceleration[:, 2] + GRAVITY, 0.05 * GRAVITY)
        loads = weight[:, None] * load_shares(self.sole_positions[..., :2], zmp, standing)
        arms = self.sole_positions[..., :2] - self.com[:, None, :2]
        distance = np.array([mean_distance(0.5 * s.length, 0.5 * s.width) for s in robot.soles[:2]])
        stiffness = loads.copy()
        for _ in range(SLIP_PASSES):
            total = stiffness.sum(axis=1)
            centre = (stiffness[..., None] * arms).sum(axis=1) / total[:, None]
            from_centre = arms - centre[:, None]
            moment = turning - centre[:, 0] * force[:, 1] + centre[:, 1] * force[:, 0]
            inertia = (stiffness * ((from_centre**2).sum(axis=-1) + distance**2)).sum(axis=1)
            speed, rate = force / total[:, None], moment / inertia
            slip = speed[:, None] + rate[:, None, None] * from_centre[..., ::-1] * (-1.0, 1.0)
            size = np.sqrt((slip**2).sum(axis=-1) + (distance * rate[:, None]) ** 2) + 1e-9
            stiffness = loads * size.max(axis=1, keepdims=True) / size
        power = (force * speed).sum(axis=1) + moment * rate
        return np.asarray(power / (loads * size).sum(axis=1))

    def torque_share(self, robot: Robot) -> Array:
        """Return the torque of each joint as a share of its limit, shape (T, na); zero for the legs.

        Inverse dynamics of the joints above the legs do not depend on the forces at the feet; those of the legs do.
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


def load_shares(soles: Array, zmp: Array, standing: Array) -> Array:
    """Return the share of the load that each standing sole bears, by the place of the ZMP between them, shape (T, 2).

    Centres of left and right sole have shape (T, 2, 2), the ZMP (T, 2), m.
    """
    between = soles[:, 0] - soles[:, 1]
    left = ((zmp - soles[:, 1]) * between).sum(axis=1) / np.maximum((between**2).sum(axis=1), 1e-9)
    left = np.where(standing.all(axis=1), np.clip(left, 0.0, 1.0), standing[:, 0])
    return np.column_stack([left, 1.0 - left])


def velocities(model: pin.Model, q: Array, rate: float) -> Array:
    """Return velocities by central differences (one-sided at both ends), shape (T, nv)."""
    steps = np.array([pin.difference(model, q[i], q[i + 1]) for i in range(len(q) - 1)]) * rate
    return np.vstack([steps[:1], 0.5 * (steps[:-1] + steps[1:]), steps[-1:]])


def second_difference(values: Array, rate: float) -> Array:
    """Return second differences with a motion at rest before the first and after the last frame, shape of `values`."""
    padded = np.concatenate([values[:1], values, values[-1:]])
    return np.asarray((padded[2:] - 2.0 * padded[1:-1] + padded[:-2]) * rate**2)
