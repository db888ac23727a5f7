"""Marks and text of a walk that goes on: footsteps, plans, force on the hands, scans and the ground as known."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from wbc.app.drift import Drift, sole_corners
from wbc.app.view.marks import (
    Force,
    Mark,
    Picture,
    Scale,
    force_marks,
    ground_mark,
    planned_step,
    real_step,
    scan_mark,
    walk_text,
)
from wbc.base.numbers import Array
from wbc.core.frames import heading
from wbc.core.robot import GRAVITY, SIDES
from wbc.sim.plant.mujoco_robot import MujocoRobot
from wbc.sim.plant.places import RobotPlaces
from wbc.sim.plant.plant import Plant

if TYPE_CHECKING:
    from wbc.walking.control import WalkingControl

MAX_STEPS = 64
"""Footsteps of each kind that are drawn, the last ones, and of those to come."""

MAP_PERIOD = 0.5
"""Time from which on the map of the ground is drawn anew, s: it has thousands of cells."""


class WalkMarks:
    """Marks of a walk, in the true world; footsteps, scans and map are kept from picture to picture."""

    def __init__(self, robot: MujocoRobot, walking: WalkingControl, scale: Scale) -> None:
        self._robot, self._walking, self._scale = robot, walking, scale
        feet = robot.feet if isinstance(robot, Plant) else ()
        self._sizes = [(s.length, s.width) for s in [f.fit.sole for f in feet] or robot.robot.soles]
        self._planned: dict[int, Mark] = {}
        self._real: dict[int, Mark] = {}
        self._standing: dict[str, int] = {}  # side → number of its stance
        self._stances = 0
        self._scans, self._scan = deque[Mark](maxlen=MAX_STEPS), 0
        self._scanned: object = None  # last step of the scheduler that has been looked at
        self._map_version, self._map_time, self._map = -1, -math.inf, np.empty((0, 3))

    def add(self, picture: Picture) -> None:
        """Add the walk to a picture: phase, plans, footsteps, scans, map, and the estimated force on the hands."""
        walking = self._walking
        drift = drift_of(self._robot, walking)
        self._add_footsteps(picture, drift)
        if walking.reference is not None:
            pendulum = walking.reference.pendulum
            dcm = np.array([*pendulum.dcm[:2], pendulum.zmp[2]])
            picture.add_planned(self._scale, {"ZMP": drift(pendulum.zmp, 0), "DCM": drift(dcm, 0)})
        self._add_ground(picture, drift)
        if (outside := outside_force(walking)) is not None:
            force, start = outside
            ends = drift(np.stack([start, start + force]), 0)
            picture.marks += force_marks(self._scale, [Force("outside", ends[0], ends[1] - ends[0])])
        progress = walking.progress
        phase = walk_text(progress.phase.value, progress.swing_side, progress.steps_done)
        picture.text += [phase, drift.text(0)]

    def _add_footsteps(self, picture: Picture, drift: Drift) -> None:
        """Add outlines of the planned footsteps, adjusted until they land, and areas of the real ones."""
        progress, soles = self._walking.progress, sole_poses(self._robot.places, self._robot.data)
        done = progress.steps_done
        self._planned = {i: mark for i, mark in self._planned.items() if done - MAX_STEPS <= i < done}
        for i, step in enumerate(progress.upcoming[:MAX_STEPS], start=done):
            place = step.placement
            corners = sole_corners(self._sizes[SIDES.index(step.side)], place.translation, place.rotation)
            self._planned[i] = planned_step(i, step.side, drift(corners, 0))
        for side, pose, size in zip(SIDES, soles, self._sizes, strict=True):
            if side == progress.swing_side:
                self._standing.pop(side, None)
                continue
            if side not in self._standing:
                self._standing[side] = self._stances
                self._stances += 1
            number = self._standing[side]
            self._real[number] = real_step(number, side, sole_corners(size, pose[:3, 3], pose[:3, :3]))
        while len(self._real) > MAX_STEPS:
            del self._real[next(iter(self._real))]
        picture.marks += [*self._planned.values(), *self._real.values()]

    def _add_ground(self, picture: Picture, drift: Drift) -> None:
        """Add what range sensors have scanned in each swing, and the cells of the ground that are known."""
        soles, ground = self._walking.stiffness, self._walking.ground
        if soles is not None and soles.steps and soles.steps[-1] is not self._scanned:
            self._scanned, profile = soles.steps[-1], soles.steps[-1].profile
            if profile is not None:
                self._scans.append(scan_mark(self._scan, drift(profile.points, 0)))
                self._scan += 1
        picture.marks += self._scans
        if ground is None:
            return
        if ground.version != self._map_version and not 0.0 <= picture.time - self._map_time < MAP_PERIOD:
            self._map_version, self._map_time = ground.version, picture.time
            self._map = drift(ground.map.known()[0], 0)
        if len(self._map):
            picture.marks.append(ground_mark(self._map))


def outside_force(walking: WalkingControl) -> tuple[Array, Array] | None:
    """Return the estimated force on the hands with the weight of the load, N, and its place, m; None without one."""
    observer, load = walking.drives.observer, walking.load
    estimated = observer.robot
    if observer.outside is None:
        return None
    force = observer.outside.wrench[:3].copy()
    if load is not None:
        force[2] -= load.applied * GRAVITY
        return force, load.place
    hands = [estimated.placement(frame).translation for frame in estimated.frames.values()]
    return force, np.mean(hands, axis=0) if hands else np.array(estimated.com)


def sole_poses(places: RobotPlaces, data: mujoco.MjData) -> list[Array]:
    """Return the true poses of the soles, homogeneous."""
    poses = []
    for body, place in zip(places.feet, places.soles, strict=True):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
        poses.append(pose @ place.homogeneous)
    return poses


def drift_of(robot: MujocoRobot, walking: WalkingControl) -> Drift:
    """Return the present drift of a walk's estimate, as of one tick."""
    estimated = walking.drives.observer.robot
    base = robot.data.xmat[robot.places.root].reshape(3, 3)
    turn = heading(base) - heading(estimated.placement(estimated.base_frame).rotation)
    feet = [[estimated.placement(sole.frame).translation for sole in estimated.soles]]
    true = [[pose[:3, 3] for pose in sole_poses(robot.places, robot.data)]]
    return Drift(np.array([turn]), np.mean(feet, axis=1), np.mean(true, axis=1))
