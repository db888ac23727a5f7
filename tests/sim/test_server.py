"""A simulated robot at the end of a wire: whom it obeys, the band it hangs at, and its time, by a clock of the test."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from wbc.core.signals import Command, Measurement
from wbc.robots import load
from wbc.sim import MujocoLoop, Plant, RobotServer
from wbc.sim.loop import server as module

DESCRIPTION = load("hrp4_class")
NA = len(DESCRIPTION.joint_names)
COMMAND = Command(np.full(NA, 0.1))


class Clock:
    """Time that passes when somebody sleeps, or as a test has it."""

    now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now += seconds


class Wire:
    """The driver's orders, and what it has got."""

    damped = False
    command: Command | None = None

    def __init__(self) -> None:
        self.sent: list[Measurement] = []

    def receive(self) -> tuple[bool, Command | None]:
        return self.damped, self.command

    def send(self, measurement: Measurement) -> None:
        self.sent.append(measurement)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    return clock


@pytest.fixture
def loop() -> MujocoLoop:
    return MujocoLoop(DESCRIPTION, Plant(DESCRIPTION).model, control_period=0.005)


def test_a_command_acts_until_its_time_is_over_or_damping_is_asked_for(
    loop: MujocoLoop, clock: Clock, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    wire, acted, rest = Wire(), [], loop.hold()
    monkeypatch.setattr(loop, "step", acted.append)
    server = RobotServer(loop, wire, watchdog=0.012)
    loop.data.qpos[loop.places.joint_qpos] += 0.01

    def step(command: Command | None = None, *, damped: bool = False, after: float = 0.0) -> Command:
        wire.command, wire.damped = command, damped
        clock.now += after
        server.step()
        now: Command = acted[-1]
        assert server.damped is (now.kp is not None), "no other command here has gains"
        if server.damped:
            sinking = (
                np.zeros(NA),
                rest.joint_position + 0.01,
                np.zeros(NA),
                np.zeros(NA),
                0.1 * DESCRIPTION.kd,
            )
            for name, value in zip(
                ("joint_torque", "joint_position", "joint_velocity", "kp", "kd"), sinking, strict=True
            ):
                np.testing.assert_allclose(getattr(now, name), value, atol=1e-12)
        return now

    for _ in range(2):  # as if it stood in a rack
        np.testing.assert_array_equal(step(after=9.0).joint_position, rest.joint_position)
        assert not server.damped and server.silent == math.inf
    assert step(COMMAND) is COMMAND and server.silent == 0.0
    assert step(after=0.006) is COMMAND and server.silent == pytest.approx(0.006), (
        "a period later it still counts"
    )
    step(after=0.002)
    assert server.damped, "it would end within the period"
    assert step(COMMAND) is COMMAND
    step(damped=True)
    assert server.damped
    step()
    assert server.damped, "there is no way back into the rack"
    assert step(COMMAND) is COMMAND
    step(Command(np.zeros(3)))
    assert server.damped and "the joints are damped" in caplog.text and len(wire.sent) == 10


def test_the_band_is_a_critically_damped_spring_that_is_let_down_and_released(
    loop: MujocoLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    """20 rad/s of the robot's mass, 50 mm above where it hangs; it is let down in a second and released in another."""
    server = RobotServer(loop, Wire(), band=0.5)
    data, root, mass = loop.data, loop.places.root, loop.robot.mass
    top = data.xpos[root] + [0.0, 0.0, 0.05]
    push = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    data.xfrc_applied[root] = push
    monkeypatch.setattr(loop, "step", lambda command: None)
    tilt, velocity, turning = 0.2, np.array([0.1, -0.2, 0.3]), np.array([0.4, 0.5, -0.6])
    data.qpos[:3] += [0.03, -0.02, 0.04]
    data.qpos[3:7] = [math.cos(0.5 * tilt), math.sin(0.5 * tilt), 0.0, 0.0]
    data.qvel[:3], data.qvel[3:6] = velocity, turning
    mujoco.mj_forward(loop.model, data)
    rotation = data.xmat[root].reshape(3, 3)
    for time, down, share in ((0.2, 0.0, 1.0), (0.9, 0.02, 1.0), (1.75, 0.05, 0.75), (2.6, 0.0, 0.0)):
        data.time = time
        server.step()
        force = mass * (20.0**2 * (top - [0.0, 0.0, down] - data.qpos[:3]) - 2.0 * 20.0 * velocity)
        moment = mass * (20.0 * np.array([-math.sin(tilt), 0.0, 0.0]) - 0.8 * rotation @ turning)
        np.testing.assert_allclose(
            data.xfrc_applied[root] - push, share * np.append(force, moment), atol=1e-9
        )
    assert np.count_nonzero(data.xfrc_applied) == 6
