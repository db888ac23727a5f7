"""Replay of a log: the plant rebuilt from the header and put into the state of any tick."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated

import numpy as np

from wbc.app.drift import Drift
from wbc.app.log.header import read_plant
from wbc.app.log.reader import Log
from wbc.app.log.signals import foot_names, position_signal
from wbc.app.log.stances import Stance, stances
from wbc.app.log.truth import furniture_signals
from wbc.app.view.marks import (
    Force,
    Mark,
    Picture,
    force_marks,
    ground_mark,
    planned_step,
    real_step,
    scan_mark,
    sole_force,
    walk_text,
)
from wbc.app.view.stage import DescribedStage, SimulatedStage, Stage
from wbc.app.view.walk_marks import sole_poses
from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.files import decoding
from wbc.base.numbers import Array, read_only
from wbc.base.settings import Ordinal, Positive, from_json
from wbc.core.robot import SIDES
from wbc.robots import RobotDescription
from wbc.sim.plant.plant import Plant

MOST_PICTURES = 1_000_000
"""Pictures of the longest film: nine hours at 30 a second."""

EVENT_TIME = 2.0
"""Time for which an event is shown, s."""


class Replay:
    """Pictures of a log: model and state of its run at any tick, with marks.

    Attributes:
        log: The log.
        plant: Plant of the log's header, which shows states and is never stepped; None for another loop.
        title: Title of the log.
        stage: MuJoCo's model, its state, which `picture` sets, and sizes of the robot.
        base_places: Positions of the base as shown, shape (ticks, 3), m.
    """

    stage: Stage

    @checked
    def __init__(self, log: Log) -> None:
        """Rebuild the plant.

        Args:
            log: Log that was recorded with a plant or with the description of the robot.

        Raises:
            InputError: The log was recorded without either, it is empty, or the plant cannot be built on this machine.
        """
        self.log = log
        if not len(log):
            raise InputError(f"{log.path} holds no ticks; there is nothing to replay")
        with decoding(log.path, "log that can be replayed"):
            self.plant = None if log.header.get("plant") is None else read_plant(dict(log.header))
            if self.plant is None:
                self.stage, self._q = _robot_of_loop(log)
            else:
                self.stage, self._q = SimulatedStage(self.plant, None), _states_of_plant(log, self.plant)
            self.title = str(log.header.get("title") or self.stage.title)
            self.base_places = read_only(self._q[:, :3])
            self._read(log)

    def _read(self, log: Log) -> None:
        self._drift = drift = Drift.of(log)
        self._com = log.vector("truth/com" if "truth/com/x" in log else "com/estimated", 3)
        self._zmp = drift(log.vector("zmp/measured", 3)) if "zmp/measured/x" in log else None
        self._dcm = drift(log.vector("dcm/estimated", 2)) if "dcm/estimated/x" in log else None
        self._planned = dict(_planned(log, drift))
        self._wrenches = [
            log.vector(f"foot/{side}/wrench_measured", 6) for side in foot_names(self.stage.robot)
        ]
        push = [f"truth/push/{part}" for part in ("point", "force")]
        self._push = [log.vector(name, 3) for name in push] if f"{push[0]}/x" in log else None
        self._stances = stances(log, "truth", drift) if _shows_walk(log) else []
        self._marks = list(_walk_marks(log, drift, self._stances))
        names = ("program/state", "walk/phase", "step/side")
        self._texts = {name: log.texts(name) for name in names if name in log}

    def __len__(self) -> int:
        return len(self.log)

    @checked
    def ticks(self, rate: Annotated[Positive, "1/s"], speed: Positive = 1.0) -> list[int]:
        """Return the ticks nearest to equally spaced times; a tick comes again where pictures are faster than ticks.

        Args:
            rate: Pictures per second of the film, Hz.
            speed: Speed of the film: seconds of the run in one second of the film.
        """
        step, time = speed / rate, self.log.time
        if (time[-1] - time[0] + 1e-9) / step > MOST_PICTURES:
            raise InputError(f"a replay has at most {MOST_PICTURES:,} pictures, got {rate:g} a second")
        times = np.arange(time[0], time[-1] + 1e-9, step)
        after = np.minimum(np.searchsorted(time, times), len(self) - 1)
        before = np.maximum(after - 1, 0)
        return [int(i) for i in np.where(time[after] - times <= times - time[before], after, before)]

    @checked
    def picture(self, tick: Ordinal) -> Picture:
        """Move all bodies to their positions at a tick, and return the marks and the text of this tick.

        Forces are those of the foot sensors. A tick that the log does not have is an `InputError`.
        """
        if tick >= len(self):
            raise InputError(f"tick of a log must be below {len(self)}, got {tick}")
        stage, scale = self.stage, self.stage.scale
        stage.show(self._q[tick])
        forces = []
        for pose, wrenches in zip(sole_poses(stage.places, stage.data), self._wrenches, strict=True):
            forces += sole_force(pose[:3, 3], pose[:3, :3], wrenches[tick])
        if self._push is not None and self._push[1][tick].any() and np.isfinite(self._push[0][tick]).all():
            forces.append(Force("push", self._push[0][tick], self._push[1][tick]))
        zmp, dcm = (None if values is None else values[tick] for values in (self._zmp, self._dcm))
        level = float(zmp[2]) if zmp is not None and np.isfinite(zmp[2]) else stage.floor
        standing = [foot.corners for foot in self._stances if foot.start <= tick < foot.end]
        support = np.concatenate(standing) if standing else None
        picture = Picture(float(self.log.time[tick]), target=self.base_places[tick])
        picture.add_balance(scale, self._com[tick], level, zmp, dcm, support)
        picture.marks += force_marks(scale, forces)
        picture.add_planned(scale, {name: points[tick] for name, points in self._planned.items()})
        picture.marks += [mark for start, end, mark in self._marks if start <= tick < end]
        self._tell(picture, tick)
        if any(stage.soles):
            picture.add_soles(
                stage.soles, [float(self.log[f"foot/{side}/stiffness"][tick]) for side in SIDES]
            )
        return picture

    def _tell(self, picture: Picture, tick: int) -> None:
        """Add to a picture what is said of its tick: program, phase, drift and last event."""
        told = {name: texts[tick] for name, texts in self._texts.items()}
        state, phase, side = map(told.get, ("program/state", "walk/phase", "step/side"))
        if state is not None:
            picture.text.append(str(state))
        if phase is not None:
            picture.text.append(walk_text(phase, side, int(np.nan_to_num(self.log["walk/steps_done"][tick]))))
        if self._marks and "truth/com/x" in self.log:
            picture.text.append(self._drift.text(tick))
        now = picture.time
        picture.text += [text for time, text in self.log.events if now - EVENT_TIME <= time <= now][-1:]


def _planned(log: Log, drift: Drift) -> Iterator[tuple[str, Array]]:
    """Yield name and places of the points that a walk plans, in the true world, shape (ticks, 3), m."""
    if "zmp/reference/x" in log and "dcm/reference/x" in log:
        zmp = log.vector("zmp/reference", 3)
        yield "ZMP", drift(zmp)
        yield "DCM", drift(np.column_stack([log.vector("dcm/reference", 2), zmp[:, 2]]))


def _shows_walk(log: Log) -> bool:
    return "foot/left/contact" in log and "dcm/reference/x" in log


def _walk_marks(log: Log, drift: Drift, real: Sequence[Stance]) -> Iterator[tuple[int, int, Mark]]:
    """Yield first tick, tick after the last one and mark of footsteps, scans and maps of a walk; none of other runs."""
    end = len(log)
    planned = stances(log, drift=drift) if _shows_walk(log) else []
    for k, stance in enumerate(stance for stance in planned if stance.start > 0):
        yield 0, end, planned_step(k, stance.side, stance.corners)
    for k, stance in enumerate(real):
        yield stance.start, end, real_step(k, stance.side, stance.corners)
    for k, (tick, along) in enumerate(_lists(log, "stiffness/scan", ("x", "lateral", "z"))):
        heading = float(log["stiffness/scan/heading"][tick])
        c, s = math.cos(heading), math.sin(heading)
        points = along @ np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)])
        yield tick, end, scan_mark(k, drift(points, tick))
    maps = _lists(log, "ground/map", ("x", "y", "z"))
    for (tick, points), until in zip(maps, [*(tick for tick, _ in maps[1:]), end], strict=False):
        yield tick, until, ground_mark(drift(points, tick))


def _lists(log: Log, group: str, parts: tuple[str, ...]) -> list[tuple[int, Array]]:
    """Return the ticks in which a group of lists has values, and these as points, shape (n, 3)."""
    if f"{group}/{parts[0]}" not in log:
        return []
    rows = zip(*(log.lists(f"{group}/{part}") for part in parts), strict=True)
    found = [(k, row) for k, row in enumerate(rows) if row[0] is not None and row[0].size > 1]
    return [(k, np.column_stack(row)) for k, row in found]


def _states_of_plant(log: Log, plant: Plant) -> Array:
    """Return the positions of a plant, robot and furniture, in MuJoCo's order, shape (ticks, nq)."""
    model = plant.model
    joints = [model.joint(i) for i in range(1, model.njnt) if plant.of_robot[model.jnt_bodyid[i]]]
    q = np.tile(plant.data.qpos, (len(log), 1))
    q[:, :3] = log.vector("truth/base/position", 3)
    q[:, 3:7] = _unit(log.vector("truth/base/orientation", 4))[:, [3, 0, 1, 2]]
    for joint in joints:
        name = position_signal(joint.name, plant.robot)
        if name not in log:
            raise InputError(
                f"{log.path} has no '{name}': its plant had other joints than this version builds"
            )
        q[:, joint.qposadr[0]] = log[name]
    for name, _, place in furniture_signals(plant):
        q[:, place] = log[name]
    return q


def _robot_of_loop(log: Log) -> tuple[DescribedStage, Array]:
    """Return the robot of any other loop and its true configurations, or the estimated ones; shape (ticks, nq)."""
    if log.header.get("description") is None:
        raise InputError(f"{log.path} was recorded without a plant: there is nothing to show")
    description = from_json(RobotDescription, log.header["description"])
    base, joints = "truth/base", "truth/joint/position"
    if f"{base}/position/x" not in log:
        base, joints = "base/estimated", "joint/position"
    if f"{base}/position/x" not in log:
        raise InputError(f"{log.path} has neither the true nor an estimated base: there is nothing to show")
    columns = [log[f"{joints}/{name}"] for name in description.robot().joint_names]
    q = np.column_stack(
        [log.vector(f"{base}/position", 3), _unit(log.vector(f"{base}/orientation", 4)), *columns]
    )
    return DescribedStage(description), q


def _unit(quaternions: Array) -> Array:
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))
