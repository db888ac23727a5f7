"""Driver of a G1 in its low-level mode, over Unitree's topics.

Source of modes and the law on the motor: unitree_sdk2_python 37116c5, unitree_mujoco c598f10.
"""

from __future__ import annotations

import logging
import time
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.drive.gate import CommandGate
from wbc.core.signals import Command, Measurement
from wbc.machine.commands import references, with_gains
from wbc.machine.loop import Driver
from wbc.machine.unitree.dds import COMMAND_TOPIC, STATE_TOPIC, Topics
from wbc.machine.unitree.wire import (
    ENABLED,
    G1_MOTORS,
    LOW_CMD,
    LOW_STATE,
    intact,
    machine_gains,
    motor_index,
    sealed,
)
from wbc.robots import RobotDescription
from wbc.robots.registry import as_description

logger = logging.getLogger(__name__)

DAMPING = 3.0
"""Damping of a damped joint, Nms/rad."""

SIMULATORS = 1
"""DDS domain of Unitree's simulators, which do not sign their states."""

LOOPBACK = ("lo", "lo0", "127.0.0.1")
"""Network interfaces of this computer alone."""

HOT = 90.0
"""Temperature from which a motor is named, °C; the library's choice, not Unitree's."""

LARGEST_ANGLE = 2.0 * np.pi
"""Largest position of a motor that can be, rad."""

TICKS = 2**32
"""Number of ticks after which their count begins anew."""

SWITCHED_ON = 0.5
"""Time after the first command from which a motor that is off is a fault, s."""


class UnitreeDriver(Driver):
    """Driver of a G1 in its low-level mode.

    It echoes mode_machine, enables the motors of its joints, and adds checksums to its packets. It drops states with a
    wrong checksum, and states without one unless they come from a simulator on this computer. It sends nothing before
    the first state has arrived, it sends damping in place of a command that is not finite, and it keeps torques within
    the limits. The G1 has no force sensors in its feet, so controls estimate the wrenches from the torques that it
    reports.

    The description may lack some motors, because it locks or omits their joints. These motors are held at their
    positions in the first state, or in that after damping, with the gains of the machine. They are damped together with
    the others.

    Attributes:
        description: The robot.
        held: Joints of the machine that are held, since the description does not have them.
        gains: Stiffness kp (Nm/rad) and damping kd (Nms/rad) for commands without gains, each of shape (na,).
        refused: Number of states with a wrong checksum so far.
        fault: Reason why the joints must be damped, by the last state: a motor that is off, or another mode_machine.
            Empty while there is none. `wbc.run` then damps the joints and ends.
        warnings: Errors and temperatures of motors in the last state.
    """

    @checked
    def __init__(
        self,
        description: RobotDescription | str,
        interface: str = "lo",
        *,
        domain: Annotated[int, Field(ge=0, le=232)] = 1,
    ) -> None:
        """Store the settings; DDS is started at the first call of a method.

        Args:
            description: Description of a G1, or its name; the joints must have the names of `G1_MOTORS`.
            interface: Network interface of the robot.
            domain: DDS domain; 0 on the machine, 1 in simulators.
        """
        description = as_description(description)
        self.description, self._interface, self._domain = description, interface, domain
        self._name, self._names = description.name, tuple(description.joint_names)
        self._index = motor_index(self._names)
        self.held = tuple(name for name in G1_MOTORS if name not in self._names)
        self._held_index = motor_index(self.held)
        self._held_gains = machine_gains(self.held)
        self._held_at: Array | None = None  # where the first state, or that after damping, has them, rad
        self.gains: tuple[Array, Array] = machine_gains(self._names)
        self._gate = CommandGate(description.robot(), 0.002)
        self._topics: Topics | None = None
        self._machine: int | None = None
        self._tick: int | None = None  # of the last state, counted on where it begins anew, ms
        self._position = self._velocity = self._zero = np.zeros(len(self._names))
        self._on = np.zeros(len(self._names), dtype=bool)
        self._begun = np.inf  # time of the first command, s
        self.refused = 0
        self.fault = ""
        self.warnings: tuple[str, ...] = ()
        self._said: set[str] = set()

    def __getstate__(self) -> dict[str, object]:
        return self.__dict__ | {"_topics": None, "description": None, "_gate": None}  # the guard only damps

    def _open(self) -> Topics:
        if self._topics is None:
            self._topics = Topics(self._domain, self._interface, STATE_TOPIC, COMMAND_TOPIC)
        return self._topics

    def read(self, timeout: float) -> Measurement | None:
        """See `Driver`; a damaged state is ignored."""
        end = time.monotonic() + timeout
        while True:
            state = self._open().read(LOW_STATE, max(end - time.monotonic(), 0.0))
            if state is None:
                return None
            if self._is_signed(state):
                break
            self.refused += 1
        motors, imu = state["motor_state"][self._index], state["imu_state"]
        self._look(state, motors)
        if self._held_at is None:
            self._hold(state["motor_state"][self._held_index]["q"].astype(float))
        self._position, self._velocity = motors["q"].astype(float), motors["dq"].astype(float)
        stamp = self._time(int(state["tick"]))
        return Measurement(
            stamp,
            self._position,
            self._velocity,
            imu["gyroscope"].astype(float),
            imu["accelerometer"].astype(float),
            None,
            joint_torque=motors["tau_est"].astype(float),
        )

    def _time(self, tick: int) -> float:
        """Return the time of a state, s: its tick counts ms in 32 bits, and begins anew after 49.7 days.

        A tick that nobody counts is always zero: `wbc.run` takes the time of arrival in its place.
        """
        if self._tick is None:
            self._tick = tick
        half = TICKS // 2
        self._tick += (tick - self._tick + half) % TICKS - half  # the shorter way round
        return 1e-3 * self._tick

    def _hold(self, position: Array) -> None:
        """Hold the motors without a joint in the description where they are, rad; one that is nowhere is damped."""
        self._held_at = _possible(position)
        if self.held:
            where = ", ".join(
                f"{name} at {angle:.3f}"
                for name, angle in zip(self.held, self._held_at.tolist(), strict=True)
            )
            self._say(f"motors without a joint in '{self._name}' are held where they are (rad): {where}")

    def _is_signed(self, state: Any) -> bool:
        """Return True for a state whose checksum is right, or missing where simulators send none."""
        if intact(state):
            return True
        if state["crc"] == 0:
            if self._domain == SIMULATORS and self._interface in LOOPBACK:
                return True
            self._say(
                f"states without a checksum on interface '{self._interface}', domain {self._domain} are refused: only "
                f"simulators send them, on loopback in domain {SIMULATORS}"
            )
        return False

    def _look(self, state: Any, motors: Any) -> None:
        """Name what is wrong with the machine."""
        machine, fault = int(state["mode_machine"]), ""
        if self._machine is None or self._held_at is None:
            self._machine = machine
        if machine != self._machine:
            fault = f"mode_machine changed from {self._machine} to {machine}"
        on = motors["mode"] == ENABLED
        self._on |= on
        if state["crc"] and time.monotonic() - self._begun > SWITCHED_ON:
            self._on[:] = True
        off = self._on & ~on
        if off.any():
            fault = f"motor off: {self._named(off)}"
        found = []
        if motors["motorstate"].any():
            wrong = motors["motorstate"] != 0
            codes = ", ".join(f"{code:#x}" for code in motors["motorstate"][wrong])
            found.append(f"motor error {codes}: {self._named(wrong)}")
        hot = motors["temperature"].max(1) > HOT
        if hot.any():
            found.append(f"motor above {HOT:g} °C: {self._named(hot)}")
        self.fault, self.warnings = fault, tuple(found)
        for text in (fault, *found):
            if text:
                self._say(text)

    def _named(self, chosen: Array) -> str:
        return ", ".join(self._names[i] for i in np.flatnonzero(chosen))

    def _say(self, text: str) -> None:
        """Log a text once."""
        if text not in self._said:
            self._said.add(text)
            logger.warning("%s", text)

    def write(self, command: Command) -> None:
        """See `Driver`; without position references the motors get only the torque."""
        known = _possible(self._position)
        q, v = references(command, np.nan_to_num(known))  # without a reading no stiffness
        whole = replace(with_gains(command, self.gains), joint_position=q, joint_velocity=v)
        try:
            whole = self._gate.admit(whole, (known, self._velocity))
        except InputError as error:
            self._say(f"{error}: the joints are damped")
            self.damp()
            return
        self._begun = min(self._begun, time.monotonic())
        self._send(
            whole.joint_position, whole.joint_velocity, whole.joint_torque, whole.kp, whole.kd, stiff=True
        )

    def damp(self) -> None:
        """See `Driver`; whoever commands afterwards begins with the machine as it is then."""
        self._held_at, self._begun, self._on = None, np.inf, np.zeros_like(self._on)
        position = np.nan_to_num(self._position, posinf=0.0, neginf=0.0)
        self._send(
            position, self._zero, self._zero, self._zero, np.full(len(self._names), DAMPING), stiff=False
        )

    def _send(self, *values: Array | None, stiff: bool) -> None:
        """Send values for the described joints; the others are held where `stiff`, and damped otherwise."""
        if self._machine is None:
            self.read(0.0)
        if self._machine is None:  # nobody there
            return
        message = np.zeros((), LOW_CMD)
        message["mode_machine"] = self._machine
        motors = message["motor_cmd"]
        motors["mode"][self._index] = ENABLED
        for name, value in zip(("q", "dq", "tau", "kp", "kd"), values, strict=True):
            motors[name][self._index] = value
        if self.held:
            at = np.full(len(self.held), np.nan) if self._held_at is None or not stiff else self._held_at
            known, (kp, kd) = np.isfinite(at), self._held_gains
            motors["mode"][self._held_index] = ENABLED
            motors["q"][self._held_index] = np.nan_to_num(at)
            motors["kp"][self._held_index] = np.where(known, kp, 0.0)
            motors["kd"][self._held_index] = np.where(known, kd, DAMPING)
        self._open().write(sealed(message))


def _possible(position: Array) -> Array:
    """Return positions of motors, rad, with NaN for those that cannot be; shape (number of motors,)."""
    return np.asarray(np.where(np.abs(position) <= LARGEST_ANGLE, position, np.nan))
