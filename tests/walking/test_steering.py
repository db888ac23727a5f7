"""Steering: velocities and goals as velocities of the steps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from steered_walk import steered_steps

import wbc
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import DriveSettings, Standing, VelocityLimits
from wbc.walking.steering import Steering
from wbc.walking.stepping.path import PathSteering
from wbc.walking.stepping.settings import GaitValues, RobotSize, SteppingConstants, SteppingSettings

DT = 0.002


SIZE = RobotSize.of(wbc.load_robot("g1").robot(), SteppingSettings().bend)
CONSTANTS = SteppingConstants().in_si(SIZE)


@pytest.fixture(scope="module")
def settings() -> SteppingSettings:
    return SteppingSettings().in_si(SIZE)


def steered(settings: SteppingSettings, heading: float = 0.0) -> PathSteering:
    return PathSteering(GaitValues(settings, CONSTANTS, SIZE, DT), heading)


def test_a_velocity_after_a_goal_leaves_the_line_to_that_goal(settings: SteppingSettings) -> None:
    steering = steered(settings)
    steering.rest((0.0, 0.0))
    steering.go_to(3.0, 0.0, 0.0)
    to_goal = steering.update((0.0, 0.1), (0.0, 0.0))  # the line to the goal begins here
    beside = steering.update((0.1, 0.3), (0.0, 0.0))
    assert abs(to_goal.velocity[1]) < 1e-9 and beside.velocity[1] < -0.05
    steering.command((0.2, 0.0, 0.0))
    steering.rest((0.1, 0.3))
    assert abs(steering.update((0.1, 0.3), (0.0, 0.0)).velocity[1]) < 1e-9


@pytest.mark.parametrize("aside", [0.3, 1.3, -2.0])
def test_a_robot_that_the_ground_turned_aside_comes_to_its_goal(
    settings: SteppingSettings, aside: float
) -> None:
    steering = steered(settings)
    steering.rest((0.0, 0.0))
    steering.go_to(2.0, 0.0, 0.0)
    place, speed, time = (0.0, 0.0), (0.0, 0.0), 0.0
    while steering.pending and time < 60.0:
        speed = turned(steering.update(place, speed).velocity, steering.heading)
        place, time = (place[0] + DT * speed[0], place[1] + DT * speed[1]), time + DT
        if abs(time - 4.0) < 0.5 * DT:
            place = (place[0], place[1] + aside)
    assert not steering.pending and math.dist(place, (2.0, 0.0)) < 0.15


def turned(point: tuple[float, float], angle: float) -> tuple[float, float]:
    c, s = math.cos(angle), math.sin(angle)
    return c * point[0] - s * point[1], s * point[0] + c * point[1]


def drive(steering: PathSteering, yaw: float, side: float) -> list[tuple[float, ...]]:
    """Velocity, turn and go of a robot that is slower and sways to a side first, in a world turned by an angle."""
    place, steps, speed, seconds = (0.0, 0.0), [], (0.0, 0.0), 3.0
    for tick in range(round(seconds / DT)):
        step = steering.update(turned(place, yaw), turned(speed, yaw))
        x, y = step.velocity
        steps.append((x, y, steering.turn, step.go))
        sway = 0.1 * side * math.cos(8.0 * tick * DT)
        speed = turned((0.8 * x - 0.05, y + sway), steering.heading - yaw)
        place = (place[0] + DT * speed[0], place[1] + DT * speed[1])
    return steps


@pytest.mark.parametrize("order", ["velocity", "far goal", "near goal"])
def test_a_turned_and_a_mirrored_world_are_steered_as_this_one(
    settings: SteppingSettings, order: str
) -> None:
    runs = []
    for yaw, side in ((0.0, 1.0), (2.9, 1.0), (0.0, -1.0)):
        steering = steered(settings, yaw)
        steering.rest((0.0, 0.0))
        if order == "velocity":
            steering.command((0.25, side * 0.05, side * 0.2))
        else:
            x, y = (2.5, side * 0.9) if order == "far goal" else (0.15, side * -0.1)
            steering.go_to(*turned((x, y), yaw), yaw + side * 0.4)
        runs.append(np.array(drive(steering, yaw, side)))
    np.testing.assert_allclose(runs[1], runs[0], atol=1e-9)
    np.testing.assert_allclose(runs[2], runs[0] * (1.0, -1.0, -1.0, 1.0), atol=1e-9)


@pytest.mark.parametrize("effort", [0.2, 0.4, 0.6, 3.0])
def test_a_velocity_is_granted_as_far_as_legs_reach_and_hips_have_torque_in_the_time(
    settings: SteppingSettings, effort: float
) -> None:
    steering, longest = steered(replace(settings, effort=effort)), settings.longest * settings.step_time
    most = steering.limits.forward
    steering.velocity = (most, 0.0)
    time = steering.step_time
    assert most * time <= SIZE.stride + 1e-6 and time <= longest + 1e-6
    assert most * time == pytest.approx(SIZE.stride) or time == pytest.approx(longest)
    least = effort * SIZE.swing * (CONSTANTS.swing.late_touch * time) ** 2 * math.sqrt(3.0) / 10.0
    assert 2.0 * most * time <= least + 1e-6, "the way of the foot with the torque of the hip"
    assert most <= steered(replace(settings, effort=1.1 * effort)).limits.forward


def test_steps_take_longer_about_the_speed_at_which_a_walk_becomes_fast(settings: SteppingSettings) -> None:
    steering, quick, found = steered(settings), CONSTANTS.time.quick, []
    for speed in (0.0, 0.5 * quick, quick, 1.5 * quick, 2.0 * quick):
        for way in (1.0, -1.0):
            steering.velocity = (way * speed, 0.0)
            found.append((steering.step_time / settings.step_time, steering.fast_share))
    assert found[::2] == found[1::2], "forward and back"
    times, shares = zip(*found[::2], strict=True)
    assert times[0] == times[4] == 1.0 and times[2] == max(times) > 1.05 and times[1] == times[3] < 1.01
    assert shares == pytest.approx((0.0, 0.0, 0.0, 0.5, 1.0))


# ---- figures --------------------------------------------------------------------------------------------------------


def test_limits_are_those_of_the_settings_and_what_feet_that_come_together_give(
    settings: SteppingSettings,
) -> None:
    """To the side feet lose v T of their distance, at most 0.8 of what lies over the gap."""
    for fastest in (9.0, 0.1):
        limits = steered(replace(settings, fastest_aside=fastest, fastest_back=fastest)).limits
        most = 0.8 * (settings.widest - settings.gap) / settings.step_time
        assert limits.aside == pytest.approx(min(most, fastest))
        assert limits.back == pytest.approx(min(fastest, limits.forward))
        assert limits.turn == settings.fastest_turn


@pytest.mark.parametrize("share", [-3.0, -0.5, 0.0, 0.7, 2.0])
def test_each_part_of_a_velocity_is_cut_to_its_own_limit(share: float) -> None:
    steering = Steering(VelocityLimits(0.3, 0.2, 0.1, 0.5), 0.6)
    cut = min(max(share, -1.0), 1.0)
    back = max(share * 0.3, -0.2) if share < 0.0 else cut * 0.3
    assert steering.limited((share * 0.3, share * 0.1, share * 0.5)) == pytest.approx(
        (back, cut * 0.1, cut * 0.5)
    )


@pytest.mark.parametrize("yaw", [0.0, 0.9, -2.4])
def test_a_near_goal_is_walked_to_as_one_stands_and_a_far_one_face_first(yaw: float) -> None:
    steering, here = Steering(VelocityLimits(0.3, 0.2, 0.1, 0.5), 0.6), (1.0, -2.0)

    def goal(ahead: float, aside: float, turn: float) -> None:
        x, y = turned((ahead, aside), yaw)
        steering.go_to(here[0] + x, here[1] + y, yaw + turn)

    goal(0.3, -0.4, 0.2)
    assert steering.away(here, yaw) == pytest.approx((0.5, 0.2))
    assert steering.approach(here, yaw, 2.0, 9.0, None) == pytest.approx((0.15, -0.2, 0.1))
    assert steering.approach(here, yaw, 2.0, 0.1, None)[0] == pytest.approx(0.1), "as fast as it may"
    goal(-0.3, 0.4, 0.2)
    assert steering.approach(here, yaw, 2.0, 0.1, None)[0] == pytest.approx(-0.1)
    goal(3.0, 4.0, 0.2)
    off = math.atan2(4.0, 3.0)
    speed = steering.approach(here, yaw, 2.0, 0.3, None)
    assert speed == pytest.approx((0.3 * math.cos(off) ** 4, 0.0, off / 2.0))
    slow = steering.approach(here, yaw, 100.0, 0.3, yaw + 0.1)
    assert slow == pytest.approx((0.05 * math.cos(0.1) ** 4, 0.0, 1e-3)), "5 m in 100 s"
    goal(-5.0, 0.0, 0.2)
    assert steering.approach(here, yaw, 2.0, 0.3, None)[0] == 0.0, "it turns first"


def test_steps_are_slow_on_soles_that_hold_and_quick_in_fast_walks_in_turns_and_before_a_stand(
    settings: SteppingSettings,
) -> None:
    """T + held · (2 − v/cruise), at most 1, of the difference to the slow time."""
    steering, own = steered(settings), CONSTANTS
    steering.command((0.2, 0.0, 0.0))
    longer = settings.slow_time - settings.step_time
    for held in (0.0, 0.4, 1.0):
        steering.supported = held
        for share, slow in ((0.0, 1.0), (1.0, 1.0), (1.6, 0.4), (2.5, 0.0)):
            steering.velocity, steering.turn = (-share * settings.cruise, 0.0), 0.0
            assert steering._slow == pytest.approx(settings.step_time + held * slow * longer)
            steering.velocity, steering.turn = (0.0, 0.0), -share * own.path.slow_turn
            assert steering._slow == pytest.approx(settings.step_time + held * slow * longer)
    steering.command(None)
    steering.turn = 0.0
    assert steering._slow == settings.step_time


def test_steps_of_a_second_walk_begin_with_the_time_of_those_of_the_first(settings: SteppingSettings) -> None:
    steering, place = steered(settings), (0.0, 0.0)
    steering.supported, times = 1.0, []
    for _ in range(2):
        assert steering.step_time == settings.step_time, "nothing asks for steps in a stand"
        steering.command((0.2, 0.0, 0.0))
        times.append(steering.step_time)
        steering.rest(place)
        for _ in range(50):
            steering.update(place, (0.0, 0.0))
        steering.command(None)
        while any(steering.velocity):
            steering.update(place, (0.0, 0.0))
        steering.rest(place)
    assert times == [settings.slow_time] * 2


@pytest.mark.parametrize("yaw", [0.0, 0.5 * math.pi, math.pi, 2.2])
def test_a_robot_leaves_a_ground_that_ends_before_it_can_stop(settings: SteppingSettings, yaw: float) -> None:
    """At v it goes on for v/2a and a step; its soles, and feet that come apart, need room beyond."""
    speed, aside = 0.2, 0.05
    c, s = math.cos(yaw), math.sin(yaw)
    stop = math.hypot(speed, aside) / (2.0 * settings.acceleration) + settings.step_time
    length, width = SIZE.sole
    width += max(0.5 * settings.width, settings.gap + aside * settings.step_time / 0.8)
    ahead = np.array([c * speed - s * aside, s * speed + c * aside])
    room = np.array([abs(c) * length + abs(s) * width, abs(s) * length + abs(c) * width])
    ends = stop * ahead + np.sign(ahead) * room
    for axis in (0, 1):
        for off in (-1e-3, 1e-3):
            low, high = np.full(2, -9.0), np.full(2, 9.0)
            (high if ends[axis] > 0.0 else low)[axis] = ends[axis] + off
            extent = (low[0], high[0], low[1], high[1])
            values = GaitValues(settings, CONSTANTS, SIZE, DT)
            steering = PathSteering(values, yaw, extent)
            assert not steering.overruns((0.0, 0.0)), "it is not asked to walk"
            steering.command((speed, aside, 0.0))
            outwards = (off < 0.0) == (ends[axis] > 0.0)
            assert steering.overruns((0.0, 0.0)) == outwards, "before it sets off"
            steering.velocity = speed, aside
            assert steering.overruns((0.0, 0.0)) == outwards
            moved = PathSteering(values, yaw, tuple(np.add(extent, [3.0, 3.0, -2.0, -2.0])))
            moved.command((speed, aside, 0.0))
            assert moved.overruns((3.0, -2.0)) == outwards


@pytest.mark.parametrize("yaw", [0.0, 1.3])
def test_a_robot_beside_its_path_comes_back_to_it_at_a_speed_that_grows_with_the_distance(
    settings: SteppingSettings, yaw: float
) -> None:
    own = CONSTANTS
    for speed, aside in ((0.2, 0.01), (0.2, 5.0), (0.2, -5.0), (0.0, 0.01)):
        steering = steered(settings, yaw)
        steering.rest((1.0, -2.0))
        steering.velocity = speed, 0.0
        x, y = turned((0.02, aside), yaw)
        back = steering._kept_to_path((1.0 + x, -2.0 + y), 0.0)
        along = 0.02 - speed * DT if speed == 0.0 else 0.0  # a robot that walks is never behind its path
        expected = [-own.path.drift_gain * part for part in (along, aside)]
        cut = [min(max(part, -own.path.drift_speed), own.path.drift_speed) for part in expected]
        assert back == pytest.approx((speed + cut[0], cut[1]), abs=1e-9)


def test_the_path_goes_along_with_a_robot_that_walks_to_the_side_and_lags_behind_it(
    settings: SteppingSettings,
) -> None:
    """From 0.1 m beside it, by e^{−t/τ}, and with the velocity that is asked for."""
    own, steering, yaw = CONSTANTS, steered(settings, 0.4), 0.4
    steering.rest((1.0, -2.0))
    steering.velocity = 0.0, 0.05
    for tick in range(1, 301):
        along = 0.05 * tick * DT
        x, y = turned((0.0, along + 0.1), yaw)
        steering._kept_to_path((1.0 + x, -2.0 + y), 0.0)
    assert steering._path is not None
    x, y = turned((steering._path[0] - 1.0, steering._path[1] + 2.0), -yaw)
    assert x == pytest.approx(0.0, abs=1e-9)
    assert along + 0.1 - y == pytest.approx(0.1 * math.exp(-300 * DT / own.path.path_lag), rel=1e-6)


def test_a_line_to_a_far_goal_is_held_from_where_it_began(settings: SteppingSettings) -> None:
    steering, yaw = steered(settings), 0.7
    start, own = (2.0, -3.0), CONSTANTS
    steering.rest(start)
    x, y = turned((5.0, 0.0), yaw)
    steering.go_to(start[0] + x, start[1] + y, yaw)
    steering.turn_to(yaw)
    steering.velocity = 0.1, 0.0
    steering._wanted(start)
    for gone, aside in ((1.0, 0.02), (2.0, -0.03)):
        x, y = turned((gone, aside), yaw)
        back = steering._kept_to_path((start[0] + x, start[1] + y), 0.0)
        assert back[1] == pytest.approx(-own.path.drift_gain * aside, abs=1e-9)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5])
def test_a_new_line_to_a_far_goal_is_begun_where_the_robot_has_come_far_off_the_old_one(
    settings: SteppingSettings, yaw: float
) -> None:
    """That is where the direction to the goal differs from that of the line by more than an angle."""
    steering, own, start = steered(settings, yaw), CONSTANTS, (2.0, -3.0)
    x, y = turned((5.0, 0.0), yaw)
    steering.go_to(start[0] + x, start[1] + y, yaw)
    steering._wanted(start)
    line = steering._line
    assert line is not None and line[0] == start and line[1] == pytest.approx(yaw)
    for share, same in ((0.5, True), (0.99, True), (1.01, False)):
        aside = 2.0 * math.tan(share * own.path.astray)
        x, y = turned((3.0, aside), yaw)
        place = start[0] + x, start[1] + y
        steering._wanted(place)
        assert (steering._line == line) is same
    assert steering._line is not None and steering._line[0] == place


@pytest.mark.parametrize("yaw", [0.0, -2.0])
def test_a_robot_that_falls_short_is_sent_on_faster_up_to_a_bound(
    settings: SteppingSettings, yaw: float
) -> None:
    """The integral of the velocity that lacks, over its time constant, of quick steps over (T_slow/T)⁴ of it."""
    own, steering = CONSTANTS, steered(settings, yaw)
    speed = turned((0.15, 0.3), yaw)
    for _ in range(100):
        steering._make_up((0.2, 9.0), speed, steering.fast_share)
    assert steering._missing == pytest.approx(0.05 * 100 * DT / own.path.speed_lag)
    for _ in range(20000):
        steering._make_up((0.2, 9.0), speed, steering.fast_share)
    assert steering._missing == pytest.approx(own.path.speed_bias)
    steering.velocity = 2.0 * CONSTANTS.time.quick, 0.0
    steering._missing, ratio = 0.0, steering._slow / steering.step_time
    steering._make_up((0.2, 9.0), speed, steering.fast_share)
    assert steering._missing == pytest.approx(0.05 * DT / (own.path.speed_lag * ratio**4))
    for _ in range(20000):
        steering._make_up((0.1, 9.0), speed, steering.fast_share)
    assert steering._missing == pytest.approx(-2.0 * own.path.speed_bias), "twice as much in a fast walk"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_velocity_changes_no_faster_than_it_may_and_a_heading_turns_with_it(
    settings: SteppingSettings, sign: float
) -> None:
    steering = steered(settings, 0.3)
    steering.rest((0.0, 0.0))
    steering.command((sign * 0.1, sign * 0.05, sign * 0.2))
    steering.update((0.0, 0.0), (0.0, 0.0))
    change = settings.acceleration * DT
    assert steering.velocity == pytest.approx((sign * change, sign * change))
    assert steering.heading == pytest.approx(0.3 + sign * 0.2 * DT)
    assert steering.direction == pytest.approx((math.cos(steering.heading), math.sin(steering.heading)))
    for _ in range(1000):
        steering.update((0.0, 0.0), (0.0, 0.0))
    assert steering.velocity == pytest.approx((sign * 0.1, sign * 0.05))


@pytest.mark.parametrize("off", [0.2, -0.5, 0.9, 3.0])
def test_a_heading_stays_as_near_to_the_pelvis_as_it_may(settings: SteppingSettings, off: float) -> None:
    steering, most = steered(settings, 3.0), CONSTANTS.path.pelvis_turn
    steering.turn_with(3.0 + off)
    left = math.remainder(3.0 + off - steering.heading, math.tau)
    assert left == pytest.approx(off if abs(off) <= most else math.copysign(most, off))


@pytest.mark.parametrize(("x", "turn", "there"), [(0.9, 0.9, True), (1.1, 0.0, False), (0.0, -1.1, False)])
def test_a_goal_is_dropped_within_its_distance_and_turn(
    settings: SteppingSettings, x: float, turn: float, *, there: bool
) -> None:
    steering, own = steered(settings), CONSTANTS
    assert not steering.arrives((0.0, 0.0))
    steering.go_to(2.0 + x * own.path.arrived, 1.0, turn * own.path.arrived_turn)
    assert steering.arrives((2.0, 1.0)) == there
    assert (steering.goal is None) == there


# ---- planned steps --------------------------------------------------------------------------------------------------


def asked(side: str | None = "left", time: float = 0.0, begun: int = 0, swings: bool = False) -> Standing:
    start = FootstepPlan(Footstep("left", 1.0, 0.0875), Footstep("right", 1.0, -0.0875), (), Gait())
    return Standing(start, side, begun, swings, time)


REACH = Reach.of(wbc.load_robot("hrp4_class").robot())


def test_a_robot_sets_off_by_half_a_second_of_its_acceleration_and_goes_on_by_the_time_that_passes() -> None:
    drive = DriveSettings(acceleration=(0.2, 0.1, 0.6))
    planner = steered_steps(REACH, drive)
    planner.steering.command((0.25, -0.15, 0.45))
    planner.footsteps(asked("right"))
    assert planner.granted == pytest.approx((0.1, -0.05, 0.3))
    planner.footsteps(asked("left", 0.25, 1))
    assert planner._wish == pytest.approx((0.15, -0.075, 0.45))
    planner.steering.command((-0.2, 0.0, 0.0))
    planner.footsteps(asked("right", 0.5, 2))
    assert planner._wish == pytest.approx((0.1, -0.05, 0.3))


def test_steps_of_a_velocity_go_as_far_as_it_does_in_their_time_and_the_outer_foot_takes_more_of_a_turn() -> (
    None
):
    """Forward v T a step; to the side and in turns 2, 4/3 and 2/3 of it."""
    planner = steered_steps(REACH, granted=(0.1, 0.02, 0.1), pace=0.1)
    planner.steering.command((0.1, 0.02, 0.1))
    plan = planner.footsteps(asked("left"))
    assert planner.granted == pytest.approx((0.1, 0.02, 0.1)) and len(plan.steps) == 5
    cycle = plan.gait.full.cycle
    place = (1.0, 0.0, 0.0)
    for k, step in enumerate(plan.steps[:4]):
        opening = k % 2 == 0
        turn = (4.0 / 3.0 if opening else 2.0 / 3.0) * 0.1 * cycle
        aside = 2.0 * 0.02 * cycle if opening else 0.0
        x, y = turned((0.1 * cycle, aside), place[2])
        place = (place[0] + x, place[1] + y, place[2] + turn)
        x, y = turned((0.0, 0.0875 if opening else -0.0875), place[2])
        assert (step.x, step.y, step.yaw) == pytest.approx((place[0] + x, place[1] + y, place[2]))


@pytest.mark.parametrize("speed", [0.05, 0.3])
def test_a_robot_that_is_to_stop_halves_a_long_step_and_closes_up(speed: float) -> None:
    planner = steered_steps(REACH, granted=(speed, 0.0, 0.0), pace=speed)
    plan = planner.footsteps(asked("left", begun=3))
    cycle = Gait.at_speed(speed).cycle
    long = speed * cycle > 0.1
    places = [step.x for step in plan.steps]
    assert places == pytest.approx([1.0 + 0.5 * speed * cycle] * 2 if long else [])
    plan = planner.footsteps(asked("right", begun=4))
    assert planner.granted == (0.0, 0.0, 0.0) and planner.pace == 0.0
    assert all(step.x == pytest.approx(1.0) for step in plan.steps)


def test_the_share_of_a_velocity_within_reach_is_the_greatest_one() -> None:
    """By the ellipse of long and wide steps: forward and to the side together take more than each alone."""
    planner, gait = steered_steps(REACH), Gait(single_support=2.0, double_support=0.5)
    share, spacing = planner.settings.reach, 0.175
    slow, fast = (Gait.at_speed(speed, gait) for speed in (0.1, 0.9))
    cycle = slow.cycle
    wider = share * (REACH.max_spacing - spacing)
    for dx, dy, turn, fits in (
        (0.99 * share * REACH.max_length, 0.0, 0.0, True),
        (1.01 * share * REACH.max_length, 0.0, 0.0, False),
        (0.0, 0.495 * wider, 0.0, True),
        (0.0, 0.505 * wider, 0.0, False),
        (0.72 * share * REACH.max_length, 0.36 * wider, 0.0, False),
        (0.69 * share * REACH.max_length, 0.34 * wider, 0.0, True),
        (0.0, 0.0, 0.99 * 0.9 * REACH.max_yaw * 0.75, True),
        (0.0, 0.0, 1.01 * 0.9 * REACH.max_yaw * 0.75, False),
    ):
        velocity = (dx / cycle, dy / cycle, turn / cycle)
        assert planner._within(velocity, spacing, slow, 1.0) == fits, (dx, dy, turn)
        assert planner._within(tuple(2.0 * part for part in velocity), spacing, slow, 0.5) == fits
    speed, part = planner._fit((0.9, 0.0, 0.0), spacing, gait)
    assert speed == 0.9
    within = [planner._within((0.9, 0.0, 0.0), spacing, fast, part + off) for off in (0.0, 0.01)]
    strained = [planner._strains((0.9, 0.0, 0.0), fast, part + off) for off in (0.0, 0.01)]
    assert within[0] and not strained[0] and (not within[1] or strained[1])
