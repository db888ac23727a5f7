"""Limits of joints.

Position, velocity and acceleration bounds of a joint are merged into one interval of its acceleration, which is
never empty. A joint that starts outside its limits is brought back instead of making the QP infeasible.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.base.checked import checked, result
from wbc.base.errors import InputError, names_in
from wbc.base.numbers import Array, scalar
from wbc.base.settings import NonNegative, PositiveNumbers, Ratio
from wbc.core.limits.base import OPTIONS, Limit, for_joints
from wbc.core.robot import Robot

BRAKING_SHARE = 0.3
"""Share of a torque limit that brakes a joint before its bounds: the rest is left for gravity and contact forces."""

RECOVERY_TIME = 0.1
"""Time constant with which a violated bound is approached again, s."""

LONGEST_STEP = 0.5
"""Greatest step of a joint in a search of inverse kinematics, rad or m: its rows are of the first order."""

_ZERO = scalar(0.0)


class BrakingLaw:
    """Law of the greatest velocity at the end of a period after which braking still keeps a bound.

    Where ā is zero, nothing can brake, and no velocity is bounded.

    The acceleration is held over one control period. After it, with velocity v⁺ and distance d⁺ left, the state must
    be viable: v⁺² ≤ 2 ā d⁺ for v⁺ > 0. If the joint has to turn round within the period, the point where it turns
    must not lie beyond the bound. From a viable state no more than the deceleration ā is ever needed. Beyond the
    bound, the joint is brought back, at its greatest velocity at most.

    Source: Del Prete, "Joint position and velocity bounds in discrete-time acceleration/torque control of robot
    arms", RA-L 3(1), 2018, section IV; the case of turning within the period is ours.
    """

    def __init__(self, braking: Array, dt: float, fastest: ArrayLike = np.inf) -> None:
        """Prepare for a deceleration ā, rad/s², that is always available, a period, s, and velocities, rad/s."""
        self._dt = dt
        self._helpless = None if (braking > 0.0).all() else braking <= 0.0
        self._back = np.broadcast_to(np.negative(fastest), braking.shape).reshape(-1)
        # v⁺² = 2 ā (d − (v + v⁺) dt/2), solved for v⁺, is √(2 ā d − ā dt v + (ā dt/2)²) − ā dt/2.
        self._per_distance, self._per_velocity = 2.0 * braking, braking * dt
        self._half = 0.5 * dt * braking
        self._square = self._half * self._half
        self._final, self._product = np.zeros_like(self._half), np.zeros_like(self._half)
        self._flat = self._final.reshape(-1)

    def __call__(self, distance: Array, velocity: Array) -> Array:
        """Return the upper bound of the velocity v⁺ towards the bound, rad/s; overwritten by the next call.

        The distance to the bound, rad, is negative beyond it; the velocity is towards it, rad/s.
        """
        final = self._final
        if self._helpless is not None:
            distance = np.where(self._helpless, 0.0, distance)  # which may be infinite
        np.multiply(self._per_distance, distance, out=final)
        final -= np.multiply(self._per_velocity, velocity, out=self._product)
        flat = self._flat
        # Otherwise a bound is too near to stop before the period ends, or has been crossed.
        near = not flat[flat.argmin()] >= 0.0
        final += self._square
        if near:
            np.maximum(final, _ZERO, out=final)
        np.sqrt(final, out=final)
        final -= self._half
        if near:
            for i in (flat < 0.0).nonzero()[0].tolist():
                d, v = distance.item(i), velocity.item(i)
                turned = v - v * abs(v) * (0.5 * self._dt) / max(d, 1e-12)
                flat[i] = max(turned if d > 0.0 else d / RECOVERY_TIME, self._back.item(i))
        if self._helpless is not None:
            final[self._helpless] = np.inf
        return final


def stopping_velocity(distance: Array, braking: Array, dt: float) -> Array:
    """Return the greatest velocity of a period after which a joint can stop within a distance.

    Velocities are held for a period, v, then v − ā dt, v − 2 ā dt …: with n = ⌊v / (ā dt)⌋ and the rest r, the way is
    ā dt² (n + 1) (n / 2 + r). Solved for v, n is ⌊(√(1 + 8 d) − 1) / 2⌋ with d the distance over ā dt².

    Args:
        distance: Distance left, ≥ 0, rad.
        braking: Deceleration ā that is always available, rad/s².
        dt: Period, s.

    Returns:
        Velocities, rad/s, of the shape of the distances.
    """
    step = braking * dt
    periods = np.minimum(distance / (step * dt), 1e15)
    whole = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * periods) - 1.0))
    return np.asarray(step * (whole + periods / (whole + 1.0) - 0.5 * whole))


class JointLimits(Limit):
    """Bounds of the position, velocity and acceleration of every actuated joint, as one interval of its acceleration.

    In inverse kinematics they are an interval of its velocity. There the accelerations are bounded, and braking
    distances are kept, only if `acceleration` or `braking` is given.

    Attributes:
        lower, upper: Least and greatest positions, shape (na,), rad (or m); like all attributes read-only, and known
            once a controller has the limits.
        velocity: Greatest velocities, shape (na,), rad/s (or m/s).
        acceleration: Greatest accelerations, shape (na,), rad/s² (or m/s²).
        braking: Deceleration that is available in both directions, shape (na,), rad/s² (or m/s²). For a drive that is
            weaker in one direction it is that of the weaker direction. A position bound that the drive has no torque to
            keep is left out.
    """

    reads = "kinematics"
    lower: Array = result("_lower", OPTIONS)
    upper: Array = result("_upper", OPTIONS)
    velocity: Array = result("_fastest", OPTIONS)
    acceleration: Array = result("_most_acceleration", OPTIONS)
    braking: Array = result("_least_braking", OPTIONS)

    @checked
    def __init__(
        self,
        *,
        position: bool = True,
        velocity: bool = True,
        acceleration: Annotated[PositiveNumbers, "rad/s²"] | None = None,
        braking: Annotated[PositiveNumbers, "rad/s²"] | None = None,
        margin: Annotated[NonNegative, "rad"] = 1e-3,
        velocity_ratio: Ratio = 1.0,
        joints: str | Sequence[str] | None = None,
    ) -> None:
        """Choose the bounds.

        Args:
            position: Keep the position limits of the model by a viable braking law: the bound holds as long as the
                joint can be decelerated by `braking`.
            velocity: Keep the velocity limits of the model.
            acceleration: Largest acceleration, rad/s² (or m/s²), scalar or shape (na,); unlimited when None.
            braking: Deceleration that is always available, rad/s² (or m/s²), scalar or shape (na,). When None, it is
                the acceleration limit, as far as there is torque for it. Without an acceleration limit it is what 30 %
                of the braking torque limit gives to the inertia of the joint, in the posture at which the limits are
                added, and at most 100 rad/s². The other 70 % are left for gravity and contact forces.
            margin: Distance from the position limits, rad (or m), for the tolerance of the solver.
            velocity_ratio: Share of the velocity limit that may be used, in (0, 1].
            joints: Names of the joints that are limited; all when None.
        """
        self.name, self.dim = "joint limits", 0
        self._joints = None if joints is None else names_in("joints of joint limits", joints)
        self._use_position, self._use_velocity = position, velocity
        self._acceleration, self._braking = acceleration, braking
        self._margin, self._ratio = margin, velocity_ratio

    @checked
    def bind(self, robot: Robot) -> None:
        """Take the limits from the model."""
        self.dim = na = robot.na
        self._rows: Array | None = None  # that have been filled
        self._free: NDArray[np.intp] | None = None  # joints without limits
        if self._joints is not None:
            self._free = np.setdiff1d(np.arange(na), [robot.joint_index(joint) for joint in self._joints])
        self._most_acceleration = np.full(na, np.inf)
        inertia = np.diag(robot.mass_matrix)[robot.base_dof :]
        # Row 0 is for the upper bounds, which negative torques keep, row 1 for the lower ones.
        torque = np.maximum(np.array([-robot.torque_lower, robot.torque_upper]), 0.0)
        brakes = np.minimum(100.0, BRAKING_SHARE * torque / inertia)
        if self._acceleration is not None:
            self._most_acceleration = for_joints("acceleration of joint limits", self._acceleration, robot)
            brakes = np.minimum(self._most_acceleration, torque / inertia)
        stop = self._most_acceleration  # of inverse kinematics, which knows no torques
        if self._braking is not None:
            stop = for_joints("braking of joint limits", self._braking, robot)
            brakes = np.where(brakes > 0.0, stop, 0.0)
        self._brakes, self._least_braking = brakes, brakes.min(axis=0)
        if (brakes > self._most_acceleration).any():
            raise InputError(
                f"braking deceleration {brakes.max(axis=0)} must not exceed the acceleration limit "
                f"{self._most_acceleration} rad/s²"
            )
        margin = np.minimum(self._margin, 0.5 * (robot.position_upper - robot.position_lower))
        self._lower, self._upper = robot.position_lower + margin, robot.position_upper - margin
        self._fastest = self._ratio * robot.velocity_limit
        # Row 0 holds the upper bounds, row 1, with changed signs, the lower ones: arrays of one shape take NumPy half
        # the time.
        self._twice_velocity, self._back = np.array([self._fastest, self._fastest]), -self._fastest
        self._greatest = None
        if np.isfinite(self._most_acceleration).any():
            self._greatest = np.array([self._most_acceleration, self._most_acceleration])
        self._distance, self._rate = np.zeros((2, na)), np.zeros((2, na))
        self._positions, self._velocities = robot.q[robot.nq - na :], robot.v[robot.nv - na :]
        self._names, self._slides = robot.joint_names, robot.slides
        self._dt = 0.0
        self._period = 0.0  # of inverse kinematics
        self._bound, self._reached = np.zeros((2, na)), np.zeros(na)
        self._stops = None  # greatest acceleration and braking in inverse kinematics, where they are bounded
        if self._acceleration is not None or self._braking is not None:
            self._stops = (
                np.array([self._most_acceleration, self._most_acceleration]),
                np.array([stop, stop]),
            )

    def _release(self, lower: Array, upper: Array) -> None:
        """Take the bounds of joints away that are not limited."""
        if self._free is not None:
            lower[self._free], upper[self._free] = -np.inf, np.inf

    def _place_rows(self, rows: Array) -> None:
        """Make each row a joint, once."""
        if rows is not self._rows:
            self._rows = rows
            rows[:] = 0.0
            rows[:, rows.shape[1] - self.dim :] = np.eye(self.dim)

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the acceleration interval of every joint, rad/s²; see `Limit.write`."""
        self._place_rows(rows)
        if dt != self._dt:
            self._dt = dt
            fastest = self._twice_velocity if self._use_velocity else np.inf
            self._law, self._least = BrakingLaw(self._brakes, dt, fastest), -self._brakes
            if (self._brakes <= 0.0).any():
                self._least = np.where(self._brakes > 0.0, self._least, np.inf)
            self._per_period = scalar(1.0 / dt)
        rate, distance = self._rate, self._distance
        rate[0] = self._velocities
        np.negative(self._velocities, out=rate[1])
        if self._use_position:
            np.subtract(self._upper, self._positions, out=distance[0])
            np.subtract(self._positions, self._lower, out=distance[1])
            bound = self._law(distance, rate)
            if self._use_velocity:
                np.minimum(bound, self._twice_velocity, out=bound)
        elif self._use_velocity:
            bound = self._twice_velocity.copy()
        else:
            bound = np.full_like(rate, np.inf)
        bound -= rate
        bound *= self._per_period
        if self._greatest is not None:
            np.minimum(bound, self._greatest, out=bound)
        np.maximum(bound, self._least, out=bound)
        upper[:] = bound[0]
        np.negative(bound[1], out=lower)
        # Where neither bound is beyond zero they cannot cross.
        flat = bound.reshape(-1)
        if not flat[flat.argmin()] >= 0.0:
            crossed = upper < lower
            lower[crossed] = upper[crossed] = 0.5 * (lower + upper)[crossed]
        self._release(lower, upper)

    def violation(self, row: int, size: float) -> str:
        """Return by how far a joint is outside its bounds; see `Limit.violation`."""
        return f"{self._names[row]} by {size:.3g} {'m' if self._slides[row] else 'rad'}"

    def write_step(self, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the distances to the position bounds, rad; see `Limit.write_step`."""
        self._place_rows(rows)
        if not self._use_position:
            lower[:], upper[:] = -np.inf, np.inf
            return
        np.subtract(self._upper, self._positions, out=upper)
        np.subtract(self._lower, self._positions, out=lower)
        np.clip(upper, -LONGEST_STEP, LONGEST_STEP, out=upper)
        np.clip(lower, -LONGEST_STEP, LONGEST_STEP, out=lower)
        self._release(lower, upper)

    def write_velocity(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the velocity interval of every joint, rad/s, that keeps the next position, q + v dt, in its bounds."""
        if rows is not self._rows:
            self._place_rows(rows)
        if dt != self._period:
            self._period, self._per_dt = dt, scalar(1.0 / dt)
            self._upper_per_dt, self._lower_per_dt = self._upper / dt, self._lower / dt
            self._change = scalar(0.0) if self._stops is None else dt * self._stops[0]
        if self._use_position and self._use_velocity and self._stops is None and self._free is None:
            np.multiply(self._positions, self._per_dt, out=self._reached)
            np.subtract(self._upper_per_dt, self._reached, out=upper)
            np.subtract(self._lower_per_dt, self._reached, out=lower)
            if upper[upper.argmin()] >= 0.0 >= lower[lower.argmax()]:  # every joint is inside
                np.minimum(upper, self._fastest, out=upper)
                np.maximum(lower, self._back, out=lower)
                return
        distance, bound = self._distance, self._bound
        if self._use_position:
            np.subtract(self._upper, self._positions, out=distance[0])
            np.subtract(self._positions, self._lower, out=distance[1])
            np.multiply(distance, self._per_dt, out=bound)
            if self._stops is not None:
                bound[:] = stopping_velocity(np.maximum(distance, _ZERO), self._stops[1], dt)
            flat, left = bound.reshape(-1), distance.reshape(-1)
            outside = not left[left.argmin()] >= 0.0
            if outside:
                beyond = distance < 0.0
                bound[beyond] = np.maximum(distance / max(dt, RECOVERY_TIME), -self._twice_velocity)[beyond]
        else:
            bound.fill(np.inf)
            flat = bound.reshape(-1)
        if self._use_velocity:
            np.minimum(bound, self._twice_velocity, out=bound)
        if self._stops is not None:
            rate = self._rate
            rate[0] = self._velocities
            np.negative(self._velocities, out=rate[1])
            np.minimum(bound, rate + self._change, out=bound)
            np.maximum(bound, rate - self._change, out=bound)
        upper[:] = bound[0]
        np.negative(bound[1], out=lower)
        if not flat[flat.argmin()] >= 0.0:
            crossed = upper < lower
            lower[crossed] = upper[crossed] = 0.5 * (lower + upper)[crossed]
        self._release(lower, upper)
