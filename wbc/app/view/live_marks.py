"""Marks and text of a run: balance, footsteps and plans of a walk, outside force, soles, range sensors."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from wbc.app.view.marks import (
    DCM_COLOUR,
    FRUSTUM_COLOUR,
    LIFT,
    LINE,
    OUTSIDE_COLOUR,
    PATH_COLOUR,
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
from wbc.walking.plans.footsteps import Footstep, heading

if TYPE_CHECKING:
    from wbc.core.signals import Measurement
    from wbc.ground import KnownGround
    from wbc.walking.control import ReferenceControl

MIN_LOAD_SHARE = 0.005
"""Contacts that bear less than this share of the robot's weight are no corners of the support polygon."""

MAX_STEPS = 64
"""Footsteps of each kind that are drawn, the last ones, and of those to come."""

PATH_POINTS, PATH_SPACING = 128, 0.04
"""Points of the path that are drawn, and the distance between them, m."""

MAP_PERIOD = 0.5
"""Time from which on the map of the ground is drawn anew, s: it has thousands of cells."""

Draw = Callable[[Picture, "Measurement | None"], None]
"""Function that adds its marks, and lines of text, to a picture; the latest measurement is None without one."""


def live_marks(robot: SimulatedRobot, walking: ReferenceControl | None, scale: Scale) -> list[Draw]:
    """Return what a run has data for."""
    draws: list[Draw] = [_Support(robot, walking, scale)]
    if walking is not None:
        draws = [_Footsteps(robot, walking), *draws, _Plans(robot, walking, scale)]
        if walking.ground is not None:
            draws.append(_Ground(robot, walking, walking.ground))
        if walking.control.observer.outside is not None:
            draws.append(_OutsideForce(robot, walking, scale))
    if isinstance(robot, Plant):
        if all(foot.variable_joints for foot in robot.feet):
            draws.append(_Soles(robot, walking))
        draws.append(_Rays(robot, walking))
    return draws


def sole_poses(places: RobotPlaces, data: mujoco.MjData) -> list[Array]:
    """Return the true poses of the soles, homogeneous."""
    poses = []
    for body, place in zip(places.feet, places.soles, strict=True):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
        poses.append(pose @ place.homogeneous)
    return poses


def drift_of(robot: SimulatedRobot, walking: ReferenceControl) -> Array:
    """Return where the world of the estimate and the plans lies, shape (4, 4), m: by feet and heading of the base."""
    estimated = walking.control.observer.robot
    base = robot.data.xmat[robot.places.root].reshape(3, 3)
    turn = heading(base) - heading(estimated.placement(estimated.base_frame).rotation)
    drift = np.eye(4)
    drift[:2, :2] = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    middle = np.mean([estimated.placement(sole.frame).translation for sole in estimated.soles], axis=0)
    true = np.mean([pose[:3, 3] for pose in sole_poses(robot.places, robot.data)], axis=0)
    drift[:3, 3] = true - drift[:3, :3] @ middle
    return drift


def moved(drift: Array, point: Array) -> Array:
    """Return a point of the estimate's world in the true one, shape (3,), m."""
    return np.asarray(drift[:3, :3] @ point + drift[:3, 3])


class _Support:
    """True DCM and support polygon."""

    def __init__(self, robot: SimulatedRobot, walking: ReferenceControl | None, scale: Scale) -> None:
        self._robot, self._walking, self._scale = robot, walking, scale
        self._omega = natural_frequency(scale.height)

    def __call__(self, picture: Picture, measurement: Measurement | None) -> None:
        truth = self._robot.truth()
        load = truth.contact_force[:, 2]
        points = truth.contact_position[load > MIN_LOAD_SHARE * self._scale.weight]
        level = 0.0
        if len(points):
            level = float(np.mean(points[:, 2])) + LIFT
            corners = convex_hull(points[:, :2])
            if len(corners) > 2:
                area = np.column_stack([corners, np.full(len(corners), level)])
                meaning = "support polygon: hull of the contacts"
                picture.marks.append(Mark("support", "area", area, SUPPORT_COLOUR, meaning=meaning))
        reference = None if self._walking is None else self._walking.reference
        omega = self._omega if reference is None else reference.pendulum.omega
        dcm = truth.com[:2] + truth.com_velocity[:2] / omega
        size = POINT * self._scale.height
        picture.marks.append(Mark("dcm", "ball", np.array([[*dcm, level]]), DCM_COLOUR, size, "DCM"))


class _Plans:
    """ZMP and DCM as planned: rings."""

    def __init__(self, robot: SimulatedRobot, walking: ReferenceControl, scale: Scale) -> None:
        self._robot, self._walking, self._radius = robot, walking, 1.6 * POINT * scale.height

    def __call__(self, picture: Picture, measurement: Measurement | None) -> None:
        reference = self._walking.reference
        if reference is None:
            return
        drift, (zmp, dcm) = (
            drift_of(self._robot, self._walking),
            (reference.pendulum.zmp, reference.pendulum.dcm),
        )
        for name, point, colour in (("ZMP", zmp, ZMP_COLOUR), ("DCM", (*dcm[:2], zmp[2]), DCM_COLOUR)):
            ring = circle(moved(drift, np.asarray(point)) + (0.0, 0.0, LIFT), self._radius)
            picture.marks.append(
                Mark(f"{name} planned", "line", ring, colour, meaning=f"ring: {name} as planned")
            )


class _Footsteps:
    """Footsteps: outlines of the planned ones, adjusted until they land, areas of the real ones; phase and step."""

    def __init__(self, robot: SimulatedRobot, walking: ReferenceControl) -> None:
        self._robot, self._walking = robot, walking
        soles = [foot.fit.sole for foot in robot.feet] if isinstance(robot, Plant) else robot.robot.soles
        self._sizes = [(sole.length, sole.width) for sole in soles]
        self._planned: dict[int, Mark] = {}
        self._real: deque[Mark] = deque(maxlen=MAX_STEPS)
        self._standing: dict[str, int] = {}  # side -> number of its stance
        self._stances = 0
        self._path: deque[Array] = deque(maxlen=PATH_POINTS)

    def __call__(self, picture: Picture, measurement: Measurement | None) -> None:
        walking, drift = self._walking, drift_of(self._robot, self._walking)
        progress, soles = walking.progress, sole_poses(self._robot.places, self._robot.data)
        done = progress.steps_done
        ahead = {
            done + i: self._plan(done + i, step, drift)
            for i, step in enumerate(progress.upcoming[:MAX_STEPS])
        }
        landed = {i: mark for i, mark in self._planned.items() if done - MAX_STEPS <= i < done}
        self._planned = landed | ahead  # landed ones stay where they were drawn
        now = []
        for side, pose, size in zip(SIDES, soles, self._sizes, strict=True):
            if side == progress.swing_side:
                self._standing.pop(side, None)
                continue
            if side not in self._standing:
                self._stances += 1
                self._standing[side] = self._stances
            now.append(
                footstep(f"real step {self._standing[side]}", side, sole_corners(*size, pose), real=True)
            )
        self._real = deque(
            (mark for mark in self._real if mark.name not in {each.name for each in now}), MAX_STEPS
        )
        self._real.extend(now)
        picture.marks += [*self._planned.values(), *self._real]
        middle = np.asarray(np.mean([pose[:3, 3] for pose in soles], axis=0), dtype=np.float64)
        picture.text += walk_lines(walking)
        back = np.asarray(np.linalg.inv(drift), dtype=np.float64)
        off, turn = (
            float(np.linalg.norm((moved(back, middle) - middle)[:2])),
            math.degrees(heading(drift[:3, :3])),
        )
        picture.text.append(f"estimate {1e3 * off:.0f} mm and {unsigned_zero(turn, 1):+.1f}° off")
        if walking.steered:
            if not self._path or float(np.linalg.norm(middle - self._path[-1])) > PATH_SPACING:
                self._path.append(middle + (0.0, 0.0, LIFT))
            if len(self._path) > 1:
                line = np.array(self._path)
                picture.marks.append(Mark("path", "line", line, PATH_COLOUR, 2.0 * LINE, "path of the robot"))

    def _plan(self, number: int, step: Footstep, drift: Array) -> Mark:
        size = self._sizes[SIDES.index(step.side)]
        corners = sole_corners(*size, drift @ step.placement.homogeneous)
        return footstep(f"planned step {number}", step.side, corners, real=False)


class _OutsideForce:
    """Outside force as estimated, with the weight of the load in the models, at the middle of the hands."""

    def __init__(self, robot: SimulatedRobot, walking: ReferenceControl, scale: Scale) -> None:
        self._robot, self._walking, self._scale = robot, walking, scale

    def __call__(self, picture: Picture, measurement: Measurement | None) -> None:
        observer, load = self._walking.control.observer, self._walking.load
        if observer.outside is None:
            return
        force, estimated = observer.outside.wrench[:3].copy(), observer.robot
        hands = [estimated.placement(frame).translation for frame in estimated.frames.values()]
        start = np.mean(hands, axis=0) if hands else np.array(estimated.com)
        if load is not None:
            force[2] -= load.applied * GRAVITY
            start = load.place
            picture.text.append(f"load {load.mass:.2f} kg")
        drift, end = drift_of(self._robot, self._walking), start + force_reach(self._scale, force)
        ends = np.stack([moved(drift, start), moved(drift, end)])
        size, meaning = 0.012 * self._scale.height, "force on the hands, estimated"
        picture.marks.append(Mark("outside", "arrow", ends, OUTSIDE_COLOUR, size, meaning))


class _Soles:
    """Colour of soles of variable stiffness."""

    def __init__(self, plant: Plant, walking: ReferenceControl | None) -> None:
        self._model, self._walking = plant.model, walking
        self._springs = [plant.model.joint(foot.variable_joints[0]).id for foot in plant.feet]
        self._bodies = sole_bodies(plant)

    def __call__(self, picture: Picture, measurement: Measurement | None) -> None:
        stiffness = [float(self._model.jnt_stiffness[joint]) for joint in self._springs]
        for bodies, value in zip(self._bodies, stiffness, strict=True):
            picture.colours |= dict.fromkeys(bodies, stiffness_colour(value))
        picture.text.append(stiffness_text(stiffness))
        scheduler = None if self._walking is None else self._walking.stiffness
        if scheduler is not None and scheduler.steps:
            last = scheduler.steps[-1]
            reason = last.fallback or "as decided"
            picture.text.append(f"{last.side} foot landed on {last.actual:.1f} Nm/rad ({reason})")


class _Ground:
    """Cells of the ground that are known, and the fields of view of the depth cameras."""

    def __init__(self, robot: SimulatedRobot, walking: ReferenceControl, ground: KnownGround) -> None:
        self._robot, self._walking, self._ground = robot, walking, ground
        self._version, self._points, self._drawn = -1, np.empty((0, 3)), -math.inf
        eyes = robot.eyes if isinstance(robot, Plant) else None
        self._cameras = [] if eyes is None else eyes.cameras

    def __call__(self, picture: Picture, measurement: Measurement | None) -> None:
        if self._ground.version != self._version and not 0.0 <= picture.time - self._drawn < MAP_PERIOD:
            self._drawn = picture.time
            self._version, (points, _) = self._ground.version, self._ground.map.known()
            drift = drift_of(self._robot, self._walking)
            self._points = np.asarray(points @ drift[:3, :3].T + drift[:3, 3])
        if len(self._points):
            picture.marks.append(ground_mark(self._points))
        for k, camera in enumerate(self._cameras):
            line = camera.outline(0.3)
            picture.marks.append(Mark(f"camera {k}", "line", line, FRUSTUM_COLOUR, meaning="depth camera"))


class _Rays:
    """Rays of the range sensors, and the ground that the swing foot has scanned so far.

    After the landing, the profile on which the stiffness was decided replaces the scanned points.
    """

    def __init__(self, plant: Plant, walking: ReferenceControl | None) -> None:
        self._plant, self._walking = plant, walking
        self._sites = [plant.model.site(foot.range_site).id for foot in plant.feet]
        self._hits: list[list[Array]] = [[] for _ in self._sites]
        self._swing: int | None = None
        self._steps = 0

    def __call__(self, picture: Picture, measurement: Measurement | None) -> None:
        self._follow_walk()
        measured, data = None if measurement is None else measurement.sole_range, self._plant.data
        for i, site in enumerate(self._sites):
            distance = math.nan if measured is None else float(measured[i])
            if math.isfinite(distance):
                start = data.site_xpos[site].copy()
                end = start + distance * data.site_xmat[site].reshape(3, 3)[:, 2]
                ray = np.stack([start, end])
                picture.marks.append(Mark(f"ray {i}", "line", ray, RAY_COLOUR, meaning="range ray"))
                if self._swing == i:
                    self._hits[i].append(end + (0.0, 0.0, LIFT))
            if len(self._hits[i]) > 1:
                line = np.array(self._hits[i])
                picture.marks.append(
                    Mark(f"scan {i}", "line", line, SCAN_COLOUR, 2.0 * LINE, "ground as scanned")
                )

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
                self._hits[SIDES.index(last.side)] = [moved(drift, point) for point in last.profile.points]
            self._steps = last.step + 1


def sole_bodies(plant: Plant) -> list[list[int]]:
    """Return the bodies of each foot on hinges of variable stiffness; empty for a passive foot."""
    return [
        sorted({int(plant.model.joint(name).bodyid[0]) for name in foot.variable_joints})
        for foot in plant.feet
    ]


def stiffness_text(stiffness: Iterable[float]) -> str:
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
