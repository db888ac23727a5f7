"""Measures of a motion: limits, speeds, torques, feet and ZMP, in the field's terms and units.

Foot slide is the path of a sole in contact per second of contact; penetration and float are depths of soles that
should stand; the ZMP is outside by the distance to the support times the time it is there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from wbc.core.arguments import checked
from wbc.core.errors import Array
from wbc.core.robot import BASE_DOF, Robot
from wbc.motion.clip import MotionClip
from wbc.motion.contacts import find_contacts
from wbc.motion.kinematics import BodyMotion, sole_corners

FLOATS = 0.02
"""A sole in contact floats if its lowest corner is this high, m."""

SHARE_SLACK, ZMP_SLACK = 1.05, 0.005
"""Excess that still counts as feasible, as motions are sampled: of speeds, torques and friction, and of the ZMP, m."""


class Support:
    """Convex support area of one frame."""

    def __init__(self, points: Array) -> None:
        """Take the hull of points, corners of the soles that stand, shape (n, 2), m."""
        try:
            hull = ConvexHull(points)
        except QhullError:  # soles on one line: no area
            self.normals, self.offsets = np.zeros((0, 2)), np.zeros(0)
            return
        self.normals = hull.equations[:, :2]
        self.offsets = -hull.equations[:, 2]

    def outside(self, point: Array) -> float:
        """Return the distance of a point to the area's edge, m; negative inside."""
        return float((self.normals @ point - self.offsets).max()) if len(self.offsets) else 0.0

    def project(self, point: Array) -> Array:
        """Return the nearest point of the area, shape (2,), m."""
        point = np.array(point, dtype=float)
        correction = np.zeros((len(self.offsets), 2))  # of Dykstra's alternating projections
        for _ in range(50):
            worst = 0.0
            for i, (normal, offset) in enumerate(zip(self.normals, self.offsets, strict=True)):
                before = point + correction[i]
                excess = max(0.0, float(normal @ before - offset))
                point = before - excess * normal
                worst = max(worst, float(abs(before - point - correction[i]).max()))
                correction[i] = before - point
            if worst < 1e-7:
                break
        return point


def supports_of(
    robot: Robot,
    soles: Sequence[Sequence[pin.SE3]],
    standing: Array,
    share: float = 1.0,
    least_load: Array | None = None,
) -> list[Support]:
    """Return the support area of each frame (T pairs of soles, which stand); areas of equal soles are shared.

    Of length and width of each sole a `share` about its centre counts. `least_load`, the least share of the load of
    each of two soles that stand, shape (T,), moves the areas of both towards the middle between them; zero when None.
    """
    least = np.zeros(len(soles)) if least_load is None else least_load
    corners = [share * offsets for offsets in sole_corners(robot)]
    made: dict[bytes, Support] = {}
    areas: list[Support] = []
    for pair, stands, load in zip(soles, standing, least, strict=True):
        inward = (load if stands.all() else 0.0) * (pair[1].translation - pair[0].translation)
        points = np.vstack(
            [
                (corners[side] @ sole.rotation.T + sole.translation + (inward, -inward)[side])[:, :2]
                for side, sole in enumerate(pair)
                if stands[side] or not stands.any()
            ]
        )
        key = points.round(9).tobytes()
        if key not in made:
            made[key] = Support(points)
        areas.append(made[key])
    return areas


@dataclass(frozen=True, slots=True, eq=False)
class MotionMeasures:
    """Measures of a motion.

    Attributes:
        duration: s.
        joint_excess: Joint → greatest excess over its limits, rad, for joints over them.
        joint_speed: Joint → greatest share of its speed limit, for joints over the allowed share.
        joint_torque: Joint → greatest share of its torque limit, for joints outside the legs over the allowed share.
        foot_slide: Path of soles in contact, mm per second of contact.
        penetration: Greatest depth of a sole below the ground, mm.
        floating: Share of contact frames in which the sole is 20 mm over the ground.
        zmp_outside: Distance of the ZMP to the support, integrated, mm·s.
        zmp_worst: Greatest distance, mm.
        friction: Greatest coefficient of friction that the soles need for their horizontal forces and yaw moments.
        single_support: Share of the time on one foot.
        infeasible_frames: Frames that are too fast, need too much torque or friction, or have the ZMP outside, (T,).
    """

    duration: float
    joint_excess: dict[str, float]
    joint_speed: dict[str, float]
    joint_torque: dict[str, float]
    foot_slide: float
    penetration: float
    floating: float
    zmp_outside: float
    zmp_worst: float
    friction: float
    single_support: float
    infeasible_frames: Array

    def to_json(self) -> dict[str, Any]:
        """Return the measures as plain values, frames as the times between which they lie."""
        values = {name: getattr(self, name) for name in self.__slots__ if name != "infeasible_frames"}
        return values | {"infeasible_share": float(self.infeasible_frames.mean()), "feasible": self.feasible}

    @property
    def feasible(self) -> bool:
        """True if limits, speeds, torques, ZMP and friction are kept."""
        return not (self.joint_excess or self.infeasible_frames.any())


def measure(
    robot: Robot, motion: BodyMotion, ground: float, stands: Array, share: float, friction: float
) -> MotionMeasures:
    """Measure a motion on a ground at a height, m, of which one sole stands at least in each frame, shape (T, 2).

    Allowed are a share of the limits of joint speeds and torques, and a coefficient of friction.
    """
    joints = motion.q[:, 7:]
    excess = np.maximum(joints - robot.position_upper, robot.position_lower - joints).max(axis=0)
    speed, torque = abs(motion.v[:, BASE_DOF:]) / robot.velocity_limit, motion.torque_share(robot)
    allowed = SHARE_SLACK * share
    areas = supports_of(robot, list(zip(motion.soles(0), motion.soles(1), strict=True)), stands)
    zmp = motion.zmp(ground)
    outside = np.array([area.outside(point) for area, point in zip(areas, zmp, strict=True)])
    needed = motion.friction(robot, stands, ground)
    both = np.logical_and(stands[1:], stands[:-1])
    path = np.linalg.norm(np.diff(motion.sole_positions[..., :2], axis=0), axis=-1)
    lowest = motion.corners[..., 2].min(axis=2) - ground
    return MotionMeasures(
        duration=(len(motion.q) - 1) / motion.rate,
        joint_excess=by_joint(robot, excess),
        joint_speed=by_joint(robot, speed.max(axis=0), allowed),
        joint_torque=by_joint(robot, torque.max(axis=0), allowed),
        foot_slide=1e3 * float(path[both].sum()) / max(float(both.sum()) / motion.rate, 1e-9),
        penetration=1e3 * max(0.0, -float(lowest.min())),
        floating=float((lowest[stands] > FLOATS).mean()) if stands.any() else 0.0,
        zmp_outside=1e3 * float(np.maximum(outside, 0.0).sum()) / motion.rate,
        zmp_worst=1e3 * max(0.0, float(outside.max())),
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
    share: float = 1.0,
    friction: float = 0.7,
) -> MotionMeasures:
    """Measure a clip as it is.

    Args:
        robot: The robot; its state is not changed.
        clip: Clip of its joints.
        share: Allowed share of the limits of joint speeds and torques.
        friction: Allowed coefficient of friction.

    Raises:
        UnknownNameError: The clip is of another robot.
        InputError: The robot leaves the ground; the time at which it does is named.
    """
    motion = BodyMotion.of(robot, clip.configurations(robot), clip.rate)
    return measure(robot, motion, *find_contacts(motion, clip.standing), share, friction)
