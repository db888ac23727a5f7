"""Stiffness actuators and range sensors of all feet of a robot."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from wbc.core.errors import Array, InputError
from wbc.feet import Foot, FootParts, RangeSensor, SoftFoot
from wbc.feet.soles.runtime_mjcf import RangeFinder, SoleStiffness
from wbc.feet.soles.soft import VariableStiffnessFoot
from wbc.sim.terrain.render import TERRAIN_GROUP


class FootDevices:
    """Stiffness actuator and range sensor of every sole, left first."""

    def __init__(
        self,
        model: mujoco.MjModel,
        feet: Sequence[FootParts],
        foot: Foot,
        range_sensor: RangeSensor | None,
    ) -> None:
        """Find the devices in the model of the feet that were built under both ankles."""
        self._model, self._feet, self._range_sensor = model, feet, range_sensor
        actuator = foot.actuator if isinstance(foot, VariableStiffnessFoot) else None
        damping = foot.damping_at if isinstance(foot, SoftFoot) and foot.damping_ratio is not None else None
        self._variable = actuator is not None
        self._soles = [
            SoleStiffness(model, built, actuator, damping) for built in feet if built.variable_joints
        ]
        self._none = np.full(len(feet), np.nan)
        self._none.setflags(write=False)
        self._ranges: list[RangeFinder] = []

    def reset(self, seeds: list[int]) -> None:
        """Restore the stiffness at the start and restart the range sensors, each with the seed of its errors."""
        for sole in self._soles:
            sole.reset()
        if self._range_sensor is not None:
            self._ranges = [
                RangeFinder(
                    self._model,
                    foot,
                    ground_group=TERRAIN_GROUP,
                    sensor=self._range_sensor,
                    seed=seed,
                )
                for foot, seed in zip(self._feet, seeds, strict=True)
            ]

    def check(self, command: Array | None) -> None:
        """Check a stiffness command, shape (number of soles,), Nm/rad; nothing changes.

        Raises `InputError` for soles of fixed stiffness, a wrong shape, or a value outside the range of the actuator.
        """
        if command is None:
            return
        if not self._variable:
            raise InputError(
                "command: the soles of this plant have a fixed stiffness; choose foot='variable' to command it"
            )
        if np.shape(command) != self._none.shape:
            raise InputError(
                f"command: sole_stiffness must have shape {self._none.shape}, got {np.shape(command)}"
            )
        for sole, stiffness in zip(self._soles, command, strict=True):
            sole.actuator.check(stiffness)

    def advance(self, command: Array | None, duration: float) -> bool:
        """Advance the stiffness actuators by a time, s, under a checked command, or the last; True for a change."""
        changed = False
        for i, sole in enumerate(self._soles if self._variable else ()):
            before = sole.actual
            commanded = sole.state.commanded if command is None else float(command[i])
            changed |= sole.step(commanded, duration) != before
        return changed

    def stiffness(self) -> Array:
        """Return the actual stiffness of each sole, shape (number of soles,), Nm/rad; NaN for a rigid one."""
        return np.array([sole.actual for sole in self._soles]) if self._soles else self._none

    def ranges(self, data: mujoco.MjData) -> Array:
        """Return the reading of each range sensor, shape (number of soles,), m; NaN without a sensor or an echo."""
        if not self._ranges:
            return self._none
        return np.array([finder.read(self._model, data) for finder in self._ranges])
