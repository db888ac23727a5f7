"""Marks: everything that is drawn beside the model, as one list for each picture.

A view, a film and a replay draw the same marks. A new mark is a function that returns some, or a class if it remembers
what was before, and a line in `live_marks` (what a run shows) or in `wbc.app.replay.marks` (what a log shows).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Literal, NamedTuple

import numpy as np

from wbc.app.view.meshes import Colour, Mesh, ball, lathe
from wbc.core.errors import Array
from wbc.feet.soles.actuator import STIFFEST

COM_COLOUR: Colour = (0.95, 0.60, 0.10, 1.0)
ZMP_COLOUR: Colour = (0.75, 0.15, 0.75, 1.0)
DCM_COLOUR: Colour = (0.34, 0.71, 0.91, 1.0)
FORCE_COLOURS: dict[str, Colour] = {"ground": (0.10, 0.60, 0.25, 0.9), "push": (0.85, 0.15, 0.10, 0.9)}
SIDE_COLOURS: dict[str, Colour] = {"left": (0.0, 0.45, 0.70, 1.0), "right": (0.84, 0.37, 0.0, 1.0)}
SUPPORT_COLOUR: Colour = (0.0, 0.62, 0.45, 0.35)
OUTSIDE_COLOUR: Colour = (0.55, 0.25, 0.10, 0.9)
RAY_COLOUR: Colour = (0.90, 0.20, 0.20, 0.9)
SCAN_COLOUR: Colour = (0.95, 0.90, 0.25, 1.0)
GROUND_COLOUR: Colour = (0.10, 0.35, 0.75, 1.0)
FRUSTUM_COLOUR: Colour = (0.10, 0.35, 0.75, 0.6)
SOFT_COLOUR: Colour = (0.35, 0.80, 0.85, 1.0)
STIFF_COLOUR: Colour = (0.50, 0.10, 0.45, 1.0)

LIFT = 0.004
"""Height of marks above the ground, m: at the same height both would flicker."""

LINE = 0.006
"""Width of outlines, m."""

POINT = 0.02
"""Radius of the marks of points, for each metre that the centre of mass is high."""

LONGEST = 1.5
"""Longest arrow of a force, in weights of the robot: one of a landing would grow out of the picture."""

NOTICED = 5e-4
"""Distance from which on a mark that has moved is drawn anew, m."""

HEAD_LENGTH, HEAD_WIDTH = 0.25, 2.5
"""Length of an arrow's head, share of the arrow, and its radius, in radii of the shaft."""


@dataclass(frozen=True, eq=False, slots=True)
class Mark:
    """Something that is drawn beside the model.

    Attributes:
        name: Unique in a picture; in the next picture the mark of that name takes its place.
        kind: A ball at the one point, an arrow from the first point to the second, a line along the points, a convex
            area within them, or a cloud of points.
        points: In the world, shape (n, 3), m.
        colour: Its colour.
        size: Radius of a ball, of an arrow's shaft, of the points of a cloud, width of a line, m.
        meaning: Text of the legend; marks with the same share a line.
    """

    name: str
    kind: Literal["ball", "arrow", "line", "area", "cloud"]
    points: Array
    colour: Colour
    size: float = LINE
    meaning: str = ""

    def looks_like(self, other: Mark) -> bool:
        """Return true if a mark that is shown need not be drawn anew for this one."""
        a, b = self.points, other.points
        return self.colour == other.colour and a.shape == b.shape and bool((np.abs(a - b) < NOTICED).all())


@dataclass(eq=False)
class Picture:
    """Marks that a view draws beside the bodies of the model at an instant.

    Attributes:
        time: s.
        marks: Marks, with different names.
        text: Lines of text.
        target: Point that the camera follows, shape (3,), m.
        colours: Colours of bodies that differ from the model's.
    """

    time: float
    marks: list[Mark] = field(default_factory=list)
    text: list[str] = field(default_factory=list)
    target: Array = field(default_factory=lambda: np.zeros(3))
    colours: dict[int, Colour] = field(default_factory=dict)


class Force(NamedTuple):
    """A force: "ground" or "push", point of attack (world, m) and force (world, N), both of shape (3,)."""

    kind: str
    point: Array
    force: Array


class Scale(NamedTuple):
    """Sizes of a robot that marks scale with: height of its centre of mass, m, and weight, N."""

    height: float
    weight: float


def balance_marks(
    scale: Scale, com: Array, zmp: Array | None, forces: Sequence[Force], level: float
) -> list[Mark]:
    """Return forces, centre of mass with its shadow at a level (m), and ZMP; None without contact."""
    size = POINT * scale.height
    shadow = np.array([[com[0], com[1], level]])
    marks = [
        Mark("com", "ball", com[None], COM_COLOUR, size, "centre of mass and its shadow"),
        Mark("com shadow", "ball", shadow, COM_COLOUR, 0.6 * size, "centre of mass and its shadow"),
    ]
    if zmp is not None:
        marks.append(Mark("zmp", "ball", zmp[None], ZMP_COLOUR, size, "ZMP"))
    number = {"ground": 0, "push": 0}
    for kind, point, force in forces:
        reach = force_reach(scale, force)
        ends = np.stack([point - reach, point] if kind == "push" else [point, point + reach])
        meaning = "push" if kind == "push" else f"contact force, drawn up to {LONGEST:g} x weight"
        name = f"{kind} force {number[kind]}"
        marks.append(Mark(name, "arrow", ends, FORCE_COLOURS[kind], 0.01 * scale.height, meaning))
        number[kind] += 1
    return marks


def force_reach(scale: Scale, force: Array) -> Array:
    """Return the arrow of a force (N), m: the robot's weight is as long as its centre of mass is high."""
    length = float(np.linalg.norm(force)) / scale.weight
    return scale.height / scale.weight * force * min(1.0, LONGEST / max(length, 1e-9))


def sole_corners(length: float, width: float, pose: Array) -> Array:
    """Return the corners of a sole with a homogeneous pose, shape (4, 3), m, a little above it."""
    local = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * (0.5 * length, 0.5 * width)
    corners: Array = np.column_stack([local, np.full(4, LIFT)]) @ pose[:3, :3].T + pose[:3, 3]
    return corners


def footstep(name: str, side: str, corners: Array, *, real: bool) -> Mark:
    """Return a footstep: the outline of a planned one, the area of a real one."""
    if real:
        return Mark(name, "area", corners, translucent(SIDE_COLOURS[side]), meaning=f"{side} footstep")
    return Mark(name, "line", closed(corners), SIDE_COLOURS[side], meaning=f"{side} footstep, planned")


def ground_mark(points: Array) -> Mark:
    """Return the cells of the ground that are known, shape (n, 3), m."""
    return Mark(
        "known ground", "cloud", points + (0.0, 0.0, LIFT), GROUND_COLOUR, 0.5 * LINE, "ground as seen"
    )


def closed(corners: Array) -> Array:
    """Return the line around corners, back to the first."""
    return np.concatenate([corners, corners[:1]])


def circle(centre: Array, radius: float) -> Array:
    """Return a level circle, shape (17, 3), m."""
    angle = np.linspace(0.0, math.tau, 17)
    return centre + radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(17)], axis=1)


def translucent(colour: Colour) -> Colour:
    """Return the colour of a filled area."""
    return (*colour[:3], 0.35)


def stiffness_colour(stiffness: float) -> Colour:
    """Return the colour of a sole, Nm/rad: from soft to stiff on a logarithmic scale."""
    share = min(1.0, math.log1p(max(0.0, stiffness)) / math.log1p(STIFFEST))
    r, g, b, a = (
        round(soft + share * (stiff - soft), 4) for soft, stiff in zip(SOFT_COLOUR, STIFF_COLOUR, strict=True)
    )
    return r, g, b, a


def legend(pictures: Iterable[Picture]) -> dict[str, Colour]:
    """Return the meaning of the colours in pictures."""
    meanings = {mark.meaning: mark.colour for picture in pictures for mark in picture.marks if mark.meaning}
    if any(picture.colours for picture in pictures):
        meanings |= {"sole of 0 Nm/rad": SOFT_COLOUR, f"sole of {STIFFEST:g} Nm/rad": STIFF_COLOUR}
    return meanings


# ---- shapes ---------------------------------------------------------------------------------------------------------


class Placed(NamedTuple):
    """Triangles of a mark, and where they are: position (m), rotation, shape (3, 3), and scale along its axes."""

    mesh: Mesh
    position: Array
    rotation: Array
    scale: Array


def placed(mark: Mark) -> Placed:
    """Return the triangles of a mark but a cloud: one mesh for all balls and arrows, else those of its points."""
    points, origin = mark.points, np.zeros(3)
    if mark.kind == "ball":
        return Placed(_unit_ball(), points[0], np.eye(3), np.full(3, mark.size))
    if mark.kind == "arrow":
        along = points[1] - points[0]
        length = max(float(np.linalg.norm(along)), 1e-6)
        return Placed(_unit_arrow(), points[0], _turn_to(along), np.array([mark.size, mark.size, length]))
    if mark.kind == "area":
        count = np.arange(1, len(points) - 1, dtype=np.uint32)
        faces = np.stack([np.zeros_like(count), count, count + 1], axis=1)
    else:
        points, faces = _ribbon(points, mark.size)
    both = np.concatenate([faces, faces[:, ::-1]])  # seen from above and from below
    return Placed(Mesh(points, both), origin, np.eye(3), np.ones(3))


Shown = dict[str, tuple[Mark, Mesh | None]]
"""Marks of a page by name, each with its triangles; None for a cloud."""


def changes(shown: Shown, marks: Sequence[Mark]) -> Iterator[tuple[str, Mark | None, Placed | None, bool]]:
    """Yield name, mark, placed triangles and whether these are new, for what looks other than shown; None if gone."""
    for name in shown.keys() - {mark.name for mark in marks}:
        del shown[name]
        yield name, None, None, False
    for mark in marks:
        old = shown.get(mark.name)
        if old is not None and mark.looks_like(old[0]):
            continue
        place = None if mark.kind == "cloud" else placed(mark)
        mesh = None if place is None else place.mesh
        anew = old is None or old[1] is not mesh or old[0].colour != mark.colour
        shown[mark.name] = (mark, mesh)
        yield mark.name, mark, place, anew


@cache
def _unit_ball() -> Mesh:
    return ball(1.0, 1.0, 1.0)


@cache
def _unit_arrow() -> Mesh:
    """Arrow of length 1 along z with a shaft of radius 1."""
    neck = 1.0 - HEAD_LENGTH
    return lathe([(0.0, 0.0), (1.0, 0.0), (1.0, neck), (HEAD_WIDTH, neck), (0.0, 1.0)])


def _turn_to(along: Array) -> Array:
    """Return a rotation, shape (3, 3), whose z axis is along a vector."""
    length = float(np.linalg.norm(along))
    if length < 1e-9:
        return np.eye(3)
    z = along / length
    x = np.cross(z, (0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0))
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _ribbon(points: Array, width: float) -> tuple[Array, np.ndarray[tuple[int, int], np.dtype[np.uint32]]]:
    """Return a ribbon along points, seen from above: a rectangle for each segment; one that rises is a cross of two."""
    start, end = points[:-1], points[1:]
    along = end - start
    length = np.linalg.norm(along, axis=1, keepdims=True)
    start, end, along = (each[length[:, 0] > 1e-9] for each in (start, end, along / np.maximum(length, 1e-9)))
    aside = np.cross((0.0, 0.0, 1.0), along)
    size = np.linalg.norm(aside, axis=1, keepdims=True)
    aside = np.where(size > 1e-6, aside / np.maximum(size, 1e-6), (1.0, 0.0, 0.0))
    steep = np.abs(along[:, 2]) > 0.5
    sides = [(start, end, aside), (start[steep], end[steep], np.cross(along, aside)[steep])]
    corners = np.concatenate(
        [np.stack([a - w, b - w, b + w, a + w], axis=1) for a, b, n in sides for w in [0.5 * width * n]]
    )
    first = 4 * np.arange(len(corners), dtype=np.uint32)[:, None, None]
    sides_of = np.array([(0, 1, 2), (0, 2, 3)], dtype=np.uint32)
    return corners.reshape(-1, 3), (first + sides_of).reshape(-1, 3)
