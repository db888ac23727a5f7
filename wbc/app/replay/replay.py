"""A recorded run as it was: the plant built again, put into the state of any tick."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from wbc.app.log import Log
from wbc.app.log.names import SIDES, position_signal
from wbc.app.log.plain import from_plain
from wbc.app.replay.overlays import make_overlays
from wbc.app.view.layers import stiffness_colour
from wbc.app.view.scene import Scene, Snapshot
from wbc.app.view.shapes import Colour
from wbc.app.view.source import FOOT, PlantSource
from wbc.core.errors import Array, InputError, positive
from wbc.feet import FootParts
from wbc.sim.plant.plant import Plant
from wbc.walking.stabilizer.zmp import NoContactForceError, cop

LEAST_LOAD = 1.0
"""Forces below this are not shown, N."""


class Replay:
    """The scene of the live view, filled from a log.

    Attributes:
        log: The log.
        plant: The plant, built from what the log says about it; it shows states and is never stepped.
        scene: What is drawn, with what `overlays` adds to it.
        overlays: Footsteps, support region and DCM of a walk.
        moving: Paths that a frame moves, in the order of its matrices.
        sole_paths: Paths of each foot that have the colour of its stiffness; none of a fixed one.
    """

    def __init__(self, log: Log) -> None:
        """Build the plant.

        Args:
            log: A log that was recorded with a plant.

        Raises:
            InputError: Recorded without a plant, nothing recorded, or the plant cannot be built here.
        """
        self.log = log
        if not len(log):
            raise InputError(f"{log.path} holds no ticks; there is nothing to replay")
        self.plant = rebuild_plant(log)
        scene = PlantSource(self.plant).scene
        self.overlays = make_overlays(log, scene.size)
        self.scene: Scene = self.overlays.added_to(scene)
        self.moving = (*scene.moving, *self.overlays.moving)
        model = self.plant.model
        names = [body.removeprefix(FOOT) for body in self.scene.bodies]
        self._bodies = np.array([model.body(name).id for name in names])
        self._q = self._configurations()
        self._soles = [model.site(foot.wrench_site).id for foot in self.plant.feet]
        self._com = log["truth/com"]
        self._wrenches = [log[f"foot/{side}/wrench_measured"] for side in SIDES]
        self._zmp = log["zmp/measured"] if "zmp/measured/x" in log else None
        self.sole_paths = tuple(self._sole_paths(foot) for foot in self.plant.feet)
        self._stiffness = [log[f"foot/{side}/stiffness"] for side in SIDES]
        self._push = (log["truth/push/point"], log["truth/push/force"])

    def __len__(self) -> int:
        return len(self.log)

    def ticks(self, rate: float, speed: float = 1.0) -> list[int]:
        """Ticks to show for so many pictures a second.

        Args:
            rate: Pictures for each second of the film, 1/s.
            speed: Seconds of the run in a second of the film.

        Raises:
            InputError: A value that is not above zero.
        """
        step = positive("speed of the replay", speed) / positive("pictures a second (1/s)", rate)
        time = self.log.time
        wanted = np.arange(time[0], time[-1] + 1e-9, step)
        after = np.minimum(np.searchsorted(time, wanted), len(self) - 1)
        before = np.maximum(after - 1, 0)
        nearest = np.where(time[after] - wanted <= wanted - time[before], after, before)
        return [int(i) for i in np.unique(nearest)]

    def show(self, tick: int) -> None:
        """Put the plant into the state of a tick: positions of all bodies, nothing else."""
        self.plant.data.qpos[:] = self._q[tick]
        mujoco.mj_kinematics(self.plant.model, self.plant.data)

    def frame(self, tick: int) -> Array:
        """One matrix for each moving path at a tick, shape (len(moving), 4, 4)."""
        return np.concatenate([self.scene.frame(self.snapshot(tick)), self.overlays.frame(tick)])

    def sole_colours(self, tick: int) -> list[Colour]:
        """Colour of each foot's `sole_paths` at a tick, by stiffness as in the live view."""
        values = [float(stiffness[tick]) for stiffness in self._stiffness]
        return [stiffness_colour(value if math.isfinite(value) else 0.0) for value in values]

    def _sole_paths(self, foot: FootParts) -> tuple[str, ...]:
        """Paths of a foot's bodies whose hinges change their stiffness."""
        model = self.plant.model
        bodies = sorted({int(model.joint(name).bodyid[0]) for name in foot.variable_joints})
        names = [FOOT + str(model.body(body).name) for body in bodies]
        return tuple(
            self.moving[self.scene.bodies.index(name)] for name in names if name in self.scene.bodies
        )

    def snapshot(self, tick: int) -> Snapshot:
        """What the live view shows at a tick; forces are those of the foot sensors."""
        self.show(tick)
        data = self.plant.data
        poses = np.tile(np.eye(4), (self._bodies.size, 1, 1))
        poses[:, :3, :3] = data.xmat[self._bodies].reshape(-1, 3, 3)
        poses[:, :3, 3] = data.xpos[self._bodies]
        forces: list[tuple[str, Array, Array]] = []
        for site, wrenches in zip(self._soles, self._wrenches, strict=True):
            wrench = wrenches[tick]
            if not np.isfinite(wrench).all() or wrench[2] < LEAST_LOAD:
                continue
            rotation = data.site_xmat[site].reshape(3, 3)
            try:
                point = data.site_xpos[site] + rotation[:, :2] @ cop(wrench)
            except NoContactForceError:
                continue
            forces.append(("ground", point, rotation @ wrench[:3]))
        point, force = (values[tick] for values in self._push)
        if np.isfinite(point).all() and force.any():
            forces.append(("push", point, force))
        zmp = None if self._zmp is None or not np.isfinite(self._zmp[tick]).all() else self._zmp[tick]
        return Snapshot(float(self.log.time[tick]), poses, self._com[tick], zmp, forces)

    def _configurations(self) -> Array:
        """MuJoCo's positions of all ticks, shape (ticks, nq)."""
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
    """Build the plant that a log was recorded with, without the errors of its sensors.

    Raises:
        InputError: Recorded without a plant, or of classes that are not there.
    """
    parts: dict[str, Any] | None = log.header.get("plant")
    if parts is None:
        raise InputError(f"{log.path} was recorded without a plant: there is nothing to be shown")
    return Plant(
        from_plain(parts["description"]),
        foot=from_plain(parts["foot"]),
        terrain=from_plain(parts["terrain"]),
        physics=from_plain(parts["physics"]),
        timestep=float(parts["timestep"]),
        control_period=float(log.header["control_period"]),
        seed=int(log.header.get("seed") or 0),
    )
