"""Flat marks on the ground, and lines: outlines, plates, polygons, ribbons."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from wbc.app.view.scene import HIDDEN, upright_axes
from wbc.app.view.shapes import Surface
from wbc.core.errors import Array


def plate(length: float, width: float) -> Surface:
    """A rectangle around the origin, length (m) along x and width (m) along y."""
    return _both_sides(_corners(length, width), [(0, 1, 2), (0, 2, 3)])


def outline(length: float, width: float, line: float) -> Surface:
    """The border of a rectangle, `line` (m) wide to the inside."""
    vertices = np.concatenate([_corners(length, width), _corners(length - 2.0 * line, width - 2.0 * line)])
    return _both_sides(vertices, _band(4))


def ring(radius: float, line: float, sides: int = 24) -> Surface:
    """A ring around the origin, `line` (m) wide to the inside."""
    angle = 2.0 * math.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1)
    return _both_sides(np.concatenate([radius * circle, (radius - line) * circle]), _band(sides))


def polygon(most: int) -> Surface:
    """A convex polygon of at most so many corners; all in one place as long as nobody moves them."""
    return _both_sides(np.zeros((most, 3)), [(0, i, i + 1) for i in range(1, most - 1)])


def polygon_corners(points: Array, most: int) -> Array:
    """Vertices for `polygon`.

    Args:
        points: Corners in order, shape (n, 3), m; without three of them there is nothing to see.
        most: Number of corners of the shape.

    Returns:
        Shape (most, 3), m.
    """
    if len(points) < 3:
        return np.zeros((most, 3))
    chosen = np.linspace(0, len(points) - 1, most).round().astype(int) if len(points) > most else None
    kept = points if chosen is None else points[chosen]
    return np.concatenate([kept, np.repeat(kept[-1:], most - len(kept), axis=0)])


def ribbon(most: int) -> Surface:
    """A ribbon through at most so many points; all in one place as long as nobody moves them."""
    faces = [(i, i + 1, most + i + 1) for i in range(most - 1)]
    faces += [(i, most + i + 1, most + i) for i in range(most - 1)]
    return _both_sides(np.zeros((2 * most, 3)), faces)


def ribbon_edges(points: Array, width: float, most: int) -> Array:
    """Vertices for `ribbon`.

    Args:
        points: Points along the ribbon, shape (n, 3), m; with less than two of them there is nothing to see.
        width: Horizontal width, m.
        most: Number of points of the shape.

    Returns:
        Shape (2 most, 3), m.
    """
    if len(points) < 2:
        return np.zeros((2 * most, 3))
    if len(points) > most:
        points = points[np.linspace(0, len(points) - 1, most).round().astype(int)]
    along = points[-1, :2] - points[0, :2]
    length = float(np.hypot(*along))
    forward = along / length if length > 1e-9 else np.array([1.0, 0.0])
    aside = 0.5 * width * np.array([-forward[1], forward[0], 0.0])
    points = np.concatenate([points, np.repeat(points[-1:], most - len(points), axis=0)])
    return np.concatenate([points + aside, points - aside])


def segment(start: Array, end: Array) -> Array:
    """Matrix that stretches a rod of length 1 along z, centred at the origin, from one point to another (m)."""
    along = end - start
    length = float(np.linalg.norm(along))
    if not length > 1e-6:
        return HIDDEN
    matrix = np.eye(4)
    x, y, z = upright_axes(along / length)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = x, y, length * z
    matrix[:3, 3] = 0.5 * (start + end)
    return matrix


def _corners(length: float, width: float) -> Array:
    corners: Array = np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0)]) * (
        0.5 * length,
        0.5 * width,
        0.0,
    )
    return corners


def _band(count: int) -> list[tuple[int, int, int]]:
    """Triangles between an outer and an inner border of so many vertices each."""
    pairs = [(i, (i + 1) % count) for i in range(count)]
    return [face for i, j in pairs for face in ((i, j, count + j), (i, count + j, count + i))]


def _both_sides(vertices: Array, faces: Iterable[tuple[int, int, int]]) -> Surface:
    """Triangles seen from above and from below."""
    above = np.array(list(faces), dtype=np.uint32)
    return Surface(vertices, np.concatenate([above, above[:, ::-1]]))
