"""Motions made by rule for any robot: arms, waist, squats, poses on one leg, steps.

They are kinematic, as motion capture is: `wbc.motion.make_feasible` decides on balance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin
from scipy.ndimage import convolve1d

from wbc.base.numbers import Array
from wbc.core.robot import Robot
from wbc.core.trajectories import minimum_jerk
from wbc.motion.clip import MotionClip
from wbc.motion.inverse_kinematics import inverse_kinematics
from wbc.motion.kinematics import BodyMotion

RATE = 100.0
"""Frames per second, Hz."""

LIMIT_MARGIN = 0.06
"""Distance of a generated motion to the joint limits, rad."""

Generator = Callable[[Robot, np.random.Generator], Array]

Range = tuple[float, float]
"""Range from which a number is drawn."""


def make_motion(robot: Robot, name: str, seed: int = 0) -> MotionClip:
    """Make a motion.

    Args:
        robot: The robot; it stands with its soles on z = 0 at the start.
        name: One of `MOTIONS`.
        seed: Fixes every random draw.
    """
    make = MOTIONS[name]
    return MotionClip.of(robot, make(robot, np.random.default_rng(seed)), RATE, f"{name} {seed}")


def _swayed(*parts: tuple[Callable[[Robot], list[int]], float | Range, float | Range]) -> Generator:
    """Return a motion of six seconds in which each joint of some parts sways: parts, amplitude, rad, frequency, Hz."""

    def make(robot: Robot, rng: np.random.Generator) -> Array:
        q, *_ = _rest(robot, 6.0)
        for joints, amplitude, frequency in parts:
            _sway(robot, q, joints(robot), amplitude, frequency, rng)
        return q

    return make


def _squat(robot: Robot, rng: np.random.Generator) -> Array:
    """Two squats of random depth, with the arms held forward."""
    q, t, path = _rest(robot, 6.0)
    depth = rng.uniform(0.08, 0.16) * float(robot.com[2])
    q[:, 2] -= depth * 0.5 * (1.0 - np.cos(math.tau * t / 3.0))
    _sway(robot, q, _arm_joints(robot, 1), 0.3, 1.0 / 3.0, rng)
    return _solve(robot, q, path)


def _one_leg(robot: Robot, rng: np.random.Generator) -> Array:
    """A shift over one foot, the other one lifted and held for two seconds, and back; the arms move meanwhile."""
    q, t, path = _rest(robot, 9.0)
    stance = int(rng.integers(2))
    q[:, :2] += _bump(t, 0.0, 2.0, 7.0, 9.0)[:, None] * (path[0, stance] - path[0].mean(axis=0))[:2]
    lift = _bump(t, 2.5, 3.5, 5.5, 6.5)
    path[:, 1 - stance, 2] += rng.uniform(0.06, 0.1) * lift
    path[:, 1 - stance, 0] += rng.uniform(-0.06, 0.1) * lift
    _sway(robot, q, _arm_joints(robot), 0.25, (0.2, 0.4), rng)
    return _solve(robot, q, path)


def _steps(robot: Robot, rng: np.random.Generator) -> Array:
    """Four steps forward of random length, feet together at the end."""
    single, double, lead = 0.8, 0.6, 1.0
    length = rng.uniform(0.03, 0.08)
    q, t, path = _rest(robot, 2.0 * lead + 4.0 * (single + double))
    places = path[0].copy()
    middle = places.mean(axis=0)[:2]
    knots, supports = [0.0], [middle]
    for step in range(4):
        side = step % 2
        begin = lead + step * (single + double) + double
        way = length if step in (0, 3) else 2.0 * length
        s = np.clip((t - begin) / single, 0.0, 1.0)
        path[:, side, 0] += way * minimum_jerk(s)[0]
        path[:, side, 2] += 0.05 * np.sin(np.pi * s) ** 2
        places[side, 0] += way
        knots += [begin, begin + single]
        supports += [places[1 - side, :2].copy()] * 2
    knots.append(float(t[-1]) - 0.3)
    supports.append(places.mean(axis=0)[:2])
    kernel = np.hanning(2 * round(0.3 * RATE) + 1)
    over = np.column_stack([np.interp(t, knots, place) for place in np.array(supports).T])
    q[:, :2] += convolve1d(over, kernel / kernel.sum(), axis=0, mode="nearest") - middle
    q[:, 2] -= 0.01
    _sway(robot, q, _arm_joints(robot, 1), 0.15, 1.0 / (2.0 * (single + double)), rng)
    return _solve(robot, q, path)


def _rest(robot: Robot, duration: float) -> tuple[Array, Array, Array]:
    """Return half-sitting in every frame, the times, s, and the places of both soles, shape (T, 2, 3), m."""
    t = np.arange(round(duration * RATE) + 1) / RATE
    q = np.tile(robot.half_sitting, (len(t), 1))
    return q, t, np.repeat(BodyMotion.of(robot, q[:2], RATE).centres[:1], len(t), axis=0)


def _arm_joints(robot: Robot, count: int = 4) -> list[int]:
    """Return the first joints of both arms: four are shoulder and elbow."""
    hands = [robot.frames[hand] for hand in ("left_hand", "right_hand") if hand in robot.frames]
    return [joint for hand in hands for joint in robot.joints_between(hand, robot.torso_frame)[:count]]


def _waist_joints(robot: Robot) -> list[int]:
    return robot.joints_between(robot.torso_frame, robot.base_frame)


def _sway(
    robot: Robot,
    q: Array,
    joints: Sequence[int],
    amplitude: float | Range,
    frequency: float | Range,
    rng: np.random.Generator,
) -> None:
    """Add a sine to each of some joints, within its limits, from rest and back to it; rad and Hz."""
    t = np.arange(len(q)) / RATE
    fade = _bump(t, 0.0, 0.8, t[-1] - 0.8, t[-1])
    for joint in joints:
        most, rate = (rng.uniform(*v) if isinstance(v, tuple) else v for v in (amplitude, frequency))
        lower, upper = robot.position_lower[joint] + LIMIT_MARGIN, robot.position_upper[joint] - LIMIT_MARGIN
        centre = float(q[0, 7 + joint])
        up, down = min(most, upper - centre), min(most, centre - lower)
        reach, middle = max(0.0, 0.5 * (up + down)), 0.5 * (up - down)
        phase = rng.uniform(0.0, math.tau)
        q[:, 7 + joint] += fade * (middle + reach * np.sin(math.tau * rate * t + phase))


def _bump(t: Array, rise: float, high: float, fall: float, low: float) -> Array:
    """Return 0 before `rise`, 1 from `high` to `fall`, 0 after `low`, with smooth slopes."""
    up, down = (t - rise) / (high - rise), (low - t) / (low - fall)
    return minimum_jerk(np.clip(up, 0.0, 1.0))[0] * minimum_jerk(np.clip(down, 0.0, 1.0))[0]


def _solve(robot: Robot, q: Array, path: Array) -> Array:
    """Return configurations with the soles, turned as in half-sitting, on a path and the base near where it is."""
    turns = [sole.rotation for sole in BodyMotion.of(robot, _rest(robot, 1.0 / RATE)[0], RATE).soles[0]]
    soles = [(pin.SE3(turns[0], left), pin.SE3(turns[1], right)) for left, right in path]
    com, standing = BodyMotion.of(robot, q, RATE).com, (path[..., 2] <= path[0, :, 2]).astype(float)
    return inverse_kinematics(robot, LIMIT_MARGIN, q, soles, standing, com)


MOTIONS: dict[str, Generator] = {
    "arms": _swayed((_arm_joints, (0.25, 0.5), (0.35, 0.65))),
    "dance": _swayed((_arm_joints, 0.8, 1.5)),
    "waist": _swayed((_waist_joints, (0.15, 0.35), (0.25, 0.5)), (_arm_joints, 0.2, (0.3, 0.6))),
    "squat": _squat,
    "one_leg": _one_leg,
    "steps": _steps,
}
"""Name → motion of a robot, drawn at random: configurations, shape (T, nq)."""
