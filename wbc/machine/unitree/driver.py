"""Driver of a G1 in its low-level mode, over Unitree's topics.

Source of modes and the law on the motor: unitree_sdk2_python 37116c5, unitree_mujoco c598f10.
"""

from __future__ import annotations

import time

import numpy as np

from wbc.core.arguments import checked
from wbc.core.errors import Array
from wbc.core.signals import Command, Measurement
from wbc.machine.unitree.dds import COMMAND_TOPIC, STATE_TOPIC, Topics
from wbc.machine.unitree.wire import ENABLED, G1_GAINS, LOW_CMD, LOW_STATE, intact, motor_index, sealed
from wbc.robots import RobotDescription

DAMPING = 3.0
"""Damping of a damped joint, Nms/rad."""


class UnitreeDriver:
    """Driver of a G1 in its low-level mode.

    It echoes mode_machine, enables the motors of its joints, signs what it sends and drops what is signed wrongly. It
    sends nothing before the first state has come. The G1 has no force sensors in its feet: controls estimate the
    wrenches from the torques that it reports.

    Attributes:
        description: The robot.
        gains: kp and kd of the machine, used where a command brings none, each of shape (na,).
        refused: States with a wrong checksum so far.
    """

    @checked
    def __init__(
        self,
        description: RobotDescription,
        interface: str = "lo",
        *,
        domain: int = 1,
    ) -> None:
        """Store the settings; DDS begins at the first call.

        Args:
            description: A G1: its joints have the names of `G1_MOTORS`.
            interface: Network interface of the robot.
            domain: DDS domain: 0 on the machine, 1 in simulators.

        Raises:
            InputError: Joints that the machine has not.
        """
        self.description, self._interface, self._domain = description, interface, domain
        self._index = motor_index(description.joint_names)
        self.gains = _machine_gains(description)
        self._topics: Topics | None = None
        self._machine: int | None = None
        self._position = np.zeros(len(description.joint_names))
        self.refused = 0

    def __getstate__(self) -> dict[str, object]:
        return self.__dict__ | {"_topics": None, "description": None}  # the guard only damps

    def _open(self) -> Topics:
        if self._topics is None:
            self._topics = Topics(self._domain, self._interface, STATE_TOPIC, COMMAND_TOPIC)
        return self._topics

    def read(self, timeout: float) -> Measurement | None:
        """See `Driver`; a damaged state is passed over."""
        end = time.monotonic() + timeout
        while True:
            state = self._open().read(LOW_STATE, max(end - time.monotonic(), 0.0))
            if state is None:
                return None
            if state["crc"] == 0 or intact(state):  # Unitree's own simulators do not sign
                break
            self.refused += 1
        self._machine = int(state["mode_machine"])
        motors, imu = state["motor"][self._index], state["imu"]
        self._position = motors["q"].astype(float)
        stamp = float(state["tick"]) * 1e-3 if state["tick"] else time.monotonic()
        return Measurement(
            stamp,
            self._position,
            motors["dq"].astype(float),
            imu["gyroscope"].astype(float),
            imu["accelerometer"].astype(float),
            None,
            joint_torque=motors["tau_est"].astype(float),
        )

    def write(self, command: Command) -> None:
        """See `Driver`; without references the motors get the torque alone."""
        zero = np.zeros(len(self._index))
        servo = command.joint_position is not None
        kp, kd = self.gains if servo else (zero, zero)
        self._send(
            self._position if command.joint_position is None else command.joint_position,
            zero if command.joint_velocity is None else command.joint_velocity,
            command.joint_torque,
            kp if command.kp is None else command.kp,
            kd if command.kd is None else command.kd,
        )

    def damp(self) -> None:
        """See `Driver`."""
        zero = np.zeros(len(self._index))
        self._send(self._position, zero, zero, zero, np.full(len(self._index), DAMPING))

    def _send(self, *values: Array) -> None:
        if self._machine is None:
            self.read(0.0)
        if self._machine is None:  # nobody there
            return
        message = np.zeros((), LOW_CMD)
        message["mode_machine"] = self._machine
        motors = message["motor"]
        motors["mode"][self._index] = ENABLED
        for name, value in zip(("q", "dq", "tau", "kp", "kd"), values, strict=True):
            motors[name][self._index] = value
        self._open().write(sealed(message))


def _machine_gains(description: RobotDescription) -> tuple[Array, Array]:
    pairs = []
    for name in description.joint_names:
        pairs.append(next((gains for part, gains in G1_GAINS.items() if part in name), (40.0, 1.0)))
    kp, kd = np.array(pairs).T
    return kp, kd
