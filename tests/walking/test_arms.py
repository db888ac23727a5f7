"""Arms of a walk: references within their limits, hands that count what they do not use, targets out of reach."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from wbc import load_robot
from wbc.base.errors import InputError
from wbc.core.robot import BASE_DOF
from wbc.core.trajectories import minimum_jerk
from wbc.sim import Plant, TrialHook, WalkPlan, WalkSpec, WalkTrial
from wbc.sim.trial.trial import TrialTick
from wbc.walking import FootstepPlan, WalkingControl, WalkingControlSettings
from wbc.walking.hands.arm import ArmSettings, Route
from wbc.walking.plans.swing import FootMotion

DT = 0.005


def control(**arms: Any) -> WalkingControl:
    robot = load_robot("hrp4_class").robot()
    settings = WalkingControlSettings(arms=ArmSettings(**arms))
    return WalkingControl(robot, FootstepPlan.standing(robot), DT, settings)


def update(walking: WalkingControl, ticks: int = 1) -> None:
    robot = walking.controller.robot
    left, right = (FootMotion.at_rest(robot.placement(sole.frame)) for sole in robot.soles)
    for _ in range(ticks):
        walking.arms.update((left, right), 0.0)


def rates(walking: WalkingControl, name: str) -> np.ndarray[Any, Any]:
    """Return velocity and acceleration of the target of a hand in world axes, shape (2, 6)."""
    task, turn = walking.controller.task(name), walking.arms[name].place.rotation
    motion = np.array((task.feedforward_velocity, task.feedforward_acceleration))
    return (motion.reshape(4, 3) @ turn.T).reshape(2, 6)


@pytest.mark.parametrize("waist", [False, True])
def test_every_hand_of_the_robot_has_an_arm_and_the_balance_counts_each_joint_once(waist: bool) -> None:
    hands = {"gripper": "left_hand", "right_hand": "right_hand"}
    robot = replace(load_robot("hrp4_class"), hands=hands).robot()
    settings = WalkingControlSettings(arms=ArmSettings(waist=waist))
    walking = WalkingControl(robot, FootstepPlan.standing(robot), DT, settings)
    assert list(walking.arms) == [arm.name for arm in walking.arms.all.values()] == ["gripper", "right_hand"]
    for arm in walking.arms.all.values():
        arm.reach([0.3, 0.0, 1.0])
    update(walking)
    spared = walking.tasks.com.spared - BASE_DOF
    assert np.unique(spared).size == spared.size
    assert set(spared) == {joint for arm in walking.arms.all.values() for joint in arm.joints}


def test_a_pose_after_a_point_turns_a_hand_from_where_it_is() -> None:
    """At a point the wrist turns as it likes; the reference of its rotation must not be that of before."""
    walking = control()
    robot, hand = walking.controller.robot, walking.arms["left_hand"]
    hand.reach(robot.placement(hand.frame).translation)
    update(walking, 100)
    q = np.array(robot.half_sitting)
    q[7 + hand.joints[-1]] += 0.8
    robot.update(q, np.zeros(robot.nv))
    here = pin.SE3(robot.placement(hand.frame))
    hand.reach(here)
    update(walking)
    task = walking.controller.task("left_hand")
    np.testing.assert_allclose(task.target.rotation, here.rotation, atol=1e-9)
    assert np.abs(task.feedforward_velocity[3:]).max() < 1e-9


def test_a_target_moves_with_its_object_which_is_forgotten_once_no_hand_has_its_target_there() -> None:
    walking = control()
    hand, arms = walking.arms["right_hand"], walking.arms
    hand.reach(hand.place.translation)
    for turn in (0.5, -1.0):
        box = pin.SE3(pin.utils.rotate("z", turn), np.array([0.4, -0.2, 0.9]))
        arms.place("box", box)
        hand.reach([0.0, -0.1, 0.0], "box")
        away = box.rotation @ hand.error[:3]
        np.testing.assert_allclose(
            hand.place.translation + away, box.act(np.array([0.0, -0.1, 0.0])), atol=1e-12
        )
    hand.release()
    update(walking, 100)
    for _ in range(2):
        arms.place("box", None)
    with pytest.raises(InputError, match="no frame 'box' of a hand's target"):
        hand.reach([0.0, 0.0, 0.1], "box")


def test_the_reference_of_a_hand_moves_as_its_feed_forwards_say() -> None:
    """The base carries the hand to where its reference is."""
    walking, name = control(speed=0.6, acceleration=3.0), "left_hand"
    hand, robot = walking.arms[name], walking.controller.robot
    start, own = pin.SE3(hand.place), robot.placement(robot.base_frame).actInv(hand.place)
    turn, way = np.array((0.3, -0.2, 0.4)), np.array((0.12, -0.05, 0.08))
    goal = pin.SE3(pin.exp3(turn) @ start.rotation, start.translation + way)
    hand.reach(goal)
    poses, rated, moving = [], [], []
    for _ in range(250):
        update(walking)
        poses.append(walking.controller.task(name).target)
        rated.append(rates(walking, name))
        base = poses[-1] * own.inverse()
        robot.update(np.concatenate((pin.SE3ToXYZQUAT(base), robot.half_sitting[7:])), np.zeros(robot.nv))
        moving.append(hand.moving)
        assert len(poses) > 1 or not hand.reached
    motions = np.array(rated)
    steps = np.array([
        [*(b.translation - a.translation), *pin.log3(b.rotation @ a.rotation.T)]
        for a, b in zip(poses, poses[1:], strict=False)
    ]) / DT  # fmt: skip
    np.testing.assert_allclose(0.5 * (motions[:-1, 0] + motions[1:, 0])[1:], steps[1:], atol=0.015)
    assert moving[0] and not moving[-1] and hand.reached and poses[-1].isApprox(goal, 2e-3)
    changes, pushes = np.diff(motions[:, 0], axis=0) / DT, motions[:, 1]
    np.testing.assert_allclose(changes[1:], pushes[2:], atol=1e-9)
    speeds = np.linalg.norm(motions[:, 0, :3], axis=1)
    assert np.linalg.norm(pushes[:, :3], axis=1).max() == pytest.approx(3.0) and speeds.max() < 0.6


def test_a_hand_at_rest_in_the_pelvis_has_the_motion_of_the_pelvis() -> None:
    """Velocity and acceleration are the differences of its pose, with a pelvis that moves as the velocities say."""
    walking, rng = control(), np.random.default_rng(2)
    robot, hand = walking.controller.robot, walking.arms["left_hand"]
    q, v = np.array(robot.q), np.zeros(robot.nv)
    v[:6] = rng.normal(size=6)
    robot.update(q, v)
    held = robot.placement(robot.base_frame).actInv(hand.place)
    arm = hand.place.translation - robot.placement(robot.base_frame).translation
    world = robot.placement(robot.base_frame).rotation @ v[:6].reshape(2, 3).T
    assert hand.speed == 0.0
    hand.reach(hand.place)
    assert hand.speed == pytest.approx(np.linalg.norm(world[:, 0] + np.cross(world[:, 1], arm)))
    hand.reach(held, "pelvis")
    assert hand.speed == pytest.approx(0.0, abs=1e-9)
    update(walking)
    place, motions = walking.controller.task("left_hand").target, rates(walking, "left_hand")

    def moved(time: float) -> pin.SE3:
        other = robot.clone()
        other.update(pin.integrate(robot.model, q, time * v), v)
        return pin.SE3(other.placement(robot.base_frame)) * held

    h = 1e-4
    before, after = moved(-h), moved(h)
    assert place.isApprox(moved(0.0), 1e-9)
    speed = (after.translation - before.translation) / (2.0 * h)
    spin = pin.log3(after.rotation @ before.rotation.T) / (2.0 * h)
    push = (after.translation + before.translation - 2.0 * place.translation) / h**2
    np.testing.assert_allclose(motions[0], [*speed, *spin], atol=1e-5)
    np.testing.assert_allclose(motions[1, :3], push, atol=1e-4)


def test_arms_swing_with_the_opposite_foot() -> None:
    walking = control(fast_swing=0.5)
    robot, posture = walking.controller.robot, walking.tasks.posture
    rest = posture.target.copy()
    yaw = 0.6
    turn = pin.utils.rotate("z", yaw)
    left, right, speed = (
        turn @ np.array(way) for way in ((0.0, 0.1, 0.0), (0.2, -0.1, 0.0), (0.3, 0.5, 0.3))
    )
    ahead = FootMotion(pin.SE3(turn, right), np.array([*speed, 0.0, 0.0, 0.0]), np.zeros(6))
    walking.arms.update((FootMotion.at_rest(pin.SE3(turn, left)), ahead), yaw, 1.0)
    moved = posture.target - rest
    assert (moved != 0.0).sum() == 2, "one joint of each arm"
    places = []
    for change in (np.zeros(robot.na), moved):
        q = robot.half_sitting.copy()
        q[7:] += change
        robot.update(q, np.zeros(robot.nv))
        places.append(
            [robot.placement(robot.frames[f"{side}_hand"]).translation[0] for side in ("left", "right")]
        )
    assert np.subtract(places[1], places[0]) == pytest.approx([0.1, -0.1], abs=0.02)
    speeds = posture.feedforward_velocity[moved != 0.0] / moved[moved != 0.0]
    np.testing.assert_allclose(speeds, 0.3 / 0.2)


def test_arms_swing_in_a_fast_walk_unless_somebody_has_moved_the_posture() -> None:
    walking = control()
    posture, arms = walking.tasks.posture, walking.arms
    rest = posture.target.copy()
    ahead = FootMotion.at_rest(pin.SE3(np.eye(3), np.array([0.2, -0.1, 0.0])))
    feet = FootMotion.at_rest(pin.SE3(np.eye(3), np.array([0.0, 0.1, 0.0]))), ahead

    def swung(fast_share: float) -> np.ndarray:
        arms.update(feet, 0.0, fast_share)
        return np.array(posture.target - rest)

    assert not swung(0.0).any()
    full = swung(1.0)
    np.testing.assert_allclose(swung(0.5), 0.5 * full, atol=1e-12)
    assert not swung(0.0).any(), "the arms come back as the walk slows down"
    joint = walking.controller.robot.joint_names[int(np.flatnonzero(full)[0])]
    posture.target = {joint: float(rest[full != 0.0][0]) + 0.1}
    moved = posture.target.copy()
    swung(1.0)
    np.testing.assert_array_equal(posture.target, moved)
    posture.target = rest
    np.testing.assert_allclose(swung(1.0), full, atol=1e-12)


class Reach(TrialHook):
    """Gives a hand a target after half a second of a walk."""

    def __init__(self, target: tuple[float, float, float], frame: str) -> None:
        self.target, self.frame, self.errors = target, frame, []

    def tick(self, tick: TrialTick) -> None:
        hand = tick.control.arms["left_hand"]
        if not hand.active and tick.control.time > 0.5:
            hand.reach(self.target, self.frame)
        if tick.control.time > 2.5:
            self.errors.append(hand.error[:3])


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("robot", ["hrp4_class", "talos", "g1"])
@pytest.mark.parametrize("mode", ["position", "torque"])
@pytest.mark.parametrize("target", [(3.0, 0.0, 0.5), (0.0, 2.0, 0.5), (0.0, 0.0, 2.0)])
def test_a_hand_sent_two_metres_away_makes_no_walk_fall(
    robot: str, mode: str, target: tuple[float, float, float]
) -> None:
    trial = WalkTrial(WalkSpec(robot=robot, mode=mode, plan=WalkPlan(distance=0.8)), visuals=False)  # type: ignore[arg-type]
    hook = Reach(target, "pelvis" if target[2] == 2.0 else "world")
    result = trial.run([hook])
    assert result.outcome == "completed" and result.failures == 0
    assert np.linalg.norm(hook.errors[-1]) > 0.5, "it is out of reach"


def test_a_hand_goes_at_the_speed_that_it_is_given_and_says_when_it_is_there() -> None:
    description = load_robot("hrp4_class")
    plant, robot = Plant(description, visuals=False), description.robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), plant.control_period)
    hand = walking.arms["right_hand"]
    start = np.array(robot.placement(hand.frame).translation)
    goal = start + [0.12, 0.02, 0.08]
    with pytest.raises(InputError, match="speed of 'right_hand'"):
        hand.reach(goal, speed=0.0)
    assert hand.target is None and not hand.moving and not hand.reached
    hand.reach(goal, speed=0.2)
    speeds, since = [], None
    while plant.time < 4.0 and since is None:
        plant.step(walking.command(plant.measure()))
        speeds.append(hand.speed)
        since = plant.time if hand.reached else None
    way = float(np.linalg.norm(goal - start))
    assert since == pytest.approx(way / 0.2 + 0.2 / 2.0, abs=0.4) and not hand.moving
    assert 0.18 < max(speeds) < 0.23
    np.testing.assert_allclose(robot.placement(hand.frame).translation, goal, atol=0.01)
    with pytest.raises(InputError, match=r"use walking\.arms\['right_hand'\]\.reach"):
        walking.controller.task("right_hand").target = hand.target


@pytest.mark.parametrize("spring", [0.0, 3.0])
def test_an_arm_presses_with_what_its_torques_leave_over_its_own_weight_and_its_springs(
    spring: float,
) -> None:
    """The greatest force whose torques, with those that hold the arm, are a share of the limits."""
    springs = {"left_elbow_pitch": (spring, 0.4), "left_shoulder_pitch": (spring, -1.0)} if spring else {}
    robot = replace(load_robot("hrp4_class"), springs=springs).robot()
    walking = WalkingControl(robot, FootstepPlan.standing(robot), DT)
    hand = walking.arms["left_hand"]
    jacobian = pin.computeFrameJacobian(
        robot.model, robot.model.createData(), robot.q, robot.frame_id(hand.frame), pin.LOCAL_WORLD_ALIGNED
    )
    held = pin.computeGeneralizedGravity(robot.model, robot.model.createData(), robot.q)[BASE_DOF:]
    for joint, (stiffness, rest) in springs.items():
        at = robot.joint_index(joint)
        held[at] += stiffness * (robot.q[7 + at] - rest)
    rows = np.array(hand.joints)
    turn = robot.placement(hand.frame).rotation
    for direction, point in (
        ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((0.0, 0.0, -1.0), (0.0, 0.0, -0.2)),
        ((0.0, 0.6, 0.8), (0.1, 0.05, -0.14)),
    ):
        force, joint = hand.strength(np.array(direction), 0.7, np.array(point))
        pushed = np.concatenate((direction, np.cross(turn @ point, direction)))

        def used(force: float, pushed: np.ndarray[Any, Any] = pushed) -> np.ndarray[Any, Any]:
            torque = held + force * pushed @ jacobian[:, BASE_DOF:]
            limit = np.where(torque > 0.0, robot.torque_upper, -robot.torque_lower)
            return (np.abs(torque) / limit)[rows]

        assert used(force).max() == pytest.approx(0.7, rel=1e-6)
        assert robot.joint_names[rows[int(np.argmax(used(force)))]] == joint


def test_the_compliance_of_a_hand_is_its_greatest_displacement_by_a_force_on_its_servos() -> None:
    walking = control()
    robot, hand = walking.controller.robot, walking.arms["left_hand"]
    rows = np.array(hand.joints)
    jacobian = pin.computeFrameJacobian(
        robot.model, robot.model.createData(), robot.q, robot.frame_id(hand.frame), pin.LOCAL_WORLD_ALIGNED
    )[:3, BASE_DOF:][:, rows]
    assert robot.servos is not None
    rng = np.random.default_rng(0)
    forces = rng.normal(size=(2000, 3))
    forces /= np.linalg.norm(forces, axis=1, keepdims=True)
    moved = (forces @ jacobian / robot.servos.kp[rows]) @ jacobian.T
    assert hand.compliance() == pytest.approx(np.linalg.norm(moved, axis=1).max(), rel=1e-2)


def test_a_hand_points_to_the_centre_of_what_moves_with_it() -> None:
    walking = control()
    robot, hand = walking.controller.robot, walking.arms["left_hand"]
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, robot.half_sitting)
    pin.updateFramePlacements(model, data)
    pin.centerOfMass(model, data, robot.half_sitting, True)
    joint = model.frames[robot.frame_id(hand.frame)].parentJoint
    centre = data.oMi[joint].act(data.com[joint])
    way = data.oMf[robot.frame_id(hand.frame)].actInv(centre)
    np.testing.assert_allclose(hand.axis(), way / np.linalg.norm(way), atol=1e-9)


def test_a_reference_waits_in_a_straight_line_for_a_hand_that_stays_behind() -> None:
    """In full up to 50 mm, at half the pace at 75 mm, not at all from 100 mm on."""
    for off, pace in ((0.04, 1.0), (0.075, 0.5), (0.12, 0.0)):
        walking = control()
        hand = walking.arms["left_hand"]
        start = pin.SE3(hand.place)
        goal = pin.SE3(start.rotation, start.translation + (0.2, 0.0, 0.0))
        hand.send(Route([goal], "world", 1.0, [2.0]))
        update(walking, 100)
        here = hand._way.place.translation[0] - start.translation[0]
        hand._there = pin.SE3(start.rotation, start.translation + (off, 0.0, 0.0))
        update(walking)
        gone = hand._way.place.translation[0] - start.translation[0] - here
        time = 100 * DT
        assert here == pytest.approx(0.2 * minimum_jerk(time / 2.0)[0])
        assert here + gone == pytest.approx(0.2 * minimum_jerk((time + pace * DT) / 2.0)[0], abs=1e-9)
