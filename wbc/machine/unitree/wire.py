"""LowCmd and LowState of unitree_hg as bytes: layouts, checksum, and the G1's joints.

The checksum runs over the C struct with its padding; the wire carries CDR, in which the first element's `mode` follows
without padding. Both are made from one NumPy record.

Sources: unitree_sdk2_python, `idl/unitree_hg` and `utils/crc.py` (37116c5); unitree_sdk2, `example/g1/low_level`; joint
indices: unitree_mujoco, `g1_joint_index_dds.md` (c598f10). All under BSD-3-Clause; no code is taken over.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.robot import SIDES

_LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
_ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")

G1_MOTORS = (
    *(f"{side}_{part}_joint" for side in SIDES for part in _LEG),
    *(f"waist_{part}_joint" for part in ("yaw", "roll", "pitch")),
    *(f"{side}_{part}_joint" for side in SIDES for part in _ARM),
)
"""Joint of each motor of a G1 with 29 joints, by index, in PR mode (serial pitch and roll)."""

G1_GAINS = {"hip": (60.0, 1.0), "knee": (100.0, 2.0), "ankle": (40.0, 1.0), "waist": (60.0, 1.0)}
"""Gains of the low-level example of the SDK, kp (Nm/rad) and kd (Nms/rad); 40 and 1 for all other joints."""

MOTORS = 35
"""Motors in a message."""

ENABLED = 1
"""Mode of a motor that obeys."""

_MOTOR_CMD = np.dtype(
    [("mode", "u1"), ("pad", "u1", 3)]
    + [(name, "<f4") for name in ("q", "dq", "tau", "kp", "kd")]
    + [("reserve", "<u4")]
)
LOW_CMD = np.dtype(
    [("mode_pr", "u1"), ("mode_machine", "u1"), ("pad", "u1", 2), ("motor_cmd", _MOTOR_CMD, MOTORS)]
    + [("reserve", "<u4", 4), ("crc", "<u4")]
)
"""C struct of LowCmd_, 1004 bytes; its fields have the names and the order of the IDL, beside padding."""

_IMU_STATE = np.dtype(
    [("quaternion", "<f4", 4), ("gyroscope", "<f4", 3), ("accelerometer", "<f4", 3), ("rpy", "<f4", 3)]
    + [("temperature", "<i2"), ("pad", "u1", 2)]
)
_MOTOR_STATE = np.dtype(
    [("mode", "u1"), ("pad", "u1", 3), ("q", "<f4"), ("dq", "<f4"), ("ddq", "<f4"), ("tau_est", "<f4")]
    + [("temperature", "<i2", 2), ("vol", "<f4"), ("sensor", "<u4", 2), ("motorstate", "<u4")]
    + [("reserve", "<u4", 4)]
)
LOW_STATE = np.dtype(
    [("version", "<u4", 2), ("mode_pr", "u1"), ("mode_machine", "u1"), ("pad", "u1", 2), ("tick", "<u4")]
    + [("imu_state", _IMU_STATE), ("motor_state", _MOTOR_STATE, MOTORS), ("wireless_remote", "u1", 40)]
    + [("reserve", "<u4", 4), ("crc", "<u4")]
)
"""C struct of LowState_, 2092 bytes."""

_CDR_HEADER = b"\x00\x01\x00\x00"  # little-endian XCDR1
_FIRST_MODE = {LOW_CMD: 2, LOW_STATE: 70}
"""Place of the first motor's mode in CDR; in the struct it lies two bytes later, with padding around it."""

_REVERSED = np.array([int(f"{value:08b}"[::-1], 2) for value in range(256)], dtype=np.uint8)


def checksum(data: bytes) -> int:
    """Return the checksum of Unitree's messages over 4-byte little-endian words.

    CRC-32 with polynomial 0x04C11DB7, initial value 0xFFFFFFFF, each word from its highest bit on, neither
    reflected nor inverted: zlib's, with all bits of every word and of the result reversed.
    """
    words = _REVERSED[np.frombuffer(data, np.uint8)].reshape(-1, 4)[:, ::-1]
    value = zlib.crc32(words.tobytes()) ^ 0xFFFFFFFF
    return int(f"{value:032b}"[::-1], 2)


def sealed(message: Any) -> Any:
    """Write the checksum into a record and return it."""
    message["crc"] = checksum(message.tobytes()[:-4])
    return message


def intact(message: Any) -> bool:
    """Return True if the checksum of a record is right."""
    return int(message["crc"]) == checksum(message.tobytes()[:-4])


def to_cdr(message: Any) -> bytes:
    """Return a record as CDR, with its header."""
    data, at = message.tobytes(), _FIRST_MODE[message.dtype]
    return b"".join((_CDR_HEADER, data[:at], data[at + 2 : at + 3], b"\x00", data[at + 6 :]))


def from_cdr(data: bytes, layout: np.dtype[Any]) -> Any:
    """Return CDR with its header as a record; None if it is malformed."""
    at, body = _FIRST_MODE[layout], data[4:]
    struct = b"".join((body[:at], b"\x00\x00", body[at : at + 1], b"\x00\x00\x00", body[at + 2 :]))
    if data[:2] != _CDR_HEADER[:2] or len(struct) < layout.itemsize:
        return None
    return np.frombuffer(struct[: layout.itemsize], layout)[0].copy()


def motor_index(joint_names: Sequence[str]) -> Array:
    """Return the index of each joint's motor."""
    missing = [name for name in joint_names if name not in G1_MOTORS]
    if missing:
        raise InputError(f"joints without a motor in Unitree's order: {', '.join(missing[:4])}")
    return np.array([G1_MOTORS.index(name) for name in joint_names], dtype=np.intp)


def machine_gains(joint_names: Sequence[str]) -> tuple[Array, Array]:
    """Return the gains of the SDK's example, kp (Nm/rad) and kd (Nms/rad), each of shape (na,)."""
    pairs = [next((g for part, g in G1_GAINS.items() if part in name), (40.0, 1.0)) for name in joint_names]
    kp, kd = np.array(pairs).reshape(-1, 2).T
    return kp, kd
