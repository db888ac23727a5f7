"""Layer of the footsteps of a walk, with its phase and step as text."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from wbc.app.scene.colours import FOOTSTEP_LEGEND, SIDE_COLOURS, translucent
from wbc.app.scene.layer import Annotations, Layer
from wbc.app.scene.marks import LIFT, LINE, outline, polygon, rectangle, ribbon, ribbon_edges
from wbc.app.scene.shapes import ROOT, Colour
from wbc.core.errors import Array
from wbc.core.robot import SIDES
from wbc.walking.planning.footsteps import Footstep, heading, other

if TYPE_CHECKING:
    from wbc.sim import Plant
    from wbc.walking.control import ReferenceControl

MAX_STEPS = 128
"""Largest number of footsteps of each kind that are drawn, the last ones; half as many of those to come."""

PATH_POINTS, PATH_MARKS, PATH_SPACING = 512, 128, 0.04
"""Points of the path that are kept and that are drawn, and the distance between them, m."""

PATH_COLOUR: Colour = (0.25, 0.25, 0.3, 0.8)

DRIVEN_STEPS = 32
"""Number of footsteps of each kind of a walk that is steered."""


class FootstepsLayer(Layer):
    """Footsteps: outlines of the planned ones (adjusted until they land), filled areas of the real ones."""

    def __init__(self, plant: Plant, walking: ReferenceControl) -> None:
        """Make marks for all steps, and for one that a stop may add; in longer walks they are reused."""
        super().__init__()
        self._plant, self._walking = plant, walking
        progress = walking.progress
        steps = progress.steps_done + len(progress.upcoming)
        # A robot that is steered goes to places that are not known yet.
        count = DRIVEN_STEPS if walking.steered else min(MAX_STEPS, 2 * ((steps + 4) // 2))
        self._sites = list(plant.sole_sites)
        soles = [rectangle(foot.fit.sole.length, foot.fit.sole.width) for foot in plant.feet]
        first = progress.upcoming[0].side if progress.upcoming else SIDES[0]
        self._planned: dict[str, list[int]] = {side: [] for side in SIDES}
        self._real: dict[str, list[int]] = {side: [] for side in SIDES}
        for i in range(count):
            side = first if i % 2 == 0 else other(first)
            corners, colour = soles[SIDES.index(side)], SIDE_COLOURS[side]
            planned = self.add(f"footsteps/planned_{i}", outline(corners), colour, on_top=True)
            self._planned[side].append(planned)
            self._real[side].append(self.add(f"footsteps/real_{i}", polygon(corners), translucent(colour)))
        self.legend = FOOTSTEP_LEGEND
        self._path: deque[Array] | None = None
        if walking.steered:
            self._path = deque(maxlen=PATH_POINTS)
            self.add("footsteps/path", ribbon(np.zeros((2 * PATH_MARKS, 3))), PATH_COLOUR, deformable=True)
            self.legend = (*FOOTSTEP_LEGEND, ("path of the robot", PATH_COLOUR))
        robot = walking.controller.robot
        soles_now = dict(zip(SIDES, (robot.placement(sole.frame) for sole in robot.soles), strict=True))
        self._start = [Footstep.of(side, soles_now[side]) for side in (first, other(first))]
        self._steps = progress.steps_done
        self._ahead: list[tuple[str, Array]] = []  # steps to come, as they were drawn last
        self._landed, self._stood = (
            {side: deque[Array](maxlen=count // 2) for side in SIDES} for _ in range(2)
        )
        self._standing: set[str] = set()

    def fill(self, matrices: Array, annotations: Annotations) -> None:  # noqa: D102
        progress, drift = self._walking.progress, drift_of(self._plant, self._walking)
        taken = progress.steps_done - self._steps
        if taken > 0:  # landed ones stay where they were drawn
            for side, mark in self._ahead[: taken + (len(self._start) if self._steps == 0 else 0)]:
                self._landed[side].append(mark)
        self._steps = progress.steps_done
        ahead = [*(() if self._steps else self._start), *progress.upcoming[: MAX_STEPS // 2]]
        self._ahead = [(step.side, drift @ _mark(step)) for step in ahead]
        for side, site in zip(SIDES, self._sites, strict=True):
            if side == progress.swing_side:
                self._standing.discard(side)
            else:
                if side in self._standing and taken < 2:
                    self._stood[side].pop()
                self._standing.add(side)
                self._stood[side].append(self._pose(site))
            planned = [*self._landed[side], *(mark for of, mark in self._ahead if of == side)]
            for places, marks in ((self._planned[side], planned), (self._real[side], [*self._stood[side]])):
                for place, mark in zip(places, marks[-len(places) :], strict=False):
                    matrices[place] = mark
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

    def _pose(self, site: int) -> Array:
        """Return the real placement of a sole."""
        data, pose = self._plant.data, np.eye(4)
        pose[:3, :3] = data.site_xmat[site].reshape(3, 3)
        pose[:3, 3] = data.site_xpos[site] + LIFT * pose[:3, 2]
        return pose


def drift_of(plant: Plant, walking: ReferenceControl) -> Array:
    """Return where the world of the estimate and the plans lies, shape (4, 4), m: by feet and heading of the base."""
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
