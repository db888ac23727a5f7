"""The UDP wire: what packets carry, who owns a robot, what strangers cannot do."""

from __future__ import annotations

import pickle
import socket
import time
import types
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

import wbc
from wbc import Command, Measurement
from wbc.core.errors import InputError
from wbc.machine import UdpDriver, UdpRobot, udp
from wbc.machine.udp import COMMAND, DAMP, HELLO, MEASUREMENT, SILENCE, End
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


class Clock:
    """The time of the module, which a test moves on."""

    def __init__(self) -> None:
        self.ahead = 0.0

    def monotonic(self) -> float:
        return time.monotonic() + self.ahead

    def monotonic_ns(self) -> int:
        return time.monotonic_ns() + int(1e9 * self.ahead)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    monkeypatch.setattr(udp, "time", made := Clock())
    return made


class Wire:
    """A robot and drivers of it, closed at the end."""

    def __init__(self, **how: Any) -> None:
        self.how = how
        self.robot = UdpRobot(DESCRIPTION, 0, **how)
        self.drivers: list[UdpDriver] = []
        self.rng = np.random.default_rng(0)

    def driver(self, **how: Any) -> UdpDriver:
        self.drivers.append(UdpDriver(DESCRIPTION, port=self.robot.port, **(self.how | how)))
        return self.drivers[-1]

    def owner(self, **how: Any) -> UdpDriver:
        """Return a driver that owns the robot."""
        driver = self.driver(**how)
        self.meet(driver)
        return driver

    def meet(self, driver: UdpDriver) -> bool:
        """Let a driver ask for the robot; return whether it gets measurements."""
        driver._greeted = False
        for _ in range(4):  # hello, answer, hello that names the robot, measurement
            got = driver.read(0.0)
            self.robot.receive()
            self.robot.send(random_measurement(self.rng))
        return got is not None or driver.read(0.0) is not None

    def obeys(self, driver: UdpDriver, command: Command = ZERO) -> bool:
        driver.write(command)
        damped, newest = self.robot.receive()
        return newest is not None and not damped

    def throw(self, data: bytes) -> tuple[bool, Command | None]:
        """Send the robot bytes from an address of their own."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
            wire.sendto(data, ("127.0.0.1", self.robot.port))
        return self.robot.receive()


@pytest.fixture(params=[None, SECRET], ids=["unsigned", "signed"])
def wire(request: pytest.FixtureRequest) -> Iterator[Wire]:
    made = Wire(secret=request.param)
    yield made
    made.robot.close()
    for driver in made.drivers:
        driver.close()


@pytest.mark.parametrize("secret", [None, SECRET])
def test_packets_carry_everything(secret: str | None) -> None:
    rng = np.random.default_rng(0)
    end, numbers = End(NA, secret), lambda n: rng.normal(size=(n, NA))
    whole = random_measurement(rng)
    for sent in (
        whole,
        replace(whole, joint_torque=None),
        replace(whole, sole_wrench=None),
        Command(*numbers(1)),
        Command(*numbers(3)),
        Command(*numbers(3), None, *numbers(2)),
        Command(*numbers(1), kp=numbers(1)[0], kd=numbers(1)[0]),
    ):
        data = end.pack(MEASUREMENT if isinstance(sent, Measurement) else COMMAND, 7, sent)
        head = end.header(data)
        assert head is not None and (head.key, head.to) == (end.key, 7) and end.genuine(data)
        got = end.content(head, data)
        assert type(got) is type(sent)
        for field in fields(sent):
            np.testing.assert_array_equal(getattr(got, field.name), getattr(sent, field.name), field.name)


def test_a_driver_gets_the_newest_measurement_and_is_obeyed_after_it(wire: Wire) -> None:
    driver = pickle.loads(pickle.dumps(wire.driver()))
    wire.drivers.append(driver)
    assert not wire.obeys(driver)  # it does not know the robot yet
    assert wire.meet(driver)
    sent = [random_measurement(wire.rng) for _ in range(3)]
    for measurement in sent:
        wire.robot.send(measurement)
    np.testing.assert_array_equal(driver.read(1.0).joint_position, sent[-1].joint_position)
    late = driver._end.pack(COMMAND, driver._robot, ZERO)
    assert wire.obeys(driver, Command(np.ones(NA)))
    driver.damp()
    assert wire.robot.receive() == (True, None)
    assert wire.throw(late) == (False, None)  # overtaken on its way by the damping


def test_a_robot_has_one_owner_until_it_falls_silent(wire: Wire, clock: Clock) -> None:
    """Hello, command and damp of others are refused and counted; a guard, which has the owner's key, damps."""
    owner, other = wire.owner(), wire.driver()
    before = wire.robot.refused
    assert not wire.meet(other) and wire.robot.refused >= before + 1
    other._robot = owner._robot
    other.damp()
    assert not wire.obeys(other) and wire.robot.receive() == (False, None)
    assert wire.robot.refused >= before + 3
    guard = pickle.loads(pickle.dumps(owner))
    wire.drivers.append(guard)
    guard.damp()
    assert wire.robot.receive() == (True, None)
    wire.robot.send(random_measurement(wire.rng))
    assert owner.read(0.0) is not None and wire.obeys(owner)  # what the guard sends moves nothing
    clock.ahead += 1.1 * SILENCE
    assert wire.meet(other) and wire.obeys(other) and not wire.obeys(owner)


BAD = {
    "negative gain": lambda c: replace(c, kd=-c.kd),
    "NaN": lambda c: replace(c, joint_torque=np.full(NA, np.nan)),
    "infinite": lambda c: replace(c, joint_position=np.full(NA, -np.inf)),
    "1e30": lambda c: replace(c, kp=np.full(NA, 1e30)),
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD.keys())
def test_a_command_that_no_drive_must_get_damps_and_its_sender_is_named(
    wire: Wire, bad: Callable[[Command], Command], caplog: pytest.LogCaptureFixture
) -> None:
    driver = wire.owner()
    good = Command(np.zeros(NA), *np.zeros((2, NA)), kp=np.ones(NA), kd=np.ones(NA))
    assert wire.obeys(driver, good)
    driver.write(bad(good))
    assert wire.robot.receive() == (True, None)
    assert "packet of {}, port {}: command: ".format(*driver._socket.getsockname()) in caplog.text  # type: ignore[union-attr]
    assert wire.obeys(driver, good)


def test_a_server_damps_on_a_bad_command_of_any_wire_and_goes_on() -> None:
    loop = MujocoLoop(DESCRIPTION, Plant(DESCRIPTION).model, control_period=0.005)
    given: list[Any] = [loop.hold()]
    server = RobotServer(loop, types.SimpleNamespace(receive=lambda: (False, given[-1]), send=lambda _: None))
    server.step()
    hold = Command(np.zeros(NA), *np.zeros((2, NA)), kp=np.ones(NA), kd=np.ones(NA))
    for wrong in (*(bad(hold) for bad in BAD.values()), Command(np.zeros(3)), "command"):
        given.append(wrong)
        server.step()
        assert server.damped, wrong
        given.append(loop.hold())
        server.step()
        assert not server.damped and np.isfinite(loop.data.qpos).all()


def test_packets_of_strangers_neither_damp_nor_lock_anybody_out(wire: Wire) -> None:
    """Forged numbers, bits that have flipped, noise: the robot obeys its owner, the driver hears its robot."""
    owner, rng = wire.owner(), wire.rng
    forger = End(NA, None)
    for key, kind, to, ahead in (
        (forger.key, COMMAND, owner._robot, 900),
        (forger.key, HELLO, 0, 10**9),
        (forger.key, DAMP, 0, 900),
        (owner._robot, COMMAND, owner._robot, 900),
        (owner._end.key ^ 1, DAMP, 0, 2**60),
    ):
        forger.key, forger._number = key, owner._end._number + ahead
        assert wire.throw(forger.pack(kind, to, ZERO)) == (False, None)
        assert wire.obeys(owner)
    good = owner._end.pack(COMMAND, owner._robot, ZERO)
    for _ in range(200):
        noise = rng.bytes(int(rng.integers(0, 1500)))
        for data in (noise, good[: rng.integers(4)] + noise, noise[:40] + good[40:]):
            assert wire.throw(data) == (False, None)
    assert wire.obeys(owner)
    # The driver's way: packets of other addresses, and of the right one with another key.
    fake = End(NA, None)
    fake._number = 2**62
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(
            fake.pack(MEASUREMENT, owner._end.key, random_measurement(rng)), owner._socket.getsockname()
        )  # type: ignore[union-attr]
    wire.robot._socket.sendto(fake.pack(MEASUREMENT, 5, random_measurement(rng)), wire.robot.sender)  # type: ignore[arg-type]
    owner._receive()
    measurement = random_measurement(rng)
    wire.robot.send(measurement)
    got = owner.read(1.0)
    assert got is not None and got.time == measurement.time


def test_signed_packets_cannot_be_forged_or_replayed(clock: Clock) -> None:
    wire = Wire(secret=SECRET)
    owner = wire.owner()
    assert wire.obeys(owner)
    hello, command = (owner._end.pack(kind, owner._robot, ZERO) for kind in (HELLO, COMMAND))
    for place in range(0, len(command), 7):
        flipped = bytearray(command)
        flipped[place] ^= 1 << place % 8
        assert wire.throw(bytes(flipped)) == (False, None)
    for data in (hello, command):
        wire.throw(data)
    sender = wire.robot.sender
    for ahead in (0.0, 10.0):  # recorded packets, in the presence of their sender and after it has gone
        clock.ahead = ahead
        for data in (hello, command):
            assert wire.throw(data) == (False, None) and wire.robot.sender == sender
    port = wire.robot.port
    wire.robot.close()
    wire.robot = UdpRobot(DESCRIPTION, port, secret=SECRET)  # it remembers nothing
    for data in (hello, command):
        assert wire.throw(data) == (False, None) and wire.robot.sender is None
    unsigned, wrong = wire.driver(secret=None), wire.driver(secret=SECRET + "!")
    assert not wire.meet(unsigned) and not wire.meet(wrong) and wire.meet(wire.driver())
    wire.robot.close()


@pytest.mark.parametrize(
    "how",
    [
        {"port": 0},
        {"host": "192.168.1.10"},
        {"host": "0.0.0.0"},
        {"secret": "short"},
        {"secret": SECRET, "unsigned": True},
    ],
)
def test_a_wire_without_a_secret_where_it_needs_one_is_refused(how: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="port|secret"):
        UdpDriver(DESCRIPTION, **how)
