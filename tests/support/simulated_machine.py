"""A machine that MuJoCo simulates behind a driver, and the runs that drive it."""
# ruff: noqa: E501 - one failure a line

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from at_rest import at_rest
from hanging import SimulatedTime

import wbc
from wbc import Command, Measurement
from wbc.machine import Driver, Runner, RunSettings
from wbc.machine.report import Phase
from wbc.sim import Machine, MujocoLoop, Plant

DESCRIPTION = wbc.load_robot("g1")
PERIOD = 0.004
NA = len(DESCRIPTION.joint_names)


@cache
def plant_model() -> mujoco.MjModel:
    return Plant(DESCRIPTION, visuals=False).model


class SimulatedMachine(Driver):
    """A machine in simulated time, on the ground, that can fall silent."""

    def __init__(
        self, clock: SimulatedTime, q: np.ndarray | None = None, *, torques: bool | None = None
    ) -> None:
        self.description = DESCRIPTION
        sensors = None if torques is None else Machine(force_sensors=False, torque_sensors=torques)
        self.loop = MujocoLoop(DESCRIPTION, plant_model(), control_period=PERIOD, machine=sensors)
        if q is not None:
            self.loop.reset(q)
        self.clock, self.commands, self.damped = clock, 0, 0
        self.silent_after = float("inf")
        self._told = -1.0

    def read(self, timeout: float) -> Measurement | None:
        measurement = self.loop.measure()
        if measurement.time <= self._told or self.clock.time - 100.0 > self.silent_after:
            self.clock.time += timeout
            return None
        self._told = measurement.time
        return measurement

    def write(self, command: Command) -> None:
        self.commands += 1
        self.loop.step(command)

    def damp(self) -> None:
        self.damped += 1
        q, zero = self.loop.measure().joint_position, np.zeros(NA)
        self.loop.step(Command(zero, q, zero, kp=zero, kd=0.1 * DESCRIPTION.kd))


class Ideal(Driver):
    """A robot on the ground whose joints are at once where they are sent, and whose base leans by a pitch, rad."""

    def __init__(self, q: np.ndarray | None = None) -> None:
        self.description, self.clock = DESCRIPTION, SimulatedTime()
        self.robot, self.commands, self.damped, self._told = DESCRIPTION.robot(), 0, 0, -1.0
        self.q = np.array(self.robot.half_sitting if q is None else q)[7:]
        self.pitch = self.rate = 0.0
        self.silent_after = float("inf")

    def measure(self) -> Measurement:
        up = pin.rpy.rpyToMatrix(0.0, self.pitch, 0.0).T @ [0.0, 0.0, 9.80665]
        still = at_rest(self.robot, self._told - 100.0, joint_position=self.q.copy(), specific_force=up)
        return replace(still, angular_velocity=np.array([0.0, self.rate, 0.0]))

    def read(self, timeout: float) -> Measurement | None:
        now = round(self.clock.time / PERIOD) * PERIOD
        if now <= self._told or self.clock.time - 100.0 > self.silent_after:
            self.clock.time += timeout
            return None
        self.pitch += self.rate * (now - self._told) if self._told > 0.0 else 0.0
        self._told = now
        return self.measure()

    def freeze(self) -> None:
        """Send the same measurement again and again from now on."""
        frozen = self.measure()
        self.read = lambda timeout: replace(frozen)  # type: ignore[method-assign]

    def write(self, command: Command) -> None:
        self.commands += 1
        if command.joint_position is not None:
            self.q = command.joint_position.copy()

    def damp(self) -> None:
        self.damped += 1


def make(machine: SimulatedMachine | Ideal, control: Any = None, **options: object) -> Runner:
    if control is None:
        control = wbc.TorqueControl(wbc.balance_controller(DESCRIPTION.robot(), PERIOD))
    values = {"fade": 0.2, "blend": 0.2, "stop": 0.2} | options
    settings = RunSettings(**values)  # type: ignore[arg-type]
    return Runner(machine, control, 1.0 / PERIOD, settings=settings, guard=False, clock=machine.clock)


def bent() -> np.ndarray:
    """Standing with knees bent more than at half-sitting, arms elsewhere."""
    joints = {"left_shoulder_pitch_joint": 0.4, "right_elbow_joint": 0.3, "waist_yaw_joint": 0.1}
    for side in ("left", "right"):
        for part, change in (("hip_pitch", -0.15), ("knee", 0.3), ("ankle_pitch", -0.15)):
            name = f"{side}_{part}_joint"
            joints[name] = DESCRIPTION.half_sitting[name] + change
    return DESCRIPTION.robot().configuration(joints)


def commands_by_phase(machine: SimulatedMachine | Ideal, runner: Runner) -> dict[Phase, list[Command]]:
    """Commands that a runner sends from now on, by its phase."""
    sent: dict[Phase, list[Command]] = {phase: [] for phase in Phase}
    write = machine.write

    def keep(command: Command) -> None:
        sent[runner.phase].append(command)
        write(command)

    machine.write = keep  # type: ignore[method-assign]
    return sent
