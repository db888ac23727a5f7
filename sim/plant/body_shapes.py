"""Shapes with which the links of a robot touch a scene: those of its own description."""

from __future__ import annotations

import mujoco
import pinocchio as pin

from wbc.core.robot import Robot
from wbc.robots.derivation.shapes import LinkShape, link_shapes
from wbc.robots.description import RobotDescription
from wbc.sim.scenes.base import GEOMS

SHAPE_GROUP = 3
"""Geom group of these shapes: viewers do not show it, and range sensors do not see it."""

HAND_RADIUS = 0.03
"""Radius of the ball at a hand without geometry, m."""


def add_body_shapes(spec: mujoco.MjSpec, description: RobotDescription, robot: Robot) -> None:
    """Let all links but the feet touch things and the ground, not each other; each hand has a site in the model."""
    feet = {description.attachment(sole.frame)[0] for sole in description.soles}
    shaped = set()
    for shape in link_shapes(description.urdf, description.package_dirs):
        body = spec.body(shape.link)
        if body is None or description.attachment(shape.link)[0] in feet:
            continue
        shaped.add(description.attachment(shape.link)[0])
        _add(body, shape)
    for role, frame in robot.frames.items():
        if description.attachment(frame)[0] not in shaped:
            site = spec.site(f"{role} site")
            ball = LinkShape(frame, "sphere", (HAND_RADIUS,), pin.SE3(pin.Quaternion.Identity(), site.pos))
            _add(site.parent, ball)


def _add(body: mujoco.MjsBody, shape: LinkShape) -> None:
    x, y, z, w = pin.Quaternion(shape.placement.rotation).normalized().coeffs()
    body.add_geom(
        type=GEOMS[shape.kind],
        size=[*shape.size, *[0.0] * (3 - len(shape.size))],
        pos=shape.placement.translation,
        quat=[w, x, y, z],
        mass=0.0,
        group=SHAPE_GROUP,
        contype=0,  # not with each other
        conaffinity=1,
        rgba=[0.0, 0.0, 0.0, 0.0],
    )
