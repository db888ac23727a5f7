"""`RobotDescription`: a robot as data, and the models that are made from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.core.arguments import check_fields, checked
from wbc.core.errors import Array, InputError, ModelError, choose, finite_scalar, non_negative, positive
from wbc.core.registry import named_parameters
from wbc.core.robot import GRAVITY, Robot, Sole
from wbc.robots import frames, urdf
from wbc.robots.derivation import defaults, inertia, posture
from wbc.robots.derivation.servo import ARMATURE_RATIO, ServoRule, effective_inertia, leg_joints
from wbc.robots.frames import FrameDescription, SoleDescription
from wbc.robots.report import report


@dataclass(frozen=True, eq=False)
class RobotDescription:
    """A robot as data.

    `RobotDescription.from_urdf` derives everything that is not given; `wbc.robots.load` has the built-in robots.

    Attributes:
        name: Name of the robot.
        urdf: The one URDF string that Pinocchio and MuJoCo read, with all limits.
        soles: Left and right sole.
        half_sitting: Joint → position, for every joint, rad or m.
        armature: Joint → rotor inertia seen at the joint, for every joint, kg m² (kg for prismatic joints).
        imu: Frame of the inertial measurement unit.
        torso: Link of the chest.
        hands: Role → frame, such as {"left_hand": "l_wrist"}.
        servo: Rule for the servo gains.
        gains: Joint → (kp, kd) where the rule does not apply, Nm/rad and Nms/rad.
        package_dirs: Folders for `package://` in the URDF, for viewers.
        height: Standing height with straight legs, m; None when unknown.
        source: Origin of the model.
        licence: Its licence.
        derived: Values that were derived from the model, one line each.
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
        check_fields(self)
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
            choose("joint", name, names)
            non_negative(f"armature of joint '{name}' (kg m²)", value)
        for name, (kp, kd) in self.gains.items():
            choose("joint", name, names)
            non_negative(f"kp of joint '{name}' (Nm/rad)", kp)
            non_negative(f"kd of joint '{name}' (Nms/rad)", kd)
        model = self._model
        for name, value in self.half_sitting.items():
            choose("joint", name, names)
            i = 7 + names.index(name)
            low, high = float(model.lowerPositionLimit[i]), float(model.upperPositionLimit[i])
            finite_scalar(f"half-sitting of joint '{name}'", value, low=low, high=high)
        q = self._half_sitting_configuration()
        posture.check_posture(model, self._sole_frames, q)
        posture.check_balance(model, self.soles, q)
        self.robot()  # raises for frames that do not exist

    @classmethod
    @named_parameters("RobotDescription.from_urdf")
    @checked
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
        """Return the description of any humanoid; what is not given is derived from the model.

        `wbc.robots.derivation.defaults` states the rules; `derived` lists the results.

        Args:
            source: URDF, a path or the XML itself.
            left_sole: Frame of the URDF (link or fixed joint), or a placement in a link; a `SoleDescription` gives
                the rectangle, too.
            right_sole: Same for the right foot.
            name: Name of the robot; that in the URDF when None.
            sole_size: Length and width of both soles, m; from the geometry of the feet when None.
            package_dirs: Folders for `package://` in the URDF.
            half_sitting: Joint → position of all or some joints, rad or m.
            torso: Link of the chest.
            imu: Frame of the inertial measurement unit, of the URDF or a placement in a link.
            hands: Role → frame.
            armature: Rotor inertia seen at the joints, one for all or joint → value, kg m².
            servo: Rule for the servo gains.
            gains: Joint → (kp, kd), Nm/rad and Nms/rad.
            position_limits: Joint → (lower, upper), in place of the URDF's, rad or m.
            velocity_limits: Joint → largest speed, in place of the URDF's, rad/s or m/s.
            torque_limits: Joint → largest torque or force, in place of the URDF's, Nm or N.
            repair: Clamp inertias that no body can have instead of refusing them.
            height: Standing height with straight legs, m.
            licence: Licence of the model.
            provenance: Origin of the model; the path when None.

        Raises:
            UnknownNameError: A parameter, frame or joint that does not exist.
            InputError: A file, frame, joint or value that cannot be used.
            ModelError: A URDF that cannot be simulated or controlled as it stands.
        """
        root = urdf.read(source)
        notes = urdf.tidy(root)
        urdf.set_limits(root, position=position_limits, velocity=velocity_limits, torque=torque_limits)
        if repair:
            notes += inertia.repair(root)
        inertia.check(root)
        name = name or str(root.get("name") or "robot")
        model = urdf.pinocchio_model(urdf.to_string(root), name)

        is_file = urdf.is_file(source)
        base = Path(source).expanduser().resolve().parent if is_file else None
        directories = tuple(str(Path(d).expanduser()) for d in package_dirs)
        soles = (
            defaults.complete_sole(root, model, "left_foot", left_sole, sole_size, directories, base, notes),
            defaults.complete_sole(
                root, model, "right_foot", right_sole, sole_size, directories, base, notes
            ),
        )
        for sole in soles:
            frames.add_frame(model, sole)
        defaults.check_sides(model, soles)

        joints = defaults.complete_half_sitting(model, soles, half_sitting or {}, notes)
        q = posture.standing_configuration(model, (soles[0].frame, soles[1].frame), joints)
        com_height = float(pin.centerOfMass(model, model.createData(), q)[2])
        mass = pin.computeTotalMass(model)
        missing = urdf.joints_without_torque_limit(root)
        if missing:
            torques = defaults.torque_limits(model, soles, missing, mass * GRAVITY * com_height)
            urdf.set_limits(root, torque=torques)
            listed = ", ".join(f"{joint} {torque:.1f}" for joint, torque in torques.items())
            notes.append(f"torque limits not given, from mass and size (Nm): {listed}")
        rotors = defaults.complete_armature(
            list(joints), armature, ARMATURE_RATIO * mass * com_height**2, notes
        )
        if torso is None:
            torso = defaults.find_torso(model, soles)
            notes.append(f"torso: link '{torso}'")
        choose("link", torso, frames.link_names(model))
        return cls(
            name=name,
            urdf=urdf.to_string(root),
            soles=soles,
            half_sitting=joints,
            armature=rotors,
            imu=defaults.complete_imu(model, imu, notes),
            torso=torso,
            hands=hands or {},
            servo=servo or ServoRule(),
            gains=gains or {},
            package_dirs=directories,
            height=None if height is None else positive("height (m)", height),
            source=provenance or (str(source) if is_file else "URDF string"),
            licence=licence,
            derived=tuple(notes),
        )

    def pinocchio_model(self) -> pin.Model:
        """Return a copy of the Pinocchio model: free-flyer, limits, armature, gravity, frames of soles and IMU."""
        return self._model.copy()

    def robot(self) -> Robot:
        """Return a new `Robot` at half-sitting, the soles on z = 0 and the origin midway between them."""
        model = self.pinocchio_model()
        return Robot(
            model,
            [Sole(sole.name, sole.frame, sole.length, sole.width) for sole in self.soles],
            self._half_sitting_configuration(),
            torso_frame=self.torso,
            imu_frame=self.imu.frame,
            frames=self.hands,
        )

    def urdf_without_geometry(self) -> str:
        """Return the URDF without visuals, collisions and meshes: the same kinematics and inertias."""
        return urdf.without_geometry(self.urdf)

    def attachment(self, frame: str) -> tuple[str, pin.SE3]:
        """Return the moving link that carries a frame, and the placement of the frame in this link.

        MuJoCo's import keeps moving links and merges those that are fixed to them.

        Args:
            frame: A sole frame, the IMU frame or any frame of the URDF.

        Raises:
            UnknownNameError: There is no such frame.
        """
        return frames.carrier(self._model, frame)

    def ankle(self, sole: str) -> Array:
        """Return the origin of the last ankle joint in the sole frame, shape (3,), m.

        Args:
            sole: "left_foot" or "right_foot".

        Raises:
            UnknownNameError: There is no such sole.
        """
        description = self.soles[frames.SOLE_NAMES.index(choose("sole", sole, frames.SOLE_NAMES))]
        frame = self._model.frames[self._model.getFrameId(description.frame)]
        return np.array(frame.placement.inverse().translation)

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
        q = self._half_sitting_configuration()
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
        """Return mass, size, soles, joints and sources, ready for JSON."""
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
        """Return the summary as text."""
        return report(self.summary())

    @cached_property
    def _model(self) -> pin.Model:
        root = urdf.read(self.urdf)
        if urdf.tidy(root) or urdf.joints_without_torque_limit(root):
            raise ModelError("the URDF of a description must be tidy; use RobotDescription.from_urdf")
        inertia.check(root)
        model = urdf.pinocchio_model(self.urdf, self.name)
        for description in (*self.soles, self.imu):
            frames.add_frame(model, description)
        model.armature[6:] = [self.armature.get(name, 0.0) for name in list(model.names)[2:]]
        return model

    @property
    def _sole_frames(self) -> tuple[str, str]:
        return self.soles[0].frame, self.soles[1].frame

    def _gain(self, which: int) -> Array:
        q = self._half_sitting_configuration()
        bound = self.servo.bound(self._model, q, self._sole_frames)
        gain = np.array(self.servo.gains(self.effective_inertia, bound)[which])
        for name, given in self.gains.items():
            gain[self.joint_names.index(name)] = given[which]
        return _frozen(gain)

    def _half_sitting_configuration(self) -> Array:
        return posture.standing_configuration(self._model, self._sole_frames, self.half_sitting)


def _frozen(values: Any) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
