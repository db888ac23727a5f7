"""One run of the checks: small motions of a robot at half-sitting, and what is measured meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.errors import MeasurementError, shown
from wbc.base.numbers import Array
from wbc.core.robot import GRAVITY
from wbc.core.signals import Command, Measurement
from wbc.core.trajectories import minimum_jerk
from wbc.machine.conformance.causes import CAUSES, RATIOS
from wbc.machine.loads import SoleLoads
from wbc.machine.loop import Loop

DEGREES = 57.2958
"""Degrees in a radian."""

STANDS = 0.05
"""Share of the weight from which on the soles carry a robot that stands."""

Record = dict[str, Array]
"""Signals of one motion by their name in a `Measurement`, one row a control period, NaN where nothing is measured."""


def settled(rows: Array) -> Array:
    """Return the mean over the last third of a motion."""
    mean: Array = rows[-max(1, len(rows) // 3) :].mean(axis=0)
    return mean


@dataclass(frozen=True)
class Check:
    """Result of one check.

    Attributes:
        name: What was looked at.
        state: "ok", "wrong" or "unknown": not to be told because of another fault, or without the sensor.
        found: Figures.
        cause: Probable cause of a wrong result, and its symptom in a controller; empty if it is not wrong.
    """

    name: str
    state: Literal["ok", "wrong", "unknown"]
    found: str
    cause: str = ""


class FreeMotion(NamedTuple):
    """Torques and velocity references that move free joints a little, and how far they do."""

    torque: Array  # shape (na,), Nm (or N)
    velocity: Array  # shape (na,), rad/s (or m/s)
    pushed: Array  # by the torques, shape (na,), rad (or m)
    dragged: Array  # by the velocity references, shape (na,), rad (or m)


class Posture(NamedTuple):
    """Robot in a posture: placements of its soles, centre of mass, m, and rotation of the IMU."""

    soles: list[pin.SE3]
    com: Array
    imu: Array


class Session:
    """One run of the checks.

    Attributes:
        delay: Delay that the loop is known to have, s.
        robot: The robot; reference: its joints at half-sitting, shape (na,); gains: kp and kd of its description.
        free: Joints beside the legs: what acts on them moves them.
        jolt: A tenth of the torque limits of these joints, of all joints where there are none, shape (na,), Nm.
        shapes: Shape of each signal of a measurement.
        checks: Results so far by the names of the checks.
        records: All motions so far.
        rest: The first of them, half-sitting held; from `settle` on, as the next one.
        standing: True if the robot stands, by its force sensors or else by the torques of its joints.
        lost: Reason why no further check can be made; empty while they can.
        free_motion: Motion of the free joints by their own gains; None until it has been tried.
    """

    rest: Record
    standing: bool

    def __init__(self, loop: Loop, delay: float) -> None:
        """Begin; nothing is sent."""
        self._loop, self.period, self.delay, about = loop, loop.control_period, delay, loop.description
        self.robot = robot = about.robot()
        self.reference, self._zero = np.array(robot.half_sitting[7:]), np.zeros(robot.na)
        self.weight = robot.mass * GRAVITY
        self.gains = np.array(about.kp), np.array(about.kd)
        legs = {name for leg in about.legs for name in leg}
        self.free = [i for i, name in enumerate(robot.joint_names) if name not in legs]
        self.jolt = 0.1 * np.minimum(robot.torque_limit, 1e3)
        if self.free:
            self.jolt[[name in legs for name in robot.joint_names]] = 0.0
        joints = dict.fromkeys(("joint_position", "joint_velocity", "joint_torque"), (robot.na,))
        imu = dict.fromkeys(("angular_velocity", "specific_force"), (3,))
        wrenches = {"sole_wrench": (len(robot.soles), 6), "hand_wrenches": (len(robot.frames), 6)}
        self.shapes: dict[str, tuple[int, ...]] = {"time": (), **joints, **imu, **wrenches}
        self.checks: dict[str, Check] = {}
        self.records: list[Record] = []
        self.lost = ""
        self.free_motion: FreeMotion | None = None

    def check(self, name: str, found: str, **wrong: object) -> None:
        """Add a check, which is wrong if a condition holds; the first one that does names one of its `CAUSES`."""
        cause = next((CAUSES[name][key] for key, holds in wrong.items() if holds), "")
        self.checks[name] = Check(name, "wrong" if cause else "ok", found, cause)

    def right(self, name: str, ratio: float) -> bool:
        """Return True if the ratio of a check is in its range; see `RATIOS`."""
        low, high = RATIOS[name]
        return low < ratio < high

    def unknown(self, name: str, why: str) -> None:
        """Add a check that cannot be made."""
        self.checks[name] = Check(name, "unknown", why)

    def good(self, *names: str) -> bool:
        """Return False if one of these checks has failed or could not be made."""
        return all(self.checks[name].state == "ok" for name in names if name in self.checks)

    @property
    def confused(self) -> str:
        """Reason why checks that need the joints as they are cannot be made; empty if they can."""
        good = self.good("joint order", "joint motion")
        return "" if good else "joints are not measured as they should"

    def some(self, joints: Sequence[int]) -> str:
        """Return the names of the first few joints."""
        return ", ".join(self.robot.joint_names[i] for i in joints[:4])

    def measure(self) -> Measurement:
        """Return the measurement now; a MeasurementError if it is something else."""
        measurement = self._loop.measure()
        if not isinstance(measurement, Measurement):
            raise MeasurementError(f"measure() of a loop must return a Measurement, got {shown(measurement)}")
        return measurement

    def settle(self) -> None:
        """Hold half-sitting, and see whether the robot stands."""
        self.rest = self.hold(0.15)
        rest: dict[str, Any] = {name: settled(rows) for name, rows in self.rest.items()}
        for name in ("sole_wrench", "joint_torque", "hand_wrenches"):
            rest[name] = rest[name] if np.isfinite(rest[name]).all() else None
        loads = SoleLoads(self._loop.description, self.period, self.gains)
        wrench = loads.wrenches(Measurement(**rest))  # of the joints where no force sensor has measured one
        self.standing = float(np.abs(wrench[:, 2]).sum()) > STANDS * self.weight

    def hold(
        self,
        seconds: float,
        torque: Array | None = None,
        velocity: Array | None = None,
        gains: tuple[Array | None, Array | None] = (None, None),
    ) -> Record:
        """Hold half-sitting for a time, s; feed-forward torques and velocity references are zero when None.

        The gains kp and kd are those of the drives when None.
        """
        tau, rate = (self._zero if value is None else value for value in (torque, velocity))
        command = Command(tau, self.reference, rate, kp=gains[0], kd=gains[1])
        return self._run([command] * self._ticks(seconds))

    def move(self, step: Array, seconds: float) -> tuple[Record, Record]:
        """Move the references by a step (shape (na,), rad) and hold there, then come back; return both records."""
        shape, slope = self.profile(seconds)
        rates = 2.0 / (len(shape) * self.period) * slope
        there, back = (
            [Command(self._zero, self.reference + a * step, b * step) for a, b in zip(way, pace, strict=True)]
            for way, pace in ((shape, rates), (1.0 - shape, -rates))
        )
        return self._run(there), self._run(back)

    def profile(self, seconds: float) -> tuple[Array, Array]:
        """Return the motion from 0 to 1 of `move`, its second half at rest, and its slope, each of shape (ticks,)."""
        n = self._ticks(seconds)
        shares: Array = np.clip(2.0 * np.arange(1, n + 1) / n, 0.0, 1.0)
        return minimum_jerk(shares)

    def _ticks(self, seconds: float) -> int:
        return max(6, round(seconds / self.period))

    def _run(self, commands: list[Command]) -> Record:
        rows = []
        for command in commands:
            self._loop.step(command)
            rows.append(self.measure())
        record = {}
        for name, shape in self.shapes.items():
            values, none = [getattr(row, name) for row in rows], np.full(shape, np.nan)
            record[name] = np.array([none if value is None else value for value in values])
        self.records.append(record)
        return record

    def posture(self, position: Array | None = None) -> Posture:
        """Return the robot with joints at positions, half-sitting when None, and its base as there."""
        robot = self.robot
        q = np.array(robot.half_sitting)
        if position is not None:
            q[7:] = position
        robot.update(q, np.zeros(robot.nv))
        soles = [pin.SE3(robot.placement(sole.frame)) for sole in robot.soles]
        return Posture(soles, robot.com.copy(), np.array(robot.placement(robot.imu_frame).rotation))
