"""Results of checks, and what all checks share: the loop, the robot, and the results so far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from wbc.core.errors import Array
from wbc.core.robot import GRAVITY
from wbc.core.signals import Measurement
from wbc.machine.conformance.excitation import Excitation
from wbc.machine.loads import SoleLoads
from wbc.machine.loop import Loop

State = Literal["ok", "wrong", "unknown"]

UNIT = 57.2958
"""Degrees in a radian."""


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
    state: State
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


class Session:
    """One run of the checks.

    Attributes:
        loop: The loop.
        delay: Delay that it is known to have, s.
        excite: Its motions.
        robot: The robot at half-sitting.
        gains: kp and kd of the description, each of shape (na,).
        checks: Results so far.
        standing: True if the robot stands, by its force sensors or else by the torques of its joints.
        force_sensors: True if the loop measures sole wrenches.
    """

    def __init__(self, loop: Loop, delay: float) -> None:
        """Begin; nothing is sent.

        Args:
            loop: The loop.
            delay: Delay that it is known to have, s.
        """
        self.loop, self.delay = loop, delay
        self.excite = Excitation(loop)
        self.robot = self.excite.robot
        self.gains = np.array(loop.description.kp), np.array(loop.description.kd)
        self.checks: list[Check] = []

    def settle(self) -> None:
        """Hold half-sitting, and see whether the robot stands."""
        self.rest = self.excite.hold(0.15)
        wrench = self.rest.settled("wrench")
        self.force_sensors = bool(np.isfinite(wrench).all())
        load = float(abs(wrench if self.force_sensors else self._felt_wrench())[:, 2].sum())
        self.standing = load > 0.05 * self.robot.mass * GRAVITY

    def _felt_wrench(self) -> Array:
        """Return the wrenches that the torques of the joints say, shape (soles, 6); zero if these are not measured."""
        settled, description = self.rest.settled, self.loop.description
        loads = SoleLoads(description, self.loop.control_period, (description.kp, description.kd))
        torque = settled("torque")
        return loads.wrenches(
            Measurement(
                0.0,
                settled("position"),
                settled("velocity"),
                settled("gyroscope"),
                settled("accelerometer"),
                None,
                joint_torque=torque if np.isfinite(torque).all() else None,
            )
        )

    def add(self, name: str, state: State | bool, found: str, cause: str = "") -> bool:
        """Add a result; True if it is good."""
        if not isinstance(state, str):
            state = "ok" if state else "wrong"
        self.checks.append(Check(name, state, found, cause if state == "wrong" else ""))
        return state == "ok"

    def bad(self, *names: str) -> bool:
        """Return True if one of these checks has failed or could not be made."""
        return any(check.name in names and check.state != "ok" for check in self.checks)
