"""Inverse kinematics: against Pink and the controller, limits, priorities, searches, refusals."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import by_default, examples
from task_factory import MOTION_TASKS, ROBOTS, left_hand, near_half_sitting, right_hand

import wbc
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.limits.joint import stopping_velocity
from wbc.core.qp.solving.solver import Status
from wbc.core.robot import Robot
from wbc.tasks import JointTorqueTask, LookAtTask, LowAccelerationTask, MomentumTask, RelativeFrameTask

ALL = (*ROBOTS, "panda", "go1")
HANDS = {"panda": "panda_hand", "go1": "FR_foot"}
SOLE_FREE = {"panda": (), "go1": ("FL_foot", "RL_foot", "RR_foot")}


@cache
def model_of(name: str) -> Robot:
    return wbc.load_robot(name).robot()


def robot_of(name: str) -> Robot:
    return model_of(name).clone()


def hand_of(robot: Robot) -> str:
    return HANDS.get(robot.name) or right_hand(robot)


def contacts(robot: Robot) -> list[wbc.SoleContact | wbc.PointContact]:
    """Return what holds a robot: soles or points, nothing of a bolted one."""
    if robot.soles:
        return [wbc.SoleContact(sole.name) for sole in robot.soles]
    return [wbc.PointContact(point) for point in SOLE_FREE[robot.name]]


def solver(name: str, dt: float = 0.01, posture: float = 1e-6) -> wbc.InverseKinematics:
    """Return a solver of a robot that stands, or is bolted, with limits and a weak posture."""
    ik = wbc.InverseKinematics(robot_of(name), dt)
    ik.add(*contacts(ik.robot), wbc.JointLimits(), wbc.PostureTask(weight=posture))
    return ik


def near(robot: Robot, frame: str, rng: np.random.Generator, size: float) -> pin.SE3:
    """Return a pose of a frame that some joints near the present ones reach, the base where it is."""
    q, data = robot.q.copy(), robot.model.createData()
    joints = robot.joints_between(frame, robot.base_frame)
    room = np.minimum(size, 0.2 * (robot.position_upper - robot.position_lower))
    for joint in joints:
        value = q[robot.base_nq + joint] + rng.uniform(-1.0, 1.0) * room[joint]
        low, high = robot.position_lower[joint] + 0.02, robot.position_upper[joint] - 0.02
        q[robot.base_nq + joint] = np.clip(value, low, high)
    pin.framesForwardKinematics(robot.model, data, q)
    return pin.SE3(data.oMf[robot.frame_id(frame)])


# ---- against others -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("seed", by_default(range(3), 0))
def test_poses_are_reached_as_by_pink(name: str, seed: int) -> None:
    pink = pytest.importorskip("pink")
    ik, rng = solver(name, posture=1e-8), np.random.default_rng(seed)
    robot, frame = ik.robot, hand_of(ik.robot)
    goal = near(robot, frame, rng, 0.5)
    ik.add(wbc.PoseTask(frame, goal))
    found = ik.reach(1e-6)
    assert found.reached, str(found)

    configuration = pink.Configuration(robot.model, robot.model.createData(), robot.q.copy())
    tasks = [pink.tasks.FrameTask(frame, 1.0, 1.0), pink.tasks.PostureTask(1e-4)]
    tasks[1].set_target(robot.q)
    tasks[0].set_target(goal)
    held = [contact.frame for contact in ik.contacts]
    turns = 1.0 if robot.soles or name == "panda" else 0.0
    for each in held:
        tasks.append(pink.tasks.FrameTask(each, 100.0, 100.0 * turns))
        tasks[-1].set_target(pin.SE3(robot.placement(each)))
    limits = [pink.limits.ConfigurationLimit(robot.model)]
    for _ in range(60):
        velocity = pink.solve_ik(configuration, tasks, 1.0, solver="daqp", limits=limits, safety_break=False)
        configuration.integrate_inplace(velocity, 1.0)
    ik.update(found.configuration)
    theirs = configuration.get_transform_frame_to_world(frame)
    assert abs(theirs.homogeneous - robot.placement(frame).homogeneous).max() < 1e-6


@pytest.mark.parametrize("name", by_default(["talos", "g1", "panda"], "talos"))
def test_velocities_are_those_of_pink_for_the_same_costs(name: str) -> None:
    """Tasks of CoM and posture have the same errors there, so the whole problem is the same."""
    pink = pytest.importorskip("pink")
    dt, robot = 0.01, robot_of(name)
    rng = np.random.default_rng(1)
    room = np.minimum(0.1, 0.1 * (robot.position_upper - robot.position_lower))
    inside = np.clip(robot.q[robot.base_nq :], robot.position_lower + room, robot.position_upper - room)
    ik = wbc.InverseKinematics(robot, dt, regularisation=1e-9, damping=0.0)
    ik.update(np.concatenate([robot.q[: robot.base_nq], inside]))
    goal = robot.com + rng.uniform(-0.05, 0.05, 3)
    ik.add(wbc.CoMTask(goal, weight=4.0, rate=20.0, error_bound=np.inf))
    posture = ik.add(wbc.PostureTask(weight=0.25, rate=50.0, error_bound=np.inf))
    posture.follow(inside + rng.uniform(-0.3, 0.3, robot.na))
    ik.add(wbc.JointLimits(margin=0.0, velocity_ratio=0.1))

    configuration = pink.Configuration(robot.model, robot.model.createData(), robot.q.copy())
    tasks = [pink.tasks.ComTask(2.0, gain=20.0 * dt), pink.tasks.PostureTask(0.5, gain=50.0 * dt)]
    tasks[0].set_target(goal)
    tasks[1].set_target(np.concatenate([robot.q[: robot.base_nq], posture.target]))
    model = robot.model.copy()
    model.upperVelocityLimit = 0.1 * np.array(robot.model.upperVelocityLimit)
    limits = [pink.limits.ConfigurationLimit(model, 1.0), pink.limits.VelocityLimit(model)]
    # Their regularisation is per squared step, ours per squared velocity; both are far below all else.
    theirs = pink.solve_ik(configuration, tasks, dt, solver="daqp", limits=limits, damping=1e-9)
    ours = ik.solve()
    assert ik.solution is not None and ik.solution.ok and len(ik.solution.active_limits) > 3
    assert ours[robot.base_dof :] == pytest.approx(theirs[robot.base_dof :], abs=1e-6)


def test_a_controller_that_comes_to_rest_is_where_the_search_ends() -> None:
    """Conflicting tasks: both minimise the same weighted errors where the gains of the tasks are alike."""
    robot = robot_of("panda")
    goal = pin.SE3(robot.placement("panda_hand"))
    goal.translation += [0.05, 0.1, -0.1]
    limits = wbc.JointLimits(margin=0.0)

    def tasks() -> list[wbc.Task]:
        return [
            wbc.PoseTask("panda_hand", goal, stiffness=400.0),
            wbc.PostureTask(weight=0.05, stiffness=400.0),
        ]

    controller = wbc.Controller(robot, 0.005, regularisation=1e-6)
    controller.add(limits, *tasks())
    q, v = robot.q.copy(), robot.v.copy()
    for _ in range(500):
        controller.update(q, v)
        v = v + 0.005 * controller.solve().accelerations
        q = pin.integrate(robot.model, q, 0.005 * v)

    ik = wbc.InverseKinematics(robot_of("panda"), 0.005)
    ik.add(wbc.JointLimits(margin=0.0), *tasks())
    found = ik.reach(1e-12)
    assert not found.reached and found.held_by == ("posture",)  # the posture pulls: a compromise
    assert found.configuration == pytest.approx(q, abs=1e-6)
    while ik.robot.v.max() == 0.0 or abs(ik.robot.v).max() > 1e-9:
        ik.step()
    assert ik.robot.q == pytest.approx(q, abs=1e-6)


@pytest.mark.parametrize("name", by_default(ROBOTS, "g1"))
def test_rows_read_no_more_of_the_state_than_they_say(name: str) -> None:
    robot, rng = robot_of(name), np.random.default_rng(0)
    ik = wbc.InverseKinematics(robot, 0.01)
    for case in MOTION_TASKS.values():
        task = case.make(robot)
        if type(task).observe is not wbc.Task.observe:
            continue
        ik.add(task)
        for _ in range(2):
            q, _ = near_half_sitting(robot, rng, 0.1, 0.0)
            ik.update(q)
            quick = [rows.copy() for rows in task.evaluated()[:2]]
            robot.update(q, np.zeros(robot.nv))
            for fast, full in zip(quick, task.evaluated()[:2], strict=True):
                assert fast == pytest.approx(full, abs=1e-9), task
        ik.remove(task)


def test_a_class_that_changes_the_rows_of_another_is_heard() -> None:
    class Half(wbc.PositionTask):
        def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
            super().evaluate(jacobian, error, drift)
            error *= 0.5

    ik = solver("panda")
    hand = ik.add(Half("panda_hand"))
    hand.target = hand.target + [0.0, 0.02, 0.0]
    ik.solve()
    assert hand.error[1] == pytest.approx(0.01)


def test_costs_of_all_selections_add_up() -> None:
    robot, weight = robot_of("talos"), 2.0
    ik = wbc.InverseKinematics(robot, 0.01, regularisation=1e-9, damping=0.0)
    posture = ik.add(wbc.PostureTask(weight=0.5, rate=4.0))
    posture.target = posture.target + 0.01
    robot.v[:] = np.linspace(-1.0, 1.0, robot.nv)
    last = robot.v.copy()
    ik.add(LowAccelerationTask(weight=weight))
    joints = (0.5 * 0.04 + weight * last[6:]) / (0.5 + weight)
    assert ik.solve()[6:] == pytest.approx(joints, abs=1e-6)


# ---- contacts, targets, priorities --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", by_default(ALL, "g1", "go1"))
def test_what_stands_stays_where_it_is(name: str) -> None:
    ik = solver(name)
    robot, frame = ik.robot, hand_of(ik.robot)
    ik.add(wbc.PoseTask(frame, near(robot, frame, np.random.default_rng(4), 0.6)))
    before = [pin.SE3(robot.placement(contact.frame)) for contact in ik.contacts]
    for _ in range(100):
        ik.step()
    for contact, place in zip(ik.contacts, before, strict=True):
        moved = robot.placement(contact.frame).translation - place.translation
        assert np.linalg.norm(moved) < 1e-5


def test_a_contact_that_is_switched_off_moves_and_holds_again_where_it_is() -> None:
    ik = solver("talos")
    foot, robot = ik.contact("left_foot"), ik.robot
    lift = ik.add(wbc.PositionTask(foot.frame))
    lift.target = lift.target + [0.0, 0.02, 0.05]
    ik.add(wbc.CoMTask())
    ik.step()
    assert np.linalg.norm(robot.placement(foot.frame).translation - lift.target) > 0.05
    foot.active = False
    for _ in range(200):
        ik.step()
    assert robot.placement(foot.frame).translation == pytest.approx(lift.target, abs=1e-3)
    foot.active = True
    lift.target = lift.target + [0.0, 0.0, 0.1]
    place = robot.placement(foot.frame).translation.copy()
    for _ in range(20):
        ik.step()
    assert robot.placement(foot.frame).translation == pytest.approx(place, abs=1e-6)


def test_velocities_make_the_momentum_that_is_asked_for() -> None:
    ik = wbc.InverseKinematics(robot_of("g1"), 0.005)
    momentum = ik.add(MomentumTask([1.0, -2.0, 0.5, 0.1, 0.2, -0.1], weight=1.0))
    for _ in range(3):
        v, robot = ik.step(), ik.robot
        full = robot.clone()
        full.update(pin.integrate(robot.model, robot.q, -0.005 * v), v)
        assert full.data.hg.vector == pytest.approx(momentum.target, abs=1e-3)


def test_a_lower_level_changes_nothing_of_those_before() -> None:
    """Whatever its weight is; and it does what they leave free as well as can be."""
    ik = wbc.InverseKinematics(robot_of("talos"), 0.01)
    robot = ik.robot
    ik.add(*contacts(robot), wbc.JointLimits())
    com, hand = wbc.CoMTask(robot.com + [0.02, 0.01, -0.03]), wbc.PoseTask(right_hand(robot))
    hand.bind(robot)
    hand.target = near(robot, right_hand(robot), np.random.default_rng(0), 0.02)
    ik.add(com)
    first = ik.solve()
    ik.add(hand, level=1)
    ik.add(wbc.PositionTask(left_hand(robot), [0.0, 1.0, 1.0], weight=1e6), level=2)
    posture = ik.add(wbc.PostureTask(weight=1e4), level=5)
    jacobians = [task.evaluated()[0] for task in (com, hand)]
    with_all = ik.solve()
    assert jacobians[0] @ with_all == pytest.approx(jacobians[0] @ first, abs=1e-7)
    ik.remove(ik.task(f"{left_hand(robot)} position"), posture)
    with_two = ik.solve()
    assert jacobians[1] @ with_all == pytest.approx(jacobians[1] @ with_two, abs=1e-7)
    assert abs(jacobians[1] @ with_two - 10.0 * hand.evaluated()[1]).max() < 0.05  # and the hand goes
    assert abs(with_all - with_two).max() > 0.1  # what was left free is used
    kept, velocity = ik.solution, hand.evaluated()[0] @ with_two
    assert kept is not None
    before = kept.residuals[hand.name].copy()
    ik.update(near_half_sitting(robot, np.random.default_rng(1), 0.2)[0])
    ik.solve()  # a solution is that of its own step
    np.testing.assert_array_equal(kept.residuals[hand.name], before)
    assert abs(velocity).max() > 0.0


def test_a_search_with_levels_ends_exactly_at_the_first_ones() -> None:
    ik = wbc.InverseKinematics(robot_of("panda"), 0.01)
    robot = ik.robot
    ik.add(wbc.JointLimits())
    hand = ik.add(wbc.PoseTask("panda_hand", near(robot, "panda_hand", np.random.default_rng(2), 0.5)))
    posture = ik.add(wbc.PostureTask({"panda_joint3": 0.4}), level=1)
    found = ik.reach(1e-9)
    assert found.reached, str(found)
    ik.update(found.configuration)
    # Nothing that leaves the hand where it is brings the posture nearer: its gradient is one of the hand's rows.
    jacobian, pull = hand.evaluated()[0], robot.q - posture.target
    pull[(robot.q < robot.position_lower + 2e-3) | (robot.q > robot.position_upper - 2e-3)] = 0.0
    left = pull - jacobian.T @ np.linalg.lstsq(jacobian.T, pull, rcond=None)[0]
    assert np.linalg.norm(pull) > 0.1 and np.linalg.norm(left) < 1e-3


def test_levels_keep_the_limits() -> None:
    ik = wbc.InverseKinematics(robot_of("panda"), 0.01)
    robot = ik.robot
    ik.add(wbc.JointLimits(margin=0.0))
    ik.add(wbc.PositionTask("panda_hand", axes=("z",)))
    away = np.where(np.arange(robot.na) % 2, 10.0, -10.0)
    ik.add(wbc.PostureTask(), level=1).follow(away)
    height = robot.placement("panda_hand").translation[2]
    for _ in range(100):
        ik.step()
        assert (robot.q <= robot.position_upper + 1e-9).all()
        assert (robot.q >= robot.position_lower - 1e-9).all()
        assert robot.placement("panda_hand").translation[2] == pytest.approx(height, abs=5e-3)
    assert ik.solution is not None and len(ik.solution.active_limits) > 2


# ---- limits -------------------------------------------------------------------------------------------------------


@examples(10)
@given(
    seed=st.integers(0, 1000),
    dt=st.sampled_from([0.001, 0.01, 0.05]),
    acceleration=st.sampled_from([None, 5.0, 50.0]),
    outside=st.booleans(),
)
def test_limits_of_joints_are_never_crossed(
    seed: int, dt: float, acceleration: float | None, outside: bool
) -> None:
    """From inside they are kept, with velocities and accelerations; from outside joints come back, and stay."""
    rng, robot = np.random.default_rng(seed), robot_of("panda")
    ik = wbc.InverseKinematics(robot, dt)
    low, high = robot.position_lower, robot.position_upper
    ik.add(wbc.JointLimits(margin=0.0, acceleration=acceleration))
    posture = ik.add(wbc.PostureTask(rate=rng.choice([1.0, 100.0, 1e4]), error_bound=np.inf))
    room = high - low
    start = rng.uniform(low - 0.1 * room, high + 0.1 * room) if outside else rng.uniform(low, high)
    ik.update(start)
    before = np.maximum(low - start, start - high)
    for period in range(45):
        if period % 15 == 0:
            posture.follow(rng.uniform(low - room, high + room))
        last = robot.v.copy()
        v = ik.step()
        beyond = np.maximum(low - robot.q, robot.q - high)
        assert (beyond <= np.maximum(before, 0.0) + 1e-9).all()
        assert (abs(v) <= robot.velocity_limit + 1e-9).all()
        if acceleration is not None:
            assert (abs(v - last) <= acceleration * dt + 1e-9).all()
        before = beyond


@examples(30)
@given(velocity=st.floats(0.0, 20.0), braking=st.floats(0.5, 200.0), dt=st.sampled_from([1e-3, 1e-2, 0.1]))
def test_the_stopping_velocity_is_the_greatest_that_stops_in_time(
    velocity: float, braking: float, dt: float
) -> None:
    way, left = 0.0, velocity
    while left > 0.0:
        way, left = way + left * dt, left - braking * dt
    found = stopping_velocity(np.array([way]), np.array([braking]), dt)
    assert found[0] == pytest.approx(velocity, rel=1e-6, abs=1e-9)


def test_joints_that_are_not_limited_go_where_they_are_sent() -> None:
    """The fourth joint is sent beyond its limit, and so is the first, which is limited."""
    robot = robot_of("panda")
    high, limits = robot.position_upper + 0.2, wbc.JointLimits(joints=["panda_joint1"], velocity=False)
    ik = wbc.InverseKinematics(robot, 0.01)
    posture = wbc.PostureTask()
    ik.add(limits, posture)
    posture.follow(high)
    for _ in range(200):
        ik.step()
    assert robot.q[0] <= robot.position_upper[0] and robot.q[3] > robot.position_upper[3] + 0.1


# ---- searches -----------------------------------------------------------------------------------------------------


def test_a_search_says_what_is_out_of_reach_and_what_a_limit_holds() -> None:
    ik = solver("panda")
    robot = ik.robot
    hand = ik.add(wbc.PositionTask("panda_hand"))
    hand.target = robot.placement("panda_hand").translation + [3.0, 0.0, 0.0]
    before = robot.q.copy()
    found = ik.reach()
    assert (robot.q == before).all()
    assert not found.reached and not found.held_by and "out of reach" in str(found)
    assert found.errors[hand.name][0] == pytest.approx(float(found.missed[hand.name].split()[0]), rel=1e-2)
    ik.remove(hand)
    turned = ik.add(wbc.OrientationTask("panda_link1"))
    turned.target = pin.rpy.rpyToMatrix(0.0, 0.0, 3.0)  # the first joint ends at 2.9 rad
    found = ik.reach()
    assert found.held_by == ("limits of panda_joint1",)
    assert found.missed == {"panda_link1 orientation": "0.104 rad"}


def test_a_search_leaves_errors_and_what_holds_tasks_back_as_of_the_last_step() -> None:
    ik = solver("panda")
    hand = ik.add(wbc.PositionTask("panda_hand"))
    hand.target = hand.target + [0.1, 0.1, -0.1]
    ik.reach()
    np.testing.assert_array_equal(hand.error, 0.0)
    ik.solve()
    before = hand.error, ik.held_back(), ik.diagnose()
    assert np.linalg.norm(before[0]) > 0.1 and ik.reach().reached
    np.testing.assert_array_equal(hand.error, before[0])
    assert (ik.held_back(), ik.diagnose()) == before[1:]


def test_frames_beyond_their_bounds_are_missed_in_their_units() -> None:
    ik = solver("panda")
    ik.add(wbc.FramePositionLimit("panda_link1", lower=[-np.inf, -np.inf, 5.0], name="high"))
    ik.add(wbc.AxisConeLimit("panda_link0", 0.1, axis=[0.0, np.sin(0.5), np.cos(0.5)], name="cup"))
    found = ik.reach()
    height = ik.robot.placement("panda_link1").translation[2]
    assert found.missed == {"high": f"{5.0 - height:.3g} m", "cup": "0.4 rad"}


def test_more_starts_find_what_one_does_not() -> None:
    ik, robot = solver("panda"), robot_of("panda")
    rng, found = np.random.default_rng(5), []
    hand = ik.add(wbc.PoseTask("panda_hand"))
    for _ in range(5):
        robot.q[:] = rng.uniform(robot.position_lower, robot.position_upper)
        robot.update_jacobians(robot.q)
        hand.target = pin.SE3(robot.placement("panda_hand"))
        found.append((ik.reach().reached, ik.reach(starts=20, seed=1).reached))
    one, more = np.sum(found, axis=0)
    assert one < 5 and more == 5


def test_a_search_from_outside_the_limits_ends_inside() -> None:
    ik = solver("panda")
    ik.update(ik.robot.position_upper + 0.7)
    found = ik.reach()
    assert found.reached
    assert (found.configuration <= ik.robot.position_upper).all()


def test_hard_tasks_that_contradict_each_other_are_named_with_numbers() -> None:
    ik = solver("panda")
    place = ik.robot.placement("panda_hand").translation.copy()
    ik.add(wbc.PositionTask("panda_hand", place + [0.03, 0.0, 0.0], hard=True, name="there"))
    ik.step()
    assert ik.solution is not None and ik.solution.status is Status.SOLVED
    ik.add(wbc.PositionTask("panda_hand", place - [0.03, 0.0, 0.0], hard=True, name="here"))
    ik.step()
    assert ik.solution.status is Status.RELAXED
    violated = ik.diagnose()
    assert set(violated) == {"hard task 'there'", "hard task 'here'"}
    assert all(0.2 < size < 0.5 for size in violated.values())
    found = ik.reach()
    assert set(found.missed) == {"there", "here"}


# ---- refusals -----------------------------------------------------------------------------------------------------

REFUSED: dict[str, tuple[Callable[[wbc.InverseKinematics], object], str]] = {
    "period": (lambda ik: wbc.InverseKinematics(ik.robot, -0.1), "dt of Inverse"),
    "torques": (lambda ik: ik.add(wbc.TorqueLimits()), "torque limits"),
    "torque task": (lambda ik: ik.add(JointTorqueTask()), "forces or torques"),
    "twice": (lambda ik: ik.add(wbc.PostureTask()), "posture"),
    "level": (lambda ik: ik.add(wbc.CoMTask(), level=-1), "level"),
    "level of a limit": (lambda ik: ik.add(wbc.CoMPolygonLimit(), level=1), "every level"),
    "hard in a level": (lambda ik: ik.add(wbc.CoMTask(hard=True), level=1), "every level"),
    "limited joint": (lambda ik: wbc.JointLimits(joints=["elbow_"]).bind(ik.robot), "elbow_"),
    "rate": (lambda ik: wbc.CoMTask(rate=-1.0), "rate"),
    "rate of a contact": (lambda ik: wbc.PointContact("x", rate=np.nan), "rate"),
    "frame": (lambda ik: ik.add(wbc.PoseTask("nowhere")), "nowhere"),
    "not there": (lambda ik: ik.remove(wbc.CoMTask()), "not part"),
    "configuration": (lambda ik: ik.update(np.zeros(3)), "shape"),
    "zeros": (lambda ik: ik.update(np.zeros(ik.robot.nq)), "quaternion"),
    "not finite": (lambda ik: ik.update(np.full(ik.robot.nq, np.nan)), "finite"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_refused_by_name(case: str) -> None:
    act, named = REFUSED[case]
    ik = solver("g1")
    before = (ik.tasks, ik.contacts, ik.limits, ik.robot.q.copy())
    with pytest.raises(InputError, match=named):
        act(ik)
    assert (ik.tasks, ik.contacts, ik.limits) == before[:3]
    assert (ik.robot.q == before[3]).all()
    assert ik.solve().shape == (ik.robot.nv,)


def test_a_search_names_a_contact_that_a_target_contradicts_and_an_obstacle_that_is_inside() -> None:
    ik = solver("talos")
    robot = ik.robot
    sole = robot.soles[0].frame
    ik.add(
        wbc.PositionTask(sole, robot.placement(sole).translation + [0.0, 0.0, 0.2], hard=True, name="lift")
    )
    found = ik.reach()
    assert set(found.held_by) == {"lift", "contact left_foot"} == set(found.missed)
    assert found.missed["contact left_foot"].endswith(" m")
    ik, ball = solver("panda"), wbc.CollisionSphere(0.05)
    lamp = wbc.Obstacle("lamp", ball, pin.SE3(np.eye(3), np.array([2.0, 0.0, 0.0])))
    ik.add(wbc.CollisionLimit(obstacles=[lamp], shapes=dict.fromkeys(("panda_hand", "panda_link7"), ball)))
    ik.add(wbc.PositionTask("panda_hand", hard=True))
    lamp.placement = ik.robot.placement("panda_hand")
    found = ik.reach(iterations=1)
    assert "collisions" in found.held_by and "'lamp'" in found.missed["collisions"]


@pytest.mark.parametrize("hard", [False, True])
def test_a_search_names_targets_that_contradict_each_other(hard: bool) -> None:
    """Each of two points can be reached by the hand, and not both; a point that nobody can reach is not among these."""
    for far, held in ((0.3, {"here", "there"}), (0.0, set())):
        ik = wbc.InverseKinematics(wbc.load_robot("panda").robot(), 0.01)
        ik.add(wbc.JointLimits())
        for name, y in (("here", 0.0), ("there", far)):
            ik.add(wbc.PositionTask("panda_hand", [0.5, y, 0.5], hard=hard, name=name))
        found = ik.reach()
        assert found.reached is not bool(held) and set(found.held_by) == held == set(found.missed)
        assert "out of reach" not in str(found)


def test_gaze_and_relative_tasks_are_reached() -> None:
    ik = solver("g1")
    robot = ik.robot
    pose = pin.SE3(np.eye(3), np.array([0.05, -0.25, 0.05]))
    ik.add(RelativeFrameTask(right_hand(robot), robot.torso_frame, pose, axes=("x", "y", "z")))
    look = ik.add(LookAtTask(robot.torso_frame, [1.0, 0.2, 1.0], axes=("yaw",)))
    for _ in range(200):
        ik.step()
    assert all(task.reached for task in ik.tasks if task is not ik.task("posture"))
    assert abs(look.error).max() < 1e-3
