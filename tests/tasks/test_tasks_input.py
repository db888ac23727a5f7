"""Bad input to tasks: refused at once, with what was wrong and what would have been accepted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from task_factory import make_robot

from wbc.base.errors import InputError, UnknownNameError
from wbc.base.numbers import Array
from wbc.core.limits.com_polygon import CoMPolygonLimit
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.qp.contact import Contact, SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.task import Task
from wbc.tasks import (
    AdmittanceTask,
    CoMTask,
    ImpedanceTask,
    JointTorqueTask,
    LowAccelerationTask,
    OrientationTask,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativeFrameTask,
    WrenchTask,
)

SKEWED = pin.SE3(np.eye(3), np.zeros(3))
SKEWED.rotation = np.diag([1.0, 1.0, -1.0])


class Driftless(Task):
    """A task without a drift."""

    def measure(self, jacobian: Array, error: Array) -> None:
        jacobian[:], error[:] = 1.0, 0.0


class Rowless(Contact):
    """A contact without rows."""

    dim = 3


WRONG_VALUES: dict[str, Callable[[], object]] = {
    "task: no drift": lambda: Driftless("driftless", 1),
    "contact: no rows": lambda: Rowless("rowless", "left_hand", np.zeros((0, 3))),
    "com: shape": lambda: CoMTask([0.0, 0.0]),
    "com: bound of zero": lambda: CoMTask(error_bound=0.0),
    "com: axis twice": lambda: CoMTask(axes=("x", "x")),
    "position: axes out of order": lambda: PositionTask("left_hand", axes=("z", "x")),
    "orientation: not a rotation": lambda: OrientationTask("left_hand", 2.0 * np.eye(3)),
    "pose: mirrored": lambda: PoseTask("left_hand", SKEWED),
    "relative: the same frame": lambda: RelativeFrameTask("left_hand", "left_hand"),
    "torque: negative weight": lambda: JointTorqueTask(weight=-1e-3),
    "torque: not finite": lambda: JointTorqueTask(np.full(3, np.nan)),
    "posture: text for a joint": lambda: PostureTask({"any": "low"}),  # type: ignore[dict-item]
    "posture: negative joint weight": lambda: PostureTask(joint_weights={"a": -1.0}),
    "admittance: negative": lambda: AdmittanceTask("left_hand", admittance=(-1e-3, 0.0)),
    "impedance: no mass and no damper": lambda: ImpedanceTask("left_hand", mass=(0.0, 1.0)),
    "impedance: no damper": lambda: ImpedanceTask("left_hand", damper=(0.0, 1.0)),
}


@pytest.mark.parametrize("what", WRONG_VALUES)
def test_wrong_value_is_refused_when_the_task_is_made(what: str) -> None:
    with pytest.raises(InputError):
        WRONG_VALUES[what]()


UNKNOWN: dict[str, Callable[[], Task]] = {
    "left_hant": lambda: PoseTask("left_hant"),
    "chets": lambda: RelativeFrameTask("left_hand", "chets"),
    "left_nee": lambda: PostureTask(joints=["left_nee"]),
    "left_nee of a target": lambda: PostureTask({"left_nee": 0.1}),
    "wieght": lambda: CoMTask(wieght=1.0),  # type: ignore[call-arg]
    "rol": lambda: PoseTask("left_hand", axes=("rol",)),
    "joints of rows on single joints": lambda: LowAccelerationTask(joints=["base"]),
    "joints of a wrench": lambda: WrenchTask(SoleContact("left_foot"), joints=["base"]),  # type: ignore[call-arg]
}


@pytest.mark.parametrize("kind", [PostureTask, JointTorqueTask])
def test_targets_of_joints_are_copied_before_a_controller_has_the_task(
    kind: type[PostureTask | JointTorqueTask],
) -> None:
    robot = make_robot("hrp4_class")
    array, named = np.array(robot.half_sitting[7:]), {robot.joint_names[0]: 0.1}
    task = kind(array)
    task.target = named
    array[:], named[robot.joint_names[0]] = 0.3, 0.3
    target = Controller(robot, 0.002).add(task).target
    np.testing.assert_array_equal(target, [0.1, *robot.half_sitting[8:]])


@pytest.mark.parametrize("what", UNKNOWN)
def test_an_unknown_name_is_refused(what: str) -> None:
    controller = Controller(make_robot("hrp4_class"), 0.002)
    with pytest.raises(UnknownNameError, match=what.split(maxsplit=1)[0]):
        controller.add(UNKNOWN[what]())
    assert controller.tasks == ()


def test_no_item_is_in_two_controllers() -> None:
    robot = make_robot("hrp4_class")
    first, second = Controller(robot, 0.002), Controller(robot, 0.002)
    items = first.add(CoMTask(), SoleContact("left_foot"), JointLimits(), TorqueLimits(), CoMPolygonLimit())
    for item in items:
        with pytest.raises(InputError, match="controller"):
            second.add(item)
    first.remove(*items)
    second.add(*items)
    assert second.solve().ok and not first.tasks
    second.remove(items[0])
    with pytest.raises(InputError, match="bound"):
        Controller(make_robot("hrp4_class"), 0.002).add(items[0])


def test_several_items_are_added_or_removed_together_or_not_at_all() -> None:
    controller = Controller(make_robot("hrp4_class"), 0.002)
    com, hand = CoMTask(), PositionTask("left_hand")
    controller.add(com)
    controller.solve()
    with pytest.raises(UnknownNameError, match="left_hant"):
        controller.add(hand, PositionTask("left_hant"))
    assert controller.tasks == (com,) and list(controller.solve().residuals) == ["com"]
    for refused, message in ((hand, "added already"), (CoMTask, "tasks, contacts and limits, not <class")):
        with pytest.raises(InputError, match=message):
            controller.add(hand, refused)
    robot = controller.robot
    robot.update(np.concatenate([robot.q[:2], robot.q[2:3] + 0.3, robot.q[3:]]), robot.v)
    controller.add(hand)
    np.testing.assert_array_equal(hand.target, robot.placement("left_hand").translation)  # where it is now
    controller.solve()
    with pytest.raises(InputError, match="controller"):
        controller.remove(hand, SoleContact("left_foot"))
    assert controller.tasks == (com, hand) and hand.name in controller.solve().residuals
    controller.remove(hand, hand)
    assert controller.tasks == (com,) and list(controller.solve().residuals) == ["com"]


def test_a_task_is_hard_or_not_as_long_as_a_controller_has_it() -> None:
    controller = Controller(make_robot("hrp4_class"), 0.002)
    com = controller.add(CoMTask())
    with pytest.raises(InputError, match="remove"):
        com.hard = True
    controller.remove(com)
    com.hard = True
    controller.add(com, SoleContact("left_foot"))
    assert com.hard and controller.solve().ok and "hard" in controller.status_table()


@pytest.mark.parametrize("degrees", [-45.0, 90.0, [30.0]])
def test_a_posture_in_degrees_is_refused_and_nothing_moves(degrees: float | list[float]) -> None:
    controller = Controller(make_robot("g1"), 0.005)
    joint = "left_elbow_joint"
    task = controller.add(PostureTask(joints=[joint]))
    before = np.array(task.target)
    target = degrees if isinstance(degrees, list) else {joint: degrees}
    for order in (task.move_to, lambda t: setattr(task, "target", t), lambda t: task.move_through([t])):
        with pytest.raises(InputError, match=f"'{joint}' .*rad.* must lie in its range"):
            order(target)
    assert not task.moving
    np.testing.assert_array_equal(task.target, before)
    with pytest.raises(InputError, match=joint):
        controller.robot.configuration({joint: 45.0})
    task.target = controller.robot.position_upper[[controller.robot.joint_index(joint)]]


@pytest.mark.parametrize("kind", [PostureTask, JointTorqueTask])
def test_targets_of_joints_add_up_before_a_controller_has_the_task_as_after(
    kind: type[PostureTask | JointTorqueTask],
) -> None:
    robot = make_robot("hrp4_class")
    one, two, three = robot.joint_names[:3]
    for start, assigned in (
        ({one: 0.1}, [{two: 0.2}, {three: 0.3}]),
        (None, [{one: 0.5}, {two: 0.2}, {one: 0.1}, {three: 0.3}]),
        ({one: 0.5}, [np.array(robot.half_sitting[7:]), {one: 0.1, two: 0.2, three: 0.3}]),
    ):
        targets = []
        for first in (True, False):
            controller, task = Controller(make_robot("hrp4_class"), 0.002), kind(start)
            if first:
                controller.add(task)
            for target in assigned:
                task.target = target
            if not first:
                controller.add(task)
            targets.append(np.array(task.target))
        np.testing.assert_array_equal(*targets)
        np.testing.assert_array_equal(targets[0][:3], [0.1, 0.2, 0.3])
    task = kind()
    task.target = {"tail": 1.0}
    with pytest.raises(UnknownNameError):
        controller.add(task)
    task.target = {one: 0.1}  # in its place
    assert Controller(robot, 0.002).add(task).target[0] == 0.1
