"""Bad input to tasks: refused at once, with what was wrong and what would have been accepted."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from task_factory import MOTION_TASKS, make_robot

from wbc.core.errors import Array, InputError, UnknownNameError
from wbc.core.limits.com_polygon import CoMPolygonLimit
from wbc.core.limits.rows import JointLimits, RowLimit, TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.task import MotionTask, Task, VariableTask
from wbc.core.robot import Robot
from wbc.tasks import (
    AdmittanceTask,
    CoMTask,
    ImpedanceTask,
    JointTorqueTask,
    MomentumTask,
    OrientationTask,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativeFrameTask,
    WrenchTask,
)

NAN = float("nan")
SKEWED = pin.SE3(np.eye(3), np.zeros(3))
SKEWED.rotation = np.diag([1.0, 1.0, -1.0])

WRONG_VALUES: dict[str, Callable[[], object]] = {
    "com: shape": lambda: CoMTask([0.0, 0.0]),
    "com: bound of zero": lambda: CoMTask(error_bound=0.0),
    "com: bound that is no number": lambda: CoMTask(error_bound=NAN),
    "com: bound of wrong shape": lambda: CoMTask(error_bound=[0.1, 0.1]),
    "com: no axis": lambda: CoMTask(axes=()),
    "com: axis twice": lambda: CoMTask(axes=("x", "x")),
    "position: axes out of order": lambda: PositionTask("left_hand", axes=("z", "x")),
    "wrench: axes out of order": lambda: WrenchTask("left_foot", axes=("roll", "z")),
    "orientation: shape": lambda: OrientationTask("left_hand", np.zeros(3)),
    "orientation: not a rotation": lambda: OrientationTask("left_hand", 2.0 * np.eye(3)),
    "pose: mirrored": lambda: PoseTask("left_hand", SKEWED),
    "relative: the same frame": lambda: RelativeFrameTask("left_hand", "left_hand"),
    "torque: joint twice": lambda: JointTorqueTask(joints=["a", "a"]),
    "torque: negative weight": lambda: JointTorqueTask(weight=-1e-3),
    "posture: no joint": lambda: PostureTask(joints=[]),
    "posture: negative joint weight": lambda: PostureTask(joint_weights={"a": -1.0}),
    "wrench: shape": lambda: WrenchTask("left_foot", np.zeros(3)),
    "admittance: negative": lambda: AdmittanceTask("left_hand", admittance=(-1e-3, 0.0)),
    "admittance: shape": lambda: AdmittanceTask("left_hand", admittance=(1e-3, 1e-3, 1e-3)),
    "admittance: negative time constant": lambda: AdmittanceTask(
        "left_hand", admittance=(1e-3, 0.0), time_constant=-1.0
    ),
    "admittance: target wrench": lambda: AdmittanceTask(
        "left_hand", admittance=(1e-3, 0.0), target_wrench=[0.0, 1.0]
    ),
    "admittance: offset bound": lambda: AdmittanceTask("left_hand", admittance=(0, 0), offset_bound=-1.0),
    "impedance: no mass and no damper": lambda: ImpedanceTask("left_hand", mass=(0.0, 1.0)),
    "impedance: neither spring nor damper": lambda: ImpedanceTask("left_hand", spring=(0.0, 0.0)),
    "impedance: no damper": lambda: ImpedanceTask("left_hand", damper=(0.0, 1.0)),
}


@pytest.mark.parametrize("what", WRONG_VALUES)
def test_wrong_value_is_refused_when_the_task_is_made(what: str) -> None:
    with pytest.raises(InputError):
        WRONG_VALUES[what]()


UNKNOWN_NAMES: dict[str, tuple[Callable[[], Task], str]] = {
    "frame": (lambda: PoseTask("left_hant"), "no frame 'left_hant'; did you mean 'left_hand'"),
    "reference frame": (
        lambda: RelativeFrameTask("left_hand", "chets"),
        "no frame 'chets'; did you mean 'chest'",
    ),
    "joint": (lambda: PostureTask(joints=["left_nee"]), "no joint 'left_nee'; did you mean 'left_knee"),
    "joint of a target": (
        lambda: PostureTask({"left_nee": 0.1}),
        "no joint 'left_nee'; did you mean 'left_knee",
    ),
    "joint weight": (lambda: PostureTask(joint_weights={"left_nee": 1.0}), "no joint 'left_nee'"),
    "joint selection": (lambda: PositionTask("left_hand", joints=["left_nee"]), "no joint 'left_nee'"),
    "torque of a joint": (lambda: JointTorqueTask(joints=["left_nee"]), "no joint 'left_nee'"),
}


@pytest.mark.parametrize("what", UNKNOWN_NAMES)
def test_unknown_name_is_refused_with_the_nearest_ones(what: str) -> None:
    make, message = UNKNOWN_NAMES[what]
    controller = Controller(make_robot("hrp4_class"), 0.002)
    with pytest.raises(UnknownNameError, match=message):
        controller.add(make())
    assert controller.tasks == ()


UNKNOWN_OPTIONS: dict[str, tuple[Callable[..., Task], str]] = {
    "gain": (lambda: CoMTask(wieght=1.0), "no parameter of CoMTask 'wieght'; did you mean 'weight'"),
    "stiffness of a torque": (
        lambda: JointTorqueTask(stiffness=1.0),
        "no parameter of JointTorqueTask 'stiffness'",
    ),
}


@pytest.mark.parametrize("what", UNKNOWN_OPTIONS)
def test_unknown_option_is_refused_with_the_nearest_ones(what: str) -> None:
    make, message = UNKNOWN_OPTIONS[what]
    with pytest.raises(UnknownNameError, match=message):
        make()


def test_an_option_replaces_the_default_of_its_task() -> None:
    task = ImpedanceTask("left_foot", weight=2.0, name="ankles", axes=("z", "roll"), hard=True)
    assert (task.name, task.dim, task.hard) == ("ankles", 2, True)
    assert (task.weight == 2.0).all() and (task.stiffness == 100.0).all() and (task.damping == 20.0).all()
    assert PoseTask("left_hand", name=None).name == "left_hand pose"
    assert CoMTask(stiffness=4.0).damping[0] == 4.0 and CoMTask(damping=3.0).damping[0] == 3.0


def test_defaults_are_those_that_the_docstring_gives() -> None:
    robot, said = make_robot("hrp4_class"), set()
    for case in MOTION_TASKS.values():
        task = case.make(robot)
        doc = " ".join(" ".join((kind.__doc__ or "").split()) for kind in type(task).__mro__)
        numbers = re.search(r"[Ww]eight (\S+)(?: and| by default.*? and|,) stiffness (\S+) 1/s", doc)
        assert numbers is not None
        assert (task.weight == float(numbers[1].replace("10⁻³", "1e-3"))).all()
        assert (task.stiffness == float(numbers[2])).all()
        said.add(numbers[0])
    assert len(said) == 4


def test_only_right_handed_orthonormal_matrices_are_rotations() -> None:
    """To 1e-6, whichever row it is."""
    rng, task = np.random.default_rng(0), OrientationTask("left_hand")
    for _ in range(40):
        turn = pin.exp3(rng.normal(size=3))
        task.target = turn
        stretched, sheared = (np.eye(3) for _ in range(2))
        row, other = rng.permutation(3)[:2]
        stretched[row, row] += rng.choice((-1e-4, 1e-4))
        sheared[row, other] = rng.choice((-1e-4, 1e-4))
        for wrong in (-turn, turn[::-1], stretched @ turn, sheared @ turn):
            with pytest.raises(InputError, match="must be a rotation matrix"):
                task.target = wrong


def test_unknown_axis_is_refused_with_the_choices() -> None:
    with pytest.raises(UnknownNameError, match="choices: x, y, z"):
        CoMTask(axes=("w",))
    with pytest.raises(UnknownNameError, match="roll"):
        PoseTask("left_hand", axes=("rol",))


@pytest.mark.parametrize("case", MOTION_TASKS)
def test_bad_assignment_leaves_the_task_as_it_was(case: str) -> None:
    robot = make_robot("hrp4_class")
    task = MOTION_TASKS[case].make(robot)
    task.bind(robot)
    for attribute, value in (
        ("weight", -1.0),
        ("weight", NAN),
        ("weight", np.ones(task.dim + 1)),
        ("stiffness", -3.0),
        ("damping", NAN),
        ("feedforward_velocity", np.zeros(task.dim + 1)),
        ("feedforward_acceleration", np.full(task.dim, NAN)),
        ("target", "there"),
        ("target", np.full(3, NAN)),
    ):
        before = getattr(task, attribute)
        before = before.copy()
        with pytest.raises(InputError):
            setattr(task, attribute, value)
        after = getattr(task, attribute)
        if isinstance(before, pin.SE3):
            assert before == after
        else:
            np.testing.assert_array_equal(before, after)


def test_momentum_has_nothing_to_damp() -> None:
    with pytest.raises(InputError, match="rate"):
        MomentumTask().damping = 1.0
    for damping in (1.0, None):
        with pytest.raises(InputError, match="rate"):
            MomentumTask(damping=damping)


def test_posture_refuses_joints_that_are_not_its_own() -> None:
    robot = make_robot("hrp4_class")
    task = PostureTask(joints=list(robot.joint_names[:3]))
    task.bind(robot)
    with pytest.raises(InputError, match="is not part of task"):
        task.target = {robot.joint_names[5]: 0.0}


def test_a_posture_that_was_refused_can_be_mended_and_is_refused_as_long_as_it_is_not() -> None:
    robot = make_robot("hrp4_class")
    controller, joint = Controller(robot, 0.005), robot.joint_names[0]
    posture = PostureTask({"tail": 1.0})
    with pytest.raises(UnknownNameError, match="no joint 'tail'"):
        controller.add(posture)
    posture.target = {joint: 0.1}
    controller.add(posture)
    assert posture.target[0] == 0.1
    weighted = PostureTask(name="weighted", joint_weights={joint: 5.0, "tail": 1.0})
    for _ in range(2):
        with pytest.raises(UnknownNameError, match="no joint 'tail'"):
            controller.add(weighted)


def test_a_single_joint_counts_as_a_list_of_one() -> None:
    robot = make_robot("hrp4_class")
    joint = robot.joint_names[3]
    for task in (PostureTask({joint: 0.5}, joints=joint), JointTorqueTask({joint: 0.5}, joints=joint)):
        task.bind(robot)
        assert task.dim == 1 and task.target.tolist() == [0.5]


def test_names_are_unique_and_items_are_added_once() -> None:
    controller = Controller(make_robot("hrp4_class"), 0.002)
    task = controller.add(CoMTask())
    with pytest.raises(InputError, match="taken"):
        controller.add(CoMTask())
    with pytest.raises(InputError, match="already"):
        controller.add(task)
    with pytest.raises(InputError, match="already"):
        controller.add(twice := PositionTask("left_hand"), twice)
    with pytest.raises(UnknownNameError, match="did you mean 'com'"):
        controller.task("con")


def test_no_item_is_in_two_controllers() -> None:
    robot = make_robot("hrp4_class")
    first, second = Controller(robot, 0.002), Controller(robot, 0.002)
    items = first.add(CoMTask(), SoleContact("left_foot"), JointLimits(), TorqueLimits(), CoMPolygonLimit())
    for item in items:
        with pytest.raises(InputError, match="belongs to another controller"):
            second.add(item)
    first.remove(*items)
    second.add(*items)
    assert second.solve().ok and not first.tasks
    second.remove(items[0])
    with pytest.raises(InputError, match="bound to another robot"):
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
        with pytest.raises(InputError, match="belongs to no controller"):
            _ = hand.robot
    robot = controller.robot
    robot.update(np.concatenate([robot.q[:2], robot.q[2:3] + 0.3, robot.q[3:]]), robot.v)
    controller.add(hand)
    np.testing.assert_array_equal(hand.target, robot.placement("left_hand").translation)  # where it is now
    controller.solve()
    with pytest.raises(InputError, match="not part of this controller"):
        controller.remove(hand, SoleContact("left_foot"))
    assert controller.tasks == (com, hand) and hand.name in controller.solve().residuals
    controller.remove(hand, hand)
    assert controller.tasks == (com,) and list(controller.solve().residuals) == ["com"]


def test_a_task_is_hard_or_not_as_long_as_a_controller_has_it() -> None:
    controller = Controller(make_robot("hrp4_class"), 0.002)
    com = controller.add(CoMTask())
    with pytest.raises(InputError, match="remove it, assign hard, and add it again"):
        com.hard = True
    controller.remove(com)
    com.hard = True
    controller.add(com, SoleContact("left_foot"))
    assert com.hard and controller.solve().ok and "hard" in controller.status_table()


def test_task_before_its_controller_says_so() -> None:
    with pytest.raises(InputError, match="belongs to no controller"):
        _ = CoMTask().target


class Own(MotionTask):
    """A task of one's own that looks nothing up."""

    def bind(self, robot: Robot) -> None:
        pass  # without super().bind(robot)

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        jacobian[:] = self.robot.com_jacobian[:1]


class OwnRows(VariableTask):
    """Rows of one's own over all variables, without the bind of the library."""

    def bind(self, robot: Robot) -> None:
        pass

    def evaluate(self, matrix: Array, reference: Array) -> None:
        pass


class OwnLimit(RowLimit):
    """A limit of one's own that limits nothing."""

    def __init__(self, **attributes: object) -> None:
        vars(self).update(attributes)

    def bind(self, robot: Robot) -> None:
        pass

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        pass


def test_what_a_task_or_limit_of_ones_own_lacks_is_said() -> None:
    for dim in (0, 1.5, "one", None, True):
        with pytest.raises(
            InputError, match="number of rows of task 'own' must be an integer of at least 1, got"
        ):
            Own("own", dim)  # type: ignore[arg-type]
    controller = Controller(make_robot("hrp4_class"), 0.002)
    for attributes in (
        {},
        {"name": "own"},
        {"dim": 1},
        {"name": "own", "dim": -1},
        {"name": "own", "dim": 1.5},
    ):
        with pytest.raises(
            InputError, match="limit OwnLimit needs a name, text, and dim, its number of rows"
        ):
            controller.add(OwnLimit(**attributes))
    with pytest.raises(InputError, match=r"super\(\).bind"):
        controller.add(Own("own", 1))
    with pytest.raises(
        InputError, match=r"OwnRows\('own rows', dim=1\) has not been bound: .*super\(\).bind"
    ):
        controller.add(OwnRows("own rows", 1))


@pytest.mark.parametrize("kind", MOTION_TASKS)
def test_what_a_task_hands_out_cannot_be_written_past_its_check(kind: str) -> None:
    robot = make_robot("hrp4_class")
    task = Controller(robot, 0.002).add(MOTION_TASKS[kind].make(robot))
    for name in dir(type(task)):
        part = getattr(type(task), name)
        value = getattr(task, name) if isinstance(part, property) and part.fset is not None else None
        if isinstance(value, pin.SE3):
            value.translation[0] = NAN
            assert np.isfinite(getattr(task, name).translation).all(), name
        elif isinstance(value, np.ndarray) and value.flags.writeable and value.size:
            value[:] = NAN
            assert np.isfinite(getattr(task, name)).all(), name
