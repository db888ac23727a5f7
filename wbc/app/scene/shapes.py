"""Shapes, colours and objects that a scene is made of."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wbc.core.errors import Array

Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity, each from 0 to 1."""

Legend = tuple[tuple[str, Colour], ...]
"""Meanings of colours, for the page."""

ROOT = "/wbc"
"""Root of all objects in the tree of the viewer."""

MARK = 0.022
"""Radius of the marks of points, for each metre that the centre of mass is high."""

HIDDEN = np.diag([1e-6, 1e-6, 1e-6, 1.0])
"""Matrix of an object that is not shown: too small to be seen (a zero scale has no inverse)."""


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


Shape = MeshFile | Surface


@dataclass(frozen=True, eq=False)
class Part:
    """A shape on a body.

    Attributes:
        body: Link (or body of the simulator) that carries it.
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


def box(x: float, y: float, z: float) -> Surface:
    """Return a box of full extents, m."""
    corners = 0.5 * np.array(list(itertools.product((-x, x), (-y, y), (-z, z))))
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    first = 4 * np.arange(6)[:, None]  # each side has corners of its own: edges are sharp
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]]).astype(np.uint32)
    return Surface(corners[np.ravel(sides)], faces)


def ellipsoid(*semi_axes: float) -> Surface:
    """Return an ellipsoid of three semi-axes, m."""
    ball = lathe([(math.cos(angle), math.sin(angle)) for angle in np.linspace(-0.5, 0.5, 13) * math.pi])
    return replace(ball, vertices=ball.vertices * semi_axes)


def sphere(radius: float) -> Surface:
    """Return a sphere, m."""
    return ellipsoid(radius, radius, radius)


def cylinder(radius: float, length: float, *, round_ends: bool = False) -> Surface:
    """Return a cylinder along z, m; with round ends beyond its length, a capsule."""
    end = [(radius, 0.0), (radius, 0.0), (0.0, 0.0)]
    if round_ends:
        end = [(radius * math.cos(a), radius * math.sin(a)) for a in np.linspace(0.0, 0.5, 7) * math.pi]
    above = [(r, 0.5 * length + z) for r, z in end]
    return lathe([*((r, -z) for r, z in reversed(above)), *above])


def lathe(profile: Sequence[tuple[float, float]], sides: int = 24) -> Surface:
    """Return what a profile, radius and height (m) of each point from below, makes around z; edges are points twice."""
    angle = math.tau * np.arange(sides) / sides
    circle = np.stack([np.cos(angle), np.sin(angle), np.ones(sides)], axis=1)
    vertices = np.concatenate([circle * (r, r, z) for r, z in profile])
    i = np.arange(sides)
    j = (i + 1) % sides
    below = sides * np.arange(len(profile) - 1)[:, None, None]
    quads = [np.stack([i, j, sides + j], axis=1), np.stack([i, sides + j, sides + i], axis=1)]
    faces = (below + np.concatenate(quads)).reshape(-1, 3)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return Surface(vertices, faces[np.abs(np.cross(b - a, c - a)).max(axis=1) > 1e-12].astype(np.uint32))


def disc(size: float) -> Surface:
    """Return the flat disc that marks a point on the ground, for a robot whose centre of mass is `size` (m) high."""
    return cylinder(MARK * size, 0.004 * size)


def two_sided(vertices: Array, faces: Iterable[tuple[int, int, int]]) -> Surface:
    """Return triangles that are seen from above and from below."""
    above = np.array(list(faces), dtype=np.uint32)
    return Surface(vertices, np.concatenate([above, above[:, ::-1]]))
