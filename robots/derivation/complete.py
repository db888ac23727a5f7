"""A description of a source: soles, heading, posture, limits, rotor inertias, torso, IMU, in this order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Unpack

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose
from wbc.base.numbers import ROUNDING, finite_scalar
from wbc.core.frames import FrameDescription
from wbc.core.model import Closure, joints_to
from wbc.core.robot import GRAVITY
from wbc.robots import frames
from wbc.robots.derivation import defaults, posture
from wbc.robots.derivation.servo import ARMATURE_RATIO, ServoRule
from wbc.robots.mechanism import Geometry, Mechanism, unlimited
from wbc.robots.options import DescriptionOptions

Reader = Callable[[float], Mechanism]
"""Function that reads a robot, with a link above its root that is turned by an angle, rad."""

SoleFinder = Callable[[pin.Model, float], tuple[defaults.Soles, list[str]]]
"""Function of a robot's model and the turn of its root so far, rad, that returns the soles and notes on them."""

AHEAD = 0.01
"""Distance of the soles' centres in front of the ankles from which on it says where a robot looks, m."""


def from_geometry(
    shapes: Sequence[Geometry],
    left: str | FrameDescription,
    right: str | FrameDescription,
    size: tuple[float, float] | None,
    package_dirs: tuple[str, ...],
) -> SoleFinder:
    """Return the finder of given soles from the shapes of a robot; see `complete_sole`."""

    def find(model: pin.Model, _: float) -> tuple[defaults.Soles, list[str]]:
        notes: list[str] = []
        one, other = (
            defaults.complete_sole(shapes, model, name, given, size, package_dirs, notes)
            for name, given in zip(frames.SOLE_NAMES, (left, right), strict=True)
        )
        return (one, other), notes

    return find


def complete(
    read: Reader,
    find_soles: SoleFinder | None,
    *,
    name: str | None,
    source: str,
    notes: list[str],
    doubtful: Sequence[str] = (),
    package_dirs: tuple[str, ...] = (),
    postures: Sequence[tuple[str, Mapping[str, float]]] = (),
    feet_found: bool = False,
    fixed: bool = False,
    loops: tuple[Closure, ...] = (),
    taken: Mapping[str, Any] | None = None,
    **options: Unpack[DescriptionOptions],
) -> dict[str, Any]:
    """Return the fields of a `RobotDescription`.

    `notes` are the remarks so far, `doubtful` those on doubtful values, `postures` those of the file (name, joint →
    position) that may be half-sitting, `taken` further fields, taken over as they are. With `feet_found` it was left to
    `find_soles`, which is None for a robot without feet, which foot is the left one. With `fixed` the base is bolted to
    the world; `loops` are the closed chains of the file.
    """
    if fixed and find_soles is not None:
        raise InputError(
            "a robot with feet is not bolted to the world: base='fixed' is for one without soles"
        )
    for option in options:
        choose("option", option, DescriptionOptions.__annotations__)
    limits = options.get("position_limits"), options.get("velocity_limits"), options.get("torque_limits")
    robot = read(0.0).with_limits(*limits)
    name = name or robot.model.name
    notes += [
        f"joint '{each}' moves with '{coupling.leader}': {coupling.ratio:g} times its position and {coupling.offset:g}"
        for each, coupling in robot.couplings.items()
    ]
    model = robot.coupled(name, notes)
    remarks: list[str] = []
    soles: defaults.Soles = ()
    turn = 0.0
    if find_soles is not None:
        soles, remarks = _add_soles(model, find_soles, 0.0)
        turn = heading(model, soles, feet_found) if options.get("turn_root") is not False else 0.0
    if turn and find_soles is not None:
        robot = read(turn).with_limits(*limits)
        model = robot.coupled(name)
        notes.append(
            f"the root looks to {np.degrees(turn):.0f}° of where the feet point: new root link "
            f"'{frames.carrier_link(model, 1)}'"
        )
        soles, remarks = _add_soles(model, find_soles, turn)
    notes += remarks
    if soles:
        defaults.check_sides(model, soles)
        for sole in soles:
            defaults.refuse_at_ankle(model, sole)

    joints = posture.half_sitting(model, soles, options.get("half_sitting") or {}, notes, postures)
    closures = (*loops, *(options.get("closures") or ()))
    if closures:
        given = options.get("half_sitting") or {}
        joints = posture.close(model, tuple(sole.frame for sole in soles), joints, given, closures)
    q = posture.standing_configuration(model, tuple(sole.frame for sole in soles), joints)
    # Sizes follow from the height over the soles.
    com_height = float(pin.centerOfMass(model, model.createData(), q)[2]) if soles else 0.0
    mass = pin.computeTotalMass(model)
    missing = unlimited(model)
    if missing and not soles:
        hint = defaults.feet_hint(model)
        raise ModelError(
            f"joints without torque limits: {', '.join(missing)}; give torque_limits{hint and f', or its feet: {hint}'}"
        )
    if missing:
        torques = defaults.torque_limits(model, soles, missing, mass * GRAVITY * com_height)
        robot = robot.with_limits(torque=torques)
        listed = ", ".join(f"{joint} {torque:.1f}" for joint, torque in torques.items())
        notes.append(f"torque limits not given, from mass and size (Nm): {listed}")
        doubtful = *doubtful, "torque limits that the file does not give are guessed from mass and size"
    rotors = defaults.complete_armature(
        list(joints), options.get("armature"), ARMATURE_RATIO * mass * com_height**2, notes
    )
    torso, height = options.get("torso"), options.get("height")
    if torso is None:
        torso = defaults.find_torso(model, soles)
        notes.append(f"torso: link '{torso}'")
    choose("link", torso, frames.link_names(model))
    return {
        "name": name,
        "mechanism": robot,
        "soles": soles,
        "half_sitting": joints,
        "armature": rotors,
        "imu": defaults.complete_imu(model, options.get("imu"), notes),
        "torso": torso,
        "hands": options.get("hands") or {},
        "servo": options.get("servo") or ServoRule(),
        "gains": options.get("gains") or {},
        "package_dirs": package_dirs,
        "height": None if height is None else finite_scalar("height (m)", height, above=0.0),
        "source": source,
        "licence": options.get("licence", "unknown"),
        "derived": tuple(notes),
        "doubtful": tuple(doubtful),
        "closures": closures,
        "passive": tuple(options.get("passive") or ()),
        **(taken or {}),
    }


def check_values(robot: Any, model: pin.Model) -> None:
    """Check the values that a description gives for single joints, each by the name of the joint."""
    names = robot.joint_names
    values = {
        "armature": (robot.armature, " (kg m²)"),
        "damping": (robot.damping, ""),
        "friction": (robot.frictionloss, ""),
        "kp": ({name: kp for name, (kp, _) in robot.gains.items()}, " (Nm/rad)"),
        "kd": ({name: kd for name, (_, kd) in robot.gains.items()}, " (Nms/rad)"),
    }
    for what, (given, unit) in values.items():
        for name, value in given.items():
            choose("joint", name, names)
            finite_scalar(f"{what} of joint '{name}'{unit}", value, low=0.0)
    for name, value in robot.half_sitting.items():
        i = model.nq - len(names) + names.index(choose("joint", name, names))
        low, high = float(model.lowerPositionLimit[i]), float(model.upperPositionLimit[i])
        finite_scalar(f"half-sitting of joint '{name}'", value, low=low, high=high)


def _add_soles(model: pin.Model, find: SoleFinder, turn: float) -> tuple[defaults.Soles, list[str]]:
    """Find the soles, give each a name of its own and add their frames to the model; return notes as well."""
    (left, right), notes = find(model, turn)
    if left.frame == right.frame and left.link != right.link:
        left, right = (replace(sole, frame=f"{sole.name}_sole") for sole in (left, right))
    named = tuple(
        sole
        if sole.frame != f"{sole.name}_sole" or frames.same_place(model, sole)
        else replace(sole, frame=f"{sole.frame}_contact")
        for sole in (left, right)
    )
    for sole in named:
        frames.add_frame(model, sole)
    return named, notes


def heading(model: pin.Model, soles: defaults.Soles, feet_found: bool) -> float:
    """Return the direction in which the feet point in the axes of the root, a multiple of a right angle, rad.

    Two signs must agree before a root is turned: the left foot lies to the left, and the toes are in front of the
    ankles; where toes say nothing, knees bend forward. With one sign alone the soles are more likely to be swapped.
    With `feet_found` the left foot is only the one with the larger y.
    """
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    ids = [model.getFrameId(sole.frame) for sole in soles]
    if any(not joints_to(model, sole.frame) for sole in soles):
        return 0.0
    places = [np.array(data.oMf[i].translation) for i in ids]
    ankles = [np.array(data.oMi[model.frames[i].parentJoint].translation) for i in ids]
    toes = 0.5 * sum(place - ankle for place, ankle in zip(places, ankles, strict=True))
    left = places[0] - places[1]
    ahead = np.array([left[1], -left[0], 0.0]) / max(ROUNDING, float(np.hypot(left[0], left[1])))
    angle = float(np.arctan2(ahead[1], ahead[0]))
    turns = round(angle / (0.5 * np.pi))
    pointing = float(toes @ ahead)
    if turns and abs(pointing) < AHEAD:
        pointing = float(sum(posture.knee_direction(model, sole.frame) for sole in soles) @ ahead)
    if feet_found and turns == 0 and pointing < -AHEAD:
        return np.pi
    if turns == 0 or pointing < AHEAD:
        return 0.0
    return turns * 0.5 * np.pi
