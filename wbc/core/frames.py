"""Frames and soles of a robot: a name, the link that carries it and where it sits in that link."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from typing import Annotated, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pydantic import Field

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array, finite_array, read_only
from wbc.base.settings import settings
from wbc.base.vectors import Vector, add_cross, turned_all


def pose_of(rotation: Array, translation: Array) -> pin.SE3:
    """Return `pin.SE3(rotation, translation)` of arrays of shapes (3, 3) and (3,) in a quarter of its time.

    A constructor of Pinocchio with several signatures tries one after the other. In a tick, `placement.copy()` and
    assigned parts take its place.
    """
    placed = pin.SE3.Identity()
    placed.rotation, placed.translation = rotation, translation
    return placed


def heading(rotation: Array) -> float:
    """Return the heading of a frame's x axis, rad, from its rotation to the world, shape (3, 3)."""
    return math.atan2(rotation[1, 0], rotation[0, 0])


def yaw_rotation(angle: float) -> Array:
    """Return the rotation about the vertical by an angle, rad, shape (3, 3)."""
    rotation: Array = pin.rpy.rpyToMatrix(0.0, 0.0, angle)
    return rotation


def direction(rotation: Array) -> complex:
    """Return the direction in the plane of a frame's x axis, of length 1, from its rotation to the world."""
    x, y = float(rotation[0, 0]), float(rotation[1, 0])
    size = math.hypot(x, y) or 1.0
    return complex(x / size, y / size)


def unit_vector(what: str, value: ArrayLike) -> Array:
    """Return a vector of length 1, shape (3,); `InputError` for what is not three finite numbers, or all zero."""
    vector = finite_array(what, value, (3,))
    length = float(np.linalg.norm(vector))
    if length < ROUNDING:
        raise InputError(f"{what} must not be zero, got {vector}")
    return vector / length


def rotation_matrix(what: str, value: ArrayLike) -> Array:
    """Return a copy of a rotation matrix, shape (3, 3), that is `what` in messages; `InputError` for what is none."""
    matrix = finite_array(what, value, (3, 3))
    if np.linalg.det(matrix) <= 0.0 or abs(matrix @ matrix.T - np.eye(3)).max() > 1e-6:
        raise InputError(f"{what} must be a rotation matrix, got\n{matrix}")
    return matrix


def _is_pose(value: pin.SE3) -> bool:
    """Return true for a finite place and a rotation: in a tenth of the time that the checks with messages take."""
    (a, b, c), (d, e, f), (g, h, i) = value.rotation.tolist()
    x, y, z = value.translation.tolist()
    return bool(
        abs(a * a + b * b + c * c - 1.0) < 1e-7
        and abs(d * d + e * e + f * f - 1.0) < 1e-7
        and abs(b * f - c * e - g) + abs(c * d - a * f - h) + abs(a * e - b * d - i) < 1e-7
        and abs(x) + abs(y) + abs(z) < math.inf
    )


def pose(what: str, value: pin.SE3) -> pin.SE3:
    """Return a copy of a pose that is `what` in messages; `InputError` for what is none."""
    if not isinstance(value, pin.SE3):
        raise InputError(f"{what} must be a pinocchio.SE3, got {value!r}")
    copy = pin.SE3(value)
    if _is_pose(copy):
        return copy
    return pin.SE3(
        rotation_matrix(f"rotation of {what}", value.rotation),
        finite_array(f"translation of {what} (m)", value.translation, (3,)),
    )


def frame_jacobian(model: pin.Model, data: pin.Data, frame: int, axes: pin.ReferenceFrame) -> Array:
    """Return `pin.getFrameJacobian`, shape (6, nv): Pinocchio returns a vector for a robot with one joint."""
    jacobian: Array = pin.getFrameJacobian(model, data, frame, axes)
    return jacobian if jacobian.ndim == 2 else jacobian[:, None]


def relative_jacobian(model: pin.Model, data: pin.Data, frame: int, reference: int) -> Array:
    """Return the velocity of a frame against the body of another one, per generalised velocity, shape (6, nv).

    With d from the reference to the frame, the rows are v − v_r − ω_r × d and ω − ω_r, along the world axes.
    """
    rows = frame_jacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
    theirs = frame_jacobian(model, data, reference, pin.LOCAL_WORLD_ALIGNED)
    rows -= theirs
    rows[:3] += pin.skew(data.oMf[frame].translation - data.oMf[reference].translation).dot(theirs[3:])
    return rows


def relative_drift(model: pin.Model, data: pin.Data, frame: int, reference: int) -> tuple[Vector, Vector]:
    """Return the acceleration of a frame in another one at no generalised acceleration, along the world axes.

    With d and the speed s = v − v_r − ω_r × d of `relative_jacobian`, the linear and the angular part are

        a − a_r − α_r × d − ω_r × (ω_r × d + 2 s),  α − α_r − ω_r × ω.
    """
    world, parts = pin.LOCAL_WORLD_ALIGNED, []
    for each in (frame, reference):
        velocity = pin.getFrameVelocity(model, data, each, world).vector.tolist()
        acceleration = pin.getFrameClassicalAcceleration(model, data, each, world).vector.tolist()
        parts.append((velocity, acceleration, data.oMf[each].translation.tolist()))
    (v, a, p), (v_r, a_r, p_r) = parts
    d, speed, change = (
        [x - y for x, y in zip(*pair, strict=True)] for pair in ((p, p_r), (v, v_r), (a, a_r))
    )
    back = [-spin for spin in v_r[3:]]
    twice = add_cross([2.0 * each for each in speed[:3]], back, d)  # 2 (v − v_r) − ω_r × d = ω_r × d + 2 s
    linear = add_cross(add_cross(change[:3], d, a_r[3:]), back, twice)
    return linear, add_cross(change[3:], back, v[3:])


def net_wrench(wrenches: Sequence[Vector], soles: Sequence[pin.SE3]) -> Array:
    """Return the sum of wrenches in their sole frames, at the world origin in world axes, shape (6,), N and Nm."""
    fx = fy = fz = mx = my = mz = 0.0
    for wrench, sole in zip(wrenches, soles, strict=True):
        force, moment = turned_all(sole.rotation.tolist(), (wrench[:3], wrench[3:]))
        x, y, z = add_cross(moment, sole.translation.tolist(), force)
        fx, fy, fz = fx + force[0], fy + force[1], fz + force[2]
        mx, my, mz = mx + x, my + y, mz + z
    return np.array((fx, fy, fz, mx, my, mz))


class FixedPose(pin.SE3):  # type: ignore[misc]  # it has no stubs
    """Pose that cannot be written: what is assigned to its owner is checked, an element that is written is not.

    Its `copy()` can be written.
    """

    @property
    def rotation(self) -> Array:
        """Rotation matrix, shape (3, 3), read-only."""
        return read_only(super().rotation)

    @property
    def translation(self) -> Array:
        """Origin, shape (3,), m, read-only."""
        return read_only(super().translation)

    def copy(self) -> pin.SE3:
        """Return a pose that can be written."""
        return pin.SE3(self)

    def _refuse(self) -> None:
        """Refuse, as an assignment to a part does."""
        raise AttributeError("this pose is read-only: assign another one to its owner, or change a copy()")

    setIdentity = setRandom = _refuse  # Pinocchio's names


SoleSide: TypeAlias = Annotated[float, Field(gt=0.0, le=2.0)]
"""Length or width of a sole, m; what is longer was given in another unit."""


@settings
class FrameDescription:
    """A frame at a fixed placement in a link.

    Attributes:
        frame: Name; that of the link itself, of a frame of the URDF at this very place, or a new one.
        link: Link that carries it.
        translation: Origin in the link frame, m.
        rpy: Roll, pitch, yaw about the fixed axes of the link frame, rad, as in URDF.
    """

    frame: str
    link: str
    translation: Annotated[tuple[float, float, float], "m"] = (0.0, 0.0, 0.0)
    rpy: Annotated[tuple[float, float, float], "rad"] = (0.0, 0.0, 0.0)

    @property
    def placement(self) -> pin.SE3:
        """Placement in the link frame."""
        return pin.SE3(pin.rpy.rpyToMatrix(*self.rpy), np.array(self.translation))


@settings
class Sole(FrameDescription):
    """A rectangular sole of a robot; its frame lies at the centre, x forward, z up and away from the ground.

    A foot is fitted to a `wbc.feet.soles.foot.AnkleSole`, which is the same rectangle seen from the ankle.

    Attributes:
        name: Name in contacts and measurements: "left_foot" or "right_foot" of a robot that walks.
        length: Extent along x, m.
        width: Extent along y, m.
    """

    name: str = field(kw_only=True)
    length: Annotated[SoleSide, "m"] = field(kw_only=True)
    width: Annotated[SoleSide, "m"] = field(kw_only=True)

    def corners(self, place: pin.SE3) -> Array:
        """Return the corners of the sole whose frame has a placement, shape (4, 3), m."""
        half = 0.5 * np.array([self.length, self.width, 0.0])
        return np.array([place.act(half * (x, y, 0.0)) for x in (1.0, -1.0) for y in (1.0, -1.0)])
