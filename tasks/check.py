"""Check of tasks, contacts and limits of one's own: rows against finite differences, bounds that agree."""

from __future__ import annotations

import copy

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import Period, Seed
from wbc.core.limits.base import Barrier, Limit
from wbc.core.limits.collision import CollisionLimit
from wbc.core.limits.frame import FLAT, AxisConeLimit
from wbc.core.limits.joint import TorqueLimits
from wbc.core.limits.pairs import random_joints
from wbc.core.qp.contact import Contact
from wbc.core.qp.items import bind
from wbc.core.qp.task import Task
from wbc.core.robot import Robot

STEP = 1e-6
"""Step of the differences: of each coordinate, rad or m, and of the motion, s."""

TOLERANCE = 1e-5
"""Largest difference, relative to the greatest number of the rows where that is above 1."""

STATES = 50
"""Number of states in which a limit is looked at."""

KINK = 1e-3
"""Relative change of a derivative within a step of the differences, from which on a coordinate has a kink there."""


@checked
def check_rows(
    item: Task | Contact | Limit,
    robot: Robot,
    *,
    frame: str | None = None,
    partial: bool = False,
    dt: Period = 0.005,
    seed: Seed = 0,
) -> None:
    """Check the rows of a task, contact or limit at random states of a robot, in motion.

        check_rows(MyTask("head"), description.robot())

    These properties are checked by finite differences. The derivative of the error of a task or contact is −J v, and
    the derivative of J v at constant v is the drift. The error of a task on velocities, such as a momentum, is target −
    J v. The lower bound of a limit is never above its upper bound. The rows of a `Barrier` are the derivatives of its
    coordinates, and its drift is the change of their velocities at constant v; a `CollisionLimit` measures
    pairs that are far apart only when they may come near, so its rows are not compared. Nor are those of an
    `AxisConeLimit` near the opposite direction, where it follows the direction of the angle no further.

    A copy of the task is bound at each random state, as a controller would do it. A target that is not given is then
    the present state. For rotations this matters, because J is the derivative of their error only at the target.

    Args:
        item: Task, contact or limit that is not yet added to a controller.
        robot: The robot; only a copy of it is moved.
        frame: Frame along whose axes the rows are, in groups of three; None if the rows are along fixed axes.
        partial: True for a task that does not use all joints: columns of zeros and the drift are then not compared.
        dt: Control period of a limit, s.
        seed: Seed of the random states.
    """
    robot, random = robot.clone(), np.random.default_rng(seed)
    if (item.owner if isinstance(item, Limit) else item._robot) is not None:
        raise InputError(
            f"'{item.name}' must be checked before it is added to a controller; make another one"
        )
    if isinstance(item, Limit):
        _check_limit(item, robot, dt, random)
        return
    if frame is not None and item.dim % 3:
        raise InputError(
            f"rows along the axes of '{frame}' must come in threes, '{item.name}' has {item.dim}"
        )
    item = copy.deepcopy(item)  # its filters and integrators stay as they are
    q, v = _random_state(robot, random)
    robot.update(q, v)
    bind(item, robot)
    jacobian, error, drift = item.evaluated()
    robot.update(q, np.zeros(robot.nv))
    at_rest = item.evaluated()[1]
    if _close(at_rest, error):
        _check_jacobian(item, robot, q, v, partial=partial)
    else:
        _compare(item, "change of the error with the velocity", error - at_rest, -jacobian @ v)
    if partial:
        return
    turns = robot.placement(frame).rotation.copy() if frame is not None else None
    ends = []
    for step in (STEP, -STEP):
        robot.update(pin.integrate(robot.model, q, step * v), v)
        velocity = item.evaluated()[0] @ v
        if frame is not None and turns is not None:  # along the axes as they were
            change = turns.T @ robot.placement(frame).rotation
            velocity = (velocity.reshape(-1, 3) @ change.T).reshape(-1)
        ends.append(velocity)
    _compare(item, "drift", drift, (ends[0] - ends[1]) / (2.0 * STEP))


def _check_limit(limit: Limit, robot: Robot, dt: float, random: np.random.Generator) -> None:
    bind(limit, robot)
    for _ in range(STATES):
        q, v = _random_state(robot, random)
        if isinstance(limit, Barrier) and not isinstance(limit, CollisionLimit):
            _check_barrier(limit, robot, q, v)
        robot.update(q, v)
        # Those of torque limits are the torques of the QP.
        rows = np.full((limit.dim, robot.nv), 1.0 if isinstance(limit, TorqueLimits) else np.nan)
        lower, upper = np.full(limit.dim, np.nan), np.full(limit.dim, np.nan)
        limit.write(dt, rows, lower, upper)
        still = ~np.abs(rows).any(axis=1) & (
            not isinstance(limit, Barrier)
        )  # whose demands a solver cuts off
        for what, wrong in (
            ("row that is not finite", ~np.isfinite(rows).all(axis=1)),
            ("bound that is NaN", np.isnan(lower) | np.isnan(upper)),
            ("lower bound above the upper one", lower > upper),
            ("row of zeros whose bounds zero does not keep", still & ((lower > 0.0) | (upper < 0.0))),
        ):
            if wrong.any():
                row = int(np.argmax(wrong))
                raise InputError(
                    f"limit '{limit.name}' has a {what}: row {row}, from {lower[row]:.6g} to {upper[row]:.6g}"
                )


def _check_barrier(limit: Barrier, robot: Robot, q: Array, v: Array) -> None:
    """Compare speeds and drift of coordinates with differences along a motion, but not across their kinks."""
    ends = []
    for step in (-STEP, 0.0, STEP):
        robot.update(pin.integrate(robot.model, q, step * v), v)
        rows = np.zeros((limit.dim, robot.nv))
        below, above = np.zeros((2, limit.dim))
        limit.measure(rows, below, above)
        found = limit.drift()
        drift = np.zeros(limit.dim) if found is None else found
        if drift.shape != (limit.dim,):
            raise InputError(
                f"drift of limit '{limit.name}' must have shape ({limit.dim},), got {drift.shape}"
            )
        if (crossed := below + above < 0.0).any():
            row = int(np.argmax(crossed))
            raise InputError(
                f"limit '{limit.name}' has a lower bound above the upper one: row {row}, by {-(below + above)[row]:.6g}"
            )
        ends.append((below, -above, rows @ v, drift))
    if isinstance(limit, AxisConeLimit) and limit._sine <= FLAT:
        return
    before, here, after = ends
    for what, given, index in (
        ("speed of the coordinate by its lower bound", here[2], 0),
        ("speed of the coordinate by its upper bound", here[2], 1),
        ("drift", here[3], 2),
    ):
        with np.errstate(invalid="ignore"):  # where there is no bound
            one, other = (here[index] - before[index]) / STEP, (after[index] - here[index]) / STEP
        smooth = np.abs(one - other) <= KINK * np.maximum(1.0, np.abs(one))
        _compare(limit, what, given[smooth], 0.5 * (one + other)[smooth])


def _check_jacobian(item: Task | Contact, robot: Robot, q: Array, v: Array, *, partial: bool) -> None:
    """Compare the Jacobian with the derivative of the error, column by column."""
    robot.update(q, v)
    jacobian, error, _ = item.evaluated()
    hint = "" if _close(error, np.zeros_like(error)) else "; its target is not where the robot is: give none"
    axes = ("x", "y", "z", "roll", "pitch", "yaw") if robot.floating else ()
    names = [f"{axis} of the base" for axis in axes]
    for column, name in enumerate([*names, *robot.joint_names]):
        if partial and not jacobian[:, column].any():
            continue
        move, ends = np.zeros(robot.nv), []
        for step in (STEP, -STEP):
            move[column] = step
            robot.update(pin.integrate(robot.model, q, move), v)
            ends.append(item.evaluated()[1])
        _compare(item, f"Jacobian by {name}", jacobian[:, column], (ends[1] - ends[0]) / (2.0 * STEP), hint)


def _compare(item: Task | Contact | Limit, what: str, given: Array, found: Array, hint: str = "") -> None:
    """Refuse rows that are not what finite differences say."""
    if given.size and not _close(given, found):
        row = int(np.abs(given - found).argmax())
        raise InputError(
            f"'{item.name}': {what} is {given[row]:.6g} in row {row}, finite differences give {found[row]:.6g}"
            f"{hint}"
        )


def _close(one: Array, other: Array) -> bool:
    scale = max(1.0, float(np.abs(other).max()))
    return bool(np.abs(one - other).max() <= TOLERANCE * scale)


def _random_state(robot: Robot, random: np.random.Generator) -> tuple[Array, Array]:
    """Return a configuration anywhere in the world, joints well inside of their limits, and a velocity."""
    q = np.array(robot.half_sitting)
    if robot.floating:
        q[:3] = random.normal(size=3)
        q[3:7] = pin.Quaternion(pin.exp3(random.normal(size=3))).coeffs()
    q[robot.base_nq :] = random_joints(robot, random, room=0.2)
    return q, random.normal(size=robot.nv)
