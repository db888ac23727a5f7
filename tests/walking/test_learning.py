"""What is learnt on the way: the carrying part of a sole, and the bandwidth of the CoP."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.core.errors import InputError
from wbc.walking.stabilizer.bandwidth import CopBandwidth, cop_bandwidth
from wbc.walking.stabilizer.carrying import CarryingArea, CarryingSettings

DT = 0.005
SIZE = (0.16, 0.076)


def press(x: float, y: float, force: float = 300.0) -> np.ndarray:
    return np.array([0.0, 0.0, force, y * force, -x * force, 0.0])


def hold(
    area: CarryingArea, wrench: np.ndarray, spin: tuple[float, float, float], seconds: float, dt: float = DT
):
    for _ in range(round(seconds / dt)):
        rectangle = area.update(wrench, np.array(spin), dt)
    return rectangle


def test_a_foot_that_rests_carries_everywhere() -> None:
    area = CarryingArea(SIZE)
    assert hold(area, press(0.05, 0.02), (0.05, -0.05, 1.0), 1.0) == (-0.08, 0.08, -0.038, 0.038)


@pytest.mark.parametrize(
    ("spin", "side"),
    [((0.0, 0.5, 0.0), 1), ((0.0, -0.5, 0.0), 0), ((-0.5, 0.0, 0.0), 3), ((0.5, 0.0, 0.0), 2)],
    ids=["toe", "heel", "left edge", "right edge"],
)
def test_tipping_over_an_edge_draws_it_in_to_the_cop(spin: tuple[float, float, float], side: int) -> None:
    area = CarryingArea(SIZE)
    full = area.rectangle
    point = (0.03, 0.01)
    rectangle = hold(area, press(*point), spin, 0.2 + area.settings.settling)
    expected = point[side // 2] + (0.005 if side % 2 else -0.005)
    assert rectangle[side] == pytest.approx(expected, abs=1e-6)
    assert [r for i, r in enumerate(rectangle) if i != side] == [r for i, r in enumerate(full) if i != side]


def test_a_foot_that_has_just_landed_turns_without_losing_its_area() -> None:
    area = CarryingArea(SIZE)
    full = area.rectangle
    assert hold(area, press(0.07, 0.0), (0.0, -0.8, 0.0), area.settings.settling - DT) == full
    assert hold(area, press(0.07, 0.0), (0.0, -0.8, 0.0), 0.1)[0] > 0.0  # later it tips
    area.reset()
    assert hold(area, press(0.07, 0.0), (0.0, -0.8, 0.0), area.settings.settling - DT) == full


def test_the_direction_is_that_of_a_real_rotation() -> None:
    """Turned about +y the toe goes down; turned about −x the left edge (+y) goes down."""
    import pinocchio as pin  # noqa: PLC0415

    assert (pin.exp3(np.array([0.0, 0.1, 0.0])) @ [0.08, 0.0, 0.0])[2] < 0.0
    assert (pin.exp3(np.array([-0.1, 0.0, 0.0])) @ [0.0, 0.038, 0.0])[2] < 0.0


def test_lost_ground_comes_back_slowly_and_at_any_period() -> None:
    ends = []
    for dt in (0.005, 0.0025):
        area = CarryingArea(SIZE)
        hold(area, press(0.0, 0.0), (0.0, 0.5, 0.0), 0.4, dt)
        ends.append(hold(area, press(0.0, 0.0), (0.0, 0.0, 0.0), 0.5, dt)[1])
    assert ends[0] == pytest.approx(ends[1], abs=2e-3)
    assert 0.02 < ends[0] < 0.035  # 50 mm/s for the time it rests, less the filter's
    area.reset()
    assert area.rectangle == (-0.08, 0.08, -0.038, 0.038)


def test_it_never_vanishes_nor_leaves_the_sole() -> None:
    rng = np.random.default_rng(0)
    area = CarryingArea(SIZE)
    for _ in range(2000):
        x0, x1, y0, y1 = area.update(
            press(rng.uniform(-0.2, 0.2), rng.uniform(-0.1, 0.1), rng.uniform(0, 600)),
            rng.uniform(-3, 3, 3),
            DT,
        )
        assert x1 - x0 >= 0.02 - 1e-9 and y1 - y0 >= 0.02 - 1e-9
        assert max(-x0, x1) <= 0.08 + 1e-9 and max(-y0, y1) <= 0.038 + 1e-9


def test_a_foot_without_load_learns_nothing() -> None:
    area = CarryingArea(SIZE)
    assert hold(area, press(0.0, 0.0, 20.0), (2.0, 2.0, 0.0), 0.5) == (-0.08, 0.08, -0.038, 0.038)
    with pytest.raises(InputError, match="smaller"):
        CarryingArea((0.01, 0.1))
    with pytest.raises(InputError, match="tip_rate"):
        CarryingSettings(tip_rate=0.0)


def record(
    bandwidth: float, dt: float, noise: float, offset: float, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """A walk-like desired ZMP (0.45 Hz with harmonics) and what a lag makes of it."""
    rng = np.random.default_rng(seed)
    t = dt * np.arange(round(20.0 / dt))
    desired = np.column_stack(
        [0.03 * np.sin(5.7 * t) + 0.01 * np.sin(13 * t), 0.09 * np.tanh(4 * np.sin(2.85 * t))]
    )
    measured, z = np.zeros_like(desired), desired[0].copy()
    for k, wanted in enumerate(desired):
        z = z + (1 - np.exp(-bandwidth * dt)) * (wanted - z)
        measured[k] = z
    return desired, measured + offset + noise * rng.standard_normal(measured.shape)


@pytest.mark.parametrize("bandwidth", [6.0, 15.0, 30.0])
@pytest.mark.parametrize("dt", [0.005, 0.002])
def test_the_bandwidth_is_found_in_noise_and_with_an_offset(bandwidth: float, dt: float) -> None:
    desired, measured = record(bandwidth, dt, noise=0.003, offset=0.01)
    assert cop_bandwidth(desired, measured, dt) == pytest.approx(bandwidth, rel=0.15)


def test_it_follows_a_change_and_waits_for_motion() -> None:
    estimate = CopBandwidth(memory=3.0)
    assert estimate.update(np.zeros(2), np.zeros(2), DT) is None
    for _ in range(200):
        assert estimate.update(np.zeros(2), np.zeros(2), DT) is None
    for bandwidth in (20.0, 8.0):
        for a, b in zip(*record(bandwidth, DT, 0.001, 0.0), strict=True):
            value = estimate.update(a, b, DT)
        assert value == pytest.approx(bandwidth, rel=0.15)
    assert estimate.update(np.full(2, np.nan), np.zeros(2), DT) == value
    with pytest.raises(InputError, match="never moves"):
        cop_bandwidth(np.zeros((10, 2)), np.zeros((10, 2)), DT)
    with pytest.raises(InputError, match="one shape"):
        cop_bandwidth(np.zeros((10, 2)), np.zeros((9, 2)), DT)
