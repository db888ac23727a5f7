"""Footsteps in the live view, and what a walk has to say in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from wbc.app.view.flat import outline, plate
from wbc.app.view.layers import LIFT, LINE, Layer
from wbc.app.view.scene import HIDDEN, Note
from wbc.app.view.shapes import Colour
from wbc.core.errors import Array
from wbc.walking.planning.footsteps import SIDES, Footstep, FootstepPlan, other

if TYPE_CHECKING:
    from wbc.sim import Plant
    from wbc.walking.control import WalkingControl

SIDE_COLOURS: dict[str, Colour] = {"left": (0.0, 0.45, 0.70, 1.0), "right": (0.84, 0.37, 0.0, 1.0)}

MOST_STEPS = 128
"""Most footsteps of each kind that are shown; of a longer walk the last ones, and half as many to come."""


class FootstepsLayer(Layer):
    """Footsteps: outlined as planned (with all adjustments until they land), filled where the feet really stand.

    Both are numbered alike: 0 is the foot that leaves first, 1 the one that stays, 2 the first landing.
    """

    def __init__(self, plant: Plant, walking: WalkingControl) -> None:
        """Make room for all steps, and for one that a stop may add.

        Args:
            plant: The plant.
            walking: The controller.
        """
        super().__init__()
        self._plant, self._walking = plant, walking
        plan = walking.walk.phases.plan
        self._count = min(MOST_STEPS, 2 * ((len(plan) + 4) // 2))
        # The places of marks are used again and again in walks that are longer.
        self._ahead = self._count if self._count >= len(plan) + 3 else self._count // 2
        self._sites = [plant.model.site(foot.wrench_site).id for foot in plant.feet]
        sizes = [(foot.fit.sole.length, foot.fit.sole.width) for foot in plant.feet]
        first = plan.steps[0].side if plan.steps else SIDES[0]
        self._planned, self._real = [], []
        for i in range(self._count):
            side = first if i % 2 == 0 else other(first)
            size, colour = sizes[SIDES.index(side)], SIDE_COLOURS[side]
            mark = outline(*size, LINE)
            self._planned.append(self.add(f"footsteps/planned_{i}", mark, colour, on_top=True))
            self._real.append(self.add(f"footsteps/real_{i}", plate(*size), (*colour[:3], 0.35)))
        self.legend = [(f"{side} footstep, planned and real", SIDE_COLOURS[side]) for side in SIDES]
        self._planned_at = np.tile(HIDDEN, (self._count, 1, 1))
        self._real_at = np.tile(HIDDEN, (self._count, 1, 1))
        self._end, self._step = 0, -1
        self._plan: FootstepPlan | None = None
        self._feet: list[Footstep] = []

    def fill(self, matrices: Array, note: Note) -> None:  # noqa: D102
        phases = self._walking.walk.phases
        step = phases.step
        if phases.plan is not self._plan or step != self._step:  # plans are never changed, but replaced
            self._plan, self._step, self._feet = phases.plan, step, all_feet(phases.plan)
            self._mark_plan(self._feet, step)
        for i in (step + 1,) if phases.swing is not None else (step, step + 1):
            self._real_at[i % self._count] = self._pose(self._feet[i].side)
        matrices[self._planned], matrices[self._real] = self._planned_at, self._real_at
        note.text += walk_lines(self._walking)

    def _mark_plan(self, feet: list[Footstep], step: int) -> None:
        """Put the marks of steps to come where they are planned now.

        Args:
            feet: All feet of the plan.
            step: Index of the step that swings, or that swings next.
        """
        # What has landed keeps the mark of where it was to land; the plan has it where it came to.
        future = range(step + 2 if step else 0, min(len(feet), step + 2 + self._ahead))
        for i in future:
            self._planned_at[i % self._count] = _mark(feet[i])
        for i in range(future.stop, self._end):
            self._planned_at[i % self._count] = HIDDEN  # a stop has cut the plan
        self._end = future.stop

    def _pose(self, side: str) -> Array:
        """Where a sole truly is."""
        site, data = self._sites[SIDES.index(side)], self._plant.data
        pose = np.eye(4)
        pose[:3, :3] = data.site_xmat[site].reshape(3, 3)
        pose[:3, 3] = data.site_xpos[site] + LIFT * pose[:3, 2]
        return pose


def all_feet(plan: FootstepPlan) -> list[Footstep]:
    """The foot that leaves first, the one that stays, and all landings of a plan."""
    if not plan.steps:
        return [plan.left, plan.right]
    return [plan.lift_off(0), plan.stance(0), *plan.steps]


def walk_lines(walking: WalkingControl) -> list[str]:
    """What a walk is doing, in words."""
    phases = walking.walk.phases
    total = len(phases.plan)
    swing = "" if phases.swing is None else f": {phases.swing} foot swings"
    lines = [f"step {min(phases.step + 1, total)} of {total}, {phases.phase.value}{swing}"]
    if walking.output is not None:
        error = walking.output.errors.dcm
        lines.append(f"DCM {1e3 * math.hypot(float(error[0]), float(error[1])):.0f} mm off its reference")
    if walking.fallen is not None:
        lines.append(f"FALLEN: {walking.fallen.name.lower()}")
    elif walking.finished:
        lines.append("finished")
    return lines


def _mark(step: Footstep) -> Array:
    pose: Array = np.array(step.placement.homogeneous)
    pose[:3, 3] += LIFT * pose[:3, 2]
    return pose
