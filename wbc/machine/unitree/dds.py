"""DDS: one topic to read and one to write, and the messages of unitree_hg and unitree_api.

Needs the extra `unitree` (cyclonedds 11; it does not find 0.10 on the loopback interface).

Source of topics and fields: unitree_sdk2_python 37116c5, `idl`; unitree_mujoco c598f10.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from wbc.core.errors import WbcError
from wbc.machine.unitree.wire import from_cdr, to_cdr

COMMAND_TOPIC, STATE_TOPIC = "rt/lowcmd", "rt/lowstate"
REQUEST_TOPIC, RESPONSE_TOPIC = "rt/api/motion_switcher/request", "rt/api/motion_switcher/response"

CONFIG = (
    '<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface name="{}"/></Interfaces></General>'
    "</Domain></CycloneDDS>"
)


class DdsError(WbcError):
    """DDS that cannot be used here, or a service that does not answer."""


def _struct(module: str, name: str, fields: dict[str, Any]) -> Any:
    from cyclonedds.idl import annotations, make_idl_struct  # noqa: PLC0415 - an extra

    made = make_idl_struct(name, f"{module}.msg.dds_.{name}", fields)
    annotations.final(made)
    annotations.autoid("sequential")(made)
    return made


def _packed(made: Any) -> Any:
    """Return a message that carries bytes which are packed already: packing field by field takes 0.3 ms."""

    def serialize(self: Any, *_: Any, **__: Any) -> bytes:
        return self.payload  # type: ignore[no-any-return]

    def deserialize(cls: Any, data: bytes, *_: Any, **__: Any) -> Any:
        message = object.__new__(cls)
        object.__setattr__(message, "payload", bytes(data))
        return message

    made.serialize, made.deserialize = serialize, classmethod(deserialize)
    return made


@functools.cache
def messages() -> dict[str, Any]:
    """Return the type of each topic.

    Raises:
        DdsError: cyclonedds is not installed.
    """
    try:
        from cyclonedds.idl import types  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise DdsError(
            "Unitree's topics need cyclonedds: pip install -e '.[unitree]' in the clone"
        ) from error
    u1, u4, f4, i2, i4, i8 = (
        getattr(types, kind) for kind in ("uint8", "uint32", "float32", "int16", "int32", "int64")
    )
    hg, api = functools.partial(_struct, "unitree_hg"), functools.partial(_struct, "unitree_api")
    floats = dict.fromkeys(("q", "dq", "tau", "kp", "kd"), f4)
    motor_cmd = hg("MotorCmd_", {"mode": u1, **floats, "reserve": u4})
    motor_state = hg(
        "MotorState_",
        {"mode": u1, **dict.fromkeys(("q", "dq", "ddq", "tau_est"), f4), "temperature": types.array[i2, 2]}
        | {"vol": f4, "sensor": types.array[u4, 2], "motorstate": u4, "reserve": types.array[u4, 4]},
    )
    imu = hg(
        "IMUState_",
        {
            "quaternion": types.array[f4, 4],
            "gyroscope": types.array[f4, 3],
            "accelerometer": types.array[f4, 3],
        }
        | {"rpy": types.array[f4, 3], "temperature": i2},
    )
    command = hg(
        "LowCmd_",
        {"mode_pr": u1, "mode_machine": u1, "motor_cmd": types.array[motor_cmd, 35]}
        | {"reserve": types.array[u4, 4], "crc": u4},
    )
    state = hg(
        "LowState_",
        {"version": types.array[u4, 2], "mode_pr": u1, "mode_machine": u1, "tick": u4, "imu_state": imu}
        | {"motor_state": types.array[motor_state, 35], "wireless_remote": types.array[u1, 40]}
        | {"reserve": types.array[u4, 4], "crc": u4},
    )
    identity = api("RequestIdentity_", {"id": i8, "api_id": i8})
    lease = api("RequestLease_", {"id": i8})
    policy = api("RequestPolicy_", {"priority": i4, "noreply": bool})
    header = api("RequestHeader_", {"identity": identity, "lease": lease, "policy": policy})
    status = api("ResponseStatus_", {"code": i4})
    answer = api("ResponseHeader_", {"identity": identity, "status": status})
    binary = {"binary": types.sequence[u1]}
    return {
        COMMAND_TOPIC: _packed(command),
        STATE_TOPIC: _packed(state),
        REQUEST_TOPIC: api("Request_", {"header": header, "parameter": str} | binary),
        RESPONSE_TOPIC: api("Response_", {"header": answer, "data": str} | binary),
    }


def request_message(number: int, request: int, parameter: str) -> Any:
    """Return a request to the motion switcher, with a number of its own and its parameters as JSON."""
    kind = messages()[REQUEST_TOPIC]
    header = kind.__annotations__["header"]
    parts = header.__annotations__
    identity = parts["identity"](id=number, api_id=request)
    policy = parts["policy"](priority=0, noreply=False)
    return kind(header(identity, parts["lease"](id=0), policy), parameter, [])


def response_message(identity: Any, code: int, data: str) -> Any:
    """Return the answer to a request of some identity; a code other than 0 refuses it."""
    kind = messages()[RESPONSE_TOPIC]
    header = kind.__annotations__["header"]
    return kind(header(identity, header.__annotations__["status"](code=code)), data, [])


class Topics:
    """One topic to read, one to write."""

    def __init__(self, domain: int, interface: str, reads: str, writes: str) -> None:
        """Join a DDS domain, with a topic to read and one to write.

        The interface of the first call in a process holds for the whole process. Raises `DdsError` when cyclonedds is
        not installed, or cannot use it.
        """
        kinds = messages()
        from cyclonedds.core import (  # noqa: PLC0415
            DDSException,
            InstanceState,
            ReadCondition,
            SampleState,
            ViewState,
            WaitSet,
        )
        from cyclonedds.domain import Domain, DomainParticipant  # noqa: PLC0415
        from cyclonedds.pub import DataWriter  # noqa: PLC0415
        from cyclonedds.sub import DataReader  # noqa: PLC0415
        from cyclonedds.topic import Topic  # noqa: PLC0415

        try:
            self._domain = Domain(domain, CONFIG.format(interface))
        except DDSException as error:
            if error.code != DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
                # A participant without the domain would speak on another interface, to whatever robot is there.
                raise DdsError(
                    f"DDS cannot use the network interface '{interface}' ({error}); the standard error may say why"
                ) from error
            self._domain = None  # it has been configured in this process before
        participant = DomainParticipant(domain)
        self._type = kinds[writes]
        self._reader = DataReader(participant, Topic(participant, reads, kinds[reads]))
        self._writer = DataWriter(participant, Topic(participant, writes, self._type))
        mask = SampleState.NotRead | ViewState.Any | InstanceState.Alive
        self._waiting = WaitSet(participant)
        self._waiting.attach(ReadCondition(self._reader, mask))
        self._participant = participant

    def read(self, layout: np.dtype[Any], timeout: float) -> Any:
        """Return the newest message as a record, None if there is none in time."""
        newest = None
        for sample in self.take(timeout):
            record = from_cdr(sample.payload, layout) if hasattr(sample, "payload") else None
            newest = newest if record is None else record
        return newest

    def write(self, record: Any) -> None:
        """Send a record."""
        message = object.__new__(self._type)
        object.__setattr__(message, "payload", to_cdr(record))
        self.send(message)

    def take(self, timeout: float) -> list[Any]:
        """Return the messages that have come, the oldest first; wait for one, `timeout` seconds, if there is none.

        Among them may be notes of cyclonedds on writers that have left.
        """
        samples: list[Any] = self._reader.take(16)
        if not samples and timeout > 0.0:
            self._waiting.wait(int(timeout * 1e9))
            samples = self._reader.take(16)
        return samples

    def send(self, message: Any) -> None:
        """Send a message."""
        self._writer.write(message)
