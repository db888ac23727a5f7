"""A description of a source: soles, heading, posture, limits, rotor inertias, torso, IMU, in this order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Unpack

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose
from wbc.base.numbers import ROUNDING
from wbc.core.model import Closure, joints_to
from wbc.core.robot import GRAVITY
from wbc.robots import frames
from wbc.robots.derivation import chains, defaults, posture
from wbc.robots.derivation.legs import knee_direction
from wbc.robots.derivation.servo import ARMATURE_RATIO, ServoRule
from wbc.robots.derivation.soles import SoleFinder, Soles, check_sides, refuse_at_ankle
from wbc.robots.mechanism import Mechanism, unlimited
from wbc.robots.options import DescriptionOptions

AHEAD = 0.01
"""Distance of the soles' centres in front of the ankles from which on it says where a robot looks, m."""


class Notes(list[str]):
    """Remarks on how a robot was read and derived, one line each.

    Attributes:
        doubtful: Remarks on what is doubtful, or in the file and not in the description, such as a force; they are no
            items of the list.
    """

    def __init__(self, lines: Iterable[str] = ()) -> None:
        super().__init__(lines)
        self.doubtful: list[str] = []


@dataclass(frozen=True)
class Read:
    """A robot as its reader has found it in a file.

    Attributes:
        mechanism: Function that returns its links and joints, with a link above the root that is turned by an angle,
            rad.
        name: Its name; that of the mechanism's model when None.
        source: Origin of the model.
        notes: Remarks so far; what is derived adds its own.
        find_soles: Finder of the soles; None for a robot without feet, such as one that is bolted to the world.
        named: True if the soles are given by name or place, False if it is left to `find_soles` which foot is the left
            one.
        package_dirs: Folders with the meshes.
        postures: Postures of the file that may be half-sitting, name and joint → position.
        loops: Closed chains of the file.
        passive: Joints of the file without a drive.
        fields: Fields of the description that the file alone gives, such as the damping.
    """

    mechanism: Callable[[float], Mechanism]
    name: str | None
    source: str
    notes: Notes
    find_soles: SoleFinder | None
    named: bool
    package_dirs: tuple[str, ...] = ()
    postures: Sequence[tuple[str, Mapping[str, float]]] = ()
    loops: tuple[Closure, ...] = ()
    passive: tuple[str, ...] = ()
    fields: Mapping[str, Any] = field(default_factory=dict)


def complete(read: Read, **options: Unpack[DescriptionOptions]) -> dict[str, Any]:
    """Return the fields of the `RobotDescription` of what was read."""
    if read.named and read.find_soles is None:
        raise InputError(
            "a robot with feet is not bolted to the world: base='fixed' is for one without soles, as feet=False is; "
            "give no left_sole and right_sole"
        )
    notes = read.notes
    robot, model, soles = _on_soles(read, options)
    joints, closures = _half_sitting(read, options, model, soles)
    mass, com_height = _size(model, soles, joints)
    robot = _driven(robot, model, soles, mass * GRAVITY * com_height, notes)
    rotors = ARMATURE_RATIO * mass * com_height**2
    return {
        "name": read.name or robot.model.name,
        "mechanism": robot,
        "soles": soles,
        "half_sitting": joints,
        "armature": defaults.complete_armature(list(joints), options.get("armature"), rotors, notes),
        "torso": _torso(options.get("torso"), model, soles, notes),
        "imu": defaults.complete_imu(model, options.get("imu"), notes),
        "hands": options.get("hands") or {},
        "servo": options.get("servo") or ServoRule(),
        "gains": options.get("gains") or {},
        "package_dirs": read.package_dirs,
        "height": options.get("height"),
        "source": read.source,
        "licence": options.get("licence", "unknown"),
        "derived": tuple(notes),
        "doubtful": tuple(notes.doubtful),
        "closures": closures,
        "passive": tuple(dict.fromkeys((*read.passive, *(options.get("passive") or ())))),
        **read.fields,
    }


def _on_soles(read: Read, options: DescriptionOptions) -> tuple[Mechanism, pin.Model, Soles]:
    """Return the mechanism, its root turned to where the feet point, its model with the soles, and these."""
    limits = options.get("position_limits"), options.get("velocity_limits"), options.get("torque_limits")
    robot, notes = read.mechanism(0.0).with_limits(*limits), read.notes
    name = read.name or robot.model.name
    notes += [
        f"joint '{each}' moves with '{coupling.leader}': {coupling.ratio:g} times its position and {coupling.offset:g}"
        for each, coupling in robot.couplings.items()
    ]
    model = robot.coupled(name, notes)
    if read.find_soles is None:
        return robot, model, ()
    soles, remarks = _add_soles(model, read.find_soles, 0.0)
    turn = heading(model, soles, not read.named) if options.get("turn_root") is not False else 0.0
    if turn:
        robot = read.mechanism(turn).with_limits(*limits)
        model = robot.coupled(name)
        notes.append(
            f"the root looks to {np.degrees(turn):.0f}° of where the feet point: new root link "
            f"'{frames.carrier_link(model, 1)}'"
        )
        soles, remarks = _add_soles(model, read.find_soles, turn)
    notes += remarks
    check_sides(model, soles)
    for sole in soles:
        refuse_at_ankle(model, sole)
    return robot, model, soles


def _half_sitting(
    read: Read, options: DescriptionOptions, model: pin.Model, soles: Soles
) -> tuple[dict[str, float], tuple[Closure, ...]]:
    """Return joint → position in half-sitting, rad or m, in which closed chains are closed, and their closures."""
    given = options.get("half_sitting") or {}
    joints = posture.half_sitting(model, soles, given, read.notes, read.postures)
    closures = (*read.loops, *(options.get("closures") or ()))
    if closures:
        joints = chains.close(model, tuple(sole.frame for sole in soles), joints, given, closures)
    return joints, closures


def _size(model: pin.Model, soles: Soles, joints: Mapping[str, float]) -> tuple[float, float]:
    """Return mass, kg, and height of the centre of mass over the soles, m; zero without soles."""
    q = posture.standing_configuration(model, tuple(sole.frame for sole in soles), joints)
    height = float(pin.centerOfMass(model, model.createData(), q)[2]) if soles else 0.0
    return pin.computeTotalMass(model), height


def _driven(
    robot: Mechanism, model: pin.Model, soles: Soles, weight_moment: float, notes: Notes
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
    notes.append(f"torque limits not given, from mass and size (Nm): {listed}")
    notes.doubtful.append("torque limits that the file does not give are guessed from mass and size")
    return robot.with_limits(torque=torques)


def _torso(given: str | None, model: pin.Model, soles: Soles, notes: Notes) -> str:
    """Return the link of the chest: the given one, or that which most of the mass hangs on."""
    if given is None:
        given = defaults.find_torso(model, soles)
        notes.append(f"torso: link '{given}'")
    choose("link", given, frames.link_names(model))
    return given


def _add_soles(model: pin.Model, find: SoleFinder, turn: float) -> tuple[Soles, list[str]]:
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


def heading(model: pin.Model, soles: Soles, feet_found: bool) -> float:
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
        pointing = float(sum(knee_direction(model, sole.frame) for sole in soles) @ ahead)
    if feet_found and turns == 0 and pointing < -AHEAD:
        return np.pi
    if turns == 0 or pointing < AHEAD:
        return 0.0
    return turns * 0.5 * np.pi
