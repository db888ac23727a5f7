"""Robot descriptions with other feet: the soles, and on request the masses, that a controller has to know."""

from __future__ import annotations

from dataclasses import replace
from xml.etree.ElementTree import Element, SubElement

import pinocchio as pin

from wbc.core.errors import ROUNDING, InputError
from wbc.feet import Foot
from wbc.robots import urdf
from wbc.robots.description import RobotDescription
from wbc.robots.frames import SoleDescription
from wbc.sim.plant.model import sole_geometries

MASS_SUFFIX = "/mass"
"""Suffix of a sole's name in the name of the link that carries the mass of its foot."""


def with_feet(description: RobotDescription, foot: Foot, *, mass: bool = False) -> RobotDescription:
    """Return the description of a robot on other feet, for its controller.

    Contacts, the observer and the force sensors then agree on where each sole is and how large.

    Args:
        description: The robot on its own soles.
        foot: Foot under both ankles.
        mass: Add mass and inertia of the feet in their rest shape; otherwise they stay unknown to the controller, as in
            the paper. The plant builds the feet itself and takes a description without them.

    Returns:
        The same description if there is nothing to change.

    Raises:
        InputError: The foot does not fit.
    """
    robot = description.robot()
    soles = []
    tree = urdf.read(description.urdf)
    for sole, geometry in zip(description.soles, sole_geometries(robot), strict=True):
        fit = foot.fit(geometry)
        if mass and fit.mass > 0.0:
            _add_mass(tree, f"{sole.name}{MASS_SUFFIX}", geometry.ankle_link, fit.added_inertia)
        fitted = fit.sole
        unchanged = fitted.placement.isApprox(geometry.placement, ROUNDING)
        if unchanged and (fitted.length, fitted.width) == (sole.length, sole.width):
            soles.append(sole)
            continue
        link, _ = description.attachment(sole.frame)
        soles.append(
            SoleDescription(
                frame=sole.frame if unchanged else f"{sole.name}_fitted",
                link=sole.link if unchanged else link,
                translation=sole.translation if unchanged else fitted.translation,
                rpy=sole.rpy if unchanged else tuple(pin.rpy.matrixToRpy(fitted.rotation_matrix).tolist()),
                name=sole.name,
                length=fitted.length,
                width=fitted.width,
            )
        )
    if mass and len(tree) > len(urdf.read(description.urdf)):
        description = replace(description, urdf=urdf.to_string(tree))
    if tuple(soles) == description.soles:
        return description
    return replace(description, soles=(soles[0], soles[1]))


def _add_mass(robot: Element, name: str, ankle: str, inertia: pin.Inertia) -> None:
    """Fix a link of the given inertia (in the axes of the ankle link) to the ankle, if it is not there already.

    A link of that name with another mass is an `InputError`.
    """
    for link in robot.findall("link"):
        if link.get("name") == name:
            worn = link.find("inertial/mass")
            has = 0.0 if worn is None else float(worn.get("value", "0"))
            if abs(has - inertia.mass) > ROUNDING:
                raise InputError(
                    f"the description wears other feet already, '{name}' has {has:g} kg, not {inertia.mass:g} kg; "
                    "give one without them"
                )
            return
    inertial = SubElement(SubElement(robot, "link", name=name), "inertial")
    SubElement(inertial, "origin", xyz=" ".join(f"{value!r}" for value in inertia.lever.tolist()))
    SubElement(inertial, "mass", value=repr(float(inertia.mass)))
    moments = {
        f"i{'xyz'[i]}{'xyz'[j]}": repr(float(inertia.inertia[i, j])) for i in range(3) for j in range(i, 3)
    }
    SubElement(inertial, "inertia", moments)
    joint = SubElement(robot, "joint", name=f"{name}_fixed", type="fixed")
    SubElement(joint, "parent", link=ankle)
    SubElement(joint, "child", link=name)
