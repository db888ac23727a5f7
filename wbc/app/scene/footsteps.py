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
from wbc.walking.planning.footsteps import SIDES, Footstep, FootstepPlan, other

if TYPE_CHECKING:
    from wbc.sim import Plant
    from wbc.walking.control import WalkingControl

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

    def __init__(self, plant: Plant, walking: WalkingControl) -> None:
        """Make marks for all steps, and for one that a stop may add.

        Args:
            plant: The plant.
            walking: The controller.
        """
        super().__init__()
        self._plant, self._walking = plant, walking
        plan = walking.walk.phases.plan
        # A robot that stands may be steered: to places that are not known yet.
        self._count = min(MAX_STEPS, 2 * ((len(plan) + 4) // 2)) if len(plan) else DRIVEN_STEPS
        # In longer walks the marks are reused.
        self._ahead = self._count if self._count >= len(plan) + 3 else self._count // 2
        self._sites = [plant.model.site(foot.wrench_site).id for foot in plant.feet]
        soles = [rectangle(foot.fit.sole.length, foot.fit.sole.width) for foot in plant.feet]
        first = plan.steps[0].side if plan.steps else SIDES[0]
        self._planned, self._real = [], []
        for i in range(self._count):
            side = first if i % 2 == 0 else other(first)
            corners, colour = soles[SIDES.index(side)], SIDE_COLOURS[side]
            self._planned.append(self.add(f"footsteps/planned_{i}", outline(corners), colour, on_top=True))
            self._real.append(self.add(f"footsteps/real_{i}", polygon(corners), translucent(colour)))
        self.legend = FOOTSTEP_LEGEND
        self._path: deque[Array] | None = None
        if not len(plan):
            self._path = deque(maxlen=PATH_POINTS)
            self.add("footsteps/path", ribbon(np.zeros((2 * PATH_MARKS, 3))), PATH_COLOUR, deformable=True)
            self.legend = (*FOOTSTEP_LEGEND, ("path of the robot", PATH_COLOUR))
        self._planned_at = np.tile(HIDDEN, (self._count, 1, 1))
        self._real_at = np.tile(HIDDEN, (self._count, 1, 1))
        self._first = first
        self._offset = self._skipped = (
            0  # indices left out where a side has stepped twice, with a stand between
        )
        self._end, self._step = 0, -1
        self._plan: FootstepPlan | None = None
        self._feet: list[Footstep] = []

    def fill(self, matrices: Array, annotations: Annotations) -> None:  # noqa: D102
        phases = self._walking.walk.phases
        step = phases.step
        if phases.plan is not self._plan or step != self._step:  # plans are replaced, never changed
            self._plan, self._step, self._feet = phases.plan, step, all_feet(phases.plan)
            forgotten = phases.completed - step  # steps that a walk that is steered has forgotten
            if (forgotten + self._skipped) % 2 != (self._feet[0].side != self._first):
                self._skipped += 1
            self._offset = forgotten + self._skipped
            self._mark_plan(self._feet, step)
        for i in (step + 1,) if phases.swing is not None else (step, step + 1):
            self._real_at[(i + self._offset) % self._count] = self._pose(self._feet[i].side)
        matrices[self._planned], matrices[self._real] = self._planned_at, self._real_at
        annotations.text += walk_lines(self._walking)
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

    def _mark_plan(self, feet: list[Footstep], step: int) -> None:
        """Move the marks of future steps to their planned placements.

        Args:
            feet: All feet of the plan.
            step: Index of the present or next step.
        """
        # The marks of landed feet stay: the plan then holds the real landings.
        offset = self._offset
        future = range(step + 2 if step + offset else 0, min(len(feet), step + 2 + self._ahead))
        for i in future:
            self._planned_at[(i + offset) % self._count] = _mark(feet[i])
        for i in range(future.stop + offset, self._end):
            self._planned_at[i % self._count] = HIDDEN  # a stop has shortened the plan
        self._end = future.stop + offset

    def _pose(self, side: str) -> Array:
        """Return the real placement of a sole."""
        site, data = self._sites[SIDES.index(side)], self._plant.data
        pose = np.eye(4)
        pose[:3, :3] = data.site_xmat[site].reshape(3, 3)
        pose[:3, 3] = data.site_xpos[site] + LIFT * pose[:3, 2]
        return pose


def all_feet(plan: FootstepPlan) -> list[Footstep]:
    """Return the first swing foot, the first stance foot, and all landings of a plan."""
    if not plan.steps:
        return [plan.left, plan.right]
    return [plan.lift_off(0), plan.stance(0), *plan.steps]


def walk_lines(walking: WalkingControl) -> list[str]:
    """Return step, phase, DCM error and outcome of a walk as lines of text."""
    phases = walking.walk.phases
    total = len(phases.plan)
    swing = "" if phases.swing is None else f": {phases.swing} foot swings"
    lines = [f"step {min(phases.step + 1, total)} of {total}, {phases.phase.value}{swing}"]
    if walking.driver.source is not None:
        forward, left, turn = walking.granted_velocity
        lines = [
            f"step {phases.completed + 1}, {phases.phase.value}{swing}",
            f"granted {forward:.2f} m/s forward, {left:.2f} m/s left, {turn:.2f} rad/s",
        ]
    if walking.output is not None:
        error = walking.output.errors.dcm
        lines.append(f"DCM {1e3 * math.hypot(float(error[0]), float(error[1])):.0f} mm off its reference")
    if walking.fallen is not None:
        lines.append(f"FALLEN: {walking.fallen.name.lower()}")
    elif walking.finished and walking.driver.source is None:
        lines.append("finished")
    return lines


def _mark(step: Footstep) -> Array:
    pose: Array = np.array(step.placement.homogeneous)
    pose[:3, 3] += LIFT * pose[:3, 2]
    return pose
