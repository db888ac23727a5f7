"""What a replay of a walk shows beside the robot: footsteps, planned and real, the support region and the DCM."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull

from wbc.app.log import Log
from wbc.app.log.stances import Stance, stances
from wbc.app.view.scene import HIDDEN, LEGEND, ROOT, Scene, SceneObject
from wbc.app.view.shapes import Colour, Surface, VisualCylinder
from wbc.core.errors import Array

DCM_COLOUR: Colour = (0.34, 0.71, 0.91, 1.0)
SIDE_COLOURS: dict[str, Colour] = {"left": (0.0, 0.45, 0.70, 1.0), "right": (0.84, 0.37, 0.0, 1.0)}
SUPPORT_COLOUR: Colour = (0.0, 0.62, 0.45, 0.35)

SCAN_COLOUR: Colour = (0.95, 0.90, 0.25, 1.0)

LIFT = 0.004
"""How far these lie over the ground of the sole, m."""

LINE = 0.006
"""Width of the outline of a footstep, m."""


@dataclass(frozen=True, eq=False)
class Overlays:
    """Objects beside those of the scene, and which of them are there at a tick.

    Attributes:
        drawings: Objects.
        moving: Paths that a frame moves, behind those of the scene.
        legend: What their colours mean.
    """

    drawings: tuple[SceneObject, ...]
    moving: tuple[str, ...]
    legend: tuple[tuple[str, Colour], ...]
    _spans: tuple[tuple[int, int], ...]
    _dcm: Array | None

    def added_to(self, scene: Scene) -> Scene:
        """Return a scene that has these, too; its own frames do not move them."""
        return replace(scene, drawings=(*scene.drawings, *self.drawings))

    def dcm(self, tick: int) -> Array | None:
        """Where the DCM is, on the ground, shape (3,), m; None if that is not known."""
        if self._dcm is None or not np.isfinite(self._dcm[tick]).all():
            return None
        point: Array = self._dcm[tick]
        return point

    def frame(self, tick: int) -> Array:
        """Return one matrix for each moving path, shape (len(moving), 4, 4)."""
        matrices = np.tile(HIDDEN, (len(self.moving), 1, 1))
        for i, (start, end) in enumerate(self._spans):
            if start <= tick < end:
                matrices[i] = np.eye(4)
        point = self.dcm(tick)
        if point is not None:
            matrices[-1] = np.eye(4)
            matrices[-1, :3, 3] = point
        return matrices


def make_overlays(log: Log, size: float) -> Overlays:
    """Make what a log has something for; nothing if it was no walk.

    Args:
        log: The log, with ground truth.
        size: Height of the centre of mass, m: the measure of markers.
    """
    if "foot/left/contact" not in log or "dcm/reference/x" not in log:
        return Overlays((), (), LEGEND, (), None)
    drawings: list[SceneObject] = []
    moving: list[str] = []
    spans: list[tuple[int, int]] = []
    for i, (name, which) in enumerate((("planned", "reference"), ("real", "truth"))):
        for k, stance in enumerate(stances(log, which)):
            path = f"{ROOT}/footsteps/{name}_{k}"
            colour = SIDE_COLOURS[stance.side]
            height = _level(log, stance, which) + LIFT + 0.001 * i
            if which == "reference":
                shape = _outline(stance.corners, height)
                drawings.append(_flat(f"{path}/shape", shape, colour))
            else:  # there from the landing on
                drawings.append(_flat(f"{path}/shape", _polygon(stance.corners, height), (*colour[:3], 0.35)))
                moving.append(path)
                spans.append((stance.start, len(log)))
    for k, (start, end, corners, height) in enumerate(_supports(log)):
        path = f"{ROOT}/support/{k}"
        drawings.append(_flat(f"{path}/shape", _polygon(corners, height + LIFT), SUPPORT_COLOUR))
        moving.append(path)
        spans.append((start, end))
    for k, (landed, points) in enumerate(_scans(log)):
        path = f"{ROOT}/scans/{k}"
        drawings.append(_flat(f"{path}/shape", _ribbon(points), SCAN_COLOUR))
        moving.append(path)
        spans.append((landed, len(log)))
    disc = VisualCylinder(0.022 * size, 0.004 * size)
    dcm = f"{ROOT}/markers/dcm"
    drawings.append(SceneObject(f"{dcm}/shape", disc, DCM_COLOUR, np.eye(4), on_top=True, shaded=False))
    points = np.column_stack([log["dcm/estimated"], log["zmp/reference/z"]])
    legend = (
        *LEGEND,
        ("DCM", DCM_COLOUR),
        ("left footstep, planned and real", SIDE_COLOURS["left"]),
        ("right footstep, planned and real", SIDE_COLOURS["right"]),
        ("support region", SUPPORT_COLOUR),
        *((("ground as scanned", SCAN_COLOUR),) if "stiffness/scan/x" in log else ()),
    )
    return Overlays(tuple(drawings), (*moving, dcm), legend, tuple(spans), points)


def _supports(log: Log) -> list[tuple[int, int, Array, float]]:
    """Stretches with the same feet on the ground: first tick, tick behind the last, corners of the hull, height."""
    feet = stances(log, "truth")
    edges = sorted({edge for foot in feet for edge in (foot.start, foot.end)})
    found = []
    for start, end in zip(edges, edges[1:], strict=False):
        standing = [foot for foot in feet if foot.start <= start and end <= foot.end]
        if standing:
            points = np.concatenate([foot.corners for foot in standing])
            corners = points[ConvexHull(points).vertices]
            height = max(_level(log, foot, "truth") for foot in standing)
            found.append((start, end, corners, height))
    return found


def _scans(log: Log) -> list[tuple[int, Array]]:
    """Tick from which a scanned profile is known, and its points in the world, shape (n, 3), m."""
    if "stiffness/scan/x" not in log:
        return []
    parts = (log.lists(f"stiffness/scan/{name}") for name in ("x", "lateral", "z"))
    found = []
    for tick, (x, y, z) in enumerate(zip(*parts, strict=True)):
        if x is not None and y is not None and z is not None and x.size > 1:
            heading = float(log["stiffness/scan/heading"][tick])
            c, s = math.cos(heading), math.sin(heading)
            found.append((tick, np.stack([c * x - s * y, s * x + c * y, z + LIFT], axis=1)))
    return found


def _ribbon(points: Array) -> Surface:
    """A line on the ground, as wide as two outlines."""
    along = np.gradient(points[:, :2], axis=0)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    across *= LINE / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    left, right = points.copy(), points.copy()
    left[:, :2] += across
    right[:, :2] -= across
    n = len(points)
    faces = []
    for i in range(n - 1):
        faces += [(i, n + i, n + i + 1), (i, n + i + 1, i + 1)]
    return _both_sides(np.concatenate([left, right]), faces)


def _level(log: Log, stance: Stance, which: str) -> float:
    """Height of a sole in the middle of a stance, m."""
    prefix = "truth/" if which == "truth" else ""
    place = f"{prefix}foot/{stance.side}/" + ("position" if which == "truth" else "reference/position")
    height = float(log[place][(stance.start + stance.end) // 2, 2])
    return height if math.isfinite(height) else 0.0


def _flat(path: str, shape: Surface, colour: Colour) -> SceneObject:
    return SceneObject(path, shape, colour, np.eye(4), shaded=False)


def _polygon(corners: Array, height: float) -> Surface:
    """A convex polygon on a level, seen from above and from below."""
    count = len(corners)
    vertices = np.column_stack([corners, np.full(count, height)])
    fan = [(0, i, i + 1) for i in range(1, count - 1)]
    return _both_sides(vertices, fan)


def _outline(corners: Array, height: float) -> Surface:
    """The border of a convex polygon, as wide as `LINE`."""
    centre = corners.mean(axis=0)
    inward = centre - corners
    inner = corners + LINE * math.sqrt(2.0) * inward / np.linalg.norm(inward, axis=1, keepdims=True)
    count = len(corners)
    vertices = np.column_stack([np.concatenate([corners, inner]), np.full(2 * count, height)])
    faces: list[tuple[int, int, int]] = []
    for i in range(count):
        j = (i + 1) % count
        faces += [(i, j, count + j), (i, count + j, count + i)]
    return _both_sides(vertices, faces)


def _both_sides(vertices: Array, faces: Sequence[tuple[int, int, int]]) -> Surface:
    both = [*faces, *((a, c, b) for a, b, c in faces)]
    return Surface(vertices, np.array(both, dtype=np.uint32))
