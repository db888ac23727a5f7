"""Motions made by rule for any robot: arms, waist, squats, poses on one leg, steps; for tests and as examples.

They are kinematic, as motion capture is: `wbc.motion.make_feasible` decides on balance.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from wbc.core.arguments import checked
from wbc.core.errors import Array
from wbc.core.registry import Registry
from wbc.core.robot import Robot
from wbc.core.settings import Seed
from wbc.motion.clip import MotionClip
from wbc.motion.inverse_kinematics import InverseKinematics, KinematicTargets
from wbc.tasks.trajectories import minimum_jerk

RATE = 100.0
"""Frames per second, Hz."""

HANDS = ("left_hand", "right_hand")

LIMIT_MARGIN = 0.06
"""Distance of a generated motion to the joint limits, rad."""

Generator = Callable[[Robot, np.random.Generator], Array]


@checked
def make_motion(robot: Robot, name: str, seed: Seed = 0) -> MotionClip:
    """Make a motion.

    Args:
        robot: The robot; it stands with its soles on z = 0 at the start.
        name: One of `MOTIONS`.
        seed: Fixes every random draw.

    Raises:
        UnknownNameError: No such motion.
    """
    make = MOTIONS[name]
    return MotionClip.of(robot, make(robot, np.random.default_rng(seed)), RATE, f"{name} {seed}")


def _arms(robot: Robot, rng: np.random.Generator, amplitude: float = 0.5, frequency: float = 0.5) -> Array:
    """Both arms on sums of two sines for six seconds."""
    t, q = _rest(robot, 6.0)
    for hand in HANDS:
        for joint in _arm(robot, hand):
            _sway(
                robot, q, t, joint, amplitude * rng.uniform(0.5, 1.0), frequency * rng.uniform(0.7, 1.3), rng
            )
    return q


def _dance(robot: Robot, rng: np.random.Generator) -> Array:
    """Arms of 0.8 rad at 1.5 Hz."""
    t, q = _rest(robot, 6.0)
    for hand in HANDS:
        for joint in _arm(robot, hand):
            _sway(robot, q, t, joint, 0.8, 1.5, rng)
    return q


def _waist(robot: Robot, rng: np.random.Generator) -> Array:
    """Every joint of the waist, and the arms a little."""
    t, q = _rest(robot, 6.0)
    for joint in robot.joints_between(robot.torso_frame, robot.base_frame):
        _sway(robot, q, t, joint, rng.uniform(0.15, 0.35), rng.uniform(0.25, 0.5), rng)
    for hand in HANDS:
        for joint in _arm(robot, hand):
            _sway(robot, q, t, joint, 0.2, rng.uniform(0.3, 0.6), rng)
    return q


def _squat(robot: Robot, rng: np.random.Generator) -> Array:
    """Two squats of random depth, with the arms held forward."""
    t, q = _rest(robot, 6.0)
    depth = rng.uniform(0.08, 0.16) * float(robot.com[2])
    q[:, 2] -= depth * 0.5 * (1.0 - np.cos(2.0 * np.pi * t / 3.0))
    for hand in HANDS:
        _sway(robot, q, t, _arm(robot, hand)[0], 0.3, 1.0 / 3.0, rng)
    return _solve(robot, q, _stands(robot, q), np.ones((len(q), 2)))


def _one_leg(robot: Robot, rng: np.random.Generator) -> Array:
    """A shift over one foot, the other one lifted and held for two seconds, and back; the arms move meanwhile."""
    t, q = _rest(robot, 9.0)
    side = int(rng.integers(2))
    soles = _stands(robot, q)
    shift = _bump(t, 0.0, 2.0, 7.0, 9.0)
    q[:, :2] += (
        shift[:, None]
        * (soles[0][side].translation - 0.5 * (soles[0][0].translation + soles[0][1].translation))[:2]
    )
    lift = rng.uniform(0.06, 0.1) * _bump(t, 2.5, 3.5, 5.5, 6.5)
    forward = rng.uniform(-0.06, 0.1) * _bump(t, 2.5, 3.5, 5.5, 6.5)
    moved = []
    for pair, up, ahead in zip(soles, lift, forward, strict=True):
        raised = pin.SE3(pair[1 - side].rotation, pair[1 - side].translation + [ahead, 0.0, up])
        moved.append((pair[0], raised) if side == 0 else (raised, pair[1]))
    for hand in HANDS:
        for joint in _arm(robot, hand):
            _sway(robot, q, t, joint, 0.25, rng.uniform(0.2, 0.4), rng)
    standing = np.ones((len(q), 2))
    standing[:, 1 - side] = lift <= 0.0
    return _solve(robot, q, moved, standing)


def _steps(robot: Robot, rng: np.random.Generator) -> Array:
    """Four steps forward of random length, feet together at the end."""
    single, double, lead = 0.8, 0.6, 1.0
    length = rng.uniform(0.03, 0.08)
    t, q = _rest(robot, 2.0 * lead + 4.0 * (single + double))
    start = _stands(robot, q)[0]
    places = np.array([start[0].translation, start[1].translation])
    path, standing = np.repeat(places[None], len(t), axis=0), np.ones((len(t), 2))
    pelvis = np.tile(places.mean(axis=0)[:2], (len(t), 1))
    offset = q[0, :2] - pelvis[0]
    knots, supports = [0.0], [places.mean(axis=0)[:2]]
    for step in range(4):
        side = step % 2
        begin = lead + step * (single + double) + double
        target = places[side, 0] + (length if step in (0, 3) else 2.0 * length)
        s = np.clip((t - begin) / single, 0.0, 1.0)
        path[:, side, 0] = np.where(
            t < begin, path[:, side, 0], places[side, 0] + (target - places[side, 0]) * minimum_jerk(s)[0]
        )
        path[:, side, 2] += 0.05 * np.sin(np.pi * s) ** 2
        standing[(s > 0.0) & (s < 1.0), side] = 0.0
        knots += [begin, begin + single]
        supports += [places[1 - side, :2].copy()] * 2
        places[side, 0] = target
    knots.append(float(t[-1]) - 0.3)
    supports.append(places.mean(axis=0)[:2])
    for axis in (0, 1):
        pelvis[:, axis] = np.interp(t, knots, np.array(supports)[:, axis])
    width = round(0.3 * RATE)
    kernel = np.hanning(2 * width + 1)
    kernel /= kernel.sum()
    padded = np.vstack([np.repeat(pelvis[:1], width, 0), pelvis, np.repeat(pelvis[-1:], width, 0)])
    for axis in (0, 1):
        q[:, axis] = np.convolve(padded[:, axis], kernel, mode="valid") + offset[axis]
    q[:, 2] -= 0.01
    soles = [(pin.SE3(start[0].rotation, left), pin.SE3(start[1].rotation, right)) for left, right in path]
    for hand in HANDS:
        _sway(robot, q, t, _arm(robot, hand)[0], 0.15, 1.0 / (2.0 * (single + double)), rng)
    return _solve(robot, q, soles, standing)


def _rest(robot: Robot, duration: float) -> tuple[Array, Array]:
    """Return times and half-sitting at each of them."""
    t = np.arange(round(duration * RATE) + 1) / RATE
    return t, np.tile(robot.half_sitting, (len(t), 1))


def _arm(robot: Robot, hand: str) -> list[int]:
    """Return the first four joints of an arm: shoulder and elbow."""
    frame = robot.frames.get(hand)
    return [] if frame is None else robot.joints_between(frame, robot.torso_frame)[:4]


def _sway(
    robot: Robot, q: Array, t: Array, joint: int, amplitude: float, frequency: float, rng: np.random.Generator
) -> None:
    """Add a sine to a joint, within its limits, from rest and back to it."""
    lower, upper = robot.position_lower[joint] + LIMIT_MARGIN, robot.position_upper[joint] - LIMIT_MARGIN
    centre = float(q[0, 7 + joint])
    up, down = min(amplitude, upper - centre), min(amplitude, centre - lower)
    reach, middle = max(0.0, 0.5 * (up + down)), 0.5 * (up - down)
    phase = rng.uniform(0.0, 2.0 * np.pi)
    fade = _bump(t, 0.0, 0.8, t[-1] - 0.8, t[-1])
    q[:, 7 + joint] += fade * (middle + reach * np.sin(2.0 * np.pi * frequency * t + phase))


def _bump(t: Array, rise: float, high: float, fall: float, low: float) -> Array:
    """Return 0 before `rise`, 1 from `high` to `fall`, 0 after `low`, with smooth slopes."""
    up, down = (t - rise) / (high - rise), (low - t) / (low - fall)
    return minimum_jerk(np.clip(up, 0.0, 1.0))[0] * minimum_jerk(np.clip(down, 0.0, 1.0))[0]


def _stands(robot: Robot, q: Array) -> list[tuple[pin.SE3, pin.SE3]]:
    """Return the soles of half-sitting for every frame."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.half_sitting)
    left, right = (data.oMf[robot.frame_id(sole.frame)].copy() for sole in robot.soles[:2])
    return [(left, right)] * len(q)


def _solve(robot: Robot, q: Array, soles: list[tuple[pin.SE3, pin.SE3]], standing: Array) -> Array:
    """Return configurations with the soles where they should be and the base near where it is."""
    data = robot.model.createData()
    com = np.array([pin.centerOfMass(robot.model, data, each).copy() for each in q])
    return InverseKinematics(robot, LIMIT_MARGIN).solve(KinematicTargets(q, soles, standing, com))


MOTIONS: Registry[Generator] = Registry(
    "motion",
    {"arms": _arms, "dance": _dance, "waist": _waist, "squat": _squat, "one_leg": _one_leg, "steps": _steps},
)
"""Name → motion of a robot, drawn at random: configurations, shape (T, nq)."""
