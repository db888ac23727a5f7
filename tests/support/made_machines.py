"""Loops of machines that conformance looks at: with a fault of what goes out or comes in, or without mass."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from wbc import Command, Measurement
from wbc.core.robot import GRAVITY
from wbc.machine import conformance
from wbc.machine.conformance import ConformanceReport

DESCRIPTION = wbc.load_robot("g1")
PERIOD = 0.005


class Wrapped:
    """A loop with a fault in what goes out, obeying some periods late."""

    def __init__(self, loop: Any, out: Callable[[Command], Any] = lambda c: c, late: int = 0) -> None:
        self._loop, self._out, self._waiting, self._late = loop, out, [], late
        self.description, self.control_period, self.measure = (
            loop.description,
            loop.control_period,
            loop.measure,
        )

    def step(self, command: Command) -> None:
        self._waiting.append(self._out(command))
        self._loop.step(self._waiting.pop(0) if len(self._waiting) > self._late else self._waiting[0])


class Recorded:
    """A loop that measures what another one has measured, under the same commands, with a fault."""

    description, control_period = DESCRIPTION, PERIOD

    def __init__(self, fault: Callable[[Measurement, int], Any]) -> None:
        self._rows, self._fault, self._tick = healthy()[0], fault, 0

    def measure(self) -> Measurement:
        return self._fault(self._rows[min(self._tick, len(self._rows) - 1)], self._tick)  # type: ignore[no-any-return]

    def step(self, command: Command) -> None:
        self._tick += 1


class Light:
    """A robot that hangs, of joints without mass: kp (q_ref − q) + kd (q̇_ref − q̇) + τ = 0 at the end of each period."""

    description, control_period = DESCRIPTION, PERIOD

    def __init__(self) -> None:
        robot = DESCRIPTION.robot()
        self.q, self.v, self.time = np.array(robot.half_sitting[7:]), np.zeros(robot.na), 0.0
        self.up = robot.placement(robot.imu_frame).rotation.T @ [0.0, 0.0, GRAVITY]
        self.torque = pin.computeGeneralizedGravity(robot.model, robot.data, robot.q)[6:]

    def measure(self) -> Measurement:
        return Measurement(
            self.time,
            self.q.copy(),
            self.v.copy(),
            np.zeros(3),
            self.up,
            np.zeros((2, 6)),
            joint_torque=self.torque,
        )

    def step(self, command: Command) -> None:
        c, servos = command, command.joint_position is not None
        kp, kd = (
            own if given is None else given
            for given, own in ((c.kp, servos * DESCRIPTION.kp), (c.kd, DESCRIPTION.kd))
        )
        to, rate = (
            (self.q if c.joint_position is None else c.joint_position),
            (0.0 if c.joint_velocity is None else c.joint_velocity),
        )
        before, self.time = self.q, self.time + PERIOD
        if not servos:  # 1 kg m² under torques alone
            self.v = self.v + PERIOD * c.joint_torque
            self.q = before + PERIOD * self.v
            return
        self.q = (kp * to + kd * (rate + before / PERIOD) + c.joint_torque) / (kp + kd / PERIOD)
        self.v = (self.q - before) / PERIOD


def plant(description: wbc.RobotDescription = DESCRIPTION, **options: Any) -> wbc.Plant:
    return wbc.Plant(description, **{"control_period": PERIOD} | options)


@functools.cache
def healthy() -> tuple[list[Measurement], ConformanceReport]:
    """Measurements of a good loop during all checks, with torques, and their result."""
    loop, rows = plant(), []

    def measure() -> Measurement:
        rows.append(replace(loop.measure(), joint_torque=loop.joint_torque.copy()))
        return rows[-1]

    listening = Wrapped(loop)
    listening.measure = measure
    return rows, conformance(listening)
