"""The swing foot: smooth, clear of the ground, softly down, and re-targeted without jumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.gait import EDGE_SHARE, StepGait, SwingShape
from wbc.walking.plans.swing import SwingFoot
from wbc.walking.stepping.single_support import STAIR

GAIT = StepGait()
HERE = Footstep("left", 0.0, 0.0875)
THERE = Footstep("left", 0.29, 0.0875)


def swing(
    landing: Footstep = THERE, start: Footstep = HERE, gait: StepGait = GAIT, duration: float = 0.8
) -> SwingFoot:
    return SwingFoot(start.placement, landing, duration, gait.swing)


def check_smooth(motion: object, times: np.ndarray, h: float = 1e-5) -> None:
    """Velocity and acceleration are the derivatives, and the acceleration does not jump."""
    for t in times:
        a, b, c = (motion.at(t + d) for d in (-h, 0.0, h))  # type: ignore[attr-defined]
        linear = (c.placement.translation - a.placement.translation) / (2 * h)
        angular = pin.log3(c.placement.rotation @ a.placement.rotation.T) / (2 * h)
        np.testing.assert_allclose(np.concatenate([linear, angular]), b.velocity, atol=1e-5)
        np.testing.assert_allclose((c.velocity - a.velocity) / (2 * h), b.acceleration, rtol=1e-3, atol=2e-3)
        near = [motion.at(t + d).acceleration for d in (-1e-8, 1e-8)]  # type: ignore[attr-defined]
        assert np.abs(near[1] - near[0]).max() < 1e-3


def test_a_foot_leaves_late_to_a_stair_above_and_arrives_early_over_one_below() -> None:
    """So that it passes the edge of the stair with its height."""
    times = np.linspace(0.0, 0.8, 801)

    def travel(rise: float) -> tuple[float, float]:
        foot = swing(replace(THERE, z=rise))
        share = np.array([foot.at(t).placement.translation[0] for t in times]) / THERE.x
        return float(times[np.argmax(share > 1e-9)]), float(times[np.argmax(share > 1.0 - 1e-9)])

    for rise in (0.02, 0.5 * GAIT.swing_height, 2.0 * GAIT.swing_height):
        later = EDGE_SHARE * 0.8 * min(rise / GAIT.swing_height, 1.0)
        assert travel(rise) == pytest.approx((GAIT.takeoff_time + later, 0.8 - GAIT.landing_time), abs=6e-3)
        assert travel(-rise) == pytest.approx((GAIT.takeoff_time, 0.8 - GAIT.landing_time - later), abs=6e-3)


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_foot_rises_onto_a_stair_heel_first_without_digging_its_toes_in(yaw: float) -> None:
    """Level behind the body it would meet the end of the ankle's range."""
    ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    start = replace(HERE, yaw=yaw)
    for rise, most in ((-0.1, 0.0), (0.05, 0.0), (0.075, 0.15), (0.1, 0.3), (0.2, 0.3)):
        x, y, _ = 0.29 * ahead
        foot = swing(replace(start, x=x, y=HERE.y + y, z=rise), start)
        places = [foot.at(t).placement for t in np.linspace(0.0, 0.8, 161)]
        pitches = [np.arcsin(-(place.rotation[2, 0])) for place in places]
        assert max(pitches) == pytest.approx(most, abs=1e-3) and min(pitches) > -1e-9
        assert pitches[-1] == pytest.approx(0.0, abs=1e-9)
        assert min(place.act(np.array([0.1, 0.0, 0.0]))[2] for place in places) > min(rise, 0.0) - 2e-3


@pytest.mark.parametrize(("rise", "share"), [(-0.1, 0.0), (0.1, 0.25), (0.15, 0.75), (0.2, 1.0), (0.5, 1.0)])
def test_heels_go_first_from_the_height_of_a_stair_on_that_a_shape_names(rise: float, share: float) -> None:
    shape = GAIT.swing._replace(swing_height=0.2, heel=0.4, stair=0.375)
    foot = SwingFoot(HERE.placement, replace(HERE, x=0.25, z=rise), 0.8, shape)
    pitches = [np.arcsin(-foot.at(t).placement.rotation[2, 0]) for t in np.linspace(0.0, 0.8, 161)]
    assert max(pitches) == pytest.approx(0.4 * share, abs=1e-3)


tilts = st.floats(-0.3, 0.3)


@examples(20)
@given(st.floats(-0.3, 0.4), st.floats(0.0, 0.2), st.floats(-0.1, 0.1), st.floats(-0.5, 0.5), tilts, tilts)
def test_it_is_smooth_from_start_to_landing(
    x: float, y: float, z: float, yaw: float, pitch: float, roll: float
) -> None:
    landing = Footstep("left", x, y, z, yaw, pitch, roll)
    foot = swing(landing)
    check_smooth(foot, np.linspace(0.003, 1.2, 50))
    first, last = foot.at(0.0), foot.at(0.8)
    np.testing.assert_allclose(first.placement.homogeneous, HERE.placement.homogeneous, atol=1e-9)
    np.testing.assert_allclose(last.placement.homogeneous, landing.placement.homogeneous, atol=1e-9)
    np.testing.assert_allclose(first.velocity, 0.0, atol=1e-9)
    np.testing.assert_allclose(last.velocity, [0, 0, -GAIT.landing_speed, 0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(last.acceleration, 0.0, atol=1e-6)


def test_it_clears_the_ground_and_never_digs() -> None:
    foot = swing()
    heights = np.array([foot.at(t).placement.translation[2] for t in np.linspace(0.0, 0.8, 401)])
    assert heights.max() == pytest.approx(GAIT.swing_height, abs=1e-6)
    assert heights.min() > -1e-9
    top = round(GAIT.apex * 400)
    assert (np.diff(heights[:top]) > -1e-9).all() and (np.diff(heights[top + 1 :]) < 1e-9).all()
    # It rises before it travels, and travels no more while it lands.
    assert foot.at(GAIT.takeoff_time).placement.translation[0] == pytest.approx(0.0, abs=1e-12)
    assert heights[int(0.15 / 0.8 * 400)] > 0.01
    assert foot.at(0.8 - GAIT.landing_time).placement.translation[0] == pytest.approx(0.29)


@pytest.mark.parametrize("apex", [0.3, 0.7])
@pytest.mark.parametrize("duration", [0.25, 0.8])
def test_it_is_highest_when_the_gait_says(apex: float, duration: float) -> None:
    foot = swing(gait=replace(GAIT, apex=apex), duration=duration)
    times = np.linspace(0.0, duration, 501)
    heights = [foot.at(t).placement.translation[2] for t in times]
    assert max(heights) == pytest.approx(GAIT.swing_height, abs=1e-5)
    assert times[int(np.argmax(heights))] == pytest.approx(apex * duration, abs=0.002)


def test_a_short_swing_lifts_its_foot_as_high_as_legs_can_in_its_time() -> None:
    heights = []
    for duration in (0.16, 0.2, 0.26, 0.35, 0.8):
        shape = GAIT.swing._replace(lift=40.0, takeoff_time=0.0, landing_time=0.0)
        foot = SwingFoot(HERE.placement, HERE, duration, shape)
        times = np.linspace(0.0, duration, 401)
        heights.append(max(foot.at(t).placement.translation[2] for t in times))
        most = max(abs(foot.at(t).acceleration[2]) for t in times[times < foot.apex_time])
        assert most <= 41.0 or heights[-1] == pytest.approx(0.3 * GAIT.swing_height)
    assert heights == sorted(heights) and heights[0] < 0.9 * GAIT.swing_height
    assert heights[-1] == pytest.approx(GAIT.swing_height, abs=1e-5)
    high = SwingFoot(HERE.placement, HERE, 0.16, shape._replace(lift=1.0), over=0.1)
    assert max(high.at(t).placement.translation[2] for t in np.linspace(0.0, 0.16, 99)) > 0.1


@pytest.mark.parametrize("touch", [1.0, 0.5])
def test_ground_that_comes_early_is_met_gently_and_ground_that_comes_in_time_more_so(touch: float) -> None:
    foot, speed = SwingFoot(HERE.placement, THERE, 0.8, GAIT.swing._replace(touch=touch)), GAIT.landing_speed
    slow = GAIT.landing_height / (0.5 * (1.0 + touch) * speed)
    motions = [foot.at(t) for t in np.linspace(0.8 - slow, 0.8, 21)]
    speeds = np.array([-motion.velocity[2] for motion in motions])
    heights = [motion.placement.translation[2] for motion in motions]
    assert (speeds[0], speeds[-1]) == pytest.approx((speed, touch * speed)) and (np.diff(speeds) < 1e-9).all()
    assert (heights[0], heights[-1]) == pytest.approx((GAIT.landing_height, 0.0), abs=1e-9)
    # Asked to land in 0.15 s it has no time for that, and still lands at that speed.
    foot.retarget(0.5, THERE, 0.65)
    assert foot.at(0.65).velocity[2] == pytest.approx(-GAIT.landing_speed)
    # Stairs are known, and leave no time either.
    stair = swing(Footstep("left", 0.3, 0.0875, 0.1), gait=GAIT.for_stairs())
    assert stair.apex_time == pytest.approx(0.4)
    assert stair.at(0.8).velocity[2] == pytest.approx(-0.5 * GAIT.landing_speed)
    assert stair.at(0.7).velocity[2] < -GAIT.landing_speed
    quick = SwingFoot(HERE.placement, THERE, 0.8, replace(GAIT, landing_height=0.0).swing)
    assert quick.at(0.6).velocity[2] < -1.5 * GAIT.landing_speed


def test_a_touchdown_that_comes_too_soon_is_put_off() -> None:
    foot = swing()
    foot.retarget(0.7, THERE, 0.6)
    assert foot.duration == pytest.approx(0.75)
    check_smooth(foot, np.linspace(0.701, 0.9, 30))


def test_late_ground_is_looked_for_and_not_without_end() -> None:
    foot = swing()
    heights = np.array([foot.at(t).placement.translation[2] for t in np.linspace(0.8, 3.5, 100)])
    assert (np.diff(heights) < 1e-9).all()
    assert heights[-1] == pytest.approx(-0.04)
    assert foot.at(0.8 + 0.5 * GAIT.search_time).placement.translation[2] < -0.4 * 0.04
    assert foot.at(0.9).velocity[2] < -GAIT.landing_speed


def test_it_moves_and_mirrors_with_the_world() -> None:
    world = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 2.5), np.array([100.0, -30.0, 0.5]))
    landing = Footstep("left", 0.3, 0.11, 0.03, 0.2, 0.1, -0.05)
    here = swing(landing)
    there = SwingFoot(world * HERE.placement, Footstep.of("left", world * landing.placement), 0.8, GAIT.swing)
    flipped = SwingFoot(
        Footstep("right", 0.0, -0.0875).placement,
        Footstep("right", 0.3, -0.11, 0.03, -0.2, 0.1, 0.05),
        0.8,
        GAIT.swing,
    )
    sign = np.array([1, -1, 1, -1, 1, -1])
    for t in np.linspace(0.0, 1.0, 21):
        a, b, c = here.at(t), there.at(t), flipped.at(t)
        np.testing.assert_allclose((world * a.placement).homogeneous, b.placement.homogeneous, atol=1e-9)
        np.testing.assert_allclose(world.rotation @ a.velocity[3:], b.velocity[3:], atol=1e-9)
        np.testing.assert_allclose(sign * a.velocity, c.velocity, atol=1e-9)
        np.testing.assert_allclose(sign * a.acceleration, c.acceleration, atol=1e-8)


STEPPING = SwingShape(
    0.11, 0.477, 0.0, 0.0, 0.25, 0.0, 0.12, 0.3, lift_speed=0.5, edge=0.0, quickest=1.0, level=0.3
)
"""Shape of a swing of the stepping walk of g1."""


@examples(30)
@given(
    st.sampled_from([GAIT.swing, STEPPING]),
    st.lists(
        st.tuples(
            st.floats(0.01, 0.1),  # time since the last change, s
            st.tuples(*[st.floats(-0.1, 0.1)] * 3),  # of the place, m
            st.floats(-0.1, 0.1),  # of the time of touch-down, s
            st.floats(-0.3, 0.3),  # of the heading, rad
            st.booleans(),  # to a stair
        ),
        max_size=12,
    ),
)
def test_no_change_of_landing_time_and_shape_makes_the_foot_jump(
    shape: SwingShape, changes: list[tuple[float, tuple[float, float, float], float, float, bool]]
) -> None:
    """Position, velocity and acceleration go on through each change, also past touch-down."""
    foot, time = SwingFoot(HERE.placement, THERE, 0.6, shape), 0.0
    for passed, (x, y, z), later, turn, stair in changes:
        time += passed
        before, now = foot.at(time), foot.landing
        foot.retarget(
            time,
            replace(now, x=now.x + x, y=now.y + y, z=now.z + z, yaw=now.yaw + turn),
            foot.duration + later,
            shape._replace(**STAIR) if stair else shape,
        )
        after = foot.at(time)
        np.testing.assert_allclose(after.placement.homogeneous, before.placement.homogeneous, atol=1e-12)
        np.testing.assert_allclose(after.velocity, before.velocity, atol=1e-9)
        np.testing.assert_allclose(after.acceleration, before.acceleration, atol=1e-6)
    end = max(foot.duration, time + 0.05)
    there = foot.at(end).placement
    np.testing.assert_allclose(there.translation[:2], foot.landing.position[:2], atol=1e-9)
    assert foot.at(end + 1.0).placement.translation[2] <= there.translation[2] + 1e-9, "it searches"


def test_a_landing_that_moves_at_every_tick_is_met_in_time_and_slowly() -> None:
    foot, period = SwingFoot(HERE.placement, THERE, 0.32, STEPPING), 0.002
    for tick in range(1, 160):
        foot.retarget(tick * period, replace(THERE, x=0.2 + 0.0005 * tick, z=0.03), 0.32)
    end = foot.at(0.32)
    np.testing.assert_allclose(end.placement.translation, (0.28, THERE.y, 0.03), atol=8e-3)  # behind by 30 ms
    assert end.velocity[2] == pytest.approx(-STEPPING.landing_speed, abs=1e-6)
    assert foot.duration == 0.32


def test_the_apex_is_over_the_highest_ground_on_the_way() -> None:
    times = np.linspace(0.0, 0.8, 201)
    for over in (-np.inf, 0.05):
        foot = SwingFoot(HERE.placement, THERE, 0.8, GAIT.swing, over)
        top = max(foot.at(t).placement.translation[2] for t in times)
        assert top == pytest.approx(max(over, 0.0) + GAIT.swing_height, abs=1e-4)


def test_a_foot_that_has_lost_the_ground_goes_on_down_from_where_it_is() -> None:
    foot = SwingFoot(HERE.placement, THERE, 0.32, STEPPING)
    place = pin.SE3(np.eye(3), np.array([0.2, 0.1, 0.07]))
    foot.resume(0.25, place)
    np.testing.assert_allclose(foot.at(0.25).placement.homogeneous, place.homogeneous, atol=1e-12)
    down = [foot.at(t).placement.translation[2] for t in np.linspace(0.25, 0.6, 40)]
    assert (np.diff(down) <= 1e-12).all() and down[-1] == pytest.approx(0.07 - STEPPING.search_depth)


def test_a_foot_that_was_thrown_off_its_way_goes_on_from_there_to_the_same_landing() -> None:
    foot = swing()
    thrown, velocity = pin.SE3(np.eye(3), np.array([0.4, -0.05, 0.25])), (2.0, -1.0, 0.5)
    foot.restart(0.3, thrown, velocity)
    motion = foot.at(0.3)
    np.testing.assert_allclose(motion.placement.translation, thrown.translation, atol=1e-9)
    np.testing.assert_allclose(motion.velocity[:3], velocity, atol=1e-9)
    check_smooth(foot, np.linspace(0.31, 0.79, 25))
    np.testing.assert_allclose(foot.at(0.8).placement.translation[:2], THERE.position[:2], atol=1e-9)
    push = np.hypot(*foot.at(0.35).acceleration[:2])
    most = 0.5 * push
    assert np.hypot(*foot.at(0.35, most).acceleration[:2]) == pytest.approx(most)


def test_a_foot_that_is_thrown_nowhere_goes_on_as_it_was() -> None:
    foot, other = swing(), swing()
    for time in (0.2, 0.3, 0.4):
        motion = other.at(time)
        other.restart(time, motion.placement, tuple(motion.velocity[:3].tolist()))
    for time in (0.45, 0.6, 0.75):
        np.testing.assert_allclose(other.at(time).velocity[:2], foot.at(time).velocity[:2], atol=1e-9)
        place = foot.at(time).placement.translation[:2]
        np.testing.assert_allclose(other.at(time).placement.translation[:2], place, atol=1e-9)


def test_the_acceleration_of_a_foot_that_was_thrown_is_one_that_legs_have() -> None:
    foot = swing()
    motion = foot.at(0.2)
    most = 0.5 * float(np.hypot(*motion.acceleration[:2]))
    foot.restart(0.2, motion.placement, (0.0, 0.0, 0.0), most)
    assert np.hypot(*foot.at(0.2).acceleration[:2]) == pytest.approx(most)


def test_a_foot_has_at_its_apex_the_height_that_its_acceleration_gives() -> None:
    """From rest, a quintic over the time up to the apex with the greatest acceleration `lift`: √3/10 a t²."""
    for lift in (2.0, 4.0):
        shape = GAIT.swing._replace(lift=lift, takeoff_time=0.0, landing_time=0.0, swing_height=0.3)
        foot = SwingFoot(HERE.placement, HERE, 0.8, shape)
        expected = max(lift * foot.apex_time**2 * np.sqrt(3.0) / 10.0, 0.3 * 0.3)
        times = np.linspace(0.0, 0.8, 801)
        assert max(foot.motion(t)[0][2] for t in times) == pytest.approx(expected, abs=2e-4)
        place, speed = foot.motion(0.1)
        left = foot.apex_time - 0.1
        reach = place[2] + 0.5 * left * speed[2] + lift * left**2 * np.sqrt(3.0) / 10.0
        assert foot._reach(0.1) == pytest.approx(reach)


@pytest.mark.parametrize("z", [0.0, 0.03, -0.04])
def test_a_foot_that_is_cut_short_has_the_time_of_a_part_of_a_fall_from_its_height(z: float) -> None:
    """Over the landing: 0.5 √(h/g), less the height of the last piece at its landing speed."""
    shape, landing = STEPPING._replace(quickest=0.5), replace(THERE, z=z)
    foot = SwingFoot(HERE.placement, landing, 0.8, shape)
    height = foot.motion(0.35)[0][2] - z
    foot.retarget(0.35, landing, 0.36)
    least = 0.5 * np.sqrt((height - shape.piece * shape.landing_speed) / 9.80665)
    assert foot.duration == pytest.approx(0.35 + max(least, shape.piece), abs=1e-6)
