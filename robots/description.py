"""`RobotDescription`: everything about a robot that is data, and the models that are made from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, InputError, ModelError, finite_scalar, non_negative, unknown_name
from wbc.core.robot import GRAVITY, Robot, Sole
from wbc.robots import frames, urdf
from wbc.robots.derivation import inertia, posture
from wbc.robots.derivation.servo import ServoRule, effective_inertia, leg_joints
from wbc.robots.frames import FrameDescription, SoleDescription


@dataclass(frozen=True, eq=False)
class RobotDescription:
    """A robot as data.

    `RobotDescription.from_urdf` fills in everything that is not known; `wbc.robots.load` has the built-in ones.

    Attributes:
        name: Name of the robot.
        urdf: The one URDF string that Pinocchio and MuJoCo read; limits are in it.
        soles: Left and right sole.
        half_sitting: Joint → position, for every joint, rad or m.
        armature: Joint → rotor inertia seen at the joint, for every joint, kg m² (kg for prismatic joints).
        imu: Frame of the inertial measurement unit.
        torso: Link of the chest.
        hands: Role → frame, such as {"left_hand": "l_wrist"}.
        servo: Rule for the servo gains.
        gains: Joint → (kp, kd) where the rule does not apply, Nm/rad and Nms/rad.
        package_dirs: Where `package://` of the URDF is looked up, for viewers.
        height: Standing height with straight legs, m; None when unknown.
        source: Where the model comes from.
        licence: Its licence.
        derived: What was derived from the model and how, one line each.
    """

    name: str
    urdf: str
    soles: tuple[SoleDescription, SoleDescription]
    half_sitting: Mapping[str, float]
    armature: Mapping[str, float]
    imu: FrameDescription
    torso: str
    hands: Mapping[str, str] = field(default_factory=dict)
    servo: ServoRule = field(default_factory=ServoRule)
    gains: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    package_dirs: tuple[str, ...] = ()
    height: float | None = None
    source: str = "given by the user"
    licence: str = "unknown"
    derived: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for mapping in ("half_sitting", "armature", "hands", "gains"):
            object.__setattr__(self, mapping, MappingProxyType(dict(getattr(self, mapping))))
        if tuple(sole.name for sole in self.soles) != frames.SOLE_NAMES:
            raise InputError(f"soles must be {frames.SOLE_NAMES}, got {tuple(s.name for s in self.soles)}")
        names = self.joint_names
        for what, given in (("half-sitting", self.half_sitting), ("armature", self.armature)):
            missing = [name for name in names if name not in given]
            if missing:
                raise InputError(f"{what} must give every joint; missing: {', '.join(missing)}")
        for name, value in self.armature.items():
            self._known(name)
            non_negative(f"armature of joint '{name}' (kg m²)", value)
        for name, (kp, kd) in self.gains.items():
            self._known(name)
            non_negative(f"kp of joint '{name}' (Nm/rad)", kp)
            non_negative(f"kd of joint '{name}' (Nms/rad)", kd)
        model = self._model
        for name, value in self.half_sitting.items():
            self._known(name)
            i = 7 + names.index(name)
            low, high = float(model.lowerPositionLimit[i]), float(model.upperPositionLimit[i])
            finite_scalar(f"half-sitting of joint '{name}'", value, low=low, high=high)
        self._check_stance()
        self.robot()  # raises for frames that do not exist

    @classmethod
    def from_urdf(
        cls,
        source: str | Path,
        *,
        left_sole: str | FrameDescription,
        right_sole: str | FrameDescription,
        name: str | None = None,
        sole_size: tuple[float, float] | None = None,
        package_dirs: tuple[str | Path, ...] = (),
        half_sitting: Mapping[str, float] | None = None,
        torso: str | None = None,
        imu: str | FrameDescription | None = None,
        hands: Mapping[str, str] | None = None,
        armature: float | Mapping[str, float] | None = None,
        servo: ServoRule | None = None,
        gains: Mapping[str, tuple[float, float]] | None = None,
        position_limits: Mapping[str, tuple[float, float]] | None = None,
        velocity_limits: Mapping[str, float] | None = None,
        torque_limits: Mapping[str, float] | None = None,
        repair: bool = False,
        height: float | None = None,
        licence: str = "unknown",
        provenance: str | None = None,
    ) -> RobotDescription:
        """Describe a robot that has never been seen; what is not given is derived from the model.

        `wbc.robots.derivation.defaults` says how; the lines of `derived` say what came out.

        Args:
            source: URDF, a path or the XML itself.
            left_sole: Frame of the URDF (link or fixed joint), or a placement in a link; a `SoleDescription` gives
                the rectangle, too.
            right_sole: Same for the right foot.
            name: Name of the robot; that in the URDF when None.
            sole_size: Length and width of both soles, m; from the geometry of the feet when None.
            package_dirs: Where `package://` is looked up.
            half_sitting: Joint → position, all or some joints.
            torso: Link of the chest.
            imu: Frame of the inertial measurement unit, of the URDF or a placement in a link.
            hands: Role → frame.
            armature: Rotor inertia seen at the joints, one for all or joint → value, kg m².
            servo: Rule for the servo gains.
            gains: Joint → (kp, kd), Nm/rad and Nms/rad.
            position_limits: Joint → (lower, upper), in place of the URDF's.
            velocity_limits: Joint → largest speed, in place of the URDF's.
            torque_limits: Joint → largest torque, in place of the URDF's.
            repair: Clamp inertias that no body can have instead of refusing them.
            height: Standing height with straight legs, m.
            licence: Licence of the model.
            provenance: Where the model comes from; the path when None.

        Returns:
            A complete description.

        Raises:
            InputError: A file, frame, joint or value that cannot be used.
            ModelError: A URDF that cannot be simulated or controlled as it stands.
        """
        from wbc.robots.derivation.defaults import describe  # noqa: PLC0415 - it builds descriptions

        return describe(
            source,
            left_sole=left_sole,
            right_sole=right_sole,
            name=name,
            sole_size=sole_size,
            package_dirs=package_dirs,
            half_sitting=half_sitting,
            torso=torso,
            imu=imu,
            hands=hands,
            armature=armature,
            servo=servo,
            gains=gains,
            position_limits=position_limits,
            velocity_limits=velocity_limits,
            torque_limits=torque_limits,
            repair=repair,
            height=height,
            licence=licence,
            provenance=provenance,
        )

    def pinocchio_model(self) -> pin.Model:
        """Pinocchio model with free-flyer, limits, armature, gravity and the sole and IMU frames; a new copy."""
        return self._model.copy()

    def robot(self) -> Robot:
        """A new `Robot`, at half-sitting with the soles on z = 0 and the origin midway between them."""
        model = self.pinocchio_model()
        return Robot(
            model,
            [Sole(sole.name, sole.frame, sole.length, sole.width) for sole in self.soles],
            posture.standing_configuration(model, self._sole_frames, self.half_sitting),
            torso_frame=self.torso,
            imu_frame=self.imu.frame,
            frames=self.hands,
        )

    def urdf_without_geometry(self) -> str:
        """The URDF without visuals, collisions and meshes: the same kinematics and inertias."""
        return urdf.without_geometry(self.urdf)

    def attachment(self, frame: str) -> tuple[str, pin.SE3]:
        """Where a frame sits on the moving link that carries it.

        Links that are fixed to others do not survive MuJoCo's import; this one does.

        Args:
            frame: A sole frame, the IMU frame or any frame of the URDF.

        Returns:
            Name of the link, and the placement of the frame in it.

        Raises:
            UnknownNameError: There is no such frame.
        """
        return frames.carrier(self._model, frame)

    def ankle(self, sole: str) -> Array:
        """Origin of the last ankle joint in the sole frame, shape (3,), m.

        Args:
            sole: "left_foot" or "right_foot".

        Raises:
            UnknownNameError: There is no such sole.
        """
        for description in self.soles:
            if description.name == sole:
                frame = self._model.frames[self._model.getFrameId(description.frame)]
                return np.array(frame.placement.inverse().translation)
        unknown_name("sole", sole, frames.SOLE_NAMES)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Actuated joints in the order of the velocity vector, length na."""
        return tuple(list(self._model.names)[2:])

    @cached_property
    def armature_array(self) -> Array:
        """Rotor inertia of each joint, shape (na,), kg m²."""
        return _frozen([self.armature[name] for name in self.joint_names])

    @cached_property
    def effective_inertia(self) -> Array:
        """Inertia that each servo accelerates at half-sitting, shape (na,), kg m²."""
        q = posture.standing_configuration(self._model, self._sole_frames, self.half_sitting)
        return _frozen(
            effective_inertia(self._model, q, self._sole_frames, self.armature_array, self.servo.stance_share)
        )

    @cached_property
    def kp(self) -> Array:
        """Servo stiffness of each joint, shape (na,), Nm/rad."""
        return self._gain(0)

    @cached_property
    def kd(self) -> Array:
        """Servo damping of each joint, shape (na,), Nms/rad."""
        return self._gain(1)

    @cached_property
    def torque_limit(self) -> Array:
        """Largest torque of each joint, shape (na,), Nm."""
        return _frozen(self._model.upperEffortLimit[6:])

    @cached_property
    def velocity_limit(self) -> Array:
        """Largest speed of each joint, shape (na,), rad/s."""
        return _frozen(self._model.upperVelocityLimit[6:])

    @cached_property
    def position_limits(self) -> tuple[Array, Array]:
        """Lower and upper position limits, each of shape (na,), rad."""
        return _frozen(self._model.lowerPositionLimit[7:]), _frozen(self._model.upperPositionLimit[7:])

    @cached_property
    def legs(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Joints of the left and the right leg, from the root to the sole."""
        names = list(self._model.names)
        left, right = (
            tuple(names[joint] for joint in leg_joints(self._model, frame)) for frame in self._sole_frames
        )
        return left, right

    def summary(self) -> dict[str, Any]:
        """What one wants to know at a glance, ready for JSON."""
        robot = self.robot()
        return {
            "name": self.name,
            "mass_kg": robot.mass,
            "height_m": self.height,
            "com_height_m": float(robot.com[2]),
            "dof": robot.na,
            "nv": robot.nv,
            "legs": {"left": list(self.legs[0]), "right": list(self.legs[1])},
            "soles": {
                sole.name: {
                    "frame": sole.frame,
                    "link": sole.link,
                    "size_m": [sole.length, sole.width],
                    "ankle_m": self.ankle(sole.name).tolist(),
                }
                for sole in self.soles
            },
            "stance_width_m": float(
                np.linalg.norm(
                    robot.placement(self.soles[0].frame).translation
                    - robot.placement(self.soles[1].frame).translation
                )
            ),
            "torso": self.torso,
            "imu": self.imu.frame,
            "hands": dict(self.hands),
            "joints": {
                name: {
                    "position": [float(robot.position_lower[i]), float(robot.position_upper[i])],
                    "velocity": float(robot.velocity_limit[i]),
                    "torque": float(robot.torque_limit[i]),
                    "half_sitting": float(self.half_sitting[name]),
                    "armature": float(self.armature[name]),
                    "kp": float(self.kp[i]),
                    "kd": float(self.kd[i]),
                }
                for i, name in enumerate(self.joint_names)
            },
            "source": self.source,
            "licence": self.licence,
            "derived": list(self.derived),
        }

    def report(self) -> str:
        """The summary as text."""
        facts = self.summary()
        height = "unknown" if self.height is None else f"{self.height:.2f} m"
        lines = [
            f"{self.name}: {facts['mass_kg']:.2f} kg, height {height}, centre of mass at "
            f"{facts['com_height_m']:.3f} m in half-sitting, {facts['dof']} joints",
            f"  source   {self.source}",
            f"  licence  {self.licence}",
        ]
        for sole in self.soles:
            x, y, z = self.ankle(sole.name)
            lines.append(
                f"  {sole.name:<10} {sole.frame}: {sole.length * 1e3:.0f} x {sole.width * 1e3:.0f} mm, "
                f"ankle at ({x * 1e3:.0f}, {y * 1e3:.0f}, {z * 1e3:.0f}) mm"
            )
        lines.append(f"  torso {self.torso}, IMU {self.imu.frame}, hands {dict(self.hands) or 'none'}")
        lines.append(
            f"  {'joint':<28}{'range deg':>16}{'rad/s':>8}{'Nm':>8}{'half-sitting deg':>18}{'kp':>9}{'kd':>8}"
        )
        for name, joint in facts["joints"].items():
            low, high = np.degrees(joint["position"])
            lines.append(
                f"  {name:<28}{f'{low:.0f} .. {high:.0f}':>16}{joint['velocity']:>8.2f}{joint['torque']:>8.1f}"
                f"{np.degrees(joint['half_sitting']):>18.2f}{joint['kp']:>9.0f}{joint['kd']:>8.1f}"
            )
        if self.derived:
            lines.append("  derived from the model:")
            lines += [f"    {line}" for line in self.derived]
        return "\n".join(lines)

    @cached_property
    def _model(self) -> pin.Model:
        root = urdf.read(self.urdf)
        if urdf.tidy(root) or urdf.joints_without_torque_limit(root):
            raise ModelError("the URDF of a description must be tidy; use RobotDescription.from_urdf")
        inertia.check(root)
        model = build_model(self.urdf, self.name)
        for description in (*self.soles, self.imu):
            frames.add_frame(model, description)
        model.armature[6:] = [self.armature.get(name, 0.0) for name in list(model.names)[2:]]
        return model

    @property
    def _sole_frames(self) -> tuple[str, str]:
        return self.soles[0].frame, self.soles[1].frame

    def _gain(self, which: int) -> Array:
        q = posture.standing_configuration(self._model, self._sole_frames, self.half_sitting)
        bound = self.servo.bound(self._model, q, self._sole_frames)
        gain = np.array(self.servo.gains(self.effective_inertia, bound)[which])
        for name, given in self.gains.items():
            gain[self.joint_names.index(name)] = given[which]
        return _frozen(gain)

    def _known(self, joint: str) -> None:
        if joint not in self.joint_names:
            unknown_name("joint", joint, self.joint_names)

    def _check_stance(self) -> None:
        """Refuse a half-sitting in which the robot would tip over at once."""
        q = posture.standing_configuration(self._model, self._sole_frames, self.half_sitting)
        posture.check_posture(self._model, self._sole_frames, q)
        data = self._model.createData()
        com = pin.centerOfMass(self._model, data, q)
        pin.updateFramePlacements(self._model, data)
        corners = []
        for sole in self.soles:
            placement = data.oMf[self._model.getFrameId(sole.frame)]
            for x in (-0.5, 0.5):
                for y in (-0.5, 0.5):
                    corners.append(placement.act(np.array([x * sole.length, y * sole.width, 0.0]))[:2])
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        if (com[:2] < low).any() or (com[:2] > high).any():
            raise InputError(
                f"half-sitting puts the centre of mass at ({com[0]:.3f}, {com[1]:.3f}) m, outside the soles, "
                f"x {low[0]:.3f} to {high[0]:.3f} m and y {low[1]:.3f} to {high[1]:.3f} m from their middle"
            )


def build_model(xml: str, name: str) -> pin.Model:
    """Parse a tidied URDF with Pinocchio.

    Args:
        xml: URDF string.
        name: Name of the model.

    Returns:
        Model with a free-flyer root and standard gravity.

    Raises:
        ModelError: Pinocchio cannot read it.
    """
    try:
        model = pin.buildModelFromXML(urdf.without_geometry(xml), pin.JointModelFreeFlyer())
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"Pinocchio cannot read the URDF of '{name}': {error}") from error
    model.name = name
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    return model


def _frozen(values: Any) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
