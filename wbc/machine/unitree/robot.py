"""A G1's end of Unitree's topics, for simulations.

Source: unitree_sdk2_python 37116c5, unitree_mujoco c598f10.
"""

from __future__ import annotations

import numpy as np

from wbc.core.arguments import checked
from wbc.core.signals import Command, Measurement
from wbc.machine.unitree.dds import COMMAND_TOPIC, STATE_TOPIC, Topics
from wbc.machine.unitree.switch import SwitchService
from wbc.machine.unitree.wire import ENABLED, LOW_CMD, LOW_STATE, intact, motor_index, sealed
from wbc.robots import RobotDescription

G1_29 = 5
"""mode_machine of a G1 with 29 joints."""


class UnitreeRobot:
    """The robot's end: for a simulation that stands in for the machine.

    Like the machine it ignores commands with a wrong checksum or mode_machine, motors that are not enabled, and all
    commands while its built-in controller has the motors; the motion switcher releases them.

    Attributes:
        refused: Commands with a wrong checksum or mode so far, and those that came while a built-in controller was on.
        switch: The robot's motion switcher.
    """

    @checked
    def __init__(
        self, description: RobotDescription, interface: str = "lo", *, domain: int = 1, mode: str = ""
    ) -> None:
        """Join the topics.

        Args:
            description: A G1.
            interface: Network interface.
            domain: DDS domain.
            mode: Name of the built-in controller that has the motors; empty when none has.

        Raises:
            InputError: Joints that the machine has not.
            DdsError: cyclonedds is not installed.
        """
        self._index = motor_index(description.joint_names)
        self._topics = Topics(domain, interface, COMMAND_TOPIC, STATE_TOPIC)
        self.switch = SwitchService(interface, domain, mode)
        self.refused = 0

    def receive(self) -> tuple[bool, Command | None]:
        """Return False and the newest command since the last call: on these topics damping is a command."""
        self.switch.answer()
        message = self._topics.read(LOW_CMD, 0.0)
        if message is None:
            return False, None
        if self.switch.mode or not intact(message) or int(message["mode_machine"]) != G1_29:
            self.refused += 1
            return False, None
        motors = message["motor"][self._index]
        on = (motors["mode"] == ENABLED).astype(float)
        q, dq, tau, kp, kd = (motors[name].astype(float) for name in ("q", "dq", "tau", "kp", "kd"))
        return False, Command(on * tau, q, dq, kp=on * kp, kd=on * kd)

    def send(self, measurement: Measurement) -> None:
        """Send a measurement."""
        state = np.zeros((), LOW_STATE)
        state["mode_machine"], state["tick"] = G1_29, round(1e3 * measurement.time) & 0xFFFFFFFF
        state["imu"]["quaternion"] = [1.0, 0.0, 0.0, 0.0]
        state["imu"]["gyroscope"] = measurement.angular_velocity
        state["imu"]["accelerometer"] = measurement.specific_force
        motors = state["motor"]
        motors["mode"][self._index] = ENABLED
        motors["q"][self._index], motors["dq"][self._index] = (
            measurement.joint_position,
            measurement.joint_velocity,
        )
        if measurement.joint_torque is not None:
            motors["tau_est"][self._index] = measurement.joint_torque
        self._topics.write(sealed(state))
