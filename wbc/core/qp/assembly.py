"""Assembly of the QP of accelerations: dynamics, forces of contacts, and references of tasks.

Variables are the generalised accelerations a (base, joints) and the contact wrenches f, each in its contact frame.
Torques are eliminated: τ = M_j a + h_j − J_jᵀ f, so that their limits are rows of the QP.

    minimise   ½ Σ weight · (J a − reference)²  +  ½ Σ wrench weight · f²  +  ½ regularisation · a²
    subject to M_b a − J_bᵀ f = −h_b                      the floating base has no motor
               J_c a = −J̇_c v − damping · J_c v + …       a contact stays where it is (or f = 0); a cost if it may yield
               hard tasks
               τ, joint accelerations, wrench cones, collisions … within their bounds

The rows have fixed places, see `wbc.core.qp.store`: a contact that is switched changes values, not sizes.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import UnknownNameError
from wbc.base.numbers import Array
from wbc.core.limits.base import Limit
from wbc.core.limits.joint import TorqueLimits
from wbc.core.qp.contact import Contact
from wbc.core.qp.motion import Block
from wbc.core.qp.released import ReleasedJoints
from wbc.core.qp.solving.solution import Layout
from wbc.core.qp.store import NOTHING, RowStore, rows_in
from wbc.core.qp.task import Task
from wbc.core.robot import Robot

logger = logging.getLogger(__name__)


@dataclass(slots=True)
class _Force:
    """Views of the numbers of a contact's force in the QP."""

    loaded: NDArray[np.bool_]  # true while the contact is active, shape ()
    columns: slice  # its variables among all contact forces
    weight: Array
    equalities: Array  # those of the contact, over its own force
    cone: Array  # the cone rows, over its own force
    cone_upper: Array
    lower: Array  # of the components that have a range
    upper: Array


class Assembly(RowStore):
    """The QP of some tasks, contacts and limits; made anew when one is added or removed.

    Attributes:
        layout: Names and places of everything in a solution.
        torque_rows: Rows of the problem that are the joint torques, less the bias.
        listening: Tasks that read the sensors.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Sequence[Task],
        contacts: Sequence[Contact],
        limits: Sequence[Limit],
        regularisation: float,
    ) -> None:
        """Allocate the problem and place these items, which are bound to the robot."""
        super().__init__(robot, [tasks], contacts, limits, 2)
        self._regularisation, self._mass_carried = regularisation, robot.mass
        self._torque_limits = next((limit for limit in limits if isinstance(limit, TorqueLimits)), None)
        self.listening = [task for task in tasks if task.listens]
        p, nv, base = self.problem, robot.nv, robot.base_dof
        self._base, self._passive = slice(0, base), robot.passive
        self._passive_rows = slice(base, self._start)
        if robot.floating:
            p.equality_groups["floating-base dynamics"] = self._base
        if robot.passive.size:
            p.equality_groups["joints without a drive"] = self._passive_rows
        self._place_forces()
        self._bound = [block for block in self._on_variables if self._find_variables(block)]

        # Views of the dynamics, [M, −Jᵀ], split into the base (equalities) and the joints (torque rows).
        mass = robot.mass_matrix.T  # symmetric, stored by columns: the transpose is contiguous by rows
        self._mass = mass[:base], mass[base:]
        self._bias = robot.bias[:base], robot.bias[base:]
        self._base_mass, self._base_force = p.equality[self._base, :nv], p.equality[self._base, nv:]
        self._joint_mass, self._joint_force = (
            p.inequality[self._torques, :nv],
            p.inequality[self._torques, nv:],
        )
        held = slice(self._start, self._start + rows_in(contacts))
        # Jacobians of forces on base and joints, each with its place: of all contacts in the equalities at once, and of
        # each one that may yield.
        jacobians = [(p.equality[held, :nv], slice(None))]
        yielding = [(block.jacobian, block.force.columns) for block in self._contacts if block.item._yields]
        jacobians = yielding if len(yielding) == len(contacts) else jacobians + yielding
        self._forces = [
            (rows[:, part].T, force[:, columns])
            for rows, columns in jacobians
            for part, force in ((slice(0, base), self._base_force), (slice(base, nv), self._joint_force))
        ]
        self._torque_lower, self._torque_upper = p.lower[self._torques], p.upper[self._torques]
        self._of_joints = [(p.lower[rows], p.upper[rows]) for rows in (self._torques, self._joints)]
        self._stored = slice(self._start, p.target.size)
        self._matrix, self._references = p.rows[self._stored, :nv], self.targets[self._start :]
        self._velocity = np.zeros(self._references.size)
        n = p.target.size - self._start
        self._stored_velocity, self._selected_velocity = self._velocity[:n], self._velocity[n:]
        self.torque_rows = slice(p.target.size, p.target.size + robot.na)
        units = {task.name: task.residual_unit for task in tasks}
        self.layout = Layout(nv, p.contacts, self.places, units, self.names)

    def _place_forces(self) -> None:
        """Place the forces of contacts: their variables, cones and ranges."""
        p, nv = self.problem, self._robot.nv
        column, row = nv, self._cones.start
        for block in self._contacts:
            contact, ranged = block.item, list(block.item.ranged)
            columns, cone = slice(column, column + contact.dim), slice(row, row + contact.cone.shape[0])
            normal = slice(cone.stop, cone.stop + len(ranged))
            column, row = columns.stop, normal.stop
            p.inequality[normal, columns][:, ranged] = np.eye(len(ranged))
            p.contacts[contact.name], p.loaded[contact.name] = columns, np.array(contact.active)
            p.inequality_groups[f"wrench cone of contact '{contact.name}'"] = slice(cone.start, normal.stop)
            block.force = _Force(
                loaded=p.loaded[contact.name],
                columns=slice(columns.start - nv, columns.stop - nv),
                weight=p.diagonal[columns],
                equalities=p.equality[block.reserved, columns],
                cone=p.inequality[cone, columns],
                cone_upper=p.upper[cone],
                lower=p.lower[normal],
                upper=p.upper[normal],
            )

    def _find_variables(self, block: Block) -> bool:
        """Bind a task on all variables; return False, and leave its rows empty, where its contact is not there."""
        task = block.item
        try:
            task.bind_problem(self.problem)
        except UnknownNameError:
            logger.warning("task '%s' has no effect: its contact is not in the controller", task.name)
            if block.reserved is not None:
                self.problem.set_empty(block.reserved, np.ones(task.dim, dtype=bool))
            return False
        return True

    # ---- the tick -----------------------------------------------------------------------------------------------

    def write(
        self,
        dt: float,
        torques: Array | None,
        outside: Array | None = None,
        released: ReleasedJoints | None = None,
    ) -> None:
        """Write the present state of robot, tasks, contacts and limits into the problem.

        Args:
            dt: Control period, s.
            torques: Torques of the last tick, shape (na,), Nm; None at the first one.
            outside: Generalised forces of the surroundings beside the contacts, shape (nv,).
            released: Joints that somebody else moves, within limits of their own.
        """
        if self._robot.mass != self._mass_carried:  # greatest forces may be multiples of the weight
            self._mass_carried = self._robot.mass
            for block in self._contacts:
                block.revision = -1
        self._fill()
        self._write_dynamics(outside)
        self._write_references()
        self._write_diagonal(self._regularisation)
        self._write_limits(dt, torques, released)

    def _take_contact(self, block: Block, engaged: bool) -> None:
        """Take motion and forces of a contact over; see `RowStore`."""
        contact, force = block.item, block.force
        if engaged != block.engaged:
            force.equalities[:] = 0.0 if engaged else np.eye(contact.dim)
            # A contact that is off has zero force: its cone rows are moved off their bounds, where they would all be
            # active at once.
            force.cone_upper[:] = 0.0 if engaged else 1.0
        super()._take_contact(block, engaged)
        force.loaded[...] = contact.active
        force.cone[:], force.weight[:] = contact.cone, contact.wrench_weight
        force.lower[:], force.upper[:] = contact.force_ranges() if engaged else (-1.0, 1.0)

    def _write_dynamics(self, outside: Array | None) -> None:
        """Write the dynamics of base and joints, and the forces of contacts and surroundings on them."""
        base, p = self._base.stop, self.problem
        self._base_mass[:], self._joint_mass[:] = self._mass
        np.negative(self._bias[0], out=p.target[:base])
        p.torque_bias[:] = self._bias[1]
        if outside is not None:
            p.target[:base] += outside[:base]
            p.torque_bias -= outside[base:]
        for jacobian_t, force in self._forces:
            np.negative(jacobian_t, out=force)
        if self._passive.size:  # no torque: equalities, in place of bounds
            p.equality[self._passive_rows] = p.inequality[self._passive]
            p.target[self._passive_rows] = -p.torque_bias[self._passive]

    def _write_references(self) -> None:
        """Write the reference accelerations: feed-forward, PD on error and velocity, minus drift."""
        v, rows, velocity, out = self._robot.v, self._numbers, self._velocity, self._references
        self._matrix.dot(v, out=self._stored_velocity)
        # With the default mode NumPy writes into a buffer first.
        v.take(self._columns, out=self._selected_velocity, mode="clip")
        np.subtract(rows.velocity, velocity, out=out)
        out *= rows.damping
        out += np.multiply(rows.stiffness, self._bounded_error(), out=velocity)
        out += rows.acceleration
        out -= self._drift
        for block in self._bound:
            block.item.evaluate(block.jacobian, block.error, NOTHING)
            if block.item.revision != block.revision:
                self._take(block)
            if block.reserved is not None:
                nothing = ~block.jacobian.any(axis=1) & (block.error == 0.0)
                self.problem.set_empty(block.reserved, nothing)

    def _write_limits(self, dt: float, torques: Array | None, released: ReleasedJoints | None) -> None:
        """Write the bounds of torques, of joints and of all other limits."""
        bias = self.problem.torque_bias
        if self._torque_limits is not None:
            lower, upper = self._torque_limits.interval(dt, torques)
            np.subtract(lower, bias, out=self._torque_lower)
            np.subtract(upper, bias, out=self._torque_upper)
        if self._passive.size:
            self._torque_lower[self._passive], self._torque_upper[self._passive] = -np.inf, np.inf
        for limit, matrix, lower, upper in self._limits:
            limit.write(dt, matrix, lower, upper)
        if released is not None:
            for lower, upper in self._of_joints:
                if lower.size:
                    lower[released.index], upper[released.index] = -np.inf, np.inf
        if self._demands:
            self._cut_demands()

    def kept(
        self, torques: Array, dt: float, previous: Array | None, released: ReleasedJoints | None
    ) -> Array:
        """Return torques within their limits, shape (na,), Nm, after those of the last tick; released have none."""
        if self._torque_limits is None:
            return torques
        lower, upper = self._torque_limits.interval(dt, previous)
        kept = np.minimum(np.maximum(torques, lower), upper)  # in a third of the time of `np.clip`
        if released is not None:
            kept[released.index] = torques[released.index]
        return kept
