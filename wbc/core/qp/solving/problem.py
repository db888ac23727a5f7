"""The quadratic program (QP) of a tick, in the structured form of whole-body control."""

from __future__ import annotations

import numpy as np

from wbc.base.numbers import Array


class Problem:
    """A QP in arrays of fixed size: least squares with a diagonal, equalities and two-sided inequalities.

        minimise   ½ Σ_soft weight · (row · x − target)²  +  ½ xᵀ diag(diagonal) x  −  linearᵀ x
        subject to row · x = target for the equalities,  lower ≤ row · x ≤ upper for the inequalities

    All rows stand in one array, equalities first, then soft rows, then inequalities: one product with x gives all
    residuals.

    Attributes:
        nv: Number of accelerations, the first variables; contact forces follow.
        na: Number of joints; the first na inequality rows are the torques, less `torque_bias`.
        n_eq: Number of equalities.
        n_soft: Number of soft rows.
        rows: All rows, shape (n_eq + n_soft + n_in, n).
        equality: View of the equalities, shape (n_eq, n).
        soft: View of the soft rows, shape (n_soft, n).
        inequality: View of the inequalities, shape (n_in, n).
        target: Targets of equalities and soft rows, shape (n_eq + n_soft,).
        soft_weight: Weights of the soft rows, shape (n_soft,), ≥ 0.
        diagonal: Shape (n,), ≥ 0.
        linear: Shape (n,).
        linear_and_rows: View of `linear` and, below it, equalities and soft rows, shape (1 + n_eq + n_soft, n).
        torque_bias: Part of the joint torques that does not depend on x, shape (na,): bias forces less outside forces.
        n_physics: Number of equalities, the first ones, that nothing may relax; all of them unless set otherwise.
        hard_tasks: Mask of the equalities that are hard tasks, shape (n_eq,).
        yielding: Order in which inequalities give way where not all can be satisfied, shape (n_in,): first 1, then 2,
            and never 0, as all unless set otherwise.
        empty: Mask of equalities that are 0 = 0, shape (n_eq,): held in reserve, to keep the size fixed; None when
            there are none.
        lower: Lower bounds, shape (n_in,); −inf where there is none.
        upper: Upper bounds, shape (n_in,); inf where there is none.
        contacts: Contact name → its force variables.
        loaded: Contact name → true while the contact is active, an array of shape () that is written at every change.
        equality_groups: Name → equalities, for diagnosis.
        inequality_groups: Name → inequalities, for diagnosis.
    """

    def __init__(self, nv: int, na: int, n: int, n_eq: int, n_soft: int, n_in: int) -> None:
        """Allocate a problem of n variables; see the attributes."""
        self.nv, self.na, self.n_eq, self.n_soft = nv, na, n_eq, n_soft
        everything: Array = np.zeros((1 + n_eq + n_soft + n_in, n))
        self.linear: Array = everything[0]
        self.rows: Array = everything[1:]
        self.linear_and_rows: Array = everything[: 1 + n_eq + n_soft]
        self.equality = self.rows[:n_eq]
        self.soft = self.rows[n_eq : n_eq + n_soft]
        self.inequality = self.rows[n_eq + n_soft :]
        self.target = np.zeros(n_eq + n_soft)
        self.n_physics = n_eq
        self.hard_tasks, self.yielding = np.zeros(n_eq, dtype=bool), np.zeros(n_in, dtype=np.intp)
        self.empty: np.ndarray[tuple[int], np.dtype[np.bool_]] | None = None
        self.soft_weight = np.zeros(n_soft)
        self.diagonal, self.torque_bias = np.zeros(n), np.zeros(na)
        self.lower, self.upper = np.full(n_in, -np.inf), np.full(n_in, np.inf)
        self.contacts: dict[str, slice] = {}
        self.loaded: dict[str, np.ndarray[tuple[()], np.dtype[np.bool_]]] = {}
        self.equality_groups: dict[str, slice] = {}
        self.inequality_groups: dict[str, slice] = {}

    def set_empty(self, rows: slice, mask: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> None:
        """Set which of some equalities are 0 = 0."""
        empty = np.zeros(self.n_eq, dtype=bool) if self.empty is None else self.empty
        empty[rows] = mask
        self.empty = empty if empty.any() else None

    @property
    def equality_target(self) -> Array:
        """Targets of the equalities, shape (n_eq,)."""
        return self.target[: self.n_eq]

    @property
    def torque_matrix(self) -> Array:
        """Rows T with joint torques τ = T x + `torque_bias`, shape (na, n)."""
        return self.inequality[: self.na]

    @property
    def hessian(self) -> Array:
        """H of the standard form ½ xᵀ H x + gᵀ x, shape (n, n); a new array."""
        weighted = self.soft * np.sqrt(self.soft_weight)[:, None]
        hessian: Array = np.dot(weighted.T, weighted)
        hessian.reshape(-1)[:: self.diagonal.size + 1] += self.diagonal
        return hessian

    @property
    def gradient(self) -> Array:
        """Vector g of the standard form, shape (n,); a new array."""
        gradient: Array = np.dot(self.soft_weight * self.target[self.n_eq :], self.soft)
        gradient += self.linear
        return np.negative(gradient, out=gradient)
