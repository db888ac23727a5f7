"""Motion clips: joint positions and the placement of the base, frame by frame, for a robot's named joints."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.numbers import Array, finite_array, unmasked
from wbc.core.conventions import rotation_of
from wbc.core.robot import Robot

UPRIGHT = 0.5
"""Least z-component of the base's z-axis in the first frame: at 60 degrees of tilt the quaternion's order is wrong."""

MOST = 4.0 * math.pi
"""Joint positions beyond are those of a file in degrees, rad."""

LONGEST = 1_000_000
"""Most frames of a clip."""

BASE_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")


@checked
@dataclass(frozen=True, slots=True, eq=False)
class MotionClip:
    """Clip of a robot: joints and base over time, at a constant rate.

    Attributes:
        joint_names: Names of the joints in the columns of `joints`, length n.
        rate: Frames per second, Hz.
        base: Placement of the base in the world: position (3), m, and quaternion (x, y, z, w), shape (T, 7); the
            quaternions are of length one and do not change sign from frame to frame.
        joints: Joint positions, shape (T, n), rad (or m).
        name: Name of the clip, for reports.
        standing: True where the left and the right sole stand, shape (T, 2); None if that is not known.
    """

    joint_names: tuple[str, ...]
    rate: Annotated[float, Field(ge=1.0, le=10_000.0), "Hz"]
    base: Array
    joints: Array
    name: str = "motion"
    standing: Array | None = None

    def __post_init__(self) -> None:
        """Check shapes, numbers, quaternions and the first frame."""
        names = tuple(self.joint_names)
        twice, times = next(iter(Counter(names).most_common(1)), ("", 0))
        if times > 1:
            raise InputError(f"a joint must occur once in a motion, got '{twice}' {times} times")
        joints = table_of("joints", self.joints, None, names, self.rate)
        base = table_of("base", self.base, count := len(joints), BASE_COLUMNS, self.rate)
        standing = self.standing
        if standing is not None:
            standing = table_of("standing", standing, count, ("left", "right"), self.rate)
            if not np.isin(standing, (0, 1)).all():
                raise InputError("standing of a motion must be true or false")
            standing = standing.astype(bool)
        far = np.abs(joints).max(axis=0, initial=0.0)
        if far.max(initial=0.0) > MOST:
            worst = int(far.argmax())
            raise InputError(
                f"joints of a motion must be in rad, joint '{names[worst]}' turns as far as {far[worst]:.1f} rad; "
                "in degrees?"
            )
        base[:, 3:] = _unit_quaternions(base[:, 3:])
        tilt = float(rotation_of(base[0, 3:])[2, 2])
        if tilt < UPRIGHT:
            raise InputError(
                f"the base must be upright in the first frame: its z-axis points up by {tilt:.2f}, at least "
                f"{UPRIGHT:g} is needed; is the order of the quaternion right (x, y, z, w or w, x, y, z)?"
            )
        values = {"joint_names": names, "base": base, "joints": joints, "standing": standing}
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)  # what is checked does not change
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.joints)

    @property
    def duration(self) -> float:
        """Time from the first to the last frame, s."""
        return (len(self) - 1) / self.rate

    @property
    def times(self) -> Array:
        """Time of each frame, shape (T,), s."""
        return np.arange(len(self)) / self.rate

    @checked
    def configurations(self, robot: Robot) -> Array:
        """Return configurations of a robot; joints that the clip does not have stay at half-sitting.

        Args:
            robot: The robot.

        Returns:
            Configurations, shape (T, nq).

        Raises:
            InputError: The robot is bolted to the world, or has no such joint.
        """
        _refuse_bolted(robot)
        q = np.tile(robot.half_sitting, (len(self), 1))
        q[:, :7] = self.base
        q[:, [7 + robot.joint_index(name) for name in self.joint_names]] = self.joints
        return q

    @classmethod
    @checked
    def of(
        cls, robot: Robot, q: Array, rate: float, name: str = "motion", standing: Array | None = None
    ) -> MotionClip:
        """Make a clip of all joints of a robot from configurations, shape (T, nq), at a rate, Hz."""
        _refuse_bolted(robot)
        q = finite_array("configurations of a motion", q)
        if q.ndim != 2 or q.shape[1] != robot.nq:
            raise InputError(
                f"configurations of a motion must have shape (T, {robot.nq}) for {robot!r}, got {q.shape}"
            )
        return cls(robot.joint_names, rate, q[:, :7], q[:, 7:], name, standing)

    def sampled(self, times: Array, rate: float) -> MotionClip:
        """Return the clip sampled at other times, with a new frame rate, to resample, slow down or ease in.

        Args:
            times: Times in the clip, shape (T,), s, from 0 to `duration`, not decreasing.
            rate: Frames per second of the result, Hz.
        """
        times = finite_array("times in the motion (s)", times)
        if (
            times.ndim != 1
            or times.size < 2
            or (np.diff(times) < 0.0).any()
            or not -1e-6 <= times[0] <= times[-1] <= self.duration + 1e-6
        ):
            raise InputError(
                f"times in the motion (s) must be two at least, increase, and lie in 0 to {self.duration:g}, got "
                f"{shown(times)}"
            )
        times, own = np.clip(times, 0.0, self.duration), self.times
        columns = np.hstack([self.base[:, :3], self.joints])
        columns = CubicHermiteSpline(own, columns, np.gradient(columns, 1.0 / self.rate, axis=0))(times)
        turns = Slerp(own, Rotation.from_quat(self.base[:, 3:]))(times).as_quat()
        standing = None if self.standing is None else self.standing[np.round(times * self.rate).astype(int)]
        base = np.hstack([columns[:, :3], turns])
        return MotionClip(self.joint_names, rate, base, columns[:, 3:], self.name, standing)


def _refuse_bolted(robot: Robot) -> None:
    if not robot.floating:
        raise InputError(f"a motion has a base that moves, robot '{robot.name}' is bolted to the world")


def real_array(what: str, values: ArrayLike) -> NDArray[Any]:
    """Return real numbers or truth values of a motion as an array of any shape, NaN where they are masked."""
    try:
        array = np.asarray(unmasked(values))
    except ValueError as error:
        raise InputError(f"{what} of a motion must have rows of one length, got {shown(values)}") from error
    if array.dtype.kind not in "biuf":
        raise InputError(f"{what} of a motion must be real numbers, got an array of type {array.dtype}")
    return array


def table_of(what: str, values: ArrayLike, count: int | None, columns: Sequence[str], rate: float) -> Array:
    """Return a copy of the numbers of all frames, shape (count, columns), after a check of each.

    Without a count there may be 2 to `LONGEST` frames.
    """
    array = real_array(what, values)
    if count is None and not 2 <= (count := len(np.atleast_1d(array))) <= LONGEST:
        raise InputError(f"a motion must have 2 to {LONGEST} frames, got {count}")
    if array.shape != (count, len(columns)):
        raise InputError(f"{what} of a motion must have shape ({count}, {len(columns)}), got {array.shape}")
    if len(bad := np.argwhere(~np.isfinite(array))):
        frame, column = (int(i) for i in bad[0])
        raise InputError(
            f"numbers of a motion must be finite, got {array[frame, column]} in frame {frame} ({frame / rate:.3f} s), "
            f"column '{columns[column]}'"
        )
    return np.array(array, dtype=float)


def _unit_quaternions(quaternions: Array) -> Array:
    """Normalise quaternions and keep their sign from frame to frame."""
    q = quaternions.copy()
    norms = np.linalg.norm(q, axis=1)
    if (abs(norms - 1.0) > 0.05).any():
        frame = int(np.argmax(abs(norms - 1.0) > 0.05))
        raise InputError(f"a quaternion must have length 1, got {norms[frame]:.3f} in frame {frame}")
    q /= norms[:, None]
    flips = np.cumprod(np.where((q[1:] * q[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    q[1:] *= flips[:, None]
    return q
