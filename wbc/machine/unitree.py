"""Unitree's low-level topics over DDS: driver of a G1, and a robot's end of them for simulations.

Needs the extra `wbc[unitree]` (cyclonedds 11; it does not find 0.10 on the loopback interface).

Source of topics, fields, modes and the law on the motor: unitree_sdk2_python 37116c5, unitree_mujoco c598f10.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError, WbcError
from wbc.core.signals import Command, Measurement
from wbc.machine.unitree_wire import (
    ENABLED,
    G1_GAINS,
    G1_MOTORS,
    LOW_CMD,
    LOW_STATE,
    from_cdr,
    intact,
    sealed,
    to_cdr,
)
from wbc.robots import RobotDescription

COMMAND_TOPIC, STATE_TOPIC = "rt/lowcmd", "rt/lowstate"

DAMPING = 3.0
"""Damping of a damped joint, Nms/rad."""

G1_29 = 5
"""mode_machine of a G1 with 29 joints."""

CONFIG = (
    '<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface name="{}"/></Interfaces></General>'
    "</Domain></CycloneDDS>"
)


class DdsError(WbcError):
    """DDS that cannot be used here."""


@functools.cache
def _messages() -> dict[str, Any]:
    """Return the DDS types; they carry bytes that are already packed."""
    try:
        from cyclonedds.idl import IdlStruct, annotations, make_idl_struct, types  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise DdsError(
            "Unitree's topics need cyclonedds: install the extra 'unitree', wbc[unitree]"
        ) from error
    u1, u4, f4, i2 = types.uint8, types.uint32, types.float32, types.int16

    def struct(name: str, fields: dict[str, Any]) -> Any:
        made = make_idl_struct(name, f"unitree_hg.msg.dds_.{name}", fields)
        annotations.final(made)
        annotations.autoid("sequential")(made)
        return made

    def packed(made: Any) -> Any:
        def serialize(self: Any, *_: Any, **__: Any) -> bytes:
            return self.payload  # type: ignore[no-any-return]

        def deserialize(cls: Any, data: bytes, *_: Any, **__: Any) -> Any:
            message = object.__new__(cls)
            object.__setattr__(message, "payload", bytes(data))
            return message

        made.serialize, made.deserialize = serialize, classmethod(deserialize)
        return made

    assert IdlStruct is not None
    floats = dict.fromkeys(("q", "dq", "tau", "kp", "kd"), f4)
    motor_cmd = struct("MotorCmd_", {"mode": u1, **floats, "reserve": u4})
    motor_state = struct(
        "MotorState_",
        {"mode": u1, **dict.fromkeys(("q", "dq", "ddq", "tau_est"), f4), "temperature": types.array[i2, 2]}
        | {"vol": f4, "sensor": types.array[u4, 2], "motorstate": u4, "reserve": types.array[u4, 4]},
    )
    imu = struct(
        "IMUState_",
        {
            "quaternion": types.array[f4, 4],
            "gyroscope": types.array[f4, 3],
            "accelerometer": types.array[f4, 3],
        }
        | {"rpy": types.array[f4, 3], "temperature": i2},
    )
    command = struct(
        "LowCmd_",
        {"mode_pr": u1, "mode_machine": u1, "motor_cmd": types.array[motor_cmd, 35]}
        | {"reserve": types.array[u4, 4], "crc": u4},
    )
    state = struct(
        "LowState_",
        {"version": types.array[u4, 2], "mode_pr": u1, "mode_machine": u1, "tick": u4, "imu_state": imu}
        | {"motor_state": types.array[motor_state, 35], "wireless_remote": types.array[u1, 40]}
        | {"reserve": types.array[u4, 4], "crc": u4},
    )
    return {COMMAND_TOPIC: packed(command), STATE_TOPIC: packed(state)}


class _Topics:
    """One topic to read, one to write."""

    def __init__(self, domain: int, interface: str, reads: str, writes: str) -> None:
        messages = _messages()
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet  # noqa: PLC0415
        from cyclonedds.domain import Domain, DomainParticipant  # noqa: PLC0415
        from cyclonedds.pub import DataWriter  # noqa: PLC0415
        from cyclonedds.sub import DataReader  # noqa: PLC0415
        from cyclonedds.topic import Topic  # noqa: PLC0415

        try:
            self._domain = Domain(domain, CONFIG.format(interface))
        except Exception:  # it has been configured in this process before
            self._domain = None
        participant = DomainParticipant(domain)
        self._type = messages[writes]
        self._reader = DataReader(participant, Topic(participant, reads, messages[reads]))
        self._writer = DataWriter(participant, Topic(participant, writes, self._type))
        mask = SampleState.NotRead | ViewState.Any | InstanceState.Alive
        self._waiting = WaitSet(participant)
        self._waiting.attach(ReadCondition(self._reader, mask))
        self._participant = participant

    def read(self, layout: Any, timeout: float) -> Any:
        """Return the newest message as a record, None if there is none in time."""
        newest = self._take(layout)
        if newest is None and timeout > 0.0:
            self._waiting.wait(int(timeout * 1e9))
            newest = self._take(layout)
        return newest

    def _take(self, layout: Any) -> Any:
        newest = None
        for sample in self._reader.take(16):
            payload = getattr(sample, "payload", None)
            record = None if payload is None else from_cdr(payload, layout)
            newest = newest if record is None else record
        return newest

    def write(self, record: Any) -> None:
        """Send a record."""
        message = object.__new__(self._type)
        object.__setattr__(message, "payload", to_cdr(record))
        self._writer.write(message)


def _motors(description: RobotDescription, motors: Sequence[str]) -> Array:
    """Return the index of each joint's motor."""
    missing = [name for name in description.joint_names if name not in motors]
    if missing:
        raise InputError(f"joints without a motor in Unitree's order: {', '.join(missing[:4])}")
    return np.array([motors.index(name) for name in description.joint_names])


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
        self._index = _motors(description, G1_MOTORS)
        self.gains = _machine_gains(description)
        self._topics: _Topics | None = None
        self._machine: int | None = None
        self._position = np.zeros(len(description.joint_names))
        self.refused = 0

    def __getstate__(self) -> dict[str, object]:
        return self.__dict__ | {"_topics": None, "description": None}  # the guard only damps

    def _open(self) -> _Topics:
        if self._topics is None:
            self._topics = _Topics(self._domain, self._interface, STATE_TOPIC, COMMAND_TOPIC)
        return self._topics

    def read(self, timeout: float) -> Measurement | None:
        """See `Driver`."""
        state = self._open().read(LOW_STATE, timeout)
        if state is None:
            return None
        if state["crc"] != 0 and not intact(state):  # Unitree's own simulators do not sign
            self.refused += 1
            return None
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


class UnitreeRobot:
    """The robot's end: for a simulation that stands in for the machine.

    Like the machine it ignores commands with a wrong checksum or mode_machine, and motors that are not enabled.

    Attributes:
        refused: Commands with a wrong checksum or mode so far.
    """

    @checked
    def __init__(self, description: RobotDescription, interface: str = "lo", *, domain: int = 1) -> None:
        """Join the topics.

        Args:
            description: A G1.
            interface: Network interface.
            domain: DDS domain.

        Raises:
            InputError: Joints that the machine has not.
            DdsError: cyclonedds is not installed.
        """
        self._index = _motors(description, G1_MOTORS)
        self._topics = _Topics(domain, interface, COMMAND_TOPIC, STATE_TOPIC)
        self.refused = 0

    def receive(self) -> tuple[bool, Command | None]:
        """Return False and the newest command since the last call: on these topics damping is a command."""
        message = self._topics.read(LOW_CMD, 0.0)
        if message is None:
            return False, None
        if not intact(message) or int(message["mode_machine"]) != G1_29:
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
