"""Replay of a log: the plant rebuilt from the header and put into the state of any tick."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from wbc.app.drift import Drift
from wbc.app.log.header import read_description, read_plant
from wbc.app.log.reader import Log
from wbc.app.log.sources import position_signal
from wbc.app.replay.marks import Captions, LoggedMarks
from wbc.app.view.live_marks import sole_bodies, sole_poses
from wbc.app.view.marks import Force, Picture, balance_marks, stiffness_colour
from wbc.app.view.stage import DescribedStage, SimulatedStage, sole_force
from wbc.core.errors import Array, InputError, positive, whole_number
from wbc.core.files import decoding
from wbc.core.robot import SIDES
from wbc.sim.plant.plant import Plant

MOST_PICTURES = 1_000_000
"""Pictures of the longest film: nine hours at 30 a second."""


class Replay:
    """Pictures of a log: model and state of its run at any tick, with marks; a `Stage` of `wbc.app.view`.

    Attributes:
        log: The log.
        plant: The plant of the log's header, which shows states and is never stepped; None for another loop.
        title: What was run.
        model: MuJoCo's model.
        data: Its state, after `picture`.
        floor: Height of the endless plane, m.
        scale: Sizes of the robot.
        base_places: Places of the base as it is shown, shape (ticks, 3), m.
    """

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
        stage: SimulatedStage | DescribedStage
        with decoding(log.path, "log that can be replayed"):
            self.plant = None if log.header.get("plant") is None else read_plant(dict(log.header))
            if self.plant is not None:
                stage, self._q = SimulatedStage(self.plant, None), _states_of_plant(log, self.plant)
                self._soles, self._places = sole_bodies(self.plant), self.plant.places
            else:
                stage, self._q = _robot_of_loop(log)
                self._soles, self._places = [[], []], stage.places
            self._stage, self.model, self.data = stage, stage.model, stage.data
            self.floor, self.scale = stage.floor, stage.scale
            self.title = str(log.header.get("title") or stage.title)
            self._com = log["truth/com" if "truth/com/x" in log else "com/estimated"]
            self._wrenches = [log[f"foot/{side}/wrench_measured"] for side in SIDES]
            drift = Drift.of(log)
            self._marks, self._caption = LoggedMarks(log, drift, self.scale), Captions(log, drift)
            self._zmp = drift(log["zmp/measured"]) if "zmp/measured/x" in log else None
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

    def picture(self, tick: int) -> Picture:
        """Put all bodies into their positions at a tick, and return its marks and text.

        Furniture stays where it was at the start; forces are those of the foot sensors. `InputError` for a tick that
        the log does not have.
        """
        if whole_number("tick of a log", tick, low=0) >= len(self):
            raise InputError(f"tick of a log must be below {len(self)}, got {tick}")
        if isinstance(self._stage, DescribedStage):
            self._stage.show(self._q[tick])
        else:
            self.data.qpos[: self._q.shape[1]] = self._q[tick]
            mujoco.mj_kinematics(self.model, self.data)
        forces = []
        for pose, wrenches in zip(sole_poses(self._places, self.data), self._wrenches, strict=True):
            forces += sole_force(pose[:3, 3], pose[:3, :3], wrenches[tick])
        if self._push:
            point, force = (values[tick] for values in self._push)
            if np.isfinite(point).all() and force.any():
                forces.append(Force("push", point, force))
        zmp = None if self._zmp is None or not np.isfinite(self._zmp[tick]).all() else self._zmp[tick]
        level = self.floor if zmp is None else float(zmp[2])
        marks = balance_marks(self.scale, self._com[tick], zmp, forces, level) + self._marks(tick)
        picture = Picture(float(self.log.time[tick]), marks, self._caption(tick), self.base_places[tick])
        for bodies, stiffness in zip(self._soles, self._stiffness, strict=True):
            value = float(stiffness[tick])
            picture.colours |= dict.fromkeys(bodies, stiffness_colour(value if math.isfinite(value) else 0.0))
        return picture


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
                f"{log.path} has no '{name}': its plant had other joints than this version builds"
            )
        q[:, joint.qposadr[0]] = log[name]
    return q


def _robot_of_loop(log: Log) -> tuple[DescribedStage, Array]:
    """Return the robot of any other loop and its true configurations, or the estimated ones; shape (ticks, nq)."""
    if log.header.get("description") is None:
        raise InputError(f"{log.path} was recorded without a plant: there is nothing to show")
    description = read_description(log.header["description"])
    base, joints = "truth/base", "truth/joint/position"
    if f"{base}/position/x" not in log:
        base, joints = "base/estimated", "joint/position"
    if f"{base}/position/x" not in log:
        raise InputError(f"{log.path} has neither the true nor an estimated base: there is nothing to show")
    columns = [log[f"{joints}/{name}"] for name in description.robot().joint_names]
    q = np.column_stack([log[f"{base}/position"], _unit(log[f"{base}/orientation"]), *columns])
    return DescribedStage(description, None), q


def _unit(quaternions: Array) -> Array:
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))
