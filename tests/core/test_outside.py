"""Outside wrench: a momentum observer against wrenches that are known."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest

from wbc.core.estimation.outside import OutsideSettings, OutsideWrench, moment_about
from wbc.core.limits.com_polygon import CoMPolygonLimit
from wbc.core.robot import GRAVITY, Robot
from wbc.robots import load
from wbc.tasks import CoMTask, MomentumTask

DESCRIPTION = load("hrp4_class")
DT = 0.005
NO_TARE = OutsideSettings(tare=0.0)
EMPTY = np.zeros(6)


def feet_wrenches(robot: Robot, total: np.ndarray) -> np.ndarray:
    """A wrench [force; moment] at the world origin, half of it on each sole, in the sole frames."""
    return np.array(
        [robot.placement(sole.frame).actInv(pin.Force(0.5 * total)).vector for sole in robot.soles]
    )


def at_rest(robot: Robot, hand: np.ndarray = EMPTY) -> np.ndarray:
    """Wrenches of the feet of a robot at rest on whose left hand the surroundings put a wrench, world axes."""
    point = robot.placement(robot.frames["left_hand"]).translation
    outside = np.concatenate([hand[:3], hand[3:] + np.cross(point, hand[:3])])
    weight = np.concatenate(
        [[0.0, 0.0, -robot.mass * GRAVITY], np.cross(robot.com, [0.0, 0.0, -robot.mass * GRAVITY])]
    )
    return feet_wrenches(robot, -weight - outside)


def test_a_step_of_force_is_followed_as_a_first_order_lag() -> None:
    robot = DESCRIPTION.robot()
    observer = OutsideWrench(robot, NO_TARE)
    observer.update(at_rest(robot), 0.0)
    force = np.array([12.0, -7.0, -30.0, 0.4, -0.3, 0.2])
    point = robot.placement(robot.frames["left_hand"]).translation
    about_com = np.concatenate([force[:3], force[3:] + np.cross(point - robot.com, force[:3])])
    for tick in range(1, 81):
        observer.update(at_rest(robot, force), DT)
        wrench = observer.wrench
        share = 1.0 - math.exp(-NO_TARE.bandwidth * DT * tick)
        assert wrench == pytest.approx(share * about_com, abs=1e-9)
    assert moment_about(wrench, robot.com.tolist(), point.tolist()) == pytest.approx(
        share * force[3:], abs=1e-9
    )


def test_a_moving_robot_with_empty_hands_feels_nothing_and_a_known_force_exactly() -> None:
    """Feet that give what inverse dynamics asks for, less the force on a hand; any motion of all joints."""
    robot = DESCRIPTION.robot()
    model, data = robot.model, robot.model.createData()
    rng, dt = np.random.default_rng(2), 1e-4
    settings = OutsideSettings(tare=0.0, bandwidth=100.0)
    observer = OutsideWrench(robot, settings)
    q, v = np.array(robot.half_sitting), 0.3 * rng.normal(size=robot.nv)
    acceleration, force = rng.normal(size=robot.nv), np.array([5.0, 3.0, -20.0])
    hand = robot.frames["left_hand"]
    robot.update(q, v)
    observer.update(at_rest(robot), 0.0)
    for _ in range(2000):
        middle = pin.integrate(model, q, 0.5 * dt * v)
        needed = pin.rnea(model, data, middle, v + 0.5 * dt * acceleration, acceleration)[:6]
        base = pin.SE3(data.liMi[1])
        q, v = pin.integrate(model, q, dt * (v + 0.5 * dt * acceleration)), v + dt * acceleration
        robot.update(q, v)
        point = robot.placement(hand).translation
        outside = np.concatenate([force, np.cross(point, force)])
        observer.update(feet_wrenches(robot, base.act(pin.Force(needed)).vector - outside), dt)
    known = np.concatenate([force, np.cross(point - robot.com, force)])
    assert observer.wrench == pytest.approx(known, abs=0.1)


def test_what_the_model_explains_in_the_middle_of_a_tare_is_no_part_of_it() -> None:
    """The tare is the error of sensors and model, whenever the model has learnt of the load in the hand."""
    robot = DESCRIPTION.robot()
    observer = OutsideWrench(robot, OutsideSettings(settling=0.2, tare=0.5, bandwidth=150.0))
    load, error = np.array([3.0, 0.0, -8.0, 0.2, 1.0, 0.0]), np.array([2.0, 0.0, -5.0, 0.0, 1.0, 0.0])
    arm = robot.placement(robot.frames["left_hand"]).translation - robot.com
    for tick in range(200):
        if tick == 90:
            observer.explain([*load[:3], *(load[3:] + np.cross(arm, load[:3]))])
        observer.update(at_rest(robot, error + load if tick < 90 else error), DT if tick else 0.0)
        assert observer.ready or not observer.wrench.any()
    about_com = np.concatenate([error[:3], error[3:] + np.cross(arm, error[:3])])
    assert observer.tare == pytest.approx(about_com, abs=1e-6)
    assert observer.wrench == pytest.approx(EMPTY, abs=1e-6)


@pytest.mark.parametrize("share", [0.02, 0.05, 0.1, -0.06])
def test_what_hands_bear_from_the_start_is_no_tare_unless_they_are_said_to_be_empty(share: float) -> None:
    """A tare is an error of sensors and model, up to 3 % of the weight; a load, or a rope, is more."""
    robot = DESCRIPTION.robot()
    observer = OutsideWrench(robot, OutsideSettings(settling=0.1, tare=0.2, bandwidth=150.0))
    borne = np.array([0.0, 0.0, -share * robot.mass * GRAVITY, 0.0, 0.0, 0.0])

    def rest(ticks: int) -> np.ndarray:
        for _ in range(ticks):
            observer.update(at_rest(robot, borne), DT)
        assert observer.ready
        return observer.wrench

    assert rest(70)[2] == pytest.approx(0.0 if abs(share) < 0.03 else borne[2], abs=1e-6)
    observer.take_tare()
    observer.update(at_rest(robot, borne), DT)
    assert not observer.ready and not observer.wrench.any()
    assert rest(70)[2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (0.1, 0.05, -0.2)])
def test_a_load_in_the_model_is_a_mass_at_its_place(point: tuple[float, float, float]) -> None:
    """CoM, mass and weight are those of robot and load, of the robot and of its clone, and go with the load."""
    robot = DESCRIPTION.robot()
    clone, frame = robot.clone(), robot.frames["left_hand"]
    mass, com = robot.mass, np.array(robot.com)
    robot.carry(frame, 5.0, point)
    for each in (robot, clone):
        each.update(each.q, each.v)
        place = each.placement(frame).act(np.array(point))
        assert each.mass == pytest.approx(mass + 5.0)
        assert each.com == pytest.approx((mass * com + 5.0 * place) / (mass + 5.0), abs=1e-12)
        assert each.bias[2] == pytest.approx((mass + 5.0) * GRAVITY)
    robot.carry(frame, 0.0)
    assert robot.mass == pytest.approx(mass + 5.0)  # all as they were, until the next update
    robot.update(robot.q, robot.v)
    assert robot.mass == pytest.approx(mass) and np.array(robot.com) == pytest.approx(com, abs=1e-12)


@pytest.mark.parametrize("clone", [False, True])
def test_a_load_between_update_and_solution_accelerates_nothing(clone: bool) -> None:
    """The CoM of a robot at rest does not accelerate by itself, whichever robot of the model takes the load."""
    robot = DESCRIPTION.robot()
    items = CoMTask(), MomentumTask(), CoMPolygonLimit()
    for item in items:
        item.bind(robot)
    (robot.clone() if clone else robot).carry("left_hand", 5.0)
    try:
        for _ in range(2):
            for task in items[:2]:
                np.testing.assert_allclose(task.evaluated()[2][:3], 0.0, atol=1e-9)
            np.testing.assert_allclose(items[2].drift(), 0.0, atol=1e-9)
            robot.update(robot.q, robot.v)
    finally:
        robot.carry("left_hand", 0.0)


@pytest.mark.parametrize(("learnt", "later"), [(0.0, 2.9), (1.2, 0.7), (-2.5, 2.9)])
def test_a_tare_that_is_learnt_in_one_heading_is_taken_off_in_another_one(
    learnt: float, later: float
) -> None:
    """All six parts of an error of sensors and model turn with the base, which also bends over."""
    robot = DESCRIPTION.robot()
    observer = OutsideWrench(robot, OutsideSettings(settling=0.1, tare=0.2, bandwidth=150.0))
    error = np.array([2.0, -1.5, -5.0, 0.7, 1.0, -0.4])
    for yaw, ticks in ((learnt, 80), (later, 250)):
        turn, bends = pin.rpy.rpyToMatrix(0.0, 0.0, yaw), (0.2, 0.4) if yaw == later else (0.0, 0.0)
        q = np.array(robot.half_sitting)
        q[3:7] = pin.Quaternion(turn @ pin.rpy.rpyToMatrix(*bends, 0.0)).coeffs()
        robot.update(q, np.zeros(robot.nv))
        force, moment = turn @ error[:3], turn @ error[3:]
        about_com = moment + np.cross(robot.com - robot.placement("left_hand").translation, force)
        for tick in range(ticks):
            hand = np.concatenate([force, about_com])
            observer.update(at_rest(robot, hand), DT if tick or yaw == later else 0.0)
    assert observer.ready
    np.testing.assert_allclose(observer.wrench, 0.0, atol=1e-6)


def test_a_foot_that_meets_the_ground_makes_the_observer_wait() -> None:
    """From 8 % of the weight on, having left it at 4 %: its blow is no force from outside."""
    robot = DESCRIPTION.robot()
    weight = robot.mass * GRAVITY

    def wrenches(share: float) -> np.ndarray:
        found = at_rest(robot)
        found[1] = (0.0, 0.0, share * weight, 0.0, 0.0, 0.0)
        return found

    for low, high, waits in ((0.041, 0.081, False), (0.039, 0.079, False), (0.039, 0.081, True)):
        observer = OutsideWrench(robot, NO_TARE)
        observer.update(at_rest(robot), 0.0)
        observer.update(wrenches(low), DT)
        before = np.array(observer.wrench)
        observer.update(wrenches(high), DT)
        assert np.array_equal(observer.wrench, before) is waits
        ticks = 0
        while np.array_equal(observer.wrench, before) and ticks < 1000:
            observer.update(wrenches(high), DT)
            ticks += 1
        assert ticks == (round(NO_TARE.wait / DT) if waits else 0)
