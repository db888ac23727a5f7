"""The pattern obeys the pendulum, stays inside its supports, and does not care where the world is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from pendulum import analytic_pattern, support_area

from wbc.core.trajectories import Quintic
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.lipm.pattern import Pattern, dcm_backwards
from wbc.walking.lipm.preview import INTERVAL, PreviewController, PreviewSettings
from wbc.walking.lipm.schedule import HeightProfile, SupportPhase, ZmpTarget, schedule, zmp_reference
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.planners import climb_stairs, walk_distance, walk_velocity

START = FootstepPlan(Footstep("left", 0.0, 0.0875), Footstep("right", 0.0, -0.0875), (), Gait())
SIZES = ((0.16, 0.076), (0.16, 0.076))
HEIGHT = 0.76
REST = Pendulum.at_rest(np.array([0.0, 0.0, HEIGHT]))
WALK = schedule(walk_distance(START, 0.6))


def remaining(supports: Sequence[SupportPhase], elapsed: float) -> tuple[SupportPhase, ...]:
    """The rest of a schedule after a time (s); the last support with no time left if all of it is over."""
    for i, support in enumerate(supports):
        if elapsed < support.duration - 1e-9:
            return (replace(support, duration=support.duration - elapsed), *supports[i + 1 :])
        elapsed -= support.duration
    return (replace(supports[-1], duration=0.0),)


def support_at(supports: tuple[SupportPhase, ...], time: float) -> SupportPhase:
    return remaining(supports, time)[0]


def inside(area: tuple[np.ndarray, np.ndarray], point: np.ndarray) -> float:
    """Return the distance of a point outside an area, m; negative inside."""
    return float((area[0] @ point - area[1])[np.abs(area[0]).sum(axis=1) > 0].max())


def pushed(state: Pendulum, shift: np.ndarray) -> Pendulum:
    com = state.com.copy()
    com[:2] += shift
    return state._replace(com=com)


def moved(state: Pendulum, world: pin.SE3) -> Pendulum:
    R = world.rotation
    return Pendulum(
        world.act(state.com),
        R @ state.com_velocity,
        R @ state.com_acceleration,
        world.act(state.zmp),
        R @ state.zmp_velocity,
        state.omega,
    )


# Schedule and areas


def test_the_schedule_covers_the_plan() -> None:
    gait = START.gait.full
    assert sum(s.duration for s in WALK) == pytest.approx(
        gait.initial_double_support + gait.final_double_support + 6 * 0.8 + 5 * 0.3
    )
    assert [s.single for s in WALK] == [False, True] * 6 + [False]
    assert WALK[1].feet[0].side == "right" and len(WALK) == 13
    assert [s.feet[-1] for s in WALK[:-1:2]] == [s.feet[0] for s in WALK[1::2]]
    assert schedule(START)[0].feet == (START.left, START.right)


def test_the_zmp_target_is_inward_on_both_feet() -> None:
    target = ZmpTarget(forward=0.01, inward=0.02)
    assert target.under(START.left) == pytest.approx(0.01 + 0.0675j)
    assert target.under(START.right) == pytest.approx(0.01 - 0.0675j)
    points = zmp_reference(WALK, target)
    assert len(points) == len(WALK) and points[-1] == pytest.approx(0.61 + 0.0j)
    assert points[0] == points[1] == target.under(WALK[1].feet[0])


# Heights


@pytest.mark.parametrize("rise", [0.1, -0.1, -0.2])
def test_the_height_follows_stairs_smoothly(rise: float) -> None:
    supports = schedule(climb_stairs(START, rise=rise, tread=0.3, count=3, first_edge=0.4))
    profile = HeightProfile(supports, HEIGHT, REST)
    total = sum(s.duration for s in supports)
    times = np.arange(0.0, total, 0.002)
    values = np.array([profile.at(t) for t in times])
    assert np.abs(np.gradient(values[:, 0], times) - values[:, 1])[1:-1].max() < 1e-3
    assert np.abs(np.diff(values[:, 2])).max() < 0.1  # no jump of the acceleration
    assert np.abs(values[:, 2]).max() < 2.5  # a quarter of gravity
    assert values[0, 0] == 0.0 and profile.at(total)[0] == pytest.approx(3 * rise)
    assert (np.sign(rise) * np.diff(values[:, 0]) > -1e-9).all()
    # Going up nothing happens before the foot has landed; going down all is done when it carries.
    time = 0.0
    for support, following in zip(supports, supports[1:], strict=False):
        level = support.feet[0].z
        if support.single and rise > 0 and following.feet[-1].z > level:
            assert profile.at(time + support.duration)[0] == pytest.approx(level, abs=1e-9)
        if (
            not support.single and rise > 0.06 and following.feet[0].z > level
        ):  # the lower leg would be stretched
            assert profile.at(time + support.duration)[0] < level + 0.021
        if support.single and rise < 0 and following.feet[-1].z < level:  # half of the support's time is over
            assert profile.at(time + support.duration - 0.25 * support.total)[0] < level - 1e-3
        if (
            support.single and rise < -0.12 and following.feet[-1].z < level
        ):  # the leg reaches down no further
            assert profile.at(time + support.duration)[0] < following.feet[-1].z + 0.021
        if not support.single and rise < 0 and following.single:
            assert profile.at(time + support.duration)[0] == pytest.approx(following.feet[0].z, abs=1e-9)
        time += support.duration


def test_a_last_step_down_takes_the_height_to_the_middle_of_both_feet() -> None:
    """From the middle of the single support to the end of the double support after it, by a quintic."""
    supports = schedule(replace(START, steps=(Footstep("left", 0.1, 0.0875, -0.06),)))
    _, single, last = supports
    landing = supports[0].duration + single.duration
    begin, end = landing - 0.5 * single.total, landing + last.duration
    curve = Quintic((0.0, 0.0, 0.0), (-0.03, 0.0, 0.0), end - begin)
    for t in np.linspace(begin, end, 9):
        np.testing.assert_allclose(
            HeightProfile(supports, HEIGHT, REST).at(t), curve.at(t - begin), atol=1e-12
        )
    np.testing.assert_allclose(HeightProfile(supports, HEIGHT, REST).at(begin - 0.01), 0.0, atol=1e-12)


# Pattern


def check_pendulum(pattern: Pattern, until: float) -> None:
    """Derivatives, dynamics and the DCM of a pattern."""
    h = 1e-4
    for t in np.linspace(0.013, until, 60):
        a, b, c = pattern.at(t - h), pattern.at(t), pattern.at(t + h)
        np.testing.assert_allclose((c.com - a.com) / (2 * h), b.com_velocity, atol=1e-6)
        np.testing.assert_allclose((c.com_velocity - a.com_velocity) / (2 * h), b.com_acceleration, atol=2e-3)
        np.testing.assert_allclose(b.com_acceleration[:2], b.omega**2 * (b.com - b.zmp)[:2], atol=1e-9)
        assert abs(pattern.dcm_at(t) - complex(*b.dcm[:2])) < 1e-12
    for i, t in enumerate(pattern.times):
        assert abs(complex(*pattern.at(t).dcm[:2]) - pattern.dcm[i]) < 1e-7


def test_the_analytic_plan_obeys_the_pendulum_from_rest_to_rest() -> None:
    pattern = analytic_pattern(WALK, HEIGHT, REST)
    check_pendulum(pattern, pattern.times[-1] + 0.5)
    np.testing.assert_allclose(pattern.at(0.0).com, REST.com, atol=1e-12)
    np.testing.assert_allclose(pattern.at(0.0).com_velocity, 0.0, atol=1e-9)
    end = pattern.at(pattern.times[-1] + 4.0)
    np.testing.assert_allclose(end.com, [0.6, 0.0, HEIGHT], atol=1e-6)
    np.testing.assert_allclose(end.com_velocity, 0.0, atol=1e-6)
    time = 0.0
    for support in WALK:
        if support.single:
            middle = pattern.at(time + 0.5 * support.duration)
            np.testing.assert_allclose(middle.zmp, support.feet[0].position, atol=1e-9)
        time += support.duration


def test_plans_move_and_mirror_with_the_world() -> None:
    world = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 2.0), np.array([100.0, -40.0, 1.5]))
    plan = walk_velocity(START, (0.1, 0.02, 0.1), 4)
    flipped = walk_velocity(START, (0.1, -0.02, -0.1), 4)
    preview = PreviewController(SIZES, HEIGHT)
    mirror = np.array([1.0, -1.0, 1.0])
    for make in (lambda s, p: analytic_pattern(s, HEIGHT, p), preview.plan):
        here = make(schedule(plan), pushed(REST, np.array([0.004, 0.01])))
        there = make(schedule(plan.moved(world)), moved(pushed(REST, np.array([0.004, 0.01])), world))
        mirrored = make(schedule(flipped), pushed(REST, np.array([0.004, -0.01])))
        for t in np.linspace(0.0, 5.0, 23):
            a, b, c = moved(here.at(t), world), there.at(t), mirrored.at(t)
            np.testing.assert_allclose(a.com, b.com, atol=1e-6)
            np.testing.assert_allclose(a.com_acceleration, b.com_acceleration, atol=1e-5)
            np.testing.assert_allclose(here.at(t).zmp * mirror, c.zmp, atol=1e-6)


# Preview


def test_replanning_on_the_plan_gives_the_plan_back() -> None:
    plan = analytic_pattern(WALK, HEIGHT, REST)
    preview = PreviewController(SIZES, HEIGHT)
    for t in np.arange(0.9, 8.0, 0.37):
        again = preview.plan(remaining(WALK, t), plan.at(t))
        for dt in (0.01, 0.2, 0.8, 2.5):
            np.testing.assert_allclose(again.at(dt).com, plan.at(t + dt).com, atol=1e-9)
            np.testing.assert_allclose(again.at(dt).zmp, plan.at(t + dt).zmp, atol=1e-9)


@pytest.mark.parametrize(
    "plan", [walk_distance(START, 0.6), walk_velocity(START, (0.1, 0.03, 0.25), 6)], ids=["ahead", "curve"]
)
def test_the_zmp_stays_inside_and_the_dcm_is_taken_over(plan: FootstepPlan) -> None:
    rng = np.random.default_rng(2)
    supports = schedule(plan)
    closed = analytic_pattern(supports, HEIGHT, REST)
    margin = 0.008
    preview = PreviewController(SIZES, HEIGHT, PreviewSettings(margin=margin))
    reached = 0
    for k, t in enumerate(np.arange(0.2, 8.0, 0.52)):
        most = 0.08 if k % 2 else 0.015  # every other push is more than the soles can make up for
        start = pushed(closed.at(t), rng.uniform(-most, most, 2))
        pattern = preview.plan(remaining(supports, t), start)
        check = pattern.at(0.0)
        np.testing.assert_allclose(check.zmp[:2], start.zmp[:2], atol=1e-9)
        reached += np.abs(check.dcm[:2] - start.dcm[:2]).max() < 1e-4
        for dt in np.arange(0.02, 2.4, 0.04):
            support = support_at(supports, t + dt)
            if dt < INTERVAL:
                continue  # the ZMP starts where it was, and may have been near the edge
            assert inside(support_area(support.feet, SIZES, margin), pattern.at(dt).zmp[:2]) < 1e-5
        end = pattern.times[-1]
        np.testing.assert_allclose(pattern.at(end + 3.0).com, closed.at(t + end + 3.0).com, atol=1e-3)
    assert reached > 5


@pytest.mark.parametrize("error", [0.001 + 0.0j, 0.001j, -0.0006 + 0.0008j])
def test_small_errors_of_the_dcm_are_shared_by_the_knots_by_their_leverage_over_their_time(
    error: complex,
) -> None:
    """The least Σ Δ |δ|² with Σ w δ = e is δ ~ w / Δ; the leverage w of a knot is the derivative of the DCM."""
    preview = PreviewController(SIZES, HEIGHT)
    supports = remaining(schedule(walk_velocity(START, (0.1, 0.02, 0.2), 6)), 1.0)
    times, points, areas = preview._knots(supports, complex(0.0, -0.08))
    moved_points = list(points)
    preview._shift(times, moved_points, areas, error)
    shifts = np.array(moved_points) - np.array(points)
    free, dcm = len(areas), dcm_backwards(times, points, preview.omega)[0]
    levers = []
    for k in range(1, free + 1):
        nudged = [*points[:k], points[k] + 1.0, *points[k + 1 :]]
        levers.append((dcm_backwards(times, nudged, preview.omega)[0] - dcm).real)
    weights, spans = np.array(levers), np.diff(times[: free + 2])
    held = 0.5 * (spans[:-1] + spans[1:])
    expected = error * (weights / held) / (weights**2 / held).sum()
    np.testing.assert_allclose(shifts[1 : free + 1], expected, rtol=1e-3, atol=1e-9)
    assert not shifts[0] and not shifts[free + 1 :].any()


def test_knots_are_the_ends_of_supports_with_some_between_the_first_two() -> None:
    """Every tenth of a second, four in the first and two in the second at most; eight supports on they end."""
    preview = PreviewController(SIZES, HEIGHT)
    times, points, areas = preview._knots(WALK, 0j)
    ends = np.cumsum([support.duration for support in WALK])
    assert times[:5] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8]) and times[5:7] == pytest.approx([1.2, 1.6])
    assert times[7:] == pytest.approx(
        [*ends[2:], *([ends[-1] + 0.5] if len(areas) == len(points) - 2 else [])]
    )
    assert len(areas) == min(len(points) - 1, 4 + 2 + 7)
    under = [START.right.position, WALK[1].feet[0].position]
    np.testing.assert_allclose([points[2].imag, points[4].imag], [0.5 * under[0][1], under[1][1]], atol=1e-12)
    short, _, _ = preview._knots(remaining(WALK, 0.65), 0j)
    assert short[1:4] == pytest.approx([0.075, 0.15, 0.15 + 0.4])


@pytest.mark.parametrize("yaw", [0.0, 0.6])
def test_the_strip_between_two_feet_is_as_wide_as_the_narrower_way_through_their_soles(yaw: float) -> None:
    """Across the line between them each sole leaves its half length or width, over the cosine to its axis."""
    preview = PreviewController(SIZES, HEIGHT, PreviewSettings(margin=0.01))
    feet = Footstep("left", 0.3, 0.2, yaw=yaw), Footstep("right", 0.1, -0.1, yaw=-0.3)
    axis, centre, half = preview._area(feet)
    way = np.array([-0.2, -0.3])
    assert (axis.real, axis.imag) == pytest.approx(tuple(way / np.linalg.norm(way)))
    assert centre == pytest.approx(0.2 + 0.05j) and half.real == pytest.approx(0.5 * np.linalg.norm(way))
    across = np.array([-way[1], way[0]]) / np.linalg.norm(way)
    rooms = []
    for foot in feet:
        c, s = np.cos(foot.yaw), np.sin(foot.yaw)
        ahead, left = abs(across @ (c, s)), abs(across @ (-s, c))
        rooms.append(min(0.07 / ahead, 0.028 / left))
    assert half.imag == pytest.approx(min(rooms))
    axis, centre, half = preview._area(feet[:1])
    assert axis == pytest.approx(complex(np.cos(yaw), np.sin(yaw))) and (centre, half) == pytest.approx(
        (0.3 + 0.2j, 0.07 + 0.028j)
    )


def test_a_preview_that_is_not_solved_keeps_the_reference_and_is_logged(
    caplog: pytest.LogCaptureFixture,
) -> None:
    preview = PreviewController(SIZES, HEIGHT)
    # Numbers that no solver tells apart.
    far = [pushed(REST, np.array([sign * 1e20, 0.0])) for sign in (1, -1)]
    begin = {preview.plan(WALK, state).dcm_at(0.0) for state in far}
    assert len(begin) == 1 and abs(begin.pop()) < 1.0
    preview.plan(WALK, pushed(REST, np.array([1.0, 0.0])))  # a DCM out of reach is met as well as it can be
    assert [record.levelname for record in caplog.records] == ["WARNING"] * 2
