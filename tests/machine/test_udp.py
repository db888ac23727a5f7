"""The UDP wire: what packets carry, who owns a robot, what strangers cannot do."""

from __future__ import annotations

import pickle
import socket
import time
import types
from collections.abc import Callable, Iterator
from dataclasses import MISSING, fields, replace
from typing import Any

import numpy as np
import pytest

import wbc
from wbc import Command, Measurement
from wbc.base.errors import InputError, WbcError
from wbc.machine import UdpDriver, UdpRobot, udp
from wbc.machine.udp import COMMAND, DAMP, HELLO, MEASUREMENT, End
from wbc.sim import MujocoLoop, Plant, RobotServer

DESCRIPTION = wbc.load_robot("g1")
NA = len(DESCRIPTION.joint_names)
ZERO = Command(np.zeros(NA))
SECRET = "as long as sixteen characters"


def random_measurement(rng: np.random.Generator, **parts: Any) -> Measurement:
    drawn = (rng.normal(size=NA), rng.normal(size=NA), rng.normal(size=3), rng.normal(size=3))
    whole = Measurement(
        float(rng.uniform()), *drawn, rng.normal(size=(2, 6)), joint_torque=rng.normal(size=NA)
    )
    return replace(whole, **parts)


class Wire:
    """A robot and drivers of it, closed at the end."""

    def __init__(self, secret: str | None) -> None:
        self.secret = secret
        self.robot = UdpRobot(DESCRIPTION, 0, secret=secret)
        self.drivers: list[UdpDriver] = []
        self.rng = np.random.default_rng(0)

    def driver(self, secret: str | None = None) -> UdpDriver:
        driver = UdpDriver(DESCRIPTION, port=self.robot.port, secret=secret or self.secret)
        self.drivers.append(driver)
        return driver

    def meets(self, driver: UdpDriver) -> bool:
        """Let a driver ask for the robot; return whether it gets measurements."""
        driver.read(0.11)  # says hello
        self.robot.receive()
        self.robot.send(random_measurement(self.rng))
        return driver.read(0.0) is not None

    def obeys(self, driver: UdpDriver, command: Command = ZERO) -> bool:
        driver.write(command)
        damped, newest = self.robot.receive()
        return newest is not None and not damped

    def owner(self) -> UdpDriver:
        """Return a driver that owns the robot."""
        driver = self.driver()
        assert self.meets(driver) and self.obeys(driver)
        return driver

    def throw(self, data: bytes) -> tuple[bool, Command | None]:
        """Send the robot bytes from an address of their own."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
            wire.sendto(data, ("127.0.0.1", self.robot.port))
        return self.robot.receive()


@pytest.fixture(params=[None, SECRET], ids=["unsigned", "signed"])
def wire(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Wire]:
    monkeypatch.setattr(udp, "LATE", 0.5)  # a busy computer may keep a packet waiting
    made = Wire(request.param)
    yield made
    made.robot.close()
    for driver in made.drivers:
        driver.close()


class Program:
    """A driver's end of the wire that shows its packets."""

    def __init__(self, wire: Wire) -> None:
        self.end = End(DESCRIPTION, "127.0.0.1", wire.secret)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(1.0)
        self._address = ("127.0.0.1", wire.robot.port)
        self.send(self.end.pack(HELLO, 0))
        wire.robot.receive()
        wire.robot.send(random_measurement(wire.rng))
        head = self.end.header(self.socket.recv(65536))
        assert head is not None
        self.robot = head.key

    def send(self, data: bytes) -> bytes:
        self.socket.sendto(data, self._address)
        return data


@pytest.mark.parametrize("drawn", [0, 2**63 - 1])
def test_no_key_is_zero_which_means_nobody_and_each_fits_into_a_header(
    drawn: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(udp.secrets, "randbits", lambda bits: drawn)
    end = End(DESCRIPTION, "127.0.0.1", None)
    head = end.header(end.pack(HELLO, 0))
    assert head is not None and 0 < head.key == end.key < 2**64


def drawn(kind: type, rng: np.random.Generator) -> dict[str, Any]:
    """Return values for all fields of a measurement or a command, none of which is a default."""
    small = {"angular_velocity": 3, "specific_force": 3, "sole_range": 2, "sole_stiffness": 2}
    small |= {"sole_wrench": (2, 6), "hand_wrenches": (2, 6)}
    values: dict[str, Any] = {each.name: rng.normal(size=small.get(each.name, NA)) for each in fields(kind)}
    if kind is Command:
        return values | {"released": rng.random(NA) < 0.5, "period": float(rng.uniform())}
    return values | {"time": float(rng.uniform()), "wrench_source": "commanded torques"}


@pytest.mark.parametrize("secret", [None, SECRET])
@pytest.mark.parametrize("kind", [Measurement, Command])
def test_packets_carry_every_field_with_and_without_each_that_may_be_missing(
    kind: type, secret: str | None
) -> None:
    end, whole = End(DESCRIPTION, "127.0.0.1", secret), drawn(kind, np.random.default_rng(0))
    optional = [each for each in fields(kind) if (each.default, each.default_factory) != (MISSING, MISSING)]
    cases = [{name: value for name, value in whole.items() if name != each.name} for each in optional]
    cases += [whole | {"sole_wrench": None}] if kind is Measurement else []
    for sent in (kind(**values) for values in (whole, *cases)):
        data = end.pack(MEASUREMENT if kind is Measurement else COMMAND, 7, sent)
        head = end.header(data)
        assert head is not None and (head.key, head.to) == (end.key, 7)
        got = end.content(head, data)
        assert type(got) is kind
        for each in fields(kind):
            np.testing.assert_array_equal(getattr(got, each.name), getattr(sent, each.name), each.name)


def test_a_robot_without_soles_has_the_same_wire() -> None:
    arm = wbc.load_robot("panda")
    end, na = End(arm, "127.0.0.1", None), len(arm.joint_names)
    sent = Measurement(
        0.1, np.ones(na), np.ones(na), np.ones(3), np.ones(3), None, hand_wrenches=np.ones((1, 6))
    )
    got = end.content(end.header(data := end.pack(MEASUREMENT, 7, sent)), data)  # type: ignore[arg-type]
    for each in fields(Measurement):
        np.testing.assert_array_equal(getattr(got, each.name), getattr(sent, each.name), each.name)


def test_what_does_not_fit_into_a_packet_is_an_error() -> None:
    with pytest.raises(InputError, match="hand_wrenches"):
        End(DESCRIPTION, "127.0.0.1", None).pack(
            MEASUREMENT, 7, random_measurement(np.random.default_rng(0), hand_wrenches=np.zeros((3, 6)))
        )
    with pytest.raises(InputError, match="a Command, got 3"):
        UdpDriver(DESCRIPTION).write(3)  # type: ignore[arg-type]
    for period in ("x", np.nan):
        with pytest.raises(InputError, match="period of a command"):
            UdpDriver(DESCRIPTION).write(replace(ZERO, period=period))  # type: ignore[arg-type]


def test_a_driver_gets_the_newest_measurement_and_is_obeyed_after_it(wire: Wire) -> None:
    driver = pickle.loads(pickle.dumps(wire.driver()))
    wire.drivers.append(driver)
    assert not wire.obeys(driver)  # it does not know the robot yet
    assert wire.meets(driver)
    sent = [random_measurement(wire.rng) for _ in range(3)]
    for measurement in sent:
        wire.robot.send(measurement)
    np.testing.assert_array_equal(driver.read(1.0).joint_position, sent[-1].joint_position)
    assert wire.obeys(driver, Command(np.ones(NA)))
    driver.damp()
    assert wire.robot.receive() == (True, None)


def test_a_driver_that_was_not_read_for_long_begins_with_what_comes_then(wire: Wire) -> None:
    """As a second run does: the system has kept the oldest packets, and lost the newest."""
    driver = wire.owner()
    for _ in range(600):
        wire.robot.send(random_measurement(wire.rng))
    driver._looked -= 1.0  # s
    assert driver.read(0.0) is None
    wire.robot.send(now := random_measurement(wire.rng))
    seen = driver.read(1.0)
    assert seen is not None and (seen.joint_position == now.joint_position).all()


def test_a_command_that_damping_has_overtaken_is_dropped(wire: Wire) -> None:
    program = Program(wire)
    late = program.end.pack(COMMAND, program.robot, ZERO)
    program.send(program.end.pack(DAMP, 0))
    assert wire.robot.receive() == (True, None)
    assert wire.throw(late) == (False, None)
    program.socket.close()


def test_damping_that_was_asked_for_is_told_whatever_comes_after_it(wire: Wire) -> None:
    """In one call: of commands those before the last request are dropped."""
    program = Program(wire)

    def told(*packets: Command | None) -> tuple[bool, float | None]:
        for content in packets:
            kind = DAMP if content is None else COMMAND
            program.send(program.end.pack(kind, 0 if content is None else program.robot, content))
        damped, newest = wire.robot.receive()
        return damped, None if newest is None else float(newest.joint_torque[0])

    one, two, bad = (Command(np.full(NA, value)) for value in (1.0, 2.0, np.nan))
    assert told(one) == (False, 1.0)
    assert told(None, one) == (True, 1.0)
    assert told(None, one, two) == (True, 2.0)
    assert told(one, None) == (True, None)
    assert told(one, None, two) == (True, 2.0)
    assert told(bad, two) == (True, 2.0)
    assert told(two, bad) == (True, None)
    assert told(two) == (False, 2.0)
    program.socket.close()


@pytest.mark.parametrize("host", ["localhost", "127.0.0.2", "::1", "0:0:0:0:0:0:0:1"])
def test_both_ends_meet_without_a_secret_at_every_name_of_this_computer(
    host: str, caplog: pytest.LogCaptureFixture
) -> None:
    try:
        robot = UdpRobot(DESCRIPTION, 0, host)
    except InputError:
        pytest.skip(f"this computer has no {host}")
    driver = UdpDriver(DESCRIPTION, host, robot.port)
    driver.read(0.0)
    robot.receive()
    robot.send(random_measurement(np.random.default_rng(0)))
    assert driver.read(1.0) is not None
    driver.write(Command(np.ones(NA)))
    damped, command = robot.receive()
    assert command is not None and not damped and robot.sender is not None
    driver._socket.send(b"no packet")  # type: ignore[union-attr]
    assert robot.receive() == (False, None) and robot.refused == 1
    assert f"port {robot.sender[1]}" in caplog.text
    driver.close()
    robot.close()


def test_a_command_that_was_held_back_is_dropped(wire: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also when its sender has been silent since, and owns the robot no more; later ones are obeyed."""
    program = Program(wire)
    assert wire.throw(program.end.pack(COMMAND, program.robot, ZERO))[1] is not None
    sender, begin = wire.robot.sender, time.monotonic()
    for delay in (0.6, 5.0, 600.0):
        held = program.end.pack(COMMAND, program.robot, Command(np.ones(NA)))
        monkeypatch.setattr(udp.time, "monotonic", lambda late=delay: begin + late)
        assert wire.throw(held) == (False, None) and wire.robot.sender == sender
        monkeypatch.undo()
    assert wire.throw(program.end.pack(COMMAND, program.robot, ZERO))[1] is not None
    program.socket.close()


def test_the_delay_of_a_packet_is_that_against_the_quickest_of_its_sender(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Clocks of both ends differ by any time, here 1000 s; after each quick packet a bound drifts away slowly."""
    end, sender, apart = End(DESCRIPTION, "127.0.0.1", None), End(DESCRIPTION, "127.0.0.1", None), 1000.0
    under_way = (0.004, 0.010, 0.003, 0.003, 0.080, 0.003, 2.0, 0.004)  # s
    quickest = np.minimum.accumulate(under_way)
    for i, (took, least) in enumerate(zip(under_way, quickest, strict=True)):
        sent = 50.0 + 0.01 * i
        head = end.header(sender.pack(HELLO, 0))
        assert head is not None
        monkeypatch.setattr(udp.time, "monotonic", lambda now=sent + took: now)
        late = end.delay(head._replace(number=round(1e9 * (sent + apart))))
        monkeypatch.undo()
        assert late == pytest.approx(took - least, abs=1e-3)


def test_a_hello_takes_the_measurements_from_nobody(wire: Wire) -> None:
    """Recorded ones are answered at most; the robot's own packets, sent back to it, are none of a driver's."""
    driver, record = wire.driver(), Program(wire)
    hello = record.end.pack(HELLO, 0)
    measurement = wire.robot._end.pack(MEASUREMENT, record.end.key, random_measurement(wire.rng))
    assert wire.meets(driver)
    for data in (hello, measurement):
        wire.throw(data)
        wire.robot.send(random_measurement(wire.rng))
        assert driver.read(0.0) is not None
    assert wire.obeys(driver)
    owner = wire.robot.sender
    for data in (record.end.pack(HELLO, 0), measurement):
        assert wire.throw(data) == (False, None) and wire.robot.sender == owner
    record.socket.close()


def test_the_memory_of_senders_is_bounded_and_keeps_the_owner(wire: Wire) -> None:
    owner, stranger = Program(wire), End(DESCRIPTION, "127.0.0.1", wire.secret)
    old = owner.send(owner.end.pack(COMMAND, owner.robot, ZERO))
    assert wire.robot.receive()[1] is not None
    for key in range(1, 1000):
        stranger.key = key
        head = wire.robot._end.header(stranger.pack(HELLO, 0))
        assert head is not None and wire.robot._end.is_new(head, owner.end.key)
    assert len(wire.robot._end._newest) <= udp.KEYS
    assert wire.throw(old) == (False, None)  # known, and old
    owner.socket.close()


def test_a_robot_has_one_owner_until_it_falls_silent(wire: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hello, command and damp of others are refused and counted; a guard, which has the owner's key, damps."""
    owner, other = wire.owner(), wire.driver()
    before = wire.robot.refused
    assert not wire.meets(other) and not wire.obeys(other)
    other.damp()
    assert wire.robot.receive() == (False, None) and wire.robot.refused >= before + 3
    guard = pickle.loads(pickle.dumps(owner))
    wire.drivers.append(guard)
    guard.damp()
    assert wire.robot.receive() == (True, None)
    wire.robot.send(random_measurement(wire.rng))
    assert owner.read(0.1) is not None and wire.obeys(owner)  # what the guard sends moves nothing
    monkeypatch.setattr(udp, "SILENCE", 0.0)
    assert wire.meets(other) and wire.obeys(other)
    monkeypatch.setattr(udp, "SILENCE", 10.0)
    assert not wire.obeys(owner)


def test_a_command_from_another_address_redirects_no_measurement(wire: Wire) -> None:
    """The owner is known by its key, and gets the measurements where it became the owner."""
    program = Program(wire)
    program.send(program.end.pack(COMMAND, program.robot, ZERO))
    assert wire.robot.receive()[1] is not None
    address = wire.robot.sender
    assert address is not None and address[1] == program.socket.getsockname()[1]
    damped, newest = wire.throw(program.end.pack(COMMAND, program.robot, ZERO))
    assert newest is not None and not damped and wire.robot.sender == address
    sent = random_measurement(wire.rng)
    wire.robot.send(sent)
    head = program.end.header(program.socket.recv(65536))
    assert head is not None and head.time == sent.time
    program.socket.close()


BAD = {
    "negative gain": lambda c: replace(c, kd=-c.kd),
    "NaN": lambda c: replace(c, joint_torque=np.full(NA, np.nan)),
    "infinite": lambda c: replace(c, joint_position=np.full(NA, -np.inf)),
    "1e30": lambda c: replace(c, kp=np.full(NA, 1e30)),
}


@pytest.mark.parametrize(
    "change",
    [
        {"joint_position": None},
        {"joint_velocity": "fast"},
        {"joint_torque": np.zeros(NA + 1)},
        {"sole_range": np.array(["near", "far"])},
        {"wrench_source": "guessed"},
        {"time": None},
    ],
)
def test_a_measurement_that_no_packet_holds_is_refused_where_it_is_sent(
    wire: Wire, change: dict[str, Any]
) -> None:
    sent = random_measurement(wire.rng)
    with pytest.raises(WbcError, match=next(iter(change)).replace("wrench_source", "origin")):
        wire.robot._end.pack(MEASUREMENT, 1, replace(sent, **change))
    wire.robot._end.pack(MEASUREMENT, 1, replace(sent, sole_range=None, sole_stiffness=None))


BAD_ON_THE_WIRE = BAD | {
    "negative stiffness": lambda c: replace(c, sole_stiffness=np.array([5.0, -5.0])),
}


@pytest.mark.parametrize("bad", BAD_ON_THE_WIRE.values(), ids=BAD_ON_THE_WIRE.keys())
def test_a_command_that_no_drive_must_get_damps_and_its_sender_is_named(
    wire: Wire, bad: Callable[[Command], Command], caplog: pytest.LogCaptureFixture
) -> None:
    driver = wire.owner()
    good = Command(np.zeros(NA), *np.zeros((2, NA)), kp=np.ones(NA), kd=np.ones(NA))
    assert wire.obeys(driver, good)
    driver.write(bad(good))
    assert wire.robot.receive() == (True, None)
    assert f"port {wire.robot.sender[1]}" in caplog.text  # type: ignore[index]
    assert wire.obeys(driver, good)


def test_a_server_damps_on_a_bad_command_of_any_wire_and_goes_on() -> None:
    loop = MujocoLoop(DESCRIPTION, Plant(DESCRIPTION, visuals=False).model, control_period=0.005)
    given: list[Any] = [loop.hold()]
    server = RobotServer(loop, types.SimpleNamespace(receive=lambda: (False, given[-1]), send=lambda _: None))
    server.step()
    hold = Command(np.zeros(NA), *np.zeros((2, NA)), kp=np.ones(NA), kd=np.ones(NA))
    others = Command(np.zeros(3)), replace(hold, period=0.004), "command"
    for wrong in (*(bad(hold) for bad in BAD.values()), *others):
        given.append(wrong)
        server.step()
        assert server.damped, wrong
        given.append(loop.hold())
        server.step()
        assert not server.damped and np.isfinite(loop.data.qpos).all()


def test_packets_of_strangers_neither_damp_nor_lock_anybody_out(wire: Wire) -> None:
    """Forged keys, bits that have flipped, noise: the robot obeys its owner, the driver hears its robot."""
    rng, owner, forger = wire.rng, Program(wire), End(DESCRIPTION, "127.0.0.1", None)

    def obeyed() -> bool:
        owner.send(owner.end.pack(COMMAND, owner.robot, ZERO))
        damped, newest = wire.robot.receive()
        return newest is not None and not damped

    assert obeyed()
    for key, kind, to in (
        (forger.key, COMMAND, owner.robot),
        (forger.key, HELLO, 0),
        (forger.key, DAMP, 0),
        (owner.robot, COMMAND, owner.robot),
        (owner.end.key ^ 1, DAMP, 0),
    ):
        forger.key = key
        assert wire.throw(forger.pack(kind, to, ZERO)) == (False, None)
        assert obeyed()
    good = owner.end.pack(COMMAND, owner.robot, ZERO)
    for _ in range(200):
        noise = rng.bytes(int(rng.integers(0, 1500)))
        for data in (noise, good[: rng.integers(4)] + noise, noise[:40] + good[40:]):
            assert wire.throw(data) == (False, None)
    assert obeyed()
    owner.socket.close()


def test_a_driver_hears_its_robot_alone(wire: Wire) -> None:
    driver = wire.owner()
    fake, rng = End(DESCRIPTION, "127.0.0.1", wire.secret), wire.rng
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for to in (0, 5):
            stranger.sendto(fake.pack(MEASUREMENT, to, random_measurement(rng)), wire.robot.sender)  # type: ignore[arg-type]
    assert driver.read(0.05) is None
    measurement = random_measurement(rng)
    wire.robot.send(measurement)
    got = driver.read(1.0)
    assert got is not None and got.time == measurement.time


def test_signed_packets_cannot_be_forged_or_replayed() -> None:
    wire = Wire(SECRET)
    owner = Program(wire)
    hello, command = (owner.end.pack(kind, owner.robot, ZERO) for kind in (HELLO, COMMAND))
    for place in range(0, len(command), 7):
        flipped = bytearray(command)
        flipped[place] ^= 1 << place % 8
        assert wire.throw(bytes(flipped)) == (False, None)
    owner.send(command)
    assert wire.robot.receive()[1] is not None
    sender = wire.robot.sender
    for data in (hello, command):  # recorded packets
        assert wire.throw(data) == (False, None) and wire.robot.sender == sender
    port = wire.robot.port
    wire.robot.close()
    wire.robot = UdpRobot(DESCRIPTION, port, secret=SECRET)  # it remembers nothing
    assert wire.throw(command) == (False, None) and wire.robot.sender is None
    wrong = wire.driver(secret=SECRET + "!")
    assert not wire.meets(wrong) and wire.meets(wire.driver())
    wire.robot.close()
    for each in (*wire.drivers, owner.socket):
        each.close()


@pytest.mark.parametrize("how", ["obeyed", "refused", "lost"])
def test_a_recorded_command_moves_nothing_once_its_sender_is_forgotten(
    how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As long as another one has owned the robot, or the robot has heard of many others since."""
    wire = Wire(SECRET)
    monkeypatch.setattr(udp, "SILENCE", 0.0)
    first = Program(wire)
    hello, command = first.end.pack(HELLO, 0), first.end.pack(COMMAND, first.robot, ZERO)
    if how != "lost":
        monkeypatch.setattr(udp, "SILENCE", 10.0 if how == "refused" else 0.0)
        if how == "refused":
            wire.owner()
        assert (wire.throw(command)[1] is not None) == (how == "obeyed")
        monkeypatch.setattr(udp, "SILENCE", 0.0)
        second = wire.driver()
        assert wire.meets(second) and wire.obeys(second)
    for _ in range(udp.KEYS + 1):
        wire.throw(End(DESCRIPTION, "127.0.0.1", SECRET).pack(HELLO, 0))
    assert first.end.key not in wire.robot._end._newest
    for data in (command, hello, command):  # again with a hello that is known to be answered
        assert wire.throw(data)[1] is None
    assert wire.meets(late := wire.driver()) and wire.obeys(late)
    first.socket.close()
    for each in (*wire.drivers, wire.robot):
        each.close()


def test_a_flood_of_others_loses_no_command_of_the_owner(wire: Wire) -> None:
    owner = wire.owner()
    if wire.robot._of_owner is None:
        pytest.skip("one socket for all")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as others:
        for _ in range(10 * udp.MOST):  # more than a buffer holds
            others.sendto(bytes(1400), ("127.0.0.1", wire.robot.port))
    assert wire.obeys(owner)
    assert wire.robot.refused
    with pytest.raises(InputError, match="listen"):
        UdpRobot(DESCRIPTION, wire.robot.port)  # no other program shares the port


@pytest.mark.parametrize(
    "how",
    [
        {"port": 0},
        {"host": "192.168.1.10"},
        {"host": "0.0.0.0"},
        {"host": "::"},
        {"host": "fe80::1"},
        {"host": "localhost.example"},
        {"secret": "short"},
    ],
)
def test_a_wire_without_a_secret_where_it_needs_one_is_refused(how: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="port|secret"):
        UdpDriver(DESCRIPTION, **how)
