"""A robot as XML, whichever format it has, and its Pinocchio model.

There are two sources, a URDF (`wbc.robots.source_urdf`) and an MJCF (`wbc.robots.readers.source_mjcf`). Each reads its
own format; what follows from a robot that was read, such as coupled joints, is the same for both.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose
from wbc.base.numbers import Array
from wbc.core.model import Coupling, driven_joints, driven_names, is_floating
from wbc.core.robot import GRAVITY, UNLIMITED

Element = ElementTree.Element

MOST_JOINTS = 256
"""Most joints with a coordinate of their own: memory of Pinocchio's data grows with the cube of their number."""

NARROWER = 1e-6
"""Difference from which on a range is narrower than another, rad or m: above rounding."""


Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity, each from 0 to 1."""


class Geometry(NamedTuple):
    """A shape of a link."""

    link: str
    role: str  # "visual" or "collision"
    kind: str  # "box", "sphere", "cylinder", "capsule" or "mesh"
    size: Array  # half sizes of a box; radius; radius and half length, m; scale of a mesh
    place: pin.SE3  # place in the link
    file: str = ""  # name of the file of a mesh
    colour: Colour | None = None  # None where the file has none


class Source(ABC):
    """The XML of one robot.

    Attributes:
        root: Its root element, which some methods change.
    """

    def __init__(self, root: Element) -> None:
        """Take the element of a robot that was read and checked."""
        self.root = root

    @property
    def text(self) -> str:
        """The XML."""
        return ElementTree.tostring(self.root, encoding="unicode")

    def model(self, name: str, fixed: bool, notes: list[str] | None = None) -> pin.Model:
        """Return the Pinocchio model, with standard gravity, or a `ModelError`.

        Its root is a free-flyer, or, with `fixed`, the world. Joints that move with another one are coupled to it.
        `notes` gets a line for each limit of a leader that its followers narrow.
        """
        model, couplings = self.tree(name, fixed), self.couplings()
        if "universe" in list(model.names)[1:]:
            raise ModelError("joint 'universe' has the name of Pinocchio's world: rename it")
        count = model.njoints - 1 - is_floating(model) - len(couplings)
        if not 0 < count <= MOST_JOINTS:
            raise ModelError(
                f"'{name}' must have 1 to {MOST_JOINTS} joints that move, got {count}: lock, or free, some"
            )
        if couplings:
            model = coupled(model, couplings, [] if notes is None else notes)
        model.name = name
        model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
        return model

    @abstractmethod
    def tree(self, name: str, fixed: bool) -> pin.Model:
        """Return the Pinocchio model in which every joint has a coordinate; limits that are none are infinite."""

    @abstractmethod
    def couplings(self) -> dict[str, Coupling]:
        """Return the joints that move with another one, joint → its leader, ratio and offset."""

    @abstractmethod
    def shapes(self) -> list[Geometry]:
        """Return the shapes of all links, in the order of the file; those of an unknown kind are left out."""

    @abstractmethod
    def without_geometry(self) -> str:
        """Return links, inertias and joints alone, which MuJoCo reads without any file."""

    @abstractmethod
    def joints(self) -> dict[str, Element]:
        """Return the joints that move."""

    @abstractmethod
    def set_limit(self, joint: Element, what: str, value: Any) -> None:
        """Write the "position" limits (lower, upper), the "velocity" limit or the "torque" limit of a joint."""

    def set_limits(
        self,
        position: Mapping[str, tuple[float, float]] | None = None,
        velocity: Mapping[str, float] | None = None,
        torque: Mapping[str, float] | None = None,
    ) -> None:
        """Write limits of joints: position (lower, upper), rad or m; velocity, rad/s or m/s; torque, Nm or N."""
        joints = self.joints()
        for what, values in (("velocity", velocity), ("torque", torque)):
            for name, value in (values or {}).items():
                choose("joint", name, joints)
                if not 0.0 < value < UNLIMITED:
                    raise InputError(
                        f"{what} limit of joint '{name}' must be above zero and below {UNLIMITED:g}, got {value}"
                    )
                self.set_limit(joints[name], what, float(value))
        for name, (lower, upper) in (position or {}).items():
            choose("joint", name, joints)
            if not (math.isfinite(lower) and math.isfinite(upper) and lower < upper):
                raise InputError(
                    f"position limits of joint '{name}' must be finite with lower < upper, got {lower}, {upper}"
                )
            self.set_limit(joints[name], "position", (float(lower), float(upper)))

    @abstractmethod
    def turn_root(self, turn: float) -> str:
        """Put a link above the root whose x axis points to where the old one has `turn` (rad); return its name."""

    def tidy(
        self, fixed: bool, lock: Mapping[str, float], repair: bool
    ) -> tuple[dict[str, float], list[str]]:
        """Settle what the file leaves open, fix joints, and check inertias, or repair them.

        Returned are the positions of all joints that are fixed, and what was changed, one line each.
        """
        return {}, []


def unlimited(model: pin.Model) -> list[str]:
    """Return the joints of a model that have no torque limit; those that are coupled need none."""
    joints = zip(driven_names(model), driven_joints(model), strict=True)
    return [name for name, joint in joints if model.upperEffortLimit[model.joints[joint].idx_v] == 0.0]


def coupled(model: pin.Model, couplings: Mapping[str, Coupling], notes: list[str]) -> pin.Model:
    """Return a model in which joints move with their leaders; `notes` gets the limits that they narrow."""
    for name, coupling in couplings.items():
        _narrow(model, name, coupling, notes)
    model = _leaders_first(model, couplings)
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


def _leaders_first(model: pin.Model, couplings: Mapping[str, Coupling]) -> pin.Model:
    """Return the model with branches in an order in which leaders come before what follows them, if there is one."""
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
    return model if order == sorted(order) else _reordered(model, order)


def _reordered(model: pin.Model, order: list[int]) -> pin.Model:
    """Return a model with its joints in another order of depth first."""
    made, number = pin.Model(), {0: 0}
    made.inertias[0] = model.inertias[0]
    for joint in order[1:]:
        kind = model.joints[joint]
        number[joint] = made.addJoint(
            number[model.parents[joint]], kind, model.jointPlacements[joint], model.names[joint]
        )
        made.inertias[number[joint]] = model.inertias[joint]
        own = made.joints[number[joint]]
        for limits in ("lowerPositionLimit", "upperPositionLimit"):
            getattr(made, limits)[own.idx_q : own.idx_q + own.nq] = getattr(model, limits)[
                kind.idx_q : kind.idx_q + kind.nq
            ]
        for limits in ("upperVelocityLimit", "upperEffortLimit"):
            getattr(made, limits)[own.idx_v : own.idx_v + own.nv] = getattr(model, limits)[
                kind.idx_v : kind.idx_v + kind.nv
            ]
    for frame in list(model.frames)[1:]:  # of the same numbers, parents first
        joint = number[frame.parentJoint]
        made.addFrame(
            pin.Frame(frame.name, joint, frame.parentFrame, frame.placement, frame.type, frame.inertia), False
        )
    return made
