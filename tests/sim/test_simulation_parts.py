"""Parts that all simulations share: pushes, delays of commands, whole steps, periods of commands."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc import Plant
from wbc.base.errors import InputError
from wbc.core.signals import Command
from wbc.sim.simulation.machine import steps_per_tick, whole_steps
from wbc.sim.simulation.pushes import Pushes
from wbc.sim.simulation.simulation import DelayLine


def test_a_push_acts_for_its_time_and_with_a_share_of_its_force_in_its_last_step() -> None:
    """For 2.5 steps of 2 ms: twice in full, then by half; its point is that of the frame, seen from the body."""
    pushes, force = Pushes(), np.array([10.0, -4.0, 2.0])
    frame = pin.SE3(pin.utils.rotate("z", 0.5 * np.pi), np.array([0.1, 0.2, 0.3]))
    assert not pushes.active and pushes.advance(0.002) == []
    pushes.add("torso", frame, force, 0.005, [0.01, 0.0, 0.0])
    pushes.add("foot", frame, 2.0 * force, 0.002, None)
    shares = []
    for step in range(3):
        assert pushes.active
        found = pushes.advance(0.002)
        assert [body for body, *_ in found] == (["torso", "foot"] if step == 0 else ["torso"])
        np.testing.assert_allclose(found[0][2], [0.1, 0.21, 0.3], atol=1e-12)
        if step == 0:
            np.testing.assert_allclose(found[1][1], 2.0 * force)
            assert found[1][2] is None
        shares.append(float(found[0][1] @ force / (force @ force)))
    assert shares == pytest.approx([1.0, 1.0, 0.5]) and not pushes.active
    pushes.add("torso", frame, force, 0.006, None)  # three steps, but for rounding
    assert [len(pushes.advance(0.002)) for _ in range(4)] == [1, 1, 1, 0]
    pushes.add("torso", frame, force, 1.0, None)
    pushes.clear()
    assert not pushes.active


def test_a_command_acts_some_steps_after_it_was_given_and_a_newer_one_takes_its_place() -> None:
    line = DelayLine(3)
    commands = [Command(np.full(2, float(k))) for k in range(4)]

    def due() -> float | None:
        found = line.advance()
        return None if found is None else float(found.joint_torque[0])

    line.push(commands[0])
    commands[0].joint_torque[:] = 9.0  # of a controller that uses its array again
    assert [due(), due()] == [None, None]
    line.push(commands[1])
    assert [due(), due(), due(), due()] == [None, 0.0, None, 1.0]
    line.push(commands[2])
    line.push(commands[3])
    assert [due() for _ in range(4)] == [None, None, None, 3.0]
    line.push(commands[2])
    line.clear()
    assert [due() for _ in range(5)] == [None] * 5


@pytest.mark.parametrize(
    ("time", "step", "count"),
    [
        (0.0, 0.001, 0),
        (0.003, 0.001, 3),
        (0.0031, 0.001, 4),
        (0.0029, 0.001, 3),
        (0.1, 0.002, 50),
        (0.0001, 0.002, 1),
    ],
)
def test_a_time_is_as_many_steps_as_cover_it(time: float, step: float, count: int) -> None:
    assert whole_steps(time, step) == count


def test_a_control_period_is_a_whole_multiple_of_the_step() -> None:
    for period, step, count in (
        (0.005, 0.001, 5),
        (0.002, 0.002, 1),
        (0.006, 0.0015, 4),
        (0.1, 0.0001, 1000),
    ):
        assert steps_per_tick(period, step) == count
    for period, step, near in ((0.005, 0.002, "0.004"), (0.001, 0.002, "0.002"), (0.0049, 0.001, "0.005")):
        with pytest.raises(InputError, match=f"nearest is {near} s"):
            steps_per_tick(period, step)


def test_a_command_is_for_the_period_of_its_simulation_or_a_multiple_of_it() -> None:
    plant = Plant("hrp4_class", control_period=0.004, visuals=False)
    zero = np.zeros(plant.robot.na)
    for period in (None, 0.004, 0.008, 0.02):
        plant.step(Command(zero, period=period))
    before = plant.time
    for period in (0.002, 0.005, 0.006, 0.003, 0.0041):
        with pytest.raises(InputError, match=f"period of {1e3 * period:g} ms.* by 4 ms"):
            plant.step(Command(zero, period=period))
    assert plant.time == before == pytest.approx(0.016)
