"""Measurements and commands as UDP packets, from both ends.

A packet is little-endian: the header, then arrays of 8-byte floats, in the order of the robot's joints, soles
and hands, then the signature where both ends share a secret.

| Header | | |
|---|---|---|
| 4 bytes | `wbc4` | |
| u8 | kind | 0 hello, 1 measurement, 2 command, 3 damp |
| u8 | flags | bits of the arrays that are there; bits 5 and 6 of a measurement: origin of the sole wrenches |
| u16 | number of joints | |
| u64 | key of the sender | drawn anew for each driver, and by the robot for each driver that says hello |
| u64 | key of the receiver | 0 in a hello and in a damp |
| u64 | number | rises from packet to packet of a key: the sender's clock, ns |
| f64 | time, s | of the sensors (measurement); control period (command), 0 for any |

| Arrays of a measurement | Bit | Arrays of a command | Bit |
|---|---|---|---|
| positions, velocities | | torques | |
| torques | 0 | reference positions | 0 |
| gyroscope (3), accelerometer (3) | | reference velocities | 1 |
| sole wrenches (6 a sole) | 1 | kp | 2 |
| hand wrenches (6 a hand) | 2 | kd | 3 |
| ranges (1 a sole) | 3 | stiffness (1 a sole) | 4 |
| stiffness (1 a sole) | 4 | 1 for each released joint, 0 for others | 5 |

The origin is 0 for sensors, 1 for measured and 2 for commanded torques (`WrenchSource`).

The signature is the first half of the HMAC-SHA256 of all bytes before it.

Whoever says hello gets the measurements for `WELCOME`, beside who gets them already; they tell the key that the robot
has drawn for this driver. A command that names that key makes its sender the owner, who alone gets them from then on:
packets of other keys are refused until it has been silent for `SILENCE`. A command that is longer under way than the
quickest packet of its sender, by `LATE`, has been held back and is dropped. A damp acts if it carries the key of the
owner, from whatever address: the guard's process has a copy of the driver. A packet whose number is not above all
before it of its key is old and dropped. The keys that the robot has drawn are dead once another driver owns it, and
with the memory of the driver's last number. So a recorded hello is answered at most, and redirects nothing; a recorded
command moves nothing.

Packets of the owner's address come in through a socket of their own (`UdpRobot`): a flood of others, which fills the
buffer of the port, loses none of them. One that pretends to come from the owner's address does, and the robot's
watchdog damps.
"""

from __future__ import annotations

import contextlib
import hmac
import ipaddress
import itertools
import logging
import math
import secrets
import select
import socket
import struct
import time
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple, get_args

import numpy as np
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, choose, shown
from wbc.base.numbers import finite_scalar
from wbc.core.estimation.checks.stamps import stamp_of
from wbc.core.signals import Command, Measurement, WrenchSource
from wbc.machine.loop import Driver, MachineError
from wbc.robots import RobotDescription
from wbc.robots.registry import as_description

logger = logging.getLogger(__name__)

PORT = 7700
"""Port of the robot."""

SILENCE = 0.5
"""Silence of the owner after which the robot obeys another sender, s."""

LATE = 0.2
"""Time by which a command may be longer under way than the quickest packet of its sender, and after which a driver puts
aside what it has not read, s."""

DRIFT = 1e-4
"""Rate by which two clocks may drift apart: that time is forgotten so slowly."""

GUESTS, WELCOME = 4, 0.5
"""Number of those who said hello last that get measurements while nobody owns the robot, and for how long, s."""

MOST = 256
"""Most packets that one call takes: a flood of them must not hold up a loop."""

KEYS = 64
"""Number of senders whose last packet is remembered."""

Peer = tuple[Any, ...]
"""Address of a socket: host and port, with IPv6 two numbers more."""

SHORTEST = 16
"""Least number of characters of a secret."""

HELLO, MEASUREMENT, COMMAND, DAMP = range(4)
HEADER = struct.Struct("<4sBBHQQQd")
MAGIC = b"wbc4"
SIGNATURE = 16
"""Length of a signature, bytes."""

ARRAYS = {
    MEASUREMENT: {"joint_position": 0, "joint_velocity": 0, "joint_torque": 1}
    | {"angular_velocity": 0, "specific_force": 0, "sole_wrench": 2, "hand_wrenches": 4}
    | {"sole_range": 8, "sole_stiffness": 16},
    COMMAND: {"joint_torque": 0, "joint_position": 1, "joint_velocity": 2, "kp": 4, "kd": 8}
    | {"sole_stiffness": 16, "released": 32},
}
"""Arrays of a kind in their order, with the flag of those that may be missing."""

UNREAD = ("sole_range", "sole_stiffness")
"""Arrays of a measurement that are NaN where nothing was read, and are left out then."""

ORIGINS, ORIGIN = get_args(WrenchSource), 32
"""Origins of sole wrenches; the flags of a measurement, divided by `ORIGIN`, are the number of one."""


class Header(NamedTuple):
    """Header of a packet behind its magic number; see the module."""

    kind: int
    flags: int
    joints: int
    key: int
    to: int
    number: int
    time: float


def new_key() -> int:
    """Return a key that nobody can guess."""
    return secrets.randbits(63) + 1


class End:
    """Packets of one end of the wire, whose key it draws.

    Attributes:
        key: Key of this end.
        given: Keys of other ends → keys that were drawn for them alone.
    """

    def __init__(self, description: RobotDescription, host: str, secret: str | None) -> None:
        """Draw a key for packets of a robot; they are signed with a secret, which other computers need."""
        if secret is None and not _is_here(host):
            raise InputError(
                f"packets to and from other computers are signed: {host} needs secret='…' at both ends"
            )
        if secret is not None and len(secret) < SHORTEST:
            raise InputError(f"secret must have {SHORTEST} characters at least, got {len(secret)}")
        self.key = new_key()
        self.given: dict[int, int] = {}
        self._joints = len(description.joint_names)
        soles, hands = len(description.soles), len(description.hands)
        # The arrays that are not here have a number for each joint.
        self._shapes = {"angular_velocity": (3,), "specific_force": (3,), "sole_wrench": (soles, 6)}
        self._shapes |= {"hand_wrenches": (hands, 6), "sole_range": (soles,), "sole_stiffness": (soles,)}
        self._secret = secret.encode() if secret else b""
        self._number = 0
        self._newest: dict[int, int] = {}  # key of a sender → number of its last packet, the last sender last
        self._quickest: dict[int, tuple[float, float]] = {}  # key → clock here less the sender's, and when, s

    def pack(
        self, kind: int, to: int, content: Measurement | Command | None = None, key: int | None = None
    ) -> bytes:
        """Return a packet to the other end, from a key; `InputError` for an array of another shape than the robot's."""
        # The clock is the same in all processes of this computer: the guard's packets come after the loop's.
        self._number = max(self._number + 1, time.monotonic_ns())
        arrays, flags, stamp = ARRAYS.get(kind, {}), 0, 0.0
        if arrays and not isinstance(content, wanted := Command if kind == COMMAND else Measurement):
            raise InputError(f"a packet must carry a {wanted.__name__}, got {shown(content)}")
        if kind == MEASUREMENT and isinstance(content, Measurement):
            origin = choose("origin of sole wrenches", content.wrench_source, ORIGINS)
            flags, stamp = ORIGIN * ORIGINS.index(origin), stamp_of(content.time)
        elif isinstance(content, Command) and content.period is not None:
            stamp = finite_scalar("period of a command (s)", content.period, above=0.0)
        values = {name: getattr(content, name) for name in arrays}
        sent = {name: value for name, value in values.items() if value is not None or not arrays[name]}
        for name, value in list(sent.items()):
            shape, is_number = self._shape(name), np.asarray(value).dtype.kind in "biuf"
            if is_number and kind == MEASUREMENT and name in UNREAD and np.isnan(value).all():
                del sent[name]
            elif not is_number or np.shape(value) != shape:
                raise InputError(f"{name} of a packet must be numbers of shape {shape}, got {shown(value)}")
        flags += sum(arrays[name] for name in sent)
        own = self.key if key is None else key
        data = HEADER.pack(MAGIC, kind, flags, self._joints, own, to, self._number, stamp)
        if sent:
            data += np.concatenate([np.ravel(value) for value in sent.values()]).astype("<f8").tobytes()
        return data + self._sign(data)

    def _shape(self, name: str) -> tuple[int, ...]:
        return self._shapes.get(name, (self._joints,))

    def _sign(self, data: bytes) -> bytes:
        return hmac.digest(self._secret, data, "sha256")[:SIGNATURE] if self._secret else b""

    def header(self, data: bytes) -> Header | None:
        """Return the header of a packet; None for another kind or robot, or a wrong signature."""
        if len(data) < HEADER.size:
            return None
        magic, *rest = HEADER.unpack_from(data)
        head = Header(*rest)
        if magic != MAGIC or head.joints != self._joints:
            return None
        body, signature = (data[:-SIGNATURE], data[-SIGNATURE:]) if self._secret else (data, b"")
        return head if hmac.compare_digest(self._sign(body), signature) else None

    def is_new(self, head: Header, keep: int = 0) -> bool:
        """Return True if no later packet of its sender has come before; the key `keep` is never forgotten."""
        newest = self._newest
        if head.number <= newest.get(head.key, 0):
            return False
        newest.pop(head.key, None)  # the last sender is the last one
        newest[head.key] = head.number
        if len(newest) > KEYS:
            oldest = next(key for key in newest if key != keep)
            del newest[oldest]
            self._quickest.pop(oldest, None)
            self.given.pop(oldest, None)
        return True

    def delay(self, head: Header) -> float:
        """Return the time by which a packet was longer under way than the quickest of its sender, s."""
        now = time.monotonic()
        offset = now - 1e-9 * head.number
        least, since = self._quickest.get(head.key, (offset, now))
        least = min(least + DRIFT * (now - since), offset)
        self._quickest[head.key] = least, now
        return offset - least

    def content(self, head: Header, data: bytes) -> Measurement | Command | None:
        """Return what a measurement or a command carries; None if its length or its flags are wrong."""
        arrays = (name for name, flag in ARRAYS[head.kind].items() if not flag or flag & head.flags)
        shapes = {name: self._shape(name) for name in arrays}
        counts = [math.prod(shape) for shape in shapes.values()]
        end, origin = len(data) - (SIGNATURE if self._secret else 0), head.flags // ORIGIN
        if end != HEADER.size + 8 * sum(counts) or origin >= len(ORIGINS):
            return None
        values = np.frombuffer(data[HEADER.size : end], "<f8").astype(np.float64)
        parts = zip(shapes.items(), np.split(values, np.cumsum(counts)[:-1]), strict=True)
        content: dict[str, Any] = {name: part.reshape(shape) for (name, shape), part in parts}
        if head.kind == COMMAND:
            if "released" in content:
                content["released"] = content["released"] != 0.0
            return Command(**content, period=head.time or None)
        wrenches = {"sole_wrench": None, "wrench_source": ORIGINS[origin]}
        return Measurement(**({"time": head.time} | wrenches | content))


class UdpDriver(Driver):
    """Driver of a robot that sends and receives the UDP packets of this module.

    Attributes:
        description: The robot.
        address: Host and port of the robot.
    """

    @checked
    def __init__(
        self,
        description: RobotDescription | str,
        host: str = "127.0.0.1",
        port: Annotated[int, Field(ge=1, le=65535)] = PORT,
        *,
        secret: str | None = None,
    ) -> None:
        """Store the robot, or the name of one, and the address; the socket is opened at the first call.

        The secret is shared with the robot and signs the packets; it is needed for a robot on another computer. Raises
        `InputError` where it is missing or too short, or the port is out of range.
        """
        description = as_description(description)
        self.description, self.address = description, (host, port)
        self._end = End(description, host, secret)
        self._socket: socket.socket | None = None
        self._robot = 0  # key
        self._greeted, self._looked = False, -np.inf  # time at which packets were taken last, s

    def __getstate__(self) -> dict[str, object]:
        return self.__dict__ | {"_socket": None, "description": None}  # the guard only damps

    def read(self, timeout: float) -> Measurement | None:
        """See `Driver`; while the robot is silent, a greeting is sent every 0.1 s."""
        end = time.monotonic() + timeout
        if time.monotonic() - self._looked > LATE:  # of packets that nobody takes the system keeps the oldest
            while self._receive() is not None:
                pass
        if not self._greeted:
            self._greeted = True
            self._send(HELLO, 0)
        while True:
            newest = self._receive()
            left = end - time.monotonic()
            if newest is not None or left <= 0.0:
                return newest
            if not select.select([self._open()], [], [], min(left, 0.1))[0]:
                self._send(HELLO, 0)

    def write(self, command: Command) -> None:
        """See `Driver`; the robot ignores commands before one of its measurements has been read."""
        self._send(COMMAND, self._robot, command)

    def damp(self) -> None:
        """See `Driver`."""
        self._send(DAMP, 0)

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _open(self) -> socket.socket:
        if self._socket is None:
            try:
                family, address = _resolved(*self.address)
                self._socket = wire = socket.socket(family, socket.SOCK_DGRAM)
                wire.setblocking(False)
                wire.connect(address)  # packets of other addresses do not arrive
            except (OSError, UnicodeError) as error:
                self.close()
                raise MachineError(
                    f"the robot's host '{self.address[0]}' cannot be found ({error})"
                ) from error
        return self._socket

    def _send(self, kind: int, to: int, content: Command | None = None) -> None:
        wire, data = self._open(), self._end.pack(kind, to, content)
        for _ in range(2):  # a first attempt may tell of a packet sent before: refused, unreachable
            with contextlib.suppress(OSError):  # nobody listens, no cable: `read` will tell
                wire.send(data)
                return

    def _receive(self) -> Measurement | None:
        newest, self._looked = None, time.monotonic()
        for data, _ in _taken(self._open()):
            head = self._end.header(data)
            if (
                head is None
                or head.kind != MEASUREMENT
                or head.to != self._end.key
                or not self._end.is_new(head)
            ):
                continue
            content = self._end.content(head, data)
            if isinstance(content, Measurement):
                self._robot, newest = head.key, content
        return newest


class UdpRobot:
    """Robot's end of the UDP wire, for a simulator or for a program on the machine.

    Attributes:
        port: Port at which the robot listens.
        refused: Number of packets so far that were not from the owner, had a wrong signature, or were not packets of
            this wire.
        sender: Address of the owner, which gets the measurements; None before there is an owner.
    """

    @checked
    def __init__(
        self,
        description: RobotDescription | str,
        port: Annotated[int, Field(ge=0, le=65535)] = PORT,
        host: str = "127.0.0.1",
        *,
        secret: str | None = None,
    ) -> None:
        """Listen at a port of the host, any free one when 0, as the robot or the one of that name.

        The secret is shared with the drivers and signs the packets; it is needed if other computers can connect. Raises
        `InputError` where it is missing or too short, the port is in use or out of range, or the host is not here.
        """
        description = as_description(description)
        self._names = tuple(description.joint_names)
        self._end = End(description, host, secret)
        with contextlib.ExitStack() as opened:
            try:
                family, address = _resolved(host, port)
                self._socket = opened.enter_context(socket.socket(family, socket.SOCK_DGRAM))
                self._socket.bind(address)
            except (OSError, UnicodeError) as error:
                raise InputError(f"cannot listen at {host}, port {port} ({error})") from error
            opened.pop_all()
        self._socket.setblocking(False)
        self.port = int(self._socket.getsockname()[1])
        self.sender: Peer | None = None
        self._of_owner: socket.socket | None = None  # gets what comes from its address
        self._owner, self._heard = 0, -np.inf
        self._guests: dict[int, tuple[Peer, float]] = {}  # key → address, and time of the hello, s
        self.refused = 0

    def receive(self) -> tuple[bool, Command | None]:
        """Return whether damping was asked for since the last call, and the newest command since then.

        A command that no drive may get counts as a request for damping. Commands before the last request are dropped.
        """
        damped, newest, end = False, None, self._end
        # Those of others first: what the guard sends is newer than what the owner sent before it.
        wires = (self._socket,) if self._of_owner is None else (self._socket, self._of_owner)
        for data, peer in itertools.chain.from_iterable(map(_taken, wires)):
            head, now = end.header(data), time.monotonic()
            owned = now - self._heard < SILENCE
            if (
                head is None
                or head.kind not in (HELLO, COMMAND, DAMP)
                or (owned and head.key != self._owner)
                or (head.kind == COMMAND and head.to != end.given.get(head.key))
            ):
                self._refuse(peer)
                continue
            if not end.is_new(head, self._owner):
                continue
            if end.delay(head) > LATE and head.kind == COMMAND:
                self._refuse(peer)
                continue
            if owned:
                self._heard = now
            if head.kind == DAMP:
                damped, newest = True, None
            elif head.kind == HELLO and not owned:
                end.given.setdefault(head.key, new_key())
                self._guests.pop(head.key, None)
                self._guests[head.key] = peer, now
                if len(self._guests) > GUESTS:
                    del self._guests[next(iter(self._guests))]
            elif head.kind == COMMAND:
                if self._owner != head.key or not owned:
                    self._own(head.key, peer)
                self._owner, self._heard = head.key, now
                newest = self._command(head, data, peer)
                damped = damped or newest is None  # commands after a request do not take it back
        return damped, newest

    def _own(self, key: int, peer: Peer) -> None:
        """Make a sender the owner: it alone has a key of the robot, and its address a socket of its own."""
        self._end.given = {key: self._end.given[key]}
        self._guests.clear()
        if peer == self.sender:
            return
        self.sender = peer
        if self._of_owner is not None:
            self._of_owner.close()
        reuse = socket.SOL_SOCKET, socket.SO_REUSEPORT
        self._of_owner = wire = socket.socket(self._socket.family, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(*reuse, 1)
            wire.setsockopt(*reuse, 1)
            wire.setblocking(False)
            wire.bind(self._socket.getsockname())
            wire.connect(peer)  # from now on the system tells its packets from those of others
        except OSError as error:  # not on this system: one socket for all
            logger.info("no socket for %s, port %d, alone: %s", *peer[:2], error)
            wire.close()
            self._of_owner = None
        finally:  # no other program shares the port
            self._socket.setsockopt(*reuse, 0)

    def _command(self, head: Header, data: bytes, peer: Peer) -> Command | None:
        command = self._end.content(head, data)
        try:
            if not isinstance(command, Command):
                raise InputError(f"command: a packet of {len(data)} bytes has not the length that it says")
            command.check(self._names)
        except InputError as error:
            logger.warning("packet of %s, port %d: %s: the joints are damped", *peer[:2], error)
            return None
        return command

    def _refuse(self, peer: Peer) -> None:
        if self.refused == 0:
            logger.warning("a packet of %s, port %d, is refused; further ones are counted", *peer[:2])
        self.refused += 1

    def send(self, measurement: Measurement) -> None:
        """Send a measurement to the owner or, before there is one, to all that have sent a greeting."""
        guests, now = self._guests, time.monotonic()
        for key in [key for key, (_, since) in guests.items() if now - since >= WELCOME]:
            del guests[key]
        to = [(key, peer) for key, (peer, _) in guests.items()]
        if self.sender is not None and self._owner not in guests:
            to.append((self._owner, self.sender))
        for key, peer in to:
            with contextlib.suppress(OSError):  # nobody listens, no cable: its watchdog will tell
                drawn = self._end.given.get(key)
                self._socket.sendto(self._end.pack(MEASUREMENT, key, measurement, drawn), peer)

    def close(self) -> None:
        """Close the sockets."""
        self._socket.close()
        if self._of_owner is not None:
            self._of_owner.close()


def _is_here(host: str) -> bool:
    """Return True for a host that is this computer by every name: its packets need no signature."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name
        return False


def _resolved(host: str, port: int) -> tuple[socket.AddressFamily, Peer]:
    """Return family and address of a host, by IPv4 where it has both: then both ends of a wire take the same."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    family, _, _, _, address = min(found, key=lambda info: info[0] != socket.AF_INET)
    return family, address


def _taken(wire: socket.socket) -> Iterator[tuple[bytes, Peer]]:
    """Yield the packets that have arrived, with their senders."""
    for _ in range(MOST):
        try:
            yield wire.recvfrom(65536)
        except BlockingIOError:
            return
        except OSError:  # what has become of a packet sent before: refused, unreachable
            continue
