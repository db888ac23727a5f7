"""Drives, sensors and keyframes of a robot in a compiled MuJoCo model."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from wbc.base.errors import ModelError
from wbc.base.numbers import Array
from wbc.core.frames import FrameDescription
from wbc.robots.derivation.complete import JointData
from wbc.robots.derivation.defaults import ASIDE
from wbc.robots.frames import frame_at
from wbc.robots.readers.actuators_mjcf import (
    JointActuator,
    acts,
    actuator_name,
    actuators,
    damping,
    driven,
    dry_friction,
    rotor_inertia,
    stiffness,
    switched_off,
)
from wbc.robots.readers.forces_mjcf import pulls
from wbc.robots.readers.tree_mjcf import Tree

HOME = ("half_sitting", "halfsitting", "half-sitting", "home", "stand", "knees_bent", "walk_pose")
"""Words in the names of keyframes that stand for a posture with bent knees, first choice first."""


UNBOUNDED = (-math.inf, math.inf)
"""Range of a drive without limits."""


def read_drives(tree: Tree) -> JointData:
    """Return the drives of a robot and the passive properties of its joints that move.

    Raises:
        ModelError: Ranges of torques of one joint that have nothing in common.
    """
    drives = _passive(tree)
    _drive(tree, drives)
    drives.damping = {name: value for name, value in drives.damping.items() if value > 0.0}
    drives.frictionloss = {name: value for name, value in drives.frictionloss.items() if value > 0.0}
    return drives


def _passive(tree: Tree) -> JointData:
    """Return rotors, friction and springs of the joints of a robot."""
    model, drives = tree.model, JointData()
    rotors, rubbing, dry = rotor_inertia(model), damping(model), dry_friction(model)
    springs = stiffness(model)
    for name, number in tree.joints.items():
        dof = int(model.jnt_dofadr[number])
        drives.armature[name] = float(rotors[dof])
        drives.damping[name] = float(rubbing[dof])
        drives.frictionloss[name] = float(dry[dof])
        if springs[number]:
            drives.springs[name] = float(springs[number]), float(model.qpos_spring[model.jnt_qposadr[number]])
    _reflect(drives, tree)
    return drives


def _drive(tree: Tree, drives: JointData) -> None:
    """Add what the actuators of a robot do: their gains and torques."""
    model, names = tree.model, {number: name for name, number in tree.joints.items()}
    sums: dict[str, tuple[float, float]] = {}
    for each in actuators(model):
        gear = each.gear
        if each.joint not in names or gear == 0.0 or not each.on:
            continue
        name = names[each.joint]
        low, high = _force_range(model, each)
        low, high = (gear * low, gear * high) if gear > 0.0 else (gear * high, gear * low)
        before = sums.get(name, (0.0, 0.0))
        sums[name] = before[0] + low, before[1] + high
        kp, kd = drives.gains.get(name, (0.0, 0.0))
        drives.gains[name] = kp - float(each.bias[1]) * gear**2, kd - float(each.bias[2]) * gear**2
    drives.gains = {name: (kp, kd) for name, (kp, kd) in drives.gains.items() if kp > 0.0}
    for number, name in names.items():
        limit = _range(model.jnt_actfrcrange[number]) if model.jnt_actfrclimited[number] else UNBOUNDED
        low, high = _inside(f"joint '{name}'", sums.get(name, UNBOUNDED), limit)
        if math.isfinite(high):
            drives.torque[name] = low, high


def _reflect(drives: JointData, tree: Tree) -> None:
    """Put rotors, friction and springs of joints that are coupled to another one where they are felt."""
    for name, coupling in tree.coupled.items():
        leader, ratio = coupling.leader, coupling.ratio
        drives.armature[leader] += ratio**2 * drives.armature.pop(name)
        drives.damping[leader] += ratio**2 * drives.damping.pop(name)
        drives.frictionloss[leader] += abs(ratio) * drives.frictionloss.pop(name)
        if name in drives.springs:
            stiffness, rest = drives.springs.pop(name)
            own, own_rest = drives.springs.get(leader, (0.0, 0.0))
            total = own + ratio**2 * stiffness
            moment = own * own_rest + ratio * stiffness * (rest - coupling.offset)
            drives.springs[leader] = total, moment / total


def passive_joints(tree: Tree) -> dict[str, float]:
    """Return the joints without an actuator that acts, joint → rest position (rad or m); none if no joint has one.

    Raises:
        ModelError: An actuator drives a tendon, a site or a body of the robot.
    """
    refuse_other_drives(tree)
    model = tree.model
    if not (moved := driven(model)) & set(tree.joints.values()):
        return {}
    rest, springs = {}, stiffness(model)
    for name, joint in tree.joints.items():
        if joint not in moved and name not in tree.coupled:
            at = int(model.jnt_qposadr[joint])
            rest[name] = float((model.qpos_spring if springs[joint] else model.qpos0)[at])
            if model.jnt_limited[joint]:
                rest[name] = float(np.clip(rest[name], *model.jnt_range[joint]))
    return rest


def refuse_other_drives(tree: Tree) -> None:
    """Raise `ModelError` for an actuator that drives a tendon, a site or a body of the robot."""
    model, kinds = tree.model, mujoco.mjtTrn
    for i in range(model.nactuator):
        kind, target = int(model.actuator_trntype[i]), int(model.actuator_trnid[i, 0])
        name = actuator_name(model, i)
        if not acts(model, i) or kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
            continue
        if kind == kinds.mjTRN_TENDON:
            if pulls(model, target, tree.carrier, tree.joints.values()):
                raise ModelError(
                    f"actuator '{name}' drives tendon '{model.tendon(target).name}', no joint; joints need drives "
                    "of their own: lock those that the tendon moves"
                )
            continue
        body, what = target, "body"
        if kind == kinds.mjTRN_SO3 and int(model.actuator_trnid[i, 1]) < 0:
            body, what = int(model.jnt_bodyid[target]), "ball joint"
        elif kind != kinds.mjTRN_BODY:
            body, what = int(model.site_bodyid[target]), "site"
        if body in tree.carrier:
            raise ModelError(f"actuator '{name}' drives a {what} of the robot, no joint")


def _range(given: Array) -> tuple[float, float]:
    """Return a range of the file; one of zero size is none."""
    low, high = sorted(float(side) for side in given)
    return (low, high) if low < high else UNBOUNDED


def _inside(what: str, one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    """Return the range that is in two ranges of torques, Nm; a `ModelError` that names `what` without one."""
    low, high = max(one[0], other[0]), min(one[1], other[1])
    if not low < high:
        ranges = " and ".join(f"[{ends[0]:g}, {ends[1]:g}]" for ends in (one, other))
        raise ModelError(f"{what}: its ranges of torques, {ranges}, have no range in common")
    return low, high


def _force_range(model: mujoco.MjModel, actuator: JointActuator) -> tuple[float, float]:
    """Return least and greatest force of an actuator before its gear; infinite where the file gives none."""
    limit, i, name = UNBOUNDED, actuator.number, f"actuator '{actuator_name(model, actuator.number)}'"
    if model.actuator_forcelimited[i]:
        limit = _range(model.actuator_forcerange[i])
    gain = actuator.gain
    if gain is None or actuator.bias.any():
        return limit
    clamped = not switched_off(model, mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    if clamped and model.actuator_ctrllimited[actuator.control]:
        limit = _inside(name, limit, _range(gain * model.actuator_ctrlrange[actuator.control]))
    if model.actuator_actlimited[i]:
        limit = _inside(name, limit, _range(gain * model.actuator_actrange[i]))
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
    Of several IMUs the one nearest to the root is taken, of those on limbs none.
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
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for site in list(places):
        body = tree.carrier[int(model.site_bodyid[site])]
        joint = int(model.body_jntadr[body])
        off = data.xanchor[joint] - data.xpos[tree.root]
        if body != tree.root and abs(off @ data.xmat[tree.root].reshape(3, 3)[:, 1]) > ASIDE:
            del places[site]
    if not places:
        return None, roles
    site = min(places, key=lambda s: (-len(places[s]), tree.carrier[int(model.site_bodyid[s])], s))
    for kind, role in ((kinds.mjSENS_GYRO, "gyroscope"), (kinds.mjSENS_ACCELEROMETER, "accelerometer")):
        if (number := places[site].get(int(kind))) is not None:
            roles[role] = str(model.sensor(number).name) or f"sensor {number}"
    return site_frame(tree, site), roles


def site_frame(tree: Tree, site: int) -> FrameDescription:
    """Return the frame at a site of the robot."""
    name = next((name for name, number in tree.sites().items() if number == site), f"site_{site}")
    body, place = tree.site_place(site)
    return frame_at(name, tree.body_name(body), place)
