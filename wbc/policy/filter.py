"""Filter of a policy: the torques that it asks for, as near to them as the limits of the robot allow.

    min Σ u²  over the torques of the arms  τ = τ_policy + τ_max u,    τ_policy = kp (q* − q) − kd v

    subject to limits of torques, limits of joints, collisions and obstacles on the accelerations M⁻¹ (τ − b), and
    dL/dt ≤ min(R, R − L / t), and so below, of the angular momentum L of the arms about the base

With the base, legs and waist as measured (see `wbc.policy.arms`), the inertia M of the arms and their bias b are all
that is left of the robot. Limits that contradict each other give way in an order: the bound on the reaction first,
then collisions and further limits, those of joints last, and those of torques never. Limits of one rank share a
violation by least squares, each over the length of its row.

The arms alone may pay for a collision. Filters that let legs and waist pay made the robot fall, whatever they knew of
the contacts of the feet. Each joint of legs and waist is braked at its stops by itself,

    τ ≤ τ_max ((q_max − q) − t v) / d,    and so below.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Annotated

import daqp
import numpy as np
from scipy.linalg.lapack import dgesv, dposv

from wbc.base.checked import checked
from wbc.base.errors import InputError, NoSolutionError, names_in
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Positive, Ratio
from wbc.core.limits.base import ATTAINABLE, Limit, cut_demands
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.qp.controller import Controller
from wbc.core.qp.items import Item
from wbc.core.qp.released import ReleasedJoints
from wbc.core.qp.task import Task
from wbc.core.signals import Measurement
from wbc.policy.arms import PolicyArms

REACTION = 0.6
"""Default of the greatest reaction of the arms over the mass of the robot, Nm/kg. Walks of a G1 with pushes of 0.7
Ns/kg have 0.5, arms that are thrown about have 3."""

LASTS = 0.04
"""Time for which the greatest reaction accelerates arms from rest to their greatest angular momentum, s. With the
default reaction this momentum is 0.024 Nms/kg. From there to the opposite one the trunk takes a quarter of what a push
of 0.7 Ns/kg gives it 0.3 m above the pelvis. Policies survive such pushes, and in their walks arms have 0.01 Nms/kg."""

RELAXED = 1e-2
"""Violation from which on limits count as relaxed, rad/s²."""

SPARED, LATE = 5e-3, 0.02
"""Distance from its stop at which an arm comes to rest that was too fast, rad, and time by which it brakes early, s:
what is known of the motion of the trunk lags behind."""

REACH, AHEAD = 0.1, 0.05
"""Distance d from a stop of legs and waist at which they are braked, rad, and time t that they look ahead, s."""


@checked
@dataclass(frozen=True, eq=False)
class PolicyFilter:
    """Filter of a policy: limits that its torques keep, where the torques of some joints, the arms, give way.

        hands = CollisionLimit("all", shapes=description.collision_shapes(), recovery=100.0, influence=0.5)
        policy = PolicyControl(robot, "policy.onnx", dt, filter=PolicyFilter(robot.joint_names[15:], [hands]))

    Attributes:
        arms: Names of joints whose torques give way; not of a leg.
        limits: Further limits; those of joints and torques are there already. A `CollisionLimit` brakes fast arms in
            time with recovery=100 and influence=0.5.
        speed: Greatest speed of the arms over that of the model. Collision limits do not stop faster arms in time.
        margin: Distance that the arms keep from their stops, rad.
        reaction: Greatest moment about each axis of the base that may accelerate the arms, Nm; 0.6 Nm/kg times the mass
            of the robot when None. More than that throws the trunk about, and the policy falls.
    """

    arms: Sequence[str]
    limits: Sequence[Limit] = ()
    _: KW_ONLY
    speed: Ratio = 0.25
    margin: Annotated[NonNegative, "rad"] = 0.03
    reaction: Annotated[Positive, "Nm"] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "arms", tuple(names_in("arms of a filter", self.arms)))
        object.__setattr__(self, "limits", tuple(self.limits))

    def bind(self, controller: Controller) -> FilteredArms:
        """Add the filter to a controller of its own."""
        joint_limits = JointLimits(velocity_ratio=self.speed, margin=self.margin, joints=self.arms)
        most = REACTION * controller.robot.mass if self.reaction is None else self.reaction
        return FilteredArms(controller, self.arms, (joint_limits, TorqueLimits(), *self.limits), most)


class TasklessController(Controller):
    """Controller of a policy whose arms no QP moves: it holds the limits of a filter, and no tasks."""

    def _check_together(self, new: Sequence[Item]) -> None:
        if any(isinstance(item, Task) and not isinstance(item, ReleasedJoints) for item in new):
            raise InputError("a policy without arms=… of the QP has no tasks; its filter keeps limits")
        super()._check_together(new)


class FilteredArms(PolicyArms):
    """Arms whose torques are those of a policy, as near as limits allow."""

    otherwise = "not filtered"

    def __init__(
        self, controller: Controller, joints: Sequence[str], limits: Sequence[Limit], reaction: float
    ) -> None:
        """Add the limits; the reaction is the greatest moment about each axis of the base, Nm."""
        super().__init__(controller, joints)
        controller.add(*limits)
        robot, n = controller.robot, self.index.size
        self._slope = robot.torque_limit / REACH
        columns = self.index + robot.base_dof
        together = bool((np.diff(columns) == 1).all())  # a slice takes NumPy a third of the time
        self._columns = slice(columns[0], columns[-1] + 1) if together else columns
        self._per_share = robot.torque_limit[self.index]
        self._stops = robot.position_lower[self.index], robot.position_upper[self.index]
        self._acceleration = np.zeros(robot.nv)
        self._carried_rows = np.zeros((6, robot.nv)), np.zeros(6), np.zeros(6)
        self._cost, self._reaction = (np.eye(n), np.zeros(n)), reaction

    def reset(self) -> None:
        """See `PolicyArms.reset`."""
        super().reset()
        self._made: Array | None = None  # torques of the last tick, shape (na,), Nm
        self._limits: tuple[Limit, ...] | None = None  # for which there is room

    def forget_rate(self) -> None:
        """See `PolicyArms.forget_rate`; torques and inertia of the last filtered tick are not those before the next."""
        super().forget_rate()
        self._made = self._limits = None  # room for limits has the inertia of the next tick

    def _place(self, limits: tuple[Limit, ...]) -> None:
        """Make room for the rows of limits."""
        self._limits, robot = limits, self.controller.robot
        self._torque_limits = next((limit for limit in limits if isinstance(limit, TorqueLimits)), None)
        others = [limit for limit in limits if limit is not self._torque_limits]
        others.sort(key=lambda limit: not isinstance(limit, JointLimits))  # by rank
        n = sum(limit.dim for limit in others)
        of_joints = sum(limit.dim for limit in others if isinstance(limit, JointLimits))
        self._ranks = np.array([0, of_joints, n, n + 3])  # rows of joints, of further limits, of the reaction
        self._rows = np.zeros((n + 3, robot.nv))
        self._rows[-3:, self._columns] = robot.mass_matrix[3:6, self._columns]
        self._lower, self._upper = np.full(n + 3, -np.inf), np.full(n + 3, np.inf)
        self._blocks, stop = [], 0
        for limit in others:
            rows = slice(stop, stop := stop + limit.dim)
            self._blocks.append((limit, self._rows[rows], self._lower[rows], self._upper[rows]))

    def servos(self, measurement: Measurement, target: Array, asked: Array) -> tuple[Array, Array, Array]:
        """See `PolicyArms.servos`; with the returned values the servos make the torques of the filter.

        The servos of the arms are those of the policy about what they do now: until the next tick they change as they
        would about its targets.
        """
        index, target, velocity = self.index, target.copy(), np.zeros_like(target)
        torque = self.near(measurement, asked)
        self.changed = torque - asked
        feed = self.changed.copy()
        feed[index], target[index], velocity[index] = (
            each[index] for each in (torque, measurement.joint_position, measurement.joint_velocity)
        )
        return feed, target, velocity

    def near(self, measurement: Measurement, asked: Array) -> Array:
        """Return the torques of all joints nearest to those of the policy, both of shape (na,), Nm.

        Where the QP has no solution the torques are those of the policy, within their limits, as of joints by
        themselves.
        """
        robot, index = self.controller.robot, self.index
        if (limits := self.controller.limits) != self._limits:
            self._place(limits)
        least, most = robot.torque_lower, robot.torque_upper
        ahead = robot.q[robot.base_nq :] + AHEAD * robot.v[robot.base_dof :]
        torques = np.minimum(asked, self._slope * (robot.position_upper - ahead))
        np.maximum(torques, self._slope * (robot.position_lower - ahead), out=torques)
        np.minimum(np.maximum(torques, least, out=torques), most, out=torques)
        if self._torque_limits is not None:
            least, most = self._torque_limits.interval(self.controller.dt, self._made)
        bounds = least.take(index), most.take(index)
        arms = self._tried(self._solve, measurement, torques.take(index), bounds)
        if arms is None:
            self._limits = None  # rows that have not been written have the inertia of an earlier tick
        else:
            torques[index] = arms
        self._made = torques.copy()
        return torques

    def _stop(self, limits: JointLimits, lower: Array, upper: Array) -> None:
        """Let arms that have become too fast for the braking of their limits brake as hard as it takes."""
        robot, arms, (low, high) = self.controller.robot, self.index, self._stops
        q, v = robot.q[robot.base_nq :].take(arms), robot.v[self._columns]
        room = np.where(v > 0.0, high - q, q - low) - SPARED
        needed = 0.5 * v * v / np.maximum(room - LATE * np.abs(v), SPARED)
        for k in (needed > limits.braking.take(arms)).nonzero()[0].tolist():
            row, most = arms.item(k), needed.item(k)
            if v.item(k) > 0.0:  # bounds that cross would have no solution
                upper[row] = min(upper.item(row), -most)
                lower[row] = min(lower.item(row), upper.item(row))
            else:
                lower[row] = max(lower.item(row), most)
                upper[row] = max(lower.item(row), upper.item(row))

    def _solve(self, measurement: Measurement, wish: Array, bounds: tuple[Array, Array]) -> Array:
        """Return the torques of the arms nearest to those that the policy wishes, within bounds.

        All are of shape (number of joints,), Nm.
        """
        columns, unit, (least, most) = self._columns, self._per_share, bounds
        per_share = self._move(measurement, wish)
        self._write_limits()
        chosen = ((self._lower > -np.inf) | (self._upper < np.inf)).nonzero()[0]
        rows = self._rows.take(chosen, axis=0)
        wished = rows.dot(self._acceleration)
        lower = np.concatenate([(least - wish) / unit, self._lower.take(chosen) - wished])
        upper = np.concatenate([(most - wish) / unit, self._upper.take(chosen) - wished])
        self.remark = ""
        if (lower <= 0.0).all() and (upper >= 0.0).all():
            return wish
        matrix = rows[:, columns].dot(per_share)
        ranks = np.array(sorted({*(unit.size + chosen.searchsorted(self._ranks)).tolist()}), dtype=np.intc)
        sense = np.zeros(lower.size, dtype=np.intc)
        x, _, flag, _ = daqp.solve(*self._cost, matrix, upper, lower, sense, break_points=ranks)
        if flag < 1:
            raise NoSolutionError(f"DAQP ends with {flag}")
        made = matrix.dot(x)
        over = np.maximum(made - upper[unit.size :], lower[unit.size :] - made)[:-3]  # but for the reaction
        if over.size and over[over.argmax()] > RELAXED:
            self.remark = "relaxed: limits of the arms cannot all be kept"
        return np.asarray(wish + unit * x)

    def _move(self, measurement: Measurement, wish: Array) -> Array:
        """Write the accelerations of the robot under the torques of a wish, shape (number of joints,), Nm.

        Returns:
            Accelerations of the arms by their torques as shares of the greatest ones, rad/s²; a column for each joint.
        """
        controller, robot, columns = self.controller, self.controller.robot, self._columns
        acceleration, base = self._acceleration, robot.base_dof
        acceleration[self._others.columns] = self._others.feedforward_acceleration
        acceleration[:base] = acceleration[columns] = 0.0
        jacobian, error, drift = self._carried_rows
        self._carried.measured(measurement)
        self._carried.evaluate(jacobian, error, drift)
        drift += jacobian.dot(acceleration)
        *_, acceleration[:base], singular = dgesv(jacobian[:, :base], -drift)
        inertia = robot.mass_matrix[columns]  # of the arms, by all joints
        _, per_torque, indefinite = dposv(inertia[:, columns], self._cost[0])
        if singular or indefinite:
            raise NoSolutionError("the inertia of the arms is singular")
        bias = robot.bias[columns] + inertia.dot(acceleration)
        if controller.outside is not None:
            bias -= controller.outside[columns]
        acceleration[columns] = per_torque.dot(wish - bias)
        per_torque *= self._per_share
        return np.asarray(per_torque)

    def _write_limits(self) -> None:
        """Write the rows of all limits, and those of the reaction of the arms on the base."""
        dt, robot, columns = self.controller.dt, self.controller.robot, self._columns
        for limit, matrix, lower, upper in self._blocks:
            limit.write(dt, matrix, lower, upper)
            cut_demands(ATTAINABLE, matrix, lower, upper)
            if isinstance(limit, JointLimits):
                self._stop(limit, lower, upper)
        turning, turned, speed = robot.mass_matrix[3:6, columns], self._rows[-3:, columns], robot.v[columns]
        share = turning.dot(speed) / (self._reaction * LASTS)  # of the greatest momentum
        turns = (turning - turned).dot(speed) / dt  # rate of the momentum at no acceleration
        self._lower[-3:] = self._reaction * np.minimum(1.0, np.maximum(-1.0, -1.0 - share)) - turns
        self._upper[-3:] = self._reaction * np.maximum(-1.0, np.minimum(1.0, 1.0 - share)) - turns
        self._rows[-3:, columns] = turning
