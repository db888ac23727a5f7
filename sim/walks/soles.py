"""What the soles of variable stiffness did on a walk: how well the ground was seen, and what came of it."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from wbc.core.errors import Array
from wbc.feet.sensing.scan import Profile
from wbc.feet.soles.sole import SIDES
from wbc.sim.plant.plant import Plant
from wbc.tasks.scheduling.record import StepStiffness
from wbc.walking.control import WalkingControl


class SoleMeter:
    """Compares each scan with the true ground when its step is decided, and collects the steps.

    A scan is made with estimated poses, and the estimate drifts along a walk. Its *shape*, which decides the stiffness,
    is compared with the ground at the place where the foot truly is; *as believed* it is compared with the ground at
    the place where the controller takes it to be.
    """

    def __init__(self, plant: Plant, walking: WalkingControl) -> None:
        """Begin with nothing.

        Args:
            plant: The plant.
            walking: The controller, with a `StiffnessScheduler`.
        """
        assert walking.stiffness is not None
        self._plant, self._walking, self._task = plant, walking, walking.stiffness
        kind = mujoco.mjtObj.mjOBJ_SITE
        self._sites = [mujoco.mj_name2id(plant.model, kind, foot.wrench_site) for foot in plant.feet]
        self._soles = [sole.frame for sole in walking.controller.robot.soles]
        self._seen: StepStiffness | None = None
        self._errors: dict[int, tuple[Array, Array]] = {}
        self._times: list[float] = []

    def update(self) -> None:
        """Take in a tick, before the plant moves on."""
        decided = self._task.decided
        if decided is None or decided is self._seen:
            return
        self._seen = decided
        self._times.append(1e6 * decided.computing)
        if decided.profile is not None:
            self._errors[decided.step] = self._compare(SIDES.index(decided.side), decided.profile)

    def _compare(self, side: int, profile: Profile) -> tuple[Array, Array]:
        """Scanned minus true heights, shape (n,), m: of the shape, without its mean; and as believed."""
        estimate = self._walking.control.observer.robot.placement(self._soles[side])
        data, site = self._plant.data, self._sites[side]
        rotation = data.site_xmat[site].reshape(3, 3) @ estimate.rotation.T
        points = profile.points
        there = data.site_xpos[site] + (points - estimate.translation) @ rotation.T
        ground = self._plant.terrain
        shape = there[:, 2] - ground.height(there[:, 0], there[:, 1])
        return shape - shape.mean(), points[:, 2] - ground.height(points[:, 0], points[:, 1])

    def steps(self) -> list[dict[str, Any]]:
        """What happened in each swing, as plain values that the spec decides."""
        result = []
        for step in self._task.steps:
            entry = step.as_dict()
            del entry["decision_us"]  # the clock's
            shape, believed = self._errors.get(step.step, (None, None))
            entry["profile_error_m"] = None if shape is None else magnitude(shape)
            entry["profile_error_as_believed_m"] = None if believed is None else magnitude(believed)
            result.append(entry)
        return result

    def decision_us(self) -> dict[str, float] | None:
        """Time that profile and policy took, µs: median and most; None without a decision."""
        if not self._times:
            return None
        return {"median": float(np.median(self._times)), "max": max(self._times)}


def magnitude(errors: Array) -> dict[str, float]:
    """Mean and 95th percentile of magnitudes."""
    size = np.abs(errors)
    return {"mean": float(size.mean()), "p95": float(np.percentile(size, 95))}
