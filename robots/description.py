"""`RobotDescription`: a robot as data, and the models that are made from it."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, Unpack

import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, ModelError, choose
from wbc.base.files import home_path
from wbc.base.html import html_table
from wbc.base.numbers import Array, finite_scalar
from wbc.base.settings import NonNegative, Number, Positive, from_json, to_json
from wbc.core.drive.servos import Servos
from wbc.core.frames import FrameDescription, Sole
from wbc.core.limits.obstacles import CollisionCapsule, CollisionSphere, Shape
from wbc.core.model import Closure, Coupling, driven_names, is_floating, joints_to
from wbc.core.robot import Robot
from wbc.robots import frames, write_urdf
from wbc.robots.derivation import link_shapes, posture
from wbc.robots.derivation.complete import complete
from wbc.robots.derivation.defaults import feet_hint
from wbc.robots.derivation.inertia import defect
from wbc.robots.derivation.servo import ServoRule, effective_inertia, read_gains
from wbc.robots.mechanism import Mechanism, unlimited
from wbc.robots.options import DescriptionOptions
from wbc.robots.readers import robot_urdf
from wbc.robots.report import doubts, facts, report

Base = Literal["floating", "fixed"]
"""Kind of a base."""

Inertia = Annotated[tuple[Number, ...], Field(min_length=10, max_length=10)]
"""The ten numbers of `toDynamicParameters` of a `pin.Inertia`."""

HASHED = (
    *("soles", "imu", "torso", "servo", "base", "half_sitting", "armature", "hands", "gains", "damping"),
    *("frictionloss", "springs", "torque_ranges", "foot_inertia", "closures", "passive"),
)
"""Data that models are made from beside the mechanism, which is hashed as a URDF, in the order of their hash."""


@checked
@dataclass(frozen=True, eq=False)
class RobotDescription:
    """Description of a robot: links, joints, soles, sensors and drives as data; `robot()` makes its model.

    `from_urdf` and `from_mjcf` read a file and derive everything that is not given; `wbc.robots.load` returns the
    built-in robots.

    Attributes:
        name: Name of the robot.
        mechanism: Its links and joints, with all limits; see `wbc.robots.mechanism`.
        soles: Left and right sole; empty for a robot without feet, such as an arm or a quadruped.
        half_sitting: Joint → position, for every joint, rad or m.
        armature: Joint → rotor inertia seen at the joint, for every joint, kg m² (kg for prismatic joints).
        imu: Frame of the inertial measurement unit.
        torso: Link of the chest.
        hands: Role → frame, such as {"left_hand": "l_wrist"}.
        servo: Rule for the servo gains.
        gains: Joint → (kp, kd) of joints to which the rule does not apply, Nm/rad and Nms/rad.
        damping: Joint → viscous damping beside its drive, Nms/rad; it is in the plant and in the controller's model.
        frictionloss: Joint → dry friction, Nm; it is in the plant, but not in the controller's model.
        springs: Joint → (stiffness, rest position) of a spring parallel to its drive, Nm/rad and rad; it is in the
            plant and in the controller's model.
        torque_ranges: Joint → (smallest, largest) torque, Nm, of joints whose limits differ by direction.
        passive: Joints without a drive, whose torque is zero, such as those of the rods in a closed chain.
        closures: Closures of kinematic chains, pairs of frames that stay together.
        foot_inertia: Sole → inertia that a foot adds to its leg, as the ten numbers of `toDynamicParameters` of a
            `pin.Inertia` in the frame of the last joint of the leg; it is in the controller's model, since a plant
            builds the feet itself.
        locked: Joint of the file that is fixed in the robot → its position, rad or m. Such a joint may move in a
            simulation of your own, as a spring does.
        sensors: Role → name of the sensor in the MJCF. The roles are "gyroscope", "accelerometer", "<body> force" and
            "<body> torque".
        package_dirs: Folders with the meshes of the URDF, for `package://` and for relative paths.
        height: Standing height with straight legs, m; None when unknown.
        source: Origin of the model.
        licence: Licence of the model.
        derived: Values that were derived from the model, as one line of text each.
        doubtful: Doubts of the reader of the file, one line each, such as on a force that the controller's model
            does not have; `doubts` adds what the values say.
    """

    name: str
    mechanism: Mechanism
    soles: tuple[Sole, ...]
    half_sitting: Mapping[str, float]
    armature: Annotated[Mapping[str, NonNegative], "kg m²"]
    imu: FrameDescription
    torso: str
    hands: Mapping[str, str] = field(default_factory=dict)
    servo: ServoRule = field(default_factory=ServoRule)
    gains: Mapping[str, tuple[NonNegative, NonNegative]] = field(default_factory=dict)
    damping: Annotated[Mapping[str, NonNegative], "Nms/rad"] = field(default_factory=dict)
    frictionloss: Annotated[Mapping[str, NonNegative], "Nm"] = field(default_factory=dict)
    springs: Mapping[str, tuple[NonNegative, Number]] = field(default_factory=dict)
    torque_ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    passive: tuple[str, ...] = ()
    closures: tuple[Closure, ...] = ()
    foot_inertia: Mapping[str, Inertia] = field(default_factory=dict)
    locked: Mapping[str, float] = field(default_factory=dict)
    sensors: Mapping[str, str] = field(default_factory=dict)
    package_dirs: tuple[str, ...] = ()
    height: Annotated[Positive, "m"] | None = None
    source: str = "given by the user"
    licence: str = "unknown"
    derived: tuple[str, ...] = ()
    doubtful: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for item in fields(self):
            if isinstance(value := getattr(self, item.name), Mapping):
                object.__setattr__(self, item.name, MappingProxyType(dict(value)))
        if self.soles and tuple(sole.name for sole in self.soles) != frames.SOLE_NAMES:
            raise InputError(
                f"soles must be {frames.SOLE_NAMES}, or none, got {tuple(s.name for s in self.soles)}"
            )
        if self.soles and self.base == "fixed":
            raise InputError(
                "a robot with feet is not bolted to the world: base='fixed' is for one without soles"
            )
        names = self.joint_names
        for what, given in (("half-sitting", self.half_sitting), ("armature", self.armature)):
            missing = [name for name in names if name not in given]
            if missing:
                raise InputError(f"{what} must give every joint; missing: {', '.join(missing)}")
        by_joint = self.half_sitting, self.armature, self.gains, self.damping, self.frictionloss, self.springs
        for name in (*itertools.chain.from_iterable(by_joint), *self.passive):
            choose("joint", name, names)
        if len(set(self.passive)) < len(self.passive):
            raise InputError(f"passive joints must be named once each, got {', '.join(self.passive)}")
        for name, numbers in self.foot_inertia.items():
            choose("sole", name, frames.SOLE_NAMES)
            if not numbers[0] > 0.0:
                raise InputError(
                    f"the foot_inertia of '{name}' must have a mass above 0, got {numbers[0]:g} kg"
                )
            foot = pin.Inertia.FromDynamicParameters(np.array(numbers))
            if why := defect(foot.mass, foot.inertia):
                raise InputError(f"the foot_inertia of '{name}' is that of no body: {why}")
        for name, (low, high) in self.torque_ranges.items():
            if not low < high:
                raise InputError(
                    f"torque range of joint '{name}' must have low < high, got ({low:g}, {high:g})"
                )
        for name, low, high in zip(names, *map(np.ndarray.tolist, self.position_limits), strict=True):
            finite_scalar(f"half-sitting of joint '{name}'", self.half_sitting[name], low=low, high=high)
        q = self._half_sitting_configuration()
        if self.soles:
            posture.check_standing(self._model, self.soles, q)
        self.robot()  # raises for frames that do not exist

    def __reduce__(self) -> tuple[Any, ...]:
        return from_json, (type(self), to_json(self))

    @classmethod
    @checked
    def from_urdf(
        cls,
        source: str | Path,
        *,
        left_sole: str | FrameDescription | None = None,
        right_sole: str | FrameDescription | None = None,
        name: str | None = None,
        sole_size: tuple[float, float] | None = None,
        package_dirs: tuple[str | Path, ...] = (),
        base: Base = "floating",
        provenance: str | None = None,
        **options: Unpack[DescriptionOptions],
    ) -> RobotDescription:
        """Return the description of any robot in a URDF; values that are not given are derived from the model.

        `wbc.robots.derivation.defaults` states the rules; `derived` lists the results.

        Args:
            source: URDF, a path or the XML itself.
            left_sole: Frame of the URDF (link or fixed joint), or a placement in a link; a `Sole` also gives the
                rectangle. With None for both soles the robot has no feet; it is then for a `Controller` of your own.
            right_sole: Same for the right foot; both soles are given, or none.
            name: Name of the robot; that in the URDF when None.
            sole_size: Length and width of both soles, m; taken from the geometry of the feet when None.
            package_dirs: Folders for `package://` in the URDF.
            base: "fixed" for a robot without feet whose root is bolted to the world; "floating" otherwise.
            provenance: Origin of the model, for reports; the path when None.
            **options: See `wbc.robots.options.DescriptionOptions`.
        """
        robot = robot_urdf.read(
            source,
            (left_sole, right_sole),
            sole_size,
            package_dirs=tuple(str(home_path(folder)) for folder in package_dirs),
            fixed=base == "fixed",
            lock=options.get("lock") or {},
            repair=options.get("repair", False),
        )
        return complete(cls, robot, name=name, provenance=provenance, **options)

    @classmethod
    @checked
    def from_mjcf(
        cls,
        source: object,
        *,
        left_sole: str | FrameDescription | None = None,
        right_sole: str | FrameDescription | None = None,
        name: str | None = None,
        sole_size: tuple[float, float] | None = None,
        feet: bool = True,
        base: Base = "floating",
        root: str | None = None,
        meshes: bool = True,
        use_gains: bool = True,
        provenance: str | None = None,
        **options: Unpack[DescriptionOptions],
    ) -> RobotDescription:
        """Return the description of any humanoid in an MJCF, read through MuJoCo's compiled model.

        These values are those of the file: joints, inertias, limits, rotor inertias, damping, friction, gains of
        position actuators, a keyframe in which the robot stands, and the site of the IMU. Values that are not in the
        file are derived as in `from_urdf`.

        Args:
            source: MJCF, a path or the XML itself, an `mujoco.MjSpec` (not changed) or a compiled `mujoco.MjModel`.
            left_sole: Body, site or geom of the left foot, or a `Sole`; the ends of the lowest limbs when None.
            right_sole: Same for the right foot; both soles are given, or none.
            name: As in `from_urdf`.
            sole_size: Length and width of both soles, m; taken from the geoms that can touch the ground when None.
            feet: False for a robot without feet, such as an arm or a quadruped; it is then for a `Controller` of your
                own.
            base: "fixed" for a robot without feet that is bolted to the world at its place in the file.
            root: Body that floats; the one with a free joint when None. Its joints are replaced by a free joint, unless
                the base is fixed.
            meshes: False to read a file whose meshes are missing; every body must then have its inertia in the file.
            use_gains: False to derive all servo gains instead of taking those of the file.
            provenance: As in `from_urdf`.
            **options: See `wbc.robots.options.DescriptionOptions`. Defaults: half-sitting is a keyframe in which the
                robot stands; the IMU is at the site of a gyroscope; velocity limits, which an MJCF does not have, are
                20 rad/s; torque limits are the tightest ones of the file.
        """
        from wbc.robots.readers import robot_mjcf  # noqa: PLC0415  MuJoCo is imported with it

        robot = robot_mjcf.read(
            source,
            (left_sole, right_sole),
            sole_size,
            feet=feet,
            fixed=base == "fixed",
            root=root,
            meshes=meshes,
            use_gains=use_gains,
            lock=options.get("lock") or {},
        )
        return complete(cls, robot, name=name, provenance=provenance, **options)

    @checked
    def with_servos(self, gains: Sequence[str]) -> RobotDescription:
        """Return the same robot with other servo gains.

        Args:
            gains: Texts of the form pattern=kp,kd, such as "*knee*=100,2", with kp in Nm/rad and kd in Nms/rad; *
                stands for any letters.
        """
        if not gains:
            return self
        return replace(self, gains={**self.gains, **read_gains(gains, self.joint_names)})

    def pinocchio_model(self) -> pin.Model:
        """Return a copy of the Pinocchio model with free-flyer, limits, armature, gravity, and sole and IMU frames."""
        return self._model.copy()

    @staticmethod
    def instead_of(value: object) -> str:
        """Return advice how to get a description from an object of another type; empty if there is none."""
        if isinstance(value, Robot):
            return f"the one that the robot was made of, load_robot('{value.name}') of a built-in one"
        return ""

    def robot(self) -> Robot:
        """Return a new `Robot` at half-sitting, the soles on z = 0 and the origin midway between them.

        A robot without feet has its base at the origin.
        """
        model = self.pinocchio_model()
        most = -model.upperEffortLimit[-len(self.joint_names) :]
        springs = (
            self._by_joint(self.springs, itertools.repeat((0.0, 0.0))).T.copy() if self.springs else None
        )
        return Robot(
            model,
            self.soles,
            self._half_sitting_configuration(),
            torso_frame=self.torso,
            imu_frame=self.imu.frame,
            frames=self.hands,
            servos=self.servos,
            springs=None if springs is None else (springs[0], springs[1]),
            damping=self._by_joint(self.damping) if self.damping else None,
            torque_lower=self._by_joint({name: low for name, (low, _) in self.torque_ranges.items()}, most),
            passive=self.passive,
            closures=self.closures,
        )

    def needs_feet(self, what: str) -> None:
        """Raise an `InputError` if the robot has no feet; `what` needs them, such as "a walk"."""
        if not self.soles:
            hint = feet_hint(self._model) or (
                "left_sole and right_sole (--left, --right) say which links they are, of "
                + ", ".join(frames.link_names(self._model)[-8:])
            )
            raise InputError(f"{what} needs two feet, robot '{self.name}' is described without: {hint}")

    @checked
    def urdf_without_geometry(self, *, moving_links: bool = False, rotors: bool = False) -> str:
        """Return a URDF without visuals, collisions and meshes: the same kinematics and inertias.

        Args:
            moving_links: Merge links that are fixed to another link, so that each link has a joint, and an inertia
                along its principal axes. It helps with engines that give 1 kg to a link without inertia, or that read
                only the diagonal of an inertia matrix.
            rotors: Add the rotor inertia of each joint to the moving link behind the joint, as a thin disc about its
                axis, for engines without rotor inertia. Only with `moving_links`.

        Raises:
            InputError: `rotors` is given without `moving_links`, or for a robot with prismatic joints.
        """
        if rotors and not moving_links:
            raise InputError("rotors become a part of moving links: give moving_links=True as well")
        return write_urdf.write(
            self.mechanism, self.name, self.armature if rotors else {}, merged=moving_links
        )

    def collision_shapes(self) -> dict[str, list[CollisionSphere | CollisionCapsule]]:
        """Return link → spheres and capsules for `CollisionLimit`, from its collision or else its visual geometry.

        A box becomes a capsule along its longest side whose diameter is the second longest side. A mesh counts as its
        bounding box.
        """
        return link_shapes.capsules(self.mechanism, self.package_dirs)

    def collision_hulls(self) -> dict[str, list[Shape]]:
        """Return link → shapes for `CollisionLimit`, from collision or else visual geometry, with meshes as hulls."""
        return link_shapes.hulls(self.mechanism, self.package_dirs)

    def attachment(self, frame: str) -> tuple[str, pin.SE3]:
        """Return the moving link that carries a frame, and the placement of the frame in it.

        MuJoCo's import keeps moving links, and merges fixed links into them.
        """
        return frames.carrier(self._model, frame)

    def ankle(self, sole: str) -> Array:
        """Return the origin of the last ankle joint in the frame of a sole, given by its name, shape (3,), m."""
        description = self.soles[frames.SOLE_NAMES.index(choose("sole", sole, frames.SOLE_NAMES))]
        frame = self._model.frames[self._model.getFrameId(description.frame)]
        return np.array(frame.placement.inverse().translation)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Actuated joints in the order of the velocity vector, length na."""
        return tuple(driven_names(self._model))

    @property
    def couplings(self) -> Mapping[str, Coupling]:
        """Joints that are coupled to another joint: joint → its leader, ratio and offset."""
        return MappingProxyType(self.mechanism.couplings)

    @property
    def base(self) -> Base:
        """Kind of the base: "floating", or "fixed" for a robot that is bolted to the world at its root."""
        return "floating" if is_floating(self.mechanism.model) else "fixed"

    @cached_property
    def digest(self) -> str:
        """Hash of all data that models are made from, 12 hexadecimal digits."""
        values = [getattr(self, name) for name in HASHED]
        content = (
            write_urdf.write(self.mechanism, "", {}, shapes=True),
            *(sorted(value.items()) if isinstance(value, Mapping) else value for value in values),
        )
        return hashlib.sha256(repr(content).encode()).hexdigest()[:12]

    @cached_property
    def armature_array(self) -> Array:
        """Rotor inertia of each joint, shape (na,), kg m²."""
        return _frozen(self._by_joint(self.armature))

    @cached_property
    def effective_inertia(self) -> Array:
        """Inertia that each servo accelerates in half-sitting, shape (na,), kg m²."""
        q, share = self._half_sitting_configuration(), self.servo.stance_share
        return _frozen(effective_inertia(self._model, q, self._sole_frames, self.armature_array, share))

    @cached_property
    def kp(self) -> Array:
        """Servo stiffness of each joint, shape (na,), Nm/rad."""
        return self.servos.kp

    @cached_property
    def kd(self) -> Array:
        """Servo damping of each joint, shape (na,), Nms/rad."""
        return self.servos.kd

    @cached_property
    def servos(self) -> Servos:
        """Servo gains of the controls, by the servo rule where the description gives none."""
        bound = self.servo.bound(self._model, self._half_sitting_configuration(), self._sole_frames)
        ankles = tuple(joint for leg in self.legs for joint in leg[-2:])
        tipping = (
            float(bound[self.joint_names.index(ankles[-1])]) / self.servo.ankle_stiffness if ankles else 0.0
        )
        derived = np.transpose(self.servo.gains(self.effective_inertia, bound))
        kp, kd = map(_frozen, self._by_joint(self.gains, derived).T)
        return Servos(kp, kd, frozenset(self.gains), self.joint_names, ankles, tipping)

    @cached_property
    def torque_limit(self) -> Array:
        """Largest torque of each joint in either direction, shape (na,), Nm."""
        return _frozen(self.robot().torque_limit)

    @cached_property
    def velocity_limit(self) -> Array:
        """Largest speed of each joint, shape (na,), rad/s."""
        return _frozen(self._model.upperVelocityLimit[-len(self.joint_names) :])

    @cached_property
    def position_limits(self) -> tuple[Array, Array]:
        """Lower and upper position limits, each of shape (na,), rad; infinite for a continuous joint."""
        na = len(self.joint_names)
        return _frozen(self._model.lowerPositionLimit[-na:]), _frozen(self._model.upperPositionLimit[-na:])

    @cached_property
    def legs(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Joints of the left and of the right leg, from the root to the sole; empty without feet."""
        if not self.soles:
            return (), ()
        names = list(self._model.names)
        left, right = (
            tuple(names[joint] for joint in joints_to(self._model, frame)) for frame in self._sole_frames
        )
        return left, right

    def summary(self) -> dict[str, Any]:
        """Return mass, size, soles, joints and sources as a dictionary for JSON."""
        return facts(self)

    def report(self) -> str:
        """Return the summary as text."""
        return report(self.summary())

    def _repr_html_(self) -> str:
        return html_table(self.report())

    def __repr__(self) -> str:
        mass = pin.computeTotalMass(self._model)
        return f"RobotDescription('{self.name}', {len(self.joint_names)} joints, {mass:.1f} kg)"

    def doubts(self) -> tuple[str, ...]:
        """Return the doubtful values, one line each: guessed limits, soft servos, different legs and others."""
        return doubts(self)

    @property
    def urdf(self) -> str:
        """The robot as a URDF with its shapes, for other engines, whatever it was read from."""
        return write_urdf.write(self.mechanism, self.name, {}, shapes=True)

    @cached_property
    def _model(self) -> pin.Model:
        model = self.mechanism.coupled(self.name)
        if missing := unlimited(model):
            raise ModelError(f"joints of a mechanism must have torque limits: {', '.join(missing)} have none")
        for description in (*self.soles, self.imu):
            frames.add_frame(model, description)
        for joint, (_, most) in self.torque_ranges.items():
            choose("joint", joint, driven_names(model))
            model.upperEffortLimit[model.joints[model.getJointId(joint)].idx_v] = most
        for sole in self.soles:
            if sole.name in self.foot_inertia:
                foot = pin.Inertia.FromDynamicParameters(np.array(self.foot_inertia[sole.name]))
                ankle = model.frames[model.getFrameId(sole.frame)].parentJoint
                model.appendBodyToJoint(ankle, foot, pin.SE3.Identity())
        names = driven_names(model)
        model.armature[-len(names) :] = [self.armature.get(name, 0.0) for name in names]
        return model

    def _by_joint(self, given: Mapping[str, Any], usual: Iterable[Any] = itertools.repeat(0.0)) -> Array:
        """Return the values of all joints, the usual one where none is given, shape (na,) or (na, k)."""
        return np.array(
            [given.get(name, value) for name, value in zip(self.joint_names, usual, strict=False)]
        )

    @property
    def _sole_frames(self) -> tuple[str, ...]:
        return tuple(sole.frame for sole in self.soles)

    def _half_sitting_configuration(self) -> Array:
        return posture.standing_configuration(self._model, self._sole_frames, self.half_sitting)


def _frozen(values: Any) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
