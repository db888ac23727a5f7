"""`StiffnessActuator`: actuator of a variable sole, from commanded to actual stiffness."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from wbc.base.errors import InputError
from wbc.base.numbers import finite_scalar
from wbc.base.settings import NonNegative, settings

SOFTEST, STIFFEST = 1.0, 2000.0
"""Range of the stiffness of soft and variable soles, Nm/rad per hinge."""

PAPER_STIFFEST = 80.0
"""End of the paper's range, Nm/rad (Table I); it begins at 0."""


@dataclass(frozen=True, slots=True)
class StiffnessState:
    """State of a stiffness actuator, Nm/rad."""

    commanded: float  # last command
    reference: float  # command after the rate limit
    actual: float  # stiffness of the sole's springs; the measured value


@settings
class StiffnessActuator:
    """Rate limit followed by a first-order lag in the logarithm of the stiffness, integrated exactly.

    The logarithm is used because the effect of a sole depends on the order of magnitude of its stiffness. The reference
    r moves towards the command with `rate_limit` at most. The actual stiffness a follows it by T d(log a)/dt = log r −
    log a. Both have closed forms while the command is constant, so the result does not depend on the time step.

    Attributes:
        rate_limit: Largest |d(log10 r)/dt|, decades/s; infinite for no limit.
        time_constant: Time constant T of the lag, s; 0 for no lag.
        low: Smallest stiffness, Nm/rad; above 0, except for an actuator that acts at once.
        high: Largest stiffness, Nm/rad; infinite for no limit.

    With the defaults the stiffness crosses the whole range in the last 0.2 s of a swing of 0.8 s: 0.1 s for the ramp,
    and 0.1 s (five time constants) until the error is 1 %.

    Source of the range: between 1 and 80 Nm/rad walks hardly differ (docs/feet.md), below 1 the sole hangs slack, and
        at 2,000 it is nearly rigid. Rate and lag are chosen here; they are not those of an existing actuator.
    """

    rate_limit: Annotated[float, Field(gt=0.0, allow_inf_nan=True), "decades/s"] = 33.0
    time_constant: Annotated[NonNegative, "s"] = 0.02
    low: Annotated[NonNegative, "Nm/rad"] = SOFTEST
    high: Annotated[float, Field(gt=0.0, allow_inf_nan=True), "Nm/rad"] = STIFFEST

    def __post_init__(self) -> None:
        if not self.high > self.low:
            raise InputError(f"high (Nm/rad) must exceed low, {self.low:g}, got {self.high:g}")
        if self.low == 0.0 and not self.acts_at_once:
            raise InputError(
                "low (Nm/rad) must be above 0 for an actuator with a rate limit or a lag, which are logarithmic; got 0"
            )

    @classmethod
    def instantaneous(cls, high: float = PAPER_STIFFEST) -> StiffnessActuator:
        """Return an actuator whose stiffness is always the commanded one, by default with the paper's range.

        Source: range from Table I of the paper, whose simulation changes the stiffness in one step.
        """
        return cls(math.inf, 0.0, 0.0, high)

    @property
    def acts_at_once(self) -> bool:
        """True if the actual stiffness is always the commanded one."""
        return math.isinf(self.rate_limit) and self.time_constant == 0.0

    def check(self, stiffness: float) -> float:
        """Return a commanded stiffness, Nm/rad; raise an error if it is out of range."""
        return finite_scalar("commanded sole stiffness (Nm/rad)", stiffness, low=self.low, high=self.high)

    def at_rest(self, stiffness: float) -> StiffnessState:
        """Return the state after a long time at one command, Nm/rad."""
        k = self.check(stiffness)
        return StiffnessState(k, k, k)

    def advance(self, state: StiffnessState, command: float, duration: float) -> StiffnessState:
        """Return the state after a command, Nm/rad, was held for a duration, s."""
        target = self.check(command)
        left = finite_scalar("duration (s)", duration, low=0.0)
        if self.acts_at_once:
            return StiffnessState(target, target, target)
        goal, reference, actual = (math.log10(k) for k in (target, state.reference, state.actual))
        gap = goal - reference
        if math.isinf(self.rate_limit):
            reference = goal
        elif gap != 0.0:
            ramp = min(left, abs(gap) / self.rate_limit)
            slope = math.copysign(self.rate_limit, gap)
            actual = self._follow(actual, reference, slope, ramp)
            reference = goal if ramp < left else reference + slope * ramp
            left -= ramp
        actual = self._follow(actual, reference, 0.0, left)
        return StiffnessState(
            target,
            target if reference == goal else self.within(10.0**reference),
            target if actual == goal else self.within(10.0**actual),
        )

    def within(self, stiffness: float) -> float:
        """Return the stiffness of the range that is nearest to a given one, Nm/rad."""
        return min(max(stiffness, self.low), self.high)

    def _follow(self, actual: float, start: float, slope: float, duration: float) -> float:
        """Return the output of the first-order lag behind the ramp start + slope · t, in closed form, log10."""
        if self.time_constant == 0.0:
            return start + slope * duration
        lag = slope * self.time_constant
        return (
            start + slope * duration - lag + (actual - start + lag) * math.exp(-duration / self.time_constant)
        )
