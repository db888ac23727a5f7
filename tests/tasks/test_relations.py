"""Tasks on one number and limits on a frame: rows by finite differences, and what they do in both solvers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from properties import by_default
from task_factory import left_hand, right_hand

import wbc
from wbc.base.errors import InputError, UnknownNameError
from wbc.core.robot import Robot
from wbc.tasks import DistanceTask, JointCouplingTask, LowAccelerationTask, ManipulabilityTask, check_rows

robots = pytest.mark.parametrize("name", by_default(("hrp4_class", "talos", "g1", "panda"), "g1"))


def ends(robot: Robot) -> tuple[str, str]:
    return ("panda_hand", "panda_link2") if robot.name == "panda" else (left_hand(robot), right_hand(robot))


ITEMS: dict[str, Callable[[Robot], wbc.Task | wbc.Limit]] = {
    "distance": lambda r: DistanceTask(*ends(r)),
    "coupling": lambda r: JointCouplingTask({r.joint_names[1]: 1.0, r.joint_names[3]: -0.5}),
    "manipulability": lambda r: ManipulabilityTask(ends(r)[0]),
    "box": lambda r: wbc.FramePositionLimit(ends(r)[0], lower=(0.1, -0.2, 0.1), upper=(0.5, 0.5, 0.5)),
    "plane": lambda r: wbc.FramePositionLimit(ends(r)[0], directions=[(0.0, 3.0, 4.0)], upper=[0.5]),
    "speed": lambda r: wbc.FrameSpeedLimit(ends(r)[0], linear=0.5, angular=1.0),
    "cone": lambda r: wbc.AxisConeLimit(ends(r)[0], 0.4, axis=(0.0, 1.0, 1.0), direction=(1.0, 0.0, 1.0)),
}


@robots
@pytest.mark.parametrize("item", ITEMS)
def test_rows_are_what_finite_differences_say(name: str, item: str) -> None:
    robot = wbc.load_robot(name).robot()
    check_rows(ITEMS[item](robot), robot, seed=1)  # in which no axis is opposite to its cone within 0.1 rad


def arm(*items: wbc.Task | wbc.Limit) -> wbc.InverseKinematics:
    ik = wbc.InverseKinematics(wbc.load_robot("panda").robot(), 0.01)
    ik.add(wbc.JointLimits(), wbc.PostureTask(weight=1e-4), *items)
    return ik


def test_a_hand_stays_in_its_box_below_its_speed_and_upright() -> None:
    """Towards a target that is outside of all of them; in both solvers."""
    robot = wbc.load_robot("panda").robot()
    start = robot.placement("panda_hand").translation.copy()
    limits = [
        wbc.FramePositionLimit("panda_hand", upper=start + [0.1, 0.15, 1.0], name="box"),
        wbc.FrameSpeedLimit("panda_hand", linear=0.2),
        wbc.AxisConeLimit("panda_hand", 0.2, direction=(0, 0, -1)),
    ]
    tilted = robot.placement("panda_hand").rotation @ pin.exp3(np.array([1.0, 0.0, 0.0]))
    goal = pin.SE3(tilted, start + [0.5, 0.5, -0.5])

    def inside(state: Robot, slack: float) -> None:
        hand = state.placement("panda_hand")
        assert (hand.translation - start <= np.array([0.1, 0.15, 1.0]) + slack).all()
        assert np.arccos(-hand.rotation[2, 2]) < 0.2 + 10 * slack

    ik = arm(*limits)
    hand = ik.add(wbc.PoseTask("panda_hand", goal))
    for _ in range(100):
        velocities = ik.solve()
        assert (abs(hand.evaluated()[0][:3] @ velocities) <= 0.2 + 1e-7).all()
        ik.step()
        inside(ik.robot, 1e-4)
    assert ik.solution is not None and {"box", "panda_hand cone"} <= set(ik.solution.active_limits)
    ik.remove(hand, *limits)

    controller = wbc.Controller(robot, 0.002)
    controller.add(wbc.JointLimits(), wbc.PostureTask(weight=1e-3))
    controller.add(*limits)
    controller.add(wbc.PoseTask("panda_hand", goal))
    q, v = robot.q.copy(), robot.v.copy()
    for _ in range(300):
        controller.update(q, v)
        solution = controller.solve()
        assert solution.ok
        v = v + 0.002 * solution.accelerations
        q = pin.integrate(robot.model, q, 0.002 * v)
        inside(robot, 2e-3)
        speed = pin.getFrameVelocity(
            robot.model, robot.data, robot.frame_id("panda_hand"), pin.LOCAL_WORLD_ALIGNED
        )
        assert (abs(speed.linear) < 0.21).all()


def test_coupled_joints_and_a_distance_are_kept_while_the_hand_moves() -> None:
    coupling = JointCouplingTask({"panda_joint2": 1.0, "panda_joint4": 0.5}, hard=True)
    distance = DistanceTask("panda_hand", "panda_link2", hard=True)
    ik = arm(coupling, distance)
    before = [task.target.copy() for task in (coupling, distance)]
    hand = ik.add(wbc.PositionTask("panda_hand"))
    hand.target = hand.target + [0.1, 0.3, 0.1]
    for _ in range(150):
        ik.step()
    for task, kept in zip((coupling, distance), before, strict=True):
        assert task.present(ik.robot) == pytest.approx(kept, abs=1e-5)
    coupling.move_to(coupling.target + 0.2)
    for _ in range(150):
        ik.step()
    assert coupling.reached


def test_manipulability_grows_to_its_target() -> None:
    ik = arm()
    ik.update(ik.robot.configuration({"panda_joint4": -0.3, "panda_joint2": 0.2}))
    task = ik.add(ManipulabilityTask("panda_hand", 0.1, weight=100.0))
    before = float(task.present(ik.robot)[0])
    while not task.reached:
        ik.step()
    assert before < 0.05


def test_low_acceleration_makes_velocities_change_less() -> None:
    jerks = []
    for weight in (0.0, 1.0):
        ik = arm(LowAccelerationTask(weight=weight))
        hand = ik.add(wbc.PositionTask("panda_hand"))
        hand.target = hand.target + [0.0, 0.1, 0.0]
        last, most = np.zeros(ik.robot.nv), 0.0
        for _ in range(200):
            v = ik.step()
            most, last = max(most, float(abs(v - last).max())), v
        jerks.append(most)
        assert np.linalg.norm(hand.error) < 0.01
    assert jerks[1] < 0.5 * jerks[0]


REFUSED: dict[str, tuple[Callable[[Robot], object], str]] = {
    "frame twice": (lambda r: DistanceTask("a", "a"), "twice"),
    "no joints": (lambda r: JointCouplingTask({}), "coefficient"),
    "zeros": (lambda r: JointCouplingTask({"a": 0.0}), "not zero"),
    "joint": (lambda r: JointCouplingTask({"elbow_": 1.0}).bind(r), "elbow_"),
    "short limb": (lambda r: ManipulabilityTask("panda_link2").bind(r), "joints"),
    "crossed": (
        lambda r: wbc.FramePositionLimit("panda_hand", lower=(1, 1, 1), upper=(0, 2, 2)),
        "not above",
    ),
    "shape": (lambda r: wbc.FramePositionLimit("panda_hand", lower=(1.0,)), r"shape \(3,\)"),
    "directions": (lambda r: wbc.FramePositionLimit("panda_hand", directions=[(0, 0, 0)]), "directions"),
    "speed": (lambda r: wbc.FrameSpeedLimit("panda_hand", linear=-1.0), "linear"),
    "angle": (lambda r: wbc.AxisConeLimit("panda_hand", 4.0), "π"),
    "axis": (lambda r: wbc.AxisConeLimit("panda_hand", 0.1, axis=(0, 0, 0)), "axis"),
    "limited frame": (lambda r: wbc.AxisConeLimit("panda_hant", 0.1).bind(r), "panda_hant"),
    "moved": (lambda r: [arm(t := LowAccelerationTask()), t.move_to(1.0)], "no target"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_refused_by_name(case: str) -> None:
    act, named = REFUSED[case]
    with pytest.raises((InputError, UnknownNameError), match=named):
        act(wbc.load_robot("panda").robot())


@pytest.mark.parametrize(
    "make",
    [
        lambda: DistanceTask("panda_hand", "panda_link2"),
        lambda: ManipulabilityTask("panda_hand"),
    ],
)
def test_a_distance_and_a_manipulability_are_not_negative_wherever_they_are_given(
    make: Callable[[], wbc.Task],
) -> None:
    ik = wbc.InverseKinematics(wbc.load_robot("panda").robot(), dt=0.01)
    task = ik.add(make())
    before = task.target.copy()
    for give in (lambda: setattr(task, "target", -1.0), lambda: task.move_to(-1.0)):
        with pytest.raises(InputError, match="of at least 0"):
            give()
    np.testing.assert_array_equal(task.target, before)


def test_a_manipulability_is_not_reached_while_its_target_is_on_its_way() -> None:
    ik = wbc.InverseKinematics(wbc.load_robot("panda").robot(), dt=0.01)
    task = ik.add(ManipulabilityTask("panda_hand"))
    assert task.reached
    task.move_to(0.8 * task.target, duration=0.2)
    steps = 0
    while not task.reached and steps < 100:
        ik.step()
        steps += 1
    assert 20 <= steps < 100
