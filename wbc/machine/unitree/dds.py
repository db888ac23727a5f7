"""DDS: one topic to read and one to write, and the messages of unitree_hg.

Needs the extra `unitree` (cyclonedds 11; it does not find 0.10 on the loopback interface).

Source of topics and fields: unitree_sdk2_python 37116c5, `idl`; unitree_mujoco c598f10.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from wbc.base.errors import WbcError
from wbc.machine.unitree.wire import LOW_CMD, LOW_STATE, from_cdr, to_cdr

COMMAND_TOPIC, STATE_TOPIC = "rt/lowcmd", "rt/lowstate"

PARTS = {"motor_cmd": "MotorCmd_", "motor_state": "MotorState_", "imu_state": "IMUState_"}
"""Names of the structures in a message of unitree_hg."""

CONFIG = (
    '<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface name="{}"/></Interfaces></General>'
    "</Domain></CycloneDDS>"
)


class DdsError(WbcError):
    """DDS that cannot be used here."""


def _of_layout(name: str, layout: np.dtype[Any]) -> Any:
    """Return the message of unitree_hg with the fields of a C struct, but for its padding."""
    from cyclonedds.idl import annotations, make_idl_struct, types  # noqa: PLC0415 - an extra

    fields = {}
    for field in layout.names or ():
        base, shape = layout[field].base, layout[field].shape
        made = _of_layout(PARTS[field], base) if base.names else getattr(types, base.name)
        fields[field] = types.array[made, shape[0]] if shape else made
    fields.pop("pad", None)
    struct = make_idl_struct(name, f"unitree_hg.msg.dds_.{name}", fields)
    annotations.final(struct)
    annotations.autoid("sequential")(struct)
    return struct


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
    """Return the type of each topic."""
    try:
        import cyclonedds.idl  # noqa: F401, PLC0415 - an extra
    except ImportError as error:
        raise DdsError(
            "Unitree's topics need cyclonedds: pip install -e '.[unitree]' in the clone"
        ) from error
    return {
        COMMAND_TOPIC: _packed(_of_layout("LowCmd_", LOW_CMD)),
        STATE_TOPIC: _packed(_of_layout("LowState_", LOW_STATE)),
    }


class Topics:
    """One topic to read, one to write."""

    def __init__(self, domain: int, interface: str, reads: str, writes: str) -> None:
        """Join a DDS domain, with a topic to read and one to write.

        The interface of the first call in a process holds for the whole process. Raises `DdsError` when cyclonedds is
        not installed, or cannot use it.
        """
        kinds = messages()
        from cyclonedds import core, pub, sub, topic  # noqa: PLC0415
        from cyclonedds.domain import Domain, DomainParticipant  # noqa: PLC0415

        try:
            self._domain = Domain(domain, CONFIG.format(interface))
        except core.DDSException as error:
            if error.code != core.DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
                # A participant without the domain would speak on another interface, to whatever robot is there.
                raise DdsError(
                    f"DDS cannot use the network interface '{interface}' ({error}); the standard error may say why"
                ) from error
            self._domain = None  # it has been configured in this process before
        participant = DomainParticipant(domain)
        self._type = kinds[writes]
        self._reader = sub.DataReader(participant, topic.Topic(participant, reads, kinds[reads]))
        self._writer = pub.DataWriter(participant, topic.Topic(participant, writes, self._type))
        mask = core.SampleState.NotRead | core.ViewState.Any | core.InstanceState.Alive
        self._waiting = core.WaitSet(participant)
        self._waiting.attach(core.ReadCondition(self._reader, mask))
        self._participant = participant

    def read(self, layout: np.dtype[Any], timeout: float) -> Any:
        """Return the newest message as a record, None if there is none in time, s."""
        samples = self._reader.take(16)
        if not samples and timeout > 0.0:
            self._waiting.wait(int(timeout * 1e9))
            samples = self._reader.take(16)
        records = [from_cdr(sample.payload, layout) for sample in samples if hasattr(sample, "payload")]
        return next((record for record in reversed(records) if record is not None), None)

    def write(self, record: Any) -> None:
        """Send a record."""
        message = object.__new__(self._type)
        object.__setattr__(message, "payload", to_cdr(record))
        self._writer.write(message)
