"""The map is the ground, within its noise, wherever the world lies; wrong knowledge is not used."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from properties import by_default

from wbc.base.errors import InputError
from wbc.ground import ElevationMap, HeightMap, KnownGround, PointCloud
from wbc.ground.cloud import SEEN
from wbc.ground.footprint import Footprint, FootprintSettings
from wbc.ground.height_map import HeightMapSettings
from wbc.ground.known import FUSED, MOST, GroundSettings
from wbc.robots import load

NOISE = 0.004


def frame(height, seed, n=4000, low=(-0.6, -0.6), high=(0.6, 0.6)):
    """Points of a ground z(x, y), m, seen with noise, and their standard deviations."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(low, high, (n, 2)).T
    return np.stack([x, y, height(x, y) + NOISE * random.standard_normal(n)], axis=1), np.full(n, NOISE)


def mapped(height, frames=6, turn=None):
    world = HeightMap(origin=(0.0, 0.0, 0.0) if turn is None else (*turn.translation[:2], _yaw(turn)))
    for k in range(frames):
        points, std = frame(height, k)
        if turn is not None:
            points = points @ turn.rotation.T + turn.translation
        world.add(points, std, 0.08 * k)
    return world


def _yaw(placement):
    return math.atan2(placement.rotation[1, 0], placement.rotation[0, 0])


def known(robot=None):
    robot = robot or load("hrp4_class").robot()
    robot.update(robot.half_sitting, np.zeros(robot.nv))
    ground = KnownGround(robot)
    ground.update(robot, 0.0)
    return robot, ground


@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.5, 0.5))
@settings(max_examples=8, deadline=None)
def test_a_plane_is_mapped_within_noise(a, b, level):
    world = mapped(lambda x, y: level + a * x + b * y)
    points, std = world.known()
    error = points[:, 2] - (level + a * points[:, 0] + b * points[:, 1])
    assert len(points) > 3000
    # Within a cell the points are not in its middle: the slope adds to the noise.
    assert np.abs(error).max() < 6.0 * NOISE + 0.02 * math.hypot(a, b)
    assert np.sqrt(np.mean(error**2)) < NOISE
    assert (std < NOISE).mean() > 0.95


@given(st.floats(0.03, 0.08), st.floats(-0.1, 0.1), st.floats(-math.pi, math.pi))
@settings(max_examples=4, deadline=None)
def test_a_sole_meets_a_stone_at_its_top(rise, at, yaw):
    def height(x, y):
        return np.where(np.hypot(x - at, y) < 0.05, rise, 0.0)

    support = Footprint(0.24, 0.1).support(mapped(height).at, at, 0.0, yaw)
    assert support is not None
    assert support.z == pytest.approx(rise, abs=2.0 * NOISE)
    assert Footprint(0.24, 0.1).highest(mapped(height).at, np.array([at + 0j]), yaw) == pytest.approx(
        rise, abs=3.0 * NOISE
    )


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-math.pi, math.pi))
@settings(max_examples=4, deadline=None)
def test_a_moved_and_turned_world_has_the_same_map(dx, dy, yaw):
    def height(x, y):
        return 0.05 * np.sin(12.0 * x) + np.where(y > 0.1, 0.04, 0.0)

    turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), np.array([dx, dy, 0.0]))
    here, there = mapped(height), mapped(height, turn=turn)
    foot = Footprint(0.24, 0.1)
    for x, y, heading in ((0.0, 0.0, 0.0), (0.2, -0.1, 0.3), (-0.15, 0.1, -0.2)):
        one = foot.best(here.at, x, y, heading, lambda x, y: True)
        place = turn.act(np.array([x, y, 0.0]))
        two = foot.best(there.at, *place[:2], heading + yaw, lambda x, y: True)
        assert one is not None and two is not None
        # A point on the very border of a cell may fall to either side of it in the turned world.
        assert two.z == pytest.approx(one.z, abs=1e-3)
        assert turn.actInv(np.array([two.x, two.y, 0.0]))[:2] == pytest.approx((one.x, one.y), abs=1e-6)


def test_what_disappears_is_forgotten_and_what_appears_is_there_at_once():
    def stone(x, y):
        return np.where(np.hypot(x, y) < 0.1, 0.06, 0.0)

    world = mapped(stone)
    flat = [frame(lambda x, y: 0.0 * x, 10 + k) for k in range(40)]
    places = np.array([0.03 + 0.03j, -0.03 + 0.01j, 0.01 - 0.05j])
    heights = []
    for k, (points, std) in enumerate(flat):
        world.add(points, std, 0.5 + 0.08 * k)
        heights.append(world.at(places)[0])
    assert heights[0] == pytest.approx([0.06] * 3, abs=0.01)
    assert np.isnan(heights).any()  # doubted in between
    assert heights[-1] == pytest.approx([0.0] * 3, abs=0.01)
    world.add(*frame(stone, 99, n=40_000), 4.0)
    assert world.at(places)[0] == pytest.approx([0.06] * 3, abs=0.01)


def test_the_grid_rolls_with_the_robot():
    world = HeightMap()
    for k in range(40):
        points, std = frame(lambda x, y: 0.1 * x, k, low=(0.1 * k - 0.5, -0.5), high=(0.1 * k + 0.5, 0.5))
        world.add(points, std, 0.1 * k)
    z, _ = world.at(np.array([3.9 + 0j, 0.0 + 0j]))
    assert z[0] == pytest.approx(0.39, abs=0.01)
    assert np.isnan(z[1])  # its cell belongs to another place now


@pytest.mark.parametrize(
    ("edge", "rise", "along"), [(0.05, 0.03, True), (-0.04, 0.02, True), (0.01, 0.02, False)]
)
def test_the_resting_plane_is_that_of_a_sole_pressed_down(edge, rise, along):
    """A plate is pressed on a block that lies under a part of it, and tilts as the footprint says."""
    length, width = 0.26, 0.11
    side = (0.5, 0.5, 0.5 * rise)
    at = (edge + 0.5, 0.0, 0.5 * rise) if along else (0.0, edge + 0.5, 0.5 * rise)
    size, place = (" ".join(f"{v}" for v in values) for values in (side, at))
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" gravity="0 0 -9.81"/><worldbody>
        <geom type="plane" size="2 2 0.1" friction="1"/>
        <geom type="box" size="{size}" pos="{place}" friction="1"/>
        <body pos="0 0 {rise + 0.012}"><freejoint/>
        <geom type="box" size="{length / 2} {width / 2} 0.01" mass="1" friction="1"/></body>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    for _ in range(3000):
        data.xfrc_applied[1, 2] = -20.0
        mujoco.mj_step(model, data)
    normal = data.xmat[1].reshape(3, 3)[:, 2]
    pressed = -normal[0] / normal[2], -normal[1] / normal[2]

    def ground(places):
        offset = places.real if along else places.imag
        return np.where(offset > edge, rise, 0.0), np.zeros(places.size)

    support = Footprint(length, width, FootprintSettings(tilt=0.4)).support(ground, 0.0, 0.0, 0.0)
    assert support is not None
    assert support.slope == pytest.approx(pressed, abs=0.06)  # spacing of planes and of nodes


def test_a_quiet_place_is_chosen_and_only_where_it_is_allowed():
    def ridge(places):
        return np.where(np.abs(places.real - 0.02) < 0.011, 0.04, 0.0), np.full(places.size, 1e-3)

    def edge(places):
        return np.where(places.imag > 0.03, 0.05, 0.0), np.full(places.size, 1e-3)

    foot = Footprint(0.26, 0.11)
    quiet = foot.best(edge, 0.0, 0.0, 0.0, lambda x, y: True)
    assert quiet is not None and abs(quiet.y) > 0.01
    outer = foot.best(edge, 0.0, 0.0, 0.0, lambda x, y: y > -1e-9)
    assert outer is not None and outer.y >= 0.0
    stays = foot.best(edge, 0.0, 0.0, 0.0, lambda x, y: False)
    assert stays is not None and (stays.x, stays.y) == (0.0, 0.0)
    for x in np.linspace(-0.24, -0.12, 7).tolist():  # before a high stair, not at a third of its height
        stair = foot.best(
            lambda p: (np.where(p.real > 0.0, 0.1, 0.0), np.zeros(p.size)), x, 0.0, 0.0, lambda x, y: True
        )
        assert stair is not None and stair.z == pytest.approx(0.0)
    level = foot.best(lambda p: (np.zeros(p.size), np.zeros(p.size)), 0.3, 0.2, 0.4, lambda x, y: True)
    assert level is not None and (level.x, level.y, level.z) == pytest.approx((0.3, 0.2, 0.0))
    assert foot.highest(ridge, np.array([0.3 + 0j]), 0.0) < foot.highest(ridge, np.array([0j]), 0.0)


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
@settings(max_examples=2, deadline=None)
def test_a_frame_from_all_round_is_mapped_right_whatever_the_heading(yaw, ahead):
    """A robot begins at a heading; a lidar sees a plateau of 0.3 m beyond 0.9 m, and points as far as 4 m."""
    robot = load("g1").robot()
    q = robot.q.copy()
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, yaw)).coeffs()
    robot.update(q, np.zeros(robot.nv))
    ground = KnownGround(robot)
    x, y = (each.ravel() for each in np.meshgrid(np.arange(-4.0, 4.0, 0.015), np.arange(-4.0, 4.0, 0.015)))
    beyond = x * math.cos(ahead) + y * math.sin(ahead)
    z = np.where(beyond > 0.9, 0.3, 0.0)
    for k in range(24):  # of so many points a part is looked at in each tick
        ground.add(PointCloud(np.stack([x, y, z], axis=1), FUSED * k, "world"))
        ground.update(robot, FUSED * k)
    cells, _ = ground.map.known()
    beyond = cells[:, 0] * math.cos(ahead) + cells[:, 1] * math.sin(ahead) - 0.9
    inside = np.abs(beyond) > 0.03
    assert len(cells) > 9000
    np.testing.assert_allclose(cells[inside, 2], np.where(beyond[inside] > 0.0, 0.3, 0.0), atol=1e-9)


@pytest.mark.parametrize(
    ("seen", "word"),
    [
        (lambda p: PointCloud(1e3 * p, 0.0, "world"), "reach"),
        (lambda p: PointCloud(p, -3.0, "world"), "old"),
        (lambda p: PointCloud(p, 1.7e18, "world"), "another clock"),  # nanoseconds
        (lambda p: PointCloud(p, 0.0, "lidar"), "lidar"),
        (lambda p: ElevationMap(np.full((60, 60), np.nan), 0.02, (-0.6, -0.6, 0.0)), "heights"),
        (lambda p: ElevationMap(np.full((60, 60), -np.inf), 0.02, (-0.6, -0.6, 0.0)), "heights"),
        (lambda p: ElevationMap(np.zeros((60, 60)), 0.02, (-0.6, -0.6, 0.0), frame="odom"), "odom"),
        (lambda p: ElevationMap(np.zeros((60, 60)), 0.02, (-0.6, -0.6, 0.0), time=-9.0, max_age=1.0), "old"),
        (
            lambda p: ElevationMap(np.zeros((60, 60)), 0.02, (-0.6, -0.6, 0.0), time=1e300, max_age=1.0),
            "clock",
        ),
        (lambda p: ElevationMap(np.zeros((60, 60)), 0.02, (-0.6, -0.6, 0.0), frame="x" * 10_000), "xxx"),
        (lambda p: ElevationMap(np.full((60, 60), 40.0), 0.02, (-0.6, -0.6, 0.0)), "sole"),
        (lambda p: PointCloud(p + (0.0, 0.0, 0.2), 0.0, "world"), "sole"),
    ],
)
def test_what_cannot_be_right_is_not_used_and_is_named(seen, word):
    robot, ground = known()
    ground.add(seen(frame(lambda x, y: 0.0 * x, 0)[0]))
    ground.update(robot, 0.03)
    placement = robot.placement(robot.soles[0].frame)
    ground.stand(0, placement)
    assert word in ground.status and len(ground.status) < 200
    assert ground.support(1, 0.1, 0.0, 0.0) is None
    assert ground.best(1, 0.1, 0.0, 0.0, lambda x, y: True) is None
    assert ground.highest(1, np.zeros(2), np.ones(2), 0.0) == -math.inf


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: PointCloud(np.zeros((4, 2)), 0.0, "world"), "points"),
        (lambda: PointCloud(np.zeros((4, 3)), math.nan, "world"), "time"),
        (lambda: PointCloud(np.zeros((4, 3)), 0.0, "world", 0.0), "std"),
        (lambda: PointCloud([[1, 2, 3], [1, 2]], 0.0, "world"), "points"),
        (lambda: PointCloud([["a", "b", "c"]], 0.0, "world"), "points"),
        (lambda: PointCloud(np.zeros((4, 3), dtype=complex), 0.0, "world"), "points"),
        (lambda: PointCloud(np.zeros((4, 4)), 0.0, "world"), "leave out the columns"),
        (lambda: PointCloud(np.zeros(4, dtype=[("x", "f4"), ("z", "f4")]), 0.0, "world"), "y missing"),
        (
            lambda: PointCloud(np.zeros(4, [("x", "f4", 3), ("y", "f4"), ("z", "f4")]), 0.0, "world"),
            "one number",
        ),
        (lambda: PointCloud(np.zeros((4, 3)), 0.0, "world", np.full(5, 0.01)), "std"),
        (lambda: PointCloud(np.zeros((4, 3)), 0.0, "world", "small"), "std"),
        (lambda: PointCloud(np.zeros((4, 3)), 0.0, None), "frame"),
        (lambda: PointCloud(np.zeros((4, 3)), 0.0, "\ud800"), "frame"),
        (lambda: PointCloud(np.zeros((4, 3)), 0.0, "a\0b"), "frame"),
        (lambda: PointCloud(np.zeros((4, 3)), "now", "world"), "time"),
        (lambda: ElevationMap(np.zeros((5, 5)), 0.02, max_age=None), "max_age"),
        (lambda: ElevationMap(np.zeros((5, 5)), 0.02, max_age=math.nan), "max_age"),
        (lambda: ElevationMap(np.zeros((5, 5)), 0.02, frame=7), "frame"),
        (lambda: ElevationMap([["low"]], 0.02), "heights"),
        (lambda: ElevationMap(np.zeros((5, 5)), 0.02, (0.0, 0.0, 90.0)), "pose"),
        (lambda: ElevationMap(np.zeros(5), 0.02), "heights"),
        (lambda: ElevationMap(np.zeros((5, 5)), 0.0), "cell"),
        (lambda: known()[1].add(ElevationMap(np.zeros((5, 5)), 0.02)), "sole"),
        (lambda: known()[1].add(np.zeros((5, 3))), "PointCloud"),
        (lambda: GroundSettings(max_age=0.0), "max_age"),
        (lambda: HeightMapSettings(cell=0.001), "cell"),
        (lambda: HeightMapSettings(cell=0.5), "cell"),
        (lambda: HeightMapSettings(follow=1.5), "follow"),
        (lambda: HeightMap().add([[0.0, 0.0, math.nan]], [0.01], 0.0), "points of HeightMap.add"),
        (lambda: HeightMap().add(np.zeros((3, 2)), np.ones(3), 0.0), "points and std"),
        (lambda: HeightMap().add(np.zeros((3, 3)), np.ones(2), 0.0), "points and std"),
        (lambda: HeightMap().add(np.zeros((3, 3)), -np.ones(3), 0.0), "std of HeightMap.add"),
        (lambda: HeightMap().at([0.1]), "places on a height map"),  # type: ignore[arg-type]
        (lambda: HeightMap().at("here"), "places on a height map"),  # type: ignore[arg-type]
        (lambda: HeightMap().at(np.zeros((2, 2), complex)), "places on a height map"),
        (lambda: HeightMap().at(np.array([complex(math.nan, 0.0)])), "places on a height map"),
        (lambda: HeightMap().shift(math.nan), "height of HeightMap.shift"),
        (lambda: HeightMap().rewind("now"), "time of HeightMap.rewind"),
    ],
)
def test_bad_input_is_named(make, name):
    with pytest.raises(InputError, match=name):
        make()


@pytest.mark.parametrize("std", [1e-300, 1e300])
def test_a_cloud_of_any_accuracy_is_fused(std):
    robot, ground = known()
    points = frame(lambda x, y: 0.0 * x, 0)[0]
    for k in range(3):
        ground.add(PointCloud(points, FUSED * k, "world", std))
        ground.update(robot, FUSED * k)
    assert np.isfinite(ground.map.known()[0]).all()


@pytest.mark.parametrize("shape", [(12,), (3, 4)])
def test_a_cloud_with_named_fields_is_read_by_its_fields(shape):
    """As ROS gives clouds: fields of other types among them, organised in rows or not."""
    kinds = [("intensity", "u1"), ("x", "f4"), ("y", "f8"), ("z", "f4"), ("ring", "u2")]
    fields = np.zeros(shape, dtype=kinds)
    fields["x"], fields["z"] = np.arange(12).reshape(shape), 0.5
    fields["y"].flat[3] = np.nan
    points = PointCloud(fields, 0.0, "world", np.full(12, 0.01)).points
    np.testing.assert_array_equal(points[:, 0], np.delete(np.arange(12), 3))
    assert (points[:, 2] == 0.5).all()


def test_of_a_large_cloud_no_more_than_a_part_is_ever_looked_at():
    """Ten million million points, in no memory; and among those that are taken, lost returns are left out."""
    huge = np.broadcast_to(np.float32([0.3, 0.1, 0.0]), (10**13, 3))
    cloud = PointCloud(huge, 0.0, "world", np.broadcast_to(np.float64(0.01), len(huge)))
    assert cloud.points.shape == (SEEN, 3) and cloud.std.shape == (SEEN,)
    robot, ground = known()
    ground.add(cloud)
    ground.update(robot, FUSED)
    assert ground.status == "" and len(ground.map.known()[0]) == 1
    points = np.zeros((8 * SEEN, 3))
    points[::2, 0], points[:, 1] = np.nan, np.arange(len(points))
    first, second = (PointCloud(points, time, "world").points for time in (0.1, 0.2))
    assert np.isfinite(first).all() and 0.4 * SEEN < len(first) < 0.6 * SEEN
    assert not np.isin(first[:, 1], second[:, 1]).all()  # others at another time
    for wrong in (points.astype(str), points.astype(complex), points.astype(bool), points[:, :2], points.T):
        with pytest.raises(InputError, match="points of a cloud"):
            PointCloud(wrong, 0.0, "world")
    with pytest.raises(InputError, match="std"):
        PointCloud(points, 0.0, "world", np.zeros(len(points)))


@pytest.mark.parametrize(("edge", "height"), [(0.5, 0.0), (0.24, 0.15)])
def test_a_sole_that_stands_beside_an_edge_or_on_it_contradicts_nothing(edge, height):
    """A step of 150 mm lies under the rim of a sole that stands below it, or under half of one that stands on it."""
    robot, ground = known()
    sole = robot.soles[0]
    placement = robot.placement(sole.frame).copy()
    placement.translation[2] = height
    heights = np.zeros((100, 100))
    heights[:, round((1.0 + edge * sole.width - 0.018) / 0.02) :] = 0.15
    ground.add(ElevationMap(heights, 0.02, (*(placement.translation[:2] - 1.0), 0.0)))
    ground.update(robot, 0.03)
    ground.stand(0, placement)
    assert ground.status == ""
    assert ground.support(0, *placement.translation[:2], 0.0) is not None


@pytest.mark.parametrize("size", by_default([MOST, MOST + 1, 20_000, 640 * 480], MOST + 1, 20_000))
def test_of_a_large_cloud_a_tick_looks_at_a_part_that_is_spread_over_all_of_it(size, monkeypatch):
    """In the order of the rows of an image as well, whatever their number; the map is the ground all the same."""
    columns = 640 if size % 640 == 0 else size
    across, down = np.meshgrid(
        np.linspace(-0.6, 0.6, columns), np.linspace(-0.6, 0.6, max(size // columns, 1))
    )
    if columns == size:
        across, down = frame(lambda x, y: 0.0 * x, 0, size)[0][:, :2].T
    points = np.stack([across.ravel(), down.ravel(), 0.1 * across.ravel()], axis=1)
    robot, ground = known()
    looked, place = [], ground._placed

    def counted(cloud, share):
        points, why = place(cloud, share)
        looked[-1] += len(points)
        return points, why

    monkeypatch.setattr(ground, "_placed", counted)
    for k in range(1, 13):
        looked.append(0)
        for _ in range(3):
            ground.add(PointCloud(points, FUSED * k, "world", NOISE))
        ground.update(robot, FUSED * k)
    assert max(looked) <= MOST + 3 and max(looked) >= min(size, MOST) - 3
    seen, _ = ground.map.known()
    assert np.abs(seen[:, 2] - 0.1 * seen[:, 0]).max() < 0.005
    inside = (np.abs(seen[:, :2]) < 0.59).all(axis=1)
    quadrants = np.histogram2d(*seen[inside, :2].T, bins=4)[0]
    assert quadrants.min() > 0.5 * quadrants.max()


def test_a_map_is_doubted_from_when_it_is_given_until_another_one_comes():
    robot, ground = known()
    flat, place = np.zeros((100, 100)), np.array([0.5 + 0.1j])
    early = KnownGround(robot)  # no clock yet
    early.add(ElevationMap(flat, 0.02, (-1.0, -1.0, 0.0), time=7.0, max_age=0.5))
    assert not early.status
    ground.add(ElevationMap(flat, 0.02, (-1.0, -1.0, 0.0), frame="odom"))
    assert "odom" in ground.status and np.isnan(ground.at(place)[0]).all()
    good = ElevationMap(flat, 0.02, (-1.0, -1.0, 0.0))
    ground.add(good)
    assert not ground.status and ground.at(place)[0] == 0.0
    sole = robot.placement(robot.soles[0].frame)
    ground.stand(0, pin.SE3(sole.rotation, np.array([*sole.translation[:2], 0.01])))
    raised, version = ground.at(place)[0], ground.version
    assert raised == pytest.approx(0.007)  # by 0.7 of the difference to the sole that stands
    ground.add(good)  # the same map again
    assert ground.at(place)[0] == raised and ground.version == version


def test_a_cloud_keeps_its_points_when_their_arrays_are_used_again():
    points, std = np.ones((10, 3)), np.full(10, NOISE)
    cloud = PointCloud(points, 0.0, "world", std)
    points[:], std[:] = 7.0, 1.0
    assert (cloud.points == 1.0).all() and (cloud.std == NOISE).all()


def test_knowledge_made_with_another_robot_is_refused():
    _, ground = known()
    g1 = load("g1").robot()
    with pytest.raises(InputError, match="'g1', not with"):
        ground.check_robot(g1)
    ground.check_robot(known()[0])
