"""Links and joints of a robot, whichever format they were read from, and the model in which joints are coupled.

Two readers make a `Mechanism`: `wbc.robots.urdf` from its records, and `wbc.robots.readers.mechanism_mjcf`
from MuJoCo's compiled arrays. Two writers turn it into other formats: `wbc.robots.write_urdf` and, for the plant,
`wbc.sim.plant.model.bare_spec`.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from pydantic_core import SchemaSerializer, core_schema

from wbc.base.errors import InputError, ModelError, choose, shown
from wbc.base.numbers import Array
from wbc.core.model import Coupling, driven_joints, driven_names, is_floating
from wbc.core.robot import GRAVITY, UNLIMITED

MOST_JOINTS = 256
"""Most joints with a coordinate of their own: memory of Pinocchio's data grows with the cube of their number."""

FARTHEST = 1e10
"""Limit that is written where a joint has none on one side, rad or m."""

WORLD_LINK = "world_link"
"""Root link of an MJCF's robot that is bolted to the world."""

TURNED = "_forward"
"""End of the name of a root link that was put above one that looks elsewhere than forward."""

HINGES = pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelRevoluteUnaligned
SLIDES = pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ, pin.JointModelPrismaticUnaligned
"""Pinocchio's joints about x, y, z, and about another axis."""

NARROWER = 1e-6
"""Difference from which on a range is narrower than another, rad or m: above rounding."""


Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity, each from 0 to 1."""


class Geometry(NamedTuple):
    """A shape of a link.

    Attributes:
        link: Name of the link.
        role: "visual" or "collision".
        kind: "box", "sphere", "cylinder", "capsule" or "mesh".
        size: Half sizes of a box, shape (3,), m; radius of a sphere, shape (1,), m; radius and half length of a
            cylinder or a capsule, shape (2,), m; scale of a mesh, shape (3,).
        place: Place in the link.
        file: Name of the file of a mesh.
        colour: Colour; None where the file has none.
        corners: Corners of the convex hull of a solid mesh that became a box, in the link, shape (n, 3), m.
    """

    link: str
    role: str
    kind: str
    size: Array
    place: pin.SE3
    file: str = ""
    colour: Colour | None = None
    corners: Array | None = None


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Links and joints of one robot.

    Attributes:
        model: Pinocchio model in which every joint has a coordinate, those that move with another one too. Its root is
            a free-flyer, or, for a robot that is bolted to the world, the world. Limits that are none are infinite; a
            torque limit that is not known is zero. Its name is that of the robot in the file.
        inertias: Link → its own inertia in its frame, without what is fixed to it; links without mass are left out.
        couplings: Joint that moves with another one → its leader, ratio and offset.
        shapes: Shapes of all links, in the order of the file; those of an unknown kind are left out.
    """

    model: pin.Model
    inertias: Mapping[str, pin.Inertia]
    couplings: Mapping[str, Coupling]
    shapes: tuple[Geometry, ...]

    def coupled(self, name: str, notes: list[str] | None = None) -> pin.Model:
        """Return the model in which joints move with their leaders, with standard gravity, or a `ModelError`.

        `notes` gets a line for each limit of a leader that its followers narrow.
        """
        model, couplings = self.model, self.couplings
        if "universe" in list(model.names)[1:]:
            raise ModelError("joint 'universe' has the name of Pinocchio's world: rename it")
        count = model.njoints - 1 - is_floating(model) - len(couplings)
        if not 0 < count <= MOST_JOINTS:
            raise ModelError(
                f"'{name}' must have 1 to {MOST_JOINTS} joints that move, got {count}: lock, or free, some"
            )
        order = _leaders_first(model, couplings)
        model = model.copy() if order == sorted(order) else self._reordered(order)
        if couplings:
            model = coupled(model, couplings, [] if notes is None else notes)
        model.name = name
        model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
        return model

    def with_limits(
        self,
        position: Mapping[str, tuple[float, float]] | None = None,
        velocity: Mapping[str, float] | None = None,
        torque: Mapping[str, float] | None = None,
    ) -> Mechanism:
        """Return it with limits: joint → position (lower, upper), rad or m; velocity, rad/s or m/s; torque, Nm or N."""
        model = self.model.copy()
        joints = {str(model.names[j]): model.joints[j] for j in driven_joints(model)}
        for what, values, limits in (
            ("velocity", velocity, model.upperVelocityLimit),
            ("torque", torque, model.upperEffortLimit),
        ):
            for name, value in (values or {}).items():
                joint = joints[choose("joint", name, joints)]
                if not 0.0 < value < UNLIMITED:
                    raise InputError(
                        f"{what} limit of joint '{name}' must be above zero and below {UNLIMITED:g}, got {value}"
                    )
                limits[joint.idx_v] = value
        for name, (lower, upper) in (position or {}).items():
            joint = joints[choose("joint", name, joints)]
            if not (math.isfinite(lower) and math.isfinite(upper) and lower < upper):
                raise InputError(
                    f"position limits of joint '{name}' must be finite with lower < upper, got {lower}, {upper}"
                )
            model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q] = lower, upper
        return replace(self, model=model)

    def to_plain(self) -> dict[str, Any]:
        """Return all data as plain values for JSON, of which `from_plain` makes the same mechanism, bit for bit."""
        model, joints = self.model, list[dict[str, Any]]()
        for number in range(1, model.njoints):
            kind, place = model.joints[number], _twelve(model.jointPlacements[number])
            made = {"name": str(model.names[number]), "parent": int(model.parents[number]), "place": place}
            if kind.nq == 1:
                slides, axis = self.axis(number)
                at = model.upperEffortLimit[kind.idx_v], model.upperVelocityLimit[kind.idx_v]
                ends = model.lowerPositionLimit[kind.idx_q], model.upperPositionLimit[kind.idx_q]
                made |= {"slides": slides, "axis": axis.tolist(), "limits": [float(x) for x in (*at, *ends)]}
            joints.append(made)
        frames = [
            (
                str(each.name),
                str(each.type),
                int(each.parentJoint),
                int(each.parentFrame),
                _twelve(each.placement),
            )
            for each in list(model.frames)[1:]
        ]
        inertias = {link: _thirteen(each) for link, each in self.inertias.items()}
        shapes = [
            (*each[:3], each.size.tolist(), _twelve(each.place), each.file, each.colour)
            for each in self.shapes
        ]
        couplings = {name: astuple(coupling) for name, coupling in self.couplings.items()}
        return {"name": model.name, "joints": joints, "frames": frames, "inertias": inertias} | {
            "carried": [_thirteen(each) for each in model.inertias],  # by the joints, the world first
            "couplings": couplings,
            "shapes": shapes,
        }

    def _reordered(self, order: list[int]) -> pin.Model:
        """Return the model with its joints in another order of depth first."""
        plain, number = self.to_plain(), {old: new for new, old in enumerate(order)}
        joints = [plain["joints"][joint - 1] for joint in order[1:]]
        frames = plain["frames"]
        changed = {
            "joints": [joint | {"parent": number[joint["parent"]]} for joint in joints],
            "frames": [(name, kind, number[joint], *rest) for name, kind, joint, *rest in frames],
            "carried": [plain["carried"][joint] for joint in order],
        }
        return self._from_plain(plain | changed).model

    @classmethod
    def from_plain(cls, values: Any) -> Mechanism:
        """Return the mechanism of plain values; an `InputError` if they are none, a mechanism as it is."""
        if isinstance(values, cls):
            return values
        try:
            return cls._from_plain(values)
        except (KeyError, TypeError, ValueError, IndexError, AttributeError, RuntimeError) as error:
            raise InputError(f"links and joints of a robot cannot be read: {shown(error)}") from error

    @classmethod
    def _from_plain(cls, values: Mapping[str, Any]) -> Mechanism:
        model = pin.Model()
        model.name = values["name"]
        for number, joint in enumerate(values["joints"]):
            parent, place, name = joint["parent"], _placement(joint["place"]), joint["name"]
            if not 0 <= parent <= number:
                raise ValueError(f"joint '{name}' hangs on number {parent}")
            if "axis" in joint:
                add_joint(
                    model, parent, place, name, joint["slides"], np.array(joint["axis"]), joint["limits"]
                )
            else:
                model.addJoint(parent, pin.JointModelFreeFlyer(), place, name)
        inertias = {link: _inertia(each) for link, each in values["inertias"].items()}
        for number, (name, kind, joint, parent, numbers) in enumerate(values["frames"]):
            if not (0 <= joint < model.njoints and 0 <= parent <= number):
                raise ValueError(f"frame '{name}' hangs on joint {joint} and frame {parent}")
            place, what = _placement(numbers), getattr(pin.FrameType, kind)
            model.addFrame(pin.Frame(name, joint, parent, place, what), False)
            if what == pin.FrameType.BODY and name in inertias:
                model.appendBodyToJoint(joint, inertias[name], place)
        for joint, carried in enumerate(values["carried"]):  # their sums, to the last bit
            model.inertias[joint] = _inertia(carried)
        couplings = {name: Coupling(*each) for name, each in values["couplings"].items()}
        shapes = tuple(
            Geometry(link, role, kind, np.array(size), _placement(place), file, colour and tuple(colour))
            for link, role, kind, size, place, file, colour in values["shapes"]
        )
        return cls(model, inertias, couplings, shapes)

    @classmethod
    def __get_pydantic_core_schema__(cls, _: Any, __: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(cls.from_plain)

    def axis(self, joint: int) -> tuple[bool, Array]:
        """Return True for a joint that slides, and its axis in its own frame, shape (3,)."""
        kind, data = self.model.joints[joint], self.model.joints[joint].createData()
        kind.calc(data, np.zeros(1))
        subspace = np.ravel(data.S)
        slides = not subspace[3:].any()
        return slides, subspace[:3] if slides else subspace[3:]


Mechanism.__pydantic_serializer__ = SchemaSerializer(  # type: ignore[attr-defined]
    core_schema.any_schema(serialization=core_schema.plain_serializer_function_ser_schema(Mechanism.to_plain))
)


def _twelve(place: pin.SE3) -> list[float]:
    """Return a placement as position and rotation, row by row."""
    return [*place.translation.tolist(), *place.rotation.ravel().tolist()]


def _placement(numbers: Sequence[float]) -> pin.SE3:
    return pin.SE3(
        np.array(numbers[3:12], dtype=np.float64).reshape(3, 3), np.array(numbers[:3], dtype=np.float64)
    )


def _thirteen(inertia: pin.Inertia) -> list[float]:
    """Return an inertia as mass, centre of mass, and matrix about it, row by row."""
    return [float(inertia.mass), *inertia.lever.tolist(), *inertia.inertia.ravel().tolist()]


def _inertia(numbers: Sequence[float]) -> pin.Inertia:
    return pin.Inertia(float(numbers[0]), np.array(numbers[1:4]), np.array(numbers[4:13]).reshape(3, 3))


def add_joint(
    model: pin.Model,
    parent: int,
    place: pin.SE3,
    name: str,
    slides: bool,
    axis: Array,
    limits: tuple[float, float, float, float],
) -> int:
    """Add a hinge or a slide at a place in the frame of its parent; return its number.

    `limits` are torque or force, speed, lower and upper position.
    """
    which = next((i for i in range(3) if np.array_equal(axis, np.eye(3)[i])), 3)
    made = (SLIDES if slides else HINGES)[which](*(() if which < 3 else (axis,)))
    return int(model.addJoint(parent, made, place, name, *(np.array([float(limit)]) for limit in limits)))


def along(vector: Array) -> pin.SE3:
    """Return the shift by a vector, shape (3,), m."""
    return pin.SE3(np.eye(3), np.array(vector, dtype=np.float64))


def placement_of(position: Array, quaternion: Array) -> pin.SE3:
    """Return a placement from MuJoCo's position (m) and quaternion (wxyz)."""
    w, x, y, z = (float(value) for value in quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.array(position, dtype=np.float64))


def placed(place: pin.SE3) -> dict[str, Array]:
    """Return position (m) and quaternion (wxyz) of a placement, as MuJoCo's specifications take them."""
    quaternion = pin.Quaternion(place.rotation).normalized().coeffs()
    return {"pos": np.array(place.translation), "quat": quaternion[[3, 0, 1, 2]]}


def free_name(names: Collection[str]) -> str:
    """Return a name for the joint of a floating root that no joint of the robot has."""
    free = "root_joint"
    while free in names:
        free += "_"
    return free


def principal(inertia: Array) -> tuple[Array, Array]:
    """Return the principal moments of an inertia about its centre of mass, shape (3,), and their axes, a rotation."""
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return moments, axes


def unlimited(model: pin.Model) -> list[str]:
    """Return the joints of a model that have no torque limit; those that are coupled need none."""
    joints = zip(driven_names(model), driven_joints(model), strict=True)
    return [name for name, joint in joints if model.upperEffortLimit[model.joints[joint].idx_v] == 0.0]


def coupled(model: pin.Model, couplings: Mapping[str, Coupling], notes: list[str]) -> pin.Model:
    """Return a model in which joints move with their leaders; `notes` gets the limits that they narrow."""
    for name, coupling in couplings.items():
        _narrow(model, name, coupling, notes)
    for name, coupling in couplings.items():
        leader, follower = model.getJointId(coupling.leader), model.getJointId(name)
        if leader > follower:
            raise ModelError(
                f"joint '{name}' is coupled to '{coupling.leader}', which hangs on it: give the coupling the other way "
                "round, or lock one of them"
            )
        model = pin.transformJointIntoMimic(model, leader, follower, coupling.ratio, coupling.offset)
    return model


def _narrow(model: pin.Model, name: str, coupling: Coupling, notes: list[str]) -> None:
    """Narrow the limits of a leader to what a joint that moves with it allows, in place."""
    own, leader = (model.joints[model.getJointId(joint)] for joint in (name, coupling.leader))
    lower, upper, speed = model.lowerPositionLimit, model.upperPositionLimit, model.upperVelocityLimit
    ends = sorted((float(side[own.idx_q]) - coupling.offset) / coupling.ratio for side in (lower, upper))
    before = float(lower[leader.idx_q]), float(upper[leader.idx_q])
    low, high = max(ends[0], before[0]), min(ends[1], before[1])
    if not low < high:
        raise ModelError(
            f"joint '{name}', coupled to '{coupling.leader}', leaves it no range: "
            f"[{ends[0]:g}, {ends[1]:g}] of [{before[0]:g}, {before[1]:g}]"
        )
    if low > before[0] + NARROWER or high < before[1] - NARROWER:
        lower[leader.idx_q], upper[leader.idx_q] = low, high
        notes.append(
            f"joint '{coupling.leader}': [{low:g}, {high:g}], for the range of '{name}', coupled to it"
        )
    fastest = float(speed[own.idx_v]) / abs(coupling.ratio)
    if fastest < float(speed[leader.idx_v]) * (1.0 - NARROWER):
        speed[leader.idx_v] = fastest
        notes.append(f"joint '{coupling.leader}': at most {fastest:g} a second, for '{name}', coupled to it")


def _leaders_first(model: pin.Model, couplings: Mapping[str, Coupling]) -> list[int]:
    """Return the joints with branches in an order in which leaders come before what follows them, if there is one."""
    below = [set(subtree) for subtree in model.subtrees]
    pairs = [(model.getJointId(name), model.getJointId(each.leader)) for name, each in couplings.items()]
    order: list[int] = []

    def visit(joint: int) -> None:
        order.append(joint)
        waiting = list(model.children[joint])
        while waiting:
            rest = {
                each: set().union(*(below[other] for other in waiting if other != each)) for each in waiting
            }
            ready = [
                each
                for each in waiting
                if not any(follower in below[each] and leader in rest[each] for follower, leader in pairs)
            ]
            waiting.remove(chosen := (ready or waiting)[0])
            visit(chosen)

    visit(0)
    return order
