"""Simple shapes of a robot's links, from the geometry in its URDF."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Literal, NamedTuple

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
from wbc.robots import urdf
from wbc.robots.derivation.soles import geometry_of, mesh_vertices, resolve

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
    """Return the shapes of all links of a URDF: collision geometry where a link has any, visual geometry otherwise.

    A mesh becomes the least box about its principal axes. What cannot be read is left out.
    """
    return _link_shapes(text, package_dirs, _meshes(text, package_dirs))


@lru_cache(maxsize=16)
def _link_shapes(text: str, package_dirs: tuple[str, ...], _: object) -> tuple[LinkShape, ...]:
    """Return the shapes of all links, anew when a mesh has changed."""
    shapes: list[LinkShape] = []
    for link in urdf.read(text).findall("link"):
        for tag in ("collision", "visual"):
            found = [_shape(str(link.get("name")), each, package_dirs) for each in link.findall(tag)]
            known = [shape for shape in found if shape is not None]
            if known:
                shapes += known
                break
    return tuple(shapes)


def _shape(link: str, element: urdf.Element, package_dirs: tuple[str, ...]) -> LinkShape | None:
    found = geometry_of(element)
    if found is None:
        return None
    if found.kind == "mesh":
        path = resolve(found.file, package_dirs)
        return None if path is None else _box(link, path, found.size, found.place)
    return LinkShape(link, found.kind, _sizes(found.size), found.place)  # type: ignore[arg-type]  # no mesh


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
    return tuple({str(mesh.get("filename", "")) for mesh in urdf.read(text).iter("mesh")})


def _meshes(text: str, package_dirs: tuple[str, ...]) -> tuple[tuple[Path, int, int], ...]:
    """Return path, time of the last change and size of the meshes of a URDF."""
    paths = [path for name in _mesh_names(text) if (path := resolve(name, package_dirs)) is not None]
    return tuple((path, state.st_mtime_ns, state.st_size) for path in paths for state in [path.stat()])


@lru_cache(maxsize=4)
def _hulls(text: str, package_dirs: tuple[str, ...], _: object) -> dict[str, list[Shape]]:
    """Return the hulls of all links, anew when a mesh has changed."""
    found: dict[str, list[Shape]] = {}
    for link in urdf.read(text).findall("link"):
        for tag in ("collision", "visual"):
            made = [_hull(each, package_dirs) for each in link.findall(tag)]
            known = [shape for shape in made if shape is not None]
            if known:
                found[str(link.get("name"))] = known
                break
    return found


def _hull(element: urdf.Element, package_dirs: tuple[str, ...]) -> Shape | None:
    found = geometry_of(element)
    if found is None:
        return None
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
