"""Forces of a MuJoCo model that act on a robot beside its drives and that the controller's model does not have."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import mujoco
import numpy as np

from wbc.core.robot import GRAVITY
from wbc.robots.notes import UNMODELLED, listed
from wbc.robots.readers.actuators_mjcf import (
    actuators,
    damping,
    dry_friction,
    equalities_off,
    rotor_inertia,
    stiffness,
    switched_off,
)

OFF = mujoco.mjtDisableBit
"""Option flags that switch something off."""

OTHER_GRAVITY = 0.02
"""Difference from standard gravity along −z, m/s², up to which it is not noted."""


SWITCHES = {
    "gravity": "nothing falls",
    "contact": "nothing touches",
    "constraint": "nothing touches, and no joint has an end or dry friction",
    "actuation": "no drive acts",
    "limit": "no joint has an end",
    "sensor": "sensors read zero",
    **dict.fromkeys(("equality", "spring", "damper", "frictionloss"), "those of the file do not act"),
}
"""Option flags that change what acts on a robot, of those that are on by default, and what happens without them."""


def unmodelled(
    model: mujoco.MjModel, bodies: Collection[int], joints: Mapping[int, str], ties: Collection[int] = ()
) -> list[str]:
    """Return a note for each force that acts on a robot, its bodies and joints, and is not in a description.

    What the file switches off is named too: a controller counts on it. `ties` are equalities that the description has.
    """
    found = _switches(model) + _gravity(model)
    held = [
        str(model.body(body).name) or f"body_{body}" for body in bodies if model.body_gravcomp[body] != 0.0
    ]
    if held and not switched_off(model, OFF.mjDSBL_GRAVITY):
        found.append(f"gravity compensation (gravcomp) of {len(held)} bodies: {listed(held)}")
    found += _free_joint(model, bodies)
    if (density := float(model.opt.density)) or model.opt.viscosity:
        viscosity = float(model.opt.viscosity)
        found.append(f"drag of a medium: density {density:g} kg/m³, viscosity {viscosity:g} Pa s")
    found += _curves(model, joints)
    found += [
        f"plugin of body '{model.body(body).name or body}'" for body in bodies if model.body_plugin[body] >= 0
    ]
    found += (
        _actuators(model, joints) + _tendons(model, bodies, joints) + _equalities(model, bodies, joints, ties)
    )
    return [UNMODELLED + each for each in found]


def _switches(model: mujoco.MjModel) -> list[str]:
    """Return a note for each option flag of the file that switches a force off."""
    given = {
        "equality": model.neq > 0,
        "spring": model.jnt_stiffness.any() or model.tendon_stiffness.any(),
        "damper": model.dof_damping.any() or model.actuator_damping.any(),
        "frictionloss": model.dof_frictionloss.any(),
    }
    return [
        f"{name} is disabled (option flag): {effect}"
        for name, effect in SWITCHES.items()
        if given.get(name, True) and switched_off(model, getattr(OFF, f"mjDSBL_{name.upper()}"))
    ]


def _gravity(model: mujoco.MjModel) -> list[str]:
    gravity = np.array(model.opt.gravity)
    if (
        switched_off(model, OFF.mjDSBL_GRAVITY)
        or np.linalg.norm(gravity + [0.0, 0.0, GRAVITY]) <= OTHER_GRAVITY
    ):
        return []
    given = ", ".join(f"{value:g}" for value in gravity)
    return [f"gravity ({given}) m/s²; the controller has {GRAVITY:g} m/s² along −z"]


def _free_joint(model: mujoco.MjModel, bodies: Collection[int]) -> list[str]:
    """Return notes on a free joint that holds the floating base to the world, or makes it heavier."""
    found, rubbing, rotors, dry = [], damping(model), rotor_inertia(model), dry_friction(model)
    for joint in range(model.njnt):
        if (
            int(model.jnt_type[joint]) != mujoco.mjtJoint.mjJNT_FREE
            or int(model.jnt_bodyid[joint]) not in bodies
        ):
            continue
        first = int(model.jnt_dofadr[joint])
        six = slice(first, first + 6)
        parts = {
            f"damping of {rubbing[six].max():g} Ns/m and Nms/rad to the world": rubbing[six],
            f"armature of {rotors[six].max():g} kg and kg m²": rotors[six],
            f"dry friction of {dry[six].max():g} N and Nm to the world": dry[six],
            f"spring of {stiffness(model)[joint]:g} N/m and Nm/rad to the world": stiffness(model)[joint],
        }
        acting = [part for part, value in parts.items() if np.any(value)]
        if acting:
            found.append(f"free joint '{model.joint(joint).name or joint}' of the base: {', '.join(acting)}")
        found += [
            f"actuator '{each.name}', which pushes the free joint of the base"
            for each in actuators(model)
            if each.joint == joint and each.on
        ]
    return found


def _curves(model: mujoco.MjModel, joints: Mapping[int, str]) -> list[str]:
    """Return notes on springs and damping of joints and actuators that are polynomials: a description has lines."""
    bent, rubs = set[int](), set[int]()
    for each in actuators(model):
        if model.actuator_dampingpoly[each.number].any():
            rubs.add(each.joint)
    for joint in joints:
        if model.jnt_stiffnesspoly[joint].any():
            bent.add(joint)
        if model.dof_dampingpoly[model.jnt_dofadr[joint]].any():
            rubs.add(joint)
    kinds = (("springs", bent, OFF.mjDSBL_SPRING), ("damping", rubs, OFF.mjDSBL_DAMPER))
    return [
        f"{what} by a polynomial of {listed(names)}"
        for what, some, flag in kinds
        if (names := [name for joint, name in joints.items() if joint in some])
        and not switched_off(model, flag)
    ]


def _actuators(model: mujoco.MjModel, joints: Mapping[int, str]) -> list[str]:
    """Return notes on actuators that are switched off, late, or no source of a torque."""
    mine = [each for each in actuators(model) if each.joint in joints]
    off = [f"'{each.name}' (group {int(model.actuator_group[each.number])})" for each in mine if not each.on]
    found = []
    if off:
        found.append(f"{len(off)} actuators whose group is disabled (actuatorgroupdisable): {listed(off)}")
    mine = [each for each in mine if each.on]
    for what in ("delay", "lag"):
        late = [(getattr(each, what), each.name) for each in mine if getattr(each, what) > 0.0]
        if late:
            names = listed([name for _, name in late])
            found.append(f"{what} of {len(late)} actuators, up to {1e3 * max(late)[0]:g} ms: {names}")
    found += [
        f"actuator '{each.name}' of joint '{joints[each.joint]}', which is no motor or servo: {each.kind}"
        for each in mine
        if each.gain is None
    ]
    return found


def _tendons(model: mujoco.MjModel, bodies: Collection[int], joints: Mapping[int, str]) -> list[str]:
    found = []
    drives = np.zeros((model.ntendon, 2))  # damping and rotors that actuators give tendons
    for i in np.flatnonzero(model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_TENDON)).tolist():
        drives[int(model.actuator_trnid[i, 0])] += model.actuator_damping[i], model.actuator_armature[i]
    for i in range(model.ntendon):
        parts = {
            "spring": not switched_off(model, OFF.mjDSBL_SPRING)
            and [model.tendon_stiffness[i], *np.ravel(model.tendon_stiffnesspoly[i])],
            "damping": not switched_off(model, OFF.mjDSBL_DAMPER)
            and [model.tendon_damping[i], *np.ravel(model.tendon_dampingpoly[i]), drives[i, 0]],
            "dry friction": model.tendon_frictionloss[i],
            "limits": model.tendon_limited[i],
            "armature": model.tendon_armature[i] + drives[i, 1],
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


def _equalities(
    model: mujoco.MjModel, bodies: Collection[int], joints: Mapping[int, str], ties: Collection[int]
) -> list[str]:
    """Return the constraints that hold when the simulation begins, on joints or bodies of the robot."""
    found, kinds = [], mujoco.mjtEq
    for i in range(0 if equalities_off(model) else model.neq):
        kind, ends = int(model.eq_type[i]), (int(model.eq_obj1id[i]), int(model.eq_obj2id[i]))
        name = str(model.equality(i).name) or f"equality {i}"
        if not model.eq_active0[i] or i in ties:
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
