"""Scenes to walk on that move under a foot: loose stones, plates that tilt, planks that bend.

Cameras and range sensors see them.
"""
# ruff: noqa: D102 - `build` is documented where it is declared

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import mujoco
import numpy as np
from pydantic import Field

from wbc.base.errors import InputError
from wbc.base.settings import NonNegative, Positive, Seed
from wbc.sim.scenes.base import METAL, Place, Scene, scene_kind
from wbc.sim.terrain.families.base import param

STONE = (0.62, 0.58, 0.52, 1.0)

DENSITY = 2600.0
"""Density of stones, kg/m³: that of granite and limestone."""

TRIES = 200
"""Draws of a place for each stone, after which there is no room left."""

Number = Annotated[int, Field(ge=1, le=1000)]


@scene_kind("loose_stones")
class LooseStones(Scene):
    """Stones that lie loose on the floor, tip and slide: flat ones, or pebbles as a layer of gravel has them."""

    seen: ClassVar[bool] = True

    seed: Seed = param(0, "Fixes sizes and places")
    count: Number = param(30, "Number of stones")
    shape: Literal["flat", "pebble"] = param("flat", "Boxes, or ellipsoids")
    size: Annotated[float, Field(ge=0.01, le=0.5), "m"] = param(0.16, "Length of the longest stones")
    height: Annotated[float, Field(ge=0.005, le=0.2), "m"] = param(0.03, "Height of the highest stones")
    length: Annotated[float, Field(ge=0.1, le=20.0), "m"] = param(2.0, "Extent of the stretch forward")
    width: Annotated[float, Field(ge=0.1, le=10.0), "m"] = param(0.8, "Extent of the stretch across")
    distance: Annotated[Place, "m"] = param(0.35, "Begin of the stretch from the origin")

    def build(self, spec: mujoco.MjSpec) -> None:
        draw, placed = np.random.default_rng(self.seed), list[tuple[float, float, float]]()
        round_, longest = self.shape == "pebble", 0.5 * self.size
        kind = "ellipsoid" if round_ else "box"
        share = math.pi / 6.0 if round_ else 1.0  # of the volume of the box around
        least, most = (0.375 * longest, 0.2 * self.height), (longest, 0.5 * self.height)
        for number in range(self.count):
            half = draw.uniform((least[0], *least), (most[0], *most))
            reach = max(half[0], half[1]) if round_ else math.hypot(half[0], half[1])
            turn = draw.uniform(0.0, math.pi)
            for _ in range(TRIES):
                x = self.distance + draw.uniform(0.0, self.length)
                y = draw.uniform(-0.5, 0.5) * self.width
                if all(math.hypot(x - a, y - b) > reach + r for a, b, r in placed):
                    break
            else:
                raise InputError(
                    f"count {self.count} of stones do not fit beside each other on {self.length:g} m x {self.width:g} "
                    f"m: {number} did; take fewer, or a larger stretch"
                )
            placed.append((x, y, reach))
            body = spec.worldbody.add_body(
                name=f"stone {number}",
                pos=[x, y, half[2]],
                quat=[math.cos(0.5 * turn), 0.0, 0.0, math.sin(0.5 * turn)],
            )
            body.add_freejoint()
            mass = DENSITY * share * 8.0 * float(half.prod())
            self.solid(body, kind, half.tolist(), mass=mass, colour=STONE)


@scene_kind("tilting_plates")
class TiltingPlates(Scene):
    """Plates across the way, one behind the other, each on a sprung hinge under its middle, or planks that bend.

    A plank is two halves that meet in its middle, each on a sprung hinge at its outer end: under a force F in the
    middle it sinks by F l²/(8 k), with its length l and the stiffness k of a hinge.
    """

    seen: ClassVar[bool] = True

    bend: bool = param(False, "True for planks that bend")
    count: Number = param(5, "Number of plates")
    distance: Annotated[Place, "m"] = param(0.35, "Begin of the first plate from the origin")
    length: Annotated[float, Field(ge=0.05, le=5.0), "m"] = param(0.35, "Extent of a plate forward")
    width: Annotated[float, Field(ge=0.1, le=10.0), "m"] = param(0.8, "Extent of a plate across")
    height: Annotated[float, Field(ge=0.02, le=0.5), "m"] = param(0.05, "Height of the top of a level plate")
    stiffness: Annotated[NonNegative, "Nm/rad"] = param(300.0, "Stiffness of a hinge")
    damping: Annotated[NonNegative, "Nms/rad"] = param(5.0, "Damping of a hinge")
    mass: Annotated[Positive, "kg"] = param(4.0, "Mass of a plate")

    def build(self, spec: mujoco.MjSpec) -> None:
        thickness, gap, parts = 0.5 * self.height, 0.01, 2 if self.bend else 1
        length = self.length / parts
        for number in range(parts * self.count):
            middle = self.distance + (number + 0.5) * length
            body = spec.worldbody.add_body(
                name=f"plate {number}", pos=[middle, 0.0, self.height - 0.5 * thickness]
            )
            end = (0.5 * length if number % 2 else -0.5 * length) if self.bend else 0.0
            joint = body.add_joint(
                type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 1.0, 0.0], pos=[end, 0.0, -0.5 * thickness]
            )
            joint.stiffness[0], joint.damping[0] = self.stiffness, self.damping
            size = (0.5 * (length - gap), 0.5 * self.width, 0.5 * thickness)
            self.solid(body, "box", size, mass=self.mass / parts, colour=METAL)
