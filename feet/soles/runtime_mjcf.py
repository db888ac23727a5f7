"""Sensors and stiffness of a foot in a running MuJoCo simulation."""

from __future__ import annotations

import math
from collections.abc import Callable

import mujoco
import numpy as np

from wbc.feet.sensing.range_sensor import RangeSampler, RangeSensor
from wbc.feet.soles.actuator import StiffnessActuator, StiffnessState
from wbc.feet.soles.foot import FootParts


class SoleStiffness:
    """Stiffness of a soft sole in a running simulation, behind its actuator."""

    def __init__(
        self,
        model: mujoco.MjModel,
        foot: FootParts,
        actuator: StiffnessActuator | None = None,
        damping: Callable[[float], float] | None = None,
    ) -> None:
        """Start at the compiled stiffness; without an actuator the sole acts at once.

        `damping` is stiffness (Nm/rad) → damping of the hinges that have it (Nms/rad); it stays when None.
        """
        self._model = model
        self._joints = np.array([model.joint(name).id for name in foot.variable_joints])
        self._dofs = model.jnt_dofadr[self._joints]
        self._damping = damping
        self.actuator = StiffnessActuator.instantaneous(high=math.inf) if actuator is None else actuator
        self._initial = float(model.jnt_stiffness[self._joints[0]])
        self.state: StiffnessState = self.actuator.at_rest(self._initial)

    @property
    def actual(self) -> float:
        """Stiffness of the springs, Nm/rad; the measured value."""
        return float(self._model.jnt_stiffness[self._joints[0]])

    def reset(self) -> None:
        """Set the stiffness at the start at once."""
        self.state = self.actuator.at_rest(self._initial)
        self._write()

    def step(self, command: float, duration: float) -> float:
        """Advance the actuator by a duration, s, under a command; write and return the actual stiffness, Nm/rad."""
        self.state = self.actuator.advance(self.state, command, duration)
        self._write()
        return self.state.actual

    def _write(self) -> None:
        """Write stiffness and damping into the model."""
        self._model.jnt_stiffness[self._joints] = self.state.actual
        if self._damping is not None:
            self._model.dof_damping[self._dofs] = self._damping(self.state.actual)


class RangeFinder:
    """The range sensor under the toe: a ray that sees the ground alone, with the sensor's errors."""

    def __init__(
        self,
        model: mujoco.MjModel,
        foot: FootParts,
        *,
        ground_group: int,
        sensor: RangeSensor | None = None,
        seed: int = 0,
    ) -> None:
        """Look up the site; the geom group of the ground, 0 to 5, holds nothing else; a sensor is perfect when None."""
        self._site = int(model.site(foot.range_site).id)
        self._groups = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
        self._groups[ground_group] = 1
        self._hit = np.zeros(1, dtype=np.int32)
        self.sampler = RangeSampler(RangeSensor() if sensor is None else sensor, seed)

    def distance(self, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return the true distance from the site to the ground along the ray, m; infinite when it hits nothing."""
        direction = data.site_xmat[self._site][2::3].copy()
        distance = mujoco.mj_ray(
            model, data, data.site_xpos[self._site], direction, self._groups, True, -1, self._hit
        )
        return math.inf if distance < 0.0 else float(distance)

    def read(self, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return the reading at the simulation's time, m; NaN when it is lost, out of range, or not due."""
        due = self.sampler.due(data.time)
        return self.sampler.sample(data.time, self.distance(model, data) if due else math.nan)
