"""Soles of a robot: where they lie in their links, and their rectangles.

Placement        of a frame of the URDF: at the centre of the rectangle, with the axes of the base at the zero
                 configuration; a new frame if the given one lies elsewhere
Rectangle        from the collision (else visual) geometry of the foot, within 5 mm of its lowest point; without
                 geometry 0.287 × 0.104 of the hip height (foot length and breadth 0.152 and 0.055 of stature, hip
                 0.530 of it: D. A. Winter, Biomechanics and Motor Control of Human Movement, 4th ed. 2009, fig. 4.1)
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError
from wbc.base.numbers import Array
from wbc.core.frames import FrameDescription, Sole
from wbc.core.model import joints_to
from wbc.robots import frames
from wbc.robots.frames import SoleName
from wbc.robots.mechanism import Geometry, along
from wbc.robots.mesh_files import read_mesh, resolve

Soles: TypeAlias = tuple[Sole, ...]
"""Left and right sole; none of a robot without feet."""

SoleFinder = Callable[[pin.Model, float, list[str]], Soles]
"""Function that returns the soles of a robot's model, of the turn of its root so far, rad, and of a list for notes."""

SOLE_RATIO = (0.152 / 0.530, 0.055 / 0.530)
"""Length and width of a sole over the height of the hip above it (Winter 2009, fig. 4.1)."""

LOWEST_HIP = 0.1
"""Least height of a hip over the sole from which a rectangle is derived, m."""

LOWEST_ANKLE = 2e-3
"""Height of the ankle over the sole below which the sole is taken for one that nobody placed, m: an error of rounding,
far below the ankle of any robot."""

ALIGNED = np.cos(np.radians(1.0))
"""Cosine of the tilt up to which a frame counts as aligned with the base."""

SAME_PLACE = 1e-3
"""Distance of the centre of a sole from a given frame up to which the sole is at that frame, m."""

SLICE = 5e-3
"""Thickness of the slice of the foot above its lowest point that counts as touching the ground, m: no share of its
size, as it is for the roundness of edges and for meshes that are not flat."""

PLAUSIBLE = (0.03, 0.6)
"""Range of the sides of a sole, m; geometry outside it is not that of a foot."""

LEAST_SHARE, LEAST_SIDE = 0.05, 0.005
"""Least side of a small robot's sole over the distance from its root, and in m: smaller geometry is in another unit."""

Y_UP = pin.rpy.rpyToMatrix(0.5 * np.pi, 0.0, 0.0)
"""Rotation of a mesh whose y axis points up."""


class Rectangle(NamedTuple):
    """Rectangle of a sole: its centre in some frame, m, shape (3,), length and width, m."""

    centre: Array
    length: float
    width: float


def find_soles(
    shapes: Sequence[Geometry],
    size: tuple[float, float] | None,
    package_dirs: tuple[str, ...],
    given: tuple[str | FrameDescription, str | FrameDescription],
    model: pin.Model,
    _: float,
    notes: list[str],
) -> Soles:
    """Return given soles, left and right, with their frames and rectangles; `notes` gets a line for each rule.

    What is given is a frame of the URDF, a placement in a link, or the whole description. `size` is length and width,
    m; that of the shapes when None. `package_dirs` are the folders with the meshes.
    """
    pairs = zip(frames.SOLE_NAMES, given, strict=True)
    return tuple(_sole(shapes, size, package_dirs, model, name, each, notes) for name, each in pairs)


def _sole(
    shapes: Sequence[Geometry],
    given_size: tuple[float, float] | None,
    package_dirs: tuple[str, ...],
    model: pin.Model,
    name: SoleName,
    given: str | FrameDescription,
    notes: list[str],
) -> Sole:
    if isinstance(given, Sole):
        if given.name != name:
            raise InputError(f"the sole given for '{name}' is called '{given.name}'")
        frames.body_frame(model, given.link)
        return given
    # The rectangle is looked for in a frame with the axes of the base: x forward, z away from the ground.
    if isinstance(given, str):
        frame, (link, place) = given, frames.carrier(model, given)
    else:
        frames.body_frame(model, given.link)
        frame, link, place = given.frame, given.link, given.placement
        frame = f"{name}_sole" if model.existFrame(frame) else frame
    data, body = model.createData(), frames.body_frame(model, link)
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    in_base = data.oMi[body.parentJoint] * body.placement * place
    turned = isinstance(given, str) and not (np.diag(in_base.rotation) > ALIGNED).all()
    if turned:
        place = place * pin.SE3(in_base.rotation.T, np.zeros(3))
        notes.append(f"{name}: axes of '{given}' are not those of the base; the sole takes those of the base")
    there = pin.Frame(frame, body.parentJoint, 0, body.placement * place, pin.FrameType.OP_FRAME)
    found = sole_rectangle(shapes, model, there, package_dirs)
    odd = ""
    if found is not None and not plausible(*found[1:], float(np.linalg.norm(in_base.translation))):
        odd = no_sole(*found[1:])
    rectangle = None if odd else found
    if odd:
        notes.append(f"{name}: {odd}")
    hip = data.oMi[model.supports[body.parentJoint][2]].translation[2] if body.parentJoint > 1 else 0.0
    size = given_size or _sides(name, rectangle, float(hip - in_base.translation[2]), notes)
    centre = np.zeros(3) if rectangle is None else rectangle.centre
    if isinstance(given, str) and (turned or np.linalg.norm(centre) >= SAME_PLACE):
        frame, place = f"{name}_sole", place * along(centre)
        x, y, z = np.round(centre * 1e3) + 0.0
        notes.append(f"{name}: sole frame '{frame}' at ({x:.0f}, {y:.0f}, {z:.0f}) mm from '{given}'")
    sole = sole_at(frames.frame_at(frame, link, place), name, size)
    refuse_at_ankle(model, sole, odd)
    return sole


def sole_at(place: FrameDescription, name: SoleName, size: tuple[float, float]) -> Sole:
    """Return the sole of a length and a width, m, at a place."""
    return Sole(
        place.frame, place.link, place.translation, place.rpy, name=name, length=size[0], width=size[1]
    )


def _sides(name: SoleName, rectangle: Rectangle | None, hip: float, notes: list[str]) -> tuple[float, float]:
    """Return length and width of a sole, m, from the geometry of the foot or the height of the hip over it, m."""
    if rectangle is not None:
        _, length, width = rectangle
        origin = "the geometry of the foot"
    else:
        hip = max(LOWEST_HIP, hip)
        length, width = (ratio * hip for ratio in SOLE_RATIO)
        origin = f"the hip height {hip:.3f} m (no usable geometry on the foot)"
    notes.append(f"{name}: {length * 1e3:.0f} x {width * 1e3:.0f} mm, from {origin}")
    return length, width


def refuse_at_ankle(model: pin.Model, sole: Sole, why: str = "") -> None:
    """Refuse a sole at the last joint of its leg, where nobody placed it; `why` is known of its geometry."""
    place = frames.body_frame(model, sole.link).placement * sole.placement
    ankle = abs(float(place.inverse().translation[2]))
    if ankle < LOWEST_ANKLE:
        why = why or f"link '{sole.link}' has no geometry that says where the ground is"
        raise ModelError(
            f"{sole.name}: the sole would lie at the ankle, {1e3 * ankle:.1f} mm from the last joint of the leg; "
            f"{why}: give a frame at the sole, a Sole, or package_dirs where its meshes are"
        )


def check_sides(model: pin.Model, soles: Soles) -> None:
    """Refuse soles that are not at the end of a leg of their own, left of the other one and below the robot."""
    legs = [set(joints_to(model, sole.frame)) for sole in soles]
    for sole, leg in zip(soles, legs, strict=True):
        if not leg:
            raise ModelError(f"sole '{sole.frame}' is fixed to the root: a leg needs joints")
    if soles[0].frame == soles[1].frame or max(legs[0]) in legs[1] or max(legs[1]) in legs[0]:
        raise ModelError(f"soles '{soles[0].frame}' and '{soles[1].frame}' are on the same leg")
    data = model.createData()
    com = pin.centerOfMass(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    left, right = (data.oMf[model.getFrameId(sole.frame)].translation for sole in soles)
    if left[1] <= right[1]:
        raise ModelError(
            f"left sole '{soles[0].frame}' lies to the right of '{soles[1].frame}' (y {left[1]:.3f} and "
            f"{right[1]:.3f} m in the root frame): swapped soles, or a root whose x axis does not point forward"
        )
    if com[2] <= max(left[2], right[2]):
        raise ModelError("the soles are above the centre of mass: the z axis of the root must point up")


def sole_rectangle(
    shapes: Sequence[Geometry],
    model: pin.Model,
    sole: pin.Frame,
    package_dirs: tuple[str, ...],
) -> Rectangle | None:
    """Return the rectangle around the geometry of a foot within 5 mm of its lowest point.

    The sole need not be a frame of the model; its z axis points away from the ground. Collision geometry is used where
    there is any, visual geometry otherwise. A foot that is wider than long is read once more with the up axis that its
    COLLADA meshes name, which Gazebo honours and Pinocchio does not. The rectangle is that of a sole if any geometry
    has one; its centre is in the frame. Returned is None without geometry.
    """
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    below = set(model.subtrees[sole.parentJoint])  # toes, too
    links = {str(f.name): i for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}
    here = data.oMi[sole.parentJoint] * sole.placement
    best: tuple[int, Rectangle] | None = None
    for role, up_axis in itertools.product(("collision", "visual"), (False, True)):
        clouds = []
        for shape in (each for each in shapes if each.role == role):
            if model.frames[link := links[shape.link]].parentJoint in below:
                cloud = _cloud(shape, package_dirs, here.actInv(data.oMf[link]), up_axis)
                clouds += [] if cloud is None else [cloud]
        if not clouds:
            continue
        found = footprint(np.concatenate(clouds))
        of_sole = plausible(found.length, found.width, float(np.linalg.norm(here.translation)))
        rank = (
            int(found.width > found.length) if of_sole else 2
        )  # 1 for one that is wider than long, 2 for none
        if best is None or rank < best[0]:
            best = rank, found
        if rank == 0:
            break
    return best and best[1]


def footprint(points: Array) -> Rectangle:
    """Return the rectangle around points that touch the ground; all, shape (n, 3), m, have the axes of the sole."""
    lowest = points[:, 2].min()
    touching = points[points[:, 2] < lowest + SLICE]
    low, high = touching.min(axis=0), touching.max(axis=0)
    length, width = (high - low)[:2].tolist()
    return Rectangle(np.array([*(0.5 * (low + high))[:2], lowest]), length, width)


def plausible(length: float, width: float, leg: float = np.inf) -> bool:
    """Return True for the sides of a sole, m, at a distance from the root of the robot, m."""
    least = max(LEAST_SIDE, min(PLAUSIBLE[0], LEAST_SHARE * leg))
    return all(least <= side <= PLAUSIBLE[1] for side in (length, width))


def no_sole(length: float, width: float) -> str:
    """Return the message on geometry that is no sole, by its sides, m."""
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
