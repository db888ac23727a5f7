"""Catch on one foot: a push over the outer edge throws the free leg out, waits, and lands it wide."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wbc.core.robot import GRAVITY
from wbc.robots import load
from wbc.sim.walks import WalkPlan, WalkPush, WalkSpec, WalkTrial
from wbc.walking import CatchSettings, FootstepPlan, LeanSettings
from wbc.walking.catching import Trunk
from wbc.walking.planning.phases import Phase
from wbc.walking.planning.planners import walk_distance
from wbc.walking.stabilizer.lean import Lean
from wbc.walking.walk import Walk, WalkReference, WalkSettings

ROBOT = load("hrp4_class").robot()
HEIGHT = 0.76
DT = 0.005
WEIGHT = ROBOT.mass * GRAVITY
CATCH = WalkSettings(catch=CatchSettings(enabled=True))
ON_LEFT, ON_RIGHT = (WEIGHT, 0.0), (0.0, WEIGHT)


def in_the_third_step(settings: WalkSettings) -> tuple[Walk, np.ndarray]:
    """Return a walk whose left foot has just left the ground, and the DCM."""
    plan = walk_distance(FootstepPlan.standing(ROBOT), 1.0)
    walk = Walk(ROBOT, plan, HEIGHT, DT, settings)
    walk.start()
    while True:
        swing = walk.phases.swing
        over = walk.phases.elapsed >= walk.phases.duration
        if swing == "left":
            loads = ON_LEFT if over else ON_RIGHT
        elif swing == "right":
            loads = ON_RIGHT if over else ON_LEFT
        else:
            loads = ON_RIGHT if walk.phases.plan.steps[walk.phases.step].side == "left" else ON_LEFT
        reference = walk.update(loads)
        if walk.steps_done >= 2 and reference.phase is Phase.SINGLE:
            if walk.phases.swing == "right":
                continue
            return walk, reference.pendulum.dcm.copy()


def beside(walk: Walk, room: float, along: np.ndarray) -> np.ndarray:
    """Return a DCM with a given room to the outer edge of the right foot, m."""
    stance = walk.phases.plan.stance(walk.phases.step)
    return np.array((along[0], stance.y - 0.038 + room))


def hold(walk: Walk, dcm: np.ndarray, seconds: float, loads: tuple[float, float] = ON_RIGHT) -> WalkReference:
    """Go on with a DCM that stays."""
    for _ in range(round(seconds / DT)):
        reference = walk.update(loads, dcm=dcm)
    return reference


def test_a_pushed_robot_throws_its_leg_out_waits_and_lands_it_wide_when_it_is_caught() -> None:
    walk, dcm = in_the_third_step(CATCH)
    assert walk.catch is not None
    planned = walk.phases.plan.steps[walk.phases.step]
    pushed = beside(walk, 0.005, dcm)
    hold(walk, pushed, 0.4)
    assert walk.catch.active
    landing = walk.phases.plan.steps[walk.phases.step]
    assert landing.y - planned.y == pytest.approx(0.25 * HEIGHT)  # within reach
    out = hold(walk, pushed, 1.0).feet[0].placement
    assert out.translation[1] - planned.y == pytest.approx(0.45 * HEIGHT, abs=1e-3)
    assert out.translation[2] > 0.02  # it waits in the air
    assert out.rotation[2, 1] > 0.3  # rolled with the leg
    assert walk.phases.phase is Phase.SINGLE

    hold(walk, beside(walk, 0.08, dcm), 0.9)
    down = walk.update(ON_RIGHT, dcm=beside(walk, 0.08, dcm)).feet[0].placement.translation
    assert down[1] == pytest.approx(landing.y, abs=1e-3) and down[2] < 0.01
    caught = beside(walk, 0.08, dcm)
    while walk.phases.phase is Phase.SINGLE:
        reference = walk.update((0.5 * WEIGHT, 0.5 * WEIGHT), dcm=caught)
    # As long as the DCM takes to come over, with the ZMP at the outer edge.
    assert walk.phases.duration > 1.5 * walk.phases.plan.gait.double_support
    # The plan goes on from there, but for what its ZMP needs to go to the edge.
    np.testing.assert_allclose(reference.pendulum.dcm[:2], caught, atol=0.02)
    while walk.phases.phase is Phase.DOUBLE:
        reference = walk.update(ON_LEFT, dcm=reference.pendulum.dcm)
    walk.update(ON_LEFT, dcm=reference.pendulum.dcm)
    assert not walk.catch.active


@pytest.mark.parametrize("enabled, room", [(False, 0.005), (True, 0.03)])
def test_without_a_push_over_the_edge_steps_are_adjusted_as_ever(enabled: bool, room: float) -> None:
    walk, dcm = in_the_third_step(WalkSettings(catch=CatchSettings(enabled=enabled)))
    other, _ = in_the_third_step(WalkSettings())
    pushed = beside(walk, room, dcm)
    for _ in range(60):
        mine, reference = walk.update(ON_RIGHT, dcm=pushed), other.update(ON_RIGHT, dcm=pushed)
        np.testing.assert_array_equal(
            mine.feet[0].placement.homogeneous, reference.feet[0].placement.homogeneous
        )
        np.testing.assert_array_equal(mine.pendulum.dcm, reference.pendulum.dcm)
    assert walk.phases.plan == other.phases.plan


def test_a_catch_that_has_begun_is_finished_though_the_robot_is_told_to_walk_quickly() -> None:
    """The foot that waits in the air comes down wide, on level ground."""
    walk, dcm = in_the_third_step(CATCH)
    hold(walk, beside(walk, 0.005, dcm), 0.4)
    landing = walk.phases.plan.steps[walk.phases.step]
    walk.reaction = 1.0
    caught = beside(walk, 0.08, dcm)
    height = 1.0
    while walk.phases.phase is Phase.SINGLE:
        reference = walk.update((0.5 * WEIGHT if height < 0.004 else 0.0, WEIGHT), dcm=caught)
        height = float(reference.feet[0].placement.translation[2])
    assert reference.feet[0].placement.translation[1] == pytest.approx(landing.y, abs=2e-3)
    assert walk.phases.plan.steps[walk.phases.step].z == pytest.approx(0.0, abs=0.01)


def test_a_robot_that_is_steered_comes_over_from_the_foot_that_it_was_caught_on() -> None:
    """Steps that are planned anew on both feet leave the duration of that support as it is."""
    ends = []
    for steered in (False, True):
        walk, dcm = in_the_third_step(CATCH)
        hold(walk, beside(walk, 0.005, dcm), 1.0)
        caught = beside(walk, 0.08, dcm)
        while walk.phases.phase is Phase.SINGLE:
            reference = walk.update((0.5 * WEIGHT, 0.5 * WEIGHT), dcm=caught)
        if steered:
            walk.steer(walk.phases.plan.steps[walk.phases.step :])
        hold(walk, reference.pendulum.dcm[:2] + (0.0, -0.06), DT, ON_LEFT)  # strays: planned anew
        ends.append(walk.phases.duration)
    assert ends[1] == pytest.approx(ends[0], abs=1e-9)


def test_the_spin_of_the_trunk_counts_against_the_room() -> None:
    walk, dcm = in_the_third_step(CATCH)
    hold(walk, beside(walk, 0.005, dcm), 1.0)
    inside = beside(walk, 0.06, dcm)
    spinning = Trunk(0.0, (0.0, -0.03))  # to the right: the DCM comes out again by 30 mm when it stops
    for _ in range(40):
        out = walk.update(ON_RIGHT, dcm=inside, trunk=spinning).feet[0].placement
    assert out.translation[1] > 0.4  # it stays out
    hold(walk, inside, 0.7)
    assert walk.update(ON_RIGHT, dcm=inside).feet[0].placement.translation[1] < 0.35


def test_the_sway_of_a_trunk_is_what_stopping_it_costs() -> None:
    lean = Lean(40.0, 0.8, LeanSettings(inertia=0.06))
    lean.speed = (1.0, 0.5)
    # I φ̇ / (m h ω): a trunk that turns about x moves to the right, one about y forward.
    np.testing.assert_allclose(lean.sway(3.5), (0.06 * 0.8 * 0.5 / 3.5, -0.06 * 0.8 / 3.5))


@pytest.mark.slow
@pytest.mark.parametrize("enabled, outcome", [(False, "fell"), (True, "completed")])
def test_a_push_over_the_edge_is_survived_with_a_catch(enabled: bool, outcome: str) -> None:
    spec = WalkSpec(
        terrain="flat",
        noise="realistic",
        plan=WalkPlan(distance=1.45),
        seed=101,
        pushes=(WalkPush(impulse=0.225, direction=-0.5 * math.pi, step=5, phase=0.25),),
        changes={"walk.catch.enabled": enabled},
    )
    assert WalkTrial(spec).run().outcome == outcome
