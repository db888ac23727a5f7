"""URDF of a robot for other engines, which read a URDF in their own way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.model import is_floating
from wbc.robots.mechanism import FARTHEST, Geometry, Mechanism, principal
from wbc.robots.urdf import Element

BETWEEN = 1e-9
"""Mass, kg, of the link between two joints of one link, and a thousand times its inertia, kg m²."""


def write(
    robot: Mechanism, name: str, rotors: Mapping[str, float], *, merged: bool = False, shapes: bool = False
) -> str:
    """Return a URDF of links, inertias and joints, with limits and couplings.

    Every link that moves has an inertia, which is given in its principal axes: some engines take a link without one for
    1 kg, others read the diagonal alone.

    Args:
        robot: Links and joints.
        name: Name of the robot.
        rotors: Joint → inertia of its rotor, kg m², that becomes a thin disc of the link behind the joint; empty for
            an engine that knows rotors.
        merged: True to merge links that are fixed to another one into it; sites are left out. Otherwise they are links.
        shapes: True for a URDF with the shapes of all links, which are not merged.

    Raises:
        InputError: A rotor of a joint that slides.
    """
    model = robot.model
    first = 1 if is_floating(model) else 0  # the joint of the root link
    links = {joint: f"{model.names[joint]}_link" for joint in range(first, model.njoints)}
    for frame in reversed(list(model.frames)):  # the first of a joint is its own
        if frame.type == pin.FrameType.BODY and frame.parentJoint in links:
            links[frame.parentJoint] = str(frame.name)
    root = Element("robot", name=name)
    elements: dict[str, Element] = {}
    for number, link in links.items():
        inertia = model.inertias[number] if merged else robot.inertias.get(link)
        if not model.inertias[number].mass and number > first:  # a joint of a link with several
            inertia = pin.Inertia(BETWEEN, np.zeros(3), 1e-3 * BETWEEN * np.eye(3))
        if rotor := rotors.get(str(model.names[number]), 0.0):
            assert inertia is not None
            inertia = _with_rotor(robot, number, inertia, rotor)
        elements[link] = _link(root, link, inertia)
        if number > first:
            _moving_joint(root, robot, number, links[model.parents[number]], link)
    for frame in [] if merged else list(model.frames):
        kinds, carrier = (pin.FrameType.BODY, pin.FrameType.OP_FRAME), links.get(frame.parentJoint, "")
        if frame.type in kinds and frame.name not in elements:
            elements[frame.name] = _link(root, frame.name, robot.inertias.get(frame.name))
            above = model.frames[frame.parentFrame]
            known = above.name if above.type == pin.FrameType.FIXED_JOINT and frame.parentFrame else ""
            _joint(root, known or f"{frame.name}_fixed", "fixed", carrier, frame.name, frame.placement)
    for shape in robot.shapes if shapes else ():
        _add_shape(elements[shape.link], shape)
    ElementTree.indent(root)  # some engines read lines of limited length
    return ElementTree.tostring(root, encoding="unicode")


def _with_rotor(robot: Mechanism, number: int, inertia: pin.Inertia, rotor: float) -> pin.Inertia:
    """Return the inertia of a link with a rotor, kg m², as a thin disc about the axis of its joint."""
    slides, axis = robot.axis(number)
    if slides:
        name = robot.model.names[number]
        raise InputError(
            f"the rotor of joint '{name}', which slides, is no disc of a link: take its armature out"
        )
    disc = rotor * 0.5 * (np.eye(3) + np.outer(axis, axis))
    return pin.Inertia(inertia.mass, inertia.lever, inertia.inertia + disc)


def _moving_joint(root: Element, robot: Mechanism, number: int, parent: str, child: str) -> None:
    """Add a hinge or a slide between two links, with its limits and its coupling to a leader."""
    model, (slides, axis), name = robot.model, robot.axis(number), str(robot.model.names[number])
    at, speed = model.idx_qs[number], model.idx_vs[number]
    ends = np.array([model.lowerPositionLimit[at], model.upperPositionLimit[at]])
    endless = not np.isfinite(ends).any()
    low, high = np.clip(ends, -FARTHEST, FARTHEST).tolist()
    kind = "prismatic" if slides else "continuous" if endless else "revolute"
    element = _joint(root, name, kind, parent, child, model.jointPlacements[number])
    ElementTree.SubElement(element, "axis", xyz=_text(axis))
    most = {"effort": model.upperEffortLimit[speed], "velocity": model.upperVelocityLimit[speed]}
    bounds = {} if endless else {"lower": low, "upper": high}
    limits = {key: repr(float(value)) for key, value in (bounds | most).items()}
    ElementTree.SubElement(element, "limit", limits)
    if name in robot.couplings:
        leader, ratio, offset = astuple(robot.couplings[name])
        mimic = {"joint": leader, "multiplier": repr(float(ratio)), "offset": repr(float(offset))}
        ElementTree.SubElement(element, "mimic", mimic)


def _add_shape(link: Element, shape: Geometry) -> None:
    element = ElementTree.SubElement(link, shape.role)
    _origin(element, shape.place)
    sizes = {
        "box": {"size": _text(2.0 * shape.size)},
        "mesh": {"filename": shape.file, "scale": _text(shape.size)},
        "sphere": {"radius": _text(shape.size)},
    }
    long = {"radius": _text(shape.size[:1]), "length": _text(2.0 * shape.size[-1:])}
    geometry = ElementTree.SubElement(element, "geometry")
    ElementTree.SubElement(geometry, shape.kind, sizes.get(shape.kind, long))
    if shape.colour is not None:
        material = ElementTree.SubElement(element, "material", name="")
        ElementTree.SubElement(material, "color", rgba=_text(np.array(shape.colour)))


def _link(root: Element, name: str, inertia: pin.Inertia | None) -> Element:
    """Add a link, with its inertia if it has one."""
    link = ElementTree.SubElement(root, "link", name=name)
    if inertia is not None:
        inertial = ElementTree.SubElement(link, "inertial")
        moments, axes = principal(inertia.inertia)
        _origin(inertial, pin.SE3(axes, inertia.lever))
        ElementTree.SubElement(inertial, "mass", value=repr(float(inertia.mass)))
        values = dict(zip(("ixx", "iyy", "izz"), map(repr, moments.tolist()), strict=True))
        ElementTree.SubElement(inertial, "inertia", values | dict.fromkeys(("ixy", "ixz", "iyz"), "0"))
    return link


def _joint(root: Element, name: str, kind: str, parent: str, child: str, place: pin.SE3) -> Element:
    """Add a joint between two links, at a place in the parent."""
    joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
    _origin(joint, place)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    return joint


def _origin(element: Element, place: pin.SE3) -> None:
    rpy = pin.rpy.matrixToRpy(place.rotation)
    ElementTree.SubElement(element, "origin", xyz=_text(place.translation), rpy=_text(rpy))


def _text(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
