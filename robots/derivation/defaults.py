"""Defaults of a robot description, derived from its model, its shapes and sole frames.

Soles            `wbc.robots.derivation.soles`: from the geometry of the feet
Half-sitting     knees bent by 40°, soles flat and level, centre of mass above the middle of the soles; other joints
                 at zero, or a twentieth of the range inside the limit nearest to it
Torque limit     where the URDF has none: leg 0.25 m g h; others three times what holds the limb stretched out
Armature         `wbc.robots.derivation.servo.ARMATURE_RATIO` times m h²
Servo gains      8 Hz, critically damped, on the effective inertia, legs bounded (`wbc.robots.derivation.servo`)
Torso            the link that the arms branch from, else the root
IMU              a frame of the URDF called so, on root, torso or head, not on a limb; else the root
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from wbc.base.errors import choose
from wbc.core.frames import FrameDescription
from wbc.core.model import is_floating, joints_to
from wbc.core.robot import GRAVITY
from wbc.robots import frames
from wbc.robots.derivation.soles import Soles

TORQUE_RATIO = 0.25
"""Torque limit of a leg joint over m g h; Talos' published ones are 0.13 to 0.39."""

LIMB_FACTOR = 3.0
"""Torque limit of any other joint over the torque that holds its limb stretched out horizontally."""

LEAST_RATIO = 0.005
"""Torque limit of any such joint over m g h at least, so that a light head or hand has one that moves it."""

ARM_JOINTS = 3
"""Smallest number of joints of an arm; a branch with fewer is a head or a finger."""

LEVEL = 0.85
"""Depth below the centre of mass over that of the lowest limb from which on a limb ends as low."""

IMU = re.compile(r"(^|[^a-z])imu")
"""Names of the frames of an inertial measurement unit."""

ASIDE = 0.01
"""Distance of a joint from the middle plane from which on it is in an arm or a leg, m."""


def feet_hint(model: pin.Model) -> str:
    """Return the options that name the two lowest limbs of a humanoid as its feet; "" for an arm or a quadruped."""
    data = model.createData()
    com = pin.centerOfMass(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    ends = [
        j
        for j in range(2 if is_floating(model) else 1, model.njoints)
        if not len(model.children[j]) and data.oMi[j].translation[2] < com[2]
    ]
    ends.sort(key=lambda joint: float(data.oMi[joint].translation[2]))
    heights = [float(com[2] - data.oMi[joint].translation[2]) for joint in ends]
    if len(ends) < 2 or heights[1] < LEVEL * heights[0] or len(ends) > 2 and heights[2] > LEVEL * heights[0]:
        return ""
    left, right = sorted(ends[:2], key=lambda joint: -float(data.oMi[joint].translation[1]))
    names = []
    for joint in (left, right):
        fixed = [f for f in model.frames if f.parentJoint == joint and f.type == pin.FrameType.BODY]
        soles = [f for f in fixed if "sole" in f.name.lower()]
        names.append(str((soles or fixed)[0].name))
    return f"left_sole='{names[0]}', right_sole='{names[1]}' (--left {names[0]} --right {names[1]})"


def complete_armature(
    names: list[str], given: float | Mapping[str, float] | None, default: float, notes: list[str]
) -> dict[str, float]:
    """Return the armature of every joint, kg m²: one for all is given, or those of some joints beside a default."""
    if given is not None and not isinstance(given, Mapping):
        return dict.fromkeys(names, float(given))
    known = dict(given or {})
    for joint in known:
        choose("joint", joint, names)
    if left := len(names) - len(known):
        derived = f"{default:.3g} kg m², from mass and size"
        what = derived if default > 0.0 else "no rotor inertia in the file, zero is taken"
        notes.append(f"armature of {left} joints: {what}")
    return {joint: float(known.get(joint, default)) for joint in names}


def torque_limits(
    model: pin.Model, soles: Soles, joints: list[str], weight_moment: float
) -> dict[str, float]:
    """Return the torque limits of some joints by the rules above, Nm; `weight_moment` is m g h of the robot, Nm."""
    data = model.createData()
    pin.centerOfMass(model, data, pin.neutral(model))
    names = list(model.names)
    legs = {joint for sole in soles for joint in joints_to(model, sole.frame)}
    limits = {}
    for name in joints:
        joint = names.index(name)
        if joint in legs:
            limits[name] = TORQUE_RATIO * weight_moment
            continue
        # data.mass and data.com of a joint are those of its subtree, the latter in the joint frame.
        slides = model.joints[joint].shortname().startswith("JointModelP")
        reach = 1.0 if slides else float(np.linalg.norm(data.com[joint]))
        limits[name] = max(LIMB_FACTOR * data.mass[joint] * GRAVITY * reach, LEAST_RATIO * weight_moment)
    return limits


def find_torso(model: pin.Model, soles: Soles) -> str:
    """Return the heaviest link above the root that two or more limbs branch from; without one the root."""
    legs = {joint for sole in soles for joint in joints_to(model, sole.frame)}
    root = 1 if is_floating(model) else 0
    best, best_mass = root, 0.0
    for joint in range(root + 1, model.njoints):
        limbs = [child for child in model.children[joint] if len(model.subtrees[child]) >= ARM_JOINTS]
        if joint not in legs and len(limbs) >= 2 and model.inertias[joint].mass > best_mass:
            best, best_mass = joint, model.inertias[joint].mass
    return frames.carrier_link(model, best)


def complete_imu(
    model: pin.Model, given: str | FrameDescription | None, notes: list[str]
) -> FrameDescription:
    """Return the frame of the inertial measurement unit: the given one, or by the rule above."""
    if isinstance(given, FrameDescription):
        frames.body_frame(model, given.link)
        return given
    if given is None:
        data = model.createData()
        pin.forwardKinematics(model, data, pin.neutral(model))
        called = [f for f in model.frames if IMU.search(f.name.lower()) and f.type == pin.FrameType.BODY]
        called.sort(key=lambda frame: int(frame.parentJoint))
        aside = [f for f in called if abs(data.oMi[f.parentJoint].translation[1]) > ASIDE]
        found = next((str(f.name) for f in called if f not in aside), None)
        given = found or frames.carrier_link(model, 1 if is_floating(model) else 0)
        limb = (
            f"; '{aside[0].name}' is on a limb: imu='{aside[0].name}' takes it" if aside and not found else ""
        )
        notes.append(f"IMU: frame '{given}'{limb}")
    link, placement = frames.carrier(model, given)
    return frames.frame_at(given, link, placement)
