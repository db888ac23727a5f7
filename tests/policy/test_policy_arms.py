"""Arms beside a policy: by the QP, and filtered."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from made_policies import ARMS, DT, G1, REST, Known, bobbing, control, resting, ticks
from properties import by_default, each_once

import wbc
from wbc.base.errors import WbcError
from wbc.policy import PolicyControl, PolicyFilter, Term
from wbc.policy.arms import MovedArms
from wbc.policy.filter import AHEAD, LASTS, REACH
from wbc.tasks import JointTorqueTask, RelativeFrameTask


def hands_error(plant: wbc.Plant, policy: PolicyControl, carried: bool = True) -> float:
    """Greatest distance of the left hand from its place before the pelvis between 0.5 s and 1 s, m."""
    task = policy.controller.add(
        RelativeFrameTask("left_rubber_hand", "pelvis", axes=("x", "y", "z"), weight=10.0, stiffness=400.0)
    )
    task.target = pin.SE3(task.target.rotation, np.array([0.3, 0.15, 0.2]))
    if not carried:
        policy._arms._carried.measured = lambda measurement: None  # type: ignore[method-assign]
    policy.velocity = (0.1, 0.0, 0.0)
    truth, worst = G1.robot(), 0.0
    while plant.time < 1.0:
        plant.step(policy.command(plant.measure()))
        state = plant.truth()
        truth.update(np.array(state.q), np.array(state.v))
        place = truth.placement("pelvis").actInv(truth.placement("left_rubber_hand")).translation
        if plant.time > 0.5:
            worst = max(worst, float(np.linalg.norm(place - task.target.translation)))
    assert policy.status() == "ok"
    return worst


def test_hands_of_the_qp_stay_while_the_policy_moves_the_pelvis() -> None:
    """The pelvis moves up and down by its IMU's acceleration: without it the hands lag."""
    error, blind = hands_error(*bobbing(arms=ARMS)), hands_error(*bobbing(arms=ARMS), carried=False)
    assert error < 1e-3 and blind > 3.0 * error


@pytest.mark.parametrize("sees", by_default([False, True], False))
def test_a_policy_sees_the_arms_of_the_qp_at_rest_or_as_they_are(sees: bool) -> None:
    plant, policy = bobbing(arms=ARMS, sees_arms=sees)
    policy.posture.target = {"left_elbow_joint": REST["left_elbow_joint"] + 0.3}
    elbow = G1.joint_names.index("left_elbow_joint")
    for _ in ticks(1.0):
        plant.step(policy.command(plant.measure()))
    seen = policy.network.seen[-1][2 + elbow]
    assert policy.drives.observer.robot.q[7 + elbow] - REST["left_elbow_joint"] == pytest.approx(
        0.3, abs=0.03
    )
    assert seen == pytest.approx(0.3, abs=0.03) if sees else seen == 0.0


def test_arms_without_a_solution_are_damped_and_the_policy_goes_on() -> None:
    plant, policy = bobbing(arms=ARMS)
    for place in (0.0, 1.0):
        policy.controller.add(
            wbc.tasks.PositionTask(
                "left_rubber_hand", hard=True, target=np.full(3, place), name=f"at {place}"
            )
        )
    knee, elbow = (G1.joint_names.index(f"left_{part}_joint") for part in ("knee", "elbow"))
    for _ in ticks(0.4):
        measurement = plant.measure()
        command = policy.command(measurement)
        assert command.kp[knee] > 0.0 and command.kp[elbow] == 0.0
        assert command.joint_torque[elbow] * measurement.joint_velocity[elbow] <= 0.0
        plant.step(command)
    assert "arms damped: " in policy.status() and policy.fallen is None


def filtered(
    wish: dict[str, float], limits: Sequence[Any] = (), period: float = DT, **options: Any
) -> tuple[wbc.Plant, PolicyControl]:
    """Return a policy whose joints stay in half-sitting but for those of a wish, rad, with a filter of its arms."""
    n = len(G1.joint_names)
    description = resting(
        observation=(Term("gravity"),),
    )
    action = [wish.get(name, REST[name]) - REST[name] for name in G1.joint_names]
    return control(Known(3, n, action), description, period, filter=PolicyFilter(ARMS, limits, **options))


def test_a_filter_changes_nothing_that_no_limit_asks_for() -> None:
    plant, policy = filtered({"left_elbow_joint": REST["left_elbow_joint"] + 0.2})
    asked = []
    for k in ticks(0.5):
        m = plant.measure()
        command = policy.command(m)
        if k > len(ticks(0.1)):
            asked.append(np.abs(policy.changed).max())
        made = command.joint_torque + command.kp * (command.joint_position - m.joint_position)
        made += command.kd * (command.joint_velocity - m.joint_velocity)
        (kp, kd), target = policy.gains, policy._joints.target
        wish = kp * (target - m.joint_position) - kd * m.joint_velocity
        np.testing.assert_allclose(made, wish + policy.changed, atol=1e-9)
        plant.step(command)
    assert max(asked) < 0.01


def test_arms_that_a_policy_sends_through_the_trunk_stop_before_it() -> None:
    wish = {"left_shoulder_roll_joint": -1.0, "left_elbow_joint": 1.2, "left_shoulder_yaw_joint": -1.2}
    pairs = [
        ("left_rubber_hand", "torso_link"),
        ("left_rubber_hand", "pelvis"),
        ("left_wrist_roll_link", "torso_link"),
    ]

    def nearest(limit: bool) -> float:
        shapes = G1.collision_shapes()
        limits = [wbc.CollisionLimit(pairs, shapes=shapes, recovery=100.0, influence=0.5)] if limit else []
        plant, policy = filtered(wish, limits)
        gauge = wbc.Controller(G1.robot(), DT)
        near = gauge.add(wbc.CollisionLimit(pairs, shapes=shapes))
        least = math.inf
        while plant.time < 0.8 and least >= 0.0:
            for _ in ticks(0.02):
                plant.step(policy.command(plant.measure()))
            state = plant.truth()
            gauge.update(np.array(state.q), np.array(state.v))
            gauge.solve()
            least = min(least, *near.distances.values())
        assert "not filtered" not in policy.status()
        return least

    assert nearest(limit=False) < 0.0
    assert nearest(limit=True) > 0.01


def test_a_filter_is_the_qp_of_the_whole_robot_with_the_torques_of_the_policy_as_cost() -> None:
    """Base, legs and waist are known there by their own rows, and drop out of the filter's QP."""
    wish = {"left_shoulder_roll_joint": -1.0, "left_elbow_joint": 1.2, "right_elbow_joint": -9.0}
    pairs = [("left_rubber_hand", "torso_link"), ("left_wrist_roll_link", "torso_link")]

    def limits() -> list[Any]:
        return [wbc.CollisionLimit(pairs, shapes=G1.collision_shapes(), recovery=100.0, influence=0.5)]

    plant, policy = filtered(wish, limits(), reaction=1e6)
    filters, robot = policy._arms, policy.controller.robot
    filters._stop = lambda *limits: None  # type: ignore[method-assign]  # which brakes harder
    whole = MovedArms(wbc.Controller(robot, DT, regularisation=1e-10), ARMS, *np.zeros((2, robot.na)))
    whole.controller.remove(whole.posture, *whole.controller.limits)
    weight = 1.0 / np.square(robot.torque_limit[15:])
    cost = whole.controller.add(JointTorqueTask(joints=list(ARMS), weight=weight))
    whole.controller.add(
        wbc.JointLimits(velocity_ratio=0.25, margin=0.03, joints=ARMS), wbc.TorqueLimits(), *limits()
    )
    whole._carried.measured = lambda measurement: None  # type: ignore[method-assign]
    whole.controller.solve()
    whole.controller._assembly._cut_demands = lambda: None  # type: ignore[method-assign]
    solve, changed, arms = filters._solve, 0, filters._columns

    def noted(measurement: wbc.Measurement, wish: np.ndarray, bounds: Any) -> np.ndarray:
        cost.target = wish.copy()
        return solve(measurement, wish, bounds)

    filters._solve = noted  # type: ignore[method-assign]
    for _ in ticks(0.3):
        measurement = plant.measure()
        command = policy.command(measurement)
        made = (policy.asked(measurement) + policy.changed)[15:]
        whole._carried.acceleration[:] = filters._carried.acceleration
        whole._others.feedforward_acceleration = filters._others.feedforward_acceleration
        torques, problem = whole.torques(measurement), whole.controller.problem
        if not filters.remark and whole.controller.solution.ok:
            costs = [float(weight @ np.square(each - cost.target)) for each in (made, torques)]
            assert costs[0] <= costs[1] + 1e-5
            x, rows = whole.controller.solution.variables.copy(), problem.torque_matrix[15:]
            x[arms] += np.linalg.solve(rows[:, arms], made - torques)
            beyond = np.maximum(
                problem.inequality @ x - problem.upper, problem.lower - problem.inequality @ x
            )
            assert beyond.max() < 0.02  # rad/s² and m/s²
            changed += costs[0] > 0.1
        plant.step(command)
    assert changed > len(ticks(0.06))


def test_stops_hold_in_a_filter_whatever_a_policy_asks_for() -> None:
    wish = {
        "left_elbow_joint": -9.0,
        "right_shoulder_roll_joint": -9.0,
        "right_wrist_roll_joint": 9.0,
        "waist_yaw_joint": 9.0,
    }
    plant, policy = filtered(wish)
    robot, over = G1.robot(), np.zeros(len(G1.joint_names))
    while plant.time < 0.6:
        plant.step(policy.command(plant.measure()))
        q = np.array(plant.truth().q[7:])
        over = np.maximum(over, np.maximum(robot.position_lower - q, q - robot.position_upper))
    assert over.max() < 2e-3


def test_arms_that_a_policy_throws_push_the_base_no_more_than_it_bears() -> None:
    wish = {f"{side}_shoulder_pitch_joint": -9.0 for side in ("left", "right")}

    def thrown(reaction: float) -> tuple[float, float]:
        """Greatest angular momentum of the arms about the base, Nms, and its greatest rate within 10 ms, Nm."""
        plant, policy = filtered(wish, period=0.002, reaction=reaction)
        robot, momentum = G1.robot(), []
        while plant.time < 0.15:
            plant.step(policy.command(plant.measure()))
            truth = plant.truth()
            robot.update(np.array(truth.q), np.array(truth.v))
            momentum.append(robot.mass_matrix[3:6, 21:] @ robot.v[21:])
        known = np.array(momentum)
        return float(np.abs(known).max()), float(np.abs(known[5:] - known[:-5]).max()) / 0.01

    momentum, rate = thrown(1000.0)
    assert momentum > 2.0 and rate > 30.0
    momentum, rate = thrown(20.0)
    assert momentum < 1.1 * 20.0 * LASTS and rate < 20.0


def braked(room: float, speed: float, upper: bool, **options: Any) -> tuple[float, float]:
    """Let a forearm move towards a stop, rad and rad/s, and return its deceleration, rad/s², and its torque, Nm."""
    plant, policy = filtered({}, **options)
    plant.step(policy.command(plant.measure()))
    robot, filters, sign = policy.controller.robot, policy._arms, 1.0 if upper else -1.0
    elbow = G1.joint_names.index("left_elbow_joint")
    stop = (robot.position_upper if upper else robot.position_lower)[elbow]
    q, v = np.array(robot.q), np.zeros(robot.nv)
    q[7 + elbow], v[6 + elbow] = stop - sign * room, sign * speed
    robot.update(q, v)
    wish, most = np.zeros(14), robot.torque_limit[15:]
    for _ in range(2):  # the change of the inertia since the last tick counts
        made = filters._solve(plant.measure(), wish, (-most, most))
    columns = filters._columns
    inertia = robot.mass_matrix[columns][:, columns]
    acceleration = filters._acceleration[columns] + np.linalg.solve(inertia, made - wish)
    return -sign * float(acceleration[elbow - 15]), -sign * float(made[elbow - 15])


@pytest.mark.parametrize("reaction", [None, 1e-3])
@pytest.mark.parametrize("upper", [False, True])
def test_an_arm_that_is_too_fast_for_its_usual_braking_stops_before_its_stop(
    upper: bool, reaction: float | None
) -> None:
    """Its base bears the reaction, whatever the bound on it: stops come first."""
    braking, _ = braked(0.2, 6.0, upper, reaction=reaction)
    assert 0.2 - 0.02 * 6.0 > 6.0**2 / (2.0 * braking) > 0.06


@pytest.mark.parametrize("upper", [False, True])
def test_an_arm_that_nothing_stops_in_time_brakes_as_hard_as_it_can(upper: bool) -> None:
    """It needs 17,000 rad/s²: with them it would be faster in the other direction than it may be, a tick later."""
    assert braked(0.16, 13.0, upper)[1] == pytest.approx(25.0, abs=0.5)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: bobbing(arms=("left_knee_joint",)), "legs"),
        (lambda: bobbing(arms=("left_gripper",)), "left_gripper"),
        (lambda: bobbing(arms=(*ARMS, ARMS[0])), "distinct"),
        (lambda: bobbing(arms=ARMS)[1].release(["left_elbow_joint"]), "shared"),
        (lambda: bobbing(arms=ARMS, filter=PolicyFilter(ARMS)), "filter"),
        (lambda: bobbing(filter=PolicyFilter(["left_knee_joint"])), "legs"),
        (lambda: bobbing(filter=PolicyFilter(ARMS))[1].controller.add(wbc.PostureTask()), "tasks"),
        (lambda: bobbing()[1].controller.add(wbc.PostureTask()), "tasks"),
    ],
)
def test_arms_that_qp_or_filter_cannot_have_are_refused(call: Callable[[], object], named: str) -> None:
    with pytest.raises(WbcError, match=named):
        call()


@pytest.mark.parametrize("upper", [True, False])
def test_a_leg_is_braked_before_its_stop_by_the_room_that_is_left(upper: bool) -> None:
    """Its torque towards the stop is at most τ_max / REACH times the room that is left after AHEAD at its speed."""
    plant, policy = filtered({})
    measurement = plant.measure()
    policy.command(measurement)
    safe, robot = policy._arms, policy.drives.observer.robot
    knee, room = robot.joint_index("left_knee_joint"), 0.4 * REACH
    speed = (0.1 if upper else -0.1) * REACH / AHEAD  # in AHEAD it covers a tenth of REACH
    robot.v[:] = 0.0
    robot.v[6 + knee] = speed
    q = np.array(robot.q)
    q[7 + knee] = robot.position_upper[knee] - room if upper else robot.position_lower[knee] + room
    robot.q[:] = q
    asked = np.zeros(robot.na)
    asked[knee] = 1e3 if upper else -1e3
    torque = safe.near(measurement, asked)[knee]
    assert torque == pytest.approx((1.0 if upper else -1.0) * 0.3 * robot.torque_limit[knee], rel=1e-6)


def test_arms_that_fail_are_said_to_once_until_they_have_worked_again(
    caplog: pytest.LogCaptureFixture,
) -> None:
    plant, policy = bobbing(arms=ARMS)
    arms, measurement = policy._arms, plant.measure()
    policy.command(measurement)
    works = arms._solve
    caplog.clear()
    for failing, said in ((True, 1), (True, 1), (False, 1), (True, 2)):
        arms._solve = fails if failing else works
        arms.torques(measurement)
        assert sum("no torques for the arms" in record.message for record in caplog.records) == said


@pytest.mark.parametrize(
    ("of_the_qp", "signal"), each_once((True, False), ("specific_force", "angular_velocity"))
)
def test_arms_work_again_after_an_imu_that_was_lost(of_the_qp: bool, signal: str) -> None:
    """It is lost until ticks fail, and turns meanwhile: what it turned by is the work of no single tick."""
    plant, policy = bobbing(**{"arms": ARMS} if of_the_qp else {"filter": PolicyFilter(ARMS)})
    carried, failed = policy._arms._carried, 0
    while plant.time < 0.4:
        measurement, lost = plant.measure(), 0.1 <= plant.time < 0.18
        if lost:
            measurement = replace(measurement, **{signal: np.full(3, np.nan)})
        before = carried.acceleration.copy()
        command = policy.command(measurement)
        failed += policy.drives.failing
        if policy.drives.failing:
            np.testing.assert_array_equal(carried.acceleration, before)
        assert np.isfinite(carried.acceleration).all() and np.isfinite(command.joint_torque).all()
        plant.step(command)
    assert failed > len(ticks(0.02)) and policy.status() == "ok" and policy.fallen is None


def test_the_bound_of_the_reaction_is_that_of_the_momentum_after_lost_ticks() -> None:
    """Arms have moved in them: by how much their inertia about the base has changed is the work of no single tick."""
    plant, policy = filtered({})
    robot, arms = policy.controller.robot, policy._arms
    policy.command(plant.measure())
    q, v = np.array(robot.q), np.zeros(robot.nv)
    q[7 + 15 :] += 0.5
    v[6 + 15 :] = 0.5
    robot.update(q, v)
    arms.forget_rate()
    arms.near(plant.measure(), np.zeros(robot.na))
    share = robot.mass_matrix[3:6, 6 + 15 :] @ v[6 + 15 :] / (arms._reaction * LASTS)
    assert np.abs(share).max() > 0.1
    np.testing.assert_allclose(arms._upper[-3:], arms._reaction * np.clip(1.0 - share, -1.0, 1.0), atol=1e-12)
    np.testing.assert_allclose(
        arms._lower[-3:], arms._reaction * np.clip(-1.0 - share, -1.0, 1.0), atol=1e-12
    )


def test_torques_of_filtered_arms_keep_their_rate_from_what_was_commanded_last() -> None:
    """After lost ticks there is no last command. A limit that raises leaves no rows of an earlier tick behind."""

    class Broken(wbc.FramePositionLimit):
        breaks = False

        def write(self, dt: float, matrix: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> None:
            if self.breaks:
                raise ValueError("a limit of the user")
            super().write(dt, matrix, lower, upper)

    plant, policy = filtered({}, [limit := Broken("left_rubber_hand", lower=(-9.0, -9.0, -9.0))])
    controller = policy.controller
    controller.remove(next(each for each in controller.limits if isinstance(each, wbc.TorqueLimits)))
    controller.add(wbc.TorqueLimits(rate=100.0))
    robot, arms = controller.robot, policy._arms
    asked = np.zeros(robot.na)
    arms.near(measurement := plant.measure(), asked)
    asked[15] = 5.0
    np.testing.assert_allclose(arms.near(measurement, asked)[15], 100.0 * DT)
    arms.forget_rate()
    np.testing.assert_allclose(arms.near(measurement, asked)[15], 5.0)
    limit.breaks = True
    arms.near(measurement, np.zeros(robot.na))
    assert "a limit of the user" in arms.failure
    limit.breaks = False
    q, v = np.array(robot.q), np.zeros(robot.nv)
    q[7 + 15 :] += 0.5
    v[6 + 15 :] = 0.5
    robot.update(q, v)
    arms.near(measurement, np.zeros(robot.na))
    share = robot.mass_matrix[3:6, 6 + 15 :] @ v[6 + 15 :] / (arms._reaction * LASTS)
    np.testing.assert_allclose(arms._upper[-3:], arms._reaction * np.clip(1.0 - share, -1.0, 1.0), atol=1e-12)


def test_the_rate_of_a_carried_frame_is_differentiated_over_one_tick_alone() -> None:
    plant, policy = bobbing(arms=ARMS)
    measurement = plant.measure()
    policy.command(measurement)
    carried = policy._arms._carried
    before = carried.acceleration.copy()
    for reading in (math.nan, math.inf):
        carried.measured(replace(measurement, specific_force=np.full(3, reading)))
        np.testing.assert_array_equal(carried.acceleration, before)
    turned = replace(measurement, angular_velocity=np.full(3, 1.0))
    carried.measured(turned)
    np.testing.assert_array_equal(carried.acceleration[3:], before[3:])
    carried.measured(replace(turned, angular_velocity=np.full(3, 1.1)))
    assert (carried.acceleration[3:] > before[3:]).all()


def fails(measurement: object) -> None:
    raise ValueError("a task of the user")
