"""Values that contacts, limits and controllers refuse: the type of the error and the name of what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

import wbc
from wbc.base.errors import InputError, ModelError, UnknownNameError
from wbc.core.limits.shapes import CollisionSphere
from wbc.core.robot import Robot
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


def again(*items: wbc.TorqueLimits | wbc.JointLimits) -> None:
    balance_controller(g1().clone(), 0.002).add(*items)


REFUSED: list[tuple[Callable[[], object], type[Exception], str]] = [
    (lambda: wbc.Controller(g1(), 0.0), InputError, "dt of Controller"),
    (lambda: wbc.Controller(g1(), 5.0), InputError, "dt of Controller"),
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
    (lambda: Sole("left_foot", min_force=-1.0), InputError, "min_force"),
    (lambda: Sole("left_foot", min_force=10.0, max_force=5.0), InputError, "left_foot"),
    (lambda: Sole("left_foot", ramp=NAN), InputError, "ramp"),
    (lambda: Sole("left_foot", wrench_weight=[1.0, 2.0]), InputError, "left_foot"),
    (lambda: Sole("left_foot", wrench_weight=-1.0), InputError, "left_foot"),
    (lambda: Sole("left_foot", motion_weight=-1.0), InputError, "left_foot"),
    (lambda: Sole("left_foot", margin=0.5).bind(g1()), InputError, "margin"),
    (lambda: Sole("pelvis").bind(g1()), UnknownNameError, "pelvis"),
    (lambda: Point("left_hand", normal=(0.0, 0.0, 0.0)), InputError, "left_hand"),
    (lambda: Point("left_hant").bind(g1()), UnknownNameError, "left_hant"),
    (lambda: wbc.JointLimits(acceleration=-1.0).bind(g1()), InputError, "acceleration"),
    (lambda: wbc.JointLimits(acceleration=[1.0, 2.0]).bind(g1()), InputError, "acceleration"),
    (lambda: wbc.JointLimits(acceleration=5.0, braking=10.0).bind(g1()), InputError, "braking"),
    (lambda: wbc.TorqueLimits(rate=0.0).bind(g1()), InputError, "rate"),
    (lambda: again(wbc.JointLimits(), wbc.JointLimits()), InputError, "joint"),
    (lambda: again(wbc.TorqueLimits(), wbc.TorqueLimits()), InputError, "torque"),
    (lambda: with_limits(1.0, 0.0), ModelError, "position"),
    (lambda: with_limits(NAN, 1.0), ModelError, "position"),
    (lambda: with_limits(0.0, 1.0, -1.0), ModelError, "velocity"),
    (lambda: with_limits(0.0, 1.0, 1.0, NAN), ModelError, "torque"),
    (lambda: wbc.CoMPolygonLimit([[0, 0], [1, 0]]), InputError, "polygon"),
    (lambda: wbc.CoMPolygonLimit([[0, 0], [1, np.nan], [0, 1]]), InputError, "points"),
    (lambda: wbc.CoMPolygonLimit([[0, 0], [1, 0], [1, 0.01], [0, 0.01]], margin=0.01), InputError, "margin"),
    (lambda: wbc.CoMPolygonLimit(time_constant=0.0), InputError, "time_constant"),
    (lambda: pairs("left_hand", "left_hand"), InputError, "left_hand"),
    (lambda: pairs("left_hand", "pelvis", margin=0.2, influence=0.1), InputError, "influence"),
    (lambda: pairs("left_hant", "pelvis", shapes={"pelvis": BALL}).bind(g1()), UnknownNameError, "left_hant"),
]


@pytest.mark.parametrize(("make", "kind", "named"), REFUSED)
def test_a_value_that_cannot_be_used_is_refused(
    make: Callable[[], object], kind: type[Exception], named: str
) -> None:
    with pytest.raises(kind, match=named):
        make()
