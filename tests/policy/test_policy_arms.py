"""Arms beside a policy: by the QP, and filtered."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from made_policies import ARMS, DT, G1, REST, Known, bobbing, control, resting

import wbc
from wbc.base.errors import InputError, WbcError
from wbc.policy import PolicyControl, PolicyFilter, Term
from wbc.tasks import RelativeFrameTask


def hands_error(plant: wbc.Plant, policy: PolicyControl, carried: bool = True) -> float:
    """Greatest distance of the left hand from its place before the pelvis, m, after 1.5 s of 3 s."""
    task = policy.controller.add(
        RelativeFrameTask("left_rubber_hand", "pelvis", axes=("x", "y", "z"), weight=10.0, stiffness=400.0)
    )
    task.target = pin.SE3(task.target.rotation, np.array([0.3, 0.15, 0.2]))
    if not carried:
        policy._arms._carried.measured = lambda measurement: None  # type: ignore[method-assign]
    policy.velocity = (0.1, 0.0, 0.0)
    truth, worst = G1.robot(), 0.0
    while plant.time < 3.0:
        plant.step(policy.command(plant.measure()))
        state = plant.truth()
        truth.update(np.array(state.q), np.array(state.v))
        place = truth.placement("pelvis").actInv(truth.placement("left_rubber_hand")).translation
        if plant.time > 1.5:
            worst = max(worst, float(np.linalg.norm(place - task.target.translation)))
    assert policy.status() == "ok"
    return worst


def test_hands_of_the_qp_stay_while_the_policy_moves_the_pelvis() -> None:
    """The pelvis moves up and down by its IMU's acceleration: without it the hands lag."""
    error, blind = hands_error(*bobbing(arms=ARMS)), hands_error(*bobbing(arms=ARMS), carried=False)
    assert error < 1e-3 and blind > 3.0 * error


@pytest.mark.parametrize("sees", [False, True])
def test_a_policy_sees_the_arms_of_the_qp_at_rest_or_as_they_are(sees: bool) -> None:
    plant, policy = bobbing(arms=ARMS, sees_arms=sees)
    policy.posture.target = {"left_elbow_joint": REST["left_elbow_joint"] + 0.3}
    elbow = G1.joint_names.index("left_elbow_joint")
    for _ in range(500):
        plant.step(policy.command(plant.measure()))
    seen = policy.network.seen[-1][2 + elbow]
    assert policy.observer.robot.q[7 + elbow] - REST["left_elbow_joint"] == pytest.approx(0.3, abs=0.03)
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
    for _ in range(200):
        measurement = plant.measure()
        command = policy.command(measurement)
        assert command.kp[knee] > 0.0 and command.kp[elbow] == 0.0
        assert command.joint_torque[elbow] * measurement.joint_velocity[elbow] <= 0.0
        plant.step(command)
    assert policy.arm_failure and "arms damped" in policy.status() and policy.fallen is None


def test_a_policy_that_is_too_slow_is_asked_for_more() -> None:
    """The velocity that is asked for as well is the integral of what lacks, at most 0.5 m/s."""
    plant, policy = bobbing(regain=0.5)
    policy.velocity = (0.2, 0.0, 0.0)
    for _ in range(1000):
        plant.step(policy.command(plant.measure()))
    assert policy.observed.command[0] == pytest.approx(
        0.2 + 2.0 * 0.5 * 0.2, abs=0.03
    )  # it does not walk at all


@pytest.mark.parametrize("arms", [("left_knee_joint",), ("left_gripper",), (*ARMS, ARMS[0])])
def test_arms_that_the_qp_cannot_have_are_refused(arms: tuple[str, ...]) -> None:
    with pytest.raises(WbcError):
        bobbing(arms=arms)
    with pytest.raises(InputError, match="shared"):
        bobbing(arms=ARMS)[1].release(["left_elbow_joint"])


def filtered(
    wish: dict[str, float], limits: Sequence[Any] = (), **options: Any
) -> tuple[wbc.Plant, PolicyControl]:
    """Return a policy whose joints stay in half-sitting but for those of a wish, rad, with a filter of its arms."""
    n = len(G1.joint_names)
    description = resting(
        observation=(Term("gravity"),),
    )
    action = [wish.get(name, REST[name]) - REST[name] for name in G1.joint_names]
    return control(Known(3, n, action), description, filter=PolicyFilter(ARMS, limits, **options))


def test_a_filter_changes_nothing_that_no_limit_asks_for() -> None:
    plant, policy = filtered({"left_elbow_joint": REST["left_elbow_joint"] + 0.2})
    asked = []
    for k in range(400):
        m = plant.measure()
        command = policy.command(m)
        if k > 50:
            asked.append(np.abs(policy.changed).max())
        made = command.joint_torque + command.kp * (command.joint_position - m.joint_position)
        made += command.kd * (command.joint_velocity - m.joint_velocity)
        wish = policy._kp * (policy._target - m.joint_position) - policy._kd * m.joint_velocity
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
        while plant.time < 1.5:
            plant.step(policy.command(plant.measure()))
            state = plant.truth()
            gauge.update(np.array(state.q), np.array(state.v))
            gauge.solve()
            least = min(least, *near.distances.values())
        assert policy.status() in ("ok", "relaxed: limits, hard tasks and contacts cannot all be satisfied")
        return least

    assert nearest(limit=False) < 0.0
    assert nearest(limit=True) > 0.01


def test_stops_hold_in_a_filter_whatever_a_policy_asks_for() -> None:
    wish = {
        "left_elbow_joint": -9.0,
        "right_shoulder_roll_joint": -9.0,
        "right_wrist_roll_joint": 9.0,
        "waist_yaw_joint": 9.0,
    }
    plant, policy = filtered(wish)
    robot, over = G1.robot(), np.zeros(len(G1.joint_names))
    while plant.time < 1.0:
        plant.step(policy.command(plant.measure()))
        q = np.array(plant.truth().q[7:])
        over = np.maximum(over, np.maximum(robot.position_lower - q, q - robot.position_upper))
    assert over.max() < 2e-3


def test_arms_are_of_the_qp_or_filtered() -> None:
    with pytest.raises(InputError, match="filter"):
        bobbing(arms=ARMS, filter=PolicyFilter(ARMS))
    with pytest.raises(InputError, match="legs"):
        bobbing(filter=PolicyFilter(["left_knee_joint"]))
