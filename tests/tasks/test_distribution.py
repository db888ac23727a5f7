"""Wrench distribution: conventions, limits, invariance, and the closed form beside the QP."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.base.errors import InputError
from wbc.core.frames import net_wrench
from wbc.core.robot import GRAVITY
from wbc.tasks.stabilizer.distribution import (
    DistributionSettings,
    FootWrenches,
    WrenchDistribution,
    left_foot_ratio,
)
from wbc.tasks.stabilizer.pendulum import cop

WEIGHT = 62.4 * GRAVITY  # JVRC-1
SIZES = ((0.22, 0.10), (0.22, 0.10))
SOLES = [pin.SE3(np.eye(3), np.array([0.0, y, 0.0])) for y in (0.105, -0.105)]


def through(zmp: np.ndarray, force: np.ndarray, yaw: float = 0.0) -> np.ndarray:
    """A force through a point, with a yaw moment, as a wrench at the world origin."""
    return np.concatenate([force, np.cross(zmp, force) + [0.0, 0.0, yaw]])


def standing(
    y: float, x: float = 0.0, *, settings: DistributionSettings | None = None, **options
) -> FootWrenches:
    zmp = np.array([x, y, 0.0])
    ratio = left_foot_ratio(zmp, SOLES[0].translation, SOLES[1].translation)
    return WrenchDistribution(SIZES, settings).solve(
        through(zmp, np.array([0.0, 0.0, WEIGHT])), SOLES, zmp, ratio, **options
    )


def random_cases(count: int, seed: int):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        contact = [(True, True), (True, False), (False, True)][rng.integers(3)]
        soles = [
            pin.SE3(pin.rpy.rpyToMatrix(*rng.uniform(-0.1, 0.1, 2), rng.uniform(-0.4, 0.4)),
                    np.array([rng.uniform(-0.2, 0.2), y + rng.uniform(-0.03, 0.03), rng.uniform(-0.05, 0.05)]))
            for y in (0.105, -0.105)
        ]  # fmt: skip
        zmp = np.array([*rng.uniform(-0.2, 0.2, 2), 0.0])
        force = np.array([*rng.uniform(-80, 80, 2), rng.uniform(300, 900)])
        yield through(zmp, force, rng.uniform(-15, 15)), soles, zmp, rng.uniform(), contact


# Conventions: the oracle of the stabilizer (a 62.4 kg robot with its feet at ±0.105 m)


def test_the_ratio_is_one_at_the_left_foot() -> None:
    left, right = SOLES[0].translation, SOLES[1].translation
    assert left_foot_ratio(left, left, right) == 1.0 and left_foot_ratio(right, left, right) == 0.0
    assert left_foot_ratio(np.array([0.3, 0.0, 0.0]), left, right) == pytest.approx(0.5)
    assert left_foot_ratio(2 * left, left, right) == 1.0


# Properties


def test_random_wrenches_are_met_or_missed_honestly_and_within_limits() -> None:
    settings = DistributionSettings()
    distribution = WrenchDistribution(SIZES, settings)
    for net, soles, zmp, ratio, contact in random_cases(150, seed=0):
        result = distribution.solve(net, soles, zmp, ratio, contact)
        assert result.status.ok
        total = net_wrench(result.wrenches, soles)
        missing = net - total
        missing[3:] -= np.cross(zmp, missing[:3])
        np.testing.assert_allclose(missing, result.shortfall, atol=1e-4)
        for wrench, touches in zip(result.wrenches, contact, strict=True):
            if not touches:
                np.testing.assert_allclose(wrench, 0.0, atol=1e-4)
                continue
            assert wrench[2] >= settings.min_force - 1e-4
            assert np.abs(wrench[:2]).max() <= settings.friction * wrench[2] + 1e-4
            x, y = cop(wrench)
            assert abs(x) <= 0.11 + 1e-6 and abs(y) <= 0.05 + 1e-6


def test_a_wrench_within_reach_is_met() -> None:
    distribution = WrenchDistribution(SIZES)
    for random, soles, _, _, _ in random_cases(80, seed=1):
        level = [pin.SE3(np.eye(3), np.array([*s.translation[:2], 0.0])) for s in soles]
        middle = 0.5 * (level[0].translation + level[1].translation)
        net = through(middle, np.array([*(0.2 * random[:2]), random[2]]))
        result = distribution.solve(net, level, middle, 0.5)
        assert np.abs(result.shortfall).max() < 0.2


def test_one_foot_alone_gets_what_the_qp_gives_it(monkeypatch: pytest.MonkeyPatch) -> None:
    direct, by_qp = WrenchDistribution(SIZES), WrenchDistribution(SIZES)
    monkeypatch.setattr(by_qp, "_on_one_foot", lambda *_: None)
    within = 0
    for net, soles, zmp, _, _ in random_cases(60, seed=5):
        for contact in ((True, False), (False, True)):
            sole = soles[contact.index(True)]
            through_sole = sole.act(
                pin.Force(np.array([*(0.2 * net[:2]), abs(net[2]) + 50.0, 3.0, -5.0, 1.0]))
            )
            for wrench in (net, through_sole.vector):
                a = direct.solve(wrench, soles, zmp, 0.5, contact)
                b = by_qp.solve(wrench, soles, zmp, 0.5, contact)
                np.testing.assert_allclose(a.wrenches, b.wrenches, atol=2e-2)
                np.testing.assert_allclose(a.shortfall, b.shortfall, atol=2e-2)
                within += not a.shortfall.any()
    assert within > 20


def test_the_margin_bounds_the_cop() -> None:
    distribution = WrenchDistribution(SIZES, DistributionSettings(margin=0.02))
    zmp = np.array([0.1, 0.105, 0.0])
    result = distribution.solve(through(zmp, np.array([0.0, 0.0, WEIGHT])), SOLES, zmp, 1.0, (True, False))
    assert cop(result.wrenches[0])[0] == pytest.approx(0.09, abs=1e-4)
    with pytest.raises(InputError, match="nothing"):
        WrenchDistribution(SIZES, DistributionSettings(margin=0.05))


def test_a_zmp_beyond_the_toe_costs_moment_but_no_weight() -> None:
    for x in (0.0, 50.0):
        zmp = np.array([x + 0.16, 0.105, 0.0])
        soles = [pin.SE3(np.eye(3), s.translation + [x, 0.0, 0.0]) for s in SOLES]
        net = through(zmp, np.array([0.0, 0.0, WEIGHT]))
        result = WrenchDistribution(SIZES).solve(net, soles, zmp, 1.0, (True, False))
        assert cop(result.wrenches[0])[0] == pytest.approx(0.11, abs=1e-6)
        assert result.wrenches[0, 2] == pytest.approx(WEIGHT, abs=1.0)


def test_a_zmp_between_level_feet_loads_them_by_the_ratio_and_needs_no_ankle_torque() -> None:
    distribution = WrenchDistribution(SIZES)
    for y in (0.0, 0.04, -0.07):
        zmp = np.array([0.0, y, 0.0])
        ratio = left_foot_ratio(zmp, SOLES[0].translation, SOLES[1].translation)
        feet = distribution.solve(through(zmp, np.array([0.0, 0.0, WEIGHT])), SOLES, zmp, ratio)
        expected = np.zeros((2, 6))
        expected[:, 2] = ratio * WEIGHT, (1.0 - ratio) * WEIGHT
        np.testing.assert_allclose(feet.wrenches, expected, atol=0.5)


@pytest.mark.parametrize("y", [0.07, -0.05])
def test_torques_by_load_keep_the_cop_of_the_foot_with_less_load_off_the_edge(y: float) -> None:
    """Torques go with the squares of the loads; at equal costs the foot with less load has its CoP further out."""
    equal, by_load = (
        [cop(wrench)[0] for wrench in standing(y, 0.04, settings=settings).wrenches]
        for settings in (DistributionSettings(), DistributionSettings(by_load=True))
    )
    light = 1 if y > 0.0 else 0
    assert equal[light] > equal[1 - light] + 0.02
    share = 0.5 + abs(y) / 0.21  # of the load, on the other foot
    torques = np.array([(1.0 - share) ** 2, share**2]) / ((1.0 - share) ** 2 + share**2) * 0.04
    np.testing.assert_allclose(
        [by_load[light], by_load[1 - light]], torques / (1.0 - share, share), rtol=0.05
    )
