"""One run of the checks: small motions of a robot at half-sitting, what is measured meanwhile, and the results."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, MeasurementError, shown
from wbc.core.robot import GRAVITY
from wbc.core.signals import Command, Measurement
from wbc.machine.conformance.rules import RULES
from wbc.machine.loads import SoleLoads
from wbc.machine.loop import Loop
from wbc.tasks.trajectories import minimum_jerk


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


@dataclass(frozen=True)
class ConformanceReport:
    """Results of all checks.

    Attributes:
        checks: In the order in which they were made.
    """

    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """True if nothing is wrong."""
        return not self.wrong

    @property
    def wrong(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return tuple(check for check in self.checks if check.state == "wrong")

    def __str__(self) -> str:
        lines = []
        for check in self.checks:
            lines.append(f"{check.state:9}{check.name:20}{check.found}")
            if check.cause:
                lines.append(f"{'':29}{check.cause}")
        return "\n".join(lines)


class Record(NamedTuple):
    """Measurements of one motion, one row a control period, NaN where nothing is measured."""

    position: Array
    velocity: Array
    torque: Array
    gyroscope: Array
    accelerometer: Array
    wrench: Array
    time: Array

    def settled(self, name: str) -> Array:
        """Return the mean of a signal over the last third."""
        values: Array = getattr(self, name)
        mean: Array = values[-max(1, len(values) // 3) :].mean(axis=0)
        return mean


class Session:
    """One run of the checks.

    Attributes:
        robot: The robot at half-sitting; reference: its joints there, shape (na,).
        gains: kp and kd of the description, each of shape (na,).
        push_limit: Torque limits, of which shares are commanded, shape (na,).
        free: Joints beside the legs: what acts on them moves them.
        checks: Results so far.
        records: Measurements of all motions so far.
        standing: True if the robot stands, by its force sensors or else by the torques of its joints.
        force_sensors: True if the loop measures sole wrenches.
    """

    def __init__(self, loop: Loop) -> None:
        """Begin; nothing is sent."""
        self._loop, self.period, self.description = loop, loop.control_period, loop.description
        self.robot = robot = self.description.robot()
        self.reference, self._zero = np.array(robot.half_sitting[7:]), np.zeros(robot.na)
        self.gains = np.array(self.description.kp), np.array(self.description.kd)
        legs = {name for leg in self.description.legs for name in leg}
        self.free = [i for i, name in enumerate(robot.joint_names) if name not in legs]
        self.push_limit = np.minimum(robot.torque_limit, 1e3)
        self.checks: list[Check] = []
        self.records: list[Record] = []

    def measure(self) -> Measurement:
        """Return the measurement now; a MeasurementError if it is something else."""
        measurement = self._loop.measure()
        if not isinstance(measurement, Measurement):
            raise MeasurementError(f"measure() of a loop must return a Measurement, got {shown(measurement)}")
        return measurement

    def hold(
        self,
        seconds: float,
        torque: Array | None = None,
        velocity: Array | None = None,
        gains: tuple[Array, Array] | None = None,
    ) -> Record:
        """Hold half-sitting, with a feed-forward torque or a velocity reference added, by gains of one's own."""
        tau = self._zero if torque is None else torque
        rate = self._zero if velocity is None else velocity
        kp, kd = gains or (None, None)
        return self._run([Command(tau, self.reference, rate, kp=kp, kd=kd)] * self._ticks(seconds))

    def move(self, step: Array, seconds: float) -> tuple[Record, Record]:
        """Move the references by a step (shape (na,), rad) and hold there, then come back; return both records."""
        shape, slope = self._profile(seconds)
        rates = 2.0 / (len(shape) * self.period) * slope
        there, back = (
            [Command(self._zero, self.reference + a * step, b * step) for a, b in zip(way, pace, strict=True)]
            for way, pace in ((shape, rates), (1.0 - shape, -rates))
        )
        return self._run(there), self._run(back)

    def profile(self, seconds: float) -> Array:
        """Return the motion from 0 to 1 that `move` makes, the second half of it at rest, shape (ticks,)."""
        return self._profile(seconds)[0]

    def _profile(self, seconds: float) -> tuple[Array, Array]:
        n = self._ticks(seconds)
        shares: Array = np.clip(2.0 * np.arange(1, n + 1) / n, 0.0, 1.0)
        return minimum_jerk(shares)

    def base_motion(self, com: Array, turn: Array) -> tuple[Array, Array]:
        """Return the joint motion that shifts the centre of mass and turns the base, the soles in their places.

        Args:
            com: Shift of the centre of mass, forward and to the left, shape (2,), m.
            turn: Rotation of the base about x, y and z of the world, shape (3,), rad.

        Returns:
            Change of the joint positions, shape (na,), and the configuration there, shape (nq,).
        """
        robot = self.robot
        model, data, q0 = robot.model, robot.data, np.array(robot.half_sitting)
        robot.update(q0, np.zeros(robot.nv))
        pin.computeJointJacobians(model, data, q0)
        *soles, base = (
            pin.getFrameJacobian(model, data, robot.frame_id(frame), pin.LOCAL_WORLD_ALIGNED)
            for frame in (*(sole.frame for sole in robot.soles), robot.base_frame)
        )
        rows = np.vstack([*soles, robot.com_jacobian[:2], base[3:]])
        target = np.concatenate([np.zeros(6 * len(soles)), com, turn])
        velocity = np.linalg.lstsq(rows, target, rcond=1e-6)[0]
        return velocity[6:], pin.integrate(model, q0, velocity)

    def _ticks(self, seconds: float) -> int:
        return max(6, round(seconds / self.period))

    def _run(self, commands: list[Command]) -> Record:
        rows = []
        for command in commands:
            self._loop.step(command)
            rows.append(self.measure())
        none, no_wrench = np.full(self.robot.na, np.nan), np.full((len(self.robot.soles), 6), np.nan)
        record = Record(
            np.array([m.joint_position for m in rows]),
            np.array([m.joint_velocity for m in rows]),
            np.array([none if m.joint_torque is None else m.joint_torque for m in rows]),
            np.array([m.angular_velocity for m in rows]),
            np.array([m.specific_force for m in rows]),
            np.array([no_wrench if m.sole_wrench is None else m.sole_wrench for m in rows]),
            np.array([m.time for m in rows]),
        )
        self.records.append(record)
        return record

    def settle(self) -> None:
        """Hold half-sitting, and see whether the robot stands."""
        self.rest = self.hold(0.15)
        wrench, torque = self.rest.settled("wrench"), self.rest.settled("torque")
        self.force_sensors = bool(np.isfinite(wrench).all())
        if not self.force_sensors:  # what the torques of the joints say; zero if these are not measured
            q, v, gyroscope, force = map(
                self.rest.settled, ("position", "velocity", "gyroscope", "accelerometer")
            )
            felt = torque if np.isfinite(torque).all() else None
            loads = SoleLoads(self.description, self.period, (self.description.kp, self.description.kd))
            wrench = loads.wrenches(Measurement(0.0, q, v, gyroscope, force, None, joint_torque=felt))
        self.standing = float(abs(wrench)[:, 2].sum()) > 0.05 * self.robot.mass * GRAVITY

    def judge(self, name: str, /, **figures: Any) -> bool:
        """Add the result of a check by its rule; True if it is good."""
        found, causes = RULES[name]
        cause = next((text for wrong, text in causes if wrong(SimpleNamespace(**figures))), "")
        name, state = name.partition(",")[0], "wrong" if cause else "ok"
        self.checks.append(Check(name, state, found.format_map(figures), cause.format_map(figures)))  # type: ignore[arg-type]
        return not cause

    def unknown(self, why: str, *names: str) -> None:
        """Add checks that cannot be made, for a reason."""
        self.checks += [Check(name, "unknown", why) for name in names]

    def bad(self, *names: str) -> bool:
        """Return True if one of these checks has failed or could not be made."""
        return any(check.name in names and check.state != "ok" for check in self.checks)

    @property
    def confused(self) -> str:
        """Reason why checks that need the joints as they are cannot be made; empty if they can."""
        bad = self.bad("joint order", "joint sign", "joint unit")
        return "joints are not measured as they should" if bad else ""
