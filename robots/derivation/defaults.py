"""Defaults for a robot of which only the URDF and the sole frames are known.

Sole rectangle   from the collision (else visual) geometry of the foot, within 5 mm of its lowest point; without
                 geometry 0.287 × 0.104 of the hip height (foot length and breadth 0.152 and 0.055 of stature, hip
                 0.530 of it: D. A. Winter, Biomechanics and Motor Control of Human Movement, 4th ed. 2009, fig. 4.1)
Sole placement   a frame whose rectangle is not around its origin gets a sole frame of its own at the centre; one
                 whose axes are not those of the base at the zero configuration is turned so that they are
Half-sitting     knees bent by 40°, soles flat and level, centre of mass above the middle of the soles; other joints
                 at zero, or a twentieth of the range inside the limit nearest to it
Torque limit     where the URDF has none: leg 0.25 m g h; others three times what holds the limb stretched out
Armature         `wbc.robots.derivation.servo.ARMATURE_RATIO` times m h²
Servo gains      8 Hz, critically damped, on the effective inertia, legs bounded (`wbc.robots.derivation.servo`)
Torso            the link that the arms branch from, else the root
IMU              a frame of the URDF called so, on the root rather than elsewhere; else the root
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin

from wbc.core.errors import InputError, ModelError, non_negative, positive, unknown_name
from wbc.core.robot import GRAVITY
from wbc.robots import frames, urdf
from wbc.robots.derivation import inertia, posture, soles
from wbc.robots.derivation.servo import ARMATURE_RATIO, ServoRule, leg_joints
from wbc.robots.description import RobotDescription, build_model
from wbc.robots.frames import SOLE_NAMES, FrameDescription, SoleDescription

SOLE_RATIO = (0.152 / 0.530, 0.055 / 0.530)
"""Length and width of a sole over the height of the hip above it (Winter 2009, fig. 4.1)."""

TORQUE_RATIO = 0.25
"""Torque limit of a leg joint over m g h; Talos' published ones are 0.13 to 0.39."""

LIMB_FACTOR = 3.0
"""Torque limit of any other joint over what holds its limb stretched out horizontally."""

ARM_JOINTS = 3
"""A branch of at least as many joints is a limb rather than a head or a finger."""

ALIGNED = np.cos(np.radians(1.0))
"""Cosine of the tilt up to which a frame counts as aligned with the base."""


def describe(
    source: str | Path,
    *,
    left_sole: str | FrameDescription,
    right_sole: str | FrameDescription,
    name: str | None,
    sole_size: tuple[float, float] | None,
    package_dirs: tuple[str | Path, ...],
    half_sitting: Mapping[str, float] | None,
    torso: str | None,
    imu: str | FrameDescription | None,
    hands: Mapping[str, str] | None,
    armature: float | Mapping[str, float] | None,
    servo: ServoRule | None,
    gains: Mapping[str, tuple[float, float]] | None,
    position_limits: Mapping[str, tuple[float, float]] | None,
    velocity_limits: Mapping[str, float] | None,
    torque_limits: Mapping[str, float] | None,
    repair: bool,
    height: float | None,
    licence: str,
    provenance: str | None,
) -> RobotDescription:
    """Complete a description; see `RobotDescription.from_urdf`."""
    root = urdf.read(source)
    is_file = not str(source).lstrip().startswith("<")
    base = Path(source).expanduser().resolve().parent if is_file else None
    notes = urdf.tidy(root)
    urdf.set_limits(root, position=position_limits, velocity=velocity_limits, torque=torque_limits)
    if repair:
        notes += inertia.repair(root)
    inertia.check(root)
    title = name or str(root.get("name") or "robot")
    model = build_model(urdf.to_string(root), title)
    directories = tuple(str(Path(d).expanduser()) for d in package_dirs)

    soles = tuple(
        _sole(root, model, which, given, sole_size, directories, base, notes)
        for which, given in zip(SOLE_NAMES, (left_sole, right_sole), strict=True)
    )
    for sole in soles:
        frames.add_frame(model, sole)
    _check_sides(model, soles)
    names = list(model.names)[2:]
    left_frame, right_frame = (sole.frame for sole in soles)
    stance = max(sole.width for sole in soles) + 0.02
    given = dict(half_sitting or {})
    posture_all = posture.half_sitting(model, (left_frame, right_frame), given, stance)
    legs = [names[j - 2] for frame in (left_frame, right_frame) for j in leg_joints(model, frame)]
    solved = [
        f"{joint} {round(np.degrees(posture_all[joint]), 2) + 0.0}" for joint in legs if joint not in given
    ]
    if solved:
        notes.append("half-sitting of the legs solved for (deg): " + ", ".join(solved))
    rest = [joint for joint in names if joint not in given and joint not in legs]
    if rest:
        notes.append(
            f"half-sitting of {len(rest)} other joints: zero, or a twentieth of the range inside a limit"
        )
    q = posture.standing_configuration(model, (left_frame, right_frame), posture_all)
    com_height = float(pin.centerOfMass(model, model.createData(), q)[2])
    mass = pin.computeTotalMass(model)

    missing = urdf.joints_without_torque_limit(root)
    if missing:
        torques = _torque_limits(model, soles, missing, mass * GRAVITY * com_height)
        urdf.set_limits(root, torque=torques)
        listed = ", ".join(f"{joint} {torque:.1f}" for joint, torque in torques.items())
        notes.append(f"torque limits not given, from mass and size (Nm): {listed}")

    rotor = _armature(names, armature, ARMATURE_RATIO * mass * com_height**2, notes)
    if torso is None:
        torso = _torso(model, soles)
        notes.append(f"torso: link '{torso}'")
    elif torso not in frames.link_names(model):
        unknown_name("link", torso, frames.link_names(model))
    return RobotDescription(
        name=title,
        urdf=urdf.to_string(root),
        soles=(soles[0], soles[1]),
        half_sitting=posture_all,
        armature=rotor,
        imu=_imu(model, imu, notes),
        torso=torso,
        hands=dict(hands or {}),
        servo=servo or ServoRule(),
        gains=dict(gains or {}),
        package_dirs=directories,
        height=None if height is None else positive("height (m)", height),
        source=provenance or (str(source) if is_file else "URDF string"),
        licence=licence,
        derived=tuple(notes),
    )


def _sole(
    root: urdf.Element,
    model: pin.Model,
    which: str,
    given: str | FrameDescription,
    size: tuple[float, float] | None,
    package_dirs: tuple[str, ...],
    base: Path | None,
    notes: list[str],
) -> SoleDescription:
    """Complete a sole."""
    if isinstance(given, SoleDescription):
        if given.name != which:
            raise InputError(f"the sole given for '{which}' is called '{given.name}'")
        frames.body_frame(model, given.link)
        return given
    if isinstance(given, FrameDescription):
        frames.body_frame(model, given.link)
        link, placement, name = given.link, given.placement, given.frame
        if model.existFrame(name):
            name = f"{which}_sole"
    else:
        link, placement = frames.carrier(model, given)
        name = given

    # The rectangle is looked for in a frame with the axes of the base: x forward, z away from the ground.
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    body = frames.body_frame(model, link)
    in_base = data.oMi[body.parentJoint] * body.placement * placement
    turned = False
    if isinstance(given, str) and not (np.diag(in_base.rotation) > ALIGNED).all():
        placement = placement * pin.SE3(in_base.rotation.T, np.zeros(3))
        turned = True
        notes.append(
            f"{which}: axes of '{given}' are not those of the base; the sole takes those of the base"
        )
    probe = model.copy()
    frames.add_frame(probe, _frame("__probe__", link, placement))
    found = soles.sole_rectangle(root, probe, "__probe__", package_dirs, base)
    centre = np.zeros(3)
    if size is not None:
        length, width = size
        if found is not None and isinstance(given, str):
            centre = found[0]
    elif found is not None:
        centre, length, width = found
        notes.append(f"{which}: {length * 1e3:.0f} x {width * 1e3:.0f} mm, from the geometry of the foot")
    else:
        hip = data.oMi[leg_joints(probe, "__probe__")[0]].translation[2] if body.parentJoint > 1 else 0.0
        hip_height = max(0.1, float(hip - in_base.translation[2]))
        length, width = (ratio * hip_height for ratio in SOLE_RATIO)
        notes.append(
            f"{which}: {length * 1e3:.0f} x {width * 1e3:.0f} mm, from the hip height {hip_height:.3f} m "
            "(no usable geometry on the foot)"
        )
    if isinstance(given, str) and not turned and np.linalg.norm(centre) < 1e-3:
        return _as_sole(which, name, link, placement, length, width)
    if isinstance(given, str):
        name = f"{which}_sole"
        shift = placement * pin.SE3(np.eye(3), centre)
        x, y, z = np.round(centre * 1e3) + 0.0
        notes.append(f"{which}: sole frame '{name}' at ({x:.0f}, {y:.0f}, {z:.0f}) mm from '{given}'")
        return _as_sole(which, name, link, shift, length, width)
    return _as_sole(which, name, link, placement, length, width)


def _as_sole(
    which: str, frame: str, link: str, placement: pin.SE3, length: float, width: float
) -> SoleDescription:
    f = _frame(frame, link, placement)
    return SoleDescription(f.frame, f.link, f.translation, f.rpy, name=which, length=length, width=width)


def _frame(name: str, link: str, placement: pin.SE3) -> FrameDescription:
    x, y, z = placement.translation.tolist()
    roll, pitch, yaw = pin.rpy.matrixToRpy(placement.rotation).tolist()
    return FrameDescription(name, link, (x, y, z), (roll, pitch, yaw))


def _check_sides(model: pin.Model, soles: tuple[SoleDescription, ...]) -> None:
    """Refuse soles that are swapped, on one leg, on the root, or above the robot."""
    legs = [set(leg_joints(model, sole.frame)) for sole in soles]
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


def _armature(
    names: list[str], given: float | Mapping[str, float] | None, default: float, notes: list[str]
) -> dict[str, float]:
    """Armature of every joint."""
    if given is not None and not isinstance(given, Mapping):
        return dict.fromkeys(names, non_negative("armature (kg m²)", given))
    known = dict(given or {})
    for joint in known:
        if joint not in names:
            unknown_name("joint", joint, names)
    if len(known) < len(names):
        notes.append(f"armature of {len(names) - len(known)} joints: {default:.4f} kg m², from mass and size")
    return {joint: float(known.get(joint, default)) for joint in names}


def _torque_limits(
    model: pin.Model, soles: tuple[SoleDescription, ...], joints: list[str], weight_moment: float
) -> dict[str, float]:
    """Torque limits by the rules above."""
    data = model.createData()
    pin.centerOfMass(model, data, pin.neutral(model))
    names = list(model.names)
    legs = {joint for sole in soles for joint in leg_joints(model, sole.frame)}
    found = {}
    for name in joints:
        joint = names.index(name)
        if joint in legs:
            found[name] = TORQUE_RATIO * weight_moment
            continue
        # data.mass and data.com of a joint are those of its subtree, the latter in the joint frame.
        slides = model.joints[joint].shortname().startswith("JointModelP")
        reach = 1.0 if slides else float(np.linalg.norm(data.com[joint]))
        found[name] = max(LIMB_FACTOR * data.mass[joint] * GRAVITY * reach, 0.005 * weight_moment)
    return found


def _torso(model: pin.Model, soles: tuple[SoleDescription, ...]) -> str:
    """The link that two or more limbs branch from, other than the root with its legs."""
    legs = {joint for sole in soles for joint in leg_joints(model, sole.frame)}
    best, best_mass = 1, 0.0
    for joint in range(2, model.njoints):
        limbs = [child for child in model.children[joint] if len(model.subtrees[child]) >= ARM_JOINTS]
        if joint not in legs and len(limbs) >= 2 and model.inertias[joint].mass > best_mass:
            best, best_mass = joint, model.inertias[joint].mass
    return frames.carrier_link(model, best)


def _imu(model: pin.Model, given: str | FrameDescription | None, notes: list[str]) -> FrameDescription:
    if isinstance(given, FrameDescription):
        frames.body_frame(model, given.link)
        return given
    if given is None:
        called = [f for f in model.frames if "imu" in f.name.lower() and f.type == pin.FrameType.BODY]
        called.sort(key=lambda frame: int(frame.parentJoint))
        given = str(called[0].name) if called else frames.carrier_link(model, 1)
        notes.append(f"IMU: frame '{given}'")
    link, placement = frames.carrier(model, given)
    return _frame(given, link, placement)
