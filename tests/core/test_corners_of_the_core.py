"""Parts of the core that few programs reach, in closed form: released joints, levels, texts, last digits."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from at_rest import at_rest
from task_factory import standing

import wbc
from wbc.base.errors import InputError, MeasurementError
from wbc.core.drive.position import PositionControl
from wbc.core.estimation.checks.plausibility import Plausibility
from wbc.core.estimation.outside import OutsideSettings, OutsideWrench
from wbc.core.limits.base import Limit
from wbc.core.qp.move import DirectionCoordinates
from wbc.core.robot import GRAVITY
from wbc.core.trajectories import Trajectory
from wbc.robots import load
from wbc.tasks import OrientationTask, PoseTask, PositionTask, PostureTask

DT = 0.005
FixedContact = wbc.FixedContact
G1, PANDA = load("g1"), load("panda")
ARM = ("left_shoulder_pitch_joint", "left_elbow_joint")


# ---- joints of somebody else, and of nobody -------------------------------------------------------------------------


def arm_joints(robot: wbc.Robot) -> list[str]:
    return [name for name in robot.joint_names if "left_shoulder" in name or "left_elbow" in name]


def test_the_commanded_robot_has_released_joints_where_and_as_fast_as_they_are() -> None:
    controller = standing("hrp4_class", DT)
    control, robot = PositionControl(controller), controller.robot
    names = [name for name in robot.joint_names if "left" in name and ("shoulder" in name or "elbow" in name)]
    released = control.release(names)
    assert released is not None and len(names) > 1
    index, before = released.index, None
    for tick in range(4):
        measured = at_rest(robot, tick * DT)
        q, v = measured.joint_position.copy(), np.zeros(robot.na)
        q[index] += 0.01 * (tick + 1) * np.arange(1, len(index) + 1)
        v[index] = np.linspace(0.1, 0.4, len(index))
        control.estimate(replace(measured, joint_position=q, joint_velocity=v))
        if before is not None:  # in the last tick: the tick begins with what is known
            np.testing.assert_allclose(control.q[7 + index], before[0], atol=1e-9)
            np.testing.assert_allclose(control.v[6 + index], before[1], atol=1e-9)
        before = q[index], v[index]


def test_an_encoder_of_a_released_joint_beyond_its_range_is_named_and_fails_no_tick() -> None:
    robot = load("hrp4_class").robot()
    checks, mask = Plausibility(robot, DT), np.zeros(robot.na, bool)
    mask[3] = True
    checks.check(at_rest(robot, 0.0))
    beyond = at_rest(robot, 0.0).joint_position.copy()
    beyond[3] = robot.position_upper[3] + 1.0
    for tick in range(1, 40):
        used, _ = checks.check(at_rest(robot, tick * DT, joint_position=beyond), forgiven=mask)
        assert checks.faults == (f"encoder of {robot.joint_names[3]}",)
        margin = checks.settings.position_margin
        assert used.joint_position[3] == pytest.approx(robot.position_upper[3] + margin)
        assert used.joint_velocity[3] == 0.0
    fast = np.zeros(robot.na)
    fast[3] = 1e3
    for tick in range(40, 80):
        checks.check(at_rest(robot, tick * DT, joint_velocity=fast), forgiven=mask)
    with pytest.raises(MeasurementError):
        checks.check(at_rest(robot, 80 * DT, joint_velocity=fast))


@pytest.mark.parametrize("at_end", [False, True])
def test_torques_of_released_joints_tell_their_motion_and_at_an_end_what_is_measured_does(
    at_end: bool,
) -> None:
    """M q̈ + h = τ in their rows, with the accelerations of all others as solved."""
    robot = G1.robot()
    controller = wbc.balance_controller(robot, DT)
    released = controller.release(arm_joints(robot))
    assert released is not None
    rng, columns = np.random.default_rng(3), released.columns
    q, v = np.array(robot.q), np.zeros(robot.nv)
    if at_end:
        q[7 + released.index[1]] = robot.position_upper[released.index[1]] + 0.1
    robot.update(q, v)
    torque, solved = rng.normal(size=robot.na), rng.normal(size=robot.nv)
    released._measured[:] = rng.normal(size=released.dim)
    measured = released._measured.copy()
    found = released._driven(q, torque, solved)
    moved = solved.copy()
    moved[columns] = found
    rest = (np.array(robot.mass_matrix) @ moved + np.array(robot.bias))[columns] - torque[released.index]
    free = np.ones(released.dim, bool)
    if at_end:
        free[1] = False
        assert found[1] == pytest.approx(measured[1])
    np.testing.assert_allclose(rest[free], 0.0, atol=1e-9)


def test_joints_without_a_drive_have_no_torque_and_released_ones_none_of_ours() -> None:
    name = "waist_yaw_joint"
    robot = replace(G1, passive=(name,)).robot()
    index = robot.joint_index(name)
    controller = wbc.balance_controller(robot, DT)
    controller.task("com").target = controller.task("com").target + [0.01, 0.01, 0.0]
    solution = controller.solve()
    assert solution.ok and abs(solution.torques[index]) < 1e-6
    moved = np.array(robot.mass_matrix) @ solution.accelerations + np.array(robot.bias)
    for contact in controller.contacts:
        jacobian = pin.getFrameJacobian(
            robot.model, robot.data, robot.frame_id(contact.frame), pin.ReferenceFrame.LOCAL
        )
        moved -= jacobian.T @ solution.wrenches[contact.name]
    assert moved[6 + index] == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(moved[6:], solution.torques, atol=1e-5)


# ---- contacts and solutions -----------------------------------------------------------------------------------------


def test_a_grip_pulls_as_hard_as_it_pushes() -> None:
    controller = wbc.balance_controller(G1.robot(), DT)
    grip = controller.add(FixedContact("left_hand", max_force=300.0))
    assert tuple(side[2] for side in grip.force_ranges()) == pytest.approx((-300.0, 300.0))


def test_a_solution_is_guessed_from_the_parts_of_the_last_one_by_their_names() -> None:
    controller = wbc.balance_controller(G1.robot(), DT)
    last = controller.solve()
    assert last.ok
    before = {name: wrench.copy() for name, wrench in last.wrenches.items()}
    controller.add(wbc.PointContact("left_hand"), PositionTask("right_hand"))
    controller.solve()
    x, layout = controller._variables_of(last), controller._assembly.layout
    np.testing.assert_array_equal(x[: layout.nv], last.accelerations)
    for name, columns in layout.contacts.items():
        np.testing.assert_array_equal(x[columns], before.get(name, np.zeros(3)))
    assert not controller._variables_of(None).any()
    other = SimpleNamespace(contacts={name: slice(30, 32) for name in before}, nv=layout.nv)
    short: Any = SimpleNamespace(layout=other, accelerations=last.accelerations, variables=last.variables)
    assert not controller._variables_of(short)[layout.nv :].any(), "of another size it is another contact"


def test_a_contact_that_is_switched_goes_on_from_the_share_of_its_forces_that_is_allowed() -> None:
    """While it unloads the bound goes with what it carried; loaded again, with the same share of the greatest."""
    controller = wbc.balance_controller(G1.robot(), DT)
    foot, grip = controller.contacts[0], controller.add(FixedContact("left_hand", ramp=0.1))
    foot.ramp = 0.1
    controller.solve()
    solution = controller.solve()
    carried = {each.name: np.abs(solution.wrenches[each.name]).copy() for each in (foot, grip)}
    greatest = 4.0 * controller.robot.mass * GRAVITY
    assert foot.force_ranges()[1] == pytest.approx(greatest)
    low, high = grip.force_ranges()
    np.testing.assert_allclose(high, [np.inf, np.inf, 1e6, np.inf, np.inf, np.inf])
    np.testing.assert_allclose(low, -high)
    foot.active = grip.active = False
    for tick in range(1, 6):
        for each in (foot, grip):
            each.advance(DT)
        share = 1.0 - tick * DT / 0.1
        assert foot.force_ranges()[1] == pytest.approx(share * carried["left_foot"][2], rel=1e-6)
        assert grip.engaged and foot.engaged
        least = 1e-3 * controller.robot.mass * GRAVITY
        bounds = grip.force_ranges()[1]
        assert (bounds <= share * np.maximum(carried[grip.name], 50.0 * least) + 1e-9).all()
    before = foot.force_ranges()[1]
    foot.active = True
    assert foot.force_ranges()[1] == pytest.approx(before), "without a jump"
    share = before / greatest
    foot.advance(DT)
    assert foot.force_ranges()[1] == pytest.approx((share + DT / 0.1) * greatest)


def test_a_grip_that_is_loaded_has_a_share_of_four_weights_and_of_their_moments() -> None:
    controller = wbc.balance_controller(G1.robot(), DT)
    grip = controller.add(FixedContact("left_hand", ramp=0.1, active=False))
    grip.active = True
    for tick in range(1, 4):
        grip.advance(DT)
        high = tick * DT / 0.1 * 4.0 * controller.robot.mass * GRAVITY
        np.testing.assert_allclose(grip.force_ranges()[1], [high] * 6)
        np.testing.assert_allclose(grip.force_ranges()[0], [-high] * 6)
        assert tuple(side[2] for side in grip.force_ranges()) == pytest.approx((-high, high))


# ---- what holds a task back -----------------------------------------------------------------------------------------


def held(weight: float, ways: tuple[float, float]) -> tuple[Any, Any, wbc.Controller]:
    """Two tasks of the same hand of an arm that pull it along y, and the controller at rest between them."""
    controller = wbc.Controller(PANDA.robot(), DT)
    hand = np.array(controller.robot.placement("panda_hand").translation)
    one = controller.add(PositionTask("panda_hand", hand + [0.0, ways[0], 0.0], name="one", weight=1.0))
    other = controller.add(
        PositionTask("panda_hand", hand + [0.0, ways[1], 0.0], name="other", weight=weight)
    )
    assert controller.solve().ok
    return one, other, controller


def test_tasks_that_pull_a_hand_apart_hold_each_other_back() -> None:
    one, other, controller = held(3.0, (0.3, -0.1))
    assert one.held_back_by == ("other",) and other.held_back_by == ("one",)
    table = controller.status_table()
    assert "held back by other" in table and "held back by one" in table
    one, other, _ = held(3.0, (0.1, 0.1))
    assert one.held_back_by == () == other.held_back_by, "they agree"


@pytest.mark.parametrize(("off", "far"), [(0.0104, True), (0.0096, False)])
def test_a_task_is_held_back_from_the_error_on_with_which_it_is_reached(off: float, *, far: bool) -> None:
    """10 mm: a residual of the stiffness times that."""
    one, _, _ = held(1e6, (off, 0.0))
    assert (one.held_back_by == ("other",)) == far


def test_a_task_against_a_limit_is_held_back_by_it_and_one_against_a_contact_by_that() -> None:
    controller = wbc.Controller(PANDA.robot(), DT)
    robot, name = controller.robot, "panda_joint4"
    index = robot.joint_index(name)
    q = np.array(robot.half_sitting)
    q[index] = robot.position_upper[index] - 1e-4
    controller.update(q, np.zeros(robot.nv))
    elbow = controller.add(PostureTask(joints=[name]))
    controller.add(wbc.JointLimits())
    elbow.target = [robot.position_upper[index] - 1e-4]
    elbow._target = np.array([robot.position_upper[index] + 0.4])
    assert controller.solve().ok
    assert elbow.held_back_by == (f"limits of {name}",)
    standing_one = wbc.balance_controller(G1.robot(), DT)
    foot = standing_one.add(PositionTask(standing_one.robot.soles[0].frame))
    foot.target = foot.target + [0.0, 0.0, 0.1]
    assert standing_one.solve().ok
    assert foot.held_back_by == ("contacts and hard tasks",)


# ---- areas ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", [(0.0, 0.0), (-30.0, 70.0)])
def test_a_polygon_needs_room_for_its_margin_where_its_widest_circle_is(place: tuple[float, float]) -> None:
    """A triangle with legs of 1 m has a circle of 1/(2 + √2) m in it, beside the mean of its corners."""
    corners = np.add([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], place)
    radius = 1.0 / (2.0 + math.sqrt(2.0))
    limit = wbc.CoMPolygonLimit(corners, margin=0.999 * radius)
    np.testing.assert_allclose(np.sort(limit.polygon, axis=0), np.sort(corners, axis=0))
    with pytest.raises(InputError, match="leaves nothing inside its margin"):
        wbc.CoMPolygonLimit(corners, margin=1.001 * radius)


# ---- times ----------------------------------------------------------------------------------------------------------


def test_a_speed_alone_is_reached_in_two_tenths_of_a_second() -> None:
    """Of the least jerk: 15/8 d/v, or √(10/√3 d/a) with a = v/0.2 where that is longer."""
    for way, speed in ((2.0, 0.5), (0.05, 0.5), (0.3, 3.0)):
        least = max(1.875 * way / speed, math.sqrt(10.0 / math.sqrt(3.0) * way * 0.2 / speed))
        assert Trajectory([(0.0,), (way,)], speed=speed).duration == pytest.approx(least, rel=1e-4)
    with pytest.raises(InputError, match=r"must be at least 7\.5 s"):
        Trajectory([(0.0,), (2.0,)], 7.4, speed=0.5)
    assert Trajectory([(0.0,), (2.0,)], 7.6, speed=0.5).duration == 7.6


# ---- inverse kinematics ---------------------------------------------------------------------------------------------


def test_a_task_on_a_lower_level_is_held_back_by_those_before_it() -> None:
    ik = wbc.InverseKinematics(PANDA.robot(), 0.01)
    hand = np.array(ik.robot.placement("panda_hand").translation)
    first = ik.add(PositionTask("panda_hand", hand, name="first"))
    second = ik.add(PositionTask("panda_hand", hand + [0.1, 0.0, 0.0], name="second"), level=1)
    idle = ik.add(PostureTask(name="idle"))
    idle.scale = 0.0
    assert ik.held_back() == {}
    ik.step()
    assert ik.held_back() == {"second": ("first",)}
    second.target = hand
    ik.step()
    assert ik.held_back() == {}
    assert first.name == "first"


class Wall(Limit):
    """Bound of the step of one coordinate."""

    name, dim, step_unit = "wall", 1, "m"

    def bind(self, robot: wbc.Robot) -> None:
        self._nv = robot.nv

    def write(self, dt: float, rows: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> None:
        raise NotImplementedError

    def write_step(self, rows: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> None:
        rows[0] = 0.0
        rows[0, 2] = 1.0
        lower[0], upper[0] = -0.3, 0.2


def test_a_limit_of_a_step_bounds_velocities_by_the_period() -> None:
    wall, rows = Wall(), np.ones((1, 5))
    lower, upper = np.zeros(1), np.zeros(1)
    wall.write_velocity(0.01, rows, lower, upper)
    np.testing.assert_allclose([lower[0], upper[0]], [-30.0, 20.0])
    np.testing.assert_array_equal(rows, [[0.0, 0.0, 1.0, 0.0, 0.0]])
    assert wall.violation(0, 0.0123456) == "0.0123 m"


# ---- estimates ------------------------------------------------------------------------------------------------------


def test_a_wrench_that_the_model_explains_comes_off_the_estimate_at_once() -> None:
    robot = load("hrp4_class").robot()
    observer = OutsideWrench(robot, OutsideSettings(tare=0.0))
    wrenches = at_rest(robot, 0.0).wrenches
    for _ in range(5):
        observer.update(1.2 * wrenches, DT)
    before, value = observer.wrench.copy(), np.array(observer._residual.value)
    taken = (1.0, -2.0, 30.0, 0.1, 0.2, -0.3)
    observer.explain(taken)
    np.testing.assert_allclose(observer.wrench, before - taken, atol=1e-12)
    np.testing.assert_allclose(observer._residual.value, value - taken, atol=1e-12)
    fresh = OutsideWrench(robot, OutsideSettings(tare=0.0))
    fresh.explain(taken)
    np.testing.assert_allclose(fresh.wrench, [-part for part in taken])


# ---- moves ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_rates_of_a_direction_are_those_of_the_direction_across_it(seed: int) -> None:
    """ω = d × ḋ, and its derivative d × d̈, by differences along r + ṙ t + r̈ t²/2."""
    rng = np.random.default_rng(seed)
    base = rng.normal(size=3)
    base /= np.linalg.norm(base)
    moving = DirectionCoordinates(base, np.asarray)
    r, v, a = (scale * rng.normal(size=3) for scale in (0.6, 0.8, 1.0))
    h, ways = 1e-4, []
    for t in (-h, 0.0, h):
        ways.append(pin.exp3(r + v * t + 0.5 * a * t * t) @ base)
    first, second = (ways[2] - ways[0]) / (2.0 * h), (ways[2] - 2.0 * ways[1] + ways[0]) / h**2
    direction, spin, rate = moving.target(r, v, a)
    np.testing.assert_allclose(direction, ways[1], atol=1e-12)
    np.testing.assert_allclose(spin, np.cross(direction, first), atol=1e-6)
    np.testing.assert_allclose(rate, np.cross(direction, second), atol=1e-5)


def test_the_usual_speed_of_a_target_is_that_of_each_of_its_units() -> None:
    robot = PANDA.robot()
    for task, speed in (
        (PositionTask("panda_hand"), 0.2),
        (OrientationTask("panda_hand"), 1.0),
        (PoseTask("panda_hand"), [0.2, 1.0]),
    ):
        task.bind(robot)
        assert task._usual_speed() == speed
    posture = PostureTask()
    posture.bind(robot)
    assert posture._usual_speed() is not None


def test_points_of_a_trajectory_that_are_the_same_need_no_time_or_are_named() -> None:
    same = Trajectory([(1.0, 2.0), (1.0, 2.0)], speed=1.0)
    assert same.duration == 0.0 and same.at(0.0)[0].tolist() == [1.0, 2.0]
    rests = Trajectory([(1.0, 2.0)] * 3, 0.7)
    assert rests.duration == 0.7 and rests.at(0.3)[0].tolist() == [1.0, 2.0]
    with pytest.raises(InputError, match=r"must differ, 1 and 2 are \[3\. 4\.\]"):
        Trajectory([(1.0, 2.0), (3.0, 4.0), (3.0, 4.0), (5.0, 5.0)], speed=1.0)
    back = Trajectory([(1.0, 2.0), (1.0, 2.0)], 0.5, velocity=(1.0, 0.0))
    assert back.duration == 0.5 and back.at(0.0)[1].tolist() == pytest.approx([1.0, 0.0])
    assert back.at(0.25)[0][0] > 1.01 and math.isclose(back.at(0.5)[0][0], 1.0)


# ---- texts ----------------------------------------------------------------------------------------------------------


def test_links_without_a_shape_are_refused_with_those_that_have_one() -> None:
    for shapes, known in (({}, "none"), ({"panda_link7": wbc.CollisionSphere(0.1)}, "panda_link7")):
        limit = wbc.CollisionLimit([("panda_link7", "panda_link1")], shapes=shapes)
        with pytest.raises(InputError, match=rf"\(it has it for: {known}\)"):
            limit.bind(PANDA.robot())
