"""MuJoCo models of feet: the parts of every foot, and rigid and soft soles made of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, choose
from wbc.base.numbers import Array
from wbc.core.robot import SIDES
from wbc.feet.soles.contact import LOOP_CLOSURE, ContactSpheres
from wbc.feet.soles.foot import FootFit, FootParts, box_inertia

Point: TypeAlias = Sequence[float] | Array
"""Three numbers, m."""

CONTACT_GROUP = 3
"""Geom group of the contact spheres; MuJoCo's viewers hide it by default."""

VISUAL_GROUP = 1
"""Geom group of the shapes that touch nothing."""

RANGE_OFFSET = 1e-6
"""Sideways offset of the range site, m: a ray on a grid line of a height field can miss the field."""

TOE_TO_RANGE = 0.014
"""Distance of the range sensor from the front edge of a rigid sole, m; as in the soft foot."""

_VISUAL: dict[str, Any] = {"contype": 0, "conaffinity": 0, "mass": 0.0, "group": VISUAL_GROUP}
_SOLE_COLOR = (0.85, 0.55, 0.25, 1.0)
_ARCH_COLOR = (0.35, 0.38, 0.42, 1.0)


def part(side: str, name: str) -> str:
    """Return the name of a part of a foot, such as "left/phalanx_3": no name of the robot has the slash."""
    return f"{side}/{name}"


def quaternion_wxyz(rotation: Sequence[float]) -> list[float]:
    """Return a quaternion xyzw in MuJoCo's order, wxyz."""
    x, y, z, w = rotation
    return [w, x, y, z]


def set_inertia(body: mujoco.MjsBody, inertia: pin.Inertia) -> None:
    """Set the inertia of a body, in the body's frame, instead of inferring it from its geoms."""
    body.explicitinertial = True
    body.mass = inertia.mass
    body.ipos = inertia.lever
    m = inertia.inertia
    body.fullinertia = [m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2]]


def add_foot_body(spec: mujoco.MjSpec, ankle_body: mujoco.MjsBody, side: str, fit: FootFit) -> mujoco.MjsBody:
    """Weld the foot's body under the ankle, its frame the sole frame, with the force and torque sensors.

    MuJoCo measures the force between a body and its parent, so all geoms that touch the ground, and nothing of the
    robot, must be on this body and its children.
    """
    choose("side", side, SIDES)
    if ankle_body.name != fit.sole.ankle_link:
        raise InputError(f"the {side} foot belongs under '{fit.sole.ankle_link}', got '{ankle_body.name}'")
    body = ankle_body.add_body(
        name=part(side, "foot"), pos=fit.sole.translation, quat=quaternion_wxyz(fit.sole.rotation)
    )
    site = body.add_site(name=part(side, "sole"), group=CONTACT_GROUP, size=[0.005] * 3)
    for what, kind in (("force", mujoco.mjtSensor.mjSENS_FORCE), ("torque", mujoco.mjtSensor.mjSENS_TORQUE)):
        spec.add_sensor(name=part(side, what), type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site.name)
    return body


def add_contact_sphere(body: mujoco.MjsBody, name: str, position: Point, contact: ContactSpheres) -> str:
    """Add a sphere that touches geoms of collision type 1, the ground."""
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[contact.radius, 0.0, 0.0],
        pos=position,
        contype=0,
        conaffinity=1,
        condim=3,
        priority=1,
        friction=[contact.friction, 0.005, 0.0001],
        solref=contact.law.solref,
        solimp=contact.law.solimp,
        mass=0.0,
        group=CONTACT_GROUP,
        rgba=_SOLE_COLOR,
    )
    return name


def add_box(body: mujoco.MjsBody, name: str, position: Point, size: Point) -> None:
    """Add a visual box, full extents in m."""
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=np.asarray(size) / 2.0,
        pos=position,
        rgba=_SOLE_COLOR,
        **_VISUAL,
    )


def add_bar(body: mujoco.MjsBody, name: str, start: Point, end: Point, radius: float) -> None:
    """Add a visual bar between two points, m."""
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[radius, 0.0, 0.0],
        fromto=[*start, *end],
        rgba=_ARCH_COLOR,
        **_VISUAL,
    )


def add_range_site(body: mujoco.MjsBody, side: str, position: Point) -> str:
    """Add the range sensor's site, its z axis opposite to the sole's normal."""
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


def build_rigid(
    spec: mujoco.MjSpec,
    ankle_body: mujoco.MjsBody,
    side: str,
    fit: FootFit,
    contact: ContactSpheres,
    *,
    plate: tuple[float, float] | None,
) -> FootParts:
    """Add a rigid sole of spheres under an ankle to a model under construction.

    `plate` is mass (kg) and thickness (m) of the sole's plate; None for a sole that is part of the ankle link.
    """
    body = add_foot_body(spec, ankle_body, side, fit)
    length, width = fit.sole.length, fit.sole.width
    if plate is not None:
        mass, thickness = plate
        set_inertia(body, box_inertia(mass, (length, width, thickness), (0.0, 0.0, thickness / 2.0)))
        add_box(body, part(side, "plate"), (0.0, 0.0, thickness / 2.0), (length, width, thickness))
        ankle = fit.sole.ankle
        add_bar(body, part(side, "shank"), (ankle[0], ankle[1], thickness), ankle.tolist(), 0.01)
    geoms = [
        add_contact_sphere(body, part(side, f"sole_{i + 1}_{j + 1}"), (x, y, contact.radius), contact)
        for i, x in enumerate(contact.row_positions(length, contact.rows(length)))
        for j, y in enumerate(contact.column_positions(width))
    ]
    site = add_range_site(body, side, (length / 2.0 - TOE_TO_RANGE, 0.0, contact.radius))
    return foot_parts(fit, body, side, site, geoms)


def foot_parts(
    fit: FootFit, body: mujoco.MjsBody, side: str, site: str, geoms: Sequence[str], **soft: Any
) -> FootParts:
    """Return the names of a foot that was built, with those that a soft one alone has."""
    return FootParts(
        fit=fit,
        body=body.name,
        wrench_site=part(side, "sole"),
        force_sensor=part(side, "force"),
        torque_sensor=part(side, "torque"),
        range_site=site,
        contact_geoms=tuple(geoms),
        **soft,
    )


def add_hinge(body: mujoco.MjsBody, name: str, stiffness: float, damping: float) -> str:
    """Add a hinge about the transverse axis with a spring, Nm/rad, and a damper, Nms/rad; return its name."""
    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=(0.0, 1.0, 0.0))
    joint.stiffness[0] = stiffness  # the other entries are coefficients of higher powers of the angle
    joint.damping[0] = damping
    return name


def add_loop(spec: mujoco.MjSpec, side: str, ends: Sequence[tuple[mujoco.MjsBody, Point]]) -> tuple[str, str]:
    """Hold a place of the arch, in its body, and one of the sole together; return the names of their sites."""
    names = (part(side, "loop_arch"), part(side, "loop_sole"))
    for name, (body, place) in zip(names, ends, strict=True):
        body.add_site(name=name, pos=place, size=[0.004] * 3, group=CONTACT_GROUP)
    spec.add_equality(
        name=part(side, "loop"),
        type=mujoco.mjtEq.mjEQ_CONNECT,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        name1=names[0],
        name2=names[1],
        solref=LOOP_CLOSURE.solref,
        solimp=LOOP_CLOSURE.solimp,
    )
    return names
