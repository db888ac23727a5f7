"""Plausibility of measurements: impossible readings are refused signal by signal, before the observer sees them.

A reading that the robot cannot produce (an encoder beyond its range or faster than its joint, a gyro beyond its range,
a foot that carries ten times the weight) is replaced by a prediction for a short time. If it lasts, the tick fails and
the control follows its failure policy. What a robot balances without is left out instead: torques of joints and
wrenches of hands at once, wrenches on the soles when the prediction ends. Time stamps that jump are refused without
being adopted.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from wbc.base.errors import MeasurementError
from wbc.base.numbers import FLOAT64, ROUNDING, Array
from wbc.base.settings import Count, NonNegative, Positive, settings
from wbc.base.vectors import largest
from wbc.core.estimation.checks.refusal import WRENCH, OptionalSignals, Refusal, few, numbers_of
from wbc.core.estimation.checks.stamps import Stamps, stamp_of
from wbc.core.robot import GRAVITY, UNLIMITED, Robot
from wbc.core.signals import SIGNALS, Measurement

logger = logging.getLogger(__name__)


@settings
class PlausibilitySettings:
    """Ranges of measurements, and the time for which a refused signal is predicted.

    Attributes:
        velocity_margin: A joint velocity is refused above this multiple of the joint's limit, and an encoder that moves
            faster.
        position_margin: An encoder is refused this far beyond the joint's range, rad; for a sliding joint, the length
            that counts as much (`Robot.per_rad`).
        position_jump: Jump of an encoder that is accepted on top of what its joint can travel in a period, rad; for a
            sliding joint, the length that counts as much.
        gyro_range: Largest angular rate of the gyroscope, rad/s; 35 rad/s are 2,000 °/s, the range of common units.
        gyro_jump: Largest change of an angular rate in a period, rad/s.
        accelerometer_range: Largest specific force, m/s²; 160 m/s² are 16 g, the range of common units.
        force_ratio: A sole's or a hand's force is refused above this multiple of the robot's weight; its moment above
            that force times the length of the sole.
        torque_margin: Measured torques are refused where one is above this multiple of the joint's limit.
        hold: Time for which a refused signal is replaced by a prediction before the tick fails, s.
        frozen_after: Number of identical measurements in a row after which ticks fail. A tick then fails
            in two cases: the clock stands still as well, or most readings changed before and the robot is not at rest.
        max_gap: Largest step of the time stamp, in control periods.
        resync: Time for which stamps must have moved on consistently before a jump of the clock is adopted, s.
    """

    velocity_margin: Annotated[float, Field(ge=1.0)] = 2.0
    position_margin: Annotated[NonNegative, "rad"] = 0.2
    position_jump: Annotated[Positive, "rad"] = 0.05
    gyro_range: Annotated[Positive, "rad/s"] = 35.0
    gyro_jump: Annotated[Positive, "rad/s"] = 15.0
    accelerometer_range: Annotated[Positive, "m/s²"] = 160.0
    force_ratio: Annotated[Positive, ""] = 10.0
    torque_margin: Annotated[float, Field(ge=1.0)] = 3.0
    hold: Annotated[NonNegative, "s"] = 0.05
    frozen_after: Count = 20
    max_gap: Count = 20
    resync: Annotated[Positive, "s"] = 0.03


RESTS = 1e-4
"""Speed of joints and gyroscope up to which a robot may rest, rad/s."""

QUIET = 1.0
"""Time for which a sensor must have been good before the log names it again, s."""

HINT = "wbc.conformance(loop) finds wrong units, signs and orders"
"""Advice of the first message about a sensor."""


class Plausibility:
    """Checks every measurement of a control and repairs what it can.

    Attributes:
        settings: Its `PlausibilitySettings`.
        names: Name of the sensor of every number of a measurement, in the order of `values`.
        stamps: Check of the time stamps; `pace` is its sentence.
        reasons: Readings of the encoders, the IMU and the soles that are refused at present, the worst of each sensor.
    """

    def __init__(self, robot: Robot, dt: float, settings: PlausibilitySettings | None = None) -> None:
        """Take the ranges from a robot with feet; dt is the control period, s."""
        self.settings = s = settings or PlausibilitySettings()
        self._dt = dt
        self.stamps = Stamps(dt, s.max_gap, s.resync)
        n, na = len(robot.soles), robot.na
        self._na = na
        self._shapes = ((na,), (na,), (3,), (3,), (n, 6))
        self._weight = robot.mass * GRAVITY
        self._optional = OptionalSignals(robot, s.force_ratio * self._weight, s.torque_margin)
        # What every number is compared with, and how far it may be from there: its range, and its last value.
        self._centres = np.zeros((2, 2 * na + 6 + 6 * n))
        self._most = np.full(self._centres.shape, np.finfo(float).max)
        self._excess = np.zeros(self._centres.shape)
        self._all_excess = self._excess.reshape(-1)
        self._middle, self._bound = self._centres[0], self._most[0]
        speed = robot.velocity_limit
        self._speed = np.where(speed < UNLIMITED, s.velocity_margin * speed, 1e3)
        self._step = self._speed * dt + s.position_jump * robot.per_rad
        self._most[1, 2 * na : 2 * na + 3] = s.gyro_jump
        self._set_ranges(robot)
        self._channels = (
            *(f"encoder of {joint}" for joint in robot.joint_names),
            *(f"velocity of {joint}" for joint in robot.joint_names),
            "gyroscope",
            "accelerometer",
            *(f"force sensor of {sole.name}" for sole in robot.soles),
        )
        self._groups = np.concatenate(  # channel of each number of a measurement
            [np.arange(2 * na), np.repeat([2 * na, 2 * na + 1], 3), np.repeat(2 * na + 2 + np.arange(n), 6)]
        )
        self.names = tuple(self._channels[group] for group in self._groups)
        lengths = ["m" if slides else "rad" for slides in robot.slides]
        self._units = (*lengths, *(f"{unit}/s" for unit in lengths), *["rad/s"] * 3, *["m/s²"] * 3)
        self._units += WRENCH * n
        self.reset()

    def _set_ranges(self, robot: Robot) -> None:
        """Set the middle of the range of every number, and its greatest distance from there."""
        s, na, bound = self.settings, self._na, self._bound
        lower, upper = robot.position_lower, robot.position_upper
        known = np.isfinite(lower) & np.isfinite(upper)
        self._middle[:na][known] = 0.5 * (lower[known] + upper[known])
        bound[:na][known] = (0.5 * upper - 0.5 * lower + s.position_margin * robot.per_rad)[known]
        bound[na : 2 * na] = self._speed
        bound[2 * na : 2 * na + 3], bound[2 * na + 3 : 2 * na + 6] = s.gyro_range, s.accelerometer_range
        force = s.force_ratio * self._weight
        for i, sole in enumerate(robot.soles):
            at = 2 * na + 6 + 6 * i
            bound[at : at + 3], bound[at + 3 : at + 6] = force, force * sole.length

    def reset(self) -> None:
        """Forget the past; the next measurement is taken as the first one."""
        self.reasons: tuple[Refusal, ...] = ()
        self._left_out: Sequence[Refusal] = ()  # of signals that a robot balances without
        self._refused_at: dict[str, float] = {}  # sensor → time of its last refusal, s
        self._values: Array | None = None
        self.stamps.reset()
        self._identical, self._changed_at, self._sudden = 0, math.nan, False
        self._older: Array | None = None  # readings before the last ones
        self._last_for(np.zeros(len(self._channels)))
        self._repeated: tuple[str, ...] = ()  # the sentence that the last tick brought nothing new

    def check(
        self, measurement: Measurement, *, forgiven: NDArray[np.bool_] | None = None
    ) -> tuple[Measurement, bool]:
        """Return a measurement that can be used, and True where its clock was adopted anew: no time has passed then.

        Encoders of the joints that are `forgiven`, shape (na,), fail no tick: somebody else moves these joints.

        Refused readings are replaced by predictions, and `sole_wrench` is None while a force sensor is longer
        refused than `hold`. Raises `MeasurementError` for one that cannot be used: of a wrong kind, a time stamp that
        jumped, other readings refused for longer than `hold`, or the same again and again.
        """
        m, unformed = self._formed(measurement)
        wrenches = m.wrenches.reshape(-1)
        values = np.concatenate(
            (m.joint_position, m.joint_velocity, m.angular_velocity, m.specific_force, wrenches)
        )
        last, stamps, before = self._values, self.stamps, self.stamps.time
        stamp = m.time if type(m.time) is float else stamp_of(m.time)
        same = last is not None and (
            values[0] == last[0]
            and values[2 * self._na] == last[2 * self._na]
            and np.array_equal(values, last)
        )
        renewed = stamps.take(stamp, first=last is None, same=same)
        if stamps.time is not m.time:
            m = replace(m, time=stamps.time)
        self._repeated = ()
        if same:
            self._check_frozen(values, stamp)
        else:
            self._older, self._identical, self._changed_at = last, 0, stamp
        if self._within(values, last) and not self.reasons:
            self._values = values
        else:
            passed = stamps.time - before
            passed = passed if passed > 0.0 and not renewed else self._dt
            m = self._repair(m, values, passed, forgiven, unformed)
        m, left_out = self._optional.check(m)
        if left_out or self._left_out:
            self._say(m.time, left_out)
            self._left_out = left_out
        return m, renewed

    def _last_for(self, times: Array) -> None:
        """Take the times for which sensors have been refused, s; an encoder may have travelled meanwhile."""
        self._lasting = times
        self._most[1, : self._na] = self._step + self._speed * times[: self._na]

    def _within(self, values: Array, last: Array | None) -> bool:
        """Return True if all numbers are in their ranges and have not jumped from the last ones; False for NaN."""
        self._centres[1] = values if last is None else last
        excess = np.subtract(values, self._centres, out=self._excess)
        np.abs(excess, out=excess)
        excess -= self._most
        return largest(self._all_excess) <= 0.0

    @property
    def faults(self) -> tuple[str, ...]:
        """Sensors refused at present, such as "encoder of left_knee", or a measurement that repeats the last one."""
        return *(each.sensor for each in (*self.reasons, *self._left_out)), *self._repeated

    @property
    def values(self) -> Array:
        """All numbers of the last measurement that was let through, shape (2 na + 6 + 6 · number of soles,)."""
        assert self._values is not None
        return self._values

    def joints(self, measurement: Any) -> tuple[Array, Array]:
        """Return joint positions and velocities as they came, each of shape (na,), rad and rad/s (or m and m/s).

        A reading that is impossible, or refused at present, is NaN.
        """
        n = self._na
        try:
            position, velocity = (numbers_of(measurement, name, (n,)) for name in SIGNALS[:2])
        except (MeasurementError, AttributeError):  # of another shape, or no measurement
            return np.full(n, np.nan), np.full(n, np.nan)
        values = np.concatenate((position, velocity))
        good = np.abs(values - self._middle[: 2 * n]) <= self._bound[: 2 * n]
        if self.reasons:
            good &= self._lasting[: 2 * n] == 0.0
        if not good.all():
            values[~good] = np.nan
        return values[:n], values[n:]

    def _formed(self, m: Any) -> tuple[Measurement, str]:
        """Return the measurement with arrays of the right type and shape, and what is wrong with its wrenches."""
        if not isinstance(m, Measurement):
            raise MeasurementError(f"a measurement must be a Measurement, got {type(m).__name__}")
        given = m.joint_position, m.joint_velocity, m.angular_velocity, m.specific_force, m.sole_wrench
        for got, of_shape in zip(given, self._shapes, strict=True):
            if type(got) is not np.ndarray or got.dtype is not FLOAT64 or got.shape != of_shape:
                shapes = dict(zip(SIGNALS, self._shapes, strict=True))
                arrays: dict[str, Any] = {name: numbers_of(m, name, shapes[name]) for name in SIGNALS[:-1]}
                unformed = ""
                try:
                    arrays[SIGNALS[-1]] = numbers_of(m, SIGNALS[-1], shapes[SIGNALS[-1]])
                except MeasurementError as error:
                    unformed = str(error)
                    arrays[SIGNALS[-1]] = np.full(shapes[SIGNALS[-1]], np.nan)
                return replace(m, **arrays), unformed
        return m, ""

    def _check_frozen(self, values: Array, stamp: float) -> None:
        """Count a measurement that repeats the last one, and raise where sensors that work do not repeat themselves.

        Readings that are rounded, and physics that come to an exact rest, repeat themselves as well: few change in the
        tick before, or all speeds are zero.
        """
        self._identical += 1
        if self._identical == 1:
            older, n = self._older, self._na
            speeds = values[n : 2 * n + 3]  # of joints and gyroscope
            most = older is not None and 2 * np.count_nonzero(values != older) > values.size
            self._sudden = bool(most and np.abs(speeds).max() > RESTS)
        if self._identical >= self.settings.frozen_after and (self._sudden or stamp == self._changed_at):
            self._repeated = ("the same measurement again",)
            raise MeasurementError(f"the same measurement for the {self._identical + 1}th time in a row")

    def _reason(self, channel: int, values: Array, wrong: NDArray[np.bool_], unformed: str) -> Refusal:
        """Return why a sensor is refused, by the number of it that is farthest beyond its bounds, or is none."""
        numbers = np.flatnonzero(wrong & (self._groups == channel))
        beyond = np.abs(values - self._middle)[numbers] / self._bound[numbers]
        worst = int(numbers[np.argmax(np.nan_to_num(beyond, nan=np.inf))])
        why = unformed if channel >= 2 * self._na + 2 else ""
        value, (middle, last) = float(values[worst]), self._centres[:, worst].tolist()
        bound, travel = self._most[:, worst].tolist()
        low, high = middle - bound, middle + bound
        jump = low <= value <= high
        if jump:
            low, high = max(low, last - travel), min(high, last + travel)
        return Refusal(self.names[worst], value, low, high, self._units[worst], jump, why)

    def _say(self, time: float, reasons: Sequence[Refusal]) -> None:
        """Log the sensors that are refused for the first time, or after a while in which they were good."""
        news = [r for r in reasons if not 0.0 <= time - self._refused_at.get(r.sensor, -math.inf) < QUIET]
        if news:
            hint = "" if self._refused_at else f"; {HINT}"
            logger.error("measurement at %.4f s: %s refused%s", time, few(news), hint)
        self._refused_at |= {each.sensor: time for each in reasons}

    def _repair(
        self, m: Measurement, values: Array, dt: float, others: NDArray[np.bool_] | None, unformed: str
    ) -> Measurement:
        """Replace impossible readings by predictions over the time that has passed, s, or give up if they last.

        Joints of `others` are forgiven; `unformed` is what is wrong with the wrenches as they came.
        """
        na, last = self._na, self._values
        wrong: NDArray[np.bool_] = ~np.logical_and.reduce(self._excess <= 0.0)  # NaN is wrong
        bad = np.zeros(len(self._channels), dtype=bool)
        bad[self._groups[wrong]] = True
        self.reasons = tuple(
            self._reason(channel, values, wrong, unformed) for channel in np.flatnonzero(bad).tolist()
        )
        self._say(m.time, self.reasons)
        self._last_for(np.where(bad, self._lasting + dt, 0.0))
        if not self.reasons:
            self._values = values
            return m
        needed, longest = 2 * na + 2, self.settings.hold + ROUNDING  # a robot balances without force sensors
        others = np.zeros(na, dtype=bool) if others is None else others
        lasting = float(self._lasting[:needed][~np.concatenate((others, others, [False, False]))].max())
        if (last is None and bad[:needed].any()) or lasting > longest:
            raise MeasurementError(f"{few(self.reasons)} refused for {lasting:.3f} s; {HINT}")
        lost = last is None or bool((self._lasting[needed:] > longest).any())
        self._values = repaired = self._predicted(values, bad, dt, others)
        parts = np.split(repaired, [na, 2 * na, 2 * na + 3, 2 * na + 6])
        arrays: dict[str, Any] = {
            name: part.reshape(shape) for name, part, shape in zip(SIGNALS, parts, self._shapes, strict=True)
        }
        return replace(m, **arrays | ({"sole_wrench": None} if lost else {}))

    def _predicted(
        self, values: Array, bad: NDArray[np.bool_], dt: float, others: NDArray[np.bool_]
    ) -> Array:
        """Return all numbers, those of bad sensors predicted over the time that has passed, s."""
        na, last = self._na, np.zeros_like(values) if self._values is None else self._values
        predicted = values.copy()
        replaced = bad[self._groups]
        predicted[replaced] = last[replaced]
        position, velocity = predicted[:na], predicted[na : 2 * na]  # views
        encoders, rates = bad[:na], bad[na : 2 * na]
        velocity[rates & ~encoders] = ((values[:na] - last[:na]) / dt)[rates & ~encoders]
        np.clip(velocity, -self._speed, self._speed, out=velocity)
        forgiven = encoders & others  # such a joint may stay where it is: it is where it says, in range
        velocity[forgiven] = 0.0
        position[encoders] += dt * velocity[encoders]
        read = forgiven & np.isfinite(values[:na])
        low, high = (self._middle + sign * self._bound for sign in (-1.0, 1.0))
        position[read] = np.clip(values, low, high)[:na][read]
        return predicted
