"""Consistency of sensors with each other: what lasts and is possible, but cannot all be true.

The monitor refuses nothing: it names what it doubts, for the log and for `status()` of a control, and works where a
machine is driven (`DriveControl.watch`). Thresholds lie between what walks come to, which is given with them, and what
errors of sensors make. The walks are those of `g1`, `hrp4_class` and `talos` with realistic noise, on flat floors and
stones of 20 mm, and under pushes of 0.4 Ns/kg.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array, lag_gain, scalar
from wbc.base.vectors import Vector, part_way
from wbc.core.estimation.checks.integrals import UNMET, IntegralComparison
from wbc.core.estimation.checks.legs import SMOOTHING, GyroscopeComparison, LegComparison
from wbc.core.estimation.foot import STILL
from wbc.core.estimation.observer import Observer
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Measurement

logger = logging.getLogger(__name__)


class CalmThresholds(NamedTuple):
    """Thresholds of a calm robot.

    A push, and the steps that catch it, pull at robot and feet as no model knows: contradictions that begin then count
    for nothing. Feet that land accelerate a walk by 9 m/s² for a moment, pushes by 12 m/s².

    Attributes:
        time: Time for which a robot must have been calm when a contradiction begins, s.
        acceleration: Horizontal acceleration from which on it is not calm, m/s².
        change: Change of the trunk's rate against its mean from which on it is not calm, rad/s.
        mean: Time constant of that mean, s.
    """

    time: float = 0.3
    acceleration: float = 2.0
    change: float = 0.2
    mean: float = 0.1


class LoadThresholds(NamedTuple):
    """Thresholds of the comparison of loads, gravity and the turns of the feet.

    In calm walks the soles carry 0.89 to 1.09 of the weight, and feet turn alike by 0.014 rad/s at most; the
    accelerometer shows 0.65 of gravity at least.

    Attributes:
        least_weight: Least part of the weight that the soles must carry.
        most_weight: Greatest part of the weight that the soles may carry.
        gravity: Least part of gravity that the accelerometer must show, upwards as estimated.
        rotation: Greatest speed at which both feet on the ground may turn alike, by encoders and gyroscope, rad/s, once
            both have stood: in a walk both may roll over the edges of stones or boards.
        carries: Part of the weight that each foot must carry when a stand begins.
        standing: Time for which a robot must have stood before the turns of its feet are compared, s.
        silent: Greatest part of the weight that a force sensor reports which is named.
        lasting: Time for which a contradiction must last, s.
        low_pass: Time constant of the compared signals, s.
    """

    least_weight: float = 0.6
    most_weight: float = 2.0
    gravity: float = 0.6
    rotation: float = 0.5
    carries: float = 0.15
    standing: float = 0.5
    silent: float = 0.02
    lasting: float = 0.1
    low_pass: float = 0.05


CALM, LOADS = CalmThresholds(), LoadThresholds()

SLIPS = 0.02
"""Time for which a foot that carries must slip until it is named, s; in walks it seems to for 0.006 s at most."""

SLIPPED = 0.3
"""Time for which a foot that has slipped is named, s."""

FROZEN_AFTER = 20
"""Ticks for which a reading must stay the same to the bit to count as frozen."""

BUSY = 0.8
"""Share of the ticks before in which it must have changed: one that is rounded comes to rest by and by."""

BUSY_GAIN = 0.02
"""Gain of that share in a tick."""

NAMED = 6
"""Number of frozen sensors that are named."""

_ONE = scalar(1.0)


class FrozenReadings:
    """Search for readings that stay the same to the bit, while noise would change a good one in every tick.

    They are doubted; a whole measurement that comes again and again is refused by `Plausibility`.
    """

    def __init__(self, robot: Robot, channels: tuple[str, ...]) -> None:
        """Prepare for a robot, and the names of the numbers that `update` gets."""
        self._robot, self._channels, self._na = robot, channels, robot.na
        self._wrenches = len(channels) - 6 * len(robot.soles)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        n = len(self._channels)
        self._last: Array | None = None
        self._run, self._busy, self._frozen = np.zeros(n), np.zeros(n), np.zeros(n, dtype=bool)
        self._ticks = 0

    def update(self, values: Array) -> list[str]:
        """Return the frozen sensors, such as "encoder of left_knee frozen"; `values` are all numbers of a tick."""
        last, self._last = self._last, values
        if last is None:
            return []
        run, busy, frozen = self._run, self._busy, self._frozen
        changed = values != last
        run += _ONE
        run[changed] = 0.0
        self._ticks += 1
        busy += max(BUSY_GAIN, 1.0 / self._ticks) * (changed - busy)
        stands = run == FROZEN_AFTER
        if np.count_nonzero(stands):  # in a third of the time of `any`
            frozen |= stands & (busy > BUSY * (1.0 - BUSY_GAIN) ** FROZEN_AFTER)
        if not np.count_nonzero(frozen):
            return []
        frozen &= ~changed
        na, doubted = self._na, frozen.copy()
        doubted[self._wrenches :] &= values[self._wrenches :] != 0.0  # no force is that of a foot in the air
        # A joint that sticks has no speed, and its encoder stays.
        sticks = (values[na : 2 * na] == 0.0) & (run[:na] >= 1.0)
        doubted[: 2 * na] &= ~np.concatenate((sticks, sticks))
        # One that is faster than it can be is cut off by the check of plausibility.
        doubted[na : 2 * na] &= np.abs(values[na : 2 * na]) < self._robot.velocity_limit
        names = list(dict.fromkeys(self._channels[i] for i in doubted.nonzero()[0]))
        more = [f"{len(names) - NAMED} more sensors frozen"] if len(names) > NAMED else []
        return [f"{name} frozen" for name in names[:NAMED]] + more


class ConsistencyMonitor:
    """Comparison of sensors with each other, tick by tick, of a machine that is driven.

    A contradiction is a fault only where nothing else explains it: it counts if it begins while the robot is calm.

    Attributes:
        doubts: What is doubted at present, such as "encoder of left_knee frozen"; empty when all agrees.
    """

    def __init__(self, robot: Robot, dt: float, channels: tuple[str, ...]) -> None:
        """Prepare for a robot, a control period, s, and the names of the numbers that `update` gets."""
        self._robot, self._dt = robot, dt
        self._names = [sole.name for sole in robot.soles]
        self._frozen, self._integrals = FrozenReadings(robot, channels), IntegralComparison(robot, dt)
        self._gain = lag_gain(dt, LOADS.low_pass)
        self._smoothing, self._slowly = lag_gain(dt, SMOOTHING), lag_gain(dt, CALM.mean)
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, robot.half_sitting)
        height = float(data.oMf[robot.frame_id(robot.imu_frame)].translation[2])  # of the IMU
        self._legs, self._gyroscope = LegComparison(dt, height), GyroscopeComparison(dt)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.doubts: tuple[str, ...] = ()
        self._time, self._sensed = math.nan, False
        n = len(self._names)
        self._parts = [1.0 / n] * n  # of the weight that the feet bear, low-passed
        self._gravity, self._stood, self._rotation = 1.0, 0.0, STILL
        self._since = [0.0, 0.0, 0.0, 0.0]
        self._calm, self._shaken, self._rate = 0.0, 0j, np.zeros(3)
        self._slips, self._slipped = [0.0] * n, [0.0] * n
        for part in (self._frozen, self._integrals, self._legs, self._gyroscope):
            part.reset()

    def update(
        self, values: Array, measurement: Measurement, observer: Observer, commanded: Array | None = None
    ) -> None:
        """Compare the sensors of one tick.

        Args:
            values: All numbers of the measurement, in the order of the channels.
            measurement: The measurement.
            observer: Observer that has seen it.
            commanded: Accelerations that the last solution asked of the estimated robot, shape (nv,); None if there are
                none.
        """
        passed, self._time = measurement.time - self._time, measurement.time
        base = None if commanded is None else (commanded[:6], observer.robot.v[:6])
        doubts = self._frozen.update(values)
        self._integrals.update(values, base, passed)
        drifts = self._integrals.drifts
        if self._integrals.behind >= UNMET:
            doubts.append("the trunk does not accelerate as commanded: weak drives, or something holds it")
        if measurement.wrench_source == "sensor":
            self._sensed = True
        elif self._sensed:
            doubts.append("force sensors silent, wrenches estimated")
        weight, gain = self._robot.mass * GRAVITY, self._gain
        loads = [row[2] for row in measurement.wrenches.tolist()]
        force = observer.inertial.rotation.dot(measurement.specific_force).tolist()
        self._watch_calm(complex(force[0], force[1]), measurement)
        self._gravity += gain * (force[2] / GRAVITY - self._gravity)
        self._parts = [
            part + gain * (load / weight - part) for part, load in zip(self._parts, loads, strict=True)
        ]
        doubts += self._compare_legs(observer, force, blind=measurement.wrench_source != "sensor")
        doubts += self._slipping(observer.rest.slides)
        doubts += self._contradictions(observer.foot_rotations, loads, weight)
        if not (doubts or drifts or self.doubts):
            return
        found = tuple(drifts or dict.fromkeys(doubts))  # an encoder that drifts explains the rest
        if found and found != self.doubts:
            logger.error("measurement at %.4f s: %s", measurement.time, "; ".join(found))
        self.doubts = found

    def _compare_legs(self, observer: Observer, force: Vector, *, blind: bool) -> list[str]:
        """Compare legs, force sensors and gyroscope; the specific force is in the world, m/s², `blind` as estimated."""
        doubts: list[str] = []
        legs, rotations = self._legs, observer.foot_rotations
        legs.move(observer.foot_velocities, rotations, observer.load_shares, force)
        if not blind:
            legs.compare(self._parts, self._gravity)
            if legs.swapped:
                doubts.append("force sensors swapped between the feet")
            if legs.silent is not None:
                doubts.append(f"force sensor of {self._names[legs.silent]} too low for the weight")
        carries = [turn for turn, share in zip(rotations, observer.rest.shares, strict=True) if share >= 0.5]
        steady = self._calm >= CALM.time and sum(self._parts) >= LOADS.least_weight
        if self._gyroscope.update(
            carries[-1] if carries else STILL,
            observer.inertial.correction.unexplained,
            blind=blind,
            steady=steady,
            turns=legs.turns,
        ):
            doubts.append("gyroscope contradicts accelerometer and legs")
        return doubts

    def _watch_calm(self, horizontal: complex, measurement: Measurement) -> None:
        """Follow how long the robot has been calm, by its horizontal acceleration, m/s², and its rate."""
        self._shaken += self._smoothing * (horizontal - self._shaken)
        change = measurement.angular_velocity - self._rate
        self._rate += self._slowly * change
        shaken = abs(self._shaken) > CALM.acceleration or float(change.dot(change)) > CALM.change**2
        self._calm = 0.0 if shaken else self._calm + self._dt

    def _slipping(self, slides: Sequence[bool]) -> list[str]:
        """Name the feet that slip along the ground, or have just done so."""
        for i, slips in enumerate(slides):
            self._slips[i] = self._slips[i] + self._dt if slips else 0.0
            self._slipped[i] = SLIPPED if self._slips[i] >= SLIPS else self._slipped[i] - self._dt
        return [f"{name} slips" for name, left in zip(self._names, self._slipped, strict=True) if left > 0.0]

    def _contradictions(self, rotations: Sequence[Vector], loads: list[float], weight: float) -> list[str]:
        """Return what loads, gravity and the turns of the feet contradict, if it has begun while the robot was calm."""
        stands = min(loads) > LOADS.carries * weight or (self._stood > LOADS.standing and self._legs.together)
        self._stood = self._stood + self._dt if stands else 0.0
        alike = _common(rotations) if self._stood > LOADS.standing else STILL
        self._rotation = part_way(self._rotation, alike, self._gain)
        total, gravity = sum(self._parts), self._gravity
        wrong = (
            gravity > LOADS.gravity and total < LOADS.least_weight,
            total > LOADS.most_weight * max(gravity, 1.0),
            gravity < LOADS.gravity and total > LOADS.least_weight,
            math.hypot(*self._rotation) > LOADS.rotation,
        )
        if True not in wrong:
            self._since = [0.0] * len(wrong)
            return []
        for i, is_wrong in enumerate(wrong):
            begun = self._since[i] > 0.0 or self._calm >= CALM.time
            self._since[i] = self._since[i] + self._dt if is_wrong and begun else 0.0
        silent = [name for name, load in zip(self._names, loads, strict=True) if load < LOADS.silent * weight]
        told = (
            f"force sensor of {' or '.join(silent or self._names)} too low for the weight",
            "force sensors too high for the weight",
            "accelerometer without gravity",
            "encoders and gyroscope disagree",
        )
        return [what for what, since in zip(told, self._since, strict=True) if since >= LOADS.lasting]


def _common(rotations: Sequence[Vector]) -> Vector:
    """Return the angular velocity that the two feet have in common; zero if they turn differently."""
    (a, b, c), (d, e, f) = rotations
    mean = 0.5 * (a + d), 0.5 * (b + e), 0.5 * (c + f)
    return mean if math.hypot(a - d, b - e, c - f) < math.hypot(*mean) else STILL
