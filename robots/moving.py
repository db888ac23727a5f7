"""URDF of the moving links of a robot alone, for physics engines that read a URDF in their own way."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.robots import urdf
from wbc.robots.source import Element, Source

BETWEEN = 1e-9
"""Mass, kg, of the link between two joints of one link, and a thousand times its inertia, kg m²."""


def moving_links(
    source: Source, name: str, fixed: bool, rotors: Mapping[str, float], *, merged: bool = True
) -> str:
    """Return a URDF of links that move, with inertias and joints alone.

    Links that are fixed to another one are merged into it. Every link has an inertia, which is given in its principal
    axes: some engines take a link without one for 1 kg, others read the diagonal alone.

    Args:
        source: The robot.
        name: Name of the robot.
        fixed: True for a robot that is bolted to the world.
        rotors: Joint → inertia of its rotor, kg m², that becomes a thin disc of the link behind the joint; empty for
            an engine that knows rotors.
        merged: False to keep links and sites that are fixed to a link, as links without mass.

    Raises:
        InputError: A rotor of a joint that slides.
    """
    model, coupled = source.tree(name, fixed), source.couplings()
    data, neutral = model.createData(), pin.neutral(model)
    first = 0 if fixed else 1  # the joint of the root link
    links = {joint: f"{model.names[joint]}_link" for joint in range(first, model.njoints)}
    for frame in reversed(list(model.frames)):  # the first of a joint is its own
        if frame.type == pin.FrameType.BODY and frame.parentJoint in links:
            links[frame.parentJoint] = str(frame.name)
    robot = Element("robot", name=name)
    for number, link in links.items():
        inertia = model.inertias[number]
        if not inertia.mass and number > first:  # a joint of a link with several
            inertia = pin.Inertia(BETWEEN, np.zeros(3), 1e-3 * BETWEEN * np.eye(3))
        if number == first:
            robot.append(_link(link, inertia.mass, inertia.lever, inertia.inertia))
            continue
        own, limits = str(model.names[number]), model.idx_qs[number]
        kind = model.joints[number]
        kind.calc(data.joints[number], neutral[limits : limits + 1])
        subspace = np.ravel(data.joints[number].S)
        slides = not subspace[3:].any()
        axis = subspace[:3] if slides else subspace[3:]
        about = np.array(inertia.inertia)
        if rotor := rotors.get(own, 0.0):
            if slides:
                raise InputError(
                    f"the rotor of joint '{own}', which slides, is no disc of a link: take its armature out"
                )
            about += rotor * 0.5 * (np.eye(3) + np.outer(axis, axis))
        robot.append(_link(link, inertia.mass, inertia.lever, about))
        low, high = float(model.lowerPositionLimit[limits]), float(model.upperPositionLimit[limits])
        endless = not np.isfinite([low, high]).all()
        element = ElementTree.SubElement(
            robot, "joint", name=own, type="prismatic" if slides else "continuous" if endless else "revolute"
        )
        place = model.jointPlacements[number]
        _origin(element, place.translation, place.rotation)
        ElementTree.SubElement(element, "parent", link=links[model.parents[number]])
        ElementTree.SubElement(element, "child", link=link)
        ElementTree.SubElement(element, "axis", xyz=_text(axis))
        speed = model.idx_vs[number]
        most = {"effort": model.upperEffortLimit[speed], "velocity": model.upperVelocityLimit[speed]}
        bounds = {} if endless else {"lower": repr(low), "upper": repr(high)}
        ElementTree.SubElement(
            element, "limit", {**bounds, **{key: repr(float(value)) for key, value in most.items()}}
        )
        if own in coupled:
            urdf.couple(element, coupled[own])
    for frame in [] if merged else list(model.frames):
        kinds, own = (pin.FrameType.BODY, pin.FrameType.OP_FRAME), links.get(frame.parentJoint, frame.name)
        if frame.type in kinds and frame.name != own:
            ElementTree.SubElement(robot, "link", name=frame.name)
            element = ElementTree.SubElement(robot, "joint", name=f"{frame.name}_fixed", type="fixed")
            _origin(element, frame.placement.translation, frame.placement.rotation)
            ElementTree.SubElement(element, "parent", link=own)
            ElementTree.SubElement(element, "child", link=frame.name)
    ElementTree.indent(robot)  # some engines read lines of limited length
    return ElementTree.tostring(robot, encoding="unicode")


def add_shapes(xml: str, source: Source) -> str:
    """Return a URDF that has all links of a robot with the shapes of these links."""
    robot = ElementTree.fromstring(xml)
    links = {link.get("name"): link for link in robot.findall("link")}
    for shape in source.shapes():
        element = ElementTree.SubElement(links[shape.link], shape.role)
        _origin(element, shape.place.translation, shape.place.rotation)
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
    return ElementTree.tostring(robot, encoding="unicode")


def _link(name: str, mass: float, lever: Array, inertia: Array) -> Element:
    """Return a link with its mass (kg), centre of mass (m) and inertia about it (kg m²), both in its frame."""
    link = Element("link", name=name)
    sizes, axes = np.linalg.eigh(inertia)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    inertial = ElementTree.SubElement(link, "inertial")
    _origin(inertial, lever, axes)
    ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
    moments = zip(("ixx", "iyy", "izz"), sizes.tolist(), strict=True)
    products = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
    ElementTree.SubElement(inertial, "inertia", {**{key: repr(size) for key, size in moments}, **products})
    return link


def _origin(element: Element, place: Array, rotation: Array) -> None:
    ElementTree.SubElement(
        element, "origin", xyz=_text(place), rpy=_text(pin.rpy.matrixToRpy(np.asarray(rotation)))
    )


def _text(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
