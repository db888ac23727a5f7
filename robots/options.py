"""Options with which a robot is read from a file, each stated once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict

from wbc.core.frames import FrameDescription
from wbc.core.model import Closure
from wbc.robots.derivation.servo import ServoRule


class DescriptionOptions(TypedDict, total=False):
    """Options of a robot, whatever kind of file it is read from; what is None or left out is derived from the model.

    Links are the bodies of an MJCF, frames of links its bodies and sites.

    Attributes:
        lock: Joint → position at which it is fixed, such as those of fingers, rad or m.
        half_sitting: Joint → position of all or some joints, rad or m.
        torso: Link of the chest.
        imu: Frame of the inertial measurement unit, of the file or a placement in a link.
        hands: Role → frame, such as {"left_hand": "l_palm"}; only "left_hand" and "right_hand" swing and dance. A robot
            has no hands when None.
        armature: Rotor inertia seen at the joints, one for all or joint → value, kg m² (kg for prismatic joints), in
            place of the file's.
        servo: Rule for the servo gains.
        gains: Joint → (kp, kd), in place of the file's, Nm/rad and Nms/rad.
        position_limits: Joint → (lower, upper), in place of the file's, rad or m.
        velocity_limits: Joint → largest speed, in place of the file's, rad/s or m/s.
        torque_limits: Joint → largest torque or force, in place of the file's, Nm or N.
        closures: Where closed chains close: pairs of frames that stay together.
        passive: Joints without a drive, whose torque is zero, such as those of rods.
        repair: Clamp inertias of a URDF that no body can have instead of refusing them; False by default.
        height: Standing height with straight legs, m; unknown when None.
        licence: Licence of the model; "unknown" by default.
    """

    lock: Mapping[str, float] | None
    half_sitting: Mapping[str, float] | None
    torso: str | None
    imu: str | FrameDescription | None
    hands: Mapping[str, str] | None
    armature: float | Mapping[str, float] | None
    servo: ServoRule | None
    gains: Mapping[str, tuple[float, float]] | None
    position_limits: Mapping[str, tuple[float, float]] | None
    velocity_limits: Mapping[str, float] | None
    torque_limits: Mapping[str, float] | None
    closures: Sequence[Closure] | None
    passive: Sequence[str] | None
    repair: bool
    height: float | None
    licence: str
