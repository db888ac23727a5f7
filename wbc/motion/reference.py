"""References of a clip for every tick: joints, pendulum, feet and trunk with velocities and accelerations.

Joints and the base's position follow cubic splines through the frames, its orientation a spline of rotations; the rest
is kinematics and the rate of the centroidal momentum, without further differences. The pendulum that a stabilizer is
given contains the change of the angular momentum,

    z = c − (h c̈ + L̇ × e_z / m) / (c̈_z + g),      c̈* = (c̈_z + g) (c − z) / h,

so that fast arms are no disturbance: the wrench that the stabilizer wants is the one that the motion makes.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation, RotationSpline

from wbc.core.errors import Array
from wbc.core.robot import GRAVITY, Robot
from wbc.motion.clip import MotionClip
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.pattern.swing import FootMotion
from wbc.walking.planning.footsteps import heading, mean_heading
from wbc.walking.source import Reference, WholeBody

ZMP_SMOOTHING = 0.02
"""Standard deviation with which the reference of the ZMP is smoothed, s: splines have kinks in their accelerations."""


def clip_references(
    robot: Robot, clip: MotionClip, standing: Array, ground: float, dt: float
) -> tuple[Array, tuple[Reference, ...]]:
    """Return configurations, shape (T, nq), and references of the ticks of a clip.

    Args:
        robot: The robot; its state is not changed.
        clip: The clip.
        standing: True where the left and the right sole stand in each frame, shape (frames, 2).
        ground: Height of the ground, m.
        dt: Control period, s.
    """
    q, v, a = splines(robot, clip, dt)
    count = len(q)
    nearest = np.minimum(np.round(np.arange(count) * dt * clip.rate).astype(int), len(clip) - 1)
    model, data = robot.model, robot.model.createData()
    soles = [robot.frame_id(sole.frame) for sole in robot.soles[:2]]
    parts = [robot.frame_id(part) for part in dict.fromkeys((robot.base_frame, robot.torso_frame))]
    com, com_velocity, com_acceleration, turning = (np.empty((count, 3)) for _ in range(4))
    moving: list[tuple[list[FootMotion], list[FootMotion]]] = []

    def motion(frame: int) -> FootMotion:
        velocity = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        acceleration = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        return FootMotion(data.oMf[frame].copy(), velocity.vector.copy(), acceleration.vector.copy())

    for i in range(count):
        turning[i] = pin.computeCentroidalMomentumTimeVariation(model, data, q[i], v[i], a[i]).angular
        pin.centerOfMass(model, data, q[i], v[i], a[i])
        com[i], com_velocity[i], com_acceleration[i] = data.com[0], data.vcom[0], data.acom[0]
        pin.updateFramePlacements(model, data)
        moving.append(([motion(sole) for sole in soles], [motion(part) for part in parts]))
    pendulums = _pendulums(com, com_velocity, com_acceleration, turning / robot.mass, ground, dt)
    return q, tuple(
        Reference(
            pendulums[i],
            (left, right),
            tuple(standing[nearest[i]].tolist()),
            mean_heading(heading(left.placement.rotation), heading(right.placement.rotation)),
            body=WholeBody(
                com_acceleration[i],
                [(m.placement.rotation, m.velocity[3:], m.acceleration[3:]) for m in trunk],
                q[i, 7:],
                v[i, 6:],
                a[i, 6:],
            ),
        )
        for i, ((left, right), trunk) in enumerate(moving)
    )


def splines(robot: Robot, clip: MotionClip, dt: float) -> tuple[Array, Array, Array]:
    """Return configurations, velocities and accelerations of a clip at the ticks of a period, s."""
    frames = clip.configurations(robot)
    count = math.ceil(clip.duration / dt - 1e-9) + 1
    t = np.minimum(np.arange(count) * dt, clip.duration)
    columns = CubicSpline(clip.times, np.delete(frames, range(3, 7), axis=1), bc_type="clamped")
    turn = RotationSpline(clip.times, Rotation.from_quat(frames[:, 3:7]))
    rotation = turn(t)
    body = rotation.inv()
    rates, rate_changes = turn(t, 1), turn(t, 2)
    place, speed, change = columns(t), columns(t, 1), columns(t, 2)
    q = np.hstack([place[:, :3], rotation.as_quat(), place[:, 3:]])
    # The base's velocity is along its own axes; its spatial acceleration lacks the turn of the velocity.
    linear = body.apply(speed[:, :3])
    v = np.hstack([linear, rates, speed[:, 3:]])
    a = np.hstack([body.apply(change[:, :3]) - np.cross(rates, linear), rate_changes, change[:, 3:]])
    a[0], a[-1], v[0], v[-1] = 0.0, 0.0, 0.0, 0.0  # a clip begins and ends at rest
    return q, v, a


def _pendulums(
    com: Array, velocity: Array, acceleration: Array, turning: Array, ground: float, dt: float
) -> tuple[Pendulum, ...]:
    """Return the pendulum whose ZMP is that of the motion of all bodies."""
    lift = np.maximum(acceleration[:, 2] + GRAVITY, 0.2 * GRAVITY)[:, None]
    height = (com[:, 2] - ground)[:, None]
    moment = np.column_stack([turning[:, 1], -turning[:, 0]])
    zmp = com[:, :2] - (height * acceleration[:, :2] + moment) / lift
    zmp = gaussian_filter1d(zmp, ZMP_SMOOTHING / dt, axis=0, mode="nearest")
    zmp_velocity = np.gradient(zmp, dt, axis=0)
    asked = acceleration.copy()
    asked[:, :2] = lift * (com[:, :2] - zmp) / height
    omega = np.sqrt(GRAVITY / height[:, 0])
    level, still = np.full((len(zmp), 1), ground), np.zeros((len(zmp), 1))
    points, rates = np.hstack([zmp, level]), np.hstack([zmp_velocity, still])
    return tuple(
        Pendulum(com[i], velocity[i], asked[i], points[i], rates[i], float(omega[i])) for i in range(len(zmp))
    )


def placed(robot: Robot, clip: MotionClip, q: Array, soles: tuple[pin.SE3, pin.SE3]) -> MotionClip:
    """Return a clip moved over the ground and turned about the vertical so that its feet begin where soles are.

    `q` is the first configuration of the clip, shape (nq,).
    """
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    own = [data.oMf[robot.frame_id(sole.frame)] for sole in robot.soles[:2]]
    turn = mean_heading(*(heading(s.rotation) for s in soles)) - mean_heading(
        *(heading(s.rotation) for s in own)
    )
    rotation = pin.utils.rotate("z", turn)
    here = 0.5 * (soles[0].translation + soles[1].translation)
    there = 0.5 * (own[0].translation + own[1].translation)
    base = clip.base.copy()
    base[:, :3] = (base[:, :3] - there) @ rotation.T + here
    base[:, 3:] = (Rotation.from_matrix(rotation) * Rotation.from_quat(base[:, 3:])).as_quat()
    return MotionClip(clip.joint_names, clip.rate, base, clip.joints, clip.name, clip.standing)
