"""Layer of the footsteps of a walk, with its phase and step as text."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from wbc.app.scene.colours import FOOTSTEP_LEGEND, SIDE_COLOURS, translucent
from wbc.app.scene.layer import Annotations, Layer
from wbc.app.scene.marks import LIFT, LINE, outline, polygon, rectangle, ribbon, ribbon_edges
from wbc.app.scene.shapes import HIDDEN, ROOT, Colour
from wbc.core.errors import Array
from wbc.core.robot import SIDES
from wbc.walking.planning.footsteps import Footstep, heading, other

if TYPE_CHECKING:
    from wbc.sim import Plant
    from wbc.walking.control import ReferenceControl

MAX_STEPS = 128
"""Largest number of footsteps of each kind; of a longer walk the last ones, and half as many to come."""

PATH_POINTS, PATH_MARKS, PATH_SPACING = 512, 128, 0.04
"""Points of the path that are kept and that are drawn, and the distance between them, m."""

PATH_COLOUR: Colour = (0.25, 0.25, 0.3, 0.8)

DRIVEN_STEPS = 32
"""Number of footsteps of each kind of a walk that is steered."""


class FootstepsLayer(Layer):
    """Footsteps: outlines of the planned ones (adjusted until they land), filled areas of the real ones.

    Both have the same indices: 0 is the first swing foot, 1 the first stance foot, 2 the first landing.
    """

    def __init__(self, plant: Plant, walking: ReferenceControl) -> None:
        """Make marks for all steps, and for one that a stop may add."""
        super().__init__()
        self._plant, self._walking = plant, walking
        progress = walking.progress
        steps = progress.steps_done + len(progress.upcoming)
        # A robot that is steered goes to places that are not known yet.
        self._count = DRIVEN_STEPS if walking.steered else min(MAX_STEPS, 2 * ((steps + 4) // 2))
        # In longer walks the marks are reused.
        self._ahead = self._count if self._count >= steps + 3 else self._count // 2
        self._sites = list(plant.sole_sites)
        soles = [rectangle(foot.fit.sole.length, foot.fit.sole.width) for foot in plant.feet]
        first = progress.upcoming[0].side if progress.upcoming else SIDES[0]
        self._planned, self._real = [], []
        for i in range(self._count):
            side = first if i % 2 == 0 else other(first)
            corners, colour = soles[SIDES.index(side)], SIDE_COLOURS[side]
            self._planned.append(self.add(f"footsteps/planned_{i}", outline(corners), colour, on_top=True))
            self._real.append(self.add(f"footsteps/real_{i}", polygon(corners), translucent(colour)))
        self.legend = FOOTSTEP_LEGEND
        self._path: deque[Array] | None = None
        if walking.steered:
            self._path = deque(maxlen=PATH_POINTS)
            self.add("footsteps/path", ribbon(np.zeros((2 * PATH_MARKS, 3))), PATH_COLOUR, deformable=True)
            self.legend = (*FOOTSTEP_LEGEND, ("path of the robot", PATH_COLOUR))
        self._planned_at = np.tile(HIDDEN, (self._count, 1, 1))
        self._real_at = self._planned_at.copy()
        self._first, robot = first, walking.controller.robot
        soles_now = dict(zip(SIDES, (robot.placement(sole.frame) for sole in robot.soles), strict=True))
        start = [Footstep.of(side, soles_now[side]) for side in (first, other(first))]
        self._start = np.array([_mark(foot) for foot in start])
        self._skipped = 0  # indices left out where a side has stepped twice, with a stand between
        self._end = 0
        self._upcoming: tuple[Footstep, ...] = ()
        self._marks = np.empty((0, 4, 4))  # of these, in the world of the estimate

    def fill(self, matrices: Array, annotations: Annotations) -> None:  # noqa: D102
        progress = self._walking.progress
        side = progress.swing_side or (progress.upcoming[0].side if progress.upcoming else None)
        if side is not None and side != self._side(progress.steps_done + self._skipped):
            self._skipped += 1
        present = progress.steps_done + self._skipped  # index of the foot that swings, or swings next
        if self._upcoming != progress.upcoming:
            self._upcoming = progress.upcoming
            marks = [_mark(foot) for foot in progress.upcoming[: self._ahead]]
            self._marks = np.array(marks).reshape(-1, 4, 4)
        drift, end = drift_of(self._plant, self._walking), present + 2 + len(self._marks)
        self._planned_at[np.arange(end, self._end) % self._count] = HIDDEN  # a stop has shortened the plan
        self._planned_at[np.arange(present + 2, end) % self._count] = drift @ self._marks  # landed ones stay
        if present == 0:
            self._planned_at[:2] = drift @ self._start
        self._end = end
        for i in (present + 1,) if progress.swing is not None else (present, present + 1):
            self._real_at[i % self._count] = self._pose(self._side(i))
        matrices[self._planned], matrices[self._real] = self._planned_at, self._real_at
        annotations.text += walk_lines(self._walking)
        feet = np.mean(self._plant.data.site_xpos[self._sites], axis=0)
        off = float(np.linalg.norm((np.linalg.inv(drift) @ [*feet, 1.0])[:2] - feet[:2]))
        turn = math.degrees(heading(drift[:3, :3]))
        annotations.text.append(f"estimate {1e3 * off:.0f} mm and {turn:+.1f}° off")
        if self._path is not None:
            self._follow(self._path, annotations)

    def _follow(self, path: deque[Array], annotations: Annotations) -> None:
        """Draw the way of the middle between the feet."""
        middle = np.mean(self._plant.data.site_xpos[self._sites], axis=0) + (0.0, 0.0, LIFT)
        if not path or float(np.linalg.norm(middle - path[-1])) > PATH_SPACING:
            path.append(middle)
            annotations.shapes[f"{ROOT}/footsteps/path"] = ribbon_edges(
                np.array(path), 2.0 * LINE, PATH_MARKS
            )

    def _side(self, index: int) -> str:
        """Return the side of the foot with an index."""
        return self._first if index % 2 == 0 else other(self._first)

    def _pose(self, side: str) -> Array:
        """Return the real placement of a sole."""
        site, data = self._sites[SIDES.index(side)], self._plant.data
        pose = np.eye(4)
        pose[:3, :3] = data.site_xmat[site].reshape(3, 3)
        pose[:3, 3] = data.site_xpos[site] + LIFT * pose[:3, 2]
        return pose


def drift_of(plant: Plant, walking: ReferenceControl) -> Array:
    """Return where the estimate's world, in which steps are planned, lies: by the feet and the heading of the base.

    Returns:
        Homogeneous, shape (4, 4), m.
    """
    robot, data = walking.control.observer.robot, plant.data
    base = robot.placement(robot.base_frame).rotation
    turn = heading(data.xmat[plant.model.jnt_bodyid[0]].reshape(3, 3)) - heading(base)
    drift = np.eye(4)
    drift[:2, :2] = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    middle = np.mean([robot.placement(sole.frame).translation for sole in robot.soles], axis=0)
    drift[:3, 3] = np.mean(data.site_xpos[list(plant.sole_sites)], axis=0) - drift[:3, :3] @ middle
    return drift


def walk_lines(walking: ReferenceControl) -> list[str]:
    """Return step, phase, DCM error and outcome of a walk as lines of text."""
    progress = walking.progress
    total = progress.steps_done + len(progress.upcoming)
    now = progress.phase.value
    if progress.swing_side is not None:
        now += f": {progress.swing_side} foot swings"
    lines = [f"step {min(progress.steps_done + 1, total)} of {total}, {now}"]
    if walking.steered:
        forward, left, turn = walking.granted_velocity
        lines = [
            f"step {progress.steps_done + 1}, {now}",
            f"granted {forward:.2f} m/s forward, {left:.2f} m/s left, {turn:.2f} rad/s",
        ]
    if walking.output is not None:
        error = walking.output.errors.dcm
        lines.append(f"DCM {1e3 * math.hypot(float(error[0]), float(error[1])):.0f} mm off its reference")
    if walking.fallen is not None:
        lines.append(f"FALLEN: {walking.fallen.name.lower()}")
    elif walking.finished and progress.steps_done and not walking.steered:
        lines.append("finished")
    return lines


def _mark(step: Footstep) -> Array:
    pose: Array = np.array(step.placement.homogeneous)
    pose[:3, 3] += LIFT * pose[:3, 2]
    return pose
