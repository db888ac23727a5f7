"""All sensors of a plant that see the ground, with their rates and latencies."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc.base.errors import InputError, shown
from wbc.base.numbers import ROUNDING
from wbc.ground import PointCloud
from wbc.sim.plant.eyes.depth import DepthCamera
from wbc.sim.plant.eyes.toes import ToeSensors

STREAM = 1
"""Second word of the seed of the eyes, so that they leave the other sensors their draws."""


class Eyes:
    """Sensors of a plant that see the ground."""

    def __init__(self, plant: Any, sensors: Sequence[DepthCamera | ToeSensors]) -> None:
        """Mount the sensors on the robot of a plant, which stands."""
        for sensor in sensors:
            if not isinstance(sensor, (DepthCamera, ToeSensors)):
                raise InputError(f"eyes of a plant are DepthCamera or ToeSensors, got {shown(sensor)}")
        self._sensors = list(sensors)
        self._views = [sensor.start(plant) for sensor in sensors]
        self.reset(plant.seed)

    def reset(self, seed: int) -> None:
        """Forget all clouds and restart the errors with a seed."""
        for view, own in zip(
            self._views, np.random.SeedSequence([seed, STREAM]).spawn(len(self._views)), strict=True
        ):
            view.reset(int(own.generate_state(1)[0]))
        self._due = [0.0] * len(self._views)
        self._late: deque[tuple[float, PointCloud]] = deque()

    def look(self, time: float) -> None:
        """Let every sensor look whose time, s, has come."""
        for i, (sensor, view) in enumerate(zip(self._sensors, self._views, strict=True)):
            if time >= self._due[i] - ROUNDING:
                self._due[i] = max(self._due[i] + 1.0 / sensor.rate, time)
                self._late += [(time + sensor.latency, cloud) for cloud in view.clouds(time)]

    def take(self, time: float) -> list[PointCloud]:
        """Return the clouds that have come by a time, s, and that were not taken before."""
        come = [cloud for due, cloud in self._late if due <= time + ROUNDING]
        if come:
            self._late = deque((due, cloud) for due, cloud in self._late if due > time + ROUNDING)
        return come
