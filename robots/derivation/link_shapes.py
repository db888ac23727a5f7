"""Simple shapes of a robot's links, from those of its file."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pinocchio as pin

from wbc.core.limits.obstacles import (
    CollisionBox,
    CollisionCapsule,
    CollisionCylinder,
    CollisionHull,
    CollisionSphere,
    Shape,
)
from wbc.robots.mechanism import Geometry, Mechanism
from wbc.robots.mesh_files import read_mesh, resolve

CORNERS = 150
"""Directions of which the outermost vertices are the corners of a mesh's hull: it is as good as whole, and quick."""

SMALLEST = 0.002
"""Least half size of a shape, m."""


@lru_cache(maxsize=4)  # it keeps the shapes of whole robots
def link_shapes(robot: Mechanism, package_dirs: tuple[str, ...]) -> tuple[Geometry, ...]:
    """Return the shapes of all links of a robot: collision shapes where a link has any, visual ones otherwise.

    A mesh becomes the least box about its principal axes. What cannot be read is left out. No size is below `SMALLEST`.
    """
    found: dict[str, list[Geometry]] = {shape.link: [] for shape in robot.shapes}
    for role in ("collision", "visual"):
        for shape in [each for each in robot.shapes if each.role == role and not found[each.link]]:
            if (made := _simple(shape, package_dirs)) is not None:
                found[shape.link].append(made)
    return tuple(shape for shapes in found.values() for shape in shapes)


def hulls(robot: Mechanism, package_dirs: tuple[str, ...]) -> dict[str, list[Shape]]:
    """Return link → shapes, as `link_shapes` does, where a mesh is its convex hull; a flat one is a thin box."""
    found: dict[str, list[Shape]] = {}
    for shape in link_shapes(robot, package_dirs):
        found.setdefault(shape.link, []).append(_hull(shape))
    return found


def capsules(
    robot: Mechanism, package_dirs: tuple[str, ...]
) -> dict[str, list[CollisionSphere | CollisionCapsule]]:
    """Return link → spheres and capsules: a box is a capsule along its longest side, as thick as the second one."""
    found: dict[str, list[CollisionSphere | CollisionCapsule]] = {}
    for shape in link_shapes(robot, package_dirs):
        size, place = shape.size.tolist(), shape.place
        if shape.kind == "box":
            _, radius, half = sorted(size)
            axis, half = np.eye(3)[int(np.argmax(size))], half - radius
        else:
            radius, half, axis = size[0], size[-1] if len(size) > 1 else 0.0, np.array([0.0, 0.0, 1.0])
        if half < SMALLEST:
            made: CollisionSphere | CollisionCapsule = CollisionSphere(radius, place.translation)
        else:
            made = CollisionCapsule(radius, place.act(-half * axis), place.act(half * axis))
        found.setdefault(shape.link, []).append(made)
    return found


def _simple(shape: Geometry, package_dirs: tuple[str, ...]) -> Geometry | None:
    if shape.kind != "mesh":
        return shape._replace(size=np.maximum(shape.size, SMALLEST))
    path = resolve(shape.file, package_dirs)
    if path is None or (mesh := read_mesh(path)) is None:
        return None
    points = mesh[0] * shape.size
    centre = points.mean(axis=0)
    axes = np.linalg.svd(points - centre, full_matrices=False)[2].T
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    local = (points - centre) @ axes
    low, high = local.min(axis=0), local.max(axis=0)
    middle = pin.SE3(axes, centre + axes @ (0.5 * (low + high)))
    spread = np.arange(CORNERS) + 0.5  # directions that are spread evenly, on a Fibonacci lattice
    height, turn = 1.0 - 2.0 * spread / CORNERS, np.pi * (1.0 + np.sqrt(5.0)) * spread
    wide = np.sqrt(1.0 - height**2)
    directions = np.stack([wide * np.cos(turn), wide * np.sin(turn), height], axis=1)
    corners = points[np.unique(np.argmax(points @ directions.T, axis=0))]
    flat = np.linalg.matrix_rank(corners - corners.mean(axis=0), tol=1e-4) < 3
    at = None if flat else corners @ shape.place.rotation.T + shape.place.translation
    size = np.maximum(0.5 * (high - low), SMALLEST)
    return shape._replace(kind="box", size=size, place=shape.place * middle, corners=at)


def _hull(shape: Geometry) -> Shape:
    if shape.corners is not None:
        return CollisionHull(shape.corners.tolist())
    size, place = shape.size.tolist(), shape.place
    if shape.kind == "box":
        x, y, z = (2.0 * half for half in size)
        return CollisionBox((x, y, z), place.translation, pin.log3(place.rotation))
    if shape.kind == "sphere":
        return CollisionSphere(size[0], place.translation)
    end = np.array([0.0, 0.0, size[1]])
    kind = CollisionCapsule if shape.kind == "capsule" else CollisionCylinder
    return kind(size[0], place.act(-end), place.act(end))
