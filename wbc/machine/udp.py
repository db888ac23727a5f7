"""Measurements and commands as UDP packets, from both ends.

A packet is little-endian: the header, then arrays of 8-byte floats, in the order of the robot's joints.

| Header | | |
|---|---|---|
| 4 bytes | `wbc1` | |
| u8 | kind | 0 hello, 1 measurement, 2 command, 3 damp |
| u8 | flags | bit 0: joint torques (measurement), references (command); bit 1: sole wrenches, gains |
| u16 | number of joints | |
| u32 | running number of the sender | |
| f64 | time of the sensors, s (measurement); 0 | |

| Kind | Arrays |
|---|---|
| measurement | positions, velocities, [torques], gyroscope (3), accelerometer (3), [sole wrenches (2 × 6)] |
| command | torques, [reference positions, reference velocities], [kp, kd] |

The robot sends measurements to the address from which the last hello or command came. Measurements and commands of one
sender whose numbers do not grow are old packets, which are dropped. A sender that begins anew begins with 1; a number
that is more than 1,000 behind is one of a sender that has.
"""

from __future__ import annotations

import contextlib
import select
import socket
import struct
import time
from dataclasses import replace

import numpy as np

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError
from wbc.core.signals import Command, Measurement
from wbc.machine.loop import MachineError
from wbc.robots import RobotDescription

PORT = 7700
"""Port of the robot."""

HELLO, MEASUREMENT, COMMAND, DAMP = range(4)
HEADER = struct.Struct("<4sBBHId")
MAGIC = b"wbc1"
LARGEST = 65507

OLD = 1000
"""Greatest number of packets that an old one is behind; what is further behind is of a sender that has begun anew."""


def pack_measurement(m: Measurement, number: int) -> bytes:
    """Return a measurement as a packet."""
    parts = [m.joint_position, m.joint_velocity]
    if m.joint_torque is not None:
        parts.append(m.joint_torque)
    parts += [m.angular_velocity, m.specific_force]
    if m.sole_wrench is not None:
        parts.append(m.sole_wrench.ravel())
    flags = int(m.joint_torque is not None) | 2 * int(m.sole_wrench is not None)
    return _packet(MEASUREMENT, flags, m.joint_position.size, number, m.time, parts)


def pack_command(c: Command, number: int) -> bytes:
    """Return a command as a packet; kp and kd go together, one alone does not go."""
    parts, flags = [c.joint_torque], 0
    if c.joint_position is not None:
        flags |= 1
        rate = np.zeros(c.joint_torque.size) if c.joint_velocity is None else c.joint_velocity
        parts += [c.joint_position, rate]
    if c.kp is not None and c.kd is not None:
        flags |= 2
        parts += [c.kp, c.kd]
    return _packet(COMMAND, flags, c.joint_torque.size, number, 0.0, parts)


def _packet(kind: int, flags: int, joints: int, number: int, stamp: float, parts: list[Array]) -> bytes:
    head = HEADER.pack(MAGIC, kind, flags, joints, number & 0xFFFFFFFF, stamp)
    return head + (np.concatenate(parts).astype("<f8").tobytes() if parts else b"")


def unpack(data: bytes, joints: int) -> tuple[int, int, Measurement | Command | None] | None:
    """Return kind, number and contents of a packet; None if it is malformed or of another robot."""
    if len(data) < HEADER.size or data[:4] != MAGIC:
        return None
    _, kind, flags, size, number, stamp = HEADER.unpack_from(data)
    if kind in (HELLO, DAMP):
        return kind, number, None
    counts = {
        MEASUREMENT: [joints, joints, *([joints] if flags & 1 else []), 3, 3, *([12] if flags & 2 else [])],
        COMMAND: [joints, *([joints] * 2 if flags & 1 else []), *([joints] * 2 if flags & 2 else [])],
    }.get(kind)
    if counts is None or size != joints or len(data) != HEADER.size + 8 * sum(counts):
        return None
    values = np.frombuffer(data, "<f8", offset=HEADER.size).astype(np.float64)
    if not np.isfinite(values).all():
        return None
    parts = np.split(values, np.cumsum(counts)[:-1])
    if kind == MEASUREMENT:
        torque = parts.pop(2) if flags & 1 else None
        q, v, gyroscope, accelerometer = parts[:4]
        wrench = parts[4].reshape(2, 6) if flags & 2 else None
        return kind, number, Measurement(stamp, q, v, gyroscope, accelerometer, wrench, joint_torque=torque)
    references, gains = bool(flags & 1), bool(flags & 2)
    return (
        kind,
        number,
        Command(
            parts[0],
            parts[1] if references else None,
            parts[2] if references else None,
            kp=parts[-2] if gains else None,
            kd=parts[-1] if gains else None,
        ),
    )


def _in_turn(number: int, newest: int) -> bool:
    """Return whether a packet is newer than the newest one, or of a sender that has begun anew."""
    return number > newest or number == 1 or number < newest - OLD


class UdpDriver:
    """Driver of a robot that speaks the packets of this module.

    Attributes:
        description: The robot.
        address: Host and port of the robot.
    """

    @checked
    def __init__(self, description: RobotDescription, host: str = "127.0.0.1", port: int = PORT) -> None:
        """Store the address; the socket is opened at the first call.

        Args:
            description: The robot.
            host: Host of the robot.
            port: Its port.

        Raises:
            InputError: A port out of range.
        """
        if not 0 < port < 65536:
            raise InputError(f"port must be in 1 … 65535, got {port}")
        self.description, self.address = description, (host, port)
        self._joints = len(description.joint_names)
        self._gains = np.array(description.kp), np.array(description.kd)
        self._resolved = self.address  # with the number of the host, found when the socket is opened
        self._socket: socket.socket | None = None
        self._number = self._newest = 0
        self._greeted = False

    def __getstate__(self) -> dict[str, object]:
        return self.__dict__ | {"_socket": None, "description": None}  # the guard only damps

    def read(self, timeout: float) -> Measurement | None:
        """See `Driver`; a robot that is silent is greeted again every 0.1 s."""
        end = time.monotonic() + timeout
        if not self._greeted:
            self._greeted = True
            self._send(_packet(HELLO, 0, self._joints, self._count(), 0.0, []))
        while True:
            newest = self._receive()
            left = end - time.monotonic()
            if newest is not None or left <= 0.0:
                return newest
            if not select.select([self._open()], [], [], min(left, 0.1))[0]:
                self._send(_packet(HELLO, 0, self._joints, self._count(), 0.0, []))

    def write(self, command: Command) -> None:
        """See `Driver`; a gain that the command leaves out is the description's, or zero in torque control."""
        if (command.kp is None) is not (command.kd is None):
            kp, kd = self._gains if command.joint_position is not None else (np.zeros(self._joints),) * 2
            command = replace(
                command,
                kp=kp if command.kp is None else command.kp,
                kd=kd if command.kd is None else command.kd,
            )
        self._send(pack_command(command, self._count()))

    def damp(self) -> None:
        """See `Driver`."""
        self._send(_packet(DAMP, 0, self._joints, self._count(), 0.0, []))

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _open(self) -> socket.socket:
        if self._socket is None:
            host, port = self.address
            try:
                self._resolved = socket.gethostbyname(host), port
            except (OSError, UnicodeError) as error:
                raise MachineError(f"the robot's host '{host}' cannot be found ({error})") from error
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.setblocking(False)
        return self._socket

    def _count(self) -> int:
        self._number += 1
        return self._number

    def _send(self, data: bytes) -> None:
        wire = self._open()
        with contextlib.suppress(OSError):  # nobody listens, no cable: `read` will tell
            wire.sendto(data, self._resolved)

    def _receive(self) -> Measurement | None:
        newest = None
        while True:
            try:
                data = self._open().recv(LARGEST)
            except BlockingIOError:
                return newest
            except OSError:  # what has become of a packet sent before: refused, unreachable
                continue
            got = unpack(data, self._joints)
            if got is not None and isinstance(got[2], Measurement) and _in_turn(got[1], self._newest):
                self._newest, newest = got[1], got[2]


class UdpRobot:
    """The robot's end of the wire: for a simulator, or a program on the machine."""

    @checked
    def __init__(self, description: RobotDescription, port: int = PORT, host: str = "127.0.0.1") -> None:
        """Listen.

        Args:
            description: The robot.
            port: Port to listen at; any free one when 0.
            host: Address to listen at.

        Raises:
            InputError: A port that is taken or out of range, an address that is not of this machine.
        """
        self._joints = len(description.joint_names)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise InputError(f"cannot listen at {host}, port {port} ({error})") from error
        self._socket.setblocking(False)
        self.port = int(self._socket.getsockname()[1])
        self._peer: tuple[str, int] | None = None
        self._number = self._newest = 0

    def receive(self) -> tuple[bool, Command | None]:
        """Return whether anything asked for damping, and the newest command, since the last call."""
        damped, newest = False, None
        while True:
            try:
                data, peer = self._socket.recvfrom(LARGEST)
            except BlockingIOError:
                return damped, newest
            except OSError:  # what has become of a packet sent before: refused, unreachable
                continue
            got = unpack(data, self._joints)
            if got is None:
                continue
            if got[0] == DAMP:
                damped, newest = True, None
            elif got[0] == HELLO:
                self._peer, self._newest = peer, got[1]
            elif isinstance(got[2], Command) and (peer != self._peer or _in_turn(got[1], self._newest)):
                self._peer, self._newest = peer, got[1]
                damped, newest = False, got[2]

    def send(self, measurement: Measurement) -> None:
        """Send a measurement to whoever sent the last hello or command."""
        if self._peer is not None:
            self._number += 1
            with contextlib.suppress(OSError):  # nobody listens, no cable: its watchdog will tell
                self._socket.sendto(pack_measurement(measurement, self._number), self._peer)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
