"""Sole rectangles from the geometry of the feet."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote

import coal
import numpy as np
import pinocchio as pin

from wbc.base.errors import shown
from wbc.base.numbers import Array
from wbc.robots.source import Geometry

SLICE = 5e-3
"""Thickness of the slice of the foot above its lowest point that counts as touching the ground, m: no share of its
size, as it is for the roundness of edges and for meshes that are not flat."""

PLAUSIBLE = (0.03, 0.6)
"""Range of the sides of a sole, m; geometry outside it is not that of a foot."""

LEAST_SHARE, LEAST_SIDE = 0.05, 0.005
"""Least side of a small robot's sole over the distance from its root, and in m: smaller geometry is in another unit."""

UNITS = {"in millimetres": 1e-3, "in centimetres": 1e-2, "with one scale of 0.001 less": 1e3}
"""Mistakes of unit → what mends them."""

PACKAGE_DEPTH = 5
"""Most folders above that of a URDF in which its packages are looked for."""

LARGEST_MESH = 100_000_000
"""Bytes of a mesh that are looked at for defects."""

Y_UP = pin.rpy.rpyToMatrix(0.5 * np.pi, 0.0, 0.0)
"""Rotation of a mesh whose y axis points up."""


def sole_rectangle(
    shapes: Sequence[Geometry],
    model: pin.Model,
    frame: str,
    package_dirs: tuple[str, ...],
    scale: float = 1.0,
) -> tuple[Array, float, float] | None:
    """Return the rectangle around the geometry of a foot within 5 mm of its lowest point.

    Collision geometry is used where there is any, visual geometry otherwise; z of the frame points away from the
    ground. A foot that is wider than long is read once more with the up axis that its COLLADA meshes name, which Gazebo
    honours and Pinocchio does not. Returned are the centre in the frame (m, shape (3,)), length and width (m), those of
    a sole if any geometry has them; None without geometry. `scale` multiplies the sizes of shapes.
    """
    sole = model.frames[model.getFrameId(frame)]
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    below = set(model.subtrees[sole.parentJoint])  # toes, too
    links = {str(f.name): i for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}
    here = data.oMf[model.getFrameId(frame)]
    wide = other = None
    for role, up_axis in itertools.product(("collision", "visual"), (False, True)):
        clouds = []
        for shape in (each for each in shapes if each.role == role):
            if model.frames[link := links[shape.link]].parentJoint in below:
                cloud = _cloud(shape, package_dirs, here.actInv(data.oMf[link]), up_axis, scale)
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
    """Return what is said of geometry that is no sole, m, with the mistake of unit that would make it one."""
    said = f"the geometry touches the ground over {length:.4g} x {width:.4g} m, which is no sole"
    for what, factor in UNITS.items():
        if plausible(factor * length, factor * width):
            said += f"; {what} it would be {1e3 * factor * length:.4g} x {1e3 * factor * width:.4g} mm"
            break
    return said


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


def _cloud(
    shape: Geometry, package_dirs: tuple[str, ...], here: pin.SE3, up_axis: bool, scale: float
) -> Array | None:
    """Return points of a shape of scaled size, with those on which it stands; `here` is the place of its link."""
    place = here * shape.place
    points = points_of(shape.kind, shape.size, place.rotation[2])
    if shape.kind == "mesh" and (path := resolve(shape.file, package_dirs)) is not None:
        points = mesh_vertices(path)
        if points is not None and up_axis and path.suffix.lower() == ".dae":
            points = points @ Y_UP.T if b"<up_axis>Y_UP" in path.read_bytes() else points
        points = None if points is None else points * shape.size
    return None if points is None else np.asarray(scale * points @ place.rotation.T + place.translation)


def mesh_vertices(path: Path) -> Array | None:
    """Return the vertices of a mesh, or None when it cannot be read: geometry is optional."""
    if mesh_defect(path):
        return None
    try:
        vertices = np.array(coal.MeshLoader().load(str(path)).vertices())
    except (ValueError, RuntimeError):
        return None
    return vertices * collada_unit(path) if np.isfinite(vertices).all() else None


def collada_unit(path: Path) -> float:
    """Return the unit of length of a COLLADA mesh, m, as the field's viewers read it; one for all other files."""
    if path.suffix.lower() != ".dae":
        return 1.0
    text = re.sub(rb"<!--.*?-->", b"", path.read_bytes(), flags=re.DOTALL)
    found = re.search(rb"<(?:\w+:)?unit\b[^>]*?\smeter\s*=\s*[\"']\s*([^\"'\s]+)", text)
    try:
        unit = float(found[1]) if found else 1.0
    except ValueError:
        return 1.0
    return unit if 0.0 < unit < math.inf else 1.0


def mesh_defect(path: Path) -> str:
    """Return why the file of a mesh holds no whole mesh, by its size, begin and end; "" where nothing is wrong."""
    state = path.stat()
    return _defect(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=4096)
def _defect(path: Path, _time: int, _size: int) -> str:
    with path.open("rb") as file:
        content = file.read(LARGEST_MESH)
    begin, end, kind = content[:512].lstrip().lower(), content[-512:].lower(), path.suffix.lower()
    if not begin:
        return "is empty"
    if begin.startswith(b"version https://git-lfs"):
        return "is a pointer of Git LFS: run `git lfs pull` in its repository"
    if begin.startswith((b"<!doctype html", b"<html")):
        return "is a page of the web"
    whole = True
    if kind == ".stl":
        count = int.from_bytes(content[80:84], "little")
        whole = 84 + 50 * count <= len(content) and len(content) > 84
        if whole:
            numbers = np.frombuffer(content, np.dtype([("corners", "<f4", 12), ("more", "<u2")]), count, 84)
            if not np.isfinite(numbers["corners"][:, 3:]).all():
                return "has corners that are no numbers"
        whole |= begin.startswith(b"solid") and b"endsolid" in end
    elif kind == ".dae":
        whole = b"collada>" in end
    elif kind == ".obj":
        whole = re.search(rb"[\r\n]\s*f\s", content) is not None
    return "" if whole or len(content) == LARGEST_MESH else "is cut off, or of another format"


def resolve(filename: str, folders: tuple[str, ...]) -> Path | None:
    """Return the file of a mesh; None where there is none.

    The name is that of a package (`package://`, `model://`), absolute, or relative to a folder, as a URL (`file://`) or
    as a path, with slashes of any kind; `folders` are searched in their order.
    """
    places = [*map(Path, folders)]
    scheme, found, rest = filename.partition("://")
    if not found:
        scheme, rest = ("file", filename[5:]) if filename.startswith("file:") else ("", filename)
    rest = rest.removeprefix("localhost") if scheme == "file" else rest
    for name in dict.fromkeys((rest, unquote(rest), unquote(rest).replace("\\", "/"))):
        candidates = [
            *(folder / name for folder in places),
            Path(name),
        ]  # an absolute name is its own in each
        if scheme in ("package", "model"):
            tail = name.split("/", 1)[-1]
            candidates = [folder / part for folder in places for part in (name, tail)]
        for path in candidates:
            if path.is_file():
                return path
    return None


def mesh_folders(
    names: Iterable[str], given: tuple[str, ...], base: Path | None
) -> tuple[tuple[str, ...], list[str]]:
    """Return the folders in which meshes of these names are, and notes on those that are nowhere or broken.

    The folders are those given, that of the file for relative names, and those above it in which a package is: as ROS
    has it, the file lies in a folder of its package.
    """
    folders = list(given)
    if base is not None:
        folders.append(str(base))
    names = list(dict.fromkeys(names))
    missing = [name for name in names if resolve(name, tuple(folders)) is None]
    for above in [] if base is None else list(base.parents)[:PACKAGE_DEPTH]:
        if found := [name for name in missing if resolve(name, (str(above),)) is not None]:
            folders.append(str(above))
            missing = [name for name in missing if name not in found]
    notes = [
        f"mesh {shown(name)} {defect}: its link has no shape of it"
        for name in names
        if (path := resolve(name, tuple(folders))) is not None and (defect := mesh_defect(path))
    ]
    if missing:
        notes.append(
            f"{len(missing)} of {len(names)} meshes are not found, first {shown(missing[0])}: their links have no "
            "shape of them; package_dirs are the folders of packages"
        )
    return tuple(folders), notes
