"""MuJoCo model of the soft foot."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import pinocchio as pin

from wbc.feet.common_mjcf import (
    add_bar,
    add_box,
    add_contact_sphere,
    add_foot_body,
    add_range_site,
    set_inertia,
)
from wbc.feet.contact import solver_parameters
from wbc.feet.model import FootModel
from wbc.feet.soft import ARCH_THICKNESS, SoftFoot, SoftLayout
from wbc.feet.sole import FootFit

_LATERAL = (0.0, 1.0, 0.0)
_FORWARD = (1.0, 0.0, 0.0)
_VISUAL_GAP = 0.001  # m between the drawn phalanges


def build_soft(
    spec: mujoco.MjSpec, ankle_body: mujoco.MjsBody, side: str, foot: SoftFoot, fit: FootFit
) -> FootModel:
    """Add a soft foot under an ankle.

    The tree runs ankle → foot body (backward arch, force sensor) → heel phalanx → … → toe, and foot body →
    frontal arch; a `connect` equality closes the arch onto the sole.

    Args:
        spec: Model under construction.
        ankle_body: Body that carries the foot.
        side: "left" or "right".
        foot: The design.
        fit: The design under this ankle.
    """
    layout = foot.layout(fit.sole)
    n = foot.phalanges
    body = add_foot_body(spec, ankle_body, side, fit)
    set_inertia(body, layout.backward_arch)
    add_bar(body, f"{side}_backward_arch", layout.ankle, layout.hinges[-1], ARCH_THICKNESS / 2.0)

    phalanges: list[mujoco.MjsBody] = []  # heel first, as the tree grows
    pitch_joints: list[str] = []
    twist_joints: list[str] = []
    parent, parent_origin = body, np.zeros(3)
    for i in reversed(range(n)):
        origin = np.array(layout.hinges[i])
        phalanx = parent.add_body(name=f"{side}_phalanx_{i + 1}", pos=origin - parent_origin)
        pitch_joints.append(
            _add_hinge(
                phalanx,
                f"{side}_phalanx_{i + 1}_pitch",
                _LATERAL,
                foot.stiffness,
                foot.damping,
                foot.armature,
            )
        )
        if foot.transverse is not None and i < n - 1:
            stiffness = foot.transverse.stiffness
            twist_joints.append(
                _add_hinge(
                    phalanx,
                    f"{side}_phalanx_{i + 1}_twist",
                    _FORWARD,
                    foot.stiffness if stiffness is None else stiffness,
                    foot.transverse.damping,
                    foot.armature,
                )
            )
        _dress_phalanx(phalanx, side, i, foot, layout, origin)
        phalanges.append(phalanx)
        parent, parent_origin = phalanx, origin
    phalanges.reverse()
    pitch_joints.reverse()
    twist_joints.reverse()

    geoms = _add_spheres(phalanges, side, foot, layout)
    toe_origin = np.array(layout.hinges[0])
    site = add_range_site(
        phalanges[0], side, np.array([layout.centers[0], 0.0, foot.hinge_height]) - toe_origin
    )
    arch_joint, loop_sites = _add_frontal_arch(spec, body, phalanges, side, foot, layout)
    encoders: tuple[str, ...] = ()
    if foot.encoders:
        encoders = tuple(f"{joint}_angle" for joint in pitch_joints)
        for joint, encoder in zip(pitch_joints, encoders, strict=True):
            spec.add_sensor(
                name=encoder,
                type=mujoco.mjtSensor.mjSENS_JOINTPOS,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                objname=joint,
            )
    follows = foot.transverse is not None and foot.transverse.stiffness is None
    return FootModel(
        side=side,
        fit=fit,
        body=body.name,
        wrench_site=f"{side}_sole",
        force_sensor=f"{side}_foot_force",
        torque_sensor=f"{side}_foot_torque",
        range_site=site,
        range_height=foot.hinge_height,
        contact_geoms=tuple(geoms),
        sole_joints=tuple(pitch_joints),
        twist_joints=tuple(twist_joints),
        variable_joints=(*pitch_joints, *(twist_joints if follows else ())),
        arch_joint=arch_joint,
        loop_sites=loop_sites,
        encoders=encoders,
    )


def _add_hinge(
    body: mujoco.MjsBody,
    name: str,
    axis: Sequence[float],
    stiffness: float,
    damping: float,
    armature: float,
) -> str:
    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, armature=armature)
    joint.stiffness[0] = stiffness  # the other entries are higher powers of the angle
    joint.damping[0] = damping
    return name


def _dress_phalanx(
    phalanx: mujoco.MjsBody, side: str, i: int, foot: SoftFoot, layout: SoftLayout, origin: np.ndarray
) -> None:
    to_body = pin.SE3(np.eye(3), -origin)
    set_inertia(phalanx, to_body.act(layout.phalanges[i]))
    center = np.array([layout.centers[i], 0.0, foot.thickness / 2.0]) - origin
    size = (layout.pitch - _VISUAL_GAP, foot.width, foot.thickness)
    add_box(phalanx, f"{side}_phalanx_{i + 1}_box", center, size)


def _add_spheres(phalanges: list[mujoco.MjsBody], side: str, foot: SoftFoot, layout: SoftLayout) -> list[str]:
    """An even grid over the whole sole, dealt out row by row; see `SoleContact.row_positions`."""
    contact = foot.contact
    per_phalanx = contact.rows_per_phalanx
    if per_phalanx == 1:
        rows = np.array(layout.centers)
    else:
        rows = contact.row_positions(foot.length, per_phalanx * foot.phalanges)
    names = []
    for row, x in enumerate(rows):
        i = row // per_phalanx
        origin = np.array(layout.hinges[i])
        for j, y in enumerate(contact.column_positions(foot.width)):
            position = np.array([x, y, contact.radius]) - origin
            names.append(
                add_contact_sphere(phalanges[i], f"{side}_sole_{row + 1}_{j + 1}", position, contact)
            )
    return names


def _add_frontal_arch(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    phalanges: list[mujoco.MjsBody],
    side: str,
    foot: SoftFoot,
    layout: SoftLayout,
) -> tuple[str, tuple[str, str] | None]:
    origin, loop_point = np.array(layout.arch_hinge), np.array(layout.loop_point)
    arch = body.add_body(name=f"{side}_frontal_arch", pos=origin)
    joint = _add_hinge(arch, f"{side}_arch_pitch", _LATERAL, foot.arch_stiffness, foot.arch_damping, 0.0)
    set_inertia(arch, pin.SE3(np.eye(3), -origin).act(layout.frontal_arch))
    tip = loop_point - origin
    add_bar(arch, f"{side}_frontal_arch_bar", (0.0, 0.0, 0.0), tip, ARCH_THICKNESS / 2.0)
    if not foot.loop:
        return joint, None
    held = phalanges[foot.loop_phalanx - 1]
    on_sole = loop_point - np.array(layout.hinges[foot.loop_phalanx - 1])
    sites = (f"{side}_loop_arch", f"{side}_loop_sole")
    arch.add_site(name=sites[0], pos=tip, size=[0.004] * 3, group=3)
    held.add_site(name=sites[1], pos=on_sole, size=[0.004] * 3, group=3)
    parameters = solver_parameters(foot.loop_law)
    spec.add_equality(
        name=f"{side}_loop",
        type=mujoco.mjtEq.mjEQ_CONNECT,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        name1=sites[0],
        name2=sites[1],
        solref=parameters.solref,
        solimp=parameters.solimp,
    )
    return joint, sites
