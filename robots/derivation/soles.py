"""Sole rectangles from the geometry of the feet."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.robots.mechanism import Geometry
from wbc.robots.mesh_files import read_mesh, resolve

SLICE = 5e-3
"""Thickness of the slice of the foot above its lowest point that counts as touching the ground, m: no share of its
size, as it is for the roundness of edges and for meshes that are not flat."""

PLAUSIBLE = (0.03, 0.6)
"""Range of the sides of a sole, m; geometry outside it is not that of a foot."""

LEAST_SHARE, LEAST_SIDE = 0.05, 0.005
"""Least side of a small robot's sole over the distance from its root, and in m: smaller geometry is in another unit."""

Y_UP = pin.rpy.rpyToMatrix(0.5 * np.pi, 0.0, 0.0)
"""Rotation of a mesh whose y axis points up."""


def sole_rectangle(
    shapes: Sequence[Geometry],
    model: pin.Model,
    sole: pin.Frame,
    package_dirs: tuple[str, ...],
) -> tuple[Array, float, float] | None:
    """Return the rectangle around the geometry of a foot within 5 mm of its lowest point.

    The sole need not be a frame of the model; its z axis points away from the ground. Collision geometry is used where
    there is any, visual geometry otherwise. A foot that is wider than long is read once more with the up axis that its
    COLLADA meshes name, which Gazebo honours and Pinocchio does not. Returned are the centre in the frame (m, shape
    (3,)), length and width (m), those of a sole if any geometry has them; None without geometry.
    """
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    below = set(model.subtrees[sole.parentJoint])  # toes, too
    links = {str(f.name): i for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}
    here = data.oMi[sole.parentJoint] * sole.placement
    wide = other = None
    for role, up_axis in itertools.product(("collision", "visual"), (False, True)):
        clouds = []
        for shape in (each for each in shapes if each.role == role):
            if model.frames[link := links[shape.link]].parentJoint in below:
                cloud = _cloud(shape, package_dirs, here.actInv(data.oMf[link]), up_axis)
                clouds += [] if cloud is None else [cloud]
        if not clouds:
            continue
        centre, length, width = footprint(np.concatenate(clouds))
        if not plausible(length, width, float(np.linalg.norm(here.translation))):
            other = other or (centre, length, width)
        elif width <= length:
            return centre, length, width
        else:
            wide = wide or (centre, length, width)
    return wide or other


def footprint(points: Array) -> tuple[Array, float, float]:
    """Return the rectangle around the points that touch the ground: centre, shape (3,), length and width, m.

    The points have the axes of the sole, shape (n, 3).
    """
    lowest = points[:, 2].min()
    touching = points[points[:, 2] < lowest + SLICE]
    low, high = touching.min(axis=0), touching.max(axis=0)
    length, width = (high - low)[:2].tolist()
    return np.array([*(0.5 * (low + high))[:2], lowest]), length, width


def plausible(length: float, width: float, leg: float = np.inf) -> bool:
    """Return True for the sides of a sole, m, at a distance from the root of the robot, m."""
    least = max(LEAST_SIDE, min(PLAUSIBLE[0], LEAST_SHARE * leg))
    return all(least <= side <= PLAUSIBLE[1] for side in (length, width))


def no_sole(length: float, width: float) -> str:
    """Return what is said of geometry that is no sole, m."""
    return f"the geometry touches the ground over {length:.4g} x {width:.4g} m, which is no sole: is it in metres?"


def points_of(kind: str, size: Array, up: Array) -> Array | None:
    """Return points of a shape in its own axes, shape (n, 3), m, with those on which it stands; None for another kind.

    Args:
        kind: "box", "sphere", "cylinder", "capsule" or "ellipsoid".
        size: Half sizes; radius; radius and half length, m.
        up: Direction away from the ground in the axes of the shape, of unit length.
    """
    if kind == "box":
        return np.array([*itertools.product(*zip(-size, size, strict=True))])
    if kind == "sphere":
        return np.asarray(-size[0] * up[None, :])
    if kind == "capsule":
        return np.asarray(np.outer([-size[1], size[1]], [0.0, 0.0, 1.0]) - size[0] * up)
    if kind == "ellipsoid":
        return np.array([-(size**2) * up / np.linalg.norm(size * up)])
    if kind == "cylinder":
        angle = np.linspace(0.0, math.tau, 32, endpoint=False)
        rim = np.stack([size[0] * np.cos(angle), size[0] * np.sin(angle), np.full(32, size[1])], axis=1)
        return np.concatenate([rim, rim * [1.0, 1.0, -1.0]])
    return None


def _cloud(shape: Geometry, package_dirs: tuple[str, ...], here: pin.SE3, up_axis: bool) -> Array | None:
    """Return points of a shape, with those on which it stands; `here` is the place of its link."""
    place = here * shape.place
    points = points_of(shape.kind, shape.size, place.rotation[2])
    if shape.kind == "mesh" and (path := resolve(shape.file, package_dirs)) is not None:
        mesh = read_mesh(path)
        points = None if mesh is None else mesh[0]
        if points is not None and up_axis and path.suffix.lower() == ".dae":
            points = points @ Y_UP.T if b"<up_axis>Y_UP" in path.read_bytes() else points
        points = None if points is None else points * shape.size
    return None if points is None else np.asarray(points @ place.rotation.T + place.translation)
