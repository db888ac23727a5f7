"""A description of a source: soles, heading, posture, limits, rotor inertias, torso, IMU, in this order."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar, Unpack

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose
from wbc.core.frames import FrameDescription
from wbc.core.model import Closure
from wbc.core.robot import GRAVITY
from wbc.robots import frames
from wbc.robots.derivation import chains, defaults, posture
from wbc.robots.derivation.legs import heading
from wbc.robots.derivation.servo import ARMATURE_RATIO, ServoRule
from wbc.robots.derivation.soles import SoleFinder, Soles, check_sides, refuse_at_ankle
from wbc.robots.mechanism import Mechanism, unlimited
from wbc.robots.options import DescriptionOptions

Description = TypeVar("Description")


@dataclass
class JointData:
    """Drives and passive properties of joints as far as a file gives them, in the units of `RobotDescription`.

    Attributes:
        torque: Joint → least and greatest torque by the tightest limits that the file gives, Nm or N.
    """

    torque: dict[str, tuple[float, float]] = field(default_factory=dict)
    gains: dict[str, tuple[float, float]] = field(default_factory=dict)
    armature: dict[str, float] = field(default_factory=dict)
    damping: dict[str, float] = field(default_factory=dict)
    frictionloss: dict[str, float] = field(default_factory=dict)
    springs: dict[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class FileRobot:
    """A robot as its reader has found it in a file; options that are given take precedence.

    Attributes:
        mechanism: Function that returns its links and joints, with a link above the root that is turned by an angle,
            rad.
        name: Its name; that of the mechanism's model when None.
        notes: Remarks of the reader.
        find_soles: Finder of the soles; None for a robot without feet, such as one that is bolted to the world.
        named: True if the soles are given by name or place, False if it is left to `find_soles` which foot is the left
            one.
        postures: Postures of the file that may be half-sitting, name and joint → position.
        joints: Drives and passive properties of its joints.

    The others are those of `RobotDescription`.
    """

    mechanism: Callable[[float], Mechanism]
    name: str | None = None
    source: str
    notes: tuple[str, ...]
    doubtful: tuple[str, ...] = ()
    find_soles: SoleFinder | None
    named: bool
    package_dirs: tuple[str, ...] = ()
    postures: Sequence[tuple[str, Mapping[str, float]]] = ()
    closures: tuple[Closure, ...] = ()
    passive: tuple[str, ...] = ()
    imu: FrameDescription | None = None
    joints: JointData = field(default_factory=JointData)
    sensors: Mapping[str, str] = field(default_factory=dict)
    locked: Mapping[str, float] = field(default_factory=dict)


def complete(
    kind: Callable[..., Description],
    read: FileRobot,
    *,
    name: str | None,
    provenance: str | None,
    **options: Unpack[DescriptionOptions],
) -> Description:
    """Return the description, made by its class, of a robot that was read; see `RobotDescription.from_urdf`."""
    if read.named and read.find_soles is None:
        raise InputError(
            "a robot with feet is not bolted to the world: base='fixed' is for one without soles, as feet=False is; "
            "give no left_sole and right_sole"
        )
    derived, doubtful = [*read.notes], [*read.doubtful]
    imu = options.get("imu")
    if imu is None and read.imu is not None:
        imu = read.imu
        derived.append(f"IMU: site '{imu.frame}' on link '{imu.link}'")
    name, joints = name or read.name, read.joints
    robot, model, soles = _on_soles(read, name, options, derived)
    given, sole_frames = options.get("half_sitting") or {}, tuple(sole.frame for sole in soles)
    sitting = posture.half_sitting(model, soles, given, derived, read.postures)
    if closures := (*read.closures, *(options.get("closures") or ())):
        sitting = chains.close(model, sole_frames, sitting, given, closures)
    q = posture.standing_configuration(model, sole_frames, sitting)
    com_height = float(pin.centerOfMass(model, model.createData(), q)[2]) if soles else 0.0
    mass = pin.computeTotalMass(model)
    robot = _driven(robot, model, soles, mass * GRAVITY * com_height, derived, doubtful)
    rotors, armature = ARMATURE_RATIO * mass * com_height**2, options.get("armature")
    if armature is None or isinstance(armature, Mapping):
        armature = {**joints.armature, **(armature or {})}
    armature = defaults.complete_armature([*sitting], armature, rotors, derived)
    limited = options.get("torque_limits") or {}
    if (torso := options.get("torso")) is None:
        torso = defaults.find_torso(model, soles)
        derived.append(f"torso: link '{torso}'")
    choose("link", torso, frames.link_names(model))
    return kind(
        name=name or robot.model.name,
        mechanism=robot,
        soles=soles,
        half_sitting=sitting,
        armature=armature,
        torso=torso,
        imu=defaults.complete_imu(model, imu, derived),
        hands=options.get("hands") or {},
        servo=options.get("servo") or ServoRule(),
        gains={**joints.gains, **(options.get("gains") or {})},
        damping=joints.damping,
        frictionloss=joints.frictionloss,
        springs=joints.springs,
        torque_ranges={
            joint: (low, high)
            for joint, (low, high) in joints.torque.items()
            if joint not in limited and not math.isclose(-low, high)
        },
        passive=tuple(dict.fromkeys((*read.passive, *(options.get("passive") or ())))),
        closures=closures,
        locked=read.locked,
        sensors=read.sensors,
        package_dirs=read.package_dirs,
        height=options.get("height"),
        source=provenance or read.source,
        licence=options.get("licence", "unknown"),
        derived=tuple(derived),
        doubtful=tuple(doubtful),
    )


def _on_soles(
    read: FileRobot, name: str | None, options: DescriptionOptions, derived: list[str]
) -> tuple[Mechanism, pin.Model, Soles]:
    """Return the mechanism, its root turned to where the feet point, its model with the soles, and these."""
    limits = options.get("position_limits"), options.get("velocity_limits"), options.get("torque_limits")
    robot = read.mechanism(0.0).with_limits(*limits)
    name = name or robot.model.name
    derived += [
        f"joint '{each}' moves with '{coupling.leader}': {coupling.ratio:g} times its position and {coupling.offset:g}"
        for each, coupling in robot.couplings.items()
    ]
    model = robot.coupled(name, derived)
    if read.find_soles is None:
        return robot, model, ()
    remarks = list[str]()
    soles = _add_soles(model, read.find_soles, 0.0, remarks)
    if turn := heading(model, soles, not read.named):
        robot = read.mechanism(turn).with_limits(*limits)
        model = robot.coupled(name)
        derived.append(
            f"the root looks to {np.degrees(turn):.0f}° of where the feet point: new root link "
            f"'{frames.carrier_link(model, 1)}'"
        )
        remarks.clear()
        soles = _add_soles(model, read.find_soles, turn, remarks)
    derived += remarks
    check_sides(model, soles)
    for sole in soles:
        refuse_at_ankle(model, sole)
    return robot, model, soles


def _driven(
    robot: Mechanism,
    model: pin.Model,
    soles: Soles,
    weight_moment: float,
    derived: list[str],
    doubtful: list[str],
) -> Mechanism:
    """Return a mechanism with torque limits for all joints; `weight_moment` is m g h, Nm."""
    if not (missing := unlimited(model)):
        return robot
    if not soles:
        hint = defaults.feet_hint(model)
        raise ModelError(
            f"joints without torque limits: {', '.join(missing)}; give torque_limits{hint and f', or its feet: {hint}'}"
        )
    torques = defaults.torque_limits(model, soles, missing, weight_moment)
    listed = ", ".join(f"{joint} {torque:.1f}" for joint, torque in torques.items())
    derived.append(f"torque limits not given, from mass and size (Nm): {listed}")
    doubtful.append("torque limits that the file does not give are guessed from mass and size")
    return robot.with_limits(torque=torques)


def _add_soles(model: pin.Model, find: SoleFinder, turn: float, notes: list[str]) -> Soles:
    """Find the soles, give each a name of its own and add their frames to the model; `notes` gets the finder's."""
    left, right = find(model, turn, notes)
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
    return named
