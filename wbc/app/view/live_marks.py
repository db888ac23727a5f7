"""Marks and text of a run beside its forces: support, footsteps, plans, outside force, soles, sensors and ground."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from wbc.app.drift import Drift
from wbc.app.view.marks import (
    DCM_COLOUR,
    FRUSTUM_COLOUR,
    LIFT,
    LINE,
    OUTSIDE_COLOUR,
    POINT,
    RAY_COLOUR,
    SCAN_COLOUR,
    SUPPORT_COLOUR,
    ZMP_COLOUR,
    Mark,
    Picture,
    Scale,
    circle,
    footstep,
    force_reach,
    ground_mark,
    sole_corners,
    stiffness_colour,
)
from wbc.core.errors import Array
from wbc.core.hull import convex_hull
from wbc.core.robot import GRAVITY, SIDES
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.plant.plant import Plant
from wbc.sim.plant.robot import SimulatedRobot
from wbc.tasks.stabilizer.pendulum import natural_frequency
from wbc.walking.plans.footsteps import heading

if TYPE_CHECKING:
    from wbc.core.signals import Measurement
    from wbc.walking.control import ReferenceControl

MIN_LOAD_SHARE = 0.005
"""Contacts that bear less than this share of the robot's weight are no corners of the support polygon."""

MAX_STEPS = 64
"""Footsteps of each kind that are drawn, the last ones, and of those to come."""

MAP_PERIOD = 0.5
"""Time from which on the map of the ground is drawn anew, s: it has thousands of cells."""


def sole_poses(places: RobotPlaces, data: mujoco.MjData) -> list[Array]:
    """Return the true poses of the soles, homogeneous."""
    poses = []
    for body, place in zip(places.feet, places.soles, strict=True):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
        poses.append(pose @ place.homogeneous)
    return poses


def drift_of(robot: SimulatedRobot, walking: ReferenceControl) -> Drift:
    """Return the present drift of a walk's estimate, as of one tick."""
    estimated = walking.control.observer.robot
    base = robot.data.xmat[robot.places.root].reshape(3, 3)
    turn = heading(base) - heading(estimated.placement(estimated.base_frame).rotation)
    feet = [[estimated.placement(sole.frame).translation for sole in estimated.soles]]
    true = [[pose[:3, 3] for pose in sole_poses(robot.places, robot.data)]]
    return Drift(np.array([turn]), np.mean(feet, axis=1), np.mean(true, axis=1))


class RunMarks:
    """Marks of all that a run has data for; footsteps, scans and map are kept from picture to picture."""

    def __init__(self, robot: SimulatedRobot, walking: ReferenceControl | None, scale: Scale) -> None:
        self._robot, self._walking, self._scale = robot, walking, scale
        self._plant = plant = robot if isinstance(robot, Plant) else None
        self._omega = natural_frequency(scale.height)
        feet = [] if plant is None else plant.feet
        self._sizes = [(s.length, s.width) for s in [f.fit.sole for f in feet] or robot.robot.soles]
        self._planned: dict[int, Mark] = {}
        self._real: dict[str, Mark] = {}
        self._standing: dict[str, int] = {}  # side → number of its stance
        self._stances = 0
        self._map_version, self._map_time, self._map = -1, -math.inf, np.empty((0, 3))
        self._sites = [] if plant is None else [plant.model.site(foot.range_site).id for foot in feet]
        self._hits: list[list[Array]] = [[] for _ in self._sites]
        self._swing: int | None = None
        self._springs: list[int] = []
        if plant is not None and all(foot.variable_joints for foot in feet):
            self._springs = [plant.model.joint(foot.variable_joints[0]).id for foot in feet]

    def draw(self, picture: Picture, measurement: Measurement | None) -> None:
        """Add marks and lines of text to a picture; the latest measurement has the rays of range sensors."""
        walking = self._walking
        if walking is not None:
            drift = drift_of(self._robot, walking)
            self._draw_footsteps(picture, walking, drift)
            self._draw_plans(picture, walking, drift)
            self._draw_ground(picture, walking, drift)
            self._draw_outside_force(picture, walking, drift)
        self._draw_support(picture)
        if self._springs:
            self._colour_soles(picture)
        if self._plant is not None:
            self._draw_rays(picture, self._plant, measurement)

    def _draw_support(self, picture: Picture) -> None:
        truth = self._robot.truth()
        points = truth.contact_position[truth.contact_force[:, 2] > MIN_LOAD_SHARE * self._scale.weight]
        level = float(np.mean(points[:, 2])) + LIFT if len(points) else 0.0
        if len(points):
            corners = convex_hull(points[:, :2])
            if len(corners) > 2:
                area = np.column_stack([corners, np.full(len(corners), level)])
                meaning = "support polygon: hull of the contacts"
                picture.marks.append(Mark("support", "area", area, SUPPORT_COLOUR, meaning=meaning))
        reference = None if self._walking is None else self._walking.reference
        omega = self._omega if reference is None else reference.pendulum.omega
        dcm = np.array([[*(truth.com[:2] + truth.com_velocity[:2] / omega), level]])
        picture.marks.append(Mark("dcm", "ball", dcm, DCM_COLOUR, POINT * self._scale.height, "DCM"))

    def _draw_plans(self, picture: Picture, walking: ReferenceControl, drift: Drift) -> None:
        if walking.reference is None:
            return
        pendulum, radius = walking.reference.pendulum, 1.6 * POINT * self._scale.height
        dcm = np.array([*pendulum.dcm[:2], pendulum.zmp[2]])
        for name, point, colour in (("ZMP", pendulum.zmp, ZMP_COLOUR), ("DCM", dcm, DCM_COLOUR)):
            ring = circle(drift(point, 0) + (0.0, 0.0, LIFT), radius)
            meaning = f"ring: {name} as planned"
            picture.marks.append(Mark(f"{name} planned", "line", ring, colour, meaning=meaning))

    def _draw_footsteps(self, picture: Picture, walking: ReferenceControl, drift: Drift) -> None:
        """Draw outlines of the planned footsteps, adjusted until they land, and areas of the real ones."""
        progress, soles = walking.progress, sole_poses(self._robot.places, self._robot.data)
        done = progress.steps_done
        self._planned = {i: mark for i, mark in self._planned.items() if done - MAX_STEPS <= i < done}
        for i, step in enumerate(progress.upcoming[:MAX_STEPS], start=done):
            size = self._sizes[SIDES.index(step.side)]
            corners = drift(sole_corners(*size, step.placement.homogeneous), 0)
            self._planned[i] = footstep(f"planned step {i}", step.side, corners, real=False)
        for side, pose, size in zip(SIDES, soles, self._sizes, strict=True):
            if side == progress.swing_side:
                self._standing.pop(side, None)
                continue
            if side not in self._standing:
                self._stances += 1
                self._standing[side] = self._stances
            name = f"real step {self._standing[side]}"
            self._real[name] = footstep(name, side, sole_corners(*size, pose), real=True)
        while len(self._real) > MAX_STEPS:
            del self._real[next(iter(self._real))]
        picture.marks += [*self._planned.values(), *self._real.values()]
        picture.text += [*walk_lines(walking), drift.text(0)]

    def _draw_outside_force(self, picture: Picture, walking: ReferenceControl, drift: Drift) -> None:
        """Draw the estimated force on the hands, with the weight of the load, at their middle."""
        observer, load = walking.control.observer, walking.load
        if observer.outside is None:
            return
        force, estimated = observer.outside.wrench[:3].copy(), observer.robot
        hands = [estimated.placement(frame).translation for frame in estimated.frames.values()]
        start = np.mean(hands, axis=0) if hands else np.array(estimated.com)
        if load is not None:
            force[2] -= load.applied * GRAVITY
            start = load.place
            picture.text.append(f"load {load.mass:.2f} kg")
        ends = drift(np.stack([start, start + force_reach(self._scale, force)]), 0)
        size, meaning = 0.012 * self._scale.height, "force on the hands, estimated"
        picture.marks.append(Mark("outside", "arrow", ends, OUTSIDE_COLOUR, size, meaning))

    def _draw_ground(self, picture: Picture, walking: ReferenceControl, drift: Drift) -> None:
        """Draw the cells of the ground that are known, and the fields of view of the depth cameras."""
        ground = walking.ground
        if ground is None:
            return
        if ground.version != self._map_version and not 0.0 <= picture.time - self._map_time < MAP_PERIOD:
            self._map_version, self._map_time = ground.version, picture.time
            self._map = drift(ground.map.known()[0], 0)
        if len(self._map):
            picture.marks.append(ground_mark(self._map))
        eyes = None if self._plant is None else self._plant.eyes
        for k, camera in enumerate([] if eyes is None else eyes.cameras):
            outline = camera.outline(0.3)
            picture.marks.append(Mark(f"camera {k}", "line", outline, FRUSTUM_COLOUR, meaning="depth camera"))

    def _colour_soles(self, picture: Picture) -> None:
        assert self._plant is not None
        stiffness = [float(self._plant.model.jnt_stiffness[joint]) for joint in self._springs]
        for bodies, value in zip(sole_bodies(self._plant), stiffness, strict=True):
            picture.colours |= dict.fromkeys(bodies, stiffness_colour(value))
        picture.text.append(stiffness_text(stiffness))

    def _draw_rays(self, picture: Picture, plant: Plant, measurement: Measurement | None) -> None:
        """Draw the rays of the range sensors, and the ground that each foot has scanned in its last swing."""
        swing = None if self._walking is None else self._walking.progress.swing
        if swing is not None and swing != self._swing:
            self._hits[swing] = []
        self._swing = swing
        ranges = None if measurement is None else measurement.sole_range
        for i, site in enumerate(self._sites):
            distance = math.nan if ranges is None else float(ranges[i])
            if math.isfinite(distance):
                start = plant.data.site_xpos[site].copy()
                end = start + distance * plant.data.site_xmat[site].reshape(3, 3)[:, 2]
                ray = np.stack([start, end])
                picture.marks.append(Mark(f"ray {i}", "line", ray, RAY_COLOUR, meaning="range ray"))
                if swing == i:
                    self._hits[i].append(end + (0.0, 0.0, LIFT))
            if len(self._hits[i]) > 1:
                line, meaning = np.array(self._hits[i]), "ground as scanned"
                picture.marks.append(Mark(f"scan {i}", "line", line, SCAN_COLOUR, 2.0 * LINE, meaning))


def sole_bodies(plant: Plant) -> list[list[int]]:
    """Return the bodies of each foot on hinges of variable stiffness; empty for a passive foot."""
    return [
        sorted({int(plant.model.joint(name).bodyid[0]) for name in foot.variable_joints})
        for foot in plant.feet
    ]


def stiffness_text(stiffness: list[float]) -> str:
    """Return the stiffness of both soles (Nm/rad) as text."""
    return "soles " + " and ".join(f"{value:.1f}" for value in stiffness) + " Nm/rad"


def walk_lines(walking: ReferenceControl) -> list[str]:
    """Return step, phase, DCM error and outcome of a walk as lines of text."""
    progress = walking.progress
    now = progress.phase.value
    if progress.swing_side is not None:
        now += f": {progress.swing_side} foot swings"
    if walking.steered:
        forward, left, turn = (unsigned_zero(value, 2) for value in walking.granted_velocity)
        lines = [
            f"step {progress.steps_done + 1}, {now}",
            f"granted {forward:.2f} m/s forward, {left:.2f} m/s left, {turn:.2f} rad/s",
        ]
    else:
        total = progress.steps_done + len(progress.upcoming)
        lines = [f"step {min(progress.steps_done + 1, total)} of {total}, {now}"]
    if walking.output is not None:
        error = walking.output.errors.dcm
        lines.append(f"DCM {1e3 * math.hypot(float(error[0]), float(error[1])):.0f} mm off its reference")
    if walking.fallen is not None:
        lines.append(f"FALLEN: {walking.fallen.name.lower()}")
    elif walking.finished and progress.steps_done and not walking.steered:
        lines.append("finished")
    return lines


def unsigned_zero(value: float, digits: int) -> float:
    """Return a number rounded to some digits, without the sign of a zero."""
    return round(value, digits) + 0.0
