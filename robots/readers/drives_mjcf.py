"""Drives, sensors and keyframes of a robot in a compiled MuJoCo model."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import mujoco
import numpy as np

from wbc.core.errors import ModelError
from wbc.robots.frames import FrameDescription, frame_at
from wbc.robots.readers.compile_mjcf import limited
from wbc.robots.readers.tree_mjcf import Tree, placement_of

HOME = ("half_sitting", "halfsitting", "half-sitting", "home", "stand", "knees_bent", "walk_pose")
"""Words in the names of keyframes that stand for a posture with bent knees, first choice first."""


@dataclass
class Drives:
    """Drives of the joints that move.

    Attributes:
        torque: Joint → tightest limit that the file gives, Nm or N.
        gains: Joint → (kp, kd) of its actuators, Nm/rad and Nms/rad.
        armature: Joint → rotor inertia, kg m².
        damping: Joint → passive damping, Nms/rad.
        frictionloss: Joint → dry friction, Nm.
    """

    torque: dict[str, float] = field(default_factory=dict)
    gains: dict[str, tuple[float, float]] = field(default_factory=dict)
    armature: dict[str, float] = field(default_factory=dict)
    damping: dict[str, float] = field(default_factory=dict)
    frictionloss: dict[str, float] = field(default_factory=dict)


def read_drives(tree: Tree) -> Drives:
    """Return the drives of a robot; `tree` gets a note for each remark.

    An actuator that drives a tendon, a site or a body of the robot is a `ModelError`.
    """
    model, drives = tree.model, Drives()
    names = {number: name for name, number in tree.joints.items()}
    for number, name in names.items():
        dof = int(model.jnt_dofadr[number])
        drives.armature[name] = float(model.dof_armature[dof])
        drives.damping[name] = float(model.dof_damping[dof])
        drives.frictionloss[name] = float(model.dof_frictionloss[dof])
        if model.jnt_actfrclimited[number]:
            drives.torque[name] = limited(*model.jnt_actfrcrange[number].tolist())
        if model.jnt_stiffness[number].any():
            tree.notes.append(
                f"joint '{name}': a spring of {model.jnt_stiffness[number].max():g} is left out"
            )
    tree.notes += _passive_tendons(tree)
    if held := [tree.body_name(body) for body in tree.bodies if model.body_gravcomp[body] != 0.0]:
        tree.notes.append(f"gravity compensation of {len(held)} bodies is left out: {listed(held)}")
    sums: dict[str, float] = {}
    for i in range(model.nu):
        joint = _driven_joint(tree, i)
        if joint not in names:
            continue
        name, gear = names[joint], abs(float(model.actuator_gear[i, 0]))
        sums[name] = sums.get(name, 0.0) + gear * _force_limit(model, i)
        kp, kd = drives.gains.get(name, (0.0, 0.0))
        if int(model.actuator_biastype[i]) == mujoco.mjtBias.mjBIAS_AFFINE:
            kp -= float(model.actuator_biasprm[i, 1]) * gear**2
            kd -= float(model.actuator_biasprm[i, 2]) * gear**2
        drives.gains[name] = (kp, kd)
    for name, limit in sums.items():
        drives.torque[name] = min(limit, drives.torque.get(name, math.inf))
    drives.torque = {
        name: limit for name, limit in drives.torque.items() if math.isfinite(limit) and limit > 0.0
    }
    if bare := [name for name in tree.joints if name not in sums]:
        tree.notes.append(f"no actuator in the file for {len(bare)} joints, taken as driven: {listed(bare)}")
    drives.gains = {name: (kp, kd) for name, (kp, kd) in drives.gains.items() if kp > 0.0}
    drives.damping = {name: value for name, value in drives.damping.items() if value > 0.0}
    drives.frictionloss = {name: value for name, value in drives.frictionloss.items() if value > 0.0}
    return drives


def listed(names: list[str]) -> str:
    """Return the first of some names, and how many more there are."""
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")


def _driven_joint(tree: Tree, actuator: int) -> int:
    """Return the joint that an actuator drives; −1 if it drives nothing of the robot."""
    model, kinds = tree.model, mujoco.mjtTrn
    kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
    name = str(model.actuator(actuator).name) or f"actuator {actuator}"
    if kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
        return target
    if kind == kinds.mjTRN_TENDON:
        if not _pulls(tree, target):
            return -1
        raise ModelError(
            f"actuator '{name}' drives tendon '{model.tendon(target).name}', no joint; joints need drives of their "
            "own: lock those that the tendon moves"
        )
    body, what = target, "body"
    if kind in (kinds.mjTRN_SITE, kinds.mjTRN_SLIDERCRANK):
        body, what = int(model.site_bodyid[target]), "site"
    if body in tree.carrier:
        raise ModelError(f"actuator '{name}' drives a {what} of the robot, no joint")
    return -1


def _pulls(tree: Tree, tendon: int) -> bool:
    """Return True if a tendon acts on joints that move or on bodies of the robot."""
    model, kinds = tree.model, mujoco.mjtWrap
    start = int(model.tendon_adr[tendon])
    for wrap in range(start, start + int(model.tendon_num[tendon])):
        kind, number = int(model.wrap_type[wrap]), int(model.wrap_objid[wrap])
        if kind == kinds.mjWRAP_JOINT and number in tree.joints.values():
            return True
        if kind == kinds.mjWRAP_SITE and int(model.site_bodyid[number]) in tree.carrier:
            return True
    return False


def _passive_tendons(tree: Tree) -> list[str]:
    """Return a note for each tendon of the robot that acts without an actuator."""
    model, notes = tree.model, []
    for i in range(model.ntendon):
        parts = {
            "spring": model.tendon_stiffness[i],
            "damping": model.tendon_damping[i],
            "dry friction": model.tendon_frictionloss[i],
            "limits": model.tendon_limited[i],
        }
        acting = [part for part, value in parts.items() if np.any(value)]
        if acting and _pulls(tree, i):
            notes.append(f"tendon '{model.tendon(i).name or i}': {', '.join(acting)} left out")
    return notes


def _force_limit(model: mujoco.MjModel, actuator: int) -> float:
    """Return the largest force of an actuator before its gear; infinite where the file gives none."""
    limit = math.inf
    if model.actuator_forcelimited[actuator]:
        limit = limited(*model.actuator_forcerange[actuator].tolist())
    plain = int(model.actuator_biastype[actuator]) == mujoco.mjtBias.mjBIAS_NONE
    fixed = int(model.actuator_gaintype[actuator]) == mujoco.mjtGain.mjGAIN_FIXED
    if plain and fixed and model.actuator_ctrllimited[actuator]:
        gain = abs(float(model.actuator_gainprm[actuator, 0]))
        limit = min(limit, gain * limited(*model.actuator_ctrlrange[actuator].tolist()))
    return limit


def keyframes(tree: Tree) -> list[tuple[str, dict[str, float]]]:
    """Return the keyframes as joint → position, rad or m, those named like a posture to stand in first."""
    model = tree.model

    def rank(name: str) -> int:
        return next((i for i, word in enumerate(HOME) if word in name.lower()), len(HOME))

    found = []
    for i in range(model.nkey):
        qpos = model.key_qpos[i]
        joints = {name: float(qpos[model.jnt_qposadr[joint]]) for name, joint in tree.joints.items()}
        found.append((str(model.key(i).name) or f"{i}", joints))
    return sorted(found, key=lambda key: rank(key[0]))


def sensors(tree: Tree) -> tuple[FrameDescription | None, dict[str, str]]:
    """Return the IMU, a frame at the site of a gyroscope and an accelerometer, and the sensors by their roles.

    Roles are "gyroscope", "accelerometer" and, for force and torque sensors, "<body> force" and "<body> torque".
    Of several IMUs the one nearest to the root is taken.
    """
    model, kinds = tree.model, mujoco.mjtSensor
    places: dict[int, dict[int, int]] = {}
    roles: dict[str, str] = {}
    for i in range(model.nsensor):
        kind, site = int(model.sensor_type[i]), int(model.sensor_objid[i])
        if int(model.sensor_objtype[i]) != mujoco.mjtObj.mjOBJ_SITE:
            continue
        body = int(model.site_bodyid[site])
        if body not in tree.carrier:
            continue
        name = str(model.sensor(i).name) or f"sensor {i}"
        if kind in (kinds.mjSENS_GYRO, kinds.mjSENS_ACCELEROMETER):
            places.setdefault(site, {})[kind] = i
        elif kind in (kinds.mjSENS_FORCE, kinds.mjSENS_TORQUE):
            what = "force" if kind == kinds.mjSENS_FORCE else "torque"
            roles[f"{tree.body_name(body)} {what}"] = name
    if not places:
        return None, roles
    site = min(places, key=lambda s: (-len(places[s]), tree.carrier[int(model.site_bodyid[s])], s))
    for kind, role in ((kinds.mjSENS_GYRO, "gyroscope"), (kinds.mjSENS_ACCELEROMETER, "accelerometer")):
        if (number := places[site].get(int(kind))) is not None:
            roles[role] = str(model.sensor(number).name) or f"sensor {number}"
    return site_frame(tree, site), roles


def site_frame(tree: Tree, site: int) -> FrameDescription:
    """Return the frame at a site of the robot."""
    model = tree.model
    link = tree.body_name(int(model.site_bodyid[site]))
    place = placement_of(model.site_pos[site], model.site_quat[site])
    name = str(model.site(site).name) or f"site_{site}"
    if name in {tree.body_name(body) for body in tree.bodies}:
        name = f"{name}_site"
    return frame_at(name, link, place)
