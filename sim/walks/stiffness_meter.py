"""Figures of soles of variable stiffness on a walk: errors of the scans, and the stiffness of each swing."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc.base.numbers import Array
from wbc.core.robot import SIDES
from wbc.feet.sensing.scan import Profile
from wbc.sim.plant.plant import Plant
from wbc.sim.trial.trial import TrialHook, TrialTick
from wbc.tasks.scheduling.stiffness import StepStiffness
from wbc.walking.control import WalkingControl


class StiffnessMeter(TrialHook):
    """Comparison of each scan with the true ground when its step is decided, and the record of all steps.

    A scan is made with estimated poses, and the estimate drifts along a walk. Its *shape*, which decides the stiffness,
    is compared with the ground under the true pose of the foot; *as believed* it is compared with the ground under the
    estimated pose.
    """

    def __init__(self, plant: Plant, walking: WalkingControl) -> None:
        """Begin without any step; the controller has a `StiffnessScheduler`."""
        assert walking.stiffness is not None
        self._plant, self._walking, self._task = plant, walking, walking.stiffness
        self._soles = [sole.frame for sole in walking.controller.robot.soles]
        self._last: StepStiffness | None = None
        self._errors: dict[int, tuple[Array, Array]] = {}
        self._times: list[float] = []

    def tick(self, tick: TrialTick) -> None:
        """Record a tick, before the plant moves on."""
        del tick
        decided = self._task.decided
        if decided is None or decided is self._last:
            return
        self._last = decided
        self._times.append(1e6 * decided.computing)
        if decided.profile is not None:
            self._errors[decided.step] = self._compare(SIDES.index(decided.side), decided.profile)

    def _compare(self, side: int, profile: Profile) -> tuple[Array, Array]:
        """Return scanned minus true heights, shape (n,), m: of the shape, without its mean; and as believed."""
        estimate = self._walking.drives.observer.robot.placement(self._soles[side])
        data, site = self._plant.data, self._plant.sole_sites[side]
        rotation = data.site_xmat[site].reshape(3, 3) @ estimate.rotation.T
        points = profile.points
        there = data.site_xpos[site] + (points - estimate.translation) @ rotation.T
        ground = self._plant.terrain
        shape = there[:, 2] - ground.height(there[:, 0], there[:, 1])
        return shape - shape.mean(), points[:, 2] - ground.height(points[:, 0], points[:, 1])

    def steps(self) -> list[dict[str, Any]]:
        """Return the record of each swing, as plain values that follow from the spec."""
        result = []
        for step in self._task.steps:
            entry = step.as_dict()
            del entry["decision_us"]  # a wall-clock time
            shape, believed = self._errors.get(step.step, (None, None))
            entry["profile_error_m"] = None if shape is None else magnitude(shape)
            entry["profile_error_as_believed_m"] = None if believed is None else magnitude(believed)
            result.append(entry)
        return result

    def decision_us(self) -> dict[str, float] | None:
        """Return the computing time of profile and policy, µs: median and maximum; None without a decision."""
        if not self._times:
            return None
        return {"median": float(np.median(self._times)), "max": max(self._times)}


def magnitude(errors: Array) -> dict[str, float]:
    """Return mean and 95th percentile of magnitudes."""
    size = np.abs(errors)
    return {"mean": float(size.mean()), "p95": float(np.percentile(size, 95))}
