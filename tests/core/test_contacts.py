"""Contacts: the wrench cone against forces at the corners, the force ramp, free axes, point contacts."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from closed_chains import four_bar_knee
from hypothesis import given
from hypothesis import strategies as st
from properties import by_default, examples
from scipy.optimize import nnls
from task_factory import ROBOTS, integrate, left_hand, make_robot, right_hand, standing

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.core.friction import friction_pyramid, rectangle_wrench_cone
from wbc.core.qp.closure import FixedContact, LoopClosure
from wbc.core.qp.contact import (
    Contact,
    PointContact,
    SoleContact,
)
from wbc.core.robot import GRAVITY, Robot
from wbc.robots import RobotDescription
from wbc.tasks import CoMTask, OrientationTask, WrenchTask, check_rows

robots = pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))
RECTANGLES = [(0.1, 0.05, 0.7), (0.05, 0.1, 0.25), (0.12, 0.065, 1.3)]


def corner_generators(x: float, y: float, friction: float) -> Array:
    """Wrenches of unit forces along the edges of pyramids inside the friction cones at the corners, shape (6, 16)."""
    friction, columns = friction / np.sqrt(2.0), []
    for (px, py), (fx, fy) in itertools.product(
        itertools.product((x, -x), (y, -y)), itertools.product((friction, -friction), repeat=2)
    ):
        force = np.array([fx, fy, 1.0])
        columns.append(np.concatenate([force, np.cross([px, py, 0.0], force)]))
    return np.array(columns).T


@pytest.mark.parametrize(("x", "y", "friction"), RECTANGLES)
def test_cone_holds_what_corner_forces_can_do_and_nothing_else(x: float, y: float, friction: float) -> None:
    """Samples on both sides of the cone, close to its faces, against non-negative least squares."""
    rng = np.random.default_rng(1)
    cone, generators = rectangle_wrench_cone(x, y, friction), corner_generators(x, y, friction)
    assert (cone @ generators <= 1e-12).all()
    unit = np.array([friction, friction, 1.0, y, x, friction * (x + y)])
    inside = outside = 0
    for _ in range(100):
        base = generators @ rng.exponential(size=16)
        direction = unit * rng.normal(size=6)
        direction[2] = 0.0  # away from the axis of the cone, so that the ray does leave it
        reach = -(cone @ base) / np.maximum(cone @ direction, 1e-12)  # where the ray leaves each half space
        edge = float(reach[cone @ direction > 1e-12].min())
        for share in (0.98, 1.02):
            wrench = base + share * edge * direction
            scaled = wrench / unit
            _, residual = nnls(generators / unit[:, None], scaled)
            feasible = residual < 1e-8 * np.linalg.norm(scaled)
            assert feasible == bool((cone @ wrench <= 1e-9 * abs(wrench[2])).all())
            inside, outside = inside + feasible, outside + (not feasible)
    assert inside == outside == 100


@robots
def test_solved_wrenches_can_be_made_by_corner_forces(name: str) -> None:
    """A robot that leans as hard as it can stays inside what its soles can pass on."""
    controller = standing(name)
    robot = controller.robot
    friction, margin = 0.3, 0.01
    controller.remove(*controller.contacts)
    contacts = [SoleContact(sole.name, friction=friction, margin=margin) for sole in robot.soles]
    com = CoMTask(weight=1e3, stiffness=0.0)
    controller.add(*contacts, com)
    for angle in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
        com.feedforward_acceleration = 20.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
        solution = controller.solve()
        assert solution.ok
        assert any("wrench cone" in limit for limit in solution.active_limits)
        for sole in robot.soles:
            x, y = 0.5 * sole.length - margin, 0.5 * sole.width - margin
            unit = np.array([1.0, 1.0, 1.0, y, x, x + y])
            wrench = solution.wrenches[sole.name] / unit
            _, residual = nnls(corner_generators(x, y, friction) / unit[:, None], wrench)
            assert residual < 1e-4 * robot.mass
            assert solution.wrenches[sole.name][2] >= contacts[0].min_force - 1e-5


@examples(30)
@given(st.floats(0.05, 2.0), st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_no_force_of_a_pyramid_leaves_the_friction_cone(
    friction: float, direction: tuple[float, float, float]
) -> None:
    """A force is scaled until it is on the pyramid's face: there, and at the edges, it is inside the cone."""
    fx, fy, _ = direction
    if max(abs(fx), abs(fy)) < 1e-3:
        return
    normal = max(abs(fx), abs(fy)) * np.sqrt(2.0) / friction  # the least one
    assert (friction_pyramid(friction) @ [fx, fy, normal] <= 1e-9).all()
    assert (friction_pyramid(friction) @ [fx, fy, 0.999 * normal] > 0.0).any()
    assert np.hypot(fx, fy) <= friction * normal * (1.0 + 1e-9)
    cone = rectangle_wrench_cone(0.1, 0.05, friction)
    assert (cone @ [fx, fy, 0.999 * normal, 0.0, 0.0, 0.0] > 0.0).any()


RELEASED: dict[str, Callable[[Robot], Contact]] = {
    "sole": lambda robot: SoleContact("left_foot", ramp=0.1),
    "sole that yields": lambda robot: SoleContact("left_foot", ramp=0.1, torsion=0.03, motion_weight=1e4),
    "point": lambda robot: PointContact(left_hand(robot), ramp=0.1, min_force=5.0, friction=1.0),
    "fixed": lambda robot: FixedContact(left_hand(robot), ramp=0.1),
}


@pytest.mark.parametrize("kind", RELEASED)
def test_a_contact_that_is_switched_off_lets_go_evenly_of_what_it_carried(kind: str) -> None:
    controller = standing("talos")
    robot, dt = controller.robot, controller.dt
    contact = RELEASED[kind](robot)
    if isinstance(contact, SoleContact):
        controller.remove(controller.contact("left_foot"))
    controller.add(contact, CoMTask(), OrientationTask(robot.torso_frame))
    pull = np.zeros(contact.dim)
    pull[:3] = (15.0, -10.0, 150.0)
    controller.add(WrenchTask(contact, pull, weight=0.0 if isinstance(contact, SoleContact) else 1.0))
    before = first = np.array(controller.solve().wrenches[contact.name])
    assert first[2] > 100.0
    contact.active = False
    ticks = round(0.1 / dt)
    for tick in range(1, ticks + 2):
        solution = controller.solve()
        assert solution.ok, controller.diagnose()
        now = np.array(solution.wrenches[contact.name])
        share = max(1.0 - tick / ticks, 0.0)
        assert now[2] == pytest.approx(share * first[2], abs=1e-3)
        assert (np.abs(now - before)[:3] <= 1.5 * first[2] / ticks).all()  # shear is in proportion at most
        before = now
    assert not contact.engaged
    contact.active = True
    for _ in range(ticks):
        solution = controller.solve()
    assert solution.ok and solution.wrenches[contact.name][2] > 0.5 * first[2]


def test_a_contact_that_is_loaded_again_goes_on_from_what_is_allowed() -> None:
    controller = standing("talos")
    contact = controller.contact("left_foot")
    controller.add(CoMTask())
    controller.solve()
    contact.active = False
    for _ in range(10):
        controller.solve()
    before = contact.force_ranges()[1]
    contact.active = True
    assert contact.force_ranges()[1] == pytest.approx(before)
    for _ in range(round(contact.ramp / controller.dt)):
        controller.solve()
    assert contact.force_ranges()[1] == contact.max_force


def test_the_greatest_force_is_a_multiple_of_the_weight_of_the_robot_that_has_the_contact_now() -> None:
    contact, weights = SoleContact("left_foot"), []
    for name in ("g1", "talos"):
        controller = standing(name)
        controller.remove(controller.contact("left_foot"))
        controller.add(contact, CoMTask())
        robot = controller.robot
        weights.append(robot.mass * GRAVITY)
        assert contact.max_force == pytest.approx(4.0 * weights[-1])
        assert contact.min_force == 10.0
        robot.carry(left_hand(robot), 20.0)
        try:
            controller.update(robot.q, robot.v)
            controller.solve()
            assert contact.force_ranges()[1] == pytest.approx(4.0 * (weights[-1] + 20.0 * GRAVITY))
            bound = controller.problem.inequality_groups["wrench cone of contact 'left_foot'"].stop - 1
            assert controller.problem.upper[bound] == pytest.approx(contact.force_ranges()[1])
        finally:
            robot.carry(left_hand(robot), 0.0)
        controller.remove(contact)
    assert weights[0] < 0.5 * weights[1]
    contact.min_force, contact.max_force = 30.0, 50.0
    controller = standing("g1")
    controller.remove(controller.contact("left_foot"))
    controller.add(contact)
    assert (contact.min_force, contact.max_force) == (30.0, 50.0)


def test_a_least_force_that_is_assigned_is_kept_on_a_light_robot_and_the_usual_one_is_less() -> None:
    robot = make_robot("g1")
    model = robot.model.copy()
    for inertia in model.inertias:
        inertia.mass *= 0.5
    light = Robot(model, robot.soles, robot.half_sitting)
    assert light.mass < 25.0
    contact, usual = SoleContact("left_foot"), SoleContact("left_foot")
    contact.min_force = 10.0
    for each in (contact, usual):
        assert each.max_force is None
        each.bind(light)
    assert contact.min_force == 10.0 and usual.min_force == pytest.approx(10.0 * light.mass / 30.0)
    contact.min_force = None
    assert contact.min_force == usual.min_force
    for each in (contact, usual):
        each.bind(robot)
        assert each.min_force == 10.0 and each.max_force == pytest.approx(4.0 * robot.mass * GRAVITY)


def test_a_greatest_force_of_none_is_the_usual_one_of_the_class() -> None:
    grip = FixedContact("left_hand", max_force=300.0)
    grip.max_force = None
    assert grip.max_force == FixedContact("left_hand").max_force == 1e6


def test_force_range_ramps_up_and_down_without_a_jump() -> None:
    robot, dt, ramp = make_robot("g1"), 0.002, 0.1
    contact = SoleContact("left_foot", ramp=ramp, min_force=20.0, max_force=500.0, active=False)
    contact.bind(robot)
    assert not contact.engaged
    for active in (True, False):
        contact.active = active
        highs, lows = [], []
        for _ in range(80):
            contact.advance(dt)
            low, high = contact.force_ranges()
            assert 0.0 <= low <= high
            lows.append(low)
            highs.append(high)
        steps = np.diff(highs) * (1.0 if active else -1.0)
        assert (steps >= -1e-12).all()
        assert steps.max() <= 500.0 * dt / ramp + 1e-9
        assert (np.diff(lows) * (1.0 if active else -1.0) >= -1e-12).all()
        assert highs[-1] == (500.0 if active else 0.0)
        assert lows[-1] == (20.0 if active else 0.0)
        first = int(np.argmax(np.isclose(highs, highs[-1])))
        assert first * dt == pytest.approx(ramp, abs=2 * dt)
    assert not contact.engaged


def test_loaded_foot_follows_target_and_velocity_of_its_contact() -> None:
    controller = standing("g1")
    robot = controller.robot
    controller.add(CoMTask())
    contact = controller.contact("left_foot")
    place, speed = pin.SE3(contact.target), 0.02
    q, v = np.array(robot.q), np.array(robot.v)
    for tick in range(250):
        lift = speed * tick * controller.dt
        target = pin.SE3(place.rotation, place.translation + [0.0, 0.0, lift])
        if tick % 2:
            contact.target, contact.velocity = target, [0.0, 0.0, speed, 0.0, 0.0, 0.0]
        else:  # the same, unchecked
            contact.follow(target, np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0]))
        controller.update(q, v)
        solution = controller.solve()
        assert solution.ok, controller.diagnose()
        q, v = integrate(controller, q, v, solution.accelerations)
    robot.update(q, v)
    lifted = robot.placement(contact.frame).translation[2] - place.translation[2]
    assert lifted == pytest.approx(speed * 250 * controller.dt, abs=2e-4)
    contact.reset()
    np.testing.assert_array_equal(contact.velocity, 0.0)
    with pytest.raises(InputError):
        contact.velocity = [0.0, float("nan"), 0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize("normal", [(1.0, 0.0, 0.0), (-0.5, 0.3, 0.7)])
def test_point_contact_holds_its_point_and_pushes_from_the_surface(
    normal: tuple[float, ...],
) -> None:
    controller, point = standing("talos"), (0.1, -0.05, 0.2)
    robot = controller.robot
    held = {"friction": 0.4, "min_force": 5.0, "ramp": 0.0, "stiffness": 0.0, "damping": 0.0}
    hand = PointContact(left_hand(robot), point=point, normal=normal, **held)
    controller.add(hand, CoMTask(np.array(robot.com) + [0.05, 0.05, -0.02], weight=100.0))
    solution = controller.solve()
    assert solution.ok, controller.diagnose()
    force = solution.wrenches[hand.name]
    assert (friction_pyramid(0.4) @ force <= 1e-5).all()
    assert force[2] >= 5.0 - 1e-5
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.q, robot.v, solution.accelerations)
    frame = robot.frame_id(hand.frame)
    motion = pin.getFrameClassicalAcceleration(robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED)
    arm, spin = robot.placement(hand.frame).rotation @ point, robot.v[3:6]
    assert not spin.any()
    np.testing.assert_allclose(motion.linear + np.cross(motion.angular, arm), 0.0, atol=1e-6)
    # The base is held by the soles and the hand together: Newton's law in the world.
    axis = np.array(normal) / np.linalg.norm(normal)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix()
    np.testing.assert_allclose(hand.rotation, turn, atol=1e-12)
    np.testing.assert_allclose(hand.normal, axis, atol=1e-12)
    total = hand.rotation @ force
    for sole in robot.soles:
        total = total + robot.placement(sole.frame).rotation @ solution.wrenches[sole.name][:3]
    pin.centerOfMass(robot.model, data, robot.q, robot.v, solution.accelerations)
    np.testing.assert_allclose(total, robot.mass * (data.acom[0] + [0, 0, 9.80665]), atol=1e-4)


def test_a_friction_that_is_assigned_bounds_the_next_wrench() -> None:
    controller = standing("hrp4_class")
    com = controller.add(CoMTask(weight=100.0))
    com.feedforward_acceleration = [5.0, 0.0, 0.0]
    soles = [contact for contact in controller.contacts if isinstance(contact, SoleContact)]
    before = controller.solve().wrenches
    for sole in soles:
        sole.friction = 0.1
    after = controller.solve()
    assert after.ok and len(soles) == 2
    for sole in soles:
        assert abs(before[sole.name][0]) > 0.11 * before[sole.name][2]
        assert abs(after.wrenches[sole.name][0]) <= 0.1 * after.wrenches[sole.name][2] + 1e-5


def test_a_configuration_stands_on_its_lower_sole() -> None:
    robot = make_robot("g1")
    knee = robot.joint_index("left_knee_joint")
    for bend in (0.8, -0.3):  # the left foot is lifted, or the right one
        q = robot.configuration({"left_knee_joint": robot.half_sitting[7 + knee] + bend})
        robot.update(q, np.zeros(robot.nv))
        heights = [robot.placement(sole.frame).translation[2] for sole in robot.soles]
        assert min(heights) == pytest.approx(0.0, abs=1e-12) and heights[bend < 0.0] > 0.004
        expected = np.array(robot.half_sitting)
        expected[[2, 7 + knee]] += q[2] - expected[2], bend
        np.testing.assert_allclose(q, expected, atol=1e-12)


@pytest.mark.parametrize("root", ["", "<freejoint/>"], ids=["bolted", "floating"])
@pytest.mark.parametrize(("rotation", "size"), [(False, 2), (True, 3)])
def test_a_closure_has_rows_where_its_chain_could_open(root: str, rotation: bool, size: int) -> None:
    """Four bars open in their plane, where they may turn as well; two hands of a humanoid in every direction."""
    options = {"feet": False} if root else {"base": "fixed"}
    robot = RobotDescription.from_mjcf(four_bar_knee(root), **options).robot()  # type: ignore[arg-type]
    tied = robot.closures[0]
    closure = LoopClosure(tied.frame, tied.other, rotation=rotation)
    closure.bind(robot)
    turn = robot.placement(tied.frame).rotation
    rows = [np.split(row, [3])[: 1 + rotation] for row in closure.directions]
    in_world = [np.concatenate([turn @ part for part in row]) for row in rows]
    plane = np.eye(6)[[0, 2, 4]][:size, : 6 if rotation else 3]
    np.testing.assert_allclose(
        np.transpose(in_world) @ in_world, plane.T @ plane, atol=1e-6
    )  # the same span, whatever its basis
    humanoid = make_robot("hrp4_class")
    hands = LoopClosure(left_hand(humanoid), right_hand(humanoid), rotation=rotation)
    if not rotation:  # of an orientation the rows are the change of the error at its target alone
        check_rows(hands, humanoid)
    else:
        hands.bind(humanoid)
    np.testing.assert_array_equal(hands.directions, np.eye(6 if rotation else 3))


class Edge(Contact):
    """An edge that a foot rolls over: a contact of one's own."""

    dim = 3

    def __init__(self, frame: str, scale: float = 1.0) -> None:
        super().__init__(f"edge of {frame}", frame, friction_pyramid(0.6))
        self._scale = scale

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        model, data, world = self.robot.model, self.robot.data, pin.LOCAL_WORLD_ALIGNED
        jacobian[:] = pin.getFrameJacobian(model, data, self.frame_id, world)[:3]
        error[:] = self._scale * (self.target.translation - self.placement.translation)
        drift[:] = pin.getFrameClassicalAcceleration(model, data, self.frame_id, world).linear


def test_a_contact_of_ones_own_carries_the_robot_and_is_checked() -> None:
    controller = standing("hrp4_class")
    robot = controller.robot
    frame = robot.sole("left_foot").frame
    beside = PointContact("left_hand", point=(0.1, -0.05, 0.2), normal=(-0.5, 0.3, 0.7))
    for contact in (
        Edge(frame),
        SoleContact("left_foot"),
        PointContact("left_hand"),
        beside,
        FixedContact(frame),
    ):
        check_rows(contact, robot)
    with pytest.raises(InputError, match="Jacobian by x"):
        check_rows(Edge(frame, scale=2.0), robot)
    controller.remove(controller.contact("left_foot"))
    edge = controller.add(Edge(frame), CoMTask())[0]
    for _ in range(50):
        solution = controller.solve()
    assert solution.ok and solution.wrenches[edge.name][2] > 20.0
    assert (edge.cone @ solution.wrenches[edge.name] <= 1e-5).all()
