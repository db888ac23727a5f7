"""`StiffnessActuator`: actuator of a variable sole, from commanded to actual stiffness."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from wbc.core.errors import InputError, finite_scalar, non_negative
from wbc.core.settings import NonNegative, settings


@dataclass(frozen=True, slots=True)
class StiffnessState:
    """State of a stiffness actuator, Nm/rad.

    Attributes:
        commanded: Last command.
        reference: Command after the rate limit.
        actual: Stiffness of the sole's springs; the measured value.
    """

    commanded: float
    reference: float
    actual: float


@settings
class StiffnessActuator:
    """Rate limit followed by a first-order lag, integrated exactly.

    The reference moves towards the command at no more than `rate_limit`; the actual stiffness a follows the
    reference r with T da/dt = r − a. Both have closed forms over an interval of constant command, so the result does
    not depend on the time step.

    Attributes:
        rate_limit: Largest |dr/dt|, Nm/rad/s; infinite for none.
        time_constant: T, s; 0 for none.
        low: Smallest stiffness, Nm/rad.
        high: Largest stiffness, Nm/rad; infinite for no limit.

    The paper's simulation changes the stiffness at once at 75 % of the swing (`StiffnessActuator.instantaneous`).
    The defaults cross the whole range in the remaining 0.2 s of a swing of 0.8 s: 0.1 s of ramp, and 0.1 s, five time
    constants, until the error is 0.11 Nm/rad. At half the rate the ramp takes 0.2 s and the error is 8 Nm/rad when the
    foot lands.

    Source: range 0–80 Nm/rad from Table I of the paper; rate and lag are chosen here and stand for no existing
    actuator.
    """

    rate_limit: Annotated[float, Field(gt=0.0, allow_inf_nan=True), "Nm/rad/s"] = 800.0
    time_constant: Annotated[NonNegative, "s"] = 0.02
    low: Annotated[NonNegative, "Nm/rad"] = 0.0
    high: Annotated[float, Field(gt=0.0, allow_inf_nan=True), "Nm/rad"] = 80.0

    def __post_init__(self) -> None:
        if not self.high > self.low:
            raise InputError(f"high (Nm/rad) must exceed low, {self.low:g}, got {self.high:g}")

    @classmethod
    def instantaneous(cls, low: float = 0.0, high: float = 80.0) -> StiffnessActuator:
        """Return an actuator whose actual stiffness is always the commanded one, as in the paper."""
        return cls(math.inf, 0.0, low, high)

    def check(self, stiffness: float) -> float:
        """Return a commanded stiffness, Nm/rad, if it is within the range.

        Raises:
            InputError: Not a number or outside [low, high].
        """
        return finite_scalar("commanded sole stiffness (Nm/rad)", stiffness, low=self.low, high=self.high)

    def at_rest(self, stiffness: float) -> StiffnessState:
        """Return the state after a long time at one command, Nm/rad.

        Raises:
            InputError: Not a number or outside [low, high].
        """
        k = self.check(stiffness)
        return StiffnessState(k, k, k)

    def advance(self, state: StiffnessState, command: float, duration: float) -> StiffnessState:
        """Return the state after a command was held for some time.

        Args:
            state: State at the start.
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
        """Return the output of the first-order lag behind the ramp start + slope · t, in closed form."""
        if self.time_constant == 0.0:
            return start + slope * duration
        lag = slope * self.time_constant
        return (
            start + slope * duration - lag + (actual - start + lag) * math.exp(-duration / self.time_constant)
        )
