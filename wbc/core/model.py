"""Joints, couplings, closures and loads of a Pinocchio model, by names and numbers.

The root of a model is free to move, or is none; every other joint has one coordinate, or is coupled to one that has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pinocchio as pin

MIMIC = "JointModelMimic"
"""Pinocchio's name of a joint that is coupled to another one."""


def is_floating(model: pin.Model) -> bool:
    """Return True for a model whose root is free to move."""
    return bool(model.njoints > 1 and model.joints[1].shortname() == "JointModelFreeFlyer")


def driven_joints(model: pin.Model) -> list[int]:
    """Return the numbers of the joints that have a coordinate of their own, without the free root, in their order.

    A joint that is coupled to another one has none: it moves with that of its leader.
    """
    first = 2 if is_floating(model) else 1
    return [j for j in range(first, model.njoints) if model.joints[j].shortname() != MIMIC]


def driven_names(model: pin.Model) -> list[str]:
    """Return the names of those joints."""
    return [str(model.names[j]) for j in driven_joints(model)]


def joints_to(model: pin.Model, frame: str | int, trunk: str | int | None = None) -> list[int]:
    """Return the numbers of the joints that move a frame but not a trunk (or the base), from the base outwards."""
    ends = [
        each if isinstance(each, int) else model.getFrameId(each)
        for each in (frame, trunk)
        if each is not None
    ]
    first = 2 if is_floating(model) else 1
    limb, *behind = ([j for j in model.supports[model.frames[end].parentJoint] if j >= first] for end in ends)
    return [joint for joint in limb if not behind or joint not in behind[0]]


@dataclass(frozen=True)
class Closure:
    """A place where a chain of a robot closes: two frames that stay together.

    Attributes:
        name: Name of the closure.
        frame: A frame on one side.
        other: The frame on the other side.
        rotation: True if the orientations stay together as well, False for the points alone.
    """

    name: str
    frame: str
    other: str
    rotation: bool


@dataclass(frozen=True)
class Coupling:
    """A joint that moves with another one: its position is ratio · (position of the leader) + offset.

    Its inertia, weight and friction are felt by the leader, times the ratio.

    Attributes:
        leader: Joint with a coordinate of its own.
        ratio: rad/rad (or m/rad, …).
        offset: Position at that of the leader zero, rad or m.
    """

    leader: str
    ratio: float
    offset: float


class CarriedMasses:
    """Point masses that the frames of a model carry, once for all robots that share the model.

    Attributes:
        total_mass: Total mass with all loads, kg.
        revision: Number of loads that were put so far.
    """

    def __init__(self, model: pin.Model) -> None:
        self._model = model
        self._carried: dict[int, tuple[int, pin.Inertia]] = {}  # frame → joint, load
        self._own: dict[int, pin.Inertia] = {}  # joint → inertia without loads
        self.total_mass, self.revision = float(pin.computeTotalMass(model)), 0

    def put(self, frame: int, joint: int, load: pin.Inertia) -> None:
        """Set the load of a frame of a joint's link, in the frame of the joint."""
        total = self._own.setdefault(joint, self._model.inertias[joint].copy())
        self._carried[frame] = joint, load
        for at, each in self._carried.values():
            if at == joint and each.mass > 0.0:
                total = total + each
        self._model.inertias[joint] = total
        self.total_mass, self.revision = float(pin.computeTotalMass(self._model)), self.revision + 1


def couplings_of(model: pin.Model, driven: Sequence[int]) -> dict[str, Coupling]:
    """Return joint → coupling of the joints of a model that mimic another one."""
    leaders = {model.joints[number].idx_v: str(model.names[number]) for number in driven}
    found = {}
    for number, joint in enumerate(model.joints):
        if joint.shortname() == MIMIC:
            mimic = joint.extract()
            found[str(model.names[number])] = Coupling(
                leaders[joint.idx_v], float(mimic.scaling), float(mimic.offset)
            )
    return found
