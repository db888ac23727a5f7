"""Limits: bounds that the solution must keep, written so that they cannot contradict each other.

Position, velocity and acceleration bounds of a joint are merged into one interval of its acceleration, which is
never empty. A joint that starts outside its limits is brought back instead of making the problem infeasible.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from wbc.core.errors import Array, InputError, finite_array, finite_scalar, non_negative, positive
from wbc.core.robot import Robot

RECOVERY_TIME = 0.1
"""Time constant with which a violated bound is approached again, s."""


def viable_acceleration(distance: Array, velocity: Array, braking: Array, dt: float) -> Array:
    """Greatest acceleration towards a bound after which the bound can still be kept by braking.

    The acceleration is held over one control period. After it, with velocity v⁺ and distance d⁺ left, the state must
    be viable: v⁺² ≤ 2 ā d⁺ for v⁺ > 0. If the joint turns round within the period, the point where it turns must not
    lie beyond the bound. From a viable state the result is never below −ā, so that braking at ā always suffices.

    Args:
        distance: Way left to the bound, shape (n,), rad; negative beyond it.
        velocity: Velocity towards the bound, shape (n,), rad/s.
        braking: Deceleration ā that is always available, shape (n,), rad/s².
        dt: Control period, s.

    Returns:
        Upper bound of the acceleration towards the bound, shape (n,), rad/s²; not yet clipped to ±ā.

    Source: Del Prete, "Joint position and velocity bounds in discrete-time acceleration/torque control of robot
    arms", RA-L 3(1), 2018, section IV; the case of turning within the period is ours.
    """
    # (v + a dt)² = 2 ā (d − v dt − a dt²/2), solved for v⁺ = v + a dt, which does not cancel for small dt.
    half = 0.5 * braking * dt
    final = np.sqrt(np.maximum(half * half + braking * (2.0 * distance - velocity * dt), 0.0)) - half
    bound = (final - velocity) / dt
    turning = final < 0.0
    outside = distance <= 0.0
    if turning.any():
        safe = np.where(outside, 1.0, distance)
        bound = np.where(turning, -velocity * np.abs(velocity) / (2.0 * safe), bound)
    if outside.any():
        bound = np.where(outside, (distance / RECOVERY_TIME - velocity) / dt, bound)
    return bound


class JointLimits:
    """Position, velocity and acceleration bounds of every actuated joint, as one interval of its acceleration."""

    def __init__(
        self,
        *,
        position: bool = True,
        velocity: bool = True,
        acceleration: ArrayLike | None = None,
        margin: float = 1e-3,
        velocity_ratio: float = 1.0,
    ) -> None:
        """Choose which bounds to keep.

        Args:
            position: Keep the position limits of the model, by a braking law that is viable: with the acceleration
                bound below, the position bound can always still be kept.
            velocity: Keep the velocity limits of the model.
            acceleration: Acceleration bound, rad/s² (or m/s²), scalar or shape (na,). When None, what 30 % of the
                torque limit gives to the joint's inertia in half-sitting, at most 100 rad/s².
            margin: Distance kept from the position limits, rad (or m); room for the solver's tolerance.
            velocity_ratio: Part of the velocity limit that may be used, in (0, 1].

        Raises:
            InputError: A value out of range.
        """
        self.name = "joint limits"
        self._use_position, self._use_velocity = bool(position), bool(velocity)
        self._acceleration = acceleration
        self._margin = non_negative("margin of joint limits (rad)", margin)
        self._ratio = finite_scalar(
            "velocity ratio of joint limits", velocity_ratio, low=0.0, high=1.0, open_low=True
        )

    def bind(self, robot: Robot) -> None:
        """Take the limits from the model.

        Raises:
            InputError: An acceleration bound that is not positive or of the wrong shape.
        """
        self._robot = robot
        na = robot.na
        if self._acceleration is None:
            inertia = np.diag(robot.mass_matrix)[6:]
            self.acceleration = np.minimum(100.0, 0.3 * np.minimum(robot.torque_limit, 1e6) / inertia)
        else:
            bound = finite_array("acceleration bound of joint limits (rad/s²)", self._acceleration)
            if bound.shape not in ((), (na,)) or (bound <= 0.0).any():
                raise InputError(f"acceleration bound must be positive, scalar or shape ({na},), got {bound}")
            self.acceleration = np.array(np.broadcast_to(bound, (na,)))
        middle = 0.5 * (robot.position_lower + robot.position_upper)
        self.lower = np.minimum(robot.position_lower + self._margin, middle)
        self.upper = np.maximum(robot.position_upper - self._margin, middle)
        self.velocity = self._ratio * robot.velocity_limit
        # Both directions are computed as one vector: first towards the upper bounds, then towards the lower ones.
        self._sign = np.concatenate([np.ones(na), -np.ones(na)])
        self._offset = np.concatenate([self.upper, -self.lower])
        self._speed = np.concatenate([self.velocity, self.velocity])
        self._braking = np.concatenate([self.acceleration, self.acceleration])
        self._state = np.zeros(2 * na)
        self._rate = np.zeros(2 * na)

    def write(self, dt: float, lower: Array, upper: Array) -> None:
        """Fill the acceleration interval of every joint.

        Args:
            dt: Control period, s.
            lower: To fill, shape (na,), rad/s².
            upper: To fill, shape (na,), rad/s².
        """
        robot = self._robot
        na = robot.na
        q, v = robot.q[7:], robot.v[6:]
        rate = self._rate
        rate[:na] = v
        np.negative(v, out=rate[na:])
        bound = self._braking
        if self._use_velocity:
            bound = np.minimum(bound, (self._speed - rate) / dt)
        if self._use_position:
            state = self._state
            state[:na] = q
            np.negative(q, out=state[na:])
            bound = np.minimum(bound, viable_acceleration(self._offset - state, rate, self._braking, dt))
        bound = np.maximum(bound, -self._braking)
        upper[:] = bound[:na]
        np.negative(bound[na:], out=lower)
        crossed = lower > upper
        if crossed.any():
            middle = 0.5 * (lower + upper)
            lower[crossed] = upper[crossed] = middle[crossed]


class TorqueLimits:
    """Bounds of the joint torques, and of how fast they change."""

    def __init__(self, *, ratio: float = 1.0, rate: ArrayLike | None = None) -> None:
        """Choose the bounds.

        Args:
            ratio: Part of the model's torque limits that may be used, in (0, 1].
            rate: Greatest change of torque per second, Nm/s, scalar or shape (na,); unlimited when None.

        Raises:
            InputError: A value out of range.
        """
        self.name = "torque limits"
        self._ratio = finite_scalar("ratio of torque limits", ratio, low=0.0, high=1.0, open_low=True)
        self._rate = rate

    def bind(self, robot: Robot) -> None:
        """Take the limits from the model.

        Raises:
            InputError: A rate that is not positive or of the wrong shape.
        """
        self.limit = self._ratio * robot.torque_limit
        self.rate: Array | None = None
        if self._rate is not None:
            rate = finite_array("torque rate (Nm/s)", self._rate)
            if rate.shape not in ((), (robot.na,)) or (rate <= 0.0).any():
                raise InputError(f"torque rate must be positive, scalar or shape ({robot.na},), got {rate}")
            self.rate = np.array(np.broadcast_to(rate, (robot.na,)))

    def write(self, dt: float, previous: Array | None, lower: Array, upper: Array) -> None:
        """Fill the torque interval of every joint.

        Args:
            dt: Control period, s.
            previous: Torques of the last tick, shape (na,), Nm; None at the first one.
            lower: To fill, shape (na,), Nm.
            upper: To fill, shape (na,), Nm.
        """
        upper[:] = self.limit
        np.negative(self.limit, out=lower)
        if self.rate is not None and previous is not None:
            before = np.clip(previous, lower, upper)
            np.minimum(upper, before + self.rate * dt, out=upper)
            np.maximum(lower, before - self.rate * dt, out=lower)


class RowLimit(ABC):
    """Base of limits on what joints do together: lower ≤ rows · acceleration ≤ upper.

    Attributes:
        name: How status tables and error messages call it.
        dim: Number of rows, fixed.
    """

    name: str
    dim: int

    @abstractmethod
    def bind(self, robot: Robot) -> None:
        """Resolve names against the robot."""

    @abstractmethod
    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the rows.

        Args:
            dt: Control period, s.
            rows: To fill, shape (dim, nv).
            lower: To fill, shape (dim,); −inf where there is no bound.
            upper: To fill, shape (dim,); inf where there is no bound.
        """


def damped_bound(distance: Array, velocity: Array, dt: float, time_constant: float) -> Array:
    """Greatest acceleration towards a bound that lets the speed towards it be distance / time constant at most.

    Args:
        distance: Way left to the bound, shape (n,); negative beyond it, which asks for a way back.
        velocity: Velocity towards the bound, shape (n,).
        dt: Control period, s.
        time_constant: Of the approach, s.

    Returns:
        Upper bound of the acceleration, shape (n,).

    Source: velocity damper of Faverjon & Tournassoud, ICRA 1987, held at the end of the period.
    """
    return (distance / time_constant - velocity) / dt


def limit_time_constant(value: float) -> float:
    """Validate the time constant of a damped limit, s.

    Raises:
        InputError: Not positive.
    """
    return positive("time constant of a limit (s)", value)
