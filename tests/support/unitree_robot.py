"""A G1's end of Unitree's topics, for simulations.

Source: unitree_sdk2_python 37116c5, unitree_mujoco c598f10.
"""

from __future__ import annotations

import json

import numpy as np

from wbc.core.signals import Command, Measurement
from wbc.machine.unitree.dds import COMMAND_TOPIC, REQUEST_TOPIC, RESPONSE_TOPIC, STATE_TOPIC, Topics, message
from wbc.machine.unitree.switch import CHECK, RELEASE, SELECT
from wbc.machine.unitree.wire import ENABLED, LOW_CMD, LOW_STATE, intact, motor_index, sealed
from wbc.robots import RobotDescription

G1_29 = 5
"""mode_machine of a G1 with 29 joints."""

UNKNOWN = 1
"""Code with which requests to the motion switcher are refused here; a machine has others, all but 0 are refusals."""


class UnitreeRobot:
    """The robot's end: for a simulation that stands in for the machine.

    Like the machine it ignores commands with a wrong checksum or mode_machine, motors that are not enabled, and all
    commands while its built-in controller has the motors; the motion switcher releases them.

    Attributes:
        refused: Commands with a wrong checksum or mode so far, and those that came while a built-in controller was on.
        mode: Name of the built-in controller that has the motors; empty when none has.
    """

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
        self._switch = Topics(domain, interface, REQUEST_TOPIC, RESPONSE_TOPIC)
        self.mode = mode
        self.refused = 0

    def receive(self) -> tuple[bool, Command | None]:
        """Return False and the newest command since the last call: on these topics damping is a command."""
        self._answer()
        record = self._topics.read(LOW_CMD, 0.0)
        if record is None:
            return False, None
        if self.mode or not intact(record) or int(record["mode_machine"]) != G1_29:
            self.refused += 1
            return False, None
        motors = record["motor_cmd"][self._index]
        on = (motors["mode"] == ENABLED).astype(float)
        q, dq, tau, kp, kd = (motors[name].astype(float) for name in ("q", "dq", "tau", "kp", "kd"))
        return False, Command(on * tau, q, dq, kp=on * kp, kd=on * kd)

    def _answer(self) -> None:
        """Answer the requests that have come for the motion switcher."""
        for asked in self._switch.take(0.0):
            if (header := getattr(asked, "header", None)) is None:
                continue
            number, request = header.identity.id, header.identity.api_id
            data = json.dumps({"form": "0", "name": self.mode}) if request == CHECK else ""
            if request in (RELEASE, SELECT):
                self.mode = str(json.loads(asked.parameter)["name"]) if request == SELECT else ""
            code = 0 if request in (CHECK, RELEASE, SELECT) else UNKNOWN
            self._switch.send(message(RESPONSE_TOPIC, ((number, request), (code,)), data, []))

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
