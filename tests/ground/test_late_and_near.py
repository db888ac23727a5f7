"""Figures of the ground as a robot knows it while it moves: late frames, poses, its body, and the sole that stands."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest

from wbc.ground import ElevationMap, HeightMap, KnownGround, PointCloud
from wbc.ground.footprint import ACROSS, HIGH, Footprint, FootprintSettings
from wbc.ground.height_map import HeightMapSettings
from wbc.ground.known import FUSED, GroundSettings
from wbc.robots import load

DESCRIPTION = load("hrp4_class")
ROBOT = DESCRIPTION.robot()
ROBOT.update(ROBOT.half_sitting, np.zeros(ROBOT.nv))
EXACT = FootprintSettings(trust=0.0)
LENGTH, WIDTH = 0.2, 0.096
WANDER = 0.05
"""Of a map whose heights grow old quickly, m/√s."""


def cell_of(world: HeightMap, place: complex = 0.01 + 0.01j) -> tuple[float, float]:
    (height,), (std,) = world.at(np.array([place]))
    return float(height), float(std)


def aging(**changes: float) -> HeightMap:
    return HeightMap(HeightMapSettings(**{"wander": WANDER, "shared": 10**6, "known": 1.0} | changes))  # type: ignore[arg-type]


# --- late frames -------------------------------------------------------------------------------------------------


def test_a_late_reading_counts_as_less_exact_by_the_time_to_the_newer_one() -> None:
    """It is fused with what has been seen since, which stays as new as it is."""
    first, late = 0.003, 0.004
    for earlier in (0.02, 0.3):
        world = aging()
        world.add([[0.01, 0.01, 0.1]], [first], 2.0)
        assert world.add([[0.01, 0.01, 0.102]], [late], 2.0 - earlier) is None
        r = late**2 + WANDER**2 * earlier
        weight = 1.0 / first**2 + 1.0 / r
        height, std = cell_of(world)
        assert height == pytest.approx((0.1 / first**2 + 0.102 / r) / weight, abs=1e-12)
        assert std == pytest.approx(weight**-0.5, rel=1e-9)
        world.add([[1.0, 1.0, 0.0]], [first], 3.0)  # it was seen at 2 s
        assert cell_of(world)[1] == pytest.approx(math.sqrt(1.0 / weight + WANDER**2), rel=1e-9)


def test_a_late_reading_of_what_was_seen_before_it_is_as_one_in_time() -> None:
    """Other places that have been seen since do not count."""
    first, late = 0.003, 0.004
    world = aging()
    world.add([[0.01, 0.01, 0.1]], [first], 1.0)
    world.add([[1.0, 1.0, 0.0]], [first], 2.0)
    world.add([[0.01, 0.01, 0.102]], [late], 1.6)
    grown = first**2 + WANDER**2 * 0.6
    weight = 1.0 / grown + 1.0 / late**2
    height, std = cell_of(world)
    assert height == pytest.approx((0.1 / grown + 0.102 / late**2) / weight, abs=1e-12)
    world.add([[1.0, 1.0, 0.0]], [first], 2.6)  # a second after it was seen
    assert cell_of(world)[1] == pytest.approx(math.sqrt(1.0 / weight + WANDER**2), rel=1e-9)
    assert std <= cell_of(world)[1]


@pytest.mark.parametrize("step", [0.05, -0.05])
def test_a_late_reading_of_another_surface_replaces_and_doubts_nothing_newer(step: float) -> None:
    """All that is older than it is replaced by a higher surface, or doubted for a lower one, as in time."""
    std = 0.003
    for seen, newer in ((2.0, True), (1.0, False)):
        world = aging(wander=0.0)
        world.add([[0.01, 0.01, 0.1]], [std], seen)
        world.add([[1.0, 1.0, 0.0]], [std], 2.0)
        world.add([[0.01, 0.01, 0.1 + step]], [std], 1.5)
        doubted = math.sqrt(1.5 * std**2 + 1e-5)
        wanted = (0.1, std) if newer else (0.15, std) if step > 0.0 else (0.1, doubted)
        assert cell_of(world) == (pytest.approx(wanted[0]), pytest.approx(wanted[1]))


def test_a_late_frame_is_moved_to_the_map_and_not_the_map_to_it() -> None:
    x = 0.01 + 0.02 * np.arange(120) - 1.0
    points, std = np.stack([x, 0.0 * x + 0.01, 0.1 * x], axis=1), np.full(120, 0.002)
    world = HeightMap(HeightMapSettings(follow=1.0))
    world.add(points, std, 2.0)
    before = world.known()[0]
    points[:, 2] += 0.005
    assert world.add(points, std, 1.9) is None
    np.testing.assert_allclose(world.known()[0], before, atol=1e-12)
    # In time the map follows, and what it knows is again that of the frame.
    assert world.add(points, std, 2.0) == pytest.approx(0.005)
    np.testing.assert_allclose(world.known()[0][:, 2], before[:, 2] + 0.005, atol=1e-12)


def test_slots_that_belong_to_other_places_now_are_no_places_of_a_late_frame() -> None:
    """The grid has 128 cells of 20 mm a side: places 2.56 m apart share a slot."""
    for seen, kept in ((2.0, True), (1.0, False)):
        world = aging()
        world.add([[0.01 + 2.56, 0.01, 0.3]], [0.002], seen)
        world.add([[1.0, 1.0, 0.0]], [0.002], 2.0)
        world.add([[0.01, 0.01, 0.1]], [0.002], 1.5)
        assert np.isnan(cell_of(world)[0]) == kept
        assert np.isnan(cell_of(world, 2.57 + 0.01j)[0]) != kept
        if not kept:
            assert cell_of(world)[1] == pytest.approx(0.002)  # as a place that was never seen


def test_heights_grow_old_as_before_once_the_clock_begins_anew() -> None:
    """All have been seen at the new time; every half a second their ages are looked at."""
    world = aging()
    world.add([[0.01, 0.01, 0.1]], [0.003], 50.0)
    world.rewind(2.0)
    for time in (2.6, 3.2):
        world.add([[1.0, 1.0, 0.0]], [0.003], time)
        assert cell_of(world)[0] == pytest.approx(0.1)
        assert cell_of(world)[1] == pytest.approx(math.sqrt(0.003**2 + WANDER**2 * (time - 2.0)), rel=1e-9)
    world.add([[0.01, 0.01, 0.1]], [0.003], 2.0)  # late, by its own clock
    assert cell_of(world)[1] < 0.003


def test_clouds_are_placed_by_the_poses_since_the_clock_began_anew() -> None:
    robot = DESCRIPTION.robot()
    ground, start = moved_ground((40.0, 41.0))
    q = ROBOT.half_sitting.copy()
    for time in (0.0, 0.1):
        robot.update(q, np.zeros(robot.nv))
        ground.update(robot, time)
    for seen in (0.0, 0.05, 0.1):
        ground.add(PointCloud([[0.3, 0.1, -float(start.translation[2])]], seen, robot.base_frame))
        ground.update(robot, seen + 0.1)
    assert ground.status == ""
    (found,), _ = ground.map.known()
    assert np.abs(found[:2] - (start.translation + [0.3, 0.1, 0.0])[:2]).max() <= 0.0101
    assert found[2] == pytest.approx(0.0, abs=1e-9)
    ground._doubt("stance", "made up")
    assert ground.highest(0, np.zeros(2), np.ones(2), 0.0) == -math.inf
    assert ground.support(0, 0.0, 0.0, 0.0) is None
    assert ground.best(0, 0.0, 0.0, 0.0, lambda x, y: True) is None


# --- poses -------------------------------------------------------------------------------------------------------


def moved_ground(times: tuple[float, ...], **changes: float) -> tuple[KnownGround, pin.SE3]:
    """Ground that a robot knows which has gone to x = 0.4 t, and turned by 0.5 t, at some times; its base at zero."""
    ROBOT.update(ROBOT.half_sitting, np.zeros(ROBOT.nv))
    ground = KnownGround(ROBOT, GroundSettings(max_age=5.0, **changes))  # type: ignore[arg-type]
    start = ROBOT.placement(ROBOT.base_frame).copy()
    robot = DESCRIPTION.robot()
    for time in times:
        q = ROBOT.half_sitting.copy()
        q[0] += 0.4 * time
        q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, 0.5 * time)).coeffs()
        robot.update(q, np.zeros(robot.nv))
        ground.update(robot, time)
    return ground, start


@pytest.mark.parametrize(
    ("seen", "pose"), [(0.5, 0.5), (0.25, 0.25), (0.9, 0.9), (1.0, 1.0), (-0.5, 0.0), (1.015, 1.0)]
)
def test_a_cloud_is_placed_by_the_pose_between_those_about_its_time(seen: float, pose: float) -> None:
    """Before the first and after the last one by these."""
    ground, start = moved_ground((0.0, 1.0))
    point = np.array([0.3, 0.1, -float(start.translation[2])])
    ground.add(PointCloud([point], seen, ROBOT.base_frame))
    robot = DESCRIPTION.robot()
    q = ROBOT.half_sitting.copy()
    q[0] += 0.4
    robot.update(q, np.zeros(robot.nv))
    ground._fused = -math.inf
    ground._fuse(ground._waiting)
    c, s = math.cos(0.5 * pose), math.sin(0.5 * pose)
    # Interpolated along the screw motion from one pose to the other.
    one = pin.SE3(np.eye(3), start.translation)
    two = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.5), start.translation + [0.4, 0.0, 0.0])
    place = one * pin.exp6(pose * pin.log6(one.actInv(two)))
    assert place.rotation == pytest.approx(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    assert ground.status == ""
    (found,), _ = ground.map.known()
    assert np.abs(found[:2] - place.act(point)[:2]).max() <= 0.0101  # half a cell
    assert found[2] == pytest.approx(place.act(point)[2])


@pytest.mark.parametrize("level", [0.0, 5.0, -3.0])
def test_points_within_the_reach_of_a_leg_above_or_below_the_soles_are_taken(level: float) -> None:
    """A leg is as long as the centre of mass is over the lower sole, wherever the robot stands."""
    robot = DESCRIPTION.robot()
    q = ROBOT.half_sitting.copy()
    q[2] += level
    robot.update(q, np.zeros(robot.nv))
    soles = [robot.placement(sole.frame).translation for sole in robot.soles]
    leg, middle = float(robot.com[2]) - min(s[2] for s in soles), np.mean(soles, axis=0)
    assert 0.5 < leg < 1.0
    for share, taken in ((0.99, True), (-0.99, True), (1.01, False), (-1.01, False)):
        ground = KnownGround(robot)
        ground.update(robot, 1.0)
        ground.add(PointCloud([middle + [0.3, 0.1, share * leg]], 1.0, "world"))
        ground.update(robot, 1.0 + FUSED)
        assert len(ground.map.known()[0]) == taken
        if not taken:
            assert f"{abs(share) * leg:.4g} m away" in ground.status


def test_a_map_of_ones_own_follows_the_frames_that_move_what_is_known() -> None:
    """With the heights of the points, and with the sole that stands."""
    x = 0.01 + 0.02 * np.arange(120) - 1.0
    points = np.stack([x, 0.0 * x + 0.01, 0.0 * x], axis=1)
    ROBOT.update(ROBOT.half_sitting, np.zeros(ROBOT.nv))
    ground = KnownGround(ROBOT, GroundSettings(map=HeightMapSettings(follow=1.0)))
    ground.update(ROBOT, 0.0)
    ground.add(ElevationMap(np.zeros((200, 200)), 0.02, (-2.0, -2.0, 0.0)))
    aside = np.array([0.5 + 0.7j])
    for k, height in enumerate((0.0, 0.004, 0.009)):
        points[:, 2] = height
        ground.add(PointCloud(points, FUSED * k, "world", 0.002))
        ground.update(ROBOT, FUSED * (k + 1))
        assert ground.at(aside)[0] == pytest.approx([height])
        assert ground.at(points[:3, 0] + 0.01j)[0] == pytest.approx([height] * 3)


# --- soles -------------------------------------------------------------------------------------------------------


def ground_of(height, std: float = 0.0):
    """Ground of heights as a function of x and y, m."""
    return lambda places: (
        np.broadcast_to(height(places.real, places.imag), places.shape).astype(float),
        np.full(places.shape, std),
    )


def test_the_ground_over_a_sole_that_stands_is_lowered_by_its_deviations() -> None:
    """At places where it carries 95 % lie below, at most, and inside half lies below. Nodes are 20 by 12 mm apart."""
    foot = Footprint(LENGTH, WIDTH, FootprintSettings(trust=2.0))
    place = np.array([0.0, 0.0, 0.02])
    for std in (0.0, 0.004):
        low = -0.02 - 2.0 * std
        assert foot.over(ground_of(lambda x, y: 0.0 * x, std), place, np.eye(3)) == pytest.approx([low] * 3)
        tip = ground_of(lambda x, y: np.where(np.hypot(x, y) < 1e-6, 0.05, 0.0), std)
        assert foot.over(tip, place, np.eye(3)) == pytest.approx([low, low + 0.05, low])
        row = ground_of(lambda x, y: np.where(x > 0.09, 0.05, 0.0), std)  # the outermost of eleven rows
        assert foot.over(row, place, np.eye(3)) == pytest.approx([low + 0.05, low + 0.05, low])
        most = ground_of(lambda x, y: np.where(x > -0.03, 0.05, 0.0), std)
        assert foot.over(most, place, np.eye(3)) == pytest.approx([low + 0.05] * 3)


def test_a_stance_contradicts_by_its_depth_inside_or_its_height_over_all() -> None:
    """A sole that stands in the ground with its inside, or over all of it; beside an edge it does neither."""
    ROBOT.update(ROBOT.half_sitting, np.zeros(ROBOT.nv))
    sole = ROBOT.placement(ROBOT.soles[0].frame)
    x0, y0, z0 = sole.translation
    length = ROBOT.soles[0].length
    for heights, off in (
        (lambda i, j: 0.07 + 0.0 * i, 0.07),
        (lambda i, j: -0.07 + 0.0 * i, -0.07),
        (lambda i, j: np.where(i > x0 + 0.35 * length, 0.07, 0.0), None),  # a rim
        (lambda i, j: np.where(i > x0, 0.02, -0.2), None),  # half of it hangs
        (lambda i, j: np.where(i > x0 - 0.2 * length, 0.065, -0.2), 0.065),
    ):
        ground = KnownGround(ROBOT)
        ground.update(ROBOT, 0.0)
        i, j = np.meshgrid(
            0.01 * np.arange(120) + x0 - 0.595, 0.01 * np.arange(120) + y0 - 0.595, indexing="ij"
        )
        ground.add(ElevationMap(z0 + heights(i, j), 0.01, (x0 - 0.6, y0 - 0.6, 0.0)))
        ground.update(ROBOT, 0.1)
        ground.stand(0, sole)
        assert ground.status == (
            ""
            if off is None
            else f"the ground known under the {ROBOT.soles[0].name} sole is {off:+.3f} m from it"
        )


def test_the_tilt_of_a_landing_is_that_of_the_plane_on_which_it_rests_and_counts_more_across() -> None:
    """Of the slopes between which it chooses, in the mean over places of the load, which a plane does not change."""
    foot = Footprint(LENGTH, WIDTH, EXACT)
    u, v = foot._sole.real, foot._sole.imag
    for slope in (0.0, 0.11, -0.18, 0.26):
        low = np.array([slope * u, slope * v])
        wanted = abs(slope) * np.array([1.0, ACROSS])
        assert foot._mean_tilt(low, low.max(axis=1)) == pytest.approx(wanted, abs=0.25 * abs(slope) + 1e-9)


def test_an_edge_is_left_by_as_much_as_it_costs() -> None:
    """0.2 m/m of what the first contact differs within a node, against 2 mm and 0.15 m/m of the way."""
    anywhere = lambda x, y: True  # noqa: E731
    settings = {"trust": 0.0, "tilt_cost": 0.0, "distance": 0.15}
    for height, moved in ((0.0049 / 0.2, False), (0.0051 / 0.2, True)):
        # The rim of the sole meets the edge when it is moved by one node ahead; a node back none does.
        edge = ground_of(lambda x, y, h=height: np.where(x > 0.5 * LENGTH + 0.01, h, 0.0))
        found = Footprint(LENGTH, WIDTH, FootprintSettings(**settings)).best(edge, 0.0, 0.0, 0.0, anywhere)  # type: ignore[arg-type]
        assert found is not None and found.x == pytest.approx(-0.02 if moved else 0.0)
        free = Footprint(LENGTH, WIDTH, FootprintSettings(**settings, edge=0.0))  # type: ignore[arg-type]
        stays = free.best(edge, 0.0, 0.0, 0.0, anywhere)
        assert stays is not None and stays.x == 0.0


def test_no_sole_rests_over_a_high_edge_with_more_than_a_fifth_of_it() -> None:
    """Eleven rows of nodes: two of them may hang over 80 mm, three may not; lower edges do not count."""
    anywhere = lambda x, y: True  # noqa: E731
    settings = FootprintSettings(trust=0.0, tilt_cost=0.0, edge=0.0)
    for rows in (1, 2, 3, 4):
        for depth in (0.99 * HIGH, 1.01 * HIGH):
            at = 0.5 * LENGTH - 0.02 * (rows - 0.5)
            drop = ground_of(lambda x, y, at=at, d=depth: np.where(x > at, -d, 0.0))
            found = Footprint(LENGTH, WIDTH, settings).best(drop, 0.0, 0.0, 0.0, anywhere)
            assert found is not None
            back = 0.02 * max(0, rows - 2) if depth > HIGH else 0.0
            assert found.x == pytest.approx(-back) and found.z == pytest.approx(0.0)


@pytest.mark.parametrize(("std", "counts"), [(1.39 * 0.015, True), (1.41 * 0.015, False), (0.002, True)])
def test_cells_that_are_known_to_some_extent_move_the_map(std: float, counts: bool) -> None:
    """Up to 1.4 times the deviation from which on a height is unknown."""
    settings = HeightMapSettings(follow=1.0)
    assert settings.known == 0.015
    world, x = HeightMap(settings), 0.01 + 0.02 * np.arange(120) - 1.0
    points = np.stack([x, 0.0 * x + 0.01, 0.1 * x], axis=1)
    world.add(points, np.full(120, std), 0.0)
    points[:, 2] += 0.005
    shift = world.add(points, np.full(120, 0.002), 0.0)
    assert shift == (pytest.approx(0.005) if counts else None)


@pytest.mark.parametrize("place", [(0.0, 3.0), (-2.0, -4.0), (5.0, 0.5)])
def test_points_near_the_feet_are_taken_wherever_the_robot_stands(place: tuple[float, float]) -> None:
    """Within 45 % of 2.56 m along x and along y from the middle of the soles; others are too far away."""
    robot = DESCRIPTION.robot()
    q = ROBOT.half_sitting.copy()
    q[:2] += place
    robot.update(q, np.zeros(robot.nv))
    middle = np.mean([robot.placement(sole.frame).translation for sole in robot.soles], axis=0)
    half = 0.45 * 2.56
    for way in ([1.0, 0.2], [-1.0, 0.2], [0.2, 1.0], [0.2, -1.0]):
        for share, taken in ((0.99, True), (1.01, False)):
            ground = KnownGround(robot)
            ground.update(robot, 1.0)
            ground.add(PointCloud([middle + [*(share * half * np.array(way)), 0.01]], 1.0, "world"))
            ground.update(robot, 1.0 + FUSED)
            assert len(ground.map.known()[0]) == taken
            assert (f"{share * half:.4g} m away" in ground.status) == (not taken)
