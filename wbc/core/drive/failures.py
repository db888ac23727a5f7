"""Failures of ticks: the reaction to them, and their record."""

from __future__ import annotations

import logging
from typing import Annotated

from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Positive, settings

logger = logging.getLogger(__name__)


@settings
class FailurePolicy:
    """Reaction to ticks without a solution or with a measurement that cannot be used.

    The last good command is held while the motion is damped; when failures continue, the robot is stopped: position
    control freezes its references, torque control only damps. A stopped control stays stopped until `reset`.

    Attributes:
        damping_time: Time constant with which reference velocities decay while a command is held, s.
        joint_damping: Damping of a joint in torque control over its torque limit, s/rad.
        stop_after: Time of uninterrupted failure after which the robot is stopped, s.
    """

    damping_time: Annotated[Positive, "s"] = 0.05
    joint_damping: Annotated[NonNegative, "s/rad"] = 0.02
    stop_after: Annotated[NonNegative, "s"] = 0.1


class FailureRecord:
    """Record of the failed ticks of a run.

    Attributes:
        policy: Reaction to failures.
        damping: Damping of the joints by this policy, shape (na,), Nms/rad (or Ns/m).
        count: Number of failed ticks so far.
        reason: Reason of the last failure; of failures in successive ticks, that of the first.
    """

    def __init__(self, policy: FailurePolicy, torque_limit: Array, dt: float) -> None:
        """Begin without failures of a robot with these limits, shape (na,), Nm; dt is the control period, s."""
        self.policy, self._dt, self.count = policy, dt, 0
        self.damping = policy.joint_damping * torque_limit
        self.reset()

    def reset(self) -> None:
        """Begin anew; the count goes on."""
        self._row, self.reason = 0, ""

    @property
    def failing(self) -> bool:
        """True if the last tick has failed."""
        return self._row > 0

    @property
    def stopped(self) -> bool:
        """True after failures have gone on for too long; `reset` starts again."""
        return self._row * self._dt > self.policy.stop_after

    def good(self) -> None:
        """End a row of failures: a tick has a command of its law."""
        self._row = 0

    def add(self, reason: str, error: Exception | None = None) -> None:
        """Count a failed tick, and log the first of a row and the stop."""
        stopped = self.stopped
        self.count += 1
        self._row += 1
        if self._row == 1 or self.stopped != stopped:
            self.reason = reason
            state = "; stopped" if self.stopped else "; command held"
            logger.error("tick failed (%s)%s", reason, state, exc_info=error)
