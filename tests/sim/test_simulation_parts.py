"""Parts that all simulations share: pushes, delays of commands, whole steps, periods of commands."""

from __future__ import annotations

import numpy as np
import pytest
from in_air import InAir

from wbc import Plant
from wbc.base.errors import InputError
from wbc.core.signals import Command
from wbc.sim.simulation.machine import steps_per_tick, whole_steps


def test_a_push_acts_for_its_time_and_with_a_share_of_its_force_in_its_last_step() -> None:
    """For 2.5 steps of 2 ms: twice in full, then by half; its point is that of the frame, seen from the body."""
    loop, force, acted = InAir("hrp4_class", timestep=0.002), np.array([10.0, -4.0, 2.0]), []
    loop.advance = lambda torque, pushes: acted.append(pushes)  # type: ignore[method-assign, func-returns-value]
    link, place = loop.description.attachment("left_sole")
    loop.push("left_sole", force, 0.005, [0.01, 0.0, 0.0])
    loop.push("torso", 2.0 * force, 0.002)
    for _ in range(4):
        loop.step(loop.hold())
    assert [len(pushes) for pushes in acted] == [2, 1, 1, 0]
    for (push, *_), share in zip(acted[:3], (1.0, 1.0, 0.5), strict=True):
        assert push.link == link and push.point == pytest.approx(place.act(np.array([0.01, 0.0, 0.0])))
        np.testing.assert_allclose(push.force, share * force)
    np.testing.assert_allclose(acted[0][1].force, 2.0 * force)
    acted.clear()
    loop.push("torso", force, 0.006)  # three steps, but for rounding
    for _ in range(4):
        loop.step(loop.hold())
    assert [len(pushes) for pushes in acted] == [1, 1, 1, 0]


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
