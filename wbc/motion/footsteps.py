"""Footsteps of a clip: one flat place for each contact, within reach of the other foot, and the paths in between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.frames import heading
from wbc.core.robot import Robot
from wbc.core.trajectories import ValueT
from wbc.motion.contacts import runs
from wbc.motion.kinematics import Soles, corners_of
from wbc.walking.plans.leg import STANDING, Leg
from wbc.walking.plans.reach import Reach

CLEARANCE = 0.01
"""Least height of a foot's lowest corner in the air, m."""

SETTLE = 0.06
"""Time in which a foot rises to the clearance above its place, and comes down from it, s."""

BLEND = 0.1
"""Time in which a foot goes over from there to its path, s."""


@dataclass(slots=True, eq=False)
class _Stance:
    """One contact: first frame, the one after the last, the given place, and how it is moved to be within reach."""

    first: int
    last: int
    given: pin.SE3
    move: pin.SE3

    @property
    def place(self) -> pin.SE3:
        """Place that is within reach."""
        return self.move * self.given


def footsteps(
    robot: Robot, soles: Sequence[Soles], com_height: Array, rate: float, standing: Array
) -> tuple[list[Soles], list[pin.SE3], float]:
    """Return the footsteps of a clip on a ground at z = 0; `standing` (T, 2) is true where a sole stands.

    Given are the placements of left and right sole in each frame, T pairs, the height of the CoM, shape (T,), m, and
    the frames per second, Hz.

    A step that is longer, wider or turned further than the walk's planner allows at the height of the clip is brought
    within its reach; those after it keep their places relative to the other foot. Returned are left and right sole in
    each frame, the motion over the ground that takes the given body to where the soles are, and the greatest distance
    by which a step was moved, m.
    """
    given = [[pair[side] for pair in soles] for side in (0, 1)]
    stances = [[_stance(given[side], *frames) for frames in runs(standing[:, side])] for side in (0, 1)]
    shortened = _bring_within_reach(stances, _reach(robot, com_height, standing))
    corners = corners_of(robot, [(pin.SE3.Identity(), pin.SE3.Identity())])[0]
    paths, moves = zip(
        *(_path(given[side], rate, stances[side], corners[side]) for side in (0, 1)), strict=True
    )
    body = [pin.SE3.Interpolate(left, right, 0.5) for left, right in zip(*moves, strict=True)]
    return list(zip(*paths, strict=True)), body, shortened


def _stance(given: Sequence[pin.SE3], first: int, last: int) -> _Stance:
    """Return a contact of a sole at its median place, flat on the ground."""
    soles = given[first:last]
    x, y, _ = np.median([sole.translation for sole in soles], axis=0)
    yaw = np.median(np.unwrap([heading(sole.rotation) for sole in soles]))
    place = pin.SE3(pin.utils.rotate("z", float(yaw)), np.array([x, y, 0.0]))
    return _Stance(first, last, place, pin.SE3.Identity())


def _reach(robot: Robot, com_height: Array, standing: Array) -> Reach:
    """Return the reach at the height of the clip on one foot; to the side that of half-sitting, as in a walk."""
    widest = Reach.of(robot)
    alone = standing.sum(axis=1) == 1
    if not alone.any():
        return widest
    leg = Leg(robot)
    to_com = leg.com_height - leg.hip_height
    hips = float(np.median(com_height[alone])) - to_com
    hips = min(max(hips, leg.shortest + 1e-6), STANDING * leg.length - 1e-6)  # inside of what a leg spans
    return replace(Reach.of(robot, hips + to_com), max_spacing=widest.max_spacing)


def _bring_within_reach(stances: list[list[_Stance]], reach: Reach) -> float:
    """Move contacts, in their order, and return the greatest distance between old and new steps, m."""
    order = [(stance, side) for side in (0, 1) for stance in stances[side]]
    last: list[_Stance | None] = [None, None]
    most = 0.0
    for stance, side in sorted(order, key=lambda pair: pair[0].first):
        other, outward = last[1 - side], 1.0 if side == 0 else -1.0
        last[side] = stance
        if other is None:
            continue
        step = other.given.actInv(stance.given)
        x, y, z = step.translation
        turn = outward * np.clip(outward * heading(step.rotation), -0.5 * reach.max_yaw, reach.max_yaw)
        x = np.clip(x, -reach.max_length, reach.max_length)
        y = outward * np.clip(outward * y, reach.min_spacing, reach.max_spacing)
        allowed = pin.SE3(pin.utils.rotate("z", float(turn)), np.array([x, y, z]))
        stance.move = other.place * allowed * stance.given.inverse()
        most = max(most, float(np.linalg.norm(allowed.translation - step.translation)))
    return most


def _path(
    given: Sequence[pin.SE3], rate: float, stances: list[_Stance], corners: Array
) -> tuple[list[pin.SE3], list[pin.SE3]]:
    """Return placements of a sole, and the motions over the ground that they contain.

    In the air the given path is moved to fit both ends. The foot leaves and reaches its place from above, flat, and
    clears the ground in between with all corners: recorded feet are rolled over toes and heels, and shuffle.
    """
    count = len(given)
    ramp, settle = (max(1, round(time * rate)) for time in (BLEND, SETTLE))
    path, moves = list(given), [pin.SE3.Identity()] * count
    for stance in stances:
        path[stance.first : stance.last] = [stance.place] * (stance.last - stance.first)
        moves[stance.first : stance.last] = [stance.move] * (stance.last - stance.first)
    for before, after in zip([None, *stances], [*stances, None], strict=True):
        ends = [] if before is None else [(before, before.last - 1)]
        ends += [] if after is None else [(after, after.first)]
        fits = [(stance.place * given[frame].inverse(), stance.move) for stance, frame in ends]
        first, last = -1 if before is None else before.last - 1, count if after is None else after.first
        for i in range(first + 1, last):
            foot, share = given[i], smoothstep((i - first) / (last - first))
            if fits:
                fit, moves[i] = (
                    pin.SE3.Interpolate(*both, share) for both in zip(fits[0], fits[-1], strict=True)
                )
                foot = fit * foot
            height, clearance = float(foot.translation[2]), CLEARANCE
            for stance, frame in ends:
                distance = abs(i - frame)
                foot = pin.SE3.Interpolate(stance.place, foot, smoothstep((distance - settle) / ramp))
                height *= smoothstep(distance / ramp)
                clearance = min(clearance, CLEARANCE * smoothstep(distance / settle))
            lowest = height + float((corners @ foot.rotation[2]).min())
            foot.translation[2] = height + max(0.0, clearance - lowest)
            path[i] = foot
    return path, moves


def smoothstep(share: ValueT) -> ValueT:
    """Return the share of a way from rest to rest at a share of the time, which counts from 0 to 1, by a cubic.

    Its greatest speed is 1.5 times the mean one, that of `minimum_jerk` 1.9 times: clips are near the limits of speed.
    """
    x = np.clip(share, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)  # type: ignore[no-any-return]
