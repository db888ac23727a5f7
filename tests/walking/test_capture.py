"""Steps out of a push: which foot, where and how many; and none where the feet in place are enough."""

from __future__ import annotations

import math

import numpy as np
import pytest

import wbc
from wbc.robots import load
from wbc.sim.balance import StandPushSpec, StandSpec, push_standing, stand
from wbc.walking import FootstepPlan, Reach, WalkingControl, natural_frequency
from wbc.walking.planning.capture import CaptureSteps
from wbc.walking.planning.footsteps import Footstep, other

ROBOT = load("hrp4_class").robot()
REACH = Reach.of(ROBOT)
SIZES = tuple((sole.length, sole.width) for sole in ROBOT.soles[:2])
START = FootstepPlan.standing(ROBOT)
OMEGA = natural_frequency(float(ROBOT.com[2]))
MIDDLE = 0.5 * (START.left.position + START.right.position)[:2]


def capture() -> CaptureSteps:
    return CaptureSteps(OMEGA, REACH, SIZES, START.spacing)


def test_a_dcm_within_the_soles_is_inside() -> None:
    steps = capture()
    assert steps.outside(MIDDLE, START) < 0.0
    edge = START.left.x + 0.5 * SIZES[0][0]
    assert steps.outside(np.array([edge + 0.03, MIDDLE[1]]), START) == pytest.approx(0.03)


@pytest.mark.parametrize("angle", np.arange(0.0, 2.0 * math.pi, math.pi / 4.0))
@pytest.mark.parametrize("distance", [0.1, 0.15, 0.25])
def test_landings_are_within_reach_and_sides_alternate(angle: float, distance: float) -> None:
    dcm = MIDDLE + distance * np.array([math.cos(angle), math.sin(angle)])
    plan = capture().footsteps(dcm, START, None, 0.02)
    stance = START.right if plan.steps[0].side == "left" else START.left
    for step in plan.steps[:-1]:
        forward, left, _, turn = step.seen_from(stance)
        assert abs(forward) <= REACH.max_length + 1e-9 and turn == 0.0
        assert REACH.min_spacing - 1e-9 <= abs(left) <= REACH.max_spacing + 1e-9
        assert step.side == other(stance.side)
        stance = step
    forward, left, _, _ = plan.steps[-1].seen_from(stance)
    assert forward == pytest.approx(0.0, abs=1e-9) and abs(left) == pytest.approx(START.spacing), (
        "feet together"
    )


def test_stronger_pushes_never_need_fewer_steps() -> None:
    counts = [
        len(capture().footsteps(MIDDLE + (x, 0.0), START, None, 0.02)) for x in np.linspace(0.08, 0.5, 15)
    ]
    assert counts == sorted(counts) and counts[0] == 2 and counts[-1] > 2


def test_mirrored_pushes_give_mirrored_feet() -> None:
    one = capture().footsteps(MIDDLE + (0.12, 0.05), START, None, 0.02).steps
    two = capture().footsteps(MIDDLE + (0.12, -0.05), START, None, 0.02).steps
    assert len(one) == len(two)
    for a, b in zip(one, two, strict=True):
        assert a.side == other(b.side) and a.x == pytest.approx(b.x)
        assert a.y - MIDDLE[1] == pytest.approx(MIDDLE[1] - b.y)


def test_a_foot_in_the_air_lands_as_planned_unless_the_dcm_leaves_the_feet() -> None:
    steps, stance = capture(), START.right
    planned = Footstep("left", 0.1, START.left.y, 0.01)
    assert steps.landing(MIDDLE + (0.05, 0.0), stance, planned, 0.2) is planned
    ahead = [steps.landing(MIDDLE + (x, 0.0), stance, planned, 0.2) for x in (0.12, 0.15, 0.18, 0.4)]
    places = [landing.x for landing in ahead]
    assert places == sorted(places) and planned.x < places[0] < places[1]
    assert places[-1] == pytest.approx(stance.x + REACH.max_length) and ahead[0].z == planned.z
    sooner = steps.landing(MIDDLE + (0.15, 0.0), stance, planned, 0.1)
    assert sooner.x < places[1], "less time in which the DCM runs away"


def test_feet_stay_apart_unless_the_dcm_runs_away_over_the_stance_foot() -> None:
    planned = Footstep("right", 0.0, START.right.y, 0.0)
    out, ahead = (
        capture().landing(MIDDLE + push, START.left, planned, 0.2) for push in ((0.0, 0.16), (0.15, 0.0))
    )
    assert START.left.y - out.y == pytest.approx(REACH.min_spacing)
    assert START.left.y - ahead.y >= START.spacing - 1e-9


def test_soles_of_a_commanded_robot_do_not_bind_while_it_steps_out_of_a_push() -> None:
    """Its QP then finds wrenches beyond the soles; on them again it has those of before."""
    robot = load("hrp4_class").robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), 0.005)
    sole, beyond = robot.soles[0], np.array([0.0, 0.0, 100.0, 0.0, -100.0 * 0.3, 0.0])
    cone = walking.tasks.contacts[0].cone.copy()
    assert (cone @ beyond).max() > 0.0 and sole.length < 0.6
    walking.tasks.free(True)
    assert (walking.tasks.contacts[0].cone @ beyond).max() <= 0.0
    walking.tasks.free(False)
    np.testing.assert_array_equal(walking.tasks.contacts[0].cone, cone)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "impulse", "degrees"),
    [
        ("hrp4_class", 0.48, 0.0),
        ("hrp4_class", 0.52, 135.0),
        ("hrp4_class", 0.48, 180.0),
        ("talos", 0.52, 0.0),
        ("talos", 0.6, 45.0),
        ("talos", 0.56, 180.0),
    ],
)
def test_a_robot_steps_out_of_a_push_that_its_feet_in_place_do_not_take(
    robot: str, impulse: float, degrees: float
) -> None:
    spec = StandPushSpec(robot=robot, mode="position", impulse=impulse, direction=math.radians(degrees))
    assert not push_standing(spec).recovered
    assert push_standing(StandPushSpec(**(vars(spec) | {"steps": "allowed"}))).recovered


@pytest.mark.slow
def test_no_step_without_a_push() -> None:
    """Noisy sensors and a small push move no foot."""
    plant = wbc.Plant(load("hrp4_class"), noise="realistic", seed=1)
    robot = load("hrp4_class").robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period)
    while plant.time < 30.0:
        if abs(plant.time - 10.0) < 1e-6:
            plant.push("torso", [0.1 * robot.mass / 0.1, 0.0, 0.0], 0.1)
        plant.step(walking.command(plant.measure()))
    assert walking.steps_done == 0 and walking.finished and walking.fallen is None
    result = stand(StandSpec(steps="allowed", seconds=3.0, noise="realistic"))
    assert result.upright and result.com_error_mm < 10.0
