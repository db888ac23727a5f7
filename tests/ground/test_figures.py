"""Figures of what is known of the ground: fused heights and variances, the robot's own body, soles on known ground."""

from __future__ import annotations

import math
import re

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from wbc.core.limits.obstacles import CollisionCapsule, CollisionSphere
from wbc.ground import ElevationMap, HeightMap, KnownGround, PointCloud
from wbc.ground.body import ANKLE, OwnBody
from wbc.ground.cloud import spread
from wbc.ground.footprint import HIGH, LOADS, NODE, Footprint, FootprintSettings
from wbc.ground.height_map import REFRESH, HeightMapSettings
from wbc.ground.known import AHEAD, FUSED, WAITING, GroundSettings
from wbc.robots import load

ROBOT = load("hrp4_class").robot()
ROBOT.update(ROBOT.half_sitting, np.zeros(ROBOT.nv))
SINGLE = HeightMapSettings(shared=10**6)
"""Settings of a map that no frame moves."""


# --- clouds and maps -------------------------------------------------------------------------------------------------


@given(st.integers(1, 100_000), st.integers(1, 3000), st.integers(0, 1008))
@examples(40)
def test_numbers_that_are_taken_are_spread_evenly_over_all(count: int, most: int, turn: int) -> None:
    """One of each of `most` equal parts, in order; all where there are no more."""
    taken = np.arange(count)[spread(count, most, turn)]
    assert len(taken) == min(count, most)
    parts = np.arange(len(taken)) * count / len(taken)
    assert (
        (taken >= np.floor(parts)).all() and (taken <= parts + count / len(taken)).all() and taken[-1] < count
    )
    if count > 20 * most:
        other = np.arange(count)[spread(count, most, turn + 1)]
        assert not np.array_equal(taken, other)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.01, 0.1))
@examples(20)
def test_a_map_of_ones_own_has_its_heights_in_its_cells(x: float, y: float, yaw: float, cell: float) -> None:
    heights = np.random.default_rng(0).normal(size=(7, 4))
    heights[2, 1] = np.nan
    known = ElevationMap(heights, cell, (x, y, yaw))
    i, j = (each.ravel() for each in np.meshgrid(np.arange(-1, 8), np.arange(-1, 5), indexing="ij"))
    for share in (0.05, 0.5, 0.95):
        u, v = (i + share) * cell, (j + share) * cell
        places = complex(x, y) + (u + 1j * v) * np.exp(1j * yaw)
        inside = (i >= 0) & (i < 7) & (j >= 0) & (j < 4)
        expected = np.where(inside, heights[np.clip(i, 0, 6), np.clip(j, 0, 3)], np.nan)
        np.testing.assert_array_equal(known.heights_at(places), expected)


# --- heights --------------------------------------------------------------------------------------------------------


@given(
    st.floats(-0.2, 0.2),
    st.floats(1e-3, 6e-3),
    st.floats(1e-3, 6e-3),
    st.floats(0.0, 2.0),
    st.floats(-1.0, 1.0),
)
@examples(40)
def test_two_readings_of_a_cell_are_fused_by_their_variances(
    z: float, first: float, second: float, pause: float, share: float
) -> None:
    """The filter of one state: the first has grown by wander² t, and both count by the inverse of their variance."""
    world = HeightMap(SINGLE)
    grown = first**2 + world.settings.wander**2 * pause
    other = z + share * 2.9 * math.sqrt(grown + second**2)
    world.add([[0.01, 0.01, z]], [first], 1.0)
    assert world.add([[0.012, 0.008, other]], [second], 1.0 + pause) is None
    weight = 1.0 / grown + 1.0 / second**2
    (height,), (std,) = world.at(np.array([0.01 + 0.01j]))
    assert std == pytest.approx(weight**-0.5, rel=1e-9)
    assert height == pytest.approx((z / grown + other / second**2) / weight, abs=1e-12)
    (point,), _ = world.known()
    np.testing.assert_allclose(point[:2], [0.01, 0.01], atol=1e-12)  # the centre of the cell


def test_a_higher_surface_is_there_at_once_and_a_lower_one_after_it_was_seen_again_and_again() -> None:
    """The gate is three deviations and 6 mm. The variance of what is doubted grows to 1.5 times as much and 1e-5 m²."""
    std, gate = 0.003, 3.0 * 0.003 * math.sqrt(2.0) + 0.006
    for step, replaced, doubted in (
        (1.01 * gate, True, False),
        (0.99 * gate, False, False),
        (-0.99 * gate, False, False),
        (-1.01 * gate, False, True),
    ):
        world = HeightMap(SINGLE)
        world.add([[0.0, 0.0, 0.1]], [std], 0.0)
        world.add([[0.0, 0.0, 0.1 + step]], [std], 0.0)
        (height,), (found,) = world.at(np.array([0j]))
        if replaced:
            assert (height, found) == (pytest.approx(0.1 + step), pytest.approx(std))
        elif doubted:
            assert (height, found) == (pytest.approx(0.1), pytest.approx(math.sqrt(1.5 * std**2 + 1e-5)))
        else:
            assert (height, found) == (pytest.approx(0.1 + 0.5 * step), pytest.approx(std / math.sqrt(2.0)))


def test_of_two_surfaces_in_a_cell_the_upper_one_counts() -> None:
    """Points count as of one surface within four deviations and 6 mm; else the mean of those above the mean."""
    std = 0.002
    most = 4.0 * std + 0.006
    for high, apart in ((0.99 * most, False), (1.01 * most, True)):
        world = HeightMap(SINGLE)
        z = [0.0, 0.0, 0.9 * high, high]
        world.add([[0.01, 0.01, each] for each in z], [std] * 4, 0.0)
        (height,), (found,) = world.at(np.array([0.01 + 0.01j]))
        assert height == pytest.approx(0.95 * high if apart else 0.475 * high)
        assert found == pytest.approx(std / math.sqrt(2.0 if apart else 4.0))


def test_a_height_is_known_until_its_deviation_has_grown() -> None:
    """√(0.004² + 0.002² t) is 15 mm after 52.25 s; ages are looked at again every half a second."""
    young = HeightMap(SINGLE)
    young.add([[0.0, 0.0, 0.1]], [0.004], 0.0)
    for time, age in ((0.499, 0.0), (0.5, 0.5), (0.999, 0.5), (1.0, 1.0)):
        young.add([[1.0, 1.0, 0.0]], [0.004], time)
        assert young.at(np.array([0j]))[1][0] == pytest.approx(math.sqrt(0.004**2 + 0.002**2 * age), rel=1e-9)
    world = HeightMap(SINGLE)
    world.add([[0.0, 0.0, 0.1]], [0.004], 0.0)
    lost = (0.015**2 - 0.004**2) / 0.002**2
    for time, known in ((lost - 0.01, True), (lost + 0.01 + REFRESH, False)):
        world.add([[1.0, 1.0, 0.0]], [0.004], time)
        (height,), (std,) = world.at(np.array([0j]))
        assert np.isfinite(height) == known and std == pytest.approx(math.sqrt(0.004**2 + 0.002**2 * time))
    world.add([[0.5, 0.5, 0.0]], [0.0151], time)
    world.add([[0.7, 0.7, 0.3]], [0.0149], time)
    assert np.isnan(world.at(np.array([0.5 + 0.5j]))[0][0]) and world.at(np.array([0.7 + 0.7j]))[0][0] == 0.3


@pytest.mark.parametrize(("count", "follow"), [(99, 1.0), (100, 1.0), (150, 0.5)])
def test_a_map_is_shifted_to_a_frame_that_shares_a_hundred_cells_with_it(count: int, follow: float) -> None:
    """By the median difference, times `follow`; what nobody sees again is shifted as well."""
    world = HeightMap(HeightMapSettings(follow=follow))
    x = 0.01 + 0.02 * np.arange(count) - 1.0
    points = np.stack([x, 0.0 * x + 0.01, 0.1 * x], axis=1)
    world.add(np.vstack([points, [[0.01, 0.51, 0.2]]]), np.full(count + 1, 0.002), 0.0)
    points[:, 2] += 0.005
    shift = world.add(points, np.full(count, 0.002), 0.0)
    aside = world.at(np.array([0.01 + 0.51j]))[0][0]
    if count < 100:
        assert shift is None and aside == pytest.approx(0.2)
    else:
        assert shift == pytest.approx(0.005 * follow) and aside == pytest.approx(0.2 + 0.005 * follow)
    world.shift(0.03)
    assert world.at(np.array([0.01 + 0.51j]))[0][0] == pytest.approx(aside + 0.03)
    world.add([[0.01, 0.51, aside + 0.028]], [0.002], 0.0)  # as exact as what is known
    assert world.at(np.array([0.01 + 0.51j]))[0][0] == pytest.approx(aside + 0.029)


@given(
    st.floats(-40.0, 40.0), st.floats(-40.0, 40.0), st.floats(-3.0, 3.0), st.sampled_from([0.01, 0.02, 0.05])
)
@examples(20)
def test_cells_lie_on_a_grid_about_the_origin_with_its_heading(
    x: float, y: float, yaw: float, cell: float
) -> None:
    world = HeightMap(HeightMapSettings(cell=cell, shared=10**6), (x, y, yaw))
    i, j = np.meshgrid(np.arange(-20, 20), np.arange(-20, 20))
    centres = complex(x, y) + cell * ((i + 0.5) + 1j * (j + 0.5)).ravel() * np.exp(1j * yaw)
    z = np.arange(centres.size) * 1e-3
    world.add(np.stack([centres.real, centres.imag, z], axis=1), np.full(z.size, 0.002), 0.0)
    found, _ = world.known()
    order = np.argsort(found[:, 2])
    np.testing.assert_allclose(found[order], np.stack([centres.real, centres.imag, z], axis=1), atol=1e-7)
    near = centres + 0.49 * cell * np.exp(1j * (yaw + 0.7))
    np.testing.assert_array_equal(world.at(near)[0], z)
    middle = complex(x + 3.0, y - 2.0)
    for share, held in ((0.449, True), (0.451, False)):
        places = middle + share * 128 * cell * np.array([1.0, -1.0, 1j, -1j]) * np.exp(1j * yaw)
        assert (world.holds(places, middle) == held).all()


# --- the robot's own body ---------------------------------------------------------------------------------------------


@given(st.integers(0, 1000))
@examples(10)
def test_points_on_the_body_are_those_within_its_shapes_and_over_its_soles(seed: int) -> None:
    """Distances from capsules and spheres, and places in the boxes of the soles, one by one."""
    rng, margin = np.random.default_rng(seed), 0.03
    robot = load("hrp4_class").robot()
    links = ["base_link" if robot.model.existFrame("base_link") else robot.base_frame, robot.soles[0].frame]
    shapes = {
        links[0]: [
            CollisionSphere(0.1, tuple(rng.normal(0.0, 0.1, 3))),
            CollisionCapsule(0.05, (0.0, 0.0, 0.0), (0.0, 0.3, 0.1)),
        ],
        links[1]: [CollisionCapsule(0.04, tuple(rng.normal(0.0, 0.1, 3)), tuple(rng.normal(0.0, 0.3, 3)))],
    }
    q = robot.half_sitting.copy()
    q[3:7] = pin.Quaternion(pin.exp3(0.3 * rng.normal(size=3))).coeffs()
    pin.framesForwardKinematics(robot.model, robot.data, q)
    body = OwnBody(robot, shapes, margin)
    centre = robot.data.oMf[robot.frame_id(links[0])].translation
    points = np.concatenate(
        [centre + rng.normal(0.0, 0.4, (1500, 3))]
        + [
            robot.data.oMf[robot.frame_id(s.frame)].translation + rng.normal(0.0, 0.15, (1500, 3))
            for s in robot.soles
        ]
    )
    gaps = []
    for link, own in shapes.items():
        place = robot.data.oMf[robot.frame_id(link)]
        for shape in own:
            ends = (
                (shape.centre, shape.centre)
                if isinstance(shape, CollisionSphere)
                else (shape.start, shape.end)
            )
            a, b = (place.act(np.asarray(end, dtype=float)) for end in ends)
            way = (b - a) @ (b - a)
            share = np.clip((points - a) @ (b - a) / way, 0.0, 1.0) if way > 0.0 else np.zeros(len(points))
            gaps.append(np.linalg.norm(points - a - share[:, None] * (b - a), axis=1) - shape.radius - margin)
    for sole in robot.soles:
        place = robot.data.oMf[robot.frame_id(sole.frame)]
        local = np.abs((points - place.translation) @ place.rotation)
        gaps.append((local - [0.5 * sole.length + margin, 0.5 * sole.width + margin, ANKLE]).max(axis=1))
    nearest = np.min(gaps, axis=0)
    clear = np.abs(nearest) > 2e-4  # single precision
    off = body.off(robot.data, points)
    np.testing.assert_array_equal(off[clear], nearest[clear] > 0.0)
    assert 0.05 < off.mean() < 0.95
    singly = [body.off(robot.data, point[None]).item() for point in points[::100]]
    np.testing.assert_array_equal(singly, off[::100])
    bare = OwnBody(robot, {}, margin).off(robot.data, points)
    soles = np.min(gaps[-2:], axis=0)
    np.testing.assert_array_equal(bare[np.abs(soles) > 1e-9], (soles > 0.0)[np.abs(soles) > 1e-9])


# --- soles ------------------------------------------------------------------------------------------------------------

EXACT = FootprintSettings(trust=0.0)


def flat(height: float):
    """Ground of one height, exactly known."""
    return lambda places: (np.full(places.shape, height), np.zeros(places.shape))


@given(
    st.floats(0.1, 0.4),
    st.floats(0.06, 0.2),
    st.floats(-3.0, 3.0),
    st.floats(-2.0, 2.0),
    st.floats(-2.0, 2.0),
)
@examples(20)
def test_a_sole_asks_for_the_ground_under_all_of_it_in_even_nodes(
    length: float, width: float, yaw: float, x: float, y: float
) -> None:
    asked: list[np.ndarray] = []

    def ground(places: np.ndarray):
        asked.append(places)
        return np.zeros(places.shape), np.zeros(places.shape)

    foot = Footprint(length, width, EXACT)
    foot.highest(ground, np.array([complex(x, y)]), yaw)
    local = (asked[0] - complex(x, y)) * np.exp(-1j * yaw)
    along, across = np.unique(local.real.round(9)), np.unique(local.imag.round(9))
    for values, extent, node in ((along, length, NODE[0]), (across, width, NODE[1])):
        count = max(round(extent / node), 2) + 1
        np.testing.assert_allclose(values, np.linspace(-0.5, 0.5, count) * extent, atol=1e-8)
    assert local.size == along.size * across.size
    foot.support(ground, x, y, yaw)  # and one node more on each side
    around = (asked[1] - complex(x, y)) * np.exp(-1j * yaw)
    assert np.unique(around.real.round(9)).size == along.size + 2
    assert around.real.max() == pytest.approx(0.5 * length + length / (along.size - 1))
    assert around.imag.min() == pytest.approx(-0.5 * width - width / (across.size - 1))


def test_the_first_contact_is_the_mean_over_small_errors_of_the_place() -> None:
    """A tip under the middle counts in full; an edge under the outermost nodes by two thirds, beside them by one."""
    length, width = 0.2, 0.096
    foot = Footprint(length, width, EXACT)

    def edge(at: float):
        return lambda places: (np.where(places.real > at, 0.03, 0.0), np.zeros(places.shape))

    for at, share in (
        (-1.0, 1.0),
        (0.0, 1.0),
        (0.07, 1.0),
        (0.09, 2.0 / 3.0),
        (0.11, 1.0 / 3.0),
        (0.13, 0.0),
    ):
        found = foot.support(edge(at), 0.0, 0.0, 0.0)
        assert found is not None and found.z == pytest.approx(0.03 * share), at
    tip = lambda places: (np.where(np.abs(places) < 1e-6, 0.02, 0.0), np.zeros(places.shape))  # noqa: E731
    found = foot.support(tip, 0.0, 0.0, 0.0)
    assert found is not None and found.z == pytest.approx(0.02)
    trusting = Footprint(length, width, FootprintSettings(trust=1.5))
    found = trusting.support(lambda p: (np.full(p.shape, 0.1), np.full(p.shape, 0.01)), 0.0, 0.0, 0.0)
    assert found is not None and found.z == pytest.approx(0.1 - 0.015)
    high = trusting.highest(lambda p: (np.full(p.shape, 0.1), np.full(p.shape, 0.01)), np.array([0j]), 0.0)
    assert high == pytest.approx(0.1 - 0.015)


@pytest.mark.parametrize("known", [0.3, 0.4])
def test_a_sole_needs_known_ground_under_a_third_of_it(known: float) -> None:
    """35 % by default, of its 11 by 9 nodes."""

    def ground(places: np.ndarray):
        z = np.where(places.real < -0.1 + known * 0.22 - 0.01, 0.05, np.nan)
        return z, np.zeros(places.shape)

    foot = Footprint(0.2, 0.096, EXACT)
    found = foot.support(ground, 0.0, 0.0, 0.0)
    assert (found is None) == (known < 0.35)
    over = foot.over(ground, np.array([0.0, 0.0, 0.02]), np.eye(3))
    assert np.isnan(over).all() == (known < 0.35)
    if known > 0.35:
        assert over == pytest.approx((0.03, 0.03, 0.03))
    nowhere = lambda places: (np.full(places.shape, np.nan), np.zeros(places.shape))  # noqa: E731
    assert foot.highest(nowhere, np.array([0j]), 0.0) == -math.inf
    assert (
        Footprint(0.2, 0.1, FootprintSettings(way=False)).highest(flat(1.0), np.array([0j]), 0.0) == -math.inf
    )


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-3.0, 3.0), st.floats(-0.2, 0.2))
@examples(20)
def test_the_ground_over_a_sole_that_stands_on_it_is_as_high_as_itself(
    roll: float, pitch: float, yaw: float, lift: float
) -> None:
    """A sole in a plane, lifted along the vertical: everywhere by as much, whatever its tilt and heading."""
    rotation = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    normal = rotation[:, 2]
    place = np.array([0.4, -0.3, 0.7])

    def plane(places: np.ndarray):
        z = (
            place[2]
            - (normal[0] * (places.real - place[0]) + normal[1] * (places.imag - place[1])) / normal[2]
        )
        return z, np.zeros(places.shape)

    over = Footprint(0.24, 0.1, EXACT).over(plane, place + [0.0, 0.0, lift], rotation)
    assert over == pytest.approx((-lift, -lift, -lift), abs=1e-9)


@pytest.mark.parametrize(("a", "b"), [(0.0, 0.0), (0.18, 0.0), (-0.11, 0.26), (0.05, -0.36), (0.36, 0.36)])
def test_a_sole_rests_on_a_plane_with_its_slope_up_to_the_greatest_tilt(a: float, b: float) -> None:
    """Of the planes between which it chooses; their heights are those of the blocks of nodes that carry."""

    def plane(places: np.ndarray):
        return a * places.real + b * places.imag, np.zeros(places.shape)

    for most in (0.5, 0.1, 0.0):
        found = Footprint(0.24, 0.1, FootprintSettings(trust=0.0, tilt=most)).support(plane, 0.0, 0.0, 0.0)
        assert found is not None
        assert found.slope == pytest.approx((np.clip(a, -most, most), np.clip(b, -most, most)), abs=0.081)
        if most < 0.2:
            assert np.abs(found.slope).max() <= most


def test_a_place_is_moved_where_that_costs_less_than_staying() -> None:
    """On level ground with a cost of its own: a move costs 2 mm, 0.15 m/m of its way, and what is added."""
    foot = Footprint(0.2, 0.096, EXACT)
    step = 0.02
    anywhere = lambda x, y: True  # noqa: E731
    for bonus, moved in ((0.002 + 0.15 * step - 1e-4, False), (0.002 + 0.15 * step + 1e-4, True)):
        cost = lambda moves, bonus=bonus: np.where(np.abs(moves - step) < 1e-9, -bonus, 0.0)  # noqa: E731
        found = foot.best(flat(0.0), 0.3, 0.1, 0.5 * math.pi, anywhere, cost)
        assert found is not None
        assert (found.x, found.y) == pytest.approx((0.3, 0.1 + (step if moved else 0.0)))
    across = 0.096 / 8.0  # a node to the left, where a board ends
    board = lambda places: (np.where(places.imag < -0.048 + 1.5 * across, 0.03, 0.0), np.zeros(places.shape))  # noqa: E731
    aside = foot.best(board, 0.0, 0.0, 0.0, anywhere)
    assert aside is not None and aside.y > 0.0 and aside.z < 0.03
    stays = foot.support(board, 0.0, 0.0, 0.0)
    assert stays is not None and stays.z == pytest.approx(0.03)
    far = lambda moves: np.where(np.abs(moves - 2.0 * step) < 1e-9, -1.0, 0.0)  # noqa: E731
    found = foot.best(flat(0.0), 0.0, 0.0, 0.0, anywhere, far)
    assert found is not None and found.x == pytest.approx(2.0 * step)
    stay = Footprint(0.2, 0.096, FootprintSettings(choice=False)).best(
        flat(0.1), 0.0, 0.0, 0.0, anywhere, far
    )
    assert stay is not None and (stay.x, stay.z) == (0.0, pytest.approx(0.1))
    assert LOADS.shape == (2, 5) and HIGH == 0.08


# --- what one robot knows -------------------------------------------------------------------------------------------


def ground_of(**changes: object) -> KnownGround:
    ROBOT.update(ROBOT.half_sitting, np.zeros(ROBOT.nv))
    ground = KnownGround(ROBOT, GroundSettings(**changes))  # type: ignore[arg-type]
    ground.update(ROBOT, 1.0)
    return ground


@pytest.mark.parametrize(
    ("age", "used"), [(0.499, True), (0.501, False), (-0.99 * AHEAD, True), (-1.01 * AHEAD, False)]
)
def test_a_cloud_is_used_up_to_its_greatest_age_and_a_little_ahead(age: float, used: bool) -> None:
    ground = ground_of()
    ground.add(PointCloud([[0.3, 0.1, 0.0]], 1.0 + FUSED - age, "world"))
    ground.update(ROBOT, 1.0 + FUSED)
    assert (ground.status == "") == used and len(ground.map.known()[0]) == used
    if not used:
        (said,) = re.findall(r"(\S+) s (?:old|ahead)", ground.status)
        assert float(said) == pytest.approx(abs(age), rel=1e-3)
    own = ElevationMap(np.zeros((60, 60)), 0.02, (-0.6, -0.6, 0.0), time=1.0 + FUSED - age, max_age=0.5)
    other = ground_of()
    other.add(own)
    other.update(ROBOT, 1.0 + FUSED)
    assert (other.status == "") == used


def test_poses_are_remembered_for_the_greatest_age_of_a_cloud() -> None:
    """However fast the ticks are, here a little faster than 512 poses last for half a second."""
    ground = ground_of()
    for period in (0.9735e-3, 0.2e-3):
        for k in range(round(0.7 / period)):
            ground._remember(ROBOT.q, 2.0 + k * period)
        times = ground._times[np.isfinite(ground._times)]
        assert times.max() - times.min() >= 0.5 - period


def test_changes_of_what_is_known_are_counted_and_come_no_faster_than_they_are_fused() -> None:
    ground, versions = ground_of(), []
    for k in range(9):
        ground.add(PointCloud([[0.3, 0.1, 0.0]], 1.0, "world"))
        ground.update(ROBOT, 1.0 + 0.25 * FUSED * (k + 1))
        versions.append(ground.version)
    assert versions == [1, 1, 1, 1, 2, 2, 2, 2, 3]
    ground.add(ElevationMap(np.zeros((60, 60)), 0.02))
    assert ground.version == 4
    for _ in range(WAITING + 5):
        ground.add(PointCloud([[0.3, 0.1, 0.0]], 1.0, "world"))
    assert len(ground._waiting) == WAITING


@pytest.mark.parametrize("height", [0.01, -0.01, 0.025, 0.04, -0.04, 0.059, 0.061])
def test_what_is_known_is_moved_to_the_sole_that_stands_by_a_share_up_to_a_step(height: float) -> None:
    """70 % of the difference, of 20 mm at most; beyond 60 mm it contradicts the sole, and nothing is used."""
    ground = ground_of()
    sole = ROBOT.placement(ROBOT.soles[0].frame)
    ground.add(ElevationMap(np.full((60, 60), sole.translation[2] + height), 0.02, (-0.6, -0.6, 0.0)))
    ground.update(ROBOT, 1.1)
    version = ground.version
    ground.stand(0, sole)
    assert ground.difference == pytest.approx(height) and ground.version == version + (abs(height) < 0.06)
    found = ground.support(0, *sole.translation[:2], 0.0)
    if abs(height) > 0.06:
        assert found is None and ground.status
        return
    assert found is not None
    moved = 0.7 * max(-0.02, min(height, 0.02))
    assert found.z - sole.translation[2] == pytest.approx(height - moved)
    way = ground.highest(0, sole.translation, sole.translation + [0.1, 0.0, 0.0], 0.0)
    assert way == pytest.approx(found.z)


def test_a_map_smaller_than_a_sole_is_refused_and_its_size_is_cells_times_their_size() -> None:
    longest = max(sole.length for sole in ROBOT.soles)
    ground = ground_of()
    ground.add(ElevationMap(np.zeros((20, 10)), 0.1001 * longest))
    with pytest.raises(ValueError, match="sole"):
        ground.add(ElevationMap(np.zeros((20, 10)), 0.0999 * longest))
