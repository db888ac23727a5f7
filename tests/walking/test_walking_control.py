"""The parts of a walk as one control, against analytic answers: a robot whose sensors are made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from properties import by_default

import wbc
from wbc.base.errors import InputError
from wbc.core.drive.control import Mode
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Measurement
from wbc.robots import load
from wbc.sim import Plant
from wbc.tasks import OrientationTask
from wbc.tasks.stabilizer.lean import LeanMotion
from wbc.walking.control import WalkingControl
from wbc.walking.lipm.walk import LipmWalk
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.planners import walk_distance
from wbc.walking.settings import WalkingControlSettings
from wbc.walking.source import StandSource, WholeBody

DESCRIPTION = load("hrp4_class")
DT = 0.005


def standing(settings: WalkingControlSettings) -> tuple[Robot, WalkingControl]:
    robot, own = DESCRIPTION.robot(), DESCRIPTION.robot()
    source = FootstepPlan.standing(robot) if settings.mode == "position" else StandSource(own)
    return robot, WalkingControl(own, source, DT, settings)


def sensors(
    robot: Robot, tick: int, q: np.ndarray, cop: tuple[float, float] = (0.0, 0.0), left: float = 0.5
) -> Measurement:
    """An upright robot at rest; a share of its weight on the left foot, both feet at a CoP (m, in the sole)."""
    wrench = np.zeros((2, 6))
    for foot, share in enumerate((left, 1.0 - left)):
        force = share * robot.mass * GRAVITY
        wrench[foot, 2:5] = force, cop[1] * force, -cop[0] * force
    up = robot.placement(robot.imu_frame).rotation.T @ np.array([0.0, 0.0, GRAVITY])
    noise = np.full(3, 1e-9 * np.sin(tick))  # sensors that never change are refused
    return Measurement(tick * DT, q[7:].copy(), np.zeros(robot.na), noise, up, wrench)


@pytest.mark.parametrize("mode", ["position", "torque"])
def test_a_plan_without_steps_says_where_the_robot_stands_and_how_it_will_step(mode: Mode) -> None:
    robot, settings = load("hrp4_class").robot(), WalkingControlSettings(mode=mode)
    stand = FootstepPlan.standing(robot, Gait(swing_height=0.1, single_support=1.2))
    away = stand.moved(pin.SE3(np.eye(3), np.array((5.0, 0.0, 0.0))))
    with pytest.raises(InputError, match="begin where the robot stands"):
        WalkingControl(robot, away, 0.005, settings)
    source = WalkingControl(robot, stand, 0.005, settings).source
    if isinstance(source, LipmWalk):
        assert source.lift_room == 0.1
        source.steering.command((0.2, 0.0, 0.0))
        source.take(None)
        source.advance((200.0, 200.0))
        assert (source.phases.gait.swing_height, source.phases.gait.single_support) == (0.1, 1.2)


def test_feed_forward_is_the_inverse_dynamics_of_the_motion_under_the_desired_wrenches() -> None:
    """Of a commanded robot that moves, while pushed feet make the stabilizer want other wrenches than the QP."""
    settings = WalkingControlSettings()
    robot, walking = standing(settings)
    control, rng = walking.drives, np.random.default_rng(4)
    for tick in range(10):
        control._v[:] = 0.1 * rng.normal(size=robot.nv)
        q, v = control.q.copy(), control.v.copy()
        command = walking.command(sensors(robot, tick, robot.half_sitting, (0.02, -0.01), left=0.6))
        solution, output = control.solution, walking.output
        assert solution is not None and solution.ok and output is not None
        model, data = robot.model, robot.model.createData()
        generalised = pin.rnea(model, data, q, v, solution.accelerations)
        own = generalised.copy()
        for sole, wrench in zip(robot.soles, output.feet.wrenches, strict=True):
            jacobian = pin.computeFrameJacobian(model, data, q, robot.frame_id(sole.frame), pin.LOCAL)
            generalised -= jacobian.T @ wrench
            own -= jacobian.T @ solution.wrenches[sole.name]
        assert (np.abs(generalised[6:]) < robot.torque_limit).all()
        np.testing.assert_allclose(command.joint_torque, generalised[6:], atol=1e-6)
        assert np.abs(generalised[6:] - own[6:]).max() > 1.0  # not those of the QP


@pytest.mark.parametrize("mode", ["position", "torque"])
def test_a_source_that_moves_the_whole_body_sets_com_trunk_and_joints(mode: Mode) -> None:
    """In torque control the feedback's acceleration is about the pendulum, and the CoM's is that of the body."""
    robot, walking = standing(WalkingControlSettings(mode=mode, bias=None))
    walking.command(sensors(robot, 0, robot.half_sitting))
    reference, tasks = walking.reference, walking.tasks
    assert reference is not None and walking.output is not None
    turns = [pin.exp3(np.array((0.1, 0.02 * i, 0.0))) for i in (1, 2)]
    trunk = [(turn, np.array((0.1, 0.2, 0.3)), np.array((0.4, 0.5, 0.6))) for turn in turns]
    joints = np.random.default_rng(0).normal(size=(3, robot.na))
    body = WholeBody(np.array((0.7, -0.4, 0.3)), trunk, *joints)
    lean = LeanMotion(
        pin.exp3(np.array((0.0, 0.05, 0.0))), np.array((0.0, 0.3, 0.1)), np.array((0.2, 0.1, 0.0))
    )
    pendulum = reference.pendulum._replace(com_acceleration=np.array((0.2, 0.1, 0.0)))
    tasks.follow(reference._replace(pendulum=pendulum, body=body), lean, output=walking.output)
    push = body.com_acceleration.copy()
    if mode == "torque":
        push[:2] += walking.output.com_acceleration[:2] - pendulum.com_acceleration[:2]
    np.testing.assert_allclose(tasks.com.feedforward_acceleration, push, atol=1e-12)
    for task, turn in zip(
        [t for t in walking.controller.tasks if isinstance(t, OrientationTask)], turns, strict=True
    ):
        np.testing.assert_allclose(task.target, lean.rotation @ turn, atol=1e-12)
        np.testing.assert_allclose(task.feedforward_velocity, (0.1, 0.5, 0.4))
        np.testing.assert_allclose(task.feedforward_acceleration, (0.6, 0.6, 0.6))
    posture = tasks.posture
    np.testing.assert_array_equal((posture.target, posture.feedforward_velocity), joints[:2])


def turned(yaw: float) -> Robot:
    """The robot, standing where it stands, with another heading."""
    robot = DESCRIPTION.robot()
    q = np.array(robot.half_sitting)
    q[:7] = pin.SE3ToXYZQUAT(
        pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), np.zeros(3)) * pin.XYZQUATToSE3(q[:7])
    )
    robot.update(q, np.zeros(robot.nv))
    return robot


def walk_as_commanded(yaw: float, distance: float) -> dict[str, np.ndarray]:
    """A walk whose servos are perfect and whose feet carry what the planned ZMP says."""
    robot = turned(yaw)
    start = FootstepPlan.standing(robot)
    plan = walk_distance(start, distance)
    walking = WalkingControl(robot, plan, DT, WalkingControlSettings(bias=None))
    control, real = walking.drives, turned(yaw)
    imu, share, out = real.frame_id(real.imu_frame), 0.5, {"joints": [], "feet": [], "com": []}
    acceleration = np.zeros(real.nv)
    for tick in range(round(20.0 / DT)):
        real.update(control.q, control.v)
        pin.forwardKinematics(real.model, real.data, real.q, real.v, acceleration)
        gyro = pin.getFrameVelocity(real.model, real.data, imu, pin.LOCAL).angular
        push = pin.getFrameClassicalAcceleration(real.model, real.data, imu, pin.LOCAL).linear
        up = real.placement(imu).rotation.T @ np.array([0.0, 0.0, GRAVITY])
        wrench = np.zeros((2, 6))
        wrench[:, 2] = np.array([share, 1.0 - share]) * real.mass * GRAVITY
        command = walking.command(
            Measurement(tick * DT, real.q[7:].copy(), real.v[6:].copy(), gyro, push + up, wrench)
        )
        reference = walking.reference
        assert control.solution is not None and control.solution.ok and reference is not None
        acceleration = control.solution.accelerations
        soles = [real.placement(sole.frame).translation for sole in real.soles]
        out["joints"].append(command.joint_position)
        out["feet"].append([
            np.linalg.norm(sole - motion.placement.translation)
            for sole, motion in zip(soles, reference.feet, strict=True)
        ])  # fmt: skip
        out["com"].append(real.com - reference.pendulum.com)
        left, right = (motion.placement.translation[:2] for motion in reference.feet)
        share = float(np.clip((reference.pendulum.zmp[:2] - right) @ (left - right), 0.0, None))
        share = min(share / float((left - right) @ (left - right)), 1.0)
        left_on, right_on = reference.progress.contact
        if not (left_on and right_on):
            late = walking.source.phases.elapsed >= walking.source.phases.duration - 1e-9
            share = (
                float(reference.progress.contact[0]) * (0.8 if late else 1.0)
                + 0.2 * late * reference.progress.contact[1]
            )
        if walking.finished:
            break
    assert walking.finished and walking.fallen is None and walking.steps_done == len(plan)
    return {name: np.array(values) for name, values in out.items()}


@pytest.mark.slow
def test_the_commanded_robot_follows_its_references_over_a_walk_in_any_direction() -> None:
    ahead, turned_away = (walk_as_commanded(yaw, 0.1) for yaw in (0.0, 2.0))
    assert ahead["feet"].max() < 5e-3 and np.abs(ahead["com"]).max() < 5e-3
    np.testing.assert_allclose(turned_away["joints"], ahead["joints"], atol=1e-7)


def test_the_walk_gets_the_dcm_of_a_moving_robot_without_its_bias(monkeypatch: pytest.MonkeyPatch) -> None:
    """The CoM is 30 mm ahead of a ZMP that does not hold it: a bias is found, and taken off."""
    robot, walking = standing(WalkingControlSettings())
    given: list[np.ndarray] = []
    assert walking.balance is not None
    bias = walking.balance.bias
    assert bias is not None
    advance = walking.source.advance
    monkeypatch.setattr(
        walking.source,
        "advance",
        lambda loads, soles, dcm, *others: given.append(dcm) or advance(loads, soles, dcm, *others),
    )
    speed = np.zeros(robot.na)
    for joint, sign in (("hip_pitch", -1.0), ("ankle_pitch", 1.0)):
        speed[[robot.joint_index(f"{side}_{joint}") for side in ("left", "right")]] = 0.1 * sign
    for tick in range(40):
        walking.command(replace(sensors(robot, tick, robot.half_sitting, (0.03, 0.0)), joint_velocity=speed))
        estimate = walking.drives.observer.robot
        dcm = estimate.com[:2] + estimate.com_velocity[:2] / walking.source.course.pattern.omega
        np.testing.assert_allclose(given[-1][:2], dcm - bias.bias, atol=1e-9)
    assert np.abs(bias.bias).max() > 1e-3 and np.abs(estimate.com_velocity[0]) > 0.02


def test_in_torque_control_the_qp_gives_the_wrenches_and_the_acceleration_that_are_desired() -> None:
    """The CoM is off by 10 mm, so the stabilizer wants other loads than the pendulum at rest."""
    robot, walking = standing(WalkingControlSettings(mode="torque", bias=None))
    q = np.array(robot.half_sitting)
    for side in ("left", "right"):
        q[7 + robot.joint_index(f"{side}_hip_roll")] += 0.015
        q[7 + robot.joint_index(f"{side}_ankle_roll")] -= 0.015
    for tick in range(5):
        command = walking.command(sensors(robot, tick, q))
        solution, output = walking.drives.solution, walking.output
        assert solution is not None and solution.ok and output is not None and command.joint_position is None
        # The robot is at rest, so the Jacobian of the CoM has no drift.
        com = walking.controller.robot.com_jacobian @ solution.accelerations
        np.testing.assert_allclose(com[:2], output.com_acceleration[:2], atol=1e-3)
        assert np.abs(output.com_acceleration[1]) > 0.1
        for sole, wrench in zip(robot.soles, output.feet.wrenches, strict=True):
            np.testing.assert_allclose(solution.wrenches[sole.name], wrench, atol=0.5)  # N, Nm
            assert abs(wrench[2] - 0.5 * robot.mass * GRAVITY) > 10.0


def test_the_lean_turns_the_trunk_as_its_velocity_says() -> None:
    """The CoM is so far ahead that the feet cannot give the moment: the trunk leans."""
    robot, walking = standing(WalkingControlSettings(bias=None))
    q = np.array(robot.half_sitting)
    for side in ("left", "right"):
        q[7 + robot.joint_index(f"{side}_hip_pitch")] -= 0.12
        q[7 + robot.joint_index(f"{side}_ankle_pitch")] += 0.12
    tasks = [task for task in walking.controller.tasks if isinstance(task, OrientationTask)]
    before, most = None, 0.0
    for tick in range(60):
        walking.command(sensors(robot, tick, q))
        now = [(task.target.copy(), task.feedforward_velocity.copy()) for task in tasks]
        for (was, _), (target, velocity) in zip(before or now, now, strict=True):
            if before is not None:
                np.testing.assert_allclose(pin.log3(target @ was.T) / DT, velocity, atol=1e-2)
                most = max(most, float(np.abs(velocity).max()))
        before = now
    assert most > 0.1


@pytest.mark.parametrize("mode", by_default(["position", "torque"], "torque"))
def test_a_hand_that_would_go_into_a_thigh_stays_beside_it_with_a_limit_on_collisions(mode: Mode) -> None:
    """The hand is sent into the middle of the thigh: without the limit it goes there, with it it stops before."""
    description = wbc.load_robot("hrp4_class")
    pair = ("left_hand", "left_thigh")
    shapes = {link: shape for link, shape in description.collision_shapes().items() if link in pair}
    least = {}
    for kept in (False, True):
        limit = wbc.CollisionLimit([pair], shapes=shapes, margin=0.02)
        robot, plant = description.robot(), Plant(description, control_period=0.005, visuals=False)
        settings = WalkingControlSettings(mode=mode)
        walking = WalkingControl(robot, None, 0.005, settings, limits=[limit] if kept else ())
        if not kept:
            limit.bind(robot)
        thigh = shapes["left_thigh"][0]
        assert isinstance(thigh, wbc.CollisionCapsule)
        middle = 0.5 * (np.array(thigh.start) + thigh.end)
        walking.arms["left_hand"].reach(robot.placement("left_thigh").act(middle))
        rows, bounds = np.zeros((limit.dim, robot.nv)), np.zeros(limit.dim)
        near = []
        while plant.time < 0.8:
            plant.step(walking.command(plant.measure()))
            limit.write(0.005, rows, bounds, np.zeros(limit.dim))
            near.append(limit.distances[pair])
        assert walking.drives.failures == 0
        least[kept] = min(near)
    assert least[False] < -0.05 and 0.018 < least[True] < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["position", "torque"])
def test_knees_that_would_touch_on_narrow_steps_keep_their_distance_with_a_limit_on_collisions(
    mode: Mode,
) -> None:
    """G1 walks on feet that are 0.09 m apart: its knees touch in passing, and with the limit they do not."""
    description = wbc.load_robot("g1")
    legs = [[f"{side}_{link}" for link in ("knee_link", "ankle_roll_link")] for side in ("left", "right")]
    pairs = [(left, right) for left in legs[0] for right in legs[1]]
    shapes, least = description.collision_shapes(), {}
    for kept in (False, True):
        limit = wbc.CollisionLimit(pairs, shapes=shapes)
        robot, plant = description.robot(), Plant(description, control_period=0.005, visuals=False)
        steps = tuple(
            Footstep("right" if i % 2 else "left", 0.1 * (i + 1), -0.045 if i % 2 else 0.045)
            for i in range(6)
        )
        plan = replace(FootstepPlan.standing(robot), steps=steps)
        settings = WalkingControlSettings(mode=mode)
        walking = WalkingControl(robot, plan, 0.005, settings, limits=[limit] if kept else ())
        if not kept:
            limit.bind(robot)
        rows, bounds, near = np.zeros((limit.dim, robot.nv)), np.zeros(limit.dim), []
        while plant.time < 8.0:
            plant.step(walking.command(plant.measure()))
            limit.write(0.005, rows, bounds, np.zeros(limit.dim))
            near.append(min(limit.distances.values()))
        assert walking.drives.failures == 0
        assert walking.fallen is None and walking.steps_done == len(steps)
        least[kept] = min(near)
    assert least[False] < 0.0 and 0.015 < least[True] < 0.03


class Asked:
    """Scheduler of stiffness that keeps what it is asked with."""

    command = (0.5, 0.5)

    def __init__(self) -> None:
        """Begin without questions."""
        self.calls: list[tuple[object, ...]] = []

    def update(self, *arguments: object) -> tuple[float, float]:
        """Keep the arguments."""
        self.calls.append(arguments)
        return (0.2, 0.8)


def test_a_stiffness_is_scheduled_by_the_share_and_by_the_rest_of_the_phase() -> None:
    robot = DESCRIPTION.robot()
    plan, asked = walk_distance(FootstepPlan.standing(robot), 0.2), Asked()
    walking = WalkingControl(DESCRIPTION.robot(), plan, DT)
    walking.stiffness = asked  # type: ignore[assignment]
    for tick in range(30):
        command = walking.command(sensors(robot, tick, robot.half_sitting))
        progress = walking.progress
        assert command.sole_stiffness == (0.2, 0.8) and progress.duration > 0.5
        share, left = asked.calls[-1][1:3]
        assert share == pytest.approx(progress.elapsed / progress.duration)
        assert left == pytest.approx(progress.duration - progress.elapsed)
    assert share > 0.1


def test_the_bias_of_a_robot_in_the_air_is_not_estimated() -> None:
    robot, walking = standing(WalkingControlSettings())
    assert walking.balance is not None and walking.balance.bias is not None
    bias = walking.balance.bias
    for tick in range(40):
        walking.command(sensors(robot, tick, robot.half_sitting, (0.03, 0.0)))
    before = bias.bias.copy()
    assert np.abs(before).max() > 1e-4
    output = walking.balance.output
    assert output is not None
    for state in (output._replace(in_air=True), output._replace(measured_zmp=np.full(3, np.nan))):
        walking.balance.output = state
        found = walking.balance._estimate_bias(bias, walking.drives.observer.robot, walking.reference)
        np.testing.assert_array_equal(found, before)


@pytest.mark.parametrize("mode", ["position", "torque"])
def test_a_walk_begins_where_its_references_are_and_free_steps_wherever_the_robot_stands(mode: Mode) -> None:
    """References of feet elsewhere would throw the robot; free steps face where it faces."""
    walking = WalkingControl(DESCRIPTION.robot(), None, DT, WalkingControlSettings(mode=mode))
    near, far = (robot.q.copy() for robot in (turned(0.0), turned(1.5)))
    near[0] += 0.05
    for q in (near, far, near):
        if mode == "position" and q is far:
            with pytest.raises(InputError, match="must begin where the robot stands"):
                walking.reset(q)
            continue
        walking.reset(q)
        assert walking.controller.robot.q[:7] == pytest.approx(q[:7])
        if mode == "torque":
            assert walking.source.steering.heading == pytest.approx(1.5 if q is far else 0.0)  # type: ignore[union-attr]
