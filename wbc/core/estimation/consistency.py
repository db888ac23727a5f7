"""Consistency of sensors with each other: what lasts and is possible, but cannot all be true.

The check of the accelerometer works in every tick: it changes what is used. The monitor refuses nothing: it names what
it doubts, for the log and for `status()` of a control, and works where a machine is driven (`DriveControl.watch`).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array, lag_gain
from wbc.base.vectors import Vector, part_way
from wbc.core.estimation.foot import STILL
from wbc.core.estimation.frozen import FrozenReadings
from wbc.core.estimation.integrals import UNMET, IntegralComparison
from wbc.core.estimation.legs import LASTING, SMOOTHING, GyroscopeComparison, LegComparison
from wbc.core.estimation.observer import Observer
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Measurement

logger = logging.getLogger(__name__)

TIME_CONSTANT = 0.05
"""Low-pass of the compared signals, s."""

WEIGHT_SHARE = 0.6
"""Least part of the weight that the soles must carry."""

WEIGHT_EXCESS = 2.0
"""Greatest part of the weight that the soles may carry."""

GRAVITY_SHARE = 0.6
"""Least part of gravity that the accelerometer must show, upwards as estimated."""

# A push, and the steps that catch it, pull at robot and feet as no model knows: contradictions that begin then count
# for nothing.
CALM = 0.3
"""Time for which a robot must have been calm when a contradiction begins, s."""

SHAKEN = 2.0
"""Horizontal acceleration from which on a robot is not calm, m/s²."""

TURNED = 0.2
"""Change of the trunk's rate against its mean over `SLOWLY` from which on a robot is not calm, rad/s."""

SLOWLY = 0.1
"""Time of that mean, s."""

FOOT_ROTATION = 0.5
"""Greatest speed at which both feet on the ground may turn alike, by encoders and gyroscope, rad/s, once both have
stood for `STANDING`: in a walk both may roll over the edges of stones or boards."""

SLIPS = 0.02
"""Time for which a foot that carries must slip until it is named, s."""

SLIPPED = 0.3
"""Time for which it is named after that, s."""

CONTRADICTS = 3.5
"""Horizontal acceleration that the accelerometer alone shows, from which on it is left out, m/s²."""

AGREES = 2.0
"""The same below which it is used again, m/s²."""

STANDING = 0.5
"""Time for which every foot must have carried `CARRIES`, s: landing feet jerk the legs and their loads."""

CARRIES = 0.15
"""Share of the load from which on a foot carries."""

MEAN = 0.015
"""Time constant of the accelerations that are compared, s."""


class AccelerometerCheck:
    """Check of the direction of the specific force against attitude, legs and ground forces.

    A robot that stands and whose accelerometer points elsewhere than up accelerates: so the legs move, and the ground
    pushes it. While neither is so, the accelerometer is left out, and the robot is taken to keep its speed.

    Attributes:
        left_out: True while the accelerometer is left out.
    """

    def __init__(self, dt: float) -> None:
        """Start at rest; dt is the control period, s."""
        self._dt, self._gain = dt, lag_gain(dt, MEAN)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.left_out = False
        self._shown = self._moved = 0j
        self._stands = 0.0  # time for which every foot has carried, s
        self._legs: Vector | None = None
        self._time = 0.0  # of the last measurement, s

    def check(self, measurement: Measurement, observer: Observer) -> Measurement:
        """Return a plausible measurement, without the accelerometer's direction where it contradicts all others."""
        inertial, before = observer.inertial, self._legs
        self._legs = legs = inertial.correction.legs
        passed, self._time = measurement.time - self._time, measurement.time
        self._stands = self._stands + self._dt if min(observer.rest.shares) > CARRIES else 0.0
        if before is None or legs is None or self._stands < STANDING:
            self._shown = self._moved = 0j
            self.left_out = False
            return measurement
        rotation = inertial.rotation
        x, y, _ = rotation.dot(measurement.specific_force).tolist()
        passed = passed if passed > 0.0 else self._dt  # more than a period where measurements are lost
        moved = complex(legs[0] - before[0], legs[1] - before[1]) / passed
        sooner = self._shown
        self._shown = shown = self._shown + self._gain * (complex(x, y) - self._shown)
        self._moved += self._gain * (moved - self._moved)
        least = AGREES if self.left_out else CONTRADICTS
        # Velocities of joints may show a push a period later than the accelerometer does.
        left_out = abs(shown) > least and min(abs(shown - self._moved), abs(sooner - self._moved)) > least
        if left_out and not self.left_out:
            force = observer.net_wrench[:2] / observer.robot.mass
            left_out = abs(shown - complex(*force.tolist())) > least
            if left_out:
                logger.error(
                    "measurement at %.4f s: accelerometer contradicts attitude and legs", measurement.time
                )
        self.left_out = left_out
        return replace(measurement, specific_force=GRAVITY * rotation[2]) if left_out else measurement


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
        self._gain = lag_gain(dt, TIME_CONSTANT)
        self._smoothing, self._slowly = lag_gain(dt, SMOOTHING), lag_gain(dt, SLOWLY)
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, robot.half_sitting)
        height = float(data.oMf[robot.frame_id(robot.imu_frame)].translation[2])  # of the IMU
        self._legs, self._gyroscope = LegComparison(dt, height), GyroscopeComparison(dt)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.doubts: tuple[str, ...] = ()
        self._time, self._sensed = math.nan, False
        self._shares = [1.0 / len(self._names)] * len(self._names)
        self._gravity, self._stood, self._rotation = 1.0, 0.0, STILL
        self._since = [0.0, 0.0, 0.0, 0.0]
        self._calm, self._shaken, self._rate = 0.0, 0j, np.zeros(3)
        self._slips, self._slipped = [0.0] * len(self._names), [0.0] * len(self._names)
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
        drifts = self._integrals.update(values, base, passed)
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
        self._shares = [
            share + gain * (load / weight - share) for share, load in zip(self._shares, loads, strict=True)
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
            legs.compare(self._shares, self._gravity)
            if legs.swapped:
                doubts.append("force sensors swapped between the feet")
            if legs.silent is not None:
                doubts.append(f"force sensor of {self._names[legs.silent]} too low for the weight")
        carries = [turn for turn, share in zip(rotations, observer.rest.shares, strict=True) if share >= 0.5]
        steady = self._calm >= CALM and sum(self._shares) >= WEIGHT_SHARE
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
        shaken = abs(self._shaken) > SHAKEN or float(change.dot(change)) > TURNED**2
        self._calm = 0.0 if shaken else self._calm + self._dt

    def _slipping(self, slides: Sequence[bool]) -> list[str]:
        """Name the feet that slip along the ground, or have just done so."""
        for i, slips in enumerate(slides):
            self._slips[i] = self._slips[i] + self._dt if slips else 0.0
            self._slipped[i] = SLIPPED if self._slips[i] >= SLIPS else self._slipped[i] - self._dt
        return [f"{name} slips" for name, left in zip(self._names, self._slipped, strict=True) if left > 0.0]

    def _contradictions(self, rotations: Sequence[Vector], loads: list[float], weight: float) -> list[str]:
        """Return what loads, gravity and the turns of the feet contradict, if it has begun while the robot was calm."""
        stands = min(loads) > CARRIES * weight or (self._stood > STANDING and self._legs.together)
        self._stood = self._stood + self._dt if stands else 0.0
        alike = _common(rotations) if self._stood > STANDING else STILL
        self._rotation = part_way(self._rotation, alike, self._gain)
        total, gravity = sum(self._shares), self._gravity
        wrong = (
            gravity > GRAVITY_SHARE > total,
            total > WEIGHT_EXCESS * max(gravity, 1.0),
            gravity < GRAVITY_SHARE < total,
            math.hypot(*self._rotation) > FOOT_ROTATION,
        )
        if True not in wrong:
            self._since = [0.0] * len(wrong)
            return []
        for i, is_wrong in enumerate(wrong):
            begun = self._since[i] > 0.0 or self._calm >= CALM
            self._since[i] = self._since[i] + self._dt if is_wrong and begun else 0.0
        silent = [name for name, load in zip(self._names, loads, strict=True) if load < 0.02 * weight]
        told = (
            f"force sensor of {' or '.join(silent or self._names)} too low for the weight",
            "force sensors too high for the weight",
            "accelerometer without gravity",
            "encoders and gyroscope disagree",
        )
        return [what for what, since in zip(told, self._since, strict=True) if since >= LASTING]


def _common(rotations: Sequence[Vector]) -> Vector:
    """Return the angular velocity that the two feet have in common; zero if they turn differently."""
    (a, b, c), (d, e, f) = rotations
    mean = 0.5 * (a + d), 0.5 * (b + e), 0.5 * (c + f)
    return mean if math.hypot(a - d, b - e, c - f) < math.hypot(*mean) else STILL
