"""Replay of a log: the plant rebuilt from the header and put into the state of any tick."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wbc.app.log.plain import from_plain
from wbc.app.log.reader import Log
from wbc.app.log.sources import position_signal
from wbc.app.log.stances import Drift
from wbc.app.replay.overlays import Overlays
from wbc.app.scene.colours import stiffness_colour
from wbc.app.scene.layers import sole_paths
from wbc.app.scene.scene import Scene, Snapshot
from wbc.app.scene.shapes import Colour
from wbc.app.scene.sources import Force, PlantSource, RobotSource, sole_force
from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError, positive, whole_number
from wbc.core.files import decoding
from wbc.core.robot import SIDES
from wbc.sim.plant.plant import Plant
from wbc.sim.terrain.spec import terrain as make_terrain

MOST_PICTURES = 1_000_000
"""Pictures of the longest film: nine hours at 30 a second."""

MIN_LOAD = 1.0
"""Smallest contact force that is shown, N."""


class Replay:
    """The scene of the live view, filled from a log.

    Attributes:
        log: The log.
        plant: The plant of the log's header, which shows states and is never stepped; None for another loop.
        terrain: The ground, flat for another loop.
        scene: The scene, with the overlays.
        overlays: Footsteps, support region and DCM of a walk.
        sole_paths: Paths of each foot in the colour of its stiffness; empty for a passive foot.
        base_places: Places of the base as it is shown, shape (ticks, 3), m.
        drift: Where the world of the estimate lies.
    """

    @checked
    def __init__(self, log: Log) -> None:
        """Rebuild the plant.

        Args:
            log: A log that was recorded with a plant or with the description of the robot.

        Raises:
            InputError: Recorded without either, nothing recorded, or the plant cannot be built here.
        """
        self.log = log
        if not len(log):
            raise InputError(f"{log.path} holds no ticks; there is nothing to replay")
        with decoding(log.path, "log that can be replayed"):
            parts = log.header.get("plant")
            self.plant = None if parts is None else _plant_of(log, parts)
            self._source: PlantSource | RobotSource
            self.sole_paths: tuple[tuple[str, ...], ...] = ((), ())
            if self.plant is not None:
                self._source, self._q = PlantSource(self.plant), _states_of_plant(log, self.plant)
                self.sole_paths = tuple(sole_paths(self.plant.model, foot) for foot in self.plant.feet)
            else:
                self._source, self._q = _robot_of_loop(log)
            self.terrain = make_terrain("flat") if self.plant is None else self.plant.terrain
            scene = self._source.scene
            self.overlays = Overlays(log, scene.com_height)
            self.scene: Scene = scene.extended(
                self.overlays.objects, self.overlays.moving, self.overlays.legend
            )
            self._com = log["truth/com" if "truth/com/x" in log else "com/estimated"]
            self._wrenches = [log[f"foot/{side}/wrench_measured"] for side in SIDES]
            self.drift = Drift(log)
            self._zmp = self.drift(log["zmp/measured"]) if "zmp/measured/x" in log else None
            self.base_places = self._q[:, :3]
            self._stiffness = [log[f"foot/{side}/stiffness"] for side in SIDES]
            self._push: tuple[Array, ...] = ()
            if "truth/push/point/x" in log:
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
        if (time[-1] - time[0] + 1e-9) / step > MOST_PICTURES:
            raise InputError(f"a replay has at most {MOST_PICTURES:,} pictures, got {rate:g} a second")
        times = np.arange(time[0], time[-1] + 1e-9, step)
        after = np.minimum(np.searchsorted(time, times), len(self) - 1)
        before = np.maximum(after - 1, 0)
        nearest = np.where(time[after] - times <= times - time[before], after, before)
        return [int(i) for i in np.unique(nearest)]

    def show(self, tick: int) -> None:
        """Put all bodies into their positions at a tick, but furniture, which stays where it was at the start.

        `InputError` for a tick that the log does not have.
        """
        self._source.show(self._q[self._checked(tick)])

    def _checked(self, tick: int) -> int:
        if whole_number("tick of a log", tick, low=0) >= len(self):
            raise InputError(f"tick of a log must be below {len(self)}, got {tick}")
        return tick

    def frame(self, tick: int) -> Array:
        """Return one matrix for each moving path of the scene at a tick, shape (len(scene.moving), 4, 4)."""
        return np.concatenate([self.scene.frame(self.snapshot(tick)), self.overlays.frame(tick)])

    def sole_colours(self, tick: int) -> list[Colour]:
        """Return the colour of each foot's `sole_paths` at a tick."""
        values = [float(stiffness[self._checked(tick)]) for stiffness in self._stiffness]
        return [stiffness_colour(value if math.isfinite(value) else 0.0) for value in values]

    def snapshot(self, tick: int) -> Snapshot:
        """Return the state at a tick; forces are those of the foot sensors."""
        self.show(tick)
        forces: list[Force] = []
        for sole, wrenches in zip(self._source.soles(), self._wrenches, strict=True):
            wrench = wrenches[tick]
            if np.isfinite(wrench).all() and wrench[2] >= MIN_LOAD:
                forces += sole_force(sole.translation, sole.rotation, wrench)
        if self._push:
            point, force = (values[tick] for values in self._push)
            if np.isfinite(point).all() and force.any():
                forces.append(("push", point, force))
        zmp = None if self._zmp is None or not np.isfinite(self._zmp[tick]).all() else self._zmp[tick]
        return Snapshot(float(self.log.time[tick]), self._source.poses(), self._com[tick], zmp, forces)


def _states_of_plant(log: Log, plant: Plant) -> Array:
    """Return the positions of the robot in a plant, in MuJoCo's order, shape (ticks, size)."""
    model = plant.model
    joints = [model.joint(i) for i in range(1, model.njnt) if plant.of_robot[model.jnt_bodyid[i]]]
    q = np.empty((len(log), 7 + len(joints)))
    q[:, :3] = log["truth/base/position"]
    q[:, 3:7] = _unit(log["truth/base/orientation"])[:, [3, 0, 1, 2]]
    for joint in joints:
        name = position_signal(joint.name, plant.robot)
        if name not in log:
            raise InputError(
                f"{log.path} has no '{name}': the plant of {log.header.get('program', 'the log')} had "
                "other joints than the one that this version builds"
            )
        q[:, joint.qposadr[0]] = log[name]
    return q


def _robot_of_loop(log: Log) -> tuple[RobotSource, Array]:
    """Return the robot of any other loop and its true configurations, or the estimated ones; shape (ticks, nq)."""
    if log.header.get("description") is None:
        raise InputError(f"{log.path} was recorded without a plant: there is nothing to show")
    description = from_plain(log.header["description"])
    base, joints = "truth/base", "truth/joint/position"
    if f"{base}/position/x" not in log:
        base, joints = "base/estimated", "joint/position"
    if f"{base}/position/x" not in log:
        raise InputError(f"{log.path} has neither the true nor an estimated base: there is nothing to show")
    columns = [log[f"{joints}/{name}"] for name in description.robot().joint_names]
    q = np.column_stack([log[f"{base}/position"], _unit(log[f"{base}/orientation"]), *columns])
    return RobotSource(description, None), q


def _unit(quaternions: Array) -> Array:
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))


def _plant_of(log: Log, parts: dict[str, Any]) -> Plant:
    """Return the plant of the header of a log, without sensor errors."""
    return Plant(
        from_plain(parts["description"]),
        foot=from_plain(parts["foot"]),
        terrain=from_plain(parts["terrain"]),
        physics=from_plain(parts["physics"]),
        timestep=float(parts["timestep"]),
        control_period=float(log.header["control_period"]),
        seed=int(log.header.get("seed") or 0),
        scene=parts.get("scene"),
        initial_configuration=parts.get("start"),
    )
