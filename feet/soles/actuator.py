"""The actuator that sets the stiffness of a sole: how the actual value follows the commanded one."""

from __future__ import annotations

import math
from dataclasses import dataclass

from wbc.core.errors import InputError, finite_scalar, non_negative


@dataclass(frozen=True, slots=True)
class StiffnessState:
    """State of a stiffness actuator, Nm/rad.

    Attributes:
        commanded: Last command.
        reference: Command after the rate limit.
        actual: What the springs of the sole have; the value that is measured.
    """

    commanded: float
    reference: float
    actual: float


@dataclass(frozen=True)
class StiffnessActuator:
    """Rate limit followed by a first-order lag, integrated exactly.

    The reference moves towards the command at no more than `rate_limit`; the actual stiffness a follows the
    reference r with T da/dt = r − a. Both have closed forms over any interval with a constant command, so the
    result does not depend on how the interval is cut into steps.

    Attributes:
        rate_limit: Largest |dr/dt|, Nm/rad/s; infinite for none.
        time_constant: T, s; 0 for none.
        low: Least stiffness, Nm/rad.
        high: Greatest stiffness, Nm/rad; infinite for no limit.

    The paper's simulation changes the stiffness at once at 75 % of the swing (`StiffnessActuator.instantaneous`).
    The defaults cross the whole range in the 0.2 s that are left then of a swing of 0.8 s: 0.1 s of ramp, and
    0.1 s, five time constants, until what is missing has shrunk to 0.11 Nm/rad. At half the rate the ramp alone
    takes all of it, and 8 Nm/rad are missing when the foot lands.

    Source: range 0–80 Nm/rad from Table I of the paper; rate and lag are chosen here and stand for no existing
    actuator.
    """

    rate_limit: float = 800.0
    time_constant: float = 0.02
    low: float = 0.0
    high: float = 80.0

    def __post_init__(self) -> None:
        if math.isnan(self.rate_limit) or self.rate_limit <= 0.0:
            raise InputError(f"stiffness rate limit (Nm/rad/s) must be above 0, got {self.rate_limit}")
        non_negative("stiffness time constant (s)", self.time_constant)
        non_negative("least stiffness (Nm/rad)", self.low)
        if not self.high > self.low:
            raise InputError(
                f"greatest stiffness (Nm/rad) must exceed the least, {self.low:g}, got {self.high}"
            )

    @classmethod
    def instantaneous(cls, low: float = 0.0, high: float = 80.0) -> StiffnessActuator:
        """An actuator whose actual stiffness is the commanded one, as in the paper."""
        return cls(math.inf, 0.0, low, high)

    def check(self, stiffness: float) -> float:
        """Return a stiffness that this actuator can be asked for, Nm/rad.

        Raises:
            InputError: Not a number or outside [low, high].
        """
        return finite_scalar("commanded sole stiffness (Nm/rad)", stiffness, low=self.low, high=self.high)

    def at_rest(self, stiffness: float) -> StiffnessState:
        """State after a long time at one command, Nm/rad.

        Raises:
            InputError: Not a number or outside [low, high].
        """
        k = self.check(stiffness)
        return StiffnessState(k, k, k)

    def advance(self, state: StiffnessState, command: float, duration: float) -> StiffnessState:
        """State after holding a command for a while.

        Args:
            state: Where it starts.
            command: Commanded stiffness, Nm/rad.
            duration: Seconds.

        Raises:
            InputError: The command is outside [low, high], or the duration is negative.
        """
        target = self.check(command)
        left = non_negative("duration (s)", duration)
        gap = target - state.reference
        reference, actual = state.reference, state.actual
        if math.isinf(self.rate_limit):
            reference = target
        elif gap != 0.0:
            ramp = min(left, abs(gap) / self.rate_limit)
            slope = math.copysign(self.rate_limit, gap)
            actual = self._follow(actual, reference, slope, ramp)
            reference = target if ramp < left else reference + slope * ramp
            left -= ramp
        actual = self._follow(actual, reference, 0.0, left)
        return StiffnessState(target, reference, actual)

    def _follow(self, actual: float, start: float, slope: float, duration: float) -> float:
        """First-order lag behind the ramp start + slope · t, exactly."""
        if self.time_constant == 0.0:
            return start + slope * duration
        lag = slope * self.time_constant
        return (
            start + slope * duration - lag + (actual - start + lag) * math.exp(-duration / self.time_constant)
        )
