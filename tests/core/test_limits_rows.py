"""Self-collision and CoM polygon: rows against finite differences, and limits that are never crossed."""

from __future__ import annotations

import itertools
from contextlib import nullcontext

import numpy as np
import pinocchio as pin
import pytest
from properties import by_default
from task_factory import (
    ROBOTS,
    description,
    integrate,
    left_hand,
    make_robot,
    near_half_sitting,
    random_state,
    right_hand,
)

from wbc.base.errors import InputError, UnknownNameError
from wbc.base.numbers import Array
from wbc.core.limits import collision
from wbc.core.limits.base import Limit, cut_demands
from wbc.core.limits.collision import CollisionLimit
from wbc.core.limits.com_polygon import CoMPolygonLimit
from wbc.core.limits.joint import JointLimits
from wbc.core.limits.obstacles import CollisionCapsule, CollisionSphere
from wbc.core.limits.pairs import srdf_pairs
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.tasks import CoMTask, PositionTask, PostureTask, check_rows

robots = pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))
STEP = 1e-6


def rows_of(limit: Limit, robot: Robot, dt: float = 0.002) -> tuple[Array, Array, Array]:
    rows, lower, upper = np.ones((limit.dim, robot.nv)), np.zeros(limit.dim), np.zeros(limit.dim)
    limit.write(dt, rows, lower, upper)
    return rows, lower, upper


# ---- self-collision -----------------------------------------------------------------------------------------------


def balls(robot: Robot, radius: float = 0.05, **options: float) -> CollisionLimit:
    hands = (left_hand(robot), right_hand(robot))
    return CollisionLimit([hands], shapes={hand: CollisionSphere(radius) for hand in hands}, **options)


def capsules(robot: Robot, **options: float) -> CollisionLimit:
    """A capsule along each lower arm, and one for the torso."""
    shapes: dict[str, CollisionCapsule] = {}
    for hand in (left_hand(robot), right_hand(robot)):
        frame = robot.model.frames[robot.frame_id(hand)]
        back = frame.placement.inverse().translation
        back = back / max(float(np.linalg.norm(back)), 1e-3) * 0.15
        shapes[hand] = CollisionCapsule(
            0.03, (0.0, 0.0, 0.0), tuple(back) if np.linalg.norm(back) > 0.1 else (0, 0, 0.15)
        )
    shapes[robot.torso_frame] = CollisionCapsule(0.05, (0.0, 0.0, 0.0), (0.0, 0.0, 0.2))
    hands = list(shapes)[:2]
    pairs = [(hands[0], hands[1]), (hands[0], robot.torso_frame), (hands[1], robot.torso_frame)]
    return CollisionLimit(pairs, shapes=shapes, **options)


@pytest.fixture
def all_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """No row of a collision limit is left out for the slowness of its pair."""
    monkeypatch.setattr(collision, "SUDDEN", np.inf)


@robots
@pytest.mark.usefixtures("all_rows")
@pytest.mark.parametrize("make", [balls, capsules])
def test_collision_rows_are_the_derivative_of_the_distance(name: str, make: object) -> None:
    robot, rng = make_robot(name), np.random.default_rng(1)
    limit = make(robot, influence=10.0)
    limit.bind(robot)
    for _ in range(5):
        q, v = random_state(robot, rng)
        robot.update(q, v)
        rows, lower, upper = rows_of(limit, robot)
        pairs = slice(len(limit.distances))  # the rows of corners come behind them
        assert np.isfinite(lower[pairs]).all()
        assert np.isinf(upper).all()
        ends = []
        for step in (STEP, -STEP):
            robot.update(pin.integrate(robot.model, q, step * v), v)
            rows_of(limit, robot)
            ends.append(np.array(list(limit.distances.values())))
        np.testing.assert_allclose(rows[pairs] @ v, (ends[0] - ends[1]) / (2 * STEP), atol=1e-6)


@robots
@pytest.mark.usefixtures("all_rows")
def test_collision_bound_counts_drift_and_damper(name: str) -> None:
    """For two balls all is known: |c̈| along the line, with the turning of the line adding v_t² / distance."""
    robot, rng, dt, time_constant, margin = make_robot(name), np.random.default_rng(2), 0.002, 0.07, 0.03
    limit = balls(robot, influence=10.0, recovery=1e9, time_constant=time_constant, margin=margin)
    limit.bind(robot)
    for _ in range(5):
        q, v = random_state(robot, rng)
        robot.update(q, v)
        rows, lower, _ = rows_of(limit, robot, dt)
        first, second = (robot.placement(hand) for hand in (left_hand(robot), right_hand(robot)))
        line = second.translation - first.translation
        length = float(np.linalg.norm(line))
        velocity = [
            pin.getFrameVelocity(robot.model, robot.data, robot.frame_id(h), pin.LOCAL_WORLD_ALIGNED).linear
            for h in (left_hand(robot), right_hand(robot))
        ]
        relative = velocity[1] - velocity[0]
        speed = float(relative @ line) / length
        sideways = float(relative @ relative) - speed**2
        steps = []
        for step in (STEP, -STEP):
            robot.update(pin.integrate(robot.model, q, step * v), v)
            steps.append(rows_of(limit, robot, dt)[0] @ v)
        growth = (steps[0] - steps[1])[0] / (2 * STEP)
        drift = growth - sideways / length
        distance = length - 0.1
        wanted = -((distance - margin) / time_constant + speed) / dt
        np.testing.assert_allclose(lower[0], wanted - drift, rtol=1e-6, atol=1e-4)


@robots
def test_hands_that_want_to_pass_through_each_other_do_not(name: str) -> None:
    controller = Controller(make_robot(name), 0.004)
    robot = controller.robot
    controller.add(
        SoleContact("left_foot"), SoleContact("right_foot"), CoMTask(), PostureTask(), JointLimits()
    )
    limit = controller.add(balls(robot, 0.06, margin=0.02))
    hands = [left_hand(robot), right_hand(robot)]
    middle = 0.5 * sum(robot.placement(hand).translation for hand in hands) + [0.1, 0.0, 0.05]
    for hand, side in zip(hands, (-0.1, 0.1), strict=True):  # each is to go past the other
        controller.add(PositionTask(hand, middle + [0.0, side, 0.0], weight=10.0, stiffness=60.0))
    q, v = np.array(robot.q), np.array(robot.v)
    distances, active = [], 0
    for _ in range(375):
        controller.update(q, v)
        solution = controller.solve()
        assert solution.ok, controller.diagnose()
        active += limit.name in solution.active_limits
        first, second = (robot.placement(hand).translation for hand in hands)
        distances.append(float(np.linalg.norm(first - second)) - 0.12)
        q, v = integrate(controller, q, v, solution.accelerations)
    assert 0.02 - 1e-5 <= min(distances) < 0.03
    assert active
    assert min(limit.distances.values()) == pytest.approx(distances[-1], abs=1e-6)


def test_links_closer_than_the_margin_come_apart() -> None:
    controller = Controller(make_robot("hrp4_class"), 0.002)
    robot = controller.robot
    hands = [left_hand(robot), right_hand(robot)]
    apart = float(
        np.linalg.norm(robot.placement(hands[0]).translation - robot.placement(hands[1]).translation)
    )
    radius = 0.5 * apart - 0.01
    limit = controller.add(balls(robot, radius, margin=0.05))
    controller.add(SoleContact("left_foot"), SoleContact("right_foot"), CoMTask(), PostureTask())
    controller.solve()
    assert min(limit.distances.values()) == pytest.approx(0.02)
    q, v = np.array(robot.q), np.array(robot.v)
    for _ in range(400):
        controller.update(q, v)
        solution = controller.solve()
        assert solution.ok
        q, v = integrate(controller, q, v, solution.accelerations)
    assert min(limit.distances.values()) >= 0.05 - 1e-3


def test_primitive_geometry_of_the_urdf_is_used() -> None:
    robot = make_robot("hrp4_class")
    urdf, shapes = description("hrp4_class").urdf, description("hrp4_class").collision_hulls()
    pairs = [("left_hand", "left_thigh"), ("left_hand", "right_hand"), ("left_forearm", "chest")]
    limit = CollisionLimit(pairs, shapes=shapes)
    limit.bind(robot)
    assert limit.dim > len(pairs)
    for pair, distance in limit.distances.items():
        geometry = pin.buildGeomFromUrdfString(robot.model, urdf, pin.COLLISION)
        links = [robot.model.frames[item.parentFrame].name for item in geometry.geometryObjects]
        for i, k in itertools.product(
            *([i for i, name in enumerate(links) if name == link] for link in pair)
        ):
            geometry.addCollisionPair(pin.CollisionPair(i, k))
        data = geometry.createData()
        pin.updateGeometryPlacements(robot.model, robot.data, geometry, data)
        pin.computeDistances(geometry, data)
        least = min(found.min_distance for found in data.distanceResults)
        assert distance == pytest.approx(least, abs=1e-6)  # the tolerance of coal's GJK


@pytest.mark.parametrize(
    ("pair", "margin", "separable"),
    [
        (("left_hand", "left_fingers"), 0.02, False),
        (("left_hand", "left_fingers"), 0.001, True),
        (("left_hand", "left_thigh"), 0.1, True),
    ],
)
def test_a_pair_that_no_joint_separates_is_refused_with_its_distance(
    pair: tuple[str, str], margin: float, separable: bool
) -> None:
    robot, shapes = make_robot("hrp4_class"), description("hrp4_class").collision_hulls()
    limit = CollisionLimit([pair], shapes=shapes, margin=margin)
    refused = pytest.raises(InputError, match=f"'{pair[0]}' and '{pair[1]}'.*0.0020 m")
    with nullcontext() if separable else refused:
        limit.bind(robot)


@pytest.mark.parametrize("radius", [0.1, 0.3])
def test_shapes_that_start_inside_each_other_are_refused_with_their_depth(radius: float) -> None:
    """Two balls whose centres are nearer than the sum of their radii."""
    robot = make_robot("hrp4_class")
    hands = left_hand(robot), right_hand(robot)
    one, other = (robot.placement(hand).translation for hand in hands)
    radii = radius, float(np.linalg.norm(one - other)) - radius + 0.017
    shapes = {hand: CollisionSphere(r) for hand, r in zip(hands, radii, strict=True)}
    with pytest.raises(InputError, match=r"are 0\.017 m"):
        CollisionLimit([hands], shapes=shapes, margin=0.001).bind(robot)


@pytest.mark.parametrize(
    ("name", "pair"),
    [
        pytest.param("talos", ("arm_left_7_link", "leg_left_3_link"), marks=pytest.mark.slow),
        pytest.param("talos", ("gripper_left_base_link", "torso_2_link"), marks=pytest.mark.slow),
        ("g1", ("left_knee_link", "right_knee_link")),
    ],
)
def test_links_whose_geometry_is_meshes_have_shapes_as_shipped(name: str, pair: tuple[str, str]) -> None:
    limit = CollisionLimit([pair], shapes=description(name).collision_shapes())
    check_rows(limit, make_robot(name))
    limit.bind(make_robot(name))
    assert 0.01 < limit.distances[pair] < 0.6


def test_pairs_come_from_an_srdf_that_leaves_some_out() -> None:
    srdf = '<robot name="r"><disable_collisions link1="b" link2="a" reason="Adjacent"/></robot>'
    for xml in (srdf, srdf.replace("<robot", '<robot xmlns="http://drake.mit.edu"')):
        assert srdf_pairs(xml, ["a", "b", "c"]) == [("a", "c"), ("b", "c")]
    with pytest.raises(InputError, match="SRDF"):
        srdf_pairs("<robot", ["a", "b"])


class Contradicting(Limit):
    """A limit whose bounds cannot both be kept."""

    name, dim = "contradicting", 1

    def bind(self, robot: Robot) -> None: ...

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        rows[:], lower[:], upper[:] = 1.0, 1.0, -1.0


def test_a_limit_that_contradicts_itself_is_named() -> None:
    with pytest.raises(InputError, match="'contradicting'.*lower bound above the upper"):
        check_rows(Contradicting(), make_robot("hrp4_class"))
    check_rows(CoMPolygonLimit(), make_robot("hrp4_class"))


# ---- centre of mass over a polygon --------------------------------------------------------------------------------


@robots
def test_polygon_rows_are_the_derivative_of_the_distance_to_each_edge(name: str) -> None:
    robot, rng, dt = make_robot(name), np.random.default_rng(4), 0.002
    limit = CoMPolygonLimit(time_constant=0.3, recovery=1e9)
    limit.bind(robot)
    q, v = near_half_sitting(robot, rng, 0.05, 0.5)
    corners = limit.polygon
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    robot.update(q, v)
    rows, lower, upper = rows_of(limit, robot, dt)
    used = len(corners)
    np.testing.assert_allclose(rows[:used] @ v, normals @ robot.com_velocity[:2], atol=1e-9)
    assert np.isneginf(lower).all()
    distance = (normals * corners).sum(axis=1) - 0.01 - normals @ robot.com[:2]
    speed = normals @ np.array(robot.com_velocity[:2])
    wanted = (distance / 0.3 - speed) / dt - limit.drift()[:used]
    np.testing.assert_allclose(upper[:used], wanted, atol=1e-4)
    np.testing.assert_array_equal(rows[used:], 0.0)
    assert np.isposinf(upper[used:]).all()


def sway(
    name: str, limit: CoMPolygonLimit, goal: Array, seconds: float, dt: float = 0.005
) -> tuple[Controller, Array]:
    """Pull the CoM somewhere; where it goes."""
    controller = Controller(make_robot(name), dt)
    robot = controller.robot
    com = CoMTask(stiffness=40.0)
    controller.add(SoleContact("left_foot"), SoleContact("right_foot"), com, PostureTask(), limit)
    com.target = np.array([goal[0], goal[1], robot.com[2]])
    q, v = np.array(robot.q), np.array(robot.v)
    path = []
    for _ in range(round(seconds / dt)):
        controller.update(q, v)
        path.append(np.array(robot.com[:2]))
        solution = controller.solve()
        assert solution.ok, (controller.diagnose(), limit)
        q, v = integrate(controller, q, v, solution.accelerations)
    return controller, np.array(path)


@pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))
def test_com_is_pulled_out_of_its_polygon_in_vain(name: str) -> None:
    robot = make_robot(name)
    here = np.array(robot.com[:2])
    square = here + 0.03 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    for angle in (0.8, 4.0):
        goal = here + 0.15 * np.array([np.cos(angle), np.sin(angle)])
        limit = CoMPolygonLimit(square, margin=0.0)
        _, path = sway(name, limit, goal, 0.8)
        beyond = np.abs(path - here).max() - 0.03
        assert beyond <= 1e-6
        assert beyond > -5e-3
    assert limit.distance == pytest.approx(-beyond, abs=1e-3)


def test_com_stays_over_the_soles_by_default() -> None:
    limit = CoMPolygonLimit()
    controller, path = sway("hrp4_class", limit, np.array([0.4, 0.1]), 2.0)
    corners = limit.polygon
    assert len(corners) == 4 or len(corners) == 6
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    inside = ((normals * corners).sum(axis=1) - path @ normals.T).min(axis=1)
    assert inside.min() >= 0.01 - 1e-6
    assert inside.min() < 0.02
    height = controller.robot.com[2]
    assert limit.time_constant == pytest.approx(np.sqrt(height / 9.80665), rel=0.05)


@robots
def test_com_that_starts_outside_comes_back(name: str) -> None:
    robot = make_robot(name)
    here = np.array(robot.com[:2])
    square = here + [0.045, 0.0] + 0.03 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    limit = CoMPolygonLimit(square, margin=0.0, recovery=0.2)
    _, path = sway(name, limit, here - [0.1, 0.0], 1.5)  # and is pulled the wrong way
    outside = here[0] + 0.015 - path[:, 0]
    assert outside[0] == pytest.approx(0.015)
    assert outside.max() < 0.016
    assert outside[-1] < 1e-3


def test_polygon_follows_the_soles_on_request() -> None:
    robot = make_robot("g1")
    limit = CoMPolygonLimit()
    with pytest.raises(InputError, match="added"):
        _ = limit.polygon
    Controller(robot, 0.002).add(limit)
    both = limit.polygon
    limit.use_soles(["left_foot"])
    sole = robot.soles[0]
    size = limit.polygon.max(axis=0) - limit.polygon.min(axis=0)
    np.testing.assert_allclose(size, [sole.length, sole.width], atol=1e-6)
    np.testing.assert_allclose(
        limit.polygon.mean(axis=0), robot.placement(sole.frame).translation[:2], atol=1e-9
    )
    limit.use_soles()
    np.testing.assert_array_equal(limit.polygon, both)
    assert np.isposinf(rows_of(limit, robot)[2][len(both) :]).all()
    limit.polygon = [[0, 0], [1, 0], [0, 1]]
    assert np.isposinf(rows_of(limit, robot)[2][3:]).all()
    with pytest.raises(UnknownNameError, match="sole"):
        limit.use_soles(["left_hand"])
    with pytest.raises(InputError, match="sole"):
        limit.use_soles([])


def test_a_demand_is_cut_off_at_what_coordinates_attain_together_and_bounds_around_zero_stay() -> None:
    rows = np.random.default_rng(0).normal(size=(6, 9))
    most = 2.0 * np.abs(rows).sum(axis=1)
    lower, upper = (
        np.array([-np.inf, -1.0, 1e3, 0.1, -np.inf, 0.0]),
        np.array([1.0, 1.0, 1e4, 0.2, -1e3, 0.0]),
    )
    cut_demands(2.0, rows, lower, upper)
    np.testing.assert_allclose(lower, [-np.inf, -1.0, most[2], 0.1, -np.inf, 0.0])
    np.testing.assert_allclose(upper, [1.0, 1.0, 1e4, 0.2, -most[4], 0.0])
