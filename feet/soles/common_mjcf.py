"""MuJoCo parts that every foot has: its body with the force sensor, contact spheres, range site."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import mujoco
import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, InputError, choose
from wbc.feet.soles.contact import ContactSpheres, solver_parameters
from wbc.feet.soles.sole import SIDES, FootFit

Point: TypeAlias = Sequence[float] | Array
"""Three numbers, m."""

CONTACT_GROUP = 3
"""Geom group of the contact spheres; MuJoCo's viewers hide it by default."""

VISUAL_GROUP = 1
"""Geom group of the shapes that are only looked at."""

RANGE_OFFSET = 1e-6
"""Sideways offset of the range site, m: a ray on a grid line of a height field can slip through it."""

_SOLE_COLOR = (0.85, 0.55, 0.25, 1.0)
_ARCH_COLOR = (0.35, 0.38, 0.42, 1.0)


def part(side: str, name: str) -> str:
    """Name of a part of a foot, such as "left/phalanx_3": the slash keeps it apart from the robot's own names."""
    return f"{side}/{name}"


def quaternion_wxyz(rotation: Sequence[float]) -> list[float]:
    """MuJoCo's order of a quaternion given as xyzw."""
    x, y, z, w = rotation
    return [w, x, y, z]


def set_inertia(body: mujoco.MjsBody, inertia: pin.Inertia) -> None:
    """Give a body an inertia expressed in its own frame, whatever its geoms would infer."""
    body.explicitinertial = True
    body.mass = inertia.mass
    body.ipos = inertia.lever
    m = inertia.inertia
    body.fullinertia = [m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2]]


def add_foot_body(spec: mujoco.MjSpec, ankle_body: mujoco.MjsBody, side: str, fit: FootFit) -> mujoco.MjsBody:
    """Weld the foot's body under the ankle, its frame the sole frame, with the force and torque sensors.

    MuJoCo measures the force between a body and its parent, so everything that touches the ground must lie
    below this body and nothing of the robot.

    Raises:
        InputError: Unknown side, ankle body of another name.
    """
    choose("side", side, SIDES)
    if ankle_body.name != fit.sole.ankle_link:
        raise InputError(
            f"the {side} foot belongs under '{fit.sole.ankle_link}', got the body '{ankle_body.name}'"
        )
    body = ankle_body.add_body(
        name=part(side, "foot"), pos=fit.sole.translation, quat=quaternion_wxyz(fit.sole.rotation)
    )
    site = body.add_site(name=part(side, "sole"), group=CONTACT_GROUP, size=[0.005] * 3)
    for what, kind in (("force", mujoco.mjtSensor.mjSENS_FORCE), ("torque", mujoco.mjtSensor.mjSENS_TORQUE)):
        spec.add_sensor(name=part(side, what), type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site.name)
    return body


def add_contact_sphere(body: mujoco.MjsBody, name: str, position: Point, contact: ContactSpheres) -> str:
    """Add one sphere that touches whatever has collision type 1: the ground."""
    parameters = solver_parameters(contact.law)
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[contact.radius, 0.0, 0.0],
        pos=position,
        contype=0,
        conaffinity=1,
        condim=contact.condim,
        priority=1,
        friction=[contact.friction, contact.spin_friction, contact.rolling_friction],
        solref=parameters.solref,
        solimp=parameters.solimp,
        mass=0.0,
        group=CONTACT_GROUP,
        rgba=_SOLE_COLOR,
    )
    return name


def add_box(body: mujoco.MjsBody, name: str, position: Point, size: Point) -> None:
    """Add a box to look at, full extents in m."""
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=np.asarray(size) / 2.0,
        pos=position,
        contype=0,
        conaffinity=0,
        mass=0.0,
        group=VISUAL_GROUP,
        rgba=_SOLE_COLOR,
    )


def add_bar(body: mujoco.MjsBody, name: str, start: Point, end: Point, radius: float) -> None:
    """Add a bar to look at between two points, m."""
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[radius, 0.0, 0.0],
        fromto=[*start, *end],
        contype=0,
        conaffinity=0,
        mass=0.0,
        group=VISUAL_GROUP,
        rgba=_ARCH_COLOR,
    )


def add_range_site(body: mujoco.MjsBody, side: str, position: Point) -> str:
    """Add the range sensor's site, looking down the sole's normal."""
    x, y, z = position
    name = part(side, "range")
    body.add_site(
        name=name,
        pos=[x + RANGE_OFFSET, y + RANGE_OFFSET, z],
        quat=[0.0, 1.0, 0.0, 0.0],  # half a turn about x: z points down
        size=[0.003] * 3,
        group=CONTACT_GROUP,
    )
    return name
