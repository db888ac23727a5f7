"""A G1's end of Unitree's topics, for simulations.

Source: unitree_sdk2_python 37116c5, unitree_mujoco c598f10.
"""

from __future__ import annotations

import numpy as np

from wbc.core.signals import Command, Measurement
from wbc.machine.unitree.dds import COMMAND_TOPIC, STATE_TOPIC, Topics
from wbc.machine.unitree.wire import ENABLED, LOW_CMD, LOW_STATE, intact, motor_index, sealed
from wbc.robots import RobotDescription

G1_29 = 5
"""mode_machine of a G1 with 29 joints."""


class UnitreeRobot:
    """The robot's end: for a simulation that stands in for the machine.

    Like the machine it ignores commands with a wrong checksum or mode_machine, and motors that are not enabled.

    Attributes:
        refused: Commands with a wrong checksum or mode so far.
    """

    def __init__(self, description: RobotDescription, interface: str = "lo", *, domain: int = 1) -> None:
        """Join the topics."""
        self._index = motor_index(description.joint_names)
        self._topics = Topics(domain, interface, COMMAND_TOPIC, STATE_TOPIC)
        self.refused = 0

    def receive(self) -> tuple[bool, Command | None]:
        """Return False and the newest command since the last call: on these topics damping is a command."""
        record = self._topics.read(LOW_CMD, 0.0)
        if record is None:
            return False, None
        if not intact(record) or int(record["mode_machine"]) != G1_29:
            self.refused += 1
            return False, None
        motors = record["motor_cmd"][self._index]
        on = (motors["mode"] == ENABLED).astype(float)
        q, dq, tau, kp, kd = (motors[name].astype(float) for name in ("q", "dq", "tau", "kp", "kd"))
        return False, Command(on * tau, q, dq, kp=on * kp, kd=on * kd)

    def send(self, measurement: Measurement) -> None:
        """Send a measurement."""
        state = np.zeros((), LOW_STATE)
        state["mode_machine"], state["tick"] = G1_29, round(1e3 * measurement.time) & 0xFFFFFFFF
        imu, motors = state["imu_state"], state["motor_state"]
        imu["quaternion"] = [1.0, 0.0, 0.0, 0.0]
        imu["gyroscope"], imu["accelerometer"] = measurement.angular_velocity, measurement.specific_force
        motors["mode"][self._index] = ENABLED
        motors["q"][self._index] = measurement.joint_position
        motors["dq"][self._index] = measurement.joint_velocity
        if measurement.joint_torque is not None:
            motors["tau_est"][self._index] = measurement.joint_torque
        self._topics.write(sealed(state))
