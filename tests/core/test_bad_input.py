"""Values that contacts, limits and controllers refuse: the type of the error and the name of what is wrong."""

from __future__ import annotations

import math
import pickle
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.base.errors import InputError, ModelError, UnknownNameError
from wbc.core.limits.obstacles import CollisionSphere, Obstacle
from wbc.core.qp.contact import FIRMEST
from wbc.core.qp.released import ReleasedJoints
from wbc.core.robot import Robot
from wbc.core.trajectories import Trajectory
from wbc.robots import load
from wbc.tasks.balance import balance_controller

Sole, Point = wbc.SoleContact, wbc.PointContact
NAN = float("nan")
BALL = CollisionSphere(0.05)


@cache
def g1() -> Robot:
    return load("g1").robot()


def with_limits(lower: float, upper: float, velocity: float = 3.0, torque: float = 10.0) -> Robot:
    """Return a robot whose last joint has other limits."""
    model = g1().model.copy()
    names = ("lowerPositionLimit", "upperPositionLimit", "upperVelocityLimit", "upperEffortLimit")
    for name, value in zip(names, (lower, upper, velocity, torque), strict=True):
        limits = np.array(getattr(model, name))
        limits[-1] = value
        setattr(model, name, limits)
    return Robot(model, g1().soles, g1().half_sitting)


def turned(length: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the half-sitting configuration with a quaternion of a length."""
    q = np.array(g1().half_sitting)
    q[3:7] *= length
    return q


def pairs(*names: str, **options: object) -> wbc.CollisionLimit:
    return wbc.CollisionLimit([names], **options)  # type: ignore[arg-type, list-item]


def boxed(sole: wbc.SoleContact, *box: Any, first: bool = False) -> None:
    """Give a sole of a robot its box, or first the box."""
    if not first:
        sole.bind(g1())
    sole.set_box(*box)
    sole.bind(g1())


def observer() -> wbc.Observer:
    return wbc.Observer(g1().clone())


def again(*items: wbc.TorqueLimits | wbc.JointLimits) -> None:
    balance_controller(g1().clone(), 0.002).add(*items)


WEIGHT = re.escape(f"of at most {FIRMEST:g}")

REFUSED: list[tuple[Callable[[], object], type[Exception], str]] = [
    (lambda: wbc.Controller(g1(), 0.0), InputError, "dt of Controller"),
    (lambda: wbc.Controller(g1(), 5.0), InputError, "dt of Controller"),
    (lambda: wbc.InverseKinematics(g1(), 1e-300), InputError, "dt of InverseKinematics"),
    (
        lambda: setattr(wbc.InverseKinematics(g1(), 0.01), "robot", 3),
        InputError,
        "robot of InverseKinematics",
    ),
    (lambda: setattr(wbc.Controller(g1(), 0.01), "robot", g1()), InputError, "robot of Controller"),
    (lambda: balance_controller(g1().clone(), 0.002).contact("left_fot"), UnknownNameError, "left_foot"),
    (lambda: wbc.Controller(load("g1"), 0.002), InputError, r"description\.robot\(\)"),  # type: ignore[arg-type]
    (lambda: wbc.Controller("g1", 0.002), InputError, r"load_robot\('g1'\)\.robot\(\)"),  # type: ignore[arg-type]
    (lambda: g1().clone().update(0.0, 0.0), InputError, "shapes"),  # type: ignore[arg-type]
    (lambda: g1().clone().update(g1().half_sitting, [0.0]), InputError, "shapes"),  # type: ignore[arg-type]
    (lambda: g1().clone().update(turned(1.1), np.zeros(g1().nv)), InputError, "quaternion.*1.1"),
    (lambda: g1().clone().update_kinematics(turned(0.0), np.zeros(g1().nv)), InputError, "quaternion"),
    (lambda: g1().clone().update(turned(NAN), np.zeros(g1().nv)), InputError, "quaternion"),
    (
        lambda: wbc.PositionControl(balance_controller(g1().clone(), 0.002)).reset(turned(1.1)),
        InputError,
        "quaternion",
    ),
    (lambda: g1().clone().carry(99999, 1.0), InputError, "99999"),
    (lambda: g1().placement(99999), InputError, "99999"),
    (lambda: wbc.CoMTask(name=""), InputError, "not empty"),
    (lambda: Sole("left_foot", min_force=-1.0), InputError, "min_force"),
    (lambda: setattr(wbc.FixedContact("pelvis"), "friction", 0.3), InputError, "friction"),
    (lambda: boxed(Sole("left_foot"), 0.1, 10.0), InputError, "than its sole"),
    (lambda: boxed(Sole("left_foot", torsion=0.1), 0.1, 0.05, (0.1, 0.0)), InputError, "than its sole"),
    (lambda: boxed(Sole("left_foot"), 10.0, 0.05, first=True), InputError, "than its sole"),
    (lambda: Sole("left_foot", min_force=10.0, max_force=5.0), InputError, "left_foot"),
    (lambda: Sole("left_foot", ramp=NAN), InputError, "ramp"),
    (lambda: Sole("left_foot", wrench_weight=[1.0, 2.0]), InputError, "left_foot"),
    (lambda: Sole("left_foot", wrench_weight=-1.0), InputError, "left_foot"),
    (lambda: Sole("left_foot", motion_weight=-1.0), InputError, WEIGHT),
    (lambda: Sole("left_foot", motion_weight=2e6), InputError, WEIGHT),
    (lambda: Sole("left_foot", margin=0.5).bind(g1()), InputError, "margin"),
    (lambda: Sole("pelvis").bind(g1()), UnknownNameError, "pelvis"),
    (lambda: Point("left_hand", normal=(0.0, 0.0, 0.0)), InputError, "left_hand"),
    (lambda: Point("left_hant").bind(g1()), UnknownNameError, "left_hant"),
    (lambda: wbc.JointLimits(acceleration=-1.0).bind(g1()), InputError, "acceleration"),
    (lambda: wbc.JointLimits(acceleration=[1.0, 2.0]).bind(g1()), InputError, "acceleration"),
    (lambda: wbc.JointLimits(acceleration=5.0, braking=10.0).bind(g1()), InputError, "braking"),
    (lambda: wbc.TorqueLimits(rate=0.0).bind(g1()), InputError, "rate"),
    (lambda: again(wbc.JointLimits(), wbc.JointLimits()), InputError, "joint"),
    (
        lambda: wbc.FramePositionLimit("torso_link", lower=[np.inf] * 3),
        InputError,
        "lower bounds",
    ),
    (
        lambda: wbc.FramePositionLimit("torso_link", upper=[-np.inf] * 3),
        InputError,
        "lower bounds",
    ),
    (lambda: pairs("left_foot", "right_foot").distances, InputError, "before it is added"),
    (lambda: again(wbc.TorqueLimits(), wbc.TorqueLimits()), InputError, "torque"),
    (lambda: with_limits(1.0, 0.0), ModelError, "position"),
    (lambda: with_limits(NAN, 1.0), ModelError, "position"),
    (lambda: with_limits(0.0, 1.0, -1.0), ModelError, "velocity"),
    (lambda: with_limits(0.0, 1.0, 1.0, NAN), ModelError, "torque"),
    (lambda: wbc.CoMPolygonLimit([[0, 0], [1, 0]]), InputError, "polygon"),
    (lambda: wbc.CoMPolygonLimit([[0, 0], [1, np.nan], [0, 1]]), InputError, "points"),
    (lambda: wbc.CoMPolygonLimit([[0, 0], [1, 0], [1, 0.01], [0, 0.01]], margin=0.01), InputError, "margin"),
    (lambda: wbc.CoMPolygonLimit(time_constant=0.0), InputError, "time_constant"),
    (lambda: wbc.JointLimits(joints=[]), InputError, "of some joint"),
    (lambda: wbc.JointLimits(position=False, velocity=False), InputError, "bound something"),
    (lambda: wbc.FrameSpeedLimit("torso_link"), InputError, "got neither"),
    (lambda: pairs("left_hand", "left_hand"), InputError, "left_hand"),
    (lambda: pairs("left_hand", "pelvis", margin=0.2, influence=0.1), InputError, "influence"),
    (lambda: pairs("left_hant", "pelvis", shapes={"pelvis": BALL}).bind(g1()), UnknownNameError, "left_hant"),
    (lambda: g1().configuration(3), InputError, "joints of Robot.configuration"),  # type: ignore[arg-type]
    (lambda: g1().joint_index(np.zeros(3)), InputError, "name of Robot.joint_index"),  # type: ignore[arg-type]
    (lambda: g1().sole(np.zeros(3)), InputError, "name of Robot.sole"),  # type: ignore[arg-type]
    (lambda: wbc.CoMPolygonLimit().use_soles("left_foot"), InputError, "soles of CoMPolygonLimit.use_soles"),
    *(
        (lambda item=item: item.bind(load("g1")), InputError, r"robot of \w+.bind .*description\.robot\(\)")
        for item in (
            wbc.CoMTask(),
            wbc.PostureTask(),
            wbc.PoseTask("left_hand"),
            Sole("left_foot"),
            Point("left_hand"),
            wbc.JointLimits(),
            wbc.TorqueLimits(),
            wbc.CoMPolygonLimit(),
            wbc.FrameSpeedLimit("left_hand", linear=1.0),
            pairs("left_hand", "pelvis", shapes={"pelvis": BALL}),
        )
    ),
    (lambda: wbc.Observer(wbc.Robot(g1().model, g1().soles[:1], g1().half_sitting)), InputError, "two feet"),
    (lambda: observer().resume(NAN), InputError, r"time of Observer.resume \(s\)"),
    (lambda: observer().retune(3), InputError, "settings of Observer.retune"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("make", "kind", "named"), REFUSED)
def test_a_value_that_cannot_be_used_is_refused(
    make: Callable[[], object], kind: type[Exception], named: str
) -> None:
    with pytest.raises(kind, match=named):
        make()


@cache
def controller() -> wbc.Controller:
    made = balance_controller(g1().clone(), 0.002)
    box = wbc.FramePositionLimit("torso_link", lower=(-1.0, -1.0, 0.0), name="box")
    if not any(isinstance(limit, wbc.JointLimits) for limit in made.limits):
        made.add(wbc.JointLimits())
    made.add(box, wbc.CoMPolygonLimit())
    return made


def spares() -> wbc.PositionTask:
    task = wbc.PositionTask("left_hand")
    task.spared = np.arange(2)
    return task


def limit(kind: type[Any]) -> Any:
    return next(each for each in controller().limits if isinstance(each, kind))


ASSIGNED: dict[str, tuple[Callable[[], Any], tuple[str, ...], tuple[object, ...]]] = {
    "robot": (
        g1,
        (
            "position_lower",
            "position_upper",
            "velocity_limit",
            "torque_lower",
            "torque_upper",
            "torque_limit",
        ),
        (2.0, NAN, np.zeros(29)),
    ),
    "outside": (controller, ("outside",), (NAN, [0.0] * 35, np.zeros(29))),
    "joint limits": (
        lambda: limit(wbc.JointLimits),
        ("lower", "upper", "velocity", "acceleration", "braking"),
        (2.0, NAN, "far", np.zeros(29)),
    ),
    "torque limits": (lambda: limit(wbc.TorqueLimits), ("least", "most", "rate"), (2.0, math.inf, None)),
    "CoM polygon": (lambda: limit(wbc.CoMPolygonLimit), ("recovery", "time_constant"), (-1.0, NAN, 0.2)),
    "box": (
        lambda: limit(wbc.FramePositionLimit),
        ("lower", "upper"),
        ("far", NAN, [0.0], [0.0, 0.0, NAN], [True, 0.0, 0.0]),
    ),
    "contact": (lambda: controller().contact("left_foot"), ("active",), (NAN, 1, "no", None, [True])),
    "obstacle": (
        lambda: Obstacle("box", BALL),
        ("placement",),
        (
            pin.SE3(2.0 * np.eye(3), np.zeros(3)),
            pin.SE3(np.diag([1.0, 1.0, -1.0]), np.zeros(3)),
            np.eye(4),
            None,
        ),
    ),
    "obstacle's parts": (lambda: Obstacle("box", BALL), ("name", "shape"), (BALL, "ball", None)),
    "task": (lambda: controller().tasks[0], ("spared",), (NAN, -1, "12", [-1], [0.5], [[1]], None)),
    "spared joints": (spares, ("spared_acceleration",), (NAN, [0.0], "fast", [0.0, NAN], None)),
    "frame speed": (
        lambda: wbc.FrameSpeedLimit("left_hand", linear=1.0),
        ("speed",),
        (NAN, 1.0, np.zeros(6)),
    ),
    "target": (lambda: controller().tasks[0], ("held_by",), (NAN, True, ["arm"])),
    "control": (
        lambda: wbc.TorqueControl(controller()),
        ("dcm_limit",),
        (NAN, -1.0, 0.0, math.inf, "far", None),
    ),
}
"""Objects, attributes of them, and values that none of these takes."""


@pytest.mark.parametrize("what", ASSIGNED)
def test_an_attribute_takes_no_value_that_cannot_be_used(what: str) -> None:
    make, names, values = ASSIGNED[what]
    made = make()
    for name in names:
        before = getattr(made, name)
        for value in values:
            with pytest.raises(InputError, match=name if what != "box" else "box"):
                setattr(made, name, value)
            np.testing.assert_equal(getattr(made, name), before)


LIVE = {
    "bias",
    "com",
    "com_jacobian",
    "com_velocity",
    "joint_jacobians",
    "mass_matrix",
    "q",
    "total_mass",
    "v",
}
"""Arrays of a robot that every update of its state overwrites."""


def handed_out() -> list[Any]:
    """Return objects of all kinds whose arrays a user sees."""
    made, closed = controller(), wbc.LoopClosure("left_hand", "right_hand")
    hands = {hand: BALL for hand in (g1().frames["left_hand"], g1().frames["right_hand"])}
    collisions = wbc.CollisionLimit([tuple(hands)], shapes=hands, name="hands")
    path = Trajectory([[0.0, 0.0], [1.0, 1.0]], 1.0)
    drives = [
        kind(balance_controller(g1().clone(), 0.005)) for kind in (wbc.PositionControl, wbc.HybridControl)
    ]
    point = wbc.PointContact("left_hand")
    bound = [closed, collisions, point, path, Obstacle("box", BALL), wbc.AxisConeLimit("left_hand", 0.2)]
    for item in (closed, collisions, point):
        item.bind(g1())
    return [
        g1(),
        *drives,
        *bound,
        spares(),
        ReleasedJoints(g1(), ["left_elbow_joint"]),
        *made.contacts,
        *made.limits,
    ]


def test_what_is_handed_out_cannot_be_written_or_is_a_copy() -> None:
    """Of every attribute of objects of all kinds but the state of a robot."""
    for each in handed_out():
        names = {name for name in dir(each) if not name.startswith("_")}
        for name in names - (LIVE if isinstance(each, Robot) else {"placement"}):
            try:
                value = getattr(each, name)
            except (wbc.WbcError, AttributeError):  # not known yet, or not of this kind
                continue
            again = getattr(each, name)
            if isinstance(value, np.ndarray):
                assert not value.flags.writeable or not np.shares_memory(value, again), (each, name)
            assert name != "shapes" or not isinstance(value, dict)
            if type(value) is pin.SE3:
                assert not np.shares_memory(value.translation, again.translation), (each, name)


def test_what_is_handed_in_is_copied() -> None:
    numbers, task, robot = np.arange(3), wbc.PositionTask("left_hand"), g1()
    task.spared = numbers
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    polygon, cone = wbc.CoMPolygonLimit(square), np.eye(3)
    polygon.bind(robot)
    point = wbc.PointContact("left_hand")
    point.cone = cone
    for own in (numbers, square, cone):
        own[:] = 7
    assert task.spared.tolist() == [0, 1, 2] and polygon.polygon.max() == 1.0 and point.cone.max() == 1.0


def test_a_polygon_that_is_assigned_before_the_limit_is_added_stays() -> None:
    """A limit without one takes the hull of the soles wherever it is added."""
    given, of_soles = wbc.CoMPolygonLimit(), wbc.CoMPolygonLimit(name="soles")
    given.polygon = square = 0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    robot, q = g1().clone(), g1().half_sitting.copy()
    corners = []
    for place in (0.0, 1.0):
        q[0] += place
        robot.update(q, np.zeros(robot.nv))
        for each in (given, of_soles):
            each.bind(robot)
        np.testing.assert_allclose(given.polygon, square)
        corners.append(of_soles.polygon.copy())
    np.testing.assert_allclose(corners[1] - corners[0], np.tile([1.0, 0.0], (len(corners[0]), 1)), atol=1e-9)


def test_a_state_that_is_refused_leaves_the_robot_as_it_is() -> None:
    robot, before = g1().clone(), (g1().q.copy(), g1().v.copy())
    for update in (robot.update, robot.update_kinematics):
        for q in (turned(1.1), turned(NAN)):
            with pytest.raises(InputError):
                update(q + 0.1 * (np.arange(q.size) > 6), np.ones(robot.nv))
            np.testing.assert_array_equal(robot.q, before[0])
            np.testing.assert_array_equal(robot.v, before[1])


def test_a_box_can_be_moved() -> None:
    box = wbc.FramePositionLimit("torso_link", lower=(-1.0, -1.0, 0.0))
    box.lower, box.upper = [0.0, 0.0, 0.0], (1.0, 2.0, math.inf)
    np.testing.assert_equal(box.lower, [0.0, 0.0, 0.0])
    np.testing.assert_equal(box.upper, [1.0, 2.0, math.inf])
    with pytest.raises(InputError, match="limit 'torso_link"):
        box.lower = [2.0, 0.0, 0.0]  # above the upper one
    np.testing.assert_equal(box.lower, [0.0, 0.0, 0.0])


def test_a_limit_that_no_controller_has_goes_to_another_process() -> None:
    """Such as one of a filter of a policy in a sweep."""
    for limit in (
        pairs("pelvis", "torso_link", shapes={"pelvis": BALL, "torso_link": BALL}),
        wbc.JointLimits(),
    ):
        copy = pickle.loads(pickle.dumps(limit))
        assert repr(copy) == repr(limit) and getattr(copy, "shapes", None) == getattr(limit, "shapes", None)
