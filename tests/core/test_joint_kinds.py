"""Joints of all kinds: those that slide, a single one, and those without limits."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pinocchio as pin
import pytest
from properties import each_once

import wbc
from wbc.base.errors import InputError
from wbc.core.limits.joint import JointLimits
from wbc.core.robot import UNLIMITED
from wbc.robots import RobotDescription, load
from wbc.tasks import LookAtTask, LowAccelerationTask, MomentumTask, PostureTask, check_rows

# ---- joints that slide --------------------------------------------------------------------------------------------

FINGER = "panda_finger_joint1"


def gripping(*joints: str, **options: float) -> tuple[wbc.Controller, PostureTask]:
    controller = wbc.Controller(load("panda").robot(), 0.005)
    return controller, controller.add(PostureTask(joints=list(joints) or None, **options))


def test_an_angle_is_a_tenth_of_a_metre_per_rad_for_a_joint_that_slides() -> None:
    robot = load("panda").robot()
    slides = np.array([name == FINGER for name in robot.joint_names])
    np.testing.assert_array_equal(robot.slides, slides)
    np.testing.assert_allclose(robot.per_rad, np.where(slides, 0.1, 1.0))


@pytest.mark.parametrize("hard", [False, True])
@pytest.mark.parametrize("joints", [(), (FINGER,), ("panda_joint2", FINGER)])
def test_reports_of_postures_know_joints_that_turn_and_joints_that_slide(
    joints: tuple[str, ...], hard: bool
) -> None:
    """A posture at its target is held back by nothing; one that is moved has an error in m and another in rad."""
    controller, task = gripping(*joints, hard=hard)
    solver = wbc.InverseKinematics(load("panda").robot(), 0.005)
    posture = solver.add(PostureTask(joints=list(joints) or None, hard=hard, weight=1.0))
    controller.solve()
    assert "posture" in controller.status_table()
    assert not controller.held_back() and not task.held_back_by
    solver.step()
    assert not solver.held_back() and not posture.held_back_by
    robot = solver.robot
    robot.q[:] = robot.configuration({"panda_joint2": 0.3, FINGER: 0.01})
    robot.update(robot.q, robot.v)
    found = solver.reach()
    assert found.reached and len(found.errors["posture"]) == (1 if joints == (FINGER,) else 2)
    robot.update(found.configuration, robot.v)
    posture.target = {FINGER: 0.03}
    sizes = {unit: size for unit, _, size in posture.sizes(posture.target - posture.present(robot))}
    assert sizes["m"] == pytest.approx(abs(0.03 - robot.q[robot.joint_index(FINGER)]))
    assert sizes.get("rad", 0.0) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("off", "speed", "reached"),
    [(0.038, 0.0, False), (0.006, 0.0, False), (0.003, 0.0, True), (0.0, 0.03, False), (0.0, 0.01, True)],
)
@pytest.mark.parametrize("joints", [(), (FINGER,), ("panda_joint2", FINGER)])
def test_a_finger_has_reached_its_target_within_millimetres(
    joints: tuple[str, ...], off: float, speed: float, reached: bool
) -> None:
    controller, task = gripping(*joints)
    robot = controller.robot
    i = robot.joint_index(FINGER)
    robot.q[i], robot.v[i] = 0.04 - off, speed
    robot.update(robot.q, robot.v)
    task.target = {FINGER: 0.04}
    assert task.reached is reached
    if "panda_joint2" in task.joints:  # the others keep what they had
        task.target = {"panda_joint2": robot.q[1] + 0.04, FINGER: float(robot.q[i])}
        robot.v[i] = 0.0
        assert task.reached
        task.target = {"panda_joint2": robot.q[1] + 0.06}
        assert not task.reached


def test_ranges_speeds_ends_and_errors_of_a_finger_are_those_of_metres() -> None:
    controller, task = gripping(FINGER)
    robot = controller.robot
    i = robot.joint_index(FINGER)
    for beyond in (0.001, 0.003):
        accepted = beyond < 0.002
        for give in (
            lambda at: setattr(task, "target", [at]),
            lambda at: robot.configuration({FINGER: at}),
        ):
            with nullcontext() if accepted else pytest.raises(InputError, match=r"\(m\).*range"):
                give(0.04 + beyond)
    assert task.error_bound == pytest.approx([0.1])
    assert gripping(FINGER, error_bound=0.7)[1].error_bound == pytest.approx([0.7])
    bounds = gripping()[1].error_bound
    np.testing.assert_allclose(bounds, np.where(robot.slides, 0.1, 1.0))
    task.target = [0.04]
    task.move_to([0.0])
    places = [0.04]
    while task.moving:
        controller.solve()
        places.append(float(task.target[0]))
    speeds = np.diff(places) / controller.dt
    assert 0.1 < np.abs(speeds).max() <= 0.2 + 1e-9
    assert np.abs(np.diff(speeds)).max() / controller.dt <= 1.0 + 1e-6  # reached in 0.2 s
    released = wbc.Controller(load("panda").robot(), 0.005).release([FINGER])
    assert released is not None
    assert (robot.position_lower[i] < released._low < released._high < robot.position_upper[i]).all()
    ik = wbc.InverseKinematics(load("panda").robot(), 0.01)
    ik.add(JointLimits())
    ik.add(PostureTask({FINGER: 0.02}, joints=[FINGER], hard=True))
    ik.add(PostureTask({FINGER: 0.01}, joints=[FINGER], hard=True, name="other"))
    assert all(size.endswith(" m") for size in ik.reach().missed.values())


# ---- a single joint -----------------------------------------------------------------------------------------------

LINK = (
    '<inertial><origin xyz="0 0 0.2"/><mass value="1"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def single(kind: str, end: float = 1.0) -> RobotDescription:
    """A robot of one joint, with a tip 1 m above it; the joint ends at ± `end`, rad or m."""
    links = "".join(f'<link name="{name}">{LINK}</link>' for name in ("base", "arm", "tip"))
    return RobotDescription.from_urdf(
        f'<robot name="one">{links}<joint name="j" type="{kind}"><parent link="base"/><child link="arm"/>'
        f'<axis xyz="0 1 0"/><limit lower="{-end}" upper="{end}" effort="20" velocity="3"/></joint>'
        '<joint name="f" type="fixed"><parent link="arm"/><child link="tip"/><origin xyz="0 0 1"/></joint></robot>',
        base="fixed",
        armature=0.01,
    )


def ball() -> wbc.Obstacle:
    return wbc.Obstacle("ball", wbc.CollisionSphere(0.1), pin.SE3(np.eye(3), np.array([0.5, 0.5, 1.0])))


ITEMS = {
    "place": lambda: wbc.PositionTask("tip"),
    "pose": lambda: wbc.PoseTask("tip"),
    "centre of mass": wbc.CoMTask,
    "momentum": MomentumTask,
    "accelerations": LowAccelerationTask,
    "gaze": lambda: LookAtTask("tip", [1.0, 2.0, 3.0]),
    "point": lambda: wbc.PointContact("tip"),
    "box": lambda: wbc.FramePositionLimit("tip", upper=(0.3, 0.3, 2.0)),
    "cone": lambda: wbc.AxisConeLimit("tip", 0.3),
    "speed": lambda: wbc.FrameSpeedLimit("tip", linear=0.1),
    "joint": lambda: JointLimits(acceleration=5.0),
    "collisions": lambda: wbc.CollisionLimit(obstacles=[ball()], shapes={"tip": wbc.CollisionSphere(0.1)}),
}


@pytest.mark.parametrize(("item", "kind"), each_once(list(ITEMS), ["revolute", "prismatic", "continuous"]))
def test_a_robot_of_one_joint_is_a_robot(kind: str, item: str) -> None:
    """Shapes are those of any robot; rows are right; both solvers have solutions."""
    description = single(kind)
    robot = description.robot()
    assert robot.mass_matrix.shape == (1, 1) and robot.com_jacobian.shape == (3, 1)
    assert robot.joint_jacobians.shape == (6, 1)
    if item not in ("accelerations", "gaze"):
        check_rows(ITEMS[item](), description.robot())
    controller = wbc.Controller(description.robot(), 0.005)
    ik = wbc.InverseKinematics(description.robot(), 0.01)
    for solver in (controller, ik):
        solver.add(PostureTask({"j": 0.5}), ITEMS[item]())
    for _ in range(3):
        assert controller.solve().ok
        ik.step()
    assert np.isfinite(ik.reach(iterations=5).configuration).all()


@pytest.mark.parametrize(
    ("kind", "place"), [("revolute", (0.4794, 0.0, 0.8776)), ("prismatic", (0.0, 0.5, 1.0))]
)
def test_a_single_joint_brings_its_tip_to_where_it_can_be(kind: str, place: tuple[float, ...]) -> None:
    ik = wbc.InverseKinematics(single(kind).robot(), 0.01)
    ik.add(JointLimits())
    ik.add(wbc.PositionTask("tip", place))
    assert ik.reach(1e-3).configuration == pytest.approx([0.5], abs=1e-3)


def test_short_ranges_have_their_own_thresholds() -> None:
    """A slide of 8 mm is not always at its target; one of 2 mm has a middle in which no stop acts."""
    controller = wbc.Controller(single("prismatic", 0.004).robot(), 0.005)
    task, robot = controller.add(PostureTask({"j": 0.002})), controller.robot
    for place, reached in ((-0.0015, False), (0.001, False), (0.0015, True)):
        robot.update(np.array([place]), np.zeros(1))
        assert task.reached is reached
    released = wbc.Controller(single("prismatic", 0.001).robot(), 0.005).release(["j"])
    assert released is not None
    assert -0.001 < released._low[0] < 0.0 < released._high[0] < 0.001


# ---- joints without limits ----------------------------------------------------------------------------------------


def test_a_velocity_limit_of_zero_is_none() -> None:
    """As files have it where nobody has set one: such a joint moves."""
    model = load("panda").robot().model.copy()
    model.upperVelocityLimit[:] = 0.0
    robot = wbc.Robot(model, (), load("panda").robot().half_sitting)
    assert (robot.velocity_limit == UNLIMITED).all()
    ik = wbc.InverseKinematics(robot, 0.01)
    ik.add(JointLimits())
    posture = ik.add(PostureTask())
    posture.target = posture.target + 0.1 * robot.per_rad
    for _ in range(200):
        ik.step()
    assert posture.reached
