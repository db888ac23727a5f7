"""Measures of a motion: limits, speeds, torques, feet and ZMP, in the field's terms and units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.base.checked import checked
from wbc.base.hull import convex_hull
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import Positive, Ratio
from wbc.core.robot import BASE_DOF, Robot
from wbc.motion.clip import MotionClip
from wbc.motion.contacts import on_ground
from wbc.motion.kinematics import BodyMotion

SHARE_SLACK = 1.05
"""Ratio of speeds, torques and friction to what is allowed that still counts as feasible, as motions are sampled."""

ZMP_SLACK = 0.005
"""Distance of the ZMP outside its support that still counts as feasible, m."""


def supports_of(corners: Array, standing: Array) -> list[Array]:
    """Return the support area of each frame by its corners, counter-clockwise, each of shape (n, 2), m."""
    return [
        convex_hull(pair[stands, :, :2].reshape(-1, 2))
        for pair, stands in zip(corners, standing, strict=True)
    ]


def nearest_inside(areas: Sequence[Array], points: Array) -> Array:
    """Return the points of support areas that are nearest to given ones, both of shape (T, 2), m."""
    nearest = points.copy()
    for i, (corners, point) in enumerate(zip(areas, points, strict=True)):
        edges, away = np.roll(corners, -1, axis=0) - corners, point - corners
        if (edges[:, 0] * away[:, 1] < edges[:, 1] * away[:, 0]).any():  # on the right of an edge: outside
            along = (away * edges).sum(axis=1) / np.maximum((edges**2).sum(axis=1), 1e-18)
            on_edges = corners + np.clip(along, 0.0, 1.0)[:, None] * edges
            nearest[i] = on_edges[((on_edges - point) ** 2).sum(axis=1).argmin()]
    return nearest


@dataclass(frozen=True, slots=True, eq=False)
class MotionMeasures:
    """Measures of a motion.

    Attributes:
        joint_excess: Joint → greatest excess over its limits, rad, for joints over them.
        joint_speed: Joint → greatest share of its speed limit, for joints over the allowed share.
        joint_torque: Joint → greatest share of its torque limit, for joints outside the legs over the allowed share.
        slide_speed: Path of soles in contact over the time of contact, m/s.
        sole_depth: Greatest depth of a sole below the ground, m.
        zmp_outside: Greatest distance of the ZMP to the support, m.
        friction: Greatest coefficient of friction that the soles need for their horizontal forces and yaw moments.
        single_support: Share of the time on one foot.
        infeasible_frames: Frames that are too fast, need too much torque or friction, or have the ZMP outside, (T,).
    """

    joint_excess: dict[str, float]
    joint_speed: dict[str, float]
    joint_torque: dict[str, float]
    slide_speed: float
    sole_depth: float
    zmp_outside: float
    friction: float
    single_support: float
    infeasible_frames: Array

    def to_json(self) -> dict[str, Any]:
        """Return the measures as plain values, of the infeasible frames their share."""
        values = {name: getattr(self, name) for name in self.__slots__ if name != "infeasible_frames"}
        return values | {"infeasible_share": float(self.infeasible_frames.mean()), "feasible": self.feasible}

    @property
    def feasible(self) -> bool:
        """True if limits, speeds, torques, ZMP and friction are kept."""
        return not (self.joint_excess or self.infeasible_frames.any())


def measure(
    robot: Robot, motion: BodyMotion, stands: Array, *, share: float, friction: float
) -> MotionMeasures:
    """Measure a motion on a ground at z = 0, of which one sole stands at least in each frame, shape (T, 2)."""
    joints = motion.q[:, 7:]
    excess = np.maximum(joints - robot.position_upper, robot.position_lower - joints).max(axis=0)
    speed, torque = abs(motion.v[:, BASE_DOF:]) / robot.velocity_limit, motion.torque_share(robot)
    allowed = SHARE_SLACK * share
    zmp = motion.zmp()
    outside = np.linalg.norm(nearest_inside(supports_of(motion.corners, stands), zmp) - zmp, axis=1)
    needed = motion.friction(robot, stands)
    both = np.logical_and(stands[1:], stands[:-1])
    path = np.linalg.norm(np.diff(motion.centres[..., :2], axis=0), axis=-1)
    return MotionMeasures(
        joint_excess=by_joint(robot, excess),
        joint_speed=by_joint(robot, speed.max(axis=0), allowed),
        joint_torque=by_joint(robot, torque.max(axis=0), allowed),
        slide_speed=float(path[both].sum()) / max(float(both.sum()) / motion.rate, ROUNDING),
        sole_depth=max(0.0, -float(motion.corners[..., 2].min())),
        zmp_outside=float(outside.max()),
        friction=float(needed.max()),
        single_support=float((stands.sum(axis=1) == 1).mean()),
        infeasible_frames=(np.maximum(speed, torque) > allowed).any(axis=1)
        | (outside > ZMP_SLACK)
        | (needed > SHARE_SLACK * friction),
    )


def by_joint(robot: Robot, values: Array, bound: float = 1e-6) -> dict[str, float]:
    """Return the values of all joints, shape (na,), that exceed a bound, by the names of the joints."""
    return {name: float(v) for name, v in zip(robot.joint_names, values, strict=True) if v > bound}


@checked
def check_motion(
    robot: Robot,
    clip: MotionClip,
    *,
    share: Ratio = 1.0,
    friction: Positive = 0.7,
) -> MotionMeasures:
    """Measure the feasibility of a clip without a change of the clip.

    Args:
        robot: The robot; its state is not changed.
        clip: Clip of its joints.
        share: Allowed share of the limits of joint speeds, and of torques of joints outside the legs.
        friction: Allowed coefficient of friction.

    Raises:
        InputError: The robot leaves the ground; the message has the time.
    """
    return measure(robot, *on_ground(robot, clip), share=share, friction=friction)
