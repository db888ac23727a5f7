"""Forces of a MuJoCo model that act on a robot beside its drives and that the controller's model does not have."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import mujoco
import numpy as np

from wbc.core.robot import GRAVITY
from wbc.robots.report import UNMODELLED, listed

OTHER_GRAVITY = 0.02
"""Difference from standard gravity along −z, m/s², up to which it is not noted."""


def unmodelled(model: mujoco.MjModel, bodies: Collection[int], joints: Mapping[int, str]) -> list[str]:
    """Return a note for each force that acts on a robot, its bodies and joints, and is not in a description."""
    found = _medium(model)
    held = [
        str(model.body(body).name) or f"body_{body}" for body in bodies if model.body_gravcomp[body] != 0.0
    ]
    if held:
        found.append(f"gravity compensation (gravcomp) of {len(held)} bodies: {listed(held)}")
    found += [
        f"the nonlinear part of the spring of joint '{name}'"
        for number, name in joints.items()
        if model.jnt_stiffnesspoly[number].any()
    ]
    found += _tendons(model, bodies, joints) + _equalities(model, bodies, joints)
    return [UNMODELLED + each for each in found]


def _medium(model: mujoco.MjModel) -> list[str]:
    found, gravity = [], np.array(model.opt.gravity)
    if np.linalg.norm(gravity + [0.0, 0.0, GRAVITY]) > OTHER_GRAVITY:
        tilt = np.degrees(np.arctan2(np.hypot(*gravity[:2]), -gravity[2]))
        given = ", ".join(f"{value:g}" for value in gravity)
        found.append(
            f"gravity ({given}) m/s², {np.linalg.norm(gravity):.3f} m/s² and {tilt:.1f}° off −z; the controller has "
            f"{GRAVITY:g} m/s² along −z"
        )
    if model.opt.density or model.opt.viscosity:
        what = f"of density {model.opt.density:g} kg/m³ and viscosity {model.opt.viscosity:g} Pa s"
        wind = f", wind of {np.linalg.norm(model.opt.wind):g} m/s" if model.opt.wind.any() else ""
        found.append(f"drag of a medium {what}{wind}")
    return found


def _tendons(model: mujoco.MjModel, bodies: Collection[int], joints: Mapping[int, str]) -> list[str]:
    found = []
    for i in range(model.ntendon):
        parts = {
            "spring": [model.tendon_stiffness[i], *np.ravel(model.tendon_stiffnesspoly[i])],
            "damping": model.tendon_damping[i],
            "dry friction": model.tendon_frictionloss[i],
            "limits": model.tendon_limited[i],
        }
        acting = [part for part, value in parts.items() if np.any(value)]
        if acting and pulls(model, i, bodies, joints):
            found.append(f"tendon '{model.tendon(i).name or i}' ({', '.join(acting)})")
    return found


def pulls(model: mujoco.MjModel, tendon: int, bodies: Collection[int], joints: Collection[int]) -> bool:
    """Return True if a tendon acts on some joints or bodies."""
    start = int(model.tendon_adr[tendon])
    for wrap in range(start, start + int(model.tendon_num[tendon])):
        kind, number = int(model.wrap_type[wrap]), int(model.wrap_objid[wrap])
        if kind == mujoco.mjtWrap.mjWRAP_JOINT and number in joints:
            return True
        if kind == mujoco.mjtWrap.mjWRAP_SITE and int(model.site_bodyid[number]) in bodies:
            return True
    return False


def _equalities(model: mujoco.MjModel, bodies: Collection[int], joints: Mapping[int, str]) -> list[str]:
    """Return the constraints that hold when the simulation begins, on joints or bodies of the robot."""
    found, kinds = [], mujoco.mjtEq
    for i in range(model.neq):
        kind, ends = int(model.eq_type[i]), (int(model.eq_obj1id[i]), int(model.eq_obj2id[i]))
        name = str(model.equality(i).name) or f"equality {i}"
        if not model.eq_active0[i]:
            continue
        if kind == kinds.mjEQ_JOINT and ends[0] in joints:
            other = str(model.joint(ends[1]).name) if ends[1] >= 0 else "a constant"
            found.append(f"equality '{name}' of joint '{joints[ends[0]]}' with {other}")
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            if int(model.eq_objtype[i]) == mujoco.mjtObj.mjOBJ_SITE:
                ends = int(model.site_bodyid[ends[0]]), int(model.site_bodyid[ends[1]])
            if any(end in bodies for end in ends):
                one, two = (str(model.body(end).name) for end in ends)
                found.append(f"'{name}', which ties body '{one}' to '{two}'")
        elif kind == kinds.mjEQ_TENDON and pulls(model, ends[0], bodies, joints):
            found.append(f"equality '{name}' of tendons")
    return found
