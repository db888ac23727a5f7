"""A scene: fixed and moving objects, and the matrices of the moving ones at an instant.

A scene is made once. A frame is one matrix for each moving path, in a fixed order: a few kilobytes to copy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from wbc.app.scene.colours import ARROW_COLOURS, COM_COLOUR, LEGEND, ZMP_COLOUR
from wbc.app.scene.ground import ground_objects
from wbc.app.scene.marks import stretched, translation
from wbc.app.scene.shapes import (
    HIDDEN,
    MARK,
    ROOT,
    Colour,
    Legend,
    Part,
    SceneObject,
    Shape,
    disc,
    lathe,
    sphere,
)
from wbc.core.errors import Array

if TYPE_CHECKING:
    from wbc.sim.terrain.spec import Terrain

ARROWS = {"ground": 16, "push": 4}
"""Largest number of forces of each kind that are shown at a time; the largest forces come first."""


LONGEST = 1.5
"""Longest arrow of a force, in weights of the robot: one of a landing would grow out of the picture."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """State of the robot and its forces at one instant.

    Attributes:
        time: s.
        poses: Poses of the scene's bodies in the world, homogeneous, shape (number of bodies, 4, 4), m.
        com: Centre of mass in the world, shape (3,), m.
        zmp: Zero-tilting moment point in the world, shape (3,), m; None without contact.
        forces: Kind of arrow, point of attack (world, m) and force (world, N).
    """

    time: float
    poses: Array
    com: Array
    zmp: Array | None = None
    forces: Sequence[tuple[str, Array, Array]] = ()


@dataclass(frozen=True, eq=False)
class Scene:
    """All objects of a picture.

    Attributes:
        title: Name of the robot.
        bodies: Moving bodies, in the order of `Snapshot.poses`.
        objects: All objects.
        moving: Paths that a frame moves, in the order of its matrices: those of `frame`, then those of the layers.
        floor: Height of the endless plane, m.
        com_height: Height of the centre of mass at the start, m; camera, markers and arrows scale with it.
        metres_per_newton: Length of an arrow for each newton, m/N.
        legend: Meaning of the colours.
    """

    title: str
    bodies: tuple[str, ...]
    objects: tuple[SceneObject, ...]
    moving: tuple[str, ...]
    floor: float
    com_height: float
    metres_per_newton: float
    legend: Legend = LEGEND
    _frame_size: int = 0

    def frame(self, snapshot: Snapshot) -> Array:
        """Return one matrix, scale included, for each path of robot, markers and forces, shape (paths, 4, 4), m."""
        matrices = np.tile(HIDDEN, (self._frame_size, 1, 1))
        place = len(self.bodies)
        matrices[:place] = snapshot.poses
        level = (
            self.floor if snapshot.zmp is None else float(snapshot.zmp[2])
        )  # on stairs: that of the stance
        shadow = np.array([*snapshot.com[:2], level])
        for point in (snapshot.com, shadow, snapshot.zmp):
            if point is not None:
                matrices[place] = translation(*point)
            place += 1
        for kind, count in ARROWS.items():
            arrows = [(point, force) for name, point, force in snapshot.forces if name == kind]
            arrows.sort(key=lambda arrow: -float(np.linalg.norm(arrow[1])))
            for i, (point, force) in enumerate(arrows[:count]):
                matrices[place + i] = self._arrow(kind, point, force)
            place += count
        return matrices

    def extended(self, objects: Sequence[SceneObject], moving: Sequence[str], legend: Legend) -> Scene:
        """Return the scene with further objects; their moving paths come after those of `frame`."""
        return replace(
            self,
            objects=(*self.objects, *objects),
            moving=(*self.moving, *moving),
            legend=(*self.legend, *legend),
        )

    def reach(self, force: Array) -> Array:
        """Return the arrow of a force (N), m: from `LONGEST` times the robot's weight on it grows no more."""
        length = self.metres_per_newton * float(np.linalg.norm(force))
        return self.metres_per_newton * force * min(1.0, LONGEST * self.com_height / max(length, 1e-9))

    def _arrow(self, kind: str, point: Array, force: Array) -> Array:
        """Return the matrix that scales the unit arrow to a force; pushes end at their point."""
        reach = self.reach(force)
        return stretched(reach, point - reach if kind == "push" else point, 0.025 * self.com_height)


def make_scene(
    title: str, parts: Sequence[Part], terrain: Terrain | None, com_height: float, weight: float
) -> Scene:
    """Return the scene of a robot on its ground, flat at z = 0 when None.

    An arrow of the robot's weight, N, is as long as its centre of mass is high, m.
    """
    bodies = tuple(dict.fromkeys(part.body for part in parts))
    paths = {body: body_path(body) for body in bodies}
    objects = [
        SceneObject(f"{paths[part.body]}/{i}", part.shape, part.colour, part.placement)
        for i, part in enumerate(parts)
    ]
    objects += ground_objects(terrain)
    mark = disc(com_height)
    markers: dict[str, tuple[Shape, Colour]] = {
        "com": (sphere(MARK * com_height), COM_COLOUR),
        "com_shadow": (mark, COM_COLOUR),
        "zmp": (mark, ZMP_COLOUR),
    }
    moving = [*paths.values(), *(f"{ROOT}/markers/{name}" for name in markers)]
    objects += [
        SceneObject(
            f"{ROOT}/markers/{name}/shape", shape, colour, np.eye(4), on_top=True, shaded=name == "com"
        )
        for name, (shape, colour) in markers.items()
    ]
    for kind, count in ARROWS.items():
        arrows = [f"{ROOT}/forces/{kind}_{i}" for i in range(count)]
        moving += arrows
        objects += [
            SceneObject(
                f"{path}/shape", _UNIT_ARROW, ARROW_COLOURS[kind], np.eye(4), on_top=True, shaded=False
            )
            for path in arrows
        ]
    floor = 0.0 if terrain is None else float(terrain.surface.floor)
    return Scene(
        title,
        bodies,
        tuple(objects),
        tuple(moving),
        floor,
        com_height,
        com_height / weight,
        _frame_size=len(moving),
    )


def body_path(body: str) -> str:
    """Return the path of a body in the tree of the viewer."""
    return f"{ROOT}/robot/{body.replace('/', '_')}"


_UNIT_ARROW = lathe([(0.0, 0.0), (0.4, 0.0), (0.4, 0.75), (1.0, 0.75), (0.0, 1.0)], sides=12)
"""Arrow of length 1 along z with a head of radius 1."""
