"""Defaults of a robot description, derived from its model, its shapes and sole frames.

Sole rectangle   from the collision (else visual) geometry of the foot, within 5 mm of its lowest point; without
                 geometry 0.287 × 0.104 of the hip height (foot length and breadth 0.152 and 0.055 of stature, hip
                 0.530 of it: D. A. Winter, Biomechanics and Motor Control of Human Movement, 4th ed. 2009, fig. 4.1)
Sole placement   of a frame of the URDF: at the centre of the rectangle, with the axes of the base at the zero
                 configuration; a new frame if the given one lies elsewhere
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
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose
from wbc.base.numbers import finite_scalar
from wbc.core.frames import FrameDescription, Sole
from wbc.core.model import is_floating, joints_to
from wbc.core.robot import GRAVITY
from wbc.robots import frames
from wbc.robots.derivation.soles import no_sole, plausible, sole_rectangle
from wbc.robots.frames import SoleName
from wbc.robots.mechanism import Geometry

Soles: TypeAlias = tuple[Sole, ...]
"""Left and right sole; none of a robot without feet."""

SOLE_RATIO = (0.152 / 0.530, 0.055 / 0.530)
"""Length and width of a sole over the height of the hip above it (Winter 2009, fig. 4.1)."""

TORQUE_RATIO = 0.25
"""Torque limit of a leg joint over m g h; Talos' published ones are 0.13 to 0.39."""

LIMB_FACTOR = 3.0
"""Torque limit of any other joint over the torque that holds its limb stretched out horizontally."""

ARM_JOINTS = 3
"""Smallest number of joints of an arm; a branch with fewer is a head or a finger."""

LEVEL = 0.85
"""Depth below the centre of mass over that of the lowest limb from which on a limb ends as low."""

IMU = re.compile(r"(^|[^a-z])imu")
"""Names of the frames of an inertial measurement unit."""

ASIDE = 0.01
"""Distance of a joint from the middle plane from which on it is in an arm or a leg, m."""

LOWEST_ANKLE = 2e-3
"""Height of the ankle over the sole below which the sole is taken for one that nobody placed, m: an error of rounding,
far below the ankle of any robot."""

ALIGNED = np.cos(np.radians(1.0))
"""Cosine of the tilt up to which a frame counts as aligned with the base."""


def complete_sole(
    shapes: Sequence[Geometry],
    model: pin.Model,
    name: SoleName,
    given: str | FrameDescription,
    size: tuple[float, float] | None,
    package_dirs: tuple[str, ...],
    notes: list[str],
) -> Sole:
    """Return a sole with its frame and rectangle; `notes` gets a line for each rule that was used.

    What is given is a frame of the URDF, a placement in a link, or the whole description; `size` is length and width,
    m, from the geometry of the foot when None.
    """
    if isinstance(given, Sole):
        if given.name != name:
            raise InputError(f"the sole given for '{name}' is called '{given.name}'")
        frames.body_frame(model, given.link)
        return given
    if isinstance(given, FrameDescription):
        frames.body_frame(model, given.link)
        link, placement, frame = given.link, given.placement, given.frame
        if model.existFrame(frame):
            frame = f"{name}_sole"
    else:
        link, placement = frames.carrier(model, given)
        frame = given

    # The rectangle is looked for in a frame with the axes of the base: x forward, z away from the ground.
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    body = frames.body_frame(model, link)
    in_base = data.oMi[body.parentJoint] * body.placement * placement
    turned = False
    if isinstance(given, str) and not (np.diag(in_base.rotation) > ALIGNED).all():
        placement = placement * pin.SE3(in_base.rotation.T, np.zeros(3))
        turned = True
        notes.append(f"{name}: axes of '{given}' are not those of the base; the sole takes those of the base")
    there = pin.Frame(frame, body.parentJoint, 0, body.placement * placement, pin.FrameType.OP_FRAME)
    rectangle = sole_rectangle(shapes, model, there, package_dirs)
    centre, leg, odd = np.zeros(3), float(np.linalg.norm(in_base.translation)), ""
    if rectangle is not None and not plausible(*rectangle[1:], leg):
        odd = no_sole(*rectangle[1:])
        notes.append(f"{name}: {odd}")
        rectangle = None
    if size is not None:
        length, width = size
        if rectangle is not None and isinstance(given, str):
            centre = rectangle[0]
    elif rectangle is not None:
        centre, length, width = rectangle
        notes.append(f"{name}: {length * 1e3:.0f} x {width * 1e3:.0f} mm, from the geometry of the foot")
    else:
        hip = data.oMi[model.supports[body.parentJoint][2]].translation[2] if body.parentJoint > 1 else 0.0
        hip_height = max(0.1, float(hip - in_base.translation[2]))
        length, width = (ratio * hip_height for ratio in SOLE_RATIO)
        notes.append(
            f"{name}: {length * 1e3:.0f} x {width * 1e3:.0f} mm, from the hip height {hip_height:.3f} m "
            "(no usable geometry on the foot)"
        )
    if isinstance(given, str) and (turned or np.linalg.norm(centre) >= 1e-3):
        frame = f"{name}_sole"
        placement = placement * pin.SE3(np.eye(3), centre)
        x, y, z = np.round(centre * 1e3) + 0.0
        notes.append(f"{name}: sole frame '{frame}' at ({x:.0f}, {y:.0f}, {z:.0f}) mm from '{given}'")
    place = frames.frame_at(frame, link, placement)
    sole = Sole(place.frame, place.link, place.translation, place.rpy, name=name, length=length, width=width)
    refuse_at_ankle(model, sole, odd)
    return sole


def refuse_at_ankle(model: pin.Model, sole: Sole, why: str = "") -> None:
    """Refuse a sole at the last joint of its leg, where nobody placed it; `why` is known of its geometry."""
    place = frames.body_frame(model, sole.link).placement * sole.placement
    ankle = abs(float(place.inverse().translation[2]))
    if ankle < LOWEST_ANKLE:
        why = why or f"link '{sole.link}' has no geometry that says where the ground is"
        raise ModelError(
            f"{sole.name}: the sole would lie at the ankle, {1e3 * ankle:.1f} mm from the last joint of the leg; "
            f"{why}: give a frame at the sole, a Sole, or package_dirs where its meshes are"
        )


def check_sides(model: pin.Model, soles: Soles) -> None:
    """Refuse soles that are not at the end of a leg of their own, left of the other one and below the robot."""
    legs = [set(joints_to(model, sole.frame)) for sole in soles]
    for sole, leg in zip(soles, legs, strict=True):
        if not leg:
            raise ModelError(f"sole '{sole.frame}' is fixed to the root: a leg needs joints")
    if soles[0].frame == soles[1].frame or max(legs[0]) in legs[1] or max(legs[1]) in legs[0]:
        raise ModelError(f"soles '{soles[0].frame}' and '{soles[1].frame}' are on the same leg")
    data = model.createData()
    com = pin.centerOfMass(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    left, right = (data.oMf[model.getFrameId(sole.frame)].translation for sole in soles)
    if left[1] <= right[1]:
        raise ModelError(
            f"left sole '{soles[0].frame}' lies to the right of '{soles[1].frame}' (y {left[1]:.3f} and "
            f"{right[1]:.3f} m in the root frame): swapped soles, or a root whose x axis does not point forward"
        )
    if com[2] <= max(left[2], right[2]):
        raise ModelError("the soles are above the centre of mass: the z axis of the root must point up")


def feet_hint(model: pin.Model) -> str:
    """Return how to name the feet of a robot that two lowest limbs say is a humanoid; "" for an arm or a quadruped."""
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
        return dict.fromkeys(names, finite_scalar("armature (kg m²)", given, low=0.0))
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
        limits[name] = max(LIMB_FACTOR * data.mass[joint] * GRAVITY * reach, 0.005 * weight_moment)
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
