"""What the live view shows beside the robot: balance, soles, and what a swinging foot sees.

A layer is made once with its objects. For each picture it fills the matrices of what it moves, and says in a note what
matrices cannot say: text, colours, shapes that bend. It reads plant and controller and never writes to them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from wbc.app.view.flat import polygon, polygon_corners, ribbon, ribbon_edges, ring, segment
from wbc.app.view.scene import ROOT, ZMP_COLOUR, Note, SceneObject
from wbc.app.view.shapes import Colour, Shape, VisualCylinder
from wbc.core.errors import Array
from wbc.sim.rig.results import hull
from wbc.walking.pattern.lipm import natural_frequency
from wbc.walking.planning.footsteps import SIDES

if TYPE_CHECKING:
    from wbc.core.signals import Measurement
    from wbc.sim import Plant
    from wbc.walking.control import WalkingControl

DCM_COLOUR: Colour = (0.34, 0.71, 0.91, 1.0)
SUPPORT_COLOUR: Colour = (0.0, 0.62, 0.45, 0.35)
RAY_COLOUR: Colour = (0.90, 0.20, 0.20, 0.9)
SCAN_COLOUR: Colour = (0.95, 0.90, 0.25, 1.0)
SOFT_COLOUR: Colour = (0.35, 0.80, 0.85, 1.0)
STIFF_COLOUR: Colour = (0.50, 0.10, 0.45, 1.0)

STIFFEST = 80.0
"""Stiffness with the colour of the stiffest, Nm/rad: the end of the range in Table I of Frizza et al., 2022."""

LIFT = 0.004
"""How far marks lie over the ground, m: they must not flicker with it."""

LINE = 0.006
"""Width of outlines, m."""

CORNERS, POINTS = 24, 64
"""Most corners of the support polygon and most points of a scanned profile that are shown."""


class Layer:
    """Something that is shown beside the robot.

    Attributes:
        drawings: Its objects.
        moving: Paths that it moves.
        legend: What its colours mean.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.drawings: list[SceneObject] = []
        self.moving: list[str] = []
        self.legend: list[tuple[str, Colour]] = []

    def add(
        self,
        path: str,
        shape: Shape,
        colour: Colour,
        *,
        on_top: bool = False,
        bends: bool = False,
    ) -> int:
        """Add an object; returns the place of its matrix, which means nothing for one that bends instead."""
        path = f"{ROOT}/{path}"
        name = path if bends else f"{path}/shape"
        self.drawings.append(
            SceneObject(name, shape, colour, np.eye(4), on_top=on_top, shaded=False, bends=bends)
        )
        if not bends:
            self.moving.append(path)
        return len(self.moving) - 1

    def fill(self, matrices: Array, note: Note) -> None:
        """Show the present state.

        Args:
            matrices: One for each moving path, all hidden, shape (len(moving), 4, 4).
            note: Takes text, colours and shapes.
        """


class BalanceLayer(Layer):
    """DCM and support polygon as they truly are, and ZMP and DCM as planned."""

    def __init__(self, plant: Plant, size: float, least: float, walking: WalkingControl | None) -> None:
        """Make markers.

        Args:
            plant: The plant.
            size: Height of the centre of mass, m: the measure of markers.
            least: Force from which on a contact counts, N.
            walking: The controller, if it is a walk.
        """
        super().__init__()
        self._plant, self._walking, self._least = plant, walking, least
        self._omega = natural_frequency(size) if walking is None else walking.walk.omega
        self._level = float(plant.terrain.surface.floor)
        radius, height = 0.022 * size, 0.004 * size
        self.add("support/polygon", polygon(CORNERS), SUPPORT_COLOUR, on_top=True, bends=True)
        self._dcm = self.add("balance/dcm", VisualCylinder(radius, height), DCM_COLOUR, on_top=True)
        self.legend = [("DCM", DCM_COLOUR), ("support polygon: hull of the contacts", SUPPORT_COLOUR)]
        if walking is not None:
            mark = ring(1.6 * radius, 0.4 * radius)
            self._planned_zmp = self.add("balance/zmp_planned", mark, ZMP_COLOUR, on_top=True)
            self._planned_dcm = self.add("balance/dcm_planned", mark, DCM_COLOUR, on_top=True)
            self.legend.append(("rings: ZMP and DCM as planned", (0.6, 0.6, 0.6, 1.0)))

    def fill(self, matrices: Array, note: Note) -> None:  # noqa: D102
        truth = self._plant.truth()
        load = truth.contact_force[:, 2]
        pressed = load > self._least
        points = truth.contact_position[pressed]
        if len(points):
            self._level = float(load[pressed] @ points[:, 2] / load[pressed].sum())
        corners = hull(points[:, :2])[0]
        lifted = np.column_stack([corners, np.full(len(corners), self._level + LIFT)])
        note.shapes[f"{ROOT}/support/polygon"] = polygon_corners(lifted, CORNERS)
        dcm = truth.com[:2] + truth.com_velocity[:2] / self._omega
        matrices[self._dcm] = _at(float(dcm[0]), float(dcm[1]), self._level + LIFT)
        reference = None if self._walking is None else self._walking.reference
        if reference is not None:
            x, y, z = reference.pendulum.zmp
            matrices[self._planned_zmp] = _at(x, y, z + LIFT)
            x, y = reference.pendulum.dcm[:2]
            matrices[self._planned_dcm] = _at(x, y, z + LIFT)


class SolesLayer(Layer):
    """Soles in the colour of their stiffness."""

    def __init__(self, plant: Plant, walking: WalkingControl | None) -> None:
        """Find the hinges whose springs can differ, and the bodies that they move."""
        super().__init__()
        self._model, self._walking = plant.model, walking
        self._springs = [plant.model.joint(foot.variable_joints[0]).id for foot in plant.feet]
        self._paths = []
        for foot in plant.feet:
            bodies = {int(plant.model.joint(name).bodyid[0]) for name in foot.variable_joints}
            names = [str(plant.model.body(body).name) for body in sorted(bodies)]
            self._paths.append([f"{ROOT}/robot/foot_{name.replace('/', '_')}" for name in names])
        self.legend = [
            ("sole of 0 Nm/rad", SOFT_COLOUR),
            (f"sole of {STIFFEST:g} Nm/rad", STIFF_COLOUR),
        ]

    def fill(self, matrices: Array, note: Note) -> None:  # noqa: D102
        stiffness = [float(self._model.jnt_stiffness[joint]) for joint in self._springs]
        for paths, value in zip(self._paths, stiffness, strict=True):
            note.colours |= dict.fromkeys(paths, stiffness_colour(value))
        note.text.append("soles " + " and ".join(f"{value:.1f}" for value in stiffness) + " Nm/rad")
        task = None if self._walking is None else self._walking.stiffness
        if task is not None and task.steps:
            last = task.steps[-1]
            why = last.fallback or "as decided"
            note.text.append(f"{last.side} foot landed on {last.actual:.1f} Nm/rad ({why})")


class RangeLayer(Layer):
    """What the range sensors see: their rays, and the ground that a swinging foot has seen so far.

    When the foot has landed, the profile that its stiffness was decided on takes the place of what was seen. Needs
    measurements: without a range sensor, or if nobody hands them over, there is nothing to see.

    Attributes:
        measurement: The last one.
    """

    def __init__(self, plant: Plant, walking: WalkingControl | None) -> None:
        """Find the sensors."""
        super().__init__()
        self.measurement: Measurement | None = None
        self._plant, self._walking = plant, walking
        self._sites = [plant.model.site(foot.range_site).id for foot in plant.feet]
        self._ray: list[int] = []
        for i in range(len(self._sites)):
            self._ray.append(self.add(f"range/ray_{i}", VisualCylinder(0.002, 1.0), RAY_COLOUR, on_top=True))
            self.add(f"range/scan_{i}", ribbon(POINTS), SCAN_COLOUR, on_top=True, bends=True)
        self._hits: list[list[Array]] = [[] for _ in self._sites]
        self._scanned = [False for _ in self._sites]
        self._swing: str | None = None
        self._steps = 0
        if walking is not None and walking.stiffness is not None:
            self.legend = [("range ray", RAY_COLOUR), ("ground as scanned", SCAN_COLOUR)]

    def fill(self, matrices: Array, note: Note) -> None:  # noqa: D102
        self._follow_walk()
        measured = None if self.measurement is None else self.measurement.sole_range
        for i, site in enumerate(self._sites):
            distance = math.nan if measured is None else float(measured[i])
            if math.isfinite(distance):
                data = self._plant.data
                start = data.site_xpos[site].copy()
                end = start + distance * data.site_xmat[site].reshape(3, 3)[:, 2]
                matrices[self._ray[i]] = segment(start, end)
                if self._swing is not None and SIDES.index(self._swing) == i:
                    self._hits[i].append(end)
            if not self._hits[i] and not self._scanned[i]:
                continue
            self._scanned[i] = True
            hits = np.array(self._hits[i]).reshape(-1, 3) + (0.0, 0.0, LIFT)
            note.shapes[f"{ROOT}/range/scan_{i}"] = ribbon_edges(hits, 2.0 * LINE, POINTS)

    def _follow_walk(self) -> None:
        """Begin anew with every swing; take over the profile of a swing that has ended."""
        walking = self._walking
        if walking is None:
            return
        swing = walking.walk.phases.swing
        if swing is not None and swing != self._swing:
            self._hits[SIDES.index(swing)] = []
        self._swing = swing
        task = walking.stiffness
        if task is not None and task.steps:
            last = task.steps[-1]
            if last.step + 1 != self._steps and last.profile is not None:
                self._hits[SIDES.index(last.side)] = list(last.profile.points)
            self._steps = last.step + 1


def stiffness_colour(stiffness: float) -> Colour:
    """Colour of a sole: from soft to stiff, on a logarithmic scale, as stiffnesses differ by factors.

    Args:
        stiffness: Nm/rad.
    """
    share = min(1.0, math.log1p(max(0.0, stiffness)) / math.log1p(STIFFEST))
    red, green, blue, opacity = (
        round(a + share * (b - a), 4) for a, b in zip(SOFT_COLOUR, STIFF_COLOUR, strict=True)
    )
    return red, green, blue, opacity


def _at(x: float, y: float, z: float) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix
