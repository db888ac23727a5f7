"""Layers of the live view: balance, outside force, stiffness of the soles, and range sensors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.app.scene.colours import (
    DCM_COLOUR,
    OUTSIDE_COLOUR,
    RAY_COLOUR,
    SCAN_COLOUR,
    SOFT_COLOUR,
    STIFF_COLOUR,
    SUPPORT_COLOUR,
    ZMP_COLOUR,
    stiffness_colour,
)
from wbc.app.scene.footsteps import FootstepsLayer, drift_of
from wbc.app.scene.layer import Annotations, Layer
from wbc.app.scene.marks import (
    LIFT,
    LINE,
    polygon,
    polygon_corners,
    ribbon,
    ribbon_edges,
    ring,
    segment,
    translation,
)
from wbc.app.scene.scene import Scene, body_path
from wbc.app.scene.shapes import MARK, ROOT, cylinder, disc
from wbc.app.scene.sources import FOOT
from wbc.core.errors import Array
from wbc.core.hull import hull_and_area
from wbc.core.robot import GRAVITY, SIDES
from wbc.feet.soles.actuator import STIFFEST
from wbc.tasks.stabilizer.pendulum import natural_frequency

if TYPE_CHECKING:
    from collections.abc import Iterable

    from wbc.feet import FootParts
    from wbc.sim import Plant
    from wbc.walking.control import ReferenceControl

CORNERS, POINTS = 24, 64
"""Largest number of corners of the support polygon and of points of a scanned profile."""

MIN_LOAD_SHARE = 0.005
"""Contacts that bear less than this share of the robot's weight are no corners of the support polygon."""


def make_layers(plant: Plant, scene: Scene, walking: ReferenceControl | None = None) -> tuple[Layer, ...]:
    """Return all layers that a run has data for."""
    layers: list[Layer] = [] if walking is None else [FootstepsLayer(plant, walking)]
    layers.append(BalanceLayer(plant, scene.com_height, walking))
    if walking is not None and walking.control.observer.outside is not None:
        layers.append(OutsideLayer(plant, walking, scene))
    if all(foot.variable_joints for foot in plant.feet):
        layers.append(SolesLayer(plant, walking))
    layers.append(RangeLayer(plant, walking))
    return tuple(layers)


class BalanceLayer(Layer):
    """DCM and support polygon of the ground truth, ZMP and DCM as planned."""

    def __init__(self, plant: Plant, com_height: float, walking: ReferenceControl | None) -> None:
        """Make the markers; they scale with the height of the centre of mass, m."""
        super().__init__()
        self._plant, self._walking = plant, walking
        self._min_load = MIN_LOAD_SHARE * plant.robot.mass * GRAVITY
        self._omega = natural_frequency(com_height)
        self._level = float(plant.terrain.surface.floor)
        mark, none = disc(com_height), np.zeros((CORNERS, 3))
        self.add("support/polygon", polygon(none), SUPPORT_COLOUR, on_top=True, deformable=True)
        self._dcm = self.add("balance/dcm", mark, DCM_COLOUR, on_top=True)
        self.legend = (("DCM", DCM_COLOUR), ("support polygon: hull of the contacts", SUPPORT_COLOUR))
        if walking is not None:
            planned = ring(1.6 * MARK * com_height, 0.4 * MARK * com_height)
            self._planned_zmp = self.add("balance/zmp_planned", planned, ZMP_COLOUR, on_top=True)
            self._planned_dcm = self.add("balance/dcm_planned", planned, DCM_COLOUR, on_top=True)
            self.legend = (*self.legend, ("rings: ZMP and DCM as planned", (0.6, 0.6, 0.6, 1.0)))

    def fill(self, matrices: Array, annotations: Annotations) -> None:  # noqa: D102
        truth = self._plant.truth()
        load = truth.contact_force[:, 2]
        pressed = load > self._min_load
        points = truth.contact_position[pressed]
        if len(points):
            self._level = float(load[pressed] @ points[:, 2] / load[pressed].sum())
        corners = hull_and_area(points[:, :2])[0]
        lifted = np.column_stack([corners, np.full(len(corners), self._level + LIFT)])
        annotations.shapes[f"{ROOT}/support/polygon"] = polygon_corners(lifted, CORNERS)
        reference = None if self._walking is None else self._walking.reference
        omega = self._omega if reference is None else reference.pendulum.omega
        dcm = truth.com[:2] + truth.com_velocity[:2] / omega
        matrices[self._dcm] = translation(float(dcm[0]), float(dcm[1]), self._level + LIFT)
        if reference is not None:
            assert self._walking is not None
            drift, zmp = drift_of(self._plant, self._walking), reference.pendulum.zmp
            matrices[self._planned_zmp] = drift @ translation(*(zmp + (0.0, 0.0, LIFT)))
            x, y = reference.pendulum.dcm[:2]
            matrices[self._planned_dcm] = drift @ translation(x, y, zmp[2] + LIFT)


class OutsideLayer(Layer):
    """Outside force as estimated, with the weight of the load in the models: a rod from the middle of the hands."""

    def __init__(self, plant: Plant, walking: ReferenceControl, scene: Scene) -> None:
        """Make the rod of a walk whose observer estimates the outside wrench.

        The rod of the robot's weight is as long as its CoM is high.
        """
        super().__init__()
        self._plant, self._walking, self._scale = plant, walking, scene.metres_per_newton
        robot = walking.control.observer.robot
        self._robot = robot
        self._hands = [robot.placement(frame) for frame in robot.frames.values()]
        rod = cylinder(0.012 * scene.com_height, 1.0)
        self._rod = self.add("outside/force", rod, OUTSIDE_COLOUR, on_top=True)
        self.legend = (("force on the hands, estimated", OUTSIDE_COLOUR),)

    def fill(self, matrices: Array, annotations: Annotations) -> None:  # noqa: D102
        outside, load = self._walking.control.observer.outside, self._walking.load
        if outside is None:
            return
        force = outside.wrench[:3].copy()
        start = np.array(self._robot.com)
        if self._hands:
            start = np.mean([hand.translation for hand in self._hands], axis=0)
        if load is not None:
            force[2] -= load.applied * GRAVITY
            start = load.place
            annotations.text.append(f"load {load.mass:.2f} kg")
        drift = drift_of(self._plant, self._walking)
        matrices[self._rod] = drift @ segment(start, start + self._scale * force)


class SolesLayer(Layer):
    """Colour of the soles by their stiffness."""

    def __init__(self, plant: Plant, walking: ReferenceControl | None) -> None:
        """Find the hinges of variable stiffness, and their bodies."""
        super().__init__()
        self._model, self._walking = plant.model, walking
        self._springs = [plant.model.joint(foot.variable_joints[0]).id for foot in plant.feet]
        self._paths = [sole_paths(plant.model, foot) for foot in plant.feet]
        self.legend = (("sole of 0 Nm/rad", SOFT_COLOUR), (f"sole of {STIFFEST:g} Nm/rad", STIFF_COLOUR))

    def fill(self, matrices: Array, annotations: Annotations) -> None:  # noqa: D102
        stiffness = [float(self._model.jnt_stiffness[joint]) for joint in self._springs]
        for paths, value in zip(self._paths, stiffness, strict=True):
            annotations.colours |= dict.fromkeys(paths, stiffness_colour(value))
        annotations.text.append(stiffness_text(stiffness))
        scheduler = None if self._walking is None else self._walking.stiffness
        if scheduler is not None and scheduler.steps:
            last = scheduler.steps[-1]
            reason = last.fallback or "as decided"
            annotations.text.append(f"{last.side} foot landed on {last.actual:.1f} Nm/rad ({reason})")


class RangeLayer(Layer):
    """Rays of the range sensors, and the ground that the swing foot has scanned so far.

    After the landing, the profile on which the stiffness was decided replaces the scanned points. Without measurements
    of a range sensor nothing is shown.
    """

    def __init__(self, plant: Plant, walking: ReferenceControl | None) -> None:
        """Find the sensors."""
        super().__init__()
        self._plant, self._walking = plant, walking
        self._sites = [plant.model.site(foot.range_site).id for foot in plant.feet]
        self._ray: list[int] = []
        points = ribbon(np.zeros((2 * POINTS, 3)))
        for i in range(len(self._sites)):
            self._ray.append(self.add(f"range/ray_{i}", cylinder(0.002, 1.0), RAY_COLOUR, on_top=True))
            self.add(f"range/scan_{i}", points, SCAN_COLOUR, on_top=True, deformable=True)
        self._hits: list[list[Array]] = [[] for _ in self._sites]
        self._scanned = [False for _ in self._sites]
        self._swing: int | None = None
        self._steps = 0
        if walking is not None and walking.stiffness is not None:
            self.legend = (("range ray", RAY_COLOUR), ("ground as scanned", SCAN_COLOUR))

    def fill(self, matrices: Array, annotations: Annotations) -> None:  # noqa: D102
        self._follow_walk()
        measured = None if self.measurement is None else self.measurement.sole_range
        for i, site in enumerate(self._sites):
            distance = math.nan if measured is None else float(measured[i])
            if math.isfinite(distance):
                data = self._plant.data
                start = data.site_xpos[site].copy()
                end = start + distance * data.site_xmat[site].reshape(3, 3)[:, 2]
                matrices[self._ray[i]] = segment(start, end)
                if self._swing == i:
                    self._hits[i].append(end)
            if not self._hits[i] and not self._scanned[i]:
                continue
            self._scanned[i] = True
            hits = np.array(self._hits[i]).reshape(-1, 3) + (0.0, 0.0, LIFT)
            annotations.shapes[f"{ROOT}/range/scan_{i}"] = ribbon_edges(hits, 2.0 * LINE, POINTS)

    def _follow_walk(self) -> None:
        """Start a scan with every swing; take the profile of the last step after its landing."""
        walking = self._walking
        if walking is None:
            return
        swing = walking.progress.swing
        if swing is not None and swing != self._swing:
            self._hits[swing] = []
        self._swing = swing
        scheduler = walking.stiffness
        if scheduler is not None and scheduler.steps:
            last = scheduler.steps[-1]
            if last.step + 1 != self._steps and last.profile is not None:
                drift = drift_of(self._plant, walking)
                seen = last.profile.points @ drift[:3, :3].T + drift[:3, 3]
                self._hits[SIDES.index(last.side)] = list(seen)
            self._steps = last.step + 1


def sole_paths(model: Any, foot: FootParts) -> tuple[str, ...]:
    """Return the paths of a foot's bodies on hinges of variable stiffness; empty for a passive foot."""
    bodies = sorted({int(model.joint(name).bodyid[0]) for name in foot.variable_joints})
    return tuple(body_path(FOOT + str(model.body(body).name)) for body in bodies)


def stiffness_text(stiffness: Iterable[float]) -> str:
    """Return the stiffness of both soles (Nm/rad) as text."""
    return "soles " + " and ".join(f"{value:.1f}" for value in stiffness) + " Nm/rad"
