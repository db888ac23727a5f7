"""Range sensors at the toes, which look down before the sole lands, and all sensors of a plant that see the ground."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Annotated, Any

import mujoco
import numpy as np

from wbc.base.errors import InputError, shown
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import NonNegative, Positive, Share, settings
from wbc.ground import PointCloud
from wbc.sim.plant.eyes.depth import DepthCamera
from wbc.sim.terrain.render import TERRAIN_GROUP

STREAM = 1
"""Second word of the seed of the eyes, so that they leave the other sensors their draws."""


@settings
class ToeSensors:
    """Errors and rate of the range sensors at the toe of each foot; `FootFit.toe_sensors` says where they sit.

    Attributes:
        nearest: Shortest distance to the ground under the sole that is read, m.
        furthest: Longest distance to the ground under the sole that is read, m.
        rate: Readings a second, Hz.
        latency: Time from a reading until it is delivered, s.
        noise: Standard deviation of a reading, m.
        dropout: Share of the readings that are lost.
    """

    nearest: Annotated[NonNegative, "m"] = 0.01
    furthest: Annotated[Positive, "m"] = 0.4
    rate: Annotated[Positive, "Hz"] = 50.0
    latency: Annotated[NonNegative, "s"] = 0.0
    noise: Annotated[NonNegative, "m"] = 0.002
    dropout: Share = 0.01

    def start(self, plant: Any) -> ToeView:
        """Return the sensors on the feet of a plant."""
        return ToeView(self, plant)


class ToeView:
    """Range sensors at the toes of a plant."""

    def __init__(self, sensors: ToeSensors, plant: Any) -> None:
        """Place the sensors on both feet."""
        self.sensors, self._plant = sensors, plant
        self._groups = np.zeros(mujoco.mjNGROUP, np.uint8)
        self._groups[TERRAIN_GROUP] = 1
        self._hit = np.zeros(1, np.int32)
        self._feet = []
        for foot, site, sole in zip(plant.feet, plant.sole_sites, plant.description.soles, strict=True):
            link, place = plant.description.attachment(sole.frame)[0], foot.fit.sole.placement
            self._feet.append((site, link, place, np.array(foot.fit.toe_sensors)))
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Restart the sensor errors with a seed."""
        self._random = np.random.default_rng(seed)

    def clouds(self, time: float) -> list[PointCloud]:
        """Return the points under each foot at a time, s, in the frame of its ankle's link."""
        s, clouds = self.sensors, []
        for site, link, place, at in self._feet:
            distance = self._ranges(site, at)
            read = distance + s.noise * self._random.standard_normal(distance.size)
            under = distance - at[:, 2]  # the sole
            good = (under > s.nearest) & (under < s.furthest)
            good &= self._random.random(distance.size) >= s.dropout
            if good.any():
                points = at[good] - read[good, None] * (0.0, 0.0, 1.0)
                cloud = points @ place.rotation.T + place.translation
                clouds.append(PointCloud(cloud, time, link, max(s.noise, 1e-3)))
        return clouds

    def _ranges(self, site: int, at: Array) -> Array:
        """Return the true distances from the sensors of a foot down to the ground, m; negative for none."""
        model, data = self._plant.model, self._plant.data
        place, rotation = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)
        down = -rotation[:, 2]
        return np.array(
            [
                mujoco.mj_ray(model, data, place + rotation @ point, down, self._groups, True, -1, self._hit)
                for point in at
            ]
        )


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
