"""Figures of free steps in closed form: times, widths and forces, the shift of the weight, landings and stairs."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from pendulum import com_after
from placed_gait import CONSTANTS, DT, LEVEL, OMEGA, POINT, SETTINGS, frame_of, gait_on, step_on
from point_mass import SCALE, PointMass

from wbc.core.robot import SIDES
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.sources import PlanSource
from wbc.walking.plans.swing import SwingFoot
from wbc.walking.stepping.course import FallCourse
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.law import Divergent
from wbc.walking.stepping.path import StepVelocity
from wbc.walking.stepping.settings import SteppingSettings
from wbc.walking.stepping.single_support import SetOff

STILL = StepVelocity((0.0, 0.0), True)


@pytest.mark.parametrize("speed", [0.0, 0.5, 1.0, 1.4, 2.0, -2.0])
def test_a_step_has_the_times_that_the_share_of_a_fast_walk_gives_it(speed: float) -> None:
    """It touches down at 0.88 of its time, of a walk of twice the speed at which hips decide at 0.95."""
    gait = gait_on(LEVEL)
    gait.steering.velocity = speed * CONSTANTS.time.quick, 0.0
    step, fast_share = gait.step, min(max(abs(speed) - 1.0, 0.0), 1.0)
    step_on(gait, 1)
    step.asked = gait._asked(STILL)
    share = (1.0 - fast_share) * CONSTANTS.swing.touch + fast_share * CONSTANTS.swing.late_touch
    assert (gait.fast_share, step._touch_time()) == pytest.approx((fast_share, 0.4 * share))
    longest = SETTINGS.longest * gait.steering.step_time
    assert step._longest == pytest.approx(longest)
    step.met, waits = 0.3, max(longest, 0.3 + longest - share * gait.steering.step_time)
    step.touch.is_to_carry = lambda *_, late: late  # type: ignore[method-assign]
    for off in (-1e-6, 1e-6):
        gait.felt.elapsed = waits + off
        assert step.is_over() == (off > 0.0)


@pytest.mark.parametrize("speed", [0.0, 0.2, -0.6, 1.2])
def test_feet_of_a_walk_to_the_side_come_together_by_no_more_than_they_may(speed: float) -> None:
    """Of a distance w they lose v T in one of two steps, at most 0.8 of what is over the gap."""
    gait = gait_on(LEVEL)
    asked = gait._asked(StepVelocity((0.0, speed), True))
    width, lost = asked.width(SETTINGS), abs(speed) * gait.steering.step_time
    assert width >= SETTINGS.width and 0.8 * (width - SETTINGS.gap) >= lost - 1e-12
    assert width == SETTINGS.width or 0.8 * (width - SETTINGS.gap) == pytest.approx(lost)


def test_a_foot_gives_up_its_load_in_a_straight_line_and_one_that_waits_bears_its_share() -> None:
    gait = gait_on(LEVEL)
    for stands, swings in ((0, 1), (1, 0)):
        gait.felt._begin(GaitPhase.SINGLE, stands)
        for elapsed, share in (
            (0.0, 2.0),
            (0.25 * CONSTANTS.touch.unload, 1.5),
            (1.1 * CONSTANTS.touch.unload, 0.0),
        ):
            gait.felt.elapsed = elapsed
            most = gait.step.touch.most_forces(met=False, stepped=True)
            assert most[stands] == CONSTANTS.touch.most_force
            assert most[swings] == pytest.approx(share * CONSTANTS.touch.share)
        gait.felt.elapsed = 0.0
        first = gait.step.touch.most_forces(met=False, stepped=False)
        assert first[swings] == 0.0, "the first step begins without a load"
        waits = gait.step.touch.most_forces(met=True, stepped=False)
        assert waits[swings] == CONSTANTS.touch.share


def test_a_foot_comes_straight_down_as_quickly_as_a_quintic_of_its_greatest_acceleration() -> None:
    gait = gait_on((frame_of((0.0, 0.11, 0.13, 0.0, 0.0, 0.0)), LEVEL[1]))
    gait.ground.height = 0.03
    times = np.linspace(0.0, gait.step._time_down() - CONSTANTS.swing.piece, 20001)
    s = times / times[-1]
    heights = 0.1 * (1.0 - s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
    pushes = np.gradient(np.gradient(heights, times), times)
    assert np.abs(pushes[5:-5]).max() == pytest.approx(CONSTANTS.swing.lift, rel=1e-3)


@pytest.mark.parametrize("stance", [0, 1])
def test_a_swing_foot_is_thrown_off_where_its_feedback_asks_for_more_than_legs_have(stance: int) -> None:
    """Stiffness times its distance plus damping times its speed, over the greatest acceleration of a swing."""
    swing_side = 1 - stance
    stiffness, damping = CONSTANTS.swing.swing_gains
    for share in (0.98, 1.02):
        for part in (0.0, 1.0):
            gait = gait_on(LEVEL)
            gait.felt._begin(GaitPhase.SINGLE, stance)
            landing = Footstep(SIDES[swing_side], 0.2, LEVEL[swing_side].translation[1])
            swing = SwingFoot(LEVEL[swing_side], landing, 0.4, gait.step._shape)
            place, speed = (np.array(each) for each in swing.motion(0.2))
            way = np.array([0.48, -0.6, 0.64]) * share * CONSTANTS.swing.swing_push
            here = place - (1.0 - part) / stiffness * way
            moved = speed - part / damping * way
            spots, speeds = [list(f.translation) for f in LEVEL], [POINT, POINT]
            spots[swing_side], speeds[swing_side] = here.tolist(), tuple(moved.tolist())
            gait.felt.state = gait.felt.state._replace(
                places=(spots[0], spots[1]), speeds=(speeds[0], speeds[1])
            )
            gait.felt.elapsed = 0.2 + DT
            thrown = gait.step.touch.thrown(swing)
            assert (thrown is not None) == (share > 1.0)
            if thrown is not None:
                np.testing.assert_allclose(thrown, moved, atol=1e-9)


def test_the_weight_comes_over_on_a_smooth_way_to_beside_the_foot_that_will_stand() -> None:
    """A cubic from rest to rest; it ends where ξ is 1.3 times the offset of a step in place from that foot."""
    for stance, heading in ((1, 0.0), (0, 0.7)):
        turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, heading), np.array([0.3, -0.1, 0.0]))
        frames = turn * LEVEL[0], turn * LEVEL[1]
        gait = gait_on(frames, tuple(turn.act(np.array([0.01, 0.0, 0.6])).tolist()), heading=heading)
        gait.felt._begin(GaitPhase.DOUBLE, stance)
        gait.felt._contact = POINT
        gait.felt.follow()
        gait.stand.shift(())
        ways, direction = [], gait.steering.direction
        for elapsed in np.linspace(0.0, CONSTANTS.stand.shift_time, 201).tolist():
            gait.felt.elapsed = elapsed
            x, y, u, v, _, _ = gait.stand.shifting(direction, SETTINGS.step_time).motion
            ways.append((turn.actInv(np.array((x, y, 0.0)))[:2], (turn.rotation.T @ (u, v, 0.0))[:2]))
        places, speeds = np.array(ways).transpose(1, 0, 2)
        side = 1.0 if stance == 1 else -1.0
        goal = (
            CONSTANTS.area.carrying,
            side
            * (
                CONSTANTS.stand.shift
                * SETTINGS.width
                / (1.0 + math.exp(gait.felt.dcm.omega * SETTINGS.step_time))
                - 0.11
            ),
        )
        np.testing.assert_allclose(
            places[[0, 100, 200]], [(0.01, 0.0), 0.5 * np.add((0.01, 0.0), goal), goal], atol=1e-9
        )
        step = CONSTANTS.stand.shift_time / 200
        np.testing.assert_allclose(np.gradient(places, step, axis=0)[1:-1], speeds[1:-1], atol=1e-4)
        np.testing.assert_allclose(speeds[[0, 200]], 0.0, atol=1e-12)


@pytest.mark.parametrize("depth", [0.0, 0.01, 0.03])
def test_the_weight_shifts_more_slowly_once_feet_are_felt_to_sink(depth: float) -> None:
    """From then on the rest of the shift takes 1 + 2 d / w as long, and ends where it does on rigid ground."""
    gait, felt_at, direction = gait_on(LEVEL, (0.01, 0.0, 0.6)), 0.1, (1.0, 0.0)
    gait.felt._begin(GaitPhase.DOUBLE, 1)
    gait.felt._contact = POINT
    gait.felt.follow()
    stand, felt, ways = gait.stand, gait.felt, []
    stand.shift(())
    felt.elapsed = CONSTANTS.stand.shift_time
    goal, felt.elapsed = stand.shifting(direction, SETTINGS.step_time).motion[:2], 0.0
    while felt.elapsed < stand.duration - CONSTANTS.stand.rest:
        felt.elapsed += DT
        if felt.elapsed > felt_at:
            felt.state = felt.state._replace(compliance=depth / SCALE.weight)
        stand.delay()
        ways.append(stand.shifting(direction, SETTINGS.step_time).motion[:4])
    duration = stand.duration - CONSTANTS.stand.rest
    slower = 1.0 + 2.0 * depth / (2.0 * SCALE.sole[1])
    assert duration == pytest.approx(felt_at + slower * (CONSTANTS.stand.shift_time - felt_at), abs=2.0 * DT)
    places, speeds = np.hsplit(np.array(ways), 2)
    np.testing.assert_allclose(places[-1], goal, atol=1e-4)
    later = round(felt_at / DT) + 2
    np.testing.assert_allclose(np.gradient(places, DT, axis=0)[later:-1], speeds[later:-1], atol=1e-3)


def test_the_edge_of_a_sole_on_springs_comes_free_where_it_carries_at_a_sixth_of_its_width() -> None:
    """Strips of a sole that is tilted by 2 d / w: the last one is free, and the pressure is centred at w / 6."""
    depth, width = 0.02, 2.0 * SCALE.sole[1]
    gait = gait_on(LEVEL)
    gait.felt.state = gait.felt.state._replace(compliance=depth / SCALE.weight)
    places = (np.arange(2000) + 0.5) / 2000 * width - 0.5 * width
    pressures = depth + (gait.stand._slower - 1.0) * places
    assert pressures.min() == pytest.approx(0.0, abs=1e-3 * depth)
    assert np.average(places, weights=pressures) == pytest.approx(width / 6.0, rel=1e-3)
    assert pressures.mean() == pytest.approx(depth)


def test_the_height_of_the_com_comes_to_that_of_the_steps_as_a_critically_damped_mass() -> None:
    """Less h − h₀ by (1 + ωt) e^{−ωt}."""
    gait, low = SteppingWalk(SteppingSettings(), SCALE, 0.0, 1e-4), SCALE.height - 0.05
    times = np.arange(1, 5001) * 1e-4
    found = np.array([gait.height.rise(low) for _ in times])
    falls = OMEGA * times
    np.testing.assert_allclose(SCALE.height - found[:, 0], 0.05 * (1.0 + falls) * np.exp(-falls), atol=1e-4)
    np.testing.assert_allclose(found[:, 1], 0.05 * OMEGA * falls * np.exp(-falls), atol=1e-3)


def test_the_com_is_planned_as_the_pendulum_about_the_commanded_centre_of_pressure() -> None:
    gait = gait_on(LEVEL, (0.02, -0.03, SCALE.height), (0.3, 0.1, 0.0))
    course = FallCourse(SCALE, 1e-4)
    for stance in (0, 1):
        course.restart()
        for _ in range(2001):
            zmp = gait.felt.state.on_sole(stance, CONSTANTS.area.carrying + 0.01, -0.005)
            x, y, u, v, a, b = course.fall(gait.felt.state, zmp)
        zmp = LEVEL[stance].translation[:2] + (CONSTANTS.area.carrying + 0.01, -0.005)
        com, speed = com_after(np.array([0.02, -0.03]), np.array([0.3, 0.1]), zmp, OMEGA, 0.2)
        np.testing.assert_allclose((x, y), com, atol=1e-4)
        np.testing.assert_allclose((u, v), speed, atol=1e-3)
        np.testing.assert_allclose((a, b), OMEGA**2 * (np.array((x, y)) - zmp), atol=1e-9)


def test_steps_of_equal_times_and_widths_are_what_a_walk_remembers() -> None:
    """The mean time of steps, and the share of the sole that has held, come to those of the last steps."""
    gait = gait_on(LEVEL)
    step, area = gait.step, gait.step.decision.area
    step._pace, gait.steering.supported = 0.9, 0.0
    share = min(0.5 * area.widest / CONSTANTS.area.slow_width, 1.0)
    off = [1.0, 1.0]
    for _ in range(3):
        step_on(gait, gait.felt.stance)
        area.aside = [-0.5 * area.widest, 0.5 * area.widest]
        swing = gait.felt.swing
        step.swing = SwingFoot(
            LEVEL[swing], Footstep(SIDES[swing], *LEVEL[swing].translation[:2]), 0.4, gait.step._shape
        )
        gait.felt.elapsed, before, done = 0.36, gait.felt.stance, gait.steps_done
        gait.step.asked = gait._asked(STILL)
        assert gait._change_feet() == (Event.LIFT_OFF,)
        assert (gait.felt.stance, gait.steps_done) == (1 - before, done + 1)
        off = [off[0] * (1.0 - CONSTANTS.time.pace_gain), off[1] * (1.0 - CONSTANTS.area.held_gain[1])]
        assert step._pace == pytest.approx(0.36 + off[0] * (0.9 - 0.36))
        assert gait.steering.supported == pytest.approx(share * (1.0 - off[1]))


@pytest.mark.parametrize("speed", [0.2, 1.5])
def test_a_fast_walk_asks_for_steps_of_the_time_that_its_last_steps_have_taken(speed: float) -> None:
    """Forward v T, of a fast walk v T̄ with their mean time; what offsets of ξ make up is asked of no step."""
    gait, asked = gait_on(LEVEL), []
    step_on(gait, 1)
    gait.steering.velocity, gait.step._pace = (speed * CONSTANTS.time.quick, 0.0), 0.5
    gait.step.decision.decide = lambda _, wish, __: asked.append(wish)  # type: ignore[method-assign, assignment]
    gait.step.asked = gait._asked(StepVelocity((0.25, 0.05), True, 0.05))
    gait.step._solve()
    time, share = gait.steering.step_time, max(speed - 1.0, 0.0)
    assert asked[0].places[0] == pytest.approx(0.2 * (time + share * (0.5 - time)))
    width, drift = gait.step.asked.width(SETTINGS), 0.05 * time
    assert asked[0].places[1::2] == pytest.approx((width + drift, width - drift, width + drift))


def test_a_landing_is_looked_at_for_the_time_that_is_left_of_the_swing() -> None:
    """On seen ground, from the second step on; three footsteps and more lie ahead, and the next is not fixed."""
    gait, asked = gait_on(LEVEL), []
    step_on(gait, 1)
    step, gait.felt.elapsed = gait.step, 0.1
    step.decision.decide = lambda state, _, look: asked.append((state.longest, look))  # type: ignore[method-assign, assignment]
    swing = gait.felt.swing
    landing = Footstep(SIDES[swing], *LEVEL[swing].translation[:2])
    step.swing = SwingFoot(LEVEL[swing], landing, 0.4, step._shape)
    ahead = [
        Footstep(SIDES[(swing + k) % 2], 0.1 * k, 0.11 if (swing + k) % 2 == 0 else -0.11) for k in range(3)
    ]
    fixed = [dataclasses.replace(ahead[0], fixed=True), *ahead[1:]]
    for sight, steps, footsteps, looks in (
        (None, 1, (), False),
        (object(), 0, (), False),
        (object(), 1, (), True),
        (object(), 1, ahead, True),
        (object(), 1, ahead[:2], False),
        (object(), 1, fixed, False),
    ):
        gait.ground.sight, gait.footsteps = sight, footsteps  # type: ignore[assignment]
        step._one.out = None if steps else SetOff(SETTINGS.step_time)
        step.asked = gait._asked(StepVelocity((0.1, 0.0), True))
        step._solve()
        longest, look = asked[-1]
        assert longest == pytest.approx(step._longest)
        assert look == (pytest.approx(step._touch_time() - 0.1) if looks else None)


def test_steps_are_decided_once_a_period_and_land_harder_on_rough_ground() -> None:
    body = PointMass()
    body.run(0.6)
    gait, step, times = body.gait, body.gait.step, []
    for uneven in (0.0, 0.01, 9.0):
        gait.steering.command((0.2, 0.0, 0.0))
        while step.swing is None:
            body.run(body.dt)
        gait.ground.uneven, swing = uneven, step.swing
        decide = step.decision.decide
        step.decision.decide = lambda *a, decide=decide, **kw: (times.append(step._ticks), decide(*a, **kw))  # type: ignore[method-assign, assignment, misc]
        while step.swing is swing or step.swing is None:
            gait.ground.uneven = uneven
            body.run(body.dt)
        step.decision.decide = decide  # type: ignore[method-assign]
        assert step.swing is not None
        left = 0.9 * uneven  # a landing on level ground leaves nine tenths of it
        harder = min(
            CONSTANTS.swing.landing_speed + CONSTANTS.swing.landing_gain * left, CONSTANTS.swing.hardest
        )
        assert step.swing.shape.landing_speed == pytest.approx(harder)
    steps = np.diff(times)
    assert np.median(steps) == step._period and (steps <= step._period).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("foot", "dcm", "goes_on"),
    [
        ((0.0, 0.25), (0.2, 0.05), True),
        ((0.4, 0.25), (0.2, 0.05), False),
        ((0.176, 0.25), (0.2, 0.05), False),
        ((0.0, 0.6), (0.0, -0.1), True),
        ((0.0, 0.2), (0.0, 0.05), False),
    ],
    ids=["ahead of both", "towards the foot", "by the foot", "beyond the outer edge", "between"],
)
def test_a_foot_that_rubs_goes_on_where_the_dcm_runs_away_from_it(
    sign: float, foot: tuple[float, float], dcm: tuple[float, float], *, goes_on: bool
) -> None:
    """Its landing is where ξ will be then, less the offset of a step in place; it lands in 0.1 s."""
    gait = gait_on(LEVEL)
    stance, side = (1, 1.0) if sign > 0.0 else (0, -1.0)
    step_on(gait, stance)
    step, gait.felt.dcm = gait.step, Divergent(dcm[0], side * dcm[1], OMEGA)
    step.asked = gait._asked(STILL)
    touch = step._touch_time()
    gait.felt.elapsed = touch - 0.1
    spots = [POINT, POINT]
    spots[1 - stance] = (foot[0], side * foot[1], 0.0)
    gait.felt.state = gait.felt.state._replace(places=(spots[0], spots[1]))
    grown, still = math.exp(0.1 * OMEGA), step._orbit()
    there = Footstep(SIDES[1 - stance], grown * dcm[0], side * (grown * dcm[1] + still.inwards))
    assert step.rubs(there) == goes_on
    far = dataclasses.replace(there, x=there.x + 9.0)
    assert not step.rubs(far), "its landing does not catch the robot"
    gait.felt.elapsed = touch + 1e-6
    assert not step.rubs(there), "it is to have landed"


@pytest.mark.parametrize(("height", "lands"), [(0.95, True), (1.05, False), (-0.95, True), (-1.05, False)])
def test_ground_within_a_third_of_a_leg_is_landed_on(height: float, lands: bool) -> None:
    gait, z = gait_on(LEVEL), height * SCALE.leg / 3.0
    seen = SimpleNamespace(x=0.2, y=0.1, z=z, slope=(0.1, -0.2))
    gait.ground.sight = SimpleNamespace(version=1, support=lambda *_: seen)  # type: ignore[assignment]
    gait.step.asked = gait._asked(STILL)
    landing = gait.step._on_seen_ground(Footstep("left", 0.2, 0.1), 0.0)
    assert landing.z == pytest.approx(z if lands else 0.0) == gait.ground.height
    assert gait.step._one.tilt == pytest.approx((-math.atan(0.1), math.atan(-0.2)) if lands else (0.0, 0.0))


def test_footsteps_ask_for_the_velocity_of_the_one_that_swings() -> None:
    gait = gait_on(LEVEL)
    gait.felt._begin(GaitPhase.SINGLE, 1)
    ahead = Footstep("left", 0.2, 0.11, yaw=0.3), Footstep("right", 0.3, -0.11)
    gait.steering.supported = 1.0
    for planned, speed in ((ahead, 0.2 / CONSTANTS.time.plan_time), (ahead[:1], 0.0)):
        gait.footsteps = planned
        steps = gait._steer()
        assert steps.velocity == pytest.approx((speed, 0.0)) and steps.go == (len(gait.footsteps) > 1)
    turned = gait.steering.heading
    assert 0.0 < turned <= 2.0 * SETTINGS.fastest_turn * DT + 1e-12, (
        "half way to the landing, as fast as it may"
    )
    for _ in range(2000):
        gait._steer()
    assert gait.steering.heading == pytest.approx(0.15)


@pytest.mark.parametrize("rise", [-0.1, 0.1, 0.0])
def test_the_com_goes_half_of_the_way_up_or_down_a_stair_before_the_foot_lands(rise: float) -> None:
    gait = gait_on(LEVEL)
    gait.ground.height = rise
    assert gait.step._com_ground() == 0.0, "no stair is known"
    gait.step._one.climbs = True
    assert gait.step._com_ground() == pytest.approx(0.5 * rise)


@pytest.mark.parametrize(
    ("stands", "lifted", "seen", "climbs"),
    [
        (0.0, 0.0, 0.09, False),
        (0.0, 0.0, 0.11, True),
        (0.0, 0.0, -0.11, True),
        (0.11, 0.0, 0.11, True),
        (0.2, 0.2, 0.2, False),
    ],
)
def test_a_landing_that_is_seen_far_above_or_below_either_foot_is_a_stair(
    stands: float, lifted: float, seen: float, climbs: bool
) -> None:
    """In heights of the CoM; a foot that closes up on a stair has come from the one below."""
    h = SCALE.height
    gait = gait_on(
        (frame_of((0.0, 0.11, h * stands, 0.0, 0.0, 0.0)), frame_of((0.0, -0.11, h * stands, 0.0, 0.0, 0.0)))
    )
    step = gait.step
    spot = SimpleNamespace(x=0.2, y=0.1, z=h * seen, slope=(0.0, 0.0))
    gait.ground.sight = SimpleNamespace(version=1, support=lambda *_: spot)  # type: ignore[assignment]
    step.asked = gait._asked(STILL)
    step._on_seen_ground(Footstep("left", 0.2, 0.1), h * lifted)
    assert step._one.climbs == climbs and (step._swing_shape().edge > 0.0) == climbs
    step._one.climbs, step.asked = False, step.asked._replace(footsteps=(Footstep("left", 0.2, 0.1),))
    step._on_seen_ground(Footstep("left", 0.2, 0.1), h * lifted)
    assert not step._one.climbs, "footsteps say where stairs are"


def test_steps_of_a_plan_take_a_time_of_their_own_and_the_slow_one_downstairs() -> None:
    gait = gait_on(LEVEL)
    gait.footsteps = Footstep("left", 0.1, 0.11), Footstep("right", 0.2, -0.11)
    for held, climbs, time in (
        (0.0, 0.0, SETTINGS.step_time),
        (1.0, 0.0, CONSTANTS.time.plan_time),
        (0.0, 0.1, CONSTANTS.time.plan_time),
        (1.0, 0.1, CONSTANTS.time.plan_time),
        (0.0, -0.1, SETTINGS.slow_time),
    ):
        gait.steering.supported, gait.stair = held, climbs
        gait._steer()
        assert gait.step_time == pytest.approx(time, rel=0.02), "a little more for the length of the step"
    gait.footsteps = ()
    gait._steer()
    assert gait.step_time == gait.steering.step_time


@pytest.mark.parametrize("rise", [-0.1, 0.1])
def test_stairs_end_with_the_step_that_brings_both_feet_to_one_height(rise: float) -> None:
    """A foot that closes up lands beside the other one, and rises or sinks by the stair that it has been left on."""
    left, right = Footstep("left", 0.0, 0.11), Footstep("right", 0.0, -0.11)
    onto, beside = Footstep("left", 0.25, 0.11, rise), Footstep("right", 0.25, -0.11, rise)
    gait = gait_on(LEVEL)
    gait.take(PlanSource(FootstepPlan(left, right, (onto, beside), Gait())))
    climbs = []
    for begun, feet in enumerate(((left, right), (onto, right), (onto, beside))):
        gait.steps_done, gait.felt.frames = begun, (feet[0].placement, feet[1].placement)
        gait._plan_steps(beside.side if begun == 1 else onto.side)
        climbs.append(gait.stair)
    assert climbs == pytest.approx([rise, rise, 0.0])
