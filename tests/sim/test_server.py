"""A simulated robot at the end of a wire: whom it obeys, the band it hangs at, and its time, by a clock of the test."""

from __future__ import annotations

import types

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
