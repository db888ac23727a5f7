"""Scenes: a wall, a table, a rail, a box, a cart, a door."""
# ruff: noqa: D102 - `build` is documented where it is declared

from __future__ import annotations

import math
from typing import Annotated, Literal

import mujoco
from pydantic import Field

from wbc.base.errors import InputError
from wbc.base.settings import NonNegative, Positive
from wbc.core.robot import GRAVITY
from wbc.sim.scenes.base import ALONG_X, ALONG_Y, METAL, Place, Scene, Size, scene_kind
from wbc.sim.terrain.families.base import param

HANDLE_RADIUS = 0.015
"""Radius of a handle, m."""

GRIP = 0.2
"""Distance of both handles of a bar from its middle, m."""

Bar = Annotated[float, Field(ge=2.0 * GRIP, le=20.0)]
"""Extent of a thing with a bar across, m: less leaves its handles beside it."""

Opening = Annotated[float, Field(ge=0.1, le=20.0)]
"""Extent of a door, m: less leaves nothing of its leaf."""

Mass = Annotated[float, Field(gt=0.0, le=1000.0), "kg"]


@scene_kind("wall")
class Wall(Scene):
    """A wall to lean against."""

    distance: Annotated[Place, "m"] = param(0.5, "Its face from the origin")
    angle: Annotated[float, Field(ge=-360.0, le=360.0), "°"] = param(
        0.0, "Direction in which it stands: 0 ahead, 90 to the left"
    )
    width: Annotated[Size, "m"] = param(2.0, "Width")
    height: Annotated[Size, "m"] = param(2.0, "Height")

    def build(self, spec: mujoco.MjSpec) -> None:
        thickness, angle = 0.1, math.radians(self.angle)
        middle = self.distance + 0.5 * thickness
        body = spec.worldbody.add_body(
            name="wall",
            pos=[middle * math.cos(angle), middle * math.sin(angle), 0.5 * self.height],
            quat=[math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)],
        )
        self.solid(body, "box", (0.5 * thickness, 0.5 * self.width, 0.5 * self.height))


@scene_kind("table")
class Table(Scene):
    """A table that does not move."""

    distance: Annotated[Place, "m"] = param(0.3, "Its front edge from the origin")
    height: Annotated[Size, "m"] = param(0.75, "Height of its top")
    length: Annotated[Size, "m"] = param(0.6, "Extent forward")
    width: Annotated[Size, "m"] = param(1.2, "Extent across")

    def build(self, spec: mujoco.MjSpec) -> None:
        thickness = min(0.04, self.height)
        body = spec.worldbody.add_body(
            name="table", pos=[self.distance + 0.5 * self.length, 0.0, self.height - 0.5 * thickness]
        )
        self.solid(body, "box", (0.5 * self.length, 0.5 * self.width, 0.5 * thickness))
        leg = 0.5 * (self.height - thickness)
        if leg > 0.0:
            for x in (-0.5, 0.5):
                for y in (-0.5, 0.5):
                    at = (x * (self.length - 0.05), y * (self.width - 0.05), -leg - 0.5 * thickness)
                    self.solid(body, "box", (0.02, 0.02, leg), at)


@scene_kind("rail")
class Rail(Scene):
    """A handrail across, on two posts."""

    distance: Annotated[Place, "m"] = param(0.4, "Middle of the bar from the origin")
    height: Annotated[Size, "m"] = param(0.9, "Height of the top of the bar")
    width: Annotated[Bar, "m"] = param(1.6, "Length of the bar")
    radius: Annotated[float, Field(gt=0.0, le=0.2), "m"] = param(0.025, "Radius of the bar")

    def __post_init__(self) -> None:
        if self.height <= self.radius:
            raise InputError(
                f"height (m) of a rail must be above its radius of {self.radius:g} m, got {self.height:g}"
            )

    def build(self, spec: mujoco.MjSpec) -> None:
        level = self.height - self.radius
        body = spec.worldbody.add_body(name="rail", pos=[self.distance, 0.0, level])
        self.solid(body, "capsule", (self.radius, 0.5 * self.width), quat=ALONG_Y, colour=METAL)
        for name, y in (("left", GRIP), ("right", -GRIP)):
            body.add_site(name=f"{name} handle", pos=[0.0, y, 0.0])
        for y in (-0.5 * self.width, 0.5 * self.width):
            self.solid(body, "capsule", (self.radius, 0.5 * level), (0.0, y, -0.5 * level), colour=METAL)


@scene_kind("box")
class BoxOnStand(Scene):
    """A box with a handle on either side, on a stand."""

    distance: Annotated[Place, "m"] = param(0.5, "Its middle from the origin")
    height: Annotated[NonNegative, "m"] = param(0.6, "Height of the stand; 0 puts it on the ground")
    mass: Mass = param(3.0, "Mass")
    length: Annotated[Size, "m"] = param(0.3, "Extent forward")
    width: Annotated[Size, "m"] = param(0.36, "Extent across, without handles")
    tall: Annotated[Size, "m"] = param(0.25, "Extent upwards")

    def build(self, spec: mujoco.MjSpec) -> None:
        if self.height > 0.0:
            stand = spec.worldbody.add_body(name="stand", pos=[self.distance, 0.0, 0.5 * self.height])
            self.solid(stand, "box", (0.5 * self.length, 0.5 * self.width, 0.5 * self.height), colour=METAL)
        body = spec.worldbody.add_body(
            name="box", pos=[self.distance, 0.0, self.height + 0.5 * self.tall + 1e-4]
        )
        body.add_freejoint()
        self.solid(body, "box", (0.5 * self.length, 0.5 * self.width, 0.5 * self.tall), mass=self.mass)
        for name, side in (("left", 1.0), ("right", -1.0)):
            y = side * (0.5 * self.width + 0.03)
            self.solid(body, "capsule", (HANDLE_RADIUS, 0.06), (0.0, y, 0.0), quat=ALONG_X, colour=METAL)
            body.add_site(name=f"{name} handle", pos=[0.0, y, 0.0])


@scene_kind("cart")
class Cart(Scene):
    """A cart on four castors, with a bar to push and pull it by."""

    distance: Annotated[Place, "m"] = param(0.45, "Its bar from the origin")
    mass: Mass = param(10.0, "Mass")
    resistance: Annotated[NonNegative, "N"] = param(15.0, "Force along the ground that moves it")
    handle: Annotated[Size, "m"] = param(0.9, "Height of its bar")
    length: Annotated[Size, "m"] = param(0.9, "Distance of its axles")
    width: Annotated[Bar, "m"] = param(0.5, "Width of the platform and length of the bar")

    def build(self, spec: mujoco.MjSpec) -> None:
        wheel, deck = 0.06, 0.04
        behind = 0.12  # of the bar, behind the rear axle: room for the feet
        body = spec.worldbody.add_body(
            name="cart", pos=[self.distance + behind + 0.5 * self.length, 0.0, wheel]
        )
        body.add_freejoint()
        half, side = 0.5 * self.length, 0.5 * self.width
        self.solid(body, "box", (half, side, deck), (0.0, 0.0, wheel + deck), mass=0.8 * self.mass)
        top = self.handle - wheel
        bar = (-half - behind, 0.0, top)
        self.solid(
            body, "capsule", (HANDLE_RADIUS, side), bar, quat=ALONG_Y, mass=0.04 * self.mass, colour=METAL
        )
        for name, sign in (("left", 1.0), ("right", -1.0)):
            body.add_site(name=f"{name} handle", pos=[bar[0], GRIP * sign, top])
            post = body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=[-half, sign * side, wheel, bar[0], sign * side, top],
                size=[HANDLE_RADIUS, 0.0, 0.0],
                mass=0.02 * self.mass,
                rgba=METAL,
            )
            post.friction[0] = self.friction
        for x in (-half, half):
            for y in (-side, side):
                castor = self.solid(
                    body, "sphere", (wheel,), (x, y, 0.0), mass=0.03 * self.mass, colour=METAL
                )
                castor.friction = [self.resistance / (self.mass * GRAVITY), 0.0, 0.0]
                castor.priority, castor.condim = 2, 3


@scene_kind("door")
class Door(Scene):
    """A door in a frame, with a hinge and a handle."""

    distance: Annotated[Place, "m"] = param(0.6, "Its leaf from the origin")
    hinge: Literal["left", "right"] = param("left", "Side of the hinge, as the robot sees it")
    opens: Literal["away", "towards"] = param("away", "Direction in which it opens")
    width: Annotated[Opening, "m"] = param(1.0, "Width of the leaf")
    height: Annotated[Opening, "m"] = param(2.0, "Height of the leaf")
    mass: Mass = param(12.0, "Mass of the leaf")
    resistance: Annotated[NonNegative, "Nm"] = param(2.0, "Dry friction of the hinge")
    damping: Annotated[NonNegative, "Nms/rad"] = param(2.0, "Damping of the hinge")
    handle: Annotated[Positive, "m"] = param(0.95, "Height of the handle")

    def __post_init__(self) -> None:
        if self.handle >= self.height:
            raise InputError(
                f"handle (m) of a door must be below the top of its leaf at {self.height:g} m, got {self.handle:g}"
            )

    def build(self, spec: mujoco.MjSpec) -> None:
        side = 1.0 if self.hinge == "left" else -1.0
        thickness = 0.04
        # Middle of the doorway at y = 0; the leaf turns about its edge.
        body = spec.worldbody.add_body(name="door", pos=[self.distance, side * 0.5 * self.width, 0.0])
        # The free edge of a leaf with its hinge on the left moves away with positive turns.
        sign = side if self.opens == "away" else -side
        limits = [0.0, math.radians(110.0)]
        body.add_joint(
            name="door hinge",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0.0, 0.0, sign],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            range=limits,
            damping=[self.damping, 0.0, 0.0],
            frictionloss=self.resistance,
        )
        gap = 0.01
        leaf = (0.5 * thickness, 0.5 * self.width - gap, 0.5 * self.height - gap)
        middle = (0.5 * thickness, -side * 0.5 * self.width, 0.5 * self.height + gap)
        self.solid(body, "box", leaf, middle, mass=self.mass)
        at = (-0.06, -side * (self.width - 0.1), self.handle)
        self.solid(body, "capsule", (HANDLE_RADIUS, 0.06), at, quat=ALONG_Y, mass=0.3, colour=METAL)
        body.add_site(name="door handle", pos=at)
        spec.add_exclude(bodyname1="door", bodyname2="door frame")
        frame = spec.worldbody.add_body(name="door frame", pos=[self.distance, 0.0, 0.0])
        for y in (-1.0, 1.0):
            self.solid(
                frame,
                "box",
                (0.05, 0.04, 0.5 * self.height),
                (0.02, y * (0.5 * self.width + 0.05), 0.5 * self.height),
                colour=METAL,
            )
