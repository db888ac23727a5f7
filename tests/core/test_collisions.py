"""Limits on collisions with obstacles and between all links: rows, motions that keep away, searches, refusals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from collision_layouts import MARGIN, panda
from hypothesis import given
from hypothesis import strategies as st
from properties import by_default, examples
from task_factory import description

import wbc
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.robot import Robot
from wbc.tasks import check_rows

BALL = wbc.CollisionSphere(0.06)
SHAPES = {
    "sphere": wbc.CollisionSphere(0.1, (0.0, 0.1, 0.0)),
    "capsule": wbc.CollisionCapsule(0.05, (0.0, 0.0, -0.2), (0.1, 0.0, 0.2)),
    "cylinder": wbc.CollisionCylinder(0.1, (0.0, 0.0, -0.2), (0.0, 0.05, 0.2)),
    "box": wbc.CollisionBox((0.1, 0.2, 0.3), turn=(0.3, -0.2, 0.5)),
    "hull": wbc.CollisionHull(((0.1, 0.0, 0.0), (-0.1, 0.05, 0.0), (0.0, -0.1, 0.1), (0.0, 0.0, -0.15))),
    "half-space": wbc.CollisionHalfSpace((0.2, 0.0, 1.0), -0.3),
}


def arm() -> wbc.InverseKinematics:
    """Return a solver of an arm with a hand that is to go 0.3 m to the side."""
    ik = wbc.InverseKinematics(panda().robot(), 0.01)
    ik.add(wbc.JointLimits(), wbc.PostureTask(weight=1e-4))
    return ik


def velocity_rows(limit: wbc.CollisionLimit, robot: Robot) -> tuple[Array, Array]:
    rows, lower, upper = np.ones((limit.dim, robot.nv)), np.zeros(limit.dim), np.zeros(limit.dim)
    limit.write_velocity(0.01, rows, lower, upper)
    assert np.isinf(upper).all()
    return rows, lower


@pytest.mark.parametrize("link", ["panda_hand", "panda_rightfinger"])
@pytest.mark.parametrize("kind", SHAPES)
def test_rows_and_bounds_are_the_derivative_of_the_distance_to_what_moves(kind: str, link: str) -> None:
    """The change of the distance is that of the rows, and what the motion of the obstacle adds to the bound.

    The right finger is coupled to the left one.
    """
    robot, rng = panda().robot(), np.random.default_rng(3)
    place = pin.SE3(pin.exp3(np.array([0.1, 0.2, -0.1])), np.array([0.6, 0.3, 0.3]))
    obstacle = wbc.Obstacle("thing", SHAPES[kind], place)
    limit = wbc.CollisionLimit(
        obstacles=[obstacle], against=[link], shapes={link: BALL}, margin=0.0, influence=5.0
    )
    limit.bind(robot)
    for _ in range(4):
        q = pin.integrate(robot.model, robot.q, 0.02 * rng.normal(size=robot.nv))
        v, twist, ends = rng.normal(size=robot.nv), 0.3 * rng.normal(size=6), []
        for step in (1e-4, -1e-4):
            robot.update_jacobians(pin.integrate(robot.model, q, step * v))
            obstacle.placement = pin.SE3(
                pin.exp3(step * twist[3:]) @ place.rotation, place.translation + step * twist[:3]
            )
            velocity_rows(limit, robot)
            ends.append(limit.distances[link, "thing"])
        robot.update_jacobians(q)
        obstacle.placement, obstacle.velocity = place, twist
        limit._margin = limit.distances[link, "thing"]  # no room: the bound is what the obstacle adds
        rows, lower = velocity_rows(limit, robot)
        assert rows[0] @ v - lower[0] == pytest.approx((ends[0] - ends[1]) / 2e-4, abs=3e-3)
        limit._margin = 0.0


def test_all_pairs_are_those_that_can_touch() -> None:
    shapes, robot = panda().collision_shapes(), panda().robot()
    limit = wbc.CollisionLimit("all", shapes=shapes)
    limit.bind(robot)
    model, names = robot.model, set(limit.distances)
    assert ("panda_link1", "panda_link6") in names or ("panda_link6", "panda_link1") in names
    for one, other in names:
        a, b = (model.frames[model.getFrameId(link)].parentJoint for link in (one, other))
        assert a != b and model.parents[a] != b and model.parents[b] != a
    assert min(limit.distances.values()) > 0.02
    check_rows(wbc.CollisionLimit("all", shapes=shapes), robot)


def test_hulls_lie_inside_the_meshes_and_nearly_fill_them() -> None:
    hulls, capsules = panda().collision_hulls(), panda().collision_shapes()
    assert set(hulls) == set(capsules)
    (hand,) = hulls["panda_hand"]
    assert isinstance(hand, wbc.CollisionHull)
    size = np.ptp(np.array(hand.points), axis=0)
    assert size[1] == pytest.approx(0.2, abs=0.01) and size[0] < 0.07  # the gripper is 0.2 m wide, and thin


def test_a_hand_goes_around_what_stands_in_its_way_and_stops_before_what_it_cannot_pass() -> None:
    ik = arm()
    hand = ik.add(wbc.PositionTask("panda_hand"))
    start = hand.target.copy()
    box = wbc.Obstacle(
        "box", wbc.CollisionBox((0.1, 0.1, 0.1)), pin.SE3(np.eye(3), start + [0.0, 0.25, 0.01])
    )
    limit = ik.add(
        wbc.CollisionLimit(obstacles=[box], against=["panda_hand"], shapes={"panda_hand": BALL}, margin=0.01)
    )
    hand.target = start + [0.0, 0.25, 0.0]  # inside the box
    for _ in range(200):
        ik.step()
        assert limit.distances["panda_hand", "box"] > 0.01 - 1e-4
    assert ik.solution is not None and limit.name in ik.solution.active_limits
    found = ik.reach()
    assert not found.reached and limit.name in found.held_by
    hand.target = start + [0.0, 0.5, 0.15]
    for _ in range(300):
        ik.step()
        assert limit.distances["panda_hand", "box"] > 0.01 - 1e-4
    assert np.linalg.norm(hand.error) < 1e-2


def test_an_obstacle_that_moves_pushes_the_hand() -> None:
    ik = arm()
    hand = ik.add(wbc.PositionTask("panda_hand"))
    wall = wbc.Obstacle("wall", wbc.CollisionHalfSpace((0.0, 1.0, 0.0)))
    wall.placement = pin.SE3(np.eye(3), np.array([0.0, -0.4, 0.0]))
    limit = ik.add(
        wbc.CollisionLimit(obstacles=[wall], against=["panda_hand"], shapes={"panda_hand": BALL}, margin=0.02)
    )
    wall.velocity = [0.0, 0.3, 0.0, 0.0, 0.0, 0.0]
    for step in range(150):
        ik.step()
        wall.placement = pin.SE3(np.eye(3), np.array([0.0, -0.4 + 0.003 * (step + 1), 0.0]))
        assert limit.distances["panda_hand", "wall"] > 0.015
    assert -hand.error[1] > 0.1  # 0.05 + 0.06 + 0.02 m, but for the start


@pytest.mark.parametrize(
    ("way", "ticks"),
    [("hulls", 120), *(pytest.param(way, 240, marks=pytest.mark.slow) for way in ("hulls", "capsules"))],
)
def test_no_row_is_left_out_that_could_be_active(way: str, ticks: int) -> None:
    """Along smooth motions and jumps, with obstacles that move: rows are those of measuring every pair at every tick.

    A row may be missing beyond the influence, or where its distance would have to shrink with more than 100 m/s². Among
    velocities no row is missing within 0.1 m.
    """
    rng, dt, time, margin, influence = np.random.default_rng(5), 0.005, 0.1, 0.0, 0.3
    g1 = description("g1")
    robot, shapes = g1.robot(), g1.collision_shapes()
    arms = [f"{side}_{link}" for side in ("left", "right") for link in ("elbow_link", "rubber_hand")]
    legs = [f"{side}_{link}" for side in ("left", "right") for link in ("hip_yaw_link", "knee_link")]
    if way == "hulls":
        shapes |= {
            link: shape for link, shape in g1.collision_hulls().items() if link in (*arms, "torso_link")
        }
    obstacles = [
        wbc.Obstacle("box", wbc.CollisionBox((0.2, 0.3, 0.4)), pin.SE3(np.eye(3), np.array([0.4, 0.3, 0.0]))),
        wbc.Obstacle("wall", wbc.CollisionHalfSpace((-1.0, 0.0, 0.0), -0.6)),
    ]
    limit = wbc.CollisionLimit(
        [(arm, other) for arm in arms for other in ("torso_link", *legs)] + [(legs[1], legs[3])],
        obstacles=obstacles,
        against=arms,
        shapes=shapes,
        margin=margin,
        influence=influence,
        time_constant=time,
    )
    limit.bind(robot)
    rows, lower, upper = np.zeros((limit.dim, robot.nv)), np.zeros(limit.dim), np.zeros(limit.dim)
    pairs, measured, left_out, needed, of_pair = len(limit._scene.names), 0, 0, 0, limit._scene.distance

    def counted(row: int, data: pin.GeometryData) -> float:
        nonlocal measured
        measured += 1
        return of_pair(row, data)

    def distances() -> Array:
        return np.array(limit._measured(limit._data))

    def move(q: Array, v: Array, step: float) -> Array:
        for obstacle in obstacles:
            twist, place = obstacle.velocity, obstacle.placement
            turned = pin.exp3(step * twist[3:]) @ place.rotation
            obstacle.placement = pin.SE3(turned, place.translation + step * twist[:3])
        limit._scene.place(limit._data)
        return np.asarray(pin.integrate(robot.model, q, step * v))

    q, v = robot.half_sitting.copy(), np.zeros(robot.nv)
    for tick in range(ticks):
        only = tick // 40 % 3  # all moves, or a joint alone, or the obstacles alone, which turn on the spot
        if tick % 40 == 0:
            q[7:] = rng.uniform(robot.position_lower, robot.position_upper)
            v = rng.normal(size=robot.nv) * (only == 0)
            v[rng.integers(6, robot.nv)] += 3.0 * (only == 1)
            for obstacle in obstacles:
                turn = 3.0 * rng.normal(size=3) * (obstacle.name == "box")
                obstacle.velocity = [*0.5 * rng.normal(size=3) * (only == 0), *turn * (only != 1)]
        if only == 0:
            v += 0.2 * rng.normal(size=robot.nv)
        robot.update(q, v)
        limit._scene.distance = counted  # type: ignore[method-assign, assignment]
        limit.write(dt, rows, lower, upper)
        limit._scene.distance = of_pair  # type: ignore[method-assign]
        ends, here = [], distances()
        if tick % 40 == 0:
            limit.write_velocity(dt, rows, lower, upper)
            near = here <= 0.1 - 1e-4
            assert (np.isfinite(lower[:pairs]) == (here <= 0.1))[
                near | (here > 0.1 + 1e-4)
            ].all() and near.any()
            limit.write(dt, rows, lower, upper)
        assert (limit._separation.distances() <= here + 1e-5).all()
        closing = limit._separation.speeds(limit._twists())
        for step in (1e-4, -1e-4):
            robot.update(move(q, v, step), v)
            ends.append((distances() - here) / step)
            move(q, v, -step)
        growth = 0.5 * (ends[0] + ends[1])
        assert (closing >= -growth - 0.03).all()
        demand = -((here - margin) / time + growth) / dt
        wanted, there = (here < influence) & (demand > -100.0), np.isfinite(lower[:pairs])
        # GJK is exact to some 1e-6 m, and the normal of hulls may jump.
        sure = (abs(here - influence) > 1e-4) & (abs(demand + 100.0) > 5.0) & (abs(ends[0] - ends[1]) < 0.02)
        assert (wanted == there)[sure].all(), (demand[wanted != there], here[wanted != there])
        assert not rows[:pairs][~there].any()
        left_out, needed = left_out + int((~there & (here < influence)).sum()), needed + int(there.sum())
        q = move(q, v, dt)
    assert left_out > 2 * ticks and needed > 0.8 * ticks and measured < 0.6 * ticks * pairs


@examples(8)
@given(seed=st.integers(0, 1000), dt=st.sampled_from([0.002, 0.01, 0.05]), inside=st.booleans())
def test_a_margin_is_never_crossed(seed: int, dt: float, inside: bool) -> None:
    """From outside the margin it is kept, however the targets jump; from within, the distance never shrinks."""
    rng, robot = np.random.default_rng(seed), panda().robot()
    room = 0.2 * (robot.position_upper - robot.position_lower)
    robot.update_jacobians(rng.uniform(robot.position_lower + room, robot.position_upper - room))
    ik, margin = wbc.InverseKinematics(robot, dt), 0.05
    ik.add(wbc.JointLimits(), wbc.PostureTask(weight=1e-4))
    hand = ik.add(wbc.PositionTask("panda_hand", rate=100.0, error_bound=1.0))
    way = rng.normal(size=3)
    gap = 0.1 + (0.03 if inside else 0.06)
    place = robot.placement("panda_hand").translation + gap * way / np.linalg.norm(way)
    ball = wbc.Obstacle("ball", wbc.CollisionSphere(0.05), pin.SE3(np.eye(3), place))
    small = {"panda_hand": wbc.CollisionSphere(0.05)}
    limit = ik.add(wbc.CollisionLimit(obstacles=[ball], against=["panda_hand"], shapes=small, margin=margin))
    before = limit.distances["panda_hand", "ball"]
    for step in range(40):
        if step % 20 == 0:
            hand.target = place + rng.uniform(-0.3, 0.3, 3)
        ik.step()
        robot.update_jacobians(robot.q)
        distance = float(np.linalg.norm(robot.placement("panda_hand").translation - place)) - 0.1
        # A step is of the first order: it may come closer by its curvature, a share of its squared length.
        curved = float(np.linalg.norm(robot.v[:-1])) ** 2 * dt**2
        assert distance >= min(before, margin) - curved - 1e-6
        before = distance


HANDS = {
    "hrp4_class": wbc.CollisionBox((0.1, 0.04, 0.16)),
    "g1": wbc.CollisionCapsule(0.03, (0.0, 0.0, -0.08), (0.0, 0.0, 0.08)),
}


@pytest.mark.parametrize("name", by_default(HANDS, "hrp4_class"))
def test_a_hand_in_torque_control_rests_at_a_wall(name: str) -> None:
    robot, dt = description(name).robot(), 0.005
    controller = wbc.balance_controller(robot, dt)
    link, hand = robot.frames["right_hand"], HANDS[name]
    place = pin.SE3(np.eye(3), robot.placement(link).translation + [0.25, 0.0, 0.0])
    obstacle = wbc.Obstacle("wall", wbc.CollisionBox((0.1, 0.5, 0.5)), place)
    limit = wbc.CollisionLimit(obstacles=[obstacle], against=[link], shapes={link: hand}, margin=MARGIN)
    controller.add(limit, wbc.PositionTask(link, obstacle.placement.translation, weight=30.0))
    q, v, least, jump = robot.q.copy(), robot.v.copy(), np.inf, np.inf
    for _ in range(400):
        controller.update(q, v)
        change = dt * controller.solve().accelerations
        v, jump = v + change, float(np.abs(change).max())
        q = pin.integrate(robot.model, q, dt * v)
        least = min(least, limit.distances[link, "wall"])
    assert least > MARGIN - 1e-3
    assert jump < 1e-2 and np.abs(v).max() < 0.05


def test_a_box_that_is_pressed_at_a_flat_face_keeps_the_margin_and_rests() -> None:
    ik, top = arm(), 0.425
    box = {"panda_hand": wbc.CollisionBox((0.2, 0.06, 0.1))}
    place = pin.SE3(np.eye(3), np.array([0.55, 0.3, 0.0]))
    obstacle = wbc.Obstacle("table", wbc.CollisionBox((0.6, 0.6, 2.0 * top)), place)
    limit = ik.add(
        wbc.CollisionLimit(obstacles=[obstacle], against=["panda_hand"], shapes=box, margin=MARGIN)
    )
    ik.add(wbc.PositionTask("panda_hand", [0.55, 0.3, top - 0.025]))
    least, speed = np.inf, np.inf
    for _ in range(400):
        speed = float(np.abs(ik.step()).max())
        least = min(least, limit.distances["panda_hand", "table"])
    assert least > MARGIN - 1e-3
    assert speed < 0.02


REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "nothing": (wbc.CollisionLimit, "at least one pair"),
    "some": (lambda: wbc.CollisionLimit("some"), "all"),
    "no shapes": (lambda: wbc.CollisionLimit("all").bind(panda().robot()), "no pair that can touch"),
    "shape": (lambda: wbc.Obstacle("x", "box"), "shape of Obstacle"),  # type: ignore[arg-type]
    "placement": (lambda: wbc.Obstacle("x", BALL, np.eye(4)), "placement of Obstacle"),  # type: ignore[arg-type]
    "velocity": (lambda: setattr(wbc.Obstacle("x", BALL), "velocity", [0.0]), "velocity of obstacle 'x'"),
    "far hull": (lambda: wbc.CollisionHull(((1e77, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0))), "1000000"),
    "large sphere": (lambda: wbc.CollisionSphere(1e77), "1000000"),
    "far obstacle": (
        lambda: wbc.Obstacle("far", wbc.CollisionSphere(0.1), pin.SE3(np.eye(3), np.full(3, 1e77))),
        "within",
    ),
    "flat hull": (lambda: wbc.CollisionHull(((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0))), "volume"),
    "normal": (lambda: wbc.CollisionHalfSpace((0.0, 0.0, 0.0)), "normal"),
    "half-space of a link": (
        lambda: wbc.CollisionLimit("all", shapes={"panda_hand": wbc.CollisionHalfSpace()}),
        "shapes of 'panda_hand'",
    ),
    "twice": (
        lambda: wbc.CollisionLimit(obstacles=[wbc.Obstacle("x", BALL)] * 2),
        "two obstacles of one name",
    ),
    "link": (
        lambda: wbc.CollisionLimit(obstacles=[wbc.Obstacle("x", BALL)], against=["hant"]).bind(
            panda().robot()
        ),
        "hant",
    ),
    "inside": (
        lambda: wbc.CollisionLimit(
            obstacles=[wbc.Obstacle("lamp", BALL, panda().robot().placement("panda_hand"))],
            shapes={"panda_hand": BALL},
        ).bind(panda().robot()),
        "'lamp'.* 0.120 m inside 'panda_hand'",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_refused_by_name(case: str) -> None:
    act, named = REFUSED[case]
    with pytest.raises(InputError, match=named):
        act()


def test_who_reads_distances_changes_no_command_and_a_reset_controller_is_as_a_new_one() -> None:
    shapes = description("g1").collision_hulls()
    links = ["left_rubber_hand", "right_rubber_hand"]

    def run(controller: wbc.Controller, limit: wbc.CollisionLimit, read: bool = False) -> Array:
        robot, found = controller.robot, []
        robot.update(robot.half_sitting, np.zeros(robot.nv))
        controller.reset()
        middle = 0.5 * sum(robot.placement(link).translation for link in links)
        for link in links:
            controller.task(link).target = middle
        for _ in range(100):
            if read:
                assert limit.distances
            found.append(np.array(controller.solve().accelerations))
            v = robot.v + 0.005 * found[-1]
            robot.update(pin.integrate(robot.model, robot.q, 0.005 * v), v)
        return np.array(found)

    def made() -> tuple[wbc.Controller, wbc.CollisionLimit]:
        controller = wbc.Controller(description("g1").robot(), 0.005)
        controller.add(wbc.PostureTask(), wbc.SoleContact("left_foot"), wbc.SoleContact("right_foot"))
        controller.add(*(wbc.PositionTask(link, weight=50.0, name=link) for link in links))
        limit = wbc.CollisionLimit([tuple(links)], shapes={link: shapes[link] for link in links})
        controller.add(wbc.JointLimits(), wbc.TorqueLimits(), limit)
        return controller, limit

    first = made()
    once = run(*first)
    assert min(first[1].distances.values()) < 0.03  # the hands meet
    np.testing.assert_array_equal(run(*first), once)
    np.testing.assert_array_equal(run(*made(), read=True), once)
