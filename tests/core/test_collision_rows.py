"""Rows of limits on collisions: corners and faces of shapes, and motions of shapes of any kind."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import pytest
from collision_layouts import CONTROLS, panda, run
from properties import by_default

import wbc
from wbc.base.numbers import Array
from wbc.core.robot import Robot


def step_rows(limit: wbc.CollisionLimit, robot: Robot) -> tuple[Array, Array]:
    rows, lower, upper = np.zeros((limit.dim, robot.nv)), np.zeros(limit.dim), np.zeros(limit.dim)
    limit.write_step(rows, lower, upper)
    return rows[np.isfinite(lower)], -lower[np.isfinite(lower)]


def test_every_corner_of_a_box_above_a_plane_has_its_height() -> None:
    robot, rng = panda().robot(), np.random.default_rng(2)
    size, floor = np.array([0.2, 0.06, 0.1]), wbc.Obstacle("floor", wbc.CollisionHalfSpace())
    box = {"panda_hand": wbc.CollisionBox(tuple(size.tolist()))}
    limit = wbc.CollisionLimit(
        obstacles=[floor], against=["panda_hand"], shapes=box, margin=0.0, influence=2.0
    )
    limit.bind(robot)
    corners = 0.5 * size * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    for _ in range(10):
        robot.update_jacobians(pin.integrate(robot.model, robot.q, 0.1 * rng.normal(size=robot.nv)))
        hand = robot.placement("panda_hand")
        heights = np.sort(corners.dot(hand.rotation[2]) + hand.translation[2])
        up = np.array([0.0, 0.0, heights[0] - 0.03])
        floor.placement = pin.SE3(np.eye(3), up)
        found = np.sort(step_rows(limit, robot)[1])
        expected = heights[:4] - up[2]
        assert found == pytest.approx(expected[expected < 0.1], abs=1e-6)


@pytest.mark.parametrize("turn", [0.3, -0.8, 2.0])
def test_corners_of_what_a_box_faces_have_their_depth_and_its_derivative(turn: float) -> None:
    """A small box below the flat side of a larger one at a hand: corners of the second shape, by plane geometry."""
    robot, half, small = panda().robot(), 0.05, np.array([0.03, 0.02, 0.025])
    under = wbc.Obstacle("box", wbc.CollisionBox(tuple((2.0 * small).tolist())))
    limit = wbc.CollisionLimit(
        obstacles=[under],
        against=["panda_hand"],
        shapes={"panda_hand": wbc.CollisionBox((0.4, 0.4, 2.0 * half))},
        margin=0.0,
        influence=0.5,
    )
    limit.bind(robot)
    rng = np.random.default_rng(4)
    robot.update_jacobians(pin.integrate(robot.model, robot.q, 0.2 * rng.normal(size=robot.nv)))
    q, hand = np.array(robot.q), pin.SE3(robot.placement("panda_hand"))
    tilt = pin.exp3(np.array([0.05, -0.03, turn]))
    under.placement = hand * pin.SE3(tilt, np.array([0.04, -0.05, -half - 0.06]))
    corners = small * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    points = [under.placement.act(corner) for corner in corners]

    def depths() -> np.ndarray:
        place = robot.placement("panda_hand")
        return np.sort([-place.actInv(point)[2] - half for point in points])[:4]

    rows, room = step_rows(limit, robot)
    order = np.argsort(room)
    assert room[order] == pytest.approx(depths(), abs=1e-6)
    for v in rng.normal(size=(5, robot.nv)):
        ends = []
        for step in (1e-6, -1e-6):
            robot.update_jacobians(pin.integrate(robot.model, q, step * v))
            ends.append(depths())
        assert (rows @ v)[order] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-5)


def test_no_row_holds_the_spin_of_a_cylinder_about_its_axis() -> None:
    robot = panda().robot()
    cylinder = wbc.CollisionCylinder(0.05, (0.0, 0.0, 0.0), (0.0, 0.0, 0.1))
    table = wbc.Obstacle("table", wbc.CollisionBox((0.6, 0.6, 0.1)))
    hand = robot.placement("panda_hand")
    limit = wbc.CollisionLimit(obstacles=[table], against=["panda_hand"], shapes={"panda_hand": cylinder})
    limit.bind(robot)
    for tilt in ([0.0, 0.0, 0.0], [0.05, 0.03, 0.0], [1.5, 0.0, 0.3]):
        table.placement = hand * pin.SE3(
            pin.exp3(np.array(tilt)), np.array([0.02, 0.0, 0.1 + 0.07 + 0.2 * max(tilt)])
        )
        rows, _ = step_rows(limit, robot)
        assert len(rows) > 2
        assert (
            abs(rows[:, 6]).max() < 1e-4 < abs(rows).max()
        )  # the last joint turns the hand about its z axis


def test_corners_follow_the_edge_of_a_floor_whose_origin_is_far_away() -> None:
    """A tilted box slides over the edge: its corners and crossings are those of a limit that has just been made."""
    robot, tilt = panda().robot(), pin.exp3(np.array([0.04, -0.06, 0.3]))
    here = robot.placement("panda_hand") * pin.SE3(tilt, np.array([0.0, 0.0, 0.05 + 0.04]))
    floor = wbc.Obstacle("floor", wbc.CollisionBox((20.0, 20.0, 0.1)))
    box = {"panda_hand": wbc.CollisionBox((0.1, 0.2, 0.1))}

    def made() -> wbc.CollisionLimit:
        limit = wbc.CollisionLimit(obstacles=[floor], against=["panda_hand"], shapes=box)
        limit.bind(robot)
        return limit

    kept: wbc.CollisionLimit | None = None
    for way in np.arange(0.0, 0.06, 0.004):
        floor.placement = here * pin.SE3(np.eye(3), np.array([10.0 - 0.04 + way, 0.0, 0.05]))
        kept = kept or made()
        found, fresh = (np.sort(step_rows(limit, robot)[1]) for limit in (kept, made()))
        assert found.size == fresh.size > 3 and found == pytest.approx(fresh, abs=3e-4)


def check(seeds: Sequence[int], control: str) -> None:
    """In no period shapes come closer by more than 3/2 θ² ℓ, by less than 1 mm in all, and they come to rest."""
    outcomes = [outcome for seed in seeds if (outcome := run(seed, control)) is not None]
    assert len(outcomes) > 0.6 * len(seeds) and not any(outcome.unsolved for outcome in outcomes)
    assert max(outcome.steepest for outcome in outcomes) < 1.5
    worst = max(outcomes, key=lambda outcome: outcome.deepest)
    assert worst.deepest < 1e-3, worst
    assert np.mean([outcome.jump < 0.05 for outcome in outcomes]) > 0.9


@pytest.mark.parametrize(
    ("control", "layouts"),
    [
        ("kinematics", range(3)),
        ("torque", range(16, 19)),
        pytest.param("kinematics", range(3, 320), marks=pytest.mark.slow),
        pytest.param("torque", (*range(16), *range(19, 230)), marks=pytest.mark.slow),
    ],
)
def test_shapes_of_any_kind_keep_the_margin_before_a_target_behind_an_obstacle(
    control: str, layouts: Sequence[int]
) -> None:
    check(layouts, control)


@pytest.mark.parametrize("seed", by_default([5222, 2891], 5222))
def test_a_shape_that_whirls_around_a_ball_comes_no_closer_with_time(seed: int) -> None:
    """At the greatest joint speeds the curvature of the way adds up: 1.2 and 0.4 mm if it did not count."""
    outcome = run(seed, "kinematics")
    assert outcome is not None and outcome.deepest < 5e-5


@pytest.mark.parametrize("seed", by_default([5217, 5447], 5217))
def test_flat_sides_come_to_rest_beside_a_ball(seed: int) -> None:
    """With a row for the nearest points alone they roll to and fro, with changes of 0.2 and 0.5 rad/s in a period."""
    outcome = run(seed, "kinematics")
    assert outcome is not None and outcome.jump < 0.03


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("control", CONTROLS)
def test_shapes_of_any_kind_keep_the_margin_in_ten_thousand_layouts(control: str) -> None:
    check(range(1000, 11000), control)
