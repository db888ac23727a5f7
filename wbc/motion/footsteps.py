"""Footsteps of a clip: one flat place for each contact, within reach of the other foot, and the paths in between."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.core.robot import Robot
from wbc.motion.contacts import runs
from wbc.motion.kinematics import BodyMotion, sole_corners
from wbc.walking.planning.footsteps import heading
from wbc.walking.planning.reach import STANDING, Reach, leg_geometry

CLEARANCE = 0.01
"""Least height of a foot's lowest corner in the air, m."""

SETTLE = 0.06
"""Time in which a foot rises to the clearance, and comes down from it, above its place, s."""


@dataclass(slots=True, eq=False)
class _Stance:
    """One contact: first frame, the one after the last, the given place, and the place that is within reach."""

    first: int
    last: int
    given: pin.SE3
    place: pin.SE3

    @classmethod
    def of(cls, motion: BodyMotion, side: int, first: int, last: int) -> _Stance:
        """Return a contact of a sole at its median place, flat on the ground."""
        x, y, _ = np.median(motion.sole_positions[first:last, side], axis=0)
        yaw = np.median(
            np.unwrap([heading(rotation) for rotation in motion.sole_rotations[first:last, side]])
        )
        place = pin.SE3(pin.utils.rotate("z", float(yaw)), np.array([x, y, 0.0]))
        return cls(first, last, place, place)

    @property
    def moved(self) -> bool:
        """True if the given place is not within reach."""
        return self.place is not self.given

    @property
    def move(self) -> pin.SE3:
        """Motion over the ground from the given place."""
        return self.place * self.given.inverse()


def footsteps(
    robot: Robot, motion: BodyMotion, standing: Array, blend: float
) -> tuple[list[tuple[pin.SE3, pin.SE3]], list[pin.SE3] | None, float]:
    """Return the footsteps of a clip on a ground at z = 0.

    A step that is longer, wider or turned further than the walk's planner allows at the height of the clip is brought
    within its reach; those after it keep their places relative to the other foot.

    Args:
        robot: The robot.
        motion: The motion.
        standing: True where a sole stands, shape (T, 2).
        blend: Time in which a foot leaves and reaches its place, s.

    Returns:
        Left and right sole in each frame; the motion over the ground in each frame that takes the given body to where
        the soles are, None where all steps are within reach; and the greatest distance by which a step was moved, m.
    """
    stances = [[_Stance.of(motion, side, *frames) for frames in runs(standing[:, side])] for side in (0, 1)]
    shortened = _bring_within_reach(stances, _reach(robot, motion, standing))
    paths, moves = zip(
        *(_path(motion, side, stances[side], sole_corners(robot)[side], blend) for side in (0, 1)),
        strict=True,
    )
    body = None
    if any(stance.moved for side in stances for stance in side):
        body = [pin.SE3.Interpolate(left, right, 0.5) for left, right in zip(*moves, strict=True)]
    return list(zip(*paths, strict=True)), body, shortened


def _reach(robot: Robot, motion: BodyMotion, standing: Array) -> Reach:
    """Return the reach at the height of the clip on one foot; to the side that of half-sitting, as in a walk."""
    widest = Reach.of(robot)
    alone = standing.sum(axis=1) == 1
    if not alone.any():
        return widest
    leg = leg_geometry(robot)
    to_com = leg.com_height - leg.hip_height
    hips = float(np.median(motion.com[alone, 2])) - to_com
    hips = min(max(hips, leg.shortest + 1e-6), STANDING * leg.length - 1e-6)  # inside of what a leg spans
    return replace(Reach.of(robot, hips + to_com), max_spacing=widest.max_spacing)


def _bring_within_reach(stances: list[list[_Stance]], reach: Reach) -> float:
    """Move the places of contacts, in their order, and return the greatest distance between old and new steps, m."""
    order = sorted(
        ((stance, side) for side in (0, 1) for stance in stances[side]), key=lambda pair: pair[0].first
    )
    last: list[_Stance | None] = [None, None]
    most = 0.0
    for stance, side in order:
        other = last[1 - side]
        if other is not None:
            step = other.given.actInv(stance.given)
            outward = 1.0 if side == 0 else -1.0
            x = float(np.clip(step.translation[0], -reach.max_length, reach.max_length))
            y = outward * float(np.clip(outward * step.translation[1], reach.min_spacing, reach.max_spacing))
            turn = outward * heading(step.rotation)
            turn = outward * float(np.clip(turn, -0.5 * reach.max_yaw, reach.max_yaw))
            allowed = pin.SE3(pin.utils.rotate("z", turn), np.array([x, y, step.translation[2]]))
            if other.moved or not allowed.isApprox(step, 1e-9):
                most = max(most, float(np.linalg.norm(allowed.translation - step.translation)))
                stance.place = other.place * allowed
        last[side] = stance
    return most


def _path(
    motion: BodyMotion, side: int, stances: list[_Stance], corners: Array, blend: float
) -> tuple[list[pin.SE3], list[pin.SE3]]:
    """Return placements of a sole, and the motions over the ground that they contain.

    In the air the given path is moved to fit both ends. The foot leaves and reaches its place from above, flat, and
    clears the ground in between with all corners: recorded feet are rolled over toes and heels, and shuffle.
    """
    count, ramp, settle = (
        len(motion.q),
        max(1, round(blend * motion.rate)),
        max(1, round(SETTLE * motion.rate)),
    )
    given = motion.soles(side)
    path, moves = list(given), [pin.SE3.Identity()] * count
    for stance in stances:
        path[stance.first : stance.last] = [stance.place] * (stance.last - stance.first)
        moves[stance.first : stance.last] = [stance.move] * (stance.last - stance.first)
    for before, after in zip([None, *stances], [*stances, None], strict=True):
        first = 0 if before is None else before.last
        last = count if after is None else after.first
        leave = None if before is None else before.place * given[min(first, count - 1)].inverse()
        reach = None if after is None else after.place * given[last].inverse()
        for i in range(first, last):
            share = _smoothstep((i - first + 1) / (last - first + 1))
            moved = _between(leave, reach, share) * given[i]
            moves[i] = _between(before and before.move, after and after.move, share)
            height, clearance = float(moved.translation[2]), CLEARANCE
            for end, distance in ((before, i - first + 1), (after, last - i)):
                if end is not None and distance < settle + ramp:
                    level = _smoothstep(max(0, distance - settle) / ramp)
                    moved = pin.SE3.Interpolate(end.place, moved, level)
                    height *= _smoothstep(min(1.0, distance / ramp))
                    clearance = min(clearance, CLEARANCE * _smoothstep(min(1.0, distance / settle)))
            lowest = height + float((corners @ moved.rotation[2]).min())
            moved.translation[2] = height + max(0.0, clearance - lowest)
            path[i] = moved
    return path, moves


def _between(one: pin.SE3 | None, other: pin.SE3 | None, share: float) -> pin.SE3:
    if one is None or other is None:
        found = one if other is None else other
        return pin.SE3.Identity() if found is None else found
    return pin.SE3.Interpolate(one, other, share)


def _smoothstep(x: float) -> float:
    return 3.0 * x**2 - 2.0 * x**3
