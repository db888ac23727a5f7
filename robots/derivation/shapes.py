"""Simple shapes of a robot's links, from those of its source."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Literal, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.limits.shapes import (
    CollisionBox,
    CollisionCapsule,
    CollisionCylinder,
    CollisionHull,
    CollisionSphere,
    Shape,
)
from wbc.robots.derivation.soles import mesh_vertices, resolve
from wbc.robots.source import Geometry
from wbc.robots.source_of import source_of

T = TypeVar("T")

CORNERS = 150
"""Directions of which the outermost vertices are the corners of a mesh's hull: it is as good as whole, and quick."""

SMALLEST = 0.002
"""Least half size of a shape, m."""


class LinkShape(NamedTuple):
    """A shape of a link."""

    link: str
    kind: Literal["box", "sphere", "cylinder", "capsule"]  # a mesh is the box around it
    size: tuple[float, ...]  # half sizes of a box; radius; radius and half length, m
    placement: pin.SE3  # in the link


def link_shapes(text: str, package_dirs: tuple[str, ...]) -> tuple[LinkShape, ...]:
    """Return the shapes of all links of a robot's XML: collision shapes where a link has any, visual ones otherwise.

    A mesh becomes the least box about its principal axes. What cannot be read is left out.
    """
    return _link_shapes(text, package_dirs, _meshes(text, package_dirs))


@lru_cache(maxsize=16)
def _link_shapes(text: str, package_dirs: tuple[str, ...], _: object) -> tuple[LinkShape, ...]:
    """Return the shapes of all links, anew when a mesh has changed."""

    def made(shape: Geometry) -> LinkShape | None:
        if shape.kind != "mesh":
            return LinkShape(shape.link, shape.kind, _sizes(shape.size), shape.place)  # type: ignore[arg-type]
        path = resolve(shape.file, package_dirs)
        return None if path is None else _box(shape.link, path, shape.size, shape.place)

    return tuple(shape for _, shapes in touching(text, made) for shape in shapes)


def touching(text: str, make: Callable[[Geometry], T | None]) -> list[tuple[str, list[T]]]:
    """Return link and what is made of its collision shapes, or of its visual shapes where that is nothing."""
    shapes, found = source_of(text).shapes(), []
    for link in dict.fromkeys(shape.link for shape in shapes):
        for role in ("collision", "visual"):
            made = [make(shape) for shape in shapes if shape.link == link and shape.role == role]
            if known := [each for each in made if each is not None]:
                found.append((link, known))
                break
    return found


def capsules(text: str, package_dirs: tuple[str, ...]) -> dict[str, list[CollisionSphere | CollisionCapsule]]:
    """Return link → spheres and capsules: a box is a capsule along its longest side, as thick as the second one."""
    found: dict[str, list[CollisionSphere | CollisionCapsule]] = {}
    for shape in link_shapes(text, package_dirs):
        place, size = shape.placement, shape.size
        if shape.kind == "box":
            _, radius, half = sorted(size)
            axis = np.eye(3)[int(np.argmax(size))]
            half = half - radius
        else:
            radius, half, axis = size[0], size[-1] if len(size) > 1 else 0.0, np.array([0.0, 0.0, 1.0])
        if half < SMALLEST:
            made: CollisionSphere | CollisionCapsule = CollisionSphere(radius, place.translation)
        else:
            made = CollisionCapsule(radius, place.act(-half * axis), place.act(half * axis))
        found.setdefault(shape.link, []).append(made)
    return found


def hulls(text: str, package_dirs: tuple[str, ...]) -> dict[str, list[Shape]]:
    """Return link → shapes, as `link_shapes` does, where a mesh is its convex hull."""
    found = _hulls(text, package_dirs, _meshes(text, package_dirs))
    return {link: list(shapes) for link, shapes in found.items()}


@lru_cache(maxsize=16)
def _mesh_names(text: str) -> tuple[str, ...]:
    return tuple({shape.file for shape in source_of(text).shapes() if shape.kind == "mesh"})


def _meshes(text: str, package_dirs: tuple[str, ...]) -> tuple[tuple[Path, int, int], ...]:
    """Return path, time of the last change and size of the meshes of a robot."""
    paths = [path for name in _mesh_names(text) if (path := resolve(name, package_dirs)) is not None]
    return tuple((path, state.st_mtime_ns, state.st_size) for path in paths for state in [path.stat()])


@lru_cache(maxsize=4)
def _hulls(text: str, package_dirs: tuple[str, ...], _: object) -> dict[str, list[Shape]]:
    """Return the hulls of all links, anew when a mesh has changed."""
    return dict(touching(text, lambda shape: _hull(shape, package_dirs)))


def _hull(found: Geometry, package_dirs: tuple[str, ...]) -> Shape | None:
    place = found.place
    if found.kind == "mesh":
        path = resolve(found.file, package_dirs)
        vertices = None if path is None else mesh_vertices(path)
        if vertices is None or len(vertices) < 4:
            return None
        points = vertices * found.size
        points = points[np.unique(np.argmax(points @ _directions().T, axis=0))]
        if np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-4) < 3:  # a flat one
            return None
        return CollisionHull(points @ place.rotation.T + place.translation)
    size = _sizes(found.size)
    if found.kind == "box":
        return CollisionBox(
            (2.0 * size[0], 2.0 * size[1], 2.0 * size[2]), place.translation, pin.log3(place.rotation)
        )
    if found.kind == "sphere":
        return CollisionSphere(size[0], place.translation)
    end = np.array([0.0, 0.0, size[1]])
    kind = CollisionCapsule if found.kind == "capsule" else CollisionCylinder
    return kind(size[0], place.act(-end), place.act(end))


@lru_cache(maxsize=1)
def _directions() -> Array:
    """Return directions that are spread evenly, shape (CORNERS, 3), on a Fibonacci lattice."""
    place = np.arange(CORNERS) + 0.5
    height, turn = 1.0 - 2.0 * place / CORNERS, np.pi * (1.0 + np.sqrt(5.0)) * place
    wide = np.sqrt(1.0 - height**2)
    return np.stack([wide * np.cos(turn), wide * np.sin(turn), height], axis=1)


def _box(link: str, path: Path, scale: Array, place: pin.SE3) -> LinkShape | None:
    vertices = mesh_vertices(path)
    if vertices is None or not len(vertices):
        return None
    points = vertices * scale
    centre = points.mean(axis=0)
    axes = np.linalg.svd(points - centre, full_matrices=False)[2].T
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    local = (points - centre) @ axes
    low, high = local.min(axis=0), local.max(axis=0)
    middle = pin.SE3(axes, centre + axes @ (0.5 * (low + high)))
    return LinkShape(link, "box", _sizes(0.5 * (high - low)), place * middle)


def _sizes(values: Array) -> tuple[float, ...]:
    return tuple(np.maximum(values, SMALLEST).tolist())
