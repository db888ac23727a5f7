"""A walk is completed by a robot that stands where it was sent; one that does its steps elsewhere has strayed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wbc.sim import WalkPlan, WalkSpec, WalkTrial
from wbc.sim.trial.trial import TrialHook, TrialTick
from wbc.sim.walks.arrival import GOAL_DISTANCE, GOAL_TURN, Arrival
from wbc.walking.plans.footsteps import mean_heading
from wbc.walking.plans.gait import Gait

JUST, BEYOND = 0.99, 1.01


def straight() -> Arrival:
    """Return the arrival of a walk of 3 m along x, the heading of whose goal is near half a turn."""
    return Arrival((3.0, 0.0, 3.1), [(0.15 * i, 0.0) for i in range(21)])


@pytest.mark.parametrize("direction", [0.0, 0.5 * math.pi, math.pi, 4.0])
def test_the_goal_is_a_circle_and_a_cone(direction: float) -> None:
    aside = np.array([math.cos(direction), math.sin(direction)])
    for share, arrived in ((0.0, True), (JUST, True), (BEYOND, False)):
        place = np.array([3.0, 0.0]) + share * GOAL_DISTANCE * aside
        assert straight().arrived(place, 3.1) is arrived
        assert straight().error(place) == pytest.approx(share * GOAL_DISTANCE)
        for side in (-1.0, 1.0):
            heading = math.remainder(3.1 + side * share * GOAL_TURN, 2.0 * math.pi)
            assert straight().arrived(np.array([3.0, 0.0]), heading) is arrived


def test_who_has_left_the_track_on_the_way_has_not_kept_to_it() -> None:
    for share, arrived in ((JUST, True), (BEYOND, False)):
        arrival = straight()
        for y in (0.0, share * GOAL_DISTANCE, 0.0):
            arrival.middles.append(np.array([1.234, y]))  # between two stands
        assert arrival.track_error == pytest.approx(share * GOAL_DISTANCE)
        assert arrival.arrived(np.array([3.0, 0.0]), 3.1) is arrived


def test_a_track_may_turn_and_may_be_a_place() -> None:
    for x, y, away in ((0.5, 0.0, 0.0), (1.0, 0.7, 0.0), (0.5, 0.2, 0.2), (0.7, 0.6, 0.3), (1.3, 1.4, 0.5)):
        corner = Arrival((1.0, 1.0, 0.5 * math.pi), [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)])
        corner.middles.append(np.array([x, y]))
        assert corner.track_error == pytest.approx(away, abs=1e-12)
    for track in ([(1.0, 2.0)], [(1.0, 2.0)] * 3):  # a turn on the spot
        spot = Arrival((1.0, 2.0, 0.0), track)
        spot.middles.append(np.array([1.3, 2.4]))
        assert spot.track_error == pytest.approx(0.5)


@pytest.mark.parametrize(
    "plan",
    [
        WalkPlan(distance=0.5),
        WalkPlan(distance=-0.3),
        WalkPlan(turn=1.0),
        WalkPlan(velocity=(0.1, 0.05, 0.2), steps=6),
    ],
)
def test_goal_and_track_are_those_of_the_plan_from_where_it_begins(plan: WalkPlan) -> None:
    prepared = WalkSpec(plan=plan, start=(1.0, -2.0, 0.5)).prepare()
    arrival, (left, right) = prepared.arrival(), prepared.plan.final
    assert arrival is not None and len(arrival.track) == len(prepared.plan) + 1
    assert arrival.goal == pytest.approx(
        (0.5 * (left.x + right.x), 0.5 * (left.y + right.y), mean_heading(left.yaw, right.yaw))
    )
    assert arrival.track[0] == pytest.approx([1.0, -2.0], abs=0.05)
    assert arrival.track[-1] == pytest.approx(arrival.goal[:2])
    if plan.distance is not None:
        assert arrival.goal[:2] == pytest.approx(
            arrival.track[0] + plan.distance * np.array([math.cos(0.5), math.sin(0.5)])
        )


class Carry(TrialHook):
    """Carries the robot to the side at a time, and back at another: its sensors do not notice."""

    def __init__(self, aside: float, at: float, back: float = math.inf) -> None:
        self._moves = [(at, aside), (back, -aside)]

    def tick(self, tick: TrialTick) -> None:
        while self._moves and tick.plant.time >= self._moves[0][0]:
            tick.plant.data.qpos[1] += self._moves.pop(0)[1]


@pytest.mark.slow
def test_a_robot_that_does_its_steps_elsewhere_has_strayed() -> None:
    quick = Gait(single_support=0.5, double_support=0.2, initial_double_support=0.5, final_double_support=0.5)
    spec = WalkSpec(plan=WalkPlan(distance=0.1), noise="none", gait=quick)
    result = WalkTrial(spec, visuals=False).run([Carry(0.6, 0.7, back=1.4)])
    assert result.outcome == "strayed" and not result.fell and result.steps_done == result.steps_planned
    assert (result.goal_error, result.track_error) == pytest.approx((0.0, 0.6), abs=0.03)
