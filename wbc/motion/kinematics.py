"""Motion of the whole body over a clip: soles, centre of mass, angular momentum and zero-moment point (ZMP)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.ndimage import gaussian_filter1d

from wbc.base.numbers import ROUNDING, Array
from wbc.core.friction import mean_distance
from wbc.core.robot import BASE_DOF, GRAVITY, SIDES, Robot

FORCE_SMOOTHING = 0.02
"""Standard deviation with which motions are smoothed whose second differences give forces, torques or the ZMP, s:
differences of recordings are noisy, and splines have kinks in their accelerations."""

LEAST_LIFT = 0.2
"""Least vertical acceleration over free fall that a ZMP is computed with, as a ratio of gravity: in free fall it is
infinitely far away."""

SLIP_PASSES = 8
"""Passes of least squares for the friction that two soles need."""

Soles = tuple[pin.SE3, pin.SE3]
"""Placements of left and right sole."""


@dataclass(frozen=True, slots=True, eq=False)
class BodyMotion:
    """Quantities of every frame of a motion, in the world; none of the arrays can be written.

    Attributes:
        rate: Frames per second, Hz.
        q: Configurations, shape (T, nq).
        v: Velocities, shape (T, nv); central differences.
        soles: Placements of both soles, T pairs.
        corners: Corners of both soles, shape (T, 2, 4, 3), m.
        com: Centre of mass, shape (T, 3), m.
        momentum: Angular momentum about the centre of mass over the mass, shape (T, 3), m²/s.
    """

    rate: float
    q: Array
    v: Array
    soles: Sequence[Soles]
    corners: Array
    com: Array
    momentum: Array

    @classmethod
    def of(cls, robot: Robot, q: Array, rate: float) -> BodyMotion:
        """Compute all quantities of configurations, shape (T, nq), at a rate, Hz; the robot's state is not changed.

        Raises:
            InputError: The robot has no feet.
        """
        robot.needs_feet("a motion")
        model, data = robot.model, robot.model.createData()
        steps = np.array([pin.difference(model, q[i], q[i + 1]) for i in range(len(q) - 1)]) * rate
        v = np.vstack([steps[:1], 0.5 * (steps[:-1] + steps[1:]), steps[-1:]])
        frames = [robot.frame_id(sole.frame) for sole in robot.soles[:2]]
        soles: list[Soles] = []
        com, momentum = np.empty((len(q), 3)), np.empty((len(q), 3))
        for i in range(len(q)):
            momentum[i] = pin.computeCentroidalMomentum(model, data, q[i], v[i]).angular / robot.mass
            com[i] = data.com[0]
            left, right = (pin.updateFramePlacement(model, data, frame).copy() for frame in frames)
            soles.append((left, right))
        corners, q = corners_of(robot, soles), q.copy()
        for values in (q, v, corners, com, momentum):
            values.setflags(write=False)
        return cls(rate, q, v, soles, corners, com, momentum)

    @property
    def centres(self) -> Array:
        """Centres of both soles, shape (T, 2, 3), m."""
        return np.asarray(self.corners.mean(axis=2))

    def acceleration(self) -> Array:
        """Return the acceleration of the centre of mass, shape (T, 3), m/s², at rest before and after the motion."""
        padded = np.pad(self.com, ((1, 1), (0, 0)), mode="edge")
        return np.asarray((padded[2:] - 2.0 * padded[1:-1] + padded[:-2]) * self.rate**2)

    def turning(self) -> Array:
        """Return the rate of the angular momentum over the mass, shape (T, 3), m²/s²."""
        return np.gradient(self.momentum, 1.0 / self.rate, axis=0)

    def zmp(self) -> Array:
        """Return the ZMP on a ground at z = 0, shape (T, 2), m (`zmp_of`)."""
        return zmp_of(self.com, self.acceleration(), self.turning())

    def friction(self, robot: Robot, standing: Array) -> Array:
        """Return the least coefficient of friction with which the soles that stand do not slip, shape (T,).

        A sole of load N transmits every horizontal force f and yaw moment τ in the ellipsoid |f|² + (τ/d)² ≤ (μN)²,
        with d the mean distance of its points from its centre (`mean_distance`). The ZMP says how two soles share the
        load. By duality μ is the greatest ratio of the power of the needed wrench to Σ N √(|v|² + (dω)²) over all
        motions of the ground under both soles; the motion is found by repeated least squares. Forces and loads are per
        mass.

        Source: R. D. Howe, M. R. Cutkosky, IJRR 15(6), 1996 (ellipsoid).
        """
        acceleration, turning, zmp = (
            gaussian_filter1d(values, FORCE_SMOOTHING * self.rate, axis=0)
            for values in (self.acceleration(), self.turning()[:, 2], self.zmp())
        )
        force, soles = acceleration[:, :2], self.centres[..., :2]
        between = soles[:, 0] - soles[:, 1]
        left = ((zmp - soles[:, 1]) * between).sum(axis=1) / np.maximum((between**2).sum(axis=1), ROUNDING)
        left = np.where(standing.all(axis=1), np.clip(left, 0.0, 1.0), standing[:, 0])
        loads = least_lift(acceleration) * np.column_stack([left, 1.0 - left])
        arms = soles - self.com[:, None, :2]
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
            size = np.sqrt((slip**2).sum(axis=-1) + (distance * rate[:, None]) ** 2) + ROUNDING
            stiffness = loads * size.max(axis=1, keepdims=True) / size
        power = (force * speed).sum(axis=1) + moment * rate
        return np.asarray(power / (loads * size).sum(axis=1))

    def torque_share(self, robot: Robot) -> Array:
        """Return the torque of each joint as a share of its limit, shape (T, na); zero for the legs.

        Inverse dynamics of the joints above the legs do not depend on the forces at the feet; those of the legs do.
        """
        acceleration = np.gradient(self.v, 1.0 / self.rate, axis=0)
        acceleration = gaussian_filter1d(acceleration, FORCE_SMOOTHING * self.rate, axis=0)
        rows, data = zip(self.q, self.v, acceleration, strict=True), robot.model.createData()
        torques = np.array([pin.rnea(robot.model, data, *row)[BASE_DOF:] for row in rows])
        torques += robot.passive_torques(self.q, self.v)
        torques[:, robot.leg_joints] = 0.0
        return robot.torque_share(torques)


def arm_joints(robot: Robot) -> dict[str, list[int]]:
    """Return the joints between the torso and each hand, by the side of the hand, as `Robot.joints_between`."""
    hands = {side: robot.frames.get(f"{side}_hand") for side in SIDES}
    return {side: robot.joints_between(hand, robot.torso_frame) for side, hand in hands.items() if hand}


def offset_between(sole: pin.SE3, place: pin.SE3) -> Array:
    """Return way, m, and rotation vector, rad, from one placement to another in the world, shape (6,)."""
    turn = np.asarray(pin.log3(place.rotation @ sole.rotation.T))
    return np.concatenate([place.translation - sole.translation, turn])


def moved(sole: pin.SE3, offset: Array) -> pin.SE3:
    """Return a placement moved by an offset; see `offset_between`."""
    return pin.SE3(pin.exp3(offset[3:]) @ sole.rotation, sole.translation + offset[:3])


def coms_of(robot: Robot, q: Array) -> Array:
    """Return the centres of mass of configurations, shape (T, nq), in the world, shape (T, 3), m."""
    data = robot.model.createData()
    return np.array([pin.centerOfMass(robot.model, data, each) for each in q])


def corners_of(robot: Robot, soles: Sequence[Soles]) -> Array:
    """Return the corners of left and right sole, T pairs of placements, shape (T, 2, 4, 3), m."""
    own = robot.soles[:2]
    return np.array([[sole.corners(place) for sole, place in zip(own, pair, strict=True)] for pair in soles])


def zmp_of(com: Array, acceleration: Array, turning: Array, ground: float = 0.0) -> Array:
    """Return the point on the ground about which gravity and inertia have no horizontal moment, shape (T, 2), m.

        z = c − (h c̈ + L̇ × e_z / m) / (c̈_z + g)

    with the centre of mass c and its acceleration, m and m/s², the rate of the angular momentum over the mass, L̇ / m,
    m²/s², all of shape (T, 3), and h the height over the ground, which is at a height, m.
    """
    moment = np.column_stack([turning[:, 1], -turning[:, 0]])
    height = com[:, 2:] - ground
    return com[:, :2] - (height * acceleration[:, :2] + moment) / least_lift(acceleration)


def least_lift(acceleration: Array) -> Array:
    """Return the vertical force per mass on the ground, shape (T, 1), m/s², at least `LEAST_LIFT` of gravity."""
    return np.maximum(acceleration[:, 2:] + GRAVITY, LEAST_LIFT * GRAVITY)
