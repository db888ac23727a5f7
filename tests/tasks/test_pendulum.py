"""Frequency of the pendulum; points of wrenches."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.base.errors import InputError
from wbc.core.frames import net_wrench
from wbc.tasks.stabilizer.pendulum import (
    NoContactForceError,
    Pendulum,
    cop,
    dcm,
    level_zmp,
    natural_frequency,
)


def test_natural_frequency_of_a_085_m_pendulum() -> None:
    assert natural_frequency(0.85) == pytest.approx(3.397, abs=5e-4)
    with pytest.raises(InputError, match="height"):
        natural_frequency(0.0)


def test_pendulum_at_rest() -> None:
    rest = Pendulum.at_rest(np.array([0.3, 0.1, 1.05]), ground=0.2)
    assert rest.omega == pytest.approx(natural_frequency(0.85))
    np.testing.assert_allclose(rest.dcm, [0.3, 0.1, 1.05])
    np.testing.assert_allclose(rest.zmp, [0.3, 0.1, 0.2])


def test_a_moved_pendulum_is_one_over_the_zmp_that_goes_with_it() -> None:
    rng = np.random.default_rng(3)
    com, velocity, acceleration, shift, rate, push = rng.normal(size=(6, 3))
    rest = Pendulum.at_rest(np.array([0.3, 0.1, 1.05]), ground=0.2)
    ground = np.array([*(com - acceleration / rest.omega**2)[:2], 0.2])
    before = rest._replace(com=com, com_velocity=velocity, com_acceleration=acceleration, zmp=ground)
    moved = before.moved(shift, rate, push)
    np.testing.assert_allclose(moved.com, com + shift)
    np.testing.assert_allclose(moved.com_velocity, velocity + rate)
    np.testing.assert_allclose(moved.com_acceleration, acceleration + push)
    np.testing.assert_allclose(
        moved.com_acceleration[:2], rest.omega**2 * (moved.com - moved.zmp)[:2], atol=1e-12
    )
    assert moved.zmp[2] == 0.2 and before.zmp is ground
    np.testing.assert_allclose(dcm(moved.com, moved.com_velocity, rest.omega), moved.dcm)


def test_cop_and_zmp_agree_on_a_level_sole_anywhere() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        sole = pin.SE3(pin.utils.rotate("z", rng.uniform(-3.0, 3.0)), rng.uniform(-100, 100, 3))
        x, y, f = rng.uniform(-0.1, 0.1), rng.uniform(-0.05, 0.05), rng.uniform(50, 500)
        shear = rng.uniform(-50, 50, 2)
        wrench = np.array([shear[0], shear[1], f, y * f, -x * f, rng.uniform(-5, 5)])
        np.testing.assert_allclose(cop(wrench), [x, y], atol=1e-12)
        world = net_wrench(wrench[None], [sole])
        found = level_zmp(world, sole.translation + [3.0, -2.0, 0.0])
        np.testing.assert_allclose(found, sole.act(np.array([x, y, 0.0])), atol=1e-8)


def test_no_point_without_force() -> None:
    with pytest.raises(NoContactForceError, match="below 1 N"):
        cop(np.array([0, 0, 0.5, 0, 0, 0]))
    with pytest.raises(NoContactForceError, match="vertical"):
        level_zmp(np.array([0, 0, 0.5, 0, 0, 0]), np.zeros(3))
    with pytest.raises(NoContactForceError, match="vertical"):
        level_zmp(np.array([0, 0, -300.0, 0, 0, 0]), np.zeros(3))
