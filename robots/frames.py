"""Frames of links in a Pinocchio model, and the names of soles."""

from __future__ import annotations

from typing import Literal, TypeAlias

import pinocchio as pin

from wbc.base.errors import InputError, choose
from wbc.base.numbers import ROUNDING
from wbc.core.frames import FrameDescription

SoleName: TypeAlias = Literal["left_foot", "right_foot"]

SOLE_NAMES: tuple[SoleName, SoleName] = ("left_foot", "right_foot")
"""Names of the soles, always in this order."""


def frame_at(name: str, link: str, placement: pin.SE3) -> FrameDescription:
    """Return the description of a frame at a placement in a link."""
    x, y, z = placement.translation.tolist()
    roll, pitch, yaw = pin.rpy.matrixToRpy(placement.rotation).tolist()
    return FrameDescription(name, link, (x, y, z), (roll, pitch, yaw))


def same_place(model: pin.Model, description: FrameDescription) -> bool:
    """Return True if every frame of that name in a model lies where the description says."""
    link = body_frame(model, description.link)
    placement = link.placement * description.placement
    return all(
        frame.parentJoint == link.parentJoint and frame.placement.isApprox(placement, ROUNDING)
        for frame in model.frames
        if frame.name == description.frame
    )


def add_frame(model: pin.Model, description: FrameDescription) -> None:
    """Add a frame to a Pinocchio model unless the very same frame is there already."""
    link = body_frame(model, description.link)
    placement = link.placement * description.placement
    if model.existFrame(description.frame):
        if same_place(model, description):
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
    """Return the frame of a link; `UnknownNameError` if there is no such link."""
    choose("link", link, link_names(model))
    return model.frames[model.getFrameId(link, pin.FrameType.BODY)]


def link_names(model: pin.Model) -> list[str]:
    """Return the names of all links of a model."""
    return [str(frame.name) for frame in model.frames if frame.type == pin.FrameType.BODY]


def carrier(model: pin.Model, frame: str) -> tuple[str, pin.SE3]:
    """Return the link whose origin is the joint that moves a frame, and the placement of the frame in this link.

    MuJoCo merges links that are fixed to one another into this one: sites are attached to it.
    """
    choose("frame", frame, (str(f.name) for f in model.frames))
    # A joint and its link may have one name: the joint comes first, at the very same place.
    known = next(f for f in model.frames if f.name == frame)
    return carrier_link(model, known.parentJoint), known.placement


def carrier_link(model: pin.Model, joint: int) -> str:
    """Return the link whose frame is that of a joint; that of several joints is that of the last."""
    for frame in model.frames:
        if frame.parentJoint == joint and frame.type == pin.FrameType.BODY:
            return str(frame.name)
    return carrier_link(model, model.children[joint][0])
