"""Limits on a frame: its position along directions, its speed, and the direction of one of its axes."""

from __future__ import annotations

import math
import operator
from typing import Annotated

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING, Array, finite_array, read_only, scalar
from wbc.base.settings import Positive
from wbc.base.vectors import add_cross, turned
from wbc.core.frames import frame_jacobian, unit_vector
from wbc.core.limits.base import OPTIONS, RECOVERY, Barrier
from wbc.core.robot import Robot

FLAT = 0.1
"""Sine of an angle below which the direction of its change turns faster than is followed."""

_WORLD = pin.LOCAL_WORLD_ALIGNED

_NONE = (0.0, 0.0, 0.0)

_LEAST = scalar(-RECOVERY)


class FrameLimit(Barrier):
    """Base of limits on a frame; the arguments are attributes, too, read-only unless a setter says otherwise."""

    frame: str = fixed(OPTIONS)
    time_constant: float = result("_time", OPTIONS)
    reads = "kinematics"

    def __init__(self, frame: str, what: str, dim: int, name: str | None, time_constant: float = 0.1) -> None:
        """Describe the limit, by default named after frame and `what`; the time constant is in s."""
        self.frame = frame
        super().__init__(name or f"{frame} {what}", dim, time_constant=time_constant)

    @checked
    def bind(self, robot: Robot) -> None:
        """Resolve the frame."""
        super().bind(robot)
        self._id = robot.frame_id(self.frame)
        self._placement = robot.data.oMf[self._id]

    def _jacobian(self) -> Array:
        """Jacobian of the frame along the world axes, shape (6, nv)."""
        return np.asarray(frame_jacobian(self._robot.model, self._robot.data, self._id, _WORLD))

    def _acceleration(self) -> Array:
        """Acceleration at no generalised acceleration, along the world axes, shape (6,)."""
        model, data = self._robot.model, self._robot.data
        return np.asarray(pin.getFrameClassicalAcceleration(model, data, self._id, _WORLD).vector)


class FramePositionLimit(FrameLimit):
    """Limit that keeps the origin of a frame inside bounds along directions of the world: in a box, or behind a plane.

    FramePositionLimit("hand", lower=(0.2, -0.5, 0.1))
    FramePositionLimit("hand", directions=[(0.0, 0.6, 0.8)], upper=[1.2])
    """

    directions: Array = result("_axes", OPTIONS)  # of length 1

    step_unit = "m"

    @checked
    def __init__(
        self,
        frame: str,
        *,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        directions: ArrayLike | None = None,
        time_constant: Annotated[Positive, "s"] = 0.1,
        name: str | None = None,
    ) -> None:
        """Describe the limit.

        Args:
            frame: Frame of the robot.
            lower: Smallest coordinate along each direction, shape (n,), m; −inf or None where there is no bound.
            upper: Largest coordinate along each direction, shape (n,), m; inf or None where there is no bound.
            directions: Vectors in the world, of any length, shape (n, 3); the three world axes when None.
            time_constant: Time constant of the approach to a bound, s.
            name: Name of the limit.
        """
        axes = finite_array(
            f"directions of the limit of '{frame}'", np.eye(3) if directions is None else directions
        )
        if (
            axes.ndim != 2
            or axes.shape[1] != 3
            or not len(axes)
            or not (lengths := np.linalg.norm(axes, axis=1)).all()
        ):
            raise InputError(
                f"directions of the limit of '{frame}' must be vectors, shape (n, 3), got {axes}"
            )
        self._axes = axes / lengths[:, None]
        super().__init__(frame, "bounds", len(axes), name, time_constant)
        none = np.full(self.dim, np.inf)
        self._take(-none if lower is None else lower, none if upper is None else upper)

    def _take(self, lower: ArrayLike, upper: ArrayLike) -> None:
        """Take bounds over that are right."""
        low, high = (
            finite_array(f"{what} of limit '{self.name}'", bound, (self.dim,), unbounded=True)
            for what, bound in (("lower", lower), ("upper", upper))
        )
        if not ((low <= high).all() and (low < np.inf).all() and (high > -np.inf).all()):
            raise InputError(
                f"limit '{self.name}' needs lower bounds that are not inf and not above the upper ones, which are not "
                f"-inf, got {low} and {high}"
            )
        self._lower, self._upper = low, high

    @property
    def lower(self) -> Array:
        """Smallest coordinate along each direction, shape (n,), m, read-only; assign an array."""
        return read_only(self._lower)

    @lower.setter
    def lower(self, value: ArrayLike) -> None:
        self._take(value, self._upper)

    @property
    def upper(self) -> Array:
        """Largest coordinate along each direction, shape (n,), m, read-only; assign an array."""
        return read_only(self._upper)

    @upper.setter
    def upper(self, value: ArrayLike) -> None:
        self._take(self._lower, value)

    def measure(self, rows: Array, below: Array, above: Array) -> None:
        """Fill a row for each direction; see `Barrier.measure`."""
        place = self._axes @ self._placement.translation
        rows[:] = self._axes @ self._jacobian()[:3]
        np.subtract(place, self._lower, out=below)
        np.subtract(self._upper, place, out=above)

    def drift(self) -> Array:
        """Return the accelerations along the directions; see `Barrier.drift`."""
        return np.asarray(self._axes @ self._acceleration()[:3])


class FrameSpeedLimit(FrameLimit):
    """Limit of the linear and of the angular velocity of a frame, for each component along the world axes.

    Attributes:
        speed: Greatest components, linear then angular, shape (6,), m/s and rad/s; read-only.
    """

    speed: Array = result("_speed", OPTIONS)
    linear: float = fixed(OPTIONS)
    angular: float = fixed(OPTIONS)

    @checked
    def __init__(
        self,
        frame: str,
        *,
        linear: Annotated[Positive, "m/s"] = math.inf,
        angular: Annotated[Positive, "rad/s"] = math.inf,
        name: str | None = None,
    ) -> None:
        """Describe the limit.

        Args:
            frame: Frame of the robot.
            linear: Largest component of the linear velocity of the frame's origin, m/s; unlimited by default.
            angular: Largest component of the angular velocity, rad/s; unlimited by default.
            name: Name of the limit.
        """
        super().__init__(frame, "speed", 6, name)
        if math.isinf(linear) and math.isinf(angular):
            raise InputError(f"limit '{self.name}' needs a linear or an angular speed, got neither")
        self.linear, self.angular = linear, angular
        self._speed = np.repeat([linear, angular], 3)

    def measure(self, rows: Array, below: Array, above: Array) -> None:
        """Fill a row for each component, which has room without end; see `Barrier.measure`."""
        rows[:] = self._jacobian()
        below[:], above[:] = np.inf, np.inf

    def drift(self) -> Array:
        """Return the accelerations of the components; see `Barrier.drift`."""
        return self._acceleration()

    def _final_speeds(self, room: Array, speed: Array, out: Array) -> Array:
        out[:] = self._speed
        return out

    def _least_accelerations(self, room: Array, out: Array) -> Array:
        return _LEAST

    def _allowed_speeds(self, room: Array, out: Array) -> None:
        out[:] = self._speed


class AxisConeLimit(FrameLimit):
    """Limit that keeps an axis of a frame inside a cone about a direction of the world, such as the axis of a full cup.

    The limit is a·d ≥ cos(angle), with the axis a and the direction d, both of length 1, along the world axes. The rate
    of a·d is ω·(a × d), with the angular velocity ω of the frame.
    """

    angle: float = result("_angle", OPTIONS)
    axis: tuple[float, float, float] = result("_axis", OPTIONS)
    direction: tuple[float, float, float] = result("_direction", OPTIONS)

    @checked
    def __init__(
        self,
        frame: str,
        angle: Annotated[Positive, "rad"],
        *,
        axis: ArrayLike = (0.0, 0.0, 1.0),
        direction: ArrayLike = (0.0, 0.0, 1.0),
        time_constant: Annotated[Positive, "s"] = 0.1,
        name: str | None = None,
    ) -> None:
        """Describe the limit.

        `angle` is half the opening of the cone, rad, below π. `axis` is in the axes of the frame, `direction` in those
        of the world; both have shape (3,) and any length, and are of length 1 as attributes.
        """
        super().__init__(frame, "cone", 1, name, time_constant)
        if angle >= math.pi:
            raise InputError(f"angle of limit '{self.name}' must be below π rad, got {angle}")
        self._axis = tuple(unit_vector(f"axis of limit '{self.name}'", axis).tolist())
        self._direction = tuple(unit_vector(f"direction of limit '{self.name}'", direction).tolist())
        self._angle, self._least = angle, math.cos(angle)

    def measure(self, rows: Array, below: Array, above: Array) -> None:
        """Fill the row; see `Barrier.measure`.

        Where axis and direction are more than a right angle apart, the row is that of their angle, because a·d changes
        the less the nearer they come to opposite directions.
        """
        axis, direction = turned(self._placement.rotation.tolist(), self._axis), self._direction
        turn, cosine = add_cross(_NONE, axis, direction), sum(map(operator.mul, axis, direction))
        sine, below[0] = 1.0, cosine - self._least
        if cosine < 0.0:
            sine = math.hypot(*turn)
            below[0] = self._angle - math.atan2(sine, cosine)
            if sine < ROUNDING:  # any way is a way back
                turn = add_cross(_NONE, axis, np.eye(3)[np.abs(axis).argmin()].tolist())
            length = math.hypot(*turn)
            turn, sine = (turn[0] / length, turn[1] / length, turn[2] / length), max(sine, FLAT)
        self._now, self._sine = (axis, cosine, turn), sine
        np.dot(turn, self._jacobian()[3:], out=rows[0])
        above[:] = np.inf

    def violation(self, row: int, size: float) -> str:
        """Return the angle beyond the cone; see `Limit.violation`: `size` is a difference of cosines near the cone."""
        return f"{math.acos(max(-1.0, min(1.0, self._now[1]))) - self._angle:.3g} rad"

    def drift(self) -> Array:
        """Return the acceleration of the row; see `Barrier.drift`.

        The second derivative of a·d = cos θ is α·(a × d) + (ω × (ω × a))·d. That of −θ is (that + cos θ θ̇²) / sin θ.
        """
        (axis, cosine, turn), sine, acceleration = self._now, self._sine, self._acceleration()
        model, data = self._robot.model, self._robot.data
        spin = pin.getFrameVelocity(model, data, self._id, _WORLD).angular.tolist()
        bend = sum(map(operator.mul, add_cross(_NONE, spin, add_cross(_NONE, spin, axis)), self._direction))
        if cosine < 0.0:
            bend = (bend + cosine * sum(map(operator.mul, spin, turn)) ** 2) / sine
        return np.array([float(acceleration[3:].dot(turn)) + bend])
