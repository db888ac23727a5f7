"""A robot as it is with other feet on: what its controller has to know of them."""

from __future__ import annotations

from dataclasses import replace

import pinocchio as pin

from wbc.feet import Foot
from wbc.robots.description import RobotDescription
from wbc.robots.frames import SoleDescription
from wbc.sim.model import sole_geometries


def shod(description: RobotDescription, foot: Foot) -> RobotDescription:
    """Describe a robot whose soles are those of a foot.

    Contacts, the observer and the force sensors then agree on where each sole is and how large. The mass of the foot
    stays unknown to the controller's model.

    Args:
        description: The robot with its own soles.
        foot: Put under both ankles.

    Returns:
        The same description if the foot is the robot's own sole.

    Raises:
        InputError: The foot does not fit.
    """
    robot = description.robot()
    soles = []
    for own, geometry in zip(description.soles, sole_geometries(robot), strict=True):
        fitted = foot.fit(geometry).sole
        unchanged = fitted.placement.isApprox(geometry.placement, 1e-9)
        if unchanged and (fitted.length, fitted.width) == (own.length, own.width):
            soles.append(own)
            continue
        link, _ = description.attachment(own.frame)
        soles.append(
            SoleDescription(
                frame=own.frame if unchanged else f"{own.name}_fitted",
                link=own.link if unchanged else link,
                translation=own.translation if unchanged else fitted.translation,
                rpy=own.rpy if unchanged else tuple(pin.rpy.matrixToRpy(fitted.rotation_matrix).tolist()),
                name=own.name,
                length=fitted.length,
                width=fitted.width,
            )
        )
    if tuple(soles) == description.soles:
        return description
    return replace(description, soles=(soles[0], soles[1]))
