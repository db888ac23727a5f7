"""The stepping walk in the plant: it stands, walks where it is steered, and stands; the slow tests walk over stones."""

from __future__ import annotations

import pytest

import wbc
from wbc.core.drive.control import Mode
from wbc.sim import walk
from wbc.sim.trial.falls import TrueFallDetector
from wbc.walking.contact import GaitPhase
from wbc.walking.control import WalkingControl
from wbc.walking.settings import WalkingControlSettings


def standing(
    mode: Mode = "torque", seed: int = 3, robot: str = "g1", period: float = 0.002
) -> tuple[wbc.Plant, WalkingControl]:
    description = wbc.load_robot(robot)
    plant = wbc.Plant(description, noise="realistic", seed=seed, control_period=period, visuals=False)
    settings = WalkingControlSettings(mode=mode)
    return plant, WalkingControl(description.robot(), None, period, settings)


def run(plant: wbc.Plant, walking: WalkingControl, until: float) -> set[GaitPhase]:
    """Go on until a time, or until the robot falls, and return the phases on the way."""
    falls, phases = TrueFallDetector(plant.robot), set()
    while plant.time < until - 1e-9:
        plant.step(walking.command(plant.measure()))
        phases.add(walking.progress.phase)
        assert not falls.fallen(plant.truth().q), f"fallen at {plant.time:.2f} s"
    return phases


def walk_ahead(mode: Mode, robot: str = "g1", end: float = 2.0, period: float = 0.002) -> float:
    """Stand, walk forward at 0.3 m/s, stop; return the distance over that of the steps' velocity."""
    plant, walking = standing(mode, robot=robot, period=period)
    start = plant.truth().com[:2].copy()
    assert run(plant, walking, 0.3) == {GaitPhase.STANDING}
    walking.velocity = (0.3, 0.0, 0.0)
    expected = 0.0
    while plant.time < end - 1e-9:
        plant.step(walking.command(plant.measure()))
        expected += walking.granted_velocity[0] * period
    walking.velocity = None
    stood = 0.0  # s, without a pause
    while stood < 0.2 and plant.time < end + 1.4 - 1e-9:
        plant.step(walking.command(plant.measure()))
        expected += walking.granted_velocity[0] * period
        stood = stood + period if walking.progress.phase is GaitPhase.STANDING else 0.0
    assert walking.fallen is None and walking.drives.failures == 0
    assert walking.progress.phase is GaitPhase.STANDING and walking.steps_done >= 3
    travelled = plant.truth().com[:2] - start
    assert abs(travelled[1]) < 0.1
    assert not TrueFallDetector(plant.robot).fallen(plant.truth().q)
    return float(travelled[0]) / expected


@pytest.mark.slow
def test_a_robot_stands_steps_forward_and_stops() -> None:
    assert 0.6 < walk_ahead("torque", period=0.004) < 1.5


@pytest.mark.slow
def test_a_robot_on_soft_servos_walks_on_the_flat() -> None:
    """Servos are inertia between two ticks: the first steps on them are shorter."""
    assert 0.5 < walk_ahead("hybrid") < 1.6


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["hrp4_class", "talos"])
def test_other_robots_walk_by_the_same_numbers(robot: str) -> None:
    assert 0.4 < walk_ahead("torque", robot=robot, end=3.2) < 1.6  # their steps take up to 0.84 s


@pytest.mark.long
@pytest.mark.slow
def test_small_flat_feet_walk_over_stones_of_40_mm() -> None:
    """At least 5 of 6 grounds, blind, with noise: without the swap that waits, or at fixed times, most walks fall."""
    outcomes = [
        walk(
            mode="torque", robot="g1", foot="flat", terrain="stones", amplitude=0.04, seed=seed, distance=3.0
        ).outcome
        for seed in range(40, 46)
    ]
    assert outcomes.count("completed") >= 5, outcomes
