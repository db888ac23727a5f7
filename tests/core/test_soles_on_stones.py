"""Soles on ground of unknown shape, and contacts whose motion is a cost: rows against mechanics, QPs feasible."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import by_default, examples
from task_factory import ROBOTS, make_robot, near_half_sitting, random_state

from wbc.base.numbers import Array
from wbc.core.limits.joint import TorqueLimits
from wbc.core.qp.contact import Contact, SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solver import solve_by_qpsolvers
from wbc.core.robot import Robot
from wbc.tasks import CoMTask, PostureTask

robots = pytest.mark.parametrize("name", by_default(ROBOTS, "hrp4_class"))
CENTRE = (0.02, -0.01)
HOLD = (1000.0, 1000.0, 1000.0, 3.0, 3.0, 3.0)


def on_stones(foot: str, **options: object) -> SoleContact:
    """Return a contact of a sole on ground of unknown shape, whose motion is a cost."""
    chosen = {"friction": 0.5, "margin": 0.0, "torsion": 0.03, "min_force": 0.0, "ramp": 0.0}
    chosen |= {"motion_weight": HOLD, "stiffness": 0.0, "damping": 12.0}
    return SoleContact(foot, **(chosen | options))  # type: ignore[arg-type]


EPS = 1e-6


def bound(robot: Robot, **options: float) -> SoleContact:
    """Return a foothold of the left sole with its centre away from that of the sole."""
    contact = on_stones("left_foot", **options)
    contact.bind(robot)
    contact.set_box(0.05, 0.02, CENTRE)
    return contact


def rows_of(contact: Contact, robot: Robot) -> tuple[Array, Array, Array]:
    """Return Jacobian, error and drift at the present state."""
    rows = np.zeros((contact.dim, robot.nv)), np.zeros(contact.dim), np.zeros(contact.dim)
    contact.evaluate(*rows)
    return rows


def level(frame: pin.SE3) -> Array:
    """Return the axes with z up and x along a sole, shape (3, 3)."""
    forward = frame.rotation[:, 0] * [1.0, 1.0, 0.0]
    forward /= np.linalg.norm(forward)
    up = np.array([0.0, 0.0, 1.0])
    return np.column_stack([forward, np.cross(up, forward), up])


@robots
def test_the_jacobian_is_dual_to_the_wrench_at_the_centre(name: str) -> None:
    """Force in level axes and moment in those of the sole do the work of a wrench of the ground on the robot."""
    robot, rng = make_robot(name), np.random.default_rng(5)
    contact = bound(robot)
    sole = robot.frame_id(contact.frame)
    for _ in range(20):
        robot.update(*random_state(robot, rng))
        frame, wrench = robot.placement(contact.frame), rng.normal(size=6)
        force, moment = level(frame) @ wrench[:3], frame.rotation @ wrench[3:]
        arm = frame.rotation @ [*CENTRE, 0.0]
        world = np.concatenate([force, moment + np.cross(arm, force)])  # about the origin of the sole
        jacobian = pin.getFrameJacobian(robot.model, robot.data, sole, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(rows_of(contact, robot)[0].T @ wrench, jacobian.T @ world, atol=1e-10)


def centre_velocity(contact: SoleContact, robot: Robot, q: Array, v: Array) -> tuple[Array, Array]:
    """Return the velocity of the centre in the world, and the angular one in the axes of the sole."""
    robot.update(q, v)
    sole = robot.frame_id(contact.frame)
    motion = pin.getFrameVelocity(robot.model, robot.data, sole, pin.LOCAL_WORLD_ALIGNED)
    frame = robot.placement(contact.frame)
    return (
        motion.linear + np.cross(motion.angular, frame.rotation @ [*CENTRE, 0.0]),
        frame.rotation.T @ motion.angular,
    )


@robots
@pytest.mark.parametrize("still", [True, False], ids=["the centre is at rest", "any velocity"])
def test_the_drift_is_the_acceleration_without_one_of_the_coordinates(name: str, still: bool) -> None:
    """Against finite differences; the sole turns as it likes. With the centre at rest it is the rows' derivative."""
    robot, rng = make_robot(name), np.random.default_rng(6)
    contact = bound(robot)
    for _ in range(10):
        q, v = random_state(robot, rng)
        robot.update(q, v)
        if still:
            linear = rows_of(contact, robot)[0][:3]
            v = v - np.linalg.pinv(linear) @ (linear @ v)
            robot.update(q, v)
        jacobian, _, drift = (row.copy() for row in rows_of(contact, robot))
        axes = level(robot.placement(contact.frame))
        before, after = (
            centre_velocity(contact, robot, pin.integrate(robot.model, q, step * v), v)
            for step in (-EPS, EPS)
        )
        linear, angular = ((b - a) / (2.0 * EPS) for a, b in zip(before, after, strict=True))
        np.testing.assert_allclose(
            drift, [*(axes.T @ linear), *angular], atol=1e-4 * (1.0 + np.abs(drift).max())
        )
        if not still:
            continue
        assert np.linalg.norm(jacobian[3:] @ v) > 0.1
        values = []
        for step in (-EPS, EPS):
            robot.update(pin.integrate(robot.model, q, step * v), v)
            values.append(rows_of(contact, robot)[0] @ v)
        rate = (values[1] - values[0]) / (2.0 * EPS)
        np.testing.assert_allclose(drift, rate, atol=1e-4 * (1.0 + np.abs(drift).max()))


def test_the_error_leads_back_to_where_the_contact_was_made() -> None:
    robot, rng = make_robot("g1"), np.random.default_rng(7)
    contact = bound(robot, stiffness=100.0)
    np.testing.assert_allclose(rows_of(contact, robot)[1], 0.0, atol=1e-12)
    q = np.array(robot.q)
    for _ in range(10):
        step = 1e-4 * rng.normal(size=robot.nv)
        robot.update(pin.integrate(robot.model, q, step), np.zeros(robot.nv))
        jacobian, error, _ = rows_of(contact, robot)
        np.testing.assert_allclose(error, -jacobian @ step, atol=2e-6)
        robot.update(q, np.zeros(robot.nv))


def test_the_cone_is_box_friction_and_torsion() -> None:
    """Each bound holds a wrench just within it and refuses one just beyond."""
    robot = make_robot("g1")
    contact = bound(robot, friction=0.4, torsion=0.03)
    inner = 0.4 / np.sqrt(2.0)
    limits = {
        0: inner,
        1: inner,
        3: 0.01,
        4: 0.025,
        5: 0.03,
    }  # of x, y, roll, pitch, yaw over the normal force
    for signs in itertools.product((-0.999, 0.999), repeat=5):  # all bounds at once: none takes from another
        wrench = np.array([0.0, 0.0, 200.0, 0.0, 0.0, 0.0])
        for (axis, limit), sign in zip(limits.items(), signs, strict=True):
            wrench[axis] = sign * limit * 200.0
        assert (contact.cone @ wrench <= 0.0).all()
        for axis, limit in limits.items():
            beyond = wrench.copy()
            beyond[axis] = np.sign(wrench[axis]) * 1.001 * limit * 200.0
            assert (contact.cone @ beyond > 0.0).any()
    assert (contact.cone @ [0.0, 0.0, -1.0, 0.0, 0.0, 0.0] > 0.0).any(), "the ground does not pull"


def with_contacts(name: str, *contacts: Contact, limited: bool = True) -> Controller:
    """Return a controller of a robot on some contacts, which is asked to move."""
    controller = Controller(make_robot(name), 0.002)
    controller.add(*contacts, CoMTask(weight=10.0), PostureTask(weight=0.1))
    if limited:
        controller.add(TorqueLimits())
    return controller


@examples(20)
@given(st.sampled_from(ROBOTS), st.integers(0, 10_000), st.floats(0.0, 3.0), st.booleans(), st.booleans())
def test_footholds_make_no_qp_infeasible(name: str, seed: int, speed: float, left: bool, right: bool) -> None:
    """Joints within their limits, any velocity, loads that must be carried; another solver finds the same."""
    weight = 9.81 * make_robot(name).mass
    feet = [
        on_stones(foot, min_force=0.06 * weight, max_force=1.4 * weight, active=on)
        for foot, on in (("left_foot", left), ("right_foot", right))
    ]
    controller = with_contacts(name, *feet)
    controller.update(*random_state(controller.robot, np.random.default_rng(seed), speed))
    solution = controller.solve()
    assert solution.ok, controller.diagnose()
    problem, x = controller.problem, solution.variables
    assert (np.abs(solution.torques) <= controller.robot.torque_limit + 1e-4).all()
    for foot, on in zip(feet, (left, right), strict=True):
        wrench = solution.wrenches[foot.name]
        if on:
            assert (foot.cone @ wrench <= 1e-4).all() and wrench[2] >= 0.06 * weight - 1e-4
        else:
            np.testing.assert_allclose(wrench, 0.0, atol=1e-6)
    hessian, gradient = problem.hessian, problem.gradient
    other = solve_by_qpsolvers("daqp", problem)
    assert other is not None
    costs = [0.5 * y @ hessian @ y + gradient @ y for y in (x, other[0])]
    assert costs[0] <= costs[1] + 1e-5 * (1.0 + abs(costs[1]))
    scale = 1.0 + np.abs(x[: problem.nv]).max()
    np.testing.assert_allclose(other[0][: problem.nv], x[: problem.nv], atol=2e-3 * scale)


SOLES: list[Callable[..., Contact]] = [
    lambda foot, **o: SoleContact(foot, min_force=0.0, **o),
    lambda foot, **o: on_stones(foot, **({"motion_weight": None} | o)),
]


@pytest.mark.parametrize("make", SOLES, ids=["sole", "foothold"])
def test_a_motion_of_a_huge_weight_is_a_constraint(make: Callable[..., Contact]) -> None:
    """The solution goes to that of the hard contact as one over the weight: 10⁻⁵ m/s² off at 10⁶."""
    feet, weights = ("left_foot", "right_foot"), (1e2, 1e4, 1e6)
    hard = with_contacts("g1", *(make(foot) for foot in feet))
    soft = [with_contacts("g1", *(make(foot, motion_weight=weight) for foot in feet)) for weight in weights]
    rng = np.random.default_rng(8)
    for _ in range(5):
        state = near_half_sitting(hard.robot, rng, 0.02, 0.05)
        answers = []
        for controller in (hard, *soft):
            controller.update(*state)
            answers.append(controller.solve())
            assert answers[-1].ok
        exact = answers[0]
        off = [np.abs(answer.accelerations - exact.accelerations).max() for answer in answers[1:]]
        assert off[2] < 1e-4 and off[0] > 1e-3
        assert off[1] / off[2] == pytest.approx(100.0, rel=0.1)
        for foot in feet:
            np.testing.assert_allclose(answers[-1].wrenches[foot], exact.wrenches[foot], atol=1e-3)


def test_a_motion_of_a_small_weight_gives_way() -> None:
    """A CoM that asks for more than the foothold holds moves the foothold, and no force leaves its cone."""
    feet = [on_stones(foot, motion_weight=1e-3) for foot in ("left_foot", "right_foot")]
    controller = with_contacts("g1", *feet)
    com = controller.task("com")
    assert isinstance(com, CoMTask)
    com.feedforward_acceleration = [0.0, 0.0, -20.0]  # faster than a fall
    solution = controller.solve()
    assert solution.ok
    jacobian, _, drift = rows_of(feet[0], controller.robot)
    assert np.abs(jacobian @ solution.accelerations + drift).max() > 1.0
