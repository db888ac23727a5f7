"""Limits of joints: positions, velocities, accelerations and torques."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from wbc.base.checked import checked, result
from wbc.base.errors import InputError, names_in
from wbc.base.numbers import Array, one_or_each
from wbc.base.settings import NonNegative, PositiveNumbers, Ratio
from wbc.core.limits.base import ATTAINABLE, OPTIONS, ZERO, Barrier, Limit, Order, demands
from wbc.core.robot import Robot

BRAKING_SHARE = 0.3
"""Share of a torque limit that brakes a joint before its bounds: the rest is left for gravity and contact forces."""

RECOVERY_TIME = 0.1
"""Time constant with which a violated bound is approached again, s."""

LONGEST_STEP = 0.5
"""Greatest step of a joint in a search of inverse kinematics, rad or m: its rows are of the first order."""


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
            np.maximum(final, ZERO, out=final)
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


class JointLimits(Barrier):
    """Bounds of the position, velocity and acceleration of every actuated joint, as one interval of its acceleration.

    The interval is never empty. A joint that starts outside its limits is brought back.

    In inverse kinematics they are an interval of its velocity. There the accelerations are bounded, and braking
    distances are kept, only if `acceleration` or `braking` is given.

    Attributes:
        lower, upper: Least and greatest positions, shape (na,), rad (or m). Like all arguments, which are attributes,
            too, they are read-only. The arrays are known once a controller has the limits.
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
    position: bool = result("_use_position", OPTIONS)
    margin: float = result("_margin", OPTIONS)
    velocity_ratio: float = result("_ratio", OPTIONS)
    joints: tuple[str, ...] | None = result("_joints", OPTIONS)

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
        self._joints = None if joints is None else tuple(names_in("joints of joint limits", joints))
        if self._joints == () or (acceleration is None and not (position or velocity)):
            raise InputError(
                f"joint limits must bound something of some joint, got joints={joints}, position={position}, "
                f"velocity={velocity} and no acceleration"
            )
        self._use_position, self._use_velocity = position, velocity
        self._acceleration, self._braking = acceleration, braking
        self._margin, self._ratio = margin, velocity_ratio

    @checked
    def bind(self, robot: Robot) -> None:
        """Take the limits from the model."""
        self.dim = na = robot.na
        super().bind(robot)
        self._rows: Array | None = None  # that have been filled
        self._brakes, stop = self._brakes_of(robot)
        self._least_braking = self._brakes.min(axis=0)
        margin = np.minimum(self._margin, 0.5 * (robot.position_upper - robot.position_lower))
        self._lower, self._upper = robot.position_lower + margin, robot.position_upper - margin
        self._fastest = self._ratio * robot.velocity_limit
        self._positions, self._velocities = robot.q[robot.nq - na :], robot.v[robot.nv - na :]
        self._names, self._slides = robot.joint_names, robot.slides

        limited = np.ones(na, dtype=bool)
        if self._joints is not None:
            limited = np.isin(np.arange(na), [robot.joint_index(joint) for joint in self._joints])
        kept = limited & self._use_position
        self._low, self._high = np.where(kept, self._lower, -np.inf), np.where(kept, self._upper, np.inf)
        self._most = np.tile(np.where(limited & self._use_velocity, self._fastest, np.inf), (2, 1))
        self._braked = np.where(self._brakes > 0.0, -self._brakes, np.inf)
        self._greatest = np.tile(np.where(limited, self._most_acceleration, np.inf), (2, 1))
        self._accelerates = bool(np.isfinite(self._greatest).any())
        given = self._acceleration is not None or self._braking is not None
        self._stop = np.tile(stop, (2, 1)) if given else None

    def _brakes_of(self, robot: Robot) -> tuple[Array, Array]:
        """Return the braking towards the upper and the lower bounds, shape (2, na), and that of inverse kinematics.

        Inverse kinematics know no torques. Negative torques keep the upper bounds.
        """
        na, most = robot.na, np.full(robot.na, np.inf)
        inertia = np.diag(robot.mass_matrix)[robot.base_dof :]
        torque = np.maximum(np.array([-robot.torque_lower, robot.torque_upper]), 0.0)
        brakes = np.minimum(ATTAINABLE, BRAKING_SHARE * torque / inertia)
        if self._acceleration is not None:
            most = one_or_each("acceleration of joint limits", self._acceleration, na)
            brakes = np.minimum(most, torque / inertia)
        self._most_acceleration = stop = most
        if self._braking is not None:
            stop = one_or_each("braking of joint limits", self._braking, na)
            brakes = np.where(brakes > 0.0, stop, 0.0)
        if (brakes > most).any():
            raise InputError(
                f"braking deceleration {brakes.max(axis=0)} must not exceed the acceleration limit {most} rad/s²"
            )
        return brakes, stop

    def measure(self, rows: Array, below: Array, above: Array) -> None:
        """Fill rows and rooms, rad (or m); see `Barrier.measure`."""
        if rows is not self._rows:
            self._rows = rows
            rows[:] = 0.0
            rows[:, rows.shape[1] - self.dim :] = np.eye(self.dim)
        np.subtract(self._positions, self._low, out=below)
        np.subtract(self._high, self._positions, out=above)

    def drift(self) -> None:
        """Return nothing: the rows of joints never change."""

    def _measure(self, rows: Array, room: Array, order: Order, dt: float) -> Array | None:
        self.measure(rows, room[1], room[0])
        return self._velocities if order == "acceleration" else None

    def _take_period(self, dt: float) -> None:
        super()._take_period(dt)
        self._law = BrakingLaw(self._brakes, dt, self._most)

    def _final_speeds(self, room: Array, speed: Array, out: Array) -> Array:
        bound = self._law(room, speed)
        np.minimum(bound, self._most, out=bound)
        return np.minimum(bound, speed + self._dt * self._greatest, out=bound) if self._accelerates else bound

    def _least_accelerations(self, room: Array, out: Array) -> Array:
        return self._braked

    def _allowed_speeds(self, room: Array, out: Array) -> None:
        """Fill velocities that keep the next position, q + v dt, within its bounds."""
        bound, dt = np.multiply(room, self._per_dt, out=out), self._dt
        if self._stop is not None:
            bound[:] = np.where(
                room < np.inf, stopping_velocity(np.maximum(room, ZERO), self._stop, dt), np.inf
            )
        if (room < 0.0).any():
            back = np.maximum(room / max(dt, RECOVERY_TIME), -self._most)
            np.copyto(bound, back, where=room < 0.0)
        np.minimum(bound, self._most, out=bound)
        if self._stop is not None:
            speed, change = np.array([self._velocities, -self._velocities]), dt * self._greatest
            np.clip(bound, speed - change, speed + change, out=bound)

    def _fill(self, others: Array | None, bound: Array, lower: Array, upper: Array) -> None:
        """Fill the bounds; take the middle of those that cross."""
        super()._fill(others, bound, lower, upper)
        if demands(lower, upper):
            crossed = upper < lower
            lower[crossed] = upper[crossed] = 0.5 * (lower[crossed] + upper[crossed])

    def write_step(self, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the distances to the position bounds, rad; see `Limit.write_step`."""
        super().write_step(rows, lower, upper)
        if self._use_position:
            np.clip(upper, -LONGEST_STEP, LONGEST_STEP, out=upper)
            np.clip(lower, -LONGEST_STEP, LONGEST_STEP, out=lower)

    def violation(self, row: int, size: float) -> str:
        """Return by how far a joint is outside its bounds; see `Limit.violation`."""
        return f"{self._names[row]} by {size:.3g} {'m' if self._slides[row] else 'rad'}"


class TorqueLimits(Limit):
    """Bounds of the joint torques and of their rates.

    Attributes:
        least, most: Bounds of the torques, shape (na,), Nm; read-only, known once a controller has the limits.
        rate: Greatest rates of the torques, shape (na,), Nm/s, read-only; None for none.
    """

    least: Array = result("_least", OPTIONS)
    most: Array = result("_most", OPTIONS)
    rate: Array | None = result("_most_rate", OPTIONS)
    ratio: float = result("_ratio", OPTIONS)

    @checked
    def __init__(self, *, ratio: Ratio = 1.0, rate: Annotated[PositiveNumbers, "Nm/s"] | None = None) -> None:
        """Choose the bounds.

        Args:
            ratio: Share of the model's torque limits that may be used, in (0, 1].
            rate: Largest rate of a torque, Nm/s, scalar or shape (na,); unlimited when None.
        """
        self.name, self.dim = "torque limits", 0
        self._ratio = ratio
        self._rate = rate

    @checked
    def bind(self, robot: Robot) -> None:
        """Take the limits from the model."""
        self.dim = robot.na
        self._least, self._most = self._ratio * robot.torque_lower, self._ratio * robot.torque_upper
        self._most_rate: Array | None = None
        if self._rate is not None:
            self._most_rate = one_or_each("rate of torque limits", self._rate, robot.na)

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the torque interval of every joint, Nm; the rows are those of the QP, and stay; see `Limit.write`."""
        lower[:], upper[:] = self.interval(dt, None)

    def interval(self, dt: float, previous: Array | None) -> tuple[Array, Array]:
        """Return the least and the greatest torque of every joint, each of shape (na,), Nm; they must not be written.

        Args:
            dt: Control period, s.
            previous: Torques of the last tick, shape (na,), Nm; None before the first tick.
        """
        least, most = self._least, self._most
        if self._most_rate is None or previous is None:
            return least, most
        before, change = np.clip(previous, least, most), self._most_rate * dt
        return np.maximum(least, before - change), np.minimum(most, before + change)
