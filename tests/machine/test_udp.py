"""The UDP wire: what packets carry, who owns a robot, what strangers cannot do; a flood while a robot is driven."""

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
from machine_process import Process

import wbc
from wbc import Command, Measurement
from wbc.core.errors import InputError
from wbc.machine import MachineError, UdpDriver, UdpRobot, udp
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


@pytest.mark.parametrize("position", [True, False])
def test_a_gain_that_comes_alone_gets_its_fellow(wire: Wire, position: bool) -> None:
    driver, zero, kd = wire.owner(), np.zeros(NA), np.full(NA, 2.0)
    driver.write(Command(zero, zero if position else None, kd=kd))
    _, command = wire.robot.receive()
    assert command is not None
    np.testing.assert_array_equal(command.kd, kd)
    np.testing.assert_array_equal(command.kp, DESCRIPTION.kp if position else zero)


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


def test_a_robot_that_begins_anew_is_heard(wire: Wire) -> None:
    driver, port = wire.owner(), wire.robot.port
    assert wire.obeys(driver)
    old = driver._end.pack(COMMAND, driver._robot, ZERO)
    wire.robot.close()
    wire.robot = UdpRobot(DESCRIPTION, port, **wire.how)
    assert not wire.obeys(driver)  # commands to the robot before
    driver._send(HELLO, 0)  # as `read` does after 0.1 s of silence
    assert wire.meet(driver) and wire.obeys(driver)
    assert wire.throw(old) == (False, None)


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


def test_refused_packets_are_told_ever_more_seldom(wire: Wire, caplog: pytest.LogCaptureFixture) -> None:
    for _ in range(2001):
        wire.robot._refuse(("10.0.0.9", 4321))
    told = [
        f"{count} packets refused, the last one of 10.0.0.9, port 4321" for count in (1, 10, 100, 1000, 2000)
    ]
    assert caplog.messages == told and wire.robot.refused == 2001


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


def test_a_wire_that_leads_nowhere_or_lacks_a_secret_is_said_in_one_line() -> None:
    with pytest.raises(MachineError, match="host 'x+' cannot be found"):
        UdpDriver(DESCRIPTION, 100 * "x", unsigned=True).read(0.0)
    taken = UdpRobot(DESCRIPTION, 0)
    wire = UdpDriver(DESCRIPTION, port=taken.port)
    for _ in range(3):
        wire.read(0.0)
        taken.receive()
    assert taken.sender is not None  # its own socket shares the port
    with pytest.raises(InputError, match=f"cannot listen at 127.0.0.1, port {taken.port}"):
        UdpRobot(DESCRIPTION, taken.port)
    taken.close()
    wire.close()
    with pytest.raises(InputError, match="port must be in"):
        UdpDriver(DESCRIPTION, port=0)
    for host in ("192.168.1.10", "robot", "0.0.0.0"):
        for made in (UdpDriver, UdpRobot):
            with pytest.raises(InputError, match=f"{host} needs secret='…'.*16 characters"):
                made(DESCRIPTION, host=host)
    with pytest.raises(InputError, match="16 characters at least, got 5"):
        UdpDriver(DESCRIPTION, secret="short")
    with pytest.raises(InputError, match="signed with a secret or unsigned"):
        UdpDriver(DESCRIPTION, secret=SECRET, unsigned=True)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hello", "command", "noise"])
def test_the_owner_is_obeyed_in_a_flood(kind: str) -> None:
    """15,000 packets a second of a stranger, from a process of its own, to a robot that is served and driven here."""
    robot = UdpRobot(DESCRIPTION, 0)
    driver = UdpDriver(DESCRIPTION, port=robot.port)
    loop = MujocoLoop(DESCRIPTION, Plant(DESCRIPTION).model, control_period=0.005)
    obeyed: list[bool] = []

    class Counting:
        def receive(self) -> tuple[bool, Command | None]:
            damped, command = robot.receive()
            obeyed.append(not damped and command is not None)
            return damped, command

        send = staticmethod(robot.send)

    server = RobotServer(loop, Counting(), watchdog=0.015)
    hold = loop.hold()
    for _ in range(10):
        driver.read(0.0)
        driver.write(hold)
        server.step()

    def tick() -> bool:
        driver.read(0.0)
        driver.write(hold)
        return len(obeyed) >= 1500

    with Process("flood", str(robot.port), kind) as flood:
        flood.line("flooding")
        obeyed.clear()
        before = robot.refused
        server.run(tick)
    packets = (robot.refused - before) / len(obeyed)  # of a tick: on a busy computer both take longer
    print(f"obeyed in {sum(obeyed)} of {len(obeyed)} ticks, {packets:.0f} packets a tick refused")
    assert packets > 25.0 and np.mean(obeyed) >= 0.99
    robot.close()
    driver.close()
