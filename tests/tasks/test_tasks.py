"""Every task against finite differences, against its own target, and inside the controller."""

from __future__ import annotations

import copy

import numpy as np
import pinocchio as pin
import pytest
from properties import by_default
from task_factory import (
    MOTION_TASKS,
    ROBOTS,
    arm,
    left_hand,
    make_robot,
    near_half_sitting,
    random_state,
    rows_of,
    standing,
)

import wbc
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.kinematics.inverse import InverseKinematics
from wbc.core.limits.base import Limit
from wbc.core.qp.controller import Controller
from wbc.core.qp.task import Task
from wbc.core.robot import GRAVITY, Robot
from wbc.tasks import (
    AdmittanceTask,
    CoMTask,
    LowAccelerationTask,
    MomentumTask,
    PoseTask,
    PositionTask,
    PostureTask,
    check_rows,
)
from wbc.tasks.balance import BalanceGains, balance_controller

cases = pytest.mark.parametrize("case", MOTION_TASKS)
robots = pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))


@robots
@cases
def test_rows_are_what_finite_differences_say(name: str, case: str) -> None:
    robot, known = make_robot(name), MOTION_TASKS[case]
    q, v = np.array(robot.q), np.array(robot.v)
    task = known.make(robot)
    frame = left_hand(robot) if known.in_frame else None
    check_rows(task, robot, frame=frame, partial=known.selects)
    np.testing.assert_array_equal(np.concatenate([robot.q, robot.v]), np.concatenate([q, v]))
    Controller(robot, 0.002).add(task)  # it has not been bound


class Wrong(PositionTask):
    """A position with one mistake."""

    def __init__(self, mistake: str, frame: str) -> None:
        super().__init__(frame)
        self.mistake = mistake

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        if self.mistake == "rebinds":
            jacobian = np.zeros_like(jacobian)
        elif self.mistake == "shape":
            error[:] = np.zeros(2)
        super().evaluate(jacobian, error, drift)
        if self.mistake == "sign":
            error *= -1.0
        elif self.mistake == "column":
            jacobian[1, 4] = 0.0
        elif self.mistake == "no drift":
            drift[:] = 0.0
        elif self.mistake == "nan":
            drift[2] = np.nan


@pytest.mark.parametrize(
    ("mistake", "words"),
    [
        ("rebinds", r"Jacobian is zero; evaluate writes into the array"),
        ("shape", r"cannot be evaluated: ValueError"),
        ("nan", r"drift of task 'left_hand position' must be finite"),
        ("sign", r"Jacobian by x of the base is 0.79.* in row 0, finite differences give -0.79"),
        ("column", r"Jacobian by pitch of the base is 0 in row 1"),
        ("no drift", r"drift is 0 in row"),
    ],
)
def test_mistakes_in_a_task_are_named(mistake: str, words: str) -> None:
    robot = make_robot("hrp4_class")
    with pytest.raises(InputError, match=words):
        check_rows(Wrong(mistake, left_hand(robot)), robot)
    controller = standing("hrp4_class")
    if mistake in ("rebinds", "shape", "nan"):
        with pytest.raises(InputError, match=words):
            controller.add(Wrong(mistake, left_hand(robot)))
        assert controller.solve().ok, "as if it had not been tried"


class Rows(Limit):
    """A limit of given bounds, whose first row has no joint."""

    def __init__(self, lower: float, upper: float, number: float = 1.0) -> None:
        self.name, self.dim = "rows", 2
        self.bounds, self.number = (lower, upper), number

    def bind(self, robot: Robot) -> None:
        pass

    def write(self, dt: float, jacobian: Array, lower: Array, upper: Array) -> None:
        jacobian[:] = 0.0
        jacobian[1, 2] = self.number
        lower[:], upper[:] = self.bounds


@pytest.mark.parametrize(
    ("limit", "refused"),
    [
        (Rows(-1.0, 1.0), None),
        (Rows(-np.inf, 0.0), None),
        (Rows(0.0, np.inf), None),
        (Rows(0.1, 1.0), "row of zeros"),
        (Rows(-1.0, -0.1), "row of zeros"),
        (Rows(1.0, -1.0), "lower bound above"),
        (Rows(np.nan, 1.0), "bound that is NaN"),
        (Rows(-1.0, np.nan), "bound that is NaN"),
        (Rows(-1.0, 1.0, np.nan), "not finite"),
    ],
)
def test_a_limit_must_leave_a_robot_that_it_does_not_move_where_it_is(
    limit: Rows, refused: str | None
) -> None:
    robot = make_robot("hrp4_class")
    if refused is None:
        check_rows(limit, robot)
    else:
        with pytest.raises(InputError, match=refused):
            check_rows(limit, robot)


def test_limits_of_the_package_pass_the_check_of_ones_own() -> None:
    """Also a cone whose axis comes near the opposite direction, and a box about a hand that is far from it."""
    robot = make_robot("hrp4_class")
    for limit in (wbc.JointLimits(), wbc.TorqueLimits(), wbc.TorqueLimits(ratio=0.5, rate=1e3)):
        check_rows(limit, robot)
    g1 = make_robot("g1")
    check_rows(wbc.AxisConeLimit(left_hand(g1), 0.3), g1)
    check_rows(wbc.FramePositionLimit(robot.base_frame, upper=(0.0, 0.0, -5.0)), robot)


def test_a_limit_of_a_controller_keeps_its_robot() -> None:
    robot, limit = make_robot("hrp4_class"), wbc.JointLimits()
    check_rows(limit, robot)
    controller = wbc.Controller(robot, 0.005)
    controller.add(limit)
    with pytest.raises(InputError, match="before it is added"):
        check_rows(limit, robot)
    assert limit._robot is robot


class Height(wbc.Barrier):
    """Keep a hand between two heights, with one mistake at most."""

    def __init__(self, frame: str, mistake: str) -> None:
        super().__init__("height", 1)
        self.frame, self.mistake = frame, mistake

    def bind(self, robot: Robot) -> None:
        if self.mistake != "no robot":
            super().bind(robot)
        self.id = robot.frame_id(self.frame)

    def measure(self, rows: Array, below: Array, above: Array) -> None:
        robot, world = self.robot, pin.LOCAL_WORLD_ALIGNED
        rows[:] = pin.getFrameJacobian(robot.model, robot.data, self.id, world)[2]
        height = robot.placement(self.id).translation[2]
        below[:], above[:] = height + 5.0, 5.0 - height
        if self.mistake == "one sign":
            rows *= -1.0
        elif self.mistake == "both signs":
            below[:], above[:] = above.copy(), below.copy()
        elif self.mistake == "crossed":
            above[:] = -height - 5.2
        elif self.mistake == "axes":
            rows[:] = pin.getFrameJacobian(robot.model, robot.data, self.id, pin.LOCAL)[2]

    def drift(self) -> Array | None:
        robot, world = self.robot, pin.LOCAL_WORLD_ALIGNED
        drift = pin.getFrameClassicalAcceleration(robot.model, robot.data, self.id, world).linear
        return {"no drift": None, "shape": drift}.get(self.mistake, drift[2:])


@pytest.mark.parametrize(
    ("mistake", "refused"),
    [
        ("", None),
        ("one sign", "lower bound is .* in row 0, finite differences give"),
        ("both signs", "lower bound is"),
        ("axes", "lower bound is"),
        ("crossed", "lower bound above the upper one: row 0, by 0.2"),
        ("no drift", "drift is 0 in row 0"),
        ("shape", r"drift .* must have shape \(1,\), got \(3,\)"),
        ("no robot", r"super\(\)\.bind"),
    ],
)
def test_the_rows_of_a_barrier_are_compared_with_its_distances(mistake: str, refused: str | None) -> None:
    robot = make_robot("hrp4_class")
    limit = Height(left_hand(robot), mistake)
    if refused is None:
        check_rows(limit, robot)
    else:
        with pytest.raises(InputError, match=refused):
            check_rows(limit, robot)
    if mistake == "no robot":
        with pytest.raises(InputError, match=refused):
            Controller(robot, 0.005).add(limit)


@robots
def test_columns_left_out_are_those_of_other_joints_only(name: str) -> None:
    robot, rng = make_robot(name), np.random.default_rng(2)
    robot.update(*random_state(robot, rng))
    joints = arm(robot)
    for allowed in (joints, ["base", *joints]):
        every, some = PoseTask(left_hand(robot)), PoseTask(left_hand(robot), joints=allowed, name="some")
        columns = np.array([6 + robot.joint_index(joint) for joint in joints])
        if "base" in allowed:
            columns = np.concatenate([np.arange(6), columns])
        for task in (every, some):
            task.bind(robot)
        full, limited = rows_of(every, robot)[0], rows_of(some, robot)[0]
        expected = np.zeros_like(full)
        expected[:, columns] = full[:, columns]
        np.testing.assert_array_equal(limited, expected)


@robots
def test_the_velocity_of_joints_left_out_is_damped_as_well(name: str) -> None:
    robot, rng = make_robot(name), np.random.default_rng(4)
    robot.update(*random_state(robot, rng))
    every, some = PoseTask(left_hand(robot)), PoseTask(left_hand(robot), joints=arm(robot), name="some")
    at_rest = []
    for task in (every, some):
        task.bind(robot)
        jacobian, _, drift = rows_of(task, robot)
        at_rest.append(-task.damping * (jacobian @ robot.v) - drift)
    np.testing.assert_allclose(at_rest[1], at_rest[0], atol=1e-10)


@robots
@cases
def test_robot_at_rest_at_its_targets_is_asked_to_stay(name: str, case: str) -> None:
    controller = standing(name)
    task = MOTION_TASKS[case].make(controller.robot)
    controller.add(task)
    solution = controller.solve()
    assert solution.ok
    np.testing.assert_allclose(task.error, 0.0, atol=1e-12)
    np.testing.assert_allclose(solution.accelerations, 0.0, atol=1e-5)


@robots
@pytest.mark.parametrize("case", [case for case in MOTION_TASKS if MOTION_TASKS[case].feasible])
def test_hard_task_is_met_exactly(name: str, case: str) -> None:
    rng = np.random.default_rng(4)
    controller = standing(name, posture=case != "momentum")
    task = MOTION_TASKS[case].make(controller.robot)
    task.hard = True
    controller.add(task)
    wanted = 0.2 * rng.normal(size=task.dim) * (controller.robot.mass if "momentum" in case else 1.0)
    task.feedforward_acceleration = wanted
    controller.robot.update(*near_half_sitting(controller.robot, rng, 0.02, 0.02))
    solution = controller.solve()
    assert solution.ok, controller.diagnose()
    jacobian, error, drift = rows_of(task, controller.robot)
    reference = wanted + task.stiffness * error - task.damping * (jacobian @ controller.robot.v) - drift
    scale = max(1.0, float(np.abs(reference).max()))
    np.testing.assert_allclose(jacobian @ solution.accelerations, reference, atol=1e-5 * scale)
    np.testing.assert_allclose(solution.residuals[task.name], 0.0, atol=1e-5 * scale)


@cases
def test_stiffness_makes_critical_damping_unless_told_otherwise(case: str) -> None:
    robot = make_robot("hrp4_class")
    task = MOTION_TASKS[case].make(robot)
    if task.of_velocity:  # its error decays with the stiffness alone
        for made in (task, MomentumTask(damping=None), LowAccelerationTask(stiffness=9.0, damping=None)):
            made.damping = None
            made.stiffness = 49.0
            np.testing.assert_array_equal(made.damping, 0.0)
        return
    task.damping = None
    task.stiffness = 49.0
    np.testing.assert_allclose(task.damping, 14.0)
    task.damping = 3.0
    task.stiffness = 100.0
    np.testing.assert_allclose(task.damping, 3.0)
    task.damping = None
    np.testing.assert_allclose(task.damping, 20.0)


@pytest.mark.parametrize("unit", ["m", "rad", "m|rad", "kg", "N|Nm"])
@pytest.mark.parametrize("rows", [6, ("u", "v")])
def test_a_task_of_any_unit_is_reached_near_its_target(unit: str, rows: int | tuple[str, ...]) -> None:
    class Own(Task):
        def __init__(self) -> None:
            super().__init__("own", rows)
            self.error_now = 0.0

        def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
            jacobian[:, : self.dim] = np.eye(self.dim)
            error[:], drift[:] = self.error_now, 0.0

    Own.unit = unit
    task = standing("hrp4_class").add(Own())
    assert task.reached
    task.error_now = 1.0
    assert not task.reached


@pytest.mark.parametrize("case", ["position", "orientation", "pose", "relative", "impedance", "admittance"])
def test_gains_feed_forward_and_drift_make_the_reference(case: str) -> None:
    """In free flight a heavy task gets its reference, which is put together here from its parts."""
    robot, rng = make_robot("talos"), np.random.default_rng(5)
    robot.update(*random_state(robot, rng, 0.3))
    controller = Controller(robot, 0.002)
    task = MOTION_TASKS[case].make(robot)
    controller.add(task)
    task.weight = 1e6
    task.damping, task.error_bound = 3.0, np.inf
    task.feedforward_velocity = rng.normal(size=task.dim)
    task.feedforward_acceleration = rng.normal(size=task.dim)
    robot.update(*random_state(robot, rng, 0.3))
    solution = controller.solve()
    jacobian, error, drift = rows_of(task, robot)
    wanted = task.feedforward_acceleration + task.stiffness * error
    wanted += task.damping * (task.feedforward_velocity - jacobian @ robot.v)
    np.testing.assert_allclose(jacobian @ solution.accelerations + drift, wanted, rtol=1e-4, atol=1e-4)


def test_momentum_cannot_be_changed_in_flight() -> None:
    robot, rng = make_robot("talos"), np.random.default_rng(6)
    controller = Controller(robot, 0.002)
    task = controller.add(MomentumTask(rng.normal(size=6), axes=("roll", "pitch", "yaw"), weight=1e3))
    task.feedforward_acceleration = rng.normal(size=3)
    robot.update(*random_state(robot, rng, 0.3))
    wanted = task.feedforward_acceleration + task.stiffness * (task.target - robot.data.hg.vector)[3:]
    np.testing.assert_allclose(controller.solve().residuals["momentum"], -wanted, atol=1e-4)


def test_mask_takes_rows_in_frame_axes() -> None:
    robot, rng = make_robot("g1"), np.random.default_rng(7)
    hand = left_hand(robot)
    full = AdmittanceTask(hand, admittance=(1e-3, 1e-1), name="full")
    some = AdmittanceTask(hand, admittance=(1e-3, 1e-1), axes=("x", "yaw"), name="some")
    robot.update(*random_state(robot, rng))
    for task in (full, some):
        task.bind(robot)
    robot.update(*random_state(robot, rng))
    (jacobian, error, drift), rows = rows_of(full, robot), rows_of(some, robot)
    np.testing.assert_array_equal(rows[0], jacobian[[0, 5]])
    np.testing.assert_array_equal(rows[2], drift[[0, 5]])
    assert rows[1][0] == error[0]  # that of the rotation is the twist alone
    some.measured_wrench = rng.normal(size=6)
    some.unobserved(0.001)
    np.testing.assert_array_equal(some.compliance_velocity[[1, 2, 3, 4]], 0.0)
    assert some.compliance_velocity[[0, 5]].all()


def test_weights_share_between_tasks_that_disagree() -> None:
    """In flight the hand can go anywhere: what it does is the mean of two wishes, weighted."""
    robot = make_robot("hrp4_class")
    controller = Controller(robot, 0.002, regularisation=1e-9)
    hand = left_hand(robot)
    here = np.array(robot.placement(hand).translation)
    one = controller.add(PositionTask(hand, here + [0.1, 0.0, 0.0], name="one", weight=3.0, stiffness=10.0))
    two = controller.add(PositionTask(hand, here - [0.0, 0.1, 0.0], name="two", weight=1.0, stiffness=10.0))
    solution = controller.solve()
    jacobian = rows_of(one, robot)[0]
    np.testing.assert_allclose(jacobian @ solution.accelerations, [0.75, -0.25, 0.0], atol=1e-5)
    np.testing.assert_allclose(3.0 * solution.residuals["one"], -solution.residuals["two"], atol=1e-5)
    two.weight = [0.0, 1.0, 1.0]
    np.testing.assert_allclose(jacobian @ controller.solve().accelerations, [1.0, -0.25, 0.0], atol=1e-5)


@robots
def test_posture_moves_the_selected_joints_alone(name: str) -> None:
    robot = make_robot(name)
    joints = arm(robot)[::-1]
    task = PostureTask({joints[1]: robot.q[7 + robot.joint_index(joints[1])] + 0.1}, joints=joints, hard=True)
    controller = Controller(robot, 0.002)
    controller.add(task)
    controller.solve()
    np.testing.assert_allclose(task.error, [0.0, 0.1, *([0.0] * (len(joints) - 2))], atol=1e-12)
    expected = task.stiffness * task.error
    chosen = [6 + robot.joint_index(joint) for joint in joints]
    np.testing.assert_allclose(controller.solve().accelerations[chosen], expected, atol=1e-6)


@pytest.mark.parametrize(("length", "close"), [(0.04, 0.004), (0.5, 0.005)])
def test_a_posture_is_reached_within_0_05_rad_or_5_mm_and_when_its_joints_are_slow(
    length: float, close: float
) -> None:
    """Of a finger that slides by 40 mm, within a tenth of that."""
    given = wbc.load_robot("panda").robot()
    model = given.model.copy()
    slides = given.slides
    for joint in np.flatnonzero(slides):
        model.upperPositionLimit[joint] = model.lowerPositionLimit[joint] + length
    robot = Robot(model, (), given.half_sitting)
    task = PostureTask()
    task.bind(robot)
    middle = 0.5 * (robot.position_lower + robot.position_upper)
    task.target = middle
    near, slow = np.where(slides, close, 0.05), np.where(slides, 0.02, 0.2)
    assert slides.any() and not slides.all()
    for joint in range(robot.na):
        for sign in (1.0, -1.0):
            for share, reached in ((0.99, True), (1.01, False)):
                unit = sign * share * np.eye(robot.na)[joint]
                robot.update(middle + near * unit, np.zeros(robot.na))
                assert task.reached is reached
                robot.update(middle, slow * unit)
                assert task.reached is reached


@pytest.mark.parametrize("chest", [True, False])
def test_the_balance_of_a_stand_has_the_tasks_that_it_says_and_carries_the_weight(chest: bool) -> None:
    given = make_robot("hrp4_class")
    torso = given.torso_frame if chest else None
    robot = Robot(given.model, given.soles, given.half_sitting, torso_frame=torso)
    gains = BalanceGains(com_weight=7.0, orientation_stiffness=50.0, posture_weight=0.3)
    controller = balance_controller(robot, 0.005, gains)
    names = ["com", "base", *["torso"] * chest, "posture"]
    assert [task.name for task in controller.tasks] == names
    np.testing.assert_array_equal(controller.task("com").weight, 7.0)
    np.testing.assert_array_equal(controller.task("posture").weight, 0.3)
    for name in names[1:-1]:
        np.testing.assert_array_equal(controller.task(name).stiffness, 50.0)
    solution = controller.solve()
    np.testing.assert_allclose(solution.accelerations, 0.0, atol=1e-2)
    carried = sum(solution.wrenches[sole.name][2] for sole in robot.soles)
    assert carried == pytest.approx(robot.mass * GRAVITY, rel=1e-3)


def test_states_in_which_rows_are_checked_are_well_inside_of_the_ranges() -> None:
    robot, seen = make_robot("hrp4_class"), list[Array]()

    class Seeing(PositionTask):
        def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
            seen.append(np.array(self.robot.q))
            super().evaluate(jacobian, error, drift)

    for seed in range(3):
        check_rows(Seeing(left_hand(robot)), robot, seed=seed)
    low, high = np.maximum(robot.position_lower, -np.pi), np.minimum(robot.position_upper, np.pi)
    shares = (np.array(seen)[:, 7:] - low) / (high - low)
    assert shares.min() > 0.2 - 1e-5 and shares.max() < 0.8 + 1e-5
    assert np.ptp(shares, axis=0).min() > 0.01 and shares.min() < 0.25 and shares.max() > 0.75


def test_drift_follows_the_gravity_of_the_model() -> None:
    description = make_robot("g1")
    model = description.model.copy()
    model.gravity = pin.Motion(np.array([0.3, -0.2, -1.62]), np.zeros(3))
    robot = Robot(model, description.soles, description.half_sitting)
    robot.update(robot.half_sitting, np.zeros(robot.nv))
    for task in (CoMTask(), MomentumTask()):
        task.bind(robot)
        np.testing.assert_allclose(rows_of(task, robot)[2], 0.0, atol=1e-9)


class Measured(Task):
    """A position whose rows come from `measure` and `drift`; the drift is counted."""

    def __init__(self, frame: str) -> None:
        super().__init__("measured", ("x", "y", "z"), stiffness=30.0, axes=("x", "z"))
        self.twin, self.asked = PositionTask(frame), 0

    def bind(self, robot: Robot) -> None:
        super().bind(robot)
        self.twin.bind(robot)

    def measure(self, jacobian: Array, error: Array) -> None:
        self.twin.measure(jacobian, error)

    def drift(self) -> Array:
        self.asked += 1
        return self.twin.drift()


def test_a_task_gives_its_rows_in_one_piece_or_in_two_and_its_drift_where_there_are_accelerations() -> None:
    robot = make_robot("hrp4_class")
    controller, hand = Controller(robot, 0.002), left_hand(robot)
    task, whole = controller.add(Measured(hand), PositionTask(hand, axes=("x", "z")))
    controller.update(*near_half_sitting(robot, np.random.default_rng(0)))
    for mine, rows in zip(task.evaluated(), whole.evaluated(), strict=True):
        np.testing.assert_array_equal(mine, rows)
    ik = InverseKinematics(make_robot("hrp4_class"), 0.01)
    task = ik.add(Measured(hand))
    task.asked = 0
    ik.solve()
    assert task.asked == 0


def test_coordinates_that_are_spared_go_on_as_expected_beside_joints_that_are_left_out() -> None:
    robot, rng = make_robot("hrp4_class"), np.random.default_rng(0)
    allowed = ["base", *arm(robot)]
    every, some = PositionTask(left_hand(robot)), PositionTask(left_hand(robot), joints=allowed, name="some")
    controller = Controller(robot, 0.002)
    controller.add(every, some)
    controller.update(*near_half_sitting(robot, rng, 0.1, 0.5))
    spared, expected = np.array([0, 6 + robot.joint_index(arm(robot)[1])]), np.array([2.0, -3.0])
    some.spared = spared
    assert not some.spared_acceleration.any()
    some.spared_acceleration = expected
    jacobian, error, drift = every.evaluated()
    used = [i for i in range(6) if i not in spared]
    used += [
        6 + robot.joint_index(joint) for joint in arm(robot) if 6 + robot.joint_index(joint) not in spared
    ]
    others = np.setdiff1d(np.arange(robot.nv), used)
    kept, same, known = some.evaluated()
    np.testing.assert_array_equal(kept[:, used], jacobian[:, used])
    assert not kept[:, others].any() and (same == error).all()
    goes_on = jacobian[:, spared] @ expected + some.damping * (jacobian[:, others] @ robot.v[others])
    np.testing.assert_allclose(known, drift + goes_on, atol=1e-12)
    with pytest.raises(InputError, match="posture"):
        controller.add(PostureTask()).spared = spared


def test_a_task_keeps_its_numbers_in_every_solver_and_a_copy_has_its_own() -> None:
    robot = make_robot("hrp4_class")
    task = PositionTask(left_hand(robot), weight=(1.0, 2.0, 3.0), damping=7.0, rate=3.0, error_bound=0.02)
    task.scale, task.feedforward_velocity = 0.5, (0.1, 0.2, 0.3)
    copied = copy.deepcopy(task)
    copied.weight, copied.scale = 5.0, 2.0

    def numbers(each: Task) -> list[float]:
        names = ("weight", "scale", "stiffness", "damping", "rate", "error_bound", "feedforward_velocity")
        return np.concatenate([getattr(each, name) for name in names]).tolist()

    before = numbers(task)
    assert before[:6] == [1.0, 2.0, 3.0, 0.5, 0.5, 0.5] and numbers(copied)[:6] == [5.0] * 3 + [2.0] * 3
    controller, ik = Controller(robot, 0.002), InverseKinematics(robot, 0.01)
    references = []
    for solver in (controller, ik, controller):
        solver.add(task)
        task.target = task.target + [0.01, 0.0, 0.0]
        solver.solve()
        assert numbers(task) == before and task.error[0] == pytest.approx(0.01, abs=1e-9)
        references.append(solver._assembly.targets[solver._assembly.places[task.name]].copy())
        solver.remove(task)
        task.target = task.target - [0.01, 0.0, 0.0]
        assert numbers(task) == before and not task.error.any()
    np.testing.assert_array_equal(references[0], references[2])
    controller.add(copied)
    controller.solve()
    rows, n_eq = controller._assembly.places[copied.name], controller.problem.n_eq
    assert controller.problem.soft_weight[rows.start - n_eq : rows.stop - n_eq] == pytest.approx(10.0)
    assert references[1] == pytest.approx([0.03 + 0.1, 0.2, 0.3])  # rate · error + velocity
    assert references[0] == pytest.approx([30.0 * 0.01 + 7.0 * 0.1, 7.0 * 0.2, 7.0 * 0.3])


def test_a_task_that_one_robot_could_not_get_is_another_robots() -> None:
    """The gripper of the arm slides, and its joints are not those of the humanoid."""
    posture = PostureTask()
    arm = wbc.InverseKinematics(wbc.load_robot("panda").robot(), dt=0.01)
    with pytest.raises(InputError):
        arm.add(posture, PoseTask("none"))
    controller = Controller(wbc.load_robot("hrp4_class").robot(), 0.005)
    controller.add(posture)
    alone = Controller(wbc.load_robot("hrp4_class").robot(), 0.005).add(PostureTask())
    assert posture.joints == controller.robot.joint_names
    np.testing.assert_array_equal(posture.error_bound, alone.error_bound)
    np.testing.assert_array_equal(posture.target, alone.target)


def test_a_removal_of_nothing_changes_nothing() -> None:
    """The QP is then the same, with the guesses of its solver."""
    controller = standing("hrp4_class")
    controller.solve()
    problem = controller.problem
    controller.remove()
    controller.solve()
    assert controller.problem is problem
