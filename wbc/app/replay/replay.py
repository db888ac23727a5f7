"""Replay of a log: the plant rebuilt from the header and put into the state of any tick."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from wbc.app.log import Log
from wbc.app.log.columns import SIDES, position_signal
from wbc.app.log.plain import from_plain
from wbc.app.replay.overlays import Overlays
from wbc.app.scene.colours import stiffness_colour
from wbc.app.scene.layers import sole_paths
from wbc.app.scene.scene import Scene, Snapshot
from wbc.app.scene.shapes import Colour
from wbc.app.scene.sources import Force, PlantSource, sole_force
from wbc.core.errors import Array, InputError, positive
from wbc.sim.plant.plant import Plant

MIN_LOAD = 1.0
"""Smallest contact force that is shown, N."""


class Replay:
    """The scene of the live view, filled from a log.

    Attributes:
        log: The log.
        plant: The plant of the log's header; it shows states and is never stepped.
        scene: The scene, with the overlays.
        overlays: Footsteps, support region and DCM of a walk.
        sole_paths: Paths of each foot in the colour of its stiffness; empty for a passive foot.
    """

    def __init__(self, log: Log) -> None:
        """Rebuild the plant.

        Args:
            log: A log that was recorded with a plant.

        Raises:
            InputError: Recorded without a plant, nothing recorded, or the plant cannot be built here.
        """
        self.log = log
        if not len(log):
            raise InputError(f"{log.path} holds no ticks; there is nothing to replay")
        self.plant = rebuild_plant(log)
        self._source = PlantSource(self.plant)
        scene, model = self._source.scene, self.plant.model
        self.overlays = Overlays(log, scene.com_height)
        self.scene: Scene = scene.extended(self.overlays.objects, self.overlays.moving, self.overlays.legend)
        self._q = self._configurations()
        self._soles = [model.site(foot.wrench_site).id for foot in self.plant.feet]
        self._com = log["truth/com"]
        self._wrenches = [log[f"foot/{side}/wrench_measured"] for side in SIDES]
        self._zmp = log["zmp/measured"] if "zmp/measured/x" in log else None
        self.sole_paths = tuple(sole_paths(model, foot) for foot in self.plant.feet)
        self._stiffness = [log[f"foot/{side}/stiffness"] for side in SIDES]
        self._push = (log["truth/push/point"], log["truth/push/force"])

    def __len__(self) -> int:
        return len(self.log)

    def ticks(self, rate: float, speed: float = 1.0) -> list[int]:
        """Return the ticks nearest to equally spaced times.

        Args:
            rate: Pictures for each second of the film, 1/s.
            speed: Seconds of the run in a second of the film.

        Raises:
            InputError: A value that is not above zero.
        """
        step = positive("speed of the replay", speed) / positive("pictures a second (1/s)", rate)
        time = self.log.time
        times = np.arange(time[0], time[-1] + 1e-9, step)
        after = np.minimum(np.searchsorted(time, times), len(self) - 1)
        before = np.maximum(after - 1, 0)
        nearest = np.where(time[after] - times <= times - time[before], after, before)
        return [int(i) for i in np.unique(nearest)]

    def show(self, tick: int) -> None:
        """Put all bodies of the plant into their positions at a tick."""
        self.plant.data.qpos[:] = self._q[tick]
        mujoco.mj_kinematics(self.plant.model, self.plant.data)

    def frame(self, tick: int) -> Array:
        """Return one matrix for each moving path of the scene at a tick, shape (len(scene.moving), 4, 4)."""
        return np.concatenate([self.scene.frame(self.snapshot(tick)), self.overlays.frame(tick)])

    def sole_colours(self, tick: int) -> list[Colour]:
        """Return the colour of each foot's `sole_paths` at a tick."""
        values = [float(stiffness[tick]) for stiffness in self._stiffness]
        return [stiffness_colour(value if math.isfinite(value) else 0.0) for value in values]

    def snapshot(self, tick: int) -> Snapshot:
        """Return the state at a tick; forces are those of the foot sensors."""
        self.show(tick)
        data = self.plant.data
        forces: list[Force] = []
        for site, wrenches in zip(self._soles, self._wrenches, strict=True):
            wrench = wrenches[tick]
            if np.isfinite(wrench).all() and wrench[2] >= MIN_LOAD:
                rotation = data.site_xmat[site].reshape(3, 3)
                forces += sole_force(data.site_xpos[site], rotation, wrench)
        point, force = (values[tick] for values in self._push)
        if np.isfinite(point).all() and force.any():
            forces.append(("push", point, force))
        zmp = None if self._zmp is None or not np.isfinite(self._zmp[tick]).all() else self._zmp[tick]
        return Snapshot(float(self.log.time[tick]), self._source.poses(), self._com[tick], zmp, forces)

    def _configurations(self) -> Array:
        """Return MuJoCo's positions of all ticks, shape (ticks, nq)."""
        log, model = self.log, self.plant.model
        q = np.empty((len(log), model.nq))
        q[:, :3] = log["truth/base/position"]
        quaternion = log["truth/base/orientation"][:, [3, 0, 1, 2]]
        q[:, 3:7] = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
        for i in range(1, model.njnt):
            joint = model.joint(i)
            name = position_signal(joint.name, self.plant.robot)
            if name not in log:
                raise InputError(
                    f"{log.path} has no '{name}': the plant of {log.header.get('program', 'the log')} had "
                    "other joints than the one that this version builds"
                )
            q[:, joint.qposadr[0]] = log[name]
        return q


def rebuild_plant(log: Log) -> Plant:
    """Return the plant of a log, without sensor errors.

    Raises:
        InputError: Recorded without a plant, or with a class that does not exist here.
    """
    parts: dict[str, Any] | None = log.header.get("plant")
    if parts is None:
        raise InputError(f"{log.path} was recorded without a plant: there is nothing to show")
    return Plant(
        from_plain(parts["description"]),
        foot=from_plain(parts["foot"]),
        terrain=from_plain(parts["terrain"]),
        physics=from_plain(parts["physics"]),
        timestep=float(parts["timestep"]),
        control_period=float(log.header["control_period"]),
        seed=int(log.header.get("seed") or 0),
    )
