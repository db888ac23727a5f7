"""Compliance of the ground by loads that go from foot to foot, and the height of a robot that sinks at every step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wbc.core.estimation.sinking import DEEPEST, FIRST, LEAST, SURE, Sinking
from wbc.core.robot import GRAVITY
from wbc.robots import load
from wbc.sim import TrialHook, WalkPlan, WalkSpec, walk

WEIGHT, DT = 400.0, 0.002
"""Weight of the robot, N; time between two measurements, s."""


def shift(
    sinking: Sinking, compliance: float, rng: np.random.Generator, tip: float = 0.0, time: float = 0.12
) -> None:
    """Let the load go from foot to foot in a time, s; that which takes over rises by `tip`, m, whatever it carries."""
    for share in np.linspace(0.05, 0.95, round(time / DT)):
        loads = WEIGHT * share, WEIGHT * (1.0 - share)
        heights = [
            -compliance * load + noise for load, noise in zip(loads, 2e-4 * rng.normal(size=2), strict=True)
        ]
        sinking.update(loads, [heights[0] + tip * share, heights[1]], DT, carry=True)
    sinking.update((WEIGHT, 0.0), (0.0, 0.3), DT, carry=False)


@pytest.mark.parametrize("compliance", [0.0, 8e-6, 4e-5])
def test_the_slope_of_depths_over_loads_is_the_compliance(compliance: float) -> None:
    sinking, rng = Sinking(WEIGHT), np.random.default_rng(2)
    for _ in range(6):
        shift(sinking, compliance, rng)
    assert sinking.compliance == sinking.steady == pytest.approx(compliance, rel=0.05, abs=3e-7)


def test_feet_that_tip_up_and_down_on_stones_tell_no_compliance() -> None:
    sinking, rng = Sinking(WEIGHT), np.random.default_rng(4)
    for tip in (0.004, -0.005, 0.002, -0.003, 0.004, -0.002):
        shift(sinking, 0.0, rng, tip)
    assert sinking.compliance == sinking.steady == 0.0


def test_a_step_off_an_edge_counts_as_no_more_than_the_deepest_floor() -> None:
    sinking, rng = Sinking(WEIGHT), np.random.default_rng(4)
    for _ in range(round(SURE / 0.1)):
        assert sinking.steady == 0.0
        shift(sinking, 0.0, rng, -0.5, time=0.1)
        assert sinking.compliance == pytest.approx(DEEPEST / WEIGHT)
    assert sinking.steady == pytest.approx(DEEPEST / WEIGHT)
    sinking.reset()
    assert sinking.compliance == sinking.steady == 0.0


def test_the_compliance_follows_a_floor_that_changes_within_three_steps() -> None:
    """After three changes of the load seven eighths of the difference are known."""
    sinking, rng = Sinking(WEIGHT), np.random.default_rng(3)
    for _ in range(8):
        shift(sinking, 0.0, rng)
    assert sinking.compliance == 0.0
    for _ in range(3):
        shift(sinking, 4e-5, rng)
    assert sinking.compliance == pytest.approx(0.875 * 4e-5, rel=0.05) and sinking.steady == 0.0
    for _ in range(4):
        shift(sinking, 0.0, rng)
    assert sinking.compliance == 0.0


def test_a_load_that_hardly_changes_tells_nothing() -> None:
    sinking = Sinking(WEIGHT)
    for share in np.linspace(0.45, 0.55, 50):
        sinking.update((WEIGHT * share, WEIGHT * (1.0 - share)), (-0.01 * share, 0.0), DT, carry=True)
    sinking.update((WEIGHT, 0.0), (0.0, 0.0), DT, carry=False)
    assert sinking.compliance == 0.0


def test_a_weight_that_shifts_slowly_tells_the_compliance_before_the_first_step() -> None:
    sinking, rng = Sinking(WEIGHT), np.random.default_rng(2)
    shift(sinking, 4e-5, rng, time=0.8)
    assert sinking.compliance == sinking.steady == pytest.approx(4e-5, rel=0.05)


@pytest.mark.parametrize("compliance", [0.0, 0.7 * LEAST / WEIGHT, 4e-5])
def test_the_first_change_of_the_load_tells_the_compliance_while_it_goes_on(compliance: float) -> None:
    """It is known once it is more than errors of sensors explain, and once the load has changed enough."""
    sinking, rng, found = Sinking(WEIGHT), np.random.default_rng(2), []
    shares = np.linspace(0.5, 0.9, 200)
    for share in shares:
        heights = -compliance * WEIGHT * np.array([share, 1.0 - share]) + 2e-4 * rng.normal(size=2)
        sinking.update((WEIGHT * share, WEIGHT * (1.0 - share)), heights.tolist(), DT, carry=True)
        found.append(sinking.compliance)
    early = 2.0 * (shares - 0.5) < FIRST - 1e-9
    assert not np.any(np.array(found)[early])
    known = compliance if compliance > LEAST / WEIGHT else 0.0
    np.testing.assert_allclose(np.array(found)[~early], known, rtol=0.1)
    assert sinking.steady == 0.0, "while it goes on, nothing is known of a rate"


def test_a_depth_that_errors_of_sensors_explain_is_no_compliance() -> None:
    sinking, rng = Sinking(WEIGHT), np.random.default_rng(2)
    for _ in range(6):
        shift(sinking, 0.7 * LEAST / WEIGHT, rng, time=0.8)
    assert sinking.compliance == 0.0


def test_the_greatest_speed_is_that_of_a_weight_that_is_put_on_a_spring_at_once() -> None:
    compliance, mass, dt = 5e-5, WEIGHT / GRAVITY, 1e-5
    depth = speed = fastest = 0.0
    while speed >= 0.0:
        speed += dt * (GRAVITY - depth / (compliance * mass))
        depth += dt * speed
        fastest = max(fastest, speed)
    sinking = Sinking(WEIGHT)
    sinking.steady = compliance
    assert sinking.speed == pytest.approx(fastest, rel=1e-3)
    assert depth == pytest.approx(2.0 * compliance * WEIGHT, rel=1e-3)


class Height(TrialHook):
    """Errors of the estimated height of the base, m, and steps: when the compliance is first known, and now.

    Also the errors of the vertical velocity of the CoM since then, m/s, and the lowest place of a sole, m.
    """

    known: tuple[float, int] | None = None
    lowest = 0.0

    def __init__(self) -> None:
        self.velocity: list[float] = []

    def tick(self, tick: Any) -> None:
        observer = tick.control.drives.observer
        if self.known is not None:
            self.velocity.append(float(observer.robot.com_velocity[2] - tick.plant.truth().com_velocity[2]))
            self.lowest = min(self.lowest, *(float(tick.plant.sole_pose(side)[0][2]) for side in (0, 1)))
        self.now = float(observer.robot.q[2] - tick.plant.base_pose[2]), tick.control.steps_done
        self.compliance = observer.sinking.compliance
        if self.compliance and self.known is None:
            self.known = self.now


def arrives(robot: str, stiffness: float) -> Height:
    """Walk a metre over a floor of a stiffness, N/m³, which a robot on its own soles completes; return its heights."""
    ground: dict[str, Any] = {"terrain": "flat", "terrain_params": {"floor_stiffness": stiffness}}
    plan, look = WalkPlan(distance=1.0), Height()
    spec = WalkSpec(robot=robot, foot="flat", mode="torque", plan=plan, noise="realistic", seed=9, **ground)
    assert walk(spec, hooks=[look]).outcome == "completed"
    return look


@pytest.mark.slow
def test_a_robot_that_sinks_at_every_step_keeps_its_height() -> None:
    """Once the compliance is known, the estimate rises in a step by less than a half of the depth."""
    look = arrives("g1", 1e7)
    assert look.known is not None
    (error, steps), (first, begun) = look.now, look.known
    depth = look.compliance * load("g1").robot().mass * GRAVITY
    assert 5e-6 < look.compliance < 2e-5 and steps - begun >= 3
    assert abs(error - first) < 0.5 * (steps - begun) * depth


@pytest.mark.slow
def test_a_robot_walks_on_a_floor_in_which_its_feet_sink_faster_than_a_foot_may_move() -> None:
    """Feet that sink at up to 0.5 m/s are references of the velocity, and the robot arrives on its own soles."""
    look = arrives("hrp4_class", 1e6)
    assert look.known is not None and look.known[1] <= 1
    assert look.lowest < -0.03, "m"
    assert float(np.sqrt(np.mean(np.square(look.velocity)))) < 0.05, "m/s"
