"""Marks: everything that is drawn beside the model, as one list for each picture.

Live views, replays and films draw the same `Picture`, which is made from the run itself (`stage`, `walk_marks`) or from
a row of its log (`wbc.app.replay.replay`). Pages and Rerun draw the triangles of a mark.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import pinocchio as pin

from wbc.app.view.meshes import Mesh, ball, lathe
from wbc.base.hull import convex_hull
from wbc.base.numbers import Array
from wbc.feet.soles.actuator import STIFFEST
from wbc.robots.mechanism import Colour
from wbc.tasks.stabilizer.pendulum import MIN_FORCE, cop

COM_COLOUR: Colour = (0.95, 0.60, 0.10, 1.0)
ZMP_COLOUR: Colour = (0.75, 0.15, 0.75, 1.0)
DCM_COLOUR: Colour = (0.34, 0.71, 0.91, 1.0)
PLANNED: dict[str, Colour] = {"ZMP": ZMP_COLOUR, "DCM": DCM_COLOUR}
"""Planned points that are drawn as rings, in the colours of the true ones."""

FORCES: dict[str, tuple[Colour, str]] = {
    "ground": ((0.10, 0.60, 0.25, 0.9), "contact force"),
    "push": ((0.85, 0.15, 0.10, 0.9), "push"),
    "outside": ((0.55, 0.25, 0.10, 0.9), "force on the hands, estimated"),
}
"""Kinds of forces: colour and meaning; an arrow as long as the centre of mass is high is the robot's weight."""

SIDE_COLOURS: dict[str, Colour] = {"left": (0.0, 0.45, 0.70, 1.0), "right": (0.84, 0.37, 0.0, 1.0)}
SUPPORT_COLOUR: Colour = (0.0, 0.62, 0.45, 0.35)
SCAN_COLOUR: Colour = (0.95, 0.90, 0.25, 1.0)
GROUND_COLOUR: Colour = (0.10, 0.35, 0.75, 1.0)
SOFT_COLOUR: Colour = (0.35, 0.80, 0.85, 1.0)
STIFF_COLOUR: Colour = (0.50, 0.10, 0.45, 1.0)

LIFT = 0.004
"""Height of marks above the ground, m: at the same height both would flicker."""

UP = np.array([0.0, 0.0, LIFT])
"""Way of a mark up to that height, m."""

LINE = 0.006
"""Width of outlines, m."""

POINT = 0.02
"""Radius of the marks of points, for each metre that the centre of mass is high."""

LONGEST = 1.5
"""Longest arrow of a force, in weights of the robot: one of a landing would grow out of the picture."""

NOTICED = 5e-4
"""Distance from which on a mark that has moved is drawn anew, m."""


@dataclass(frozen=True, eq=False, slots=True)
class Mark:
    """Something that is drawn beside the model.

    Attributes:
        name: Unique in a picture; in the next picture the mark of that name takes its place.
        kind: A ball at the one point, an arrow from the first point to the second, a line along the points, a convex
            area within them, or a cloud of points.
        points: In the world, shape (n, 3), m.
        colour: Its colour.
        size: Radius of a ball, of an arrow's shaft, half the side of the points of a cloud, width of a line, m.
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
        look, shown = (self.kind, self.colour, self.size), (other.kind, other.colour, other.size)
        a, b = self.points, other.points
        return look == shown and a.shape == b.shape and bool((np.abs(a - b) < NOTICED).all())


class Force(NamedTuple):
    """A force: one of `FORCES`, point of attack (world, m) and force (world, N), both of shape (3,)."""

    kind: str
    point: Array
    force: Array


class Scale(NamedTuple):
    """Sizes of a robot that marks scale with: height of its centre of mass, m, and weight, N."""

    height: float
    weight: float


@dataclass(eq=False)
class Picture:
    """Marks and text beside the bodies of a model at one time; points are in the true world, m.

    Attributes:
        time: Time, s.
        marks: Marks, with different names.
        text: Lines of text.
        target: Point that the camera follows, shape (3,).
        colours: Colours of bodies that differ from the model's.
    """

    time: float
    marks: list[Mark] = field(default_factory=list)
    text: list[str] = field(default_factory=list)
    target: Array = field(default_factory=lambda: np.zeros(3))
    colours: dict[int, Colour] = field(default_factory=dict)

    @property
    def lines(self) -> list[str]:
        """Time and text."""
        return [f"{self.time:.2f} s", *self.text]

    def add_balance(
        self,
        scale: Scale,
        com: Array,
        level: float,
        zmp: Array | None = None,
        dcm: Array | None = None,
        support: Array | None = None,
    ) -> None:
        """Add CoM with its shadow at a level (m), ZMP, DCM (x, y) and support, the hull of points of shape (n, 3)."""
        size, shadow = POINT * scale.height, np.array([[com[0], com[1], level]])
        self.marks += [
            Mark("com", "ball", com[None], COM_COLOUR, size, "centre of mass and its shadow"),
            Mark("com shadow", "ball", shadow, COM_COLOUR, 0.6 * size, "centre of mass and its shadow"),
        ]
        if zmp is not None and np.isfinite(zmp).all():
            self.marks.append(Mark("zmp", "ball", zmp[None], ZMP_COLOUR, size, "ZMP"))
        if dcm is not None and np.isfinite(dcm).all():
            place = np.array([[*dcm[:2], level + LIFT]])
            self.marks.append(Mark("dcm", "ball", place, DCM_COLOUR, size, "DCM"))
        if support is not None and len(corners := convex_hull(support[:, :2])) > 2:
            area = np.column_stack([corners, np.full(len(corners), support[:, 2].mean() + LIFT)])
            self.marks.append(Mark("support", "area", area, SUPPORT_COLOUR, meaning="support polygon"))

    def add_planned(self, scale: Scale, planned: Mapping[str, Array]) -> None:
        """Add rings of the planned points "ZMP" and "DCM", shape (3,), where they are known."""
        for name, point in planned.items():
            if np.isfinite(point).all():
                self.marks.append(ring(name, PLANNED[name], point, scale))

    def add_soles(self, soles: Sequence[Sequence[int]], stiffness: Sequence[float]) -> None:
        """Add the colours of soles, the bodies of each, by their stiffness, Nm/rad; NaN where it is not known."""
        for bodies, value in zip(soles, stiffness, strict=True):
            if math.isfinite(value):
                self.colours |= dict.fromkeys(bodies, stiffness_colour(value))
        if self.colours:
            self.text.append("soles " + " and ".join(f"{value:.1f}" for value in stiffness) + " Nm/rad")


def force_marks(scale: Scale, forces: Sequence[Force]) -> list[Mark]:
    """Return the arrows of forces: a push ends at its point, others begin there."""
    marks, number = [], dict.fromkeys(FORCES, 0)
    for kind, point, force in forces:
        length = float(np.linalg.norm(force)) / scale.weight
        reach = scale.height / scale.weight * force * min(1.0, LONGEST / max(length, 1e-9))
        ends = np.stack([point - reach, point] if kind == "push" else [point, point + reach])
        colour, meaning = FORCES[kind]
        marks.append(
            Mark(f"{kind} force {number[kind]}", "arrow", ends, colour, 0.01 * scale.height, meaning)
        )
        number[kind] += 1
    return marks


def sole_force(position: Array, rotation: Array, wrench: Array) -> list[Force]:
    """Return the contact force of a sole by the wrench in its frame, at its centre of pressure; empty without one.

    It has one from `MIN_FORCE` on.
    """
    if not (np.isfinite(wrench).all() and wrench[2] >= MIN_FORCE):
        return []
    return [Force("ground", position + rotation[:, :2] @ cop(wrench), rotation @ wrench[:3])]


def planned_step(number: int, side: str, corners: Array) -> Mark:
    """Return the outline of a planned footstep."""
    closed, meaning = np.concatenate([corners, corners[:1]]), f"{side} footstep, planned (outline)"
    return Mark(f"planned step {number}", "line", closed + UP, SIDE_COLOURS[side], meaning=meaning)


def real_step(number: int, side: str, corners: Array) -> Mark:
    """Return the area of a footstep where the foot stood."""
    colour = (*SIDE_COLOURS[side][:3], 0.35)
    return Mark(f"real step {number}", "area", corners + UP, colour, meaning=f"{side} footstep")


def scan_mark(number: int, points: Array) -> Mark:
    """Return the ground that a range sensor has scanned in a swing, shape (n, 3), m."""
    return Mark(f"scan {number}", "line", points + UP, SCAN_COLOUR, 2.0 * LINE, "ground as scanned")


def ground_mark(points: Array) -> Mark:
    """Return the cells of the ground that are known, shape (n, 3), m."""
    return Mark("known ground", "cloud", points + UP, GROUND_COLOUR, 0.5 * LINE, "ground as seen")


def ring(name: str, colour: Colour, centre: Array, scale: Scale) -> Mark:
    """Return the ring of a planned point."""
    angle, radius = np.linspace(0.0, math.tau, 17), 1.6 * POINT * scale.height
    circle = radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(17)], axis=1)
    return Mark(f"{name} planned", "line", centre + circle + UP, colour, meaning=f"{name} as planned (ring)")


def stiffness_colour(stiffness: float) -> Colour:
    """Return the colour of a sole, Nm/rad: from soft to stiff on a logarithmic scale."""
    share = min(1.0, math.log1p(max(0.0, stiffness)) / math.log1p(STIFFEST))
    r, g, b, a = (
        round(soft + share * (stiff - soft), 4) for soft, stiff in zip(SOFT_COLOUR, STIFF_COLOUR, strict=True)
    )
    return r, g, b, a


def walk_text(phase: str, swing: str | None, steps_done: int) -> str:
    """Return phase of a walk, the foot that swings, and the number of steps done, in words."""
    swings = f", {swing} foot swings" if phase == "single support" and swing else ""
    return f"{phase}{swings}, {steps_done} steps done"


def legend(picture: Picture) -> dict[str, Colour]:
    """Return the meaning of the colours in a picture."""
    meanings = {mark.meaning: mark.colour for mark in picture.marks if mark.meaning}
    if picture.colours:
        meanings |= {"sole of 0 Nm/rad": SOFT_COLOUR, f"sole of {STIFFEST:g} Nm/rad": STIFF_COLOUR}
    return meanings


def css(colour: Colour) -> str:
    """Return an opaque colour as pages have it."""
    return "rgb({}, {}, {})".format(*(round(255 * part) for part in colour[:3]))


# ---- shapes ---------------------------------------------------------------------------------------------------------


def mark_mesh(mark: Mark) -> Mesh:
    """Return the triangles of a mark in the world, to be drawn from both sides; lines and clouds are level."""
    points, size = mark.points, mark.size
    if mark.kind == "ball":
        vertices, faces = ball(size, size, size)
        return Mesh(vertices + points[0], faces)
    if mark.kind == "arrow":
        along = points[1] - points[0]
        length = max(float(np.linalg.norm(along)), 1e-6)
        neck, head = 0.75 * length, 2.5 * size
        vertices, faces = lathe([(0.0, 0.0), (size, 0.0), (size, neck), (head, neck), (0.0, length)])
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).matrix()
        return Mesh(vertices @ turn.T + points[0], faces)
    if mark.kind == "area":
        count = np.arange(1, len(points) - 1, dtype=np.uint32)
        return Mesh(points, np.stack([np.zeros_like(count), count, count + 1], axis=1))
    if mark.kind == "line":
        start, end = points[:-1], points[1:]
        aside = np.cross((0.0, 0.0, 0.5 * size), end - start)
        aside /= np.maximum(np.linalg.norm(end - start, axis=1, keepdims=True), 1e-9)
        corners = [start - aside, end - aside, end + aside, start + aside]
    else:
        corners = [points + (x, y, 0.0) for x, y in size * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])]
    first = 4 * np.arange(len(corners[0]), dtype=np.uint32)[:, None, None]
    faces = (first + np.array([(0, 1, 2), (0, 2, 3)], dtype=np.uint32)).reshape(-1, 3)
    return Mesh(np.stack(corners, axis=1).reshape(-1, 3), faces)
