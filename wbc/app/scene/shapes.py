"""Shapes, colours and objects that a scene is made of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from wbc.core.errors import Array

Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity, each from 0 to 1."""

Legend = tuple[tuple[str, Colour], ...]
"""Meanings of colours, for the page."""

ROOT = "/wbc"
"""Root of all objects in the tree of the viewer."""

HIDDEN = np.diag([1e-6, 1e-6, 1e-6, 1.0])
"""Matrix of an object that is not shown: too small to be seen (a zero scale has no inverse)."""


@dataclass(frozen=True)
class VisualBox:
    """A box of the given full extents, m."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class VisualEllipsoid:
    """An ellipsoid of the given semi-axes, m; a sphere when they are equal."""

    semi_axes: tuple[float, float, float]


@dataclass(frozen=True)
class VisualCylinder:
    """A cylinder along z, m; with round ends beyond its length, a capsule."""

    radius: float
    length: float
    round_ends: bool = False


@dataclass(frozen=True)
class MeshFile:
    """A mesh in a file, scaled."""

    path: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles: vertices of shape (n, 3), m; faces of shape (m, 3); colours of the vertices, shape (n, 3), or None."""

    vertices: Array
    faces: np.ndarray[tuple[int, int], np.dtype[np.uint32]]
    colours: Array | None = None


Shape = VisualBox | VisualEllipsoid | VisualCylinder | MeshFile | Surface


@dataclass(frozen=True, eq=False)
class Part:
    """A shape on a body.

    Attributes:
        body: Link (or body of the simulator) that carries it.
        shape: The shape.
        colour: Its colour.
        placement: Pose in the frame of the body, homogeneous, shape (4, 4), m.
    """

    body: str
    shape: Shape
    colour: Colour
    placement: Array


@dataclass(frozen=True, eq=False)
class SceneObject:
    """An object of the viewer.

    Attributes:
        path: Place in the tree; frames move a path above it.
        shape: The shape.
        colour: Its colour.
        placement: Pose relative to the path above, shape (4, 4), m.
        on_top: Drawn in front of everything else.
        shaded: Lit by the lamps; in its plain colour when False.
        deformable: A `Surface` whose vertices come with the annotations of frames.
    """

    path: str
    shape: Shape
    colour: Colour
    placement: Array
    on_top: bool = False
    shaded: bool = True
    deformable: bool = False


def sphere(radius: float) -> VisualEllipsoid:
    """Return a sphere."""
    return VisualEllipsoid((radius, radius, radius))


def disc(size: float) -> VisualCylinder:
    """Return the flat disc that marks a point on the ground, for a robot whose centre of mass is `size` (m) high."""
    return VisualCylinder(0.022 * size, 0.004 * size)


def two_sided(vertices: Array, faces: Iterable[tuple[int, int, int]]) -> Surface:
    """Return triangles that are seen from above and from below."""
    above = np.array(list(faces), dtype=np.uint32)
    return Surface(vertices, np.concatenate([above, above[:, ::-1]]))
