"""Contacts of free steps: feet that lose the ground or are kicked away, and where the weight goes."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from pendulum import com_after
from point_mass import SCALE, PointMass, Tick
from properties import by_default

from wbc.core.robot import SIDES
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.planners import walk_distance
from wbc.walking.plans.sources import PlanSource

DT = 0.004


def test_the_pendulum_is_as_planned_and_a_push_moves_it_at_the_next_decision_alone() -> None:
    """c̈ = ω² (c − z) in every phase; on both feet over the soles, in a step about the commanded CoP."""
    body, phases = PointMass(), set()
    body.run(0.6)
    body.speed += (0.05, 0.02)
    still = body.run(0.2)
    feet = 0.5 * (still[-1].frames[0].translation + still[-1].frames[1].translation)
    assert np.linalg.norm(np.array(still[-1].state.com)[:2] - feet[:2]) > 2e-3
    body.gait.steering.command((0.2, 0.05, 0.0))
    body.run(2.5)
    for before, tick in itertools.pairwise(body.ticks):
        now, past, last = tick.reference, tick.reference.pendulum, before.reference
        phases.add(now.progress.phase)
        np.testing.assert_allclose(
            past.com_acceleration[:2], SCALE.omega**2 * (past.com - past.zmp)[:2], atol=1e-9
        )
        if now.progress.phase is GaitPhase.STANDING:
            np.testing.assert_allclose(past.com[:2], feet[:2], atol=1e-9)
        if now.progress.phase is GaitPhase.SINGLE:
            place = tick.frames[now.progress.stance].actInv(np.array(past.zmp))
            carrying = body.gait.constants.area.carrying
            assert tuple(place[:2]) == pytest.approx((carrying + now.cop[0], now.cop[1]), abs=1e-9)
        if now.progress.phase is last.progress.phase and now.progress.stance == last.progress.stance:
            goes_on = last.pendulum.com + DT * last.pendulum.com_velocity
            np.testing.assert_allclose(past.com[:2], goes_on[:2], atol=1e-3)
    assert phases == set(GaitPhase)


@pytest.mark.parametrize(
    "velocity", by_default([(0.5, 0.0, 0.0), (0.0, -0.2, 0.0), (-0.2, 0.0, 0.5)], (-0.2, 0.0, 0.5))
)
def test_com_and_dcm_of_the_reference_go_on_through_landings_and_changes_of_feet(
    velocity: tuple[float, float, float],
) -> None:
    """Each tick continues the fall about the last ZMP, whatever the step does, while nothing pushes."""
    body, walked = PointMass(), set[Event]()
    body.run(0.6)
    body.gait.steering.command(velocity)
    body.run(2.5)
    for before, tick in itertools.pairwise(body.ticks):
        last, now = before.reference, tick.reference
        if not last.progress.phase is now.progress.phase is GaitPhase.SINGLE:
            continue
        walked.update(now.progress.events)
        fall = last.pendulum.com[:2], last.pendulum.com_velocity[:2], last.pendulum.zmp[:2]
        com, speed = com_after(*fall, SCALE.omega, DT)
        np.testing.assert_allclose(now.pendulum.com[:2], com, atol=5e-5)
        dcm = now.pendulum.com + now.pendulum.com_velocity / SCALE.omega
        np.testing.assert_allclose(dcm[:2], com + speed / SCALE.omega, atol=3e-4)
    assert {Event.LIFT_OFF, Event.TOUCH_DOWN} <= walked


def test_a_foot_that_loses_the_ground_while_the_other_one_holds_swings_on() -> None:
    body = PointMass()
    body.run(0.6)
    body.gait.steering.command((0.2, 0.0, 0.0))
    while not waiting(body.run(DT)):
        pass
    tick, gait = body.ticks[-1], body.gait
    s, stance = gait.constants, tick.reference.progress.stance

    def swings(load: float, held: float, seconds: float) -> bool:
        wrenches = [[0.0] * 6, [0.0] * 6]
        wrenches[stance][2], wrenches[1 - stance][2] = held, load
        for _ in range(round(seconds / DT)):
            reference = gait.advance(tick.state._replace(wrenches=wrenches), tick.frames)
        return bool(reference.progress.air == 1 - stance)

    assert not swings(1.1 * s.touch.lost, 2.0 * s.touch.held, s.touch.lost_time + 4 * DT)
    assert swings(0.9 * s.touch.lost, 1.1 * s.touch.held, 2 * DT)


class EdgeFirst(PointMass):
    """Feet that meet the ground with their inner edge, and lie on it 2 ms later."""

    since = 0

    def pressure(self, side: int) -> tuple[float, float]:
        """See `PointMass.pressure`."""
        x, y = super().pressure(side)
        waits = (
            bool(self.ticks) and self.ticks[-1].reference.progress.stance != side and self._load[side] > 0.0
        )
        self.since = self.since + 1 if waits else self.since * (self._load[side] == 1.0)
        inner = SCALE.sole[1] * (-1.0 if side == 0 else 1.0)
        return (x, inner) if waits and self.since <= 1 else (x, y)


def waiting(ticks: list[Tick]) -> int:
    """Return the number of ticks in which a foot in contact waits."""
    return sum(
        tick.reference.progress.phase is GaitPhase.SINGLE and tick.reference.progress.air is None
        for tick in ticks
    )


def test_a_foot_takes_over_by_where_it_will_carry_not_by_the_edge_with_which_it_meets_the_ground() -> None:
    waits = []
    for body in (PointMass(dt=0.002), EdgeFirst(dt=0.002)):
        body.run(0.6)
        body.gait.steering.command((0.2, 0.0, 0.0))
        waits.append(waiting(body.run(3.0)))
    assert waits[1] > 0.2 * waits[0] > 0, "no step waits that begins at the edge"


def test_a_foot_that_has_been_kicked_away_is_not_stepped_onto() -> None:
    for sign, kicked in ((1.0, 0), (-1.0, 1)):
        body = PointMass()
        body.run(0.7)
        tick, gait = body.ticks[-1], body.gait
        wrenches = [[0.0] * 6, [0.0] * 6]
        wrenches[1 - kicked][2] = SCALE.weight
        fast = tick.state._replace(velocity=(0.0, sign * 0.9, 0.0), wrenches=wrenches)
        reference = gait.advance(fast, tick.frames)
        assert Event.LIFT_OFF in reference.progress.events and reference.progress.air == kicked


@pytest.mark.parametrize("shifts", [False, True], ids=["in a stand", "while the weight shifts"])
@pytest.mark.parametrize(
    ("speed", "force", "steps"), [(1.0, 0.0, True), (0.1, 0.0, False), (1.0, 0.3, False)]
)
def test_a_foot_that_is_kicked_away_in_a_stand_swings_at_once(
    shifts: bool, speed: float, force: float, steps: bool
) -> None:
    """It moves and carries nothing while the other one holds; a foot that is unloaded, or slides, does not.

    Its place jumps by 10 mm in one tick in all cases, as noise does it in an estimate that bridges delays.
    """
    for kicked in (0, 1):
        body = PointMass()
        body.run(0.7)
        if shifts:
            body.gait.steering.command((0.2, 0.0, 0.0))
            body.run(0.2)
        tick, gait = body.ticks[-1], body.gait
        assert gait.felt.phase is (GaitPhase.DOUBLE if shifts else GaitPhase.STANDING)
        places, wrenches = list(tick.state.places), [[0.0] * 6, [0.0] * 6]
        x, y, z = places[kicked]
        places[kicked], speeds = (x - 0.01, y, z + 0.01), [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
        speeds[kicked] = (0.0, 0.6 * speed, 0.8 * speed)
        wrenches[kicked][2], wrenches[1 - kicked][2] = force * SCALE.weight, (1.0 - force) * SCALE.weight
        state = tick.state._replace(
            places=(places[0], places[1]), wrenches=wrenches, speeds=(speeds[0], speeds[1])
        )
        reference = gait.advance(state, tick.frames)
        assert (gait.felt.phase is GaitPhase.SINGLE) == steps
        assert not steps or (Event.LIFT_OFF in reference.progress.events and reference.progress.air == kicked)


def in_swing(share: float) -> PointMass:
    """Return a point mass that walks ahead, at a share of a swing that is not the first of the walk."""
    body = PointMass()
    body.run(0.6)
    body.gait.steering.command((0.2, 0.0, 0.0))
    gait = body.gait
    while gait.step.swing is None or gait.felt.elapsed < share * gait.step.duration or gait.step.first:
        body.run(DT)
    return body


@pytest.mark.parametrize(
    ("speed", "height", "meets"),
    [(0.0, 0.01, True), (6.0, 0.01, False), (0.0, 0.4, False)],
    ids=["on the ground", "pushed", "high up"],
)
def test_a_force_on_a_foot_that_is_pushed_or_that_is_high_up_is_no_contact(
    speed: float, height: float, *, meets: bool
) -> None:
    body = in_swing(0.7)
    gait = body.gait
    tick, swing = body.ticks[-1], gait.felt.swing
    wrenches = [[0.0, 0.0, force, 0.0, 0.0, 0.0] for force in (SCALE.weight, SCALE.weight)]
    wrenches[swing][2] = 2.0 * gait.constants.touch.met
    places, (x, y, _) = list(tick.state.places), tick.state.places[swing]
    places[swing] = x, y, height
    speeds = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    speeds[swing] = (0.0, speed, 0.0)
    for k in range(3):
        state = tick.state._replace(
            places=(places[0], places[1]),
            speeds=(speeds[0], speeds[1]),
            wrenches=wrenches if k == 2 else tick.state.wrenches,
        )
        reference = gait.advance(state, tick.frames)
    assert (gait.step.met is not None) == meets
    assert (reference.urgency < 0.0) == (speed > 0.0)


@pytest.mark.parametrize(
    ("moved", "bears", "follows"),
    [(-0.08, 1.0, True), (0.08, 1.0, True), (-0.005, 1.0, False), (0.2, 0.0, False)],
)
def test_the_expected_ground_goes_with_the_foot_that_stands(
    moved: float, bears: float, *, follows: bool
) -> None:
    """After an impact the estimate moves by some centimetres, and the foot does not; a sole that yields moves less.

    A foot that bears nothing was kicked away, and flies over the ground.
    """
    body = PointMass()
    body.run(0.6)
    body.gait.steering.command((0.2, 0.0, 0.0))
    gait = body.gait
    while gait.step.swing is None or gait.felt.elapsed < 0.4 * gait.step.duration:
        body.run(DT)
    tick, (x, y, z) = body.ticks[-1], body.ticks[-1].state.com
    before = gait.step.swing.landing.z
    places = [(p, q, r + moved) for p, q, r in tick.state.places]
    wrenches = [[0.0, 0.0, bears * load[2], *load[3:]] for load in tick.state.wrenches]
    state = tick.state._replace(com=(x, y, z + moved), places=(places[0], places[1]), wrenches=wrenches)
    for _ in range(gait.step._period):
        gait.advance(state, tick.frames)
    assert gait.step.swing.landing.z == pytest.approx(before + (moved if follows else 0.0), abs=1e-12)


def test_the_commanded_centre_of_pressure_is_compared_with_the_measured_one_behind_the_same_low_pass() -> (
    None
):
    """A sole that presses where it is told shows no error, however quickly that moves: it would be taken to last."""
    body, off, moved = PointMass(), [], []
    body.run(0.6)
    body.gait.steering.command((0.2, 0.05, 0.0))

    def compare(tick: Tick) -> None:
        gait = body.gait
        if tick.reference.progress.air is None or tick.reference.progress.elapsed < 0.05:
            return
        told = gait.step.step_state().cop_command
        off.append(math.dist(told[:2], gait.felt.contact[:2]))
        moved.append(math.dist(gait.step.decision.cop, gait.step.decision.lagged))

    body.run(2.5, compare)
    assert max(moved) > 5e-3 and max(off) < 1.5e-3


@pytest.mark.parametrize("first", ["left", "right"])
def test_the_weight_shifts_to_where_the_first_footstep_begins(first: str) -> None:
    """ξ rests at (s + b) / E from the foot that will stand: the first step takes the time of the others."""
    body = PointMass()
    body.run(0.6)
    left, right = (
        Footstep(side, *frame.translation[:2].tolist())
        for side, frame in zip(SIDES, body.ticks[-1].frames, strict=True)
    )
    plan = walk_distance(FootstepPlan(left, right, (), Gait(step_length=0.12)), 0.6, first=first)
    body.gait.take(PlanSource(plan))
    lift = next(tick for tick in body.run(2.0) if Event.LIFT_OFF in tick.reference.progress.events)
    body.run(1.0)
    step = next(
        tick
        for tick in body.ticks
        if tick.time > lift.time and Event.LIFT_OFF in tick.reference.progress.events
    )
    assert step.time - lift.time == pytest.approx(body.gait.steering.step_time, rel=0.06)
