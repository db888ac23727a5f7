"""A simulated robot at the end of a wire: whom it obeys, the band it hangs at, and its time, by a clock of the test."""

from __future__ import annotations

import math
import types

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
def loop() -> MujocoLoop:
    return MujocoLoop(DESCRIPTION, Plant(DESCRIPTION).model, control_period=0.005)


def test_a_command_acts_until_its_time_is_over_or_damping_is_asked_for(
    loop: MujocoLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, wire = [100.0], Wire()
    clock = types.SimpleNamespace(monotonic=lambda: now[0], sleep=lambda seconds: None)
    monkeypatch.setattr(module, "time", clock)
    server = RobotServer(loop, wire, watchdog=0.012)
    for command, after, damped in (
        (COMMAND, 0.0, False),
        (None, 0.006, False),
        (None, 0.002, True),  # it would end within the period
        (COMMAND, 0.0, False),
        (Command(np.zeros(3)), 0.0, True),
    ):
        wire.command, now[0] = command, now[0] + after
        server.step()
        assert server.damped is damped
    wire.command, wire.damped = COMMAND, True
    server.step()
    assert server.damped


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
