"""Contacts of a motion: which sole stands when, found by height and speed with hysteresis."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array
from wbc.core.robot import Robot
from wbc.motion.clip import MotionClip
from wbc.motion.kinematics import BodyMotion

HEIGHT = 0.03
"""Height of a sole's highest corner over the ground below which a contact begins, m."""

SPEED = 0.2
"""Speed of a sole's fastest corner below which a contact begins, m/s."""

RELEASE_HEIGHT = 0.03
"""Height of a sole's lowest corner over the ground above which a contact ends, m."""

RELEASE_SPEED = 0.4
"""Speed of a sole's fastest corner above which a contact ends, m/s."""

SETTLE = 0.015
"""Both ends of a contact in which the sole's height differs by more from its median are no part of it, m."""

SHORTEST = 0.1
"""Contacts that are shorter are dropped, s."""

GAP = 0.06
"""Gaps between contacts that are shorter are filled, s."""

FLIGHT = 0.08
"""Longest time without any contact, s; a clip that has a longer one is refused."""


def on_ground(robot: Robot, clip: MotionClip, double_support: float = 0.0) -> tuple[BodyMotion, Array]:
    """Return the motion of a clip over a ground at z = 0, and where soles stand, shape (T, 2) (`find_contacts`)."""
    q = clip.configurations(robot)
    ground, standing = find_contacts(BodyMotion.of(robot, q, clip.rate), clip.standing, double_support)
    q[:, 2] -= ground
    return BodyMotion.of(robot, q, clip.rate), standing


def find_contacts(
    motion: BodyMotion, known: Array | None = None, double_support: float = 0.0
) -> tuple[float, Array]:
    """Return the height of a flat ground, m, and where soles stand on it, shape (T, 2): one at least in every frame.

    The ground is where soles at rest are: the 5th percentile of their lowest corners. The lowest point of the whole
    clip is no measure: one dip would make the rest float. Where it is `known` what stands, shape (T, 2), the ground
    alone is found. When one foot takes over, both stand for a least time, s. An `InputError` names the time at which
    the robot leaves the ground for longer than `FLIGHT`.
    """
    if known is not None and known.any():
        ground = float(np.percentile(motion.corners[..., 2].min(axis=2)[known], 5.0))
        standing = known
    else:
        ground, standing = touching(motion.corners, motion.rate)
    return ground, always_standing(standing, motion.rate, double_support)


def always_standing(standing: Array, rate: float, double_support: float = 0.0) -> Array:
    """Return where soles stand, shape (T, 2), with short times filled in which none does; see `find_contacts`."""
    standing = standing.copy()
    for first, last in runs(~standing.any(axis=1)):
        begin, end = first / rate, last / rate
        if end - begin > FLIGHT + ROUNDING:
            raise InputError(
                f"a motion must have a foot on the ground at all times: no sole stands from {begin:.2f} s to "
                f"{end:.2f} s, {end - begin:.2f} s, at most {FLIGHT:g} s are let pass"
            )
        standing[first:last] = standing[first - 1] if first else standing[min(last, len(standing) - 1)]
    for own, other in ((0, 1), (1, 0)):
        _overlap(standing[:, own], standing[:, other], round(double_support * rate))
    return standing


def _overlap(own: Array, other: Array, frames: int) -> None:
    """Let a foot stand on until the other one, which takes over, has stood for some frames; both have shape (T,)."""
    for _, last in runs(own):
        recent = other[max(0, last - frames) : last]
        if last < len(own) and not recent.all():
            landing = last - recent.size + int(np.argmax(recent)) if recent.any() else last
            own[last : landing + frames] = True


def touching(corners: Array, rate: float) -> tuple[float, Array]:
    """Return the height of the ground, m, and where each sole stands on it by its points, shape (T, 2).

    `corners` are points of both soles, shape (T, 2, n, 3), m, at a rate, Hz.
    """
    heights = corners[..., 2]
    lowest, highest = heights.min(axis=2), heights.max(axis=2)
    speed = np.linalg.norm(np.gradient(corners, 1.0 / rate, axis=0), axis=-1).max(axis=-1)
    slow = speed < SPEED
    level = lowest[slow] if slow.any() else lowest.ravel()
    # Soles may rest at several heights, such as a raised foot that is held still: the ground is the lowest of them.
    near = level[level < np.percentile(level, 5.0) + HEIGHT]
    ground = float(np.percentile(near, 5.0))
    begin = (highest - ground < HEIGHT) & slow
    end = (lowest - ground > RELEASE_HEIGHT) | (speed > RELEASE_SPEED)
    standing = np.zeros(lowest.shape, dtype=bool)
    for side, column in enumerate(standing.T):
        now = bool(begin[: max(1, int(0.1 * rate)), side].any())
        for i in range(len(column)):
            column[i] = now = (now or bool(begin[i, side])) and not bool(end[i, side])
        for first, last in runs(~column):
            if first > 0 and last < len(column) and last - first < GAP * rate:
                column[first:last] = True
        for first, last in runs(column):
            height = heights[first:last, side].mean(axis=1)
            off = abs(height - np.median(height))
            settled = np.flatnonzero((off < SETTLE) | (off == off.min()))  # one at least
            column[first:last] = False
            column[first + settled[0] : first + settled[-1] + 1] = True
        for first, last in runs(column):
            if last - first < SHORTEST * rate:
                column[first:last] = False
    return ground, standing


def runs(flags: ArrayLike) -> list[tuple[int, int]]:
    """Return first index and the one after the last of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(flags, dtype=int), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
