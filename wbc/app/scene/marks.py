"""Flat marks on the ground, and lines: outlines, plates, polygons, ribbons."""

from __future__ import annotations

import math

import numpy as np

from wbc.app.scene.shapes import HIDDEN, Surface, two_sided
from wbc.core.errors import Array

LIFT = 0.004
"""Height of marks above the ground, m: at the same height both would flicker."""

LINE = 0.006
"""Width of outlines, m."""


def rectangle(length: float, width: float) -> Array:
    """Return the corners of a rectangle around the origin, length (m) along x, width (m) along y, shape (4, 3)."""
    corners: Array = np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0)]) * (
        0.5 * length,
        0.5 * width,
        0.0,
    )
    return corners


def outline(corners: Array) -> Surface:
    """Return the border of a rectangle with the given corners, shape (4, 3), m; `LINE` wide to the inside."""
    inward = np.zeros_like(corners)
    for neighbour in (np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)):
        edge = neighbour - corners
        inward += edge / np.linalg.norm(edge, axis=1, keepdims=True)
    return two_sided(np.concatenate([corners, corners + LINE * inward]), _band(4))


def ring(radius: float, line: float) -> Surface:
    """Return a ring around the origin, `line` (m) wide to the inside."""
    sides = 24
    angle = math.tau * np.arange(sides) / sides
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1)
    return two_sided(np.concatenate([radius * circle, (radius - line) * circle]), _band(sides))


def polygon(corners: Array) -> Surface:
    """Return a convex polygon with the given corners, shape (n, 3), m."""
    return two_sided(corners, [(0, i, i + 1) for i in range(1, len(corners) - 1)])


def polygon_corners(points: Array, count: int) -> Array:
    """Return the vertices of a polygon of `count` corners, shape (count, 3), m, through points in order.

    Fewer than three points give an invisible polygon.
    """
    if len(points) < 3:
        return np.zeros((count, 3))
    points = _thinned(points, count)
    return np.concatenate([points, np.repeat(points[-1:], count - len(points), axis=0)])


def ribbon(edges: Array) -> Surface:
    """Return a ribbon between two lines: the first and the second half of the vertices, shape (2 n, 3), m."""
    count = len(edges) // 2
    faces = [(i, i + 1, count + i + 1) for i in range(count - 1)]
    faces += [(i, count + i + 1, count + i) for i in range(count - 1)]
    return two_sided(edges, faces)


def ribbon_edges(points: Array, width: float, count: int) -> Array:
    """Return the vertices of both edges of a ribbon along points, of a horizontal width, m; shape (2 count, 3), m.

    Fewer than two points give an invisible ribbon.
    """
    if len(points) < 2:
        return np.zeros((2 * count, 3))
    points = _thinned(points, count)
    along = points[-1, :2] - points[0, :2]
    length = float(np.hypot(*along))
    forward = along / length if length > 1e-9 else np.array([1.0, 0.0])
    aside = 0.5 * width * np.array([-forward[1], forward[0], 0.0])
    points = np.concatenate([points, np.repeat(points[-1:], count - len(points), axis=0)])
    return np.concatenate([points + aside, points - aside])


def segment(start: Array, end: Array) -> Array:
    """Return the matrix that stretches a rod of length 1 along z, centred at the origin, between two points (m)."""
    return stretched(end - start, 0.5 * (start + end))


def stretched(along: Array, place: Array, thickness: float = 1.0) -> Array:
    """Return the matrix that brings a shape of length 1 along z to a place, turned and as long as a vector, m."""
    length = float(np.linalg.norm(along))
    if not length > 1e-3:
        return HIDDEN
    z = along / length
    x = np.cross(z, (0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0))
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([thickness * x, thickness * np.cross(z, x), along, place])
    return matrix


def translation(x: float, y: float, z: float) -> Array:
    """Return the matrix of a translation, m."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def _thinned(points: Array, count: int) -> Array:
    """Return at most so many of the points, evenly chosen."""
    if len(points) <= count:
        return points
    thinned: Array = points[np.linspace(0, len(points) - 1, count).round().astype(int)]
    return thinned


def _band(count: int) -> list[tuple[int, int, int]]:
    """Return the triangles between an outer and an inner border of so many vertices each."""
    pairs = [(i, (i + 1) % count) for i in range(count)]
    return [face for i, j in pairs for face in ((i, j, count + j), (i, count + j, count + i))]
