"""Frames and soles as data: a name, the link that carries it and where it sits in that link."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.core.errors import InputError, finite_array, positive, unknown_name

Triple = tuple[float, float, float]

SOLE_NAMES = ("left_foot", "right_foot")
"""Names of the soles, in this order everywhere."""


@dataclass(frozen=True)
class FrameDescription:
    """A frame at a fixed placement in a link.

    Attributes:
        frame: Name; that of the link itself, of a frame of the URDF at this very place, or a new one.
        link: Link that carries it.
        translation: Origin in the link frame, m.
        rpy: Roll, pitch, yaw about the fixed axes of the link frame, rad, as in URDF.
    """

    frame: str
    link: str
    translation: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for what in ("translation", "rpy"):
            values = finite_array(f"{what} of frame '{self.frame}'", getattr(self, what), (3,))
            object.__setattr__(self, what, tuple(values.tolist()))

    @property
    def placement(self) -> pin.SE3:
        """Placement in the link frame."""
        return pin.SE3(pin.rpy.rpyToMatrix(*self.rpy), np.array(self.translation))


@dataclass(frozen=True)
class SoleDescription(FrameDescription):
    """A rectangular sole; its frame lies at the centre, x forward, z up and away from the ground.

    Attributes:
        name: "left_foot" or "right_foot".
        length: Extent along x, m.
        width: Extent along y, m.
    """

    name: str = SOLE_NAMES[0]
    length: float = 0.0
    width: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.name not in SOLE_NAMES:
            unknown_name("sole", self.name, SOLE_NAMES)
        positive(f"length of sole '{self.name}' (m)", self.length)
        positive(f"width of sole '{self.name}' (m)", self.width)


def add_frame(model: pin.Model, description: FrameDescription) -> None:
    """Add a frame to a Pinocchio model unless the very same frame is there already.

    Args:
        model: Changed.
        description: Frame to add.

    Raises:
        UnknownNameError: The link does not exist.
        InputError: A frame of that name exists elsewhere.
    """
    link = body_frame(model, description.link)
    placement = link.placement * description.placement
    for frame in model.frames:
        if frame.name == description.frame:
            if frame.parentJoint == link.parentJoint and frame.placement.isApprox(placement, 1e-9):
                return
            raise InputError(
                f"a frame '{description.frame}' exists already, elsewhere than described; choose another name"
            )
    index = model.getFrameId(description.link, pin.FrameType.BODY)
    model.addFrame(
        pin.Frame(description.frame, link.parentJoint, index, placement, pin.FrameType.OP_FRAME),
        append_inertia=False,
    )


def body_frame(model: pin.Model, link: str) -> pin.Frame:
    """The frame of a link.

    Raises:
        UnknownNameError: There is no such link.
    """
    links = link_names(model)
    if link not in links:
        unknown_name("link", link, links)
    return model.frames[model.getFrameId(link, pin.FrameType.BODY)]


def link_names(model: pin.Model) -> list[str]:
    """All links of a model."""
    return [str(frame.name) for frame in model.frames if frame.type == pin.FrameType.BODY]


def carrier(model: pin.Model, frame: str) -> tuple[str, pin.SE3]:
    """The link that moves with a frame and bears the origin of its joint, and the frame's place in it.

    MuJoCo merges links that are fixed to one another into this one, so that this is where a site can be attached.

    Raises:
        UnknownNameError: There is no such frame.
    """
    if not model.existFrame(frame):
        unknown_name("frame", frame, [str(f.name) for f in model.frames])
    found = model.frames[model.getFrameId(frame)]
    return carrier_link(model, found.parentJoint), found.placement


def carrier_link(model: pin.Model, joint: int) -> str:
    """The link whose frame is that of a joint."""
    for frame in model.frames:
        if frame.parentJoint == joint and frame.type == pin.FrameType.BODY:
            return str(frame.name)
    raise AssertionError(f"joint {joint} has no link")
