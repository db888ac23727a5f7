"""A robot with a floating base: its model, and its state with all quantities that a tick reads.

`Robot.update(q, v)` runs Pinocchio once; afterwards the mass matrix, bias forces, centre of mass and all frames
are plain attributes. Frames and joints are looked up by name once, when a task or contact is made, never in a tick.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal, NoReturn

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbc.base.checked import checked, fixed
from wbc.base.errors import InputError, ModelError, shown, unknown_name
from wbc.base.numbers import Array, finite_array, finite_scalar, read_only, scalar
from wbc.base.registry import Registry
from wbc.base.settings import NonNegative, Triple
from wbc.core.drive.servos import Servos
from wbc.core.frames import Sole
from wbc.core.model import (
    CarriedMasses,
    Closure,
    couplings_of,
    driven_joints,
    driven_names,
    is_floating,
    joints_to,
)

GRAVITY = 9.80665
"""Standard gravity, m/s² (ISO 80000-3); Pinocchio and MuJoCo models are both set to it."""

UNLIMITED = 1e5
"""Torque and speed limits from this value on are none, in Nm, N, rad/s and m/s: no joint of a robot comes near."""

TINY = 1e-9
"""Torque by which is divided where a drive has none, Nm or N."""

FULL_MASS = 30.0
"""Mass from which on forces in settings are taken as they are, kg; a lighter robot takes them in proportion."""

FULL_HEIGHT = 0.67
"""Height of the CoM from which on lengths in settings are taken as they are, m: that of the G1; a smaller robot takes
them in proportion."""

SIDES = ("left", "right")
"""Sides of a robot: order of its soles and legs, and prefix of every name that a foot adds to a model."""

BEYOND = 0.02
"""Distance beyond its limits up to which a joint may be held, rad."""

LEVER = 0.1
"""Length of a sliding joint that counts as one rad of a turning one does, m: that of a small limb, or a gripper."""

UNIT = 1e-3
"""Difference from 1 up to which the length of a quaternion is rounding."""

BASE_DOF = 6
"""Velocity coordinates of the floating base: linear, then angular, both in the base frame."""


class _View:
    """Piece of Pinocchio's memory for `numpy.asarray`, with a reference to the data that owns it."""

    def __init__(self, array: Array, owner: pin.Data) -> None:
        self.__array_interface__ = array.__array_interface__
        self._owner = owner


Reads = Literal["kinematics", "all"]
"""State of a robot that something needs at rest: what `Robot.update_jacobians` computes, or all of `Robot.update`."""


DESCRIBED = "make a robot from a description with another value, as of `dataclasses.replace`"
"""Advice in place of an assignment to an attribute that the description of a robot gives."""


def _refuse_quaternion(what: str, quaternion: Array) -> NoReturn:
    length = float(np.linalg.norm(quaternion))
    raise InputError(f"quaternion of the {what} must have length 1, got {length:g}: {quaternion.tolist()}")


def force_scale(mass: float) -> float:
    """Return the factor of the forces in settings for a robot of a mass, kg: below 1 for a light one."""
    return min(1.0, mass / FULL_MASS)


class Robot:
    """Pinocchio model, data and current state of a robot, whose base floats, or is bolted to the world.

    A bolted base has no coordinates: configuration and velocity contain the joints alone, and the centre of mass is
    that of the moving links. A joint that is coupled to another joint has no coordinate either, see `couplings`.

    Attributes:
        name: Name of the robot.
        model: Pinocchio model; only `carry` changes it, by its inertias.
        data: Pinocchio data of the current state.
        soles: The soles that can make contact, left first; empty for a robot without feet.
        half_sitting: Reference configuration with the soles on the ground z = 0, shape (nq,).
        nq: Size of a configuration: base position (world, m), base quaternion (xyzw), joints (rad or m).
        nv: Size of a velocity: base linear and angular velocity in the base frame, joints.
        com_height: Height of the CoM over the first sole in half-sitting, m; infinity without soles.
        length_scale: Factor of lengths in settings: that height over `FULL_HEIGHT`, at most 1.
        floating: True for a base that floats.
        base_nq: Number of coordinates of the base, with which a configuration begins: 7, or 0 for a bolted base. The
            velocity of the base has `base_dof` coordinates: 6, or 0.
        na: Number of joints with a coordinate, nv − `base_dof`.
        joint_names: Names of these joints in the order of the velocity vector, length na.
        joint_numbers: Numbers of these joints in the Pinocchio model.
        couplings: Joint without a coordinate of its own → the joint that leads it.
        per_rad: What counts as one rad of each joint, shape (na,): 1 rad of a joint that turns, `LEVER` of one that
            slides. An angle times this is a threshold of all joints, rad (or m).
        slides: True for each joint that slides, shape (na,): its unit is m.
        passive: Indices of the joints without a drive, whose torque is zero, in arrays of shape (na,).
        closures: Closures of kinematic chains; every solver adds a `LoopClosure` for each.
        q: Configuration of the last `update`, shape (nq,).
        v: Velocity of the last `update`, shape (nv,).
        mass_matrix: M(q), shape (nv, nv); overwritten by the next update.
        bias: Coriolis, centrifugal, gravity, spring and damping forces h(q, v), shape (nv,); overwritten by the next
            update.
        com: Centre of mass in the world, shape (3,), m; overwritten by the next update.
        com_velocity: Velocity of the centre of mass in the world, shape (3,), m/s; overwritten by the next update.
        com_jacobian: Jacobian of the centre of mass, shape (3, nv); overwritten by the next update.
        joint_jacobians: Jacobians of the joints at the origin of the world, shape (6, nv), more columns with coupled
            joints; overwritten by the next update.
        position_lower: Lower joint limits, shape (na,), rad (or m).
        position_upper: Upper joint limits, shape (na,), rad (or m).
        velocity_limit: Largest joint speed, shape (na,), rad/s (or m/s); `UNLIMITED` where the model has none,
            or zero, with which a joint could never move.
        torque_limit: Largest joint torque in either direction, shape (na,), Nm (or N); `UNLIMITED` where the model has
            none.
        torque_lower: Smallest joint torque, shape (na,), Nm (or N). It is −torque_limit, except for drives whose limits
            differ by direction.
        torque_upper: Largest joint torque, shape (na,), Nm (or N).
        frames: Role → frame of what is no sole, such as {"left_hand": "left_wrist"}; `roles` has the soles, too.
        torso_frame: Frame of the chest.
        imu_frame: Frame of the inertial measurement unit.
        servos: Gains of the servos; None if they are unknown.
        springs: Stiffness (Nm/rad) and rest position (rad) of springs beside the drives, each of shape (na,); their
            torques are part of `bias`. None for a robot without springs.
        damping: Viscous damping of the joints beside the drives, shape (na,), Nms/rad (or Ns/m); its torques are part
            of `bias`. None for a robot without damping.
    """

    position_lower: Array = fixed(DESCRIBED)
    position_upper: Array = fixed(DESCRIBED)
    velocity_limit: Array = fixed(DESCRIBED)
    torque_lower: Array = fixed(DESCRIBED)
    torque_upper: Array = fixed(DESCRIBED)
    torque_limit: Array = fixed(DESCRIBED)
    half_sitting: Array = fixed(DESCRIBED)
    passive: NDArray[np.intp]

    @checked
    def __init__(
        self,
        model: pin.Model,
        soles: Sequence[Sole],
        half_sitting: ArrayLike,
        *,
        torso_frame: str | None = None,
        imu_frame: str | None = None,
        frames: Mapping[str, str] | None = None,
        servos: Servos | None = None,
        springs: tuple[Array, Array] | None = None,
        damping: Array | None = None,
        torque_lower: Array | None = None,
        passive: Sequence[str] = (),
        closures: Sequence[Closure] = (),
    ) -> None:
        """Make a robot from a complete model, which has limits, armature and sole frames; see the attributes.

        The Pinocchio model has a free-flyer root joint, or no root joint for a bolted base. All other joints have one
        degree of freedom; joints that mimic another joint are coupled to it. The frames of torso and IMU are the root
        when None. The smallest torques are the negative torque limits of the model when None; `passive` are names.
        """
        self.model, self.name = model, str(model.name)
        self._read_joints()
        self._read_frames(soles, torso_frame, imu_frame, frames)
        if servos is not None and servos.joint_names != self.joint_names:
            raise InputError(
                f"servos must be of the {self.na} joints of robot '{self.name}', in their order, got "
                f"{shown(servos.joint_names)}"
            )
        self.servos, self.damping = servos, None if damping is None else read_only(np.array(damping))
        self.springs = springs and (read_only(np.array(springs[0])), read_only(np.array(springs[1])))
        self.half_sitting = self.check_configuration("half-sitting configuration", half_sitting)
        self.half_sitting.setflags(write=False)
        self._read_limits(torque_lower, passive)
        self.closures = tuple(closures)
        for closure in self.closures:
            self.frame_id(closure.frame)
            self.frame_id(closure.other)
        self.data = model.createData()
        self._loads = CarriedMasses(model)
        self._carried, self._total_mass = 0, scalar(self._loads.total_mass)
        self._subtree_forces = [np.asarray(each) for each in self.data.Fcrb] if self.couplings else []

        # Live views of Pinocchio's memory: their addresses do not change for the life of `data`.
        data = self.data
        self.mass_matrix, self.bias, self.com, self.com_velocity, com_jacobian, joints = (
            np.asarray(_View(array, data))
            for array in (data.M, data.nle, data.com[0], data.vcom[0], data.Jcom, data.J)
        )
        # Of a single column, Pinocchio makes a vector.
        self.com_jacobian, self.joint_jacobians = com_jacobian.reshape(3, -1), joints.reshape(6, -1)
        self._base_force = self.bias[:3]
        self._base_rotation, self._gravity = data.oMi[1].rotation, np.array(model.gravity.linear)
        self._still = None if self.floating else model.createData()  # for `com_drift`
        self.q = np.array(self.half_sitting)
        self.v, self._no_acceleration = np.zeros(self.nv), np.zeros(self.nv)
        self.update(self.q, self.v)
        ground = self.placement(self.soles[0].frame).translation[2] if self.soles else -np.inf
        self.com_height = float(self.com[2] - ground)
        self.length_scale = min(1.0, self.com_height / FULL_HEIGHT)

    def _read_joints(self) -> None:
        """Read the joints of the model: coordinates, names, kinds and couplings."""
        model = self.model
        if model.njoints < 2:
            raise ModelError(f"robot '{model.name}' has no joints")
        self.floating = is_floating(model)
        self.base_nq, self.base_dof = (BASE_DOF + 1, BASE_DOF) if self.floating else (0, 0)
        self.joint_numbers = tuple(driven_joints(model))
        for number in self.joint_numbers:
            joint = model.joints[number]
            if joint.nv != 1 or joint.nq != 1:
                raise ModelError(
                    f"joint '{model.names[number]}' has {joint.nq} coordinates; joints of one coordinate are required, "
                    "beside a free-flyer at the root"
                )
        kinds = [model.joints[number].shortname() for number in self.joint_numbers]
        self.slides = np.array([kind.startswith("JointModelP") for kind in kinds])
        self.per_rad = np.where(self.slides, LEVER, 1.0)
        self.couplings = couplings_of(model, self.joint_numbers)
        self.nq, self.nv = int(model.nq), int(model.nv)
        self.na = self.nv - self.base_dof
        self.joint_names = tuple(driven_names(model))

    def _read_frames(
        self, soles: Sequence[Sole], torso: str | None, imu: str | None, frames: Mapping[str, str] | None
    ) -> None:
        """Find the frames of the base, of soles, torso and IMU, and further ones; see `__init__`."""
        model, root = self.model, 1 if self.floating else 0
        self._frame_ids: dict[str, int] = {
            str(frame.name): i for i, frame in reversed(list(enumerate(model.frames)))
        }
        self.soles = tuple(soles)
        for sole in self.soles:
            self.frame_id(sole.frame)
        links = [str(f.name) for f in model.frames if f.parentJoint == root and f.type == pin.FrameType.BODY]
        if not links:
            raise ModelError(
                f"robot '{model.name}' needs a frame of type BODY at its root joint '{model.names[root]}': its base "
                "link"
            )
        self.base_frame = links[0]
        self.torso_frame, self.imu_frame = torso or self.base_frame, imu or self.base_frame
        self.frames: dict[str, str] = Registry("role of a frame", frames)
        for frame in (self.torso_frame, self.imu_frame, *self.frames.values()):
            self.frame_id(frame)

    def _read_limits(self, torque_lower: Array | None, passive: Sequence[str]) -> None:
        """Read the limits of the joints, and refuse those that contradict each other; see `__init__`."""
        model = self.model
        self.position_lower = np.array(model.lowerPositionLimit[self.base_nq :])
        self.position_upper = np.array(model.upperPositionLimit[self.base_nq :])
        speed = model.upperVelocityLimit[self.base_dof :]
        self.velocity_limit = np.where(speed == 0.0, UNLIMITED, np.minimum(speed, UNLIMITED))
        self.torque_upper = np.minimum(model.upperEffortLimit[self.base_dof :], UNLIMITED)
        lower = -self.torque_upper if torque_lower is None else np.array(torque_lower)
        self.torque_lower = np.maximum(lower, -UNLIMITED)
        self.passive = np.array(sorted(self.joint_index(name) for name in passive), dtype=np.intp)
        self.torque_lower[self.passive] = self.torque_upper[self.passive] = 0.0
        self.torque_limit = np.maximum(-self.torque_lower, self.torque_upper)
        limits = self.position_lower, self.position_upper, self.velocity_limit, self.torque_limit
        for name, lower, upper, *others in zip(self.joint_names, *(x.tolist() for x in limits), strict=True):
            if not lower <= upper:
                raise ModelError(
                    f"joint '{name}' needs a lower position limit that is not above its upper one, got {lower}, {upper}"
                )
            if not all(limit >= 0.0 for limit in others):
                raise ModelError(
                    f"joint '{name}' needs limits of velocity and torque that are zero or above, got {others}"
                )
        for each in (*limits, self.torque_lower, self.torque_upper, self.per_rad, self.slides):
            each.setflags(write=False)

    @property
    def total_mass(self) -> Array:
        """Total mass of the robot and its loads at the last update, kg, an array of shape () that follows `carry`."""
        return self._total_mass

    @property
    def mass(self) -> float:
        """Total mass of the robot and its loads at the last update, kg; it changes with the loads."""
        return float(self._total_mass)

    @property
    def force_scale(self) -> float:
        """Factor of forces in settings, such as the smallest force on a sole; below 1 for a light robot."""
        return force_scale(self.mass)

    @checked
    def carry(
        self, frame: str | int, mass: Annotated[NonNegative, "kg"], point: Triple = (0.0, 0.0, 0.0)
    ) -> None:
        """Set the point mass that a frame carries, for this robot and all its clones, from the next update on.

        Args:
            frame: Frame of a link that moves.
            mass: Mass, kg; zero removes the load.
            point: Position of the mass in the frame, shape (3,), m.
        """
        index = frame if isinstance(frame, int) else self.frame_id(frame)
        if not 0 <= index < self.model.nframes:
            self._refuse_frame(index)
        carrier = self.model.frames[index]
        joint = int(carrier.parentJoint)
        if joint == 0:
            raise InputError(
                f"a load must be on a frame that moves with the robot, '{carrier.name}' does not move"
            )
        load = pin.Inertia(mass, carrier.placement.act(np.asarray(point)), np.zeros((3, 3)))
        self._loads.put(index, joint, load)

    @staticmethod
    def instead_of(value: object) -> str:
        """Return advice how to make a robot from an object of another type; empty if there is none."""
        if isinstance(value, str):
            return f"load_robot({shown(value)}).robot() makes one"
        if callable(getattr(value, "robot", None)):
            return "description.robot() makes one of a description"
        return "its attribute robot is one" if isinstance(getattr(value, "robot", None), Robot) else ""

    def update(self, q: Array, v: Array) -> None:
        """Compute all quantities that depend on the state: configuration, shape (nq,), and velocity, shape (nv,)."""
        self._take(q, v)
        self._take_loads()
        if self.couplings:
            self._compute_coupled()
        else:
            pin.computeAllTerms(self.model, self.data, self.q, self.v)
        if self.springs is not None or self.damping is not None:
            self.bias[self.base_dof :] += self.passive_torques(self.q, self.v)
        pin.updateFramePlacements(self.model, self.data)

    def com_drift(self) -> Array:
        """Return the acceleration of the CoM at no generalised acceleration, in the world, shape (3,), m/s².

        It needs no second pass over the kinematics: the forces on the base rows of the bias, turned into the world,
        are mass · (drift − gravity). A bolted base has no such rows.
        """
        if self._still is not None:
            pin.centerOfMass(self.model, self._still, self.q, self.v, self._no_acceleration, False)
            return np.array(self._still.acom[0])
        drift: Array = self._base_rotation.dot(self._base_force)
        drift /= self._total_mass
        drift += self._gravity
        return drift

    def spring_torques(self, q: Array) -> Array:
        """Return torques, shape (…, na), Nm, that hold the springs at configurations, shape (…, nq), as in `bias`."""
        joints = q[..., self.base_nq :]
        if self.springs is None:
            return np.zeros_like(joints)
        stiffness, rest = self.springs
        return np.asarray(stiffness * (joints - rest))

    def passive_torques(self, q: Array, v: Array) -> Array:
        """Return torques, shape (…, na), Nm, that hold springs and move damped joints at states (…, nq) and (…, nv)."""
        torques = self.spring_torques(q)
        if self.damping is not None:
            torques += self.damping * v[..., self.base_dof :]
        return torques

    def torque_share(self, torque: Array) -> Array:
        """Return joint torques as shares of their limits in the same direction, shape (…, na), at least 0."""
        # With both limits off zero, one quotient is the share and the other one is not positive.
        upper, lower = np.maximum(self.torque_upper, TINY), np.minimum(self.torque_lower, -TINY)
        return np.asarray(np.maximum(torque / upper, torque / lower))

    def _compute_coupled(self) -> None:
        """Compute what `computeAllTerms` does, which refuses coupled joints."""
        model, data, q, v = self.model, self.data, self.q, self.v
        for forces in self._subtree_forces:  # pin 4.1 adds to those of the last call
            forces[:] = 0.0
        pin.crba(model, data, q)
        pin.nonLinearEffects(model, data, q, v)
        pin.ccrba(model, data, q, v)
        pin.jacobianCenterOfMass(model, data, q)
        pin.centerOfMass(model, data, q, v, False)
        pin.forwardKinematics(model, data, q, v, self._no_acceleration)

    def update_kinematics(self, q: Array, v: Array) -> None:
        """Compute only frames, the centre of mass, their velocities and the centroidal momentum (`data.hg`).

        The arguments are those of `update`. It takes half the time, and the results are equal up to rounding. Mass
        matrix, bias, accelerations and Jacobians stay as they are.
        """
        self._take(q, v)
        self._take_loads()
        pin.centerOfMass(self.model, self.data, self.q, self.v, False)
        pin.computeCentroidalMomentum(self.model, self.data)
        pin.updateFramePlacements(self.model, self.data)

    def update_jacobians(self, q: Array | None = None) -> None:
        """Compute only frames, the CoM and their Jacobians at a configuration, shape (nq,); at the present when None.

        They equal those of `update` up to rounding; velocities, forces and accelerations stay as they are.
        """
        if q is not None:
            self._take(q, self.v)
        self._take_loads()
        pin.jacobianCenterOfMass(self.model, self.data, self.q)
        pin.updateFramePlacements(self.model, self.data)

    def _take_loads(self) -> None:
        """Take the mass of loads over where they have changed; until now it was that of the other quantities."""
        if self._loads.revision != self._carried:
            self._carried, self._total_mass[...] = self._loads.revision, self._loads.total_mass

    def _take(self, q: Array, v: Array) -> None:
        # A scalar or a shape (1,) would be taken for all coordinates.
        try:
            if len(q) != self.nq or len(v) != self.nv:
                raise ValueError
            if self.floating:
                x, y, z, w = q[3:7].tolist() if type(q) is np.ndarray else q[3:7]
                if not abs(x * x + y * y + z * z + w * w - 1.0) <= 2.0 * UNIT:  # or NaN
                    _refuse_quaternion("configuration", np.array((x, y, z, w)))
            self.v[:] = v
            self.q[:] = q
        except InputError:
            raise
        except (TypeError, ValueError) as error:
            raise InputError(
                f"configuration and velocity must have shapes ({self.nq},) and ({self.nv},), got {shown(q)}, {shown(v)}"
            ) from error

    def check_configuration(self, what: str, value: ArrayLike) -> Array:
        """Return a copy of a configuration, shape (nq,), after a check; `what` is its name in messages."""
        q = finite_array(what, value, (self.nq,))
        if self.floating and abs(float(np.linalg.norm(q[3:7])) - 1.0) > UNIT:
            _refuse_quaternion(what, q[3:7])
        return q

    def clone(self) -> Robot:
        """Return a robot with the same model and a state of its own."""
        twin = Robot(
            self.model,
            self.soles,
            self.half_sitting,
            torso_frame=self.torso_frame,
            imu_frame=self.imu_frame,
            frames=self.frames,
            servos=self.servos,
            springs=self.springs,
            damping=self.damping,
            torque_lower=self.torque_lower,
            passive=[self.joint_names[i] for i in self.passive],
            closures=self.closures,
        )
        twin._loads = self._loads
        return twin

    def __reduce__(self) -> NoReturn:
        raise InputError(
            f"{self!r} cannot be pickled or copied by `copy`: its arrays are views of Pinocchio's memory; use"
            " `clone()`, and give another process the RobotDescription"
        )

    def frame_id(self, name: str) -> int:
        """Return the index of a frame by its name or by its role, such as "left_hand"; raise an `UnknownNameError`."""
        if name not in self._frame_ids:
            roles = self.roles
            if name not in roles:
                unknown_name("frame", name, [*self._frame_ids, *roles])
            name = roles[name]
        return self._frame_ids[name]

    @property
    def roles(self) -> dict[str, str]:
        """Frames by role, such as "left_hand" and "left_foot"; the name of a frame takes precedence over a role."""
        return {**{sole.name: sole.frame for sole in self.soles}, **self.frames}

    @checked
    def joint_index(self, name: str) -> int:
        """Return the index of an actuated joint in arrays of shape (na,); raise an `UnknownNameError`."""
        if name not in self.joint_names:
            unknown_name("joint", name, self.joint_names)
        return self.joint_names.index(name)

    def check_range(
        self, what: str, joints: Sequence[int] | NDArray[np.intp], positions: Array, beyond: float = BEYOND
    ) -> None:
        """Refuse positions, shape (n,), rad or m, outside the ranges of n joints, given by indices from 0 to na − 1.

        A range is wider than the limits by `beyond`, rad (of a sliding joint by what counts as much), because stops
        yield and a robot may hold the position in which it is.
        """
        more = beyond * self.per_rad[joints]
        low, high = self.position_lower[joints] - more, self.position_upper[joints] + more
        outside = ((positions < low) | (positions > high)).nonzero()[0]
        if outside.size:
            row = int(outside[0])
            joint = int(joints[row])
            raise InputError(
                f"{what} '{self.joint_names[joint]}' ({'m' if self.slides[joint] else 'rad'}) must lie in its range "
                f"[{self.position_lower[joint]:.4g}, {self.position_upper[joint]:.4g}], got {positions[row]:g}"
            )

    def needs_feet(self, what: str) -> None:
        """Raise an `InputError` if the robot has other than two soles; `what` needs them, such as "an observer"."""
        if len(self.soles) != 2:
            raise InputError(
                f"{what} needs two feet, robot '{self.name}' is described with {len(self.soles)}"
            )

    @checked
    def sole(self, name: str) -> Sole:
        """Return a sole by its name or by its frame; raise an `UnknownNameError`."""
        for sole in self.soles:
            if name in (sole.name, sole.frame):
                return sole
        unknown_name("sole", name, [sole.name for sole in self.soles])

    def placement(self, frame: str | int) -> pin.SE3:
        """Return the placement of a frame in the world, a view that updates change; `pin.SE3(placement)` copies it."""
        try:
            return self.data.oMf[frame if isinstance(frame, int) else self.frame_id(frame)]
        except IndexError:
            self._refuse_frame(frame)

    def _refuse_frame(self, number: object) -> NoReturn:
        raise InputError(
            f"number of a frame of robot '{self.name}' must be from 0 to {self.model.nframes - 1}, got {number}"
        )

    def joints_between(self, frame: str, trunk: str) -> list[int]:
        """Return the joints between a trunk and a frame, such as a hand, in order from the trunk outwards.

        They are indices in arrays of shape (na,).
        """
        limb = joints_to(self.model, self.frame_id(frame), self.frame_id(trunk))
        return list(dict.fromkeys(self.model.joints[j].idx_v - self.base_dof for j in limb))

    @property
    def trunk_frames(self) -> tuple[str, ...]:
        """Frames of the root and of the chest, or one where the root is the chest."""
        return tuple(dict.fromkeys((self.base_frame, self.torso_frame)))

    @property
    def leg_joints(self) -> list[int]:
        """Joints between the soles and the base, as indices in arrays of shape (na,)."""
        return [j for sole in self.soles for j in self.joints_between(sole.frame, self.base_frame)]

    @checked
    def configuration(self, joints: Mapping[str, float] | None = None) -> Array:
        """Return half-sitting with other positions of some joints, shape (nq,); the lower sole is on the ground z = 0.

        Args:
            joints: Joint name → position, rad (or m).

        Raises:
            InputError: A position is outside the range of its joint; as an `UnknownNameError`, there is no such joint.
        """
        q = np.array(self.half_sitting)
        for name, value in (joints or {}).items():
            index = self.joint_index(name)
            q[self.base_nq + index] = finite_scalar(f"position of joint '{name}'", value)
            self.check_range("position of joint", [index], q[[self.base_nq + index]])
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, q)
        if self.floating:
            q[2] -= min(
                (data.oMf[self.frame_id(sole.frame)].translation[2] for sole in self.soles), default=0.0
            )
        return q

    def __repr__(self) -> str:
        return f"Robot('{self.name}', nv={self.nv}, mass={self.mass:.1f} kg)"
